//! Spoiled containers and sources: none may hurt the reader, the verifier or the front end, and containers that verify run the same in every engine.
//!
//! Fixed seeds and counts; `examples/mutants.rs` and `examples/sources.rs` do the same for millions, and look at the time of each. Here only an item that
//! does not end fails, by its seed.

#[path = "common/bases.rs"]
mod bases;
#[path = "common/checked.rs"]
mod checked;
#[path = "common/measure.rs"]
mod measure;

use std::sync::Arc;

use checked::Checked;
use khz_bytecode::verify::Rule;
use khz_frontend::on_large_stack;
use khz_proof::campaign::{Campaign, Figures, Report};
use khz_proof::harness::engines;
use khz_proof::mutate::source::mutant;
use khz_proof::mutate::{Tally, accepted};
use khz_proof::oracle::{Plan, compare};
use khz_proof::statistics::Statistics;

/// Seconds that an item may take on the busiest machine: it takes less than one on a quiet one.
const HANG_S: u64 = 120;

#[derive(Default)]
struct Count(Tally);

impl Figures for Count {
    fn merge(&mut self, later: Self) {
        self.0.add(&later.0);
    }
}

fn search<F: Figures>(count: u64, check: impl Fn(u64, &mut F) -> Option<String> + Sync) -> Report<F> {
    let report = Campaign { first: 0, count, threads: 2, most_findings: 5 }.run(check, |_| ()).expect("a thread");
    assert!(report.findings.is_empty(), "{:#?}", report.findings);
    report
}

#[test]
fn mutants_of_containers_are_read_and_verified_without_harm() {
    let pool = bases::pool(150, &bases::texts(0, &[]));
    assert!(pool.len() > 300, "{} containers", pool.len());
    let watch = measure::no_hang("containers", HANG_S);
    let report = search(8_000, |seed, Count(tally)| {
        let mutant = pool.mutant(seed);
        let (verdict, cost) = measure::measure(&watch, seed, || mutant.classify());
        tally.count_mutant(&mutant, &verdict);
        // The clock is none of a test's business.
        measure::Cost { time_ns: 0, ..cost }.finding()
    });
    let Count(tally) = report.figures;
    assert!(tally.accepted * 20 >= tally.total, "at least 5% verify: {}", tally.report());
    // Of ten million mutants of the example every rule was broken by some, the rarest (V0090) by 197; these few reach most rules.
    let unmet = tally.unmet_rules();
    assert!(unmet.len() <= 15 && !unmet.contains(&Rule::TypeDepth), "mutants reach most rules: {}", tally.report());
}

#[test]
fn mutants_that_verify_run_the_same_in_every_engine() {
    #[derive(Default)]
    struct Ran(u64, Statistics);
    impl Figures for Ran {
        fn merge(&mut self, later: Self) {
            self.0 += later.0;
            self.1.merge(later.1);
        }
    }
    let watch = measure::no_hang("containers that verify", HANG_S);
    let look = |seed: u64, Ran(count, statistics): &mut Ran| {
        let makers = engines::makers();
        accepted(seed + 50_000, 30).find_map(|(number, verified)| {
            *count += 1;
            let plan = Plan { seed, scans: 2, fuel: 5_000, ..Plan::default() };
            let difference = compare(&Arc::new(verified), &makers, &plan, statistics).difference()?;
            Some(format!("mutant {number}: {}", difference.description))
        })
    };
    let report = search(40, |seed, ran: &mut Ran| watch.over(seed, || look(seed, ran)));
    assert!(report.figures.0 > 200, "{} mutants ran", report.figures.0);
}

#[test]
fn mutants_of_sources_are_checked_without_harm() {
    #[derive(Default)]
    struct Seen(Checked, Vec<String>);
    impl Figures for Seen {
        fn merge(&mut self, later: Self) {
            self.0.add(&later.0);
            self.1.extend(later.1);
        }
    }
    let texts = bases::texts(40, &[]);
    assert!(texts.len() > 500, "{} texts", texts.len());
    let watch = measure::no_hang("sources", HANG_S);
    // A seed of the search is a batch, for which the front end's thread is made once.
    let report = search(50, |batch, seen: &mut Seen| {
        let found = on_large_stack(|| {
            let mut found = Seen::default();
            for seed in batch * 80..(batch + 1) * 80 {
                let mutant = mutant(&texts, seed);
                let (result, cost) = measure::measure(&watch, seed, || checked::check(&mutant.bytes));
                let finding = result.map(|codes| found.0.count(&mutant, &codes)).err();
                let finding = finding.or_else(|| measure::Cost { time_ns: 0, ..cost }.finding());
                found.1.extend(finding.map(|words| format!("seed {seed}: {words}")));
            }
            found
        });
        seen.merge(found);
        None
    });
    let Seen(checked, findings) = report.figures;
    assert!(findings.is_empty(), "{findings:#?}");
    assert_eq!(checked.total, 4000);
    assert!(
        checked.with_diagnostics * 2 > checked.total && checked.with_diagnostics < checked.total,
        "{}",
        checked.report()
    );
    assert!(checked.codes.len() > 60, "{}", checked.report());
}
