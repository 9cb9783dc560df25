//! The typing pass: one walk over the code with a stack of types, in code order.
//!
//! Every block but the entry is reached over a forward edge (`flow`), so when the walk comes to a block, its stack is known and
//! every edge seen later only has to agree. The same walk holds definite assignment of reference locals (the sets of
//! assigned locals are intersected over the forward edges; an edge back can only bring more) and notes what each instruction touches.

use super::error::{Check, VerifyError};
use super::facts::{BasicBlock, PlacedInstruction};
use super::rules::Rule;
use super::scope::{Broken, Scope};
use super::touch::{Origin, Touch, TouchKind};
use super::types::Wanted;
use crate::container::{ArrayDescriptor, ControlPlace, Owner, Type};
use crate::ids::{ArrayId, BlockId, ForId, FunctionId, MethodId, SlotIndex, TypeId};
use crate::instruction::{ControlOp, HelperOp, HelperOperand, Instruction, MAX_CAPACITIES};
use crate::limits::MAX_ANALYSIS_ENTRIES;
use crate::trap::TrapCode;
use crate::value::{BytePlace, IntegerType, LocalType, RefType, SlotPlace, StackType, Storage, ValueType};

/// What the typing pass found out about one function.
#[derive(Debug, Default)]
pub(super) struct Draft {
    /// What its instructions touch, in code order.
    pub(super) touches: Vec<Touch>,
    /// Where the writable references point that it passes to direct calls, if that is known.
    pub(super) arguments: Vec<Option<Origin>>,
    /// Whether it writes, or makes writable references to, variables that are neither its own nor handed to it (slots and images aside).
    pub(super) reaches_out: bool,
    /// Deepest stack.
    pub(super) max_stack: u16,
    /// Whether an instruction of its own may trap (depth of calls aside).
    pub(super) traps: bool,
    /// Whether it may bring a foreign NaN into typed memory.
    pub(super) foreign_floats: bool,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    ty: StackType,
    origin: Option<Origin>,
}

/// The walk over one function.
struct Typer<'s, 'a, 'c> {
    scope: &'s Scope<'a, 'c>,
    instructions: &'s [PlacedInstruction],
    at: usize,
    /// First instruction of the block that is walked.
    block_start: usize,
    stack: Vec<Entry>,
    /// Bit of each local that is a reference and no parameter.
    reference_bits: Vec<Option<usize>>,
    /// Whether each local is the bound or step of a FOR loop.
    is_for_slot: Vec<bool>,
    assigned: Vec<u64>,
    draft: Draft,
}

/// Types the code of a function; fills the entry stacks of its blocks. `entries` counts against [`MAX_ANALYSIS_ENTRIES`].
pub(super) fn type_function(
    scope: &Scope<'_, '_>,
    instructions: &[PlacedInstruction],
    blocks: &mut [BasicBlock],
    entries: &mut usize,
) -> Check<Draft> {
    let mut typer = Typer::new(scope, instructions);
    let mut assigned_at: Vec<Option<Vec<u64>>> = vec![None; blocks.len()];
    if let Some(first) = assigned_at.first_mut() {
        *first = Some(typer.assigned.clone());
    }
    for number in 0..blocks.len() {
        let block = &blocks[number];
        // A block is reached before it is walked; its set is not needed any more afterwards.
        typer.assigned = assigned_at[number].take().unwrap_or_default();
        typer.block_start = block.start;
        typer.stack.clear();
        typer.stack.extend(block.entry_stack.iter().map(|ty| Entry { ty: *ty, origin: None }));
        for (inside, placed) in instructions[block.start..block.end].iter().enumerate() {
            typer.at = block.start + inside;
            typer.step(&placed.instruction).map_err(|broken| typer.error(broken))?;
        }
        let mut successors = block.successors.clone();
        successors.sort_unstable();
        successors.dedup();
        for successor in successors {
            typer
                .leave_to(number, successor, blocks, &mut assigned_at, entries)
                .map_err(|broken| typer.error(broken))?;
        }
    }
    Ok(typer.draft)
}

impl<'s, 'a, 'c> Typer<'s, 'a, 'c> {
    fn new(scope: &'s Scope<'a, 'c>, instructions: &'s [PlacedInstruction]) -> Self {
        let parameters = usize::from(scope.function.parameters);
        let mut bits: usize = 0;
        let reference_bits = scope.function.locals.iter().enumerate().map(|(index, local)| {
            let counts = index >= parameters && matches!(local, LocalType::Ref(_));
            counts.then(|| {
                bits += 1;
                bits - 1
            })
        });
        let reference_bits: Vec<_> = reference_bits.collect();
        let mut is_for_slot = vec![false; scope.function.locals.len()];
        for slot in scope.function.for_loops.iter().flat_map(|descriptor| [descriptor.bound, descriptor.step]) {
            is_for_slot[slot.index()] = true;
        }
        let assigned = vec![0; bits.div_ceil(64)];
        Typer {
            scope,
            instructions,
            at: 0,
            block_start: 0,
            stack: Vec::new(),
            reference_bits,
            is_for_slot,
            assigned,
            draft: Draft::default(),
        }
    }

    fn error(&self, (rule, message): Broken) -> VerifyError {
        let placed = self.instructions.get(self.at);
        let name = placed.map_or("", |placed| placed.instruction.mnemonic());
        let offset = placed.map_or(0, |placed| placed.offset);
        VerifyError::code(rule, self.scope.id, offset, format!("`{name}`: {message}"))
    }

    /// Brings the stack to a successor.
    fn leave_to(
        &self,
        from: usize,
        to: BlockId,
        blocks: &mut [BasicBlock],
        assigned_at: &mut [Option<Vec<u64>>],
        entries: &mut usize,
    ) -> Result<(), Broken> {
        let target = &mut blocks[to.index()];
        let is_first = target.predecessors.first().is_some_and(|first| first.index() == from) && to.index() > from;
        // Every edge counts: the same few blocks may have very many ways between them.
        *entries += self.stack.len();
        if *entries > MAX_ANALYSIS_ENTRIES {
            return Err((Rule::AnalysisSize, "the stacks at block starts are too many".into()));
        }
        if is_first {
            target.entry_stack = self.stack.iter().map(|entry| entry.ty).collect();
        } else if !target.entry_stack.iter().eq(self.stack.iter().map(|entry| &entry.ty)) {
            let message = format!(
                "it brings {} where another way brings {}",
                describe(self.stack.iter().map(|entry| entry.ty)),
                describe(target.entry_stack.iter().copied())
            );
            return Err((Rule::MergeStack, message));
        }
        if to.index() > from {
            match &mut assigned_at[to.index()] {
                Some(set) => set.iter_mut().zip(&self.assigned).for_each(|(set, own)| *set &= own),
                empty => *empty = Some(self.assigned.clone()),
            }
        }
        Ok(())
    }

    fn push(&mut self, ty: StackType) -> Result<(), Broken> {
        self.push_entry(Entry { ty, origin: None })
    }

    fn push_value(&mut self, ty: ValueType) -> Result<(), Broken> {
        self.push(StackType::Value(ty))
    }

    fn push_entry(&mut self, entry: Entry) -> Result<(), Broken> {
        let limit = usize::from(self.scope.container.parameters.max_stack_depth);
        if self.stack.len() >= limit {
            return Err((Rule::StackDepth, format!("the stack would grow beyond {limit} entries")));
        }
        self.stack.push(entry);
        // The limit is a u16.
        self.draft.max_stack = self.draft.max_stack.max(self.stack.len() as u16);
        Ok(())
    }

    fn pop(&mut self) -> Result<Entry, Broken> {
        self.stack.pop().ok_or_else(|| (Rule::StackUnderflow, "the stack is empty".into()))
    }

    fn pop_value(&mut self, wanted: ValueType) -> Result<(), Broken> {
        let found = self.pop()?.ty;
        if found == StackType::Value(wanted) {
            return Ok(());
        }
        Err((Rule::OperandType, format!("it takes {wanted}; the stack has {found}")))
    }

    fn pop_reference(&mut self) -> Result<(RefType, Option<Origin>), Broken> {
        let entry = self.pop()?;
        match entry.ty {
            StackType::Ref(reference) => Ok((reference, entry.origin)),
            StackType::Value(found) => Err((Rule::OperandType, format!("it takes a reference; the stack has {found}"))),
        }
    }

    fn pop_reference_to(&mut self, target: TypeId, write: bool) -> Result<(RefType, Option<Origin>), Broken> {
        let (found, origin) = self.pop_reference()?;
        if found.target != target {
            return Err((Rule::ReferenceTarget, format!("it works on type {target}; the stack has {found}")));
        }
        if write && !found.write {
            return Err((Rule::ReadOnlyReference, format!("the stack has {found}")));
        }
        Ok((found, origin))
    }

    fn pop_local(&mut self, wanted: LocalType) -> Result<Option<Origin>, Broken> {
        match wanted {
            LocalType::Scalar(storage) => self.pop_value(storage.value_type()).map(|()| None),
            LocalType::Ref(wanted) => {
                let (found, origin) = self.pop_reference()?;
                if found.fits(wanted) {
                    return Ok(origin);
                }
                Err((Rule::OperandType, format!("it takes {wanted}; the stack has {found}")))
            }
        }
    }

    fn touch(&mut self, kind: TouchKind) {
        self.draft.reaches_out |= matches!(kind, TouchKind::BytesWrite(BytePlace::Data | BytePlace::Block, ..));
        self.draft.touches.push(Touch { instruction: self.at, kind });
    }

    fn type_exists(&self, ty: TypeId) -> Result<&'c Type, Broken> {
        self.scope.types.get(ty).ok_or_else(|| (Rule::OperandIndex, format!("there is no type {ty}")))
    }

    /// Whether the instruction before this one, in the same block, pushed a constant that is not 0.
    fn follows_nonzero_constant(&self) -> bool {
        let before = self.at.checked_sub(1).filter(|before| *before >= self.block_start);
        match before.and_then(|at| self.instructions.get(at)).map(|placed| &placed.instruction) {
            Some(Instruction::ConstI32 { value }) => *value != 0,
            Some(Instruction::Const { id }) => {
                use crate::container::Constant::I64;
                !matches!(self.scope.container.constants.get(id.index()), None | Some(I64(0)))
            }
            _ => false,
        }
    }

    fn note_traps(&mut self, instruction: &Instruction) {
        let traps = match instruction {
            Instruction::Numeric(op) => op.trap().is_some() && !self.follows_nonzero_constant(),
            Instruction::ForEnter { .. } => !self.follows_nonzero_constant(),
            other => {
                let own = other.control_op().map_or(&[][..], ControlOp::traps);
                own.iter().any(|trap| *trap != TrapCode::CallDepth)
            }
        };
        self.draft.traps |= traps;
    }

    fn step(&mut self, instruction: &Instruction) -> Result<(), Broken> {
        self.note_traps(instruction);
        match instruction {
            Instruction::Nop {} => Ok(()),
            Instruction::ConstI32 { .. } => self.push_value(ValueType::I32),
            Instruction::Const { id } => {
                let constant = self.scope.container.constants.get(id.index());
                let constant = constant.ok_or_else(|| (Rule::OperandIndex, format!("there is no constant {id}")))?;
                self.push_value(constant.value_type())
            }
            Instruction::Drop {} => self.pop().map(|_| ()),
            Instruction::Dup {} => {
                let top = self.pop()?;
                self.push_entry(top)?;
                self.push_entry(top)
            }
            Instruction::Select {} => self.select(),
            Instruction::SlotLoad { place, index } => self.slot_load(*place, *index),
            Instruction::SlotStore { place, index } => self.slot_store(*place, *index),
            Instruction::Load { .. } | Instruction::Store { .. } => self.known_access(instruction),
            Instruction::LoadBit { place, offset, bit } => self.bit(*place, *offset, *bit, false),
            Instruction::StoreBit { place, offset, bit } => self.bit(*place, *offset, *bit, true),
            Instruction::Numeric(op) => {
                op.operands().iter().rev().try_for_each(|operand| self.pop_value(*operand))?;
                self.push_value(op.result())
            }
            Instruction::Helper(op, capacities) => self.helper(*op, *capacities),
            Instruction::CheckI32 { kind, lower, upper } => {
                self.check(ValueType::I32, *kind, (i64::from(*lower), i64::from(*upper)))
            }
            Instruction::CheckI64 { kind, lower, upper } => self.check(ValueType::I64, *kind, (*lower, *upper)),
            Instruction::Address { .. }
            | Instruction::RefLoad { .. }
            | Instruction::RefStore { .. }
            | Instruction::RefField { .. }
            | Instruction::RefIndex { .. }
            | Instruction::RefToInt {}
            | Instruction::RefCheck { .. }
            | Instruction::Copy { .. } => self.reference(instruction),
            Instruction::Jump { .. } => Ok(()),
            Instruction::JumpIf { .. } | Instruction::JumpUnless { .. } | Instruction::Switch { .. } => {
                self.pop_value(ValueType::I32)
            }
            Instruction::ForEnter { id, .. } => self.for_loop(*id, true),
            Instruction::ForNext { id, .. } => self.for_loop(*id, false),
            Instruction::Call { function } => self.call(*function),
            Instruction::CallVirtual { method } => self.call_virtual(*method),
            Instruction::Return {} => self.return_(),
        }
    }

    fn select(&mut self) -> Result<(), Broken> {
        self.pop_value(ValueType::I32)?;
        let (second, first) = (self.pop()?, self.pop()?);
        if first.ty != second.ty {
            return Err((Rule::OperandType, format!("it chooses between {} and {}", first.ty, second.ty)));
        }
        self.push(first.ty)
    }

    fn for_slot(&self, place: SlotPlace, index: SlotIndex) -> Result<(), Broken> {
        if place == SlotPlace::Local && self.is_for_slot.get(index.index()) == Some(&true) {
            return Err((Rule::ForSlots, format!("l {index} belongs to a FOR loop")));
        }
        Ok(())
    }

    fn slot_load(&mut self, place: SlotPlace, index: SlotIndex) -> Result<(), Broken> {
        let found = self.scope.slot(place, index)?;
        self.for_slot(place, index)?;
        if place == SlotPlace::Local
            && let Some(Some(bit)) = self.reference_bits.get(index.index())
            && self.assigned[bit / 64] & (1 << (bit % 64)) == 0
        {
            return Err((Rule::UnassignedReference, format!("l {index} is not assigned on every path to here")));
        }
        self.touch(TouchKind::SlotRead(place, index));
        self.push(found.stack_type())
    }

    fn slot_store(&mut self, place: SlotPlace, index: SlotIndex) -> Result<(), Broken> {
        let found = self.scope.slot(place, index)?;
        self.for_slot(place, index)?;
        self.pop_local(found)?;
        if place == SlotPlace::Local
            && let Some(Some(bit)) = self.reference_bits.get(index.index())
        {
            self.assigned[bit / 64] |= 1 << (bit % 64);
        }
        self.touch(TouchKind::SlotWrite(place, index));
        Ok(())
    }

    fn known_access(&mut self, instruction: &Instruction) -> Result<(), Broken> {
        match *instruction {
            Instruction::Load { place, storage, offset } => {
                self.scope.check_bytes(place, offset, Wanted::Scalar(storage), false)?;
                self.touch(TouchKind::BytesRead(place, offset));
                self.push_value(storage.value_type())
            }
            Instruction::Store { place, storage, offset } => {
                self.scope.check_bytes(place, offset, Wanted::Scalar(storage), true)?;
                self.touch(TouchKind::BytesWrite(place, offset, storage));
                self.pop_value(storage.value_type())
            }
            _ => Ok(()),
        }
    }

    fn bit(&mut self, place: BytePlace, offset: u32, bit: u8, write: bool) -> Result<(), Broken> {
        if !place.is_image() {
            return Err((Rule::BitPlace, format!("bit {bit} of {place} {offset}")));
        }
        if bit > 7 {
            return Err((Rule::ImageBounds, format!("a byte has no bit {bit}")));
        }
        self.scope.check_bytes(place, offset, Wanted::Scalar(Storage::U8), write)?;
        if write {
            self.touch(TouchKind::BytesRead(place, offset));
            self.touch(TouchKind::BytesWrite(place, offset, Storage::U8));
            return self.pop_value(ValueType::I32);
        }
        self.touch(TouchKind::BytesRead(place, offset));
        self.push_value(ValueType::I32)
    }

    fn helper(&mut self, op: HelperOp, capacities: [u16; MAX_CAPACITIES]) -> Result<(), Broken> {
        let mut strings = op.capacity_count();
        for operand in op.operands().iter().rev() {
            if let HelperOperand::Value(value) = operand {
                self.pop_value(*value)?;
                continue;
            }
            strings -= 1;
            let capacity = capacities[strings];
            let (found, origin) = self.pop_reference()?;
            match self.scope.types.get(found.target) {
                Some(own) if operand.string_type(capacity).as_ref() == Some(own) => {}
                Some(Type::String { capacity: own }) if !operand.is_wide() => {
                    let message = format!("it says STRING[{capacity}]; the stack has a STRING[{own}]");
                    return Err((Rule::StringOperand, message));
                }
                Some(Type::WideString { capacity: own }) if operand.is_wide() => {
                    let message = format!("it says WSTRING[{capacity}]; the stack has a WSTRING[{own}]");
                    return Err((Rule::StringOperand, message));
                }
                _ => {
                    let wanted = if operand.is_wide() { "WSTRING" } else { "STRING" };
                    return Err((Rule::ReferenceTarget, format!("it takes a {wanted}; the stack has {found}")));
                }
            }
            if operand.is_destination() {
                if !found.write {
                    return Err((Rule::ReadOnlyReference, format!("the stack has {found}")));
                }
                self.touch(TouchKind::ReferenceWrite { reference: found, origin });
            } else {
                self.touch(TouchKind::ReferenceRead(found));
            }
        }
        op.result().map_or(Ok(()), |result| self.push_value(result))
    }

    fn check(&mut self, width: ValueType, kind: IntegerType, (lower, upper): (i64, i64)) -> Result<(), Broken> {
        let ordered = if kind.is_signed() {
            lower <= upper
        } else if width == ValueType::I32 {
            lower as u32 <= upper as u32
        } else {
            lower as u64 <= upper as u64
        };
        if kind.value_type() != width || !ordered {
            return Err((Rule::CheckKind, format!("{lower} to {upper} in the order of {kind}")));
        }
        self.pop_value(width)?;
        self.push_value(width)
    }

    fn reference(&mut self, instruction: &Instruction) -> Result<(), Broken> {
        match *instruction {
            Instruction::Address { place, offset, target } => self.address(place, offset, target),
            Instruction::RefLoad { storage } => {
                let (found, _) = self.pop_scalar_reference(storage)?;
                self.touch(TouchKind::ReferenceRead(found));
                self.push_value(storage.value_type())
            }
            Instruction::RefStore { storage } => {
                self.pop_value(storage.value_type())?;
                let (reference, origin) = self.pop_scalar_reference(storage)?;
                if !reference.write {
                    return Err((Rule::ReadOnlyReference, format!("the stack has {reference}")));
                }
                self.touch(TouchKind::ReferenceWrite { reference, origin });
                Ok(())
            }
            Instruction::RefField { owner, field } => self.ref_field(owner, field),
            Instruction::RefIndex { array } => self.ref_index(array),
            Instruction::RefToInt {} => {
                self.pop_reference()?;
                self.push_value(ValueType::I64)
            }
            Instruction::RefCheck { target, write } => {
                self.type_exists(target)?;
                if self.scope.types.size(target) == 0 {
                    return Err((Rule::CheckTarget, format!("type {target} has no bytes")));
                }
                self.pop_value(ValueType::I64)?;
                self.draft.foreign_floats |= write;
                self.draft.reaches_out |= write;
                self.push(StackType::Ref(RefType { target, write, image: true }))
            }
            Instruction::Copy { target } => {
                self.type_exists(target)?;
                let (source, _) = self.pop_reference_to(target, false)?;
                let (reference, origin) = self.pop_reference_to(target, true)?;
                self.draft.foreign_floats |= source.image && self.scope.types.has_float(target);
                self.touch(TouchKind::ReferenceRead(source));
                self.touch(TouchKind::ReferenceWrite { reference, origin });
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn pop_scalar_reference(&mut self, storage: Storage) -> Result<(RefType, Option<Origin>), Broken> {
        let (found, origin) = self.pop_reference()?;
        match self.scope.types.get(found.target) {
            Some(Type::Scalar(own)) if *own == storage => Ok((found, origin)),
            _ => Err((Rule::ReferenceTarget, format!("it works on a scalar {storage}; the stack has {found}"))),
        }
    }

    fn address(&mut self, place: BytePlace, offset: u32, target: TypeId) -> Result<(), Broken> {
        self.type_exists(target)?;
        let write = self.scope.check_bytes(place, offset, Wanted::Type(target), false)?;
        self.draft.reaches_out |= write && matches!(place, BytePlace::Data | BytePlace::Block);
        let origin = Some(Origin { place, start: offset, size: self.scope.types.size(target) });
        self.push_entry(Entry { ty: StackType::Ref(RefType { target, write, image: place.is_image() }), origin })
    }

    fn ref_field(&mut self, owner: TypeId, number: u16) -> Result<(), Broken> {
        let (Type::Struct(record) | Type::Union(record) | Type::Block { record, .. }) = self.type_exists(owner)? else {
            return Err((Rule::ReferenceTarget, format!("type {owner} has no fields")));
        };
        let field = record.fields.get(usize::from(number));
        let field = field.ok_or_else(|| (Rule::OperandIndex, format!("type {owner} has no field {number}")))?;
        let (found, origin) = self.pop_reference_to(owner, false)?;
        let size = self.scope.types.size(field.ty);
        let origin = origin.map(|origin| Origin { start: origin.start.saturating_add(field.offset), size, ..origin });
        self.push_entry(Entry { ty: StackType::Ref(RefType { target: field.ty, ..found }), origin })
    }

    fn ref_index(&mut self, array: ArrayId) -> Result<(), Broken> {
        let descriptor = self.scope.container.types.arrays.get(array.index());
        let descriptor = descriptor.ok_or_else(|| (Rule::OperandIndex, format!("there is no array {array}")))?;
        for _ in &descriptor.dimensions {
            self.pop_value(ValueType::I32)?;
        }
        let (found, origin) = self.pop_reference()?;
        if self.scope.types.get(found.target) != Some(&Type::Array(array))
            && !self.are_characters(descriptor, found.target)
        {
            return Err((Rule::ReferenceTarget, format!("it works on array {array}; the stack has {found}")));
        }
        // Any element: the origin stays the whole array.
        self.push_entry(Entry { ty: StackType::Ref(RefType { target: descriptor.element, ..found }), origin })
    }

    /// Whether an array is the bytes or code units of a string of this type, so that it can stand for the string.
    fn are_characters(&self, array: &ArrayDescriptor, string: TypeId) -> bool {
        let (unit, capacity) = match self.scope.types.get(string) {
            Some(Type::String { capacity }) => (Storage::U8, *capacity),
            Some(Type::WideString { capacity }) => (Storage::U16, *capacity),
            _ => return false,
        };
        array.dimensions == [(1, i32::from(capacity))]
            && self.scope.types.get(array.element) == Some(&Type::Scalar(unit))
    }

    fn for_loop(&mut self, id: ForId, enters: bool) -> Result<(), Broken> {
        let descriptor = self.scope.function.for_loops.get(id.index());
        let descriptor = descriptor.ok_or_else(|| (Rule::OperandIndex, format!("there is no FOR descriptor {id}")))?;
        if enters {
            (0..3).try_for_each(|_| self.pop_value(descriptor.ty.value_type()))?;
        }
        match descriptor.control {
            ControlPlace::Slot(place, slot) => {
                self.touch(TouchKind::SlotRead(place, slot));
                self.touch(TouchKind::SlotWrite(place, slot));
            }
            ControlPlace::Bytes(place, offset) => {
                self.touch(TouchKind::BytesRead(place, offset));
                self.touch(TouchKind::BytesWrite(place, offset, descriptor.ty.storage()));
            }
        }
        Ok(())
    }

    fn call(&mut self, id: FunctionId) -> Result<(), Broken> {
        let callee = self.scope.container.functions.get(id.index());
        let callee = callee.ok_or_else(|| (Rule::OperandIndex, format!("there is no function {id}")))?;
        if matches!(callee.owner, Owner::Program(_)) && callee.owner != self.scope.function.owner {
            return Err((Rule::CallOwner, format!("function {id} runs only on instances of its own program type")));
        }
        let first = self.draft.arguments.len();
        for parameter in callee.parameter_types().iter().rev() {
            let origin = self.pop_local(*parameter)?;
            if matches!(parameter, LocalType::Ref(reference) if reference.write) {
                self.draft.arguments.push(origin);
            }
        }
        if let Some(this) = Scope::this(callee) {
            let (found, origin) = self.pop_reference()?;
            self.draft.arguments.push(origin);
            let exact = RefType { target: this.target, ..found };
            if !self.scope.types.derives_from(found.target, this.target) || !exact.fits(this) {
                return Err((Rule::OperandType, format!("`this` is {this}; the stack has {found}")));
            }
        }
        let count = self.draft.arguments.len() - first;
        self.touch(TouchKind::Call { function: id, first, count });
        callee.results.iter().try_for_each(|result| self.push_value(*result))
    }

    fn call_virtual(&mut self, method: MethodId) -> Result<(), Broken> {
        let signature = self.scope.container.types.methods.get(method.index());
        let signature = signature.ok_or_else(|| (Rule::OperandIndex, format!("there is no method {method}")))?;
        for parameter in signature.parameters.iter().rev() {
            self.pop_local(*parameter)?;
        }
        self.pop_value(ValueType::I64)?;
        self.draft.reaches_out = true;
        self.touch(TouchKind::CallVirtual(method));
        signature.results.iter().try_for_each(|result| self.push_value(*result))
    }

    fn return_(&mut self) -> Result<(), Broken> {
        let results = &self.scope.function.results;
        let fits = self.stack.len() == results.len()
            && self.stack.iter().zip(results).all(|(entry, result)| entry.ty == StackType::Value(*result));
        if fits {
            return Ok(());
        }
        let found = describe(self.stack.iter().map(|entry| entry.ty));
        let wanted = describe(results.iter().map(|result| StackType::Value(*result)));
        Err((Rule::ReturnStack, format!("the stack has {found}; the results are {wanted}")))
    }
}

/// A stack as text, cut short.
fn describe(types: impl ExactSizeIterator<Item = StackType>) -> String {
    const SHOWN: usize = 8;
    let more = if types.len() > SHOWN { ", …" } else { "" };
    let shown: Vec<String> = types.take(SHOWN).map(|ty| ty.to_string()).collect();
    format!("[{}{more}]", shown.join(", "))
}
