//! Rules about the sources themselves: crate arrows, sizes, `unsafe`, links in documents, stubs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Longest file, in lines.
const MAX_FILE_LINES: usize = 800;
/// Longest function, in lines.
const MAX_FUNCTION_LINES: usize = 70;

/// Files that may be longer, each with the reason.
const LONG_FILES: &[(&str, &str)] = &[];

/// Functions that may be longer, each with the reason: `file: function`.
const LONG_FUNCTIONS: &[(&str, &str)] = &[("interp/src/run.rs: run", "the dispatch loop: one arm an operation")];

/// Which workspace crates each crate may depend on.
const ARROWS: &[(&str, &[&str])] = &[
    ("bytecode", &[]),
    ("machine", &["khz-bytecode"]),
    ("frontend", &["khz-bytecode", "khz-machine"]),
    ("interp", &["khz-bytecode", "khz-machine"]),
    ("jit", &["khz-bytecode", "khz-machine"]),
    ("scheduler", &["khz-bytecode", "khz-machine"]),
    ("proof", &["khz-bytecode", "khz-frontend", "khz-interp", "khz-jit", "khz-machine", "khz-scheduler"]),
];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn files_below(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                files_below(&path, extension, found);
            }
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
    found.sort();
}

fn sources() -> Vec<(String, String)> {
    let mut paths = Vec::new();
    files_below(&root(), "rs", &mut paths);
    let name = |p: &Path| p.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
    paths.iter().map(|p| (name(p), fs::read_to_string(p).unwrap())).collect()
}

#[test]
fn crates_depend_only_downward() {
    for (krate, allowed) in ARROWS {
        let manifest = fs::read_to_string(root().join(krate).join("Cargo.toml")).unwrap();
        let dependencies = manifest.split("[dependencies]").nth(1).unwrap_or_default();
        let dependencies = dependencies.split("\n[").next().unwrap_or_default();
        for line in dependencies.lines().filter(|line| line.starts_with("khz-")) {
            let name = line.split(['.', ' ', '=']).next().unwrap();
            assert!(allowed.contains(&name), "{krate} must not depend on {name}");
        }
    }
}

#[test]
fn files_are_of_one_concept_and_short() {
    let mut long = Vec::new();
    for (name, text) in sources() {
        let lines = text.lines().count();
        let excused = LONG_FILES.iter().any(|(file, _)| *file == name);
        if lines > MAX_FILE_LINES && !excused {
            long.push(format!("{name}: {lines} lines"));
        }
        assert!(!excused || lines > MAX_FILE_LINES, "{name} needs no excuse any more");
    }
    assert!(long.is_empty(), "files over {MAX_FILE_LINES} lines:\n{}", long.join("\n"));
}

/// (name, first line, lines) of each function, found by indentation: rustfmt keeps the closing brace under the `fn`.
fn functions(text: &str) -> Vec<(String, usize, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let trimmed = line.trim_start();
        let indent = line.len() - trimmed.len();
        let head =
            trimmed.trim_start_matches("pub ").trim_start_matches("pub(crate) ").trim_start_matches("pub(super) ");
        let head = head.trim_start_matches("const ").trim_start_matches("unsafe ").trim_start_matches("extern \"C\" ");
        let Some(rest) = head.strip_prefix("fn ") else { continue };
        let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let closing = format!("{}}}", " ".repeat(indent));
        if line.ends_with('}') || line.ends_with(';') {
            continue;
        }
        if let Some(length) = lines[at..].iter().position(|l| *l == closing) {
            found.push((name, at + 1, length + 1));
        }
    }
    found
}

#[test]
fn functions_are_short() {
    let mut long = Vec::new();
    for (name, text) in sources() {
        for (function, line, lines) in functions(&text) {
            let excused = LONG_FUNCTIONS.iter().any(|(which, _)| *which == format!("{name}: {function}"));
            if lines > MAX_FUNCTION_LINES && !excused {
                long.push(format!("{name}:{line}: {function} has {lines} lines"));
            }
        }
    }
    assert!(long.is_empty(), "functions over {MAX_FUNCTION_LINES} lines:\n{}", long.join("\n"));
}

/// Files that ARCHITECTURE.md allows to hold `unsafe`.
fn unsafe_files() -> Vec<String> {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let list = text.split("### Files that may hold `unsafe`").nth(1).expect("the list of files");
    let list = list.split("\n## ").next().unwrap();
    list.lines().filter_map(|l| l.strip_prefix("- `")).map(|l| l.split('`').next().unwrap().to_string()).collect()
}

#[test]
fn unsafe_stands_only_where_the_architecture_says() {
    let allowed = unsafe_files();
    assert!(!allowed.is_empty());
    for file in &allowed {
        assert!(root().join(file).exists(), "{file} is listed in ARCHITECTURE.md and does not exist");
    }
    for (name, text) in sources() {
        if allowed.contains(&name) {
            continue;
        }
        for (at, line) in text.lines().enumerate() {
            let code = line.split("//").next().unwrap();
            let uses = [" {", " fn", " impl", " extern"].iter().any(|what| code.contains(&format!("unsafe{what}")));
            assert!(!uses, "{name}:{}: unsafe outside the files that ARCHITECTURE.md names", at + 1);
        }
    }
}

#[test]
fn nothing_is_left_for_later() {
    // Written in two parts so that this file does not find itself.
    let stubs = [
        concat!("todo", "!("),
        concat!("unimplemented", "!("),
        concat!("#[ig", "nore"),
        concat!("FIX", "ME"),
        concat!("TO", "DO"),
    ];
    for (name, text) in sources() {
        for (at, line) in text.lines().enumerate() {
            for stub in stubs {
                assert!(!line.contains(stub), "{name}:{}: {stub}", at + 1);
            }
        }
    }
}

#[test]
fn links_in_documents_lead_somewhere() {
    let mut documents = Vec::new();
    files_below(&root(), "md", &mut documents);
    assert!(documents.len() > 3);
    for document in documents {
        let text = fs::read_to_string(&document).unwrap();
        for piece in text.split("](").skip(1) {
            let link = piece.split([')', '#', ' ']).next().unwrap();
            if link.is_empty() || link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            let target = document.parent().unwrap().join(link);
            assert!(target.exists(), "{}: dead link {link}", document.display());
        }
    }
}

#[test]
fn every_crate_opens_with_a_page() {
    for krate in ["bytecode", "machine", "frontend", "interp", "jit", "scheduler", "proof", "."] {
        let text = fs::read_to_string(root().join(krate).join("src/lib.rs")).unwrap();
        let page = text.lines().take_while(|line| line.starts_with("//!")).count();
        assert!(page >= 8, "{krate}/src/lib.rs opens with {page} lines of documentation");
    }
}

#[test]
fn dependencies_are_not_doubled_beyond_what_is_known() {
    // Names that the lock file holds in more than one version, each with whose fault it is.
    let known: BTreeMap<&str, &str> = BTreeMap::from([
        ("bitflags", "region, of cranelift-jit, is still at 1"),
        ("hashbrown", "gimli, of cranelift-codegen, is one behind indexmap"),
        ("syn", "macros of the curve25519 crates are still at 2"),
        ("windows-sys", "region, of cranelift-jit; not compiled here"),
    ]);
    let lock = fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let mut versions: BTreeMap<&str, usize> = BTreeMap::new();
    for line in lock.lines().filter_map(|l| l.strip_prefix("name = \"")) {
        *versions.entry(line.trim_end_matches('"')).or_default() += 1;
    }
    for (name, count) in versions {
        assert!(count == 1 || known.contains_key(name), "{name} stands {count} times in Cargo.lock");
    }
}
