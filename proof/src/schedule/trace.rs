//! What happens in a run of a plan, row by row: the scheduler's user writes it down, the model foretells it.

use std::fmt;

use khz_bytecode::trap::TrapCode;

use super::plan::Command;

/// A piece of code that is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// The init function.
    Init,
    /// The startup function.
    Startup,
    /// An instance, for a task (both by position).
    Instance(usize, usize),
}

/// Values of the plan's variables in the order of [`super::plan::Plan::names`]; none where the container has no such variable.
pub type Values = Vec<Option<i64>>;

/// When the next round is, as a scheduler says it to its clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// An edge is pending.
    Edge,
    /// At a time in nanoseconds; a freewheeling task would run before.
    At(u64, bool),
    /// Only freewheeling tasks.
    Freewheel,
}

/// How a run of many rounds ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// All scans have run.
    Completed,
    /// Nothing can ever be due.
    NothingDue,
    /// A stop was requested.
    Stopped,
    /// A trap.
    Faulted,
}

/// State of a resource.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Loaded or stopped.
    Stopped,
    /// Running.
    Running,
    /// After a trap.
    Faulted,
}

/// Figures of a measured quantity in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Figures {
    /// How many.
    pub count: u64,
    /// The latest.
    pub last: u64,
    /// The least.
    pub min: u64,
    /// The mean, rounded down.
    pub average: u64,
    /// The greatest.
    pub max: u64,
}

/// Figures of one task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskFigures {
    /// Cycles that ended.
    pub scans: u64,
    /// Cycles past the next due time.
    pub overruns: u64,
    /// Grid points without a cycle.
    pub lost_cycles: u64,
    /// Execution times.
    pub execution: Option<Figures>,
    /// Lateness of starts.
    pub jitter: Option<Figures>,
}

/// Statistics of a resource.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Statistics {
    /// Time of the last round.
    pub time_ns: u64,
    /// Rounds that ended.
    pub rounds: u64,
    /// Those with a task.
    pub rounds_with_tasks: u64,
    /// Each task.
    pub tasks: Vec<TaskFigures>,
}

/// One thing that happens.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// The host gives a command that the state allows.
    Commanded(Command),
    /// The driver is asked for its inputs.
    Inputs,
    /// Code begins, with so much fuel.
    Began(Code, Option<u64>),
    /// The driver gets the bytes of %Q.
    Outputs(Vec<u8>),
    /// A round that began at a time (ns) ended; it ran these tasks.
    Round(u64, Vec<usize>, Values),
    /// The clock is told when to go on.
    Waits(Next),
    /// A trap faulted the resource: what ran, the trap, time of the round (ns), rounds before.
    Fault(Code, TrapCode, u64, u64),
    /// A run of rounds ended.
    Ended(Ending),
    /// After a command: state, time of the last round (ns), rounds, values, statistics.
    Holds(State, u64, u64, Values, Statistics),
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Event::Round(time, ran, _) => write!(f, "round at {time} ran {ran:?}"),
            Event::Holds(state, time, rounds, _, statistics) => {
                let tasks = statistics.tasks.iter().map(|task| (task.scans, task.overruns, task.lost_cycles));
                let tasks: Vec<_> = tasks.collect();
                write!(f, "{state:?} time {time} rounds {rounds}/{} {tasks:?}", statistics.rounds_with_tasks)
            }
            other => write!(f, "{other:?}"),
        }
    }
}

/// What the model is told about a run of code.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// Units of fuel it took.
    pub fuel_used: u64,
    /// When it ended in the middle because its fuel did: what memory held then.
    pub out_of_fuel: Option<Values>,
}

/// A run of a plan as it was seen.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Observed {
    /// What happened.
    pub events: Vec<Event>,
    /// Runs of code, in order.
    pub runs: Vec<Run>,
    /// Which of the plan's variables the container has.
    pub known: Vec<bool>,
}

/// Rows that are shown before a difference.
const ROWS_BEFORE: usize = 8;
/// Rows that are shown after it.
const ROWS_AFTER: usize = 3;
/// Width of a column.
const COLUMN: usize = 78;

/// The first difference of two traces, side by side with the rows before; `None` when they are equal. `names` are those of the values.
#[must_use]
pub fn difference(found: &[Event], foretold: &[Event], names: &[String]) -> Option<String> {
    let at = (0..found.len().max(foretold.len())).find(|at| found.get(*at) != foretold.get(*at))?;
    let show = |events: &[Event], at: usize| events.get(at).map_or_else(|| "(end)".to_string(), ToString::to_string);
    let mut text = format!("  {:<COLUMN$} | the model\n", "the scheduler");
    for row in at.saturating_sub(ROWS_BEFORE)..=at + ROWS_AFTER {
        let (left, right) = (show(found, row), show(foretold, row));
        let mark = if row == at { '>' } else { ' ' };
        text.push_str(&format!("{mark} {left:<COLUMN$} | {right}\n"));
    }
    if let (Some(left), Some(right)) = (found.get(at), foretold.get(at)) {
        text.push_str(&differing_parts(left, right, names));
    }
    Some(text)
}

/// Values and statistics that differ between two events of a kind.
fn differing_parts(left: &Event, right: &Event, names: &[String]) -> String {
    let (left_values, right_values) = match (left, right) {
        (Event::Round(_, _, left), Event::Round(_, _, right)) => (left, right),
        (Event::Holds(_, _, _, left, _), Event::Holds(_, _, _, right, _)) => (left, right),
        _ => return String::new(),
    };
    let mut text = String::new();
    for ((name, left), right) in names.iter().zip(left_values).zip(right_values).filter(|((_, l), r)| l != r) {
        text.push_str(&format!("  {name} = {left:?}, the model has {right:?}\n"));
    }
    if let (Event::Holds(.., left), Event::Holds(.., right)) = (left, right) {
        let tasks = left.tasks.iter().zip(&right.tasks).enumerate();
        for (task, (left, right)) in tasks.filter(|(_, (left, right))| left != right) {
            text.push_str(&format!("  task {task}: {left:?}\n  the model: {right:?}\n"));
        }
    }
    text
}
