//! Text, containers and files that must come back as they were: over generated Structured Text, generated containers, and all programs of the repository.
//!
//! `frontend/tests/format` formats the repository's programs in many ways; here the generated ones are formatted.

use khz_proof::campaign::{Campaign, Report};
use khz_proof::harness::programs;
use khz_proof::harness::round_trips::{Tally, check_container, check_format, check_seed, compile};

/// Generated programs of each sort; `examples/round_trips.rs` takes more.
const PROGRAMS: u64 = 100;
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

#[test]
fn generated_texts_and_containers_survive() {
    let campaign = Campaign { first: 0, count: PROGRAMS, threads: 2, most_findings: 1 };
    let report: Report<Tally> = campaign.run(check_seed, |_| ()).expect("a thread");
    assert!(report.findings.is_empty(), "{}", report.findings[0].description);
    let tally = report.figures;
    assert_eq!((tally.texts, tally.containers), (PROGRAMS, 2 * PROGRAMS));
    assert!(tally.changed > 2 * PROGRAMS, "formatting has nothing to do: {tally:?}");
}

#[test]
fn programs_of_the_repository_survive_bytes_text_and_stripping() {
    let folders = programs::TEXTS.into_iter().chain([programs::WORKLOADS]);
    let texts: Vec<(String, String)> = folders
        .flat_map(|folder| programs::files(&programs::root().join(folder), &["st"]))
        .filter_map(|path| Some((path.display().to_string(), std::fs::read_to_string(path).ok()?)))
        .filter(|(_, text)| compile(text).is_some_and(|containers| !containers.is_empty()))
        .collect();
    assert!(texts.len() >= 900, "{} programs of the repository compile", texts.len());
    let wrong = all(&texts, |(name, text)| {
        let containers = compile(text).unwrap_or_default();
        // `frontend/tests/format` formats all others.
        let formatted = if name.contains(programs::WORKLOADS) { check_format(text).map(drop) } else { Ok(()) };
        // Native code for all of them takes a minute; by length is as good as by chance.
        let engines = if text.len().is_multiple_of(4) { 2 } else { 1 };
        let checked = formatted.and_then(|()| containers.iter().try_for_each(|one| check_container(one, engines)));
        checked.map_err(|what| format!("{name}: {what}"))
    });
    assert!(wrong.is_empty(), "{} programs\n{}", wrong.len(), wrong.join("\n"));
}
