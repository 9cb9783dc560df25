//! Random programs in all engines, and that they reach everything.

use std::sync::Arc;

use khz_bytecode::trap::TrapCode;
use khz_jit::Passes;
use khz_proof::bytecode::generate;
use khz_proof::campaign::{Campaign, Report};
use khz_proof::harness::{engines, engines::Engines};
use khz_proof::oracle::{Maker, Plan, compare};
use khz_proof::statistics::Statistics;

/// How many programs; `examples/compare.rs` runs more.
const PROGRAMS: u64 = 12_000;
/// Scans of each.
const SCANS: u32 = 10;

#[test]
fn random_programs_do_the_same_in_every_engine() {
    let campaign = Campaign { first: 0, count: PROGRAMS, threads: 2, most_findings: 1 };
    let look = |seed: u64, statistics: &mut Statistics| {
        let plan = Plan { seed, scans: SCANS, ..Plan::default() };
        let engines = Engines::of_seed(seed);
        let found = compare(&Arc::new(generate(seed)), &engines.makers(), &plan, statistics).difference();
        engines.note(statistics);
        found.map(|found| found.description)
    };
    let Report { findings, figures: statistics, .. } = campaign.run(look, |_| ()).expect("a thread");
    assert_eq!(findings, []);
    let report = statistics.report();
    assert_eq!(statistics.executed.rare(500), Vec::<&str>::new(), "every instruction runs: {report}");
    for code in TrapCode::ALL {
        assert!(statistics.executed.trap_count(*code) >= 500, "every trap happens: {report}");
    }
    let passes: Vec<&str> = statistics.passes.keys().copied().collect();
    let mut known = Passes::NAMES.to_vec();
    known.sort_unstable();
    assert_eq!(passes, known);
    for (pass, count) in &statistics.passes {
        assert!(*count >= PROGRAMS / 100, "pass {pass} changes something: {report}");
    }
    for (feature, count) in &statistics.features {
        assert!(*count >= PROGRAMS / 50, "programs with {feature} are common: {report}");
    }
    assert!(
        statistics.without_fuel * 2 > PROGRAMS && statistics.trapped * 10 < statistics.runs * 8,
        "most programs end: {report}"
    );
}

#[test]
fn native_code_is_the_same_without_passes_and_with_each_alone() {
    let none = engines::native_with(Passes::NONE);
    let alone: Vec<_> =
        (Passes::NAMES.iter()).map(|name| (*name, engines::native_with(Passes::NONE.with(name).unwrap()))).collect();
    let mut makers = vec![Maker::new("jit without passes", &none)];
    makers.extend(alone.iter().map(|(name, make)| Maker::new(name, make)));
    for seed in 20_000..20_040 {
        let verified = Arc::new(generate(seed));
        let plan = Plan { seed, ..Plan::default() };
        let difference = compare(&verified, &makers, &plan, &mut Statistics::default()).difference();
        if let Some(difference) = difference {
            panic!("seed {seed}: {}", difference.description);
        }
    }
}
