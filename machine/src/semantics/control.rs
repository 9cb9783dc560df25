//! Rules that control and memory instructions share: range checks, FOR loops, array indices, references.
//!
//! 32-bit values are carried in an `i64` here, so that one function serves every [`IntegerType`]; only the low 32 bits of such a
//! carrier count, so it does not matter how a caller extends.

use khz_bytecode::value::{IntegerType, ValueType};

use crate::image::ImageLayout;

/// The value of a carrier in the order of its type: 32-bit values extended as the type's signedness says; 64-bit ones as they are.
#[inline]
#[must_use]
pub fn in_order(kind: IntegerType, carrier: i64) -> i64 {
    match (kind.value_type(), kind.is_signed()) {
        (ValueType::I64, _) => carrier,
        (_, true) => i64::from(carrier as i32),
        (_, false) => i64::from(carrier as u32),
    }
}

/// Whether `a <= b` in the order of the type.
#[inline]
#[must_use]
pub fn is_ordered(kind: IntegerType, a: i64, b: i64) -> bool {
    match kind {
        IntegerType::U64 => a as u64 <= b as u64,
        _ => in_order(kind, a) <= in_order(kind, b),
    }
}

/// Whether `lower <= value <= upper` in the order of the type: the test of `check.i32` and `check.i64`.
#[inline]
#[must_use]
pub fn check_range(kind: IntegerType, value: i64, lower: i64, upper: i64) -> bool {
    is_ordered(kind, lower, value) && is_ordered(kind, value, upper)
}

/// What the trap *range* reports for a failed check: value, lower and upper bound in the order of the type.
#[must_use]
pub fn range_values(kind: IntegerType, value: i64, lower: i64, upper: i64) -> [i64; 3] {
    [in_order(kind, value), in_order(kind, lower), in_order(kind, upper)]
}

/// The carrier after a store to, and a load from, a variable of the type.
#[inline]
#[must_use]
pub fn wrap_integer(kind: IntegerType, carrier: i64) -> i64 {
    match kind {
        IntegerType::I8 => i64::from(carrier as i8),
        IntegerType::U8 => i64::from(carrier as u8),
        IntegerType::I16 => i64::from(carrier as i16),
        IntegerType::U16 => i64::from(carrier as u16),
        IntegerType::I32 | IntegerType::U32 => i64::from(carrier as i32),
        IntegerType::I64 | IntegerType::U64 => carrier,
    }
}

/// The step as a number: signed in the width of the type's stack value, whatever the type.
#[inline]
fn signed_step(kind: IntegerType, step: i64) -> i64 {
    match kind.value_type() {
        ValueType::I64 => step,
        _ => i64::from(step as i32),
    }
}

/// Whether `for.enter` starts a first pass: `control` as read back from the control variable. A step of 0 is the caller's trap.
#[inline]
#[must_use]
pub fn for_is_due(kind: IntegerType, control: i64, bound: i64, step: i64) -> bool {
    if signed_step(kind, step) >= 0 { is_ordered(kind, control, bound) } else { is_ordered(kind, bound, control) }
}

/// `for.next`: the new value of the control variable, and whether a further pass follows.
///
/// The decision is taken from the distance to the bound before the step, so it holds at the ends of the type's range too.
#[inline]
#[must_use]
pub fn for_next(kind: IntegerType, control: i64, bound: i64, step: i64) -> (i64, bool) {
    let step = signed_step(kind, step);
    let (control, bound) = (in_order(kind, control), in_order(kind, bound));
    let goes_on = if step > 0 {
        is_ordered(kind, control, bound) && bound.wrapping_sub(control) as u64 >= step.unsigned_abs()
    } else {
        step < 0 && is_ordered(kind, bound, control) && control.wrapping_sub(bound) as u64 >= step.unsigned_abs()
    };
    (wrap_integer(kind, control.wrapping_add(step)), goes_on)
}

/// Position of an index in its dimension, counted from 0; `None` is the trap *array index* with (index, lower, upper).
#[inline]
#[must_use]
pub fn array_position(index: i32, lower: i32, upper: i32) -> Option<u32> {
    // One comparison: an index below the lower bound wraps to a position beyond the upper one.
    let position = index.wrapping_sub(lower) as u32;
    (lower <= upper && position <= upper.wrapping_sub(lower) as u32).then_some(position)
}

/// Position of an element in its array, counted in elements: `indices` one for each dimension of `dimensions`, the first varies slowest.
///
/// # Errors
/// The values of the trap *array index* for the first dimension whose index is outside.
#[inline]
pub fn element_position(indices: &[i32], dimensions: &[(i32, i32)]) -> Result<u32, [i64; 3]> {
    let mut position: u32 = 0;
    for (index, (lower, upper)) in indices.iter().zip(dimensions) {
        let inside = array_position(*index, *lower, *upper);
        let inside = inside.ok_or([i64::from(*index), i64::from(*lower), i64::from(*upper)])?;
        let extent = (upper.wrapping_sub(*lower) as u32).wrapping_add(1);
        position = position.wrapping_mul(extent).wrapping_add(inside);
    }
    Ok(position)
}

/// `ref.check`: the image offset of the `size` bytes at `address`, which counts from the data region's start as references in memory do.
///
/// `None` is the trap *reference* with the address: NULL, or bytes outside what may be read (or, with `write`, written).
#[inline]
#[must_use]
pub fn check_reference(layout: &ImageLayout, address: i64, size: u32, write: bool) -> Option<u32> {
    let reach = if write { layout.writable() } else { layout.readable() };
    let reach_bytes = reach.end.saturating_sub(reach.start);
    let offset = u32::try_from(address).ok().filter(|offset| *offset != 0)?;
    let end = offset.checked_add(size)?;
    (end <= reach_bytes).then(|| reach.start + offset)
}
