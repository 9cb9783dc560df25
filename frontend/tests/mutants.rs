//! One slip in a program: what refuses it says so at a place, and says little. A fixed sample of what
//! `cargo run --release -p khz-frontend --example spoiled_programs` does with all conformance programs.

#[path = "support/mutants.rs"]
mod mutants;

use mutants::{SLIPS, Tally, mutant, tokens, verdict};
use std::path::{Path, PathBuf};

/// Of the programs, how many are left out between two of the sample; of their mutants the same.
const PROGRAM_STEP: usize = 24;
const MUTANT_STEP: usize = 17;

fn programs() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/conformance");
    let clauses = std::fs::read_dir(folder).expect("the conformance programs").flatten();
    let mut found: Vec<PathBuf> = clauses
        .flat_map(|clause| std::fs::read_dir(clause.path()).into_iter().flatten().flatten())
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "st"))
        .collect();
    found.sort();
    found
}

#[test]
fn one_slip_gives_few_diagnostics_and_each_has_its_place() {
    let mut tally = Tally::default();
    let mut number = 0;
    for path in programs().iter().step_by(PROGRAM_STEP) {
        let text = std::fs::read_to_string(path).expect("a program is text");
        let tokens = tokens(&text);
        for at in 0..tokens.len() {
            for slip in SLIPS {
                number += 1;
                if number % MUTANT_STEP != 0 {
                    continue;
                }
                let Some(changed) = mutant(&text, &tokens, at, slip) else { continue };
                let found = verdict(&changed);
                let what = format!("{} token {at} {slip:?}: {:?}", path.display(), found.lines);
                assert_eq!(found.without_place, 0, "{what}");
                assert_ne!(found.refused, found.is_compiled, "what gives no container is refused, at a place: {what}");
                tally.add(&found);
            }
        }
    }
    assert!(tally.refused > 500, "{tally:?}: the sample is too small to say anything");
    assert!(tally.few_per_mille() >= 950, "{tally:?}");
}

#[test]
fn lost_names_are_not_reported_again_where_they_are_used() {
    for (text, lines) in [
        // A name too many and one too few in a list.
        ("PROGRAM p\nVAR\n  a b, c : INT;\nEND_VAR\n  b := c + a;\nEND_PROGRAM\n", 1),
        ("PROGRAM p\nVAR\n  , b : INT;\nEND_VAR\n  b := a;\nEND_PROGRAM\n", 1),
        // A declaration without its name; what is unknown elsewhere is still said.
        ("PROGRAM p\nVAR\n  : INT;\nEND_VAR\n  b := 1;\nEND_PROGRAM\n", 1),
        ("PROGRAM p\nVAR\n  : INT;\nEND_VAR\n  b := 1;\nEND_PROGRAM\nPROGRAM q\n  z := 1;\nEND_PROGRAM\n", 2),
        // An enumeration, an array and a function that lost something.
        (
            "TYPE\n  C : (red green, blue);\nEND_TYPE\nPROGRAM p\nVAR\n  c : C;\nEND_VAR\n  c := green;\n  c := blue;\nEND_PROGRAM\n",
            1,
        ),
        ("PROGRAM p\nVAR\n  a : ARRAY ARRAY[0..3] OF INT := [1, 2, 3, 4];\nEND_VAR\n  a[1] := 2;\nEND_PROGRAM\n", 1),
        ("FUNCTION : INT\nEND_FUNCTION\nPROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := f();\nEND_PROGRAM\n", 1),
    ] {
        let found = verdict(text);
        assert!(found.refused && found.lines.len() == lines, "{text}\n{:#?}", found.lines);
    }
}
