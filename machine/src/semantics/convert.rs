//! Conversions between number types.
//!
//! Rust's `as` is the definition wanted here: integer to integer keeps the low bits, integer to float rounds to nearest
//! even, float to integer cuts toward zero, saturates and makes NaN 0.

use super::float::{canonical_f32, canonical_f64, hardware_f32, hardware_f64};
use super::operations;

operations! {
    i64_extend_i32_s(a: i32) -> i64 = i64::from(a);
    i64_extend_i32_u(a: i32) -> i64 = i64::from(a as u32);
    i32_wrap_i64(a: i64) -> i32 = a as i32;
    i32_saturate_u32(a: i32) -> i32 = (a as u32).min(i32::MAX as u32) as i32;
    i32_saturate_i64_s(a: i64) -> i32 = a.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
    i32_saturate_i64_u(a: i64) -> i32 = (a as u64).min(i32::MAX as u64) as i32;
    f32_convert_i32_s(a: i32) -> f32 = a as f32;
    f32_convert_i32_u(a: i32) -> f32 = a as u32 as f32;
    f32_convert_i64_s(a: i64) -> f32 = a as f32;
    f32_convert_i64_u(a: i64) -> f32 = a as u64 as f32;
    f64_convert_i32_s(a: i32) -> f64 = f64::from(a);
    f64_convert_i32_u(a: i32) -> f64 = f64::from(a as u32);
    f64_convert_i64_s(a: i64) -> f64 = a as f64;
    f64_convert_i64_u(a: i64) -> f64 = a as u64 as f64;
    f32_demote_f64(a: f64) -> f32 = hardware_f32(a as f32);
    f64_promote_f32(a: f32) -> f64 = hardware_f64(f64::from(a));
    i32_reinterpret_f32(a: f32) -> i32 = a.to_bits() as i32;
    i64_reinterpret_f64(a: f64) -> i64 = a.to_bits() as i64;
    f32_reinterpret_i32(a: i32) -> f32 = canonical_f32(f32::from_bits(a as u32));
    f64_reinterpret_i64(a: i64) -> f64 = canonical_f64(f64::from_bits(a as u64));
}

macro_rules! to_integers {
    ($float:ident, $($round:ident $trunc:ident: $narrow:ident as $result:ident;)*) => { operations! { $(
        $round(a: $float) -> $result = a.round_ties_even() as $narrow as $result;
        $trunc(a: $float) -> $result = a as $narrow as $result;
    )* } };
}

to_integers! { f32,
    f32_round_i8 f32_trunc_i8: i8 as i32;
    f32_round_u8 f32_trunc_u8: u8 as i32;
    f32_round_i16 f32_trunc_i16: i16 as i32;
    f32_round_u16 f32_trunc_u16: u16 as i32;
    f32_round_i32 f32_trunc_i32: i32 as i32;
    f32_round_u32 f32_trunc_u32: u32 as i32;
    f32_round_i64 f32_trunc_i64: i64 as i64;
    f32_round_u64 f32_trunc_u64: u64 as i64;
}
to_integers! { f64,
    f64_round_i8 f64_trunc_i8: i8 as i32;
    f64_round_u8 f64_trunc_u8: u8 as i32;
    f64_round_i16 f64_trunc_i16: i16 as i32;
    f64_round_u16 f64_trunc_u16: u16 as i32;
    f64_round_i32 f64_trunc_i32: i32 as i32;
    f64_round_u32 f64_trunc_u32: u32 as i32;
    f64_round_i64 f64_trunc_i64: i64 as i64;
    f64_round_u64 f64_trunc_u64: u64 as i64;
}
