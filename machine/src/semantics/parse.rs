//! Numbers and times out of text, without allocation: the longest prefix that is one. The string conversions take the prefix, the
//! variable writer asks for the whole.

use std::fmt::Write;

use super::text::{TIME_UNITS, TextBuffer};

/// Reads a text from its start, one byte at a time.
#[derive(Clone, Copy)]
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl Cursor<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    pub(super) fn take(&mut self, wanted: u8) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    /// Takes `wanted` in any case, whole or not at all.
    pub(super) fn take_word(&mut self, wanted: &str) -> bool {
        let word = self.bytes.get(self.at..).and_then(|rest| rest.get(..wanted.len()));
        let found = word.is_some_and(|word| word.eq_ignore_ascii_case(wanted.as_bytes()));
        self.at += if found { wanted.len() } else { 0 };
        found
    }

    /// Takes an optional sign; true for minus.
    fn sign(&mut self) -> bool {
        let negative = self.take(b'-');
        if !negative {
            self.take(b'+');
        }
        negative
    }

    pub(super) fn digit(&mut self, base: u32) -> Option<u32> {
        let digit = self.peek().and_then(|byte| char::from(byte).to_digit(base))?;
        self.at += 1;
        Some(digit)
    }

    /// Takes digits, with single underscores between them allowed, and hands each to `each`; whether there was one.
    fn digits(&mut self, base: u32, mut each: impl FnMut(u32)) -> bool {
        let start = self.at;
        loop {
            let before = *self;
            if self.at > start {
                self.take(b'_');
            }
            match self.digit(base) {
                Some(digit) => each(digit),
                None => {
                    *self = before;
                    return self.at > start;
                }
            }
        }
    }

    fn magnitude(&mut self, base: u32) -> Option<u128> {
        let mut magnitude: u128 = 0;
        self.digits(base, |digit| {
            magnitude = magnitude.saturating_mul(u128::from(base)).saturating_add(u128::from(digit));
        })
        .then_some(magnitude)
    }
}

/// An integer as text has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct IntegerText {
    /// Whether it has a minus sign.
    pub negative: bool,
    /// Its magnitude; `u128::MAX` when larger.
    pub magnitude: u128,
    /// Bytes it takes.
    pub used: usize,
}

impl IntegerText {
    /// Its value, cut to the range of a signed 128-bit number.
    pub(crate) fn value(self) -> i128 {
        let magnitude = i128::try_from(self.magnitude).unwrap_or(i128::MAX);
        if self.negative { -magnitude } else { magnitude }
    }

    /// Its value as a signed 64-bit number, saturated.
    pub(crate) fn saturated_i64(self) -> i64 {
        self.value().clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64
    }

    /// Its value as an unsigned 64-bit number, saturated.
    pub(crate) fn saturated_u64(self) -> u64 {
        self.value().clamp(0, i128::from(u64::MAX)) as u64
    }
}

/// The longest prefix that is a decimal or based (`2#`, `8#`, `16#`) integer with an optional sign.
pub(crate) fn parse_integer(bytes: &[u8]) -> Option<IntegerText> {
    let mut cursor = Cursor { bytes, at: 0 };
    let negative = cursor.sign();
    let magnitude = cursor.magnitude(10)?;
    let mut decimal = IntegerText { negative, magnitude, used: cursor.at };
    if let 2 | 8 | 16 = magnitude
        && cursor.take(b'#')
        && let Some(based) = cursor.magnitude(magnitude as u32)
    {
        decimal = IntegerText { negative, magnitude: based, used: cursor.at };
    }
    Some(decimal)
}

/// Significant digits that decide how any LREAL rounds (767), and some; further ones only tell whether there is a rest.
const SIGNIFICANT_DIGITS: usize = 780;
const REAL_BUFFER_BYTES: usize = SIGNIFICANT_DIGITS + 32;

/// A floating-point number as text has it, brought to the form `±digits e exponent`.
pub(crate) struct RealText {
    normal: TextBuffer<REAL_BUFFER_BYTES>,
    /// Bytes it takes.
    pub used: usize,
}

impl RealText {
    /// As a REAL, rounded to nearest even.
    pub(crate) fn to_f32(&self) -> f32 {
        self.normal.as_str().parse().map_or(0.0, super::canonical_f32)
    }

    /// As an LREAL, rounded to nearest even.
    pub(crate) fn to_f64(&self) -> f64 {
        self.normal.as_str().parse().map_or(0.0, super::canonical_f64)
    }
}

/// Collects the digits of a number of any length.
struct Significand {
    normal: TextBuffer<REAL_BUFFER_BYTES>,
    count: usize,
    has_rest: bool,
    exponent: i64,
}

impl Significand {
    fn push(&mut self, digit: u32, in_fraction: bool) {
        let is_leading_zero = self.count == 0 && digit == 0;
        if self.count < SIGNIFICANT_DIGITS {
            if !is_leading_zero {
                self.count += 1;
                // Room is there: the count says so.
                let _ = self.normal.write_char(char::from_digit(digit, 10).unwrap_or('0'));
            }
            self.exponent -= i64::from(in_fraction);
        } else {
            self.has_rest |= digit != 0;
            self.exponent += i64::from(!in_fraction);
        }
    }

    fn finish(mut self, explicit_exponent: i64) -> TextBuffer<REAL_BUFFER_BYTES> {
        let mut exponent = self.exponent + explicit_exponent;
        if self.has_rest {
            let _ = self.normal.write_char('1');
            exponent -= 1;
        }
        let _ = write!(self.normal, "{}e{exponent}", if self.count == 0 { "0" } else { "" });
        self.normal
    }
}

/// Exponents beyond this are as good as infinite, even against 65534 digits.
const EXPONENT_LIMIT: i64 = 10_000_000;

/// The longest prefix that is a decimal number with optional sign, fraction and exponent, or `NaN` or `Infinity`.
pub(crate) fn parse_real(bytes: &[u8]) -> Option<RealText> {
    let mut cursor = Cursor { bytes, at: 0 };
    let mut normal = TextBuffer::new();
    if cursor.sign() {
        let _ = normal.write_char('-');
    }
    for name in ["NaN", "Infinity"] {
        if cursor.take_word(name) {
            let _ = normal.write_str(name);
            return Some(RealText { normal, used: cursor.at });
        }
    }
    let mut significand = Significand { normal, count: 0, has_rest: false, exponent: 0 };
    let has_whole = cursor.digits(10, |digit| significand.push(digit, false));
    let mut end = has_whole.then_some(cursor);
    if cursor.take(b'.') && (cursor.digits(10, |digit| significand.push(digit, true)) || has_whole) {
        end = Some(cursor);
    }
    let mut end = end?;
    let mut explicit_exponent: i64 = 0;
    cursor = end;
    if cursor.take(b'e') || cursor.take(b'E') {
        let negative = cursor.sign();
        let found = cursor.digits(10, |digit| {
            explicit_exponent = (explicit_exponent * 10 + i64::from(digit)).min(EXPONENT_LIMIT);
        });
        if found {
            end = cursor;
            explicit_exponent = if negative { -explicit_exponent } else { explicit_exponent };
        }
    }
    Some(RealText { normal: significand.finish(explicit_exponent), used: end.at })
}

/// Fraction digits of a duration that can matter: one day has 8.64E13 nanoseconds.
const DURATION_FRACTION_DIGITS: u32 = 18;

/// A duration in nanoseconds and the bytes it takes: the longest prefix that is a literal of table 8, with or without `T#`, `TIME#`,
/// `LT#`, `LTIME#`. Units fall; only the last may have a fraction, which is cut to whole nanoseconds.
#[must_use]
pub fn parse_time(bytes: &[u8]) -> Option<(i128, usize)> {
    let mut cursor = Cursor { bytes, at: 0 };
    let _ = ["LTIME#", "TIME#", "LT#", "T#"].iter().any(|prefix| cursor.take_word(prefix));
    let negative = cursor.sign();
    let mut total: i128 = 0;
    let mut end = None;
    let mut next_unit = 0;
    while let Some((part_ns, unit, is_last)) = take_duration_part(&mut cursor, next_unit) {
        total = total.saturating_add(part_ns);
        next_unit = unit + 1;
        end = Some(cursor.at);
        if is_last {
            break;
        }
        cursor.take(b'_');
    }
    let total = if negative { -total } else { total };
    end.map(|end| (total, end))
}

/// One number and its unit, no larger than unit `first_unit`: nanoseconds, position of the unit, whether it had a fraction.
fn take_duration_part(cursor: &mut Cursor<'_>, first_unit: usize) -> Option<(i128, usize, bool)> {
    let whole = cursor.magnitude(10)?;
    let (mut fraction, mut scale, mut digits) = (0_u128, 1_u128, 0);
    let has_fraction = cursor.take(b'.');
    if has_fraction {
        let found = cursor.digits(10, |digit| {
            if digits < DURATION_FRACTION_DIGITS {
                fraction = fraction * 10 + u128::from(digit);
                scale *= 10;
                digits += 1;
            }
        });
        if !found {
            return None;
        }
    }
    // `ms` before `m`: a unit of two letters is tried before its first letter.
    let mut units: [usize; TIME_UNITS.len()] = std::array::from_fn(|unit| unit);
    units.reverse();
    units.sort_by_key(|unit| std::cmp::Reverse(TIME_UNITS[*unit].0.len()));
    let unit = units.into_iter().find(|unit| cursor.take_word(TIME_UNITS[*unit].0))?;
    if unit < first_unit {
        return None;
    }
    let unit_ns = u128::from(TIME_UNITS[unit].1);
    let part = whole.saturating_mul(unit_ns).saturating_add(fraction * unit_ns / scale);
    Some((i128::try_from(part).unwrap_or(i128::MAX), unit, has_fraction))
}
