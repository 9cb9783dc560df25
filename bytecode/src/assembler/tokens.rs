//! Lines of assembly text cut into words, each with its place.

use super::AssemblyError;

/// One word, or one quoted text without its quotes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Token {
    pub text: String,
    /// 1-based, in characters.
    pub column: usize,
    pub quoted: bool,
}

/// One line that is not empty.
#[derive(Debug, Clone)]
pub(super) struct Line {
    /// 1-based.
    pub number: usize,
    pub tokens: Vec<Token>,
}

impl Line {
    /// The first word; lines are never empty.
    pub fn keyword(&self) -> &str {
        self.tokens.first().filter(|token| !token.quoted).map_or("", |token| token.text.as_str())
    }

    pub fn words(&self) -> Words<'_> {
        Words { line: self, next: 0 }
    }

    pub fn error_at(&self, column: usize, message: impl Into<String>) -> AssemblyError {
        AssemblyError { line: self.number, column, message: message.into() }
    }
}

/// Cuts a text into its lines; comments (`;` to the end of the line) and empty lines are gone.
pub(super) fn split(text: &str) -> Result<Vec<Line>, AssemblyError> {
    let mut lines = Vec::new();
    for (index, raw) in text.lines().enumerate() {
        let line = Line { number: index + 1, tokens: Vec::new() };
        let tokens = split_line(&line, raw)?;
        if !tokens.is_empty() {
            lines.push(Line { tokens, ..line });
        }
    }
    Ok(lines)
}

fn split_line(line: &Line, raw: &str) -> Result<Vec<Token>, AssemblyError> {
    let mut tokens: Vec<Token> = Vec::new();
    let mut word: Option<Token> = None;
    let mut characters = raw.chars().zip(1..);
    while let Some((character, column)) = characters.next() {
        if character == '"' && word.is_none() {
            let text = quoted(line, column, &mut characters)?;
            tokens.push(Token { text, column, quoted: true });
        } else if character == ';' {
            break;
        } else if character.is_whitespace() {
            tokens.extend(word.take());
        } else {
            word.get_or_insert_with(|| Token { text: String::new(), column, quoted: false }).text.push(character);
        }
    }
    tokens.extend(word);
    Ok(tokens)
}

fn quoted(
    line: &Line,
    start: usize,
    characters: &mut impl Iterator<Item = (char, usize)>,
) -> Result<String, AssemblyError> {
    let mut text = String::new();
    while let Some((character, column)) = characters.next() {
        match character {
            '"' => return Ok(text),
            '\\' => text.push(escaped(line, column, characters)?),
            other => text.push(other),
        }
    }
    Err(line.error_at(start, "this text has no closing quote"))
}

fn escaped(
    line: &Line,
    column: usize,
    characters: &mut impl Iterator<Item = (char, usize)>,
) -> Result<char, AssemblyError> {
    match characters.next().map(|(character, _)| character) {
        Some('n') => Ok('\n'),
        Some('r') => Ok('\r'),
        Some('t') => Ok('\t'),
        Some('\'') => Ok('\''),
        Some('0') => Ok('\0'),
        Some(plain @ ('"' | '\\')) => Ok(plain),
        Some('u') => {
            let digits: String = characters
                .by_ref()
                .map(|(character, _)| character)
                .skip_while(|character| *character == '{')
                .take_while(|character| *character != '}')
                .take(8)
                .collect();
            let code = u32::from_str_radix(&digits, 16).ok().and_then(char::from_u32);
            code.ok_or_else(|| line.error_at(column, "`\\u{…}` needs the number of a character in hexadecimal digits"))
        }
        _ => Err(line.error_at(column, "unknown escape; known are \\n \\r \\t \\0 \\\" \\' \\\\ \\u{…}")),
    }
}

/// The text between quotes that [`split`] reads back.
pub(crate) fn quote(text: &str) -> String {
    format!("\"{}\"", text.escape_debug())
}

/// A cursor over the words of one line.
#[derive(Debug, Clone)]
pub(super) struct Words<'l> {
    line: &'l Line,
    next: usize,
}

impl<'l> Words<'l> {
    /// An error at the word read last.
    pub fn error(&self, message: impl Into<String>) -> AssemblyError {
        let column = self.line.tokens.get(self.next.saturating_sub(1)).map_or(1, |token| token.column);
        self.line.error_at(column, message)
    }

    /// The next word or text, which is a `what`.
    pub fn next(&mut self, what: &str) -> Result<&'l Token, AssemblyError> {
        let token = self.line.tokens.get(self.next).ok_or_else(|| self.error(format!("{what} is missing here")))?;
        self.next += 1;
        Ok(token)
    }

    /// The next word.
    pub fn word(&mut self, what: &str) -> Result<&'l str, AssemblyError> {
        let token = self.next(what)?;
        if token.quoted {
            return Err(self.error(format!("{what} is a word, not a quoted text")));
        }
        Ok(&token.text)
    }

    /// The next quoted text.
    pub fn text(&mut self, what: &str) -> Result<&'l str, AssemblyError> {
        let token = self.next(what)?;
        if !token.quoted {
            return Err(self.error(format!("{what} stands in quotes")));
        }
        Ok(&token.text)
    }

    /// The next word if there is one.
    pub fn peek(&self) -> Option<&'l str> {
        self.line.tokens.get(self.next).map(|token| token.text.as_str())
    }

    /// Whether the next word is this one; it is read then.
    pub fn take(&mut self, keyword: &str) -> bool {
        let found = self.peek() == Some(keyword);
        self.next += usize::from(found);
        found
    }

    /// The next word as a number, decimal or with 0x.
    pub fn number<T: TryFrom<i128>>(&mut self, what: &str) -> Result<T, AssemblyError> {
        let word = self.word(what)?;
        number(word).ok_or_else(|| self.error(format!("{what} can not be `{word}`")))
    }

    /// Pairs of hexadecimal digits as bytes.
    pub fn bytes(&mut self, what: &str) -> Result<Vec<u8>, AssemblyError> {
        let word = self.word(what)?;
        hex(word).ok_or_else(|| self.error(format!("{what} is pairs of hexadecimal digits")))
    }

    /// Nothing may be left.
    pub fn end(&mut self) -> Result<(), AssemblyError> {
        match self.line.tokens.get(self.next) {
            None => Ok(()),
            Some(token) => Err(self.line.error_at(token.column, format!("`{}` is one word too many", token.text))),
        }
    }
}

/// A number, decimal or with 0x.
pub(super) fn number<T: TryFrom<i128>>(word: &str) -> Option<T> {
    let value = match word.strip_prefix("0x") {
        // A sign behind 0x is no number.
        Some(digits) if digits.starts_with(['+', '-']) => None,
        Some(digits) => i128::from_str_radix(digits, 16).ok(),
        None => word.parse().ok(),
    };
    value.and_then(|value: i128| T::try_from(value).ok())
}

fn hex(word: &str) -> Option<Vec<u8>> {
    let digits: Option<Vec<u8>> =
        word.chars().map(|digit| digit.to_digit(16).and_then(|d| u8::try_from(d).ok())).collect();
    let digits = digits?;
    let (pairs, rest) = digits.as_chunks::<2>();
    rest.is_empty().then(|| pairs.iter().map(|[high, low]| high << 4 | low).collect())
}

/// Bytes as hexadecimal digits.
pub(crate) fn to_hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::with_capacity(bytes.len() * 2), |mut text, byte| {
        // Writing to a String does not fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
