//! IFs in the body of a loop become selects, stores in their arms included, so that the body is one block. Only worth it in vectors: whoever calls
//! this puts the blocks back where none come of it.

use std::collections::BTreeMap;

use khz_bytecode::value::Storage;

use crate::mir::{Block, BlockData, Function, Instruction, LoopId, Op, Place, Results, Target, Terminator, Value, Var};

/// Most blocks of a body that is looked at.
const MOST_BLOCKS: usize = 24;
/// Most instructions of an arm.
const MOST_INSTRUCTIONS: usize = 24;

/// Makes the blocks of a loop one; gives them as they were, or nothing where it can not be done and nothing was changed.
pub(super) fn flatten(function: &mut Function, id: LoopId, blocks: &[Block]) -> Option<Vec<(Block, BlockData)>> {
    if blocks.len() > MOST_BLOCKS || blocks.len() < 3 {
        return None;
    }
    let header = function.loops[id.index()].header;
    let before: Vec<(Block, BlockData)> =
        blocks.iter().map(|block| (*block, function.blocks[block.index()].clone())).collect();
    let mut alive: Vec<Block> = blocks.to_vec();
    while alive.len() > 1 {
        if !step(function, header, &mut alive) {
            restore(function, before);
            return None;
        }
    }
    Some(before)
}

/// Puts blocks back.
pub(super) fn restore(function: &mut Function, before: Vec<(Block, BlockData)>) {
    for (block, data) in before {
        function.blocks[block.index()] = data;
    }
}

/// Joins a block with the only one behind it, or makes an IF selects; false when there is nothing left to do.
fn step(function: &mut Function, header: Block, alive: &mut Vec<Block>) -> bool {
    let mut ways: BTreeMap<Block, usize> = BTreeMap::from([(header, 1)]);
    for block in alive.iter() {
        for target in function.blocks[block.index()].terminator.targets() {
            *ways.entry(target.block).or_default() += 1;
        }
    }
    let inside = |block: Block| alive.contains(&block) && block != header;
    for position in (0..alive.len()).rev() {
        let block = alive[position];
        let gone = match &function.blocks[block.index()].terminator {
            Terminator::Jump(target) if inside(target.block) && ways[&target.block] == 1 => {
                let next = target.block;
                join(function, block, next);
                vec![next]
            }
            Terminator::Branch { then, otherwise, .. } if inside(then.block) && inside(otherwise.block) => {
                let Some(shape) = Shape::find(function, block, &ways) else { continue };
                shape.convert(function, block);
                shape.arms.iter().flatten().copied().collect()
            }
            _ => continue,
        };
        for block in &gone {
            discard(function, *block);
        }
        alive.retain(|block| !gone.contains(block));
        return true;
    }
    false
}

fn join(function: &mut Function, block: Block, next: Block) {
    let instructions = std::mem::take(&mut function.blocks[next.index()].instructions);
    let terminator = function.blocks[next.index()].terminator.clone();
    let joined = &mut function.blocks[block.index()];
    joined.instructions.extend(instructions);
    joined.terminator = terminator;
}

/// Nothing leads to a discarded block, and it leads nowhere.
fn discard(function: &mut Function, block: Block) {
    let data = &mut function.blocks[block.index()];
    data.instructions.clear();
    data.terminator = Terminator::Jump(Target { block, arguments: Vec::new() });
    data.innermost_loop = None;
}

/// An IF: its arms, where it has them, and where both lead.
struct Shape {
    condition: Value,
    arms: [Option<Block>; 2],
    end: Block,
}

impl Shape {
    fn find(function: &Function, block: Block, ways: &BTreeMap<Block, usize>) -> Option<Shape> {
        let Terminator::Branch { condition, then, otherwise } = &function.blocks[block.index()].terminator else {
            return None;
        };
        let ends = [then, otherwise].map(|target| arm_end(function, target.block, ways));
        let (arms, end) = match ends {
            [Some(a), Some(b)] if a == b => ([Some(then.block), Some(otherwise.block)], a),
            [Some(end), _] if otherwise.block == end => ([Some(then.block), None], end),
            [_, Some(end)] if then.block == end => ([None, Some(otherwise.block)], end),
            _ => return None,
        };
        Some(Shape { condition: *condition, arms, end })
    }

    /// Appends both arms, what they store and assign chosen by the condition.
    fn convert(&self, function: &mut Function, block: Block) {
        let place = function.blocks[block.index()].instructions.last().map_or(Place(0), |last| last.place);
        let mut assigned: [BTreeMap<Var, Value>; 2] = Default::default();
        for (position, arm) in self.arms.iter().enumerate() {
            if let Some(arm) = arm {
                let instructions = std::mem::take(&mut function.blocks[arm.index()].instructions);
                assigned[position] = self.arm(function, block, instructions, position == 0);
            }
        }
        let mut variables: Vec<Var> = assigned.iter().flat_map(BTreeMap::keys).copied().collect();
        variables.sort_unstable();
        variables.dedup();
        let mut chosen = Vec::new();
        for var in variables {
            let ty = function.variables[var.index()];
            let values = assigned.each_ref().map(|values| match values.get(&var) {
                Some(value) => *value,
                None => define(function, block, ty, Op::Get(var), place),
            });
            let select = Op::Select { condition: self.condition, then: values[0], otherwise: values[1] };
            chosen.push((var, define(function, block, ty, select, place)));
        }
        let data = &mut function.blocks[block.index()];
        let sets = chosen.into_iter().map(|(var, value)| Op::Set(var, value));
        data.instructions.extend(sets.map(|op| Instruction { op, results: Results::None, place }));
        data.terminator = Terminator::Jump(Target { block: self.end, arguments: Vec::new() });
    }

    fn arm(&self, function: &mut Function, into: Block, arm: Vec<Instruction>, is_then: bool) -> BTreeMap<Var, Value> {
        let mut values: BTreeMap<Var, Value> = BTreeMap::new();
        // Reads behind an assignment in the arm give what was assigned.
        let mut same: BTreeMap<Value, Value> = BTreeMap::new();
        for mut instruction in arm {
            instruction.op.for_each_operand(|value| *value = same.get(value).copied().unwrap_or(*value));
            match (&instruction.op, &instruction.results) {
                (Op::Set(var, value), _) => {
                    values.insert(*var, *value);
                }
                (Op::Get(var), Results::One(result)) if values.contains_key(var) => {
                    same.insert(*result, values[var]);
                }
                (Op::Store(address, access, value), _) => {
                    let (address, access, value) = (*address, *access, *value);
                    let ty = function.ty(value);
                    let old = define(function, into, ty, Op::Load(address, access), instruction.place);
                    let (then, otherwise) = if is_then { (value, old) } else { (old, value) };
                    let select = Op::Select { condition: self.condition, then, otherwise };
                    let kept = define(function, into, ty, select, instruction.place);
                    instruction.op = Op::Store(address, access, kept);
                    function.blocks[into.index()].instructions.push(instruction);
                }
                _ => function.blocks[into.index()].instructions.push(instruction),
            }
        }
        values
    }
}

fn define(function: &mut Function, block: Block, ty: crate::mir::Type, op: Op, place: Place) -> Value {
    let value = function.new_value(ty);
    function.blocks[block.index()].instructions.push(Instruction { op, results: Results::One(value), place });
    value
}

/// Where an arm leads, if only one way enters it and it does nothing but compute, read and store floats.
fn arm_end(function: &Function, arm: Block, ways: &BTreeMap<Block, usize>) -> Option<Block> {
    let data = &function.blocks[arm.index()];
    let is_float = |storage: Storage| matches!(storage, Storage::F32 | Storage::F64);
    let harmless = |instruction: &Instruction| match &instruction.op {
        Op::Const(_) | Op::Get(_) | Op::Set(..) | Op::Select { .. } => true,
        Op::Numeric(op, _) => op.trap().is_none(),
        Op::Load(_, access) | Op::Store(_, access, _) => is_float(access.storage) && !access.canonicalise,
        _ => false,
    };
    let short = data.instructions.len() <= MOST_INSTRUCTIONS && data.parameters.is_empty();
    let fits = short && ways.get(&arm) == Some(&1) && data.instructions.iter().all(harmless);
    match &data.terminator {
        Terminator::Jump(end) if fits && end.arguments.is_empty() => Some(end.block),
        _ => None,
    }
}
