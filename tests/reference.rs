//! Reference documents made of the tables: `docs/diagnostics.md`, `docs/library.md`. `KHZ_BLESS=1` renews them.

mod common;

use std::fmt::Write;

use common::root;
use khz_frontend::diagnostics::all_rules;
use khz_machine::library::{blocks, functions};

fn fresh(name: &str, text: &str) {
    let path = root().join("docs").join(name);
    #[expect(clippy::disallowed_methods, reason = "blessing is asked for by the environment")]
    let bless = std::env::var("KHZ_BLESS").is_ok();
    if bless {
        std::fs::write(&path, text).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == text,
        "docs/{name} is not what the tables say: KHZ_BLESS=1 cargo test --test reference renews it"
    );
}

#[test]
fn diagnostics_are_documented() {
    let mut out = String::from(
        "# Diagnostics\n\nGenerated from `frontend/src/diagnostics/`. `khz explain CODE` prints the same.\n",
    );
    for rule in all_rules() {
        // Writing to a String does not fail, here and below.
        let _ = write!(out, "\n## {}: {}\n\n*{}.* {}\n", rule.code, rule.title, rule.severity.word(), rule.explanation);
        for (word, example) in [("Wrong", rule.wrong), ("Right", rule.right)] {
            if !example.is_empty() {
                let _ = write!(out, "\n{word}:\n\n```text\n{}\n```\n", example.trim_end());
            }
        }
    }
    fresh("diagnostics.md", &out);
}

#[test]
fn the_library_is_documented() {
    let mut out = String::from(
        "# Standard functions and function blocks\n\nGenerated from `machine/src/library/`.\n\n## Functions\n\n| function | meaning | clause |\n|---|---|---|\n",
    );
    for function in functions::TABLE {
        let parameters: Vec<&str> = function.parameters.iter().map(|parameter| parameter.name).collect();
        let more = if function.extensible { ", …" } else { "" };
        let outputs = if function.outputs.is_empty() { "" } else { "; => " };
        let _ = writeln!(
            out,
            "| {}({}{more}{outputs}{}) | {} | {} |",
            function.name,
            parameters.join(", "),
            function.outputs.join(", "),
            function.meaning,
            function.clause
        );
    }
    out.push_str("\nConversions are not rows: `x_TO_y`, `TO_y`, `x_TRUNC_y` and `TRUNC_y` exist for every pair of types that can be converted.\n\n\
         `ADD_INT`, `GT_DINT`, `SEL_REAL` and so on are the functions with the type of their inputs said: every function over types of a group has\n\
         such a name for each type of the group (table 21).\n\n\
         `x_BCD_TO_y`, `BCD_TO_y`, `y_TO_BCD_x` and `TO_BCD_x` exist for every bit string x (BYTE, WORD, DWORD, LWORD) and unsigned integer y (table 22).\n\
         A digit above 9 counts at its place like the others; `IS_VALID_BCD` finds it. Of a number with more digits than x has, the lowest are taken.\n\n\
         Every call may give EN and take ENO (table 18): where EN is FALSE nothing is evaluated, ENO is FALSE and the result is the initial value of its type.\n");
    out.push_str("\n## Function blocks\n\nEach is Structured Text, compiled with the program that uses it.\n");
    for block in blocks::all() {
        let _ = write!(out, "\n### {}\n\n```text\n{}\n```\n", block.name, block.source.trim_end());
    }
    fresh("library.md", &out);
}
