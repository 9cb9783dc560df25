//! Every example, workload, test program and conformance program on both engines in lock-step, with random inputs; `examples/diff_everything.rs` runs them for longer.

mod common;
#[path = "common/everything.rs"]
mod everything;

use common::root;

/// Rounds of each program; the example runs 10,000.
const ROUNDS: u64 = 50;

#[test]
fn no_program_that_there_is_differs() {
    let files: Vec<_> = everything::folders(&root()).iter().flat_map(|folder| everything::sources(folder)).collect();
    let tally = everything::run_all(&files, ROUNDS, 1, 2);
    for (what, wrong) in [("programs differ", &tally.differences), ("files are refused", &tally.refusals)] {
        assert!(wrong.is_empty(), "{} {what}:\n{}", wrong.len(), wrong.join("\n"));
    }
    // A comparison that compares nothing would be quiet too.
    assert!(tally.programs >= 800 && tally.with_inputs >= 3, "{tally:?}");
    assert!(tally.rounds + tally.ended * ROUNDS >= tally.programs * ROUNDS, "{tally:?}");
    assert!(tally.cycles * 2 > tally.rounds && tally.traps > 1000, "{tally:?}");
    assert!(tally.ended < 10, "{tally:?}");
}
