//! Slots, bytes and references.

use khz_bytecode::container::{ArrayDescriptor, Owner, Type as MemoryType};
use khz_bytecode::ids::{ArrayId, FunctionId, SlotIndex, TypeId};
use khz_bytecode::instruction::{Instruction as Code, NumericOp};
use khz_bytecode::value::{BytePlace, LocalType, SlotPlace, Storage};

use super::{Builder, Entry, ProgramMemory};
use crate::mir::{Access, Address, Base, Const, Op, Region, Slot, Type, Value};

impl Builder<'_> {
    /// Translates an instruction of memory and references.
    pub(super) fn memory(&mut self, code: &Code) {
        match code {
            Code::SlotLoad { place, index } => self.slot_load(*place, *index),
            Code::SlotStore { place, index } => {
                let value = self.pop();
                self.slot_store(*place, *index, value);
            }
            Code::Load { place, storage, offset } => {
                let value = self.load_place(*place, *offset, *storage);
                self.push(value);
            }
            Code::Store { place, storage, offset } => {
                let value = self.pop();
                self.store_place(*place, *offset, *storage, value);
            }
            Code::LoadBit { place, offset, bit } => {
                let value = self.define(Type::I32, Op::LoadBit(self.place_address(*place, *offset), *bit));
                self.push(value);
            }
            Code::StoreBit { place, offset, bit } => {
                let value = self.pop();
                self.effect(Op::StoreBit(self.place_address(*place, *offset), *bit, value));
            }
            Code::Address { place, offset, .. } => {
                self.stack.push(Entry::Ref(self.place_address(*place, *offset), place.is_image()));
            }
            Code::RefLoad { storage } => {
                let (address, image) = self.pop_ref();
                let access = self.byte_access(*storage, image);
                let value = self.define(storage.value_type().into(), Op::Load(address, access));
                self.push(value);
            }
            Code::RefStore { storage } => {
                let value = self.pop();
                let (address, _) = self.pop_ref();
                let wrapped = self.wrap_bool(*storage, value);
                self.effect(Op::Store(address, self.byte_access(*storage, false), wrapped));
            }
            Code::RefField { owner, field } => self.ref_field(*owner, *field),
            Code::RefIndex { array } => self.ref_index(*array),
            Code::RefToInt {} => {
                let reference = self.pop();
                let value = self.define(Type::I64, Op::RefToInt(reference));
                self.push(value);
            }
            Code::RefCheck { target, write } => {
                let offset = self.pop();
                let size = self.extent(*target);
                let value = self.define(Type::Ref, Op::RefCheck { offset, size, write: *write });
                self.stack.push(Entry::Ref(self.at(Base::Value(value), 0), true));
            }
            Code::Copy { target } => {
                let ((source, _), (destination, _)) = (self.pop_ref(), self.pop_ref());
                let size = self.extent(*target);
                self.effect(Op::Copy { destination, source, size });
            }
            other => unreachable!("{} is translated elsewhere", other.mnemonic()),
        }
    }

    fn extent(&self, ty: TypeId) -> u32 {
        self.scope.verified.facts().type_extents[ty.index()].size
    }

    /// How a slot outside the call's own is accessed.
    pub(super) fn slot_access(&self, slot: Slot) -> Access {
        let container = self.scope.verified.container();
        let function: FunctionId = self.out.id;
        let storage = match (slot.place, container.functions[function.index()].owner) {
            (SlotPlace::Program, Owner::Program(program)) => {
                container.types.programs[program.index()].slots[slot.index.index()]
            }
            _ => container.types.slots[slot.index.index()],
        };
        Access { storage, canonicalise: false, normalise: !self.scope.clean_bools, region: Region::Slots }
    }

    fn slot_load(&mut self, place: SlotPlace, index: SlotIndex) {
        if place == SlotPlace::Local {
            let value = self
                .define(self.out.variables[self.locals[index.index()].index()], Op::Get(self.locals[index.index()]));
            match self.code.locals[index.index()] {
                LocalType::Scalar(_) => self.push(value),
                LocalType::Ref(ty) => self.stack.push(Entry::Ref(self.at(Base::Value(value), 0), ty.image)),
            }
        } else {
            let value = self.load_slot(Slot { place, index });
            self.push(value);
        }
    }

    pub(super) fn load_slot(&mut self, slot: Slot) -> Value {
        let access = self.slot_access(slot);
        self.define(access.storage.value_type().into(), Op::LoadSlot(slot, access))
    }

    pub(super) fn slot_store(&mut self, place: SlotPlace, index: SlotIndex, value: Value) {
        if place == SlotPlace::Local {
            let wrapped = self.wrap_local(self.code.locals[index.index()], value);
            self.effect(Op::Set(self.locals[index.index()], wrapped));
        } else {
            let slot = Slot { place, index };
            let access = self.slot_access(slot);
            let wrapped = self.wrap_bool(access.storage, value);
            self.effect(Op::StoreSlot(slot, access, wrapped));
        }
    }

    /// A store to memory cuts by itself; only a BOOL has to be 0 or 1 before.
    fn wrap_bool(&mut self, storage: Storage, value: Value) -> Value {
        if storage == Storage::Bool { self.wrap(storage, value) } else { value }
    }

    fn byte_access(&self, storage: Storage, image: bool) -> Access {
        let canonicalise = storage.is_float() && (image || self.scope.verified.facts().foreign_floats);
        Access { storage, canonicalise, normalise: storage == Storage::Bool, region: Region::Bytes }
    }

    pub(super) fn load_place(&mut self, place: BytePlace, offset: u32, storage: Storage) -> Value {
        let access = self.byte_access(storage, place.is_image());
        self.define(storage.value_type().into(), Op::Load(self.place_address(place, offset), access))
    }

    pub(super) fn store_place(&mut self, place: BytePlace, offset: u32, storage: Storage, value: Value) {
        let wrapped = self.wrap_bool(storage, value);
        self.effect(Op::Store(self.place_address(place, offset), self.byte_access(storage, false), wrapped));
    }

    /// The address of a known place.
    pub(super) fn place_address(&self, place: BytePlace, offset: u32) -> Address {
        let offset = i64::from(offset);
        let data = i64::from(self.scope.layout.data.start);
        match (place, self.program) {
            (BytePlace::Block, ProgramMemory::Instance { block, .. }) => {
                self.at(Base::Image, data + i64::from(block) + offset)
            }
            (BytePlace::Block, _) => {
                let (_, block) = self.out.program.expect("only a program's function has a data block");
                self.at(Base::Value(block), offset)
            }
            (BytePlace::This, _) => {
                self.at(Base::Value(self.this.expect("only a block's function has `this`")), offset)
            }
            (BytePlace::Frame, _) => self.at(Base::Value(self.out.frame), offset),
            (fixed, _) => {
                let start = self.scope.layout.fixed_start(fixed).expect("every other place has a fixed start");
                self.at(Base::Image, i64::from(start) + offset)
            }
        }
    }

    fn ref_field(&mut self, owner: TypeId, field: u16) {
        let (mut address, image) = self.pop_ref();
        let ty = &self.scope.verified.container().types.types[owner.index()];
        let (MemoryType::Struct(record) | MemoryType::Union(record) | MemoryType::Block { record, .. }) = ty else {
            unreachable!("the verifier proved that the owner is a record")
        };
        address.displacement = address.displacement.wrapping_add(i64::from(record.fields[usize::from(field)].offset));
        self.stack.push(Entry::Ref(address, image));
    }

    fn ref_index(&mut self, array: ArrayId) {
        let descriptor = &self.scope.verified.container().types.arrays[array.index()];
        let indices = self.pop_many(descriptor.dimensions.len());
        let (address, image) = self.pop_ref();
        let mut linear: Option<Value> = None;
        let mut lower_linear: i64 = 0;
        for (index, (lower, upper)) in indices.iter().zip(&descriptor.dimensions) {
            self.effect(Op::CheckIndex { index: *index, lower: *lower, upper: *upper });
        }
        for (index, (lower, upper)) in indices.iter().zip(&descriptor.dimensions) {
            let wide = self.unary(NumericOp::I64ExtendI32S, *index);
            let count = i64::from(*upper) - i64::from(*lower) + 1;
            linear = Some(match linear {
                None => wide,
                Some(outer) => {
                    let scaled = self.scale(outer, count);
                    self.binary(NumericOp::I64Add, scaled, wide)
                }
            });
            lower_linear = lower_linear.wrapping_mul(count).wrapping_add(i64::from(*lower));
        }
        let element = self.element(address, descriptor, linear, lower_linear);
        self.stack.push(Entry::Ref(element, image));
    }

    /// The address of an element: sums are exact modulo 2^64, and the checks hold the result inside the array.
    fn element(&mut self, array: Address, descriptor: &ArrayDescriptor, linear: Option<Value>, lower: i64) -> Address {
        let Some(linear) = linear else { return array };
        let stride = descriptor.stride;
        let displacement = array.displacement.wrapping_sub(lower.wrapping_mul(i64::from(stride)));
        match array.index {
            None => Address { base: array.base, displacement, index: Some((linear, stride)) },
            Some((outer, outer_stride)) if stride > 0 && outer_stride.is_multiple_of(stride) => {
                let scaled = self.scale(outer, i64::from(outer_stride / stride));
                let sum = self.binary(NumericOp::I64Add, scaled, linear);
                Address { base: array.base, displacement, index: Some((sum, stride)) }
            }
            Some(_) => {
                let base = self.define(Type::Ref, Op::Reference(Address { displacement, ..array }));
                Address { base: Base::Value(base), displacement: 0, index: Some((linear, stride)) }
            }
        }
    }

    fn scale(&mut self, value: Value, factor: i64) -> Value {
        if factor == 1 {
            return value;
        }
        let factor = self.constant(Const::I64(factor));
        self.binary(NumericOp::I64Mul, value, factor)
    }
}
