//! References: code that leaves a reference to a type on the stack.

use khz_bytecode::ids::{ArrayId, TypeId};
use khz_bytecode::instruction::{Instruction, NumericOp};
use khz_bytecode::value::{BytePlace, RefType, SlotPlace, ValueType};

use super::body::{Body, Place};
use super::world::Way;

impl Body<'_> {
    /// A reference to `target`: with `write` a writable one, with `typed` one into typed memory. Returns its exact type.
    pub fn reference(&mut self, target: TypeId, write: bool, typed: bool, depth: usize) -> RefType {
        for _ in 0..3 {
            let found = match self.world.random.weighted(&[5, 4, 5, 1, 2, 1]) {
                0 => self.place_reference(target, write),
                1 => self.local_reference(target, write, typed),
                2 if depth > 0 => self.inner_reference(target, write, typed, depth - 1),
                3 if !typed => self.image_reference(target, write),
                4 if self.world.profile.raw && !typed && depth > 0 => {
                    Some(self.raw_reference(target, write, depth - 1))
                }
                5 if depth > 0 => self.chosen_reference(target, depth - 1),
                _ => None,
            };
            if let Some(found) = found {
                return found;
            }
        }
        self.place_reference(target, write).expect("there is a variable of every type")
    }

    fn address(&mut self, found: Place, target: TypeId) -> RefType {
        self.put(Instruction::Address { place: found.place, offset: found.offset, target });
        RefType { target, write: found.write, image: false }
    }

    fn place_reference(&mut self, target: TypeId, write: bool) -> Option<RefType> {
        let found = self.typed_place(target, write)?;
        Some(self.address(found, target))
    }

    fn local_reference(&mut self, target: TypeId, write: bool, typed: bool) -> Option<RefType> {
        let fits = |ty: &RefType| ty.target == target && (ty.write || !write) && !(ty.image && typed);
        let fitting: Vec<_> = self.references.iter().filter(|(_, ty)| fits(ty)).copied().collect();
        let (index, ty) = *self.world.random.pick(&fitting)?;
        self.put(Instruction::SlotLoad { place: SlotPlace::Local, index });
        Some(ty)
    }

    /// A field or an element of something larger.
    fn inner_reference(&mut self, target: TypeId, write: bool, typed: bool, depth: usize) -> Option<RefType> {
        let ways = self.world.ways[target.index()].clone();
        let (owner, way) = *self.world.random.pick(&ways)?;
        let found = self.reference(owner, write, typed, depth);
        self.waiting += 1;
        match way {
            Way::Field(field) => self.put(Instruction::RefField { owner, field }),
            Way::Index(array) => self.index(array, depth),
        }
        self.waiting -= 1;
        Some(RefType { target, ..found })
    }

    fn index(&mut self, array: ArrayId, depth: usize) {
        let dimensions = self.world.container.types.arrays[array.index()].dimensions.clone();
        for (lower, upper) in &dimensions {
            let (low, high) = (i64::from(*lower), i64::from(*upper));
            let careful = self.world.random.chance(self.world.profile.care);
            if !careful && self.world.random.chance(60) {
                self.expression(ValueType::I32, depth);
            } else if careful && self.world.random.chance(40) {
                self.expression(ValueType::I32, depth);
                self.integer(ValueType::I32, high - low + 1);
                self.put(Instruction::Numeric(NumericOp::I32RemU));
                self.integer(ValueType::I32, low);
                self.put(Instruction::Numeric(NumericOp::I32Add));
            } else {
                let beyond = i64::from(!careful);
                let index = self.world.random.between(low - beyond, high + beyond);
                self.integer(ValueType::I32, index);
            }
            self.waiting += 1;
        }
        self.waiting -= dimensions.len();
        self.put(Instruction::RefIndex { array });
    }

    fn image_reference(&mut self, target: TypeId, write: bool) -> Option<RefType> {
        let (place, offset) = self.image_place(self.world.extents[target.index()].size, write)?;
        self.put(Instruction::Address { place, offset, target });
        Some(RefType { target, write: place != BytePlace::Input, image: true })
    }

    /// A reference out of an integer.
    fn raw_reference(&mut self, target: TypeId, write: bool, depth: usize) -> RefType {
        if self.world.random.chance(self.world.profile.care) {
            let from = if self.world.random.chance(80) {
                target
            } else {
                TypeId(self.world.random.below(self.world.extents.len()) as u16)
            };
            self.reference(from, write, false, depth);
            self.put(Instruction::RefToInt {});
        } else if self.world.random.chance(50) {
            let end = i64::from(self.world.container.parameters.data_region_bytes) + 200;
            let address = self.world.random.between(-8, end);
            self.integer(ValueType::I64, address);
        } else {
            self.expression(ValueType::I64, depth);
        }
        let write = write || self.world.random.chance(30);
        self.put(Instruction::RefCheck { target, write });
        RefType { target, write, image: true }
    }

    /// One of two places, chosen at run time.
    fn chosen_reference(&mut self, target: TypeId, depth: usize) -> Option<RefType> {
        let (first, second) = (self.typed_place(target, true)?, self.typed_place(target, true)?);
        let found = self.address(first, target);
        self.address(second, target);
        self.waiting += 2;
        self.expression(ValueType::I32, depth);
        self.waiting -= 2;
        self.put(Instruction::Select {});
        Some(found)
    }
}
