//! Strings: their functions, and values as text.

use super::functions::Function;
use super::moments;
use super::tree::{Kind, Value};

/// The units `from..from + count` by a 1-based position, clamped to the string.
fn span(text: &[u16], count: i128, position: i128) -> (usize, usize) {
    let start = (position - 1).clamp(0, text.len() as i128) as usize;
    let count = count.clamp(0, (text.len() - start) as i128) as usize;
    (start, start + count)
}

/// A function of strings. None: its meaning is not written here.
pub(super) fn function(function: Function, values: &[Value]) -> Option<Value> {
    let Value::Str(text) = &values[0] else { return None };
    let number = |at: usize| values[at].int();
    let clamped = |at: usize| number(at).clamp(0, text.len() as i128) as usize;
    Some(Value::Str(match function {
        Function::Len => return Some(Value::Int(text.len() as i128)),
        Function::Find => {
            let wanted = values[1].units();
            let found = text.windows(wanted.len().max(1)).position(|window| window == wanted);
            return Some(Value::Int(found.map_or(0, |at| at as i128 + 1)));
        }
        Function::Left => text[..clamped(1)].to_vec(),
        Function::Right => text[text.len() - clamped(1)..].to_vec(),
        Function::Mid => {
            let (from, to) = span(text, number(1), number(2));
            text[from..to].to_vec()
        }
        Function::Concat => values.iter().flat_map(|value| value.units().to_vec()).collect(),
        Function::Insert => {
            let at = clamped(2);
            [&text[..at], values[1].units(), &text[at..]].concat()
        }
        Function::Delete => {
            let (from, to) = span(text, number(1), number(2));
            [&text[..from], &text[to..]].concat()
        }
        Function::Replace => {
            let (from, to) = span(text, number(2), number(3));
            [&text[..from], values[1].units(), &text[to..]].concat()
        }
        _ => return None,
    }))
}

/// A float as the shortest decimal, always with a point; with an exponent below 1E-4 and from 1E16 on.
fn float(value: f64, plain: &str, scientific: &str) -> String {
    if value.is_nan() {
        return "NaN".to_string();
    }
    if value.is_infinite() {
        return if value > 0.0 { "Infinity" } else { "-Infinity" }.to_string();
    }
    let (mantissa, exponent) = if value == 0.0 || (1e-4..1e16).contains(&value.abs()) {
        (plain, None)
    } else {
        scientific.split_once('e').map_or((plain, None), |(mantissa, exponent)| (mantissa, Some(exponent)))
    };
    let point = if mantissa.contains('.') { "" } else { ".0" };
    format!("{mantissa}{point}{}", exponent.map_or(String::new(), |exponent| format!("E{exponent}")))
}

const UNITS: [(i128, &str); 7] = [
    (86_400_000_000_000, "d"),
    (3_600_000_000_000, "h"),
    (60_000_000_000, "m"),
    (1_000_000_000, "s"),
    (1_000_000, "ms"),
    (1_000, "us"),
    (1, "ns"),
];

/// A duration in the units that it has.
fn duration(nanoseconds: i128) -> String {
    let mut left = nanoseconds.abs();
    let mut text = String::new();
    for (unit, name) in UNITS {
        if left >= unit {
            text += &format!("{}{name}", left / unit);
            left %= unit;
        }
    }
    let sign = if nanoseconds < 0 { "-" } else { "" };
    let text = if text.is_empty() { "0ms" } else { &text };
    format!("T#{sign}{text}")
}

/// The text in the room of a string: what is before the first 0.
#[must_use]
pub fn text_in(room: &[u16]) -> &[u16] {
    room.split(|unit| *unit == 0).next().unwrap_or(room)
}

/// `WSTRING_TO_STRING`: a unit that is not Latin-1 becomes `?`.
#[must_use]
pub fn narrow(units: &[u16]) -> Vec<u8> {
    units.iter().map(|unit| u8::try_from(*unit).unwrap_or(b'?')).collect()
}

/// `x_TO_STRING` and `x_TO_WSTRING`.
#[must_use]
pub fn write(kind: Kind, value: &Value) -> Vec<u16> {
    if kind.is_character() {
        // Character 0 ends the text that it is in.
        let unit = value.int() as u16;
        return if unit == 0 { Vec::new() } else { vec![unit] };
    }
    let text = match value {
        Value::Real(value) => float(f64::from(*value), &format!("{value}"), &format!("{value:e}")),
        Value::Lreal(value) => float(*value, &format!("{value}"), &format!("{value:e}")),
        _ if kind == Kind::Bool => if value.int() == 0 { "FALSE" } else { "TRUE" }.to_string(),
        _ if kind.is_duration() => duration(value.int()),
        _ if kind.is_moment() => {
            let name = match kind {
                Kind::Date | Kind::Ldate => "D",
                Kind::Tod | Kind::Ltod => "TOD",
                _ => "DT",
            };
            format!("{name}#{}", moments::text(kind, value.int()))
        }
        _ => value.int().to_string(),
    };
    text.bytes().map(u16::from).collect()
}

/// The longest prefix that is a decimal number with fraction and exponent, or the name of what has no digits.
fn decimal(text: &[u8]) -> &str {
    let digits = |from: usize| text[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let signed = |at: usize| at + usize::from(matches!(text.get(at), Some(b'+' | b'-')));
    let start = signed(0);
    for name in ["NaN", "Infinity"] {
        let end = start + name.len();
        if text.get(start..end).is_some_and(|word| word.eq_ignore_ascii_case(name.as_bytes())) {
            return std::str::from_utf8(&text[..end]).unwrap_or("0");
        }
    }
    let whole = digits(start);
    let mut end = start + whole;
    if text.get(end) == Some(&b'.') && digits(end + 1) + whole > 0 {
        end += 1 + digits(end + 1);
    }
    if end == start {
        return "0";
    }
    if matches!(text.get(end), Some(b'e' | b'E')) && digits(signed(end + 1)) > 0 {
        end = signed(end + 1) + digits(signed(end + 1));
    }
    std::str::from_utf8(&text[..end]).unwrap_or("0")
}

/// The longest prefix that is a duration without fractions, in nanoseconds: its units fall.
fn time(text: &[u8]) -> i128 {
    let mut rest = text.strip_prefix(b"T#").unwrap_or(text);
    let sign = if rest.first() == Some(&b'-') { -1 } else { 1 };
    rest = rest.strip_prefix(b"-").unwrap_or(rest);
    let (mut total, mut least) = (0_i128, i128::MAX);
    loop {
        let count = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let number = rest[..count].iter().fold(0_i128, |sum, digit| sum * 10 + i128::from(digit - b'0'));
        // `ms` before `m`: the longest name.
        let unit = UNITS.iter().filter(|(_, name)| rest[count..].starts_with(name.as_bytes()));
        let Some((unit, name)) = unit.max_by_key(|(_, name)| name.len()).filter(|(unit, _)| count > 0 && *unit < least)
        else {
            return sign * total;
        };
        total += number * unit;
        (least, rest) = (*unit, &rest[count + name.len()..]);
    }
}

/// `STRING_TO_x` and `WSTRING_TO_x`: the longest valid prefix, without one 0; the first character.
#[must_use]
pub fn read(kind: Kind, units: &[u16]) -> Value {
    let text = &narrow(units)[..];
    match kind {
        Kind::Char => return Value::Int(text.first().map_or(0, |unit| i128::from(*unit))),
        Kind::Wchar => return Value::Int(units.first().map_or(0, |unit| i128::from(*unit))),
        Kind::Bool => return Value::Int(i128::from(text.eq_ignore_ascii_case(b"TRUE"))),
        Kind::Real => return Value::Real(decimal(text).parse().unwrap_or(0.0)),
        Kind::Lreal => return Value::Lreal(decimal(text).parse().unwrap_or(0.0)),
        Kind::Time | Kind::Ltime => return Value::Int(kind.wrap(time(text))),
        _ if kind.is_moment() => return Value::Int(moments::read(kind, text)),
        _ => {}
    }
    let (sign, digits) = match text.split_first() {
        // A sign is no valid beginning of a number that has none.
        Some((b'-', rest)) if kind.is_signed() => (-1, rest),
        _ => (1, text),
    };
    let mut number = prefix(digits, 10).unwrap_or(0);
    // A base of 2, 8 or 16 and digits of it behind a `#`.
    if matches!(number, 2 | 8 | 16)
        && let Some(at) = digits.iter().position(|byte| *byte == b'#')
        && digits[..at].iter().all(u8::is_ascii_digit)
    {
        number = prefix(&digits[at + 1..], number as u32).unwrap_or(number);
    }
    Value::Int(kind.wrap(sign * number))
}

/// The number that the digits of a base at the beginning make; none without any.
fn prefix(text: &[u8], base: u32) -> Option<i128> {
    let digits = text.iter().map_while(|byte| char::from(*byte).to_digit(base));
    digits.fold(None, |sum: Option<i128>, digit| Some(sum.unwrap_or(0) * i128::from(base) + i128::from(digit)))
}
