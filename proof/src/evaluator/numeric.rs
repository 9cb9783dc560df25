//! The numeric rows, from their sentences in `docs/instructions.md`: integers by exact arithmetic in 128 bits that is cut afterwards, floating
//! point by value with the one NaN put in by hand.

use super::calendar;
use khz_bytecode::instruction::NumericOp;
use khz_bytecode::trap::TrapCode;
use khz_bytecode::value::ValueType;
use khz_machine::semantics::Value;

/// Computes one numeric instruction; operands first pushed first.
///
/// # Panics
/// When the operands are not of the row's types, or a row has no meaning here: the table has grown and this evaluator has not.
pub(super) fn compute(op: NumericOp, operands: &[Value]) -> Result<Value, TrapCode> {
    let fits = operands.iter().map(|operand| operand.value_type()).eq(op.operands().iter().copied());
    assert!(fits, "{} on {operands:?}", op.mnemonic());
    let (prefix, name) = op.mnemonic().split_once('.').unwrap_or_default();
    let bits = match (prefix, op.operands().first(), op.operands().last()) {
        ("date", ..) => {
            let number = |at: usize| operands.get(at).map_or(0, |operand| signed(u128::from(operand.bits()), 64));
            calendar::compute(name, number(0), number(1)) as u128
        }
        ("f32" | "f64", Some(ValueType::F32), Some(ValueType::F32)) if is_plain(name) => float32(name, operands),
        ("f32" | "f64", Some(ValueType::F64), Some(ValueType::F64)) if is_plain(name) => float64(name, operands),
        (_, Some(from), _) if !is_plain(name) => convert(prefix, name, *from, operands[0]),
        _ => integer(prefix, name, operands)?,
    };
    Ok(match op.result() {
        ValueType::I32 => Value::I32(bits as i32),
        ValueType::I64 => Value::I64(bits as i64),
        ValueType::F32 => Value::F32(f32::from_bits(bits as u32)),
        ValueType::F64 => Value::F64(f64::from_bits(bits as u64)),
    })
}

/// Conversions name the other type, behind an underscore: `convert_i32_s`, `round_u8`.
fn is_plain(name: &str) -> bool {
    let conversions =
        ["convert", "demote", "promote", "round", "trunc", "reinterpret", "wrap", "saturate", "extend_i32"];
    !conversions.iter().any(|prefix| name.starts_with(prefix))
}

fn signed(bits: u128, width: u32) -> i128 {
    ((bits << (128 - width)) as i128) >> (128 - width)
}

fn cut(bits: u128, width: u32) -> u128 {
    bits & ((1 << width) - 1)
}

fn rotate(bits: u128, width: u32, left: u32) -> u128 {
    let (bits, left) = (cut(bits, width), left % width);
    cut((bits << left) | (bits >> (width - left)), width)
}

fn integer(prefix: &str, name: &str, operands: &[Value]) -> Result<u128, TrapCode> {
    let width = if prefix == "i64" { 64 } else { 32 };
    let a = u128::from(operands[0].bits());
    let b = operands.get(1).map_or(0, |operand| u128::from(operand.bits()));
    let (sa, sb) = (signed(a, width), signed(b, width));
    let count = b.min(100) as u32;
    let truth = |value: bool| u128::from(value);
    let divisor = || if b == 0 { Err(TrapCode::DivideByZero) } else { Ok(b) };
    Ok(match name {
        "add" => (sa + sb) as u128,
        "sub" => (sa - sb) as u128,
        "mul" => (sa * sb) as u128,
        "div_s" => divisor().map(|_| (sa / sb) as u128)?,
        "div_u" => divisor().map(|b| a / b)?,
        "rem_s" => divisor().map(|_| (sa % sb) as u128)?,
        "rem_u" => divisor().map(|b| a % b)?,
        "and" => a & b,
        "or" => a | b,
        "xor" => a ^ b,
        "shl" if b >= u128::from(width) => 0,
        "shl" => a << count,
        "shr_s" => (sa >> count) as u128,
        "shr_u" => a >> count,
        "rotl" => rotate(a, width, (b % u128::from(width)) as u32),
        "rotr" => rotate(a, width, width - (b % u128::from(width)) as u32),
        "rotl8" => rotate(a, 8, (b % 8) as u32),
        "rotr8" => rotate(a, 8, 8 - (b % 8) as u32),
        "rotl16" => rotate(a, 16, (b % 16) as u32),
        "rotr16" => rotate(a, 16, 16 - (b % 16) as u32),
        "neg" => (-sa) as u128,
        "abs" => sa.unsigned_abs(),
        "not" => !a,
        "min_s" => sa.min(sb) as u128,
        "min_u" => a.min(b),
        "max_s" => sa.max(sb) as u128,
        "max_u" => a.max(b),
        "eq" => truth(a == b),
        "ne" => truth(a != b),
        "lt_s" => truth(sa < sb),
        "lt_u" => truth(a < b),
        "le_s" => truth(sa <= sb),
        "le_u" => truth(a <= b),
        "gt_s" => truth(sa > sb),
        "gt_u" => truth(a > b),
        "ge_s" => truth(sa >= sb),
        "ge_u" => truth(a >= b),
        "eqz" => truth(a == 0),
        "nez" => truth(a != 0),
        "extend8_s" => signed(a, 8) as u128,
        "extend16_s" => signed(a, 16) as u128,
        "extend8_u" => cut(a, 8),
        "extend16_u" => cut(a, 16),
        _ => panic!("no meaning for {prefix}.{name}"),
    })
}

macro_rules! floats {
    ($function:ident, $variant:ident, $ty:ident, $nan:literal, $sin:ident $cos:ident $tan:ident $asin:ident $acos:ident $atan:ident
     $exp:ident $ln:ident $log:ident $atan2:ident $pow:ident $sqrt:ident) => {
        fn $function(name: &str, operands: &[Value]) -> u128 {
            let number = |at: usize| match operands.get(at) {
                Some(Value::$variant(value)) => *value,
                _ => 0.0,
            };
            let (a, b) = (number(0), number(1));
            let truth = match name {
                "eq" => Some(a == b),
                "ne" => Some(!(a == b)),
                "lt" => Some(a < b),
                "le" => Some(a <= b),
                "gt" => Some(a > b),
                "ge" => Some(a >= b),
                _ => None,
            };
            if let Some(truth) = truth {
                return u128::from(truth);
            }
            let result = match name {
                "add" => a + b,
                "sub" => a - b,
                "mul" => a * b,
                "div" => a / b,
                "neg" => $ty::from_bits(a.to_bits() ^ (1 << ($ty::WIDTH - 1))),
                "abs" => $ty::from_bits(a.to_bits() & !(1 << ($ty::WIDTH - 1))),
                "sqrt" => libm::$sqrt(a),
                "min" => {
                    if b < a {
                        b
                    } else {
                        a
                    }
                }
                "max" => {
                    if b > a {
                        b
                    } else {
                        a
                    }
                }
                "sin" => libm::$sin(a),
                "cos" => libm::$cos(a),
                "tan" => libm::$tan(a),
                "asin" => libm::$asin(a),
                "acos" => libm::$acos(a),
                "atan" => libm::$atan(a),
                "exp" => libm::$exp(a),
                "ln" => libm::$ln(a),
                "log" => libm::$log(a),
                "atan2" => libm::$atan2(a, b),
                "pow" => libm::$pow(a, b),
                _ => panic!("no meaning for {name}"),
            };
            if result.is_nan() { $nan } else { u128::from(result.to_bits()) }
        }
    };
}

/// Width of a float type, which the standard library does not name.
trait Width {
    const WIDTH: u32;
}
impl Width for f32 {
    const WIDTH: u32 = 32;
}
impl Width for f64 {
    const WIDTH: u32 = 64;
}

floats!(float32, F32, f32, 0xFFC0_0000, sinf cosf tanf asinf acosf atanf expf logf log10f atan2f powf sqrtf);
floats!(float64, F64, f64, 0xFFF8_0000_0000_0000, sin cos tan asin acos atan exp log log10 atan2 pow sqrt);

fn bits_of_f32(value: f32) -> u128 {
    if value.is_nan() { 0xFFC0_0000 } else { u128::from(value.to_bits()) }
}

fn bits_of_f64(value: f64) -> u128 {
    if value.is_nan() { 0xFFF8_0000_0000_0000 } else { u128::from(value.to_bits()) }
}

/// Lowest and highest number of an integer type by its name.
fn range_of(name: &str) -> (i128, i128) {
    let width: u32 = name.get(1..).and_then(|digits| digits.parse().ok()).unwrap_or(0);
    if name.starts_with('u') { (0, (1 << width) - 1) } else { (-(1 << (width - 1)), (1 << (width - 1)) - 1) }
}

fn convert(prefix: &str, name: &str, from: ValueType, operand: Value) -> u128 {
    let bits = u128::from(operand.bits());
    let width = if matches!(from, ValueType::I64 | ValueType::F64) { 64 } else { 32 };
    // Exact: every REAL is an LREAL.
    let float = match operand {
        Value::F32(value) => f64::from(value),
        Value::F64(value) => value,
        Value::I32(_) | Value::I64(_) => 0.0,
    };
    let (verb, other) = name.split_once('_').unwrap_or((name, ""));
    let number = if name.ends_with("_u") || name == "saturate_u32" { bits as i128 } else { signed(bits, width) };
    match (verb, prefix) {
        ("extend", _) | ("wrap", _) => number as u128,
        ("saturate", _) => number.clamp(i128::from(i32::MIN), i128::from(i32::MAX)) as u128,
        ("convert", "f32") => bits_of_f32(number as f32),
        ("convert", _) => bits_of_f64(number as f64),
        ("demote", _) => bits_of_f32(float as f32),
        ("promote", _) => bits_of_f64(float),
        ("reinterpret", "f32") => bits_of_f32(f32::from_bits(bits as u32)),
        ("reinterpret", "f64") => bits_of_f64(f64::from_bits(bits as u64)),
        ("reinterpret", _) => bits,
        ("round" | "trunc", _) => {
            let whole = if verb == "round" { libm::rint(float) } else { libm::trunc(float) };
            let (lowest, highest) = range_of(other);
            // `as` makes 0 of NaN and saturates at numbers far beyond every type here.
            (whole as i128).clamp(lowest, highest) as u128
        }
        _ => panic!("no meaning for {prefix}.{name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use khz_machine::semantics::eval_numeric;

    #[test]
    fn every_row_means_here_what_it_means_in_the_machine() {
        let mut random = Random::new(3);
        for op in NumericOp::ALL {
            for _ in 0..400 {
                let operands: Vec<Value> =
                    op.operands().iter().map(|ty| Value::from_bits(*ty, random.value_bits(*ty))).collect();
                assert_eq!(compute(*op, &operands), eval_numeric(*op, &operands), "{} {operands:?}", op.mnemonic());
            }
        }
    }
}
