//! What those who know another language meant: help for tokens that stand where Structured Text has none.

use super::Parser;
use super::expr::literal_start;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// How the text at a mistake begins, and what Structured Text has for it; the first that fits.
const FOREIGN: [(&str, &str); 20] = [
    ("++", "add one with `a := a + 1`"),
    ("--", "a comment is `// …` or `(* … *)`; subtract one with `a := a - 1`"),
    ("+=", "write `a := a + …`"),
    ("-=", "write `a := a - …`"),
    ("*=", "write `a := a * …`"),
    ("/=", "write `a := a / …`"),
    ("%", "the remainder of a division is `MOD`"),
    ("<<", "shift with `SHL(a, n)`"),
    (">>", "shift with `SHR(a, n)`"),
    ("=>", "assign with `:=`; `=>` takes an output of a call"),
    ("#include", "nothing is included: name all files, or list them in khz.toml"),
    ("#", "a comment is `// …` or `(* … *)`"),
    ("?", "choose with `SEL(condition, if_false, if_true)`"),
    ("..", "a range of a loop is `1 TO 3`"),
    (",", "the decimal point is `.`"),
    (")", "leave it out, or open it with `(`"),
    ("void ", "a program is `PROGRAM name … END_PROGRAM`"),
    ("int ", "a program is `PROGRAM name … END_PROGRAM`"),
    ("[", "an array is declared `ARRAY[0..9] OF INT`"),
    ("(", "bounds of arrays stand in `[ ]`"),
];

/// Words of other languages that stand alone as statements.
const WORDS: [(&str, &str); 4] = [
    ("BREAK", "leave a loop with `EXIT;`"),
    ("PASS", "an empty statement is `;`"),
    ("END", "say what ends: `END_IF;`, `END_FOR;`, `END_WHILE;`, `END_CASE;`"),
    ("STOP", "leave a program with `RETURN;`"),
];

impl Parser<'_> {
    /// What the text at the current token is in other languages.
    pub(super) fn foreign_hint(&self) -> Option<&'static str> {
        let text = self.text.get(self.span().start as usize..)?;
        let found = FOREIGN.iter().find(|(start, _)| text.starts_with(start)).map(|(_, hint)| *hint);
        // Of `<<` the first half has been read as an operator.
        let before = self.text.get(self.prev_span().start as usize..)?;
        let doubled = ["<<", ">>"].iter().find(|twice| before.starts_with(**twice));
        let doubled = doubled.and_then(|twice| FOREIGN.iter().find(|(start, _)| start == twice));
        found.or(doubled.map(|(_, hint)| *hint))
    }

    /// What a word that stands alone may have been meant to be.
    pub(super) fn word_hint(&self, text: &str) -> Option<&'static str> {
        WORDS.iter().find(|(word, _)| word.eq_ignore_ascii_case(text)).map(|(_, hint)| *hint)
    }

    /// An operator behind the beginning of a statement: `a + 1;` computes and keeps nothing, `a += 1` is of another language. Says whether it was
    /// reported.
    pub(super) fn loose_expression(&mut self, begin: Span) -> bool {
        let operator = matches!(
            self.kind(),
            TokenKind::Plus
                | TokenKind::Minus
                | TokenKind::Star
                | TokenKind::Slash
                | TokenKind::Power
                | TokenKind::Less
                | TokenKind::Greater
                | TokenKind::LessEqual
                | TokenKind::GreaterEqual
                | TokenKind::NotEqual
                | TokenKind::Ampersand
                | TokenKind::Keyword(Keyword::And | Keyword::Or | Keyword::Xor | Keyword::Mod)
        );
        if !operator {
            return false;
        }
        let span = begin.to(self.span());
        let mut found = Diagnostic::new(&rules::NO_STATEMENT, span, "this computes a value and does nothing with it");
        let hint = self.foreign_hint();
        found = found.help(hint.unwrap_or("assign it to a variable: `name := …;`"));
        self.report(found);
        self.bump();
        if hint.is_none() && !self.on_new_line() {
            self.expression();
        }
        // The `;` is for who reads the statement; of another language's operator nothing is known before it.
        while hint.is_some() && !self.on_new_line() && !matches!(self.kind(), TokenKind::Semicolon | TokenKind::End) {
            self.bump();
        }
        true
    }

    /// `END;`: where one kind of statement is open, that is what ends.
    pub(super) fn bare_end(&mut self) -> Option<Keyword> {
        if !(self.at_word("END") && self.kind_at(1) == TokenKind::Semicolon) {
            return None;
        }
        let open = &self.open;
        let all = [
            (open.ifs, Keyword::EndIf),
            (open.cases, Keyword::EndCase),
            (open.fors, Keyword::EndFor),
            (open.whiles, Keyword::EndWhile),
        ];
        let mut all = all.into_iter().filter(|(count, _)| *count > 0);
        match (all.next(), all.next()) {
            (Some((_, word)), None) => Some(word),
            _ => None,
        }
    }

    /// `r ^ 2`: where an operand follows, `^` is a power of another language and follows no reference.
    pub(super) fn at_foreign_power(&self) -> bool {
        let next = self.kind_at(1);
        self.at(TokenKind::Caret) && (literal_start(next) || matches!(next, TokenKind::Ident | TokenKind::LeftParen))
    }
}
