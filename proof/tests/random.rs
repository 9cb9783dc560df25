//! Random programs in all engines, and that they reach everything.

mod common;

use std::sync::Arc;

use khz_bytecode::trap::TrapCode;
use khz_jit::Passes;
use khz_proof::bytecode::generate;
use khz_proof::oracle::{Maker, Plan, compare};
use khz_proof::statistics::Statistics;

/// How many programs; `examples/compare.rs` runs more.
const PROGRAMS: u64 = 600;

#[test]
fn random_programs_do_the_same_in_every_engine() {
    let mut statistics = Statistics::default();
    let makers = common::makers();
    for seed in 0..PROGRAMS {
        let verified = Arc::new(generate(seed));
        let plan = Plan { seed, ..Plan::default() };
        let difference = compare(&verified, &makers, &plan, &mut statistics).difference();
        if let Some(difference) = difference {
            panic!("seed {seed}: {}", difference.description);
        }
    }
    let report = statistics.report();
    assert_eq!(statistics.executed.rare(20), Vec::<&str>::new(), "every instruction runs: {report}");
    for code in TrapCode::ALL {
        assert!(statistics.executed.trap_count(*code) >= 20, "every trap happens: {report}");
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
    let none = common::native_with(Passes::NONE);
    let alone: Vec<_> =
        (Passes::NAMES.iter()).map(|name| (*name, common::native_with(Passes::NONE.with(name).unwrap()))).collect();
    let mut makers = vec![Maker { name: "jit without passes", make: &none }];
    makers.extend(alone.iter().map(|(name, make)| Maker { name, make }));
    for seed in 20_000..20_040 {
        let verified = Arc::new(generate(seed));
        let plan = Plan { seed, ..Plan::default() };
        let difference = compare(&verified, &makers, &plan, &mut Statistics::default()).difference();
        if let Some(difference) = difference {
            panic!("seed {seed}: {}", difference.description);
        }
    }
}
