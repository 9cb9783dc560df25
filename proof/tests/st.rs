//! Generated Structured Text: the front end and both engines against the tree that the text came from.

#[path = "common/mod.rs"]
mod engines;
#[path = "common/st.rs"]
mod oracle;

use oracle::{Tally, check_seed};

/// Programs of the test; `examples/st.rs` runs more.
const PROGRAMS: u64 = 400;

#[test]
fn generated_programs_mean_what_their_trees_mean() {
    let workers = 2;
    let run = |worker: u64| {
        let mut tally = Tally::default();
        let found: Vec<String> = (0..PROGRAMS)
            .filter(|seed| seed % workers == worker)
            .filter_map(|seed| check_seed(seed, &mut tally, 300))
            .collect();
        (tally, found)
    };
    let results: Vec<_> = std::thread::scope(|scope| {
        let running: Vec<_> = (0..workers).map(|worker| scope.spawn(move || run(worker))).collect();
        running.into_iter().map(|worker| worker.join().expect("a worker")).collect()
    });
    let found: Vec<&String> = results.iter().flat_map(|(_, found)| found).collect();
    assert!(found.is_empty(), "{} programs differ:\n{}", found.len(), found[0]);
    let reached = |word: &str| results.iter().any(|(tally, _)| tally.words.contains_key(word));
    for word in oracle::names().chain([
        "STRING",
        "FOR",
        "WHILE",
        "REPEAT",
        "CASE",
        "EXIT",
        "CONTINUE",
        "RETURN",
        "VAR_IN_OUT",
        "VAR_TEMP",
    ]) {
        assert!(reached(word), "no program has {word}");
    }
    for trap in ["divide by zero", "array index", "range"] {
        assert!(results.iter().any(|(tally, _)| tally.traps.contains_key(trap)), "no program traps: {trap}");
    }
    let programs: u64 = results.iter().map(|(tally, _)| tally.programs).sum();
    let cut: u64 = results.iter().map(|(tally, _)| tally.too_long).sum();
    let refused: u64 = results.iter().map(|(tally, _)| tally.refused).sum();
    assert_eq!(programs + refused, PROGRAMS);
    assert!(refused * 8 < PROGRAMS, "{refused} programs are refused");
    assert!(cut * 20 < programs, "{cut} programs take too long to say anything");
}

/// The tree without calls of blocks, the text with them: the comparison has to see it.
#[test]
fn a_tree_that_means_something_else_is_found() {
    let mut found = 0;
    for seed in 0..40 {
        let source = khz_proof::st::generate(seed);
        let text = khz_proof::st::print::print(&source);
        let mut other = source.clone();
        let mut tally = Tally::default();
        for unit in &mut other.units {
            unit.body.retain(|stmt| !matches!(stmt, khz_proof::st::tree::Stmt::Call(..)));
        }
        found += usize::from(oracle::check_text(&text, &other, seed, &mut tally).is_err());
    }
    assert!(found >= 10, "{found} of 40 programs without their calls of blocks are found out");
}
