//! The standard, clause by clause: `tests/conformance/<clause>-<name>/NNN_name.st`, each about one row of a table, and
//! `docs/conformance.md`, which is made of their first lines (`KHZ_BLESS=1 cargo test --test conformance` writes it).
//!
//! The first line of a file is `// table 29: ADD; of SINT`: where the standard has it, the feature, and what of it. The values were
//! worked out with exact integer and IEEE arithmetic and models of the standard's figures, not by running Kilohertz.

mod common;
#[path = "common/programs.rs"]
mod programs;

use std::fmt::Write;
use std::path::PathBuf;

use common::{files, root};
use programs::{Expected, check_all};

/// The clauses' folders, in the order of the standard.
fn folders() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join("tests/conformance")).expect("the conformance folder");
    let mut found: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    found.sort();
    found
}

fn all() -> Vec<PathBuf> {
    folders().iter().flat_map(|folder| files(folder, "st")).collect()
}

#[test]
fn programs_come_to_what_they_say() {
    let files = all();
    assert!(files.len() >= 400, "{} programs", files.len());
    let wrong = check_all(&root().join("tests/conformance"), &files);
    assert!(wrong.is_empty(), "{} findings\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn first_lines_say_what_is_expected() {
    for path in all() {
        let expected = Expected::of(&std::fs::read_to_string(&path).expect("a readable file"));
        let shows = !expected.values.is_empty() || expected.error.is_some() || expected.trap.is_some();
        assert!(shows, "{}: expects nothing", path.display());
        assert!(title(&expected).is_some(), "{}: the first line is no title", path.display());
        assert_eq!(expected.notes.len(), 1, "{}: {:?}", path.display(), expected.notes);
        assert!(!expected.not_yet || expected.error.is_some(), "{}: not yet, and without an error", path.display());
    }
}

/// Where in the standard, the feature, and what of it.
fn title(expected: &Expected) -> Option<(&str, &str, &str)> {
    let (place, rest) = expected.notes.first()?.split_once(": ")?;
    let known = ["table ", "tables ", "clause ", "figure "].iter().any(|word| place.starts_with(word));
    let (feature, detail) = rest.split_once("; ").unwrap_or((rest, ""));
    known.then_some((place, feature, detail))
}

/// A feature of a table: its programs.
#[derive(Default)]
struct Row {
    place: String,
    feature: String,
    run: usize,
    refused: usize,
    /// What is not yet, by its detail.
    later: Vec<String>,
}

fn rows(folder: &std::path::Path) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for path in files(folder, "st") {
        let expected = Expected::of(&std::fs::read_to_string(&path).expect("a readable file"));
        let (place, feature, detail) = title(&expected).expect("a title");
        let at = rows.iter().position(|row| row.place == place && row.feature == feature).unwrap_or_else(|| {
            rows.push(Row { place: place.into(), feature: feature.into(), ..Row::default() });
            rows.len() - 1
        });
        match (expected.not_yet, expected.error.is_some()) {
            (true, _) => rows[at].later.push(if detail.is_empty() { "all of it".into() } else { detail.into() }),
            (_, true) => rows[at].refused += 1,
            _ => rows[at].run += 1,
        }
    }
    rows
}

/// What has no program, because the compiler does not read it at all.
const OUTSIDE: [(&str, &str); 3] = [
    ("7.2", "Instruction List: left out, the standard itself has deprecated it"),
    ("8", "Graphical languages: Ladder Diagram and Function Block Diagram are no text; none is planned"),
    ("6.7", "Sequential Function Chart, graphical form: none is planned; for the textual form see above"),
];

fn document() -> String {
    let mut out = String::from(
        "# Conformance to IEC 61131-3, Edition 3\n\n\
         Clause by clause: what of Structured Text is in, shown by the programs of `tests/conformance/`, and what is not yet. Every program runs on\n\
         both engines. *Refused* counts wrong programs, each with the code and place of its one error. What is *not yet* is a test too: the compiler\n\
         refuses it with a clear error. Made by `tests/conformance.rs` from the programs' first lines; do not edit.\n",
    );
    let (mut run, mut refused, mut later) = (0, 0, 0);
    for folder in folders() {
        let name = folder.file_name().expect("a folder").to_string_lossy().into_owned();
        let (clause, words) = name.split_once('-').expect("clause-name");
        let _ = writeln!(out, "\n## {clause} {}\n", words.replace('-', " "));
        out.push_str("| standard | feature | programs | refused | not yet |\n|---|---|--:|--:|---|\n");
        for row in rows(&folder) {
            let count = |number: usize| if number == 0 { String::new() } else { number.to_string() };
            let (place, feature, not_yet) = (row.place, row.feature.replace('|', "\\|"), row.later.join(", "));
            let _ = writeln!(out, "| {place} | {feature} | {} | {} | {not_yet} |", count(row.run), count(row.refused));
            run += row.run;
            refused += row.refused;
            later += row.later.len();
        }
    }
    out.push_str("\n## Outside\n\n| clause | |\n|---|---|\n");
    for (clause, what) in OUTSIDE {
        let _ = writeln!(out, "| {clause} | {what} |");
    }
    let total = run + refused + later;
    let _ = writeln!(
        out,
        "\nTogether {total} programs: {run} that run, {refused} that are wrong and refused, {later} for what is not yet."
    );
    out
}

#[test]
fn the_document_is_fresh() {
    let path = root().join("docs/conformance.md");
    let made = document();
    if std::env::var_os("KHZ_BLESS").is_some() {
        std::fs::write(&path, &made).expect("docs/conformance.md");
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        kept == made,
        "docs/conformance.md is not what the programs say: KHZ_BLESS=1 cargo test --test conformance"
    );
}
