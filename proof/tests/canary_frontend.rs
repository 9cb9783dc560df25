//! The planted fault of the front end.
#![cfg(feature = "canary")]

#[path = "common/mod.rs"]
mod engines;
#[path = "common/st.rs"]
mod oracle;

use khz_bytecode::canary::{Fault, plant};
use oracle::{Tally, check_seed};

/// Programs among which the fault must show.
const PROGRAMS: u64 = 100;

#[test]
fn the_fault_of_the_front_end_is_found_and_made_small() {
    let found = {
        let _planted = plant(Fault::Frontend);
        (0..PROGRAMS).find_map(|seed| check_seed(seed, &mut Tally::default(), 600).map(|report| (seed, report)))
    };
    let (seed, report) = found.expect("the fault shows in one of the programs");
    let text = report.split_once("\nPROGRAM").map_or("", |(_, text)| text);
    assert!(text.contains("USINT") && text.lines().count() < 16, "{report}");
    assert_eq!(check_seed(seed, &mut Tally::default(), 0), None, "without the fault");
}
