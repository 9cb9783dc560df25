//! Differences that were found once, made small: `tests/regressions/*.kasm`. Each is a container that all engines must run alike.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use khz_bytecode::assembler::assemble;
use khz_bytecode::verify::verify;
use khz_proof::harness::engines;
use khz_proof::oracle::{Plan, compare};
use khz_proof::statistics::Statistics;

#[test]
fn what_differed_once_does_not_differ_again() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/regressions");
    let mut paths: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty());
    for path in paths {
        let text = fs::read_to_string(&path).unwrap();
        let container = assemble(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let verified = verify(container).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let verified = Arc::new(verified);
        for seed in 0..4 {
            let plan = Plan { seed, cuts: 3, ..Plan::default() };
            let difference = compare(&verified, &engines::makers(), &plan, &mut Statistics::default()).difference();
            if let Some(difference) = difference {
                panic!("{}: {}", path.display(), difference.description);
            }
        }
    }
}
