//! Whole compilations: workloads, examples of every rule, and what containers hold, checked by the verifier.

use khz_bytecode::verify::verify;
use khz_frontend::diagnostics::{Severity, has_errors, semantic, types};
use khz_frontend::{Compilation, CompileOptions, SourceInput, check, compile};

fn source(name: &str, text: &str) -> SourceInput {
    SourceInput { name: name.to_owned(), bytes: text.as_bytes().to_vec() }
}

fn compiled(text: &str) -> Compilation {
    compile(&[source("test.st", text)], &CompileOptions::default())
}

fn messages(found: &Compilation) -> String {
    let lines =
        found.diagnostics.iter().map(|one| format!("{} {} {}", found.sources.place(one.span), one.code(), one.message));
    lines.collect::<Vec<_>>().join("\n")
}

/// Compiles, verifies, and gives the containers.
fn verified(text: &str) -> Vec<khz_bytecode::container::Container> {
    let found = compiled(text);
    assert!(!has_errors(&found.diagnostics), "{}\n{text}", messages(&found));
    let mut list = Vec::new();
    for resource in found.resources {
        if let Err(error) = verify(resource.container.clone()) {
            panic!("{error}\n{text}");
        }
        list.push(resource.container);
    }
    list
}

#[test]
fn every_rule_is_broken_by_its_wrong_example_and_kept_by_its_right_one() {
    for rule in semantic::TABLE.iter().chain(types::TABLE).filter(|rule| !rule.wrong.is_empty()) {
        // Checking also looks at unit tests, which a build leaves alone.
        let wrong = check(&[source("test.st", rule.wrong)], &CompileOptions::default());
        let codes: Vec<&str> = wrong.diagnostics.iter().map(khz_frontend::diagnostics::Diagnostic::code).collect();
        assert!(codes.contains(&rule.code), "{}: {codes:?}\n{}", rule.code, messages(&wrong));
        let others = wrong.diagnostics.iter().filter(|found| found.is_error() && found.code() != rule.code);
        assert_eq!(others.count(), 0, "{}: a cascade\n{}", rule.code, messages(&wrong));
        assert_eq!(has_errors(&wrong.diagnostics), rule.severity == Severity::Error, "{}", rule.code);
        let right = check(&[source("test.st", rule.right)], &CompileOptions::default());
        let again = right.diagnostics.iter().any(|found| found.code() == rule.code);
        assert!(!again && !has_errors(&right.diagnostics), "{}: right example\n{}", rule.code, messages(&right));
        verified(rule.right);
    }
}

#[test]
fn every_standard_block_compiles_and_verifies() {
    for block in khz_machine::library::blocks::all() {
        let text = format!(
            "PROGRAM p\nVAR\n  x : {0};\n  y : ARRAY[0..3] OF {0};\n  i : INT;\nEND_VAR\n  x();\n  y[i]();\nEND_PROGRAM\n",
            block.name
        );
        verified(&text);
    }
}

#[test]
fn check_makes_no_containers() {
    let found = check(&[source("a.st", "PROGRAM p\nEND_PROGRAM\n")], &CompileOptions::default());
    assert!(found.resources.is_empty() && found.diagnostics.is_empty());
}

#[test]
fn the_same_source_gives_the_same_container() {
    let text = include_str!("programs/tour.st");
    assert_eq!(compiled(text).resources[0].container, compiled(text).resources[0].container);
}

#[test]
fn a_tour_of_the_language_verifies() {
    verified(include_str!("programs/tour.st"));
}

#[test]
fn workloads_verify() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/workloads");
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten().filter(|entry| entry.path().extension().is_some_and(|ext| ext == "st")) {
        let text = std::fs::read_to_string(entry.path()).expect("a workload is text");
        let found = compiled(&text);
        assert!(found.diagnostics.is_empty(), "{}: {}", entry.path().display(), messages(&found));
        verified(&text);
    }
}

#[test]
fn no_unreachable_code_is_emitted() {
    for body in [
        "WHILE TRUE DO a := a + 1; END_WHILE;",
        "FOR i := 1 TO 9 DO EXIT; END_FOR;",
        "FOR i := 1 TO 9 DO IF b THEN CONTINUE; ELSE EXIT; END_IF; END_FOR; a := 1;",
        "REPEAT RETURN; UNTIL b END_REPEAT;",
        "REPEAT REPEAT a := a + 1; UNTIL b END_REPEAT; UNTIL b END_REPEAT;",
        "FOR i := 1 TO 9 DO WHILE b DO a := a + 1; END_WHILE; END_FOR;",
        "IF TRUE THEN RETURN; END_IF; a := 1;",
        "WHILE b AND_THEN a > 1 OR_ELSE i < 3 DO IF b THEN EXIT; END_IF; CONTINUE; END_WHILE;",
        "CASE a OF 1: RETURN; 2: EXIT; ELSE RETURN; END_CASE;",
    ] {
        let body = body.replace("2: EXIT;", "2: ;");
        verified(&format!("PROGRAM p\nVAR\n  a : INT;\n  i : INT;\n  b : BOOL;\nEND_VAR\n  {body}\nEND_PROGRAM\n"));
    }
}

/// Splits a text into words with what stands behind each.
fn words(text: &str) -> Vec<String> {
    text.split_inclusive(|c: char| !c.is_alphanumeric() && c != '_').map(str::to_owned).collect()
}

#[test]
fn of_changed_sources_none_panics_and_what_compiles_verifies() {
    let mut texts = vec![include_str!("programs/tour.st").to_owned()];
    texts.extend(
        semantic::TABLE.iter().chain(types::TABLE).flat_map(|rule| [rule.wrong, rule.right]).map(str::to_owned),
    );
    let pool: Vec<String> = texts.iter().flat_map(|text| words(text)).collect();
    let mut state: u64 = 0x9E37_79B9_7F4A_7C15;
    let mut pick = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        usize::try_from(state % below.max(1) as u64).unwrap_or(0)
    };
    let mut compiled_count = 0;
    for _ in 0..600 {
        let which = pick(texts.len() + 20).saturating_sub(20);
        let mut list = words(&texts[which]);
        for _ in 0..=pick(2) {
            if list.is_empty() {
                break;
            }
            let (at, other) = (pick(list.len()), pick(pool.len()));
            match pick(3) {
                0 => drop(list.remove(at)),
                1 => list[at].clone_from(&pool[other]),
                _ => list.insert(at, pool[other].clone()),
            }
        }
        let text = list.concat();
        for resource in compiled(&text).resources {
            compiled_count += 1;
            if let Err(error) = verify(resource.container) {
                panic!("{error}\n{text}");
            }
        }
    }
    assert!(compiled_count > 30, "only {compiled_count} changed sources still compile: the test tests little");
}

/// `levels` functions, each of which calls the next one twice, with one array of its own in place of one that came: the last one is called
/// with 2 to the power of `levels - 1` combinations.
fn doubling(levels: usize) -> String {
    let names: Vec<String> = (0..levels).map(|at| format!("p{at}")).collect();
    let mut text = String::new();
    for level in 0..levels {
        let parameters = format!("VAR_IN_OUT {} : ARRAY[*] OF INT; END_VAR\n", names.join(", "));
        let mut other = names.clone();
        other[level] = "own".to_owned();
        let (same, other) = (names.join(", "), other.join(", "));
        let body = if level + 1 == levels {
            format!("f{level} := UPPER_BOUND(p0, 1);")
        } else {
            let next = level + 1;
            format!("f{level} := f{next}({same}) + f{next}({other});")
        };
        let own = format!("VAR own : ARRAY[1..{}] OF INT; END_VAR\n", level + 100);
        text += &format!("FUNCTION f{level} : DINT\n{parameters}{own}  {body}\nEND_FUNCTION\n");
    }
    let whole = vec!["a"; levels].join(", ");
    text + &format!("PROGRAM main\nVAR a : ARRAY[1..2] OF INT; n : DINT; END_VAR\n  n := f0({whole});\nEND_PROGRAM\n")
}

#[test]
fn open_arrays_give_one_function_for_each_combination_up_to_a_limit() {
    let [container] = &verified(&doubling(6))[..] else { panic!("one resource") };
    // The program and 1 + 2 + 4 + 8 + 16 + 32 functions.
    assert_eq!(container.functions.len(), 64);
    let found = compiled(&doubling(16));
    assert_eq!(found.diagnostics.iter().filter(|found| found.is_error()).count(), 1);
    assert!(found.diagnostics.iter().any(|found| found.code() == semantic::LIMIT.code), "{}", messages(&found));
}
