//! Compares generated Structured Text with its tree over many programs: `st FIRST_SEED COUNT [--threads N] [--scans N] [--fuel N]
//! [--passes N]`; `--fuel` and `--passes` say of one of how many programs. What differs is printed small; the exit status says whether anything did.
#![allow(clippy::print_stdout, reason = "a program for people")]

mod common;

use std::process::ExitCode;

use khz_proof::campaign::Report;
use khz_proof::harness::meaning::{Plan, Tally, check_seed};

/// How many findings are made small.
const REDUCED: usize = 8;

fn main() -> ExitCode {
    let arguments = common::Arguments::read(
        1000,
        &common::Known {
            options: &[("scans", 1..=10_000), ("fuel", common::ANY), ("passes", common::ANY), ("tries", common::ANY)],
            ..common::Known::default()
        },
    );
    let usual = Plan::default();
    let plan = Plan {
        scans: arguments.option("scans", usual.scans),
        fuel: arguments.option("fuel", usual.fuel),
        passes: arguments.option("passes", usual.passes),
    };
    let report: Report<Tally> = arguments.search(|seed, tally: &mut Tally| check_seed(seed, plan, tally, 0));
    let tries = arguments.option("tries", 1500) as usize;
    for (number, finding) in report.findings.iter().enumerate() {
        println!("==== {}", finding.description.lines().take(4).collect::<Vec<_>>().join(" | "));
        if number < REDUCED && !finding.description.starts_with("panic") {
            let small = check_seed(finding.seed, plan, &mut Tally::default(), tries);
            println!("{}", small.unwrap_or_default().lines().take(120).collect::<Vec<_>>().join("\n"));
        }
    }
    println!("{}", report.figures.report());
    common::finish(report.findings.len())
}
