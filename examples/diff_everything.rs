//! Every program of this repository, or of folders, on both engines in lock-step with random inputs: `diff_everything [ROUNDS] [SEED] [FOLDER…]`.
//!
//! Each file is a program of its own; what has no inputs has its variables changed. The exit status is 5 when something differs or a file is
//! refused that does not say so, 2 when a word means nothing.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program for people")]

#[path = "../tests/common/everything.rs"]
mod everything;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use khz_proof::arguments::Grammar;

fn main() -> ExitCode {
    let grammar = Grammar { numbers: &["ROUNDS", "SEED"], options: &[], words: &[], folders: true };
    let line = match grammar.read(std::env::args().skip(1)) {
        Ok(line) => line,
        Err(wrong) => {
            eprintln!("{wrong}\n{}", grammar.usage());
            return ExitCode::from(2);
        }
    };
    let number = |at: usize, usual| line.numbers.get(at).copied().unwrap_or(usual);
    let (rounds, seed) = (number(0, 10_000), number(1, 1));
    let everywhere = || everything::folders(Path::new(env!("CARGO_MANIFEST_DIR")));
    let folders = if line.folders.is_empty() { everywhere() } else { line.folders };
    let files: Vec<PathBuf> = folders.iter().flat_map(|folder| everything::sources(folder)).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let tally = everything::run_all(&files, rounds, seed, threads);
    for wrong in tally.differences.iter().chain(&tally.refusals) {
        println!("==== {wrong}");
    }
    println!(
        "{} programs of {} files ({} files are refused as they say, {} have no PROGRAM), {} rounds, {} task cycles on each side",
        tally.programs,
        files.len(),
        tally.refused,
        tally.without_program,
        tally.rounds,
        tally.cycles
    );
    println!(
        "{} programs have inputs, of the others the variables were changed; {} traps, the same on all sides and reset; {} programs do not start",
        tally.with_inputs, tally.traps, tally.ended
    );
    println!(
        "{} differences, {} files that are refused and do not say so, or can not be read",
        tally.differences.len(),
        tally.refusals.len()
    );
    ExitCode::from(if tally.differences.is_empty() && tally.refusals.is_empty() { 0 } else { 5 })
}
