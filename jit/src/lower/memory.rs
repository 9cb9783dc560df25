//! Loads, stores, references and block moves.

use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{self, InstBuilder, MemFlagsData, types};
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::value::{SlotPlace, Storage};

use super::{Lowerer, clif_type};
use crate::build::ProgramMemory;
use crate::mir::{Access, Address, Base, Instruction, Op, Region, Results, Slot, Type};
use crate::runtime::{MOVE_BYTES, ZERO_BYTES};

/// Largest block move or zeroing, in bytes, that is written out as loads and stores.
const INLINE_BYTES: u32 = 64;

impl Lowerer<'_, '_> {
    /// Lowers an instruction that works on memory.
    pub(super) fn memory(&mut self, instruction: &Instruction) {
        let results = &instruction.results;
        match &instruction.op {
            Op::LoadSlot(slot, access) => {
                let (base, offset) = self.slot_address(*slot);
                let value = self.load(base, offset, *access);
                self.define(results, value);
            }
            Op::StoreSlot(slot, access, value) => {
                let value = self.value(*value);
                self.store_slot(*slot, *access, value);
            }
            Op::Load(address, access) => {
                let (base, offset) = self.address(address);
                let value = match results {
                    Results::One(result) if matches!(self.function.ty(*result), Type::F32x4 | Type::F64x2) => {
                        let (ty, flags) = (clif_type(self.function.ty(*result)), self.flags(access.region));
                        self.builder.ins().load(ty, flags, base, offset)
                    }
                    _ => self.load(base, offset, *access),
                };
                self.define(results, value);
            }
            Op::Store(address, access, value) => {
                let value = self.value(*value);
                let (base, offset) = self.address(address);
                self.store(base, offset, *access, value);
            }
            Op::LoadBit(address, bit) => {
                let (base, offset) = self.address(address);
                let flags = self.flags(Region::Bytes);
                let byte = self.builder.ins().uload8(types::I32, flags, base, offset);
                let shifted = self.builder.ins().ushr_imm_s(byte, i64::from(*bit));
                let value = self.builder.ins().band_imm_s(shifted, 1);
                self.define(results, value);
            }
            Op::StoreBit(address, bit, value) => {
                let value = self.value(*value);
                let (base, offset) = self.address(address);
                let flags = self.flags(Region::Bytes);
                let byte = self.builder.ins().uload8(types::I32, flags, base, offset);
                let others = self.builder.ins().band_imm_s(byte, !(1i64 << bit));
                let set = self.builder.ins().icmp_imm_s(IntCC::NotEqual, value, 0);
                let set = self.builder.ins().uextend(types::I32, set);
                let set = self.builder.ins().ishl_imm_s(set, i64::from(*bit));
                let byte = self.builder.ins().bor(others, set);
                self.builder.ins().istore8(flags, byte, base, offset);
            }
            Op::Reference(address) => {
                let value = self.pointer(address);
                self.define(results, value);
            }
            Op::RefToInt(reference) => {
                let reference = self.value(*reference);
                let data = i64::from(self.scope.layout.data.start);
                let start = self.builder.ins().iadd_imm_s(self.image, data);
                let value = self.builder.ins().isub(reference, start);
                self.define(results, value);
            }
            Op::Copy { destination, source, size } => self.copy(destination, source, *size),
            Op::Zero(address, size) => self.zero(address, *size),
            other => unreachable!("{other} is lowered elsewhere"),
        }
    }

    fn flags(&self, region: Region) -> MemFlagsData {
        let region = match region {
            Region::Slots => self.regions.slots,
            Region::Bytes => self.regions.bytes,
        };
        // Not `aligned`: unaligned access is legal.
        MemFlagsData::new().with_notrap().with_endianness(ir::Endianness::Little).with_alias_region(Some(region))
    }

    /// Base and displacement of a slot.
    fn slot_address(&self, slot: Slot) -> (ir::Value, ir::immediates::Offset32) {
        // All slots together take less than 1 MiB.
        let at = |first: u32| ((first + u32::from(slot.index.0)) * SLOT_BYTES) as i32;
        let start = self.scope.layout.slots.start as i32;
        match (slot.place, self.program, self.function.program) {
            (SlotPlace::Program, ProgramMemory::Instance { slots, .. }, _) => (self.image, (start + at(slots)).into()),
            (SlotPlace::Program, _, Some((slots, _))) => (self.value(slots), at(0).into()),
            _ => (self.image, (start + at(0)).into()),
        }
    }

    /// Base and displacement of an address; what does not fit a displacement is added.
    fn address(&mut self, address: &Address) -> (ir::Value, ir::immediates::Offset32) {
        let mut base = match address.base {
            Base::Image => self.image,
            Base::Value(value) => self.value(value),
        };
        if let Some((index, stride)) = address.index {
            let index = self.value(index);
            let scaled = if stride.is_power_of_two() {
                self.builder.ins().ishl_imm_s(index, i64::from(stride.trailing_zeros()))
            } else {
                self.builder.ins().imul_imm_s(index, i64::from(stride))
            };
            base = self.builder.ins().iadd(base, scaled);
        }
        match i32::try_from(address.displacement) {
            Ok(offset) => (base, offset.into()),
            Err(_) => (self.builder.ins().iadd_imm_s(base, address.displacement), 0.into()),
        }
    }

    /// An address as a value.
    pub(super) fn pointer(&mut self, address: &Address) -> ir::Value {
        let (base, offset) = self.address(address);
        let offset = i64::from(offset);
        if offset == 0 { base } else { self.builder.ins().iadd_imm_s(base, offset) }
    }

    fn load(&mut self, base: ir::Value, offset: ir::immediates::Offset32, access: Access) -> ir::Value {
        let flags = self.flags(access.region);
        let ins = self.builder.ins();
        match access.storage {
            Storage::Bool => {
                let byte = ins.uload8(types::I32, flags, base, offset);
                if !access.normalise {
                    return byte;
                }
                let set = self.builder.ins().icmp_imm_s(IntCC::NotEqual, byte, 0);
                self.builder.ins().uextend(types::I32, set)
            }
            Storage::I8 => ins.sload8(types::I32, flags, base, offset),
            Storage::U8 => ins.uload8(types::I32, flags, base, offset),
            Storage::I16 => ins.sload16(types::I32, flags, base, offset),
            Storage::U16 => ins.uload16(types::I32, flags, base, offset),
            Storage::I32 => ins.load(types::I32, flags, base, offset),
            Storage::I64 => ins.load(types::I64, flags, base, offset),
            Storage::F32 => {
                let value = ins.load(types::F32, flags, base, offset);
                if access.canonicalise { self.canonical(value) } else { value }
            }
            Storage::F64 => {
                let value = ins.load(types::F64, flags, base, offset);
                if access.canonicalise { self.canonical(value) } else { value }
            }
        }
    }

    /// Stores a value into a slot.
    pub(super) fn store_slot(&mut self, slot: Slot, access: Access, value: ir::Value) {
        let (base, offset) = self.slot_address(slot);
        self.store(base, offset, access, value);
    }

    fn store(&mut self, base: ir::Value, offset: ir::immediates::Offset32, access: Access, value: ir::Value) {
        let flags = self.flags(access.region);
        let ins = self.builder.ins();
        match access.storage {
            Storage::Bool | Storage::I8 | Storage::U8 => ins.istore8(flags, value, base, offset),
            Storage::I16 | Storage::U16 => ins.istore16(flags, value, base, offset),
            Storage::I32 | Storage::I64 | Storage::F32 | Storage::F64 => ins.store(flags, value, base, offset),
        };
    }

    fn copy(&mut self, destination: &Address, source: &Address, size: u32) {
        let (destination, source) = (self.pointer(destination), self.pointer(source));
        if size > INLINE_BYTES {
            let size = self.i64(i64::from(size));
            self.call_routine(MOVE_BYTES, &[types::I64; 3], &[], &[destination, source, size]);
            return;
        }
        let flags = self.flags(Region::Bytes);
        // All loads before all stores, so that the extents may overlap.
        let mut parts = Vec::new();
        for (offset, ty) in pieces(size) {
            parts.push((offset, self.builder.ins().load(ty, flags, source, offset)));
        }
        for (offset, value) in parts {
            self.builder.ins().store(flags, value, destination, offset);
        }
    }

    fn zero(&mut self, address: &Address, size: u32) {
        let at = self.pointer(address);
        if size > INLINE_BYTES {
            let size = self.i64(i64::from(size));
            self.call_routine(ZERO_BYTES, &[types::I64; 2], &[], &[at, size]);
            return;
        }
        let flags = self.flags(Region::Bytes);
        for (offset, ty) in pieces(size) {
            let zero = self.builder.ins().iconst(ty, 0);
            self.builder.ins().store(flags, zero, at, offset);
        }
    }
}

/// An extent as integers of falling size, with their offsets.
fn pieces(size: u32) -> Vec<(i32, ir::Type)> {
    let mut at = 0;
    let mut pieces = Vec::new();
    for ty in [types::I64, types::I32, types::I16, types::I8] {
        while size - at >= ty.bytes() {
            pieces.push((at as i32, ty));
            at += ty.bytes();
        }
    }
    pieces
}
