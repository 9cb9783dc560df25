//! Dates and times of day (IEC 61131-3, tables 9, 26 and 36): nanoseconds since 1970-01-01 or since midnight, proleptic Gregorian. What the
//! instructions of the calendar mean, and such values as text.

use std::fmt::{self, Write};

use super::operations;
use super::parse::Cursor;

/// Nanoseconds of a day.
pub const DAY_NS: i64 = 86_400_000_000_000;
const SECOND_NS: i64 = 1_000_000_000;
/// Days of 400 years, after which the calendar repeats.
const ERA_DAYS: i64 = 146_097;
/// Days from 0000-03-01 to 1970-01-01.
const EPOCH_DAYS: i64 = 719_468;
/// 1970-01-01 was a Thursday; Sunday is 0.
const EPOCH_WEEKDAY: i64 = 4;

operations! {
    date_start(a: i64) -> i64 = a.wrapping_sub(date_time(a));
    date_time(a: i64) -> i64 = a.rem_euclid(DAY_NS);
    date_year(a: i64) -> i32 = civil_of_days(a.div_euclid(DAY_NS)).0 as i32;
    date_month(a: i64) -> i32 = civil_of_days(a.div_euclid(DAY_NS)).1 as i32;
    date_day(a: i64) -> i32 = civil_of_days(a.div_euclid(DAY_NS)).2 as i32;
    date_weekday(a: i64) -> i32 = (a.div_euclid(DAY_NS) + EPOCH_WEEKDAY).rem_euclid(7) as i32;
    date_of(a: i64, b: i64) -> i64 = days_of_months(a, b).wrapping_mul(DAY_NS);
}

/// Year, month and day of a count of days since 1970-01-01.
fn civil_of_days(days: i64) -> (i64, i64, i64) {
    // Years are counted from March, so that the leap day is a year's last.
    let shifted = days + EPOCH_DAYS;
    let (era, day_of_era) = (shifted.div_euclid(ERA_DAYS), shifted.rem_euclid(ERA_DAYS));
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    (era * 400 + year_of_era + i64::from(month <= 2), month, day)
}

/// Days from 1970-01-01 to a day of a month that is counted from January of the year 0; wrapped.
fn days_of_months(months: i64, day: i64) -> i64 {
    let (year, month) = (months.div_euclid(12), months.rem_euclid(12) + 1);
    let year_from_march = year - i64::from(month <= 2);
    let (era, year_of_era) = (year_from_march.div_euclid(400), year_from_march.rem_euclid(400));
    let month_from_march = (month + 9) % 12;
    let days_of_year = (153 * month_from_march + 2) / 5 - 1;
    let days_of_era = 365 * year_of_era + year_of_era / 4 - year_of_era / 100 + days_of_year - EPOCH_DAYS;
    era.wrapping_mul(ERA_DAYS).wrapping_add(days_of_era).wrapping_add(day)
}

/// Writes the day that a moment lies in: `2024-02-29`.
///
/// # Errors
/// Those of `out`.
pub fn write_date(out: &mut impl Write, moment_ns: i64) -> fmt::Result {
    let (year, month, day) = civil_of_days(moment_ns.div_euclid(DAY_NS));
    write!(out, "{year:04}-{month:02}-{day:02}")
}

/// Writes a time of day: `12:34:56` or `12:34:56.789`. Times outside a day, which arithmetic can make, show as they are: `25:00:00`, `-00:00:01`.
///
/// # Errors
/// Those of `out`.
pub fn write_time_of_day(out: &mut impl Write, time_ns: i64) -> fmt::Result {
    let sign = if time_ns < 0 { "-" } else { "" };
    let time = time_ns.unsigned_abs();
    let (seconds, mut fraction) = (time / SECOND_NS as u64, time % SECOND_NS as u64);
    write!(out, "{sign}{:02}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)?;
    if fraction == 0 {
        return Ok(());
    }
    let mut digits = 9;
    while fraction.is_multiple_of(10) {
        fraction /= 10;
        digits -= 1;
    }
    write!(out, ".{fraction:0digits$}")
}

/// Writes a moment: `2024-02-29-12:34:56`.
///
/// # Errors
/// Those of `out`.
pub fn write_date_and_time(out: &mut impl Write, moment_ns: i64) -> fmt::Result {
    write_date(out, moment_ns)?;
    out.write_char('-')?;
    write_time_of_day(out, date_time(moment_ns))
}

/// The longest prefix that is a date, as `2024-02-29`, `D#2024-2-29`, `DATE#…`, `LD#…` or `LDATE#…`: nanoseconds since 1970-01-01, which may be beyond
/// 64 bits, and the bytes that it takes.
#[must_use]
pub fn parse_date(bytes: &[u8]) -> Option<(i128, usize)> {
    let mut cursor = behind_prefix(bytes, ["LDATE#", "DATE#", "LD#", "D#"]);
    let moment_ns = take_date(&mut cursor)?;
    Some((moment_ns, cursor.at))
}

/// The longest prefix that is a time of day, as `12:34`, `12:34:56.789`, `TOD#…`, `TIME_OF_DAY#…`, `LTOD#…` or `LTIME_OF_DAY#…`: nanoseconds since midnight
/// and the bytes that it takes. What is finer than a nanosecond is cut off. Times outside a day are read as they are written: `25:00:00`, `-00:00:01`.
#[must_use]
pub fn parse_time_of_day(bytes: &[u8]) -> Option<(i128, usize)> {
    let mut cursor = behind_prefix(bytes, ["LTIME_OF_DAY#", "TIME_OF_DAY#", "LTOD#", "TOD#"]);
    let is_negative = cursor.take(b'-');
    let time_ns = take_time(&mut cursor)?;
    Some((if is_negative { -time_ns } else { time_ns }, cursor.at))
}

/// The longest prefix that is a moment, as `2024-02-29-12:34:56`, `DT#…`, `DATE_AND_TIME#…`, `LDT#…` or `LDATE_AND_TIME#…`: as [`parse_date`].
#[must_use]
pub fn parse_date_and_time(bytes: &[u8]) -> Option<(i128, usize)> {
    let mut cursor = behind_prefix(bytes, ["LDATE_AND_TIME#", "DATE_AND_TIME#", "LDT#", "DT#"]);
    let date_ns = take_date(&mut cursor)?;
    let time_ns = cursor.take(b'-').then(|| take_time(&mut cursor)).flatten()?;
    (time_ns < i128::from(DAY_NS)).then_some((date_ns + time_ns, cursor.at))
}

fn behind_prefix<'t>(bytes: &'t [u8], prefixes: [&str; 4]) -> Cursor<'t> {
    let mut cursor = Cursor { bytes, at: 0 };
    let _ = prefixes.iter().any(|prefix| cursor.take_word(prefix));
    cursor
}

/// Takes digits.
fn take_number(cursor: &mut Cursor<'_>) -> Option<i128> {
    let mut number = i128::from(cursor.digit(10)?);
    while let Some(digit) = cursor.digit(10) {
        // As good as infinite: no product below overflows.
        number = (number * 10 + i128::from(digit)).min(i128::from(u64::MAX));
    }
    Some(number)
}

fn take_date(cursor: &mut Cursor<'_>) -> Option<i128> {
    let year = take_number(cursor).filter(|year| *year < 10_000)? as i64;
    let month =
        cursor.take(b'-').then(|| take_number(cursor)).flatten().filter(|month| (1..=12).contains(month))? as i64;
    let day = cursor.take(b'-').then(|| take_number(cursor)).flatten().filter(|day| (1..=31).contains(day))? as i64;
    let days = days_of_months(year * 12 + month - 1, day);
    // A day that does not exist comes back as another one.
    (civil_of_days(days) == (year, month, day)).then(|| i128::from(days) * i128::from(DAY_NS))
}

/// Takes `hours:minutes` and, as far as they make sense, `:seconds` and `.fraction`.
fn take_time(cursor: &mut Cursor<'_>) -> Option<i128> {
    let below_60 = |cursor: &mut Cursor<'_>| {
        cursor.take(b':').then(|| take_number(cursor)).flatten().filter(|number| *number < 60)
    };
    let hours = take_number(cursor)?;
    let minutes = below_60(cursor)?;
    let mut time_ns = (hours * 60 + minutes) * 60 * i128::from(SECOND_NS);
    let before = *cursor;
    let Some(seconds) = below_60(cursor) else {
        *cursor = before;
        return Some(time_ns);
    };
    time_ns += seconds * i128::from(SECOND_NS);
    let before = *cursor;
    let (mut place_ns, mut has_fraction) = (i128::from(SECOND_NS), false);
    if cursor.take(b'.') {
        while let Some(digit) = cursor.digit(10) {
            place_ns /= 10;
            time_ns += i128::from(digit) * place_ns;
            has_fraction = true;
        }
    }
    if !has_fraction {
        *cursor = before;
    }
    Some(time_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(year: i64, month: i64, day: i64) -> i64 {
        date_of(year * 12 + month - 1, day)
    }

    #[test]
    fn every_day_of_eight_centuries_follows_the_one_before() {
        let (mut year, mut month, mut day) = (1600, 1, 1);
        let first = days_of_months(year * 12, day);
        assert_eq!(days_of_months(1970 * 12, 1), 0);
        for days in first..first + 2 * ERA_DAYS {
            assert_eq!(civil_of_days(days), (year, month, day));
            assert_eq!(days_of_months(year * 12 + month - 1, day), days);
            let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
            let last = match month {
                2 => 28 + i64::from(is_leap),
                4 | 6 | 9 | 11 => 30,
                _ => 31,
            };
            (year, month, day) = match (month, day == last) {
                (_, false) => (year, month, day + 1),
                (12, true) => (year + 1, 1, 1),
                (_, true) => (year, month + 1, 1),
            };
        }
    }

    #[test]
    fn parts_of_a_moment() {
        // A Thursday.
        let moment = of(2024, 2, 29) + 45_296 * SECOND_NS + 5;
        assert_eq!((date_year(moment), date_month(moment), date_day(moment), date_weekday(moment)), (2024, 2, 29, 4));
        assert_eq!((date_start(moment), date_time(moment)), (of(2024, 2, 29), 45_296 * SECOND_NS + 5));
        // A nanosecond before 1970, a Wednesday.
        assert_eq!((date_year(-1), date_month(-1), date_day(-1), date_weekday(-1)), (1969, 12, 31, 3));
        assert_eq!((date_start(-1), date_time(-1)), (-DAY_NS, DAY_NS - 1));
        // The first day has no start in 64 bits: it wraps.
        assert_eq!(date_start(i64::MIN), i64::MIN.wrapping_sub(i64::MIN.rem_euclid(DAY_NS)));
        assert_eq!((date_year(i64::MIN), date_year(i64::MAX)), (1677, 2262));
    }

    #[test]
    fn days_and_months_beyond_their_ends_go_on() {
        assert_eq!(of(2024, 13, 1), of(2025, 1, 1));
        assert_eq!(of(2024, 0, 1), of(2023, 12, 1));
        assert_eq!(of(2024, 2, 30), of(2024, 3, 1));
        assert_eq!(of(2024, 3, 0), of(2024, 2, 29));
        assert_eq!(of(1970, 1, -364), of(1969, 1, 1));
        // Exact arithmetic, cut to 64 bits.
        let exact = |months: i64, day: i64| {
            let (year, month) = (i128::from(months).div_euclid(12), months.rem_euclid(12));
            let (eras, within) = (year.div_euclid(400), year.rem_euclid(400) as i64);
            let days =
                eras * i128::from(ERA_DAYS) + i128::from(days_of_months(within * 12 + month, 0)) + i128::from(day);
            (days * i128::from(DAY_NS)) as i64
        };
        for (months, day) in [(i64::MIN, i64::MIN), (i64::MAX, i64::MAX), (i64::MAX, -1), (123_456_789_012_345, 7)] {
            assert_eq!(date_of(months, day), exact(months, day), "{months} {day}");
        }
    }

    #[test]
    fn texts_read_back() {
        for moment in [0, 951_782_400 * SECOND_NS + 1_500_000, -1, i64::MIN, i64::MAX] {
            let mut text = String::new();
            write_date_and_time(&mut text, moment).unwrap();
            assert_eq!(parse_date_and_time(text.as_bytes()), Some((i128::from(moment), text.len())), "{text}");
            text.clear();
            write_time_of_day(&mut text, moment).unwrap();
            assert_eq!(parse_time_of_day(text.as_bytes()), Some((i128::from(moment), text.len())), "{text}");
        }
        assert_eq!(parse_time_of_day(b"23:59:59.9999999999"), Some((i128::from(DAY_NS) - 1, 19)));
        assert_eq!(parse_time_of_day(b"1:2"), Some((3_720 * i128::from(SECOND_NS), 3)));
    }

    #[test]
    fn the_longest_prefix_counts() {
        let day = i128::from(DAY_NS);
        for (text, expected) in [
            ("D#1970-01-02x", Some((day, 12))),
            ("ldate#1970-1-2-3", Some((day, 14))),
            ("2023-02-29", None),
            ("2024-13-01", None),
            ("2024-00-01", None),
            ("2024-01-32", None),
            ("2024-1", None),
            ("10000-01-01", None),
            ("TOD#00:00", None),
            ("99999999999999999999999999999999999999999-1-1", None),
        ] {
            assert_eq!(parse_date(text.as_bytes()), expected, "{text}");
        }
        let second = i128::from(SECOND_NS);
        for (text, expected) in [
            ("TOD#00:01:02.5.6", Some((62_500_000_000, 14))),
            ("00:01:60", Some((60 * second, 5))),
            ("00:01:02.", Some((62 * second, 8))),
            ("00:01:", Some((60 * second, 5))),
            ("-00:00:01", Some((-second, 9))),
            ("00", None),
            ("00:60", None),
            ("", None),
        ] {
            assert_eq!(parse_time_of_day(text.as_bytes()), expected, "{text}");
        }
        assert_eq!(parse_date_and_time(b"DT#1970-01-02-00:00:01"), Some((day + second, 22)));
        assert_eq!(parse_date_and_time(b"1970-01-01-24:00:00"), None);
        assert_eq!(parse_date_and_time(b"1970-01-01"), None);
    }
}
