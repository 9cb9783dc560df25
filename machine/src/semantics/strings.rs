//! The string instructions, on the bytes of an image.
//!
//! A string is the bytes before its first 0, at most as many as its capacity. Positions count from 1; what lies outside a string
//! clamps. A result is cut to the capacity of its destination and terminated; bytes behind the terminator stay as they were. The
//! destination may be, or overlap, any source: the result is as if all sources were read first.
//!
//! Nothing allocates, and nothing panics: a place that reaches beyond `memory` ends where `memory` does.

use std::fmt::Write;
use std::ops::Range;

use super::calendar::{
    parse_date, parse_date_and_time, parse_time_of_day, write_date, write_date_and_time, write_time_of_day,
};
use super::parse::{IntegerText, parse_integer, parse_real, parse_time};
use super::text::{TextBuffer, write_f32, write_f64, write_time};

/// Where a `STRING[capacity]` lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StringPlace {
    /// Offset of its first byte from the start of `memory`.
    pub at: u32,
    /// Characters that it can hold; the terminator comes on top.
    pub capacity: u16,
}

impl StringPlace {
    /// Bytes that its characters may take in `memory`, the terminator's left out.
    #[inline]
    fn room(self, memory: &[u8]) -> Range<usize> {
        let start = (self.at as usize).min(memory.len());
        let end = (self.at as usize).saturating_add(usize::from(self.capacity)).min(memory.len());
        start..end
    }

    /// Bytes of its characters.
    #[inline]
    fn characters(self, memory: &[u8]) -> Range<usize> {
        let room = self.room(memory);
        let bytes = memory.get(room.clone()).unwrap_or_default();
        room.start..room.start + length(bytes)
    }

    /// Its characters.
    #[inline]
    #[must_use]
    pub fn text(self, memory: &[u8]) -> &[u8] {
        memory.get(self.characters(memory)).unwrap_or_default()
    }
}

/// How many bytes stand before the first 0. Strings of a controller are short: eight bytes at a time in place are faster than a call of a routine
/// for long ones.
#[inline]
fn length(bytes: &[u8]) -> usize {
    const ONES: u64 = u64::from_le_bytes([1; 8]);
    const HIGH: u64 = u64::from_le_bytes([0x80; 8]);
    let (words, rest) = bytes.as_chunks::<8>();
    for (position, word) in words.iter().enumerate() {
        let word = u64::from_le_bytes(*word);
        // The lowest bit that is set marks the first 0; above it there may be false ones.
        let zeros = word.wrapping_sub(ONES) & !word & HIGH;
        if zeros != 0 {
            return position * 8 + (zeros.trailing_zeros() / 8) as usize;
        }
    }
    let in_rest = rest.iter().position(|byte| *byte == 0).unwrap_or(rest.len());
    words.len() * 8 + in_rest
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
fn assemble<const N: usize>(memory: &mut [u8], dst: StringPlace, pieces: [Range<usize>; N]) {
    let mut room = dst.room(memory);
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
    if let Some(terminator) = memory.get_mut(room.start) {
        *terminator = 0;
    }
}

/// Does copies whose targets lie in each other's sources. Buffers come in three sizes, so that short strings do not pay for long ones.
#[cold]
#[inline(never)]
fn copy_through_scratch(memory: &mut [u8], moves: &[Move]) {
    match moves.iter().map(|step| step.len).sum::<usize>() {
        0..=512 => copy_through::<512>(memory, moves),
        513..=8192 => copy_through::<8192>(memory, moves),
        _ => copy_through::<65536>(memory, moves),
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

/// Makes `dst` this text.
#[inline]
fn store_text(memory: &mut [u8], dst: StringPlace, text: &[u8]) {
    let room = dst.room(memory);
    let len = text.len().min(room.len());
    let target = memory.get_mut(room.start..).unwrap_or_default();
    target.iter_mut().zip(&text[..len]).for_each(|(to, from)| *to = *from);
    if let Some(terminator) = target.get_mut(len) {
        *terminator = 0;
    }
}

/// A signed count cut to 0..=`most`.
#[inline]
fn clamp(count: i32, most: usize) -> usize {
    usize::try_from(count).unwrap_or(0).min(most)
}

/// The two ranges of `text` around `count` characters from 1-based `position` on; positions before the first count as the first.
#[inline]
fn around(text: &Range<usize>, count: i32, position: i32) -> (Range<usize>, Range<usize>) {
    let start = text.start + clamp(position.saturating_sub(1), text.len());
    let end = start + clamp(count, text.end - start);
    (text.start..start, end..text.end)
}

/// The row `string_assign`.
#[inline]
pub fn string_assign(memory: &mut [u8], dst: StringPlace, src: StringPlace) {
    let text = src.characters(memory);
    assemble(memory, dst, [text]);
}

/// The row `string_len`.
#[inline]
#[must_use]
pub fn string_len(memory: &[u8], src: StringPlace) -> i32 {
    src.characters(memory).len() as i32
}

/// The row `string_left`.
#[inline]
pub fn string_left(memory: &mut [u8], dst: StringPlace, src: StringPlace, count: i32) {
    let text = src.characters(memory);
    let part = text.start..text.start + clamp(count, text.len());
    assemble(memory, dst, [part]);
}

/// The row `string_right`.
#[inline]
pub fn string_right(memory: &mut [u8], dst: StringPlace, src: StringPlace, count: i32) {
    let text = src.characters(memory);
    let part = text.end - clamp(count, text.len())..text.end;
    assemble(memory, dst, [part]);
}

/// The row `string_mid`.
#[inline]
pub fn string_mid(memory: &mut [u8], dst: StringPlace, src: StringPlace, count: i32, position: i32) {
    let text = src.characters(memory);
    let (before, behind) = around(&text, count, position);
    let part = before.end..behind.start;
    assemble(memory, dst, [part]);
}

/// The row `string_concat`.
#[inline]
pub fn string_concat(memory: &mut [u8], dst: StringPlace, a: StringPlace, b: StringPlace) {
    let pieces = [a.characters(memory), b.characters(memory)];
    assemble(memory, dst, pieces);
}

/// The row `string_insert`.
#[inline]
pub fn string_insert(memory: &mut [u8], dst: StringPlace, a: StringPlace, b: StringPlace, position: i32) {
    let (text, inserted) = (a.characters(memory), b.characters(memory));
    let at = text.start + clamp(position, text.len());
    assemble(memory, dst, [text.start..at, inserted, at..text.end]);
}

/// The row `string_delete`.
#[inline]
pub fn string_delete(memory: &mut [u8], dst: StringPlace, src: StringPlace, count: i32, position: i32) {
    let (before, behind) = around(&src.characters(memory), count, position);
    assemble(memory, dst, [before, behind]);
}

/// The row `string_replace`.
#[inline]
pub fn string_replace(memory: &mut [u8], dst: StringPlace, a: StringPlace, b: StringPlace, count: i32, position: i32) {
    let (before, behind) = around(&a.characters(memory), count, position);
    let inserted = b.characters(memory);
    assemble(memory, dst, [before, inserted, behind]);
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

/// The row `string_compare`.
#[inline]
#[must_use]
pub fn string_compare(memory: &[u8], a: StringPlace, b: StringPlace) -> i32 {
    a.text(memory).cmp(b.text(memory)) as i32
}

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
            store_text(memory, dst, text.bytes());
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
