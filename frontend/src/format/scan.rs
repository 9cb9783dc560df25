//! The tokens of a text with what stood between them.

use super::comment;
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::{Token, TokenKind, lex};

/// What stands between a token and the one before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Gap {
    /// They share a line.
    SameLine,
    /// A line break. Also what stands before the first token.
    NewLine,
    /// At least one blank line.
    Blank,
}

/// A text as tokens.
pub(super) struct Scanned<'a> {
    /// The text.
    pub text: &'a str,
    /// Its tokens, comments and pragmas included.
    pub tokens: Vec<Token>,
    /// What stands before each token.
    gaps: Vec<Gap>,
    /// For each token: whether the comments from here on end their line, rather than stand before a token on it.
    ends_line: Vec<bool>,
    /// For each token: the first one behind it that is no comment and no pragma.
    next: Vec<Option<usize>>,
}

impl<'a> Scanned<'a> {
    /// The tokens of a text.
    pub fn new(text: &'a str) -> Self {
        let tokens = lex(text);
        let mut gaps = Vec::with_capacity(tokens.len());
        let mut end = None;
        for token in &tokens {
            let breaks = match end {
                None => 1,
                Some(end) => text.get(end..token.start as usize).map_or(0, |gap| gap.matches('\n').count()),
            };
            gaps.push(match breaks {
                0 => Gap::SameLine,
                1 => Gap::NewLine,
                _ => Gap::Blank,
            });
            end = Some(token.end as usize);
        }
        let mut scanned = Self { text, tokens, gaps, ends_line: Vec::new(), next: Vec::new() };
        scanned.look_back();
        scanned
    }

    /// Fills what each token has to know about those behind it.
    fn look_back(&mut self) {
        let count = self.tokens.len();
        self.ends_line = vec![true; count];
        self.next = vec![None; count];
        for at in (0..count.saturating_sub(1)).rev() {
            let following = at + 1;
            let kind = self.kind(following);
            self.ends_line[at] = match kind {
                _ if self.gap(following) != Gap::SameLine => true,
                // Between lines a pragma gets a line of its own.
                TokenKind::Pragma => true,
                TokenKind::Comment => self.ends_line[following],
                _ => false,
            };
            self.next[at] = if kind.is_trivia() { self.next[following] } else { Some(following) };
        }
    }

    /// The kind of a token; [`TokenKind::End`] behind the last one.
    pub fn kind(&self, at: usize) -> TokenKind {
        self.tokens.get(at).map_or(TokenKind::End, |token| token.kind)
    }

    /// The text of a token.
    pub fn slice(&self, at: usize) -> &'a str {
        self.tokens.get(at).and_then(|token| self.text.get(token.start as usize..token.end as usize)).unwrap_or("")
    }

    /// What stands before a token; behind the last one, a line break.
    pub fn gap(&self, at: usize) -> Gap {
        self.gaps.get(at).copied().unwrap_or(Gap::NewLine)
    }

    /// Whether the comments from this one on end their line.
    pub fn ends_line(&self, at: usize) -> bool {
        self.ends_line.get(at).copied().unwrap_or(true)
    }

    /// The first token behind this one that is no comment and no pragma.
    pub fn next(&self, at: usize) -> Option<usize> {
        self.next.get(at).copied().flatten()
    }

    /// The reserved word that a token is.
    pub fn keyword(&self, at: usize) -> Option<Keyword> {
        match self.kind(at) {
            TokenKind::Keyword(word) => Some(word),
            _ => None,
        }
    }

    /// Whether a token is a name that reads `word`: for words that are reserved in one place only.
    pub fn is_word(&self, at: usize, word: &str) -> bool {
        self.kind(at) == TokenKind::Ident && self.slice(at).eq_ignore_ascii_case(word)
    }
}

/// Where in `before` the first token stands that `after` does not have in its place. Case counts in neither names nor
/// reserved words; in comments the white space at both ends of a line does not count.
pub(super) fn first_difference(before: &Scanned<'_>, after: &Scanned<'_>) -> Option<u32> {
    let same = |at: usize| {
        let (a, b) = (before.slice(at), after.slice(at));
        before.kind(at) == after.kind(at)
            && match before.kind(at) {
                TokenKind::Keyword(_) | TokenKind::Ident => a.eq_ignore_ascii_case(b),
                TokenKind::Comment | TokenKind::Pragma => comment::same(a, b),
                _ => a == b,
            }
    };
    let count = before.tokens.len().max(after.tokens.len());
    let at = (0..count).find(|&at| !same(at))?;
    let end = u32::try_from(before.text.len()).unwrap_or(u32::MAX);
    Some(before.tokens.get(at).map_or(end, |token| token.start))
}
