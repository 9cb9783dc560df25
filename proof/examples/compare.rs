//! Compares engines over many random programs: `compare FIRST_SEED COUNT [interp|jit]…`. What differs is printed small.
#![allow(clippy::print_stdout, reason = "a program for people")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::sync::Arc;

use khz_proof::bytecode::generate;
use khz_proof::oracle::{Plan, compare, reduce};
use khz_proof::statistics::Statistics;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().and_then(|word| word.parse::<u64>().ok());
    let (first, count) = (number().unwrap_or(0), number().unwrap_or(1000));
    let wanted: Vec<String> = arguments.collect();
    let makers: Vec<_> = common::makers()
        .into_iter()
        .filter(|maker| wanted.is_empty() || wanted.iter().any(|name| name == maker.name))
        .collect();
    let mut statistics = Statistics::default();
    let mut differences = 0;
    for seed in first..first + count {
        let verified = Arc::new(generate(seed));
        let plan = Plan { seed, ..Plan::default() };
        let Some(found) = compare(&verified, &makers, &plan, &mut statistics).difference() else { continue };
        differences += 1;
        println!("==== seed {seed}: {}", found.description.lines().take(3).collect::<Vec<_>>().join(" | "));
        if differences <= 6 {
            let only: Vec<_> = common::makers().into_iter().filter(|maker| maker.name == found.engine).collect();
            let (shrunk, description) = reduce(&verified, &only, &plan, 4000);
            println!("{} instructions\n{description}", shrunk.instructions);
        }
    }
    println!("{differences} differences\n{}", statistics.report());
}
