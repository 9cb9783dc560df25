//! From tokens to tree: a recursive-descent parser that never fails.
//!
//! Each function reads one production, which its doc comment gives; the files are cut by concept. What is wrong is
//! reported and the parser goes on with the best guess, so that one run shows all mistakes. Three habits keep one mistake
//! from being reported many times:
//! - at one token at most one message is reported ([`Parser::report`]);
//! - what is missing is assumed to be there (a `;`, `THEN`, `END_IF` …) if what follows makes sense;
//! - else tokens are skipped to a place where a new statement or declaration is likely to begin.
//!
//! Time is linear in the text: each token is looked at a bounded number of times. Depth is bounded by [`MAX_NESTING`] and
//! [`MAX_EXPRESSION_HEIGHT`], so that neither this parser nor a recursive pass over the tree can run out of stack.

mod config;
mod expr;
mod hints;
mod init;
mod literal;
mod pou;
mod pragma;
mod spelling;
mod stmt;
mod test;
mod types;
mod vars;

use super::ast::{Ast, Expr, ExprId, ExprKind, Ident, Pragma, SourceUnit, TestSuite, VarSection};
use super::keyword::Keyword;
use super::lexer::{Token, TokenKind, lex};
use super::symbol::{Interner, Symbol};
use crate::diagnostics::{Diagnostic, MAX_ERRORS_PER_FILE, Rule, syntax as rules};
use crate::source::{FileId, SourceMap, Span};
use std::collections::BTreeSet;

/// How deep parentheses, statements, types and initial values may nest, all together.
pub const MAX_NESTING: u32 = 256;

/// How many nodes an expression may have on its longest path down: `a + b + c` has 3. A pass that recurses into
/// expressions needs stack for this many levels on top of [`MAX_NESTING`] statements.
pub const MAX_EXPRESSION_HEIGHT: u16 = 512;

/// How many tokens a file may have, comments not counted.
pub const MAX_TOKENS: usize = 8_000_000;

/// Parses all files of a map, in order. Never fails: it returns a tree, with holes where the source was wrong, and what
/// there is to say about it, in order of place (see [`crate::diagnostics::tidy`]).
pub fn parse(sources: &SourceMap) -> (Ast, Vec<Diagnostic>) {
    let mut ast = Ast::default();
    let mut diagnostics = Vec::new();
    let mut heights = Vec::new();
    for (file, source) in sources.files() {
        let mut parser = Parser::new(file, source.text(), &mut ast.names, &mut heights, &mut diagnostics);
        let mut unit = parser.source_unit();
        unit.global_list = source.global_list().map(|name| {
            let spelling = ast.names.intern(name);
            Ident { symbol: ast.names.fold(spelling), spelling, span: Span::new(file, 0, 0) }
        });
        ast.files.push(unit);
    }
    ast.expr_count = u32::try_from(heights.len()).unwrap_or(u32::MAX);
    (ast, crate::diagnostics::tidy(diagnostics))
}

/// How many statements of each kind are open around the current place: says whether an `END_…` closes something.
#[derive(Default)]
struct OpenBlocks {
    ifs: u32,
    cases: u32,
    fors: u32,
    whiles: u32,
    repeats: u32,
    /// Whether an `ELSE IF` stood somewhere before: two statements, each with an end of its own.
    else_ifs: bool,
}

/// The state of parsing one file.
struct Parser<'a> {
    file: FileId,
    text: &'a str,
    /// The tokens that the grammar sees; the last one is [`TokenKind::End`].
    tokens: Vec<Token>,
    /// The current token.
    pos: usize,
    /// Pragmas, each with the index of the token that follows it.
    pragmas: Vec<(usize, Token)>,
    /// The first pragma that nothing has taken yet.
    next_pragma: usize,
    /// Pragmas that are attached to nothing.
    loose_pragmas: Vec<Pragma>,
    names: &'a mut Interner,
    /// The height of each expression by its id; its length is the next id.
    heights: &'a mut Vec<u16>,
    diagnostics: &'a mut Vec<Diagnostic>,
    /// How many messages of this file have been kept.
    reported: usize,
    /// The token at which the last message was reported.
    reported_at: Option<usize>,
    too_deep_reported: bool,
    /// Names refused for their letters, so that each is refused once.
    bad_names: BTreeSet<Symbol>,
    nesting: u32,
    open: OpenBlocks,
    /// Whether declarations were skipped, so that names may be unknown that the text does declare.
    names_lost: bool,
    /// Variable sections found among the statements of the current POU.
    late_sections: Vec<VarSection>,
    /// Whether the current statements are a test's.
    in_test: bool,
    /// The tests of the file so far.
    suite: TestSuite,
}

impl<'a> Parser<'a> {
    fn new(
        file: FileId,
        text: &'a str,
        names: &'a mut Interner,
        heights: &'a mut Vec<u16>,
        diagnostics: &'a mut Vec<Diagnostic>,
    ) -> Self {
        let mut parser = Self {
            file,
            text,
            tokens: Vec::new(),
            pos: 0,
            pragmas: Vec::new(),
            next_pragma: 0,
            loose_pragmas: Vec::new(),
            names,
            heights,
            diagnostics,
            reported: 0,
            reported_at: None,
            too_deep_reported: false,
            bad_names: BTreeSet::new(),
            nesting: 0,
            open: OpenBlocks::default(),
            names_lost: false,
            late_sections: Vec::new(),
            in_test: false,
            suite: TestSuite::default(),
        };
        parser.take_tokens();
        parser
    }

    /// Lexes the text, reports what the lexer could not make sense of, and sets comments and pragmas aside.
    fn take_tokens(&mut self) {
        for token in lex(self.text) {
            let span = Span::new(self.file, token.start, token.end);
            match token.kind {
                TokenKind::Comment => continue,
                TokenKind::UnterminatedComment => {
                    let open = Span::new(self.file, token.start, token.start + 2);
                    let close = if self.slice(open) == "(*" { "*)" } else { "*/" };
                    self.push(
                        Diagnostic::new(&rules::UNTERMINATED_COMMENT, open, "this comment has no end")
                            .help(format!("comments nest: each opening in it needs a `{close}` of its own")),
                    );
                    continue;
                }
                TokenKind::Pragma => {
                    self.pragmas.push((self.tokens.len(), token));
                    continue;
                }
                TokenKind::UnterminatedPragma => {
                    self.push(Diagnostic::new(&rules::UNTERMINATED_PRAGMA, span, "this pragma has no `}`"));
                    continue;
                }
                TokenKind::UnterminatedString => {
                    self.push(
                        Diagnostic::new(&rules::UNTERMINATED_STRING, span, "this string does not end on its line")
                            .help("a line break in a string is written `$N`, a quote `$'`"),
                    );
                }
                TokenKind::Unknown => {
                    let text = self.slice(span);
                    let line = self.text.get(..span.start as usize).map(|before| before.rsplit('\n').next());
                    // A second one of the line is the end of what the first one began.
                    if !line.flatten().is_some_and(|line| line.contains(text)) {
                        self.push(unknown_characters(span, text));
                    }
                    // White space of other kinds comes with pasted text; leaving it out is the best guess.
                    if self.slice(span).chars().all(|found| found.is_whitespace() || found == '\u{FEFF}') {
                        continue;
                    }
                }
                _ => {}
            }
            if self.tokens.len() >= MAX_TOKENS {
                let message = format!("the file has more than {MAX_TOKENS} tokens; the rest is not read");
                self.push(Diagnostic::new(&rules::NOT_SOURCE_TEXT, span, message));
                break;
            }
            self.tokens.push(token);
        }
        let end = u32::try_from(self.text.len()).unwrap_or(u32::MAX);
        self.tokens.push(Token { kind: TokenKind::End, start: end, end });
    }

    // ----- Looking at tokens and moving on -----

    /// The token `ahead` places from here.
    fn token_at(&self, ahead: usize) -> Token {
        let last = self.tokens.len().saturating_sub(1);
        let at = self.pos.saturating_add(ahead).min(last);
        self.tokens.get(at).copied().unwrap_or(Token { kind: TokenKind::End, start: 0, end: 0 })
    }

    fn kind(&self) -> TokenKind {
        self.token_at(0).kind
    }

    fn kind_at(&self, ahead: usize) -> TokenKind {
        self.token_at(ahead).kind
    }

    /// The current token, if it is a reserved word.
    fn keyword(&self) -> Option<Keyword> {
        match self.kind() {
            TokenKind::Keyword(word) => Some(word),
            _ => None,
        }
    }

    /// Where the current token stands.
    fn span(&self) -> Span {
        let token = self.token_at(0);
        Span::new(self.file, token.start, token.end)
    }

    /// Where the token before the current one stands.
    fn prev_span(&self) -> Span {
        match self.pos.checked_sub(1).and_then(|at| self.tokens.get(at)) {
            Some(token) => Span::new(self.file, token.start, token.end),
            None => Span::new(self.file, 0, 0),
        }
    }

    /// From `start` to the token before the current one.
    fn span_from(&self, start: Span) -> Span {
        start.to(self.prev_span())
    }

    fn slice(&self, span: Span) -> &'a str {
        self.text.get(span.start as usize..span.end as usize).unwrap_or("")
    }

    fn at(&self, kind: TokenKind) -> bool {
        self.kind() == kind
    }

    fn at_keyword(&self, word: Keyword) -> bool {
        self.kind() == TokenKind::Keyword(word)
    }

    /// Whether the current token is a name that reads `word` (in upper case): for words that are reserved in one place only.
    fn at_word(&self, word: &str) -> bool {
        self.at(TokenKind::Ident) && self.slice(self.span()).eq_ignore_ascii_case(word)
    }

    fn at_end(&self) -> bool {
        self.at(TokenKind::End)
    }

    /// Moves on by one token, which is given back. At the end it stays.
    fn bump(&mut self) -> Span {
        let span = self.span();
        if self.pos + 1 < self.tokens.len() {
            self.pos += 1;
        }
        span
    }

    fn eat(&mut self, kind: TokenKind) -> Option<Span> {
        self.at(kind).then(|| self.bump())
    }

    fn eat_keyword(&mut self, word: Keyword) -> Option<Span> {
        self.at_keyword(word).then(|| self.bump())
    }

    fn eat_word(&mut self, word: &str) -> Option<Span> {
        self.at_word(word).then(|| self.bump())
    }

    /// Whether the current token is the first of its line (the token before it ended on an earlier one).
    fn on_new_line(&self) -> bool {
        let between = self.text.get(self.prev_span().end as usize..self.span().start as usize);
        between.is_none_or(|text| text.contains('\n'))
    }

    // ----- Reporting -----

    /// Keeps a diagnostic. A file full of mistakes does not fill the memory: what [`crate::diagnostics::tidy`] would cut
    /// off anyway is let go.
    fn push(&mut self, diagnostic: Diagnostic) {
        if self.reported < MAX_ERRORS_PER_FILE * 10 {
            self.reported += 1;
            self.diagnostics.push(diagnostic);
        }
    }

    /// Reports a syntax error at the current token, unless one has been reported there already: also one of the lexer,
    /// about the token itself or about a string without end before it, which has swallowed what should stand here.
    fn report(&mut self, diagnostic: Diagnostic) {
        let before = self.pos.checked_sub(1).and_then(|at| self.tokens.get(at)).map(|token| token.kind);
        let known = self.at(TokenKind::Unknown) || before == Some(TokenKind::UnterminatedString);
        if self.reported_at != Some(self.pos) && !known {
            self.push(diagnostic);
        }
        self.reported_at = Some(self.pos);
    }

    /// Reports that `what` should stand at the current token.
    fn report_expected(&mut self, what: &str) {
        let message = format!("expected {what}, found {}", self.found());
        let help = self.foreign_hint().map_or_else(|| format!("write {what} there"), str::to_owned);
        self.report(Diagnostic::new(&rules::EXPECTED, self.span(), message).help(help));
    }

    /// Reports that `what` should stand behind the token before the current one.
    fn report_missing(&mut self, what: &str, after: &str) {
        let message = format!("expected {what} after {after}, found {}", self.found());
        let help = self.foreign_hint().map_or_else(|| format!("write {what} there"), str::to_owned);
        self.report(Diagnostic::new(&rules::EXPECTED, self.prev_span().after(), message).help(help));
    }

    /// The current token as messages name it.
    fn found(&self) -> String {
        let text = self.slice(self.span());
        match self.kind() {
            TokenKind::End => "the end of the file".to_owned(),
            TokenKind::UnterminatedString => "a string".to_owned(),
            _ if text.chars().nth(40).is_some() => self.kind().describe().to_owned(),
            _ => format!("`{text}`"),
        }
    }

    /// Reports a rule about a span other than the current token: always kept.
    fn report_at(&mut self, rule: &'static Rule, span: Span, message: impl Into<String>) {
        self.push(Diagnostic::new(rule, span, message));
    }

    // ----- What is wanted -----

    /// Reads `kind` or reports that it is missing `after` something. Says whether it was there.
    fn expect(&mut self, kind: TokenKind, after: &str) -> bool {
        if self.eat(kind).is_some() {
            return true;
        }
        self.report_missing(kind.describe(), after);
        false
    }

    /// Reads a reserved word or reports that it is missing. A misspelt one counts as read.
    fn expect_keyword(&mut self, word: Keyword, after: &str) -> bool {
        if self.eat_keyword(word).is_some() {
            return true;
        }
        if self.at(TokenKind::Ident) && (spelling::is_like(self.slice(self.span()), word.text()) || self.prolongs(word))
        {
            self.report_misspelt(word);
            self.bump();
            return true;
        }
        self.report_missing(&format!("`{}`", word.text()), after);
        false
    }

    /// `DOO`: a letter more than the word, and nothing that could go on from there.
    fn prolongs(&self, word: Keyword) -> bool {
        let text = self.slice(self.span()).to_ascii_uppercase();
        let goes_on = matches!(self.kind_at(1), TokenKind::Ident | TokenKind::Keyword(_));
        goes_on && !self.on_new_line() && text.len() == word.text().len() + 1 && text.starts_with(word.text())
    }

    /// Reads a name, or reports that `what` is missing and makes one up.
    fn name(&mut self, what: &str) -> Ident {
        if self.at(TokenKind::Ident) {
            return self.take_name();
        }
        if let Some(word) = self.keyword()
            && matches!(self.kind_at(1), TokenKind::Colon | TokenKind::Comma | TokenKind::Assign)
        {
            let message = format!("`{}` is a reserved word and cannot be a name", word.text());
            let help = "give it another name, `_` and a letter more for example";
            self.report(Diagnostic::new(&rules::RESERVED_WORD, self.span(), message).help(help));
            return self.take_name();
        }
        self.report_expected(what);
        Ident { symbol: Symbol::MISSING, spelling: Symbol::MISSING, span: self.span().before() }
    }

    /// The name of something that is declared here.
    fn declared_name(&mut self, what: &str) -> Ident {
        let name = self.name(what);
        self.names_lost |= name.is_missing();
        name
    }

    /// The current token as a name.
    fn take_name(&mut self) -> Ident {
        let span = self.bump();
        let text = self.slice(span);
        let spelling = self.names.intern(text);
        let symbol = self.names.fold(spelling);
        if !text.is_ascii() && self.bad_names.insert(symbol) {
            let message = format!("the name `{text}` has letters other than A to Z");
            self.push(
                Diagnostic::new(&rules::BAD_NAME, span, message)
                    .help("names are made of A to Z, a to z, 0 to 9 and `_` (IEC 61131-3 6.1.2)"),
            );
        }
        Ident { symbol, spelling, span }
    }

    // ----- Depth -----

    /// Reads something that may contain itself. At the limit of depth it reports and gives `instead`.
    fn nested<T>(&mut self, read: impl FnOnce(&mut Self) -> T, instead: impl FnOnce(&mut Self) -> T) -> T {
        if self.nesting >= MAX_NESTING {
            self.report_too_deep(format!("this is nested more than {MAX_NESTING} levels deep"));
            return instead(self);
        }
        self.nesting += 1;
        let result = read(self);
        self.nesting -= 1;
        result
    }

    /// Reports a limit of depth, once a file.
    fn report_too_deep(&mut self, message: String) {
        if self.too_deep_reported {
            self.reported_at = Some(self.pos);
            return;
        }
        self.too_deep_reported = true;
        self.report(Diagnostic::new(&rules::TOO_DEEP, self.span(), message).help("cut it into smaller parts"));
    }

    /// Makes an expression whose highest child has the height `below`. One that grows too high becomes a hole.
    fn expr_node(&mut self, below: u16, span: Span, kind: ExprKind) -> Expr {
        let id = ExprId(u32::try_from(self.heights.len()).unwrap_or(u32::MAX));
        if below >= MAX_EXPRESSION_HEIGHT {
            self.report_too_deep(format!("this expression has more than {MAX_EXPRESSION_HEIGHT} operations in a row"));
            self.heights.push(1);
            return Expr { id, kind: ExprKind::Error, span };
        }
        self.heights.push(below + 1);
        Expr { id, kind, span }
    }

    /// The height of an expression of this parser.
    fn height(&self, expr: &Expr) -> u16 {
        self.heights.get(expr.id.index()).copied().unwrap_or(MAX_EXPRESSION_HEIGHT)
    }

    /// A hole where an expression should be.
    fn error_expr(&mut self) -> Expr {
        let span = self.span().before();
        self.expr_node(0, span, ExprKind::Error)
    }

    /// `file = { declaration }`.
    fn source_unit(&mut self) -> SourceUnit {
        let declarations = self.declarations();
        self.finish_pragmas();
        let tests = std::mem::take(&mut self.suite);
        SourceUnit {
            file: self.file,
            global_list: None,
            declarations,
            names_lost: self.names_lost,
            tests,
            pragmas: std::mem::take(&mut self.loose_pragmas),
        }
    }
}

/// The message about characters that belong nowhere.
fn unknown_characters(span: Span, text: &str) -> Diagnostic {
    let shown: String = text.chars().take(10).flat_map(char::escape_debug).collect();
    let found = Diagnostic::new(&rules::UNKNOWN_CHARACTER, span, format!("`{shown}` has no meaning here"));
    match text.chars().next() {
        Some('\u{2018}' | '\u{2019}' | '\u{201C}' | '\u{201D}') => {
            found.help("these are typographic quotes; strings stand in `'` or `\"`")
        }
        Some('\u{2013}' | '\u{2014}' | '\u{2212}') => found.help("this is a typographic dash; minus is `-`"),
        Some(first) if first.is_whitespace() => found.help("replace it by an ordinary space"),
        Some('|') => found.help("or is written `OR`"),
        Some('`') => found.help("strings stand in `'`"),
        Some('?') => found.help("choose with `SEL(condition, if_false, if_true)`"),
        Some('~') => found.help("the complement is `NOT a`"),
        _ => found,
    }
}
