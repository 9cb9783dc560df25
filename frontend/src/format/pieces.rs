//! A logical line as pieces: each token with its text, its space, and where the line may break.

use super::scan::{Gap, Scanned};
use super::spacing::{Spacing, rank};
use super::split::{Line, LineKind};
use super::{FormatOptions, KeywordCase};
use crate::syntax::lexer::TokenKind;
use std::borrow::Cow;

/// A token of a line.
pub(super) struct Piece<'a> {
    /// Its text.
    pub text: Cow<'a, str>,
    /// The token.
    pub at: usize,
    /// Its kind.
    pub kind: TokenKind,
    /// Whether a space stands before it when it does not begin a line of text.
    pub space: bool,
    /// The rank of a binary operator.
    pub rank: Option<u8>,
    /// It begins a line of text because of a comment: its own line, or behind one that ends its line.
    pub forced: bool,
    /// It is a comment behind something on its line.
    pub trailing: bool,
    /// Characters from the beginning of the line to behind it, were all on one line.
    pub end: usize,
}

/// What a bracket of a line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bracket {
    /// Arguments, fields, enumeration values: too long, they stand one a line.
    Items,
    /// Initial values of an array: too long, each line takes as many as fit.
    Values,
    /// Parentheses around an expression, an index, bounds.
    Plain,
}

/// A bracket with what it needs to be laid out.
pub(super) struct Group {
    /// What it is.
    pub bracket: Bracket,
    /// Its closing piece.
    pub close: usize,
    /// A comment breaks a line in it.
    pub forced: bool,
}

/// A line cut into pieces.
pub(super) struct Pieces<'a> {
    /// The pieces in order.
    pub all: Vec<Piece<'a>>,
    /// Behind the last piece that is no comment.
    pub code_end: usize,
}

impl<'a> Pieces<'a> {
    /// The pieces of a line.
    pub fn new(scanned: &Scanned<'a>, line: &Line, options: FormatOptions) -> Self {
        let mut spacing = Spacing::new(scanned, line);
        let mut all: Vec<Piece<'a>> = Vec::with_capacity(line.tokens.len());
        let (mut end, mut code_end) = (0, 0);
        for at in line.tokens.clone() {
            let kind = scanned.kind(at);
            let (space, operator) = spacing.next(at);
            let text = word(scanned, at, line, options);
            let first = all.is_empty();
            let on_new_line = scanned.gap(at) != Gap::SameLine;
            let around_comment = kind.is_trivia() || all.last().is_some_and(|last| last.kind.is_trivia());
            let width = text.split('\n').next().map_or(0, |text| text.trim_end().chars().count());
            end += width + usize::from(space);
            if !kind.is_trivia() {
                code_end = all.len() + 1;
            }
            all.push(Piece {
                text,
                at,
                kind,
                space,
                rank: if operator { rank(kind) } else { None },
                forced: !first && on_new_line && around_comment,
                trailing: !first && kind.is_trivia() && !on_new_line && scanned.gap(at + 1) != Gap::SameLine,
                end,
            });
        }
        Self { all, code_end }
    }

    /// Whether the line has no need to be broken if `room` characters fit. Comments behind it do not count.
    pub fn fit(&self, room: usize) -> bool {
        let forced = self.all.iter().any(|piece| piece.forced);
        let code = self.code_end.checked_sub(1).and_then(|last| self.all.get(last));
        !forced && code.is_none_or(|last| last.end <= room)
    }
}

/// The text of a token: reserved words in upper case if that is asked for, also where they are reserved in one place only.
fn word<'a>(scanned: &Scanned<'a>, at: usize, line: &Line, options: FormatOptions) -> Cow<'a, str> {
    let text = scanned.slice(at);
    if options.keywords == KeywordCase::Keep {
        return Cow::Borrowed(text);
    }
    match scanned.kind(at) {
        TokenKind::Keyword(word) => Cow::Borrowed(word.text()),
        TokenKind::Ident if is_word_of_place(scanned, at, line) => Cow::Owned(text.to_ascii_uppercase()),
        _ => Cow::Borrowed(text),
    }
}

/// Whether a name is a reserved word at its place.
fn is_word_of_place(scanned: &Scanned<'_>, at: usize, line: &Line) -> bool {
    let is = |words: &[&str]| words.iter().any(|word| scanned.is_word(at, word));
    let before = (line.tokens.start..at).rev().map(|at| scanned.kind(at)).find(|kind| !kind.is_trivia());
    let next = scanned.next(at).map_or(TokenKind::End, |next| scanned.kind(next));
    let after_name = before == Some(TokenKind::Ident);
    match line.kind {
        LineKind::SectionHead => true,
        LineKind::TestHead | LineKind::TestEnd => before.is_none(),
        LineKind::ResourceHead => before.is_none() || is(&["ON"]),
        LineKind::Task => {
            before.is_none()
                || (matches!(before, Some(TokenKind::LeftParen | TokenKind::Comma))
                    && next == TokenKind::Assign
                    && is(&["SINGLE", "INTERVAL", "PRIORITY"]))
        }
        LineKind::ProgramInstance => {
            (after_name && is(&["WITH"]))
                || (matches!(before, Some(TokenKind::Keyword(_)))
                    && next == TokenKind::Ident
                    && scanned.next(at).is_some_and(|next| !scanned.is_word(next, "WITH"))
                    && is(&["RETAIN", "NON_RETAIN"]))
        }
        LineKind::Plain => {
            (is(&["AT"]) && next == TokenKind::Direct)
                || (after_name && is(&["R_EDGE", "F_EDGE", "READ_WRITE", "READ_ONLY"]))
        }
        LineKind::CaseLabel => false,
    }
}

/// The brackets of a line and the places where it may break.
pub(super) struct Breaks {
    /// The brackets.
    pub groups: Vec<Group>,
    /// For each piece that opens a bracket: which.
    pub opens: Vec<Option<usize>>,
    /// For each piece before which a line may break: the piece at which the next such place of the same list or
    /// expression is, or its end.
    pub segments: Vec<Option<usize>>,
    /// For each piece: how many characters cannot be parted from what stands before it, from it on.
    pub tails: Vec<usize>,
}

/// A bracket while its pieces are read.
struct OpenGroup {
    /// Its index; none of the line itself.
    group: Option<usize>,
    /// The run that is being read.
    run: usize,
    commas: bool,
    forced: bool,
    index_like: bool,
}

impl Breaks {
    /// Finds the brackets of a line, in one pass forwards and one backwards.
    pub fn new(pieces: &Pieces<'_>) -> Self {
        let all = &pieces.all;
        let mut breaks = Self {
            groups: Vec::new(),
            opens: vec![None; all.len()],
            segments: vec![None; all.len()],
            tails: vec![0; all.len() + 1],
        };
        // A run is what stands between two commas of a bracket: the loosest operator in it is where it breaks.
        let mut runs = vec![u8::MAX];
        let mut run_of = Vec::with_capacity(all.len());
        let mut group_of = Vec::with_capacity(all.len());
        let mut open = vec![OpenGroup { group: None, run: 0, commas: false, forced: false, index_like: true }];
        for (at, piece) in all.iter().enumerate() {
            if matches!(piece.kind, TokenKind::RightParen | TokenKind::RightBracket) && open.len() > 1 {
                breaks.close(&mut open, at);
            }
            let Some(top) = open.last_mut() else { break };
            top.forced |= piece.forced;
            if let (Some(rank), Some(loosest)) = (piece.rank, runs.get_mut(top.run)) {
                *loosest = rank.min(*loosest);
            }
            run_of.push(top.run);
            group_of.push(top.group);
            if piece.kind == TokenKind::Comma {
                top.commas = true;
                top.run = runs.len();
                runs.push(u8::MAX);
            }
            if matches!(piece.kind, TokenKind::LeftParen | TokenKind::LeftBracket) {
                let index_like = piece.kind == TokenKind::LeftBracket && !piece.space && !follows_opening(all, at);
                breaks.opens[at] = Some(breaks.groups.len());
                open.push(OpenGroup {
                    group: Some(breaks.groups.len()),
                    run: runs.len(),
                    commas: false,
                    forced: false,
                    index_like,
                });
                runs.push(u8::MAX);
                let values = piece.kind == TokenKind::LeftBracket;
                let bracket = if values { Bracket::Values } else { Bracket::Items };
                breaks.groups.push(Group { bracket, close: all.len(), forced: false });
            }
        }
        while open.len() > 1 {
            breaks.close(&mut open, all.len());
        }
        breaks.look_back(pieces, &runs, &run_of, &group_of);
        breaks
    }

    fn close(&mut self, open: &mut Vec<OpenGroup>, at: usize) {
        let Some(closed) = open.pop() else { return };
        let Some(group) = closed.group.and_then(|group| self.groups.get_mut(group)) else { return };
        group.close = at;
        group.forced = closed.forced;
        if !closed.commas || closed.index_like {
            group.bracket = Bracket::Plain;
        }
        if let Some(outer) = open.last_mut() {
            outer.forced |= closed.forced;
        }
    }

    /// Where the segments end and how long the tails are.
    fn look_back(&mut self, pieces: &Pieces<'_>, runs: &[u8], run_of: &[usize], group_of: &[Option<usize>]) {
        // The next place to break, for the line and for each bracket.
        let mut next: Vec<usize> = self.groups.iter().map(|group| group.close).collect();
        let mut next_of_line = pieces.code_end;
        for (at, piece) in pieces.all.iter().enumerate().rev() {
            let start = at.checked_sub(1).and_then(|before| pieces.all.get(before)).map_or(0, |before| before.end);
            let closes = matches!(
                piece.kind,
                TokenKind::Semicolon | TokenKind::Comma | TokenKind::RightParen | TokenKind::RightBracket
            );
            let header = matches!(piece.kind, TokenKind::Keyword(word) if matches!(word.text(), "THEN" | "DO" | "OF"));
            if closes || header {
                self.tails[at] = piece.end - start + self.tails[at + 1];
            }
            let after_comma = at > 0 && pieces.all[at - 1].kind == TokenKind::Comma;
            let loosest = run_of.get(at).and_then(|&run| runs.get(run)).copied();
            if !after_comma && (piece.rank.is_none() || piece.rank != loosest) {
                continue;
            }
            let group = group_of.get(at).copied().flatten();
            let slot = group.and_then(|group| next.get_mut(group)).unwrap_or(&mut next_of_line);
            self.segments[at] = Some(*slot);
            *slot = at;
        }
    }
}

/// Whether the piece stands right behind an opening bracket, where no space tells a value from an index.
fn follows_opening(all: &[Piece<'_>], at: usize) -> bool {
    let before = all.get(..at).and_then(|before| before.iter().rev().find(|piece| !piece.kind.is_trivia()));
    before.is_some_and(|before| matches!(before.kind, TokenKind::LeftBracket | TokenKind::LeftParen))
}
