//! Improvements of the mid-level form: one file each, each a function of a [`Function`](crate::mir::Function) and what it calls.
//!
//! The order is that of [`run`]. Each may be switched off, for measuring and for finding a fault.

use khz_bytecode::verify::Verified;

use crate::mir::Function;

/// Which passes run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Passes {
}

impl Default for Passes {
    fn default() -> Self {
        Passes {}
    }
}

/// Runs the passes on a function.
pub fn run(function: &mut Function, verified: &Verified, passes: Passes) {
    let _ = (function, verified, passes);
}
