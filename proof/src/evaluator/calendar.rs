//! The rows of the calendar, by counting: years are walked one by one, months by their lengths.

/// Nanoseconds of a day.
const DAY_NS: i128 = 86_400_000_000_000;
/// Days from 0001-01-01 to 1970-01-01.
const DAYS_TO_1970: i128 = 719_162;

fn is_leap(year: i128) -> bool {
    year.rem_euclid(4) == 0 && (year.rem_euclid(100) != 0 || year.rem_euclid(400) == 0)
}

fn month_lengths(year: i128) -> [i128; 12] {
    [31, if is_leap(year) { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31]
}

/// Year, month and day of a moment in nanoseconds since 1970-01-01.
pub(crate) fn civil(moment_ns: i128) -> (i128, i128, i128) {
    let mut day = moment_ns.div_euclid(DAY_NS);
    let mut year = 1970;
    while day < 0 {
        year -= 1;
        day += month_lengths(year).iter().sum::<i128>();
    }
    loop {
        let length = month_lengths(year).iter().sum::<i128>();
        if day < length {
            break;
        }
        day -= length;
        year += 1;
    }
    let mut month = 1;
    for length in month_lengths(year) {
        if day < length {
            break;
        }
        day -= length;
        month += 1;
    }
    (year, month, day + 1)
}

/// The start of a day, in nanoseconds since 1970-01-01; months beyond a year's and days beyond a month's count on.
pub(crate) fn start_of(year: i128, month: i128, day: i128) -> i128 {
    let months = year * 12 + month - 1;
    let (year, month) = (months.div_euclid(12), months.rem_euclid(12));
    let before = year - 1;
    let leap_days = before.div_euclid(4) - before.div_euclid(100) + before.div_euclid(400);
    let in_year: i128 = month_lengths(year).iter().take(month as usize).sum();
    (before * 365 + leap_days + in_year + day - 1 - DAYS_TO_1970) * DAY_NS
}

/// Nanoseconds since the start of the day.
pub(crate) fn time_of_day(moment_ns: i128) -> i128 {
    moment_ns.rem_euclid(DAY_NS)
}

/// 0 on Sundays. 1970-01-01 was a Thursday.
pub(crate) fn weekday(moment_ns: i128) -> i128 {
    (moment_ns.div_euclid(DAY_NS) + 4).rem_euclid(7)
}

/// Computes a row of the group `date`.
pub(super) fn compute(name: &str, a: i128, b: i128) -> i128 {
    match name {
        "start" => a - time_of_day(a),
        "time" => time_of_day(a),
        "year" => civil(a).0,
        "month" => civil(a).1,
        "day" => civil(a).2,
        "weekday" => weekday(a),
        "of" => start_of(0, a + 1, b),
        _ => panic!("no meaning for date.{name}"),
    }
}
