//! Warnings over programs that people wrote and trust: a rule that complains about them is wrong too often.

use khz_frontend::diagnostics::Severity;
use khz_frontend::{CompileOptions, SourceInput, check};
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

/// What is said about a file beside errors: some name types of their neighbours.
fn words(path: &Path) -> Vec<String> {
    let bytes = std::fs::read(path).expect("a readable program");
    let name = path.display().to_string();
    let found = check(&[SourceInput { name, bytes }], &CompileOptions::default());
    let words = found.diagnostics.iter().filter(|one| one.severity != Severity::Error);
    words.map(|one| format!("{} {} {}", found.sources.place(one.span), one.code(), one.message)).collect()
}

#[test]
fn trusted_programs_have_no_warnings() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    // The workloads are no part of the repository; where they are, they count.
    for folder in [root.join("../examples"), root.join("../../shared/workloads")] {
        programs(&folder, &mut files);
    }
    assert!(files.len() >= 5, "{files:?}");
    let all: Vec<String> = files.iter().flat_map(|path| words(path)).collect();
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn in_the_conformance_programs_what_is_strange_on_purpose_is_found() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/conformance");
    for (program, line, code) in [
        ("6.5-variables/014_global_hidden.st", 7, "S0074"),
        ("7.3.3-statements/008_if_empty_branches.st", 7, "S0073"),
        ("7.3.3-statements/052_for_control_written.st", 8, "S0075"),
        ("7.3.3-statements/132_nan_conditions_real.st", 15, "T0120"),
    ] {
        let all = words(&folder.join(program));
        let wanted = format!("{program}:{line}:");
        assert!(all.iter().any(|one| one.contains(&wanted) && one.contains(code)), "{program}: {all:?}");
    }
}
