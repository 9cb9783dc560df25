//! The fuzz targets under stable Rust: their bodies on the corpus, on the programs of the repository, and on a fixed number of mutants of both.
//!
//! `fuzz/src/lib.rs` is included as it is. Containers of the corpus are made from assembly texts and programs of the repository:
//! `KHZ_BLESS=1 cargo test --test fuzz_corpus` writes them.

#[path = "../fuzz/src/lib.rs"]
#[allow(dead_code, reason = "some of it only libFuzzer calls")]
mod bodies;
mod common;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use bodies::{TARGETS, Target};
use common::{files, root};
use khz_bytecode::container::{Container, read, write};
use khz_bytecode::verify::verify;
use khz_frontend::{CompileOptions, SourceInput};
use khz_proof::harness::programs;

/// Most bytes of a mutant.
const MOST_BYTES: usize = 1 << 16;

fn corpus(folder: &str) -> PathBuf {
    root().join("fuzz/corpus").join(folder)
}

/// Every file of a folder, by name.
fn all(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    let bytes = |path: &Path| std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    paths.iter().map(|path| (path.display().to_string(), bytes(path))).collect()
}

/// Runs the body of a target on each input and on `mutants` mutants of each.
fn run(target: &Target, inputs: &[(String, Vec<u8>)], mutants: u32) {
    let mut findings = Vec::new();
    let mut look_at = |name: &str, bytes: &[u8]| {
        if catch_unwind(AssertUnwindSafe(|| (target.body)(bytes))).is_err() {
            findings.push(name.to_string());
        }
    };
    for (number, (name, bytes)) in inputs.iter().enumerate() {
        look_at(name, bytes);
        // Even seeds only: odd ones leave it to libFuzzer.
        for seed in (0..mutants).map(|seed| 2 * (seed + number as u32 * 1000)) {
            if let Some(mutant) = (target.mutated)(bytes, MOST_BYTES, seed) {
                look_at(&format!("{name}, mutant {seed}"), &mutant);
            }
        }
    }
    let count = findings.len();
    findings.truncate(20);
    assert!(count == 0, "{}: {count} findings, first of all {findings:#?}", target.name);
}

fn target(name: &str) -> &'static Target {
    TARGETS.iter().find(|target| target.name == name).expect("a target")
}

/// Runs a target on its corpus.
fn run_corpus(name: &str, mutants: u32) {
    let target = target(name);
    run(target, &all(&corpus(target.corpus)), mutants);
}

#[test]
fn sources() {
    // Those of the conformance suite are many; `proof/tests/mutants.rs` has them.
    let folders = programs::PROGRAMS.iter().filter(|folder| **folder != "tests/conformance");
    let programs = folders.flat_map(|folder| programs::files(&root().join(folder), &["st"])).map(|path| {
        let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        (path.display().to_string(), bytes)
    });
    let inputs: Vec<_> = all(&corpus("source")).into_iter().chain(programs).collect();
    run(target("source"), &inputs, 15);
}

#[test]
fn containers_through_the_reader() {
    run_corpus("container_reader", 100);
}

#[test]
fn containers_through_the_verifier() {
    run_corpus("verifier", 60);
}

#[test]
fn containers_in_both_engines() {
    run_corpus("verified_execution", 12);
}

#[test]
fn tables_of_inputs() {
    run_corpus("csv", 300);
}

#[test]
fn traces_and_mappings() {
    run_corpus("trace", 300);
    run_corpus("mapping", 300);
}

#[test]
fn project_files() {
    run_corpus("toml", 300);
}

/// Small containers of many forms: what the assembly texts say, and some programs, of which one is stripped.
fn seeds() -> Vec<(String, Container)> {
    let mut found = Vec::new();
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    for (folder, ending) in [("tests/bytecode", "kasm"), ("bytecode/tests/verifier", "khza")] {
        for path in files(&root().join(folder), ending).iter().filter(|path| !stem(path).starts_with('v')) {
            let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let container = khz_bytecode::assembler::assemble(&text);
            found.push((stem(path), container.unwrap_or_else(|e| panic!("{}: {e}", path.display()))));
        }
    }
    for name in ["blocks", "strings", "timers", "located", "structures", "trap_index", "for_limits"] {
        let path = root().join("tests/programs").join(name).with_extension("st");
        let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let source = SourceInput { name: format!("{name}.st"), bytes };
        let options = CompileOptions { strip: name == "timers", ..CompileOptions::default() };
        let resources = khz_frontend::compile(&[source], &options).resources;
        found.extend(resources.into_iter().map(|resource| (name.to_string(), resource.container)));
    }
    found
}

#[test]
fn containers_of_the_corpus_are_sound() {
    let folder = corpus("containers");
    if std::env::var_os("KHZ_BLESS").is_some() {
        std::fs::create_dir_all(&folder).expect("a folder");
        for (name, container) in seeds() {
            let bytes = write(&container).expect("a container that can be written");
            std::fs::write(folder.join(name).with_extension("iplc"), bytes).expect("a file");
        }
    }
    for (name, _) in seeds() {
        let path = folder.join(name).with_extension("iplc");
        let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let container = read(&bytes).unwrap_or_else(|e| panic!("{}: {e}: KHZ_BLESS=1", path.display()));
        verify(container).unwrap_or_else(|e| panic!("{}: {e}: KHZ_BLESS=1", path.display()));
    }
}

#[test]
fn every_target_has_a_body_a_file_and_a_corpus() {
    let manifest = std::fs::read_to_string(root().join("fuzz/Cargo.toml")).expect("the manifest");
    let mut bytes = 0;
    let mut folders: Vec<&str> = TARGETS.iter().map(|target| target.corpus).collect();
    folders.sort_unstable();
    folders.dedup();
    for Target { name, .. } in TARGETS {
        assert!(root().join("fuzz/fuzz_targets").join(name).with_extension("rs").is_file(), "{name} has no file");
        assert!(manifest.contains(&format!("name = \"{name}\"")), "{name} is not in the manifest");
    }
    let there = std::fs::read_dir(corpus("")).expect("the corpus").count();
    assert_eq!(there, folders.len(), "a folder of the corpus that no target has");
    for name in folders {
        let corpus = all(&corpus(name));
        assert!(corpus.len() >= 5, "{name} has a corpus of {}", corpus.len());
        bytes += corpus.iter().map(|(_, bytes)| bytes.len()).sum::<usize>();
    }
    let targets = files(&root().join("fuzz/fuzz_targets"), "rs");
    assert_eq!(targets.len(), TARGETS.len(), "a target without a body: {targets:?}");
    assert!(bytes < 1 << 20, "the corpus has {bytes} bytes");
}
