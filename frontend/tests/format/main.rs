//! The formatter: what it makes of the golden files, and what holds for every text.

#![expect(clippy::missing_panics_doc, reason = "tests panic when they fail")]

mod corpus;
mod golden;
mod hostile;

use khz_frontend::diagnostics::has_errors;
use khz_frontend::format::{FormatOptions, format};
use khz_frontend::source::SourceMap;
use khz_frontend::syntax::lexer::{TokenKind, lex};

/// Whether a text has no syntax errors.
pub fn parses(text: &str) -> bool {
    let mut sources = SourceMap::new();
    sources.add_text("a.st", text);
    !has_errors(&khz_frontend::parse(&sources).1)
}

/// The tokens of a text, comments among them, so that those of a text and of the same text formatted are equal.
pub fn tokens(text: &str) -> Vec<(TokenKind, String)> {
    lex(text)
        .into_iter()
        .map(|token| {
            let text = &text[token.start as usize..token.end as usize];
            let text = match token.kind {
                TokenKind::Keyword(_) | TokenKind::Ident => text.to_ascii_uppercase(),
                TokenKind::Comment | TokenKind::Pragma => text.split_whitespace().collect::<Vec<_>>().join(" "),
                _ => text.to_owned(),
            };
            (token.kind, text)
        })
        .collect()
}

/// Formats a text that parses and checks everything that holds for every result.
pub fn check(name: &str, text: &str, options: &FormatOptions) -> String {
    let once = format(text, options).unwrap_or_else(|error| panic!("{name}: {error:?}\n{text}"));
    assert_eq!(tokens(text), tokens(&once), "{name}: the tokens changed:\n{text}\n=====\n{once}");
    assert!(parses(&once), "{name}: the result does not parse:\n{once}");
    let twice = format(&once, options).unwrap_or_else(|error| panic!("{name}: {error:?}\n{once}"));
    assert_eq!(once, twice, "{name}: the second run changed something; before:\n{text}");
    assert!(once.is_empty() || once.ends_with('\n') && !once.ends_with("\n\n"), "{name}: one line end at the end");
    assert!(!once.contains("\n\n\n"), "{name}: more than one blank line");
    let pragma_free = once.lines().filter(|line| !line.contains(['{', '}']));
    for line in pragma_free {
        assert_eq!(line.trim_end_matches([' ', '\t', '\r']), line, "{name}: white space at the end of a line");
    }
    once
}
