//! Numbers, times and dates as text, from the section of that name in `docs/bytecode.md`.
//!
//! What reads takes pieces off the front of a slice and hands back what is left; numbers are 128 bits wide and saturate, dates are counted out by
//! [`calendar`](super::calendar). Floating-point numbers are formatted and read by Rust's own library, here as in the engines; the document is about the prefix and the
//! form, which are made here.

use super::calendar::{civil, start_of, time_of_day};

const SECOND_NS: i128 = 1_000_000_000;
const DAY_NS: i128 = 86_400 * SECOND_NS;

/// Units of a duration with their nanoseconds: the order in which they may follow each other.
const UNITS: [(&str, i128); 7] = [
    ("d", DAY_NS),
    ("h", 3_600 * SECOND_NS),
    ("m", 60 * SECOND_NS),
    ("s", SECOND_NS),
    ("ms", 1_000_000),
    ("us", 1_000),
    ("ns", 1),
];

/// A float; `plain` and `scientific` are its shortest digits in both of Rust's notations.
pub(super) fn from_float(value: f64, plain: &str, scientific: &str) -> String {
    if value.is_nan() {
        return "NaN".into();
    }
    if value.is_infinite() {
        return if value < 0.0 { "-Infinity".into() } else { "Infinity".into() };
    }
    let with_point = |digits: &str| if digits.contains('.') { digits.to_string() } else { format!("{digits}.0") };
    let magnitude = value.abs();
    if magnitude == 0.0 || (1e-4..1e16).contains(&magnitude) {
        return with_point(plain);
    }
    let (digits, exponent) = scientific.split_once('e').expect("Rust writes an exponent");
    format!("{}E{exponent}", with_point(digits))
}

/// A TIME.
pub(super) fn from_time(time_ns: i128) -> String {
    let sign = if time_ns < 0 { "-" } else { "" };
    let mut left = time_ns.abs();
    let mut parts = String::new();
    for (name, unit_ns) in UNITS {
        let mut count = 0_i128;
        if left >= unit_ns {
            count = left / unit_ns;
            left -= count * unit_ns;
        }
        if count != 0 {
            parts.push_str(&format!("{count}{name}"));
        }
    }
    format!("T#{sign}{}", if parts.is_empty() { "0ms" } else { &parts })
}

fn date(moment_ns: i128) -> String {
    let (year, month, day) = civil(moment_ns);
    format!("{year:04}-{month:02}-{day:02}")
}

fn clock(time_ns: i128) -> String {
    let sign = if time_ns < 0 { "-" } else { "" };
    let time = time_ns.abs();
    let (minutes, seconds) = (time / SECOND_NS / 60, time / SECOND_NS % 60);
    let fraction = format!("{:09}", time % SECOND_NS);
    let fraction = fraction.trim_end_matches('0');
    let point = if fraction.is_empty() { "" } else { "." };
    format!("{sign}{:02}:{:02}:{seconds:02}{point}{fraction}", minutes / 60, minutes % 60)
}

/// A DATE.
pub(super) fn from_date(moment_ns: i128) -> String {
    format!("D#{}", date(moment_ns))
}

/// A TIME_OF_DAY.
pub(super) fn from_time_of_day(time_ns: i128) -> String {
    format!("TOD#{}", clock(time_ns))
}

/// A DATE_AND_TIME.
pub(super) fn from_moment(moment_ns: i128) -> String {
    format!("DT#{}-{}", date(moment_ns), clock(time_of_day(moment_ns)))
}

/// What stands behind a character.
fn behind(text: &[u8], character: u8) -> Option<&[u8]> {
    text.split_first().filter(|(first, _)| **first == character).map(|(_, rest)| rest)
}

/// What stands behind a word in any case.
fn behind_word<'t>(text: &'t [u8], word: &str) -> Option<&'t [u8]> {
    let (head, rest) = text.split_at_checked(word.len())?;
    head.eq_ignore_ascii_case(word.as_bytes()).then_some(rest)
}

/// What stands behind the first of some prefixes that is there, or all of it.
fn without_prefix<'t>(text: &'t [u8], prefixes: &[&str]) -> &'t [u8] {
    prefixes.iter().find_map(|prefix| behind_word(text, prefix)).unwrap_or(text)
}

/// Whether it begins with a minus, and what stands behind the sign.
fn sign(text: &[u8]) -> (bool, &[u8]) {
    match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    }
}

/// Digits of a base, of which any two may have one underscore between them, and what follows the last; none without a digit.
fn digits(text: &[u8], base: u32) -> Option<(String, &[u8])> {
    let is_digit = |at: usize| text.get(at).is_some_and(|byte| char::from(*byte).is_digit(base));
    let mut found = String::new();
    let mut at = 0;
    while is_digit(at) || (at > 0 && text.get(at) == Some(&b'_') && is_digit(at + 1)) {
        at += usize::from(text[at] == b'_');
        found.push(char::from(text[at]));
        at += 1;
    }
    (at > 0).then(|| (found, &text[at..]))
}

/// Their number, saturated.
fn number(digits: &str, base: u32) -> i128 {
    digits.chars().fold(0_i128, |sum, digit| {
        sum.saturating_mul(i128::from(base)).saturating_add(digit.to_digit(base).map_or(0, i128::from))
    })
}

/// An integer, in 128 bits.
pub(super) fn to_integer(text: &[u8]) -> i128 {
    let (negative, text) = sign(text);
    let Some((decimal, rest)) = digits(text, 10) else { return 0 };
    let mut value = number(&decimal, 10);
    if [2, 8, 16].contains(&value)
        && let Some((based, _)) = behind(rest, b'#').and_then(|rest| digits(rest, value as u32))
    {
        value = number(&based, value as u32);
    }
    if negative { -value } else { value }
}

/// The prefix that is a floating-point number, in the words that Rust reads; `0` without one.
pub(super) fn float_prefix(text: &[u8]) -> String {
    let (negative, text) = sign(text);
    let minus = if negative { "-" } else { "" };
    for name in ["NaN", "Infinity"] {
        if behind_word(text, name).is_some() {
            return format!("{minus}{name}");
        }
    }
    let (whole, rest) = digits(text, 10).map_or((None, text), |(whole, rest)| (Some(whole), rest));
    let fraction = behind(rest, b'.').map(|rest| digits(rest, 10).unwrap_or((String::new(), rest)));
    let (fraction, rest) = match fraction {
        Some((fraction, behind)) if whole.is_some() || !fraction.is_empty() => (fraction, behind),
        _ => (String::new(), rest),
    };
    if whole.is_none() && fraction.is_empty() {
        return "0".into();
    }
    let exponent = behind(rest, b'e').or_else(|| behind(rest, b'E')).and_then(|rest| {
        let (negative, rest) = sign(rest);
        let (digits, _) = digits(rest, 10)?;
        Some(format!("e{}{digits}", if negative { "-" } else { "" }))
    });
    format!("{minus}{}.{fraction}{}", whole.as_deref().unwrap_or("0"), exponent.as_deref().unwrap_or(""))
}

/// A duration in nanoseconds.
pub(super) fn to_time(text: &[u8]) -> i128 {
    let (negative, mut text) = sign(without_prefix(text, &["LTIME#", "TIME#", "LT#", "T#"]));
    let (mut total, mut least_ns) = (0_i128, i128::MAX);
    while let Some((part_ns, unit_ns, is_whole, rest)) = duration_part(text)
        && unit_ns < least_ns
    {
        total = total.saturating_add(part_ns);
        (least_ns, text) = (unit_ns, behind(rest, b'_').unwrap_or(rest));
        if !is_whole {
            break;
        }
    }
    if negative { -total } else { total }
}

/// A number and its unit: nanoseconds, those of the unit, whether it has no fraction, and what follows.
fn duration_part(text: &[u8]) -> Option<(i128, i128, bool, &[u8])> {
    let (whole, rest) = digits(text, 10)?;
    let (fraction, rest) = match behind(rest, b'.') {
        Some(rest) => digits(rest, 10).map(|(fraction, rest)| (Some(fraction), rest))?,
        None => (None, rest),
    };
    let named = UNITS.iter().filter_map(|(name, ns)| behind_word(rest, name).map(|rest| (*ns, rest)));
    // Of `m` and `ms` the longer name.
    let (unit_ns, rest) = named.min_by_key(|(_, rest)| rest.len())?;
    let mut part_ns = number(&whole, 10).saturating_mul(unit_ns);
    if let Some(fraction) = &fraction {
        let counting: String = fraction.chars().take(18).collect();
        let finer = number(&counting, 10) * unit_ns / 10_i128.pow(counting.len() as u32);
        part_ns = part_ns.saturating_add(finer);
    }
    Some((part_ns, unit_ns, fraction.is_none(), rest))
}

/// Plain digits, and what follows.
fn plain_number(text: &[u8]) -> Option<(i128, &[u8])> {
    let length = text.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let digits = std::str::from_utf8(&text[..length]).ok().filter(|digits| !digits.is_empty())?;
    Some((number(digits, 10), &text[length..]))
}

/// Year, month and day: nanoseconds of the start of the day, and what follows.
fn day(text: &[u8]) -> Option<(i128, &[u8])> {
    let (year, text) = plain_number(text)?;
    let (month, text) = plain_number(behind(text, b'-')?)?;
    let (day, text) = plain_number(behind(text, b'-')?)?;
    if year > 9999 || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let next_month = start_of(year, month + 1, 1);
    let moment_ns = start_of(year, month, day);
    (moment_ns < next_month).then_some((moment_ns, text))
}

/// Hours, minutes and what may follow of seconds: nanoseconds.
fn clock_time(text: &[u8]) -> Option<i128> {
    let below_60 = |text| plain_number(behind(text, b':')?).filter(|(number, _)| *number < 60);
    let (hours, text) = plain_number(text)?;
    let (minutes, text) = below_60(text)?;
    let whole_ns = hours.saturating_mul(60).saturating_add(minutes).saturating_mul(60 * SECOND_NS);
    let Some((seconds, text)) = below_60(text) else { return Some(whole_ns) };
    let fraction = behind(text, b'.').unwrap_or_default();
    let digits = fraction.iter().take_while(|byte| byte.is_ascii_digit()).map(|byte| i128::from(byte - b'0'));
    let padded = digits.chain(std::iter::repeat(0)).take(9);
    let fraction_ns = padded.fold(0, |sum, digit| sum * 10 + digit);
    Some(whole_ns.saturating_add(seconds * SECOND_NS + fraction_ns))
}

/// A DATE in nanoseconds since 1970-01-01.
pub(super) fn to_date(text: &[u8]) -> i128 {
    day(without_prefix(text, &["LDATE#", "DATE#", "LD#", "D#"])).map_or(0, |(moment_ns, _)| moment_ns)
}

/// A TIME_OF_DAY in nanoseconds.
pub(super) fn to_time_of_day(text: &[u8]) -> i128 {
    let text = without_prefix(text, &["LTIME_OF_DAY#", "TIME_OF_DAY#", "LTOD#", "TOD#"]);
    let (negative, text) = behind(text, b'-').map_or((false, text), |rest| (true, rest));
    let time_ns = clock_time(text).unwrap_or(0);
    if negative { -time_ns } else { time_ns }
}

/// A DATE_AND_TIME in nanoseconds since 1970-01-01.
pub(super) fn to_moment(text: &[u8]) -> i128 {
    let text = without_prefix(text, &["LDATE_AND_TIME#", "DATE_AND_TIME#", "LDT#", "DT#"]);
    let moment = day(text).and_then(|(moment_ns, rest)| {
        let time_ns = clock_time(behind(rest, b'-')?).filter(|time_ns| *time_ns < DAY_NS)?;
        Some(moment_ns + time_ns)
    });
    moment.unwrap_or(0)
}
