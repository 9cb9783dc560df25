//! Holds the scheduler against the model over many configurations of tasks, in both engines: `schedule FIRST_SEED COUNT [--threads N]
//! [--findings N]`. What is not as the rules say is printed small.
#![allow(clippy::print_stdout, reason = "a program for people")]

#[path = "common/mod.rs"]
mod common;

use std::process::ExitCode;

use common::Arguments;
use khz_proof::harness::engines;
use khz_proof::harness::schedule::{Tally, check_seed};

/// Questions that the shrinker may ask.
const TRIES: usize = 1000;

fn main() -> ExitCode {
    let arguments = Arguments::read(1000, &common::Known::default());
    let report = arguments.search(|seed, tally: &mut Tally| check_seed(seed, &engines::makers(), tally, TRIES));
    for finding in &report.findings {
        println!("==== {}", finding.description);
    }
    println!("{}", report.figures.report());
    common::finish(report.findings.len())
}
