//! Random programs in all engines.

mod common;

use std::sync::Arc;

use khz_proof::bytecode::generate;
use khz_proof::oracle::{Plan, compare};
use khz_proof::statistics::Statistics;

#[test]
fn random_programs_do_the_same_in_every_engine() {
    let mut statistics = Statistics::default();
    let makers = common::makers();
    for seed in 0..1500 {
        let verified = Arc::new(generate(seed));
        let plan = Plan { seed, ..Plan::default() };
        let difference = compare(&verified, &makers, &plan, &mut statistics).difference();
        if let Some(difference) = difference {
            panic!("seed {seed}: {}", difference.description);
        }
    }
    println!("{}", statistics.report());
}
