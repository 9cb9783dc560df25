//! Unit tests in ST (`docs/testing.md`). Their words are compared where they can stand and are ordinary names everywhere else: at
//! the top level, where no name can stand, and among the statements of a test.

use super::Parser;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{Arg, ArgKind, Expr, ExprKind, Ident, StmtKind, Test, TestPart};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// Words that begin a part of a test file, and the words that end it.
const PARTS: [(&str, &str); 5] = [
    ("TEST", "END_TEST"),
    ("SETUP", "END_SETUP"),
    ("TEARDOWN", "END_TEARDOWN"),
    ("TEST_PROGRAM", "END_TEST_PROGRAM"),
    ("TEST_FUNCTION_BLOCK", "END_TEST_FUNCTION_BLOCK"),
];

impl Parser<'_> {
    /// Whether a part of a test file begins here.
    pub(super) fn at_test_declaration(&self) -> bool {
        self.part_here().is_some()
    }

    fn part_here(&self) -> Option<(&'static str, &'static str)> {
        if !self.at(TokenKind::Ident) {
            return None;
        }
        let next = self.kind_at(1);
        PARTS.iter().copied().find(|(word, _)| {
            let fits = match *word {
                "TEST" => matches!(next, TokenKind::String | TokenKind::WString | TokenKind::UnterminatedString),
                "SETUP" | "TEARDOWN" => {
                    !matches!(next, TokenKind::Assign | TokenKind::Colon | TokenKind::LeftParen | TokenKind::Dot)
                }
                _ => true,
            };
            fits && self.at_word(word)
        })
    }

    /// Whether the current token ends the test whose statements are read.
    pub(super) fn at_test_end(&self) -> bool {
        self.in_test && PARTS.iter().any(|(_, end)| self.at_word(end))
    }

    /// ```text
    /// test = 'TEST' string part 'END_TEST' | 'SETUP' part 'END_SETUP' | 'TEARDOWN' part 'END_TEARDOWN'
    ///      | 'TEST_PROGRAM' name part 'END_TEST_PROGRAM' | 'TEST_FUNCTION_BLOCK' name part 'END_TEST_FUNCTION_BLOCK'
    /// ```
    ///
    /// Says whether there was one.
    pub(super) fn test_declaration(&mut self) -> bool {
        let Some((opener, end)) = self.part_here() else { return false };
        let open = self.bump();
        match opener {
            "SETUP" | "TEARDOWN" => {
                let part = self.test_part(opener, end, open);
                let slot = if opener == "SETUP" { &mut self.suite.setup } else { &mut self.suite.teardown };
                let first = slot.as_ref().map(|first| first.span);
                slot.get_or_insert(part);
                if let Some(first) = first {
                    let found = Diagnostic::new(&rules::BAD_TEST, open, format!("a file has one {opener}"));
                    self.push(found.label(first, "the first is here"));
                }
            }
            "TEST" => {
                let name_span = self.bump();
                let name = name_of(self.slice(name_span));
                let part = self.test_part(opener, end, open);
                self.add_test(Test { name, name_span, in_suite: true, part });
            }
            _ => {
                let name = self.name("the name of the test");
                self.eat(TokenKind::Semicolon);
                let part = self.test_part(opener, end, open);
                let text = self.names.text(name.spelling).to_owned();
                self.add_test(Test { name: text, name_span: name.span, in_suite: false, part });
            }
        }
        true
    }

    fn add_test(&mut self, test: Test) {
        if test.name.is_empty() {
            let found = Diagnostic::new(&rules::BAD_TEST, test.name_span, "a test has a name");
            self.push(found.help("say in it what holds: `TEST 'the motor stops at its limit'`"));
        }
        self.suite.tests.push(test);
    }

    /// `part = { section } block`, to behind its end.
    fn test_part(&mut self, opener: &'static str, end: &'static str, open: Span) -> TestPart {
        let outer = std::mem::replace(&mut self.in_test, true);
        let mut sections = self.sections();
        let body = self.block();
        sections.append(&mut self.late_sections);
        if self.eat_word(end).is_none() {
            self.report_missing(&format!("`{end}`"), &format!("the {opener}"));
            // The end of another part or of a POU was meant to be this one.
            if self.at_test_end() || self.keyword().is_some_and(Keyword::ends_pou) {
                self.bump();
            }
        }
        self.in_test = outer;
        let span = self.span_from(open);
        self.eat(TokenKind::Semicolon);
        TestPart { sections, body, span }
    }

    /// Whether a MOCK statement begins here.
    pub(super) fn at_mock(&self) -> bool {
        let mocks = || self.at_word("MOCK") || self.at_word("MOCK_FUNCTION");
        self.in_test && self.kind_at(1) == TokenKind::Ident && mocks()
    }

    /// ```text
    /// mock = 'MOCK' variable | 'MOCK_FUNCTION' name 'RETURNS' expression
    /// ```
    pub(super) fn mock_statement(&mut self) -> StmtKind {
        let word = self.take_name();
        if self.slice(word.span).eq_ignore_ascii_case("MOCK") {
            self.suite.mocks = true;
            let instance = self.postfix();
            return self.pseudo_call(word, vec![instance]);
        }
        let function = self.take_name();
        self.suite.mocked_functions.push(function);
        if self.eat_word("RETURNS").is_none() {
            self.report_missing("`RETURNS` and a value", "the function");
            return StmtKind::Error;
        }
        let value = self.expression();
        let name = self.expr_node(0, function.span, ExprKind::Name(function));
        self.pseudo_call(word, vec![name, value])
    }

    fn pseudo_call(&mut self, word: Ident, values: Vec<Expr>) -> StmtKind {
        let height = values.iter().map(|value| self.height(value)).max().unwrap_or(0);
        let args = values.into_iter().map(|value| Arg { span: value.span, kind: ArgKind::Positional(value) }).collect();
        let callee = Box::new(self.expr_node(0, word.span, ExprKind::Name(word)));
        let span = self.span_from(word.span);
        StmtKind::Call(self.expr_node(height, span, ExprKind::Call { callee, args }))
    }
}

/// What a quoted name says: without its quotes, `$'` being a quote.
fn name_of(quoted: &str) -> String {
    let quote = quoted.chars().next().unwrap_or('\'');
    let inside = quoted.strip_prefix(quote).unwrap_or(quoted);
    let inside = inside.strip_suffix(quote).unwrap_or(inside);
    let mut name = String::with_capacity(inside.len());
    let mut escaped = false;
    for c in inside.chars() {
        let begins = c == '$' && !escaped;
        // A name is one line of reports, whatever stands in it.
        name.extend((!begins).then_some(if c.is_control() { ' ' } else { c }));
        escaped = begins;
    }
    name.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::name_of;

    #[test]
    fn names_lose_their_quotes() {
        assert_eq!(name_of("'it$'s \"on\"'"), "it's \"on\"");
        assert_eq!(name_of("\"costs 5 $$\""), "costs 5 $");
        assert_eq!(name_of("'unterminated"), "unterminated");
        assert_eq!(name_of(""), "");
    }
}
