//! `khz diff`: engines in lock-step on a user's program ([`engines`]), or the program against a recorded trace ([`against`]).

mod against;
mod curves;
mod engines;

use super::Outcome;
use super::args::DiffArgs;

/// Runs it.
pub fn run(args: &DiffArgs) -> Outcome {
    match &args.against {
        Some(path) => against::run(args, path),
        None => engines::run(args),
    }
}
