//! Operators, conversions and standard functions over values.

use khz_bytecode::trap::TrapCode;

use super::tree::{Kind, Op, Value};

/// Standard functions that the generator uses.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Function {
    Abs,
    Sqrt,
    Min,
    Max,
    Limit,
    Sel,
    Mux,
    Shl,
    Shr,
    Rol,
    Ror,
    Add,
    Mul,
    Move,
    Len,
    Left,
    Right,
    Mid,
    Concat,
    Insert,
    Delete,
    Replace,
    Find,
}

impl Function {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        const NAMES: [&str; 23] = [
            "ABS", "SQRT", "MIN", "MAX", "LIMIT", "SEL", "MUX", "SHL", "SHR", "ROL", "ROR", "ADD", "MUL", "MOVE",
            "LEN", "LEFT", "RIGHT", "MID", "CONCAT", "INSERT", "DELETE", "REPLACE", "FIND",
        ];
        NAMES[self as usize]
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

fn equal(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Real(a), Value::Real(b)) => a == b,
        (Value::Lreal(a), Value::Lreal(b)) => a == b,
        _ => a == b,
    }
}

/// A binary operation whose operands are of one type, of which integers wrap in `kind`.
///
/// # Errors
/// A division of integers by zero.
///
/// # Panics
/// When the tree is wrong.
pub fn binary(op: Op, kind: Kind, a: &Value, b: &Value) -> Result<Value, TrapCode> {
    let flag = |value: bool| Ok(Value::Int(i128::from(value)));
    match op {
        Op::Eq => return flag(equal(a, b)),
        Op::Ne => return flag(!equal(a, b)),
        Op::Lt => return flag(less(a, b)),
        Op::Gt => return flag(less(b, a)),
        Op::Le => return flag(less(a, b) || equal(a, b)),
        Op::Ge => return flag(less(b, a) || equal(a, b)),
        _ => {}
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
    const MILLISECOND: i128 = 1_000_000;
    let float = match value {
        Value::Real(value) => Some(f64::from(*value)),
        Value::Lreal(value) => Some(*value),
        _ => None,
    };
    match (float, to) {
        (Some(value), Kind::Bool) => Value::Int(i128::from(value != 0.0)),
        (Some(value), Kind::Real) => Value::Real(value as f32),
        (Some(value), Kind::Lreal) => Value::Lreal(value),
        (Some(value), _) => saturate(to, if cut { value.trunc() } else { value.round_ties_even() }),
        // From the exact integer, so that it is rounded once.
        (None, Kind::Real) => Value::Real(value.int() as f32),
        (None, Kind::Lreal) => Value::Lreal(value.int() as f64),
        (None, Kind::Bool) => Value::Int(i128::from(value.int() != 0)),
        (None, Kind::Time) if from != Kind::Time => Value::Int(to.wrap(value.int().wrapping_mul(MILLISECOND))),
        (None, _) if from == Kind::Time && to != Kind::Time => Value::Int(to.wrap(value.int() / MILLISECOND)),
        (None, _) => Value::Int(to.wrap(value.int())),
    }
}

/// `STRING_TO_x` of a decimal prefix.
#[must_use]
pub fn number_in(kind: Kind, text: &[u8]) -> Value {
    let (sign, digits) = match text.split_first() {
        // A sign is no valid beginning of a number without one.
        Some((b'-', rest)) if kind.is_signed() => (-1, rest),
        _ => (1, text),
    };
    let end = digits.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(digits.len());
    let number = digits[..end].iter().fold(0_i128, |sum, digit| sum * 10 + i128::from(digit - b'0'));
    Value::Int(kind.wrap(sign * number))
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

/// The bytes `from..from + count` by a 1-based position, clamped to the string.
fn span(text: &[u8], count: i128, position: i128) -> (usize, usize) {
    let start = (position - 1).clamp(0, text.len() as i128) as usize;
    let count = count.clamp(0, (text.len() - start) as i128) as usize;
    (start, start + count)
}

fn string(function: Function, values: &[Value]) -> Value {
    let text = values[0].bytes();
    let number = |at: usize| values[at].int();
    let clamped = |at: usize| number(at).clamp(0, text.len() as i128) as usize;
    Value::Str(match function {
        Function::Left => text[..clamped(1)].to_vec(),
        Function::Right => text[text.len() - clamped(1)..].to_vec(),
        Function::Mid => {
            let (from, to) = span(text, number(1), number(2));
            text[from..to].to_vec()
        }
        Function::Concat => values.iter().flat_map(|value| value.bytes().to_vec()).collect(),
        Function::Insert => {
            let at = clamped(2);
            [&text[..at], values[1].bytes(), &text[at..]].concat()
        }
        Function::Delete => {
            let (from, to) = span(text, number(1), number(2));
            [&text[..from], &text[to..]].concat()
        }
        Function::Replace => {
            let (from, to) = span(text, number(2), number(3));
            [&text[..from], values[1].bytes(), &text[to..]].concat()
        }
        _ => panic!("{function:?} makes no string"),
    })
}

/// A standard function; integers wrap in `kind`.
///
/// # Panics
/// When the tree is wrong.
#[must_use]
pub fn standard(function: Function, kind: Kind, values: &[Value]) -> Value {
    let fold = |greatest: bool| values[1..].iter().fold(values[0].clone(), |a, b| pick(a, b.clone(), greatest));
    match function {
        Function::Abs => match &values[0] {
            Value::Real(value) => Value::Real(value.abs()),
            Value::Lreal(value) => Value::Lreal(value.abs()),
            value => Value::Int(kind.wrap(value.int().abs())),
        },
        Function::Sqrt => match &values[0] {
            Value::Real(value) => Value::Real(value.sqrt()),
            Value::Lreal(value) => Value::Lreal(value.sqrt()),
            other => panic!("SQRT of {other:?}"),
        },
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
        Function::Add | Function::Mul => {
            let op = if function == Function::Add { Op::Add } else { Op::Mul };
            let step = |a: Value, b: &Value| binary(op, kind, &a, b).unwrap_or(a);
            values[1..].iter().fold(values[0].clone(), step)
        }
        Function::Move => values[0].clone(),
        Function::Len => Value::Int(values[0].bytes().len() as i128),
        Function::Find => {
            let (text, wanted) = (values[0].bytes(), values[1].bytes());
            let found = text.windows(wanted.len().max(1)).position(|window| window == wanted);
            Value::Int(found.map_or(0, |at| at as i128 + 1))
        }
        _ => string(function, values),
    }
}
