//! A fault of the front end, which generated Structured Text finds.

use khz_bytecode::canary::{Fault, plant};

use super::hunt::hunt;
use khz_proof::harness::meaning::{Plan, Tally, check_seed};

/// Programs among which the fault must show.
const PROGRAMS: u64 = 400;
/// Tries of the shrinker.
const TRIES: usize = 600;

#[test]
fn a_fault_of_the_front_end_is_found_and_made_small() {
    let look = |seed, (): &mut ()| check_seed(seed, Plan::default(), &mut Tally::default(), 0);
    let seed = hunt(Fault::Frontend, PROGRAMS, look).seed;
    let report = {
        let _planted = plant(Fault::Frontend);
        check_seed(seed, Plan::default(), &mut Tally::default(), TRIES).expect("it shows again")
    };
    let text = report.split_once("\nPROGRAM").map_or("", |(_, text)| text);
    assert!(text.contains("USINT") && text.lines().count() < 16, "{report}");
}
