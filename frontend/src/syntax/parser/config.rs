//! Configurations (IEC 61131-3 6.8.2, table 62).

use super::Parser;
use super::spelling;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{
    AccessVar, Attribute, ConfigVar, Configuration, Connection, ProgramInstance, Resource, Retention, Task, TaskParam,
    TaskParamKind, VarKind,
};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// The parameters of a task by their names.
const TASK_PARAMS: [(&str, TaskParamKind); 3] =
    [("SINGLE", TaskParamKind::Single), ("INTERVAL", TaskParamKind::Interval), ("PRIORITY", TaskParamKind::Priority)];

impl Parser<'_> {
    /// ```text
    /// configuration = 'CONFIGURATION' name { globals | resource | task | program | access | config } 'END_CONFIGURATION'
    /// ```
    pub(super) fn configuration(&mut self, attributes: Vec<Attribute>) -> Configuration {
        let open = self.bump();
        let name = self.name("the name of the configuration");
        let mut configuration = Configuration {
            name,
            globals: Vec::new(),
            resources: Vec::new(),
            config_vars: Vec::new(),
            access_vars: Vec::new(),
            attributes,
            span: open,
        };
        let mut direct = empty_resource(open);
        loop {
            let attributes = self.attributes();
            if self.at_word("RESOURCE") {
                let resource = self.resource(attributes);
                configuration.resources.push(resource);
            } else if self.at_keyword(Keyword::VarAccess) {
                self.drop_attributes(attributes);
                self.access_section(&mut configuration.access_vars);
            } else if self.at_keyword(Keyword::VarConfig) {
                self.drop_attributes(attributes);
                self.config_section(&mut configuration.config_vars);
            } else if self.at_keyword(Keyword::VarGlobal) {
                configuration.globals.push(self.var_section(Keyword::VarGlobal, VarKind::Global, attributes));
            } else if !self.resource_element(&mut direct, attributes, Keyword::EndConfiguration) {
                break;
            }
        }
        if self.eat_keyword(Keyword::EndConfiguration).is_none() {
            self.missing_end(Keyword::EndConfiguration, "CONFIGURATION", open);
        }
        configuration.span = self.span_from(open);
        self.eat(TokenKind::Semicolon);
        if !direct.tasks.is_empty() || !direct.programs.is_empty() {
            direct.span = configuration.span;
            configuration.resources.push(direct);
        }
        configuration
    }

    /// `resource = 'RESOURCE' name [ 'ON' name ] { globals | task | program } 'END_RESOURCE'`.
    fn resource(&mut self, attributes: Vec<Attribute>) -> Resource {
        let open = self.bump();
        let mut resource = empty_resource(open);
        resource.attributes = attributes;
        resource.name = Some(self.name("the name of the resource"));
        if self.eat_word("ON").is_some() {
            resource.processor = Some(self.name("the name of a processor after `ON`"));
        }
        loop {
            let attributes = self.attributes();
            if self.at_keyword(Keyword::VarGlobal) {
                resource.globals.push(self.var_section(Keyword::VarGlobal, VarKind::Global, attributes));
            } else if self.at_word("RESOURCE") {
                self.drop_attributes(attributes);
                break;
            } else if !self.resource_element(&mut resource, attributes, Keyword::EndResource) {
                break;
            }
        }
        if self.eat_keyword(Keyword::EndResource).is_none() {
            self.missing_end(Keyword::EndResource, "RESOURCE", open);
        }
        resource.span = self.span_from(open);
        self.eat(TokenKind::Semicolon);
        resource
    }

    /// A task, a program instance or a mistake. False if what is around it ends or goes on here.
    fn resource_element(&mut self, resource: &mut Resource, attributes: Vec<Attribute>, end: Keyword) -> bool {
        if self.at_word("TASK") {
            let task = self.task(attributes);
            resource.tasks.push(task);
            return true;
        }
        if self.at_keyword(Keyword::Program) && self.at_program_instance() {
            let program = self.program_instance(attributes);
            resource.programs.push(program);
            return true;
        }
        self.drop_attributes(attributes);
        match self.kind() {
            TokenKind::End => false,
            TokenKind::Semicolon => {
                self.bump();
                true
            }
            TokenKind::Keyword(word)
                if word == end
                    || word.starts_declaration()
                    || word == Keyword::EndConfiguration
                    || (end == Keyword::EndResource && word.starts_section()) =>
            {
                false
            }
            _ => {
                if !self.mend_configuration_word() {
                    self.report_expected(&format!("`TASK`, `PROGRAM` or `{}`", end.text()));
                    self.bump();
                    self.skip_element();
                }
                true
            }
        }
    }

    /// A misspelt word in a configuration.
    fn mend_configuration_word(&mut self) -> bool {
        if self.at(TokenKind::Ident) && spelling::is_like(self.slice(self.span()), "TASK") {
            let found =
                Diagnostic::new(&rules::MISSPELT_KEYWORD, self.span(), format!("{} is no word here", self.found()));
            self.report(found.help("did you mean `TASK`?"));
            self.bump();
            self.skip_element();
            return true;
        }
        self.mend_leading_word()
    }

    /// Skips to behind the next `;`, or to a word that begins or ends an element. May not move at all.
    fn skip_element(&mut self) {
        loop {
            match self.kind() {
                TokenKind::Semicolon => {
                    self.bump();
                    return;
                }
                TokenKind::End => return,
                TokenKind::Keyword(word)
                    if word.starts_declaration()
                        || word.starts_section()
                        || matches!(word, Keyword::EndResource | Keyword::EndConfiguration) =>
                {
                    return;
                }
                TokenKind::Ident if self.on_new_line() && (self.at_word("TASK") || self.at_word("RESOURCE")) => return,
                _ => {
                    self.bump();
                }
            }
        }
    }

    /// The `;` of an element.
    fn end_element(&mut self, what: &str) {
        if self.eat(TokenKind::Semicolon).is_none() {
            self.report_missing("`;`", what);
            self.skip_element();
        }
    }

    /// `task = 'TASK' name '(' parameter { ',' parameter } ')' ';'`.
    fn task(&mut self, attributes: Vec<Attribute>) -> Task {
        let start = self.bump();
        let name = self.name("the name of the task");
        let mut params = Vec::new();
        if self.expect(TokenKind::LeftParen, "the name of the task") {
            while !self.at(TokenKind::RightParen) {
                params.extend(self.task_param());
                if self.eat(TokenKind::Comma).is_none() {
                    break;
                }
            }
            self.close(TokenKind::RightParen, "the parameters of the task");
        }
        let span = self.span_from(start);
        self.end_element("this task");
        Task { name, params, attributes, span }
    }

    /// `parameter = ( 'SINGLE' | 'INTERVAL' | 'PRIORITY' ) ':=' expression`. None if the name is another one.
    fn task_param(&mut self) -> Option<TaskParam> {
        let text = self.slice(self.span());
        let exact = TASK_PARAMS.iter().find(|(name, _)| text.eq_ignore_ascii_case(name));
        let near = exact.or_else(|| TASK_PARAMS.iter().find(|(name, _)| spelling::is_like(text, name)));
        if exact.is_none() && self.at(TokenKind::Ident) {
            let message = format!("`{text}` is no parameter of a task");
            let help = match near {
                Some((name, _)) => format!("did you mean `{name}`?"),
                None => "the parameters are SINGLE, INTERVAL and PRIORITY; for more, use an attribute".to_owned(),
            };
            self.report(Diagnostic::new(&rules::UNKNOWN_TASK_PARAMETER, self.span(), message).help(help));
        }
        let name = self.name("SINGLE, INTERVAL or PRIORITY");
        self.expect(TokenKind::Assign, "the name of the parameter");
        let value = self.expression();
        near.map(|&(_, kind)| TaskParam { kind, name, value })
    }

    /// Whether `PROGRAM` begins an instance here and not, after a lost end, a declaration: that goes on with a variable
    /// section or on a new line, an instance with `WITH` or `:`.
    pub(super) fn at_program_instance(&self) -> bool {
        /// More tokens than `PROGRAM RETAIN name WITH` with one too many.
        const REACH: usize = 6;
        let first = (1..REACH).find(|&ahead| self.kind_at(ahead) != TokenKind::Ident || self.word_at(ahead, "WITH"));
        match first.map(|ahead| self.kind_at(ahead)) {
            Some(TokenKind::Ident | TokenKind::Colon | TokenKind::Semicolon) => true,
            // A doubled word.
            Some(TokenKind::Keyword(Keyword::Program)) => first == Some(1),
            _ => false,
        }
    }

    pub(super) fn word_at(&self, ahead: usize, word: &str) -> bool {
        let token = self.token_at(ahead);
        let span = Span::new(self.file, token.start, token.end);
        token.kind == TokenKind::Ident && self.slice(span).eq_ignore_ascii_case(word)
    }

    /// ```text
    /// program = 'PROGRAM' [ 'RETAIN' | 'NON_RETAIN' ] name [ 'WITH' task ] ':' type [ '(' [ connection { ',' connection } ] ')' ] ';'
    /// ```
    fn program_instance(&mut self, attributes: Vec<Attribute>) -> ProgramInstance {
        let start = self.bump();
        let mut retention = None;
        if self.kind_at(1) == TokenKind::Ident && !self.word_at(1, "WITH") {
            if self.at_word("RETAIN") {
                retention = Some((Retention::Retain, self.bump()));
            } else if self.at_word("NON_RETAIN") {
                retention = Some((Retention::NonRetain, self.bump()));
            }
        }
        let name = self.name("the name of the program instance");
        let task = self.eat_word("WITH").map(|_| self.name("the name of a task after `WITH`"));
        self.expect(TokenKind::Colon, "the name of the instance or its task");
        let ty = self.name("the name of a program type");
        let mut connections = Vec::new();
        if self.eat(TokenKind::LeftParen).is_some() {
            while !self.at(TokenKind::RightParen) {
                connections.extend(self.connection());
                if self.eat(TokenKind::Comma).is_none() {
                    break;
                }
            }
            self.close(TokenKind::RightParen, "the connections");
        }
        let span = self.span_from(start);
        self.end_element("this program instance");
        ProgramInstance { name, retention, task, ty, connections, attributes, span }
    }

    /// `connection = variable ':=' expression | variable '=>' variable | variable 'WITH' task`. None if it is none of them.
    fn connection(&mut self) -> Option<Connection> {
        let variable = self.postfix();
        if self.eat(TokenKind::Assign).is_some() {
            return Some(Connection::Source { variable, source: self.expression() });
        }
        if self.eat(TokenKind::Arrow).is_some() {
            return Some(Connection::Sink { variable, sink: self.postfix() });
        }
        if self.eat_word("WITH").is_some() {
            return Some(Connection::FbTask { fb: variable, task: self.name("the name of a task after `WITH`") });
        }
        self.report_missing("`:=` or `=>`", "the variable of the program");
        None
    }

    /// `config = 'VAR_CONFIG' { variable [ 'AT' direct-address ] ':' type [ ':=' initial-value ] ';' } 'END_VAR'`.
    fn config_section(&mut self, into: &mut Vec<ConfigVar>) {
        self.section(|parser| {
            let start = parser.span();
            let path = parser.postfix();
            let address = parser.location();
            let ty = parser.declared_type("the path of the variable");
            let init = parser.optional_init();
            into.push(ConfigVar { path, address, ty, init, span: parser.span_from(start) });
        });
    }

    /// `access = 'VAR_ACCESS' { name ':' variable ':' type [ 'READ_WRITE' | 'READ_ONLY' ] ';' } 'END_VAR'`.
    fn access_section(&mut self, into: &mut Vec<AccessVar>) {
        self.section(|parser| {
            let start = parser.span();
            let name = parser.name("the name of an access path");
            parser.expect(TokenKind::Colon, "the name of the access path");
            let target = parser.postfix();
            let ty = parser.declared_type("the variable");
            let writable = parser.eat_word("READ_WRITE").is_some();
            if !writable {
                parser.eat_word("READ_ONLY");
            }
            into.push(AccessVar { name, target, ty, writable, span: parser.span_from(start) });
        });
    }

    /// The entries of a VAR_CONFIG or VAR_ACCESS.
    fn section(&mut self, mut entry: impl FnMut(&mut Self)) {
        let open = self.bump();
        let (mut constant, mut retention) = (None, None);
        self.qualifiers(&mut constant, &mut retention);
        if let Some(span) = constant.or(retention.map(|(_, span)| span)) {
            self.report_at(&rules::BAD_QUALIFIER, span, "this section has no qualifiers");
        }
        loop {
            match self.kind() {
                TokenKind::Ident => {
                    entry(self);
                    self.end_declaration(Keyword::EndVar);
                }
                TokenKind::Semicolon | TokenKind::Keyword(Keyword::EndVar) => {
                    let end = self.at_keyword(Keyword::EndVar);
                    self.bump();
                    if end {
                        self.eat(TokenKind::Semicolon);
                        return;
                    }
                }
                TokenKind::End => return self.missing_end(Keyword::EndVar, self.slice(open), open),
                TokenKind::Keyword(word)
                    if word.starts_declaration()
                        || word.starts_section()
                        || matches!(word, Keyword::EndResource | Keyword::EndConfiguration) =>
                {
                    return self.missing_end(Keyword::EndVar, self.slice(open), open);
                }
                _ => {
                    self.report_expected("a path or `END_VAR`");
                    self.bump();
                    self.skip_declaration(Keyword::EndVar);
                }
            }
        }
    }
}

/// A resource without name and content.
fn empty_resource(span: Span) -> Resource {
    Resource {
        name: None,
        processor: None,
        globals: Vec::new(),
        tasks: Vec::new(),
        programs: Vec::new(),
        attributes: Vec::new(),
        span,
    }
}
