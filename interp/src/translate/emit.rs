//! Appending operations, and the jump targets that are known only at the end of a function.

use khz_bytecode::ids::Label;

use khz_bytecode::instruction::Instruction;
use khz_bytecode::value::{LocalType, Storage};
use khz_bytecode::verify::BasicBlock;

use super::Translator;
use super::numeric::is_wrapped;
use crate::register_form::{Code, Operation, sum_code};

/// A jump target to be filled in when all blocks have their places.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patch {
    /// What holds the target.
    pub at: PatchPlace,
    /// Block to go to.
    pub block: usize,
    /// 1 to go behind the block's header operation, because the jump does its check; else 0.
    pub skip: u32,
}

/// What holds a jump target.
#[derive(Debug, Clone, Copy)]
pub(super) enum PatchPlace {
    /// `dst` of an operation.
    Operation(usize),
    /// An entry of the jump table.
    Table(usize),
}

/// Operand stack registers that are known to hold 0 or 1: forgotten at the start of each block.
#[derive(Debug, Clone, Default)]
pub(super) struct KnownBools {
    /// By depth: the age in which it was found out.
    found: Vec<u32>,
    age: u32,
}

impl KnownBools {
    /// Nothing is known any more.
    pub(super) fn forget(&mut self) {
        self.age += 1;
    }

    fn set(&mut self, depth: usize, is_bool: bool) {
        if self.found.len() <= depth {
            self.found.resize(depth + 1, 0);
        }
        self.found[depth] = if is_bool { self.age } else { 0 };
    }

    fn get(&self, depth: usize) -> bool {
        self.age > 0 && self.found.get(depth) == Some(&self.age)
    }
}

impl Translator<'_> {
    /// Whether a register holds 0 or 1.
    pub(super) fn is_bool(&self, register: u32) -> bool {
        if let Some(depth) = register.checked_sub(self.registers.stack) {
            return self.bools.get(depth as usize);
        }
        if let Some(storage) = self.held.storage(register) {
            return storage == Storage::Bool;
        }
        let local = register.checked_sub(self.registers.locals).and_then(|l| self.function.locals.get(l as usize));
        local == Some(&LocalType::Scalar(Storage::Bool))
    }

    /// Whether an operation's result is 0 or 1.
    pub(super) fn gives_bool(&self, operation: &Operation) -> bool {
        match operation.code {
            Code::I32And => self.is_bool(operation.a) || self.is_bool(operation.b),
            Code::AndNot | Code::Move => self.is_bool(operation.a),
            Code::OrAnd => self.is_bool(operation.x as u32) && (self.is_bool(operation.a) || self.is_bool(operation.b)),
            Code::OrAndNot => self.is_bool(operation.x as u32) && self.is_bool(operation.a),
            Code::I32Or | Code::I32Xor => self.is_bool(operation.a) && self.is_bool(operation.b),
            Code::OrNot => self.is_bool(operation.a),
            Code::i32_and => operation.b <= 1,
            Code::i32_xor => operation.b <= 1 && self.is_bool(operation.a),
            Code::Constant => operation.a <= 1 && operation.b == 0,
            code => is_wrapped(code, Storage::Bool),
        }
    }

    fn append(&mut self, operation: Operation, origin: u32) {
        self.program.operations.push(operation);
        self.program.origins.push(origin);
        self.data_behind = 0;
    }

    /// Appends an operation whose only effect is to write register `dst` from other operands: a later one may redirect it.
    pub(super) fn value(&mut self, operation: Operation) {
        self.value_from(operation, self.origin);
    }

    /// As [`Self::value`], for a trap that belongs to the instruction at `origin`.
    pub(super) fn value_from(&mut self, operation: Operation, origin: u32) {
        if let Some(depth) = operation.dst.checked_sub(self.registers.stack) {
            let is_bool = self.gives_bool(&operation);
            self.bools.set(depth as usize, is_bool);
        }
        self.append(operation, origin);
        self.last_result = Some(operation.dst);
    }

    /// Appends the data that the operation just appended fetches.
    pub(super) fn data(&mut self, data: &[Operation], origin: u32) {
        data.iter().for_each(|data| self.append(*data, origin));
        self.data_behind = data.len();
    }

    /// Appends any other operation.
    pub(super) fn effect(&mut self, operation: Operation) {
        self.effect_from(operation, self.origin);
    }

    /// As [`Self::effect`], for a trap that belongs to the instruction at `origin`.
    pub(super) fn effect_from(&mut self, operation: Operation, origin: u32) {
        // What writes a register of the operand stack among other effects.
        if matches!(operation.code, Code::SelectUnless | Code::Helper | Code::Call | Code::CallVirtual) {
            self.bools.forget();
        }
        self.append(operation, origin);
        self.last_result = None;
    }

    /// The last operation, when it just computed `register` and nothing else.
    pub(super) fn last_value(&self, register: u32) -> Option<Operation> {
        self.last_result.filter(|last| *last == register)?;
        self.last_position().map(|at| self.program.operations[at])
    }

    /// The operation before the last one, when that one just computed its result from it and both stand in this block.
    pub(super) fn value_before_last(&self) -> Option<Operation> {
        let before = self.last_position()?.checked_sub(1).filter(|at| *at >= self.block_starts[self.block] as usize)?;
        self.program.operations.get(before).copied()
    }

    /// Position of the last operation that is no data.
    fn last_position(&self) -> Option<usize> {
        self.program.operations.len().checked_sub(1 + self.data_behind)
    }

    /// Puts an operation in the place of the last one; the data behind it stays.
    pub(super) fn replace_last(&mut self, operation: Operation) {
        if let Some(at) = self.last_position() {
            self.program.operations[at] = operation;
            self.redirect_last(operation.dst);
        }
    }

    /// When the last operation adds to `register` the product that the one before computes: lets that one do both.
    fn sum_into(&mut self, register: u32) -> bool {
        let Some(add) = self.last_position().map(|at| (at, self.program.operations[at])) else { return false };
        let (at, add) = add;
        let start = self.block_starts[self.block] as usize;
        let before = self.program.operations[start..at].iter().rposition(|o| o.code != Code::Data).map(|b| start + b);
        let Some(before) = before.filter(|_| self.data_behind == 0) else { return false };
        let product = self.program.operations[before];
        let Some(code) = sum_code(add.code, product.code) else { return false };
        // A `dup` may have left the product on the stack as well.
        let is_product = product.dst >= self.registers.stack
            && !self.stack.iter().any(|entry| entry.value.reads(product.dst))
            && [(register, product.dst), (product.dst, register)].contains(&(add.a, add.b));
        if is_product {
            self.remove_last();
            self.program.operations[before] = Operation { code, dst: register, ..product };
        }
        is_product
    }

    /// Redirects the last operation to write `register` instead.
    pub(super) fn redirect_last(&mut self, register: u32) {
        if register < self.registers.stack && self.sum_into(register) {
            return;
        }
        if let Some(at) = self.last_position() {
            self.program.operations[at].dst = register;
            if let Some(depth) = register.checked_sub(self.registers.stack) {
                let last = self.program.operations[at];
                let is_bool = self.gives_bool(&last);
                self.bools.set(depth as usize, is_bool);
            }
            self.last_result = Some(register);
        }
    }

    /// Takes the last operation back.
    pub(super) fn remove_last(&mut self) {
        if let Some(at) = self.last_position() {
            self.program.operations.truncate(at);
            self.program.origins.truncate(at);
        }
        self.data_behind = 0;
        self.last_result = None;
    }

    /// Position of a 64-bit operand in the constants.
    pub(super) fn constant_number(&mut self, bits: u64) -> u32 {
        // Constants of one function are few; looking at the last ones finds most repetitions.
        let constants = &mut self.program.constants;
        let recent = constants.len().saturating_sub(32);
        if let Some(at) = constants[recent..].iter().position(|constant| *constant == bits) {
            return (recent + at) as u32;
        }
        constants.push(bits);
        (constants.len() - 1) as u32
    }

    /// The block that starts at a label.
    pub(super) fn block_at(&self, label: Label) -> usize {
        let starts = &self.facts.blocks;
        let found = starts.binary_search_by_key(&label.0, |block| {
            self.facts.instructions.get(block.start).map_or(u32::MAX, |first| first.offset)
        });
        // The verifier proved that each target starts a block.
        found.unwrap_or_else(|before| before.saturating_sub(1))
    }

    /// Appends a branch to a block. `skip`: see [`Patch::skip`].
    pub(super) fn branch_to(&mut self, operation: Operation, block: usize, skip: u32) {
        let at = PatchPlace::Operation(self.program.operations.len());
        self.patches.push(Patch { at, block, skip });
        self.effect(operation);
    }

    /// Appends a jump to a block, unless it is the next one.
    pub(super) fn jump_to(&mut self, block: usize) {
        if block == self.block + 1 {
            return;
        }
        if self.end_pass_instead(block) {
            return;
        }
        // A jump back goes to a loop header: it does the header's check itself.
        let back = block <= self.block && self.header_loops[block].is_some();
        let code = if back { Code::Repeat } else { Code::Jump };
        self.branch_to(Operation { code, x: 0, dst: 0, a: 0, b: 0 }, block, u32::from(back));
    }

    /// A jump to a block that does nothing but end a pass of a FOR loop: ends it here.
    fn end_pass_instead(&mut self, block: usize) -> bool {
        let Some(BasicBlock { start, end, .. }) = self.facts.blocks.get(block) else { return false };
        let Some([only]) = self.facts.instructions.get(*start..*end) else { return false };
        let Instruction::ForNext { id, header } = only.instruction else { return false };
        if self.header_loops[block].is_some() || block <= self.block {
            return false;
        }
        let own = std::mem::replace(&mut self.origin, only.offset);
        self.for_next(id, header);
        self.origin = own;
        let at = PatchPlace::Operation(self.program.operations.len());
        self.patches.push(Patch { at, block: block + 1, skip: 0 });
        self.effect(Operation { code: Code::Jump, x: 0, dst: 0, a: 0, b: 0 });
        true
    }

    /// Lets jumps go straight to where they end up. The ends of passes stay: their target names the header whose limits they check.
    fn shorten_jumps(&mut self, patches: &[Patch]) {
        const MOST_HOPS: usize = 8;
        for patch in patches {
            let PatchPlace::Operation(at) = patch.at else { continue };
            let operation = self.program.operations[at];
            if patch.skip != 0 || matches!(operation.code, Code::Repeat | Code::ForNext) {
                continue;
            }
            let mut target = operation.dst;
            for _ in 0..MOST_HOPS {
                match self.program.operations[target as usize] {
                    Operation { code: Code::Jump, dst, .. } => target = dst,
                    _ => break,
                }
            }
            let end = self.program.operations[target as usize];
            if operation.code == Code::Jump && matches!(end.code, Code::Repeat | Code::Return | Code::ReturnOne) {
                self.program.operations[at] = end;
                self.program.origins[at] = self.program.origins[target as usize];
            } else {
                self.program.operations[at].dst = target;
            }
        }
    }

    /// Fills in all jump targets of the function.
    pub(super) fn apply_patches(&mut self) {
        let patches = std::mem::take(&mut self.patches);
        for patch in &patches {
            let target = self.block_starts[patch.block] + patch.skip;
            match patch.at {
                PatchPlace::Operation(at) => self.program.operations[at].dst = target,
                PatchPlace::Table(at) => self.program.jump_table[at] = target,
            }
        }
        self.shorten_jumps(&patches);
    }

    /// Notes that jump table entry `at` goes to a block.
    pub(super) fn table_entry(&mut self, at: usize, block: usize) {
        self.patches.push(Patch { at: PatchPlace::Table(at), block, skip: 0 });
    }
}
