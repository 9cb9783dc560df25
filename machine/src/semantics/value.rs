//! A value of the operand stack that knows its type, for callers that are not compiled for one type: constant folding,
//! tests of single instructions, third evaluators.

use khz_bytecode::value::ValueType;

/// One entry of the operand stack that is not a reference. Two are equal when type and bits are.
#[derive(Debug, Clone, Copy)]
pub enum Value {
    /// BOOL, integers and bit strings up to 32 bits.
    I32(i32),
    /// 64-bit integers and bit strings, times, dates.
    I64(i64),
    /// REAL.
    F32(f32),
    /// LREAL.
    F64(f64),
}

impl Value {
    /// Its type.
    #[must_use]
    pub fn value_type(self) -> ValueType {
        match self {
            Value::I32(_) => ValueType::I32,
            Value::I64(_) => ValueType::I64,
            Value::F32(_) => ValueType::F32,
            Value::F64(_) => ValueType::F64,
        }
    }

    /// Its bits, zero-extended.
    #[must_use]
    pub fn bits(self) -> u64 {
        match self {
            Value::I32(value) => u64::from(value as u32),
            Value::I64(value) => value as u64,
            Value::F32(value) => u64::from(value.to_bits()),
            Value::F64(value) => value.to_bits(),
        }
    }

    /// The value of type `ty` whose bits are the low bits of `bits`; NaNs become the one NaN.
    #[must_use]
    pub fn from_bits(ty: ValueType, bits: u64) -> Value {
        match ty {
            ValueType::I32 => Value::I32(bits as i32),
            ValueType::I64 => Value::I64(bits as i64),
            ValueType::F32 => Value::F32(super::canonical_f32(f32::from_bits(bits as u32))),
            ValueType::F64 => Value::F64(super::canonical_f64(f64::from_bits(bits))),
        }
    }
}

impl PartialEq for Value {
    fn eq(&self, other: &Value) -> bool {
        self.value_type() == other.value_type() && self.bits() == other.bits()
    }
}

impl Eq for Value {}

/// A Rust type that carries a [`ValueType`]: lets table-driven code call typed functions.
pub trait Operand: Copy {
    /// The type on the operand stack.
    const TYPE: ValueType;
    /// The number inside `value`; one of another type gives its bits, as far as they fit.
    fn from_value(value: Value) -> Self;
    /// The number as a value.
    fn into_value(self) -> Value;
}

macro_rules! operands {
    ($($rust:ident $variant:ident |$bits:ident| $other:expr;)*) => { $(
        impl Operand for $rust {
            const TYPE: ValueType = ValueType::$variant;

            #[inline]
            fn from_value(value: Value) -> $rust {
                match value {
                    Value::$variant(value) => value,
                    other => {
                        let $bits = other.bits();
                        $other
                    }
                }
            }

            #[inline]
            fn into_value(self) -> Value {
                Value::$variant(self)
            }
        }
    )* };
}
operands! {
    i32 I32 |bits| bits as i32;
    i64 I64 |bits| bits as i64;
    f32 F32 |bits| super::canonical_f32(f32::from_bits(bits as u32));
    f64 F64 |bits| super::canonical_f64(f64::from_bits(bits));
}
