//! `khz diff`: engines in lock-step on a user's program ([`engines`]) or on generated ones, or a program against a recorded trace.

mod engines;

use super::Outcome;
use super::args::DiffArgs;

/// Runs it.
pub fn run(args: &DiffArgs) -> Outcome {
    engines::run(args)
}
