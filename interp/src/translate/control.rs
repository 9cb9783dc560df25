//! Branches, FOR loops and calls.

use khz_bytecode::container::{ControlPlace, Owner};
use khz_bytecode::ids::{ForId, FunctionId, Label, MethodId};
use khz_bytecode::instruction::Instruction;
use khz_bytecode::value::{IntegerType, SlotPlace, ValueType};
use khz_bytecode::verify::FunctionFacts;

use super::Translator;
use super::stack::{Base, Pending};
use crate::loops::known_start;
use crate::register_form::{Code, Control, ForAccess, Operation, branch_codes};

/// What the translation knows of a FOR loop's step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// Nothing, or several `for.enter` start it.
    Unknown,
    /// Its only `for.enter` has not been seen.
    Awaited,
    /// Its only `for.enter` gives it this value.
    Constant(i16),
}

/// What is known of each FOR loop of a function before its translation.
pub(super) fn awaited_steps(count: usize, facts: &FunctionFacts) -> Vec<Step> {
    let mut entered = vec![0_usize; count];
    for placed in &facts.instructions {
        if let Instruction::ForEnter { id, .. } = placed.instruction
            && let Some(times) = entered.get_mut(id.index())
        {
            *times += 1;
        }
    }
    entered.iter().map(|times| if *times == 1 { Step::Awaited } else { Step::Unknown }).collect()
}

impl Translator<'_> {
    pub(super) fn jump(&mut self, target: Label) {
        self.settle_all();
        self.jump_to(self.block_at(target));
    }

    /// `jump.if` (`when` true) or `jump.unless`, fused with the comparison before it.
    pub(super) fn branch(&mut self, target: Label, mut when: bool) {
        let block = self.block_at(target);
        let (entry, own) = self.pop();
        let computed = match entry.value {
            Pending::Register(register) if register == own => self.last_value(own),
            _ => None,
        };
        if let Some(last) = computed
            && let Some(tested) = self.masked_test(&last)
        {
            let code = if tested.1 == when { Code::JumpIfMasked } else { Code::JumpUnlessMasked };
            self.settle_all();
            return self.branch_to(Operation { code, x: 0, dst: 0, a: tested.0.a, b: tested.0.b }, block, 0);
        }
        if let Some(last) = computed
            && let Some((if_, unless)) = branch_codes(last.code)
        {
            self.remove_last();
            self.settle_all();
            let code = if when { if_ } else { unless };
            return self.branch_to(Operation { code, ..last }, block, 0);
        }
        let a = match computed {
            Some(last) if matches!(last.code, Code::I32Eqz | Code::I32Nez) => {
                self.remove_last();
                when ^= last.code == Code::I32Eqz;
                last.a
            }
            _ => self.in_register(&entry.value, own),
        };
        self.settle_all();
        let code = if when { Code::JumpIf } else { Code::JumpUnless };
        self.branch_to(Operation { code, x: 0, dst: 0, a, b: 0 }, block, 0);
    }

    /// For a condition that `last` computes as some bits of a register being set (true) or not (false): takes the operations back and
    /// gives the `and`.
    fn masked_test(&mut self, last: &Operation) -> Option<(Operation, bool)> {
        let is_set = match last.code {
            Code::i32_and => {
                self.remove_last();
                return Some((*last, true));
            }
            Code::i32_ne if last.b == 0 => true,
            Code::I32Nez => true,
            Code::i32_eq if last.b == 0 => false,
            Code::I32Eqz => false,
            _ => return None,
        };
        // The `and` stands right before, in a register of its own that only `last` reads.
        let before = self.value_before_last().filter(|and| and.code == Code::i32_and && and.dst == last.a)?;
        if last.a < self.registers.stack || last.a != last.dst {
            return None;
        }
        self.remove_last();
        self.remove_last();
        Some((before, is_set))
    }

    pub(super) fn switch(&mut self, targets: &[Label]) {
        let (entry, own) = self.pop();
        let a = self.in_register(&entry.value, own);
        self.settle_all();
        let start = self.program.jump_table.len();
        self.program.jump_table.resize(start + targets.len(), 0);
        for (index, target) in targets.iter().enumerate() {
            let block = self.block_at(*target);
            self.table_entry(start + index, block);
        }
        // At most MAX_SWITCH_TARGETS, and the verifier refuses an empty list.
        let count = targets.len() as u32;
        self.effect(Operation { code: Code::Switch, x: 0, dst: count, a, b: start as u32 });
    }

    /// Position of a new row for a FOR loop in the program's table.
    fn for_access(&mut self, id: ForId) -> ForAccess {
        let descriptor = self.function.for_loops[id.index()];
        let (base, offset) = match descriptor.control {
            ControlPlace::Slot(SlotPlace::Local, index) => {
                return self.for_access_at(id, Control::Register(self.local_register(index)));
            }
            ControlPlace::Slot(place, index) if let Some(held) = self.held.find(place, index) => {
                return self.for_access_at(id, Control::Register(held.register));
            }
            ControlPlace::Slot(place, index) => self.slot_address(place, index),
            ControlPlace::Bytes(place, offset) => {
                let (base, start) = self.base_of(place);
                (base, start + offset)
            }
        };
        let control = match base {
            Base::Image => Control::Image(offset),
            Base::Register(register) => Control::Based(register, offset),
        };
        self.for_access_at(id, control)
    }

    fn for_access_at(&self, id: ForId, control: Control) -> ForAccess {
        let descriptor = self.function.for_loops[id.index()];
        let (bound, step) = (self.local_register(descriptor.bound), self.local_register(descriptor.step));
        ForAccess { kind: descriptor.ty, control, bound, step }
    }

    pub(super) fn for_enter(&mut self, id: ForId, exit: Label) {
        let depth = self.stack.len();
        if self.steps[id.index()] == Step::Awaited {
            let step = match self.stack[depth - 1].value {
                Pending::Constant(bits) => Some(match self.function.for_loops[id.index()].ty.value_type() {
                    ValueType::I64 => bits as i64,
                    _ => i64::from(bits as i32),
                }),
                _ => None,
            };
            let step = step.filter(|step| *step != 0).and_then(|step| i16::try_from(step).ok());
            self.steps[id.index()] = step.map_or(Step::Unknown, Step::Constant);
        }
        let access = self.for_access(id);
        if self.for_enter_known(id, access, exit) {
            return;
        }
        self.settle_all();
        self.stack.truncate(depth - 3);
        let b = self.next_register();
        let a = self.program.for_loops.len() as u32;
        self.program.for_loops.push(access);
        let block = self.block_at(exit);
        self.branch_to(Operation { code: Code::ForEnter, x: 0, dst: 0, a, b }, block, 0);
    }

    /// `for.enter` with constant operands and a control variable in a register: constants, and a jump when no pass is due.
    fn for_enter_known(&mut self, id: ForId, access: ForAccess, exit: Label) -> bool {
        let Control::Register(control) = access.control else { return false };
        let [.., initial, bound, step] = self.stack.as_slice() else { return false };
        let (Pending::Constant(initial), Pending::Constant(bound), Pending::Constant(step)) =
            (initial.value, bound.value, step.value)
        else {
            return false;
        };
        let Some((start, is_due)) = known_start(access.kind, initial, bound, step) else { return false };
        self.stack.truncate(self.stack.len() - 3);
        self.settle_all();
        self.compute(&Pending::Constant(bound), access.bound);
        // Fast ends of passes carry the step; the loop's only one then is of that form.
        let header = self.header_loops.get(self.block + 1).copied().flatten();
        let is_carried = header.is_some_and(|l| l.for_loop == Some(id))
            && matches!(self.steps[id.index()], Step::Constant(_))
            && matches!(access.kind, IntegerType::I32 | IntegerType::I16);
        if !is_carried {
            self.compute(&Pending::Constant(step), access.step);
        }
        self.compute(&Pending::Constant(start), control);
        if !is_due {
            let block = self.block_at(exit);
            self.jump_to(block);
        }
        true
    }

    fn is_program_base(&self, register: u32) -> bool {
        matches!(self.function.owner, Owner::Program(_)) && register == self.registers.program_base
    }

    pub(super) fn for_next(&mut self, id: ForId, header: Label) {
        self.settle_all();
        let block = self.block_at(header);
        let header = self.header_loops[block];
        let skip = u32::from(header.is_some());
        let access = self.for_access(id);
        let is_for_loop = header.is_some_and(|l| l.for_loop == Some(id));
        let fast = match (access.kind, access.control) {
            (IntegerType::I32, Control::Register(a)) => Some((Code::ForNextI32, a)),
            (IntegerType::I16, Control::Register(a)) => Some((Code::ForNextI16, a)),
            // Only program slots are reached through that base.
            (IntegerType::I32, Control::Based(base, a)) if self.is_program_base(base) => {
                Some((Code::ForNextProgramI32, a))
            }
            (IntegerType::I16, Control::Based(base, a)) if self.is_program_base(base) => {
                Some((Code::ForNextProgramI16, a))
            }
            _ => None,
        };
        if let (true, Some((code, a)), Step::Constant(x)) = (is_for_loop, fast, self.steps[id.index()]) {
            let operation = Operation { code, x, dst: 0, a, b: access.bound };
            return self.branch_to(operation, block, skip);
        }
        let a = self.program.for_loops.len() as u32;
        self.program.for_loops.push(access);
        self.branch_to(Operation { code: Code::ForNext, x: 0, dst: 0, a, b: 0 }, block, skip);
    }

    /// Settles the arguments of a call and takes them from the stack: the register that its window starts at.
    fn arguments(&mut self, count: usize) -> u32 {
        self.settle_elements();
        let first = self.stack.len() - count;
        for depth in first..self.stack.len() {
            self.settle(depth);
        }
        self.stack.truncate(first);
        self.next_register()
    }

    pub(super) fn call(&mut self, callee: FunctionId) {
        let function = &self.verified.container().functions[callee.index()];
        let this = usize::from(matches!(function.owner, Owner::Block(_)));
        let results = function.results.len();
        let a = self.arguments(usize::from(function.parameters) + this);
        let (dst, b) = (self.facts.frame_bytes, u32::from(callee.0));
        self.effect(Operation { code: Code::Call, x: 0, dst, a, b });
        self.windows.call(a, callee);
        (0..results).for_each(|_| self.push_result());
    }

    pub(super) fn call_virtual(&mut self, method: MethodId) {
        let signature = &self.verified.container().types.methods[method.index()];
        let results = signature.results.len();
        let a = self.arguments(signature.parameters.len() + 1);
        let (dst, b) = (self.facts.frame_bytes, u32::from(method.0));
        self.effect(Operation { code: Code::CallVirtual, x: 0, dst, a, b });
        self.windows.call_virtual();
        (0..results).for_each(|_| self.push_result());
    }

    pub(super) fn return_(&mut self) {
        let results = self.function.results.len();
        // A result that stands unchecked does not exist: results are numbers.
        let operation = match results {
            0 => Operation { code: Code::Return, x: 0, dst: 0, a: 0, b: 0 },
            1 => {
                let (entry, own) = self.pop();
                let a = self.in_register(&entry.value, own);
                Operation { code: Code::ReturnOne, x: 0, dst: 0, a, b: 0 }
            }
            _ => {
                self.settle_all();
                let b = results as u32;
                Operation { code: Code::ReturnMany, x: 0, dst: 0, a: self.registers.stack, b }
            }
        };
        let held = self.program.held.last().copied().unwrap_or_default();
        if self.held.runs.iter().any(|run| run.is_written) {
            self.effect(Operation { code: Code::PutSlotsBack, x: 0, dst: 0, a: held.first, b: held.end });
        }
        self.effect(operation);
    }
}
