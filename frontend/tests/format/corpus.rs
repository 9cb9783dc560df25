//! What holds for all programs of the repository and for what comes of them by changing tokens.

use super::{check, parses, tokens};
use khz_bytecode::container;
use khz_frontend::compile::{CompileOptions, SourceInput, compile};
use khz_frontend::diagnostics::has_errors;
use khz_frontend::format::{FormatOptions, KeywordCase};
use khz_frontend::syntax::lexer::{TokenKind, lex};
use std::path::{Path, PathBuf};

/// All Structured Text files of the repository: path and text.
pub fn programs() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace");
    let mut folders =
        vec![root.join("examples"), root.join("tests"), root.join("frontend/tests"), root.join("benches")];
    let mut files: Vec<PathBuf> = Vec::new();
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        for entry in entries {
            let path = entry.expect("a folder that can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "st") {
                files.push(path);
            }
        }
    }
    files.sort();
    let texts = files.iter().filter_map(|path| Some((path.display().to_string(), std::fs::read_to_string(path).ok()?)));
    texts.filter(|(_, text)| parses(text)).collect()
}

/// The programs of this crate's tests: enough of each construct to try many changes of each.
pub fn samples() -> Vec<(String, String)> {
    programs().into_iter().filter(|(name, _)| name.contains("frontend/tests/")).collect()
}

/// Options that break lines everywhere, nowhere, and as usual.
fn all_options() -> [FormatOptions; 4] {
    [
        FormatOptions::default(),
        FormatOptions { width: 30, ..FormatOptions::default() },
        FormatOptions { width: 0, indent: 4, keywords: KeywordCase::Keep },
        FormatOptions { width: 10_000, indent: 0, keywords: KeywordCase::Keep },
    ]
}

#[test]
fn every_program_keeps_its_tokens_and_its_layout() {
    let programs = programs();
    assert!(programs.len() > 20, "the programs of the repository were not found");
    for (name, text) in &programs {
        for options in &all_options() {
            check(name, text, options);
        }
    }
}

/// What a program compiles to, without the lines that the debug section names and the hash of its source; none if it
/// has errors.
fn compiled(text: &str) -> Option<Vec<Vec<u8>>> {
    let input = SourceInput { name: "a.st".to_owned(), bytes: text.as_bytes().to_vec() };
    let compilation = compile(&[input], &CompileOptions { strip: true, ..CompileOptions::default() });
    (!has_errors(&compilation.diagnostics)).then(|| {
        let containers = compilation.resources.into_iter().map(|resource| resource.container);
        containers
            .map(|mut container| {
                container.source_hash = Default::default();
                container::write(&container).expect("a program that fits")
            })
            .collect()
    })
}

#[test]
fn formatted_programs_compile_to_the_same_bytes() {
    let mut programs_compiled = 0;
    for (name, text) in &programs() {
        let Some(before) = compiled(text) else { continue };
        programs_compiled += usize::from(!before.is_empty());
        for options in &all_options() {
            let after = compiled(&check(name, text, options));
            assert!(after.as_ref() == Some(&before), "{name}: formatting changed what the program is compiled to");
        }
    }
    assert!(programs_compiled > 20, "only {programs_compiled} programs of the repository compile");
}

#[test]
fn line_ends_do_not_matter() {
    for (name, text) in &programs() {
        let options = FormatOptions::default();
        let expected = check(name, text, &options);
        assert_eq!(check(name, &text.replace('\n', "\r\n"), &options), expected, "{name}");
    }
}

#[test]
fn layout_depends_on_tokens_only() {
    // Without comments and blank lines nothing but the tokens is left to depend on, apart from arms and values that the
    // writer put on one line.
    for (name, text) in &programs() {
        let words: Vec<&str> = lex(text)
            .iter()
            .filter(|token| !token.kind.is_trivia())
            .map(|token| &text[token.start as usize..token.end as usize])
            .collect();
        let options = FormatOptions::default();
        let expected = check(name, &words.join(" "), &options);
        assert_eq!(check(name, &words.join("  \t "), &options), expected, "{name}");
    }
}

/// A small generator of numbers; the seed is the test's.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 % limit as u64).expect("below a usize")
    }
}

/// What may stand between two tokens without changing the program.
const BETWEEN: [&str; 12] = [
    " ",
    "\n",
    "\n\n\n",
    "\r\n\t",
    " (* inline *) ",
    " (* over\n     two lines *) ",
    " // to the end\n",
    "\n// alone\n",
    "\n\n  (* alone *)\n\n",
    " /* a */ (* b *)\n",
    "\n(* leads *) ",
    " {pragma}\n",
];

#[test]
fn comments_and_white_space_anywhere() {
    let mut numbers = Numbers(0x9E37_79B9_7F4A_7C15);
    let mut formatted = 0;
    for (name, text) in &samples() {
        let tokens = lex(text);
        for _ in 0..24 {
            let mut mixed = String::new();
            let share = 1 + numbers.below(20);
            for (at, token) in tokens.iter().enumerate() {
                let end = tokens.get(at + 1).map_or(text.len(), |next| next.start as usize);
                mixed.push_str(&text[token.start as usize..token.end as usize]);
                mixed.push_str(&text[token.end as usize..end]);
                if numbers.below(share) == 0 {
                    mixed.push_str(BETWEEN[numbers.below(BETWEEN.len())]);
                }
            }
            // A few places mind: an enumeration's base type must stand on its line.
            if parses(&mixed) {
                formatted += 1;
                let options = &all_options()[numbers.below(4)];
                check(name, &mixed, options);
            }
        }
    }
    assert!(formatted > 100, "only {formatted} of the mixed texts parse");
}

#[test]
fn changed_tokens_that_still_parse() {
    let mut formatted = 0;
    for (name, text) in &samples() {
        let tokens = lex(text);
        // Every tenth place of each file: parsing and formatting all of them takes minutes.
        for (at, token) in tokens.iter().enumerate().skip(name.len() % 10).step_by(10) {
            let (start, end) = (token.start as usize, token.end as usize);
            let word = &text[start..end];
            let mut variants = vec![
                format!("{}{}", &text[..start], &text[end..]),
                format!("{}{word} {word}{}", &text[..start], &text[end..]),
            ];
            if let Some(next) = tokens.get(at + 1) {
                let (from, to) = (next.start as usize, next.end as usize);
                variants.push(format!("{}{} {word} {}", &text[..start], &text[from..to], &text[to..]));
            }
            for variant in variants.iter().filter(|variant| parses(variant)) {
                formatted += 1;
                check(name, variant, &FormatOptions { width: 40, ..FormatOptions::default() });
            }
        }
    }
    assert!(formatted > 100, "only {formatted} of the changed texts parse");
}

#[test]
fn reserved_words_keep_their_case_if_asked() {
    let text = "Program p Var retain n : int; End_Var if n<1 Then n:=1; End_If End_Program";
    let kept = check("case", text, &FormatOptions { keywords: KeywordCase::Keep, ..FormatOptions::default() });
    assert_eq!(
        kept,
        "Program p\nVar retain\n  n : int;\nEnd_Var\n  if n < 1 Then\n    n := 1;\n  End_If\nEnd_Program\n"
    );
    let upper = check("case", text, &FormatOptions::default());
    assert!(upper.starts_with("PROGRAM p\nVAR RETAIN\n  n : int;\nEND_VAR\n  IF n < 1 THEN\n"), "{upper}");
    assert!(tokens(&upper).iter().any(|(kind, text)| *kind == TokenKind::Ident && text == "RETAIN"));
}
