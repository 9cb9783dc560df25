//! Writes lines; one that is too long, or has a comment that ends its line in it, over several lines of text.

use super::FormatOptions;
use super::comment;
use super::pieces::{Bracket, Breaks, Piece, Pieces};
use super::scan::{Gap, Scanned};
use super::split::Line;
use crate::syntax::lexer::TokenKind;

/// Levels by which an expression that goes on is indented: one more than what stands in a block.
const CONTINUATION_LEVELS: usize = 2;

/// The text that comes out.
pub(super) struct Writer<'a> {
    scanned: &'a Scanned<'a>,
    options: FormatOptions,
    out: String,
    /// The column of the next character.
    column: usize,
    /// The indentation of the current line of text.
    indent: usize,
    /// Nothing stands on the current line of text yet.
    fresh: bool,
}

/// A bracket that is open, or the line itself.
struct Open {
    /// None if its contents do not stand on lines of their own.
    broken: Option<Bracket>,
    /// The indentation of its contents.
    inner: usize,
    /// The indentation of its closing bracket.
    outer: usize,
    /// Its closing piece.
    close: usize,
}

impl<'a> Writer<'a> {
    /// An empty text.
    pub fn new(scanned: &'a Scanned<'a>, options: FormatOptions) -> Self {
        let out = String::with_capacity(scanned.text.len() + scanned.text.len() / 4);
        Self { scanned, options, out, column: 0, indent: 0, fresh: true }
    }

    /// All that was written.
    pub fn finish(self) -> String {
        self.out
    }

    /// Writes a logical line.
    pub fn line(&mut self, line: &Line) {
        if line.blank_before {
            self.out.push('\n');
        }
        let pieces = Pieces::new(self.scanned, line, self.options);
        let indent = line.level.saturating_mul(usize::from(self.options.indent));
        self.begin(indent);
        if pieces.fit(self.options.width.saturating_sub(indent)) {
            for piece in &pieces.all {
                self.piece(piece);
            }
        } else {
            self.broken_line(&pieces);
        }
        self.out.push('\n');
    }

    /// Begins a line of text.
    fn begin(&mut self, indent: usize) {
        self.out.extend(std::iter::repeat_n(' ', indent));
        self.column = indent;
        self.indent = indent;
        self.fresh = true;
    }

    /// Goes to a new line of text before a piece; a blank line before it is kept.
    fn new_line(&mut self, piece: &Piece<'_>, indent: usize, may_be_blank: bool) {
        self.out.push('\n');
        if may_be_blank && self.scanned.gap(piece.at) == Gap::Blank {
            self.out.push('\n');
        }
        self.begin(indent);
    }

    fn piece(&mut self, piece: &Piece<'_>) {
        if piece.space && !std::mem::take(&mut self.fresh) {
            self.out.push(' ');
            self.column += 1;
        }
        self.fresh = false;
        if !piece.kind.is_trivia() {
            self.out.push_str(&piece.text);
            self.column += piece.text.chars().count();
            return;
        }
        let start = self.scanned.tokens.get(piece.at).map_or(0, |token| token.start as usize);
        let (text, from) = (self.scanned.text, self.out.len());
        comment::write(&mut self.out, &piece.text, || comment::column(text, start), self.column);
        let written = self.out.get(from..).unwrap_or("");
        match written.rfind('\n') {
            None => self.column += written.chars().count(),
            Some(end) => self.column = written.get(end + 1..).map_or(0, |last| last.chars().count()),
        }
    }

    fn broken_line(&mut self, pieces: &Pieces<'_>) {
        let breaks = Breaks::new(pieces);
        let mut open = vec![Open { broken: None, inner: self.indent, outer: self.indent, close: pieces.all.len() }];
        // The last piece that was no comment.
        let mut code: Option<TokenKind> = None;
        for (at, piece) in pieces.all.iter().enumerate() {
            self.break_before(pieces, &breaks, &mut open, at, code);
            self.piece(piece);
            if !piece.kind.is_trivia() {
                code = Some(piece.kind);
            }
            if let Some(group) = breaks.opens.get(at).copied().flatten() {
                let opened = self.open(pieces, &breaks, group, at, open.last());
                open.push(opened);
            }
        }
    }

    /// Decides how the bracket that a piece opens is laid out.
    fn open(&self, pieces: &Pieces<'_>, breaks: &Breaks, group: usize, at: usize, around: Option<&Open>) -> Open {
        let inner = around.map_or(0, |around| around.inner);
        let plain = Open { broken: None, inner, outer: inner, close: pieces.all.len() };
        let Some(group) = breaks.groups.get(group) else { return plain };
        let width = end_of(pieces, group.close).saturating_sub(end_of(pieces, at));
        let tail = breaks.tails.get(group.close + 1).copied().unwrap_or(0);
        let fits = self.column + width + tail <= self.options.width;
        if group.bracket == Bracket::Plain || (fits && !group.forced) {
            return Open { close: group.close, ..plain };
        }
        Open {
            broken: Some(group.bracket),
            inner: self.indent + usize::from(self.options.indent),
            outer: self.indent,
            close: group.close,
        }
    }

    /// Goes to a new line before a piece if it has to begin one.
    fn break_before(
        &mut self,
        pieces: &Pieces<'_>,
        breaks: &Breaks,
        open: &mut Vec<Open>,
        at: usize,
        code: Option<TokenKind>,
    ) {
        let Some(piece) = pieces.all.get(at) else { return };
        let before = at.checked_sub(1).and_then(|before| pieces.all.get(before)).map(|before| before.kind);
        if open.len() > 1
            && open.last().is_some_and(|top| top.close == at)
            && let Some(closed) = open.pop()
        {
            if closed.broken.is_some() {
                self.new_line(piece, closed.outer, false);
            } else if piece.forced {
                self.new_line(piece, self.continuation(closed.inner), false);
            }
            return;
        }
        let Some(top) = open.last() else { return };
        let opened = is_opening(before);
        let begins_item = matches!(code, Some(TokenKind::Comma)) || is_opening(code);
        let indent = match top.broken {
            Some(_) if begins_item || piece.kind.is_trivia() => top.inner,
            _ => self.continuation(top.inner),
        };
        let wants = match top.broken {
            _ if piece.forced => true,
            _ if piece.trailing => false,
            Some(_) if opened => true,
            Some(Bracket::Items) if before == Some(TokenKind::Comma) => true,
            Some(Bracket::Values) if before == Some(TokenKind::Comma) => {
                self.scanned.gap(piece.at) != Gap::SameLine || !self.segment_fits(pieces, breaks, at)
            }
            _ => !self.segment_fits(pieces, breaks, at),
        };
        if wants && at > 0 {
            self.new_line(piece, indent, !is_opening(code));
        }
    }

    /// Whether the list or expression fits on the current line up to the next place where it could break. Where it
    /// cannot break at all it has to.
    fn segment_fits(&self, pieces: &Pieces<'_>, breaks: &Breaks, at: usize) -> bool {
        let Some(end) = breaks.segments.get(at).copied().flatten() else { return true };
        let Some(last) = end.checked_sub(1) else { return true };
        let start = at.checked_sub(1).map_or(0, |before| end_of(pieces, before));
        let width = end_of(pieces, last).saturating_sub(start);
        let tail = breaks.tails.get(end).copied().unwrap_or(0);
        self.column + width + tail <= self.options.width
    }

    fn continuation(&self, indent: usize) -> usize {
        indent + CONTINUATION_LEVELS * usize::from(self.options.indent)
    }
}

fn is_opening(kind: Option<TokenKind>) -> bool {
    matches!(kind, Some(TokenKind::LeftParen | TokenKind::LeftBracket))
}

/// Characters from the beginning of the line to behind a piece, were all on one line.
fn end_of(pieces: &Pieces<'_>, at: usize) -> usize {
    pieces.all.get(at).or(pieces.all.last()).map_or(0, |piece| piece.end)
}
