//! Every program that there is, on both engines in lock-step with random inputs: for the test and for the long run of the example of the same name.
#![allow(dead_code, reason = "each user takes its part")]

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use khz_frontend::{CompileOptions, Dialect, SourceInput};
use khz_proof::harness::programs::{PROGRAMS, WORKLOADS};
use kilohertz::lockstep::inputs::RandomInputs;
use kilohertz::lockstep::{EngineUnderTest, Lockstep, Options, Summary};
use kilohertz::pipeline::{self, Program, Refused};

const MAX_IMAGE_BYTES: u64 = 1 << 26;
/// Microseconds of fuel of a task's cycle: a loop that random values make long ends in a trap, like any other.
const WATCHDOG_US: u64 = 2_000;

/// What all programs came to.
#[derive(Debug, Default)]
pub struct Tally {
    /// Programs that were run.
    pub programs: u64,
    /// Files that are refused, and say so in their first lines.
    pub refused: u64,
    /// Files that hold no PROGRAM.
    pub without_program: u64,
    /// Programs with inputs of their own; the others have only their variables changed.
    pub with_inputs: u64,
    pub rounds: u64,
    pub cycles: u64,
    pub traps: u64,
    /// Programs whose initialisation traps.
    pub ended: u64,
    /// Programs on which the sides differ.
    pub differences: Vec<String>,
    /// Files that can not be read, or are refused and do not say so.
    pub refusals: Vec<String>,
}

impl Tally {
    pub fn add(&mut self, other: Tally) {
        self.programs += other.programs;
        self.refused += other.refused;
        self.without_program += other.without_program;
        self.with_inputs += other.with_inputs;
        self.rounds += other.rounds;
        self.cycles += other.cycles;
        self.traps += other.traps;
        self.ended += other.ended;
        self.differences.extend(other.differences);
        self.refusals.extend(other.refusals);
    }
}

/// Files of sources in a folder and below, by path.
pub fn sources(folder: &Path) -> Vec<PathBuf> {
    kilohertz::files::list(&[folder.to_path_buf()]).unwrap_or_default()
}

/// The folders of this repository that hold programs, and the workloads where they are present.
pub fn folders(root: &Path) -> Vec<PathBuf> {
    PROGRAMS.iter().map(|folder| root.join(folder)).chain([root.join(WORKLOADS)]).filter(|f| f.exists()).collect()
}

/// Runs every program of some files, on some threads; what is wrong comes in the order of the files.
pub fn run_all(files: &[PathBuf], rounds: u64, seed: u64, threads: usize) -> Tally {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut found = Vec::new();
        while let Some(file) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
            found.push((file.clone(), run_file(file, rounds, seed)));
        }
        found
    };
    let mut all: Vec<(PathBuf, Tally)> = std::thread::scope(|scope| {
        let builder = || std::thread::Builder::new().stack_size(32 << 20);
        let running: Vec<_> =
            (0..threads.max(1)).map(|_| builder().spawn_scoped(scope, work).expect("a thread")).collect();
        running.into_iter().flat_map(|worker| worker.join().expect("a program panicked")).collect()
    });
    all.sort_by(|a, b| a.0.cmp(&b.0));
    let mut tally = Tally::default();
    all.into_iter().for_each(|(_, one)| tally.add(one));
    tally
}

fn run_file(path: &Path, rounds: u64, seed: u64) -> Tally {
    let mut tally = Tally::default();
    let name = path.display().to_string();
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) => {
            tally.refusals.push(format!("{name}: {error}"));
            return tally;
        }
    };
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let says = |word: &str| text.lines().map_while(|line| line.strip_prefix("// ")).any(|line| line.starts_with(word));
    let dialect = if says("dialect: iec") { Dialect::Iec } else { Dialect::Default };
    let options = CompileOptions { dialect, ..CompileOptions::default() };
    let source = SourceInput { name: name.clone(), bytes };
    match pipeline::compile(&[source], &options) {
        Err(Refused::Diagnostics { .. }) if says("error:") || says("not yet") || !text.contains("PROGRAM") => {
            tally.refused += 1;
        }
        Err(error) => tally.refusals.push(format!("{name}: {error}")),
        Ok(loaded) if loaded.programs.is_empty() => tally.without_program += 1,
        Ok(loaded) => loaded.programs.iter().for_each(|program| run_program(&name, program, rounds, seed, &mut tally)),
    }
    tally
}

/// A program with its inputs changed; one that has none with its variables changed.
fn run_program(name: &str, program: &Program, rounds: u64, seed: u64, tally: &mut Tally) {
    tally.programs += 1;
    match compare(program, rounds, seed) {
        Ok((summary, has_inputs)) => {
            tally.with_inputs += u64::from(has_inputs);
            tally.rounds += summary.rounds;
            tally.cycles += summary.cycles;
            tally.traps += summary.traps.values().sum::<u64>();
            tally.ended += u64::from(summary.ended.is_some());
        }
        Err(reason) => tally.differences.push(format!("{name}, RESOURCE {}: {reason}", program.name)),
    }
}

fn compare(program: &Program, rounds: u64, seed: u64) -> Result<(Summary, bool), String> {
    let engines = EngineUnderTest::standard(program, MAX_IMAGE_BYTES).map_err(|error| error.to_string())?;
    let options = Options {
        max_image_bytes: MAX_IMAGE_BYTES,
        watchdog_us: WATCHDOG_US,
        idle_goes_on: true,
        ..Options::default()
    };
    let mut lockstep = Lockstep::open(program, engines, options).map_err(|error| error.to_string())?;
    let mut inputs = RandomInputs::new(program, lockstep.image().layout(), seed, &[]);
    let has_inputs = !inputs.is_empty();
    if !has_inputs {
        inputs = inputs.and_variables(&[]);
    }
    let summary = lockstep.run(Some(&mut inputs), rounds).map_err(|found| format!("{found:#?}"))?;
    Ok((summary, has_inputs))
}
