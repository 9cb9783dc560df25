//! Numbers and times as text, without allocation: what the string instructions and the variable dump write.

use std::fmt::{self, Write};

/// A small text on the stack. What does not fit is dropped, as an assignment to a short STRING does.
#[derive(Debug, Clone, Copy)]
pub struct TextBuffer<const N: usize> {
    bytes: [u8; N],
    len: usize,
}

impl<const N: usize> TextBuffer<N> {
    /// An empty text.
    #[must_use]
    pub fn new() -> Self {
        TextBuffer { bytes: [0; N], len: 0 }
    }

    /// What was written.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&self.bytes)
    }

    /// What was written, as text: empty if a character was cut in its middle.
    #[must_use]
    pub fn as_str(&self) -> &str {
        std::str::from_utf8(self.bytes()).unwrap_or_default()
    }
}

impl<const N: usize> Default for TextBuffer<N> {
    fn default() -> Self {
        TextBuffer::new()
    }
}

impl<const N: usize> Write for TextBuffer<N> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = self.bytes.get_mut(self.len..).unwrap_or_default();
        let taken = room.len().min(text.len());
        room.iter_mut().zip(text.as_bytes()).for_each(|(to, from)| *to = *from);
        self.len += taken;
        Ok(())
    }
}

/// Room for the shortest decimal of any REAL or LREAL between [`PLAIN`]'s ends, or with an exponent.
const REAL_TEXT_BYTES: usize = 40;

/// Magnitudes that are written without an exponent.
const PLAIN: std::ops::Range<f64> = 1e-4..1e16;

macro_rules! write_real {
    ($name:ident, $float:ident, $keyword:literal) => {
        #[doc = concat!("Writes ", $keyword, " as the shortest decimal that reads back to the same bits, as an IEC literal: always with a point, with `E` ")]
        /// below 1E-4 and from 1E16 on. What has no literal is written `NaN`, `Infinity`, `-Infinity`.
        ///
        /// # Errors
        /// Those of `out`.
        pub fn $name(out: &mut impl Write, value: $float) -> fmt::Result {
            if value.is_nan() {
                return out.write_str("NaN");
            }
            if value.is_infinite() {
                return out.write_str(if value > 0.0 { "Infinity" } else { "-Infinity" });
            }
            let magnitude = f64::from(value.abs());
            let mut text = TextBuffer::<REAL_TEXT_BYTES>::new();
            if value == 0.0 || PLAIN.contains(&magnitude) {
                write!(text, "{value}")?;
            } else {
                write!(text, "{value:e}")?;
            }
            let (mantissa, exponent) = text.as_str().split_once('e').unwrap_or((text.as_str(), ""));
            out.write_str(mantissa)?;
            if !mantissa.contains('.') {
                out.write_str(".0")?;
            }
            if exponent.is_empty() { Ok(()) } else { write!(out, "E{exponent}") }
        }
    };
}
write_real!(write_f32, f32, "a REAL");
write_real!(write_f64, f64, "an LREAL");

/// Units of a duration literal, largest first, with their nanoseconds.
pub(crate) const TIME_UNITS: [(&str, u64); 7] = [
    ("d", 86_400_000_000_000),
    ("h", 3_600_000_000_000),
    ("m", 60_000_000_000),
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1_000),
    ("ns", 1),
];

/// Writes a duration in nanoseconds as an IEC literal behind `prefix` (`T` or `LT`), largest units first, without those that are 0: `T#1m30s500ms`,
/// `T#-5ms`, `T#0ms`.
///
/// # Errors
/// Those of `out`.
pub fn write_time(out: &mut impl Write, prefix: &str, duration_ns: i64) -> fmt::Result {
    write!(out, "{prefix}#{}", if duration_ns < 0 { "-" } else { "" })?;
    let mut rest = duration_ns.unsigned_abs();
    if rest == 0 {
        return out.write_str("0ms");
    }
    for (unit, unit_ns) in TIME_UNITS {
        let count = rest / unit_ns;
        rest %= unit_ns;
        if count > 0 {
            write!(out, "{count}{unit}")?;
        }
    }
    Ok(())
}
