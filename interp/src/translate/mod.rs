//! Translation, once at load: from verified stack code to the register form.
//!
//! One pass over each function's blocks in code order. The operand stack exists only at translation time: an entry is *pending* (a
//! constant, a register, an address with a known offset, an array element not yet checked) until an operation uses it directly, or
//! until it has to stand in its own register: at the ends of blocks, so that every way into a block finds the stack in the same
//! registers, and before its source changes. See `stack.rs`.
//!
//! Slots in memory that a function uses much are registers from its start to its end: see `held.rs`.
//!
//! Traps stay precise. The bounds check of a pending element is the only pending thing that can trap; it is made before any
//! operation that can trap itself or that writes memory, so nobody can tell that it came late.

mod control;
mod emit;
mod held;
mod memory;
mod numeric;
mod size;
mod stack;

use khz_bytecode::container::{Function, Owner};
use khz_bytecode::ids::{FunctionId, SlotIndex};
use khz_bytecode::instruction::Instruction;
use khz_bytecode::value::{LocalType, SlotPlace, StackType, Storage};
use khz_bytecode::verify::{BasicBlock, FunctionFacts, Loop, Verified};
use khz_machine::image::ImageLayout;

use crate::register_form::{Code, FunctionEntry, HeldSlots, Operation, Program};
use control::Step;
use emit::{KnownBools, Patch};
use held::HeldRegisters;
use stack::{Entry, Pending};

/// All functions of a verified container in register form; with `fuel`, code that charges fuel.
pub(crate) fn translate(verified: &Verified, layout: &ImageLayout, fuel: bool) -> Program {
    let mut program = Program::default();
    let mut windows = size::CallWindows::default();
    for (index, function) in verified.container().functions.iter().enumerate() {
        // The verifier holds the number of functions to what an id can name.
        let facts = verified.function(FunctionId(index as u16));
        let mut translator = Translator::new(verified, layout, function, facts, &mut program, &mut windows);
        translator.fuel = fuel;
        translator.hold_slots();
        translator.function();
    }
    program.register_count = size::register_count(verified, &program, &windows);
    program
}

/// Which register holds what in one function's window.
#[derive(Debug, Clone, Copy, Default)]
struct FunctionRegisters {
    /// First `L` slot; `this` is before it.
    locals: u32,
    /// Start of the program instance's slots.
    program_base: u32,
    /// Start of the program instance's data block.
    block_base: u32,
    /// Start of the frame bytes.
    frame_base: u32,
    /// First slot that is held in a register.
    held: u32,
    /// Bottom of the operand stack.
    stack: u32,
    /// All registers of the window.
    count: u32,
}

impl FunctionRegisters {
    fn new(function: &Function) -> Self {
        let locals = u32::from(matches!(function.owner, Owner::Block(_)));
        let program_base = locals + function.locals.len() as u32;
        let block_base = program_base + u32::from(matches!(function.owner, Owner::Program(_)));
        let frame_base = block_base + u32::from(matches!(function.owner, Owner::Program(_)));
        let held = frame_base + u32::from(function.frame.is_some());
        FunctionRegisters { locals, program_base, block_base, frame_base, held, stack: held, count: held }
    }

    /// Puts the operand stack behind the held slots.
    fn with_stack(self, held_count: u32, function: &Function, facts: &FunctionFacts) -> Self {
        let stack = self.held + held_count;
        let count = stack + u32::from(facts.max_stack).max(function.results.len() as u32);
        FunctionRegisters { stack, count, ..self }
    }
}

/// For blocks that are loop headers their loop.
fn header_loops(facts: &FunctionFacts) -> Vec<Option<&Loop>> {
    let mut loops = vec![None; facts.blocks.len()];
    for l in &facts.loops {
        loops[l.header.index()] = Some(l);
    }
    loops
}

/// Translates one function.
struct Translator<'a> {
    verified: &'a Verified,
    layout: &'a ImageLayout,
    function: &'a Function,
    facts: &'a FunctionFacts,
    registers: FunctionRegisters,
    held: HeldRegisters,
    program: &'a mut Program,
    windows: &'a mut size::CallWindows,
    fuel: bool,
    /// The operand stack, bottom first.
    stack: Vec<Entry>,
    /// Register that the last operation wrote as its only effect, when no jump can come between: it may be redirected.
    last_result: Option<u32>,
    /// How many data operations stand behind the last operation that is none.
    data_behind: usize,
    /// Which operand stack registers hold 0 or 1.
    bools: KnownBools,
    /// Offset of the instruction that is being translated.
    origin: u32,
    /// The instruction behind it in the same block.
    next: Option<&'a Instruction>,
    /// Block that is being translated.
    block: usize,
    /// For blocks that are loop headers their loop.
    header_loops: Vec<Option<&'a Loop>>,
    /// What is known of each FOR loop's step.
    steps: Vec<Step>,
    /// Position of each block's first operation.
    block_starts: Vec<u32>,
    /// Jump targets to be filled in.
    patches: Vec<Patch>,
}

impl<'a> Translator<'a> {
    fn new(
        verified: &'a Verified,
        layout: &'a ImageLayout,
        function: &'a Function,
        facts: &'a FunctionFacts,
        program: &'a mut Program,
        windows: &'a mut size::CallWindows,
    ) -> Self {
        Translator {
            verified,
            layout,
            function,
            facts,
            registers: FunctionRegisters::new(function),
            held: HeldRegisters::default(),
            program,
            windows,
            fuel: false,
            stack: Vec::new(),
            last_result: None,
            data_behind: 0,
            bools: KnownBools::default(),
            origin: 0,
            next: None,
            block: 0,
            header_loops: header_loops(facts),
            steps: control::awaited_steps(function.for_loops.len(), facts),
            block_starts: vec![0; facts.blocks.len()],
            patches: Vec::new(),
        }
    }

    /// Chooses the slots that live in registers, and lays out the window.
    fn hold_slots(&mut self) {
        let storage_of = |place, index| self.memory_slot(place, index);
        let first = self.registers.held;
        self.held = HeldRegisters::choose(self.verified, self.layout, self.function, self.facts, storage_of, first);
        self.registers = self.registers.with_stack(self.held.count(), self.function, self.facts);
    }

    fn function(&mut self) {
        self.windows.begin_function();
        self.program.functions.push(FunctionEntry {
            start: self.program.operations.len() as u32,
            registers: self.registers.count,
            frame_bytes: self.facts.frame_bytes,
        });
        self.prologue();
        let facts = self.facts;
        for (index, block) in facts.blocks.iter().enumerate() {
            self.block = index;
            self.block(block);
        }
        self.apply_patches();
    }

    /// What happens at each call before the first instruction: limits, zeroes, parameters as stores would leave them, bases.
    fn prologue(&mut self) {
        let parameters = u32::from(self.function.parameters);
        let locals = self.function.locals.len() as u32;
        let first = self.registers.locals;
        let frame_bytes = self.facts.frame_bytes;
        let zeroed = locals.saturating_sub(parameters);
        self.effect(Operation { code: Code::Enter, x: 0, dst: first + parameters, a: zeroed, b: frame_bytes });
        if self.fuel {
            self.effect(Operation { code: Code::Charge, x: 0, dst: 0, a: self.facts.entry_fuel, b: 0 });
        }
        for (index, ty) in self.function.parameter_types().iter().enumerate() {
            let register = first + index as u32;
            if let LocalType::Scalar(storage) = ty
                && let Some(code) = numeric::wrap_code(*storage)
            {
                self.effect(Operation { code, x: 0, dst: register, a: register, b: 0 });
            }
        }
        if matches!(self.function.owner, Owner::Program(_)) {
            self.effect(Operation { code: Code::ProgramBase, x: 0, dst: self.registers.program_base, a: 0, b: 0 });
            self.effect(Operation { code: Code::BlockBase, x: 0, dst: self.registers.block_base, a: 0, b: 0 });
        }
        if self.function.frame.is_some() {
            self.effect(Operation { code: Code::FrameBase, x: 0, dst: self.registers.frame_base, a: 0, b: 0 });
        }
        self.bring_slots();
    }

    fn bring_slots(&mut self) {
        let first = self.program.slot_runs.len() as u32;
        self.program.slot_runs.extend_from_slice(&self.held.runs);
        let end = self.program.slot_runs.len() as u32;
        let brought_at = self.program.operations.len() as u32;
        self.program.held.push(HeldSlots { first, end, brought_at });
        if first != end {
            self.effect(Operation { code: Code::BringSlots, x: 0, dst: 0, a: first, b: end });
        }
    }

    fn block(&mut self, block: &'a BasicBlock) {
        self.block_starts[self.block] = self.program.operations.len() as u32;
        self.last_result = None;
        self.bools.forget();
        self.stack.clear();
        for (depth, ty) in block.entry_stack.iter().enumerate() {
            let image = matches!(ty, StackType::Ref(reference) if reference.image);
            let register = self.registers.stack + depth as u32;
            self.stack.push(Entry { value: Pending::Register(register), image });
        }
        let placed = &self.facts.instructions[block.start..block.end];
        self.origin = placed.first().map_or(0, |first| first.offset);
        if let Some(header) = self.header_loops[self.block] {
            self.effect(Operation { code: Code::Header, x: 0, dst: 0, a: 0, b: 0 });
            if self.fuel {
                self.effect(Operation { code: Code::Charge, x: 0, dst: 0, a: header.fuel, b: 0 });
            }
        }
        for (index, instruction) in placed.iter().enumerate() {
            self.origin = instruction.offset;
            self.next = placed.get(index + 1).map(|next| &next.instruction);
            self.instruction(&instruction.instruction);
        }
        if placed.last().is_some_and(|last| last.instruction.falls_through()) {
            self.settle_all();
            if let Some(behind) = block.successors.last()
                && behind.index() != self.block + 1
            {
                self.jump_to(behind.index());
            }
        }
    }

    fn instruction(&mut self, instruction: &'a Instruction) {
        match instruction {
            Instruction::Numeric(op) => self.numeric(*op),
            Instruction::Helper(op, capacities) => self.helper(*op, *capacities),
            Instruction::Nop {} => {}
            Instruction::ConstI32 { value } => self.push(Pending::Constant(u64::from(*value as u32))),
            Instruction::Const { id } => self.constant(*id),
            Instruction::Drop {} => self.drop_top(),
            Instruction::Dup {} => self.duplicate(),
            Instruction::Select {} => self.select(),
            Instruction::SlotLoad { place, index } => self.slot_load(*place, *index),
            Instruction::SlotStore { place, index } => self.slot_store(*place, *index),
            Instruction::Load { place, storage, offset } => self.load(*place, *storage, *offset),
            Instruction::Store { place, storage, offset } => self.store(*place, *storage, *offset),
            Instruction::LoadBit { place, offset, bit } => self.load_bit(*place, *offset, *bit),
            Instruction::StoreBit { place, offset, bit } => self.store_bit(*place, *offset, *bit),
            Instruction::Address { place, offset, .. } => self.address(*place, *offset),
            Instruction::RefLoad { storage } => self.ref_load(*storage),
            Instruction::RefStore { storage } => self.ref_store(*storage),
            Instruction::RefField { owner, field } => self.ref_field(*owner, *field),
            Instruction::RefIndex { array } => self.ref_index(*array),
            Instruction::RefToInt {} => self.ref_to_int(),
            Instruction::RefCheck { target, write } => self.ref_check(*target, *write),
            Instruction::Copy { target } => self.copy(*target),
            Instruction::CheckI32 { kind, lower, upper } => {
                self.check_range(*kind, i64::from(*lower), i64::from(*upper));
            }
            Instruction::CheckI64 { kind, lower, upper } => self.check_range(*kind, *lower, *upper),
            Instruction::Jump { target } => self.jump(*target),
            Instruction::JumpIf { target } => self.branch(*target, true),
            Instruction::JumpUnless { target } => self.branch(*target, false),
            Instruction::Switch { targets } => self.switch(targets),
            Instruction::ForEnter { id, exit } => self.for_enter(*id, *exit),
            Instruction::ForNext { id, header } => self.for_next(*id, *header),
            Instruction::Call { function } => self.call(*function),
            Instruction::CallVirtual { method } => self.call_virtual(*method),
            Instruction::Return {} => self.return_(),
        }
    }

    /// How a slot in memory lies, and for `L` slots nothing.
    fn memory_slot(&self, place: SlotPlace, index: SlotIndex) -> Option<Storage> {
        let types = &self.verified.container().types;
        match (place, self.function.owner) {
            (SlotPlace::Global, _) => types.slots.get(index.index()).copied(),
            (SlotPlace::Program, Owner::Program(program)) => {
                types.programs[program.index()].slots.get(index.index()).copied()
            }
            _ => None,
        }
    }
}
