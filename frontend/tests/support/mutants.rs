//! Programs with one token deleted, doubled or swapped with the next one: what a slip of the hand makes of a program.

use khz_frontend::diagnostics::{Diagnostic, has_errors};
use khz_frontend::syntax::lexer::{Token, TokenKind, lex};
use khz_frontend::{CompileOptions, SourceInput, compile};

/// What was done to a token.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slip {
    Deleted,
    Doubled,
    Swapped,
}

/// All of them.
pub const SLIPS: [Slip; 3] = [Slip::Deleted, Slip::Doubled, Slip::Swapped];

/// The tokens of a program that can be changed.
pub fn tokens(text: &str) -> Vec<Token> {
    lex(text).into_iter().filter(|token| token.kind != TokenKind::Comment).collect()
}

/// The program with one slip. `None`: the last token has no next one.
pub fn mutant(text: &str, tokens: &[Token], at: usize, slip: Slip) -> Option<String> {
    let range = |token: &Token| token.start as usize..token.end as usize;
    let this = range(tokens.get(at)?);
    let word = &text[this.clone()];
    Some(match slip {
        Slip::Deleted => format!("{} {}", &text[..this.start], &text[this.end..]),
        Slip::Doubled => format!("{} {word}{}", &text[..this.end], &text[this.end..]),
        Slip::Swapped => {
            let next = range(tokens.get(at + 1)?);
            let (before, between, after) = (&text[..this.start], &text[this.end..next.start], &text[next.end..]);
            // Spaces, so that they stay tokens.
            format!("{before} {}{between} {word} {after}", &text[next])
        }
    })
}

/// What is said about a program.
#[derive(Debug)]
pub struct Verdict {
    pub refused: bool,
    /// Whether a container came of it.
    pub is_compiled: bool,
    pub diagnostics: Vec<Diagnostic>,
    /// `LINE:COLUMN CODE message` of each.
    pub lines: Vec<String>,
    /// How many of them have a place outside of the file.
    pub without_place: usize,
}

/// Compiles a program.
pub fn verdict(text: &str) -> Verdict {
    let source = SourceInput { name: "m.st".to_owned(), bytes: text.as_bytes().to_vec() };
    let found = compile(&[source], &CompileOptions::default());
    let inside = |one: &Diagnostic| {
        let file = found.sources.file(one.span.file);
        file.is_some_and(|file| file.name() == "m.st" && one.span.end as usize <= file.text().len())
    };
    let without_place = found.diagnostics.iter().filter(|one| !inside(one)).count();
    let line = |one: &Diagnostic| format!("{} {} {}", found.sources.place(one.span), one.code(), one.message);
    Verdict {
        refused: has_errors(&found.diagnostics),
        is_compiled: !found.resources.is_empty(),
        lines: found.diagnostics.iter().map(line).collect(),
        without_place,
        diagnostics: found.diagnostics,
    }
}

/// Figures over many mutants.
#[derive(Debug, Default)]
pub struct Tally {
    pub mutants: usize,
    pub refused: usize,
    pub without_place: usize,
    /// Mutants that give no container, and nothing says why.
    pub silent: usize,
    /// How many refused mutants have this many diagnostics (the last entry: or more).
    pub counts: [usize; 12],
}

impl Tally {
    pub fn add(&mut self, verdict: &Verdict) {
        self.mutants += 1;
        self.without_place += verdict.without_place;
        self.silent += usize::from(!verdict.is_compiled && !verdict.refused);
        if verdict.refused {
            self.refused += 1;
            let last = self.counts.len() - 1;
            self.counts[verdict.diagnostics.len().min(last)] += 1;
        }
    }

    /// Of 1000 refused mutants, how many have at most three diagnostics.
    pub fn few_per_mille(&self) -> usize {
        self.counts[..=3].iter().sum::<usize>() * 1000 / self.refused.max(1)
    }
}
