//! Configurations of many tasks under the real scheduler against the brute-force model of the scheduling rules.

use khz_proof::campaign::Campaign;
use khz_proof::harness::schedule::{Tally, check_seed};
use khz_proof::harness::{engines, schedule};

/// Configurations of the test; `examples/schedule.rs` runs more.
const PLANS: u64 = 3000;
/// One of so many runs in both engines, the others in the interpreter alone: native code is most of the time here.
const IN_BOTH: u64 = 3;

#[test]
fn tasks_run_when_and_as_often_as_the_rules_say() {
    let campaign = Campaign { first: 0, count: PLANS, threads: 2, most_findings: 1 };
    let check = |seed: u64, tally: &mut Tally| {
        let makers = engines::makers();
        let used = if seed.is_multiple_of(IN_BOTH) { &makers[..] } else { &makers[..1] };
        check_seed(seed, used, tally, 400)
    };
    let report = campaign.run(check, |_| ()).expect("a thread");
    if let Some(found) = report.findings.first() {
        panic!("{}", found.description);
    }
    let tally = report.figures;
    assert_eq!((tally.plans, tally.unknown_values), (PLANS, 0), "{}", tally.report());
    let count = |what: &str| tally.reached.get(what).copied().unwrap_or(0);
    for (what, least) in schedule::REACHES {
        assert!(count(what) >= *least, "{what}: {} of {least}\n{}", count(what), tally.report());
    }
}
