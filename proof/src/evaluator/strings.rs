//! The string rows on copied characters; numbers, times and dates as text are in [`texts`].

use khz_bytecode::instruction::{HelperOp, HelperOperand};
use khz_machine::semantics::{StringPlace, Value};

use super::texts;

/// Characters before the terminator, at most as many as the capacity; `unit` is the bytes of each.
fn text(image: &[u8], place: StringPlace, unit: usize) -> Vec<u16> {
    let room = &image[place.at as usize..][..unit * usize::from(place.capacity)];
    let characters =
        room.chunks(unit).map(|bytes| bytes.iter().rev().fold(0, |high, byte| high << 8 | u16::from(*byte)));
    characters.take_while(|character| *character != 0).collect()
}

fn put(image: &mut [u8], place: StringPlace, unit: usize, text: &[u16]) {
    let kept = &text[..text.len().min(usize::from(place.capacity))];
    let bytes = kept.iter().chain(&[0]).flat_map(|character| character.to_le_bytes().into_iter().take(unit));
    image[place.at as usize..].iter_mut().zip(bytes).for_each(|(to, byte)| *to = byte);
}

/// `count` cut to 0..=`most`.
fn clamp(count: i64, most: usize) -> usize {
    count.clamp(0, most as i64) as usize
}

/// Does one string instruction.
///
/// # Panics
/// When a place lies outside the image.
pub(super) fn apply(op: HelperOp, image: &mut [u8], places: &[StringPlace], values: &[Value]) -> Option<Value> {
    use HelperOp as H;
    let number = |at: usize| match values.get(at) {
        Some(Value::I32(value)) => i64::from(*value),
        Some(Value::I64(value)) => *value,
        _ => 0,
    };
    let strings: Vec<HelperOperand> = op.operands().iter().copied().filter(|operand| operand.is_string()).collect();
    let unit = |at: usize| if strings[at].is_wide() { 2 } else { 1 };
    let contents: Vec<Vec<u16>> = places.iter().enumerate().map(|(at, place)| text(image, *place, unit(at))).collect();
    // The first source: behind the destination, when there is one.
    let source = contents.get(1).cloned().unwrap_or_default();
    let (before, behind) = {
        let start = clamp(number(1).saturating_sub(1), source.len());
        let end = start + clamp(number(0), source.len() - start);
        (start, end)
    };
    if let Some(value) = read(op, &contents) {
        return Some(value);
    }
    let result = match op {
        H::StringAssign | H::WideAssign | H::WideFromString => source,
        H::StringFromWide => {
            source.iter().map(|character| if *character > 255 { u16::from(b'?') } else { *character }).collect()
        }
        H::StringLeft | H::WideLeft => source[..clamp(number(0), source.len())].to_vec(),
        H::StringRight | H::WideRight => source[source.len() - clamp(number(0), source.len())..].to_vec(),
        H::StringMid | H::WideMid => source[before..behind].to_vec(),
        H::StringConcat | H::WideConcat => [&source[..], &contents[2]].concat(),
        H::StringInsert | H::WideInsert => {
            let at = clamp(number(0), source.len());
            [&source[..at], &contents[2], &source[at..]].concat()
        }
        H::StringDelete | H::WideDelete => [&source[..before], &source[behind..]].concat(),
        H::StringReplace | H::WideReplace => [&source[..before], &contents[2], &source[behind..]].concat(),
        H::StringFromChar => Some(number(0) as u16 & 0xFF).into_iter().filter(|byte| *byte != 0).collect(),
        H::WideFromChar => Some(number(0) as u16).into_iter().filter(|unit| *unit != 0).collect(),
        _ => written(op, values[0]).encode_utf16().collect(),
    };
    put(image, places[0], unit(0), &result);
    None
}

/// A value as text.
fn written(op: HelperOp, value: Value) -> String {
    let number = match value {
        Value::I32(value) => i128::from(value),
        Value::I64(value) => i128::from(value),
        Value::F32(_) | Value::F64(_) => 0,
    };
    match (op, value) {
        (HelperOp::StringFromI64, _) => number.to_string(),
        (HelperOp::StringFromU64, _) => number.rem_euclid(1 << 64).to_string(),
        (HelperOp::StringFromBool, _) => if number == 0 { "FALSE" } else { "TRUE" }.to_string(),
        (HelperOp::StringFromF32, Value::F32(value)) => {
            texts::from_float(f64::from(value), &format!("{value}"), &format!("{value:e}"))
        }
        (HelperOp::StringFromF64, Value::F64(value)) => {
            texts::from_float(value, &format!("{value}"), &format!("{value:e}"))
        }
        (HelperOp::StringFromTime, _) => texts::from_time(number),
        (HelperOp::StringFromDate, _) => texts::from_date(number),
        (HelperOp::StringFromTod, _) => texts::from_time_of_day(number),
        (HelperOp::StringFromDt, _) => texts::from_moment(number),
        _ => panic!("no meaning for {} of {value:?}", op.mnemonic()),
    }
}

/// What the rows without a destination make of their strings; none: it is a row with one.
fn read(op: HelperOp, contents: &[Vec<u16>]) -> Option<Value> {
    use HelperOp as H;
    match op {
        H::StringLen | H::WideLen => return Some(Value::I32(contents[0].len() as i32)),
        H::StringFind | H::WideFind => return Some(Value::I32(find(&contents[0], &contents[1]))),
        H::StringCompare | H::WideCompare => return Some(Value::I32(contents[0].cmp(&contents[1]) as i32)),
        _ => {}
    }
    // Conversions read narrow strings only.
    let text: &[u8] = &contents[0].iter().map(|character| *character as u8).collect::<Vec<u8>>();
    let saturated = |value: i128| Value::I64(value.clamp(i128::from(i64::MIN), i128::from(i64::MAX)) as i64);
    Some(match op {
        HelperOp::StringToBool => Value::I32(i32::from(text.eq_ignore_ascii_case(b"TRUE"))),
        HelperOp::StringToI64 => saturated(texts::to_integer(text)),
        HelperOp::StringToU64 => Value::I64(texts::to_integer(text).clamp(0, i128::from(u64::MAX)) as u64 as i64),
        HelperOp::StringToF32 => {
            let value: f32 = texts::float_prefix(text).parse().expect("a number");
            Value::F32(if value.is_nan() { f32::from_bits(0xFFC0_0000) } else { value })
        }
        HelperOp::StringToF64 => {
            let value: f64 = texts::float_prefix(text).parse().expect("a number");
            Value::F64(if value.is_nan() { f64::from_bits(0xFFF8_0000_0000_0000) } else { value })
        }
        HelperOp::StringToTime => saturated(texts::to_time(text)),
        HelperOp::StringToDate => saturated(texts::to_date(text)),
        HelperOp::StringToTod => saturated(texts::to_time_of_day(text)),
        HelperOp::StringToDt => saturated(texts::to_moment(text)),
        _ => return None,
    })
}

fn find(text: &[u16], wanted: &[u16]) -> i32 {
    if wanted.is_empty() {
        return 0;
    }
    text.windows(wanted.len()).position(|part| part == wanted).map_or(0, |at| at as i32 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use khz_bytecode::instruction::HelperOperand;
    use khz_bytecode::value::ValueType;
    use khz_machine::semantics::eval_helper;

    use crate::random::Random;

    const CAPACITY: u16 = 90;

    /// Texts that the rows read, with every piece of their grammars in places where it is right and where it is not.
    const PIECES: [&str; 46] = [
        "0",
        "1",
        "7",
        "9",
        "12",
        "29",
        "30",
        "31",
        "59",
        "60",
        "99",
        "1970",
        "2024",
        "2023",
        "9999",
        "9223372036854775807",
        "18446744073709551615",
        "36028797018963968",
        "0x",
        "#",
        "2#",
        "8#",
        "16#",
        "-",
        "-",
        "+",
        ".",
        ".",
        "e",
        "E-",
        "_",
        ":",
        ":",
        "d",
        "h",
        "m",
        "s",
        "ms",
        "US",
        "ns",
        "T#",
        "TOD#",
        "LDT#",
        "DATE#",
        "NaN",
        "Infinity",
    ];

    /// Whole texts that random pieces seldom make.
    const WHOLE: [&str; 16] = [
        "DT#2024-02-29-12:34:56.789",
        "ldate_and_time#1900-2-28-0:0",
        "D#1900-02-29",
        "2000-02-29",
        "TOD#23:59:59.9999999999",
        "-25:61:00",
        "T#-1d2h3m4s5ms6us7ns",
        "time#1.5d",
        "LTIME#0.0000000000000115740740740741d",
        "t#106751d23h47m16s854ms775us807ns",
        "1h_30m_",
        "16#FFFF_ffff_ffff_ffff",
        "8#18",
        "1_000.5e-1_0",
        "5e-324",
        "-2.2250738585072011e-308",
    ];

    fn random_text(random: &mut Random) -> Vec<u8> {
        if random.chance(20) {
            return random.one_of(WHOLE).into();
        }
        (0..random.below(9)).flat_map(|_| random.one_of(PIECES).bytes()).take(usize::from(CAPACITY)).collect()
    }

    fn random_value(random: &mut Random, ty: ValueType) -> Value {
        let bits = random.bits() >> random.below(64);
        let bits = if random.chance(50) { bits.wrapping_neg() } else { bits };
        match ty {
            ValueType::I32 => Value::I32(bits as i32),
            ValueType::I64 => Value::I64(bits as i64),
            ValueType::F32 if random.chance(50) => Value::F32(bits as u8 as f32 * 1e-6),
            ValueType::F32 => Value::F32(f32::from_bits(bits as u32)),
            ValueType::F64 if random.chance(50) => Value::F64(bits as u16 as f64 * 1e13),
            ValueType::F64 => Value::F64(f64::from_bits(bits)),
        }
    }

    /// This evaluator and `khz_machine` were written apart and agree on every row; generated containers seldom have texts that come so far.
    #[test]
    fn every_row_means_what_the_engines_do() {
        let mut random = Random::new(19);
        for round in 0..HelperOp::ALL.len() * 4000 {
            let op = HelperOp::ALL[round % HelperOp::ALL.len()];
            let (mut places, mut values, mut image) = (Vec::new(), Vec::new(), Vec::new());
            for operand in op.operands() {
                if let HelperOperand::Value(ty) = operand {
                    values.push(random_value(&mut random, *ty));
                    continue;
                }
                // Characters of two bytes stand on even addresses.
                image.resize(image.len().next_multiple_of(2), 0_u8);
                places.push(StringPlace { at: image.len() as u32, capacity: CAPACITY });
                let mut text = random_text(&mut random);
                text.resize(usize::from(CAPACITY) + 1, 0);
                let unit = if operand.is_wide() { 2 } else { 1 };
                image.extend(text.iter().flat_map(|byte| u16::from(*byte).to_le_bytes().into_iter().take(unit)));
            }
            let (before, mut theirs) = (image.clone(), image.clone());
            let ours = apply(op, &mut image, &places, &values);
            let expected = eval_helper(op, &mut theirs, &places, &values);
            let bits = |value: Option<Value>| value.map(|value| (value.value_type(), value.bits()));
            let shown = || (String::from_utf8_lossy(&before).replace('\0', ""), &values, &expected);
            assert_eq!(bits(ours), bits(expected), "{} of {:?}", op.mnemonic(), shown());
            assert!(image == theirs, "{} of {:?} gives {:?}", op.mnemonic(), shown(), String::from_utf8_lossy(&image));
        }
    }
}
