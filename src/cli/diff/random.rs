//! `khz diff --random N`: generated programs, Structured Text against its own meaning and containers against the third evaluator, in both engines.

use std::io::{IsTerminal, Write};
use std::sync::Arc;

use khz_proof::bytecode;
use khz_proof::campaign::{Campaign, Figures, Progress};
use khz_proof::harness::{engines, meaning};
use khz_proof::oracle::{Plan, compare, reduce as reduce_container};
use khz_proof::st;
use khz_proof::st::case::{Case, Round};
use khz_proof::st::compare::{Bench, Difference, Sort};
use khz_proof::statistics::Statistics;
use serde_json::json;

use super::super::args::{DiffArgs, Format};
use super::super::output::{Failure, people, result};
use super::super::{Outcome, Status};

/// Scans of each program.
const SCANS: u32 = 10;
/// Fuel of a scan, in units: a program that needs more says nothing.
const FUEL: u64 = 1_000_000;
const IMAGE_LIMIT_BYTES: u64 = 1 << 22;
/// Programs that are tried to make a difference small.
const TRIES: usize = 2000;

/// What was reached.
#[derive(Default)]
struct Reached {
    text: meaning::Tally,
    /// Programs of Structured Text that both engines also ran with values from outside.
    with_inputs: u64,
    containers: Statistics,
}

impl Figures for Reached {
    fn merge(&mut self, later: Self) {
        self.text.merge(later.text);
        self.with_inputs += later.with_inputs;
        self.containers.merge(later.containers);
    }
}

/// Which programs a seed makes: of an odd number the last seed makes only the one of Structured Text.
#[derive(Clone, Copy)]
struct Programs {
    first: u64,
    count: u64,
}

impl Programs {
    fn has_container(self, seed: u64) -> bool {
        self.count.is_multiple_of(2) || seed != self.first.wrapping_add(self.count / 2)
    }
}

/// Runs it.
pub fn run(args: &DiffArgs, count: u64) -> Outcome {
    let first = args.seed.unwrap_or(0);
    if first.checked_add(count.div_ceil(2)).is_none() {
        return Err(Failure::usage(format!(
            "--seed {first}: the seeds of {count} programs from there on are beyond 64 bits"
        )));
    }
    let programs = Programs { first, count };
    let threads = args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let campaign = Campaign { first, count: count.div_ceil(2), threads, most_findings: 1 };
    let report = campaign
        .run(|seed, reached: &mut Reached| check(args, programs, seed, reached), show)
        .map_err(|error| no_thread(&error))?;
    if std::io::stderr().is_terminal() {
        // The line is people's only; a closed terminal does not matter.
        let _ = write!(std::io::stderr(), "\r\x1b[K");
    }
    let found = report.findings.first();
    let small = found.map(|found| {
        // On a thread like those of the search: shrinkers recurse.
        let alone = Campaign { first: found.seed, count: 1, threads: 1, most_findings: 1 };
        let small = alone.run(|seed, (): &mut ()| smallest(args, programs, seed), |_| ());
        let findings = small.map(|small| small.findings).unwrap_or_default();
        findings.into_iter().next().map_or_else(|| found.description.clone(), |small| small.description)
    });
    let Reached { text, with_inputs, containers } = &report.figures;
    let statistics = format!(
        "Structured Text: {}\n{with_inputs} of them with values from outside in both engines\ncontainers: {}",
        text.report().trim_end(),
        containers.report().trim_end()
    );
    let (compared, refused) = (text.programs + containers.programs, text.refused);
    if args.common.format == Format::Json {
        let difference =
            found.map(|found| json!({ "seed": found.seed, "description": found.description, "smallest": small }));
        result(
            &json!({ "equal": found.is_none(), "programs": count, "compared": compared, "refused": refused, "seed": first, "seeds_done": report.done, "difference": difference, "reached": statistics })
                .to_string(),
        );
    } else {
        people(&statistics);
        match (found, &small) {
            (Some(found), Some(small)) => {
                people(&format!("seed {} differs: {}\n{small}", found.seed, found.description));
            }
            _ => people(&format!(
                "equal: {count} programs, {SCANS} scans each, from seed {first} on ({compared} compared, {refused} refused by the compiler)"
            )),
        }
    }
    Ok(if found.is_some() { Status::Differ } else { Status::Done })
}

/// The machine has no thread for the search.
fn no_thread(error: &std::io::Error) -> Failure {
    Failure::Message(Status::Host, format!("no thread can be had: {error}"))
}

/// How far it is, on a terminal.
fn show(progress: Progress) {
    if std::io::stderr().is_terminal() {
        // The line is people's only; a closed terminal does not matter.
        let _ = write!(std::io::stderr(), "\r\x1b[K{} of {} seeds  (Ctrl+C stops)", progress.done, progress.count);
    }
}

/// What the programs of a seed show, in a few words.
fn check(args: &DiffArgs, programs: Programs, seed: u64, reached: &mut Reached) -> Option<String> {
    let _planted = super::plant(args);
    let (text, rounds) = case(seed);
    if let Some(found) = bench(|bench| engines_differ(bench, &text, &rounds)) {
        return Some(format!("Structured Text, {} and {}: {}", found.left, found.right, found.description));
    }
    let compared = reached.text.programs;
    if let Some(found) = meaning::check_seed(seed, meaning::Plan::default(), &mut reached.text, 0) {
        return Some(format!("Structured Text against its meaning: {}", first_lines(&found, 2)));
    }
    // One that the compiler refused ran nowhere.
    reached.with_inputs += reached.text.programs - compared;
    if !programs.has_container(seed) {
        return None;
    }
    let engines = engines::Engines::of_seed(seed);
    let verified = Arc::new(bytecode::generate(seed));
    let found = compare(&verified, &engines.makers(), &plan(seed), &mut reached.containers).difference();
    engines.note(&mut reached.containers);
    found.map(|found| format!("container: {}", first_lines(&found.description, 3)))
}

/// The smallest program that still differs: between the engines with both traces side by side, against its meaning with what differs first.
fn smallest(args: &DiffArgs, programs: Programs, seed: u64) -> Option<String> {
    let _planted = super::plant(args);
    let case = Case::new(st::generate(seed), seed, SCANS as usize);
    let small = bench(|bench| {
        let compare = |text: &str, rounds: &[Round]| engines_differ(bench, text, rounds);
        st::reduce::reduce(&case, &compare, TRIES)
    });
    if let Some(small) = small {
        return Some(small.to_string());
    }
    if let Some(found) = meaning::check_seed(seed, meaning::Plan::default(), &mut meaning::Tally::default(), TRIES) {
        return Some(found);
    }
    if !programs.has_container(seed) {
        return None;
    }
    let verified = Arc::new(bytecode::generate(seed));
    let engines = engines::Engines::of_seed(seed);
    let found = compare(&verified, &engines.makers(), &plan(seed), &mut Statistics::default()).difference()?;
    let only: Vec<_> = engines.makers().into_iter().filter(|maker| maker.name == found.engine).collect();
    Some(reduce_container(&verified, &only, &plan(seed), TRIES).1)
}

fn plan(seed: u64) -> Plan {
    Plan { seed, scans: SCANS, ..Plan::default() }
}

/// A program of Structured Text, and what comes from outside.
fn case(seed: u64) -> (String, Vec<Round>) {
    let case = Case::new(st::generate(seed), seed, SCANS as usize);
    (st::print::print(&case.source), case.rounds)
}

fn bench<T>(with: impl FnOnce(&Bench<'_>) -> T) -> T {
    let makers = engines::makers();
    with(&Bench { compile: &engines::compile, makers: &makers, fuel: FUEL, image_limit_bytes: IMAGE_LIMIT_BYTES })
}

/// A difference between the engines. What the compiler refuses is the business of the other oracle, which knows why it may.
fn engines_differ(bench: &Bench<'_>, text: &str, rounds: &[Round]) -> Option<Difference> {
    bench.compare(text, rounds).filter(|found| !matches!(found.sort, Sort::Refused(_)))
}

fn first_lines(text: &str, count: usize) -> String {
    text.lines().take(count).collect::<Vec<_>>().join(" | ")
}
