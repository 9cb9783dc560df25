//! Small functions and function blocks are put where they are called: timers, counters and their like become a few instructions on known addresses.
//!
//! A trap inside names the same place and the same chain of calls as ever: each place of the callee gets the call as its caller. Frame bytes keep
//! their addresses, because the callee's frame starts where the caller's ends; a callee that still calls others is therefore only taken when it has
//! no frame bytes of its own. Fuel is charged as at a call; the deadline is not looked at once more. Nothing is inlined where virtual calls
//! count their depth.

use std::collections::BTreeMap;
use std::rc::Rc;

use khz_bytecode::container::Owner;
use khz_bytecode::ids::FunctionId;

use crate::build::{ProgramMemory, Scope, build};
use crate::mir::{
    Address, Base, Block, BlockData, Function, Instruction, Op, Place, PlaceData, Results, Target, Terminator, Value,
};

/// Most instructions of a function that is inlined, its own callees included.
const MOST_INSTRUCTIONS: usize = 240;
/// Most instructions that a function may grow by: larger programs call, which keeps compiling linear.
const MOST_GROWTH: usize = 2500;
/// Most instructions of the mid-level form that inlining adds to a function with so many calls.
#[must_use]
pub fn most_growth(calls: usize) -> usize {
    calls.saturating_mul(MOST_INSTRUCTIONS).min(MOST_GROWTH)
}

/// Deepest nesting of inlined calls.
const DEEPEST: usize = 4;

/// Inlines into one function after the other, and remembers what it has built.
pub struct Inliner<'a> {
    scope: &'a Scope<'a>,
    known: BTreeMap<(FunctionId, ProgramMemory), Option<Rc<Function>>>,
    depth: usize,
}

impl<'a> Inliner<'a> {
    /// An inliner for the functions of a container.
    #[must_use]
    pub fn new(scope: &'a Scope<'a>) -> Self {
        Inliner { scope, known: BTreeMap::new(), depth: 0 }
    }

    /// Inlines what a function calls.
    pub fn run(&mut self, function: &mut Function, program: ProgramMemory) {
        let calls = function.blocks.iter().flat_map(|block| &block.instructions);
        if !calls.into_iter().any(|instruction| matches!(instruction.op, Op::Call(..))) {
            return;
        }
        let blocks = std::mem::take(&mut function.blocks);
        let addresses = addresses(&blocks);
        let frame_bytes = self.scope.verified.function(function.id).frame_bytes;
        let mut splice =
            Splice { function, addresses, frame_bytes, starts: Vec::new(), named_anew: Vec::new(), grown: 0 };
        for block in blocks {
            splice.starts.push(Block(splice.function.blocks.len() as u32));
            self.block(&mut splice, block, program);
        }
        splice.finish();
    }

    fn block(&mut self, splice: &mut Splice<'_>, block: BlockData, program: ProgramMemory) {
        let BlockData { parameters, instructions, terminator, innermost_loop, write_back } = block;
        let empty = |parameters, terminator| BlockData {
            parameters,
            instructions: Vec::new(),
            terminator,
            innermost_loop,
            write_back,
        };
        let mut open = empty(parameters, Terminator::Return(Vec::new()));
        for instruction in instructions {
            let Op::Call(callee, arguments) = &instruction.op else {
                open.instructions.push(instruction);
                continue;
            };
            let room = MOST_GROWTH.saturating_sub(splice.grown);
            let Some(body) = self.body(*callee, program).filter(|body| size(body) <= room) else {
                open.instructions.push(instruction);
                continue;
            };
            splice.grown += size(&body);
            let results = instruction.results.as_slice().to_vec();
            let first = Block(splice.function.blocks.len() as u32 + 1);
            open.terminator = Terminator::Jump(Target { block: first, arguments: Vec::new() });
            splice.push(open, false);
            splice.callee(&body, arguments, instruction.place, innermost_loop);
            open = empty(results, Terminator::Return(Vec::new()));
        }
        open.terminator = terminator;
        splice.push(open, true);
    }

    /// A function as it is inlined, if it is.
    fn body(&mut self, callee: FunctionId, program: ProgramMemory) -> Option<Rc<Function>> {
        let owner = self.scope.verified.container().functions.get(callee.index())?.owner;
        let program = if matches!(owner, Owner::Program(_)) { program } else { ProgramMemory::None };
        if let Some(known) = self.known.get(&(callee, program)) {
            return known.clone();
        }
        let facts = self.scope.verified.function(callee);
        let small = facts.instructions.len() <= MOST_INSTRUCTIONS && facts.loops.is_empty();
        let body = if small && self.depth < DEEPEST {
            let mut function = build(self.scope, callee, program);
            self.depth += 1;
            self.run(&mut function, program);
            self.depth -= 1;
            let mut instructions = function.blocks.iter().flat_map(|block| &block.instructions);
            let calls = instructions.any(|i| matches!(i.op, Op::Call(..) | Op::CallVirtual(..)));
            let fits = size(&function) <= MOST_INSTRUCTIONS && (!calls || facts.frame_bytes == 0);
            fits.then(|| Rc::new(function))
        } else {
            None
        };
        // What is too deep here may be taken elsewhere.
        if self.depth == 0 || body.is_some() {
            self.known.insert((callee, program), body.clone());
        }
        body
    }
}

fn size(function: &Function) -> usize {
    function.blocks.iter().map(|block| block.instructions.len() + 1).sum()
}

/// References that are addresses.
fn addresses(blocks: &[BlockData]) -> BTreeMap<Value, Address> {
    let instructions = blocks.iter().flat_map(|block| &block.instructions);
    let known = instructions.filter_map(|instruction| match (&instruction.op, &instruction.results) {
        (Op::Reference(address), Results::One(result)) => Some((*result, *address)),
        _ => None,
    });
    known.collect()
}

/// A function that is put together anew.
struct Splice<'f> {
    function: &'f mut Function,
    addresses: BTreeMap<Value, Address>,
    frame_bytes: u32,
    /// Where each block of before starts now.
    starts: Vec<Block>,
    /// For each new block, whether its targets are still those of before.
    named_anew: Vec<bool>,
    grown: usize,
}

impl Splice<'_> {
    fn push(&mut self, block: BlockData, named_as_before: bool) {
        self.function.blocks.push(block);
        self.named_anew.push(!named_as_before);
    }

    /// Targets and loops name blocks by their new numbers.
    fn finish(self) {
        for (block, done) in self.function.blocks.iter_mut().zip(&self.named_anew) {
            if *done {
                continue;
            }
            for target in block.terminator.targets_mut() {
                target.block = self.starts[target.block.index()];
            }
        }
        for data in &mut self.function.loops {
            data.header = self.starts[data.header.index()];
        }
    }

    /// Appends a callee's blocks; the next block that is appended is the one that it returns to.
    fn callee(
        &mut self,
        body: &Function,
        arguments: &[Value],
        call: Place,
        innermost_loop: Option<crate::mir::LoopId>,
    ) {
        let mut copy = self.names(body, arguments, call);
        let first = copy.first_block;
        let behind = Block(first + body.blocks.len() as u32);
        for (number, block) in body.blocks.iter().enumerate() {
            let mut instructions = Vec::with_capacity(block.instructions.len() + 1);
            if number == 0 {
                instructions.append(&mut copy.head);
            }
            instructions
                .extend(block.instructions.iter().map(|instruction| copy.instruction(instruction, number == 0)));
            let mut terminator = block.terminator.clone();
            if let Terminator::Return(values) = &terminator {
                let arguments = values.iter().map(|value| copy.value(*value)).collect();
                terminator = Terminator::Jump(Target { block: behind, arguments });
            } else {
                copy.terminator(&mut terminator);
            }
            let parameters =
                if number == 0 { Vec::new() } else { block.parameters.iter().map(|v| copy.value(*v)).collect() };
            let write_back = block.write_back;
            let data = BlockData { parameters, instructions, terminator, innermost_loop, write_back };
            self.push(data, false);
        }
    }

    /// New names for everything of a callee.
    fn names(&mut self, body: &Function, arguments: &[Value], call: Place) -> Copy {
        let function = &mut *self.function;
        let values = function.values.len() as u32;
        function.values.extend(&body.values);
        let variables = function.variables.len() as u32;
        function.variables.extend(&body.variables);
        let places = function.places.len() as u32;
        function.places.extend(body.places.iter().map(|data| PlaceData {
            caller: Some(data.caller.map_or(call, |caller| Place(caller.0 + places))),
            ..*data
        }));
        // The hidden parameters first: the frame, which starts where this call's ends, and the program's memory, which is the caller's.
        let frame =
            Address { base: Base::Value(function.frame), displacement: i64::from(self.frame_bytes), index: None };
        let own_frame = Value(values + body.frame.0);
        let head = Instruction { op: Op::Reference(frame), results: Results::One(own_frame), place: call };
        let mut given: BTreeMap<Value, Value> = BTreeMap::new();
        let mut known: BTreeMap<Value, Address> = BTreeMap::from([(own_frame, frame)]);
        let hidden = match (body.program, function.program) {
            (Some((slots, block)), Some((own_slots, own_block))) => {
                given.extend([(slots, own_slots), (block, own_block)]);
                3
            }
            _ => 1,
        };
        let parameters = body.blocks.first().map_or(&[][..], |block| &block.parameters[..]);
        for (parameter, argument) in parameters.iter().skip(hidden).zip(arguments) {
            given.insert(*parameter, *argument);
            if let Some(address) = self.addresses.get(argument) {
                known.insert(*argument, *address);
            }
        }
        // A callee's own references are known by name as well, once they are copied.
        let first_block = function.blocks.len() as u32;
        Copy { values, variables, places, first_block, given, known, head: vec![head] }
    }
}

/// How a callee's names become the caller's.
struct Copy {
    values: u32,
    variables: u32,
    places: u32,
    first_block: u32,
    given: BTreeMap<Value, Value>,
    known: BTreeMap<Value, Address>,
    head: Vec<Instruction>,
}

impl Copy {
    fn value(&self, value: Value) -> Value {
        self.given.get(&value).copied().unwrap_or(Value(value.0 + self.values))
    }

    /// An address, counted from where its base lies when that is known.
    fn address(&self, address: &mut Address) {
        if let Some((index, _)) = &mut address.index {
            *index = self.value(*index);
        }
        let Base::Value(base) = address.base else { return };
        let base = self.value(base);
        address.base = Base::Value(base);
        if let Some(known) = self.known.get(&base)
            && (known.index.is_none() || address.index.is_none())
        {
            address.base = known.base;
            address.displacement = address.displacement.wrapping_add(known.displacement);
            address.index = address.index.or(known.index);
        }
    }

    fn instruction(&mut self, instruction: &Instruction, in_prologue: bool) -> Instruction {
        let mut op = instruction.op.clone();
        match &mut op {
            Op::Load(at, _) | Op::LoadBit(at, _) | Op::Reference(at) | Op::Zero(at, _) => self.address(at),
            Op::Store(at, _, value) | Op::StoreBit(at, _, value) => {
                *value = self.value(*value);
                self.address(at);
            }
            Op::Copy { destination, source, .. } => {
                self.address(destination);
                self.address(source);
            }
            Op::Get(var) => var.0 += self.variables,
            Op::Set(var, value) => {
                var.0 += self.variables;
                *value = self.value(*value);
            }
            Op::Checkpoint { deadline, .. } if in_prologue => *deadline = false,
            other => other.for_each_operand(|value| *value = self.value(*value)),
        }
        let results = match &instruction.results {
            Results::None => Results::None,
            Results::One(value) => Results::One(self.value(*value)),
            Results::Many(values) => Results::Many(values.iter().map(|value| self.value(*value)).collect()),
        };
        if let (Op::Reference(address), Results::One(result)) = (&op, &results) {
            self.known.insert(*result, *address);
        }
        Instruction { op, results, place: Place(instruction.place.0 + self.places) }
    }

    fn terminator(&self, terminator: &mut Terminator) {
        terminator.for_each_operand(|value| *value = self.value(*value));
        for target in terminator.targets_mut() {
            target.block.0 += self.first_block;
        }
    }
}
