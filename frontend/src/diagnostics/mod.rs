//! What is wrong with a program, said so that its writer can mend it.
//!
//! Each thing that can be said is one [`Rule`]: a row of a table with its code, severity, title, explanation and a wrong
//! and a right example. The tables are [`syntax`] (P…), [`semantic`] (S…) and [`types`] (T…); `khz explain`, the
//! generated reference and the tests are derived from them. Codes are stable: a code is never given a new meaning.
//!
//! A [`Diagnostic`] is one occurrence of a rule at a place. To add one: add a row to the table (the compiler then wants
//! the wrong and right example, and a test compiles both), and report `Diagnostic::new(&semantic::THE_ROW, span, text)`.

pub mod files;
pub mod render;
pub mod semantic;
pub(crate) mod similar;
pub mod syntax;
pub mod types;

use crate::source::{FileId, Span};
use std::collections::BTreeMap;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// The program is refused.
    Error,
    /// Legal, and most likely not what was meant.
    Warning,
    /// Something to know.
    Note,
}

impl Severity {
    /// The word that messages show.
    pub fn word(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        }
    }
}

/// A row of a diagnostics table.
#[derive(Debug, PartialEq, Eq)]
pub struct Rule {
    /// `P0001`: P for syntax, S for names and configuration, T for types, F for files that are no plain Structured Text.
    pub code: &'static str,
    /// How bad an occurrence is.
    pub severity: Severity,
    /// A short title.
    pub title: &'static str,
    /// What it means and what to do.
    pub explanation: &'static str,
    /// A complete source file that gives this diagnostic. Empty where text cannot show it (the bytes of a file).
    pub wrong: &'static str,
    /// The same file, mended: it gives no error.
    pub right: &'static str,
    /// The name of that file; its ending says how it is read.
    pub file: &'static str,
}

/// Declares a table of rules: a static for each row, and `TABLE` with all rows in order.
macro_rules! rules {
    ($(#[doc = $table_doc:literal])* table;
     $($name:ident = $code:literal $severity:ident $title:literal {
        $explanation:literal $(in $file:literal)? wrong $wrong:literal right $right:literal
     })*) => {
        $(
            #[doc = concat!($code, ": ", $title, ".")]
            pub static $name: $crate::diagnostics::Rule = $crate::diagnostics::Rule {
                code: $code,
                severity: $crate::diagnostics::Severity::$severity,
                title: $title,
                explanation: $explanation,
                wrong: $wrong,
                right: $right,
                file: $crate::diagnostics::rules!(file $($file)?),
            };
        )*
        $(#[doc = $table_doc])*
        pub static TABLE: &[&$crate::diagnostics::Rule] = &[$(&$name),*];
    };
    (file) => { "example.st" };
    (file $file:literal) => { $file };
}
pub(crate) use rules;

/// All rows of all tables, in order of their codes.
pub fn all_rules() -> impl Iterator<Item = &'static Rule> {
    syntax::TABLE.iter().chain(semantic::TABLE).chain(types::TABLE).chain(files::TABLE).copied()
}

/// The rule of a code, in any case (`p0001`).
pub fn rule(code: &str) -> Option<&'static Rule> {
    all_rules().find(|rule| rule.code.eq_ignore_ascii_case(code))
}

/// One occurrence of a rule.
#[derive(Clone, Debug)]
pub struct Diagnostic {
    /// Which rule.
    pub rule: &'static Rule,
    /// The rule's severity, unless the reporter knows better (warnings as errors, say).
    pub severity: Severity,
    /// What is wrong here, in one line, without the place.
    pub message: String,
    /// The place that the message is about.
    pub span: Span,
    /// Other places that explain it, each with a short text.
    pub labels: Vec<(Span, String)>,
    /// How to mend it.
    pub help: Option<String>,
}

impl Diagnostic {
    /// An occurrence of `rule` at `span`.
    pub fn new(rule: &'static Rule, span: Span, message: impl Into<String>) -> Self {
        Self { rule, severity: rule.severity, message: message.into(), span, labels: Vec::new(), help: None }
    }

    /// The same with another place that explains it.
    #[must_use]
    pub fn label(mut self, span: Span, text: impl Into<String>) -> Self {
        self.labels.push((span, text.into()));
        self
    }

    /// The same with a way to mend it.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = Some(text.into());
        self
    }

    /// The rule's code.
    pub fn code(&self) -> &'static str {
        self.rule.code
    }

    /// Whether it refuses the program.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}

/// Whether one of them refuses the program.
pub fn has_errors(diagnostics: &[Diagnostic]) -> bool {
    diagnostics.iter().any(Diagnostic::is_error)
}

/// How many errors of one file are kept; the rest is counted.
pub const MAX_ERRORS_PER_FILE: usize = 100;

/// Puts diagnostics in the order in which people read them (file, place, then the order in which they were found), drops
/// exact repetitions, and cuts each file's errors off after [`MAX_ERRORS_PER_FILE`] with a note that says how many more
/// there were.
pub fn tidy(mut diagnostics: Vec<Diagnostic>) -> Vec<Diagnostic> {
    diagnostics.sort_by_key(|found| (found.span.file, found.span.start));
    diagnostics.dedup_by(|a, b| a.span == b.span && a.rule == b.rule && a.message == b.message);
    let mut errors: BTreeMap<FileId, (usize, Span)> = BTreeMap::new();
    let mut kept = Vec::with_capacity(diagnostics.len());
    for found in diagnostics {
        if found.is_error() {
            let (count, last) = errors.entry(found.span.file).or_insert((0, found.span));
            *count += 1;
            if *count > MAX_ERRORS_PER_FILE {
                continue;
            }
            *last = found.span;
        }
        kept.push(found);
    }
    for (count, last) in errors.into_values() {
        if count > MAX_ERRORS_PER_FILE {
            let more = count - MAX_ERRORS_PER_FILE;
            let message = format!("{more} further errors in this file are not shown");
            kept.push(Diagnostic::new(&syntax::TOO_MANY_ERRORS, last, message));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_unique_ordered_and_of_their_table() {
        for (table, letter) in [(syntax::TABLE, 'P'), (semantic::TABLE, 'S'), (types::TABLE, 'T'), (files::TABLE, 'F')]
        {
            assert!(table.windows(2).all(|pair| pair[0].code < pair[1].code), "codes of table {letter} in order");
            for row in table {
                assert_eq!(row.code.len(), 5);
                assert!(row.code.starts_with(letter) && row.code[1..].bytes().all(|byte| byte.is_ascii_digit()));
                assert!(!row.title.is_empty() && !row.title.ends_with('.'), "{}: title without full stop", row.code);
                assert!(row.explanation.ends_with('.'), "{}: explanation in sentences", row.code);
            }
        }
    }

    #[test]
    fn rules_are_found_in_any_case() {
        assert_eq!(rule("p0001"), Some(&syntax::NOT_SOURCE_TEXT));
        assert_eq!(rule("P9999"), None);
    }

    #[test]
    fn errors_are_capped_per_file_and_sorted() {
        let at = |file, start| Span::new(FileId(file), start, start + 1);
        let mut all: Vec<Diagnostic> =
            (0..150).rev().map(|start| Diagnostic::new(&syntax::EXPECTED, at(0, start), "x")).collect();
        all.push(Diagnostic::new(&syntax::EXPECTED, at(1, 5), "y"));
        all.push(Diagnostic::new(&syntax::EXPECTED, at(1, 5), "y"));
        let tidied = tidy(all);
        assert_eq!(tidied.len(), MAX_ERRORS_PER_FILE + 2);
        assert!(tidied[..100].windows(2).all(|pair| pair[0].span.start < pair[1].span.start));
        let last = &tidied[tidied.len() - 1];
        assert_eq!(
            (last.code(), last.message.as_str()),
            (syntax::TOO_MANY_ERRORS.code, "50 further errors in this file are not shown")
        );
        assert!(!last.is_error());
    }
}
