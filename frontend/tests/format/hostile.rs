//! No text makes the formatter panic, hang or give something away that it did not check.

#![expect(clippy::disallowed_methods, reason = "one of these tests measures how long hostile texts take")]

use super::corpus::samples;
use super::{check, parses};
use khz_frontend::format::{FormatError, FormatOptions, format};
use std::time::{Duration, Instant};

#[test]
fn cut_at_every_byte() {
    let options = FormatOptions::default();
    // Every byte of the small files; of the large ones each byte comes up in a small one too, so every 41st is enough.
    for (name, text) in &samples() {
        let step = if text.len() < 1000 { 1 } else { 41 };
        for end in (0..text.len()).step_by(step).filter(|&end| text.is_char_boundary(end)) {
            let cut = &text[..end];
            match format(cut, &options) {
                Ok(formatted) => assert_eq!(format(&formatted, &options), Ok(formatted), "{name} cut at {end}"),
                Err(FormatError::Syntax(found)) => assert!(!found.is_empty() && !parses(cut)),
                Err(error) => panic!("{name} cut at {end}: {error}"),
            }
        }
    }
}

#[test]
fn syntax_errors_are_given_with_their_places() {
    let Err(FormatError::Syntax(found)) = format("PROGRAM p\n  x := ;\nEND_PROGRAM\n", &FormatOptions::default())
    else {
        panic!("a text with a syntax error was formatted");
    };
    assert_eq!(found.len(), 1);
    assert!(found[0].is_error());
    assert_eq!(found[0].span.start, 17, "{found:?}");
}

#[test]
fn nothing_and_comments_alone() {
    let options = FormatOptions::default();
    assert_eq!(check("empty", "", &options), "");
    assert_eq!(check("white space", " \n\r\n\t", &options), "");
    assert_eq!(check("comment", "\n\n  // a  \n\n\n(* b *)", &options), "// a\n\n(* b *)\n");
    assert_eq!(check("semicolon", ";", &options), ";\n");
}

/// Texts with much of one thing in one line or one block.
fn hostile(many: usize) -> Vec<String> {
    let body = |inside: String| format!("PROGRAM p\n{inside}\nEND_PROGRAM\n");
    let deep = 120;
    vec![
        body(format!("x := f({}1);", "1, ".repeat(many))),
        body(format!("f({}x);", "a + b, ".repeat(many))),
        body(format!("x := {}1{};", "f(a, ".repeat(deep), ")".repeat(deep))),
        body(format!("x := {}1{}", "(".repeat(deep), ")".repeat(deep) + ";")),
        body(format!("{}{}", "IF a THEN x := f(1, // c\n 2); ".repeat(deep), "END_IF; ".repeat(deep))),
        body(format!("x := 1 {};", "(* c *) ".repeat(many))),
        body(format!("x := 1 {};", "(* c\n *)".repeat(many))),
        body(format!("x := 1 {};", "// c\n".repeat(many))),
        body("(* a *)".repeat(many)),
        body("(* a\n *)".repeat(many)),
        body("{p}".repeat(many)),
        body(";".repeat(many)),
        body("x := 1;".repeat(many)),
        body(format!("CASE x OF {} END_CASE", "1: ; ".repeat(many))),
        format!("TYPE {} END_TYPE", "T : STRUCT a : INT; END_STRUCT".repeat(many)),
        format!("VAR_GLOBAL {}a : INT; END_VAR", "a, ".repeat(many)),
        format!("VAR_GLOBAL a : ARRAY[1..{many}] OF INT := [{}1]; END_VAR", "1, ".repeat(many)),
        format!("VAR_GLOBAL {} END_VAR", "a AT %IX0.0 : T #5; ".replace("T #5", "INT (0..1) := T#5s").repeat(many)),
        "\n".repeat(many),
        " \t\r\n".repeat(many),
    ]
}

#[test]
fn much_of_one_thing() {
    for text in hostile(300) {
        if parses(&text) {
            for width in [0, 20, 100] {
                check("hostile", &text, &FormatOptions { width, ..FormatOptions::default() });
            }
        }
    }
}

#[test]
fn time_is_linear() {
    for (at, text) in hostile(20_000).iter().enumerate() {
        let start = Instant::now();
        // Whether it parses does not matter here: some are beyond the parser's limits.
        let _ = format(text, &FormatOptions::default());
        // Quadratic time would be minutes; the limit is wide because the machine may be busy.
        assert!(start.elapsed() < Duration::from_secs(20), "text {at} took {:?}", start.elapsed());
    }
}

#[test]
fn a_typed_literal_does_not_become_a_time() {
    let text = "VAR_GLOBAL x : T := T #5; y : TIME := T#5s; c : Color := Color # Red; d : D := D # 5; END_VAR";
    let formatted = check("typed", text, &FormatOptions::default());
    assert!(formatted.contains("x : T := T #5;"), "{formatted}");
    assert!(formatted.contains("c : Color := Color#Red;"), "{formatted}");
}
