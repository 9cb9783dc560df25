//! Every program of this repository, or of folders, on both engines in lock-step with random inputs: `diff_everything [ROUNDS] [SEED] [FOLDER…]`.
//!
//! Each file is a program of its own; what has no inputs has its variables changed. The exit status is 5 when something differs.
#![allow(clippy::print_stdout, reason = "a program for people")]

#[path = "../tests/common/everything.rs"]
mod everything;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut words = std::env::args().skip(1);
    let mut number = || words.next().and_then(|word| word.parse::<u64>().ok());
    let (rounds, seed) = (number().unwrap_or(10_000), number().unwrap_or(1));
    let named: Vec<PathBuf> = words.map(PathBuf::from).collect();
    let folders = if named.is_empty() { everything::folders(Path::new(env!("CARGO_MANIFEST_DIR"))) } else { named };
    let files: Vec<PathBuf> = folders.iter().flat_map(|folder| everything::sources(folder)).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let tally = everything::run_all(&files, rounds, seed, threads);
    for wrong in &tally.wrong {
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
    println!("{} differences", tally.wrong.len());
    ExitCode::from(if tally.wrong.is_empty() { 0 } else { 5 })
}
