//! `khz diff`: engines in lock-step on a user's program ([`engines`]) or on generated ones ([`random`]), or a program against a recorded
//! trace ([`against`]).

mod against;
mod curves;
mod engines;
mod random;

use super::Outcome;
use super::args::DiffArgs;
use super::output::Failure;

/// Runs it.
pub fn run(args: &DiffArgs) -> Outcome {
    args.check().map_err(Failure::usage)?;
    let _planted = plant(args);
    match (&args.against, args.random) {
        (_, Some(count)) => random::run(args, count),
        (Some(path), None) => against::run(args, path),
        (None, None) => engines::run(args),
    }
}

/// Plants the fault that a test asks for, in this thread; only the feature `canary` has any.
#[cfg(feature = "canary")]
fn plant(args: &DiffArgs) -> Option<khz_bytecode::canary::Planted> {
    use khz_bytecode::canary::{Fault, plant};
    let name = args.plant.as_deref()?;
    Fault::ALL.iter().find(|fault| format!("{fault:?}").eq_ignore_ascii_case(name)).map(|fault| plant(*fault))
}

#[cfg(not(feature = "canary"))]
fn plant(_args: &DiffArgs) -> Option<std::convert::Infallible> {
    None
}
