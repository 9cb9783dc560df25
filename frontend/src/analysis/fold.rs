//! Constant folding: the arithmetic of the language on known values. Operations with a rounding of their own (transcendental
//! functions) are not folded here, so that only one routine ever computes them.

use khz_bytecode::container::ElementaryType as E;

use super::tree::{BinOp, UnOp};
use super::types::{Const, integer_type, is_duration, is_real, limits, widen, wrap};

/// Nanoseconds in a millisecond, the unit in which TIME meets numbers.
pub(crate) const NS_PER_MS: i64 = 1_000_000;

/// The one NaN (architecture §5), or the value.
pub(super) fn canonical32(value: f32) -> f32 {
    if value.is_nan() { f32::from_bits(0xFFC0_0000) } else { value }
}

/// The one NaN (architecture §5), or the value.
pub(super) fn canonical64(value: f64) -> f64 {
    if value.is_nan() { f64::from_bits(0xFFF8_0000_0000_0000) } else { value }
}

/// Why there is no folded value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unfolded {
    /// Not known here.
    Unknown,
    /// A division by zero.
    DivideByZero,
    /// Beyond what literals can hold.
    Overflow,
}

/// Two operands of one elementary type.
pub(super) fn binary(op: BinOp, ty: E, a: &Const, b: &Const) -> Result<Const, Unfolded> {
    match (a, b) {
        (Const::Int(a), Const::Int(b)) => integer(op, ty, widen(ty, *a), widen(ty, *b)),
        (Const::F32(a), Const::F32(b)) => {
            let found = match op {
                BinOp::Add => a + b,
                BinOp::Sub => a - b,
                BinOp::Mul => a * b,
                BinOp::Div => a / b,
                _ => return compare(op, a.partial_cmp(b)),
            };
            Ok(Const::F32(canonical32(found)))
        }
        (Const::F64(a), Const::F64(b)) => {
            let found = match op {
                BinOp::Add => a + b,
                BinOp::Sub => a - b,
                BinOp::Mul => a * b,
                BinOp::Div => a / b,
                _ => return compare(op, a.partial_cmp(b)),
            };
            Ok(Const::F64(canonical64(found)))
        }
        (Const::Str(a), Const::Str(b)) => compare(op, Some(a.cmp(b))),
        _ => Err(Unfolded::Unknown),
    }
}

/// Two literals without a type.
pub(super) fn literals(op: BinOp, a: &Const, b: &Const) -> Result<Const, Unfolded> {
    match (a, b) {
        (Const::Wide(a), Const::Wide(b)) => {
            let found = match op {
                BinOp::Add => a.checked_add(*b),
                BinOp::Sub => a.checked_sub(*b),
                BinOp::Mul => a.checked_mul(*b),
                BinOp::Div | BinOp::Mod if *b == 0 => return Err(Unfolded::DivideByZero),
                BinOp::Div => a.checked_div(*b),
                BinOp::Mod => a.checked_rem(*b),
                BinOp::And => Some(a & b),
                BinOp::Or => Some(a | b),
                BinOp::Xor => Some(a ^ b),
                BinOp::Min => Some(*a.min(b)),
                BinOp::Max => Some(*a.max(b)),
                _ => return compare(op, Some(a.cmp(b))),
            };
            let found = found.ok_or(Unfolded::Overflow)?;
            let fits = (i128::from(i64::MIN)..=i128::from(u64::MAX)).contains(&found);
            if fits { Ok(Const::Wide(found)) } else { Err(Unfolded::Overflow) }
        }
        (Const::Lit(a, x), Const::Lit(b, y)) => Ok(match op {
            BinOp::Add => Const::Lit(a + b, x + y),
            BinOp::Sub => Const::Lit(a - b, x - y),
            BinOp::Mul => Const::Lit(a * b, x * y),
            BinOp::Div => Const::Lit(a / b, x / y),
            BinOp::Min => Const::Lit(if b < a { *b } else { *a }, if y < x { *y } else { *x }),
            BinOp::Max => Const::Lit(if b > a { *b } else { *a }, if y > x { *y } else { *x }),
            _ => return compare(op, a.partial_cmp(b)),
        }),
        _ => Err(Unfolded::Unknown),
    }
}

fn compare(op: BinOp, order: Option<std::cmp::Ordering>) -> Result<Const, Unfolded> {
    use std::cmp::Ordering::{Equal, Greater, Less};
    let found = match op {
        BinOp::Eq => order == Some(Equal),
        BinOp::Ne => order != Some(Equal),
        BinOp::Lt => order == Some(Less),
        BinOp::Le => matches!(order, Some(Less | Equal)),
        BinOp::Gt => order == Some(Greater),
        BinOp::Ge => matches!(order, Some(Greater | Equal)),
        _ => return Err(Unfolded::Unknown),
    };
    Ok(Const::Int(i64::from(found)))
}

fn integer(op: BinOp, ty: E, a: i128, b: i128) -> Result<Const, Unfolded> {
    let found = match op {
        BinOp::Add => a + b,
        BinOp::Sub => a - b,
        BinOp::Mul => a.wrapping_mul(b),
        BinOp::Div | BinOp::Mod if b == 0 => return Err(Unfolded::DivideByZero),
        BinOp::Div => a / b,
        BinOp::Mod => a % b,
        BinOp::And | BinOp::AndThen => a & b,
        BinOp::Or | BinOp::OrElse => a | b,
        BinOp::Xor => a ^ b,
        _ => return compare(op, Some(a.cmp(&b))),
    };
    Ok(Const::Int(wrap(ty, found)))
}

/// One operand.
pub(super) fn unary(op: UnOp, ty: Option<E>, value: &Const) -> Option<Const> {
    Some(match (op, value) {
        (UnOp::Neg, Const::Wide(value)) => Const::Wide(-value),
        (UnOp::Neg, Const::Lit(wide, narrow)) => Const::Lit(-wide, -narrow),
        (UnOp::Neg, Const::F32(value)) => Const::F32(canonical32(-value)),
        (UnOp::Neg, Const::F64(value)) => Const::F64(canonical64(-value)),
        (UnOp::Neg, Const::Int(value)) => Const::Int(wrap(ty?, -widen(ty?, *value))),
        (UnOp::Not, Const::Int(value)) if ty == Some(E::Bool) => Const::Int(i64::from(*value == 0)),
        (UnOp::Not, Const::Int(value)) => Const::Int(wrap(ty?, !widen(ty?, *value))),
        (UnOp::Abs, Const::Int(value)) => Const::Int(wrap(ty?, widen(ty?, *value).abs())),
        _ => return None,
    })
}

/// A conversion between elementary types; `None` where the machine's own routine must decide.
pub(super) fn convert(value: &Const, from: E, to: E, truncates: bool) -> Option<Const> {
    if from == to {
        return Some(value.clone());
    }
    match value {
        Const::Int(value) => {
            let mut number = widen(from, *value);
            if is_duration(from) != is_duration(to) {
                let (unit_from, unit_to) =
                    (if from == E::Time { NS_PER_MS } else { 1 }, if to == E::Time { NS_PER_MS } else { 1 });
                number = i128::from(wrap(E::Lint, number / i128::from(unit_from) * i128::from(unit_to)));
            }
            if is_real(to) {
                #[expect(clippy::cast_precision_loss, reason = "rounding to nearest even is the meaning")]
                let (wide, narrow) = (number as f64, number as f32);
                return Some(if to == E::Real { Const::F32(narrow) } else { Const::F64(wide) });
            }
            if to == E::Bool {
                return Some(Const::Int(i64::from(widen(from, *value) != 0)));
            }
            integer_type(to)?;
            Some(Const::Int(wrap(to, number)))
        }
        #[expect(clippy::cast_possible_truncation, reason = "rounding to nearest even is the meaning")]
        Const::F64(value) if to == E::Real => Some(Const::F32(canonical32(*value as f32))),
        Const::F32(value) if to == E::Lreal => Some(Const::F64(canonical64(f64::from(*value)))),
        Const::F32(value) => float_to_integer(f64::from(*value), to, truncates),
        Const::F64(value) => float_to_integer(*value, to, truncates),
        _ => None,
    }
}

fn float_to_integer(value: f64, to: E, truncates: bool) -> Option<Const> {
    if to == E::Bool || is_duration(to) {
        return None;
    }
    let (low, high) = limits(to)?;
    let rounded = if truncates { value.trunc() } else { value.round_ties_even() };
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates and NaN gives 0, as the language says")]
    let number = (rounded as i128).clamp(low, high);
    Some(Const::Int(wrap(to, number)))
}
