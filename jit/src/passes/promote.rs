//! Slots live in variables while a loop runs: loaded in front of it, stored back behind it and by every trap inside it.
//!
//! Nothing aliases a slot, so only a call whose callee touches it stands in the way. Outermost loops come first; what a call keeps out of one
//! of them may still live in a variable in a loop inside. Straight-line code stays in memory: many live values cost more than they gain.

use std::collections::{BTreeMap, BTreeSet};

use khz_bytecode::ids::FunctionId;
use khz_bytecode::instruction::NumericOp;
use khz_bytecode::value::{SlotPlace, Storage};
use khz_bytecode::verify::Verified;

use crate::mir::{
    Access, Block, BlockData, Control, Dirty, Function, Instruction, LoopId, Op, Place, Results, Slot, Target,
    Terminator, Value, Var, WriteBack,
};

/// Most slots that one loop takes into variables.
const MOST_SLOTS: usize = 48;
/// Deepest loop level that is looked at: bounds the work for a nest of many levels.
const DEEPEST_LEVEL: usize = 4;
/// Most stores that leaving a loop may cost in code: ways out × slots.
const MOST_STORES: usize = 4096;

/// Which slots calls touch.
#[derive(Debug, Clone, Copy)]
pub struct CallEffects<'a> {
    verified: &'a Verified,
    parts: &'a [Function],
}

impl<'a> CallEffects<'a> {
    /// The verifier's effect summaries, and the parts that were cut out of the function.
    #[must_use]
    pub fn new(verified: &'a Verified, parts: &'a [Function]) -> Self {
        CallEffects { verified, parts }
    }

    fn add(&self, op: &Op, touched: &mut Touched) {
        match op {
            Op::Call(function, _) if touched.callees.insert(*function) => {
                let effects = &self.verified.function(*function).effects;
                let globals = effects.globals_read.iter().chain(&effects.globals_written);
                touched.slots.extend(globals.map(|index| Slot { place: SlotPlace::Global, index: *index }));
                let program = effects.program_read.iter().chain(&effects.program_written);
                touched.slots.extend(program.map(|index| Slot { place: SlotPlace::Program, index: *index }));
                touched.all_globals |= !effects.virtual_calls.is_empty();
            }
            // A method has no way to the slots of a program, but to those of all.
            Op::CallVirtual(..) => touched.all_globals = true,
            Op::Part(number, _) if touched.parts.insert(*number) => {
                let part = self.parts.get(*number as usize);
                for instruction in part.iter().flat_map(|part| &part.blocks).flat_map(|block| &block.instructions) {
                    match &instruction.op {
                        Op::LoadSlot(slot, _) | Op::StoreSlot(slot, ..) => {
                            touched.slots.insert(*slot);
                        }
                        op => self.add(op, touched),
                    }
                }
            }
            _ => {}
        }
    }
}

#[derive(Default)]
struct Touched {
    callees: BTreeSet<FunctionId>,
    parts: BTreeSet<u32>,
    slots: BTreeSet<Slot>,
    all_globals: bool,
}

impl Touched {
    fn contains(&self, slot: Slot) -> bool {
        self.slots.contains(&slot) || (self.all_globals && slot.place == SlotPlace::Global)
    }
}

/// How often and how a loop uses a slot.
struct Use {
    access: Access,
    count: usize,
    written: bool,
}

/// Runs it.
pub fn run(function: &mut Function, effects: CallEffects<'_>) {
    if function.loops.is_empty() {
        return;
    }
    let headers = function.loops.iter().enumerate().map(|(number, data)| (data.header, LoopId(number as u32)));
    let headers: BTreeMap<Block, LoopId> = headers.collect();
    let mut known = BTreeMap::new();
    for level in 0..DEEPEST_LEVEL {
        let at_level: Vec<(LoopId, Vec<usize>)> = loops_of_level(function, level);
        if at_level.is_empty() {
            return;
        }
        let mut ways_in = WaysIn::new(function, &headers);
        for (id, blocks) in at_level {
            promote(function, id, &blocks, effects, &headers, &mut ways_in, &mut known);
        }
    }
}

/// Which blocks lead to each loop header. May name one that does so no longer.
struct WaysIn(BTreeMap<Block, Vec<usize>>);

impl WaysIn {
    fn new(function: &Function, headers: &BTreeMap<Block, LoopId>) -> WaysIn {
        let mut ways: BTreeMap<Block, Vec<usize>> = BTreeMap::new();
        for (number, block) in function.blocks.iter().enumerate() {
            for target in block.terminator.targets() {
                if headers.contains_key(&target.block) {
                    ways.entry(target.block).or_default().push(number);
                }
            }
        }
        WaysIn(ways)
    }

    fn add(&mut self, to: Block, from: Block) {
        if let Some(ways) = self.0.get_mut(&to) {
            ways.push(from.index());
        }
    }
}

/// Loops of a nesting level with all their blocks.
fn loops_of_level(function: &Function, level: usize) -> Vec<(LoopId, Vec<usize>)> {
    // Outer loops stand before inner ones, so one walk gives depths and the loop of the level around each.
    let mut depth = vec![0; function.loops.len()];
    let mut around: Vec<Option<LoopId>> = vec![None; function.loops.len()];
    for (number, data) in function.loops.iter().enumerate() {
        let parent = data.parent.map(LoopId::index).filter(|parent| *parent < number);
        depth[number] = parent.map_or(0, |parent| depth[parent] + 1);
        around[number] =
            if depth[number] == level { Some(LoopId(number as u32)) } else { parent.and_then(|p| around[p]) };
    }
    let mut blocks: BTreeMap<LoopId, Vec<usize>> = BTreeMap::new();
    for (number, block) in function.blocks.iter().enumerate() {
        if let Some(id) = block.innermost_loop.and_then(|id| around[id.index()]) {
            blocks.entry(id).or_default().push(number);
        }
    }
    blocks.into_iter().collect()
}

fn promote(
    function: &mut Function,
    id: LoopId,
    blocks: &[usize],
    effects: CallEffects<'_>,
    headers: &BTreeMap<Block, LoopId>,
    ways_in: &mut WaysIn,
    known: &mut BTreeMap<Slot, Var>,
) {
    let inside: BTreeSet<usize> = blocks.iter().copied().collect();
    let chosen = choose(function, blocks, effects);
    let ways_out: usize = blocks.iter().map(|number| leaving(function, *number, &inside).len()).sum();
    let written = chosen.values().filter(|usage| usage.written).count();
    if chosen.is_empty() || ways_out.saturating_mul(written) > MOST_STORES {
        return;
    }
    let held: BTreeMap<Slot, (Var, Access)> = chosen
        .iter()
        .map(|(slot, usage)| {
            // A slot has one variable for all loops that hold it: making SSA form takes time and memory for each variable in each block.
            let ty = usage.access.storage.value_type().into();
            let var = *known.entry(*slot).or_insert_with(|| function.new_variable(ty));
            (*slot, (var, usage.access))
        })
        .collect();
    let dirty: Vec<Dirty> = chosen
        .iter()
        .filter(|(_, usage)| usage.written)
        .map(|(slot, usage)| Dirty { var: held[slot].0, slot: *slot, access: usage.access })
        .collect();
    rewrite(function, blocks, &held);
    add_write_back(function, blocks, &dirty);
    enter(function, id, &inside, &held, ways_in);
    leave(function, id, blocks, &inside, &dirty, ways_in);
    for number in blocks {
        let Some(inner) = headers.get(&Block(*number as u32)) else { continue };
        if let Some(counted) = &mut function.loops[inner.index()].counted {
            let var = match counted.control {
                Control::Slot(slot) => held.get(&slot).map(|(var, _)| *var),
                _ => None,
            };
            if let Some(var) = var {
                counted.control = Control::Var(var);
            }
        }
    }
}

/// The slots worth holding: the most used ones that no call in the loop touches.
fn choose(function: &Function, blocks: &[usize], effects: CallEffects<'_>) -> BTreeMap<Slot, Use> {
    let mut touched = Touched::default();
    let mut uses: BTreeMap<Slot, Use> = BTreeMap::new();
    for number in blocks {
        for instruction in &function.blocks[*number].instructions {
            let (slot, access, written) = match &instruction.op {
                Op::LoadSlot(slot, access) => (*slot, *access, false),
                Op::StoreSlot(slot, access, _) => (*slot, *access, true),
                op => {
                    effects.add(op, &mut touched);
                    continue;
                }
            };
            let usage = uses.entry(slot).or_insert(Use { access, count: 0, written: false });
            usage.count += 1;
            usage.written |= written;
        }
    }
    uses.retain(|slot, _| !touched.contains(*slot));
    if uses.len() > MOST_SLOTS {
        let mut order: Vec<(usize, Slot)> = uses.iter().map(|(slot, usage)| (usage.count, *slot)).collect();
        order.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
        let kept: BTreeSet<Slot> = order.into_iter().take(MOST_SLOTS).map(|(_, slot)| slot).collect();
        uses.retain(|slot, _| kept.contains(slot));
    }
    uses
}

/// The operation that gives what a load gives after a store.
pub(super) fn wrap(storage: Storage) -> Option<NumericOp> {
    match storage {
        Storage::Bool => Some(NumericOp::I32Nez),
        Storage::I8 => Some(NumericOp::I32Extend8S),
        Storage::U8 => Some(NumericOp::I32Extend8U),
        Storage::I16 => Some(NumericOp::I32Extend16S),
        Storage::U16 => Some(NumericOp::I32Extend16U),
        Storage::I32 | Storage::I64 | Storage::F32 | Storage::F64 => None,
    }
}

/// Loads and stores of held slots become reads and assignments.
fn rewrite(function: &mut Function, blocks: &[usize], held: &BTreeMap<Slot, (Var, Access)>) {
    for number in blocks {
        let before = std::mem::take(&mut function.blocks[*number].instructions);
        let mut after = Vec::with_capacity(before.len());
        for mut instruction in before {
            match &instruction.op {
                Op::LoadSlot(slot, _) => {
                    if let Some((var, _)) = held.get(slot) {
                        instruction.op = Op::Get(*var);
                    }
                }
                Op::StoreSlot(slot, access, value) => {
                    if let Some((var, _)) = held.get(slot) {
                        let mut value = *value;
                        if let Some(op) = wrap(access.storage) {
                            let wrapped = function.new_value(op.result().into());
                            let numeric = Op::Numeric(op, [value, value]);
                            let place = instruction.place;
                            after.push(Instruction { op: numeric, results: Results::One(wrapped), place });
                            value = wrapped;
                        }
                        instruction.op = Op::Set(*var, value);
                    }
                }
                _ => {}
            }
            after.push(instruction);
        }
        function.blocks[*number].instructions = after;
    }
}

/// Traps in the loop store what was changed, beside what loops around it hold.
fn add_write_back(function: &mut Function, blocks: &[usize], dirty: &[Dirty]) {
    if dirty.is_empty() {
        return;
    }
    let mut longer: BTreeMap<WriteBack, WriteBack> = BTreeMap::new();
    for number in blocks {
        let before = function.blocks[*number].write_back;
        let write_backs = &mut function.write_backs;
        let after = *longer.entry(before).or_insert_with(|| {
            let all = write_backs[before.index()].iter().chain(dirty).copied().collect();
            write_backs.push(all);
            WriteBack(write_backs.len() as u32 - 1)
        });
        function.blocks[*number].write_back = after;
    }
}

/// A block in front of the loop loads what it holds.
fn enter(
    function: &mut Function,
    id: LoopId,
    inside: &BTreeSet<usize>,
    held: &BTreeMap<Slot, (Var, Access)>,
    ways_in: &WaysIn,
) {
    let header = function.loops[id.index()].header;
    let parent = function.loops[id.index()].parent;
    let types: Vec<_> = function.blocks[header.index()].parameters.iter().map(|value| function.ty(*value)).collect();
    let parameters: Vec<Value> = types.into_iter().map(|ty| function.new_value(ty)).collect();
    let place = function.blocks[header.index()].instructions.first().map_or(Place(0), |first| first.place);
    let mut instructions = Vec::new();
    for (slot, (var, access)) in held {
        let value = function.new_value(access.storage.value_type().into());
        instructions.push(Instruction { op: Op::LoadSlot(*slot, *access), results: Results::One(value), place });
        instructions.push(Instruction { op: Op::Set(*var, value), results: Results::None, place });
    }
    let write_back =
        parent.map_or(WriteBack(0), |parent| function.blocks[function.loops[parent.index()].header.index()].write_back);
    let terminator = Terminator::Jump(Target { block: header, arguments: parameters.clone() });
    let entrance =
        function.add_block(BlockData { parameters, instructions, terminator, innermost_loop: parent, write_back });
    for number in ways_in.0.get(&header).into_iter().flatten() {
        if inside.contains(number) {
            continue;
        }
        for target in function.blocks[*number].terminator.targets_mut() {
            if target.block == header {
                target.block = entrance;
            }
        }
    }
}

/// Targets of a block that lie outside the loop, by position.
fn leaving(function: &Function, number: usize, inside: &BTreeSet<usize>) -> Vec<usize> {
    let targets = function.blocks[number].terminator.targets();
    let outside = targets.iter().enumerate().filter(|(_, target)| !inside.contains(&target.block.index()));
    outside.map(|(position, _)| position).collect()
}

/// The innermost loop that holds both a loop and a block outside of it. The block may be the header of a loop beside.
fn common_loop(function: &Function, id: LoopId, block: Block) -> Option<LoopId> {
    let mut at = function.blocks[block.index()].innermost_loop;
    while let Some(outer) = at {
        if function.loop_contains(outer, Some(id)) {
            return Some(outer);
        }
        at = function.loops[outer.index()].parent;
    }
    None
}

/// Each way out of the loop passes a block that stores what was changed.
fn leave(
    function: &mut Function,
    id: LoopId,
    blocks: &[usize],
    inside: &BTreeSet<usize>,
    dirty: &[Dirty],
    ways_in: &mut WaysIn,
) {
    if dirty.is_empty() {
        return;
    }
    for number in blocks {
        for position in leaving(function, *number, inside) {
            let target = function.blocks[*number].terminator.targets()[position].clone();
            let place = function.blocks[*number].instructions.last().map_or(Place(0), |last| last.place);
            // Nothing in the new block traps.
            let (innermost_loop, write_back) = (common_loop(function, id, target.block), WriteBack(0));
            let mut instructions = Vec::new();
            for one in dirty {
                let value = function.new_value(one.access.storage.value_type().into());
                instructions.push(Instruction { op: Op::Get(one.var), results: Results::One(value), place });
                let store = Op::StoreSlot(one.slot, one.access, value);
                instructions.push(Instruction { op: store, results: Results::None, place });
            }
            let behind = target.block;
            let terminator = Terminator::Jump(target);
            let parameters = Vec::new();
            let exit =
                function.add_block(BlockData { parameters, instructions, terminator, innermost_loop, write_back });
            ways_in.add(behind, exit);
            let mut targets = function.blocks[*number].terminator.targets_mut();
            *targets[position] = Target { block: exit, arguments: Vec::new() };
        }
    }
}
