//! A round once more, in the third evaluator: who is right, and which statement wrote a variable last.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use khz_bytecode::verify::Verified;
use khz_machine::engine::{DeadlineCell, Engine, Fuel, Limits};
use khz_machine::image::Image;
use khz_machine::trap::{CodePlace, Trap};
use khz_proof::evaluator::Evaluator;

use super::recorder::Runs;

/// Units of fuel, about one an instruction, that a round may have used to be repeated: the evaluator is slow.
const MAX_UNITS: u64 = 20_000_000;
/// Bytes that are watched one by one, at most.
const MAX_WATCHED: usize = 64;

/// What a round comes to in the evaluator.
pub struct Replay {
    /// The memory that it leaves.
    pub image: Image,
    /// How it ended.
    pub ending: Result<(), Trap>,
    /// For each watched range the instruction that wrote it last, then the calls that led there; empty: none did.
    pub writers: Vec<Vec<CodePlace>>,
}

/// Repeats recorded runs from their first image and watches some bytes of it.
///
/// # Errors
/// Why that can not be done, for people.
pub(super) fn replay(verified: &Arc<Verified>, record: &Runs, watched: &[Range<usize>]) -> Result<Replay, String> {
    if record.runs.is_empty() {
        return Err("no code ran in it".to_string());
    }
    let units: u64 = record.runs.iter().map(|run| run.used).sum();
    if units > MAX_UNITS {
        return Err(format!("it is too long for that ({units} units of fuel, at most {MAX_UNITS})"));
    }
    let mut image = record.before.clone();
    let mut evaluator = Evaluator::new(verified.clone(), image.layout(), true);
    // Offsets fit: an image is smaller than 2 GiB.
    let watched = watched.iter().take(MAX_WATCHED);
    evaluator.watch(watched.clone().map(|bytes| bytes.start as u32..bytes.end as u32));
    let mut run_all = || {
        for run in &record.runs {
            let deadline = DeadlineCell::new();
            let mut fuel = Fuel { left: run.fuel.unwrap_or(MAX_UNITS) };
            let limits = Limits { deadline: &deadline, fuel: Some(&mut fuel), task_index: run.task_index };
            evaluator.run(run.entry, &mut image, limits)?;
        }
        Ok(())
    };
    // The evaluator checks every access and panics where the verifier promised too much.
    let ending = catch_unwind(AssertUnwindSafe(&mut run_all))
        .map_err(|_| "the evaluator found an access that the verifier should have refused".to_string())?;
    let writers = (0..watched.len()).map(|position| evaluator.writer(position).to_vec()).collect();
    Ok(Replay { image, ending, writers })
}
