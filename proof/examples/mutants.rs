//! Spoils containers: `mutants FIRST_SEED COUNT [--threads N] [FOLDER]…` reads and verifies a mutant of each seed, of containers generated, assembled and compiled
//! from the repository's and further folders' programs; `mutants FIRST_SEED COUNT run` runs those that verify in all engines.
//!
//! A panic, more than a second or more than 256 MiB for one mutant is a finding; its mutant is written to `mutant-SEED.iplc`. One that runs for 10 s is named and
//! ends the search. A count of 1 writes the mutant to `mutant.iplc`. A seed means the same mutant only with the same folders. With `run` a
//! difference is a finding, too; the container that shows it is written to `mutant-SEED.iplc`, made small to `small-SEED.iplc`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program for people")]

#[path = "../tests/common/bases.rs"]
mod bases;
mod common;
#[path = "../tests/common/measure.rs"]
mod measure;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use common::{Arguments, Known};
use khz_bytecode::container::write;
use khz_proof::campaign::Figures;
use khz_proof::harness::engines;
use khz_proof::mutate::{Tally, accepted};
use khz_proof::oracle::{Plan, compare, reduce};
use khz_proof::statistics::Statistics;

/// Generated containers of the pool.
const GENERATED: u64 = 1500;
/// Mutants of each generated container that are tried when they are run.
const TRIES: usize = 40;

#[derive(Default)]
struct Seen {
    tally: Tally,
    costs: measure::Costs,
}

impl Figures for Seen {
    fn merge(&mut self, later: Self) {
        self.tally.add(&later.tally);
        self.costs.add(later.costs);
    }
}

fn main() -> ExitCode {
    let known = Known { words: &["run"], folders: true, ..Known::default() };
    let arguments = Arguments::read(10_000, &known);
    match (arguments.has("run"), arguments.folders()) {
        (true, []) => run(&arguments),
        (false, folders) => verify(&arguments, folders),
        (true, _) => {
            eprintln!("`run` makes its mutants of generated containers: there is no use for a folder");
            ExitCode::from(2)
        }
    }
}

fn verify(arguments: &Arguments, folders: &[PathBuf]) -> ExitCode {
    let pool = bases::pool(GENERATED, &bases::texts(0, folders));
    println!("{} containers, smallest, middle and largest of {:?} bytes", pool.len(), pool.sizes());
    let watch = measure::no_hang("mutants", common::LATE_S);
    let report = arguments.search(|seed: u64, seen: &mut Seen| {
        let mutant = pool.mutant(seed);
        let (verdict, cost) = measure::measure(&watch, seed, || mutant.classify());
        seen.tally.count_mutant(&mutant, &verdict);
        seen.costs.count(seed, cost);
        cost.finding()
    });
    if arguments.count == 1 {
        // Who asks for one seed wants to see it.
        let mutant = pool.mutant(arguments.first);
        let written = std::fs::write("mutant.iplc", mutant.bytes.unwrap_or_default());
        println!("mutant.iplc: {:?}, {written:?}", mutant.kinds);
    }
    for finding in &report.findings {
        let path = format!("mutant-{}.iplc", finding.seed);
        let mutant = pool.mutant(finding.seed);
        let written = std::fs::write(&path, mutant.bytes.unwrap_or_default());
        println!("==== seed {}, {:?}: {} ({path}: {written:?})", finding.seed, mutant.kinds, finding.description);
    }
    println!("{}{}", report.figures.tally.report(), report.figures.costs.report());
    common::finish(report.findings.len())
}

/// What a search that runs mutants counts.
#[derive(Default)]
struct Ran {
    mutants: u64,
    statistics: Statistics,
}

impl Figures for Ran {
    fn merge(&mut self, later: Self) {
        self.mutants += later.mutants;
        self.statistics.merge(later.statistics);
    }
}

fn run(arguments: &Arguments) -> ExitCode {
    let report = arguments.search(|seed: u64, ran: &mut Ran| {
        let makers = engines::makers();
        for (number, verified) in accepted(seed, TRIES) {
            ran.mutants += 1;
            let plan = Plan { seed, scans: 100, fuel: 5_000, image_limit_bytes: 1 << 16, ..Plan::default() };
            let verified = Arc::new(verified);
            let Some(found) = compare(&verified, &makers, &plan, &mut ran.statistics).difference() else { continue };
            let only: Vec<_> = engines::makers().into_iter().filter(|maker| maker.name == found.engine).collect();
            let (shrunk, description) = reduce(&verified, &only, &plan, 2000);
            let written =
                [("mutant", verified.container()), ("small", shrunk.verified.container())].map(|(name, container)| {
                    let path = format!("{name}-{seed}.iplc");
                    let bytes = write(container).unwrap_or_default();
                    format!("{path}: {:?}", std::fs::write(&path, bytes))
                });
            return Some(format!(
                "mutant {number}: {}\n{} instructions\n{description}\n{written:?}",
                found.description, shrunk.instructions
            ));
        }
        None
    });
    for finding in &report.findings {
        println!("==== seed {}: {}", finding.seed, finding.description);
    }
    let ran = &report.figures;
    println!(
        "{} differences in {} mutants that verify\n{}",
        report.findings.len(),
        ran.mutants,
        ran.statistics.report()
    );
    common::finish(report.findings.len())
}
