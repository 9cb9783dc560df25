//! Variable sections and declarations (IEC 61131-3 6.5).

use khz_bytecode::container::ElementaryType;

use super::Parser;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{
    Attribute, DirectAddress, Edge, Ident, Retention, TypeSpec, TypeSpecKind, VarDecl, VarKind, VarSection,
};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// A list of declarations with its end: a variable section, a structure.
pub(super) struct DeclList {
    /// The word that ends it.
    pub end: Keyword,
    /// The word that began it, for messages.
    pub opener: &'static str,
    /// Where it began.
    pub open: Span,
    /// Whether its end comes before the next section: if not, what is no declaration stands outside.
    pub closed: bool,
}

/// The section that a reserved word begins, if it holds ordinary declarations.
pub(super) fn section_kind(word: Keyword) -> Option<VarKind> {
    Some(match word {
        Keyword::Var => VarKind::Local,
        Keyword::VarInput => VarKind::Input,
        Keyword::VarOutput => VarKind::Output,
        Keyword::VarInOut => VarKind::InOut,
        Keyword::VarGlobal => VarKind::Global,
        Keyword::VarExternal => VarKind::External,
        Keyword::VarTemp => VarKind::Temp,
        _ => return None,
    })
}

impl Parser<'_> {
    /// `section = section-word { qualifier } { declaration } 'END_VAR'`.
    pub(super) fn var_section(&mut self, word: Keyword, kind: VarKind, attributes: Vec<Attribute>) -> VarSection {
        let open = self.bump();
        let mut constant = None;
        let mut retention = None;
        self.qualifiers(&mut constant, &mut retention);
        let list = DeclList { end: Keyword::EndVar, opener: word.text(), open, closed: self.section_is_closed() };
        let decls = self.declarations_until(&list);
        VarSection { kind, constant, retention, decls, attributes, span: self.span_from(open) }
    }

    /// `qualifier = 'CONSTANT' | 'RETAIN' | 'NON_RETAIN' | 'PERSISTENT'`, in any order.
    pub(super) fn qualifiers(&mut self, constant: &mut Option<Span>, retention: &mut Option<(Retention, Span)>) {
        loop {
            if let Some(span) = self.eat_keyword(Keyword::Constant) {
                if constant.replace(span).is_some() {
                    self.report_at(&rules::BAD_QUALIFIER, span, "CONSTANT stands here twice");
                }
                continue;
            }
            // `VAR retain : INT; …` declares a variable of that name.
            if matches!(self.kind_at(1), TokenKind::Colon | TokenKind::Comma) {
                return;
            }
            let found = match () {
                () if self.at_word("RETAIN") => Retention::Retain,
                () if self.at_word("NON_RETAIN") => Retention::NonRetain,
                () if self.at_word("PERSISTENT") => Retention::Persistent,
                () => return,
            };
            let span = self.bump();
            match *retention {
                None => *retention = Some((found, span)),
                // `RETAIN PERSISTENT` in any order is PERSISTENT.
                Some((Retention::Retain, first)) if found == Retention::Persistent => {
                    *retention = Some((found, first.to(span)));
                }
                Some((Retention::Persistent, _)) if found == Retention::Retain => {}
                Some(_) => {
                    self.report_at(&rules::BAD_QUALIFIER, span, "this contradicts or repeats the word before it");
                }
            }
        }
    }

    /// Whether `END_VAR` comes before the next section, declaration or end of a POU. Looks ahead at most to the next
    /// section, so all sections together cost one pass over the tokens.
    pub(super) fn section_is_closed(&self) -> bool {
        for token in self.tokens.get(self.pos..).unwrap_or(&[]) {
            match token.kind {
                TokenKind::Keyword(Keyword::EndVar) => return true,
                TokenKind::Keyword(word) if word.starts_section() || word.starts_declaration() || word.ends_pou() => {
                    return false;
                }
                _ => {}
            }
        }
        false
    }

    /// `{ declaration } end`, where the end is reported if it is missing.
    pub(super) fn declarations_until(&mut self, list: &DeclList) -> Vec<VarDecl> {
        let mut decls = Vec::new();
        loop {
            if self.at(TokenKind::Ident)
                && !matches!(self.kind_at(1), TokenKind::Colon | TokenKind::Comma | TokenKind::Assign)
                && self.mend_leading_word()
            {
                continue;
            }
            let attributes = self.attributes();
            match self.kind() {
                TokenKind::Keyword(word) if word == list.end => {
                    self.drop_attributes(attributes);
                    self.bump();
                    if list.end == Keyword::EndVar {
                        self.eat(TokenKind::Semicolon);
                    }
                    return decls;
                }
                TokenKind::Semicolon => {
                    self.bump();
                }
                TokenKind::Ident if !list.closed && self.begins_statement() => {
                    self.missing_end(list.end, list.opener, list.open);
                    return decls;
                }
                TokenKind::Ident => decls.push(self.var_decl(list.end, attributes)),
                TokenKind::Keyword(_) if matches!(self.kind_at(1), TokenKind::Colon | TokenKind::Comma) => {
                    decls.push(self.var_decl(list.end, attributes));
                }
                kind if self.ends_declarations(kind, list) => {
                    self.drop_attributes(attributes);
                    self.missing_end(list.end, list.opener, list.open);
                    return decls;
                }
                _ => {
                    self.drop_attributes(attributes);
                    let message = format!("expected a declaration or `{}`, found {}", list.end.text(), self.found());
                    let help = "a declaration is `name : INT;`; a name begins with a letter or `_`";
                    self.report(Diagnostic::new(&rules::EXPECTED, self.span(), message).help(help));
                    self.names_lost = true;
                    // The first name of a list is missing.
                    let goes_on = self.at(TokenKind::Comma) && self.kind_at(1) == TokenKind::Ident;
                    self.bump();
                    if !goes_on {
                        self.skip_declaration(list.end);
                    }
                }
            }
        }
    }

    /// Whether a name at the current place begins a statement rather than a declaration.
    fn begins_statement(&self) -> bool {
        matches!(
            self.kind_at(1),
            TokenKind::Assign | TokenKind::LeftParen | TokenKind::Dot | TokenKind::LeftBracket | TokenKind::Caret
        )
    }

    /// Whether declarations without their end are over here.
    fn ends_declarations(&self, kind: TokenKind, list: &DeclList) -> bool {
        match kind {
            TokenKind::End => true,
            TokenKind::Keyword(word) => {
                word.starts_declaration()
                    || word.starts_section()
                    || word.ends_pou()
                    || matches!(word, Keyword::EndConfiguration | Keyword::EndResource)
                    || (list.end != Keyword::EndVar && matches!(word, Keyword::EndType | Keyword::EndVar))
                    || (!list.closed && word.starts_statement())
            }
            _ => false,
        }
    }

    /// `declaration = name { ',' name } [ 'AT' direct-address ] ':' type [ edge ] [ ':=' initial-value ] ';'`.
    fn var_decl(&mut self, end: Keyword, attributes: Vec<Attribute>) -> VarDecl {
        let start = self.span();
        let mut names = vec![self.declared_name("the name of a variable")];
        loop {
            if self.eat(TokenKind::Comma).is_none() {
                // `a b, c : INT;`: what follows is a name too.
                let another = self.at(TokenKind::Ident)
                    && !self.on_new_line()
                    && matches!(self.kind_at(1), TokenKind::Comma | TokenKind::Colon);
                if !another {
                    break;
                }
                self.report_missing("`,`", "this name");
            }
            names.push(self.declared_name("the name of a variable"));
        }
        if let Some(ty) = self.type_before_name(&mut names) {
            let init = self.optional_init();
            let span = self.span_from(start);
            self.end_declaration(end);
            return VarDecl { names, address: None, ty, edge: None, init, attributes, span };
        }
        let address = self.location();
        let ty = self.declared_type("the name of the variable");
        let edge = self.edge();
        let init = self.optional_init();
        let span = self.span_from(start);
        self.end_declaration(end);
        VarDecl { names, address, ty, edge, init, attributes, span }
    }

    /// `int a;`, as other languages declare: says so, and puts the name in the place of the type's.
    fn type_before_name(&mut self, names: &mut [Ident]) -> Option<TypeSpec> {
        let [first] = names else { return None };
        let ends = matches!(self.kind_at(1), TokenKind::Semicolon | TokenKind::Assign);
        let is_type = |text: &str| ElementaryType::ALL.iter().any(|ty| ty.name().eq_ignore_ascii_case(text));
        if !(self.at(TokenKind::Ident) && ends && !self.on_new_line() && is_type(self.slice(first.span))) {
            return None;
        }
        let help = format!("write `{} : {};`", self.slice(self.span()), self.slice(first.span));
        let found = Diagnostic::new(&rules::EXPECTED, first.span, "the name of a variable stands before its type");
        self.report(found.help(help));
        let ty = std::mem::replace(first, self.take_name());
        Some(TypeSpec { kind: TypeSpecKind::Named(ty), span: ty.span })
    }

    /// `[ 'AT' direct-address ]`.
    pub(super) fn location(&mut self) -> Option<DirectAddress> {
        self.eat_word("AT")?;
        if matches!(self.kind(), TokenKind::Direct | TokenKind::MalformedDirect) {
            return self.direct_address();
        }
        self.report_expected("a direct address like `%IX0.0` after `AT`");
        None
    }

    /// `':' type`.
    pub(super) fn declared_type(&mut self, after: &str) -> TypeSpec {
        let colon = self.expect(TokenKind::Colon, after);
        let hopeless = !colon && (self.kind_at(1) == TokenKind::Colon || self.on_new_line());
        if hopeless {
            // What comes is no type: a second message would only confuse.
            return TypeSpec { kind: TypeSpecKind::Error, span: self.span().before() };
        }
        self.type_spec()
    }

    /// `edge = 'R_EDGE' | 'F_EDGE'`.
    fn edge(&mut self) -> Option<(Edge, Span)> {
        if let Some(span) = self.eat_word("R_EDGE") {
            return Some((Edge::Rising, span));
        }
        self.eat_word("F_EDGE").map(|span| (Edge::Falling, span))
    }

    /// The `;` of a declaration. Where it is missing the next declaration is looked for.
    pub(super) fn end_declaration(&mut self, end: Keyword) {
        if self.eat(TokenKind::Semicolon).is_some() {
            return;
        }
        if self.reported_at != Some(self.pos) {
            self.report_missing("`;`", "this declaration");
        }
        let next_follows = self.on_new_line() && matches!(self.kind_at(1), TokenKind::Colon | TokenKind::Comma);
        if !next_follows {
            self.skip_declaration(end);
        }
    }

    /// Skips to behind the next `;`, or to the end of the list or whatever cannot be inside of it. May not move at all.
    pub(super) fn skip_declaration(&mut self, end: Keyword) {
        loop {
            match self.kind() {
                TokenKind::Semicolon => {
                    self.bump();
                    return;
                }
                TokenKind::End => return,
                TokenKind::Keyword(word) if word == end || boundary(word) => return,
                TokenKind::Ident if self.on_new_line() && self.kind_at(1) == TokenKind::Colon => return,
                _ => {
                    self.names_lost |= self.at(TokenKind::Ident);
                    self.bump();
                }
            }
        }
    }

    /// Reports a construct that is known and not supported.
    pub(super) fn report_unsupported(&mut self, what: &str) {
        let message = format!("{what} is not supported by this version");
        self.report(Diagnostic::new(&rules::NOT_SUPPORTED, self.span(), message));
    }
}

/// Whether declarations are skipped no further than to this word.
fn boundary(word: Keyword) -> bool {
    word.starts_declaration()
        || word.starts_section()
        || word.ends_pou()
        || matches!(
            word,
            Keyword::EndVar
                | Keyword::EndType
                | Keyword::EndStruct
                | Keyword::EndUnion
                | Keyword::EndConfiguration
                | Keyword::EndResource
        )
}
