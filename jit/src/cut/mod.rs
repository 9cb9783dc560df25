//! Long functions are cut into parts of bounded size, so that compiling takes time in proportion to the program: what Cranelift and some passes
//! do grows faster than the function that they work on.
//!
//! A part is a stretch that is entered at its start and left at its end ([`slices`]): some hundred rungs, IFs or loops, or long arms of a CASE. It is no
//! function of the program: it works on the frame of the one it was cut from, and its traps name the same places with the same calls around them.
//! Values and variables from outside are its parameters, variables that it assigns and others read are its results. Cutting comes after inlining and
//! before all passes that improve a function, each of which then works on one part.
//!
//! The choice of stretches may be wrong (it compares sums); building the parts finds that out, and then nothing is cut.

mod exposed;
mod rename;
pub mod slices;

use std::collections::{BTreeMap, BTreeSet};

use crate::mir::{
    Block, BlockData, Const, Function, Instruction, LoopData, LoopId, Op, Place, Results, Target, Terminator, Type,
    Value, Var, WriteBack,
};
use rename::Renamer;
use slices::{Order, Slice, choose};

/// Items (instructions and ends of blocks) from which on a stretch becomes a part, unless [`crate::JitOptions::part_items`] says otherwise.
pub const PART_ITEMS: usize = 2000;

/// Most parameters and results of a part beside the hidden ones.
const MOST_NAMES: usize = 256;

/// Cuts parts of about `most` items out of a function that has more, and gives them, callees before callers.
#[must_use]
pub fn run(function: &mut Function, most: usize) -> Vec<Function> {
    let order = Order::new(function);
    if order.count <= most {
        return Vec::new();
    }
    let chosen = choose(function, &order, most);
    if chosen.is_empty() {
        return Vec::new();
    }
    let before = function.clone();
    match Cutter::new(function, order).run(&chosen) {
        Some(parts) => parts,
        None => {
            *function = before;
            Vec::new()
        }
    }
}

/// What a stretch names of the function around it.
#[derive(Debug, Default)]
struct Names {
    /// How often each variable is read and assigned.
    variables: BTreeMap<Var, (u32, u32)>,
    /// Values from outside.
    values: BTreeSet<Value>,
}

/// A stretch that was taken out: blocks with the names of the function around, targets and loops with its own.
struct Piece {
    blocks: Vec<BlockData>,
    loops: Vec<LoopData>,
    names: Names,
}

/// A part that the stretch around it will call.
struct Cut {
    slice: Slice,
    number: u32,
    inputs: Vec<Value>,
    variables: Vec<Var>,
    results: Vec<Var>,
    names: Names,
}

struct Cutter<'f> {
    function: &'f mut Function,
    order: Order,
    /// The loop that each block is the header of.
    headers: Vec<Option<LoopId>>,
    /// The piece that defines each value; the parameters are everybody's.
    defined_in: Vec<u32>,
    /// Reads and assignments of each variable in the whole function.
    uses: Vec<(u32, u32)>,
    parts: Vec<Function>,
}

/// Piece that has no number yet, or a value that is defined nowhere.
const NOWHERE: u32 = u32::MAX;
/// The function's own parameters.
const EVERYWHERE: u32 = u32::MAX - 1;

impl<'f> Cutter<'f> {
    fn new(function: &'f mut Function, order: Order) -> Self {
        let mut headers = vec![None; function.blocks.len()];
        for (number, data) in function.loops.iter().enumerate() {
            headers[data.header.index()] = Some(LoopId(number as u32));
        }
        let mut defined_in = vec![NOWHERE; function.values.len()];
        for parameter in &function.blocks[0].parameters {
            defined_in[parameter.index()] = EVERYWHERE;
        }
        let mut uses = vec![(0, 0); function.variables.len()];
        for instruction in function.blocks.iter().flat_map(|block| &block.instructions) {
            count(&instruction.op, |var| &mut uses[var.index()]);
        }
        Cutter { function, order, headers, defined_in, uses, parts: Vec::new() }
    }

    fn run(mut self, chosen: &[Slice]) -> Option<Vec<Function>> {
        let mut open: Vec<Cut> = Vec::new();
        for slice in chosen {
            let first = open.partition_point(|cut| cut.slice.start < slice.start);
            let inner = open.split_off(first);
            open.push(self.part(*slice, inner)?);
        }
        let whole = Slice { start: 0, end: self.order.count };
        let piece = self.piece(whole, open, &[])?;
        // What is used here and was defined in a part would be missing.
        let own = |value: &Value| self.defined_in[value.index()] == EVERYWHERE;
        if !piece.names.values.iter().all(own) {
            return None;
        }
        self.function.blocks = piece.blocks;
        self.function.loops = piece.loops;
        Some(self.parts)
    }

    /// Makes a part of a stretch; `inner`: the parts in it.
    fn part(&mut self, slice: Slice, inner: Vec<Cut>) -> Option<Cut> {
        let mut names = Names::default();
        self.count_names(slice, &inner, &mut names);
        let mut variables = Vec::new();
        let mut results = Vec::new();
        // In a loop a part runs again: what it reads before it assigns it may be what it assigned the last time.
        let again = if self.is_in_loop(slice) {
            exposed::variables(self.function, &self.order, slice, &inner)
        } else {
            BTreeSet::new()
        };
        for (var, (reads, assignments)) in &names.variables {
            let (all_reads, all_assignments) = self.uses[var.index()];
            let is_carried = *assignments > 0 && again.contains(var);
            let leaves = is_carried || *assignments > 0 && all_reads > *reads;
            if leaves {
                results.push(*var);
            }
            if is_carried || all_assignments > *assignments && (*reads > 0 || leaves) {
                variables.push(*var);
            }
        }
        let piece = self.piece(slice, inner, &results)?;
        let hidden = self.hidden();
        let inputs: Vec<Value> = piece.names.values.iter().copied().filter(|value| !hidden.contains(value)).collect();
        if inputs.len() + variables.len() > MOST_NAMES || results.len() > MOST_NAMES {
            return None;
        }
        let number = self.parts.len() as u32;
        let part = Renamer::new(self.function, &inputs, &variables, &results).part(piece.blocks, piece.loops);
        self.parts.push(part);
        let names = Names { values: inputs.iter().copied().collect(), variables: names.variables };
        Some(Cut { slice, number, inputs, variables, results, names })
    }

    /// Whether a stretch lies in a loop that it does not hold whole.
    fn is_in_loop(&self, slice: Slice) -> bool {
        let mut at = self.function.blocks[self.order.item(slice.start).0].innermost_loop;
        while let Some(id) = at {
            let data = &self.function.loops[id.index()];
            if self.order.start(data.header.index()) < slice.start {
                return true;
            }
            at = data.parent;
        }
        false
    }

    /// Frame and program memory, which every part gets.
    fn hidden(&self) -> Vec<Value> {
        let program = self.function.program.into_iter().flat_map(|(slots, block)| [slots, block]);
        std::iter::once(self.function.frame).chain(program).collect()
    }

    /// Adds how often a stretch and the parts in it read and assign variables.
    fn count_names(&self, slice: Slice, inner: &[Cut], names: &mut Names) {
        let mut at = slice.start;
        let mut inner = inner.iter();
        let mut next = inner.next();
        while at < slice.end {
            if let Some(cut) = next.filter(|cut| cut.slice.start == at) {
                for (var, (reads, assignments)) in &cut.names.variables {
                    let both = names.variables.entry(*var).or_default();
                    *both = (both.0 + reads, both.1 + assignments);
                }
                (at, next) = (cut.slice.end, inner.next());
                continue;
            }
            let (block, number) = self.order.item(at);
            if let Some(instruction) = self.function.blocks[block].instructions.get(number) {
                count(&instruction.op, |var| names.variables.entry(var).or_default());
            }
            at += 1;
        }
    }

    /// Takes a stretch out of the function, with calls in place of the parts in it. It ends with the values of `results`.
    fn piece(&mut self, slice: Slice, inner: Vec<Cut>, results: &[Var]) -> Option<Piece> {
        let number = self.parts.len() as u32;
        let mut walk = Walk { cutter: self, number, blocks: Vec::new(), renamed: BTreeMap::new(), loops: Vec::new() };
        walk.blocks(slice, inner, results);
        let Walk { mut blocks, renamed, mut loops, .. } = walk;
        loops.sort();
        let named: BTreeMap<LoopId, LoopId> =
            loops.iter().enumerate().map(|(new, old)| (*old, LoopId(new as u32))).collect();
        let old_loops = &self.function.loops;
        let around = |mut at: Option<LoopId>| loop {
            match at {
                Some(id) if !named.contains_key(&id) => at = old_loops[id.index()].parent,
                known => break known.map(|id| named[&id]),
            }
        };
        let mut names = Names::default();
        for data in &mut blocks {
            data.innermost_loop = around(data.innermost_loop);
            for target in data.terminator.targets_mut() {
                target.block = *renamed.get(&target.block)?;
            }
            let mut used = |value: &mut Value| {
                if self.defined_in[value.index()] != number {
                    names.values.insert(*value);
                }
            };
            data.instructions.iter_mut().for_each(|instruction| instruction.op.for_each_operand(&mut used));
            data.terminator.for_each_operand(&mut used);
        }
        let mut own_loops = Vec::with_capacity(loops.len());
        for id in &loops {
            let LoopData { header, parent, counted } = self.function.loops[id.index()].clone();
            for value in counted.iter().flat_map(|counted| [counted.initial, counted.bound, counted.step]) {
                if self.defined_in[value.index()] != number {
                    names.values.insert(value);
                }
            }
            own_loops.push(LoopData { header: *renamed.get(&header)?, parent: around(parent), counted });
        }
        Some(Piece { blocks, loops: own_loops, names })
    }
}

/// Counts what an instruction does to a variable.
fn count<'a>(op: &Op, counts: impl FnOnce(Var) -> &'a mut (u32, u32)) {
    match op {
        Op::Get(var) => counts(*var).0 += 1,
        Op::Set(var, _) => counts(*var).1 += 1,
        _ => {}
    }
}

/// Copies a stretch block by block.
struct Walk<'c, 'f> {
    cutter: &'c mut Cutter<'f>,
    number: u32,
    blocks: Vec<BlockData>,
    renamed: BTreeMap<Block, Block>,
    loops: Vec<LoopId>,
}

impl Walk<'_, '_> {
    fn blocks(&mut self, slice: Slice, inner: Vec<Cut>, results: &[Var]) {
        let mut inner = inner.into_iter().peekable();
        let (mut block, mut number) = self.cutter.order.item(slice.start);
        self.open(block, number == 0, true);
        // Whether the last block has no end yet.
        let mut open = true;
        while block < self.cutter.function.blocks.len() {
            let position = self.cutter.order.start(block) + number;
            if position == slice.end {
                return self.finish((number == 0).then_some(block), open, results);
            }
            if !std::mem::replace(&mut open, true) {
                // A part that begins at the header of a loop holds the loop whole.
                self.open(block, true, inner.peek().is_none_or(|cut| cut.slice.start != position));
            }
            if let Some(cut) = inner.next_if(|cut| cut.slice.start == position) {
                self.call(&cut);
                (block, number) = self.cutter.order.item(cut.slice.end);
                if number == 0 {
                    self.close(Terminator::Jump(Target { block: Block(block as u32), arguments: Vec::new() }));
                    open = false;
                }
            } else if let Some(instruction) = self.instruction(block, number) {
                self.push(instruction);
                number += 1;
            } else {
                let nothing = Terminator::Return(Vec::new());
                let terminator = std::mem::replace(&mut self.cutter.function.blocks[block].terminator, nothing);
                self.close(terminator);
                (block, number, open) = (block + 1, 0, false);
            }
        }
    }

    /// Takes an instruction; nothing where the block has no further one.
    fn instruction(&mut self, block: usize, number: usize) -> Option<Instruction> {
        let empty = Instruction { op: Op::Const(Const::I32(0)), results: Results::None, place: Place(0) };
        self.cutter.function.blocks[block].instructions.get_mut(number).map(|taken| std::mem::replace(taken, empty))
    }

    fn push(&mut self, instruction: Instruction) {
        for value in instruction.results.as_slice() {
            self.cutter.defined_in[value.index()] = self.number;
        }
        if let Some(open) = self.blocks.last_mut() {
            open.instructions.push(instruction);
        }
    }

    /// Starts a block: that of the function with its name and parameters, and the loop that it is the header of, or what is left of it.
    fn open(&mut self, block: usize, from_its_start: bool, has_its_loop: bool) {
        let data = &self.cutter.function.blocks[block];
        let (mut parameters, innermost_loop) = (Vec::new(), data.innermost_loop);
        if from_its_start {
            parameters.clone_from(&data.parameters);
            self.renamed.insert(Block(block as u32), Block(self.blocks.len() as u32));
            self.loops.extend(self.cutter.headers[block].filter(|_| has_its_loop));
        }
        for value in &parameters {
            let known = &mut self.cutter.defined_in[value.index()];
            if *known != EVERYWHERE {
                *known = self.number;
            }
        }
        let (instructions, terminator) = (Vec::new(), Terminator::Return(Vec::new()));
        let write_back = WriteBack(0);
        self.blocks.push(BlockData { parameters, instructions, terminator, innermost_loop, write_back });
    }

    fn close(&mut self, terminator: Terminator) {
        if let Some(open) = self.blocks.last_mut() {
            open.terminator = terminator;
        }
    }

    /// The call of a part: reads the variables that it takes, assigns those that it gives.
    fn call(&mut self, cut: &Cut) {
        let ty = |cutter: &Cutter<'_>, var: &Var| cutter.function.variables[var.index()];
        let mut arguments = cut.inputs.clone();
        for var in &cut.variables {
            let value = self.new_value(ty(self.cutter, var));
            self.effect(Op::Get(*var), Results::One(value));
            arguments.push(value);
        }
        let values: Vec<Value> = cut.results.iter().map(|var| self.new_value(ty(self.cutter, var))).collect();
        let results = match values.as_slice() {
            [] => Results::None,
            [value] => Results::One(*value),
            many => Results::Many(many.to_vec()),
        };
        self.effect(Op::Part(cut.number, arguments), results);
        for (var, value) in cut.results.iter().zip(values) {
            self.effect(Op::Set(*var, value), Results::None);
        }
    }

    fn effect(&mut self, op: Op, results: Results) {
        self.push(Instruction { op, results, place: Place(0) });
    }

    fn new_value(&mut self, ty: Type) -> Value {
        self.cutter.defined_in.push(self.number);
        self.cutter.function.new_value(ty)
    }

    /// The end of a part; where it lies in front of a block, that is where the part's blocks that go there go.
    fn finish(&mut self, in_front_of: Option<usize>, open: bool, results: &[Var]) {
        if let Some(block) = in_front_of {
            let behind = Block(block as u32);
            if open {
                self.close(Terminator::Jump(Target { block: behind, arguments: Vec::new() }));
            }
            self.renamed.insert(behind, Block(self.blocks.len() as u32));
            let (parameters, instructions) = (Vec::new(), Vec::new());
            let (terminator, innermost_loop, write_back) = (Terminator::Return(Vec::new()), None, WriteBack(0));
            self.blocks.push(BlockData { parameters, instructions, terminator, innermost_loop, write_back });
        }
        let mut values = Vec::with_capacity(results.len());
        for var in results {
            let value = self.new_value(self.cutter.function.variables[var.index()]);
            self.effect(Op::Get(*var), Results::One(value));
            values.push(value);
        }
        self.close(Terminator::Return(values));
    }
}
