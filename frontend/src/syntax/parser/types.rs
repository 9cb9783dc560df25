//! Types (IEC 61131-3 6.4, table 11).

use super::Parser;
use super::vars::DeclList;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{
    ArrayDim, Attribute, Declaration, EnumValue, Expr, Range, ReferenceKind, TypeDecl, TypeSpec, TypeSpecKind,
};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

impl Parser<'_> {
    /// `'TYPE' { name ':' type [ ':=' initial-value ] ';' } 'END_TYPE'`.
    pub(super) fn type_block(&mut self, attributes: Vec<Attribute>, into: &mut Vec<Declaration>) {
        let open = self.bump();
        let mut attributes = Some(attributes);
        loop {
            let mut here = attributes.take().unwrap_or_default();
            here.extend(self.attributes());
            match self.kind() {
                TokenKind::Keyword(Keyword::EndType) => {
                    self.drop_attributes(here);
                    self.bump();
                    self.eat(TokenKind::Semicolon);
                    return;
                }
                TokenKind::Semicolon => {
                    self.bump();
                }
                TokenKind::Ident if self.kind_at(1) != TokenKind::Colon && self.mend_leading_word() => {}
                TokenKind::Ident => into.push(Declaration::Type(self.type_decl(here))),
                TokenKind::Keyword(_) if self.kind_at(1) == TokenKind::Colon => {
                    into.push(Declaration::Type(self.type_decl(here)));
                }
                TokenKind::End => return self.missing_end(Keyword::EndType, "TYPE", open),
                TokenKind::Keyword(word) if word.starts_declaration() || word.starts_section() || word.ends_pou() => {
                    return self.missing_end(Keyword::EndType, "TYPE", open);
                }
                _ => {
                    self.report_expected("the name of a type or `END_TYPE`");
                    self.names_lost = true;
                    self.bump();
                    self.skip_declaration(Keyword::EndType);
                }
            }
        }
    }

    /// `name ':' type [ ':=' initial-value ] ';'`.
    fn type_decl(&mut self, attributes: Vec<Attribute>) -> TypeDecl {
        let start = self.span();
        let name = self.declared_name("the name of a type");
        if self.at_word("EXTENDS") {
            self.report_unsupported("a structure that EXTENDS another");
            self.bump();
            self.name("the name of a structure");
        }
        self.expect(TokenKind::Colon, "the name of the type");
        let spec = self.type_spec();
        let init = self.optional_init();
        let span = self.span_from(start);
        let structure = matches!(spec.kind, TypeSpecKind::Struct { .. });
        // Vendors leave the `;` out after END_STRUCT.
        if !structure || init.is_some() {
            self.end_declaration(Keyword::EndType);
        } else {
            self.eat(TokenKind::Semicolon);
        }
        TypeDecl { name, spec, init, attributes, span }
    }

    /// ```text
    /// type = name | string-type | subrange | enumeration | array | structure | reference
    /// ```
    pub(super) fn type_spec(&mut self) -> TypeSpec {
        self.nested(Self::type_spec_unlimited, |parser| TypeSpec {
            kind: TypeSpecKind::Error,
            span: parser.span().before(),
        })
    }

    fn type_spec_unlimited(&mut self) -> TypeSpec {
        let start = self.span();
        let kind = match self.kind() {
            TokenKind::Keyword(Keyword::Array) => self.array_type(),
            TokenKind::Keyword(Keyword::Struct) => self.struct_type(Keyword::EndStruct, "STRUCT"),
            TokenKind::Keyword(Keyword::Union) => self.struct_type(Keyword::EndUnion, "UNION"),
            TokenKind::LeftParen => self.enum_type(),
            TokenKind::Ident => self.named_type(),
            _ => {
                self.report_expected("a type");
                return TypeSpec { kind: TypeSpecKind::Error, span: start.before() };
            }
        };
        TypeSpec { kind, span: self.span_from(start) }
    }

    /// ```text
    /// named-type  = name [ '(' range ')' | '(' enum-values ')' ]
    /// string-type = ( 'STRING' | 'WSTRING' ) [ '[' length ']' | '(' length ')' ]
    /// reference   = ( 'REF_TO' | 'POINTER' 'TO' | 'REFERENCE' 'TO' ) type
    /// ```
    fn named_type(&mut self) -> TypeSpecKind {
        let to_follows = self.kind_at(1) == TokenKind::Keyword(Keyword::To);
        let reference = match () {
            () if self.at_word("REF_TO") => Some(ReferenceKind::RefTo),
            () if to_follows && self.at_word("POINTER") => Some(ReferenceKind::PointerTo),
            () if to_follows && self.at_word("REFERENCE") => Some(ReferenceKind::ReferenceTo),
            () => None,
        };
        if let Some(kind) = reference {
            self.bump();
            self.eat_keyword(Keyword::To);
            return TypeSpecKind::Reference { kind, target: Box::new(self.type_spec()) };
        }
        if self.at_word("STRING") || self.at_word("WSTRING") {
            let wide = self.at_word("WSTRING");
            self.bump();
            return TypeSpecKind::String { wide, length: self.string_length().map(Box::new) };
        }
        let name = self.take_name();
        if !self.at(TokenKind::LeftParen) {
            return TypeSpecKind::Named(name);
        }
        let enumeration = self.kind_at(1) == TokenKind::Ident
            && matches!(self.kind_at(2), TokenKind::Comma | TokenKind::RightParen | TokenKind::Assign);
        if enumeration {
            return TypeSpecKind::Enum { base: Some(name), values: self.enum_values() };
        }
        self.bump();
        let range = Box::new(self.range());
        self.close(TokenKind::RightParen, "the range");
        TypeSpecKind::Subrange { base: name, range }
    }

    fn string_length(&mut self) -> Option<Expr> {
        let close = match self.kind() {
            TokenKind::LeftBracket => TokenKind::RightBracket,
            TokenKind::LeftParen => TokenKind::RightParen,
            _ => return None,
        };
        self.bump();
        let length = self.expression();
        self.close(close, "the length of the string");
        Some(length)
    }

    /// `range = expression '..' expression`.
    pub(super) fn range(&mut self) -> Range {
        let low = self.expression();
        self.range_from(low)
    }

    /// The rest of a range after its lower bound.
    pub(super) fn range_from(&mut self, low: Expr) -> Range {
        let high =
            if self.expect(TokenKind::DotDot, "the lower bound") { self.expression() } else { self.error_expr() };
        let span = low.span.to(self.prev_span());
        Range { low, high, span }
    }

    /// `enumeration = '(' enum-values ')' [ base-type ]`.
    fn enum_type(&mut self) -> TypeSpecKind {
        let values = self.enum_values();
        let base = (self.at(TokenKind::Ident) && !self.on_new_line()).then(|| self.take_name());
        TypeSpecKind::Enum { base, values }
    }

    /// `enum-values = '(' name [ ':=' expression ] { ',' name [ ':=' expression ] } ')'`.
    fn enum_values(&mut self) -> Vec<EnumValue> {
        self.bump();
        let mut values = Vec::new();
        while !self.at(TokenKind::RightParen) {
            let attributes = self.attributes();
            let name = self.declared_name("the name of a value");
            if name.is_missing() {
                if self.at(TokenKind::Comma) {
                    self.bump();
                    continue;
                }
                break;
            }
            let value = self.eat(TokenKind::Assign).map(|_| self.expression());
            values.push(EnumValue { name, value, attributes });
            if self.eat(TokenKind::Comma).is_none() {
                let another = self.at(TokenKind::Ident)
                    && matches!(self.kind_at(1), TokenKind::Comma | TokenKind::RightParen | TokenKind::Assign);
                if !another {
                    break;
                }
                self.report_missing("`,`", "this value");
            }
        }
        self.names_lost |= !self.at(TokenKind::RightParen);
        self.close(TokenKind::RightParen, "the values");
        values
    }

    /// `array = 'ARRAY' '[' dimension { ',' dimension } ']' 'OF' type`, with `dimension = range | '*'`.
    fn array_type(&mut self) -> TypeSpecKind {
        self.bump();
        let mut dims = Vec::new();
        let round = self.at(TokenKind::LeftParen);
        let has_bounds = self.expect(TokenKind::LeftBracket, "`ARRAY`") || round;
        if round {
            self.bump();
        }
        if !has_bounds && self.at_keyword(Keyword::Array) {
            return self.nested(Self::array_type, |_| TypeSpecKind::Error);
        }
        if has_bounds {
            loop {
                dims.push(match self.eat(TokenKind::Star) {
                    Some(span) => ArrayDim::Open(span),
                    None => ArrayDim::Range(self.range()),
                });
                if self.eat(TokenKind::Comma).is_none() {
                    break;
                }
            }
            if !(round && self.eat(TokenKind::RightParen).is_some()) {
                self.close(TokenKind::RightBracket, "the bounds");
            }
        }
        self.expect_keyword(Keyword::Of, "the bounds of the array");
        let element = Box::new(self.type_spec());
        if has_bounds { TypeSpecKind::Array { dims, element } } else { TypeSpecKind::Error }
    }

    /// `structure = 'STRUCT' { declaration } 'END_STRUCT' | 'UNION' { declaration } 'END_UNION'`.
    fn struct_type(&mut self, end: Keyword, opener: &'static str) -> TypeSpecKind {
        let open = self.bump();
        if self.at_word("OVERLAP") {
            self.report_unsupported("OVERLAP");
            self.bump();
        }
        let fields = self.declarations_until(&DeclList { end, opener, open, closed: true });
        TypeSpecKind::Struct { union: end == Keyword::EndUnion, fields }
    }

    /// Reports that a block has no end.
    pub(super) fn missing_end(&mut self, end: Keyword, opener: &str, open: Span) {
        let message = format!("expected `{}`, found {}", end.text(), self.found());
        let span = if self.at_end() { self.prev_span().after() } else { self.span() };
        let help = if end == Keyword::EndIf && self.open.else_ifs {
            "`ELSE IF` begins another IF with an END_IF of its own; `ELSIF` goes on with the same one".to_owned()
        } else {
            format!("write `{}` there", end.text())
        };
        let found = Diagnostic::new(&rules::MISSING_END, span, message).help(help);
        self.report(found.label(open, format!("this {opener} has no `{}`", end.text())));
    }
}
