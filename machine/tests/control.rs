//! FOR loops, ranges, indices, references and scalars against models with unlimited integers.

use khz_bytecode::container::Container;
use khz_bytecode::value::{IntegerType, Storage};
use khz_machine::image::ImageLayout;
use khz_machine::semantics::{
    Value, array_position, check_range, check_reference, element_position, for_is_due, for_next, load_foreign_scalar,
    load_scalar, store_scalar,
};

fn wrap8(ty: IntegerType, value: i64) -> i64 {
    if ty == IntegerType::I8 { (value + 128).rem_euclid(256) - 128 } else { value.rem_euclid(256) }
}

#[test]
fn eight_bit_loops_in_full() {
    for (ty, values) in [(IntegerType::I8, -128..=127), (IntegerType::U8, 0..=255_i64)] {
        for step in (-260..=260_i64).step_by(7).chain([-128, -127, -1, 1, 127, 128]) {
            for control in values.clone() {
                for bound in values.clone() {
                    let due = if step > 0 { control <= bound } else { control >= bound };
                    let next = control + step;
                    let goes_on = if step > 0 { next <= bound } else { next >= bound };
                    if step != 0 {
                        assert_eq!(for_is_due(ty, control, bound, step), due, "{ty} {control} {bound} {step}");
                    }
                    // A body that moved the control variable past the bound ends the loop even if the step leads back.
                    let goes_on = step != 0 && goes_on && due;
                    let expected = (wrap8(ty, next), goes_on);
                    assert_eq!(for_next(ty, control, bound, step), expected, "{ty} {control} {bound} {step}");
                }
            }
        }
    }
}

#[test]
fn loops_at_the_ends_of_wide_types() {
    let edges = [i64::MIN, i64::MIN + 1, i32::MIN.into(), -2, -1, 0, 1, 2, i32::MAX.into(), u32::MAX.into(), i64::MAX];
    for control in edges {
        for bound in edges {
            for step in edges {
                for ty in [IntegerType::I32, IntegerType::U32, IntegerType::I64, IntegerType::U64] {
                    let number = |value: i64| match ty {
                        IntegerType::I32 => i128::from(value as i32),
                        IntegerType::U32 => i128::from(value as u32),
                        IntegerType::U64 => i128::from(value as u64),
                        _ => i128::from(value),
                    };
                    let wide = matches!(ty, IntegerType::I64 | IntegerType::U64);
                    let step_number = if wide { i128::from(step) } else { i128::from(step as i32) };
                    let (c, b) = (number(control), number(bound));
                    let goes_on = match step_number {
                        0 => false,
                        1.. => c <= b && c + step_number <= b,
                        _ => c >= b && c + step_number >= b,
                    };
                    let got = for_next(ty, control, bound, step);
                    assert_eq!(got.1, goes_on, "{ty} {control} {bound} {step}");
                    let next = c + step_number;
                    assert_eq!(number(got.0), number(next as i64), "{ty} {control} {bound} {step}");
                }
            }
        }
    }
}

#[test]
fn ranges_are_in_the_order_of_the_type() {
    assert!(check_range(IntegerType::U32, -1, 0, -1));
    assert!(!check_range(IntegerType::I32, -1, 0, -1));
    assert!(check_range(IntegerType::U64, i64::MIN, 5, -1));
    assert!(!check_range(IntegerType::I64, i64::MIN, 5, i64::MAX));
    assert!(!check_range(IntegerType::I16, 11, -10, 10) && check_range(IntegerType::I16, -10, -10, 10));
}

#[test]
fn indices_meet_their_bounds() {
    for lower in -5..5 {
        for upper in -5..5 {
            for index in -8..8 {
                let expected = (lower..=upper).contains(&index).then(|| (index - lower) as u32);
                assert_eq!(array_position(index, lower, upper), expected);
            }
        }
    }
    assert_eq!(array_position(i32::MAX, i32::MIN, i32::MAX), Some(u32::MAX));
    assert_eq!(array_position(i32::MIN, 1, i32::MAX), None);
    let dimensions = [(-1, 1), (5, 9)];
    assert_eq!(element_position(&[1, 6], &dimensions), Ok(11));
    assert_eq!(element_position(&[2, 99], &dimensions), Err([2, -1, 1]), "the first dimension is checked first");
    assert_eq!(element_position(&[0, 10], &dimensions), Err([10, 5, 9]));
}

#[test]
fn references_stay_inside() {
    let mut container = Container::default();
    container.parameters.data_region_bytes = 100;
    container.parameters.output_image_bytes = 8;
    container.parameters.input_image_bytes = 8;
    let layout = ImageLayout::new(&container, 1 << 20).unwrap();
    let end = i64::from(layout.input.end - layout.data.start);
    let writable_end = i64::from(layout.output.end - layout.data.start);
    for (address, size, write, inside) in [
        (0, 1, false, false),
        (-1, 1, false, false),
        (16, 4, true, true),
        (end - 4, 4, false, true),
        (end - 3, 4, false, false),
        (end - 4, 4, true, false),
        (writable_end - 4, 4, true, true),
        (writable_end - 3, 4, true, false),
        (i64::MAX, 4, false, false),
        (i64::MIN, 4, false, false),
        (1 << 32 | 16, 4, false, false),
        (0xFFFF_FFFF, 8, false, false),
        (16, u32::MAX, false, false),
    ] {
        let expected = inside.then(|| layout.data.start + address as u32);
        assert_eq!(check_reference(&layout, address, size, write), expected, "{address} {size} {write}");
    }
}

#[test]
fn scalars_wrap_and_extend() {
    let cases = [
        (Storage::Bool, Value::I32(256), vec![1], Value::I32(1)),
        (Storage::I8, Value::I32(0x1FF), vec![0xFF], Value::I32(-1)),
        (Storage::U8, Value::I32(0x1FF), vec![0xFF], Value::I32(255)),
        (Storage::I16, Value::I32(0x1_8000), vec![0, 0x80], Value::I32(-32_768)),
        (Storage::U16, Value::I32(-1), vec![0xFF, 0xFF], Value::I32(65_535)),
        (Storage::I32, Value::I32(-2), vec![0xFE, 0xFF, 0xFF, 0xFF], Value::I32(-2)),
        (Storage::I64, Value::I64(1), vec![1, 0, 0, 0, 0, 0, 0, 0], Value::I64(1)),
        (Storage::F32, Value::F32(1.0), vec![0, 0, 0x80, 0x3F], Value::F32(1.0)),
        (Storage::F64, Value::F64(-0.0), vec![0, 0, 0, 0, 0, 0, 0, 0x80], Value::F64(-0.0)),
    ];
    for (storage, stored, bytes, loaded) in cases {
        let mut memory = [0xAA; 10];
        store_scalar(&mut memory, storage, stored);
        assert_eq!(memory[..bytes.len()], bytes, "{storage}");
        assert!(memory[bytes.len()..].iter().all(|byte| *byte == 0xAA), "{storage} writes its width only");
        assert_eq!(load_scalar(&memory, storage), loaded, "{storage}");
    }
    assert_eq!(load_scalar(&[7], Storage::Bool), Value::I32(1));
    assert_eq!(load_scalar(&[], Storage::I64), Value::I64(0), "what is not there is 0");
    let nan = [1, 0, 0x80, 0x7F];
    assert_eq!(load_scalar(&nan, Storage::F32).bits(), 0x7F80_0001);
    assert_eq!(load_foreign_scalar(&nan, Storage::F32).bits(), 0xFFC0_0000);
}
