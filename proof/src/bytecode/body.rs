//! The code of one function: what it can name, and its variables.

use khz_bytecode::container::{Constant, ControlPlace, Function, Owner};
use khz_bytecode::ids::{ConstantId, FunctionId, Label, SlotIndex, TypeId};
use khz_bytecode::instruction::Instruction;
use khz_bytecode::value::{BytePlace, LocalType, RefType, SlotPlace, Storage, ValueType};

use super::code::Code;
use super::world::World;

/// A scalar variable.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Variable {
    Slot(SlotPlace, SlotIndex),
    Bytes(BytePlace, Storage, u32),
}

impl Variable {
    pub fn load(self) -> Instruction {
        match self {
            Variable::Slot(place, index) => Instruction::SlotLoad { place, index },
            Variable::Bytes(place, storage, offset) => Instruction::Load { place, storage, offset },
        }
    }

    pub fn store(self) -> Instruction {
        match self {
            Variable::Slot(place, index) => Instruction::SlotStore { place, index },
            Variable::Bytes(place, storage, offset) => Instruction::Store { place, storage, offset },
        }
    }

    pub fn control(self) -> ControlPlace {
        match self {
            Variable::Slot(place, index) => ControlPlace::Slot(place, index),
            Variable::Bytes(place, _, offset) => ControlPlace::Bytes(place, offset),
        }
    }
}

/// A loop around the code at hand.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Around {
    /// Where leaving it goes.
    pub exit: Label,
    /// Where its next pass begins.
    pub next: Label,
    /// Entries that waited on the stack at its start.
    pub waiting: usize,
}

/// A typed place that the function can name.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub place: BytePlace,
    pub offset: u32,
    pub ty: TypeId,
    pub write: bool,
}

/// A function in the making.
#[derive(Debug)]
pub(crate) struct Body<'w> {
    pub world: &'w mut World,
    pub id: FunctionId,
    pub function: Function,
    pub code: Code,
    /// Instructions that may still be written, about.
    pub left: usize,
    /// Entries on the stack that belong to nobody yet.
    pub waiting: usize,
    pub around: Vec<Around>,
    pub places: Vec<Place>,
    /// Scalar locals that anyone may write.
    pub scalars: Vec<SlotIndex>,
    /// Locals that count passes; they are only read.
    pub counters: Vec<SlotIndex>,
    pub references: Vec<(SlotIndex, RefType)>,
}

impl<'w> Body<'w> {
    pub fn new(world: &'w mut World, id: FunctionId) -> Self {
        let function = world.container.functions[id.index()].clone();
        let mut places: Vec<Place> = world
            .data
            .iter()
            .map(|(offset, ty, write)| Place { place: BytePlace::Data, offset: *offset, ty: *ty, write: *write })
            .collect();
        let own = match function.owner {
            Owner::None => None,
            Owner::Program(program) => {
                world.container.types.programs[program.index()].block.map(|ty| (BytePlace::Block, ty))
            }
            Owner::Block(ty) => Some((BytePlace::This, ty)),
        };
        for (place, root) in own.into_iter().chain(function.frame.map(|ty| (BytePlace::Frame, ty))) {
            let inside = world.inside[root.index()].iter();
            places.extend(inside.map(|(offset, ty)| Place { place, offset: *offset, ty: *ty, write: true }));
        }
        let (mut scalars, mut references) = (Vec::new(), Vec::new());
        for (index, local) in function.locals.iter().enumerate() {
            match local {
                LocalType::Scalar(_) => scalars.push(SlotIndex(index as u16)),
                LocalType::Ref(ty) => references.push((SlotIndex(index as u16), *ty)),
            }
        }
        let left = world.profile.instructions;
        Body {
            world,
            id,
            function,
            code: Code::default(),
            left,
            waiting: 0,
            around: Vec::new(),
            places,
            scalars,
            counters: Vec::new(),
            references,
        }
    }

    pub fn put(&mut self, instruction: Instruction) {
        self.left = self.left.saturating_sub(1);
        self.code.put(instruction);
    }

    pub fn local(&mut self, ty: LocalType) -> SlotIndex {
        self.function.locals.push(ty);
        SlotIndex(self.function.locals.len() as u16 - 1)
    }

    /// Writes the whole body and hands the function back to the world.
    pub fn write(mut self) {
        for storage in [Storage::I32, Storage::I64, Storage::F32, Storage::F64] {
            let index = self.local(LocalType::Scalar(storage));
            self.scalars.push(index);
        }
        for _ in 0..self.world.random.below(4) {
            let storage = Storage::ALL[self.world.random.below(9)];
            let index = self.local(LocalType::Scalar(storage));
            self.scalars.push(index);
        }
        for _ in 0..self.world.random.below(3) {
            self.new_reference_local();
        }
        while self.left > 0 {
            self.statement(3);
        }
        for result in self.function.results.clone() {
            self.expression(result, 2);
            self.waiting += 1;
        }
        self.put(Instruction::Return {});
        self.function.code = self.code.finish();
        self.world.container.functions[self.id.index()] = self.function;
    }

    fn new_reference_local(&mut self) {
        let target = TypeId(self.world.random.below(self.world.extents.len()) as u16);
        let write = self.world.random.chance(60);
        let found = self.reference(target, write, false, 2);
        let ty = RefType { target, write, image: found.image || self.world.random.chance(20) };
        let index = self.local(LocalType::Ref(ty));
        self.put(Instruction::SlotStore { place: SlotPlace::Local, index });
        self.references.push((index, ty));
    }

    /// A constant of a type.
    pub fn constant_bits(&mut self, ty: ValueType, bits: u64) {
        let constant = match ty {
            ValueType::I32 => return self.put(Instruction::ConstI32 { value: bits as i32 }),
            ValueType::I64 => Constant::I64(bits as i64),
            ValueType::F32 => Constant::F32(bits as u32),
            ValueType::F64 => Constant::F64(bits),
        };
        let pool = &mut self.world.container.constants;
        let position = pool.iter().position(|known| *known == constant).unwrap_or_else(|| {
            pool.push(constant);
            pool.len() - 1
        });
        self.put(Instruction::Const { id: ConstantId(position as u16) });
    }

    pub fn integer(&mut self, ty: ValueType, value: i64) {
        self.constant_bits(ty, if ty == ValueType::I32 { u64::from(value as u32) } else { value as u64 });
    }

    /// A slot of one storage, if there is one.
    fn slot(&mut self, storage: Storage, write: bool) -> Option<Variable> {
        let mut found = Vec::new();
        for index in self.scalars.iter().chain(self.counters.iter().filter(|_| !write)) {
            if self.function.locals[index.index()] == LocalType::Scalar(storage) {
                found.push(Variable::Slot(SlotPlace::Local, *index));
            }
        }
        let shared = usize::from(self.world.container.tasks.shared_globals);
        let globals = self.world.container.types.slots.iter().take(shared).enumerate();
        let of_storage = |(index, own): (usize, &Storage)| (*own == storage).then_some(SlotIndex(index as u16));
        found.extend(globals.filter_map(of_storage).map(|index| Variable::Slot(SlotPlace::Global, index)));
        if let Owner::Program(program) = self.function.owner {
            let slots = self.world.container.types.programs[program.index()].slots.iter().enumerate();
            found.extend(slots.filter_map(of_storage).map(|index| Variable::Slot(SlotPlace::Program, index)));
        }
        self.world.random.pick(&found).copied()
    }

    /// Any place in %I, %Q or %M that has room for `bytes`.
    pub fn image_place(&mut self, bytes: u32, write: bool) -> Option<(BytePlace, u32)> {
        let parameters = &self.world.container.parameters;
        let sizes = [
            (BytePlace::Memory, parameters.memory_image_bytes),
            (BytePlace::Output, parameters.output_image_bytes),
            (BytePlace::Input, parameters.input_image_bytes),
        ];
        let fitting: Vec<(BytePlace, u32)> = (sizes.into_iter())
            .filter(|(place, size)| u32::from(*size) >= bytes && !(write && *place == BytePlace::Input))
            .map(|(place, size)| (place, u32::from(size) - bytes))
            .collect();
        let (place, most) = *self.world.random.pick(&fitting)?;
        Some((place, self.world.random.below(most as usize + 1) as u32))
    }

    /// A place of exactly this type.
    pub fn typed_place(&mut self, ty: TypeId, write: bool) -> Option<Place> {
        let of_type = |place: &&Place| place.ty == ty && (place.write || !write);
        let own: Vec<Place> =
            self.places.iter().filter(of_type).filter(|place| place.place != BytePlace::Data).copied().collect();
        if !own.is_empty() && self.world.random.chance(60) {
            return self.world.random.pick(&own).copied();
        }
        let all: Vec<Place> = self.places.iter().filter(of_type).copied().collect();
        self.world.random.pick(&all).copied()
    }

    /// A variable of this storage.
    pub fn variable_of(&mut self, storage: Storage, write: bool) -> Option<Variable> {
        match self.world.random.weighted(&[6, 3, 1]) {
            0 => self.slot(storage, write),
            1 => self
                .typed_place(World::scalar(storage), write)
                .map(|found| Variable::Bytes(found.place, storage, found.offset)),
            _ => {
                self.image_place(storage.bytes(), write).map(|(place, offset)| Variable::Bytes(place, storage, offset))
            }
        }
    }

    /// A variable whose value has this type.
    pub fn variable(&mut self, ty: ValueType, write: bool) -> Variable {
        let storages: Vec<Storage> =
            Storage::ALL.iter().copied().filter(|storage| storage.value_type() == ty).collect();
        for _ in 0..4 {
            let storage = storages[self.world.random.below(storages.len())];
            if let Some(found) = self.variable_of(storage, write) {
                return found;
            }
        }
        // Each function has a local of each stack type.
        let widest = storages[storages.len() - 1];
        self.slot(widest, write).expect("a local of this type")
    }

    pub fn any_value_type(&mut self) -> ValueType {
        self.world.random.one_of([ValueType::I32, ValueType::I32, ValueType::I64, ValueType::F32, ValueType::F64])
    }
}
