//! Spoiled containers: none may hurt the reader or the verifier, and those that verify run the same in every engine.

mod common;

use std::sync::Arc;

use khz_proof::bytecode::generate;
use khz_proof::mutate::{Tally, Verdict, classify, mutant};
use khz_proof::oracle::{Plan, compare};
use khz_proof::random::Random;
use khz_proof::statistics::Statistics;

/// Containers, and mutants of each.
const CONTAINERS: u64 = 40;
const MUTANTS: u64 = 50;

#[test]
fn mutants_that_verify_run_the_same_in_every_engine() {
    let (mut tally, mut statistics) = (Tally::default(), Statistics::default());
    let makers = common::makers();
    for seed in 0..CONTAINERS {
        let container = generate(seed + 50_000);
        let mut random = Random::new(seed);
        for number in 0..MUTANTS {
            let verdict =
                mutant(&mut random, container.container()).map_or(Verdict::Unwritable, |bytes| classify(&bytes));
            tally.count(&verdict);
            let Verdict::Accepted(verified) = verdict else { continue };
            let plan = Plan { seed, scans: 2, fuel: 5_000, ..Plan::default() };
            if let Some(difference) = compare(&Arc::new(*verified), &makers, &plan, &mut statistics).difference() {
                panic!("mutant {number} of seed {seed}: {}", difference.description);
            }
        }
    }
    assert!(tally.accepted * 20 >= tally.total, "at least 5% verify: {}", tally.report());
    assert!(tally.by_code.len() >= 45, "mutants reach most rules: {}", tally.report());
}
