//! Compares generated Structured Text with its tree over many programs: `st FIRST_SEED COUNT`. What differs is printed small.
#![allow(clippy::print_stdout, reason = "a program for people")]

#[path = "../tests/common/mod.rs"]
mod engines;
#[path = "../tests/common/st.rs"]
mod oracle;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().and_then(|word| word.parse::<u64>().ok());
    let (first, count) = (number().unwrap_or(0), number().unwrap_or(1000));
    let mut tally = oracle::Tally::default();
    let mut differences = 0;
    for seed in first..first + count {
        let tries = if differences < 8 { 600 } else { 0 };
        if let Some(found) = oracle::check_seed(seed, &mut tally, tries) {
            differences += 1;
            let lines = if tries > 0 { 200 } else { 2 };
            println!("==== {}", found.lines().take(lines).collect::<Vec<_>>().join("\n"));
        }
    }
    println!("{differences} differences\n{}", tally.report());
}
