//! Formats, writes, reads and strips generated texts and containers, which must come back as they were: `round_trips FIRST_SEED COUNT
//! [--threads N] [--findings N]`.
#![allow(clippy::print_stdout, reason = "a program for people")]

mod common;

use std::process::ExitCode;

use khz_proof::campaign::Report;
use khz_proof::harness::round_trips::{Tally, check_seed};

fn main() -> ExitCode {
    let report: Report<Tally> = common::Arguments::read(1000, &common::Known::default()).search(check_seed);
    for finding in &report.findings {
        println!("==== {}", finding.description);
    }
    let Tally { texts, changed, containers } = report.figures;
    println!("{texts} texts, {changed} formatted texts that differ from them; {containers} containers");
    common::finish(report.findings.len())
}
