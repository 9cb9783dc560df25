//! Slots, scalars at known places, references and arrays.

use khz_bytecode::container::{ArrayDescriptor, Type};
use khz_bytecode::ids::{ArrayId, SlotIndex, TypeId};
use khz_bytecode::instruction::Instruction;
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::value::{BytePlace, LocalType, SlotPlace, Storage, ValueType};

use super::Translator;
use super::numeric::{is_wrapped, wrap_code, wrap_constant};
use super::stack::{Base, Dimension, Element, Entry, Pending};
use crate::register_form::{Code, LoadCodes, Operation, access_codes, constant_store_codes, foreign_load_codes};

impl Translator<'_> {
    /// Where a byte place starts.
    pub(super) fn base_of(&self, place: BytePlace) -> (Base, u32) {
        match self.layout.fixed_start(place) {
            Some(start) => (Base::Image, start),
            None => match place {
                BytePlace::Block => (Base::Register(self.registers.block_base), 0),
                BytePlace::Frame => (Base::Register(self.registers.frame_base), 0),
                // `this` is the first register of a function of a block.
                _ => (Base::Register(0), 0),
            },
        }
    }

    /// Where a slot in memory is.
    pub(super) fn slot_address(&self, place: SlotPlace, index: SlotIndex) -> (Base, u32) {
        let offset = u32::from(index.0) * SLOT_BYTES;
        match place {
            SlotPlace::Program => (Base::Register(self.registers.program_base), offset),
            _ => (Base::Image, self.layout.slots.start + offset),
        }
    }

    /// Register of an `L` slot.
    pub(super) fn local_register(&self, index: SlotIndex) -> u32 {
        self.registers.locals + u32::from(index.0)
    }

    fn scalar_load(&mut self, codes: LoadCodes, base: Base, offset: u32) {
        let dst = self.next_register();
        self.value(match base {
            Base::Image => Operation { code: codes.image, x: 0, dst, a: offset, b: 0 },
            Base::Register(a) => Operation { code: codes.based, x: 0, dst, a, b: offset },
        });
        self.push_result();
    }

    /// Stores the top.
    fn scalar_store(&mut self, storage: Storage, base: Base, offset: u32) {
        self.settle_elements();
        let (entry, own) = self.pop();
        if let Pending::Constant(bits) = entry.value {
            let is_wide = matches!(storage.value_type(), ValueType::I64 | ValueType::F64);
            let dst = if is_wide { self.constant_number(bits) } else { bits as u32 };
            let (image, based) = constant_store_codes(storage);
            return self.effect(match base {
                Base::Image => Operation { code: image, x: 0, dst, a: offset, b: 0 },
                Base::Register(a) => Operation { code: based, x: 0, dst, a, b: offset },
            });
        }
        let dst = self.in_register(&entry.value, own);
        let codes = access_codes(storage).store;
        self.effect(match base {
            Base::Image => Operation { code: codes.image, x: 0, dst, a: offset, b: 0 },
            Base::Register(a) => Operation { code: codes.based, x: 0, dst, a, b: offset },
        });
    }

    pub(super) fn slot_load(&mut self, place: SlotPlace, index: SlotIndex) {
        if let Some(held) = self.held.find(place, index) {
            return self.push(Pending::Register(held.register));
        }
        if let Some(storage) = self.memory_slot(place, index) {
            let (base, offset) = self.slot_address(place, index);
            return self.scalar_load(access_codes(storage).load, base, offset);
        }
        let image = matches!(self.function.locals[index.index()], LocalType::Ref(reference) if reference.image);
        self.stack.push(Entry { value: Pending::Register(self.local_register(index)), image });
    }

    pub(super) fn slot_store(&mut self, place: SlotPlace, index: SlotIndex) {
        if let Some(held) = self.held.find(place, index) {
            // A trap puts it back into the image, so an index check that was asked for before comes before.
            self.settle_elements();
            return self.register_store(held.register, held.storage);
        }
        if let Some(storage) = self.memory_slot(place, index) {
            let (base, offset) = self.slot_address(place, index);
            return self.scalar_store(storage, base, offset);
        }
        let register = self.local_register(index);
        if let LocalType::Scalar(storage) = self.function.locals[index.index()] {
            return self.register_store(register, storage);
        }
        let (entry, _) = self.pop();
        self.settle_readers(register);
        // A reference: assigning one makes its pending index check, in the order of the instructions.
        self.settle_elements();
        self.compute(&entry.value, register);
    }

    /// Stores the top to a slot that is a register.
    fn register_store(&mut self, register: u32, storage: Storage) {
        let (entry, own) = self.pop();
        self.settle_readers(register);
        let computed = match entry.value {
            Pending::Register(source) if source == own => self.last_value(own),
            _ => None,
        };
        match (entry.value, wrap_code(storage)) {
            (Pending::Constant(bits), _) => {
                self.compute(&Pending::Constant(wrap_constant(storage, bits)), register);
            }
            (_, None) if computed.is_some() => self.redirect_last(register),
            (_, Some(_)) if computed.is_some_and(|last| self.is_stored_form(&last, storage)) => {
                self.redirect_last(register);
            }
            (Pending::Register(a), Some(_)) if storage == Storage::Bool && self.is_bool(a) => {
                self.value(Operation { code: Code::Move, x: 0, dst: register, a, b: 0 });
            }
            (value, None) => self.compute(&value, register),
            (value, Some(code)) => {
                let a = self.in_register(&value, own);
                self.value(Operation { code, x: 0, dst: register, a, b: 0 });
            }
        }
    }

    /// Whether an operation's result is as a store to this storage and a load from it would leave it.
    fn is_stored_form(&self, operation: &Operation, storage: Storage) -> bool {
        is_wrapped(operation.code, storage) || (storage == Storage::Bool && self.gives_bool(operation))
    }

    /// The loads of a storage from where `foreign` says that any NaN may stand.
    fn load_codes(storage: Storage, foreign: bool) -> LoadCodes {
        if foreign { foreign_load_codes(storage) } else { access_codes(storage).load }
    }

    pub(super) fn load(&mut self, place: BytePlace, storage: Storage, offset: u32) {
        let foreign = place.is_image() || self.verified.facts().foreign_floats;
        let (base, start) = self.base_of(place);
        self.scalar_load(Self::load_codes(storage, foreign), base, start + offset);
    }

    pub(super) fn store(&mut self, place: BytePlace, storage: Storage, offset: u32) {
        let (base, start) = self.base_of(place);
        self.scalar_store(storage, base, start + offset);
    }

    pub(super) fn load_bit(&mut self, place: BytePlace, offset: u32, bit: u8) {
        let (_, start) = self.base_of(place);
        let dst = self.next_register();
        self.value(Operation { code: Code::LoadBit, x: 0, dst, a: start + offset, b: u32::from(bit) });
        self.push_result();
    }

    pub(super) fn store_bit(&mut self, place: BytePlace, offset: u32, bit: u8) {
        self.settle_elements();
        let (_, start) = self.base_of(place);
        let (entry, own) = self.pop();
        let dst = self.in_register(&entry.value, own);
        self.effect(Operation { code: Code::StoreBit, x: 0, dst, a: start + offset, b: u32::from(bit) });
    }

    pub(super) fn address(&mut self, place: BytePlace, offset: u32) {
        let (base, start) = self.base_of(place);
        self.stack.push(Entry { value: Pending::Address(base, start + offset), image: place.is_image() });
    }

    pub(super) fn ref_load(&mut self, storage: Storage) {
        let (entry, _) = self.pop();
        let codes = Self::load_codes(storage, entry.image || self.verified.facts().foreign_floats);
        match entry.value {
            Pending::Address(base, offset) => self.scalar_load(codes, base, offset),
            Pending::Register(register) => self.scalar_load(codes, Base::Register(register), 0),
            // References are never constants; their bits would be an image offset.
            Pending::Constant(bits) => self.scalar_load(codes, Base::Image, bits as u32),
            Pending::Element(mut element) => {
                // A pending check that asks the same is made by this load, in the name of the one that was asked for first.
                let mut pending = self.stack.iter().filter_map(|entry| match entry.value {
                    Pending::Element(other) => Some(other),
                    _ => None,
                });
                match pending.next() {
                    Some(first) if first.checks_as(&element) && pending.all(|other| other.checks_as(&element)) => {
                        element.origin = first.origin;
                    }
                    _ => self.settle_elements(),
                }
                let dst = self.next_register();
                self.access_element(codes, true, &element, dst);
                self.push_result();
            }
        }
    }

    pub(super) fn ref_store(&mut self, storage: Storage) {
        let (value, value_own) = self.pop();
        let (reference, _) = self.pop();
        // Checks of entries below come first: they were asked for first.
        self.settle_elements();
        let dst = self.in_register(&value.value, value_own);
        let codes = access_codes(storage).store;
        match reference.value {
            Pending::Address(Base::Image, a) => self.effect(Operation { code: codes.image, x: 0, dst, a, b: 0 }),
            Pending::Constant(bits) => self.effect(Operation { code: codes.image, x: 0, dst, a: bits as u32, b: 0 }),
            Pending::Address(Base::Register(a), b) => self.effect(Operation { code: codes.based, x: 0, dst, a, b }),
            Pending::Register(a) => self.effect(Operation { code: codes.based, x: 0, dst, a, b: 0 }),
            Pending::Element(element) => self.access_element(codes, false, &element, dst),
        }
    }

    pub(super) fn ref_field(&mut self, owner: TypeId, field: u16) {
        let ty = &self.verified.container().types.types[owner.index()];
        // The verifier lets only records have fields.
        let (Type::Struct(record) | Type::Union(record) | Type::Block { record, .. }) = ty else { return };
        let offset = record.fields[usize::from(field)].offset;
        let (entry, _) = self.pop();
        let value = match entry.value {
            Pending::Address(base, at) => Pending::Address(base, at + offset),
            Pending::Register(register) => Pending::Address(Base::Register(register), offset),
            Pending::Constant(bits) => Pending::Constant(bits + u64::from(offset)),
            Pending::Element(mut element) => {
                element.offset += offset;
                Pending::Element(element)
            }
        };
        self.stack.push(Entry { value, image: entry.image });
    }

    pub(super) fn ref_index(&mut self, array: ArrayId) {
        let verified = self.verified;
        let descriptor = &verified.container().types.arrays[array.index()];
        let strides = strides(descriptor);
        let count = descriptor.dimensions.len();
        let reference = self.stack.len() - count - 1;
        let own = self.own_register(reference);
        let image = self.stack[reference].image;
        let is_loaded_next = matches!(self.next, Some(Instruction::RefLoad { .. }));
        if matches!(self.stack[reference].value, Pending::Element(_)) {
            self.settle_elements();
        }
        let (mut base, mut offset) = match self.stack[reference].value {
            Pending::Address(base, offset) => (base, offset),
            Pending::Register(register) => (Base::Register(register), 0),
            Pending::Constant(bits) => (Base::Image, bits as u32),
            Pending::Element(_) => (Base::Register(own), 0),
        };
        let mut pending: Option<Element> = None;
        for (position, ((lower, upper), stride)) in descriptor.dimensions.iter().zip(strides).enumerate() {
            let index = self.stack[reference + 1 + position].value;
            if let Pending::Constant(bits) = index
                && (*lower..=*upper).contains(&(bits as i32))
            {
                let distance = (bits as i32).wrapping_sub(*lower) as u32;
                offset = offset.wrapping_add(distance.wrapping_mul(stride));
                if let Some(element) = &mut pending {
                    element.offset = element.offset.wrapping_add(distance.wrapping_mul(stride));
                }
                continue;
            }
            let own_index = self.own_register(reference + 1 + position);
            let extent = upper.wrapping_sub(*lower) as u32;
            if let Some(element) = &mut pending
                && let Pending::Register(index) = index
                && element.inner.is_none()
                && element.outer.is_narrow()
                && stride <= u32::from(u16::MAX)
                && element.displacement == 0
                && (is_loaded_next || (index < own && element.outer.index < own))
            {
                element.inner = Some(Dimension { index, lower: *lower, extent, stride });
                continue;
            }
            // An earlier dimension's check comes first, and leaves a reference in the own register.
            if let Some(element) = pending.take() {
                self.settle_below(reference);
                self.compute(&Pending::Element(element), own);
                (base, offset) = (Base::Register(own), 0);
            }
            // Only for the top of the stack: the entries above another index may be copies of it.
            let displaced = if position + 1 == count { self.displaced_index(&index, own_index) } else { None };
            let (index, displacement) = displaced.unwrap_or_else(|| (self.in_register(&index, own_index), 0));
            let outer = Dimension { index, lower: *lower, extent, stride };
            pending = Some(Element { base, offset, displacement, outer, inner: None, origin: self.origin });
        }
        self.stack.truncate(reference);
        let value = match pending {
            None => Pending::Address(base, offset),
            Some(element) => self.keep_or_compute(element, own),
        };
        self.stack.push(Entry { value, image });
    }

    /// The index as a register and a small constant, when the operation just before added that: then takes it back.
    fn displaced_index(&mut self, index: &Pending, own: u32) -> Option<(u32, i16)> {
        let Pending::Register(register) = *index else { return None };
        let last = self.last_value(own).filter(|_| register == own)?;
        let added = match last.code {
            Code::i32_add => last.b as i32,
            Code::i32_sub => (last.b as i32).wrapping_neg(),
            _ => return None,
        };
        let displacement = i16::try_from(added).ok()?;
        self.remove_last();
        Some((last.a, displacement))
    }

    /// Makes the pending index checks of the entries below a depth.
    fn settle_below(&mut self, depth: usize) {
        for below in 0..depth {
            if matches!(self.stack[below].value, Pending::Element(_)) {
                self.settle(below);
            }
        }
    }

    /// Whether an index may stay unchecked until its use: its register must stay as it is although the entries above are gone.
    fn keep_or_compute(&mut self, mut element: Element, own: u32) -> Pending {
        let base_is_own = element.base == Base::Register(own);
        if !element.outer.is_narrow() {
            let depth = self.stack.len();
            self.settle_below(depth);
            self.compute(&Pending::Element(element), own);
            return Pending::Register(own);
        }
        if matches!(self.next, Some(Instruction::RefLoad { .. })) {
            return Pending::Element(element);
        }
        // The indexes of two dimensions are none: that was looked at when they were put together.
        let index_is_temporary = element.outer.index > own;
        if index_is_temporary && !base_is_own {
            // The entry's own register is free: it keeps the index.
            if self.last_value(element.outer.index).is_some() {
                self.redirect_last(own);
            } else {
                self.value(Operation { code: Code::Move, x: 0, dst: own, a: element.outer.index, b: 0 });
            }
            element.outer.index = own;
            return Pending::Element(element);
        }
        if index_is_temporary {
            let depth = self.stack.len();
            self.settle_below(depth);
            self.compute(&Pending::Element(element), own);
            return Pending::Register(own);
        }
        Pending::Element(element)
    }

    pub(super) fn ref_to_int(&mut self) {
        let depth = self.stack.len() - 1;
        if matches!(self.stack[depth].value, Pending::Element(_)) {
            self.settle_elements();
        }
        let (entry, own) = self.pop();
        let data = u64::from(self.layout.data.start);
        if let Pending::Address(Base::Image, offset) = entry.value {
            return self.push(Pending::Constant(u64::from(offset).wrapping_sub(data)));
        }
        let a = self.in_register(&entry.value, own);
        let b = self.constant_number(data.wrapping_neg());
        self.value(Operation { code: Code::i64_add, x: 0, dst: own, a, b });
        self.push_result();
    }

    pub(super) fn ref_check(&mut self, target: TypeId, write: bool) {
        self.settle_elements();
        let (entry, own) = self.pop();
        let a = self.in_register(&entry.value, own);
        let size = self.verified.facts().type_extents[target.index()].size;
        self.value(Operation { code: Code::ReferenceCheck, x: i16::from(write), dst: own, a, b: size });
        self.stack.push(Entry { value: Pending::Register(own), image: true });
    }

    pub(super) fn copy(&mut self, target: TypeId) {
        self.settle_elements();
        let (source, source_own) = self.pop();
        let (destination, destination_own) = self.pop();
        let dst = self.in_register(&destination.value, destination_own);
        let a = self.in_register(&source.value, source_own);
        let size = self.verified.facts().type_extents[target.index()].size;
        self.effect(Operation { code: Code::Copy, x: 0, dst, a, b: size });
    }
}

/// Bytes from one index to the next, by dimension.
fn strides(descriptor: &ArrayDescriptor) -> Vec<u32> {
    let mut stride = descriptor.stride;
    let mut strides = vec![0; descriptor.dimensions.len()];
    for (out, (lower, upper)) in strides.iter_mut().zip(&descriptor.dimensions).rev() {
        *out = stride;
        stride = stride.wrapping_mul((upper.wrapping_sub(*lower) as u32).wrapping_add(1));
    }
    strides
}
