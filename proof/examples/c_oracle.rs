//! Compares the arithmetic of generated Structured Text with C over many programs: `c_oracle FIRST_SEED COUNT`, 500 programs in one C file.
#![allow(clippy::print_stdout, reason = "a program for people")]

#[path = "../tests/common/c.rs"]
mod c;
mod common;

use std::process::ExitCode;

/// Programs in one C file: the compiler holds all of them at once.
const AT_ONCE: u64 = 500;

fn main() -> ExitCode {
    let common::Arguments { first, count, .. } = common::Arguments::read(2000, &common::Known::default());
    let mut tally = c::Tally::default();
    let mut differences = 0;
    for start in (first..first + count).step_by(AT_ONCE as usize) {
        for found in c::compare_seeds(start..(start + AT_ONCE).min(first + count), &mut tally) {
            differences += 1;
            println!("==== {found}");
        }
    }
    let (all, called, missing) = tally.coverage();
    println!(
        "{differences} differences\n{} programs, {} scans, {} values, traps {:?}\n{called} of {all} operations called; not {missing:?}",
        tally.programs, tally.scans, tally.values, tally.traps
    );
    common::finish(differences)
}
