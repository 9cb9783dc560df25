//! Which neighbours in a line have a space between them.

use super::scan::Scanned;
use super::split::{Line, LineKind};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// Types whose names begin literals: `T #5` is a typed literal, `T#5` a time, so the space is kept.
const LITERAL_PREFIXES: [&str; 14] =
    ["T", "LT", "TIME", "LTIME", "D", "LD", "DATE", "LDATE", "TOD", "LTOD", "TIME_OF_DAY", "LTIME_OF_DAY", "DT", "LDT"];

/// The same with more letters.
const LONG_LITERAL_PREFIXES: [&str; 2] = ["DATE_AND_TIME", "LDATE_AND_TIME"];

/// Goes through the tokens of one line and says before which a space stands.
pub(super) struct Spacing<'a> {
    scanned: &'a Scanned<'a>,
    kind: LineKind,
    /// The token before, comments included.
    before: Option<usize>,
    /// The last token that was no comment.
    last: Option<usize>,
    /// That token was a sign.
    sign: bool,
    /// How many brackets are open.
    depth: usize,
    /// A type is being read: between the `:` of a declaration and its `:=`.
    in_type: bool,
    /// The `:` of a label is still to come.
    in_label: bool,
}

impl<'a> Spacing<'a> {
    /// For the tokens of a line, from its first on.
    pub fn new(scanned: &'a Scanned<'a>, line: &Line) -> Self {
        Self {
            scanned,
            kind: line.kind,
            before: None,
            last: None,
            sign: false,
            depth: 0,
            in_type: false,
            in_label: line.kind == LineKind::CaseLabel,
        }
    }

    /// Whether a space stands before the next token of the line, if both stand on one line of text; and whether the
    /// token is a binary operator.
    pub fn next(&mut self, at: usize) -> (bool, bool) {
        let kind = self.scanned.kind(at);
        let space = self.before.is_some_and(|before| self.between(before, at));
        let sign = matches!(kind, TokenKind::Plus | TokenKind::Minus)
            && !self.last.is_some_and(|last| self.ends_operand(last));
        let operator = !sign && rank(kind).is_some() && !(kind == TokenKind::Star && self.is_open_bound());
        self.before = Some(at);
        if kind.is_trivia() {
            return (space, false);
        }
        self.sign = sign;
        self.last = Some(at);
        match kind {
            TokenKind::LeftParen | TokenKind::LeftBracket => self.depth += 1,
            TokenKind::RightParen | TokenKind::RightBracket => self.depth = self.depth.saturating_sub(1),
            TokenKind::Colon if self.depth == 0 => {
                self.in_type = !self.in_label && self.kind != LineKind::ProgramInstance;
                self.in_label = false;
            }
            TokenKind::Assign if self.depth == 0 => self.in_type = false,
            _ => {}
        }
        (space, operator)
    }

    /// `ARRAY[*]`: the `*` follows `[` or `,`.
    fn is_open_bound(&self) -> bool {
        !self.last.is_some_and(|last| self.ends_operand(last))
    }

    /// Whether an operand can end with the token: a sign behind it is an operator.
    fn ends_operand(&self, at: usize) -> bool {
        match self.scanned.kind(at) {
            TokenKind::Keyword(word) => matches!(word, Keyword::True | Keyword::False),
            TokenKind::RightParen | TokenKind::RightBracket | TokenKind::Caret => true,
            TokenKind::Ident | TokenKind::Direct | TokenKind::MalformedDirect | TokenKind::Part => true,
            kind => kind.is_literal(),
        }
    }

    fn between(&self, before: usize, at: usize) -> bool {
        use TokenKind::{
            Caret, Colon, Comma, Comment, Dot, DotDot, Hash, LeftBracket, LeftParen, RightBracket, RightParen,
            Semicolon,
        };
        let (left, right) = (self.scanned.kind(before), self.scanned.kind(at));
        match (left, right) {
            (LeftParen | LeftBracket, Comment) => self.scanned.slice(at).starts_with("//"),
            // An empty statement behind its label.
            (Colon, Semicolon) => true,
            (_, Semicolon | Comma | RightParen | RightBracket) => false,
            (_, Comment | TokenKind::Pragma) | (Comment | TokenKind::Pragma, _) => true,
            (_, Hash) => self.would_be_literal(before, at),
            (Hash, _) => false,
            (_, Dot | Caret | DotDot) | (LeftParen | LeftBracket | Dot | DotDot, _) => false,
            (_, Colon) => !self.in_label,
            _ if self.sign => false,
            (_, LeftParen) => self.before_paren(before),
            (_, LeftBracket) => match left {
                TokenKind::Keyword(Keyword::Array) => false,
                _ => !self.ends_operand(before),
            },
            _ => true,
        }
    }

    /// Whether a space stands before `(`: not in a call, not in a repetition, not before the length of a string.
    fn before_paren(&self, before: usize) -> bool {
        match self.scanned.kind(before) {
            TokenKind::Ident if self.in_type => {
                !self.scanned.is_word(before, "STRING") && !self.scanned.is_word(before, "WSTRING")
            }
            _ => !self.ends_operand(before),
        }
    }

    /// Whether a name and `#` put together would become a literal with the token behind them.
    fn would_be_literal(&self, before: usize, hash: usize) -> bool {
        let prefixes = LITERAL_PREFIXES.iter().chain(&LONG_LITERAL_PREFIXES);
        let is_prefix = prefixes.into_iter().any(|word| self.scanned.is_word(before, word));
        is_prefix && self.scanned.kind(hash + 1) != TokenKind::Ident
    }
}

/// How tight an operator binds, as far as breaking lines goes: loosest first, from 1.
pub(super) fn rank(kind: TokenKind) -> Option<u8> {
    Some(match kind {
        TokenKind::Keyword(Keyword::Or | Keyword::OrElse) => 1,
        TokenKind::Keyword(Keyword::Xor) => 2,
        TokenKind::Keyword(Keyword::And | Keyword::AndThen) | TokenKind::Ampersand => 3,
        TokenKind::Equal | TokenKind::NotEqual => 4,
        TokenKind::Less | TokenKind::Greater | TokenKind::LessEqual | TokenKind::GreaterEqual => 5,
        TokenKind::Plus | TokenKind::Minus => 6,
        TokenKind::Star | TokenKind::Slash | TokenKind::Keyword(Keyword::Mod) => 7,
        TokenKind::Power => 8,
        _ => return None,
    })
}
