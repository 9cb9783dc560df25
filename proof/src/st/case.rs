//! A program with what happens to it: rounds, the time between them, and values that come from outside.

use super::moments;
use super::spelling::Style;
use super::tree::{Class, Def, Kind, Source, Ty, Value};
use crate::random::Random;

/// A value that a part of a global variable gets from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// The part's path, as in a dump.
    pub name: String,
    /// Position of the global, then of its parts.
    pub at: Vec<usize>,
    /// The value.
    pub value: Value,
    /// The value as an IEC literal.
    pub literal: String,
}

/// What happens before a round.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Round {
    /// Time since the round before, in nanoseconds.
    pub wait_ns: i64,
    /// Values from outside.
    pub inputs: Vec<Input>,
    /// The first bytes of %I; those behind are 0.
    pub image: Vec<u8>,
}

/// A program and its rounds.
#[derive(Debug, Clone)]
pub struct Case {
    /// The program.
    pub source: Source,
    /// Its rounds.
    pub rounds: Vec<Round>,
}

/// Bytes of %I that come from outside; the generator puts no variable behind them.
const IMAGE_BYTES: usize = 64;
/// Most values that come from outside before one round.
const MOST_INPUTS: usize = 3;

impl Case {
    /// A program with `rounds` rounds that a seed decides. The first begins at 0 with the initial values.
    #[must_use]
    pub fn new(source: Source, seed: u64, rounds: usize) -> Case {
        let mut random = Random::new(seed ^ 0x696E_7075_7473);
        let mut places = Vec::new();
        for (number, var) in source.globals.iter().enumerate() {
            if var.class == Class::Var && !var.gone && !var.reserved && var.at.is_none() {
                parts(&source, &var.name, var.ty, vec![number], &mut places);
            }
        }
        let mut made = Vec::new();
        for round in 0..rounds {
            let image = (0..IMAGE_BYTES).map(|_| if random.chance(30) { 0xFF } else { random.bits() as u8 }).collect();
            let mut next = Round { image, ..Round::default() };
            if round > 0 {
                next.wait_ns = random.one_of([0, 1, 10_000_000, 7_500_000, 20_000_001]);
                for _ in 0..random.below(MOST_INPUTS + 1) {
                    let Some((name, ty, at)) = random.pick(&places).cloned() else { break };
                    let value = value(&source, ty, &mut random);
                    let literal = Style::new(0).literal(&source, ty, &value, false);
                    next.inputs.push(Input { name, at, value, literal });
                }
            }
            made.push(next);
        }
        Case { source, rounds: made }
    }

    /// What happens from outside, one line for each round in which something does.
    #[must_use]
    pub fn inputs_text(&self) -> String {
        inputs_text(&self.rounds)
    }
}

/// The number of rounds and what comes from outside before them.
#[must_use]
pub fn inputs_text(rounds: &[Round]) -> String {
    let mut text = match rounds.len() {
        1 => "1 round\n".to_string(),
        count => format!("{count} rounds\n"),
    };
    for (number, round) in rounds.iter().enumerate() {
        let mut events = Vec::new();
        if round.wait_ns != 0 {
            events.push(format!("{} ns later", round.wait_ns));
        }
        events.extend(round.inputs.iter().map(|input| format!("{} := {}", input.name, input.literal)));
        let bytes = round.image.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        if bytes > 0 {
            let bytes: Vec<String> = round.image[..bytes].iter().map(|byte| format!("{byte:02X}")).collect();
            events.push(format!("%I begins with the bytes {}", bytes.join(" ")));
        }
        if !events.is_empty() {
            text += &format!("before round {number}: {}\n", events.join("; "));
        }
    }
    text
}

/// All parts of a variable that are no composites, with their paths.
fn parts(source: &Source, path: &str, ty: Ty, at: Vec<usize>, found: &mut Vec<(String, Ty, Vec<usize>)>) {
    let Ty::N(id) = ty else {
        found.push((path.to_string(), ty, at));
        return;
    };
    let next = |part: usize| at.iter().copied().chain([part]).collect();
    match &source.types[id].def {
        Def::Struct(fields) => {
            for (part, (name, ty, _)) in fields.iter().enumerate() {
                parts(source, &format!("{path}.{name}"), *ty, next(part), found);
            }
        }
        Def::Array(dims, element) => {
            for part in 0..Source::elements(dims) {
                let mut rest = part;
                let mut indices = Vec::new();
                for (low, high) in dims.iter().rev() {
                    let count = (high - low + 1) as usize;
                    indices.insert(0, (low + (rest % count) as i32).to_string());
                    rest /= count;
                }
                parts(source, &format!("{path}[{}]", indices.join(", ")), *element, next(part), found);
            }
        }
        Def::Enum(..) | Def::Subrange(..) => found.push((path.to_string(), ty, at)),
        // What a block remembers is its own business.
        Def::Block(_) | Def::Standard(_) => {}
    }
}

/// A value for a part of a variable.
pub(crate) fn value(source: &Source, ty: Ty, random: &mut Random) -> Value {
    match ty {
        Ty::K(Kind::Real) => Value::Real(finite(random) as f32),
        Ty::K(Kind::Lreal) => Value::Lreal(finite(random)),
        Ty::K(kind) if kind.is_moment() => Value::Int(moments::sayable(kind, i128::from(random.integer(64)))),
        Ty::K(kind) => Value::Int(kind.wrap(i128::from(random.integer(64)))),
        Ty::S(capacity) | Ty::W(capacity) => {
            let count = random.below(usize::from(capacity.min(12)) + 1);
            let last = if ty.is_wide() { 0x20AC } else { 0xE9 };
            let units = [b'a', b'A', b'0', b'7', b'-', b'$'].map(u16::from);
            Value::Str(
                (0..count)
                    .map(|_| random.pick(&units).copied().filter(|_| random.chance(86)).unwrap_or(last))
                    .collect(),
            )
        }
        Ty::N(id) => match &source.types[id].def {
            Def::Enum(_, values) => Value::Int(random.pick(values).map_or(0, |(_, value)| i128::from(*value))),
            Def::Subrange(_, low, high) => {
                let span = (high - low).unsigned_abs().saturating_add(1);
                Value::Int(low + i128::from(random.bits()).rem_euclid(i128::try_from(span).unwrap_or(i128::MAX)))
            }
            other => panic!("no input of {other:?}"),
        },
    }
}

/// A number that a literal can say in both widths.
fn finite(random: &mut Random) -> f64 {
    let value = random.float();
    if (value as f32).is_finite() { value } else { 2.5 }
}
