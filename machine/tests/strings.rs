//! String instructions against a model that copies everything first, on random, overlapping and hostile places; numbers and times
//! against Rust's own and by round trips.

use khz_bytecode::instruction::{HelperOp, HelperOperand};
use khz_bytecode::value::ValueType;
use khz_machine::semantics::strings::*;
use khz_machine::semantics::{StringPlace, Value, eval_helper};

/// SplitMix64: the same numbers in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }
}

/// Characters of `unit` bytes before the terminator.
fn characters(memory: &[u8], place: StringPlace, unit: usize) -> Vec<u16> {
    let room = &memory[place.at as usize..][..unit * usize::from(place.capacity)];
    let all = room.chunks(unit).map(|bytes| u16::from(bytes[0]) | u16::from(*bytes.get(1).unwrap_or(&0)) << 8);
    all.take_while(|character| *character != 0).collect()
}

fn bytes_of(text: &[u16], unit: usize) -> Vec<u8> {
    text.iter().flat_map(|character| character.to_le_bytes().into_iter().take(unit)).collect()
}

fn cut(text: &[u16], from: i64, to: i64) -> Vec<u16> {
    let index = |at: i64| at.clamp(0, text.len() as i64) as usize;
    text[index(from)..index(to).max(index(from))].to_vec()
}

/// The text that a row with a destination makes; `None` for rows without one.
fn model(op: HelperOp, s: &[Vec<u16>], v: &[i64]) -> Option<Vec<u16>> {
    use HelperOp as H;
    let position = |at: usize| (v[at] - 1).max(0);
    let count = |at: usize| v[at].max(0);
    Some(match op {
        H::StringAssign | H::WideAssign | H::WideFromString => s[0].clone(),
        H::StringFromWide => s[0].iter().map(|c| if *c < 256 { *c } else { u16::from(b'?') }).collect(),
        H::StringLeft | H::WideLeft => cut(&s[0], 0, v[0]),
        H::StringRight | H::WideRight => cut(&s[0], s[0].len() as i64 - count(0), s[0].len() as i64),
        H::StringMid | H::WideMid => cut(&s[0], position(1), position(1) + count(0)),
        H::StringConcat | H::WideConcat => [&s[0][..], &s[1]].concat(),
        H::StringInsert | H::WideInsert => [&cut(&s[0], 0, v[0])[..], &s[1], &cut(&s[0], v[0], 1 << 20)].concat(),
        H::StringDelete | H::WideDelete => {
            [cut(&s[0], 0, position(1)), cut(&s[0], position(1) + count(0), 1 << 20)].concat()
        }
        H::StringReplace | H::WideReplace => {
            [&cut(&s[0], 0, position(1))[..], &s[1], &cut(&s[0], position(1) + count(0), 1 << 20)].concat()
        }
        H::StringFromChar => vec![v[0] as u16 & 0xFF],
        H::WideFromChar => vec![v[0] as u16],
        _ => return None,
    })
}

fn run_one(random: &mut Random, op: HelperOp, size: usize, hostile: bool) {
    let alphabet = 1 + random.below(4);
    let mut memory: Vec<u8> =
        (0..size).map(|_| if random.below(9) == 0 { 0 } else { b'a' + random.below(alphabet) as u8 }).collect();
    if random.below(2) == 0 {
        // Code units below 256, at even or odd offsets.
        let first = random.below(2) as usize;
        memory.iter_mut().skip(first).step_by(2).for_each(|byte| *byte = 0);
    }
    let place = |random: &mut Random, unit: u64| {
        let at = random.below(size as u64 - unit);
        let capacity = random.below((size as u64 - at) / unit);
        if hostile && random.below(3) == 0 {
            StringPlace { at: random.next() as u32, capacity: random.next() as u16 }
        } else {
            StringPlace { at: at as u32, capacity: capacity as u16 }
        }
    };
    let units: Vec<u64> = op.operands().iter().map(|o| u64::from(o.unit_bytes())).filter(|unit| *unit > 0).collect();
    let strings: Vec<StringPlace> = units.iter().map(|unit| place(random, *unit)).collect();
    let numbers: Vec<i64> = (0..2)
        .map(|_| match random.below(12) {
            0 => i64::from(i32::MIN),
            1 => i64::from(i32::MAX),
            2 if op.mnemonic().contains("from_") => random.next() as i64,
            _ => random.below(size as u64 + 4) as i64 - 3,
        })
        .collect();
    let values: Vec<Value> = numbers.iter().map(|n| Value::I32(*n as i32)).collect();
    let mut got = memory.clone();
    let result = eval_helper(op, &mut got, &strings, &values);
    if hostile {
        return;
    }
    let texts: Vec<_> = strings.iter().zip(&units).map(|(p, unit)| characters(&memory, *p, *unit as usize)).collect();
    let sources = &texts[usize::from(op.operands()[0].is_destination())..];
    use HelperOp as H;
    if let Some(text) = model(op, sources, &numbers) {
        let mut expected = memory.clone();
        let (dst, unit) = (strings[0], units[0] as usize);
        let mut text = text[..text.len().min(dst.capacity.into())].to_vec();
        text.push(0);
        let bytes = bytes_of(&text, unit);
        let end = if text[0] == 0 { unit } else { bytes.len() };
        expected[dst.at as usize..][..end].copy_from_slice(&bytes[..end]);
        assert_eq!(got, expected, "{op:?} {strings:?} {numbers:?}");
    } else if let H::StringFind | H::WideFind = op {
        let found = (0..sources[0].len()).find(|at| sources[0][*at..].starts_with(&sources[1]));
        let expected = found.filter(|_| !sources[1].is_empty()).map_or(0, |at| at as i32 + 1);
        assert_eq!(result, Some(Value::I32(expected)));
    } else if let H::StringCompare | H::WideCompare = op {
        assert_eq!(result, Some(Value::I32(sources[0].cmp(&sources[1]) as i32)));
    } else if let H::StringLen | H::WideLen = op {
        assert_eq!(result, Some(Value::I32(sources[0].len() as i32)));
    }
}

/// Whether [`model`] or a branch beside it knows the row, or the row only reads.
fn is_modelled(op: HelperOp) -> bool {
    let formats = matches!(op.operands(), [HelperOperand::Dst, HelperOperand::Value(_)]);
    op == HelperOp::StringFromChar || !formats
}

#[test]
fn overlapping_places_read_before_they_write() {
    let mut random = Random(1);
    for op in HelperOp::ALL.iter().filter(|op| is_modelled(**op)) {
        for round in 0..4000 {
            run_one(&mut random, *op, 8 + round % 60, false);
        }
    }
}

#[test]
fn hostile_places_do_no_harm() {
    let mut random = Random(2);
    for op in HelperOp::ALL {
        for _ in 0..400 {
            run_one(&mut random, *op, 40, true);
        }
        let mut nothing: [u8; 0] = [];
        let anywhere = [StringPlace { at: u32::MAX, capacity: u16::MAX }; 3];
        let result = eval_helper(*op, &mut nothing, &anywhere, &[]);
        assert_eq!(result.map(Value::value_type), op.result());
        assert_eq!(eval_helper(*op, &mut [1], &[], &[]).map(Value::value_type), op.result());
    }
}

#[test]
fn long_strings_that_cross_each_other() {
    // REPLACE with a destination that lies across both sources: every copy destroys what another reads.
    for (half, shift) in [(200_u32, 50_u32), (3_000, 700), (30_000, 9_000)] {
        let memory: Vec<u8> = (0..4 * half).map(|at| b'A' + (at * 7 % 61) as u8 + (at / half) as u8).collect();
        let place = |at: u32, capacity: u32| StringPlace { at, capacity: capacity as u16 };
        let (a, b, dst) = (place(shift, half), place(0, half), place(shift / 2, 2 * half));
        let mut got = memory.clone();
        string_concat(&mut got, dst, a, b);
        let text = bytes_of(&[characters(&memory, a, 1), characters(&memory, b, 1)].concat(), 1);
        let mut expected = memory.clone();
        expected[dst.at as usize..][..text.len()].copy_from_slice(&text);
        expected[dst.at as usize + text.len()] = 0;
        assert!(got == expected, "{half}");
        let mut got = memory.clone();
        let (a, b, dst) = (place(shift, half / 2), place(1, half / 2), place(shift / 2, half));
        wide_concat(&mut got, dst, a, b);
        let text = bytes_of(&[characters(&memory, a, 2), characters(&memory, b, 2), vec![0]].concat(), 2);
        let mut expected = memory.clone();
        expected[dst.at as usize..][..text.len()].copy_from_slice(&text);
        assert!(got == expected, "{half} wide");
    }
}

fn text_of(value: Value) -> String {
    let mut memory = vec![0; 100];
    let dst = StringPlace { at: 3, capacity: 90 };
    match value {
        Value::F32(v) => string_from_f32(&mut memory, dst, v),
        Value::F64(v) => string_from_f64(&mut memory, dst, v),
        Value::I64(v) => string_from_time(&mut memory, dst, v),
        Value::I32(v) => string_from_bool(&mut memory, dst, v),
    }
    String::from_utf16(&characters(&memory, dst, 1)).unwrap()
}

/// Runs a row that reads one string.
fn from_text(op: HelperOp, text: &str) -> Value {
    let mut memory = text.as_bytes().to_vec();
    memory.push(0);
    let src = StringPlace { at: 0, capacity: text.len() as u16 };
    eval_helper(op, &mut memory, &[src], &[]).unwrap()
}

#[test]
fn reals_read_back_to_the_same_bits() {
    let mut random = Random(3);
    for _ in 0..30_000 {
        let bits = random.next();
        let (short, long) = (Value::from_bits(ValueType::F32, bits), Value::from_bits(ValueType::F64, bits));
        assert_eq!(from_text(HelperOp::StringToF32, &text_of(short)), short);
        assert_eq!(from_text(HelperOp::StringToF64, &text_of(long)), long);
    }
    for (value, text) in [
        (1.5, "1.5"),
        (-0.25, "-0.25"),
        (1.0, "1.0"),
        (0.0, "0.0"),
        (-0.0, "-0.0"),
        (0.1, "0.1"),
        (1e15, "1000000000000000.0"),
        (1e16, "1.0E16"),
        (1.25e-7, "1.25E-7"),
        (1e-4, "0.0001"),
        (f64::INFINITY, "Infinity"),
        (f64::NEG_INFINITY, "-Infinity"),
        (f64::NAN, "NaN"),
    ] {
        assert_eq!(text_of(Value::F64(value)), text);
    }
    assert_eq!(text_of(Value::F32(0.1)), "0.1");
}

#[test]
fn decimal_texts_of_any_length_round_as_rust_rounds() {
    let mut random = Random(4);
    for round in 0..3_000_u64 {
        let digits = |random: &mut Random, most: u64| -> String {
            (0..random.below(most)).map(|_| char::from(b'0' + random.below(10) as u8)).collect()
        };
        let most = if round % 10 == 0 { 1200 } else { 25 };
        let exponent = random.below(700) as i64 - 350;
        let text = format!(
            "{}1{}.{}e{exponent}",
            ["", "-", "000"][random.below(3) as usize],
            digits(&mut random, most),
            digits(&mut random, most)
        );
        let got = from_text(HelperOp::StringToF64, &text);
        assert_eq!(got, Value::F64(text.parse().unwrap()), "{text}");
        assert_eq!(from_text(HelperOp::StringToF32, &text), Value::F32(text.parse().unwrap()), "{text}");
    }
    // Half way between two numbers, and a digit beyond every buffer that decides.
    let half = format!("1.00000000000000011102230246251565404236316680908203125{}", "0".repeat(900));
    assert_eq!(from_text(HelperOp::StringToF64, &half), Value::F64(1.0));
    assert_eq!(from_text(HelperOp::StringToF64, &format!("{half}1")), Value::F64(1.000_000_000_000_000_2));
}

#[test]
fn the_longest_prefix_counts() {
    for (text, value) in [
        ("12ab", 12),
        ("-7", -7),
        ("+7.9", 7),
        ("16#fFg", 255),
        ("2#1012", 5),
        ("8#17", 15),
        ("16#", 16),
        ("3#1", 3),
        ("1_000_", 1000),
        ("_1", 0),
        ("", 0),
        ("x", 0),
        (" 1", 0),
        ("-", 0),
        ("9223372036854775808", i64::MAX),
        ("-99999999999999999999999999999999999999999999", i64::MIN),
    ] {
        assert_eq!(from_text(HelperOp::StringToI64, text), Value::I64(value), "{text}");
    }
    for (text, value) in
        [("18446744073709551615", u64::MAX), ("18446744073709551616", u64::MAX), ("-1", 0), ("16#10", 16)]
    {
        assert_eq!(from_text(HelperOp::StringToU64, text), Value::I64(value as i64), "{text}");
    }
    for (text, value) in [
        ("1.5e3x", 1500.0),
        ("1e", 1.0),
        ("1.e2", 100.0),
        (".5", 0.5),
        (".", 0.0),
        ("-.e1", 0.0),
        ("1_0.2_5", 10.25),
        ("-0", -0.0),
        ("1e999999999999", f64::INFINITY),
        ("e5", 0.0),
        ("-infinity", f64::NEG_INFINITY),
        ("1e-999999999999", 0.0),
        ("0e99999999", 0.0),
        ("5..2", 5.0),
    ] {
        assert_eq!(from_text(HelperOp::StringToF64, text), Value::F64(value), "{text}");
    }
    for (text, truth) in [("TRUE", 1), ("true", 1), ("TRUEx", 0), ("1", 0), ("", 0)] {
        assert_eq!(from_text(HelperOp::StringToBool, text), Value::I32(truth), "{text}");
    }
}

#[test]
fn times_as_literals() {
    let second = 1_000_000_000;
    for (value, text) in [
        (90 * second, "T#1m30s"),
        (90 * second + 500_000_000, "T#1m30s500ms"),
        (0, "T#0ms"),
        (-5_000_000, "T#-5ms"),
        (86_400 * second + 1, "T#1d1ns"),
        (i64::MAX, "T#106751d23h47m16s854ms775us807ns"),
        (i64::MIN, "T#-106751d23h47m16s854ms775us808ns"),
    ] {
        assert_eq!(text_of(Value::I64(value)), text);
        assert_eq!(from_text(HelperOp::StringToTime, text), Value::I64(value), "{text}");
    }
    let mut random = Random(5);
    for _ in 0..5_000 {
        let value = (random.next() >> random.below(64)) as i64;
        assert_eq!(from_text(HelperOp::StringToTime, &text_of(Value::I64(value))), Value::I64(value));
    }
    for (text, value) in [
        ("time#1.5s", 3 * second / 2),
        ("1h_30m", 5400 * second),
        ("LT#2us", 2000),
        ("5s3m", 5 * second),
        ("1.5m2s", 90 * second),
        ("T#", 0),
        ("T#5", 0),
        ("T#-", 0),
        ("T#1d2", 86_400 * second),
        ("t#+10MS", 10_000_000),
        ("T#99999999999999999999999999999999999999999d", i64::MAX),
        ("T#0.000000001s", 1),
        ("1ms2ms", 1_000_000),
    ] {
        assert_eq!(from_text(HelperOp::StringToTime, text), Value::I64(value), "{text}");
    }
    assert_eq!((text_of(Value::I32(1)), text_of(Value::I32(0))), ("TRUE".to_string(), "FALSE".to_string()));
}

#[test]
fn dates_and_times_of_day_as_literals() {
    type From = fn(&mut [u8], StringPlace, i64);
    type Form<'v> = (From, HelperOp, &'v [(i64, &'v str)]);
    let forms: [Form<'_>; 3] = [
        (
            string_from_date,
            HelperOp::StringToDate,
            &[
                (0, "D#1970-01-01"),
                (-86_400_000_000_000, "D#1969-12-31"),
                (1_709_164_800_000_000_000, "D#2024-02-29"),
                (9_223_286_400_000_000_000, "D#2262-04-11"),
            ],
        ),
        (
            string_from_tod,
            HelperOp::StringToTod,
            &[
                (0, "TOD#00:00:00"),
                (45_296_500_000_000, "TOD#12:34:56.5"),
                (86_399_999_999_999, "TOD#23:59:59.999999999"),
                (-1, "TOD#-00:00:00.000000001"),
                (i64::MAX, "TOD#2562047:47:16.854775807"),
                (i64::MIN, "TOD#-2562047:47:16.854775808"),
            ],
        ),
        (
            string_from_dt,
            HelperOp::StringToDt,
            &[
                (0, "DT#1970-01-01-00:00:00"),
                (-1, "DT#1969-12-31-23:59:59.999999999"),
                (i64::MAX, "DT#2262-04-11-23:47:16.854775807"),
                (i64::MIN, "DT#1677-09-21-00:12:43.145224192"),
            ],
        ),
    ];
    for (from, to, values) in forms {
        let written = |value: i64| {
            let mut memory = vec![0; 100];
            let dst = StringPlace { at: 3, capacity: 90 };
            from(&mut memory, dst, value);
            String::from_utf16(&characters(&memory, dst, 1)).unwrap()
        };
        for (value, text) in values {
            assert_eq!(written(*value), *text);
            assert_eq!(from_text(to, text), Value::I64(*value), "{text}");
            let (_, bare) = text.split_once('#').unwrap();
            assert_eq!(from_text(to, &format!("{bare}!")), Value::I64(*value), "{text} without its type");
        }
        let mut random = Random(6);
        for _ in 0..5_000 {
            let value = (random.next() as i64) >> random.below(64);
            let value =
                if to == HelperOp::StringToDate { value / 86_400_000_000_000 * 86_400_000_000_000 } else { value };
            assert_eq!(from_text(to, &written(value)), Value::I64(value), "{}", written(value));
        }
    }
}

#[test]
fn the_longest_prefix_that_is_a_date_counts() {
    for (op, text, value) in [
        (HelperOp::StringToDate, "D#9999-12-31", i64::MAX),
        (HelperOp::StringToDate, "D#0001-01-01", i64::MIN),
        (HelperOp::StringToDate, "TOD#1970-01-02", 0),
        (HelperOp::StringToDate, "2023-02-29", 0),
        (HelperOp::StringToTod, "99999999999999999999999:00", i64::MAX),
        (HelperOp::StringToTod, "1:61", 0),
        (HelperOp::StringToDt, "date_and_time#1970-1-1-0:1", 60_000_000_000),
        (HelperOp::StringToDt, "DT#1970-01-02", 0),
    ] {
        assert_eq!(from_text(op, text), Value::I64(value), "{text}");
    }
}
