//! Generated Structured Text: the front end and both engines against the tree that the text came from.

use khz_bytecode::trap::TrapCode;
use khz_machine::library::{blocks, functions};
use khz_proof::campaign::{Campaign, Report};
use khz_proof::harness::meaning::{self, Plan, Tally, check_seed};
use khz_proof::st::blocks::Standard;
use khz_proof::st::coverage::{FEATURES, not_shown};
use khz_proof::st::functions::compares;
use khz_proof::st::tree::{Def, Kind, Stmt};

/// Programs of the test; `examples/st.rs` runs more.
const PROGRAMS: u64 = 8000;

#[test]
fn generated_programs_mean_what_their_trees_mean() {
    let campaign = Campaign { first: 0, count: PROGRAMS, threads: 2, most_findings: 1 };
    let plan = |seed: u64| Plan { scans: if seed.is_multiple_of(4) { 10 } else { 4 }, fuel: 16, passes: 0 };
    let report: Report<Tally> =
        campaign.run(|seed, tally: &mut Tally| check_seed(seed, plan(seed), tally, 300), |_| ()).expect("a thread");
    assert!(report.findings.is_empty(), "a program differs:\n{}", report.findings[0].description);
    let tally = report.figures;
    assert_eq!((tally.programs, tally.refused), (PROGRAMS, 0), "every program is compared, none is refused");
    assert!(tally.with_fuel > 0 && tally.with_variant > 0 && tally.cycles > PROGRAMS, "{}", tally.report());
    assert!(tally.too_long * 20 < tally.programs, "{} programs take too long to say anything", tally.too_long);
    for trap in TrapCode::ALL {
        let (met, why_not) = (tally.traps.contains_key(trap.name()), not_shown(*trap));
        assert_eq!(met, why_not.is_none(), "{trap}: {why_not:?}, and yet {:?}", tally.traps);
    }
    covers_the_library(&tally);
    covers_the_language(&tally);
}

/// Every row of the library, with many of the types that it takes.
fn covers_the_library(tally: &Tally) {
    for row in functions::TABLE {
        let types = tally.coverage.types_of(row.name);
        let single = !row.parameters.iter().any(|parameter| parameter.class.is_generic())
            || matches!(row.result, functions::ResultRule::WantedInteger | functions::ResultRule::Of(_));
        let wanted = match row.parameters[0].class {
            _ if single => 1,
            functions::TypeClass::AnyReal | functions::TypeClass::Float => 2,
            functions::TypeClass::BitString => 4,
            _ => 8,
        };
        assert!(types >= wanted, "{} is called with {types} types", row.name);
        assert!(!compares(row.function) || types >= 16, "{} compares {types} types", row.name);
    }
    for block in blocks::all() {
        assert!(tally.coverage.blocks.contains_key(&block.name), "no program calls {}", block.name);
    }
    let (mut known, mut made): (Vec<String>, Vec<String>) =
        (blocks::all().map(|block| block.name).collect(), Standard::all().into_iter().map(Standard::name).collect());
    known.sort_unstable();
    made.sort_unstable();
    assert_eq!(known, made, "the blocks of the library and those that the evaluator knows");
}

fn covers_the_language(tally: &Tally) {
    let conversions = &tally.coverage.conversions;
    for from in Kind::ALL {
        for to in Kind::ALL.into_iter().filter(|to| *to != from) {
            let names = (from.name().to_string(), to.name().to_string());
            assert_eq!(
                conversions.contains_key(&(names.0, names.1, false)),
                from.converts(to),
                "no {}_TO_{}",
                from.name(),
                to.name()
            );
            let becomes = tally.coverage.widenings.contains_key(&(from, to));
            assert!(becomes || !from.becomes(to), "no {} becomes a {}", from.name(), to.name());
        }
        let name = from.name();
        let texts = [(name, "STRING"), ("STRING", name), (name, "WSTRING"), ("WSTRING", name)];
        for (from, to) in texts.into_iter().chain([("enumeration", name)]) {
            let known = conversions.contains_key(&(from.to_string(), to.to_string(), false));
            assert!(known, "no {from}_TO_{to}");
        }
    }
    for (from, to) in [("STRING", "WSTRING"), ("WSTRING", "STRING")] {
        assert!(conversions.contains_key(&(from.to_string(), to.to_string(), false)), "no {from}_TO_{to}");
    }
    for row in functions::TABLE.iter().filter(|row| row.result == functions::ResultRule::String) {
        for width in ["STRING", "WSTRING"] {
            let known = tally.coverage.functions.contains_key(&(row.name, width.to_string()));
            assert!(known, "no {} of a {width}", row.name);
        }
    }
    for feature in FEATURES {
        assert!(tally.coverage.features.contains_key(feature), "no program has: {feature}");
    }
}

/// The tree without calls of blocks, the text with them: the comparison has to see it.
#[test]
fn a_tree_that_means_something_else_is_found() {
    let mut found = 0;
    let mut tried = 0;
    for seed in 0..120 {
        let source = khz_proof::st::generate(seed);
        let text = khz_proof::st::print::print(&source);
        let mut other = source.clone();
        for unit in &mut other.units {
            unit.body.retain(|stmt| !matches!(stmt, Stmt::Call(..)));
        }
        let last = source.units.last().map_or(0, |unit| unit.body.len());
        if other.units.last().map_or(0, |unit| unit.body.len()) != last {
            tried += 1;
            let result = meaning::check_text(&text, None, &other, seed, Plan::default(), &mut Tally::default());
            found += usize::from(result.is_err());
        }
    }
    assert!(found * 3 >= tried, "{found} of {tried} programs without their calls of blocks are found out");
}

/// The wrong task, the wrong order, a connection less: the comparison has to see it.
#[test]
fn a_configuration_that_means_something_else_is_found() {
    let mut found = [0; 3];
    for seed in 0..800 {
        let source = khz_proof::st::generate(seed);
        if source.config.is_none() {
            continue;
        }
        let text = khz_proof::st::print::print(&source);
        for (number, found) in found.iter_mut().enumerate() {
            let mut other = source.clone();
            let Some(config) = &mut other.config else { continue };
            match number {
                0 => config.instances.reverse(),
                1 => config.tasks.iter_mut().for_each(|task| task.interval_us = task.interval_us.map(|us| us * 2)),
                _ => config.instances.iter_mut().for_each(|instance| instance.args.truncate(1)),
            }
            let result = meaning::check_text(&text, None, &other, seed, Plan::default(), &mut Tally::default());
            *found += usize::from(result.is_err());
        }
    }
    assert!(found.iter().all(|found| *found >= 5), "{found:?} configurations are found out");
}

/// Where a trap happened is compared: a text of which a line is missing at the top is found out by that alone.
#[test]
fn a_trap_at_another_place_is_found() {
    let mut found = 0;
    for seed in 0..1500 {
        let source = khz_proof::st::generate(seed);
        let (text, positions) = khz_proof::st::print::print_positions(&source);
        let moved = format!("\n{text}");
        let result =
            meaning::check_text(&moved, Some(&positions), &source, seed, Plan::default(), &mut Tally::default());
        found += usize::from(matches!(result, Err(found) if found.class.starts_with("trap place")));
    }
    assert!(found >= 10, "{found} moved traps are found");
}

/// The limits of an enumeration's base are reached, so that its width counts.
#[test]
fn enumerations_of_every_base_are_made() {
    let mut bases = std::collections::BTreeSet::new();
    for seed in 0..2000 {
        for ty in khz_proof::st::generate(seed).types {
            if let Def::Enum(Some(base), _) = ty.def {
                bases.insert(base);
            }
        }
    }
    assert_eq!(bases.len(), Kind::INTEGERS.len(), "{bases:?}");
}
