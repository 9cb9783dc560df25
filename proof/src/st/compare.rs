//! Text and rounds in two engines or more: the first difference, with both traces.
//!
//! The first engine is the definition; each other one is held against it. All run in lock-step, first with fuel, so that whatever the
//! shrinker makes of a program ends, and then, if no fuel ran out, in their form without. After each run of a program instance its ending and the
//! whole memory image are compared.

use std::fmt::{self, Display};
use std::sync::Arc;

use khz_bytecode::container::{Container, SystemVariableKind};
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::trap::TrapCode;
use khz_bytecode::verify::{Verified, verify};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Fuel, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::report::{SourcePosition, describe};
use khz_machine::trap::{CodePlace, Trap};
use khz_machine::variables::{Variable, VariableTable};

use super::case::Round;
use crate::evaluator::Evaluator;
use crate::oracle::Maker;
use crate::traces::{ENDING, Row, Traces};

/// Why a compiler takes no program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Code of the first error.
    pub code: String,
    /// What it says, for people.
    pub text: String,
}

/// From Structured Text to a container.
pub type Compile<'c> = dyn Fn(&str) -> Result<Container, Refusal> + 'c;

/// What a comparison needs that this crate does not know.
pub struct Bench<'b> {
    /// The compiler.
    pub compile: &'b Compile<'b>,
    /// The engines; the first is the definition.
    pub makers: &'b [Maker<'b>],
    /// Units of fuel of each run.
    pub fuel: u64,
    /// Largest memory image, in bytes.
    pub image_limit_bytes: u64,
}

/// What sort of difference: shrinking keeps it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Sort {
    /// The compiler takes it not, for an error of this code.
    Refused(String),
    /// What was compiled does not verify, or an engine can not be made.
    Broken,
    /// One traps where the other does not, or elsewhere, or with other values.
    Trap,
    /// A variable has another value.
    Value,
    /// The memory images differ where no variable lies.
    Image,
}

/// A statement of the program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Statement {
    /// The place in it where it happened.
    pub place: SourcePosition,
    /// Its line of the source.
    pub text: String,
}

impl Statement {
    /// The statement at a place of a source text.
    #[must_use]
    pub fn at(place: SourcePosition, source: &str) -> Statement {
        let line = source.lines().nth((place.line as usize).saturating_sub(1)).unwrap_or("");
        let text = line.trim().to_string();
        Statement { place, text }
    }
}

impl Display for Statement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.text)
    }
}

/// A difference between two engines.
#[derive(Debug, Clone)]
pub struct Difference {
    /// The engine that is held for right.
    pub left: String,
    /// The engine that says something else.
    pub right: String,
    /// What sort.
    pub sort: Sort,
    /// In which round, from 0.
    pub round: usize,
    /// Path of the first variable that differs.
    pub variable: Option<String>,
    /// What differs, for people.
    pub description: String,
    /// Where one of them trapped, if one did.
    pub trapped: Option<CodePlace>,
    /// The statement that made it: the one that trapped, or the one that wrote the variable last as the third evaluator runs it.
    pub statement: Option<Statement>,
    /// What both say of all variables, up to the difference.
    pub traces: Traces,
}

impl Difference {
    /// Whether another one is of the same engines and sort.
    #[must_use]
    pub fn is_like(&self, other: &Difference) -> bool {
        (&self.left, &self.right, &self.sort) == (&other.left, &other.right, &other.sort)
    }

    fn before_running(left: &str, right: &str, sort: Sort, description: String) -> Difference {
        Difference {
            left: left.to_string(),
            right: right.to_string(),
            sort,
            round: 0,
            variable: None,
            description,
            statement: None,
            trapped: None,
            traces: Traces::default(),
        }
    }
}

/// Name of the source file that the compared text is.
pub const FILE: &str = "main.st";

/// One engine, and what it left behind.
pub(crate) struct Side<'m> {
    name: &'m str,
    engine: Box<dyn Engine>,
    pub(crate) image: Image,
    /// The image after each round, and how the round ended.
    rounds: Vec<(Image, Result<(), Trap>)>,
}

impl<'m> Side<'m> {
    /// An engine before its first round, with the initial values.
    ///
    /// # Errors
    /// What the maker says.
    pub(crate) fn new(
        maker: &Maker<'m>,
        verified: &Arc<Verified>,
        layout: &ImageLayout,
        with_fuel: bool,
    ) -> Result<Side<'m>, String> {
        let engine = (maker.make)(verified.clone(), layout, with_fuel)?;
        let image = Image::new(layout.clone(), verified.container());
        Ok(Side { name: maker.name, engine, image, rounds: Vec::new() })
    }

    /// Runs every program instance once, tasks by priority; before the first round what runs once. Gives how it ended.
    pub(crate) fn round(&mut self, verified: &Verified, fuel: Option<u64>) -> Result<(), Trap> {
        let first = self.rounds.is_empty();
        let result = run_round(&mut *self.engine, &mut self.image, verified, first, fuel);
        self.rounds.push((self.image.clone(), result));
        result
    }
}

/// Runs every program instance once, tasks by priority; before the `first` round what runs once.
fn run_round(
    engine: &mut dyn Engine,
    image: &mut Image,
    verified: &Verified,
    first: bool,
    fuel: Option<u64>,
) -> Result<(), Trap> {
    let container = verified.container();
    let mut entries = if first { vec![(Entry::Init, 0), (Entry::Startup, 0)] } else { Vec::new() };
    let mut order: Vec<(u16, usize, usize)> = Vec::new();
    for (index, instance) in container.tasks.instances.iter().enumerate() {
        let task = container.tasks.tasks.iter().position(|task| task.id == instance.task).unwrap_or(0);
        let priority = container.tasks.tasks.get(task).map_or(0, |task| task.priority);
        order.push((priority, task, index));
    }
    order.sort_unstable();
    entries.extend(order.into_iter().map(|(_, task, index)| (Entry::Instance(index), task)));
    for (entry, task_index) in entries {
        let deadline = DeadlineCell::new();
        let mut tank = Fuel { left: fuel.unwrap_or(0) };
        let limits = Limits { deadline: &deadline, fuel: fuel.map(|_| &mut tank), task_index };
        engine.run(entry, image, limits)?;
    }
    Ok(())
}

impl Bench<'_> {
    /// The first difference of a text over some rounds; none too when the image would be too large.
    #[must_use]
    pub fn compare(&self, text: &str, rounds: &[Round]) -> Option<Difference> {
        let container = match (self.compile)(text) {
            Ok(container) => container,
            Err(refusal) => {
                let sort = Sort::Refused(refusal.code);
                return Some(Difference::before_running("generator", "compiler", sort, refusal.text));
            }
        };
        let verified = match verify(container) {
            Ok(verified) => Arc::new(verified),
            Err(error) => {
                return Some(Difference::before_running("compiler", "verifier", Sort::Broken, error.to_string()));
            }
        };
        let layout = ImageLayout::new(verified.container(), self.image_limit_bytes).ok()?;
        for with_fuel in [true, false] {
            match self.run(&verified, &layout, text, rounds, with_fuel) {
                Ran::Different(difference) => return Some(*difference),
                Ran::OutOfFuel => break,
                Ran::Equal => {}
            }
        }
        None
    }

    fn run(
        &self,
        verified: &Arc<Verified>,
        layout: &ImageLayout,
        text: &str,
        rounds: &[Round],
        with_fuel: bool,
    ) -> Ran {
        let mut sides = Vec::new();
        for maker in self.makers {
            match Side::new(maker, verified, layout, with_fuel) {
                Ok(side) => sides.push(side),
                Err(reason) => {
                    let broken = Difference::before_running("verifier", maker.name, Sort::Broken, reason);
                    return Ran::Different(Box::new(broken));
                }
            }
        }
        let names = VariableTable::of(verified.container());
        let mut now = 0_i64;
        for round in rounds {
            now = now.saturating_add(round.wait_ns);
            for side in &mut sides {
                give(&mut side.image, &names, verified.container(), round, now);
                let _ = side.round(verified, with_fuel.then_some(self.fuel));
            }
            let Some((left, others)) = sides.split_first() else { return Ran::Equal };
            if let Some(right) = others.iter().find(|right| differ(left, right)) {
                let mut difference = tell(left, right, &names, verified.container());
                let places = match difference.trapped {
                    Some(place) => vec![place],
                    None => self.writer(verified, layout, rounds, &difference).unwrap_or_default(),
                };
                // Inside a standard block nothing has a place in the source; its call has one.
                let mut sources = places.into_iter().filter_map(|place| describe(place, verified.container()).source);
                difference.statement = sources.find(|place| place.file == FILE).map(|place| Statement::at(place, text));
                return Ran::Different(Box::new(difference));
            }
            match left.rounds.last() {
                Some((_, Err(trap))) if trap.code == TrapCode::Watchdog => return Ran::OutOfFuel,
                Some((_, Err(_))) => return Ran::Equal,
                _ => {}
            }
        }
        Ran::Equal
    }

    /// The instruction that wrote the differing variable last, as the third evaluator runs the same rounds, and the calls that led there.
    fn writer(
        &self,
        verified: &Arc<Verified>,
        layout: &ImageLayout,
        rounds: &[Round],
        difference: &Difference,
    ) -> Option<Vec<CodePlace>> {
        let names = VariableTable::of(verified.container());
        let variable = names.resolve(difference.variable.as_deref()?).ok()?;
        let bytes = names.bytes_of(layout, &variable)?;
        let mut evaluator = Evaluator::new(verified.clone(), layout, true);
        // Offsets fit: an image is smaller than 2 GiB.
        evaluator.watch(std::iter::once(bytes.start as u32..bytes.end as u32));
        let mut image = Image::new(layout.clone(), verified.container());
        let mut now = 0_i64;
        for (number, round) in rounds.iter().enumerate().take(difference.round + 1) {
            now = now.saturating_add(round.wait_ns);
            give(&mut image, &names, verified.container(), round, now);
            run_round(&mut evaluator, &mut image, verified, number == 0, Some(self.fuel)).ok()?;
        }
        Some(evaluator.writer(0).to_vec())
    }
}

enum Ran {
    Equal,
    OutOfFuel,
    Different(Box<Difference>),
}

/// The time and the values from outside.
fn give(image: &mut Image, names: &VariableTable, container: &Container, round: &Round, now: i64) {
    set_time(image, container, now);
    let bytes = image.layout().input.start as usize..image.layout().input.end as usize;
    let given = round.image.iter().copied().chain(std::iter::repeat(0));
    image.bytes_mut()[bytes].iter_mut().zip(given).for_each(|(byte, given)| *byte = given);
    for input in &round.inputs {
        if let Ok(variable) = names.resolve(&input.name) {
            // A variable that the shrinker made narrower may not take a value; then it keeps its own, in every engine.
            let _ = names.write(image, &variable, &input.literal);
        }
    }
}

/// Gives the system variables a time in nanoseconds.
pub(crate) fn set_time(image: &mut Image, container: &Container, now: i64) {
    for variable in &container.types.system_variables {
        let value = match variable.kind {
            SystemVariableKind::UpTime => now - now % 1_000_000,
            SystemVariableKind::UpLtime => now,
        };
        let at = image.layout().slots.start as usize + variable.slot.index() * SLOT_BYTES as usize;
        image.bytes_mut()[at..at + SLOT_BYTES as usize].copy_from_slice(&value.to_le_bytes());
    }
}

fn differ(left: &Side<'_>, right: &Side<'_>) -> bool {
    match (left.rounds.last(), right.rounds.last()) {
        (Some((a, left)), Some((b, right))) => left != right || a.first_difference(b).is_some(),
        _ => false,
    }
}

fn ending(result: &Result<(), Trap>, container: &Container) -> String {
    match result {
        Ok(()) => "returns".to_string(),
        Err(trap) => format!("trap {} {:?} at {}", trap.code, trap.values, describe(trap.place, container)),
    }
}

/// Most parts of one variable that a trace has.
const MOST_PARTS: usize = 64;

fn tell(left: &Side<'_>, right: &Side<'_>, names: &VariableTable, container: &Container) -> Difference {
    let watched: Vec<Variable> =
        names.variables().filter(|one| !one.constant).flat_map(|one| names.leaves(&one, MOST_PARTS)).collect();
    let mut rows = Vec::new();
    for (round, ((a, left), (b, right))) in left.rounds.iter().zip(&right.rounds).enumerate() {
        for variable in &watched {
            let name = variable.name.clone();
            rows.push(Row { round, name, left: names.text(a, variable), right: names.text(b, variable) });
        }
        let (left, right) = (ending(left, container), ending(right, container));
        rows.push(Row { round, name: ENDING.to_string(), left, right });
    }
    if left.rounds.iter().chain(&right.rounds).all(|(_, result)| result.is_ok()) {
        rows.retain(|row| row.name != ENDING);
    }
    let traces = Traces { left: left.name.to_string(), right: right.name.to_string(), rows };
    let round = left.rounds.len().saturating_sub(1);
    let trap = left.rounds.last().zip(right.rounds.last()).filter(|((_, a), (_, b))| a != b);
    let first = traces.first_difference().map(|at| traces.rows[at].clone()).filter(|row| row.name != ENDING);
    let (sort, description) = match (&trap, &first) {
        (Some(((_, a), (_, b))), _) => (Sort::Trap, format!("{}; {}", ending(a, container), ending(b, container))),
        (None, Some(row)) => (Sort::Value, format!("{} = {}; {}", row.name, row.left, row.right)),
        (None, None) => {
            let at = left.image.first_difference(&right.image).unwrap_or(0);
            (Sort::Image, format!("the memory images differ at byte {at}, where no variable lies"))
        }
    };
    let trapped = trap.and_then(|((_, a), (_, b))| a.err().or(b.err())).map(|trap| trap.place);
    Difference {
        left: left.name.to_string(),
        right: right.name.to_string(),
        sort,
        round,
        variable: first.map(|row| row.name),
        description,
        statement: None,
        trapped,
        traces,
    }
}
