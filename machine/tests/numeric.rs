//! Every numeric row, on edge values, against definitions of its own: integers by 128-bit arithmetic, floats by another width or by the
//! definition of rounding. The model reads the mnemonic, so a row that it does not know fails here.

#[path = "common/edges.rs"]
mod edges;

use std::hint::black_box;

use edges::all;
use khz_bytecode::instruction::NumericOp;
use khz_bytecode::trap::TrapCode;
use khz_bytecode::value::ValueType;
use khz_machine::semantics::{NAN_F32_BITS, NAN_F64_BITS, Value, eval_numeric};

fn signed(value: Value) -> i128 {
    match value {
        Value::I32(v) => v.into(),
        Value::I64(v) => v.into(),
        Value::F32(_) | Value::F64(_) => panic!("{value:?} is no integer"),
    }
}

fn unsigned(value: Value) -> i128 {
    value.bits().into()
}

fn real(value: Value) -> f64 {
    match value {
        Value::F32(v) => v.into(),
        Value::F64(v) => v,
        Value::I32(_) | Value::I64(_) => panic!("{value:?} is no float"),
    }
}

const DAY_NS: i128 = 86_400_000_000_000;

fn days_of_year(year: i128) -> i128 {
    let is_leap = year.rem_euclid(4) == 0 && year.rem_euclid(100) != 0 || year.rem_euclid(400) == 0;
    365 + i128::from(is_leap)
}

fn days_of_month(year: i128, month: i128) -> i128 {
    match month {
        2 => days_of_year(year) - 337,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Year, month and day, by walking from 1970-01-01.
fn civil(mut days: i128) -> (i128, i128, i128) {
    let (mut year, mut month) = (1970, 1);
    while days < 0 {
        year -= 1;
        days += days_of_year(year);
    }
    while days >= days_of_year(year) {
        days -= days_of_year(year);
        year += 1;
    }
    while days >= days_of_month(year, month) {
        days -= days_of_month(year, month);
        month += 1;
    }
    (year, month, days + 1)
}

/// The start of a month that is counted from January of the year 0: eras of 400 years, then year by year.
fn start_of_month(months: i128) -> i128 {
    let (era, year, month) = (months.div_euclid(4800), months.rem_euclid(4800) / 12, months.rem_euclid(12) + 1);
    let era_days: i128 = (0..400).map(days_of_year).sum();
    let of_years = |years: std::ops::Range<i128>| years.map(days_of_year).sum::<i128>();
    let days = era * era_days + of_years(0..year) + (1..month).map(|month| days_of_month(year, month)).sum::<i128>();
    (days - of_years(0..1970)) * DAY_NS
}

/// What a row of the calendar gives. `None`: not such a row.
fn calendar_model(name: &str, args: &[Value]) -> Option<i128> {
    let (first, second) = (signed(*args.first()?), args.get(1).map_or(0, |second| signed(*second)));
    Some(match name {
        "start" => first - first.rem_euclid(DAY_NS),
        "time" => first.rem_euclid(DAY_NS),
        "weekday" => (first.div_euclid(DAY_NS) + 4).rem_euclid(7),
        "year" => civil(first.div_euclid(DAY_NS)).0,
        "month" => civil(first.div_euclid(DAY_NS)).1,
        "day" => civil(first.div_euclid(DAY_NS)).2,
        "of" => start_of_month(first) + (second - 1) * DAY_NS,
        _ => return None,
    })
}

/// What an integer row of `bits` bits gives, by 128-bit arithmetic. `None`: not an integer row.
fn integer_model(name: &str, bits: u32, args: &[Value]) -> Option<Result<i128, TrapCode>> {
    let pick = |at: usize| if name.ends_with("_u") { unsigned(args[at]) } else { signed(args[at]) };
    let count = || unsigned(args[1]);
    let by_zero = Err(TrapCode::DivideByZero);
    let flag = |truth: bool| Ok(i128::from(truth));
    let mask = |width: u32| (1_i128 << width) - 1;
    let rotate = |width: u32, left: bool| {
        let value = unsigned(args[0]) & mask(width);
        let count = (count() % i128::from(width)) as u32;
        let count = if left { count } else { (width - count) % width };
        (value << count | value >> (width - count)) & mask(width)
    };
    Some(match name {
        "add" => Ok(signed(args[0]) + signed(args[1])),
        "sub" => Ok(signed(args[0]) - signed(args[1])),
        "mul" => Ok(signed(args[0]) * signed(args[1])),
        "div_s" | "div_u" => {
            if pick(1) == 0 {
                by_zero
            } else {
                Ok(pick(0) / pick(1))
            }
        }
        "rem_s" | "rem_u" => {
            if pick(1) == 0 {
                by_zero
            } else {
                Ok(pick(0) % pick(1))
            }
        }
        "and" => Ok(signed(args[0]) & signed(args[1])),
        "or" => Ok(signed(args[0]) | signed(args[1])),
        "xor" => Ok(signed(args[0]) ^ signed(args[1])),
        "shl" => Ok(if count() < bits.into() { signed(args[0]) << count() } else { 0 }),
        "shr_s" | "shr_u" => Ok(pick(0) >> count().min(100)),
        "rotl" => Ok(rotate(bits, true)),
        "rotr" => Ok(rotate(bits, false)),
        "rotl8" => Ok(rotate(8, true)),
        "rotr8" => Ok(rotate(8, false)),
        "rotl16" => Ok(rotate(16, true)),
        "rotr16" => Ok(rotate(16, false)),
        "neg" => Ok(-signed(args[0])),
        "abs" => Ok(signed(args[0]).abs()),
        "not" => Ok(-1 - signed(args[0])),
        "min_s" | "min_u" => Ok(pick(0).min(pick(1))),
        "max_s" | "max_u" => Ok(pick(0).max(pick(1))),
        "eq" => flag(signed(args[0]) == signed(args[1])),
        "ne" => flag(signed(args[0]) != signed(args[1])),
        "lt_s" | "lt_u" => flag(pick(0) < pick(1)),
        "le_s" | "le_u" => flag(pick(0) <= pick(1)),
        "gt_s" | "gt_u" => flag(pick(0) > pick(1)),
        "ge_s" | "ge_u" => flag(pick(0) >= pick(1)),
        "eqz" => flag(signed(args[0]) == 0),
        "nez" => flag(signed(args[0]) != 0),
        "extend8_s" => Ok((unsigned(args[0]) & 0xFF ^ 0x80) - 0x80),
        "extend16_s" => Ok((unsigned(args[0]) & 0xFFFF ^ 0x8000) - 0x8000),
        "extend8_u" => Ok(unsigned(args[0]) & 0xFF),
        "extend16_u" => Ok(unsigned(args[0]) & 0xFFFF),
        "extend_i32_s" => Ok(signed(args[0])),
        "extend_i32_u" => Ok(unsigned(args[0])),
        "wrap_i64" => Ok(signed(args[0])),
        "saturate_u32" | "saturate_i64_u" => Ok(unsigned(args[0]).min(i32::MAX.into())),
        "saturate_i64_s" => Ok(signed(args[0]).clamp(i32::MIN.into(), i32::MAX.into())),
        "reinterpret_f32" | "reinterpret_f64" => Ok(unsigned(args[0])),
        _ => return calendar_model(name, args).map(Ok),
    })
}

/// A float rounded or cut to an integer, by the definition, then saturated.
fn to_integer_model(name: &str, value: f64) -> i128 {
    let (method, target) = name.split_once('_').unwrap();
    let bits: u32 = target[1..].parse().unwrap();
    let (least, most) = if target.starts_with('i') {
        (-(1_i128 << (bits - 1)), (1_i128 << (bits - 1)) - 1)
    } else {
        (0, (1_i128 << bits) - 1)
    };
    if value.is_nan() {
        return 0;
    }
    let below = value.floor();
    let rounded = match (method, value - below) {
        ("trunc", _) => value.trunc() as i128,
        (_, rest) if rest < 0.5 || rest == 0.5 && below as i128 % 2 == 0 => below as i128,
        (_, rest) if rest.is_finite() => below as i128 + 1,
        _ => value as i128,
    };
    rounded.clamp(least, most)
}

/// Whether `value` is `exact` rounded to nearest even: no neighbour is nearer, and at a tie the last bit is even.
fn is_nearest(exact: i128, value: Value) -> bool {
    let (candidate, below, above) = match value {
        Value::F32(v) => (v as i128, v.next_down() as i128, v.next_up() as i128),
        Value::F64(v) => (v as i128, v.next_down() as i128, v.next_up() as i128),
        _ => return false,
    };
    let (distance, other) = ((exact - candidate).abs(), (exact - below).abs().min((exact - above).abs()));
    distance == 0 || distance < other || distance == other && value.bits() & 1 == 0
}

fn assert_float(op: NumericOp, args: &[Value], got: Value) {
    let (name, width) = (op.mnemonic().split_once('.').unwrap().1, op.result());
    let narrow = |value: f64| match width {
        ValueType::F32 => Value::from_bits(ValueType::F32, u64::from((value as f32).to_bits())),
        _ => Value::from_bits(ValueType::F64, value.to_bits()),
    };
    let x = |at: usize| black_box(real(args[at]));
    let expected = match name {
        // Computed in 64 bits and then rounded, these are exact for 32 bits too.
        "add" => narrow(x(0) + x(1)),
        "sub" => narrow(x(0) - x(1)),
        "mul" => narrow(x(0) * x(1)),
        "div" => narrow(x(0) / x(1)),
        "sqrt" => narrow(x(0).sqrt()),
        "neg" => narrow(f64::from_bits(x(0).to_bits() ^ 1 << 63)),
        "abs" => narrow(f64::from_bits(x(0).to_bits() & !(1 << 63))),
        "min" => {
            if x(1) < x(0) {
                args[1]
            } else {
                args[0]
            }
        }
        "max" => {
            if x(1) > x(0) {
                args[1]
            } else {
                args[0]
            }
        }
        "demote_f64" | "promote_f32" => narrow(x(0)),
        "reinterpret_i32" | "reinterpret_i64" => Value::from_bits(width, args[0].bits()),
        "sin" => return assert_close(op, args, got, x(0).sin()),
        "cos" => return assert_close(op, args, got, x(0).cos()),
        "tan" => return assert_close(op, args, got, x(0).tan()),
        "asin" => return assert_close(op, args, got, x(0).asin()),
        "acos" => return assert_close(op, args, got, x(0).acos()),
        "atan" => return assert_close(op, args, got, x(0).atan()),
        "exp" => return assert_close(op, args, got, x(0).exp()),
        "ln" => return assert_close(op, args, got, x(0).ln()),
        "log" => return assert_close(op, args, got, x(0).log10()),
        "atan2" => return assert_close(op, args, got, x(0).atan2(x(1))),
        "pow" => return assert_close(op, args, got, x(0).powf(x(1))),
        _ => {
            let exact = if name.ends_with("_u") { unsigned(args[0]) } else { signed(args[0]) };
            assert!(name.starts_with("convert_") && is_nearest(exact, got), "{op:?} {args:?}: {got:?}");
            return;
        }
    };
    assert_eq!(got, expected, "{op:?} {args:?}");
}

/// The libm functions are pinned, not correctly rounded: near the system's, with the same zeros, infinities and NaNs.
fn assert_close(op: NumericOp, args: &[Value], got: Value, wanted: f64) {
    let (got, tolerance) = (real(got), if op.result() == ValueType::F32 { 1e-6 } else { 1e-14 });
    let wanted = if op.result() == ValueType::F32 { f64::from(wanted as f32) } else { wanted };
    let is_close = (got - wanted).abs() <= tolerance * wanted.abs().max(1e-37);
    assert!(is_close || got == wanted || got.is_nan() && wanted.is_nan(), "{op:?} {args:?}: {got}, not {wanted}");
    assert!(got != 0.0 || wanted != 0.0 || got.is_sign_negative() == wanted.is_sign_negative(), "{op:?} {args:?}");
}

fn check(op: NumericOp, args: &[Value]) {
    let got = eval_numeric(op, args);
    let name = op.mnemonic().split_once('.').unwrap().1;
    let is_float_operand = matches!(op.operands()[0], ValueType::F32 | ValueType::F64);
    if let Ok(value) = got {
        assert_eq!(value.value_type(), op.result(), "{op:?}");
    }
    if matches!(op.result(), ValueType::F32 | ValueType::F64) {
        let got = got.unwrap();
        let is_canonical = !real(got).is_nan() || got.bits() == u64::from(NAN_F32_BITS) || got.bits() == NAN_F64_BITS;
        assert!(is_canonical, "{op:?} {args:?}: {:x}", got.bits());
        return assert_float(op, args, got);
    }
    if is_float_operand && !name.starts_with("reinterpret") {
        let expected = match name {
            "eq" => i128::from(real(args[0]) == real(args[1])),
            "ne" => i128::from(real(args[0]) != real(args[1])),
            "lt" | "le" | "gt" | "ge" => {
                let order = real(args[0]).partial_cmp(&real(args[1]));
                i128::from(order.is_some_and(|order| match name {
                    "lt" => order.is_lt(),
                    "le" => order.is_le(),
                    "gt" => order.is_gt(),
                    _ => order.is_ge(),
                }))
            }
            _ => to_integer_model(name, real(args[0])),
        };
        assert_eq!(got, Ok(Value::from_bits(op.result(), expected as u64)), "{op:?} {args:?}");
        return;
    }
    let bits = if op.operands()[0] == ValueType::I32 { 32 } else { 64 };
    let expected = integer_model(name, bits, args).unwrap_or_else(|| panic!("the model does not know {op:?}"));
    assert_eq!(got, expected.map(|value| Value::from_bits(op.result(), value as u64)), "{op:?} {args:?}");
}

#[test]
fn every_row_on_edge_values() {
    for op in NumericOp::ALL {
        match op.operands() {
            [one] => all(*one).into_iter().for_each(|a| check(*op, &[black_box(a)])),
            [one, two] => {
                for a in all(*one) {
                    all(*two).into_iter().for_each(|b| check(*op, &black_box([a, b])));
                }
            }
            other => panic!("{op:?} takes {other:?}"),
        }
    }
}

#[test]
fn every_pair_of_narrow_numbers() {
    let rows = NumericOp::ALL.iter().filter(|op| op.operands().iter().all(|ty| *ty == ValueType::I32));
    for op in rows.filter(|op| op.operands().len() == 2) {
        for a in -128..=255 {
            for b in (-128..=255).step_by(3) {
                check(*op, &[Value::I32(a), Value::I32(b)]);
            }
        }
    }
}

#[test]
fn foreign_nans_become_the_one_nan() {
    for bits in [0x7FC0_0000_u32, 0x7F80_0001, 0xFFFF_FFFF, 0xFFC0_0001] {
        let got = eval_numeric(NumericOp::F32ReinterpretI32, &[Value::I32(black_box(bits) as i32)]);
        assert_eq!(got.unwrap().bits(), u64::from(NAN_F32_BITS));
    }
    for bits in [0x7FF8_0000_0000_0000_u64, 0x7FF0_0000_0000_0001, u64::MAX] {
        let got = eval_numeric(NumericOp::F64ReinterpretI64, &[Value::I64(black_box(bits) as i64)]);
        assert_eq!(got.unwrap().bits(), NAN_F64_BITS);
    }
}
