//! Every program below a folder × every token × (deleted, doubled, swapped): how many diagnostics one slip causes.
//!
//! ```sh
//! cargo run --release -p khz-frontend --example spoiled_programs -- tests/conformance      # all of it
//! cargo run --release -p khz-frontend --example spoiled_programs -- tests/conformance 5    # and mutants with 5 or more, one in 50
//! cargo run --release -p khz-frontend --example spoiled_programs -- tests/conformance 99 7 # every seventh mutant
//! ```

#![allow(clippy::print_stdout, reason = "an example prints")]

#[path = "../tests/support/mutants.rs"]
mod mutants;

use mutants::{SLIPS, Tally, mutant, tokens, verdict};
use std::path::{Path, PathBuf};

fn programs(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            programs(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "st") {
            found.push(path);
        }
    }
    found.sort();
}

fn main() {
    let mut words = std::env::args().skip(1);
    let folder = words.next().unwrap_or_else(|| "tests/conformance".to_owned());
    let shown: usize = words.next().and_then(|word| word.parse().ok()).unwrap_or(usize::MAX);
    let every: usize = words.next().and_then(|word| word.parse().ok()).unwrap_or(1).max(1);
    let mut number = 0_usize;
    let mut files = Vec::new();
    programs(Path::new(&folder), &mut files);
    let (mut tally, mut many) = (Tally::default(), 0_usize);
    for path in &files {
        let Ok(text) = std::fs::read_to_string(path) else { continue };
        let tokens = tokens(&text);
        for at in 0..tokens.len() {
            for slip in SLIPS {
                number += 1;
                if !number.is_multiple_of(every) {
                    continue;
                }
                let Some(changed) = mutant(&text, &tokens, at, slip) else { continue };
                let found = verdict(&changed);
                tally.add(&found);
                if found.refused && found.diagnostics.len() >= shown {
                    many += 1;
                    if many % 50 == 1 {
                        let token = &text[tokens[at].start as usize..tokens[at].end as usize];
                        println!("{} token {at} `{token}` {slip:?}:\n  {}", path.display(), found.lines.join("\n  "));
                    }
                }
            }
        }
    }
    println!("{} programs, {} mutants, {} refused", files.len(), tally.mutants, tally.refused);
    println!("diagnostics without a place in the file: {}", tally.without_place);
    println!("neither compiled nor refused: {}", tally.silent);
    println!("refused mutants by number of diagnostics: {:?}", tally.counts);
    println!("at most 3: {} of 1000", tally.few_per_mille());
}
