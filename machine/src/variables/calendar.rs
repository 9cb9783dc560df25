//! Dates and times of day as IEC literals (IEC 61131-3, table 9): nanoseconds since 1970-01-01 or since midnight, proleptic Gregorian.

use std::fmt::{self, Write};

/// Nanoseconds of a day.
pub(super) const DAY_NS: i64 = 86_400_000_000_000;
const SECOND_NS: i64 = 1_000_000_000;
/// Days of 400 years, after which the calendar repeats.
const ERA_DAYS: i64 = 146_097;
/// Days from 0000-03-01 to 1970-01-01.
const EPOCH_DAYS: i64 = 719_468;

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

/// Days since 1970-01-01.
fn days_of_civil(year: i64, month: i64, day: i64) -> i64 {
    let year_from_march = year - i64::from(month <= 2);
    let (era, year_of_era) = (year_from_march.div_euclid(400), year_from_march.rem_euclid(400));
    let month_from_march = (month + 9) % 12;
    let day_of_year = (153 * month_from_march + 2) / 5 + day - 1;
    era * ERA_DAYS + 365 * year_of_era + year_of_era / 4 - year_of_era / 100 + day_of_year - EPOCH_DAYS
}

/// Writes the day that a moment lies in: `2024-02-29`.
pub(super) fn write_date(out: &mut impl Write, moment_ns: i64) -> fmt::Result {
    let (year, month, day) = civil_of_days(moment_ns.div_euclid(DAY_NS));
    write!(out, "{year:04}-{month:02}-{day:02}")
}

/// Writes a time of day: `12:34:56` or `12:34:56.789`. Times outside a day, which arithmetic can make, show as they are: `25:00:00`, `-00:00:01`.
pub(super) fn write_time_of_day(out: &mut impl Write, time_ns: i64) -> fmt::Result {
    let sign = if time_ns < 0 { "-" } else { "" };
    let time = time_ns.unsigned_abs();
    let (seconds, fraction) = (time / SECOND_NS as u64, time % SECOND_NS as u64);
    write!(out, "{sign}{:02}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)?;
    if fraction == 0 {
        return Ok(());
    }
    let digits = format!("{fraction:09}");
    write!(out, ".{}", digits.trim_end_matches('0'))
}

/// Reads `2024-02-29`: nanoseconds since 1970-01-01.
pub(super) fn parse_date(text: &str) -> Option<i64> {
    let mut parts = text.splitn(3, '-').map(decimal);
    let (year, month, day) = (parts.next()??, parts.next()??, parts.next()??);
    let days = days_of_civil(year, month, day);
    // A day that does not exist comes back as another one.
    (year < 10_000 && civil_of_days(days) == (year, month, day)).then(|| days.checked_mul(DAY_NS)).flatten()
}

/// Reads `12:34`, `12:34:56` or `12:34:56.789`: nanoseconds since midnight.
pub(super) fn parse_time_of_day(text: &str) -> Option<i64> {
    let mut parts = text.splitn(3, ':');
    let hours = decimal(parts.next()?).filter(|hours| *hours < 24)?;
    let minutes = decimal(parts.next()?).filter(|minutes| *minutes < 60)?;
    let (seconds, fraction) = parts.next().map_or(("0", ""), |part| part.split_once('.').unwrap_or((part, "")));
    let seconds = decimal(seconds).filter(|seconds| *seconds < 60)?;
    if fraction.len() > 9 || !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let fraction_ns = decimal(&format!("{fraction:0<9}"))?;
    Some(((hours * 60 + minutes) * 60 + seconds) * SECOND_NS + fraction_ns)
}

/// Reads `2024-02-29-12:34:56`: nanoseconds since 1970-01-01.
pub(super) fn parse_date_and_time(text: &str) -> Option<i64> {
    let (date, time) = text.rsplit_once('-')?;
    parse_date(date)?.checked_add(parse_time_of_day(time)?)
}

fn decimal(text: &str) -> Option<i64> {
    // Nine digits are the most that a part may have, so no sum here overflows.
    let is_number = (1..=9).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_day_of_eight_centuries_follows_the_one_before() {
        let (mut year, mut month, mut day) = (1600, 1, 1);
        let first = days_of_civil(year, month, day);
        assert_eq!(days_of_civil(1970, 1, 1), 0);
        for days in first..first + 2 * ERA_DAYS {
            assert_eq!(civil_of_days(days), (year, month, day));
            assert_eq!(days_of_civil(year, month, day), days);
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
    fn texts_read_back_and_impossible_ones_do_not_read() {
        for moment in [0, 951_782_400 * SECOND_NS + 1_500_000, -1, i64::MIN, i64::MAX] {
            let mut text = String::new();
            write_date(&mut text, moment).unwrap();
            text.push('-');
            write_time_of_day(&mut text, moment.rem_euclid(DAY_NS)).unwrap();
            if let Some(again) = parse_date_and_time(&text) {
                assert_eq!(again, moment, "{text}");
            } else {
                assert_eq!(moment, i64::MIN, "{text}: only the day before the first whole one has no start");
            }
        }
        for text in ["2023-02-29", "2024-13-01", "2024-00-01", "2024-1", "x", "2024-01-01-24:00:00"] {
            assert_eq!(parse_date(text), None, "{text}");
            assert_eq!(parse_date_and_time(text), None, "{text}");
        }
        assert_eq!(parse_time_of_day("23:59:59.999999999"), Some(DAY_NS - 1));
        assert_eq!(parse_time_of_day("1:2"), Some(3_720 * SECOND_NS));
    }
}
