//! Misspelt reserved words: `ENDIF`, `ELSEIF`, `WHLE`, `END IF`.

use super::Parser;
use super::expr::literal_start;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// Longer words are not compared: no reserved word is near to them.
const MAX_COMPARED_LEN: usize = 24;

/// Whether someone who wrote `text` may well have meant `word` (upper case).
pub(super) fn is_like(text: &str, word: &str) -> bool {
    // Most words differ so plainly that nothing need be counted.
    let same_first = text.bytes().next().map(|byte| byte.to_ascii_uppercase()) == word.bytes().next();
    if !same_first || !text.is_ascii() || text.len() > MAX_COMPARED_LEN || text.len().abs_diff(word.len()) > 3 {
        return false;
    }
    let plain = |from: &str| from.bytes().filter(|&byte| byte != b'_').map(|byte| byte.to_ascii_uppercase()).collect();
    let (text, word): (Vec<u8>, Vec<u8>) = (plain(text), plain(word));
    let allowed = match word.len() {
        0..=2 => 0,
        3..=6 => 1,
        _ => 2,
    };
    text == word || distance(&text, &word) <= allowed
}

/// How many letters must be put in, taken out, replaced or swapped with their neighbour to make one word of the other.
pub(super) fn distance(a: &[u8], b: &[u8]) -> usize {
    let mut before_last: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for (i, &from) in a.iter().enumerate() {
        let mut row = Vec::with_capacity(b.len() + 1);
        row.push(i + 1);
        for (j, &to) in b.iter().enumerate() {
            let mut best = (last[j] + usize::from(from != to)).min(last[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && a[i - 1] == to && b[j - 1] == from && from != to {
                best = best.min(before_last[j - 1] + 1);
            }
            row.push(best);
        }
        before_last = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

/// The word that `END` and this word, written apart, were meant to be.
fn closing(word: Keyword) -> Option<Keyword> {
    Some(match word {
        Keyword::If => Keyword::EndIf,
        Keyword::Case => Keyword::EndCase,
        Keyword::For => Keyword::EndFor,
        Keyword::While => Keyword::EndWhile,
        Keyword::Repeat => Keyword::EndRepeat,
        Keyword::Var => Keyword::EndVar,
        Keyword::Type => Keyword::EndType,
        Keyword::Struct => Keyword::EndStruct,
        Keyword::Program => Keyword::EndProgram,
        Keyword::Function => Keyword::EndFunction,
        Keyword::FunctionBlock => Keyword::EndFunctionBlock,
        Keyword::Configuration => Keyword::EndConfiguration,
        _ => return None,
    })
}

/// Whether a statement, section or declaration begins or ends with the word: what a line may begin with.
fn leads(word: Keyword) -> bool {
    word.starts_statement()
        || word.starts_declaration()
        || word.starts_section()
        || matches!(word, Keyword::Else | Keyword::Elsif | Keyword::Until)
        || word.text().starts_with("END_")
}

/// Whether the word, were it spelt right, could stand before such a token: `foo;` is not a misspelt FOR.
fn goes_before(word: Keyword, next: TokenKind) -> bool {
    match word {
        Keyword::Exit | Keyword::Continue | Keyword::Return => next == TokenKind::Semicolon,
        Keyword::Else | Keyword::Repeat => next != TokenKind::Semicolon,
        _ if word.text().starts_with("END_") => true,
        _ => {
            matches!(next, TokenKind::Ident | TokenKind::Minus | TokenKind::LeftParen | TokenKind::Direct)
                || matches!(next, TokenKind::Keyword(Keyword::Not | Keyword::Constant))
                || literal_start(next)
        }
    }
}

impl Parser<'_> {
    /// Reports that the current name was meant to be a reserved word.
    pub(super) fn report_misspelt(&mut self, word: Keyword) {
        let message = format!("{} is no word of the language", self.found());
        let found = Diagnostic::new(&rules::MISSPELT_KEYWORD, self.span(), message);
        self.report(found.help(format!("did you mean `{}`?", word.text())));
    }

    /// Where a line begins with a name that cannot begin it: if it is near to a reserved word, reports that, makes the
    /// token that word, and says so.
    pub(super) fn mend_leading_word(&mut self) -> bool {
        if !self.at(TokenKind::Ident) {
            return false;
        }
        if self.at_word("END")
            && let TokenKind::Keyword(word) = self.kind_at(1)
            && let Some(closing) = closing(word)
        {
            let message = format!("`{}` is one word", closing.text());
            let span = self.span();
            self.report(Diagnostic::new(&rules::MISSPELT_KEYWORD, span, message).help("write it with `_`"));
            self.bump();
            self.reported_at = Some(self.pos);
            self.become_keyword(closing);
            return true;
        }
        if let Some(word) = self.bare_end() {
            self.report_misspelt(word);
            self.become_keyword(word);
            return true;
        }
        let text = self.slice(self.span());
        let next = self.kind_at(1);
        let meant = |word: Keyword| leads(word) && goes_before(word, next) && is_like(text, word.text());
        let Some(word) = Keyword::ALL.iter().copied().find(|&word| meant(word)) else {
            return false;
        };
        self.report_misspelt(word);
        self.become_keyword(word);
        true
    }

    /// Makes the current token a reserved word.
    fn become_keyword(&mut self, word: Keyword) {
        if let Some(token) = self.tokens.get_mut(self.pos) {
            token.kind = TokenKind::Keyword(word);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_counts_letters() {
        assert_eq!(distance(b"", b"abc"), 3);
        assert_eq!(distance(b"WHLE", b"WHILE"), 1);
        assert_eq!(distance(b"WHIEL", b"WHILE"), 1, "swapped neighbours are one mistake");
        assert_eq!(distance(b"kitten", b"sitting"), 3);
    }

    #[test]
    fn near_words_only() {
        assert!(is_like("ENDIF", "END_IF"));
        assert!(is_like("elseif", "ELSIF"));
        assert!(is_like("END_FUNCTIONBLOCK", "END_FUNCTION_BLOCK"));
        assert!(is_like("END_WHLE", "END_WHILE"));
        assert!(!is_like("IO", "IF"), "two letters are too few to guess");
        assert!(!is_like("motor", "FOR"));
        assert!(!is_like("größe", "FOR"));
    }
}
