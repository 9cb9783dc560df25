//! Floating point: IEEE 754 in the width of the type, round to nearest even, and one NaN.
//!
//! Operands hold no other NaN than the one (`docs/bytecode.md`, Values). On x86-64 the hardware then gives it again: an
//! invalid operation yields exactly the one NaN, and a NaN operand is handed on. Other machines have another default, so
//! there each result is made canonical. Comparison with `is_nan` is never folded away, because a NaN may stand in any operand.

use super::operations;

/// Bits of the one REAL NaN: x86-64's default.
pub const NAN_F32_BITS: u32 = 0xFFC0_0000;
/// Bits of the one LREAL NaN.
pub const NAN_F64_BITS: u64 = 0xFFF8_0000_0000_0000;

/// The value itself, or the one NaN for any NaN.
#[inline]
#[must_use]
pub fn canonical_f32(value: f32) -> f32 {
    if value.is_nan() { f32::from_bits(NAN_F32_BITS) } else { value }
}

/// The value itself, or the one NaN for any NaN.
#[inline]
#[must_use]
pub fn canonical_f64(value: f64) -> f64 {
    if value.is_nan() { f64::from_bits(NAN_F64_BITS) } else { value }
}

/// A result of hardware arithmetic on canonical operands, canonical on every machine.
#[inline]
pub(super) fn hardware_f32(value: f32) -> f32 {
    if cfg!(target_arch = "x86_64") { value } else { canonical_f32(value) }
}

/// A result of hardware arithmetic on canonical operands, canonical on every machine.
#[inline]
pub(super) fn hardware_f64(value: f64) -> f64 {
    if cfg!(target_arch = "x86_64") { value } else { canonical_f64(value) }
}

macro_rules! both_widths {
    ($float:ident, $canonical:ident, $hardware:ident,
     $add:ident $sub:ident $mul:ident $div:ident $neg:ident $abs:ident $sqrt:ident $min:ident $max:ident
     $eq:ident $ne:ident $lt:ident $le:ident $gt:ident $ge:ident) => {
        operations! {
            $add(a: $float, b: $float) -> $float = $hardware(a + b);
            $sub(a: $float, b: $float) -> $float = $hardware(a - b);
            $mul(a: $float, b: $float) -> $float = $hardware(a * b);
            $div(a: $float, b: $float) -> $float = $hardware(a / b);
            $neg(a: $float) -> $float = $canonical(-a);
            $abs(a: $float) -> $float = $canonical(a.abs());
            $sqrt(a: $float) -> $float = $hardware(a.sqrt());
            $min(a: $float, b: $float) -> $float = if b < a { b } else { a };
            $max(a: $float, b: $float) -> $float = if b > a { b } else { a };
            $eq(a: $float, b: $float) -> i32 = i32::from(a == b);
            $ne(a: $float, b: $float) -> i32 = i32::from(a != b);
            $lt(a: $float, b: $float) -> i32 = i32::from(a < b);
            $le(a: $float, b: $float) -> i32 = i32::from(a <= b);
            $gt(a: $float, b: $float) -> i32 = i32::from(a > b);
            $ge(a: $float, b: $float) -> i32 = i32::from(a >= b);
        }
    };
}

both_widths!(f32, canonical_f32, hardware_f32,
    f32_add f32_sub f32_mul f32_div f32_neg f32_abs f32_sqrt f32_min f32_max
    f32_eq f32_ne f32_lt f32_le f32_gt f32_ge);
both_widths!(f64, canonical_f64, hardware_f64,
    f64_add f64_sub f64_mul f64_div f64_neg f64_abs f64_sqrt f64_min f64_max
    f64_eq f64_ne f64_lt f64_le f64_gt f64_ge);

// The pinned libm is Rust code without machine intrinsics, so its results are the same on every machine; its NaNs are not.
operations! {
    f32_sin(a: f32) -> f32 = canonical_f32(libm::sinf(a));
    f32_cos(a: f32) -> f32 = canonical_f32(libm::cosf(a));
    f32_tan(a: f32) -> f32 = canonical_f32(libm::tanf(a));
    f32_asin(a: f32) -> f32 = canonical_f32(libm::asinf(a));
    f32_acos(a: f32) -> f32 = canonical_f32(libm::acosf(a));
    f32_atan(a: f32) -> f32 = canonical_f32(libm::atanf(a));
    f32_exp(a: f32) -> f32 = canonical_f32(libm::expf(a));
    f32_ln(a: f32) -> f32 = canonical_f32(libm::logf(a));
    f32_log(a: f32) -> f32 = canonical_f32(libm::log10f(a));
    f32_atan2(y: f32, x: f32) -> f32 = canonical_f32(libm::atan2f(y, x));
    f32_pow(base: f32, exponent: f32) -> f32 = canonical_f32(libm::powf(base, exponent));
    f64_sin(a: f64) -> f64 = canonical_f64(libm::sin(a));
    f64_cos(a: f64) -> f64 = canonical_f64(libm::cos(a));
    f64_tan(a: f64) -> f64 = canonical_f64(libm::tan(a));
    f64_asin(a: f64) -> f64 = canonical_f64(libm::asin(a));
    f64_acos(a: f64) -> f64 = canonical_f64(libm::acos(a));
    f64_atan(a: f64) -> f64 = canonical_f64(libm::atan(a));
    f64_exp(a: f64) -> f64 = canonical_f64(libm::exp(a));
    f64_ln(a: f64) -> f64 = canonical_f64(libm::log(a));
    f64_log(a: f64) -> f64 = canonical_f64(libm::log10(a));
    f64_atan2(y: f64, x: f64) -> f64 = canonical_f64(libm::atan2(y, x));
    f64_pow(base: f64, exponent: f64) -> f64 = canonical_f64(libm::pow(base, exponent));
}
