//! Spoils containers and compares engines on those that verify: `mutants FIRST_SEED COUNT MUTANTS_EACH [interp|jit]…`.
#![allow(clippy::print_stdout, reason = "a program for people")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::sync::Arc;

use khz_proof::bytecode::generate;
use khz_proof::mutate::{Tally, Verdict, classify, mutant};
use khz_proof::oracle::{Plan, compare, reduce};
use khz_proof::random::Random;
use khz_proof::statistics::Statistics;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().and_then(|word| word.parse::<u64>().ok());
    let (first, count, each) = (number().unwrap_or(0), number().unwrap_or(100), number().unwrap_or(100));
    let wanted: Vec<String> = arguments.collect();
    let makers: Vec<_> = common::makers()
        .into_iter()
        .filter(|maker| wanted.is_empty() || wanted.iter().any(|name| name == maker.name))
        .collect();
    let (mut tally, mut statistics) = (Tally::default(), Statistics::default());
    let mut differences = 0;
    for seed in first..first + count {
        let container = generate(seed);
        let mut random = Random::new(seed);
        for number in 0..each {
            let verdict =
                mutant(&mut random, container.container()).map_or(Verdict::Unwritable, |bytes| classify(&bytes));
            tally.count(&verdict);
            let Verdict::Accepted(verified) = verdict else { continue };
            let plan = Plan { seed, scans: 2, fuel: 5_000, ..Plan::default() };
            let verified = Arc::new(*verified);
            let Some(found) = compare(&verified, &makers, &plan, &mut statistics).difference() else { continue };
            differences += 1;
            println!(
                "==== mutant {number} of seed {seed}: {}",
                found.description.lines().take(3).collect::<Vec<_>>().join(" | ")
            );
            if differences <= 6 {
                let only: Vec<_> = common::makers().into_iter().filter(|maker| maker.name == found.engine).collect();
                let (shrunk, description) = reduce(&verified, &only, &plan, 4000);
                println!("{} instructions\n{description}", shrunk.instructions);
            }
        }
    }
    println!("{differences} differences\n{}\n{}", tally.report(), statistics.report());
}
