//! FOR loops whose control variable may be anywhere: the general forms of `for.enter` and `for.next`.

use khz_bytecode::value::{IntegerType, Storage, ValueType};
use khz_machine::semantics;

use crate::memory::{Registers, Scalar};
use crate::register_form::{Control, ForAccess};

/// Loads the control variable as a carrier.
#[inline]
fn load(access: &ForAccess, memory: &[u8], registers: &Registers<'_>) -> i64 {
    let at = match access.control {
        Control::Register(register) => return registers.get(register) as i64,
        Control::Image(at) => at as usize,
        Control::Based(base, offset) => registers.get(base).wrapping_add(u64::from(offset)) as usize,
    };
    let bits = match access.kind.storage() {
        Storage::I8 => i8::load(memory, at),
        Storage::U8 | Storage::Bool => u8::load(memory, at),
        Storage::I16 => i16::load(memory, at),
        Storage::U16 => u16::load(memory, at),
        Storage::I32 | Storage::F32 => i32::load(memory, at),
        Storage::I64 | Storage::F64 => i64::load(memory, at),
    };
    bits as i64
}

/// Stores a carrier, already wrapped to the control variable's type.
#[inline]
fn store(access: &ForAccess, carrier: i64, memory: &mut [u8], registers: &mut Registers<'_>) {
    let bits = register_bits(access.kind, carrier);
    let at = match access.control {
        Control::Register(register) => return registers.set(register, bits),
        Control::Image(at) => at as usize,
        Control::Based(base, offset) => registers.get(base).wrapping_add(u64::from(offset)) as usize,
    };
    match access.kind.storage().bytes() {
        1 => u8::store(memory, at, bits),
        2 => u16::store(memory, at, bits),
        4 => i32::store(memory, at, bits),
        _ => i64::store(memory, at, bits),
    }
}

/// How a carrier stands in a register: 32-bit values zero-extended.
#[inline]
fn register_bits(kind: IntegerType, carrier: i64) -> u64 {
    match kind.value_type() {
        ValueType::I64 => carrier as u64,
        _ => u64::from(carrier as u32),
    }
}

/// `for.enter` with operands that are known: the control variable's register and whether a first pass is due, or nothing for a
/// step of 0.
pub(crate) fn known_start(kind: IntegerType, initial: u64, bound: u64, step: u64) -> Option<(u64, bool)> {
    let bits = register_bits(kind, semantics::wrap_integer(kind, initial as i64));
    (step != 0).then(|| (bits, semantics::for_is_due(kind, bits as i64, bound as i64, step as i64)))
}

/// `for.enter` with initial value, bound and step in the registers from `operands` on: whether a first pass is due, or nothing for a
/// step of 0.
pub(crate) fn enter_loop(
    access: &ForAccess,
    operands: u32,
    memory: &mut [u8],
    registers: &mut Registers<'_>,
) -> Option<bool> {
    let kind = access.kind;
    let initial = registers.get(operands) as i64;
    let bound = registers.get(operands + 1);
    let step = registers.get(operands + 2);
    if step == 0 {
        return None;
    }
    registers.set(access.bound, bound);
    registers.set(access.step, step);
    store(access, semantics::wrap_integer(kind, initial), memory, registers);
    let control = load(access, memory, registers);
    Some(semantics::for_is_due(kind, control, bound as i64, step as i64))
}

/// `for.next`: sets the control variable; whether a further pass follows.
pub(crate) fn next_pass(access: &ForAccess, memory: &mut [u8], registers: &mut Registers<'_>) -> bool {
    let control = load(access, memory, registers);
    let (bound, step) = (registers.get(access.bound) as i64, registers.get(access.step) as i64);
    let (next, goes_on) = semantics::for_next(access.kind, control, bound, step);
    store(access, next, memory, registers);
    goes_on
}
