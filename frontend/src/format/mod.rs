//! `khz fmt`: one layout for Structured Text.
//!
//! ```text
//! text ─ lex ─▶ tokens ─ outline ─▶ what only the tree knows ─ split ─▶ lines ─ spacing, layout ─▶ text
//! ```
//!
//! - [`scan`](self) keeps the tokens, comments and pragmas among them, with what stood between them: nothing, a line
//!   break, a blank line.
//! - `outline` asks the tree the two things that tokens alone do not tell: where the arms of a CASE begin, and where the
//!   head of a POU ends.
//! - `split` cuts the tokens into logical lines (a statement, a declaration, a head, an `END_…`, a comment of its own)
//!   and gives each its level.
//! - `spacing` says which neighbours have a space between them.
//! - `layout` writes a line, over several lines of text if it is too long or a comment in it ends its line.
//!
//! **The layout depends on the tokens and on little else**: whether a comment shared its line with what stands before and
//! after it, and where blank lines were. Each of these is the same in the output, so formatting twice is formatting once.
//!
//! **Nothing is lost.** The output is lexed again and compared with the input, token by token, before it is given away:
//! whoever formats a file keeps every token and every comment of it, or keeps the file.
//!
//! Nothing here recurses into what a user wrote (open blocks and brackets are kept on stacks of our own), and the time is
//! linear in the text.
//!
//! ```
//! use khz_frontend::format::{FormatOptions, format};
//!
//! let untidy = "program p var n:int; end_var\nif n<3 then n:=n+1; end_if; // count\nend_program";
//! let tidy = "PROGRAM p\nVAR\n  n : int;\nEND_VAR\n  IF n < 3 THEN\n    n := n + 1;\n  END_IF; // count\nEND_PROGRAM\n";
//! assert_eq!(format(untidy, &FormatOptions::default()).as_deref(), Ok(tidy));
//! ```

mod comment;
mod layout;
mod outline;
mod pieces;
mod scan;
mod spacing;
mod split;

use crate::diagnostics::{Diagnostic, Severity, has_errors};
use crate::source::SourceMap;

/// The deepest indentation of one level that is honoured, in spaces: output grows with level times indentation.
pub const MAX_INDENT: u8 = 16;

/// How reserved words are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum KeywordCase {
    /// In upper case, as the standard writes them.
    #[default]
    Upper,
    /// As they are.
    Keep,
}

/// How a text is laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FormatOptions {
    /// Spaces of one level, at most [`MAX_INDENT`].
    pub indent: u8,
    /// Characters that a line should not exceed. A line that cannot be broken may.
    pub width: usize,
    /// How reserved words are written.
    pub keywords: KeywordCase,
}

impl Default for FormatOptions {
    fn default() -> Self {
        Self { indent: 2, width: 100, keywords: KeywordCase::Upper }
    }
}

/// Why a text was not formatted.
#[derive(Clone, Debug, thiserror::Error)]
pub enum FormatError {
    /// It has syntax errors: their diagnostics, with spans in file 0 of a map that holds this text alone.
    #[error("the text has syntax errors")]
    Syntax(Vec<Diagnostic>),
    /// The output would not have had the tokens of the input: a fault of the formatter, never of the text.
    #[error(
        "the formatted text would not have the same tokens from byte {at} of the source on (a fault of khz: please report it)"
    )]
    TokensChanged {
        /// Offset of the first token that differs.
        at: u32,
    },
}

impl PartialEq for FormatError {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Syntax(a), Self::Syntax(b)) => {
                a.iter().map(|one| (one.code(), one.span)).eq(b.iter().map(|one| (one.code(), one.span)))
            }
            (Self::TokensChanged { at: a }, Self::TokensChanged { at: b }) => a == b,
            _ => false,
        }
    }
}

/// Formats a text.
///
/// # Errors
/// [`FormatError::Syntax`] if it has syntax errors: what cannot be parsed cannot be laid out without guessing.
pub fn format(text: &str, options: &FormatOptions) -> Result<String, FormatError> {
    let options = FormatOptions { indent: options.indent.min(MAX_INDENT), ..*options };
    let mut sources = SourceMap::new();
    sources.add_text("", text);
    let (ast, found) = crate::syntax::parser::parse(&sources);
    if has_errors(&found) {
        return Err(FormatError::Syntax(found.into_iter().filter(|one| one.severity == Severity::Error).collect()));
    }
    let outline = outline::Outline::new(&ast);
    let scanned = scan::Scanned::new(text);
    let lines = split::split(&scanned, &outline);
    let mut writer = layout::Writer::new(&scanned, options);
    for line in &lines {
        writer.line(line);
    }
    let output = writer.finish();
    match scan::first_difference(&scanned, &scan::Scanned::new(&output)) {
        None => Ok(output),
        Some(at) => Err(FormatError::TokensChanged { at }),
    }
}
