//! Places to addresses: what is known when the program is compiled becomes an offset, the rest a chain of references.

use khz_bytecode::ids::SlotIndex;
use khz_bytecode::instruction::{Instruction as I, NumericOp as N};
use khz_bytecode::value::{BytePlace, SlotPlace, Storage, ValueType};

use super::body::FunctionBuilder;
use crate::analysis::tree::{Expr, ExprKind, Place, Root, Step};
use crate::analysis::types::{Const, Ty, TyKind};

/// Where a variable is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Home {
    /// In a slot.
    Slot(SlotPlace, SlotIndex),
    /// At a known place in bytes.
    Bytes(BytePlace, u32),
    /// One bit of the process image.
    Bit(BytePlace, u32, u8),
    /// Where the reference in an `L` slot points.
    Ref(SlotIndex),
    /// Nowhere in this unit.
    None,
}

/// Where a place is, when its code has been emitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Address {
    Slot(SlotPlace, SlotIndex),
    Bytes(BytePlace, u32),
    Bit(BytePlace, u32, u8),
    /// A reference is on the stack.
    Stack,
}

impl FunctionBuilder<'_, '_> {
    fn root_home(&self, root: Root) -> Home {
        match root {
            Root::Var(var) => self.homes.get(var.0 as usize).copied().unwrap_or(Home::None),
            Root::Global(global) => self.b.global_homes.get(&global).copied().unwrap_or(Home::None),
            Root::Direct(located) => match located.bit {
                Some(bit) => Home::Bit(located.place, located.offset, bit),
                None => Home::Bytes(located.place, located.offset),
            },
            Root::System(long) => self.b.system_home(long),
            Root::CallInstance => self.calls.last().map_or(Home::None, |call| call.instance),
            Root::CallOutput(var) => {
                let found = self.calls.last().and_then(|call| call.outputs.iter().find(|(id, _)| *id == var));
                found.map_or(Home::None, |(_, home)| *home)
            }
        }
    }

    fn root_type(&self, place: &Place) -> Ty {
        self.b.actual(match place.path.first() {
            Some(Step::Field(owner, _) | Step::Index(owner, _)) => Ty::User(*owner),
            Some(Step::Part(ty, ..) | Step::Character(ty, _)) => *ty,
            None => place.ty,
        })
    }

    /// The offset of a constant index list in its array.
    fn constant_offset(&self, array: Ty, indices: &[Expr]) -> Option<u32> {
        let TyKind::Array { element, dims } = self.b.project.types.kind(array)? else { return None };
        let stride = i64::from(self.b.project.types.extent(*element).0);
        let mut number: i64 = 0;
        for (index, (low, high)) in indices.iter().zip(dims.iter()) {
            let ExprKind::Const(Const::Int(value)) = index.kind else { return None };
            // A constant index of an open array was checked against no bounds yet.
            if value < i64::from(*low) || value > i64::from(*high) {
                return None;
            }
            number = number * (i64::from(*high) - i64::from(*low) + 1) + (value - i64::from(*low));
        }
        u32::try_from(number * stride).ok()
    }

    /// Emits the way to a place, without a last step to bits.
    pub(super) fn address(&mut self, place: &Place) -> Address {
        let steps = match place.path.last() {
            Some(Step::Part(..)) => &place.path[..place.path.len() - 1],
            _ => &place.path[..],
        };
        let mut ty = self.root_type(place);
        let mut at = match self.root_home(place.root) {
            Home::Slot(slots, index) => return Address::Slot(slots, index),
            Home::Bit(image, offset, bit) => return Address::Bit(image, offset, bit),
            Home::Bytes(bytes, offset) => Some((bytes, offset)),
            Home::Ref(slot) => {
                self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
                None
            }
            Home::None => Some((BytePlace::Data, 0)),
        };
        for step in steps {
            match step {
                Step::Field(owner, field) => {
                    let def =
                        self.b.project.types.fields(Ty::User(*owner)).and_then(|fields| fields.get(*field as usize));
                    let (offset, field_ty) = def.map_or((0, Ty::Error), |def| (def.offset, def.ty));
                    match &mut at {
                        Some((_, base)) => *base = base.saturating_add(offset),
                        None => {
                            let owner = self.b.type_id(Ty::User(*owner));
                            let field = self.b.id16(*field as usize, "fields of a structure");
                            self.e.push(I::RefField { owner, field }, 1, 1);
                        }
                    }
                    ty = field_ty;
                }
                Step::Index(owner, indices) => {
                    let array = self.b.actual(Ty::User(*owner));
                    match (at, self.constant_offset(array, indices)) {
                        (Some((bytes, base)), Some(offset)) => at = Some((bytes, base.saturating_add(offset))),
                        _ => {
                            if let Some((bytes, offset)) = at.take() {
                                self.push_address(bytes, offset, ty);
                            }
                            self.index(array, indices, place);
                        }
                    }
                    if let Some(TyKind::Array { element, .. }) = self.b.project.types.kind(array) {
                        ty = *element;
                    }
                }
                Step::Character(text, index) => {
                    if let Some((bytes, offset)) = at.take() {
                        self.push_address(bytes, offset, *text);
                    }
                    self.value(index);
                    let array = self.b.character_array(*text);
                    self.e.mark(place.span);
                    self.e.push(I::RefIndex { array }, 2, 1);
                }
                Step::Part(..) => {}
            }
        }
        at.map_or(Address::Stack, |(bytes, offset)| Address::Bytes(bytes, offset))
    }

    fn index(&mut self, array: Ty, indices: &[Expr], place: &Place) {
        for index in indices {
            self.value(index);
        }
        self.b.type_id(array);
        let Ty::User(id) = array else { return };
        let Some(&array) = self.b.arrays.get(&id) else { return };
        self.e.mark(place.span);
        let count = u32::try_from(indices.len()).unwrap_or(0);
        self.e.push(I::RefIndex { array }, 1 + count, 1);
    }

    pub(super) fn push_address(&mut self, place: BytePlace, offset: u32, ty: Ty) {
        let target = self.b.type_id(ty);
        self.e.push(I::Address { place, offset, target }, 0, 1);
    }

    /// Pushes a reference to a place that has an address.
    pub(super) fn reference(&mut self, place: &Place) {
        match self.address(place) {
            Address::Bytes(bytes, offset) => self.push_address(bytes, offset, place.ty),
            Address::Stack => {}
            // The checker gave every variable that a reference is made to an address.
            Address::Slot(..) | Address::Bit(..) => {}
        }
    }

    fn load_at(&mut self, address: Address, storage: Storage) {
        match address {
            Address::Slot(place, index) => self.e.push(I::SlotLoad { place, index }, 0, 1),
            Address::Bytes(place, offset) => self.e.push(I::Load { place, storage, offset }, 0, 1),
            Address::Bit(place, offset, bit) => self.e.push(I::LoadBit { place, offset, bit }, 0, 1),
            Address::Stack => self.e.push(I::RefLoad { storage }, 1, 1),
        }
    }

    /// Stores what is on the stack; for [`Address::Stack`] the reference is below it.
    pub(super) fn store_at(&mut self, address: Address, storage: Storage) {
        match address {
            Address::Slot(place, index) => self.e.push(I::SlotStore { place, index }, 1, 0),
            Address::Bytes(place, offset) => self.e.push(I::Store { place, storage, offset }, 1, 0),
            Address::Bit(place, offset, bit) => self.e.push(I::StoreBit { place, offset, bit }, 1, 0),
            Address::Stack => self.e.push(I::RefStore { storage }, 2, 0),
        }
    }

    fn storage_of(&self, ty: Ty) -> Storage {
        self.b.project.types.storage(ty).unwrap_or(Storage::U8)
    }

    /// Pushes the value of a scalar place.
    pub(super) fn load(&mut self, place: &Place) {
        let Some(Step::Part(whole, first, bits)) = place.path.last() else {
            let address = self.address(place);
            self.load_at(address, self.storage_of(place.ty));
            return;
        };
        let (whole, first, bits) = (*whole, *first, *bits);
        let address = self.address(place);
        let storage = self.storage_of(whole);
        self.load_at(address, storage);
        let wide = storage.value_type() == ValueType::I64;
        #[expect(clippy::cast_possible_wrap, reason = "a bit number")]
        self.i32_const(first as i32);
        self.numeric(if wide { N::I64ShrU } else { N::I32ShrU });
        if wide {
            self.numeric(N::I32WrapI64);
        }
        if bits < 32 {
            self.i32_const(mask32(bits));
            self.numeric(N::I32And);
        }
    }

    /// Stores a scalar value.
    pub(super) fn store(&mut self, place: &Place, value: &Expr) {
        let Some(Step::Part(whole, first, bits)) = place.path.last() else {
            let address = self.address(place);
            self.value(value);
            self.store_at(address, self.storage_of(place.ty));
            return;
        };
        self.store_part(place, value, *whole, *first, *bits);
    }

    /// Reads, replaces bits, writes; the value is computed first, because it may change the variable.
    fn store_part(&mut self, place: &Place, value: &Expr, whole: Ty, first: u32, bits: u32) {
        let storage = self.storage_of(whole);
        let wide = storage.value_type() == ValueType::I64;
        self.value(value);
        let slot = self.scratch(self.storage_of(value.ty));
        self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
        let address = self.address(place);
        if address == Address::Stack {
            self.e.push(I::Dup {}, 1, 2);
        }
        self.load_at(address, storage);
        let mask = (if bits >= 64 { u64::MAX } else { (1u64 << bits) - 1 }) << first;
        if wide {
            self.i64_const((!mask).cast_signed());
            self.numeric(N::I64And);
        } else {
            #[expect(clippy::cast_possible_truncation, reason = "the variable has 32 bits")]
            self.i32_const((!mask as u32).cast_signed());
            self.numeric(N::I32And);
        }
        self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
        if wide {
            self.numeric(N::I64ExtendI32U);
        }
        #[expect(clippy::cast_possible_wrap, reason = "a bit number")]
        self.i32_const(first as i32);
        self.numeric(if wide { N::I64Shl } else { N::I32Shl });
        self.numeric(if wide { N::I64Or } else { N::I32Or });
        self.store_at(address, storage);
        self.release(slot);
    }
}

fn mask32(bits: u32) -> i32 {
    ((1u32 << bits.min(31)) - 1).cast_signed()
}
