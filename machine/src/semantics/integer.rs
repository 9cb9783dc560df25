//! Integer arithmetic, comparison and bit operations. Everything wraps; only division by zero traps.

use khz_bytecode::trap::TrapCode;

use super::operations;

/// 1 for true, 0 for false: how a BOOL stands on the operand stack.
#[inline]
fn bit(value: bool) -> i32 {
    i32::from(value)
}

/// The operations that are the same for both widths; the shift and rotate counts are always 32 bits wide.
macro_rules! both_widths {
    ($signed:ident, $unsigned:ident,
     $add:ident $sub:ident $mul:ident $div_s:ident $div_u:ident $rem_s:ident $rem_u:ident $and:ident $or:ident $xor:ident
     $shl:ident $shr_s:ident $shr_u:ident $rotl:ident $rotr:ident $neg:ident $abs:ident $not:ident
     $min_s:ident $min_u:ident $max_s:ident $max_u:ident $eq:ident $ne:ident $lt_s:ident $lt_u:ident $le_s:ident $le_u:ident
     $gt_s:ident $gt_u:ident $ge_s:ident $ge_u:ident $eqz:ident $nez:ident) => {
        operations! {
            $add(a: $signed, b: $signed) -> $signed = a.wrapping_add(b);
            $sub(a: $signed, b: $signed) -> $signed = a.wrapping_sub(b);
            $mul(a: $signed, b: $signed) -> $signed = a.wrapping_mul(b);
            $div_s(a: $signed, b: $signed) -> Result<$signed, TrapCode> =
                if b == 0 { Err(TrapCode::DivideByZero) } else { Ok(a.wrapping_div(b)) };
            $div_u(a: $signed, b: $signed) -> Result<$signed, TrapCode> =
                (a as $unsigned).checked_div(b as $unsigned).map(|q| q as $signed).ok_or(TrapCode::DivideByZero);
            $rem_s(a: $signed, b: $signed) -> Result<$signed, TrapCode> =
                if b == 0 { Err(TrapCode::DivideByZero) } else { Ok(a.wrapping_rem(b)) };
            $rem_u(a: $signed, b: $signed) -> Result<$signed, TrapCode> =
                (a as $unsigned).checked_rem(b as $unsigned).map(|r| r as $signed).ok_or(TrapCode::DivideByZero);
            $and(a: $signed, b: $signed) -> $signed = a & b;
            $or(a: $signed, b: $signed) -> $signed = a | b;
            $xor(a: $signed, b: $signed) -> $signed = a ^ b;
            $shl(a: $signed, count: i32) -> $signed = a.checked_shl(count as u32).unwrap_or(0);
            $shr_s(a: $signed, count: i32) -> $signed = a >> (count as u32).min($signed::BITS - 1);
            $shr_u(a: $signed, count: i32) -> $signed = (a as $unsigned).checked_shr(count as u32).unwrap_or(0) as $signed;
            $rotl(a: $signed, count: i32) -> $signed = a.rotate_left(count as u32 % $signed::BITS);
            $rotr(a: $signed, count: i32) -> $signed = a.rotate_right(count as u32 % $signed::BITS);
            $neg(a: $signed) -> $signed = a.wrapping_neg();
            $abs(a: $signed) -> $signed = a.wrapping_abs();
            $not(a: $signed) -> $signed = !a;
            $min_s(a: $signed, b: $signed) -> $signed = a.min(b);
            $min_u(a: $signed, b: $signed) -> $signed = (a as $unsigned).min(b as $unsigned) as $signed;
            $max_s(a: $signed, b: $signed) -> $signed = a.max(b);
            $max_u(a: $signed, b: $signed) -> $signed = (a as $unsigned).max(b as $unsigned) as $signed;
            $eq(a: $signed, b: $signed) -> i32 = bit(a == b);
            $ne(a: $signed, b: $signed) -> i32 = bit(a != b);
            $lt_s(a: $signed, b: $signed) -> i32 = bit(a < b);
            $lt_u(a: $signed, b: $signed) -> i32 = bit((a as $unsigned) < b as $unsigned);
            $le_s(a: $signed, b: $signed) -> i32 = bit(a <= b);
            $le_u(a: $signed, b: $signed) -> i32 = bit(a as $unsigned <= b as $unsigned);
            $gt_s(a: $signed, b: $signed) -> i32 = bit(a > b);
            $gt_u(a: $signed, b: $signed) -> i32 = bit(a as $unsigned > b as $unsigned);
            $ge_s(a: $signed, b: $signed) -> i32 = bit(a >= b);
            $ge_u(a: $signed, b: $signed) -> i32 = bit(a as $unsigned >= b as $unsigned);
            $eqz(a: $signed) -> i32 = bit(a == 0);
            $nez(a: $signed) -> i32 = bit(a != 0);
        }
    };
}

both_widths!(i32, u32,
    i32_add i32_sub i32_mul i32_div_s i32_div_u i32_rem_s i32_rem_u i32_and i32_or i32_xor
    i32_shl i32_shr_s i32_shr_u i32_rotl i32_rotr i32_neg i32_abs i32_not
    i32_min_s i32_min_u i32_max_s i32_max_u i32_eq i32_ne i32_lt_s i32_lt_u i32_le_s i32_le_u
    i32_gt_s i32_gt_u i32_ge_s i32_ge_u i32_eqz i32_nez);
both_widths!(i64, u64,
    i64_add i64_sub i64_mul i64_div_s i64_div_u i64_rem_s i64_rem_u i64_and i64_or i64_xor
    i64_shl i64_shr_s i64_shr_u i64_rotl i64_rotr i64_neg i64_abs i64_not
    i64_min_s i64_min_u i64_max_s i64_max_u i64_eq i64_ne i64_lt_s i64_lt_u i64_le_s i64_le_u
    i64_gt_s i64_gt_u i64_ge_s i64_ge_u i64_eqz i64_nez);

operations! {
    // Narrow rotates give the narrow number zero-extended: bit strings are unsigned.
    i32_rotl8(a: i32, count: i32) -> i32 = i32::from((a as u8).rotate_left(count as u32 % 8));
    i32_rotr8(a: i32, count: i32) -> i32 = i32::from((a as u8).rotate_right(count as u32 % 8));
    i32_rotl16(a: i32, count: i32) -> i32 = i32::from((a as u16).rotate_left(count as u32 % 16));
    i32_rotr16(a: i32, count: i32) -> i32 = i32::from((a as u16).rotate_right(count as u32 % 16));
    i32_extend8_s(a: i32) -> i32 = i32::from(a as i8);
    i32_extend16_s(a: i32) -> i32 = i32::from(a as i16);
    i32_extend8_u(a: i32) -> i32 = i32::from(a as u8);
    i32_extend16_u(a: i32) -> i32 = i32::from(a as u16);
}
