//! The arithmetic of generated Structured Text against C: `cc` is what Rust links with, so it is there.

#[path = "common/c.rs"]
mod c;

use c::{Tally, compare_seeds};

/// Programs of the test, in one C file; `examples/c_oracle.rs` runs more.
const PROGRAMS: u64 = 600;

#[test]
fn arithmetic_is_what_it_is_in_c() {
    let mut tally = Tally::default();
    let found = compare_seeds(0..PROGRAMS, &mut tally);
    assert!(found.is_empty(), "{} programs differ:\n{}", found.len(), found[0]);
    let (all, called, missing) = tally.coverage();
    assert!(all > 400 && called * 100 >= all * 95, "{called} of {all} operations are called, not {missing:?}");
    // An index beyond its array and a value beyond its range are rare in these programs; the longer run has many of both.
    let [division, index, range] = tally.traps;
    assert!(division > 0 && index + range > 0, "no program traps: {:?}", tally.traps);
    assert!(tally.programs as u64 == PROGRAMS && tally.values > 20_000, "{tally:?}");
}
