//! A fault of the scheduler, which the model of its rules finds in generated configurations.

use khz_bytecode::canary::{Fault, plant};

use super::hunt::hunt;
use khz_proof::harness::engines::makers;
use khz_proof::harness::schedule::{Tally, check_seed};

/// Configurations among which the fault must show.
const PLANS: u64 = 200;
/// Tries of the shrinker.
const TRIES: usize = 600;

#[test]
fn a_fault_of_the_scheduler_is_found_and_made_small() {
    // The engine plays no part in it.
    let check = |seed, tally: &mut Tally, tries| check_seed(seed, &makers()[..1], tally, tries);
    let seed = hunt(Fault::Scheduler, PLANS, |seed, tally| check(seed, tally, 0)).seed;
    let report = {
        let _planted = plant(Fault::Scheduler);
        check(seed, &mut Tally::default(), TRIES).expect("it shows again")
    };
    let (_, small) = report.split_once("\nsmall: ").expect("a report has its small plan");
    // A task that sleeps too long is late without a program of its own.
    let count = |word| small.matches(word).count();
    assert!(count(" TASK t") == 1 && count("PROGRAM P") <= 1, "{report}");
    assert!(small.contains("lost_cycles: 1"), "{report}");
}
