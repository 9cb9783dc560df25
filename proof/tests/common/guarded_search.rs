//! What runs between guard pages: a generated container and one of its mutants that verifies, many scans each, in both engines under fuel.

use std::sync::Arc;

use khz_bytecode::verify::Verified;
use khz_proof::bytecode::generate;
use khz_proof::mutate::accepted;
use khz_proof::oracle::{Plan, compare};
use khz_proof::statistics::Statistics;

use super::guarded::{Guarded, Side};
use khz_proof::harness::engines::makers;

/// Scans of each program.
pub const SCANS: u32 = 100;
/// Units of fuel of each run: enough for most.
const FUEL: u64 = 2000;
/// Mutants that are tried for each seed.
const TRIES: usize = 12;

/// Looks at one seed; what differs, if anything. An access outside ends the process.
pub fn look(seed: u64, statistics: &mut Statistics) -> Option<String> {
    let mutants = accepted(seed, TRIES).take(1).map(|(number, verified)| (format!("mutant {number}"), verified));
    let programs: Vec<(String, Verified)> =
        std::iter::once(("program".to_string(), generate(seed))).chain(mutants).collect();
    programs.into_iter().zip([seed, seed / 2]).find_map(|((name, verified), side)| {
        let side = if side.is_multiple_of(2) { Side::Before } else { Side::Behind };
        let plan = Plan { seed, scans: SCANS, fuel: FUEL, cuts: 0, ..Plan::default() };
        let found = Guarded::run(side, || compare(&Arc::new(verified), &makers(), &plan, statistics));
        found.difference().map(|found| format!("{name}, guarded {side:?}: {}", found.description))
    })
}
