//! The string instructions, on the bytes of an image.
//!
//! A string is the characters before its first 0, at most as many as its capacity: bytes of a `STRING`, UTF-16 code units (little-endian, two bytes
//! each) of a `WSTRING`. Positions count from 1; what lies outside a string clamps. A result is cut to the capacity of its destination and
//! terminated; what stands behind the terminator stays as it was. The destination may be, or overlap, any source: the result is as if all sources
//! were read first.
//!
//! Both widths share one body, generic over the bytes of a character: `W` is 1 or 2. Nothing allocates, and nothing panics: a place that reaches
//! beyond `memory` ends where `memory` does.

use std::fmt::Write;
use std::ops::Range;

use super::calendar::{
    parse_date, parse_date_and_time, parse_time_of_day, write_date, write_date_and_time, write_time_of_day,
};
use super::parse::{IntegerText, parse_integer, parse_real, parse_time};
use super::search::find_units;
use super::text::{TextBuffer, write_f32, write_f64, write_time};

/// Where a `STRING[capacity]` or `WSTRING[capacity]` lies; the row says which.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StringPlace {
    /// Offset of its first byte from the start of `memory`.
    pub at: u32,
    /// Characters that it can hold; the terminator comes on top.
    pub capacity: u16,
}

impl StringPlace {
    /// Bytes that its characters may take in `memory`, the terminator's left out: whole characters only.
    #[inline]
    fn room<const W: usize>(self, memory: &[u8]) -> Range<usize> {
        let start = (self.at as usize).min(memory.len());
        let bytes = (usize::from(self.capacity) * W).min(memory.len() - start);
        start..start + bytes / W * W
    }

    /// Bytes of its characters.
    #[inline]
    fn characters<const W: usize>(self, memory: &[u8]) -> Range<usize> {
        let room = self.room::<W>(memory);
        let bytes = memory.get(room.clone()).unwrap_or_default();
        room.start..room.start + length::<W>(bytes)
    }

    /// The characters of a `STRING`.
    #[inline]
    #[must_use]
    pub fn text(self, memory: &[u8]) -> &[u8] {
        memory.get(self.characters::<1>(memory)).unwrap_or_default()
    }

    /// The code units of a `WSTRING`.
    #[inline]
    #[must_use]
    pub fn units(self, memory: &[u8]) -> &[[u8; 2]] {
        memory.get(self.characters::<2>(memory)).unwrap_or_default().as_chunks::<2>().0
    }
}

/// How many bytes stand before the first character 0. Strings of a controller are short: eight bytes at a time in place are faster than a call of a
/// routine for long ones.
#[inline]
fn length<const W: usize>(bytes: &[u8]) -> usize {
    // Lanes of one character each: their lowest and their highest bits.
    let ones: u64 = if W == 1 { u64::MAX / 0xFF } else { u64::MAX / 0xFFFF };
    let high = ones << (8 * W as u32 - 1);
    let (words, rest) = bytes.as_chunks::<8>();
    for (position, word) in words.iter().enumerate() {
        let word = u64::from_le_bytes(*word);
        // The lowest bit that is set marks the first 0; above it there may be false ones.
        let zeros = word.wrapping_sub(ones) & !word & high;
        if zeros != 0 {
            let lane_bytes = W as u32 * 8;
            return position * 8 + (zeros.trailing_zeros() / lane_bytes * W as u32) as usize;
        }
    }
    let in_rest = rest.chunks_exact(W).position(|unit| unit.iter().all(|byte| *byte == 0));
    words.len() * 8 + in_rest.map_or(rest.len(), |units| units * W)
}

/// One copy of a part of a source to its place in the destination.
#[derive(Clone, Copy, Default)]
struct Move {
    from: usize,
    to: usize,
    len: usize,
}

impl Move {
    /// Whether doing this one would destroy what `other` has still to read.
    #[inline]
    fn destroys(&self, other: &Move) -> bool {
        self.to < other.from + other.len && other.from < self.to + self.len
    }
}

/// Makes `dst` the pieces one behind the other, cut to its capacity, and terminates it.
///
/// The pieces' targets never overlap, so each copy may run as soon as no other has still to read from its target; with few pieces
/// such an order nearly always exists. When each would destroy another's source, the rest goes through a scratch buffer.
#[inline]
fn assemble<const W: usize, const N: usize>(memory: &mut [u8], dst: StringPlace, pieces: [Range<usize>; N]) {
    let mut room = dst.room::<W>(memory);
    let mut pending = [Move::default(); N];
    for (slot, piece) in pending.iter_mut().zip(pieces) {
        let len = piece.len().min(room.len());
        // A piece that is in place already is done: no other target overlaps it.
        if piece.start != room.start {
            *slot = Move { from: piece.start, to: room.start, len };
        }
        room.start += len;
    }
    while pending.iter().any(|step| step.len > 0) {
        let is_free = |i: usize, step: &Move| {
            step.len > 0
                && !pending.iter().enumerate().any(|(j, other)| i != j && other.len > 0 && step.destroys(other))
        };
        let Some(next) = pending.iter().enumerate().position(|(i, step)| is_free(i, step)) else {
            copy_through_scratch(memory, &pending);
            break;
        };
        let step = pending[next];
        memory.copy_within(step.from..step.from + step.len, step.to);
        pending[next].len = 0;
    }
    terminate::<W>(memory, room.start);
}

/// Puts a terminator; of a place that is cut by the end of `memory`, what there is of it.
#[inline]
fn terminate<const W: usize>(memory: &mut [u8], at: usize) {
    memory.get_mut(at..).unwrap_or_default().iter_mut().take(W).for_each(|byte| *byte = 0);
}

/// Does copies whose targets lie in each other's sources. Buffers come in four sizes, so that short strings do not pay for long ones.
#[cold]
#[inline(never)]
fn copy_through_scratch(memory: &mut [u8], moves: &[Move]) {
    match moves.iter().map(|step| step.len).sum::<usize>() {
        0..=512 => copy_through::<512>(memory, moves),
        513..=8192 => copy_through::<8192>(memory, moves),
        8193..=65536 => copy_through::<65536>(memory, moves),
        _ => copy_through::<131_072>(memory, moves),
    }
}

#[inline(never)]
fn copy_through<const N: usize>(memory: &mut [u8], moves: &[Move]) {
    let mut scratch = [0_u8; N];
    let mut filled = 0;
    for step in moves {
        let source = memory.get(step.from..step.from + step.len).unwrap_or_default();
        scratch.iter_mut().skip(filled).zip(source).for_each(|(to, from)| *to = *from);
        filled += step.len;
    }
    filled = 0;
    for step in moves {
        let target = memory.get_mut(step.to..step.to + step.len).unwrap_or_default();
        target.iter_mut().zip(scratch.iter().skip(filled)).for_each(|(to, from)| *to = *from);
        filled += step.len;
    }
}

/// Makes `dst` these characters, computed one by one; they do not come from `memory`.
#[inline]
fn store<const W: usize>(memory: &mut [u8], dst: StringPlace, units: impl Iterator<Item = [u8; W]>) {
    let room = dst.room::<W>(memory);
    let target = memory.get_mut(room.clone()).unwrap_or_default();
    let mut end = room.start;
    for (to, unit) in target.chunks_exact_mut(W).zip(units) {
        to.copy_from_slice(&unit);
        end += W;
    }
    terminate::<W>(memory, end);
}

/// Makes `dst` the characters of `source`, each turned into one of the other width.
///
/// The two may overlap. A character is written over what has been read only where the destination does not run ahead of the source, so that the
/// direction follows from the places: narrowing from the start goes wrong only where the destination begins behind the source, widening
/// from the end only where it begins before. Such rare places go through a scratch buffer.
fn recode<const F: usize, const T: usize>(
    memory: &mut [u8],
    dst: StringPlace,
    source: Range<usize>,
    convert: impl Fn([u8; F]) -> [u8; T],
) {
    let room = dst.room::<T>(memory);
    let count = (source.len() / F).min(room.len() / T);
    let (from_end, to_end) = (source.start + count * F, room.start + count * T);
    let apart = to_end <= source.start || from_end <= room.start;
    if apart || (T <= F && room.start <= source.start) {
        for at in 0..count {
            copy_unit(memory, source.start + at * F, room.start + at * T, &convert);
        }
    } else if T >= F && room.start >= source.start {
        for at in (0..count).rev() {
            copy_unit(memory, source.start + at * F, room.start + at * T, &convert);
        }
    } else {
        recode_through_scratch(memory, room.start, source.start, count, &convert);
    }
    terminate::<T>(memory, to_end);
}

#[inline]
fn copy_unit<const F: usize, const T: usize>(
    memory: &mut [u8],
    from: usize,
    to: usize,
    convert: impl Fn([u8; F]) -> [u8; T],
) {
    let mut unit = [0; F];
    unit.copy_from_slice(memory.get(from..from + F).unwrap_or(&[0; F]));
    if let Some(target) = memory.get_mut(to..to + T) {
        target.copy_from_slice(&convert(unit));
    }
}

/// [`recode`] where neither direction is safe.
#[cold]
#[inline(never)]
fn recode_through_scratch<const F: usize, const T: usize>(
    memory: &mut [u8],
    to: usize,
    from: usize,
    count: usize,
    convert: &impl Fn([u8; F]) -> [u8; T],
) {
    let mut scratch = [0_u8; 131_072];
    let source = memory.get(from..from + count * F).unwrap_or_default();
    scratch.iter_mut().zip(source).for_each(|(kept, byte)| *kept = *byte);
    let target = memory.get_mut(to..to + count * T).unwrap_or_default();
    for (to, unit) in target.as_chunks_mut::<T>().0.iter_mut().zip(scratch.as_chunks::<F>().0) {
        *to = convert(*unit);
    }
}

/// A signed count cut to 0..=`most` characters, in bytes; `most` is in bytes.
#[inline]
fn clamp<const W: usize>(count: i32, most: usize) -> usize {
    usize::try_from(count).unwrap_or(0).min(most / W) * W
}

/// The two ranges of `text` around `count` characters from 1-based `position` on; positions before the first count as the first.
#[inline]
fn around<const W: usize>(text: &Range<usize>, count: i32, position: i32) -> (Range<usize>, Range<usize>) {
    let start = text.start + clamp::<W>(position.saturating_sub(1), text.len());
    let end = start + clamp::<W>(count, text.end - start);
    (text.start..start, end..text.end)
}

/// The rows that both widths have: the same body under two names.
macro_rules! both_widths {
    ($W:ident; $($narrow:ident $wide:ident [$($mutability:ident)?] ($memory:ident $(, $argument:ident: $ty:ty)*) $(-> $result:ty)? = $body:expr;)*) => { $(
        #[doc = concat!("The row `", stringify!($narrow), "`.")]
        #[inline]
        #[allow(clippy::must_use_candidate, reason = "only some rows have a result")]
        pub fn $narrow($memory: &$($mutability)? [u8] $(, $argument: $ty)*) $(-> $result)? {
            const $W: usize = 1;
            $body
        }

        #[doc = concat!("The row `", stringify!($wide), "`.")]
        #[inline]
        #[allow(clippy::must_use_candidate, reason = "only some rows have a result")]
        pub fn $wide($memory: &$($mutability)? [u8] $(, $argument: $ty)*) $(-> $result)? {
            const $W: usize = 2;
            $body
        }
    )* };
}
both_widths! { W;
    string_assign wide_assign [mut] (memory, dst: StringPlace, src: StringPlace) = {
        let text = src.characters::<W>(memory);
        assemble::<W, 1>(memory, dst, [text]);
    };
    string_len wide_len [] (memory, src: StringPlace) -> i32 = (src.characters::<W>(memory).len() / W) as i32;
    string_left wide_left [mut] (memory, dst: StringPlace, src: StringPlace, count: i32) = {
        let text = src.characters::<W>(memory);
        let part = text.start..text.start + clamp::<W>(count, text.len());
        assemble::<W, 1>(memory, dst, [part]);
    };
    string_right wide_right [mut] (memory, dst: StringPlace, src: StringPlace, count: i32) = {
        let text = src.characters::<W>(memory);
        let part = text.end - clamp::<W>(count, text.len())..text.end;
        assemble::<W, 1>(memory, dst, [part]);
    };
    string_mid wide_mid [mut] (memory, dst: StringPlace, src: StringPlace, count: i32, position: i32) = {
        let text = src.characters::<W>(memory);
        let (before, behind) = around::<W>(&text, count, position);
        let part = before.end..behind.start;
        assemble::<W, 1>(memory, dst, [part]);
    };
    string_concat wide_concat [mut] (memory, dst: StringPlace, a: StringPlace, b: StringPlace) = {
        let pieces = [a.characters::<W>(memory), b.characters::<W>(memory)];
        assemble::<W, 2>(memory, dst, pieces);
    };
    string_insert wide_insert [mut] (memory, dst: StringPlace, a: StringPlace, b: StringPlace, position: i32) = {
        let (text, inserted) = (a.characters::<W>(memory), b.characters::<W>(memory));
        let at = text.start + clamp::<W>(position, text.len());
        assemble::<W, 3>(memory, dst, [text.start..at, inserted, at..text.end]);
    };
    string_delete wide_delete [mut] (memory, dst: StringPlace, src: StringPlace, count: i32, position: i32) = {
        let (before, behind) = around::<W>(&src.characters::<W>(memory), count, position);
        assemble::<W, 2>(memory, dst, [before, behind]);
    };
    string_replace wide_replace [mut] (memory, dst: StringPlace, a: StringPlace, b: StringPlace, count: i32, position: i32) = {
        let (before, behind) = around::<W>(&a.characters::<W>(memory), count, position);
        let inserted = b.characters::<W>(memory);
        assemble::<W, 3>(memory, dst, [before, inserted, behind]);
    };
}

/// The row `string_find`.
#[inline]
#[must_use]
pub fn string_find(memory: &[u8], a: StringPlace, b: StringPlace) -> i32 {
    let (text, wanted) = (a.text(memory), b.text(memory));
    if wanted.is_empty() {
        return 0;
    }
    let found = if text.len() <= SHORT_BYTES { find_short(text, wanted) } else { memchr::memmem::find(text, wanted) };
    found.map_or(0, |at| at as i32 + 1)
}

/// Longest text that is searched place by place: what makes long searches fast takes longer to set up than this.
const SHORT_BYTES: usize = 128;

#[inline]
fn find_short(text: &[u8], wanted: &[u8]) -> Option<usize> {
    let (first, rest) = wanted.split_first()?;
    let places = text.len().checked_sub(rest.len())?;
    let starts = text.iter().take(places).enumerate().filter(|(_, byte)| *byte == first);
    starts.map(|(at, _)| at).find(|at| text.get(at + 1..).is_some_and(|behind| behind.starts_with(rest)))
}

/// The row `wide_find`.
#[inline]
#[must_use]
pub fn wide_find(memory: &[u8], a: StringPlace, b: StringPlace) -> i32 {
    find_units(a.units(memory), b.units(memory)).map_or(0, |at| at as i32 + 1)
}

/// The row `string_compare`.
#[inline]
#[must_use]
pub fn string_compare(memory: &[u8], a: StringPlace, b: StringPlace) -> i32 {
    a.text(memory).cmp(b.text(memory)) as i32
}

/// The row `wide_compare`.
#[inline]
#[must_use]
pub fn wide_compare(memory: &[u8], a: StringPlace, b: StringPlace) -> i32 {
    let (a, b) = (a.units(memory).iter(), b.units(memory).iter());
    a.map(|unit| u16::from_le_bytes(*unit)).cmp(b.map(|unit| u16::from_le_bytes(*unit))) as i32
}

/// The row `string_from_char`.
#[inline]
pub fn string_from_char(memory: &mut [u8], dst: StringPlace, code: i32) {
    store::<1>(memory, dst, Some([code as u8]).filter(|unit| *unit != [0]).into_iter());
}

/// The row `wide_from_char`.
#[inline]
pub fn wide_from_char(memory: &mut [u8], dst: StringPlace, code: i32) {
    store::<2>(memory, dst, Some((code as u16).to_le_bytes()).filter(|unit| *unit != [0, 0]).into_iter());
}

/// The row `string_from_wide`.
#[inline]
pub fn string_from_wide(memory: &mut [u8], dst: StringPlace, src: StringPlace) {
    let source = src.characters::<2>(memory);
    recode::<2, 1>(memory, dst, source, |unit| [u8::try_from(u16::from_le_bytes(unit)).unwrap_or(NO_LATIN_1)]);
}

/// The row `wide_from_string`.
#[inline]
pub fn wide_from_string(memory: &mut [u8], dst: StringPlace, src: StringPlace) {
    let source = src.characters::<1>(memory);
    recode::<1, 2>(memory, dst, source, |[byte]| [byte, 0]);
}

/// What stands in a STRING for a code unit that Latin-1 does not have.
pub const NO_LATIN_1: u8 = b'?';

/// Room for every number and time that is written.
const NUMBER_BYTES: usize = 64;

macro_rules! from_values {
    ($($(#[$doc:meta])* $name:ident($ty:ty) |$out:ident, $value:ident| $write:expr;)*) => { $(
        $(#[$doc])*
        pub fn $name(memory: &mut [u8], dst: StringPlace, $value: $ty) {
            let mut text = TextBuffer::<NUMBER_BYTES>::new();
            let $out = &mut text;
            // A buffer does not fail.
            let _ = $write;
            store::<1>(memory, dst, text.bytes().iter().map(|byte| [*byte]));
        }
    )* };
}
from_values! {
    /// The row `string_from_i64`.
    string_from_i64(i64) |out, value| write!(out, "{value}");
    /// The row `string_from_u64`.
    string_from_u64(i64) |out, value| write!(out, "{}", value as u64);
    /// The row `string_from_f32`.
    string_from_f32(f32) |out, value| write_f32(out, value);
    /// The row `string_from_f64`.
    string_from_f64(f64) |out, value| write_f64(out, value);
    /// The row `string_from_bool`.
    string_from_bool(i32) |out, value| out.write_str(if value != 0 { "TRUE" } else { "FALSE" });
    /// The row `string_from_time`.
    string_from_time(i64) |out, value| write_time(out, "T", value);
    /// The row `string_from_date`.
    string_from_date(i64) |out, value| out.write_str("D#").and_then(|()| write_date(out, value));
    /// The row `string_from_tod`.
    string_from_tod(i64) |out, value| out.write_str("TOD#").and_then(|()| write_time_of_day(out, value));
    /// The row `string_from_dt`.
    string_from_dt(i64) |out, value| out.write_str("DT#").and_then(|()| write_date_and_time(out, value));
}

/// The row `string_to_i64`.
#[must_use]
pub fn string_to_i64(memory: &[u8], src: StringPlace) -> i64 {
    parse_integer(src.text(memory)).map_or(0, IntegerText::saturated_i64)
}

/// The row `string_to_u64`.
#[must_use]
pub fn string_to_u64(memory: &[u8], src: StringPlace) -> i64 {
    parse_integer(src.text(memory)).map_or(0, |integer| integer.saturated_u64() as i64)
}

/// The row `string_to_f32`.
#[must_use]
pub fn string_to_f32(memory: &[u8], src: StringPlace) -> f32 {
    parse_real(src.text(memory)).map_or(0.0, |real| real.to_f32())
}

/// The row `string_to_f64`.
#[must_use]
pub fn string_to_f64(memory: &[u8], src: StringPlace) -> f64 {
    parse_real(src.text(memory)).map_or(0.0, |real| real.to_f64())
}

/// The row `string_to_bool`.
#[must_use]
pub fn string_to_bool(memory: &[u8], src: StringPlace) -> i32 {
    i32::from(src.text(memory).eq_ignore_ascii_case(b"TRUE"))
}

/// The row `string_to_time`.
#[must_use]
pub fn string_to_time(memory: &[u8], src: StringPlace) -> i64 {
    saturated(parse_time(src.text(memory)))
}

/// The row `string_to_date`.
#[must_use]
pub fn string_to_date(memory: &[u8], src: StringPlace) -> i64 {
    saturated(parse_date(src.text(memory)))
}

/// The row `string_to_tod`.
#[must_use]
pub fn string_to_tod(memory: &[u8], src: StringPlace) -> i64 {
    saturated(parse_time_of_day(src.text(memory)))
}

/// The row `string_to_dt`.
#[must_use]
pub fn string_to_dt(memory: &[u8], src: StringPlace) -> i64 {
    saturated(parse_date_and_time(src.text(memory)))
}

/// Nanoseconds out of a text in 64 bits; 0 without any.
fn saturated(parsed: Option<(i128, usize)>) -> i64 {
    parsed.map_or(0, |(value_ns, _)| value_ns.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64)
}
