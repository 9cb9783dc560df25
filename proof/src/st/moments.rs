//! Dates and times of day: what tables 26, 35 and 36 say of them, counted on the calendar of the third evaluator, in exact numbers that are cut to 64 bits.

use khz_bytecode::container::ElementaryType as E;
use khz_machine::library::functions::{ResultRule, TypeClass};

use super::functions::{Function, binary, row};
use super::tree::{Kind, Op, Value};
use crate::evaluator::calendar::{civil, start_of, time_of_day, weekday};
use khz_bytecode::trap::TrapCode;

/// Nanoseconds of a day.
pub const DAY_NS: i128 = 86_400_000_000_000;

/// The kind of a type of the library's table.
#[must_use]
pub fn kind_of(ty: E) -> Option<Kind> {
    Kind::ALL.into_iter().find(|kind| kind.name() == ty.name())
}

/// The type that a function always gives.
#[must_use]
pub fn result(function: Function) -> Option<Kind> {
    if let ResultRule::Of(ty) = row(function).result { kind_of(ty) } else { None }
}

/// The type that a function splits; none: it splits nothing.
#[must_use]
pub fn splits(function: Function) -> Option<Kind> {
    let row = row(function);
    match row.parameters.first().map(|parameter| parameter.class) {
        Some(TypeClass::Of(ty)) if !row.outputs.is_empty() => kind_of(ty),
        _ => None,
    }
}

/// A value near a number that a literal of the type can say: a whole day, a time within one, any moment.
#[must_use]
pub fn sayable(kind: Kind, value: i128) -> i128 {
    match kind {
        // Some 290 years on both sides of 1970.
        Kind::Date | Kind::Ldate => (value % 106_000) * DAY_NS,
        Kind::Tod | Kind::Ltod => value.rem_euclid(DAY_NS),
        _ => kind.wrap(value),
    }
}

/// `A_TO_B` between durations, dates and times of day, all in nanoseconds.
#[must_use]
pub fn convert(from: Kind, to: Kind, value: i128) -> i128 {
    let has_day = matches!(from, Kind::Date | Kind::Ldate | Kind::Dt | Kind::Ldt);
    match to {
        Kind::Date | Kind::Ldate if !matches!(from, Kind::Date | Kind::Ldate) => to.wrap(value - time_of_day(value)),
        Kind::Tod | Kind::Ltod if has_day => time_of_day(value),
        _ => value,
    }
}

/// Nanoseconds of one of the unit in which a type meets numbers; none: it is a number itself.
#[must_use]
pub fn unit_ns(kind: Kind) -> Option<i128> {
    match kind {
        Kind::Time | Kind::Tod => Some(1_000_000),
        Kind::Date | Kind::Dt => Some(1_000_000_000),
        Kind::Ltime | Kind::Ldate | Kind::Ltod | Kind::Ldt => Some(1),
        _ => None,
    }
}

/// Nanoseconds of hours, minutes, seconds, milliseconds, microseconds, nanoseconds; of the last ones there may be none.
fn time_of_parts(parts: &[Value]) -> i128 {
    let units = [3_600_000_000_000, 60_000_000_000, 1_000_000_000, 1_000_000, 1_000, 1];
    parts.iter().zip(units).map(|(part, unit)| part.int().wrapping_mul(unit)).sum()
}

fn date_of_parts(parts: &[Value]) -> i128 {
    // What a LINT can not hold is lost before the calendar counts.
    let months = Kind::Lint.wrap(Kind::Lint.wrap(parts[0].int() * 12) + parts[1].int() - 1);
    start_of(0, months + 1, parts[2].int())
}

/// A function of table 35 or 36 with a result. None: it is none of them.
///
/// # Errors
/// A division by zero.
pub fn standard(function: Function, kind: Kind, values: &[Value]) -> Result<Option<Value>, TrapCode> {
    let name = row(function).name;
    if function == Function::DayOfWeek {
        return Ok(Some(Value::Int(weekday(values[0].int()))));
    }
    let Some(to) = result(function) else { return Ok(None) };
    // Years and hours come as LINT, whatever they were.
    let parts: Vec<Value> = values
        .iter()
        .map(|value| if let Value::Int(value) = value { Value::Int(Kind::Lint.wrap(*value)) } else { value.clone() })
        .collect();
    let op = [("ADD", Op::Add), ("SUB", Op::Sub), ("MUL", Op::Mul), ("DIV", Op::Div)];
    if let Some((_, op)) = op.into_iter().find(|(prefix, _)| name.starts_with(prefix)) {
        return binary(op, kind, &values[0], &values[1]).map(Some);
    }
    let made = match function {
        Function::ConcatDate | Function::ConcatLdate => date_of_parts(&parts),
        Function::ConcatTod | Function::ConcatLtod => time_of_parts(&parts),
        Function::ConcatDt | Function::ConcatLdt => date_of_parts(&parts) + time_of_parts(&parts[3..]),
        _ => values[0].int() + values[1].int(),
    };
    Ok(Some(Value::Int(to.wrap(made))))
}

/// A part of a value by the name of the output that it goes to.
///
/// # Panics
/// When there is no such part: the tree is wrong.
#[must_use]
pub fn part(kind: Kind, value: i128, name: &str) -> i128 {
    let time = convert(kind, Kind::Ltod, value);
    match name {
        "YEAR" => civil(value).0,
        "MONTH" => civil(value).1,
        "DAY" => civil(value).2,
        "HOUR" => time / 3_600_000_000_000,
        "MINUTE" => time / 60_000_000_000 % 60,
        "SECOND" => time / 1_000_000_000 % 60,
        "MILLISECOND" => time / 1_000_000 % 1000,
        "MICROSECOND" => time / 1000 % 1000,
        "NANOSECOND" => time % 1000,
        other => panic!("no part {other}"),
    }
}

fn date_text(value: i128) -> String {
    let (year, month, day) = civil(value);
    format!("{year:04}-{month:02}-{day:02}")
}

fn time_text(value: i128) -> String {
    let sign = if value < 0 { "-" } else { "" };
    let (seconds, fraction) = (value.abs() / 1_000_000_000, value.abs() % 1_000_000_000);
    let text = format!("{sign}{:02}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60);
    if fraction == 0 { text } else { format!("{text}.{fraction:09}").trim_end_matches('0').to_string() }
}

/// A value as a literal of its type, without the type.
#[must_use]
pub fn text(kind: Kind, value: i128) -> String {
    match kind {
        Kind::Date | Kind::Ldate => date_text(value),
        Kind::Tod | Kind::Ltod => time_text(value),
        _ => format!("{}-{}", date_text(value), time_text(time_of_day(value))),
    }
}

/// Digits at the beginning as a number, and what is behind them.
fn digits(text: &[u8]) -> Option<(i128, &[u8])> {
    let count = text.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let number = text[..count].iter().fold(0_i128, |sum, digit| (sum * 10 + i128::from(digit - b'0')).min(1 << 70));
    (count > 0).then_some((number, &text[count..]))
}

fn behind(text: &[u8], separator: u8) -> Option<(i128, &[u8])> {
    digits(text.strip_prefix(&[separator])?)
}

fn read_date(text: &[u8]) -> Option<(i128, &[u8])> {
    let (year, rest) = digits(text)?;
    let (month, rest) = behind(rest, b'-')?;
    let (day, rest) = behind(rest, b'-')?;
    // A year of ten thousand has no literal.
    if year > 9999 || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let made = start_of(year, month, day);
    // A day that the month has not is in the next one.
    let next = start_of(year, month + 1, 1);
    (made < next).then_some((made, rest))
}

fn read_time(text: &[u8]) -> Option<i128> {
    let (hours, rest) = digits(text)?;
    let (minutes, rest) = behind(rest, b':').filter(|(minutes, _)| *minutes < 60)?;
    let mut value = (hours * 60 + minutes) * 60_000_000_000;
    if let Some((seconds, rest)) = behind(rest, b':').filter(|(seconds, _)| *seconds < 60) {
        value += seconds * 1_000_000_000;
        if let Some(fraction) = rest.strip_prefix(b".") {
            let digits = fraction.iter().take_while(|byte| byte.is_ascii_digit());
            let units = std::iter::successors(Some(100_000_000_i128), |unit| Some(unit / 10));
            value += digits.zip(units).map(|(digit, unit)| i128::from(digit - b'0') * unit).sum::<i128>();
        }
    }
    Some(value)
}

/// `STRING_TO_x`: the longest prefix that is a literal, with its type before it or not; without one 0.
#[must_use]
pub fn read(kind: Kind, text: &[u8]) -> i128 {
    let names: &[&str] = match kind {
        Kind::Date | Kind::Ldate => &["D#", "DATE#", "LD#", "LDATE#"],
        Kind::Tod | Kind::Ltod => &["TOD#", "TIME_OF_DAY#", "LTOD#", "LTIME_OF_DAY#"],
        _ => &["DT#", "DATE_AND_TIME#", "LDT#", "LDATE_AND_TIME#"],
    };
    let is_named = |name: &&&str| text.get(..name.len()).is_some_and(|head| head.eq_ignore_ascii_case(name.as_bytes()));
    let text = &text[names.iter().find(is_named).map_or(0, |name| name.len())..];
    let found = match kind {
        Kind::Date | Kind::Ldate => read_date(text).map(|(date, _)| date),
        Kind::Tod | Kind::Ltod => match text.strip_prefix(b"-") {
            Some(rest) => read_time(rest).map(|time| -time),
            None => read_time(text),
        },
        _ => read_date(text).and_then(|(date, rest)| {
            let time = read_time(rest.strip_prefix(b"-")?).filter(|time| *time < DAY_NS)?;
            Some(date + time)
        }),
    };
    found.map_or(0, |value| value.clamp(i128::from(i64::MIN), i128::from(i64::MAX)))
}
