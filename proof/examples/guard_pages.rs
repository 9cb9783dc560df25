//! Runs generated containers and their mutants between guard pages: `guard_pages FIRST_SEED COUNT [--threads N]`. An access outside an image ends
//! the process with SIGSEGV.
#![allow(clippy::print_stdout, reason = "a program for people")]

mod common;
#[path = "../tests/common/guarded.rs"]
mod guarded;
#[path = "../tests/common/guarded_search.rs"]
mod guarded_search;

use std::process::ExitCode;

use khz_proof::campaign::Report;
use khz_proof::statistics::Statistics;

#[global_allocator]
static ALLOCATOR: guarded::Guarded = guarded::Guarded;

fn main() -> ExitCode {
    let arguments = common::Arguments::read(1000, &common::Known::default());
    let report: Report<Statistics> = arguments.search(guarded_search::look);
    for finding in &report.findings {
        println!("==== seed {}: {}", finding.seed, finding.description);
    }
    println!(
        "{} images of {} scans\n{}",
        guarded::Guarded::blocks_ever(),
        guarded_search::SCANS,
        report.figures.report()
    );
    common::finish(report.findings.len())
}
