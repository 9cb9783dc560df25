//! Operators, conversions and standard functions over values.

use khz_bytecode::trap::TrapCode;
pub use khz_machine::library::functions::StandardFunction as Function;
use khz_machine::library::functions::{FunctionRow, TABLE, TypeClass};

use super::moments;
use super::tree::{Kind, Op, Value};

/// The row of a function in the table of the library, which says how it is called and what it takes.
///
/// # Panics
/// Never: every function has a row.
#[must_use]
pub fn row(function: Function) -> &'static FunctionRow {
    TABLE.iter().find(|row| row.function == function).expect("every function has a row")
}

/// Whether a parameter of a class takes a type.
#[must_use]
pub fn takes(class: TypeClass, kind: Kind) -> bool {
    match class {
        TypeClass::AnyElementary => true,
        // Dates and times of day are summed with durations only.
        TypeClass::AnyMagnitude => kind != Kind::Bool && !kind.is_moment() && !kind.is_character(),
        TypeClass::AnyNum => kind.is_integer() || kind.is_bits() || kind.is_real(),
        TypeClass::AnyReal | TypeClass::Float => kind.is_real(),
        TypeClass::BitString => kind.is_bits(),
        TypeClass::Bytes => !kind.is_real() && !kind.is_character(),
        TypeClass::AnyInt | TypeClass::Shiftable | TypeClass::Count => kind.is_integer() || kind.is_bits(),
        TypeClass::AnyBit => kind == Kind::Bool || kind.is_integer() || kind.is_bits(),
        TypeClass::Part | TypeClass::FinePart => kind.is_integer(),
        TypeClass::Bool => kind == Kind::Bool,
        TypeClass::AnyString | TypeClass::AnyChars | TypeClass::Array | TypeClass::Of(_) => false,
    }
}

fn less(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Int(a), Value::Int(b)) => a < b,
        (Value::Real(a), Value::Real(b)) => a < b,
        (Value::Lreal(a), Value::Lreal(b)) => a < b,
        (Value::Str(a), Value::Str(b)) => a < b,
        _ => panic!("{a:?} and {b:?} have no order"),
    }
}

fn power(a: &Value, b: &Value) -> Value {
    match (a, b) {
        (Value::Real(a), Value::Real(b)) => Value::Real(libm::powf(*a, *b)),
        (Value::Lreal(a), Value::Lreal(b)) => Value::Lreal(libm::pow(*a, *b)),
        _ => panic!("{a:?} to the power of {b:?}"),
    }
}

/// A comparison.
///
/// # Panics
/// When the tree is wrong.
fn compare(op: Op, a: &Value, b: &Value) -> Option<bool> {
    Some(match op {
        Op::Eq => a == b,
        Op::Ne => a != b,
        Op::Lt => less(a, b),
        Op::Gt => less(b, a),
        Op::Le => less(a, b) || a == b,
        Op::Ge => less(b, a) || a == b,
        _ => return None,
    })
}

/// A binary operation whose operands are of one type, of which integers wrap in `kind`.
///
/// # Errors
/// A division of integers by zero.
///
/// # Panics
/// When the tree is wrong.
pub fn binary(op: Op, kind: Kind, a: &Value, b: &Value) -> Result<Value, TrapCode> {
    if let Some(flag) = compare(op, a, b) {
        return Ok(Value::Int(i128::from(flag)));
    }
    macro_rules! float {
        ($wrap:path, $a:expr, $b:expr) => {
            Ok($wrap(match op {
                Op::Add => $a + $b,
                Op::Sub => $a - $b,
                Op::Mul => $a * $b,
                Op::Div => $a / $b,
                _ => panic!("{op:?} of floats"),
            }))
        };
    }
    match (a, b) {
        _ if op == Op::Pow => Ok(power(a, b)),
        // A duration times or by a float: in LREAL, then to the nearest nanosecond.
        (Value::Int(_), Value::Lreal(factor)) => {
            let time = a.int() as f64;
            Ok(saturate(kind, if op == Op::Mul { time * factor } else { time / factor }.round_ties_even()))
        }
        (Value::Lreal(factor), Value::Int(_)) if op == Op::Mul => {
            Ok(saturate(kind, (factor * b.int() as f64).round_ties_even()))
        }
        (Value::Real(a), Value::Real(b)) => float!(Value::Real, a, b),
        (Value::Lreal(a), Value::Lreal(b)) => float!(Value::Lreal, a, b),
        _ => {
            let (a, b) = (a.int(), b.int());
            if matches!(op, Op::Div | Op::Mod) && b == 0 {
                return Err(TrapCode::DivideByZero);
            }
            let exact = match op {
                Op::Add => a + b,
                Op::Sub => a - b,
                Op::Mul => a.wrapping_mul(b),
                Op::Div => a / b,
                Op::Mod => a % b,
                Op::And | Op::AndThen => a & b,
                Op::Or | Op::OrElse => a | b,
                Op::Xor => a ^ b,
                _ => panic!("{op:?} of numbers"),
            };
            Ok(Value::Int(kind.wrap(exact)))
        }
    }
}

/// The least or greatest so far and the next, as the semantics fold them.
fn pick(a: Value, b: Value, greatest: bool) -> Value {
    if if greatest { less(&a, &b) } else { less(&b, &a) } { b } else { a }
}

/// `-e`
#[must_use]
pub fn negate(kind: Kind, value: &Value) -> Value {
    match value {
        Value::Real(value) => Value::Real(-value),
        Value::Lreal(value) => Value::Lreal(-value),
        _ => Value::Int(kind.wrap(-value.int())),
    }
}

/// `NOT e`
#[must_use]
pub fn complement(kind: Kind, value: &Value) -> Value {
    Value::Int(kind.wrap(if kind == Kind::Bool { 1 - value.int() } else { !value.int() }))
}

fn saturate(kind: Kind, whole: f64) -> Value {
    let (low, high) = kind.limits();
    // `as` saturates and makes 0 of a NaN, which is the rule; 128 bits hold every limit.
    Value::Int((whole as i128).clamp(low, high))
}

/// `A_TO_B`; with `cut` the fraction is cut off instead of rounded to even.
///
/// # Panics
/// When the generator uses none such.
#[must_use]
pub fn convert(from: Kind, to: Kind, value: &Value, cut: bool) -> Value {
    let float = match value {
        Value::Real(value) => Some(f64::from(*value)),
        Value::Lreal(value) => Some(*value),
        _ => None,
    };
    if to != Kind::Bool {
        match (moments::unit_ns(from), moments::unit_ns(to)) {
            (Some(_), Some(_)) => return Value::Int(moments::convert(from, to, value.int())),
            // Numbers meet them as a LINT of their unit.
            (Some(unit), None) => return convert(Kind::Lint, to, &Value::Int(value.int() / unit), cut),
            (None, Some(unit)) => {
                let whole = convert(from, Kind::Lint, value, cut).int();
                let ns = Kind::Lint.wrap(whole.wrapping_mul(unit));
                return Value::Int(moments::convert(Kind::Ltime, to, ns));
            }
            (None, None) => {}
        }
    }
    if (from, to) == (Kind::Wchar, Kind::Char) {
        return Value::Int(i128::from(super::text::narrow(&[value.int() as u16])[0]));
    }
    match (float, to) {
        (Some(value), Kind::Bool) => Value::Int(i128::from(value != 0.0)),
        (Some(value), Kind::Real) => Value::Real(value as f32),
        (Some(value), Kind::Lreal) => Value::Lreal(value),
        (Some(value), _) => saturate(to, if cut { value.trunc() } else { value.round_ties_even() }),
        // From the exact integer, so that it is rounded once.
        (None, Kind::Real) => Value::Real(value.int() as f32),
        (None, Kind::Lreal) => Value::Lreal(value.int() as f64),
        (None, Kind::Bool) => Value::Int(i128::from(value.int() != 0)),
        (None, _) => Value::Int(to.wrap(value.int())),
    }
}

fn shift(function: Function, kind: Kind, value: i128, count: i128) -> i128 {
    let bits = kind.bits();
    // The count is unsigned: a negative one is a large one.
    let by = u32::try_from(count).unwrap_or(u32::MAX);
    let pattern = value.rem_euclid(1 << bits);
    match function {
        Function::Shl if by >= bits => 0,
        Function::Shl => pattern << by,
        Function::Shr => value >> by.min(bits),
        _ => {
            let by = (count.rem_euclid(i128::from(bits))) as u32;
            let left = if function == Function::Rol { by } else { (bits - by) % bits };
            (pattern << left) | (pattern >> (bits - left))
        }
    }
}

/// The bytes of a value in reverse order, as a number without sign.
fn reversed(kind: Kind, value: i128) -> i128 {
    (0..kind.bits().div_ceil(8)).fold(0, |sum, at| sum << 8 | (value >> (8 * at) & 0xFF))
}

/// A function of one float.
fn float(function: Function, value: &Value) -> Option<Value> {
    macro_rules! table {
        ($($name:ident $narrow:path, $wide:path);* $(;)?) => {
            match (function, value) {
                $((Function::$name, Value::Real(value)) => Some(Value::Real($narrow(*value))),
                (Function::$name, Value::Lreal(value)) => Some(Value::Lreal($wide(*value))),)*
                _ => None,
            }
        };
    }
    table! {
        Sqrt f32::sqrt, f64::sqrt;
        Ln libm::logf, libm::log;
        Log libm::log10f, libm::log10;
        Exp libm::expf, libm::exp;
        Sin libm::sinf, libm::sin;
        Cos libm::cosf, libm::cos;
        Tan libm::tanf, libm::tan;
        Asin libm::asinf, libm::asin;
        Acos libm::acosf, libm::acos;
        Atan libm::atanf, libm::atan;
        Abs f32::abs, f64::abs;
    }
}

/// The operator that a function folds over its inputs, or whose chain it is.
fn operator(function: Function) -> Option<Op> {
    Some(match function {
        Function::Add => Op::Add,
        Function::Mul => Op::Mul,
        Function::Sub => Op::Sub,
        Function::Div => Op::Div,
        Function::Mod => Op::Mod,
        Function::Expt => Op::Pow,
        Function::And => Op::And,
        Function::Or => Op::Or,
        Function::Xor => Op::Xor,
        Function::Gt => Op::Gt,
        Function::Ge => Op::Ge,
        Function::Eq => Op::Eq,
        Function::Le => Op::Le,
        Function::Lt => Op::Lt,
        Function::Ne => Op::Ne,
        _ => return None,
    })
}

/// Whether a function compares its inputs.
#[must_use]
pub fn compares(function: Function) -> bool {
    operator(function).is_some_and(|op| compare(op, &Value::Int(0), &Value::Int(0)).is_some())
}

/// A standard function; the inputs and the result of arithmetic are of type `kind`, in which integers wrap. None: its meaning is not written here.
///
/// # Errors
/// A division of integers by zero.
///
/// # Panics
/// When the tree is wrong.
pub fn standard(function: Function, kind: Kind, values: &[Value]) -> Result<Option<Value>, TrapCode> {
    let fold = |greatest: bool| values[1..].iter().fold(values[0].clone(), |a, b| pick(a, b.clone(), greatest));
    if let Some(op) = operator(function) {
        if compares(function) {
            let all = values.windows(2).all(|pair| compare(op, &pair[0], &pair[1]) == Some(true));
            return Ok(Some(Value::Int(i128::from(all))));
        }
        let first = values[0].clone();
        return values[1..].iter().try_fold(first, |a, b| binary(op, kind, &a, b)).map(Some);
    }
    if let Some(found) = float(function, &values[0]) {
        return Ok(Some(found));
    }
    if let Some(found) = moments::standard(function, kind, values)? {
        return Ok(Some(found));
    }
    Ok(Some(match function {
        Function::Abs => Value::Int(kind.wrap(values[0].int().abs())),
        Function::Not => complement(kind, &values[0]),
        Function::Atan2 => match (&values[0], &values[1]) {
            (Value::Real(y), Value::Real(x)) => Value::Real(libm::atan2f(*y, *x)),
            (Value::Lreal(y), Value::Lreal(x)) => Value::Lreal(libm::atan2(*y, *x)),
            other => panic!("ATAN2 of {other:?}"),
        },
        Function::Trunc => convert(Kind::Lreal, kind, &values[0], true),
        Function::Min => fold(false),
        Function::Max => fold(true),
        Function::Limit => {
            let inner = pick(values[1].clone(), values[0].clone(), true);
            pick(inner, values[2].clone(), false)
        }
        Function::Sel => values[if values[0].int() == 0 { 1 } else { 2 }].clone(),
        Function::Mux => {
            // Out of range, negative too: the last one.
            let wanted = usize::try_from(values[0].int()).unwrap_or(usize::MAX);
            values[wanted.saturating_add(1).min(values.len() - 1)].clone()
        }
        Function::Shl | Function::Shr | Function::Rol | Function::Ror => {
            Value::Int(kind.wrap(shift(function, kind, values[0].int(), values[1].int())))
        }
        Function::Move | Function::ToLittleEndian | Function::LittleEndianTo => values[0].clone(),
        Function::ToBigEndian | Function::BigEndianTo => Value::Int(kind.wrap(reversed(kind, values[0].int()))),
        Function::IsValid => Value::Int(i128::from(match &values[0] {
            Value::Real(value) => value.is_finite(),
            Value::Lreal(value) => value.is_finite(),
            other => panic!("IS_VALID of {other:?}"),
        })),
        Function::IsValidBcd => Value::Int(i128::from(!format!("{:X}", values[0].int()).contains(|c| c > '9'))),
        _ => return Ok(super::text::function(function, values)),
    }))
}
