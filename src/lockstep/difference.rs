//! What differs: how two sides ended, which variables, which statement wrote them, and whom the third evaluator agrees with.

use std::ops::Range;

use khz_machine::image::Image;
use khz_machine::report::{DescribedPlace, TrapReport, describe as describe_place};
use khz_machine::variables::Variable;
use khz_scheduler::TimeNs;

use super::replay::{Replay, replay};
use super::side::{Side, State, Step};
use super::{Lockstep, Summary};

/// Variables that are named, at most.
const MAX_VARIABLES: usize = 20;
/// Parts of one variable that are looked at, and of all together.
const MAX_LEAVES: usize = 10_000;
const MAX_LEAVES_IN_ALL: usize = 1_000_000;

/// A difference between two sides.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// The round in which they first differ, from 1; 0: before the first round.
    pub round: u64,
    /// When that round began.
    pub time: TimeNs,
    /// Names of the two sides; the first is what the others are compared with.
    pub sides: [String; 2],
    /// How each ended, when they ended otherwise.
    pub endings: Option<[String; 2]>,
    /// Variables that differ, those of the first differing round first, at most 20.
    pub variables: Vec<DifferingVariable>,
    /// How many more variables differ.
    pub more_variables: usize,
    /// The first byte of the memory image that differs, with both values, when no variable does.
    pub byte: Option<(u32, [u8; 2])>,
    /// What the third evaluator says of the round.
    pub verdict: Verdict,
    /// Positions of the sides.
    pub(super) pair: [usize; 2],
}

/// A variable that differs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DifferingVariable {
    /// Its name.
    pub name: String,
    /// The round in which it first differed.
    pub round: u64,
    /// When that round began.
    pub time: TimeNs,
    /// Its value on both sides, as IEC literals.
    pub values: [String; 2],
    /// What the third evaluator has; only in the first differing round.
    pub evaluator: Option<String>,
    /// The statement that wrote it last in that round, then the calls that led there, innermost first; empty: none did, or it is not known.
    pub statement: Vec<DescribedPlace>,
}

/// What the third evaluator says of the first differing round.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// It comes to the same as these sides: to both only where what differs is none of the engines' work.
    AgreesWith(Vec<String>),
    /// It was not asked, for this reason.
    Unknown(String),
}

/// Describes how the side at `other` differs from the first one.
pub(super) fn describe(lockstep: &Lockstep<'_>, other: usize) -> Difference {
    let pair = [0, other];
    let sides = pair.map(|position| &lockstep.sides[position]);
    let endings = (sides[0].step != sides[1].step).then(|| sides.map(|side| ending(lockstep, side)));
    let time = sides.iter().filter_map(|side| time(side)).max().unwrap_or(TimeNs::ZERO);
    let mut found = Difference {
        round: lockstep.rounds,
        time,
        sides: sides.map(|side| side.name.clone()),
        endings,
        variables: Vec::new(),
        more_variables: 0,
        byte: None,
        verdict: Verdict::Unknown(String::new()),
        pair,
    };
    let differing = differing(lockstep, pair);
    let mut watched: Vec<Range<usize>> = differing.iter().map(|(_, bytes)| bytes.clone()).collect();
    let byte = first_byte(sides);
    watched.extend(byte.map(|(at, _)| at as usize..at as usize + 1).filter(|_| differing.is_empty()));
    let repeated = replay(&lockstep.program.verified, &lockstep.record.lock(), &watched);
    found.verdict = match &repeated {
        Ok(replay) => Verdict::AgreesWith(agreeing(sides, replay)),
        Err(reason) => Verdict::Unknown(reason.clone()),
    };
    if differing.is_empty() {
        found.byte = byte;
    }
    add_variables(lockstep, &mut found, repeated.as_ref().ok());
    found
}

/// Adds the variables that differ now and are not named yet.
pub(super) fn add_variables(lockstep: &Lockstep<'_>, found: &mut Difference, replay: Option<&Replay>) {
    let sides = found.pair.map(|position| &lockstep.sides[position]);
    let (Some(a), Some(b)) = (sides[0].image(), sides[1].image()) else { return };
    let container = lockstep.program.container();
    let time = time(sides[0]).unwrap_or(found.time);
    let mut more = 0;
    for (position, (variable, _)) in differing(lockstep, found.pair).into_iter().enumerate() {
        if found.variables.iter().any(|known| known.name == variable.name) {
            continue;
        }
        if found.variables.len() >= MAX_VARIABLES {
            more += 1;
            continue;
        }
        let text = |image: &Image| lockstep.names.text(image, &variable);
        let writer = replay.and_then(|replay| replay.writers.get(position)).map_or(&[][..], Vec::as_slice);
        found.variables.push(DifferingVariable {
            round: lockstep.rounds,
            time,
            values: [text(a), text(b)],
            evaluator: replay.map(|replay| text(&replay.image)),
            statement: writer.iter().map(|place| describe_place(*place, container)).collect(),
            name: variable.name,
        });
    }
    found.more_variables = found.more_variables.max(more);
}

/// Variables whose bytes differ, with their bytes, in the order of a dump.
fn differing(lockstep: &Lockstep<'_>, pair: [usize; 2]) -> Vec<(Variable, Range<usize>)> {
    let [Some(a), Some(b)] = pair.map(|position| lockstep.sides[position].image()) else { return Vec::new() };
    if a.first_difference(b).is_none() {
        return Vec::new();
    }
    let names = &lockstep.names;
    let leaves = names.variables().flat_map(|variable| names.leaves(&variable, MAX_LEAVES)).take(MAX_LEAVES_IN_ALL);
    let placed = leaves.filter_map(|leaf| names.bytes_of(a.layout(), &leaf).map(|bytes| (leaf, bytes)));
    let differs = |bytes: &Range<usize>| a.bytes()[bytes.clone()] != b.bytes()[bytes.clone()];
    // Neighbours share the byte of a bit.
    placed
        .filter(|(leaf, bytes)| differs(bytes) && (bytes.len() != 1 || names.text(a, leaf) != names.text(b, leaf)))
        .collect()
}

/// The first byte that differs.
fn first_byte(sides: [&Side; 2]) -> Option<(u32, [u8; 2])> {
    let [a, b] = sides.map(Side::image);
    let (a, b) = (a?, b?);
    let at = a.first_difference(b)?;
    Some((at, [a.bytes()[at as usize], b.bytes()[at as usize]]))
}

/// Sides whose ending and memory are those of the evaluator.
fn agreeing(sides: [&Side; 2], replay: &Replay) -> Vec<String> {
    let wanted = replay.ending.err();
    let is_like = |side: &&Side| {
        side.fault().map(|report| report.trap) == wanted
            && side.image().is_some_and(|image| image.first_difference(&replay.image).is_none())
    };
    sides.into_iter().filter(is_like).map(|side| side.name.clone()).collect()
}

fn time(side: &Side) -> Option<TimeNs> {
    match &side.state {
        State::Stopped(resource) => Some(resource.time()),
        State::Running(resource) => Some(resource.time()),
        State::Faulted(resource) => Some(resource.time()),
        State::Absent => None,
    }
}

/// How a side ended, in words.
fn ending(lockstep: &Lockstep<'_>, side: &Side) -> String {
    match side.step {
        Some(Step { fault: Some((trap, place)), .. }) => {
            TrapReport::new(&trap, place.entry(), lockstep.program.container()).to_string()
        }
        Some(Step { round: Some(round), wake, .. }) => {
            format!("no trap, {} tasks ran, then {wake:?}", round.tasks)
        }
        _ => "no trap".to_string(),
    }
}

impl Summary {
    /// In words, for people.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!("equal after {} rounds", self.rounds);
        if let Some(trap) = self.ended {
            text += &format!("; both trapped: {trap}");
        } else if !self.traps.is_empty() {
            let traps: Vec<String> = self.traps.iter().map(|(trap, count)| format!("{count} × {trap}")).collect();
            text += &format!("; both trapped and were reset: {}", traps.join(", "));
        }
        text
    }
}
