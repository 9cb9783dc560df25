//! The top level of a file and the program organisation units (IEC 61131-3 6.6).

use super::Parser;
use super::vars::{DeclList, section_kind};
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{Attribute, Declaration, Pou, PouKind, TypeSpec, VarKind, VarSection};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// Elements at the top level that are known and not supported.
const UNSUPPORTED_DECLARATIONS: [&str; 3] = ["INTERFACE", "CLASS", "NAMESPACE"];

/// Elements inside of a POU that are known and not supported.
const UNSUPPORTED_ELEMENTS: [&str; 6] = ["METHOD", "PROPERTY", "ACTION", "TRANSITION", "STEP", "INITIAL_STEP"];

impl PouKind {
    /// The word that begins it.
    fn opener(self) -> &'static str {
        match self {
            Self::Program => "PROGRAM",
            Self::Function => "FUNCTION",
            Self::FunctionBlock => "FUNCTION_BLOCK",
        }
    }

    /// The word that ends it.
    fn end(self) -> Keyword {
        match self {
            Self::Program => Keyword::EndProgram,
            Self::Function => Keyword::EndFunction,
            Self::FunctionBlock => Keyword::EndFunctionBlock,
        }
    }
}

impl Parser<'_> {
    /// ```text
    /// declaration = type-block | pou | global-variables | configuration | test
    /// ```
    pub(super) fn declarations(&mut self) -> Vec<Declaration> {
        let mut declarations = Vec::new();
        loop {
            let attributes = self.attributes();
            match self.kind() {
                TokenKind::End => {
                    self.drop_attributes(attributes);
                    return declarations;
                }
                TokenKind::Semicolon => {
                    self.drop_attributes(attributes);
                    self.bump();
                }
                TokenKind::Keyword(Keyword::Type) => self.type_block(attributes, &mut declarations),
                TokenKind::Keyword(Keyword::Program) => {
                    declarations.push(Declaration::Pou(self.pou(PouKind::Program, attributes)));
                }
                TokenKind::Keyword(Keyword::Function) => {
                    declarations.push(Declaration::Pou(self.pou(PouKind::Function, attributes)));
                }
                TokenKind::Keyword(Keyword::FunctionBlock) => {
                    declarations.push(Declaration::Pou(self.pou(PouKind::FunctionBlock, attributes)));
                }
                TokenKind::Keyword(Keyword::VarGlobal) => {
                    let section = self.var_section(Keyword::VarGlobal, VarKind::Global, attributes);
                    declarations.push(Declaration::Globals(section));
                }
                TokenKind::Keyword(Keyword::Configuration) => {
                    declarations.push(Declaration::Configuration(self.configuration(attributes)));
                }
                _ => {
                    self.drop_attributes(attributes);
                    if !self.test_declaration() {
                        self.no_declaration();
                    }
                }
            }
        }
    }

    /// Something at the top level that is no declaration: mends it, or skips to the next declaration.
    fn no_declaration(&mut self) {
        if self.skip_unsupported(&UNSUPPORTED_DECLARATIONS) || self.mend_leading_word() {
            return;
        }
        self.report_expected(
            "a declaration: `PROGRAM`, `FUNCTION`, `FUNCTION_BLOCK`, `TYPE`, `VAR_GLOBAL` or `CONFIGURATION`",
        );
        self.names_lost = true;
        loop {
            self.bump();
            match self.kind() {
                TokenKind::End => return,
                // A lost CONFIGURATION leaves its program instances behind.
                TokenKind::Keyword(Keyword::Program) if self.at_program_instance() => {}
                TokenKind::Keyword(word) if word.starts_declaration() || word == Keyword::VarGlobal => return,
                TokenKind::Ident if self.on_new_line() && self.at_test_declaration() => return,
                _ => {}
            }
        }
    }

    /// ```text
    /// pou = 'PROGRAM' name { section } block 'END_PROGRAM'
    ///     | 'FUNCTION' name [ ':' type ] { section } block 'END_FUNCTION'
    ///     | 'FUNCTION_BLOCK' name { section } block 'END_FUNCTION_BLOCK'
    /// ```
    fn pou(&mut self, kind: PouKind, attributes: Vec<Attribute>) -> Pou {
        let open = self.bump();
        let lost_outside = std::mem::take(&mut self.names_lost);
        let name = self.name(&format!("the name of the {}", kind.opener()));
        let result = self.result_type(kind);
        self.inheritance();
        self.eat(TokenKind::Semicolon);
        let mut sections = self.sections();
        let body = self.block();
        sections.append(&mut self.late_sections);
        self.end_of_pou(kind, open);
        let span = self.span_from(open);
        self.eat(TokenKind::Semicolon);
        let names_lost = std::mem::replace(&mut self.names_lost, lost_outside || name.is_missing());
        Pou { kind, name, result, sections, body, attributes, names_lost, span }
    }

    /// `[ ':' type ]`: of functions only.
    fn result_type(&mut self, kind: PouKind) -> Option<TypeSpec> {
        let colon = self.span();
        self.eat(TokenKind::Colon)?;
        let ty = self.type_spec();
        if kind == PouKind::Function {
            return Some(ty);
        }
        let message = format!("a {} has no result", kind.opener());
        let found = Diagnostic::new(&rules::EXPECTED, colon.to(ty.span), message);
        self.report(found.help("only a FUNCTION has a result type"));
        None
    }

    /// `[ 'EXTENDS' name ] [ 'IMPLEMENTS' name { ',' name } ]`: known and not supported.
    fn inheritance(&mut self) {
        while self.at_word("EXTENDS") || self.at_word("IMPLEMENTS") {
            let word = self.slice(self.span()).to_ascii_uppercase();
            self.report_unsupported(&format!("`{word}`"));
            self.bump();
            loop {
                self.name("a name");
                if self.eat(TokenKind::Comma).is_none() {
                    break;
                }
            }
        }
    }

    pub(super) fn sections(&mut self) -> Vec<VarSection> {
        let mut sections = Vec::new();
        loop {
            let attributes = self.attributes();
            match self.keyword().filter(|word| word.starts_section()) {
                Some(word) => match section_kind(word) {
                    Some(kind) => sections.push(self.var_section(word, kind, attributes)),
                    None => self.drop_misplaced_section(attributes),
                },
                None if self.headless_section() => sections.push(self.section_without_head(attributes)),
                None => {
                    self.drop_attributes(attributes);
                    // `VAR_INPT` is a section whose word is misspelt, unless it is the beginning of a statement.
                    let names_follow = self.at(TokenKind::Ident) && self.kind_at(1) == TokenKind::Ident;
                    if !(names_follow && self.mend_leading_word()) {
                        return sections;
                    }
                }
            }
        }
    }

    /// Whether declarations stand here whose `VAR` is missing: names with a `:`, and an `END_VAR` after them.
    fn headless_section(&self) -> bool {
        let declares = match self.kind_at(1) {
            TokenKind::Comma => true,
            TokenKind::Colon => self.kind_at(2) != TokenKind::Equal,
            TokenKind::Ident => self.word_at(1, "AT") && self.kind_at(2) == TokenKind::Direct,
            _ => false,
        };
        self.at(TokenKind::Ident) && declares && self.section_is_closed()
    }

    fn section_without_head(&mut self, attributes: Vec<Attribute>) -> VarSection {
        let open = self.span();
        self.report_missing("`VAR`", "what stands before these declarations");
        let list = DeclList { end: Keyword::EndVar, opener: "VAR", open, closed: true };
        let decls = self.declarations_until(&list);
        VarSection {
            kind: VarKind::Local,
            constant: None,
            retention: None,
            decls,
            attributes,
            span: self.span_from(open),
        }
    }

    /// A VAR_CONFIG or VAR_ACCESS outside of a configuration: reported and skipped.
    pub(super) fn drop_misplaced_section(&mut self, attributes: Vec<Attribute>) {
        self.drop_attributes(attributes);
        let message = format!("{} stands in a CONFIGURATION only", self.found());
        self.report(Diagnostic::new(&rules::MISPLACED_SECTION, self.span(), message));
        self.bump();
        while !self.at_end() && self.eat_keyword(Keyword::EndVar).is_none() {
            if self.keyword().is_some_and(|word| word.starts_section() || word.starts_declaration() || word.ends_pou())
            {
                return;
            }
            self.bump();
        }
    }

    /// The `END_…` of a POU; that of another kind is reported and taken for it.
    fn end_of_pou(&mut self, kind: PouKind, open: Span) {
        if self.eat_keyword(kind.end()).is_some() {
            return;
        }
        self.missing_end(kind.end(), kind.opener(), open);
        if self.keyword().is_some_and(Keyword::ends_pou) {
            self.bump();
        }
    }

    /// A method, property, action or element of a sequential chart: reported and skipped.
    pub(super) fn unsupported_element(&mut self) -> bool {
        self.skip_unsupported(&UNSUPPORTED_ELEMENTS)
    }

    /// If one of the words begins an element here, reports it and skips to behind its `END_…`.
    fn skip_unsupported(&mut self, words: &[&str]) -> bool {
        if self.kind_at(1) != TokenKind::Ident {
            return false;
        }
        let Some(&word) = words.iter().find(|word| self.at_word(word)) else { return false };
        self.report_unsupported(&format!("`{word}`"));
        let end = format!("END_{}", word.trim_start_matches("INITIAL_"));
        loop {
            self.bump();
            match self.kind() {
                TokenKind::End => break,
                TokenKind::Ident if self.at_word(&end) => {
                    self.bump();
                    self.eat(TokenKind::Semicolon);
                    break;
                }
                TokenKind::Keyword(word) if word.starts_declaration() || word.ends_pou() => break,
                _ => {}
            }
        }
        // What follows has its meaning from what was skipped.
        self.reported_at = Some(self.pos);
        true
    }
}
