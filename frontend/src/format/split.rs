//! From tokens to logical lines: a statement, a declaration, a head, an `END_…`, a comment on its own.

use super::outline::Outline;
use super::scan::{Gap, Scanned};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;
use std::ops::Range;

/// Words that begin a part of a test file at the top level, and the words that end it. Elsewhere they are names.
const TEST_PARTS: [(&str, &str); 5] = [
    ("TEST", "END_TEST"),
    ("SETUP", "END_SETUP"),
    ("TEARDOWN", "END_TEARDOWN"),
    ("TEST_PROGRAM", "END_TEST_PROGRAM"),
    ("TEST_FUNCTION_BLOCK", "END_TEST_FUNCTION_BLOCK"),
];

/// What a line is, as far as its spacing and its words depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineKind {
    /// A statement, a declaration, an `END_…`, a comment.
    Plain,
    /// `VAR_… CONSTANT`: the head of a variable section.
    SectionHead,
    /// `RESOURCE name ON name`.
    ResourceHead,
    /// `TASK name (…);`
    Task,
    /// `PROGRAM name WITH task : type (…);` in a resource.
    ProgramInstance,
    /// `TEST 'name'`, `SETUP`: the head of a part of a test file.
    TestHead,
    /// `END_TEST`, which is a reserved word here only.
    TestEnd,
    /// `1, 3..5:`, perhaps with its statement behind it.
    CaseLabel,
}

/// A logical line.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// Its tokens: those of the line with the comments in it, and the comments behind it on its last line of text.
    pub tokens: Range<usize>,
    /// How many levels it is indented.
    pub level: usize,
    /// What it is.
    pub kind: LineKind,
    /// Whether a blank line stands before it.
    pub blank_before: bool,
}

/// Something that is open around a line.
#[derive(Clone, Copy)]
struct Frame {
    kind: FrameKind,
    /// The level of the line that opened it.
    level: usize,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum FrameKind {
    /// A configuration: a `RESOURCE` may begin in it, and a `PROGRAM` in it is an instance.
    Configuration,
    /// A resource.
    Resource,
    /// A program, function or function block: its variable sections are not indented.
    Pou,
    /// A part of a test file, which a name ends: laid out like a program.
    Test(&'static str),
    /// A CASE; what is in an arm stands one level deeper than the label, what is in its ELSE does not.
    Case { in_arm: bool },
    /// Everything else: sections, type blocks, structures, statements.
    Other,
}

/// Cuts the tokens of a text without syntax errors into lines.
pub(super) fn split(scanned: &Scanned<'_>, outline: &Outline) -> Vec<Line> {
    let mut splitter = Splitter { scanned, outline, lines: Vec::new(), frames: Vec::new(), open: None, waiting: 0 };
    for at in 0..scanned.tokens.len() {
        if scanned.kind(at).is_trivia() {
            splitter.trivia(at);
        } else {
            splitter.token(at);
        }
    }
    splitter.close(scanned.tokens.len());
    splitter.settle(0);
    splitter.lines
}

/// The line that is being read.
#[derive(Clone, Copy)]
struct Open {
    /// Its first token, maybe a comment.
    start: usize,
    /// Its first token that is no comment.
    first: Option<usize>,
    level: usize,
    kind: LineKind,
    /// The `:` of a CASE label is still to come, and behind it one simple statement or something else.
    label: Option<bool>,
}

struct Splitter<'a> {
    scanned: &'a Scanned<'a>,
    outline: &'a Outline,
    lines: Vec<Line>,
    frames: Vec<Frame>,
    open: Option<Open>,
    /// The first line whose level is that of the next line of code: comments and pragmas on their own.
    waiting: usize,
}

impl Splitter<'_> {
    /// A comment or pragma: in the open line, behind the last one, before the next one or on its own.
    fn trivia(&mut self, at: usize) {
        if self.open.is_some() {
            return;
        }
        let is_comment = self.scanned.kind(at) == TokenKind::Comment;
        let ends_line = self.scanned.ends_line(at);
        if is_comment
            && ends_line
            && self.scanned.gap(at) == Gap::SameLine
            && let Some(last) = self.lines.last_mut()
        {
            last.tokens.end = at + 1;
            return;
        }
        self.open = Some(Open { start: at, first: None, level: 0, kind: LineKind::Plain, label: None });
        if ends_line || !is_comment {
            self.close(at + 1);
        }
    }

    /// A token of the program.
    fn token(&mut self, at: usize) {
        if self.open.is_none_or(|open| open.first.is_none()) {
            self.begin(at);
        }
        if let Some(Keyword::Struct | Keyword::Union) = self.scanned.keyword(at)
            && let Some(open) = self.open
        {
            self.frames.push(Frame { kind: FrameKind::Other, level: open.level });
        }
        if self.ends_after(at) {
            self.close(at + 1);
        }
    }

    /// Puts the open line away; its tokens end before `end`.
    fn close(&mut self, end: usize) {
        let Some(open) = self.open.take() else { return };
        self.lines.push(Line {
            tokens: open.start..end,
            level: open.level,
            kind: open.kind,
            blank_before: open.start > 0 && self.scanned.gap(open.start) == Gap::Blank,
        });
        if open.first.is_some() {
            self.waiting = self.lines.len();
        }
    }

    /// Gives the comments before the next line of code their level.
    fn settle(&mut self, level: usize) {
        for line in self.lines.get_mut(self.waiting..).unwrap_or(&mut []) {
            line.level = level;
        }
        self.waiting = self.lines.len();
    }

    /// Begins a line of code: finds its level and keeps what it opens.
    fn begin(&mut self, at: usize) {
        let start = self.open.map_or(at, |open| open.start);
        let inner = self.inner();
        let top = self.frames.last().copied();
        let outer = top.map_or(0, |frame| frame.level);
        let mut open = Open { start, first: Some(at), level: inner, kind: LineKind::Plain, label: None };
        let mut comments = None;
        match self.scanned.keyword(at) {
            Some(word) if word.text().starts_with("END_") => {
                self.frames.pop();
                open.level = outer;
                comments = Some(inner);
            }
            Some(Keyword::Else | Keyword::Elsif | Keyword::Until) => {
                open.level = outer;
                comments = Some(inner);
                if let Some(Frame { kind: FrameKind::Case { in_arm }, level }) = self.frames.last_mut() {
                    *in_arm = false;
                    // The ELSE of a CASE is one more arm: comments before it stand where they stand before a label.
                    comments = Some(*level + 1);
                }
            }
            Some(word) if word.starts_section() => {
                if top.is_some_and(|frame| matches!(frame.kind, FrameKind::Pou | FrameKind::Test(_))) {
                    open.level = outer;
                }
                open.kind = LineKind::SectionHead;
                self.push(FrameKind::Other, open.level);
            }
            Some(word) => self.begin_with(word, &mut open, top),
            None => self.begin_with_name(at, &mut open, top),
        }
        // The word that ends a test is a name to the lexer.
        if open.kind == LineKind::TestEnd {
            comments = Some(inner);
        }
        self.settle(comments.unwrap_or(open.level));
        self.open = Some(open);
    }

    /// A line that begins with a reserved word that opens something.
    fn begin_with(&mut self, word: Keyword, open: &mut Open, top: Option<Frame>) {
        let in_configuration =
            top.is_some_and(|frame| matches!(frame.kind, FrameKind::Configuration | FrameKind::Resource));
        let kind = match word {
            Keyword::Program if in_configuration => {
                open.kind = LineKind::ProgramInstance;
                return;
            }
            Keyword::Program | Keyword::Function | Keyword::FunctionBlock => FrameKind::Pou,
            Keyword::Configuration => FrameKind::Configuration,
            Keyword::Case => FrameKind::Case { in_arm: false },
            Keyword::Type | Keyword::If | Keyword::For | Keyword::While | Keyword::Repeat => FrameKind::Other,
            // TRUE and FALSE may begin the label of an arm.
            _ => return self.begin_label(open, top),
        };
        self.push(kind, open.level);
    }

    /// A line that begins with something else: a label, a resource, a task, or anything.
    fn begin_with_name(&mut self, at: usize, open: &mut Open, top: Option<Frame>) {
        match top.map(|frame| frame.kind) {
            Some(FrameKind::Configuration) if self.scanned.is_word(at, "RESOURCE") => {
                open.kind = LineKind::ResourceHead;
                self.push(FrameKind::Resource, open.level);
            }
            Some(FrameKind::Configuration | FrameKind::Resource) if self.scanned.is_word(at, "TASK") => {
                open.kind = LineKind::Task;
            }
            Some(FrameKind::Test(end)) if self.scanned.is_word(at, end) => {
                open.kind = LineKind::TestEnd;
                open.level = top.map_or(0, |frame| frame.level);
                self.frames.pop();
            }
            None => {
                if let Some((_, end)) = TEST_PARTS.iter().find(|(word, _)| self.scanned.is_word(at, word)) {
                    open.kind = LineKind::TestHead;
                    self.push(FrameKind::Test(end), open.level);
                }
            }
            _ => self.begin_label(open, top),
        }
    }

    /// If the label of an arm begins here, says so.
    fn begin_label(&mut self, open: &mut Open, top: Option<Frame>) {
        let start = open.first.and_then(|at| self.scanned.tokens.get(at)).map(|token| token.start);
        let Some(single) = start.and_then(|start| self.outline.arm(start)) else { return };
        if let Some(Frame { kind: FrameKind::Case { .. }, level }) = top {
            open.kind = LineKind::CaseLabel;
            open.level = level + 1;
            open.label = Some(single);
            if let Some(frame) = self.frames.last_mut() {
                frame.kind = FrameKind::Case { in_arm: true };
            }
        }
    }

    fn push(&mut self, kind: FrameKind, level: usize) {
        self.frames.push(Frame { kind, level });
    }

    /// The level of what stands in the innermost open thing.
    fn inner(&self) -> usize {
        self.frames.last().map_or(0, |frame| match frame.kind {
            FrameKind::Case { in_arm: true } => frame.level + 2,
            _ => frame.level + 1,
        })
    }

    /// Whether the open line ends with this token.
    fn ends_after(&mut self, at: usize) -> bool {
        let Some(open) = self.open else { return false };
        let next = self.scanned.next(at);
        let next_kind = next.map_or(TokenKind::End, |next| self.scanned.kind(next));
        match self.scanned.kind(at) {
            TokenKind::Semicolon => true,
            TokenKind::Colon if open.label.is_some() => self.ends_after_label(at, next),
            TokenKind::Keyword(word) => match word {
                Keyword::Then | Keyword::Do | Keyword::Else | Keyword::Repeat | Keyword::Type => true,
                Keyword::Struct | Keyword::Union => true,
                Keyword::Of => open.first.and_then(|first| self.scanned.keyword(first)) == Some(Keyword::Case),
                Keyword::EndStruct | Keyword::EndUnion => {
                    !matches!(next_kind, TokenKind::Semicolon | TokenKind::Assign)
                }
                _ if word.text().starts_with("END_") => next_kind != TokenKind::Semicolon,
                _ => self.ends_before(open, next),
            },
            _ => {
                let setup = self.scanned.is_word(at, "SETUP") || self.scanned.is_word(at, "TEARDOWN");
                if open.kind == LineKind::TestEnd
                    || (open.kind == LineKind::TestHead && setup && open.first == Some(at))
                {
                    return next_kind != TokenKind::Semicolon;
                }
                let end = self.scanned.tokens.get(at).map_or(0, |token| token.end);
                if self.outline.is_head_end(end) {
                    return next_kind != TokenKind::Semicolon;
                }
                self.ends_before(open, next)
            }
        }
    }

    /// A label ends its line, unless the only statement of its arm, a simple one, stands on the same line.
    fn ends_after_label(&mut self, colon: usize, next: Option<usize>) -> bool {
        let single = self.open.as_mut().and_then(|open| open.label.take()).unwrap_or(false);
        let Some(next) = next.filter(|_| single) else { return true };
        let between = (colon + 1..=next).all(|at| self.scanned.gap(at) == Gap::SameLine);
        !between || (colon + 1..next).any(|at| self.scanned.slice(at).contains('\n'))
    }

    /// Whether the line ends because of what comes next.
    fn ends_before(&self, open: Open, next: Option<usize>) -> bool {
        let Some(next) = next else { return true };
        if open.kind == LineKind::SectionHead {
            return !self.is_qualifier(next);
        }
        self.scanned.keyword(next).is_some_and(|word| {
            word.starts_statement()
                || word.starts_section()
                || word.starts_declaration()
                || matches!(word, Keyword::Else | Keyword::Elsif | Keyword::Until)
                || word.text().starts_with("END_")
        })
    }

    /// Whether the token belongs to the head of a variable section. A variable may have a qualifier's name.
    fn is_qualifier(&self, at: usize) -> bool {
        if self.scanned.keyword(at) == Some(Keyword::Constant) {
            return true;
        }
        let following = self.scanned.next(at).map(|next| self.scanned.kind(next));
        ["RETAIN", "NON_RETAIN", "PERSISTENT"].iter().any(|word| self.scanned.is_word(at, word))
            && !matches!(following, Some(TokenKind::Colon | TokenKind::Comma))
    }
}
