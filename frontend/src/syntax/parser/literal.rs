//! Literals and direct addresses (IEC 61131-3 6.3 and 6.5.5): the value of a token.

use khz_machine::semantics::{DAY_NS, parse_date, parse_date_and_time, parse_time_of_day};

use super::Parser;
use super::expr::access_size;
use crate::diagnostics::{Diagnostic, Rule, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{Area, DirectAddress, Ident, Literal, LiteralValue};
use crate::syntax::keyword::Keyword;
use crate::syntax::lexer::TokenKind;

/// What is wrong with a literal: the rule, the message, the help.
type Fault = (&'static Rule, String, Option<&'static str>);

/// What a number with letters behind it was meant to be.
fn malformed_hint(text: &str) -> Option<&'static str> {
    let lower = text.to_ascii_lowercase();
    let unit = lower.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.' || c == '_');
    Some(match unit {
        _ if lower.starts_with("0x") => "hexadecimal numbers are written `16#1F`",
        _ if lower.starts_with("0b") => "binary numbers are written `2#101`",
        _ if lower.starts_with("0o") => "octal numbers are written `8#17`",
        "d" | "h" | "m" | "s" | "ms" | "us" | "ns" => "durations are written `T#5s`",
        _ => "a name begins with a letter or `_`, and units stand in a comment",
    })
}

impl Parser<'_> {
    /// `literal = [ sign ] token`; the type and its `#` have been read. None if it has been reported.
    pub(super) fn literal(&mut self, ty: Option<Ident>) -> Option<Literal> {
        let mut negative = false;
        if matches!(self.kind(), TokenKind::Minus | TokenKind::Plus) {
            negative = self.at(TokenKind::Minus);
            self.bump();
        }
        let kind = self.kind();
        let span = self.bump();
        let text = self.slice(span);
        let value = match kind {
            TokenKind::Int => integer(text, negative),
            TokenKind::BasedInt => based_integer(text, negative),
            TokenKind::Real => real(text, negative),
            TokenKind::Time => time(text),
            TokenKind::Date | TokenKind::TimeOfDay | TokenKind::DateAndTime => date(kind, text),
            TokenKind::Keyword(word) => Ok(LiteralValue::Bool(word == Keyword::True)),
            TokenKind::String => string(text),
            TokenKind::WString => wide_string(text),
            // Reported by the lexer's caller.
            TokenKind::UnterminatedString => return None,
            _ => Err((&rules::BAD_NUMBER, format!("`{text}` is neither a number nor a name"), malformed_hint(text))),
        };
        match value {
            Ok(value) => Some(Literal { ty, value: as_bool(ty.map(|ty| self.slice(ty.span)), value) }),
            Err(fault) => {
                self.report_fault(span, fault);
                None
            }
        }
    }

    fn report_fault(&mut self, span: Span, (rule, message, help): Fault) {
        let mut found = Diagnostic::new(rule, span, message);
        found.help = help.map(str::to_owned);
        self.push(found);
    }

    /// `direct-address = '%' area [ size ] ( integer { '.' integer } | '*' )`. None if it has been reported.
    pub(super) fn direct_address(&mut self) -> Option<DirectAddress> {
        let well_formed = self.at(TokenKind::Direct);
        let span = self.bump();
        let text = self.slice(span);
        let address = if well_formed { address(text, span) } else { None };
        if address.is_none() {
            let message = format!("`{text}` is no address");
            let help = "addresses look like `%IX0.0`, `%QW3`, `%MD4` or `%I*`; the remainder of a division is `MOD`";
            self.report_fault(span, (&rules::BAD_ADDRESS, message, Some(help)));
        }
        address
    }
}

/// `BOOL#1` is TRUE: the checker need not know two spellings.
fn as_bool(ty: Option<&str>, value: LiteralValue) -> LiteralValue {
    match value {
        LiteralValue::Int { negative: false, magnitude: value @ (0 | 1), .. }
            if ty.is_some_and(|ty| ty.eq_ignore_ascii_case("BOOL")) =>
        {
            LiteralValue::Bool(value == 1)
        }
        value => value,
    }
}

fn address(text: &str, span: Span) -> Option<DirectAddress> {
    let bytes = text.as_bytes();
    let area = match bytes.get(1)?.to_ascii_uppercase() {
        b'I' => Area::Input,
        b'Q' => Area::Output,
        b'M' => Area::Memory,
        _ => return None,
    };
    let size = access_size(bytes.get(2).copied());
    let numbers = text.get(if size.is_some() { 3 } else { 2 }..)?;
    let path = match numbers {
        "*" => Vec::new(),
        numbers => numbers.split('.').map(|number| number.parse().ok()).collect::<Option<Vec<u32>>>()?,
    };
    Some(DirectAddress { area, size, path, span })
}

/// The digits without `_`, which may only stand between two of them.
fn digits(text: &str) -> Option<String> {
    let stray = text.starts_with('_') || text.ends_with('_') || text.contains("__");
    (!text.is_empty() && !stray).then(|| text.replace('_', ""))
}

fn stray_underscore(text: &str) -> Fault {
    (&rules::BAD_NUMBER, format!("`{text}`: a `_` may only stand between two digits"), None)
}

fn too_large(text: &str) -> Fault {
    (&rules::NUMBER_TOO_LARGE, format!("`{text}` is too large for any type"), None)
}

/// `1_000`.
fn integer(text: &str, negative: bool) -> Result<LiteralValue, Fault> {
    let plain = digits(text).ok_or_else(|| stray_underscore(text))?;
    let magnitude = plain.parse().map_err(|_| too_large(text))?;
    Ok(LiteralValue::Int { negative, magnitude, based: false })
}

/// `16#FF`, `8#17`, `2#1010`.
fn based_integer(text: &str, negative: bool) -> Result<LiteralValue, Fault> {
    let (base, number) = text.split_once('#').unwrap_or((text, ""));
    let radix = match base {
        "2" => 2,
        "8" => 8,
        "16" => 16,
        _ => {
            let message = format!("`{base}` is no base for numbers");
            return Err((&rules::BAD_NUMBER, message, Some("the bases are 2, 8 and 16")));
        }
    };
    if number.is_empty() {
        return Err((&rules::BAD_NUMBER, format!("digits are missing after `{text}`"), None));
    }
    let plain = digits(number).ok_or_else(|| stray_underscore(text))?;
    if let Some(wrong) = plain.chars().find(|digit| !digit.is_digit(radix)) {
        return Err((&rules::BAD_NUMBER, format!("`{wrong}` is no digit of base {radix}"), None));
    }
    let magnitude = u64::from_str_radix(&plain, radix).map_err(|_| too_large(text))?;
    Ok(LiteralValue::Int { negative, magnitude, based: true })
}

/// `1.5E-3`.
fn real(text: &str, negative: bool) -> Result<LiteralValue, Fault> {
    let parts_fine =
        text.split(['.', 'e', 'E', '+', '-']).filter(|part| !part.is_empty()).all(|part| digits(part).is_some());
    if !parts_fine {
        return Err(stray_underscore(text));
    }
    let sign = if negative { "-" } else { "" };
    let plain = format!("{sign}{}", text.replace('_', ""));
    // Both are rounded once, from the digits: going through the LREAL would round a REAL twice.
    let (value, value_f32) = (plain.parse::<f64>(), plain.parse::<f32>());
    match (value, value_f32) {
        (Ok(value), Ok(value_f32)) if value.is_finite() => Ok(LiteralValue::Real { value, value_f32 }),
        _ => Err(too_large(text)),
    }
}

/// The units of a time literal with their nanoseconds, largest first.
const TIME_UNITS: [(&str, i128); 7] = [
    ("D", DAY_NS as i128),
    ("H", 3_600_000_000_000),
    ("M", 60_000_000_000),
    ("S", 1_000_000_000),
    ("MS", 1_000_000),
    ("US", 1_000),
    ("NS", 1),
];

/// `T#1d2h3m4s5ms6us7ns`, `LTIME#-1.5s`.
fn time(text: &str) -> Result<LiteralValue, Fault> {
    let bad = |what: String| (&rules::BAD_TIME, what, Some("times look like `T#1h30m`, `T#1.5s`, `T#200ms`"));
    let (prefix, body) = text.split_once('#').unwrap_or((text, ""));
    let (negative, body) = match body.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, body.strip_prefix('+').unwrap_or(body)),
    };
    let mut rest = body;
    let mut total_ns: i128 = 0;
    let mut next_unit = 0;
    let mut fraction_seen = false;
    while !rest.is_empty() {
        let number_len = rest.find(|found: char| found.is_ascii_alphabetic()).unwrap_or(rest.len());
        let (number, after) = rest.split_at(number_len);
        let unit_len = after.find(|found: char| !found.is_ascii_alphabetic()).unwrap_or(after.len());
        let (unit, after) = after.split_at(unit_len);
        rest = after.strip_prefix('_').unwrap_or(after);
        if unit.is_empty() {
            return Err(bad(format!("a unit is missing after `{number}`")));
        }
        let found = TIME_UNITS.iter().position(|(name, _)| unit.eq_ignore_ascii_case(name));
        let index = found.ok_or_else(|| bad(format!("`{unit}` is no unit of time")))?;
        if index < next_unit {
            return Err(bad(format!("`{unit}` must stand before the smaller units, and once")));
        }
        if fraction_seen {
            return Err(bad("only the last number of a time may have a fraction".to_owned()));
        }
        next_unit = index + 1;
        fraction_seen = number.contains('.');
        let unit_ns = TIME_UNITS.get(index).map_or(0, |&(_, ns)| ns);
        let part_ns = scaled(number, unit_ns).ok_or_else(|| bad(format!("`{number}` is no number")))?;
        total_ns = total_ns.saturating_add(part_ns);
    }
    let signed_ns = if negative { -total_ns } else { total_ns };
    let value_ns = i64::try_from(signed_ns).map_err(|_| too_large(text))?;
    Ok(LiteralValue::Time { long: is_long(prefix), value_ns })
}

/// A decimal number times the nanoseconds of its unit; what is finer than a nanosecond is cut off.
fn scaled(number: &str, unit_ns: i128) -> Option<i128> {
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    let (whole, fraction) = (digits(whole)?, digits(fraction)?);
    // A whole number of more digits is too large for any unit; a finer fraction is below a nanosecond.
    let whole: i128 = whole.parse::<u64>().map_or(i128::from(u64::MAX), i128::from);
    let mut part_ns = 0;
    let mut place_ns = unit_ns.saturating_mul(1_000_000);
    let mut sum = 0_i128;
    for digit in fraction.chars().take(20) {
        place_ns /= 10;
        sum += i128::from(digit.to_digit(10)?) * place_ns;
    }
    part_ns += sum / 1_000_000;
    Some(whole.saturating_mul(unit_ns).saturating_add(part_ns))
}

/// Whether the prefix of a time or date is of an L-form: `LT`, `LTIME`, `LD`, `LTOD` ….
fn is_long(prefix: &str) -> bool {
    prefix.starts_with(['l', 'L'])
}

/// `D#2024-02-29`, `TOD#12:30:00.5`, `DT#2024-02-29-12:30:00`.
fn date(kind: TokenKind, text: &str) -> Result<LiteralValue, Fault> {
    let (prefix, body) = text.split_once('#').unwrap_or((text, ""));
    let long = is_long(prefix);
    let inside = 0..i128::from(DAY_NS);
    let (parsed, what) = match kind {
        TokenKind::Date => (parse_date(body.as_bytes()), "date"),
        TokenKind::TimeOfDay => {
            (parse_time_of_day(body.as_bytes()).filter(|(ns, _)| inside.contains(ns)), "time of day")
        }
        _ => (parse_date_and_time(body.as_bytes()), "date with a time of day"),
    };
    let Some((value_ns, _)) = parsed.filter(|(_, used)| *used == body.len()) else {
        let help = "dates look like `D#2024-02-29`, `TOD#12:30:00.5`, `DT#2024-02-29-12:30:00`";
        return Err((&rules::BAD_DATE, format!("`{body}` is no {what}"), Some(help)));
    };
    let value_ns = i64::try_from(value_ns).map_err(|_| too_large(text))?;
    Ok(match kind {
        TokenKind::Date => LiteralValue::Date { long, value_ns },
        TokenKind::TimeOfDay => LiteralValue::TimeOfDay { long, value_ns },
        _ => LiteralValue::DateAndTime { long, value_ns },
    })
}

/// The characters of a quoted text with its `$` escapes resolved (IEC 61131-3 tables 6 and 7), each given to `put`.
fn unescape(text: &str, hex_digits: usize, mut put: impl FnMut(u32) -> Result<(), Fault>) -> Result<(), Fault> {
    let inside = text.get(1..text.len().saturating_sub(1)).unwrap_or("");
    let mut rest = inside;
    while let Some(first) = rest.chars().next() {
        rest = rest.get(first.len_utf8()..).unwrap_or("");
        if first != '$' {
            put(u32::from(first))?;
            continue;
        }
        let escape = rest.chars().next().unwrap_or(' ');
        let named = match escape {
            '$' | '\'' | '"' => Some(u32::from(escape)),
            'l' | 'L' | 'n' | 'N' => Some(10),
            'p' | 'P' => Some(12),
            'r' | 'R' => Some(13),
            't' | 'T' => Some(9),
            _ => None,
        };
        if let Some(code) = named {
            rest = rest.get(1..).unwrap_or("");
            put(code)?;
            continue;
        }
        let hex = rest.get(..hex_digits).filter(|hex| hex.bytes().all(|digit| digit.is_ascii_hexdigit()));
        let Some(code) = hex.and_then(|hex| u32::from_str_radix(hex, 16).ok()) else {
            let help = "escapes are `$$`, `$'`, `$L`, `$N`, `$P`, `$R`, `$T` and hexadecimal digits (two in '…', four in \"…\")";
            return Err((&rules::BAD_STRING, format!("`${escape}` is no escape"), Some(help)));
        };
        rest = rest.get(hex_digits..).unwrap_or("");
        put(code)?;
    }
    Ok(())
}

/// `'text'`.
fn string(text: &str) -> Result<LiteralValue, Fault> {
    let mut bytes = Vec::new();
    unescape(text, 2, |code| match u8::try_from(code) {
        Ok(byte) => {
            bytes.push(byte);
            Ok(())
        }
        Err(_) => {
            let shown = char::from_u32(code).unwrap_or('?');
            let message = format!("`{shown}` has no place in a STRING, which holds Latin-1 characters");
            Err((&rules::BAD_STRING, message, Some("use a WSTRING: \"…\"")))
        }
    })?;
    Ok(LiteralValue::String(bytes))
}

/// `"text"`.
fn wide_string(text: &str) -> Result<LiteralValue, Fault> {
    let mut units = Vec::new();
    unescape(text, 4, |code| {
        match char::from_u32(code) {
            Some(found) => units.extend_from_slice(found.encode_utf16(&mut [0; 2])),
            // Half of a surrogate pair, written as an escape: a unit like any other.
            None => units.extend(u16::try_from(code)),
        }
        Ok(())
    })?;
    Ok(LiteralValue::WString(units))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn int(value: &Result<LiteralValue, Fault>) -> Option<u64> {
        match value {
            Ok(LiteralValue::Int { magnitude, .. }) => Some(*magnitude),
            _ => None,
        }
    }

    fn ns(text: &str) -> Option<i64> {
        match time(text) {
            Ok(LiteralValue::Time { value_ns, .. }) => Some(value_ns),
            _ => None,
        }
    }

    fn date_value(kind: TokenKind, text: &str) -> Option<i64> {
        match date(kind, text) {
            Ok(
                LiteralValue::Date { value_ns, .. }
                | LiteralValue::TimeOfDay { value_ns, .. }
                | LiteralValue::DateAndTime { value_ns, .. },
            ) => Some(value_ns),
            _ => None,
        }
    }

    #[test]
    fn integers_of_all_bases() {
        assert_eq!(int(&integer("1_000", false)), Some(1000));
        assert_eq!(int(&integer("18446744073709551615", false)), Some(u64::MAX));
        assert_eq!(int(&integer("18446744073709551616", false)), None);
        for wrong in ["1__0", "1_"] {
            assert_eq!(int(&integer(wrong, false)), None, "{wrong}");
        }
        assert_eq!(int(&based_integer("16#Ff_fF", false)), Some(0xFFFF));
        assert_eq!(int(&based_integer("2#1010", false)), Some(10));
        assert_eq!(int(&based_integer("8#17", false)), Some(15));
        for wrong in ["16#", "16#G", "2#2", "3#1", "16#_1", "16#1FFFFFFFFFFFFFFFF"] {
            assert_eq!(int(&based_integer(wrong, false)), None, "{wrong}");
        }
    }

    #[test]
    fn reals_are_rounded_once() {
        let value = real("16777217.0", true).ok();
        assert_eq!(value, Some(LiteralValue::Real { value: -16_777_217.0, value_f32: -16_777_216.0 }));
        assert!(real("1.0E400", false).is_err());
        assert!(real("1_.0", false).is_err());
        assert_eq!(real("1_0.0_1E+1_0", false).ok(), Some(LiteralValue::Real { value: 10.01e10, value_f32: 10.01e10 }));
    }

    #[test]
    fn times_in_all_units() {
        assert_eq!(ns("T#1d2h3m4s5ms6us7ns"), Some(93_784_005_006_007));
        assert_eq!(ns("t#-1.5S"), Some(-1_500_000_000));
        assert_eq!(ns("LTIME#1d_2h"), Some(93_600_000_000_000));
        assert_eq!(ns("T#0.1us"), Some(100));
        assert_eq!(ns("T#0.123456789d"), Some(10_666_666_569_600));
        assert_eq!(ns("T#90m"), Some(5_400_000_000_000), "the first unit may overflow into the next");
        assert_eq!(ns("T#106751d23h47m16s854ms775us807ns"), Some(i64::MAX));
        assert_eq!(ns("T#106751d23h47m16s854ms775us808ns"), None);
        assert_eq!(ns("T#-106751d23h47m16s854ms775us808ns"), Some(i64::MIN));
        for wrong in ["T#5", "T#1s2h", "T#1s1s", "T#1.5h3m", "T#5x", "T#1_s", "T#1.s", "T#99999999999999999999999d"] {
            assert_eq!(ns(wrong), None, "{wrong}");
        }
        assert_eq!(time("lt#1s").ok(), Some(LiteralValue::Time { long: true, value_ns: 1_000_000_000 }));
    }

    #[test]
    fn dates_count_from_1970() {
        const DAY: i64 = 86_400_000_000_000;
        let day = |text| date_value(TokenKind::Date, text);
        assert_eq!(day("D#1970-01-01"), Some(0));
        assert_eq!(day("D#1969-12-31"), Some(-DAY));
        assert_eq!(day("D#2000-03-01"), Some(11_017 * DAY));
        assert_eq!(day("D#2024-02-29"), Some(19_782 * DAY));
        for wrong in
            ["D#2023-02-29", "D#2024-13-01", "D#2024-00-01", "D#2024-1", "D#2024-1-1-1", "D#2024-04-31", "D#1000-1-1"]
        {
            assert_eq!(day(wrong), None, "{wrong}");
        }
        let clock = |text| date_value(TokenKind::TimeOfDay, text);
        assert_eq!(clock("TOD#12:30:00.5"), Some(45_000_500_000_000));
        assert_eq!(clock("TOD#12:30"), Some(45_000_000_000_000));
        for wrong in ["TOD#24:00:00", "TOD#1:60:0", "TOD#1:1:60", "TOD#1", "TOD#1:1:1:1"] {
            assert_eq!(clock(wrong), None, "{wrong}");
        }
        assert_eq!(date_value(TokenKind::DateAndTime, "DT#1970-01-02-00:00:01"), Some(DAY + 1_000_000_000));
        assert_eq!(date_value(TokenKind::DateAndTime, "DT#1970-01-02"), None);
    }

    #[test]
    fn strings_resolve_their_escapes() {
        let bytes = |text| match string(text) {
            Ok(LiteralValue::String(bytes)) => Some(bytes),
            _ => None,
        };
        assert_eq!(bytes("'$N$' $41$l$P$r$t$$'"), Some(b"\n' A\n\x0C\r\t$".to_vec()));
        assert_eq!(bytes("'ä'"), Some(vec![0xE4]));
        assert_eq!(bytes("''"), Some(vec![]));
        for wrong in ["'$'", "'$4'", "'$GG'", "'€'", "'$ä'"] {
            assert_eq!(bytes(wrong), None, "{wrong}");
        }
        let units = |text| match wide_string(text) {
            Ok(LiteralValue::WString(units)) => Some(units),
            _ => None,
        };
        assert_eq!(units("\"€$0041$\"😀\""), Some(vec![0x20AC, 0x41, 0x22, 0xD83D, 0xDE00]));
        assert_eq!(units("\"$D800\""), Some(vec![0xD800]));
        assert_eq!(units("\"$41\""), None);
    }

    #[test]
    fn addresses_have_area_size_and_path() {
        let span = Span::new(crate::source::FileId(0), 0, 0);
        let found = address("%qx1.2", span);
        let expected = DirectAddress { area: Area::Output, size: access_size(Some(b'X')), path: vec![1, 2], span };
        assert_eq!(found, Some(expected));
        assert_eq!(address("%I*", span).map(|found| found.is_incomplete()), Some(true));
        assert_eq!(address("%MB99999999999", span), None);
    }
}
