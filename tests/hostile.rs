//! Wrong input: a clear message and exit status 1, or a run that both engines do alike; never a panic.

mod common;

use std::panic::{AssertUnwindSafe, catch_unwind};

use common::{Scratch, khz, run, stderr};
use khz_bytecode::container;
use khz_bytecode::verify::verify;
use khz_frontend::{CompileOptions, SourceInput};
use khz_machine::engine::{DeadlineCell, Entry, Fuel, Limits};
use kilohertz::pipeline::{self, EngineKind, Program};

const SMALL: &str =
    "PROGRAM main VAR n : INT; a : ARRAY[0..3] OF REAL; END_VAR n := n + 1; a[n MOD 4] := INT_TO_REAL(n); END_PROGRAM";

#[test]
fn a_missing_file_is_named() {
    let output = run("run nowhere.st");
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("nowhere.st"), "{}", stderr(&output));
}

#[test]
fn an_empty_file_is_named() {
    let scratch = Scratch::new("empty");
    let path = scratch.write("empty.st", "");
    let output = khz().arg("check").arg(&path).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("empty.st: the file is empty"), "{}", stderr(&output));
}

#[test]
fn binary_noise_is_refused() {
    let scratch = Scratch::new("noise");
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let noise: Vec<u8> = (0..10_000)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 56) as u8
        })
        .collect();
    for name in ["noise.st", "noise.iplc"] {
        let path = scratch.write(name, &noise);
        for command in ["check", "run", "verify", "disasm"] {
            let output = khz().arg(command).arg(&path).output().unwrap();
            assert_eq!(output.status.code(), Some(1), "{command} {name}: {}", stderr(&output));
            assert!(stderr(&output).contains(name), "{command} {name}: {}", stderr(&output));
            assert!(!stderr(&output).contains("panicked"), "{command} {name}: {}", stderr(&output));
        }
    }
}

fn small_container() -> Vec<u8> {
    let source = SourceInput { name: "small.st".into(), bytes: SMALL.into() };
    let loaded = pipeline::compile(&[source], &CompileOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    container::write(loaded.programs[0].container()).unwrap()
}

#[test]
fn a_container_cut_at_every_byte_is_refused() {
    let bytes = small_container();
    for length in 0..bytes.len() {
        let result = catch_unwind(|| container::read(&bytes[..length]));
        let error =
            result.unwrap_or_else(|_| panic!("cut at {length}: panic")).expect_err("a cut container is refused");
        assert!(!error.to_string().is_empty());
    }
}

/// What a mutated container came to.
#[derive(Debug, PartialEq, Eq, Clone, Copy)]
enum Fate {
    Unreadable,
    Refused,
    Ran,
}

/// Reads, verifies and runs bytes in both engines under fuel; panics unless both do the same.
fn fate(bytes: &[u8]) -> Fate {
    let Ok(container) = container::read(bytes) else { return Fate::Unreadable };
    let Ok(verified) = verify(container) else { return Fate::Refused };
    let program = Program {
        name: String::new(),
        verified: std::sync::Arc::new(verified),
        container_bytes: bytes.len(),
        inputs: Vec::new(),
    };
    let Ok(layout) = program.layout(16 << 20) else { return Fate::Refused };
    let deadline = DeadlineCell::new();
    let runs: Vec<_> = EngineKind::BOTH
        .iter()
        .map(|kind| {
            let mut engine = program.engine(*kind, &layout, true).unwrap();
            let mut image = program.image(16 << 20).unwrap();
            let entries = (0..program.container().tasks.instances.len()).map(Entry::Instance);
            let mut results = Vec::new();
            for entry in entries.clone().chain(entries) {
                let mut fuel = Fuel { left: 100_000 };
                let limits = Limits { deadline: &deadline, fuel: Some(&mut fuel), task_index: 0 };
                results.push((engine.run(entry, &mut image, limits), fuel));
            }
            (results, image)
        })
        .collect();
    assert_eq!(runs[0].0, runs[1].0, "engines end differently");
    assert_eq!(runs[0].1.first_difference(&runs[1].1), None, "images differ");
    Fate::Ran
}

#[test]
fn one_flipped_bit_at_every_byte_never_panics() {
    let bytes = small_container();
    let mut counts = [0_usize; 3];
    for at in 0..bytes.len() {
        for resealed in [false, true] {
            let mut mutant = bytes.clone();
            mutant[at] ^= 1 << (at % 8);
            if resealed {
                container::reseal(&mut mutant);
            }
            let outcome = catch_unwind(AssertUnwindSafe(|| fate(&mutant)));
            let fate = outcome.unwrap_or_else(|_| panic!("byte {at}, resealed {resealed}: panic or engines differ"));
            counts[fate as usize] += 1;
        }
    }
    // A flip that nothing notices would make the hashes pointless; a reseal that never passes would make this test pointless.
    assert!(counts[Fate::Unreadable as usize] > bytes.len() / 2, "{counts:?}");
    assert!(counts[Fate::Ran as usize] > 10, "{counts:?}");
}

#[test]
fn wrong_usage_is_status_2() {
    for words in ["", "nonsense", "run", "run x.st --scans many", "run x.st --engine vm", "bench x.st --scans 0"] {
        assert_eq!(run(words).status.code(), Some(2), "khz {words}");
    }
}
