//! Constant folding: the arithmetic of the language on known values. What has a rounding of its own (transcendental functions),
//! shifts, strings and the choice among floats are computed by the machine's routine of the instruction that would stand there.

use khz_bytecode::container::ElementaryType as E;

use khz_bytecode::instruction::NumericOp;
use khz_bytecode::value::ValueType;
use khz_machine::semantics::{StringPlace, Value, eval_helper, eval_numeric};

use super::moments::convert_ns;
use super::ops;
use super::tree::{BinOp, Expr, ExprKind, TextOp, UnOp};
use super::types::{Const, Ty, integer_type, is_real, is_time, limits, widen, wrap};

/// Nanoseconds in a millisecond, the unit in which TIME meets numbers.
pub(crate) const NS_PER_MS: i64 = 1_000_000;

/// Nanoseconds of the unit in which a duration, date or time of day meets numbers: TIME and TIME_OF_DAY milliseconds, DATE and DATE_AND_TIME seconds, the
/// L-forms nanoseconds. `None`: no such type.
pub(crate) fn unit_ns(ty: E) -> Option<i64> {
    match ty {
        E::Time | E::TimeOfDay => Some(NS_PER_MS),
        E::Date | E::DateAndTime => Some(1000 * NS_PER_MS),
        _ => is_time(ty).then_some(1),
    }
}

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
        (Const::F32(_), Const::F32(_)) | (Const::F64(_), Const::F64(_)) if is_chosen_or_routine(op) => {
            let found = ops::binary(op, ty).and_then(|code| machine(code, &[value(a, ty)?, value(b, ty)?], ty));
            found.ok_or(Unfolded::Unknown)
        }
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
        (Const::Str(x), Const::Str(y)) => texts(op, (a, b), x.cmp(y)),
        (Const::WStr(x), Const::WStr(y)) => texts(op, (a, b), x.cmp(y)),
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
        BinOp::Min => a.min(b),
        BinOp::Max => a.max(b),
        _ => return compare(op, Some(a.cmp(&b))),
    };
    Ok(Const::Int(wrap(ty, found)))
}

/// Two strings, whose order is known.
fn texts(op: BinOp, (a, b): (&Const, &Const), order: std::cmp::Ordering) -> Result<Const, Unfolded> {
    match op {
        BinOp::Min => Ok(if order.is_gt() { b } else { a }.clone()),
        BinOp::Max => Ok(if order.is_lt() { b } else { a }.clone()),
        _ => compare(op, Some(order)),
    }
}

/// Whether two floats go through a routine of the machine.
fn is_chosen_or_routine(op: BinOp) -> bool {
    matches!(op, BinOp::Min | BinOp::Max | BinOp::Pow | BinOp::Atan2)
}

/// A shift or rotation; the count is a DINT.
pub(super) fn shift(op: BinOp, ty: E, a: &Const, count: &Const) -> Option<Const> {
    machine(ops::binary(op, ty)?, &[value(a, ty)?, value(count, E::Dint)?], ty)
}

/// A constant as an instruction takes it.
fn value(known: &Const, ty: E) -> Option<Value> {
    Some(match known {
        Const::Int(known) if ty.storage().value_type() == ValueType::I64 => Value::I64(*known),
        #[expect(clippy::cast_possible_truncation, reason = "the low 32 bits are the value in a register")]
        Const::Int(known) => Value::I32(*known as i32),
        Const::F32(known) => Value::F32(*known),
        Const::F64(known) => Value::F64(*known),
        Const::Wide(_) | Const::Lit(..) | Const::Str(_) | Const::WStr(_) => return None,
    })
}

/// What an instruction gives, as a constant of a type. `None`: it traps.
fn machine(code: NumericOp, operands: &[Value], ty: E) -> Option<Const> {
    Some(match eval_numeric(code, operands).ok()? {
        Value::I32(found) => Const::Int(wrap(ty, i128::from(found))),
        Value::I64(found) => Const::Int(wrap(ty, i128::from(found))),
        Value::F32(found) => Const::F32(found),
        Value::F64(found) => Const::F64(found),
    })
}

/// A string operation whose operands are all known; `ty` is its result's type.
pub(super) fn text(op: TextOp, parts: &[Expr], ty: Ty) -> Option<Const> {
    let wide = if ty.is_text() { ty.is_wide_text() } else { parts.first()?.ty.is_wide_text() };
    let helper = ops::text(op, wide)?;
    let operands: Vec<(&Const, Ty)> = parts
        .iter()
        .map(|part| match &part.kind {
            ExprKind::Const(known) => Some((known, part.ty)),
            _ => None,
        })
        .collect::<Option<_>>()?;
    // The result, then the operands, each in a string as long as it must be; one character may come of a number.
    let characters = |(known, _): &(&Const, Ty)| match known {
        Const::Str(text) => text.len(),
        Const::WStr(text) => text.len(),
        _ => 0,
    };
    let room = operands.iter().map(characters).sum::<usize>() + 1;
    let mut image = vec![0; 2 * (room + 1)];
    let mut places = Vec::new();
    if helper.result().is_none() {
        places.push(StringPlace { at: 0, capacity: u16::try_from(room).ok()? });
    }
    let mut values = Vec::new();
    for operand in &operands {
        let (known, of) = operand;
        if of.is_text() {
            let at = u32::try_from(image.len()).ok()?;
            places.push(StringPlace { at, capacity: u16::try_from(characters(operand)).ok()? });
            image.extend(super::init::scalar_bytes(known, 2 * (u32::try_from(characters(operand)).ok()? + 1)));
        } else {
            values.push(value(
                known,
                match *of {
                    Ty::Elem(of) => of,
                    _ => return None,
                },
            )?);
        }
    }
    match eval_helper(helper, &mut image, &places, &values) {
        Some(Value::I32(found)) => Some(Const::Int(wrap(E::Int, i128::from(found)))),
        Some(_) => None,
        None if wide => {
            let units = image.as_chunks::<2>().0.iter().map(|unit| u16::from_le_bytes(*unit));
            Some(Const::WStr(units.take_while(|unit| *unit != 0).collect()))
        }
        None => Some(Const::Str(image.split(|byte| *byte == 0).next()?.into())),
    }
}

/// The number in decimal digits of a bit string's width, or the digits of a number.
fn decimal(op: UnOp, bytes: u32, known: i128) -> i128 {
    let (from, to) = if op == UnOp::FromBcd { (16, 10) } else { (10, 16) };
    (0..bytes * 2).fold(0, |sum, at| sum + known / i128::pow(from, at) % from * i128::pow(to, at))
}

/// Bytes and digits.
fn code(op: UnOp, ty: E, known: i64) -> Option<Const> {
    let bytes = ty.storage().bytes();
    let wide = widen(ty, known);
    Some(Const::Int(match op {
        UnOp::FromBcd | UnOp::ToBcd => wrap(ty, decimal(op, bytes, wide)),
        UnOp::SwapBytes => wrap(ty, i128::from(known.swap_bytes().cast_unsigned() >> (64 - bytes * 8))),
        UnOp::IsValidBcd => i64::from((0..bytes * 2).all(|at| wide >> (4 * at) & 15 < 10)),
        _ => return None,
    }))
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
        (UnOp::IsValid, Const::F32(value)) => Const::Int(i64::from(value.is_finite())),
        (UnOp::IsValid, Const::F64(value)) => Const::Int(i64::from(value.is_finite())),
        (_, Const::Int(value)) => return code(op, ty?, *value),
        (_, known) => {
            let ty = ty?;
            return machine(ops::unary(op, ty.storage().value_type())?, &[self::value(known, ty)?], ty);
        }
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
            if (from, to) == (E::Wchar, E::Char) {
                let unit = u16::try_from(number).unwrap_or(u16::MAX);
                return Some(Const::Int(i64::from(super::characters::narrow(unit))));
            }
            match (unit_ns(from), unit_ns(to)) {
                (Some(_), Some(_)) => number = i128::from(convert_ns(*value, from, to)),
                (Some(unit), None) => number /= i128::from(unit),
                (None, Some(unit)) => {
                    number = i128::from(convert_ns(wrap(E::Lint, number * i128::from(unit)), E::Ltime, to));
                }
                (None, None) => {}
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
    if to == E::Bool || is_time(to) {
        return None;
    }
    let (low, high) = limits(to)?;
    let rounded = if truncates { value.trunc() } else { value.round_ties_even() };
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates and NaN gives 0, as the language says")]
    let number = (rounded as i128).clamp(low, high);
    Some(Const::Int(wrap(to, number)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_read_and_made() {
        assert_eq!(decimal(UnOp::FromBcd, 2, 0x0042), 42);
        assert_eq!(decimal(UnOp::FromBcd, 8, 0x9999_9999_9999_9999), 9_999_999_999_999_999);
        // A digit above 9 counts at its place.
        assert_eq!(decimal(UnOp::FromBcd, 1, 0x1F), 25);
        assert_eq!(decimal(UnOp::ToBcd, 4, 12_345_678), 0x1234_5678);
        assert_eq!(code(UnOp::IsValidBcd, E::Word, 0x99A9), Some(Const::Int(0)));
        assert_eq!(code(UnOp::IsValidBcd, E::Word, 0x9999), Some(Const::Int(1)));
    }

    #[test]
    fn bytes_turn_in_their_own_width() {
        assert_eq!(code(UnOp::SwapBytes, E::Int, 0x0180), Some(Const::Int(-32767)));
        assert_eq!(code(UnOp::SwapBytes, E::Byte, 0x12), Some(Const::Int(0x12)));
        assert_eq!(code(UnOp::SwapBytes, E::Dword, 0x1234_5678), Some(Const::Int(0x7856_3412)));
        assert_eq!(code(UnOp::SwapBytes, E::Lint, -2), Some(Const::Int(i64::from_be_bytes((-2i64).to_le_bytes()))));
    }
}
