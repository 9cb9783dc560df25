//! Compares the arithmetic of generated Structured Text with C over many programs: `c_oracle FIRST_SEED COUNT`, 500 programs in one C file.
#![allow(clippy::print_stdout, reason = "a program for people")]

#[path = "../tests/common/c.rs"]
mod c;

/// Programs in one C file: the compiler holds all of them at once.
const AT_ONCE: u64 = 500;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().and_then(|word| word.parse::<u64>().ok());
    let (first, count) = (number().unwrap_or(0), number().unwrap_or(2000));
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
        "{differences} differences\n{} programs ({} more refused for a constant trap), {} scans, {} values, traps {:?}\n{called} of {all} operations called; not {missing:?}",
        tally.programs, tally.refused, tally.scans, tally.values, tally.traps
    );
}
