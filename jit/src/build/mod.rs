//! From verified bytecode to the mid-level form: one pass over a function's instructions with a stack of what each entry holds.
//!
//! References stay symbolic on that stack (base, displacement, index × stride) until memory is accessed through them, so that an array element
//! becomes one address. Entries that cross a merge become block parameters.

mod control;
mod memory;
mod numeric;

use khz_bytecode::container::{self, Owner};
use khz_bytecode::ids::{BlockId, FunctionId, Label};
use khz_bytecode::instruction::{Instruction as Code, NumericOp};
use khz_bytecode::value::{LocalType, StackType, Storage};
use khz_bytecode::verify::{FunctionFacts, PlacedInstruction, Verified};
use khz_machine::image::ImageLayout;

use crate::mir::{
    Address, Base, Block, BlockData, Const, Function, Instruction, LoopData, LoopId, Op, Place, PlaceData, Results,
    Target, Terminator, Type, Value, Var, WriteBack,
};

/// Whose memory the places `P` and `B` mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ProgramMemory {
    /// Nobody's: functions that are no program's.
    None,
    /// One program instance's: offsets are constants.
    Instance {
        /// First slot of its partition.
        slots: u32,
        /// Its data block's offset in the data region.
        block: u32,
    },
    /// That of whichever instance runs: two addresses come as parameters.
    Shared,
}

/// What the code of one resource has in common.
#[derive(Debug, Clone, Copy)]
pub struct Scope<'a> {
    /// What is compiled.
    pub verified: &'a Verified,
    /// Where the regions of the image lie.
    pub layout: &'a ImageLayout,
    /// Whether every BOOL slot holds 0 or 1 at all times, because no initial value says otherwise.
    pub clean_bools: bool,
}

/// One entry of the operand stack.
#[derive(Debug, Clone, Copy)]
enum Entry {
    Value(Value),
    /// A reference that no instruction has made a value yet, and whether it may point into %I, %Q or %M.
    Ref(Address, bool),
}

/// Makes the mid-level form of a function.
#[must_use]
pub fn build(scope: &Scope<'_>, id: FunctionId, program: ProgramMemory) -> Function {
    let mut builder = Builder::new(scope, id, program);
    builder.prologue();
    for block in 0..builder.facts.blocks.len() {
        builder.block(block);
    }
    builder.out
}

struct Builder<'a> {
    scope: &'a Scope<'a>,
    facts: &'a FunctionFacts,
    code: &'a container::Function,
    program: ProgramMemory,
    out: Function,
    locals: Vec<Var>,
    this: Option<Value>,
    stack: Vec<Entry>,
    /// Stacks handed to blocks that only one block leads to.
    handed: Vec<Option<Vec<Entry>>>,
    /// Instructions of the block at hand.
    pending: Vec<Instruction>,
    place: Place,
    current: BlockId,
    for_values: Vec<control::ForState>,
}

fn local_type(ty: LocalType) -> Type {
    match ty {
        LocalType::Scalar(storage) => storage.value_type().into(),
        LocalType::Ref(_) => Type::Ref,
    }
}

fn stack_type(ty: StackType) -> Type {
    match ty {
        StackType::Value(value) => value.into(),
        StackType::Ref(_) => Type::Ref,
    }
}

impl<'a> Builder<'a> {
    fn new(scope: &'a Scope<'a>, id: FunctionId, program: ProgramMemory) -> Self {
        let code = &scope.verified.container().functions[id.index()];
        let facts = scope.verified.function(id);
        let out = Function {
            id,
            values: Vec::new(),
            variables: Vec::new(),
            blocks: Vec::new(),
            loops: Vec::new(),
            places: vec![PlaceData { function: id, offset: 0, caller: None }],
            write_backs: vec![Vec::new()],
            results: code.results.iter().map(|ty| (*ty).into()).collect(),
            frame: Value(0),
            program: None,
        };
        Builder {
            scope,
            facts,
            code,
            program,
            out,
            locals: Vec::new(),
            this: None,
            stack: Vec::new(),
            handed: vec![None; facts.blocks.len()],
            pending: Vec::new(),
            place: Place(0),
            current: BlockId(0),
            for_values: vec![control::ForState::default(); code.for_loops.len()],
        }
    }

    /// Block 0: parameters into variables, everything else zero, first look at the deadline.
    fn prologue(&mut self) {
        let mut parameters = vec![self.out.new_value(Type::Ref)];
        self.out.frame = parameters[0];
        if self.program == ProgramMemory::Shared {
            let pair = (self.out.new_value(Type::Ref), self.out.new_value(Type::Ref));
            parameters.extend([pair.0, pair.1]);
            self.out.program = Some(pair);
        }
        if matches!(self.code.owner, Owner::Block(_)) {
            let this = self.out.new_value(Type::Ref);
            parameters.push(this);
            self.this = Some(this);
        }
        for (position, ty) in self.code.locals.iter().enumerate() {
            let var = self.out.new_variable(local_type(*ty));
            self.locals.push(var);
            if position < usize::from(self.code.parameters) {
                let value = self.out.new_value(local_type(*ty));
                parameters.push(value);
            }
        }
        let first = parameters.len() - usize::from(self.code.parameters).min(self.code.locals.len());
        let fuel = self.facts.entry_fuel;
        // Zeroed first: a run that ends here leaves a frame that a later run may look at.
        if self.facts.frame_bytes > 0 {
            let frame = self.at(Base::Value(self.out.frame), 0);
            self.effect(Op::Zero(frame, self.facts.frame_bytes));
        }
        self.effect(Op::Checkpoint { fuel, deadline: true });
        for (position, ty) in self.code.locals.iter().enumerate() {
            let value = match parameters.get(first + position) {
                Some(value) => self.wrap_local(*ty, *value),
                None => self.zero(*ty),
            };
            self.effect(Op::Set(self.locals[position], value));
        }
        self.start_blocks(parameters);
    }

    /// Adds the prologue and all other blocks, empty, so that they can be named.
    fn start_blocks(&mut self, parameters: Vec<Value>) {
        let jump = |block| Terminator::Jump(Target { block, arguments: Vec::new() });
        let instructions = std::mem::take(&mut self.pending);
        let plain = BlockData {
            parameters,
            instructions,
            terminator: jump(Block(1)),
            innermost_loop: None,
            write_back: WriteBack(0),
        };
        self.out.add_block(plain);
        for data in &self.facts.blocks {
            let empty = BlockData {
                parameters: Vec::new(),
                instructions: Vec::new(),
                terminator: Terminator::Return(Vec::new()),
                innermost_loop: data.innermost_loop.map(|id| LoopId(id.0)),
                write_back: WriteBack(0),
            };
            let block = self.out.add_block(empty);
            let parameters: Vec<Value> = if takes_parameters(data) {
                data.entry_stack.iter().map(|ty| self.out.new_value(stack_type(*ty))).collect()
            } else {
                Vec::new()
            };
            self.out.blocks[block.index()].parameters = parameters;
        }
        for data in &self.facts.loops {
            let parent = data.parent.map(|id| LoopId(id.0));
            self.out.loops.push(LoopData { header: mir_block(data.header), parent, counted: None });
        }
    }

    /// Translates one basic block.
    fn block(&mut self, number: usize) {
        let facts = self.facts;
        let Some(data) = facts.blocks.get(number) else { return };
        self.current = BlockId(number as u32);
        let block = mir_block(self.current);
        self.stack = if takes_parameters(data) {
            let parameters = self.out.blocks[block.index()].parameters.clone();
            parameters.iter().zip(&data.entry_stack).map(|(value, ty)| entry_of(*value, *ty)).collect()
        } else {
            self.handed[number].take().unwrap_or_default()
        };
        let instructions = facts.instructions.get(data.start..data.end).unwrap_or_default();
        self.header_checkpoint(block, instructions);
        let (last, body) = instructions.split_last().expect("a verified block has at least one instruction");
        for instruction in body {
            self.at_place(instruction.offset);
            self.instruction(&instruction.instruction);
        }
        self.at_place(last.offset);
        let terminator = self.terminator(last);
        let done = &mut self.out.blocks[block.index()];
        done.instructions = std::mem::take(&mut self.pending);
        done.terminator = terminator;
    }

    fn header_checkpoint(&mut self, block: Block, instructions: &[PlacedInstruction]) {
        let innermost = self.out.blocks[block.index()].innermost_loop;
        let Some(id) = innermost.filter(|id| self.out.loops[id.index()].header == block) else { return };
        self.at_place(instructions.first().map_or(0, |first| first.offset));
        let fuel = self.facts.loops[id.index()].fuel;
        self.effect(Op::Checkpoint { fuel, deadline: true });
    }

    /// Translates what ends a block; what only falls through becomes a jump.
    fn terminator(&mut self, last: &PlacedInstruction) -> Terminator {
        let next = BlockId(self.current.0 + 1);
        match &last.instruction {
            Code::Jump { target } => self.jump(self.label(*target)),
            Code::JumpIf { target } => {
                let condition = self.pop();
                self.branch(condition, self.label(*target), next)
            }
            Code::JumpUnless { target } => {
                let condition = self.pop();
                self.branch(condition, next, self.label(*target))
            }
            Code::Switch { targets } => self.switch(targets),
            Code::ForEnter { id, exit } => self.for_enter(*id, self.label(*exit), next),
            Code::ForNext { id, header } => self.for_next(*id, self.label(*header), next),
            Code::Return {} => {
                let count = self.code.results.len();
                Terminator::Return(self.pop_many(count))
            }
            other => {
                self.instruction(other);
                self.jump(next)
            }
        }
    }

    fn switch(&mut self, labels: &[Label]) -> Terminator {
        let value = self.pop();
        let mut targets: Vec<Target> = labels.iter().map(|label| self.target(self.label(*label))).collect();
        let default = targets.pop().expect("a verified switch has a target");
        Terminator::Switch { value, targets, default }
    }

    fn jump(&mut self, to: BlockId) -> Terminator {
        Terminator::Jump(self.target(to))
    }

    fn branch(&mut self, condition: Value, then: BlockId, otherwise: BlockId) -> Terminator {
        let then = self.target(then);
        Terminator::Branch { condition, then, otherwise: self.target(otherwise) }
    }

    /// The way into a block: the stack as its parameters, or handed on as it is where there is no other way in.
    fn target(&mut self, to: BlockId) -> Target {
        let block = mir_block(to);
        let data = &self.facts.blocks[to.index()];
        if !takes_parameters(data) {
            self.handed[to.index()] = Some(self.stack.clone());
            return Target { block, arguments: Vec::new() };
        }
        let mut arguments = Vec::with_capacity(self.stack.len());
        for position in 0..self.stack.len() {
            let value = self.materialise(self.stack[position]);
            if let Entry::Ref(_, image) = self.stack[position] {
                self.stack[position] = Entry::Ref(self.at(Base::Value(value), 0), image);
            }
            arguments.push(value);
        }
        Target { block, arguments }
    }

    /// The block that starts at an offset. The verifier proved that there is one.
    fn label(&self, label: Label) -> BlockId {
        let offset = |block: &khz_bytecode::verify::BasicBlock| self.facts.instructions[block.start].offset;
        let found = self.facts.blocks.binary_search_by_key(&label.0, offset);
        BlockId(found.expect("a verified jump goes to the start of a block") as u32)
    }

    fn at_place(&mut self, offset: u32) {
        self.out.places.push(PlaceData { function: self.out.id, offset, caller: None });
        self.place = Place(self.out.places.len() as u32 - 1);
    }

    fn effect(&mut self, op: Op) {
        self.pending.push(Instruction { op, results: Results::None, place: self.place });
    }

    fn define(&mut self, ty: Type, op: Op) -> Value {
        let value = self.out.new_value(ty);
        self.pending.push(Instruction { op, results: Results::One(value), place: self.place });
        value
    }

    fn constant(&mut self, value: Const) -> Value {
        self.define(value.ty(), Op::Const(value))
    }

    fn unary(&mut self, op: NumericOp, a: Value) -> Value {
        self.define(op.result().into(), Op::Numeric(op, [a, a]))
    }

    fn binary(&mut self, op: NumericOp, a: Value, b: Value) -> Value {
        self.define(op.result().into(), Op::Numeric(op, [a, b]))
    }

    fn zero(&mut self, ty: LocalType) -> Value {
        match local_type(ty) {
            Type::I32 => self.constant(Const::I32(0)),
            Type::I64 => self.constant(Const::I64(0)),
            Type::F32 => self.constant(Const::F32(0)),
            Type::F64 => self.constant(Const::F64(0)),
            // Never read: a reference is assigned on every path before its use. Vectors come up later, and are no local's type.
            Type::Ref | Type::F32x4 | Type::F64x2 => {
                self.define(Type::Ref, Op::Reference(Address { base: Base::Image, displacement: 0, index: None }))
            }
        }
    }

    /// What a load gives after `value` was stored as `storage`.
    fn wrap(&mut self, storage: Storage, value: Value) -> Value {
        match storage {
            Storage::Bool => self.unary(NumericOp::I32Nez, value),
            Storage::I8 => self.unary(NumericOp::I32Extend8S, value),
            Storage::U8 => self.unary(NumericOp::I32Extend8U, value),
            Storage::I16 => self.unary(NumericOp::I32Extend16S, value),
            Storage::U16 => self.unary(NumericOp::I32Extend16U, value),
            Storage::I32 | Storage::I64 | Storage::F32 | Storage::F64 => value,
        }
    }

    fn wrap_local(&mut self, ty: LocalType, value: Value) -> Value {
        match ty {
            LocalType::Scalar(storage) => self.wrap(storage, value),
            LocalType::Ref(_) => value,
        }
    }

    fn push(&mut self, value: Value) {
        self.stack.push(Entry::Value(value));
    }

    fn pop_entry(&mut self) -> Entry {
        self.stack.pop().expect("the verifier proved the depth of the stack")
    }

    /// Pops an entry as a value; a symbolic reference becomes one.
    fn pop(&mut self) -> Value {
        let entry = self.pop_entry();
        self.materialise(entry)
    }

    fn pop_many(&mut self, count: usize) -> Vec<Value> {
        let mut values: Vec<Value> = (0..count).map(|_| self.pop()).collect();
        values.reverse();
        values
    }

    fn pop_ref(&mut self) -> (Address, bool) {
        match self.pop_entry() {
            Entry::Ref(address, image) => (address, image),
            // The verifier proved that it is a reference; without its type the careful answer is that it may point anywhere.
            Entry::Value(value) => (self.at(Base::Value(value), 0), true),
        }
    }

    fn materialise(&mut self, entry: Entry) -> Value {
        match entry {
            Entry::Value(value) => value,
            Entry::Ref(Address { base: Base::Value(value), displacement: 0, index: None }, _) => value,
            Entry::Ref(address, _) => self.define(Type::Ref, Op::Reference(address)),
        }
    }

    fn at(&self, base: Base, displacement: i64) -> Address {
        Address { base, displacement, index: None }
    }
}

fn entry_of(value: Value, ty: StackType) -> Entry {
    match ty {
        StackType::Value(_) => Entry::Value(value),
        StackType::Ref(reference) => {
            Entry::Ref(Address { base: Base::Value(value), displacement: 0, index: None }, reference.image)
        }
    }
}

/// Whether a block gets its stack as parameters: where ways meet.
fn takes_parameters(data: &khz_bytecode::verify::BasicBlock) -> bool {
    data.predecessors.len() != 1
}

/// The prologue is block 0, so that the entry may be a loop's header.
fn mir_block(block: BlockId) -> Block {
    Block(block.0 + 1)
}
