//! What is known of a trap that ended a run.

use khz_machine::engine::Entry;
use khz_machine::trap::Trap;

use crate::task::TaskIndex;
use crate::time::TimeNs;

/// What was running.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultPlace {
    /// The init function, at load or reset.
    Init,
    /// The startup function.
    Startup,
    /// A program instance.
    Task {
        /// Its task.
        task: TaskIndex,
        /// Its position in the instance table.
        instance: usize,
    },
}

impl FaultPlace {
    /// What the engine was asked to run.
    #[must_use]
    pub fn entry(self) -> Entry {
        match self {
            FaultPlace::Init => Entry::Init,
            FaultPlace::Startup => Entry::Startup,
            FaultPlace::Task { instance, .. } => Entry::Instance(instance),
        }
    }
}

/// A trap, with what ran and when. Names and source lines are the business of who has the debug section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultReport {
    /// What was running.
    pub place: FaultPlace,
    /// Why, where, and the calls that led there.
    pub trap: Trap,
    /// Time of the round, which was abandoned; its outputs were not flushed.
    pub time: TimeNs,
    /// Rounds that had ended before.
    pub rounds: u64,
}
