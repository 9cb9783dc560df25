//! A search for one planted fault.

use std::time::Instant;

use khz_bytecode::canary::{Fault, plant};
use khz_proof::campaign::{Campaign, Figures, Finding, Report};

/// Looks for a fault in the programs of seeds 0 to `programs` with `look`, which says what it found: first without the fault, where nothing may be
/// found up to the seed that shows it, then with it. Shows how long that took.
pub fn hunt<F: Figures>(fault: Fault, programs: u64, look: impl Fn(u64, &mut F) -> Option<String> + Sync) -> Finding {
    let campaign = Campaign { first: 0, count: programs, threads: 2, most_findings: 1 };
    #[expect(clippy::disallowed_methods, reason = "only what people are shown, never a result")]
    let start = Instant::now();
    let found: Report<F> = {
        let _planted = plant(fault);
        campaign.run(&look, |_| ()).expect("a thread")
    };
    let elapsed_s = start.elapsed().as_secs_f64();
    let finding = found.findings.into_iter().next();
    let finding = finding.unwrap_or_else(|| panic!("not found in {programs} programs: {}", fault.text()));
    show(&format!("{fault:?}: seed {} of a search of {elapsed_s:.1} s. {}", finding.seed, fault.text()));
    let sound: Report<F> = Campaign { count: finding.seed + 1, ..campaign }.run(look, |_| ()).expect("a thread");
    assert_eq!(sound.findings, [], "without the fault");
    finding
}

/// A line for people who run the tests with `--nocapture`.
#[allow(clippy::print_stderr, reason = "only shown when asked for")]
fn show(line: &str) {
    eprintln!("{line}");
}
