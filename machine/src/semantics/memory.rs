//! Scalars in memory: how each [`Storage`] wraps at a store and extends at a load.

use khz_bytecode::value::Storage;

use super::{Value, canonical_f32, canonical_f64};

/// The first `N` bytes of `bytes`; what is missing reads as 0.
#[inline]
fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk::<N>().copied().unwrap_or_else(|| {
        let mut all = [0; N];
        all.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        all
    })
}

/// Loads the scalar that starts at `bytes[0]`, as the bytes say; missing bytes count as 0.
#[inline]
#[must_use]
pub fn load_scalar(bytes: &[u8], storage: Storage) -> Value {
    match storage {
        Storage::Bool => Value::I32(i32::from(first::<1>(bytes) != [0])),
        Storage::I8 => Value::I32(i32::from(i8::from_le_bytes(first(bytes)))),
        Storage::U8 => Value::I32(i32::from(u8::from_le_bytes(first(bytes)))),
        Storage::I16 => Value::I32(i32::from(i16::from_le_bytes(first(bytes)))),
        Storage::U16 => Value::I32(i32::from(u16::from_le_bytes(first(bytes)))),
        Storage::I32 => Value::I32(i32::from_le_bytes(first(bytes))),
        Storage::I64 => Value::I64(i64::from_le_bytes(first(bytes))),
        Storage::F32 => Value::F32(f32::from_le_bytes(first(bytes))),
        Storage::F64 => Value::F64(f64::from_le_bytes(first(bytes))),
    }
}

/// As [`load_scalar`], where foreign bytes may stand: any NaN becomes the one NaN.
#[inline]
#[must_use]
pub fn load_foreign_scalar(bytes: &[u8], storage: Storage) -> Value {
    match load_scalar(bytes, storage) {
        Value::F32(value) => Value::F32(canonical_f32(value)),
        Value::F64(value) => Value::F64(canonical_f64(value)),
        other => other,
    }
}

/// Stores the low bytes of `value` (BOOL: value <> 0) from `bytes[0]` on; bytes that do not fit are dropped.
#[inline]
pub fn store_scalar(bytes: &mut [u8], storage: Storage, value: Value) {
    let bits = match storage {
        Storage::Bool => u64::from(value.bits() != 0),
        _ => value.bits(),
    };
    let all = bits.to_le_bytes();
    bytes.iter_mut().zip(all).take(storage.bytes() as usize).for_each(|(to, from)| *to = from);
}
