//! From text to tokens (IEC 61131-3 clause 6.1 to 6.3).
//!
//! The lexer never fails and loses nothing: comments and pragmas are tokens, a character that belongs nowhere is a token
//! of kind [`TokenKind::Unknown`], and what is not closed has a kind of its own. Numbers, times and addresses are lexed
//! generously (`16#XY` is one token) so that the parser can say what is wrong with them in one message.

use super::keyword::Keyword;
use logos::{Lexer, Logos};

/// A token: its kind and the bytes `start..end` of the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token {
    /// What it is.
    pub kind: TokenKind,
    /// Offset of its first byte.
    pub start: u32,
    /// Offset after its last byte.
    pub end: u32,
}

/// What the callbacks tell [`lex`].
#[derive(Debug, Default)]
pub struct LexState {
    /// The token just made is not closed.
    unterminated: bool,
    /// There is no `}` in the rest of the text: looking for it once is enough.
    no_closing_brace: bool,
}

/// Kinds of tokens.
#[derive(Logos, Clone, Copy, Debug, PartialEq, Eq)]
#[logos(extras = LexState)]
#[logos(skip r"[ \t\r\n\x0B\x0C]+")]
pub enum TokenKind {
    /// A name. Letters beyond ASCII are lexed, for the parser to refuse with a clear message.
    #[regex(
        r"[A-Za-z_\u{C0}-\u{24F}\u{370}-\u{52F}\u{4E00}-\u{9FFF}][A-Za-z0-9_\u{C0}-\u{24F}\u{370}-\u{52F}\u{4E00}-\u{9FFF}]*"
    )]
    Ident,
    /// A reserved word.
    Keyword(Keyword),

    /// `(* … *)` or `/* … */`, which nest, or `// …`.
    #[token("(*", nested_round_comment)]
    #[token("/*", nested_slash_comment)]
    #[regex(r"//[^\n]*", allow_greedy = true)]
    Comment,
    /// A comment without its end.
    UnterminatedComment,
    /// `{ … }`.
    #[token("{", pragma)]
    Pragma,
    /// A pragma without its end.
    UnterminatedPragma,

    /// `1_000`.
    #[regex(r"[0-9][0-9_]*", priority = 5)]
    Int,
    /// `16#FF`.
    #[regex(r"[0-9][0-9_]*#[0-9A-Za-z_]*")]
    BasedInt,
    /// `1.5`, `1.5E-3`, `1E6`.
    #[regex(r"[0-9][0-9_]*\.[0-9][0-9_]*([eE][+-]?[0-9][0-9_]*)?", priority = 6)]
    #[regex(r"[0-9][0-9_]*[eE][+-]?[0-9][0-9_]*", priority = 6)]
    Real,
    /// `12abc`: neither number nor name.
    #[regex(r"[0-9][0-9_]*(\.[0-9][0-9_]*)?[A-Za-z][A-Za-z0-9_]*", priority = 2)]
    MalformedNumber,
    /// `T#1d2h`, `LTIME#-1.5s`.
    #[regex(r"(?i:L?TIME|L?T)#[+-]?[0-9][0-9A-Za-z_]*(\.[0-9A-Za-z_]+)*")]
    Time,
    /// `D#2024-02-29`.
    #[regex(r"(?i:L?DATE|L?D)#[0-9]+(-[0-9]+)*")]
    Date,
    /// `TOD#12:30:00.5`.
    #[regex(r"(?i:L?TIME_OF_DAY|L?TOD)#[0-9]+(:[0-9]+)*(\.[0-9]+)?")]
    TimeOfDay,
    /// `DT#2024-02-29-12:30:00`.
    #[regex(r"(?i:L?DATE_AND_TIME|L?DT)#[0-9]+(-[0-9]+)*(:[0-9]+)*(\.[0-9]+)?")]
    DateAndTime,
    /// `'text'`.
    #[token("'", single_quoted)]
    String,
    /// `"text"`.
    #[token("\"", double_quoted)]
    WString,
    /// A string of either kind that does not end on its line.
    UnterminatedString,
    /// `%IX0.0`, `%Q*`.
    #[regex(r"%[IQMiqm][XBWDLxbwdl]?([0-9]+(\.[0-9]+)*|\*)")]
    Direct,
    /// `%X3` after a dot: a part of a bit string.
    #[regex(r"%[XBWDLxbwdl][0-9]+")]
    Part,
    /// `%` with something else after it.
    #[regex(r"%[A-Za-z0-9_.*]*", priority = 1)]
    MalformedDirect,

    /// `:=`.
    #[token(":=")]
    Assign,
    /// `=>`.
    #[token("=>")]
    Arrow,
    /// `=`.
    #[token("=")]
    Equal,
    /// `<>`.
    #[token("<>")]
    NotEqual,
    /// `<`.
    #[token("<")]
    Less,
    /// `>`.
    #[token(">")]
    Greater,
    /// `<=`.
    #[token("<=")]
    LessEqual,
    /// `>=`.
    #[token(">=")]
    GreaterEqual,
    /// `+`.
    #[token("+")]
    Plus,
    /// `-`.
    #[token("-")]
    Minus,
    /// `*`.
    #[token("*")]
    Star,
    /// `**`.
    #[token("**")]
    Power,
    /// `/`.
    #[token("/")]
    Slash,
    /// `&`.
    #[token("&")]
    Ampersand,
    /// `..`.
    #[token("..")]
    DotDot,
    /// `.`.
    #[token(".")]
    Dot,
    /// `,`.
    #[token(",")]
    Comma,
    /// `;`.
    #[token(";")]
    Semicolon,
    /// `:`.
    #[token(":")]
    Colon,
    /// `(`.
    #[token("(")]
    LeftParen,
    /// `)`.
    #[token(")")]
    RightParen,
    /// `[`.
    #[token("[")]
    LeftBracket,
    /// `]`.
    #[token("]")]
    RightBracket,
    /// `^`.
    #[token("^")]
    Caret,
    /// `#`.
    #[token("#")]
    Hash,
    /// `@`.
    #[token("@")]
    At,
    /// An operator of another language: `==`, `!=`, `&&`, `||`, `!`.
    #[token("==")]
    #[token("!=")]
    #[token("&&")]
    #[token("||")]
    #[token("!")]
    Foreign,

    /// A character that belongs nowhere.
    Unknown,
    /// The end of the text; [`lex`] never gives it, the parser sees it behind the last token.
    End,
}

impl TokenKind {
    /// Whether the grammar does not see it: comments and pragmas.
    pub fn is_trivia(self) -> bool {
        matches!(self, Self::Comment | Self::UnterminatedComment | Self::Pragma | Self::UnterminatedPragma)
    }

    /// Whether it is a literal that was written to its end; TRUE and FALSE are keywords.
    pub fn is_literal(self) -> bool {
        matches!(
            self,
            Self::Int
                | Self::BasedInt
                | Self::Real
                | Self::MalformedNumber
                | Self::Time
                | Self::Date
                | Self::TimeOfDay
                | Self::DateAndTime
                | Self::String
                | Self::WString
        )
    }

    /// How messages name the kind.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Ident => "a name",
            Self::Keyword(word) => word.text(),
            Self::Comment | Self::UnterminatedComment => "a comment",
            Self::Pragma | Self::UnterminatedPragma => "a pragma",
            Self::Int | Self::BasedInt | Self::Real | Self::MalformedNumber => "a number",
            Self::Time => "a time",
            Self::Date | Self::TimeOfDay | Self::DateAndTime => "a date or time of day",
            Self::String | Self::WString | Self::UnterminatedString => "a string",
            Self::Direct | Self::MalformedDirect => "a direct address",
            Self::Part => "a partial access",
            Self::Assign => "`:=`",
            Self::Arrow => "`=>`",
            Self::Equal => "`=`",
            Self::NotEqual => "`<>`",
            Self::Less => "`<`",
            Self::Greater => "`>`",
            Self::LessEqual => "`<=`",
            Self::GreaterEqual => "`>=`",
            Self::Plus => "`+`",
            Self::Minus => "`-`",
            Self::Star => "`*`",
            Self::Power => "`**`",
            Self::Slash => "`/`",
            Self::Ampersand => "`&`",
            Self::DotDot => "`..`",
            Self::Dot => "`.`",
            Self::Comma => "`,`",
            Self::Semicolon => "`;`",
            Self::Colon => "`:`",
            Self::LeftParen => "`(`",
            Self::RightParen => "`)`",
            Self::LeftBracket => "`[`",
            Self::RightBracket => "`]`",
            Self::Caret => "`^`",
            Self::Hash => "`#`",
            Self::At => "`@`",
            Self::Foreign => "an operator of another language",
            Self::Unknown => "a character that belongs nowhere",
            Self::End => "the end of the file",
        }
    }
}

/// All tokens of a text in order, comments and pragmas included. White space is what lies between them.
///
/// Texts of 4 GiB and more do not occur: [`crate::source::MAX_FILE_BYTES`] caps them.
pub fn lex(text: &str) -> Vec<Token> {
    let mut lexer = TokenKind::lexer(text);
    let mut tokens: Vec<Token> = Vec::with_capacity(text.len() / 4);
    while let Some(result) = lexer.next() {
        let unterminated = std::mem::take(&mut lexer.extras.unterminated);
        let kind = match result {
            Ok(TokenKind::Ident) => Keyword::lookup(lexer.slice()).map_or(TokenKind::Ident, TokenKind::Keyword),
            Ok(TokenKind::Comment) if unterminated => TokenKind::UnterminatedComment,
            Ok(TokenKind::Pragma) if unterminated => TokenKind::UnterminatedPragma,
            Ok(TokenKind::String | TokenKind::WString) if unterminated => TokenKind::UnterminatedString,
            Ok(kind) => kind,
            Err(()) => TokenKind::Unknown,
        };
        let span = lexer.span();
        let start = u32::try_from(span.start).unwrap_or(u32::MAX);
        let end = u32::try_from(span.end).unwrap_or(u32::MAX);
        // A run of noise is one token, so that it is one message.
        if kind == TokenKind::Unknown
            && let Some(last) = tokens.last_mut()
            && last.kind == TokenKind::Unknown
            && last.end == start
        {
            last.end = end;
            continue;
        }
        tokens.push(Token { kind, start, end });
    }
    tokens
}

fn nested_round_comment(lexer: &mut Lexer<TokenKind>) -> bool {
    nested_comment(lexer, *b"(*", *b"*)")
}

fn nested_slash_comment(lexer: &mut Lexer<TokenKind>) -> bool {
    nested_comment(lexer, *b"/*", *b"*/")
}

/// Moves behind the end of a comment whose opening has been read. Comments of one kind nest; the other kind is text.
fn nested_comment(lexer: &mut Lexer<TokenKind>, open: [u8; 2], close: [u8; 2]) -> bool {
    let rest = lexer.remainder().as_bytes();
    let mut depth = 1_u32;
    let mut at = 0;
    while let Some(pair) = rest.get(at..at + 2) {
        if pair == close {
            depth -= 1;
            at += 2;
            if depth == 0 {
                lexer.bump(at);
                return true;
            }
        } else if pair == open {
            // The text is capped far below the 8 GiB that an overflow would take.
            depth = depth.saturating_add(1);
            at += 2;
        } else {
            at += 1;
        }
    }
    lexer.extras.unterminated = true;
    lexer.bump(rest.len());
    true
}

/// Moves behind the `}`. A pragma that is not closed ends with its line.
fn pragma(lexer: &mut Lexer<TokenKind>) -> bool {
    let rest = lexer.remainder();
    let found = if lexer.extras.no_closing_brace { None } else { rest.find('}') };
    if let Some(at) = found {
        lexer.bump(at + 1);
        return true;
    }
    lexer.extras.no_closing_brace = true;
    lexer.extras.unterminated = true;
    lexer.bump(rest.find(['\r', '\n']).unwrap_or(rest.len()));
    true
}

fn single_quoted(lexer: &mut Lexer<TokenKind>) -> bool {
    quoted(lexer, b'\'')
}

fn double_quoted(lexer: &mut Lexer<TokenKind>) -> bool {
    quoted(lexer, b'"')
}

/// Moves behind the closing quote. A string that is not closed ends with its line.
fn quoted(lexer: &mut Lexer<TokenKind>, quote: u8) -> bool {
    let rest = lexer.remainder().as_bytes();
    let mut at = 0;
    while let Some(&byte) = rest.get(at) {
        if byte == quote {
            lexer.bump(at + 1);
            return true;
        }
        if matches!(byte, b'\r' | b'\n') {
            break;
        }
        // After `$` any ASCII character on the line is taken, a quote too.
        let escapes = byte == b'$' && rest.get(at + 1).is_some_and(|next| !matches!(next, b'\r' | b'\n' | 0x80..));
        at += if escapes { 2 } else { 1 };
    }
    lexer.extras.unterminated = true;
    lexer.bump(at);
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kinds and texts of all tokens.
    fn all(text: &str) -> Vec<(TokenKind, &str)> {
        lex(text).iter().map(|token| (token.kind, &text[token.start as usize..token.end as usize])).collect()
    }

    fn kinds(text: &str) -> Vec<TokenKind> {
        lex(text).iter().map(|token| token.kind).collect()
    }

    #[test]
    fn ranges_are_no_reals() {
        use TokenKind::{DotDot, Int, Real};
        assert_eq!(all("0..255"), [(Int, "0"), (DotDot, ".."), (Int, "255")]);
        assert_eq!(all("0.5"), [(Real, "0.5")]);
        assert_eq!(all("1_0.5E-3"), [(Real, "1_0.5E-3")]);
        assert_eq!(all("1E6"), [(Real, "1E6")]);
        assert_eq!(kinds("1.E6"), [Int, TokenKind::Dot, TokenKind::Ident]);
    }

    #[test]
    fn numbers_and_typed_literals() {
        use TokenKind::{BasedInt, Hash, Ident, Int, MalformedNumber, Minus};
        assert_eq!(all("INT#16#7F"), [(Ident, "INT"), (Hash, "#"), (BasedInt, "16#7F")]);
        assert_eq!(all("INT#-5"), [(Ident, "INT"), (Hash, "#"), (Minus, "-"), (Int, "5")]);
        assert_eq!(all("16#XY"), [(BasedInt, "16#XY")]);
        assert_eq!(all("12abc"), [(MalformedNumber, "12abc")]);
        assert_eq!(all("1.5abc"), [(MalformedNumber, "1.5abc")]);
        assert_eq!(all("2#1010_1010"), [(BasedInt, "2#1010_1010")]);
    }

    #[test]
    fn times_and_dates() {
        use TokenKind::{Date, DateAndTime, Ident, Time, TimeOfDay};
        for text in ["T#1d2h3m4s5ms6us7ns", "t#-1.5s", "TIME#5_000ms", "LT#1ns", "LTIME#1h", "ltime#+3s"] {
            assert_eq!(all(text), [(Time, text)]);
        }
        for text in ["D#2024-02-29", "date#1970-1-1", "LD#2024-02-29", "LDATE#2024-02-29"] {
            assert_eq!(all(text), [(Date, text)]);
        }
        for text in ["TOD#12:30:00.5", "TIME_OF_DAY#1:2:3", "LTOD#23:59:59.999999999", "LTIME_OF_DAY#0:0:0"] {
            assert_eq!(all(text), [(TimeOfDay, text)]);
        }
        for text in ["DT#2024-02-29-12:30:00.25", "DATE_AND_TIME#2024-2-9-1:2:3", "LDT#2024-02-29-0:0:0"] {
            assert_eq!(all(text), [(DateAndTime, text)]);
        }
        assert_eq!(all("D#2024-02-29-d"), [(Date, "D#2024-02-29"), (TokenKind::Minus, "-"), (Ident, "d")]);
        assert_eq!(kinds("T#red"), [Ident, TokenKind::Hash, Ident], "a type may be named T");
        assert_eq!(kinds("time_of_day"), [Ident]);
    }

    #[test]
    fn comments_nest() {
        use TokenKind::{Comment, Ident, UnterminatedComment};
        assert_eq!(all("a (* (* x *) /* *) b"), [(Ident, "a"), (Comment, "(* (* x *) /* *)"), (Ident, "b")]);
        assert_eq!(all("/* /* *) */ */x"), [(Comment, "/* /* *) */ */"), (Ident, "x")]);
        assert_eq!(all("// (* \nx"), [(Comment, "// (* "), (Ident, "x")]);
        assert_eq!(all("(*) x"), [(UnterminatedComment, "(*) x")]);
        assert_eq!(all("(*"), [(UnterminatedComment, "(*")]);
        assert_eq!(all("(**)"), [(Comment, "(**)")]);
    }

    #[test]
    fn strings_and_pragmas() {
        use TokenKind::{Ident, Pragma, String, UnterminatedPragma, UnterminatedString, WString};
        assert_eq!(all("'a$'b' x"), [(String, "'a$'b'"), (Ident, "x")]);
        assert_eq!(all("'a$$' x"), [(String, "'a$$'"), (Ident, "x")]);
        assert_eq!(all("\"a'b$\"\""), [(WString, "\"a'b$\"\"")]);
        assert_eq!(all("'abc\nx"), [(UnterminatedString, "'abc"), (Ident, "x")]);
        assert_eq!(all("'abc$"), [(UnterminatedString, "'abc$")]);
        assert_eq!(all("'$ä'"), [(String, "'$ä'")]);
        assert_eq!(all("{attribute 'a' := 'b'}x"), [(Pragma, "{attribute 'a' := 'b'}"), (Ident, "x")]);
        assert_eq!(all("{a\nx"), [(UnterminatedPragma, "{a"), (Ident, "x")]);
    }

    #[test]
    fn direct_addresses() {
        use TokenKind::{Direct, Dot, Ident, MalformedDirect, Part};
        for text in ["%IX0.0", "%QW3", "%md4", "%MB7", "%IL8", "%I0.0", "%I*", "%QX1.2.3"] {
            assert_eq!(all(text), [(Direct, text)]);
        }
        assert_eq!(all("w.%X3"), [(Ident, "w"), (Dot, "."), (Part, "%X3")]);
        assert_eq!(all("%ZX0"), [(MalformedDirect, "%ZX0")]);
        assert_eq!(all("%"), [(MalformedDirect, "%")]);
    }

    #[test]
    fn words_operators_and_noise() {
        use TokenKind::{Arrow, Assign, Foreign, GreaterEqual, Ident, Keyword as Word, NotEqual, Power, Star, Unknown};
        assert_eq!(kinds("eNd_If end_iff"), [Word(Keyword::EndIf), Ident]);
        assert_eq!(kinds(":= => >= <> ** *"), [Assign, Arrow, GreaterEqual, NotEqual, Power, Star]);
        assert_eq!(kinds("== != && || !"), [Foreign; 5]);
        assert_eq!(all("größe"), [(Ident, "größe")]);
        assert_eq!(all("a ???\u{A0}\u{2014}b"), [(Ident, "a"), (Unknown, "???\u{A0}\u{2014}"), (Ident, "b")]);
    }
}
