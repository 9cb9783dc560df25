//! Compares engines over many random containers: `compare FIRST_SEED COUNT [--threads N] [--scans N] [--cuts N] [--size 0..3] [--parts ITEMS] [interp|jit]…`. What differs
//! is printed small; the exit status says whether anything did.
#![allow(clippy::print_stdout, reason = "a program for people")]

mod common;

use std::process::ExitCode;
use std::sync::Arc;

use khz_proof::bytecode::{Size, generate, generate_sized};
use khz_proof::campaign::Report;
use khz_proof::harness::engines::{self, Engines};
use khz_proof::oracle::{Plan, compare, reduce};
use khz_proof::statistics::Statistics;

/// How many findings are made small.
const REDUCED: usize = 6;

fn main() -> ExitCode {
    let arguments = common::Arguments::read(
        1000,
        &common::Known {
            options: &[
                ("scans", 1..=10_000),
                ("cuts", 0..=10_000),
                ("size", 0..=Size::ALL.len() as u64 - 1),
                ("parts", 1..=1 << 20),
            ],
            words: &engines::makers().iter().map(|maker| maker.name).collect::<Vec<_>>(),
            folders: false,
        },
    );
    let plan = |seed| Plan {
        seed,
        scans: arguments.option("scans", 10) as u32,
        cuts: arguments.option("cuts", 1) as u32,
        ..Plan::default()
    };
    let size = arguments.option("size", u64::MAX);
    let generate = |seed| match Size::ALL.get(size as usize) {
        Some(size) => generate_sized(seed, *size),
        None => generate(seed),
    };
    let engines_of = |seed| match arguments.option("parts", 0) {
        0 => Engines::of_seed(seed),
        items => Engines::in_parts(seed, items as usize),
    };
    let look = |seed, statistics: &mut Statistics| {
        let engines = engines_of(seed);
        let mut makers = engines.makers();
        makers.retain(|maker| arguments.wants(maker.name));
        let found = compare(&Arc::new(generate(seed)), &makers, &plan(seed), statistics).difference();
        engines.note(statistics);
        found
    };
    let report: Report<Statistics> =
        arguments.search(|seed, statistics: &mut Statistics| look(seed, statistics).map(|found| found.description));
    for (number, finding) in report.findings.iter().enumerate() {
        let seed = finding.seed;
        println!("==== seed {seed}: {}", finding.description.lines().take(3).collect::<Vec<_>>().join(" | "));
        if number < REDUCED && !finding.description.starts_with("panic") {
            let verified = Arc::new(generate(seed));
            let Some(found) = look(seed, &mut Statistics::default()) else { continue };
            let engines = engines_of(seed);
            let only: Vec<_> = engines.makers().into_iter().filter(|maker| maker.name == found.engine).collect();
            let (shrunk, description) = reduce(&verified, &only, &plan(seed), 4000);
            println!("{} instructions\n{description}", shrunk.instructions);
        }
    }
    println!("{}", report.figures.report());
    common::finish(report.findings.len())
}
