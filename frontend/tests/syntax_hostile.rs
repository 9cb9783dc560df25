//! No text makes the parser panic, hang or flood the user with messages.

#![expect(clippy::disallowed_methods, reason = "these tests measure how long hostile texts take")]

#[allow(dead_code, reason = "each test file uses its own part of what they share")]
mod support;

use khz_frontend::diagnostics::MAX_ERRORS_PER_FILE;
use khz_frontend::source::SourceMap;
use khz_frontend::syntax::lexer::{Token, lex};
use std::time::{Duration, Instant};
use support::{SAMPLES, messages, parse};

/// A small generator of numbers; the seed is the test's.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, limit: usize) -> usize {
        usize::try_from(self.next() % limit as u64).expect("below a usize")
    }
}

/// Parses and checks what holds for every text: diagnostics lie inside of it, and ids are dense.
fn check(text: &str) -> usize {
    let (ast, found, sources) = parse(text);
    let len = u32::try_from(text.len()).expect("small texts");
    for one in &found {
        assert!(one.span.start <= one.span.end && one.span.end <= len, "{one:?} in a text of {len} bytes");
        assert!(!one.message.is_empty());
        assert!(one.labels.iter().all(|(span, _)| span.end <= len));
        let shown = khz_frontend::diagnostics::render::render(one, &sources, Default::default());
        assert!(shown.starts_with("a.st:"));
    }
    assert!(found.iter().filter(|one| one.is_error()).count() <= MAX_ERRORS_PER_FILE);
    assert!(ast.expr_count as usize <= text.len() * 2 + 2, "no more expressions than text");
    found.iter().filter(|one| one.is_error()).count()
}

fn slice<'a>(text: &'a str, token: &Token) -> &'a str {
    &text[token.start as usize..token.end as usize]
}

/// How many messages each mutation gave.
#[derive(Default)]
struct Counts {
    mutations: usize,
    /// Those with more than three errors: how many, and what was done.
    many: Vec<(usize, String)>,
}

impl Counts {
    fn add(&mut self, errors: usize, what: impl FnOnce() -> String) {
        self.mutations += 1;
        if errors > 3 {
            self.many.push((errors, what()));
        }
    }
}

#[test]
fn one_token_wrong_gives_few_messages() {
    let mut counts = Counts::default();
    for (name, text) in SAMPLES {
        let tokens = lex(text);
        for (at, token) in tokens.iter().enumerate() {
            let (start, end) = (token.start as usize, token.end as usize);
            let word = slice(text, token);
            let place = |how: &str| format!("{name}: {how} `{word}` at byte {start}");
            counts.add(check(&format!("{}{}", &text[..start], &text[end..])), || place("deleted"));
            counts.add(check(&format!("{}{word} {word}{}", &text[..start], &text[end..])), || place("doubled"));
            if let Some(next) = tokens.get(at + 1) {
                let between = &text[end..next.start as usize];
                let swapped =
                    format!("{}{}{between} {word} {}", &text[..start], slice(text, next), &text[next.end as usize..]);
                counts.add(check(&swapped), || place("swapped"));
            }
        }
    }
    assert!(counts.mutations > 5000);
    let share = counts.many.len() as f64 / counts.mutations as f64;
    assert!(share < 0.01, "{share:.4} of {} with more than 3 messages: {:#?}", counts.mutations, counts.many);
    assert!(counts.many.iter().all(|&(errors, _)| errors < 9), "{:#?}", counts.many);
}

#[test]
fn cut_at_every_byte() {
    for (_, text) in SAMPLES {
        for end in (0..text.len()).filter(|&end| text.is_char_boundary(end)) {
            check(&text[..end]);
        }
    }
}

#[test]
fn random_bytes() {
    let mut numbers = Numbers(0x9E37_79B9_7F4A_7C15);
    for _ in 0..3000 {
        let len = numbers.below(200);
        let bytes: Vec<u8> = (0..len).map(|_| numbers.next() as u8).collect();
        let mut sources = SourceMap::new();
        sources.add_bytes("a.st", &bytes);
        let text: String = sources.files().map(|(_, file)| file.text()).collect();
        check(&text);
    }
}

#[test]
fn random_tokens() {
    let pool: Vec<&str> = SAMPLES
        .iter()
        .flat_map(|(_, text)| lex(text).into_iter().map(|token| slice(text, &token)).collect::<Vec<_>>())
        .collect();
    let mut numbers = Numbers(42);
    for _ in 0..3000 {
        let len = numbers.below(120);
        let words: Vec<&str> = (0..len).map(|_| pool[numbers.below(pool.len())]).collect();
        check(&words.join(if numbers.below(4) == 0 { "\n" } else { " " }));
    }
}

#[test]
fn deep_nesting_is_refused_and_does_not_overflow() {
    let deep = 30_000;
    let body = |inside: &str| format!("PROGRAM p\n{inside}\nEND_PROGRAM\n");
    let texts = [
        body(&format!("x := {}1;", "(".repeat(deep))),
        body(&format!("x := {}1{};", "(".repeat(deep), ")".repeat(deep))),
        body(&format!("x := {}1;", "-".repeat(deep))),
        body(&format!("x := {}1;", "NOT ".repeat(deep))),
        body(&format!("x := 1{};", " + 1".repeat(deep))),
        body(&format!("x := {}1;", "1 OR 1 XOR 1 AND 1 = 1 < 1 + 1 * 1 ** (".repeat(deep / 10))),
        body(&format!("x{} := 1;", ".y".repeat(deep))),
        body(&format!("x{} := 1;", "[1".repeat(deep))),
        body(&format!("x{} := 1;", "^".repeat(deep))),
        body(&"f(a := ".repeat(deep)),
        body(&"IF a THEN ".repeat(deep)),
        body(&"CASE a OF 1: ".repeat(deep)),
        body(&"WHILE a DO FOR i := 1 TO 2 DO REPEAT ".repeat(deep / 3)),
        format!("TYPE t : {}", "ARRAY[1..2] OF ".repeat(deep)),
        format!("TYPE t : {}", "STRUCT a : ".repeat(deep)),
        format!("TYPE t : {}", "REF_TO ".repeat(deep)),
        format!("VAR_GLOBAL x : INT := {}", "[".repeat(deep)),
        format!("VAR_GLOBAL x : INT := {}", "(a := ".repeat(deep)),
        format!("VAR_GLOBAL x : INT := {}", "[3(".repeat(deep)),
        "(*".repeat(deep),
        "{\n".repeat(deep),
        "'\n".repeat(deep),
    ];
    for text in texts {
        let started = Instant::now();
        let errors = check(&text);
        assert!(errors > 0, "{}", &text[..40]);
        assert!(started.elapsed() < Duration::from_secs(5), "{}", &text[..40]);
    }
}

#[test]
fn the_limit_of_depth_is_said_once() {
    let found = messages(&format!("PROGRAM p\nx := {}1{};\nEND_PROGRAM\n", "(".repeat(300), ")".repeat(300)));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("P0024"), "{found:?}");
    // One hundred levels are fine, and so is a long sum.
    let fine = format!("PROGRAM p\nx := {}1{}{};\nEND_PROGRAM\n", "(".repeat(100), ")".repeat(100), " + 1".repeat(400));
    assert_eq!(messages(&fine), Vec::<String>::new());
}

#[test]
fn time_is_linear() {
    // Each of these would take minutes if something looked ahead or back over and over.
    for unit in [
        "x := 1", "END_IF ", "IF ", "f(", "a : ", "VAR ", "VAR x ", "a,", "a.b", "{x", "x = ", ") ", "ENDIF ",
        "TYPE a ", "; ", "1.", "%",
    ] {
        let text = format!("PROGRAM p\n{}", unit.repeat(40_000));
        let started = Instant::now();
        check(&text);
        assert!(started.elapsed() < Duration::from_secs(5), "{unit}: {:?}", started.elapsed());
    }
}

#[test]
fn a_hundred_errors_and_a_note() {
    let found = messages(&format!("PROGRAM p\n{}END_PROGRAM\n", "x = 1;\n".repeat(500)));
    assert_eq!(found.len(), MAX_ERRORS_PER_FILE + 1);
    assert!(found[MAX_ERRORS_PER_FILE].ends_with("400 further errors in this file are not shown"));
}
