//! Initial values (IEC 61131-3 6.4.4 and 6.5.1).

use super::Parser;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::syntax::ast::{Init, InitElement, InitField, InitKind};
use crate::syntax::lexer::TokenKind;

impl Parser<'_> {
    /// `[ ':=' initial-value ]`. A `=` in its place is reported and taken for it.
    pub(super) fn optional_init(&mut self) -> Option<Init> {
        if self.at(TokenKind::Equal) {
            let message = "an initial value is given with `:=`";
            self.report(Diagnostic::new(&rules::EQUALS_FOR_ASSIGN, self.span(), message).help("write `:=`"));
            self.bump();
            return Some(self.init());
        }
        self.eat(TokenKind::Assign).map(|_| self.init())
    }

    /// `initial-value = expression | array-initialiser | structure-initialiser`.
    pub(super) fn init(&mut self) -> Init {
        self.nested(Self::init_unlimited, |parser| {
            let hole = parser.error_expr();
            Init { span: hole.span, kind: InitKind::Expr(hole) }
        })
    }

    fn init_unlimited(&mut self) -> Init {
        let start = self.span();
        let kind = match self.kind() {
            TokenKind::LeftBracket => InitKind::Array(self.array_init()),
            TokenKind::LeftParen if self.kind_at(1) == TokenKind::Ident && self.kind_at(2) == TokenKind::Assign => {
                InitKind::Struct(self.struct_init())
            }
            _ => InitKind::Expr(self.expression()),
        };
        Init { kind, span: self.span_from(start) }
    }

    /// `array-initialiser = '[' element { ',' element } ']'`.
    fn array_init(&mut self) -> Vec<InitElement> {
        self.bump();
        let mut elements = Vec::new();
        while !self.at(TokenKind::RightBracket) {
            elements.push(self.init_element());
            if self.eat(TokenKind::Comma).is_none() {
                break;
            }
        }
        self.close(TokenKind::RightBracket, "the initial values");
        elements
    }

    /// `element = initial-value | integer '(' [ initial-value { ',' initial-value } ] ')'`.
    fn init_element(&mut self) -> InitElement {
        let start = self.span();
        let repeats = matches!(self.kind(), TokenKind::Int | TokenKind::BasedInt);
        if !(repeats && self.kind_at(1) == TokenKind::LeftParen) {
            let values = vec![self.init()];
            return InitElement { repeat: None, values, span: self.span_from(start) };
        }
        // `postfix` takes the number alone: a literal cannot be called.
        let repeat = Some(self.postfix());
        self.bump();
        let mut values = Vec::new();
        while !self.at(TokenKind::RightParen) {
            values.push(self.init());
            if self.eat(TokenKind::Comma).is_none() {
                break;
            }
        }
        self.close(TokenKind::RightParen, "the repeated values");
        InitElement { repeat, values, span: self.span_from(start) }
    }

    /// `structure-initialiser = '(' name ':=' initial-value { ',' name ':=' initial-value } ')'`.
    pub(super) fn struct_init(&mut self) -> Vec<InitField> {
        self.bump();
        let mut fields = Vec::new();
        loop {
            let name = self.name("the name of a field");
            self.expect(TokenKind::Assign, "the name of the field");
            fields.push(InitField { name, value: self.init() });
            if self.eat(TokenKind::Comma).is_none() {
                break;
            }
        }
        self.close(TokenKind::RightParen, "the initial values");
        fields
    }
}
