//! Expressions (IEC 61131-3 7.3.2, table 71).
//!
//! Operators by rank, loosest first: `OR OR_ELSE`, `XOR`, `AND & AND_THEN`, `= <>`, `< > <= >=`, `+ -`, `* / MOD`, `**`,
//! then the unary `- + NOT`, which bind tighter than any binary operator: `-2 ** 2` is `(-2) ** 2`. Operators of one
//! rank are taken from left to right.

use super::Parser;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{AccessSize, Arg, ArgKind, BinaryOp, Expr, ExprKind, Ident, UnaryOp};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// The loosest rank of a binary operator.
const LOOSEST: u8 = 1;

/// A binary operator and its rank: the higher, the tighter it binds.
fn binary_operator(kind: TokenKind) -> Option<(BinaryOp, u8)> {
    Some(match kind {
        TokenKind::Keyword(Keyword::Or) => (BinaryOp::Or, 1),
        TokenKind::Keyword(Keyword::OrElse) => (BinaryOp::OrElse, 1),
        TokenKind::Keyword(Keyword::Xor) => (BinaryOp::Xor, 2),
        TokenKind::Keyword(Keyword::And) | TokenKind::Ampersand => (BinaryOp::And, 3),
        TokenKind::Keyword(Keyword::AndThen) => (BinaryOp::AndThen, 3),
        TokenKind::Equal => (BinaryOp::Equal, 4),
        TokenKind::NotEqual => (BinaryOp::NotEqual, 4),
        TokenKind::Less => (BinaryOp::Less, 5),
        TokenKind::Greater => (BinaryOp::Greater, 5),
        TokenKind::LessEqual => (BinaryOp::LessEqual, 5),
        TokenKind::GreaterEqual => (BinaryOp::GreaterEqual, 5),
        TokenKind::Plus => (BinaryOp::Add, 6),
        TokenKind::Minus => (BinaryOp::Sub, 6),
        TokenKind::Star => (BinaryOp::Mul, 7),
        TokenKind::Slash => (BinaryOp::Div, 7),
        TokenKind::Keyword(Keyword::Mod) => (BinaryOp::Mod, 7),
        TokenKind::Power => (BinaryOp::Power, 8),
        _ => return None,
    })
}

/// What a binary operator of another language means here, with its rank.
fn foreign_operator(text: &str) -> Option<(BinaryOp, u8)> {
    match text {
        "==" => Some((BinaryOp::Equal, 4)),
        "!=" => Some((BinaryOp::NotEqual, 4)),
        "&&" => Some((BinaryOp::And, 3)),
        "||" => Some((BinaryOp::Or, 1)),
        _ => None,
    }
}

impl Parser<'_> {
    /// `expression = unary { binary-operator unary }`, the operators ranked.
    pub(super) fn expression(&mut self) -> Expr {
        self.nested(|parser| parser.binary(LOOSEST), Self::error_expr)
    }

    /// An expression where `:=` can only be a slip for `=`: a condition.
    pub(super) fn condition(&mut self) -> Expr {
        let lhs = self.expression();
        if !self.at(TokenKind::Assign) {
            return lhs;
        }
        let message = "`:=` assigns; it cannot stand in a condition";
        self.report(Diagnostic::new(&rules::ASSIGN_IN_CONDITION, self.span(), message).help("compare with `=`"));
        let op_span = self.bump();
        let rhs = self.expression();
        self.binary_node(BinaryOp::Equal, op_span, lhs, rhs)
    }

    /// Operators of at least this rank.
    fn binary(&mut self, lowest: u8) -> Expr {
        let mut lhs = self.unary();
        while let Some((op, rank)) = self.operator() {
            if rank < lowest {
                break;
            }
            let op_span = self.bump();
            // One rank up: operators of the same rank are left to this loop, so that they associate to the left.
            let rhs = self.nested(|parser| parser.binary(rank + 1), Self::error_expr);
            lhs = self.binary_node(op, op_span, lhs, rhs);
        }
        lhs
    }

    /// The binary operator at the current token. One of another language is reported and taken for what it means.
    fn operator(&mut self) -> Option<(BinaryOp, u8)> {
        if !self.at(TokenKind::Foreign) {
            return binary_operator(self.kind());
        }
        let text = self.slice(self.span());
        let found = foreign_operator(text)?;
        self.report_foreign(text, found.0.text());
        Some(found)
    }

    fn report_foreign(&mut self, text: &str, meant: &str) {
        let message = format!("`{text}` is no operator of Structured Text");
        self.report(Diagnostic::new(&rules::FOREIGN_OPERATOR, self.span(), message).help(format!("write `{meant}`")));
    }

    fn binary_node(&mut self, op: BinaryOp, op_span: Span, lhs: Expr, rhs: Expr) -> Expr {
        let below = self.height(&lhs).max(self.height(&rhs));
        let span = lhs.span.to(rhs.span);
        self.expr_node(below, span, ExprKind::Binary { op, op_span, lhs: Box::new(lhs), rhs: Box::new(rhs) })
    }

    /// `unary = [ '-' | '+' | 'NOT' ] unary | postfix`.
    fn unary(&mut self) -> Expr {
        let op = match self.kind() {
            TokenKind::Minus => UnaryOp::Neg,
            TokenKind::Plus => UnaryOp::Plus,
            TokenKind::Keyword(Keyword::Not) if !self.at_formal_not() => UnaryOp::Not,
            TokenKind::Foreign if self.slice(self.span()) == "!" => {
                self.report_foreign("!", "NOT");
                UnaryOp::Not
            }
            _ => return self.postfix(),
        };
        let op_span = self.bump();
        let operand = self.nested(Self::unary, Self::error_expr);
        let below = self.height(&operand);
        let span = op_span.to(operand.span);
        self.expr_node(below, span, ExprKind::Unary { op, op_span, operand: Box::new(operand) })
    }

    /// Whether `NOT` is called as the function that it is too, with the names of its parameters: `NOT(IN := x)`. Another name before `:=` is
    /// a comparison gone wrong.
    fn at_formal_not(&self) -> bool {
        self.at_keyword(Keyword::Not)
            && self.kind_at(1) == TokenKind::LeftParen
            && (self.kind_at(2), self.kind_at(3)) == (TokenKind::Ident, TokenKind::Assign)
            && ["IN", "EN"].iter().any(|name| {
                let token = self.token_at(2);
                let text = self.text.get(token.start as usize..token.end as usize);
                text.is_some_and(|text| text.eq_ignore_ascii_case(name))
            })
    }

    /// `postfix = primary { '.' member | '[' expression { ',' expression } ']' | '^' | '(' arguments ')' }`.
    pub(super) fn postfix(&mut self) -> Expr {
        let mut expr = self.primary();
        loop {
            expr = match self.kind() {
                TokenKind::Dot => self.member(expr),
                TokenKind::LeftBracket => self.index(expr),
                TokenKind::Caret if self.at_foreign_power() => {
                    self.report_foreign("^", "**");
                    let op_span = self.bump();
                    let exponent = self.nested(Self::unary, Self::error_expr);
                    return self.binary_node(BinaryOp::Power, op_span, expr, exponent);
                }
                TokenKind::Caret => {
                    let end = self.bump();
                    let (below, span) = (self.height(&expr), expr.span.to(end));
                    self.expr_node(below, span, ExprKind::Deref { base: Box::new(expr) })
                }
                TokenKind::LeftParen if callable(&expr) => self.call(expr),
                _ => return expr,
            };
        }
    }

    /// `member = '.' ( name | integer | '%' size integer )`.
    fn member(&mut self, base: Expr) -> Expr {
        self.bump();
        let below = self.height(&base);
        let part_span = self.span();
        let part = match self.kind() {
            TokenKind::Int => Some((AccessSize::Bit, self.slice(part_span))),
            TokenKind::Part => {
                let text = self.slice(part_span);
                Some((
                    access_size(text.as_bytes().get(1).copied()).unwrap_or(AccessSize::Bit),
                    text.get(2..).unwrap_or(""),
                ))
            }
            _ => None,
        };
        let Some((size, digits)) = part else {
            let member = self.name("the name of a member after `.`");
            let span = base.span.to(member.span);
            return self.expr_node(below, span, ExprKind::Member { base: Box::new(base), member });
        };
        self.bump();
        let index = digits.parse().unwrap_or(u32::MAX);
        let span = base.span.to(part_span);
        self.expr_node(below, span, ExprKind::Part { base: Box::new(base), size, index, part_span })
    }

    /// `index = '[' expression { ',' expression } ']'`.
    fn index(&mut self, base: Expr) -> Expr {
        self.bump();
        let mut indices = Vec::new();
        loop {
            indices.push(self.expression());
            if self.eat(TokenKind::Comma).is_none() {
                break;
            }
        }
        self.close(TokenKind::RightBracket, "the index");
        let below = indices.iter().map(|index| self.height(index)).fold(self.height(&base), u16::max);
        let span = self.span_from(base.span);
        self.expr_node(below, span, ExprKind::Index { base: Box::new(base), indices })
    }

    /// `call = callee '(' [ argument { ',' argument } ] ')'`.
    fn call(&mut self, callee: Expr) -> Expr {
        self.bump();
        let mut args = Vec::new();
        while !self.at(TokenKind::RightParen) {
            args.push(self.argument());
            if self.eat(TokenKind::Comma).is_none() {
                let another =
                    self.at(TokenKind::Ident) && matches!(self.kind_at(1), TokenKind::Assign | TokenKind::Arrow);
                if !another {
                    break;
                }
                self.report_missing("`,`", "this argument");
            }
            if self.at(TokenKind::RightParen) {
                self.report_expected("another argument after `,`");
            }
        }
        self.close(TokenKind::RightParen, "the arguments");
        let mut below = self.height(&callee);
        for arg in &args {
            let value = match &arg.kind {
                ArgKind::Positional(value) => Some(value),
                ArgKind::Input { value, .. } => value.as_ref(),
                ArgKind::Output { target, .. } => target.as_ref(),
            };
            below = below.max(value.map_or(0, |value| self.height(value)));
        }
        let span = self.span_from(callee.span);
        self.expr_node(below, span, ExprKind::Call { callee: Box::new(callee), args })
    }

    /// ```text
    /// argument = expression
    ///          | name ':=' [ expression ]
    ///          | [ 'NOT' ] name '=>' [ variable ]
    /// ```
    fn argument(&mut self) -> Arg {
        let start = self.span();
        let negated =
            self.at_keyword(Keyword::Not) && self.kind_at(1) == TokenKind::Ident && self.kind_at(2) == TokenKind::Arrow;
        if negated {
            self.bump();
        }
        let kind = match (self.kind(), self.kind_at(1)) {
            (TokenKind::Ident, TokenKind::Assign) => {
                let name = self.argument_name();
                ArgKind::Input { name, value: self.argument_value() }
            }
            (TokenKind::Ident, TokenKind::Arrow) => {
                let name = self.argument_name();
                ArgKind::Output { name, negated, target: self.argument_value() }
            }
            _ => ArgKind::Positional(self.expression()),
        };
        Arg { kind, span: self.span_from(start) }
    }

    fn argument_name(&mut self) -> Ident {
        let name = self.take_name();
        self.bump();
        name
    }

    fn argument_value(&mut self) -> Option<Expr> {
        let absent = matches!(self.kind(), TokenKind::Comma | TokenKind::RightParen);
        (!absent).then(|| self.expression())
    }

    /// Reads a closing bracket. Where it is missing, tokens are skipped to it if it comes within the statement's line:
    /// what stands between has been reported.
    pub(super) fn close(&mut self, kind: TokenKind, after: &str) {
        if self.expect(kind, after) {
            return;
        }
        // A few tokens ahead only, so that the search stays cheap whatever the text.
        const REACH: usize = 8;
        for ahead in 0..REACH {
            match self.kind_at(ahead) {
                found if found == kind => {
                    (0..=ahead).for_each(|_| {
                        self.bump();
                    });
                    return;
                }
                TokenKind::Semicolon | TokenKind::Keyword(_) | TokenKind::End | TokenKind::Assign => return,
                TokenKind::LeftParen | TokenKind::LeftBracket => return,
                _ => {}
            }
        }
    }

    /// ```text
    /// primary = literal | name | type-name '#' name | direct-address | '(' expression ')'
    /// ```
    fn primary(&mut self) -> Expr {
        match self.kind() {
            TokenKind::Ident if self.kind_at(1) == TokenKind::Hash => self.typed(),
            TokenKind::Ident => {
                let name = self.take_name();
                self.expr_node(0, name.span, ExprKind::Name(name))
            }
            // `AND(a, b)`: these operators are standard functions too (tables 29 and 31).
            TokenKind::Keyword(Keyword::And | Keyword::Or | Keyword::Xor | Keyword::Mod)
                if self.kind_at(1) == TokenKind::LeftParen =>
            {
                let name = self.take_name();
                self.expr_node(0, name.span, ExprKind::Name(name))
            }
            TokenKind::Keyword(Keyword::Not) if self.at_formal_not() => {
                let name = self.take_name();
                self.expr_node(0, name.span, ExprKind::Name(name))
            }
            TokenKind::LeftParen => self.parenthesised(),
            TokenKind::Direct | TokenKind::MalformedDirect => {
                let address = self.direct_address();
                let span = self.prev_span();
                self.expr_node(0, span, address.map_or(ExprKind::Error, ExprKind::Direct))
            }
            kind if literal_start(kind) => {
                let start = self.span();
                let literal = self.literal(None);
                let span = self.span_from(start);
                self.expr_node(0, span, literal.map_or(ExprKind::Error, ExprKind::Literal))
            }
            TokenKind::Unknown => {
                self.bump();
                self.reported_at = Some(self.pos);
                self.error_expr()
            }
            _ => {
                self.report_expected("an expression");
                self.error_expr()
            }
        }
    }

    /// `'(' expression ')'`. No node: the span of the expression is widened.
    fn parenthesised(&mut self) -> Expr {
        let open = self.bump();
        let mut expr = self.expression();
        if self.at(TokenKind::Assign) {
            let message = "`:=` assigns; it cannot stand in an expression";
            self.report(Diagnostic::new(&rules::ASSIGN_IN_CONDITION, self.span(), message).help("compare with `=`"));
            self.bump();
            self.expression();
        }
        self.close(TokenKind::RightParen, "the expression");
        expr.span = self.span_from(open);
        expr
    }

    /// `type-name '#' ( name | [ sign ] literal )`.
    fn typed(&mut self) -> Expr {
        let ty = self.take_name();
        self.bump();
        if self.at(TokenKind::Ident) {
            let value = self.take_name();
            let span = ty.span.to(value.span);
            return self.expr_node(0, span, ExprKind::EnumValue { ty, value });
        }
        let signed = matches!(self.kind(), TokenKind::Minus | TokenKind::Plus);
        if !literal_start(if signed { self.kind_at(1) } else { self.kind() }) {
            self.report_expected("a value after `#`");
            return self.error_expr();
        }
        let literal = self.literal(Some(ty));
        let span = self.span_from(ty.span);
        self.expr_node(0, span, literal.map_or(ExprKind::Error, ExprKind::Literal))
    }
}

/// Whether `(` after it is a call: after `(a + b)` or a literal it is not.
fn callable(expr: &Expr) -> bool {
    matches!(
        expr.kind,
        ExprKind::Name(_)
            | ExprKind::Member { .. }
            | ExprKind::Index { .. }
            | ExprKind::Deref { .. }
            | ExprKind::Call { .. }
    )
}

/// The size of a letter in an address.
pub(super) fn access_size(letter: Option<u8>) -> Option<AccessSize> {
    match letter?.to_ascii_uppercase() {
        b'X' => Some(AccessSize::Bit),
        b'B' => Some(AccessSize::Byte),
        b'W' => Some(AccessSize::Word),
        b'D' => Some(AccessSize::Double),
        b'L' => Some(AccessSize::Long),
        _ => None,
    }
}

/// Whether a literal (without type and sign) begins with it.
pub(super) fn literal_start(kind: TokenKind) -> bool {
    let others = matches!(kind, TokenKind::UnterminatedString | TokenKind::Keyword(Keyword::True | Keyword::False));
    others || kind.is_literal()
}
