//! Spoils Structured Text and checks it as `khz check` does, every diagnostic rendered: `sources FIRST_SEED COUNT [--threads N] [FOLDER]…`, from the repository's programs,
//! generated ones, and those of further folders. A count of 1 writes the text to `source.st`.
//!
//! A panic, more than a second or more than 256 MiB for one source is a finding; its text is written to `source-SEED.st`. One that runs for 10 s is named and ends the
//! search. A seed means the same source only with the same folders.
#![allow(clippy::print_stdout, reason = "a program for people")]

#[path = "../tests/common/bases.rs"]
mod bases;
#[path = "../tests/common/checked.rs"]
mod checked;
mod common;
#[path = "../tests/common/measure.rs"]
mod measure;

use std::process::ExitCode;

use checked::Checked;
use common::{Arguments, Known};
use khz_frontend::on_large_stack;
use khz_proof::campaign::{Figures, Finding};
use khz_proof::mutate::source::mutant;
use khz_proof::watch::Watch;

/// Generated programs among the texts.
const GENERATED: u64 = 300;
/// Sources that one thread looks at in a row.
const BATCH: u64 = 250;

#[derive(Default)]
struct Seen {
    checked: Checked,
    costs: measure::Costs,
    findings: Vec<Finding>,
}

impl Figures for Seen {
    fn merge(&mut self, later: Self) {
        self.checked.add(&later.checked);
        self.costs.add(later.costs);
        self.findings.extend(later.findings);
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::read(10_000, &Known { folders: true, ..Known::default() });
    let (first, count) = (arguments.first, arguments.count);
    let texts = bases::texts(GENERATED, arguments.folders());
    println!("{} texts, {} bytes in all", texts.len(), texts.iter().map(Vec::len).sum::<usize>());
    // Many at a time: so the front end's thread is made once for many, and their memory is counted where it is used.
    let watch = measure::no_hang("sources", common::LATE_S);
    let report = arguments.search_batches(BATCH, "sources", |seeds, seen: &mut Seen| {
        seen.merge(on_large_stack(|| look_at(&texts, &watch, seeds.clone())));
        None
    });
    let seen = report.figures;
    if count == 1 {
        // Who asks for one seed wants to see it.
        let written = std::fs::write("source.st", mutant(&texts, first).bytes);
        println!("source.st: {written:?}");
    }
    for finding in &report.findings {
        println!("==== sources from seed {} on: {}", finding.seed, finding.description);
    }
    for finding in &seen.findings {
        let path = format!("source-{}.st", finding.seed);
        let mutant = mutant(&texts, finding.seed);
        let written = std::fs::write(&path, &mutant.bytes);
        println!("==== seed {}, {:?}: {} ({path}: {written:?})", finding.seed, mutant.kinds, finding.description);
    }
    println!("{}{}", seen.checked.report(), seen.costs.report());
    let findings = seen.findings.len() + report.findings.len();
    println!("{findings} findings in {} sources", seen.checked.total);
    common::finish(findings)
}

fn look_at(texts: &[Vec<u8>], watch: &Watch, seeds: std::ops::Range<u64>) -> Seen {
    let mut seen = Seen::default();
    for seed in seeds {
        let mutant = mutant(texts, seed);
        let (result, cost) = measure::measure(watch, seed, || checked::check(&mutant.bytes));
        seen.costs.count(seed, cost);
        let description = result.map(|codes| seen.checked.count(&mutant, &codes)).err().or_else(|| cost.finding());
        seen.findings.extend(description.map(|description| Finding { seed, description }));
    }
    seen
}
