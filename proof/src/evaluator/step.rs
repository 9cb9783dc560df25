//! One instruction.

use khz_bytecode::container::{Constant, ControlPlace, Owner, Type};
use khz_bytecode::ids::{ArrayId, FunctionId, Label, MethodId, SlotIndex, TypeId};
use khz_bytecode::instruction::{HelperOp, HelperOperand, Instruction, MAX_CAPACITIES};
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::trap::TrapCode;
use khz_bytecode::value::{BytePlace, IntegerType, RefType, SlotPlace, StackType, Storage, ValueType};
use khz_bytecode::verify::Loop;
use khz_machine::semantics::{StringPlace, Value, load_scalar, store_scalar};

use super::{Item, Run, Stop, numeric, stop, strings};

impl Run<'_> {
    pub(super) fn step(&mut self, instruction: &Instruction) -> Result<(), Stop> {
        match instruction {
            Instruction::Nop {} => {}
            Instruction::ConstI32 { value } => self.push(Value::I32(*value)),
            Instruction::Const { id } => self.push(match self.container.constants[id.index()] {
                Constant::I64(value) => Value::I64(value),
                Constant::F32(bits) => Value::F32(f32::from_bits(bits)),
                Constant::F64(bits) => Value::F64(f64::from_bits(bits)),
            }),
            Instruction::Drop {} => drop(self.pop()),
            Instruction::Dup {} => {
                let top = self.pop();
                self.stack.extend([top, top]);
            }
            Instruction::Select {} => {
                let (condition, second, first) = (self.pop_i32(), self.pop(), self.pop());
                assert_eq!(first.stack_type(), second.stack_type(), "select between unlike entries");
                self.stack.push(if condition != 0 { first } else { second });
            }
            Instruction::Numeric(op) => {
                let mut operands: Vec<Value> = op.operands().iter().map(|_| self.pop_value()).collect();
                operands.reverse();
                let result = numeric::compute(*op, &operands);
                self.push(result.map_err(|code| Stop { code, values: [0; 3] })?);
            }
            Instruction::Helper(op, capacities) => self.helper(*op, *capacities),
            Instruction::CheckI32 { kind, lower, upper } => {
                let value = self.pop_i32();
                self.push(Value::I32(value));
                check(*kind, i64::from(value), i64::from(*lower), i64::from(*upper))?;
            }
            Instruction::CheckI64 { kind, lower, upper } => {
                let value = self.pop_i64();
                self.push(Value::I64(value));
                check(*kind, value, *lower, *upper)?;
            }
            Instruction::SlotLoad { .. }
            | Instruction::SlotStore { .. }
            | Instruction::Load { .. }
            | Instruction::Store { .. }
            | Instruction::LoadBit { .. }
            | Instruction::StoreBit { .. } => self.known(instruction),
            Instruction::Address { .. }
            | Instruction::RefLoad { .. }
            | Instruction::RefStore { .. }
            | Instruction::RefField { .. }
            | Instruction::RefIndex { .. }
            | Instruction::RefToInt {}
            | Instruction::RefCheck { .. }
            | Instruction::Copy { .. } => self.reference(instruction)?,
            other => return self.control(other),
        }
        self.top().at += 1;
        Ok(())
    }

    /// Where a slot of `g` or `p` lies, and its storage.
    fn slot(&mut self, place: SlotPlace, index: SlotIndex) -> (u32, Storage) {
        let start = if place == SlotPlace::Global { self.layout.slots.start } else { self.program };
        let at = start + u32::from(index.0) * SLOT_BYTES;
        let number = (at - self.layout.slots.start) / SLOT_BYTES;
        (at, self.container.types.slots[number as usize])
    }

    /// Where a byte place begins.
    fn start_of(&mut self, place: BytePlace) -> u32 {
        match place {
            BytePlace::Data => self.layout.data.start,
            BytePlace::Block => self.block.expect("the program has a data block"),
            BytePlace::This => self.top().this,
            BytePlace::Frame => self.top().frame,
            BytePlace::Memory => self.layout.memory.start,
            BytePlace::Output => self.layout.output.start,
            BytePlace::Input => self.layout.input.start,
        }
    }

    /// Loads a scalar; where any NaN may stand, it becomes the one NaN.
    fn load(&mut self, at: u32, storage: Storage, image: bool) -> Value {
        let is_foreign = image || self.verified.facts().foreign_floats;
        let value = load_scalar(self.bytes(at, storage.bytes()), storage);
        match value {
            Value::F32(value) if is_foreign && value.is_nan() => Value::F32(f32::from_bits(0xFFC0_0000)),
            Value::F64(value) if is_foreign && value.is_nan() => Value::F64(f64::from_bits(0xFFF8_0000_0000_0000)),
            other => other,
        }
    }

    fn store(&mut self, at: u32, storage: Storage, value: Value) {
        assert_eq!(storage.value_type(), value.value_type(), "a store of another type");
        assert!(at + storage.bytes() <= self.layout.input.start, "a store into %I");
        self.writes(at, storage.bytes());
        store_scalar(self.bytes(at, storage.bytes()), storage, value);
    }

    fn known(&mut self, instruction: &Instruction) {
        match *instruction {
            Instruction::SlotLoad { place: SlotPlace::Local, index } => {
                let item = self.load_local(index.index());
                self.stack.push(item);
            }
            Instruction::SlotStore { place: SlotPlace::Local, index } => self.store_local(index.index()),
            Instruction::SlotLoad { place, index } => {
                let (at, storage) = self.slot(place, index);
                let value = load_scalar(self.bytes(at, SLOT_BYTES), storage);
                self.push(value);
            }
            Instruction::SlotStore { place, index } => {
                let ((at, storage), value) = (self.slot(place, index), self.pop_value());
                self.store(at, storage, value);
            }
            Instruction::Load { place, storage, offset } => {
                let at = self.start_of(place) + offset;
                let value = self.load(at, storage, place.is_image());
                self.push(value);
            }
            Instruction::Store { place, storage, offset } => {
                let (at, value) = (self.start_of(place) + offset, self.pop_value());
                self.store(at, storage, value);
            }
            Instruction::LoadBit { place, offset, bit } => {
                let at = self.start_of(place) + offset;
                let byte = self.bytes(at, 1)[0];
                self.push(Value::I32(i32::from(byte >> bit & 1)));
            }
            Instruction::StoreBit { place, offset, bit } => {
                let (at, value) = (self.start_of(place) + offset, self.pop_i32());
                self.writes(at, 1);
                let byte = &mut self.bytes(at, 1)[0];
                *byte = *byte & !(1 << bit) | (u8::from(value != 0) << bit);
            }
            _ => {}
        }
    }

    fn size_of(&self, ty: TypeId) -> u32 {
        self.verified.facts().type_extents[ty.index()].size
    }

    fn reference(&mut self, instruction: &Instruction) -> Result<(), Stop> {
        match *instruction {
            Instruction::Address { place, offset, target } => {
                let at = self.start_of(place) + offset;
                let write = place != BytePlace::Input && !self.is_constant(place, offset);
                self.stack.push(Item::Ref(at, RefType { target, write, image: place.is_image() }));
            }
            Instruction::RefLoad { storage } => {
                let (at, ty) = self.pop_ref();
                let value = self.load(at, storage, ty.image);
                self.push(value);
            }
            Instruction::RefStore { storage } => {
                let value = self.pop_value();
                let (at, ty) = self.pop_ref();
                assert!(ty.write, "a write through {ty}");
                self.store(at, storage, value);
            }
            Instruction::RefField { owner, field } => {
                let (at, ty) = self.pop_ref();
                assert_eq!(ty.target, owner, "a field of another type");
                let (Type::Struct(record) | Type::Union(record) | Type::Block { record, .. }) =
                    &self.container.types.types[owner.index()]
                else {
                    panic!("a field of no record")
                };
                let field = record.fields[usize::from(field)];
                self.stack.push(Item::Ref(at + field.offset, RefType { target: field.ty, ..ty }));
            }
            Instruction::RefIndex { array } => self.ref_index(array)?,
            Instruction::RefToInt {} => {
                let (at, _) = self.pop_ref();
                let address = i64::from(at) - i64::from(self.layout.data.start);
                self.push(Value::I64(address));
            }
            Instruction::RefCheck { target, write } => {
                let address = self.pop_i64();
                let end = if write { self.layout.output.end } else { self.layout.input.end };
                let (first, size) = (i128::from(self.layout.data.start), i128::from(self.size_of(target)));
                let at = first + i128::from(address);
                if address == 0 || at < first || at + size > i128::from(end) {
                    return stop(TrapCode::Reference, [address, 0, 0]);
                }
                self.stack.push(Item::Ref(at as u32, RefType { target, write, image: true }));
            }
            Instruction::Copy { target } => {
                let ((source, _), (destination, ty)) = (self.pop_ref(), self.pop_ref());
                assert!(ty.write, "a copy to {ty}");
                let size = self.size_of(target);
                let bytes = self.bytes(source, size).to_vec();
                self.writes(destination, size);
                self.bytes(destination, size).copy_from_slice(&bytes);
            }
            _ => {}
        }
        Ok(())
    }

    fn ref_index(&mut self, array: ArrayId) -> Result<(), Stop> {
        let descriptor = &self.container.types.arrays[array.index()];
        let mut indices: Vec<i64> = descriptor.dimensions.iter().map(|_| i64::from(self.pop_i32())).collect();
        indices.reverse();
        let mut position = 0;
        for (index, (lower, upper)) in indices.into_iter().zip(&descriptor.dimensions) {
            let (lower, upper) = (i64::from(*lower), i64::from(*upper));
            if index < lower || index > upper {
                return stop(TrapCode::ArrayIndex, [index, lower, upper]);
            }
            position = position * (upper - lower + 1) + (index - lower);
        }
        let (at, ty) = self.pop_ref();
        let at = at + position as u32 * descriptor.stride;
        self.stack.push(Item::Ref(at, RefType { target: descriptor.element, ..ty }));
        Ok(())
    }

    fn is_constant(&self, place: BytePlace, offset: u32) -> bool {
        let mut variables = self.container.types.data.iter().rev();
        place == BytePlace::Data && variables.find(|variable| variable.offset <= offset).is_some_and(|v| v.constant)
    }

    fn helper(&mut self, op: HelperOp, capacities: [u16; MAX_CAPACITIES]) {
        let mut items: Vec<Item> = op.operands().iter().map(|_| self.pop()).collect();
        items.reverse();
        let (mut places, mut values) = (Vec::new(), Vec::new());
        for (operand, item) in op.operands().iter().zip(items) {
            match (operand, item) {
                (HelperOperand::Value(_), Item::Value(value)) => values.push(value),
                (string, Item::Ref(at, ty)) if string.is_string() => {
                    let capacity = capacities[places.len()];
                    let wanted = match string {
                        HelperOperand::WideDst | HelperOperand::WideSrc => Type::WideString { capacity },
                        _ => Type::String { capacity },
                    };
                    assert_eq!(self.container.types.types[ty.target.index()], wanted);
                    assert!(ty.write || !string.is_destination(), "a write through {ty}");
                    places.push(StringPlace { at, capacity });
                }
                (operand, item) => panic!("{item:?} where {operand:?} is due"),
            }
        }
        if let (Some(first), Some(place)) = (op.operands().first(), places.first())
            && first.is_destination()
        {
            self.writes(place.at, first.unit_bytes() * (u32::from(place.capacity) + 1));
        }
        let result = strings::apply(op, self.image, &places, &values);
        result.into_iter().for_each(|value| self.push(value));
    }

    fn jump(&mut self, label: Label) {
        let facts = self.verified.function(self.top().function);
        let target = facts.instructions.iter().position(|placed| placed.offset == label.0);
        self.top().at = target.expect("a jump goes to an instruction");
    }

    fn control(&mut self, instruction: &Instruction) -> Result<(), Stop> {
        let target = match instruction {
            Instruction::Jump { target } => Some(*target),
            Instruction::JumpIf { target } => Some(*target).filter(|_| self.pop_i32() != 0),
            Instruction::JumpUnless { target } => Some(*target).filter(|_| self.pop_i32() == 0),
            Instruction::Switch { targets } => {
                let value = self.pop_i32() as u32 as usize;
                targets.get(value).or(targets.last()).copied()
            }
            Instruction::ForEnter { id, exit } => {
                let is_due = self.for_enter(id.index())?;
                Some(*exit).filter(|_| !is_due)
            }
            Instruction::ForNext { id, header } => {
                let goes_on = self.for_next(id.index());
                Some(*header).filter(|_| goes_on)
            }
            Instruction::Call { function } => return self.call(*function, None),
            Instruction::CallVirtual { method } => return self.call_virtual(*method),
            Instruction::Return {} => {
                self.return_();
                return Ok(());
            }
            other => panic!("no meaning for {}", other.mnemonic()),
        };
        match target {
            Some(target) => self.jump(target),
            None => self.top().at += 1,
        }
        Ok(())
    }

    fn pop_integer(&mut self, ty: IntegerType) -> i64 {
        if ty.value_type() == ValueType::I64 { self.pop_i64() } else { i64::from(self.pop_i32()) }
    }

    fn push_integer(&mut self, ty: IntegerType, value: i64) {
        self.push(if ty.value_type() == ValueType::I64 { Value::I64(value) } else { Value::I32(value as i32) });
    }

    fn set_control(&mut self, control: ControlPlace, ty: IntegerType, value: i64) {
        self.push_integer(ty, value);
        match control {
            ControlPlace::Slot(place, index) => self.known(&Instruction::SlotStore { place, index }),
            ControlPlace::Bytes(place, offset) => {
                self.known(&Instruction::Store { place, storage: ty.storage(), offset });
            }
        }
    }

    fn control_value(&mut self, control: ControlPlace, ty: IntegerType) -> i64 {
        match control {
            ControlPlace::Slot(place, index) => self.known(&Instruction::SlotLoad { place, index }),
            ControlPlace::Bytes(place, offset) => {
                self.known(&Instruction::Load { place, storage: ty.storage(), offset });
            }
        }
        self.pop_integer(ty)
    }

    /// Whether a first pass is due.
    fn for_enter(&mut self, number: usize) -> Result<bool, Stop> {
        let id = self.top().function;
        let descriptor = self.container.functions[id.index()].for_loops[number];
        let ty = descriptor.ty;
        let (step, bound, initial) = (self.pop_integer(ty), self.pop_integer(ty), self.pop_integer(ty));
        if step == 0 {
            return stop(TrapCode::Range, [0; 3]);
        }
        for (slot, value) in [(descriptor.bound, bound), (descriptor.step, step)] {
            self.push_integer(ty, value);
            self.store_local(slot.index());
        }
        self.set_control(descriptor.control, ty, initial);
        let control = self.control_value(descriptor.control, ty);
        self.top().controls[number] = control;
        let (control, bound) = (ordered(ty, control), ordered(ty, bound));
        Ok(if step > 0 { control <= bound } else { control >= bound })
    }

    /// Whether a further pass is due.
    fn for_next(&mut self, number: usize) -> bool {
        let id = self.top().function;
        let descriptor = self.container.functions[id.index()].for_loops[number];
        let ty = descriptor.ty;
        let control = self.control_value(descriptor.control, ty);
        let kept = [descriptor.bound, descriptor.step].map(|slot| match self.load_local(slot.index()) {
            Item::Value(Value::I32(value)) => i64::from(value),
            Item::Value(Value::I64(value)) => value,
            other => panic!("{other:?} in a FOR slot"),
        });
        let is_proven = |found: &Loop| found.for_loop.is_some_and(|id| id.index() == number) && found.control_is_proven;
        if self.verified.function(id).loops.iter().any(is_proven) {
            assert_eq!(control, self.top().controls[number], "a proven control variable was written in its loop");
        }
        self.set_control(descriptor.control, ty, control.wrapping_add(kept[1]));
        let next = self.control_value(descriptor.control, ty);
        self.top().controls[number] = next;
        let (control, bound, step) = (ordered(ty, control), ordered(ty, kept[0]), i128::from(kept[1]));
        if step > 0 {
            control <= bound && bound - control >= step
        } else {
            control >= bound && control - bound >= -step
        }
    }

    fn call(&mut self, id: FunctionId, found: Option<u32>) -> Result<(), Stop> {
        let callee = &self.container.functions[id.index()];
        let depth = self.calls.len() + 1;
        let own = self.verified.function(self.top().function).frame_bytes;
        let frame = self.top().frame + own.next_multiple_of(8);
        let needed = u64::from(frame) + u64::from(self.verified.function(id).frame_bytes);
        let deepest = usize::from(self.container.parameters.max_call_depth);
        if depth > deepest || needed > u64::from(self.frames.end) {
            return stop(TrapCode::CallDepth, [depth as i64, 0, 0]);
        }
        let mut this = found.unwrap_or(0);
        if let (Owner::Block(block), None) = (callee.owner, found) {
            let at = self.stack.len() - usize::from(callee.parameters) - 1;
            let Item::Ref(instance, ty) = self.stack.remove(at) else { panic!("`this` is no reference") };
            assert!(self.derives_from(ty.target, block) && ty.write && !ty.image, "`this` is {ty}");
            this = instance;
        }
        if let Owner::Program(_) = callee.owner {
            assert_eq!(self.owner(), callee.owner, "a call into another program");
        }
        self.enter(id, frame, this)
    }

    fn derives_from(&self, ty: TypeId, ancestor: TypeId) -> bool {
        let mut next = Some(ty);
        while let Some(ty) = next {
            let Type::Block { base, .. } = &self.container.types.types[ty.index()] else { return false };
            if ty == ancestor {
                return true;
            }
            next = *base;
        }
        false
    }

    fn call_virtual(&mut self, method: MethodId) -> Result<(), Stop> {
        let parameters = self.container.types.methods[method.index()].parameters.len();
        let at = self.stack.len() - parameters - 1;
        let Item::Value(Value::I64(address)) = self.stack[at] else { panic!("the address is no i64") };
        let Some(function) = self.find(address, method) else {
            return stop(TrapCode::Reference, [address, 0, 0]);
        };
        self.stack.remove(at);
        self.call(function, Some(self.layout.data.start + address as u32))
    }

    /// The function that a method name means for the instance at an address.
    fn find(&self, address: i64, method: MethodId) -> Option<FunctionId> {
        for row in &self.container.types.block_instances {
            let distance = i128::from(address) - i128::from(row.offset);
            let stride = i128::from(row.stride.max(1));
            if distance < 0 || distance % stride != 0 || distance / stride >= i128::from(row.count) {
                continue;
            }
            let mut next = Some(row.ty);
            while let Some(ty) = next {
                let Type::Block { base, methods, .. } = &self.container.types.types[ty.index()] else { break };
                if let Some((_, function)) = methods.iter().find(|(name, _)| *name == method) {
                    return Some(*function);
                }
                next = *base;
            }
        }
        None
    }

    fn return_(&mut self) {
        let call = self.calls.pop().expect("a function runs");
        let results = &self.container.functions[call.function.index()].results;
        let found = self.stack[call.base..].iter().map(|item| item.stack_type());
        assert!(
            found.eq(results.iter().map(|ty| StackType::Value(*ty))),
            "the stack holds other things than the results"
        );
        if let Some(caller) = self.calls.last_mut() {
            caller.at += 1;
        }
    }
}

/// A carried value in the order of its type.
fn ordered(ty: IntegerType, carried: i64) -> i128 {
    match (ty.value_type(), ty.is_signed()) {
        (_, true) => i128::from(carried),
        (ValueType::I64, false) => i128::from(carried as u64),
        (_, false) => i128::from(carried as u32),
    }
}

fn check(ty: IntegerType, value: i64, lower: i64, upper: i64) -> Result<(), Stop> {
    let (v, l, u) = (ordered(ty, value), ordered(ty, lower), ordered(ty, upper));
    if l <= v && v <= u {
        return Ok(());
    }
    // As i64: unsigned 64-bit values as their bit pattern.
    stop(TrapCode::Range, [v as i64, l as i64, u as i64])
}
