//! The oracle of generated Structured Text: compiled and run in both engines, against the tree run directly.
#![allow(dead_code, reason = "each user takes its part")]

use std::collections::BTreeMap;
use std::sync::Arc;

use khz_bytecode::container::{Container, SystemVariableKind};
use khz_bytecode::trap::TrapCode;
use khz_bytecode::verify::verify;
use khz_frontend::{CompileOptions, SourceInput};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::trap::Trap;
use khz_machine::variables::{Variable, VariableTable, VariableValue};
use khz_proof::campaign::Figures;
use khz_proof::random::Random;
use khz_proof::st::evaluate::{Evaluator, Stop};
use khz_proof::st::generate;
use khz_proof::st::print::print;
use khz_proof::st::shrink::shrink;
use khz_proof::st::tree::{Def, Kind, Source, Ty, Value};

/// Scans of a program.
pub const SCANS: u64 = 4;
/// What the compiler may say of a generated program: constants alone divide by zero, index outside the bounds, or leave a subrange.
const REFUSED: [&str; 3] = ["refused T0007", "refused T0006", "refused T0008"];
const STEPS: u64 = 100_000;
const IMAGE_LIMIT_BYTES: u64 = 1 << 22;

/// What a search reached.
#[derive(Default)]
pub struct Tally {
    pub programs: u64,
    pub scans: u64,
    pub values: u64,
    pub too_long: u64,
    pub unused: u64,
    /// Refused because the compiler saw a trap that constants alone make, which the generator does not look for.
    pub refused: u64,
    pub traps: BTreeMap<String, u64>,
    /// Programs with a word of the language in their text.
    pub words: BTreeMap<String, u64>,
}

impl Figures for Tally {
    fn merge(&mut self, later: Self) {
        self.programs += later.programs;
        self.scans += later.scans;
        self.values += later.values;
        self.too_long += later.too_long;
        self.unused += later.unused;
        self.refused += later.refused;
        later.traps.into_iter().for_each(|(name, count)| *self.traps.entry(name).or_default() += count);
        later.words.into_iter().for_each(|(name, count)| *self.words.entry(name).or_default() += count);
    }
}

impl Tally {
    pub fn report(&self) -> String {
        format!(
            "{} programs, {} scans, {} values compared, {} without an end in time, {} values of unused globals, {} refused for a constant trap\ntraps {:?}\nprograms with {:?}",
            self.programs, self.scans, self.values, self.too_long, self.unused, self.refused, self.traps, self.words
        )
    }

    fn words(&mut self, text: &str) {
        let mut found: Vec<&str> = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
        found.sort_unstable();
        found.dedup();
        for word in
            found.into_iter().filter(|word| word.len() > 1 && word.starts_with(|c: char| c.is_ascii_uppercase()))
        {
            let own =
                ["Enum", "Struct", "Array", "Range", "Block", "Holder"].iter().find(|own| word.starts_with(**own));
            let is_hex = word != "ADD" && word.bytes().all(|byte| byte.is_ascii_hexdigit());
            if (word == word.to_ascii_uppercase() && !is_hex) || own.is_some() {
                *self.words.entry(own.map_or(word, |own| own).to_string()).or_default() += 1;
            }
        }
    }
}

/// A difference: what kind, for the shrinker, and the words for people.
#[derive(Debug)]
pub struct Found {
    pub class: String,
    pub text: String,
}

fn found(class: impl Into<String>, text: impl Into<String>) -> Found {
    Found { class: class.into(), text: text.into() }
}

struct Machine {
    name: &'static str,
    engine: Box<dyn Engine>,
    image: Image,
}

/// The one NaN for all.
fn same(source: &Source, ty: Ty, wanted: &Value, got: &VariableValue) -> bool {
    match (wanted, got) {
        (Value::Int(a), VariableValue::Bool(b)) => *a == i128::from(*b),
        (Value::Int(a), VariableValue::Signed(b)) => *a == i128::from(*b),
        (Value::Int(a), VariableValue::Unsigned(b)) => *a == i128::from(*b),
        (Value::Int(a), VariableValue::Time(_, b)) => *a == i128::from(*b),
        (Value::Real(a), VariableValue::Real(b)) if a.is_nan() => b.to_bits() == 0xFFC0_0000,
        (Value::Real(a), VariableValue::Real(b)) => a.to_bits() == b.to_bits(),
        (Value::Lreal(a), VariableValue::Lreal(b)) if a.is_nan() => b.to_bits() == 0xFFF8_0000_0000_0000,
        (Value::Lreal(a), VariableValue::Lreal(b)) => a.to_bits() == b.to_bits(),
        (Value::Str(a), VariableValue::String(b)) => a == b,
        (Value::Int(a), VariableValue::Named(name)) => match ty {
            Ty::N(id) => match &source.types[id].def {
                Def::Enum(values) => values
                    .iter()
                    .any(|(known, value)| name.rsplit(['#', '.']).next() == Some(known) && i128::from(*value) == *a),
                _ => false,
            },
            _ => false,
        },
        _ => false,
    }
}

fn compile(text: &str) -> Result<Container, Found> {
    let input = SourceInput { name: "main.st".to_string(), bytes: text.as_bytes().to_vec() };
    let compilation = khz_frontend::compile(&[input], &CompileOptions::default());
    if khz_frontend::diagnostics::has_errors(&compilation.diagnostics) {
        let errors: Vec<_> = compilation
            .diagnostics
            .iter()
            .filter(|one| one.severity == khz_frontend::diagnostics::Severity::Error)
            .collect();
        let code = errors.first().map_or(String::new(), |error| error.code().to_string());
        let shown = khz_frontend::diagnostics::render::render_all(
            &compilation
                .diagnostics
                .iter()
                .filter(|one| one.severity == khz_frontend::diagnostics::Severity::Error)
                .cloned()
                .collect::<Vec<_>>(),
            &compilation.sources,
            Default::default(),
        );
        return Err(found(format!("refused {code}"), shown));
    }
    let resource = compilation.resources.into_iter().next();
    resource.map(|resource| resource.container).ok_or_else(|| found("no resource", ""))
}

fn set_time(image: &mut Image, container: &Container, now: i64) {
    for variable in &container.types.system_variables {
        let value = match variable.kind {
            SystemVariableKind::UpTime => now - now % 1_000_000,
            SystemVariableKind::UpLtime => now,
        };
        let at = image.layout().slots.start as usize + variable.slot.index() * 8;
        image.bytes_mut()[at..at + 8].copy_from_slice(&value.to_le_bytes());
    }
}

/// Compares one program; `seed` gives the times of its rounds.
pub fn check(source: &Source, seed: u64, tally: &mut Tally) -> Result<(), Found> {
    check_text(&print(source), source, seed, tally)
}

/// Whether a scan ended as the tree says.
fn same_ending(place: &str, expected: &Result<(), Stop>, result: &Result<(), Trap>) -> Result<(), Found> {
    match (expected, result) {
        (Ok(()), Ok(())) => Ok(()),
        (Err(Stop::Trap(code, values)), Err(trap)) if *code == trap.code => {
            // What a step of zero shows besides is not written down.
            let shown = matches!(code, TrapCode::ArrayIndex) || (*code == TrapCode::Range && *values != [0; 3]);
            if shown && *values != trap.values {
                return Err(found("trap values", format!("{place}: {:?} instead of {values:?}", trap.values)));
            }
            Ok(())
        }
        _ => Err(found("result", format!("{place}: {result:?} instead of {expected:?}"))),
    }
}

/// Compares a text with a tree.
pub fn check_text(text: &str, source: &Source, seed: u64, tally: &mut Tally) -> Result<(), Found> {
    let container = match compile(text) {
        Err(found) if REFUSED.contains(&found.class.as_str()) => {
            tally.refused += 1;
            return Ok(());
        }
        other => other?,
    };
    let verified = verify(container).map_err(|error| found("verifier", error.to_string()))?;
    let verified = Arc::new(verified);
    let layout = ImageLayout::new(verified.container(), IMAGE_LIMIT_BYTES)
        .map_err(|error| found("layout", error.to_string()))?;
    let mut machines = Vec::new();
    for maker in super::engines::makers() {
        let engine = (maker.make)(verified.clone(), &layout, false).map_err(|error| found("engine", error))?;
        machines.push(Machine { name: maker.name, engine, image: Image::new(layout.clone(), verified.container()) });
    }
    let names = VariableTable::of(verified.container());
    let mut evaluator = Evaluator::new(source, STEPS);
    let mut places: Option<Vec<Option<Variable>>> = None;
    let mut random = Random::new(seed ^ 0x7469_6D65);
    let mut now = 0;
    tally.programs += 1;
    tally.words(text);
    for scan in 0..SCANS {
        let expected = evaluator.scan(now);
        if expected == Err(Stop::TooLong) {
            tally.too_long += 1;
            return Ok(());
        }
        tally.scans += 1;
        let wanted = evaluator.variables();
        let places = places.get_or_insert_with(|| wanted.iter().map(|(path, ..)| names.resolve(path).ok()).collect());
        for machine in &mut machines {
            set_time(&mut machine.image, verified.container(), now);
            let deadline = DeadlineCell::new();
            let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
            let result = machine.engine.run(Entry::Instance(0), &mut machine.image, limits);
            let place = format!("{} scan {scan}", machine.name);
            same_ending(&place, &expected, &result)?;
            for ((path, ty, value), variable) in wanted.iter().zip(places.iter()) {
                let Some(variable) = variable else {
                    if path.starts_with("main.") {
                        return Err(found("name", format!("{place}: {path} is not in the dump")));
                    }
                    tally.unused += 1;
                    continue;
                };
                let got =
                    names.read(&machine.image, variable).map_err(|error| found("read", format!("{path}: {error}")))?;
                tally.values += 1;
                if !same(source, *ty, value, &got) {
                    let class = if expected.is_err() { "value after a trap" } else { "value" };
                    return Err(found(class, format!("{place}: {path} = {got:?} instead of {value:?} ({expected:?})")));
                }
            }
        }
        if let [first, second] = machines.as_slice()
            && let Some(at) = first.image.first_difference(&second.image)
        {
            return Err(found("engines", format!("scan {scan}: the images differ at {at}")));
        }
        if let Err(Stop::Trap(code, _)) = expected {
            *tally.traps.entry(code.to_string()).or_default() += 1;
            return Ok(());
        }
        now += random.one_of([0, 1, 10_000_000, 7_500_000, 20_000_001]);
    }
    Ok(())
}

/// The program of a seed, and if it differs the smallest that differs alike, with its text.
pub fn check_seed(seed: u64, tally: &mut Tally, tries: usize) -> Option<String> {
    let source = generate(seed);
    let Err(first) = check(&source, seed, tally) else { return None };
    let shows = |source: &Source| matches!(check(source, seed, &mut Tally::default()), Err(other) if other.class == first.class);
    let small = shrink(&source, &shows, tries);
    let last = check(&small, seed, &mut Tally::default()).err().map_or(first.text.clone(), |found| found.text);
    Some(format!("seed {seed}: {}\nfirst: {}\nsmall: {last}\n{}", first.class, first.text, print(&small)))
}

/// Whether a type is one that the tally names.
pub fn names() -> impl Iterator<Item = &'static str> {
    Kind::ALL.into_iter().map(Kind::name)
}
