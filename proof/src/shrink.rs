//! Making a differing container small: whatever can go while the difference stays, goes.
//!
//! Everything is tried in a fixed order, so the result depends on nothing but the container. Each change is kept only when the container still verifies
//! and [`Shrinker::differs`] still holds. The search ends when a whole round changes nothing, or when its tries are used up.

use khz_bytecode::container::{Constant, Container, ControlPlace, Function, Owner, Type};
use khz_bytecode::disassembler::disassemble;
use khz_bytecode::ids::{ForId, FunctionId, Label, SlotIndex};
use khz_bytecode::instruction::{Instruction, Reader};
use khz_bytecode::value::{SlotPlace, ValueType};
use khz_bytecode::verify::{Verified, verify};

use crate::bytecode::code::{encode, relabel};

/// What shrinking may cost, and what it keeps.
pub struct Shrinker<'d> {
    /// Whether a container still shows what is looked for.
    pub differs: &'d dyn Fn(&Verified) -> bool,
    /// Containers that may be tried.
    pub tries: usize,
}

/// A container made small.
#[derive(Debug)]
pub struct Shrunk {
    /// It, verified.
    pub verified: Verified,
    /// As assembly text.
    pub text: String,
    /// Instructions in all.
    pub instructions: usize,
}

impl Shrinker<'_> {
    /// Reduces a container that differs.
    pub fn shrink(mut self, verified: &Verified) -> Shrunk {
        let mut best = verified.clone();
        loop {
            let before = weight(best.container());
            self.drop_tables(&mut best);
            self.empty_functions(&mut best);
            self.drop_functions(&mut best);
            self.attempt(&mut best, drop_unused_constants);
            for function in 0..best.container().functions.len() {
                self.delete_ranges(&mut best, function);
                self.decide(&mut best, function);
                self.dissolve(&mut best, function);
                self.delete_pairs(&mut best, function);
                self.simplify(&mut best, function);
            }
            if weight(best.container()) >= before || self.tries == 0 {
                break;
            }
        }
        let text = disassemble(best.container());
        let instructions = best.facts().functions.iter().map(|function| function.instructions.len()).sum();
        Shrunk { verified: best, text, instructions }
    }

    /// Takes `change` over when the container still verifies and differs.
    fn attempt(&mut self, best: &mut Verified, change: impl FnOnce(&mut Container)) -> bool {
        if self.tries == 0 {
            return false;
        }
        let mut container = best.container().clone();
        change(&mut container);
        if container == *best.container() {
            return false;
        }
        let Ok(changed) = verify(container) else { return false };
        self.tries -= 1;
        if !(self.differs)(&changed) {
            return false;
        }
        *best = changed;
        true
    }

    /// Initial values, program instances, tasks, variables, start functions.
    fn drop_tables(&mut self, best: &mut Verified) {
        self.attempt(best, |container| container.types.init_image.clear());
        self.attempt(best, |container| container.types.retain.clear());
        self.attempt(best, |container| container.parameters.init_function = None);
        self.attempt(best, |container| container.parameters.startup_function = None);
        for run in (0..best.container().types.init_image.len()).rev() {
            self.attempt(best, |container| drop(container.types.init_image.remove(run)));
        }
        for number in (0..best.container().tasks.instances.len()).rev() {
            self.attempt(best, |container| drop_instance(container, number));
        }
        for number in (0..best.container().tasks.tasks.len()).rev() {
            self.attempt(best, |container| {
                container.tasks.tasks.remove(number);
                container.types.task_extensions.remove(number);
            });
        }
        let extents = best.facts().type_extents.clone();
        for number in (0..best.container().types.data.len()).rev() {
            self.attempt(best, |container| {
                let variable = container.types.data.remove(number);
                let size = extents.get(variable.ty.index()).map_or(0, |extent| extent.size);
                let inside = variable.offset..variable.offset + size;
                let rows = container.types.block_instances.len();
                container.types.block_instances.retain(|row| !inside.contains(&row.offset));
                // Only rows of globals, at the end, may go without the instances' positions moving.
                if container.types.block_instances.len() != rows {
                    container.types.init_image.retain(|run| run.region != khz_bytecode::container::Region::Data);
                }
            });
        }
        for number in (0..best.container().types.types.len()).rev() {
            self.attempt(best, |container| {
                if let Some(Type::Block { methods, .. }) = container.types.types.get_mut(number) {
                    methods.clear();
                }
            });
        }
        while self.attempt(best, |container| drop(container.types.types.pop())) {}
        while self.attempt(best, |container| drop(container.types.arrays.pop())) {}
        while self.attempt(best, |container| drop(container.types.methods.pop())) {}
        while self.attempt(best, |container| _ = container.constants.pop()) {}
        while self.attempt(best, |container| _ = container.types.slots.pop()) {}
    }

    /// Bodies that only return zeros.
    fn empty_functions(&mut self, best: &mut Verified) {
        for function in (0..best.container().functions.len()).rev() {
            self.attempt(best, |container| {
                let mut code = Vec::new();
                for result in container.functions[function].results.clone() {
                    code.extend(zero(container, result));
                }
                code.push(Instruction::Return {});
                let function = &mut container.functions[function];
                function.for_loops.clear();
                function.frame = None;
                function.code = encode(&mut code, |_| 0);
            });
        }
    }

    fn drop_functions(&mut self, best: &mut Verified) {
        for function in (0..best.container().functions.len()).rev() {
            self.attempt(best, |container| drop_function(container, function));
        }
    }

    /// Deletes runs of instructions, long ones first.
    fn delete_ranges(&mut self, best: &mut Verified, function: usize) {
        let mut size = instructions_of(&best.container().functions[function]).len() / 2;
        while size > 0 {
            let mut at = 0;
            while at + size <= instructions_of(&best.container().functions[function]).len() {
                let deleted = self.attempt(best, |container| {
                    change_code(&mut container.functions[function], |code| {
                        code.splice(at..at + size, std::iter::empty());
                        (at, size, 0)
                    });
                });
                at += usize::from(!deleted);
            }
            size = if size > 16 { size / 2 } else { size - 1 };
        }
    }

    /// Puts drops of the operands and zeros as results in the place of what has effects, and then deletes what pushed the operands. Undone where that
    /// leaves no less than before.
    fn dissolve(&mut self, best: &mut Verified, function: usize) {
        let before = best.clone();
        let mut has_changed = false;
        for at in (0..instructions_of(&best.container().functions[function]).len()).rev() {
            has_changed |= self.attempt(best, |container| {
                let instruction = instructions_of(&container.functions[function]).swap_remove(at);
                let Some((operands, results)) = stack_effect(container, &instruction) else { return };
                let mut others = vec![Instruction::Drop {}; operands];
                others.extend(results.into_iter().filter_map(|ty| zero(container, ty)));
                let come = others.len();
                change_code(&mut container.functions[function], |code| {
                    code.splice(at..=at, others);
                    (at, 1, come)
                });
            });
        }
        if has_changed {
            self.delete_pairs(best, function);
            if weight(best.container()) >= weight(before.container()) {
                *best = before;
            }
        }
    }

    /// Deletes what pushes a value and, further on, the `drop` that takes it away; what computes with values becomes drops first.
    fn delete_pairs(&mut self, best: &mut Verified, function: usize) {
        const FARTHEST: usize = 12;
        let mut at = 0;
        while let Some(instruction) = instructions_of(&best.container().functions[function]).get(at).cloned() {
            let spare = match instruction {
                Instruction::Select {} => 2,
                Instruction::Numeric(op) => op.operands().len() - 1,
                Instruction::RefField { .. } => 0,
                Instruction::RefIndex { array } => {
                    let array = best.container().types.arrays.get(array.index());
                    array.map_or(usize::MAX, |array| array.dimensions.len())
                }
                _ => usize::MAX,
            };
            if spare != usize::MAX {
                self.attempt(best, |container| {
                    change_code(&mut container.functions[function], |code| {
                        code.splice(at..=at, (0..spare).map(|_| Instruction::Drop {}));
                        (at, 1, spare)
                    });
                });
            }
            let code = instructions_of(&best.container().functions[function]);
            let drops = (at + 1..code.len().min(at + FARTHEST)).filter(|other| code[*other] == Instruction::Drop {});
            let deleted = drops.collect::<Vec<_>>().into_iter().any(|other| {
                self.attempt(best, |container| {
                    for gone in [other, at] {
                        change_code(&mut container.functions[function], |code| {
                            code.remove(gone);
                            (gone, 1, 0)
                        });
                    }
                })
            });
            at += usize::from(!deleted);
        }
    }

    /// Takes one way at a branch for good; what is then not reached goes.
    fn decide(&mut self, best: &mut Verified, function: usize) {
        let mut at = 0;
        while let Some(instruction) = instructions_of(&best.container().functions[function]).get(at).cloned() {
            let ways = match instruction {
                Instruction::JumpIf { .. } | Instruction::JumpUnless { .. } => 2,
                Instruction::Switch { targets } => targets.len(),
                _ => 0,
            };
            let decided = (0..ways).any(|way| {
                self.attempt(best, |container| {
                    let function = &mut container.functions[function];
                    take_way(function, at, way);
                    while drop_dead(function) {}
                })
            });
            at += usize::from(!decided);
        }
    }

    /// Puts simpler instructions in the place of single ones, or of a run by a constant.
    fn simplify(&mut self, best: &mut Verified, function: usize) {
        self.attempt(best, |container| drop_unused_locals(&mut container.functions[function]));
        for at in 0..instructions_of(&best.container().functions[function]).len() {
            for span in [1, 2, 3, 4] {
                for value in [0_u8, 1] {
                    let replaced =
                        self.attempt(best, |container| replace_by_constant(container, function, at, span, value));
                    if replaced {
                        break;
                    }
                }
            }
            let code = instructions_of(&best.container().functions[function]);
            let Some(Instruction::ConstI32 { value }) = code.get(at).cloned() else { continue };
            for smaller in [0, 1, value / 2] {
                if smaller.unsigned_abs() < value.unsigned_abs() {
                    self.attempt(best, |container| {
                        change_code(&mut container.functions[function], |code| {
                            code[at] = Instruction::ConstI32 { value: smaller };
                            (0, 0, 0)
                        });
                    });
                }
            }
        }
    }
}

/// What shrinking makes smaller.
fn weight(container: &Container) -> usize {
    let code: usize = container.functions.iter().map(|function| function.code.len() + function.locals.len() + 4).sum();
    let types = &container.types;
    code + types.init_image.len()
        + types.data.len()
        + types.types.len()
        + container.tasks.tasks.len()
        + container.tasks.instances.len()
}

/// The instructions of a function, as far as they can be read.
pub(crate) fn instructions_of(function: &Function) -> Vec<Instruction> {
    let mut reader = Reader::new(&function.code);
    let mut found = Vec::new();
    while !reader.is_at_end() {
        let Ok(instruction) = Instruction::decode(&mut reader) else { break };
        found.push(instruction);
    }
    found
}

/// Changes the code of a function; `change` says where, how many instructions went and how many came. FOR descriptors that lost their `for.enter` go.
pub(crate) fn change_code(
    function: &mut Function,
    change: impl FnOnce(&mut Vec<Instruction>) -> (usize, usize, usize),
) {
    let mut code = instructions_of(function);
    let mut offsets = Vec::new();
    let mut end = 0;
    for instruction in &code {
        offsets.push(end);
        let mut bytes = Vec::new();
        instruction.encode(&mut bytes);
        end += bytes.len() as u32;
    }
    for instruction in &mut code {
        relabel(instruction, |label| Label(offsets.partition_point(|offset| *offset < label.0) as u32));
    }
    let (at, gone, come) = change(&mut code);
    let moved = |position: usize| match position {
        _ if position <= at => position,
        _ if position < at + gone => at,
        _ => position - gone + come,
    };
    let count = code.len();
    for instruction in &mut code {
        relabel(instruction, |label| Label(moved(label.0 as usize).min(count) as u32));
    }
    let entered =
        |id: usize| code.iter().any(|i| matches!(i, Instruction::ForEnter { id: found, .. } if found.index() == id));
    let kept: Vec<usize> = (0..function.for_loops.len()).filter(|id| entered(*id)).collect();
    function.for_loops = kept.iter().map(|id| function.for_loops[*id]).collect();
    for instruction in &mut code {
        if let Instruction::ForEnter { id, .. } | Instruction::ForNext { id, .. } = instruction {
            let position = kept.iter().position(|kept| *kept == id.index());
            *id = ForId(position.unwrap_or(usize::from(u16::MAX)) as u16);
        }
    }
    function.code = encode(&mut code, |label| label.0 as usize);
}

/// Replaces a branch by a jump to target number `way`, or, for one beyond the targets, by going on behind it.
fn take_way(function: &mut Function, at: usize, way: usize) {
    change_code(function, |code| {
        let jump = code[at].targets().get(way).map(|target| Instruction::Jump { target: *target });
        let come = 1 + usize::from(jump.is_some());
        code.splice(at..=at, std::iter::once(Instruction::Drop {}).chain(jump));
        (at, 1, come)
    });
}

/// Removes one run of instructions that nothing leads to, or a jump to the next instruction; false when there is none.
fn drop_dead(function: &mut Function) -> bool {
    let mut dropped = false;
    change_code(function, |code| {
        let mut reached = vec![false; code.len()];
        let mut open = vec![0];
        while let Some(at) = open.pop() {
            let Some(instruction) = code.get(at).filter(|_| !std::mem::replace(&mut reached[at], true)) else {
                continue;
            };
            open.extend(instruction.targets().iter().map(|target| target.0 as usize));
            open.extend(Some(at + 1).filter(|next| instruction.falls_through() && *next < code.len()));
        }
        let is_idle = |at: usize| matches!(code[at], Instruction::Jump { target } if target.0 as usize == at + 1);
        let Some(at) = (0..code.len()).find(|at| !reached[*at] || is_idle(*at)) else { return (0, 0, 0) };
        let end = (at + 1..code.len()).find(|end| reached[*end]).unwrap_or(code.len());
        let count = if reached[at] { 1 } else { end - at };
        code.drain(at..at + count);
        dropped = true;
        (at, count, 0)
    });
    dropped
}

fn zero(container: &mut Container, ty: ValueType) -> Option<Instruction> {
    constant_of(container, ty, 0)
}

/// An instruction that pushes 0 or 1 of a type.
fn constant_of(container: &mut Container, ty: ValueType, value: u8) -> Option<Instruction> {
    let constant = match ty {
        ValueType::I32 => return Some(Instruction::ConstI32 { value: i32::from(value) }),
        ValueType::I64 => Constant::I64(i64::from(value)),
        ValueType::F32 => Constant::F32(f32::from(value).to_bits()),
        ValueType::F64 => Constant::F64(f64::from(value).to_bits()),
    };
    let position = container.constants.iter().position(|known| *known == constant).unwrap_or_else(|| {
        container.constants.push(constant);
        container.constants.len() - 1
    });
    khz_bytecode::ids::ConstantId::from_index(position).map(|id| Instruction::Const { id })
}

/// How many entries of the stack an instruction with effects takes, and the values that it leaves.
fn stack_effect(container: &Container, instruction: &Instruction) -> Option<(usize, Vec<ValueType>)> {
    Some(match instruction {
        Instruction::Call { function } => {
            let callee = container.functions.get(function.index())?;
            let this = usize::from(matches!(callee.owner, Owner::Block(_)));
            (callee.parameter_types().len() + this, callee.results.clone())
        }
        Instruction::CallVirtual { method } => {
            let signature = container.types.methods.get(method.index())?;
            (signature.parameters.len() + 1, signature.results.clone())
        }
        Instruction::Helper(op, _) => (op.operands().len(), op.result().into_iter().collect()),
        Instruction::RefLoad { storage } => (1, vec![storage.value_type()]),
        Instruction::RefStore { .. } | Instruction::Copy { .. } => (2, Vec::new()),
        Instruction::SlotStore { .. } | Instruction::Store { .. } | Instruction::StoreBit { .. } => (1, Vec::new()),
        _ => return None,
    })
}

/// Puts a constant of a type that fits in the place of `span` instructions.
fn replace_by_constant(container: &mut Container, function: usize, at: usize, span: usize, value: u8) {
    let code = instructions_of(&container.functions[function]);
    let Some(last) = at.checked_add(span).and_then(|end| code.get(at..end)).and_then(<[_]>::last) else { return };
    let ty = match last {
        Instruction::Numeric(op) => op.result(),
        Instruction::Load { storage, .. } | Instruction::RefLoad { storage } => storage.value_type(),
        Instruction::LoadBit { .. } => ValueType::I32,
        Instruction::RefToInt {} => ValueType::I64,
        Instruction::SlotLoad { place, index } => match slot_type(container, function, *place, *index) {
            Some(ty) => ty,
            None => return,
        },
        Instruction::Helper(op, _) => match op.result() {
            Some(ty) => ty,
            None => return,
        },
        _ => return,
    };
    let Some(constant) = constant_of(container, ty, value) else { return };
    change_code(&mut container.functions[function], |code| {
        code.splice(at..at + span, [constant]);
        (at, span, 1)
    });
}

fn slot_type(container: &Container, function: usize, place: SlotPlace, index: SlotIndex) -> Option<ValueType> {
    use khz_bytecode::value::LocalType;
    let function = &container.functions[function];
    let storage = match (place, function.owner) {
        (SlotPlace::Global, _) => *container.types.slots.get(index.index())?,
        (SlotPlace::Program, Owner::Program(program)) => {
            *container.types.programs.get(program.index())?.slots.get(index.index())?
        }
        (SlotPlace::Local, _) => match function.locals.get(index.index())? {
            LocalType::Scalar(storage) => *storage,
            LocalType::Ref(_) => return None,
        },
        _ => return None,
    };
    Some(storage.value_type())
}

/// Removes a program instance and its rows of the function block instance table.
fn drop_instance(container: &mut Container, number: usize) {
    let gone = container.tasks.instances.remove(number);
    let (first, count) = (usize::from(gone.block_offset), usize::from(gone.block_count));
    if count > 0 && first + count <= container.types.block_instances.len() {
        let block = container.types.block_instances[first].offset;
        container.types.block_instances.drain(first..first + count);
        container.types.data.retain(|variable| variable.offset != block);
        let end = container
            .types
            .data
            .iter()
            .map(|variable| variable.offset)
            .find(|offset| *offset > block)
            .unwrap_or(u32::MAX);
        container
            .types
            .init_image
            .retain(|run| run.region != khz_bytecode::container::Region::Data || !(block..end).contains(&run.offset));
    }
    for instance in container.tasks.instances.iter_mut().filter(|instance| instance.block_offset > gone.block_offset) {
        instance.block_offset = instance.block_offset.saturating_sub(gone.block_count);
    }
}

/// Removes a function that nothing names.
fn drop_function(container: &mut Container, number: usize) {
    let is_named = |id: FunctionId| id.index() == number;
    let by_code = |function: &Function| {
        instructions_of(function).iter().any(|i| matches!(i, Instruction::Call { function } if is_named(*function)))
    };
    let by_type = |ty: &Type| matches!(ty, Type::Block { methods, .. } if methods.iter().any(|(_, function)| is_named(*function)));
    let starts = [container.parameters.init_function, container.parameters.startup_function];
    if container.functions.iter().any(by_code)
        || container.types.types.iter().any(by_type)
        || starts.into_iter().flatten().any(is_named)
        || container.tasks.instances.iter().any(|instance| is_named(instance.entry))
    {
        return;
    }
    let lower = |id: &mut FunctionId| id.0 -= u16::from(id.index() > number);
    container.functions.remove(number);
    for function in &mut container.functions {
        let mut code = instructions_of(function);
        for instruction in &mut code {
            if let Instruction::Call { function } = instruction {
                lower(function);
            }
        }
        // No instruction changed its length, so labels stay right.
        function.code.clear();
        code.iter().for_each(|instruction| instruction.encode(&mut function.code));
    }
    for ty in &mut container.types.types {
        if let Type::Block { methods, .. } = ty {
            methods.iter_mut().for_each(|(_, function)| lower(function));
        }
    }
    container.parameters.init_function.iter_mut().for_each(lower);
    container.parameters.startup_function.iter_mut().for_each(lower);
    container.tasks.instances.iter_mut().for_each(|instance| lower(&mut instance.entry));
}

/// Removes constants that no code names.
fn drop_unused_constants(container: &mut Container) {
    let mut codes: Vec<Vec<Instruction>> = container.functions.iter().map(instructions_of).collect();
    let mut used = std::collections::BTreeSet::new();
    for instruction in codes.iter().flatten() {
        if let Instruction::Const { id } = instruction {
            used.insert(*id);
        }
    }
    for instruction in codes.iter_mut().flatten() {
        if let Instruction::Const { id } = instruction {
            id.0 = used.iter().take_while(|other| *other < id).count() as u16;
        }
    }
    container.constants = used.iter().filter_map(|id| container.constants.get(id.index()).copied()).collect();
    for (function, code) in container.functions.iter_mut().zip(&codes) {
        function.code.clear();
        code.iter().for_each(|instruction| instruction.encode(&mut function.code));
    }
}

/// Removes locals behind the parameters that nothing names.
fn drop_unused_locals(function: &mut Function) {
    let mut code = instructions_of(function);
    let mut used = vec![false; function.locals.len()];
    used.iter_mut().take(usize::from(function.parameters)).for_each(|used| *used = true);
    let mut mark = |index: SlotIndex| {
        if let Some(used) = used.get_mut(index.index()) {
            *used = true;
        }
    };
    for instruction in &code {
        if let Instruction::SlotLoad { place: SlotPlace::Local, index }
        | Instruction::SlotStore { place: SlotPlace::Local, index } = instruction
        {
            mark(*index);
        }
    }
    for descriptor in &function.for_loops {
        mark(descriptor.bound);
        mark(descriptor.step);
        if let ControlPlace::Slot(SlotPlace::Local, index) = descriptor.control {
            mark(index);
        }
    }
    let position =
        |index: &mut SlotIndex| index.0 = used.iter().take(index.index()).filter(|used| **used).count() as u16;
    for instruction in &mut code {
        if let Instruction::SlotLoad { place: SlotPlace::Local, index }
        | Instruction::SlotStore { place: SlotPlace::Local, index } = instruction
        {
            position(index);
        }
    }
    for descriptor in &mut function.for_loops {
        position(&mut descriptor.bound);
        position(&mut descriptor.step);
        if let ControlPlace::Slot(SlotPlace::Local, index) = &mut descriptor.control {
            position(index);
        }
    }
    let mut kept = used.iter();
    function.locals.retain(|_| kept.next().copied().unwrap_or(true));
    function.code.clear();
    code.iter().for_each(|instruction| instruction.encode(&mut function.code));
}
