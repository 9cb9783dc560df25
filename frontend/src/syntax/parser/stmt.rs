//! Statements (IEC 61131-3 7.3.3, table 72).

use super::Parser;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{Block, CaseArm, CaseLabel, ExprKind, IfBranch, Stmt, StmtKind};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// How many tokens are looked through for a `THEN`, `DO`, `OF` that something strange stands before.
const REACH: usize = 8;

impl Parser<'_> {
    /// `block = { statement }`, up to what no statement begins with and something around it may want.
    pub(super) fn block(&mut self) -> Block {
        let start = self.span().before();
        let mut statements = Vec::new();
        while !self.block_ends() {
            let before = self.pos;
            if self.stray_word() || self.misplaced_section() || self.unsupported_element() || self.mend_statement() {
                continue;
            }
            statements.push(self.statement());
            if self.pos == before {
                self.bump();
            }
        }
        let span = match (statements.first(), statements.last()) {
            (Some(first), Some(last)) => first.span.to(last.span),
            _ => start,
        };
        Block { statements, span }
    }

    /// Whether the current token ends a list of statements: the end of an open statement, a POU or the file.
    fn block_ends(&self) -> bool {
        match self.kind() {
            TokenKind::End => true,
            TokenKind::Keyword(word) => {
                self.closes_open_block(word)
                    || word.ends_pou()
                    || (word.starts_declaration() && !self.on_same_line_as_statement())
                    || matches!(word, Keyword::VarGlobal)
            }
            _ => self.at_test_end() || (self.open.cases > 0 && self.at_case_label()),
        }
    }

    /// A declaration's word in the middle of a line is noise rather than the next declaration.
    fn on_same_line_as_statement(&self) -> bool {
        !self.on_new_line() && !self.prev_is(TokenKind::Semicolon)
    }

    fn prev_is(&self, kind: TokenKind) -> bool {
        self.pos.checked_sub(1).and_then(|at| self.tokens.get(at)).is_some_and(|token| token.kind == kind)
    }

    /// Whether a statement that is open around here ends or goes on with the word.
    fn closes_open_block(&self, word: Keyword) -> bool {
        match word {
            Keyword::EndIf | Keyword::Elsif => self.open.ifs > 0,
            Keyword::Else => self.open.ifs > 0 || self.open.cases > 0,
            Keyword::EndCase => self.open.cases > 0,
            Keyword::EndFor => self.open.fors > 0,
            Keyword::EndWhile => self.open.whiles > 0,
            Keyword::EndRepeat | Keyword::Until => self.open.repeats > 0,
            _ => false,
        }
    }

    /// An `END_…`, `ELSE`, `UNTIL` that nothing here can be closed with: reports it and moves on.
    fn stray_word(&mut self) -> bool {
        let Some(word) = self.keyword() else { return false };
        let stray = matches!(word, Keyword::Else | Keyword::Elsif | Keyword::Until)
            || (word.text().starts_with("END_") && !word.ends_pou());
        if !stray {
            return false;
        }
        let message = format!("`{}` closes nothing here", word.text());
        self.report(Diagnostic::new(&rules::STRAY_END, self.span(), message));
        self.bump();
        if matches!(word, Keyword::Elsif | Keyword::Until) {
            self.condition();
            self.eat_keyword(Keyword::Then);
        }
        self.eat(TokenKind::Semicolon);
        true
    }

    /// A variable section among the statements: reported, and kept for its POU.
    fn misplaced_section(&mut self) -> bool {
        let Some(word) = self.keyword().filter(|word| word.starts_section()) else { return false };
        let message = format!("`{}` must stand before the first statement", word.text());
        let found = Diagnostic::new(&rules::MISPLACED_SECTION, self.span(), message);
        self.report(found.help("move it up, in front of the statements"));
        let attributes = self.attributes();
        match super::vars::section_kind(word) {
            Some(kind) => {
                let section = self.var_section(word, kind, attributes);
                self.late_sections.push(section);
            }
            None => self.drop_misplaced_section(attributes),
        }
        true
    }

    /// A name that cannot begin a statement and is near to a word that can.
    fn mend_statement(&mut self) -> bool {
        let starts_statement = matches!(
            self.kind_at(1),
            TokenKind::Assign
                | TokenKind::LeftParen
                | TokenKind::Dot
                | TokenKind::LeftBracket
                | TokenKind::Caret
                | TokenKind::Equal
                | TokenKind::Foreign
                | TokenKind::Hash
        );
        !starts_statement && self.mend_leading_word()
    }

    /// ```text
    /// statement = ';' | assignment ';' | call ';' | if | case | for | while | repeat | ( 'EXIT' | 'CONTINUE' | 'RETURN' ) ';'
    /// ```
    fn statement(&mut self) -> Stmt {
        self.nested(Self::statement_unlimited, |parser| {
            let span = parser.span();
            parser.bump();
            parser.skip_statement();
            Stmt { kind: StmtKind::Error, span }
        })
    }

    fn statement_unlimited(&mut self) -> Stmt {
        let start = self.span();
        let kind = match self.kind() {
            TokenKind::Semicolon => {
                self.bump();
                return Stmt { kind: StmtKind::Empty, span: start };
            }
            TokenKind::Keyword(Keyword::If) => self.if_statement(),
            TokenKind::Keyword(Keyword::Case) => self.case_statement(),
            TokenKind::Keyword(Keyword::For) => self.for_statement(),
            TokenKind::Keyword(Keyword::While) => self.while_statement(),
            TokenKind::Keyword(Keyword::Repeat) => self.repeat_statement(),
            TokenKind::Keyword(Keyword::Exit) => self.jump(StmtKind::Exit),
            TokenKind::Keyword(Keyword::Continue) => self.jump(StmtKind::Continue),
            TokenKind::Keyword(Keyword::Return) => self.jump(StmtKind::Return),
            TokenKind::Ident if self.at_mock() => self.mock_statement(),
            TokenKind::Ident | TokenKind::Direct | TokenKind::MalformedDirect => self.simple_statement(),
            _ => {
                let message = format!("expected a statement, found {}", self.found());
                let hint = self.foreign_hint().unwrap_or("a statement begins with a name or a word like `IF`");
                self.report(Diagnostic::new(&rules::EXPECTED, self.span(), message).help(hint));
                self.bump();
                self.skip_statement();
                return Stmt { kind: StmtKind::Error, span: self.span_from(start) };
            }
        };
        let span = self.span_from(start);
        if self.end_statement(&kind) {
            return Stmt { kind, span };
        }
        // Something stands behind it that is no part of it: what was meant is not known.
        Stmt { kind: StmtKind::Error, span }
    }

    fn jump(&mut self, kind: StmtKind) -> StmtKind {
        self.bump();
        let gives = matches!(kind, StmtKind::Return) && !self.at(TokenKind::Semicolon) && !self.on_new_line();
        if gives && (self.at(TokenKind::Ident) || super::expr::literal_start(self.kind())) {
            let message = format!("expected `;` after `RETURN`, found {}", self.found());
            let found = Diagnostic::new(&rules::EXPECTED, self.span(), message);
            self.report(found.help("a function gives what is assigned to its name: `name := value; RETURN;`"));
        }
        kind
    }

    /// The `;` of a statement. After an `END_…` it may be left out, as vendors allow. FALSE: something else stood before it.
    fn end_statement(&mut self, kind: &StmtKind) -> bool {
        if self.eat(TokenKind::Semicolon).is_some() {
            return true;
        }
        let compound = matches!(
            kind,
            StmtKind::If { .. }
                | StmtKind::Case { .. }
                | StmtKind::For { .. }
                | StmtKind::While { .. }
                | StmtKind::Repeat { .. }
        );
        if compound {
            return true;
        }
        if !matches!(kind, StmtKind::Error) && self.reported_at != Some(self.pos) {
            self.report_missing("`;`", "this statement");
        }
        let word_follows = self
            .keyword()
            .is_some_and(|word| word.starts_statement() || self.closes_open_block(word) || word.ends_pou());
        let next_follows = word_follows || (self.on_new_line() && self.at(TokenKind::Ident));
        if !next_follows {
            self.skip_statement();
        }
        next_follows
    }

    /// Skips to behind the next `;` or to a word that begins or ends a statement, section or declaration. May not move
    /// at all.
    fn skip_statement(&mut self) {
        loop {
            match self.kind() {
                TokenKind::Semicolon => {
                    self.bump();
                    return;
                }
                TokenKind::End => return,
                TokenKind::Ident if self.at_test_end() => return,
                TokenKind::Keyword(word)
                    if word.starts_statement()
                        || word.starts_section()
                        || word.starts_declaration()
                        || matches!(word, Keyword::Else | Keyword::Elsif | Keyword::Until)
                        || word.text().starts_with("END_") =>
                {
                    return;
                }
                _ => {
                    self.bump();
                }
            }
        }
    }

    /// ```text
    /// assignment = variable ':=' expression
    /// call       = name '(' arguments ')'
    /// ```
    fn simple_statement(&mut self) -> StmtKind {
        let target = self.postfix();
        let op_span = self.span();
        match self.kind() {
            TokenKind::Assign => {
                self.bump();
            }
            TokenKind::Equal | TokenKind::Foreign
                if self.slice(op_span).starts_with('=') && self.kind_at(1) != TokenKind::Colon =>
            {
                let message = format!("`{}` compares; it does not assign", self.slice(op_span));
                self.report(Diagnostic::new(&rules::EQUALS_FOR_ASSIGN, op_span, message).help("assign with `:=`"));
                self.bump();
            }
            TokenKind::Colon if self.kind_at(1) == TokenKind::Equal => {
                let message = "`:=` is written without a space";
                self.report(Diagnostic::new(&rules::EQUALS_FOR_ASSIGN, op_span, message).help("write `:=`"));
                self.bump();
                self.bump();
            }
            TokenKind::Equal if self.kind_at(1) == TokenKind::Colon => {
                let message = "`:=` is written the other way round";
                self.report(Diagnostic::new(&rules::EQUALS_FOR_ASSIGN, op_span, message).help("write `:=`"));
                self.bump();
                self.bump();
            }
            TokenKind::Ident if self.at_word("REF") && self.kind_at(1) == TokenKind::Equal => {
                self.report_unsupported("`REF=`");
                self.skip_statement();
                return StmtKind::Error;
            }
            _ if !matches!(target.kind, ExprKind::Error) && self.loose_expression(target.span) => {
                return StmtKind::Error;
            }
            _ => return self.call_statement(target),
        }
        let value = self.expression();
        if self.at(TokenKind::Assign) {
            self.report_unsupported("more than one `:=` in a statement");
            self.skip_statement();
        }
        StmtKind::Assign { target, op_span, value }
    }

    /// An expression that stands alone: a call, or a mistake.
    fn call_statement(&mut self, expr: crate::syntax::ast::Expr) -> StmtKind {
        match &expr.kind {
            ExprKind::Call { .. } => return StmtKind::Call(expr),
            ExprKind::Error => {}
            _ if self.at(TokenKind::Semicolon) || self.on_new_line() => {
                let message = "this has a value and does nothing with it";
                if self.reported_at != Some(self.pos) {
                    let help = self.word_hint(self.slice(expr.span));
                    self.push(
                        Diagnostic::new(&rules::NO_STATEMENT, expr.span, message)
                            .help(help.unwrap_or("assign to it with `:=`, or call it with `(…)`")),
                    );
                }
                self.reported_at = Some(self.pos);
            }
            _ => self.report_missing("`:=` or `(`", "the beginning of this statement"),
        }
        StmtKind::Error
    }

    /// The word between a statement's head and its body. Another one of its kind in its place is taken for it.
    fn expect_header(&mut self, word: Keyword, after: &str) {
        if self.eat_keyword(word).is_some() {
            return;
        }
        if self.at(TokenKind::Ident) {
            self.expect_keyword(word, after);
        } else {
            self.report_missing(&format!("`{}`", word.text()), after);
        }
        for ahead in 0..REACH {
            let confused = match self.kind_at(ahead) {
                TokenKind::Keyword(found) if found == word => true,
                TokenKind::Keyword(Keyword::Then | Keyword::Do | Keyword::Of) => ahead == 0,
                TokenKind::Semicolon | TokenKind::Keyword(_) | TokenKind::End | TokenKind::Assign => return,
                _ => continue,
            };
            if confused {
                (0..=ahead).for_each(|_| {
                    self.bump();
                });
            }
            return;
        }
    }

    /// The `END_…` of a statement, whose span is given back. One that is missing is reported.
    fn block_end(&mut self, end: Keyword, opener: &str, open: Span) -> Span {
        if let Some(span) = self.eat_keyword(end) {
            return span;
        }
        self.missing_end(end, opener, open);
        self.prev_span().after()
    }

    /// ```text
    /// if = 'IF' expression 'THEN' block { 'ELSIF' expression 'THEN' block } [ 'ELSE' block ] 'END_IF'
    /// ```
    fn if_statement(&mut self) -> StmtKind {
        let open = self.span();
        self.open.ifs += 1;
        let mut branches = Vec::new();
        let mut otherwise: Option<Block> = None;
        loop {
            match self.keyword() {
                Some(Keyword::If | Keyword::Elsif) if otherwise.is_none() => {
                    self.bump();
                    let condition = self.condition();
                    self.expect_header(Keyword::Then, "the condition");
                    branches.push(IfBranch { condition, body: self.block() });
                }
                Some(Keyword::Else) if otherwise.is_none() => {
                    self.bump();
                    self.open.else_ifs |= self.at_keyword(Keyword::If) && !self.on_new_line();
                    otherwise = Some(self.block());
                }
                // A second ELSE belongs to an outer IF, if there is one, and this IF has lost its end.
                Some(word @ (Keyword::Else | Keyword::Elsif)) if self.open.ifs == 1 && self.open.cases == 0 => {
                    let message = format!("`{}` after `ELSE`", word.text());
                    self.report(Diagnostic::new(&rules::STRAY_END, self.span(), message).help("ELSE must be last"));
                    self.bump();
                    if word == Keyword::Elsif {
                        self.condition();
                        self.expect_header(Keyword::Then, "the condition");
                    }
                    self.block();
                }
                _ => break,
            }
        }
        self.open.ifs -= 1;
        self.block_end(Keyword::EndIf, "IF", open);
        StmtKind::If { branches, otherwise }
    }

    /// `case = 'CASE' expression 'OF' { arm } [ 'ELSE' block ] 'END_CASE'`.
    fn case_statement(&mut self) -> StmtKind {
        let open = self.bump();
        let selector = self.condition();
        self.expect_header(Keyword::Of, "the selector");
        self.open.cases += 1;
        let mut arms = Vec::new();
        let mut otherwise = None;
        loop {
            let before = self.pos;
            if self.at_case_label() {
                arms.push(self.case_arm());
            } else if self.at_keyword(Keyword::Else) && otherwise.is_none() {
                self.bump();
                otherwise = Some(self.block());
            } else if self.block_ends() {
                break;
            } else {
                if self.at_keyword(Keyword::Case) {
                    let message = "each arm of a CASE begins with its labels, without a word";
                    let found = Diagnostic::new(&rules::EXPECTED, self.span(), message);
                    self.report(found.help("leave `CASE` out: `1: …`"));
                    self.bump();
                    continue;
                }
                if !self.mend_leading_word() {
                    self.report_expected("the label of a CASE arm");
                }
                self.block();
            }
            // At the limit of nesting a label may have moved nothing.
            if self.pos == before {
                self.bump();
            }
        }
        self.open.cases -= 1;
        self.block_end(Keyword::EndCase, "CASE", open);
        StmtKind::Case { selector, arms, otherwise }
    }

    /// Whether the label of an arm begins here: a value, or a name with something behind it that no statement has.
    fn at_case_label(&self) -> bool {
        match self.kind() {
            TokenKind::Minus | TokenKind::Plus => true,
            TokenKind::Ident => {
                let mut ahead = 1;
                while self.kind_at(ahead) == TokenKind::Dot && self.kind_at(ahead + 1) == TokenKind::Ident {
                    ahead += 2;
                }
                match self.kind_at(ahead) {
                    // `x : = 1` is a slip for an assignment.
                    TokenKind::Colon => self.kind_at(ahead + 1) != TokenKind::Equal,
                    TokenKind::Comma | TokenKind::DotDot | TokenKind::Hash => true,
                    TokenKind::Plus | TokenKind::Minus | TokenKind::Star | TokenKind::Slash => true,
                    _ => false,
                }
            }
            kind => super::expr::literal_start(kind),
        }
    }

    /// `arm = label { ',' label } ':' block`, with `label = expression | range`.
    fn case_arm(&mut self) -> CaseArm {
        let start = self.span();
        let mut labels = Vec::new();
        loop {
            let value = self.expression();
            labels.push(if self.at(TokenKind::DotDot) {
                CaseLabel::Range(self.range_from(value))
            } else {
                CaseLabel::Value(value)
            });
            if self.eat(TokenKind::Comma).is_none() {
                break;
            }
        }
        if !self.expect(TokenKind::Colon, "the label") && !self.on_new_line() {
            self.skip_statement();
        }
        let body = self.block();
        CaseArm { labels, body, span: self.span_from(start) }
    }

    /// `for = 'FOR' variable ':=' expression 'TO' expression [ 'BY' expression ] 'DO' block 'END_FOR'`.
    fn for_statement(&mut self) -> StmtKind {
        let open = self.bump();
        let variable = Box::new(self.postfix());
        if self.at(TokenKind::Equal) {
            let message = "`=` compares; the first value is given with `:=`";
            self.report(Diagnostic::new(&rules::EQUALS_FOR_ASSIGN, self.span(), message).help("write `:=`"));
            self.bump();
        } else {
            self.expect(TokenKind::Assign, "the control variable");
        }
        let from = Box::new(self.expression());
        self.expect_header(Keyword::To, "the first value");
        let to = Box::new(self.expression());
        let by = self.eat_keyword(Keyword::By).map(|_| Box::new(self.expression()));
        self.expect_header(Keyword::Do, "the head of the loop");
        self.open.fors += 1;
        let body = self.block();
        self.open.fors -= 1;
        let end_span = self.block_end(Keyword::EndFor, "FOR", open);
        StmtKind::For { variable, from, to, by, body, end_span }
    }

    /// `while = 'WHILE' expression 'DO' block 'END_WHILE'`.
    fn while_statement(&mut self) -> StmtKind {
        let open = self.bump();
        let condition = self.condition();
        self.expect_header(Keyword::Do, "the condition");
        self.open.whiles += 1;
        let body = self.block();
        self.open.whiles -= 1;
        let end_span = self.block_end(Keyword::EndWhile, "WHILE", open);
        StmtKind::While { condition, body, end_span }
    }

    /// `repeat = 'REPEAT' block 'UNTIL' expression [ ';' ] 'END_REPEAT'`.
    fn repeat_statement(&mut self) -> StmtKind {
        let open = self.bump();
        self.open.repeats += 1;
        let body = self.block();
        self.open.repeats -= 1;
        let until = if self.expect_keyword(Keyword::Until, "the loop's statements") {
            self.condition()
        } else {
            self.error_expr()
        };
        self.eat(TokenKind::Semicolon);
        let end_span = self.block_end(Keyword::EndRepeat, "REPEAT", open);
        StmtKind::Repeat { body, until, end_span }
    }
}
