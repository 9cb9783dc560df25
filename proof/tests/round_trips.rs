//! Text, containers and files that must come back as they were: over generated Structured Text, generated containers, and all programs of the repository.
//!
//! `frontend/tests/format` formats the repository's programs in many ways; here the generated ones are formatted.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use khz_bytecode::container::{self, Container};
use khz_bytecode::verify::verify;
use khz_frontend::diagnostics::has_errors;
use khz_frontend::format::{FormatOptions, KeywordCase, format};
use khz_frontend::{CompileOptions, SourceInput};
use khz_proof::harness::engines;
use khz_proof::round_trip::{Rounds, through_bytes, through_text, without_names};
use khz_proof::st::generate;
use khz_proof::st::print::print;

/// Generated programs of each sort.
const PROGRAMS: u64 = 100;
const ROUNDS: Rounds = Rounds { count: 4, seed: 7, fuel: 200_000, image_limit_bytes: 1 << 22 };

fn compile(text: &str) -> Option<Vec<Container>> {
    let input = SourceInput { name: "a.st".to_string(), bytes: text.as_bytes().to_vec() };
    let compilation = khz_frontend::compile(&[input], &CompileOptions::default());
    if has_errors(&compilation.diagnostics) {
        return None;
    }
    Some(compilation.resources.into_iter().map(|resource| resource.container).collect())
}

/// What engines see of a program: all sections but the debug section, and nothing of the text itself.
fn content(containers: &[Container]) -> Vec<Vec<u8>> {
    let bytes = |container: &Container| {
        let mut bare = container.clone();
        container::strip(&mut bare);
        bare.source_hash = Default::default();
        container::write(&bare).expect("a program that fits")
    };
    containers.iter().map(bytes).collect()
}

/// Everything that holds for any sound container. Stripping is looked at in the first `engines` engines.
fn check_container(container: &Container, engines: usize) -> Result<(), String> {
    through_bytes(container)?;
    through_text(container)?;
    let mut stripped = container.clone();
    container::strip(&mut stripped);
    through_bytes(&stripped)?;
    through_text(&stripped)?;
    let verified = Arc::new(verify(container.clone()).map_err(|error| error.to_string())?);
    without_names(&verified, &engines::makers()[..engines], &ROUNDS)
}

/// Runs something for many things on two threads; what is wrong comes in their order.
fn all<T: Sync>(things: &[T], check: impl Fn(&T) -> Result<(), String> + Sync) -> Vec<String> {
    let check = &check;
    std::thread::scope(|scope| {
        let parts = things.chunks(things.len().div_ceil(2).max(1));
        let run = |part| {
            scope.spawn(move || <[T]>::iter(part).filter_map(|thing| check(thing).err()).collect::<Vec<String>>())
        };
        let running: Vec<_> = parts.map(run).collect();
        running.into_iter().flat_map(|worker| worker.join().expect("a worker")).collect()
    })
}

/// Formats a text in several ways: each is its own formatting and compiles to the same content. How many differ from the text; none: it
/// does not compile.
fn check_format(text: &str) -> Result<Option<usize>, String> {
    let Some(before) = compile(text) else { return Ok(None) };
    let all_options = [
        FormatOptions::default(),
        FormatOptions { width: 40, ..FormatOptions::default() },
        FormatOptions { width: 0, indent: 3, keywords: KeywordCase::Keep },
    ];
    let mut changed = 0;
    for options in &all_options {
        let once = format(text, options).map_err(|error| format!("{error:?}"))?;
        let twice = format(&once, options).map_err(|error| format!("{error:?}"))?;
        if once != twice {
            return Err(format!("formatting the formatted text changes it\n{once}\n=====\n{twice}"));
        }
        let after = compile(&once).ok_or_else(|| format!("the formatted text is refused\n{once}"))?;
        if content(&after) != content(&before) {
            return Err(format!("the formatted text means something else\n{once}"));
        }
        changed += usize::from(once != text);
    }
    Ok(Some(changed))
}

#[test]
fn formatted_programs_compile_to_the_same_content() {
    let seeds: Vec<u64> = (0..PROGRAMS).collect();
    let changed = AtomicUsize::new(0);
    let wrong = all(&seeds, |seed| {
        let found = check_format(&print(&generate(*seed))).map_err(|what| format!("seed {seed}: {what}"))?;
        changed.fetch_add(found.unwrap_or(0), Ordering::Relaxed);
        Ok(())
    });
    assert!(wrong.is_empty(), "{} programs\n{}", wrong.len(), wrong[0]);
    let changed = changed.into_inner();
    assert!(changed > 2 * PROGRAMS as usize, "formatting changes only {changed} texts: it has nothing to do");
}

/// Where the workloads are, which are not part of the repository.
const WORKLOADS: &str = "../shared/workloads";

#[test]
fn compiled_programs_survive_bytes_text_and_stripping() {
    let seeds: Vec<u64> = (1000..1000 + PROGRAMS).collect();
    let wrong = all(&seeds, |seed| {
        let containers = compile(&print(&generate(*seed))).unwrap_or_default();
        containers.iter().try_for_each(|one| check_container(one, 2)).map_err(|what| format!("seed {seed}: {what}"))
    });
    assert!(wrong.is_empty(), "{} programs\n{}", wrong.len(), wrong[0]);
}

#[test]
fn generated_containers_survive_bytes_text_and_stripping() {
    let seeds: Vec<u64> = (0..PROGRAMS).collect();
    let wrong = all(&seeds, |seed| {
        let verified = khz_proof::bytecode::generate(*seed);
        check_container(verified.container(), 2).map_err(|what| format!("seed {seed}: {what}"))
    });
    assert!(wrong.is_empty(), "{} containers\n{}", wrong.len(), wrong[0]);
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.map(|entry| entry.expect("an entry").path()) {
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "st") {
            found.push(path);
        }
    }
    found.sort();
}

#[test]
fn programs_of_the_repository_survive_bytes_text_and_stripping() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace");
    let mut files = Vec::new();
    let folders = ["tests", "examples", "benches", "frontend/tests", WORKLOADS];
    folders.iter().for_each(|folder| sources(&root.join(folder), &mut files));
    let texts: Vec<(String, String)> = files
        .iter()
        .filter_map(|path| Some((path.display().to_string(), std::fs::read_to_string(path).ok()?)))
        .filter(|(_, text)| compile(text).is_some_and(|containers| !containers.is_empty()))
        .collect();
    assert!(texts.len() >= 900, "{} programs of the repository compile", texts.len());
    let wrong = all(&texts, |(name, text)| {
        let containers = compile(text).unwrap_or_default();
        // `frontend/tests/format` formats all others.
        let formatted = if name.contains(WORKLOADS) { check_format(text).map(drop) } else { Ok(()) };
        // Native code for all of them takes a minute; by length is as good as by chance.
        let engines = if text.len().is_multiple_of(4) { 2 } else { 1 };
        let checked = formatted.and_then(|()| containers.iter().try_for_each(|one| check_container(one, engines)));
        checked.map_err(|what| format!("{name}: {what}"))
    });
    assert!(wrong.is_empty(), "{} programs\n{}", wrong.len(), wrong.join("\n"));
}
