//! Spoils containers: `mutants FIRST_SEED COUNT [FOLDER]…` reads and verifies a mutant of each seed, of containers generated, assembled and compiled
//! from the repository's and further folders' programs; `mutants run FIRST_SEED COUNT` runs those that verify in all engines.
//!
//! A panic, more than a second or more than 256 MiB for one mutant is a finding; its mutant is written to `mutant-SEED.iplc`.
//! A count of 1 writes the mutant to `mutant.iplc`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program for people")]

#[path = "../tests/common/bases.rs"]
mod bases;
#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/measure.rs"]
mod measure;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use khz_proof::campaign::{Campaign, Figures, Progress};
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

fn main() {
    let mut words: Vec<String> = std::env::args().skip(1).collect();
    let runs = words.first().is_some_and(|word| word == "run");
    words.drain(..usize::from(runs));
    let number = |at: usize, other: u64| words.get(at).and_then(|word| word.parse().ok()).unwrap_or(other);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let campaign = Campaign { first: number(0, 0), count: number(1, 10_000), threads, most_findings: 20 };
    if runs {
        run(&campaign);
    } else {
        let folders: Vec<PathBuf> = words.iter().skip(2).map(PathBuf::from).collect();
        verify(&campaign, &folders);
    }
}

/// Says how far a search is, each time another twentieth is done.
fn show(progress: Progress) {
    let part = (progress.count / 20).max(1);
    if progress.done / part != progress.done.saturating_sub(32) / part {
        eprintln!("{} of {}, {} findings", progress.done, progress.count, progress.findings);
    }
}

#[allow(clippy::disallowed_methods, reason = "wall time, for people")]
fn verify(campaign: &Campaign, folders: &[PathBuf]) {
    let pool = bases::pool(GENERATED, &bases::texts(0, folders));
    println!("{} containers, smallest, middle and largest of {:?} bytes", pool.len(), pool.sizes());
    let start = Instant::now();
    let check = |seed: u64, seen: &mut Seen| {
        let mutant = pool.mutant(seed);
        let (verdict, cost) = measure::measure(|| mutant.classify());
        seen.tally.count_mutant(&mutant, &verdict);
        seen.costs.count(seed, cost);
        cost.finding()
    };
    let report = campaign.run(check, show);
    if campaign.count == 1 {
        // Who asks for one seed wants to see it.
        let mutant = pool.mutant(campaign.first);
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
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{} findings in {} mutants, {seconds:.1} s, {:.0} a second",
        report.findings.len(),
        report.done,
        report.done as f64 / seconds
    );
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

fn run(campaign: &Campaign) {
    let check = |seed: u64, ran: &mut Ran| {
        let makers = common::makers();
        for (number, verified) in accepted(seed, TRIES) {
            ran.mutants += 1;
            let plan = Plan { seed, scans: 100, fuel: 5_000, image_limit_bytes: 1 << 16, ..Plan::default() };
            let verified = Arc::new(verified);
            let Some(found) = compare(&verified, &makers, &plan, &mut ran.statistics).difference() else { continue };
            let only: Vec<_> = common::makers().into_iter().filter(|maker| maker.name == found.engine).collect();
            let (shrunk, description) = reduce(&verified, &only, &plan, 2000);
            return Some(format!(
                "mutant {number}: {}\n{} instructions\n{description}",
                found.description, shrunk.instructions
            ));
        }
        None
    };
    let report = campaign.run(check, show);
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
}
