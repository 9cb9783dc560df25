//! Where the repository has programs: one list for everything that takes all of them.

use std::path::{Path, PathBuf};

/// Folders with programs that are run, or say in their first lines why they are refused.
pub const PROGRAMS: [&str; 5] = ["tests/conformance", "tests/programs", "tests/st", "examples", "tests/schedules"];

/// Folders with any Structured Text: [`PROGRAMS`] are below them, and what is only formatted, measured or refused.
pub const TEXTS: [&str; 4] = ["tests", "examples", "benches", "frontend/tests"];

/// Where the workloads are, which are not part of the repository.
pub const WORKLOADS: &str = "../shared/workloads";

/// The repository.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every file below a folder with one of these endings, by path. A folder that is not there has none.
#[must_use]
pub fn files(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| endings.iter().any(|wanted| ending == *wanted)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}
