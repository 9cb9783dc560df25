//! Values at the edges of what numeric instructions do, for the tests of this crate and of both engines.
#![allow(dead_code, reason = "each user takes its part")]

use khz_bytecode::value::ValueType;
use khz_machine::semantics::Value;

/// A few of a type: each pair of them is compiled, in every shape of operands.
pub fn edges(ty: ValueType) -> Vec<Value> {
    match ty {
        ValueType::I32 => {
            [0, 1, -1, 2, 7, 8, 31, 32, 33, 127, 128, -129, 255, 256, 32767, -32769, 65535, i32::MAX, i32::MIN]
                .map(Value::I32)
                .to_vec()
        }
        ValueType::I64 => {
            let powers = [1 << 31, -(1 << 31) - 1, u32::MAX.into(), 1 << 53, (1 << 53) + 1];
            [0, 1, -1, 3, 63, 64, 65].into_iter().chain(powers).chain([i64::MAX, i64::MIN]).map(Value::I64).collect()
        }
        ValueType::F32 => {
            let bits = [0xFFC0_0000, 1, 0x007F_FFFF, 0x8000_0001, 0x7F7F_FFFF, 0x7F80_0000, 0xFF80_0000];
            let plain = [0.0, -0.0, 1.0, -1.5, 0.5, 2.5, 127.5, -128.6, 255.5, 65535.4, 2_147_483_600.0, 1e19, -1e19];
            bits.map(f32::from_bits).into_iter().chain(plain).map(Value::F32).collect()
        }
        ValueType::F64 => {
            let bits = [0xFFF8_0000_0000_0000, 1, 0x7FEF_FFFF_FFFF_FFFF, 0x7FF0 << 48, 0xFFF0 << 48];
            let plain = [0.0, -0.0, 1.0, -1.5, 0.5, 2.5, -128.6, 4_294_967_295.5, 2_147_483_647.5, 9.3e18, -1e19, 1e40];
            bits.map(f64::from_bits).into_iter().chain(plain).map(Value::F64).collect()
        }
    }
}

/// Those and many more, where a pair costs nothing but its computation.
pub fn all(ty: ValueType) -> Vec<Value> {
    let further: Vec<Value> = match ty {
        ValueType::I32 => I32_FURTHER.iter().map(|v| Value::I32(*v)).collect(),
        ValueType::I64 => I64_FURTHER.iter().map(|v| Value::I64(*v)).collect(),
        ValueType::F32 => {
            let some = [1e-45_f32, f32::MAX, 1.0e38, 16_777_217.0, 8_388_609.5];
            F64_FURTHER.iter().map(|v| *v as f32).chain(some).map(Value::F32).collect()
        }
        ValueType::F64 => F64_FURTHER.iter().copied().map(Value::F64).collect(),
    };
    edges(ty).into_iter().chain(further).collect()
}

const I32_FURTHER: &[i32] =
    &[-2, 3, 15, 16, 63, 64, 65, -128, 32_768, -32_768, 0x5A5A_A5A5, i32::MIN + 1, i32::MAX - 1];
const I64_FURTHER: &[i64] = &[
    2,
    -3,
    10,
    255,
    -256,
    0x7FFF_FFFF,
    0x1_0000_0000,
    -0x8000_0000,
    (1 << 24) + 1,
    -(1 << 24) - 1,
    (1 << 62) + (1 << 38) + 1,
    i64::MIN + 1,
    i64::MAX - 511,
];
const F64_FURTHER: &[f64] = &[
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    -0.5,
    1.5,
    2.5,
    -2.5,
    0.499_999_999_999_999_94,
    126.5,
    127.5,
    128.5,
    -128.5,
    -129.0,
    254.5,
    255.5,
    256.0,
    32_767.5,
    65_535.5,
    2_147_483_647.5,
    -2_147_483_648.5,
    2_147_483_648.0,
    4_294_967_295.5,
    9.223_372_036_854_775e18,
    9.223_372_036_854_776e18,
    -9.3e18,
    1.844_674_407_370_955_2e19,
    3.7,
    -3.7,
    10.0,
    1e-310,
    1e300,
    -1e300,
    5e-324,
    f64::MAX,
    f64::MIN_POSITIVE,
    f64::INFINITY,
    f64::NEG_INFINITY,
];
