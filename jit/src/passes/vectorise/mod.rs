//! Loops over independent elements run several passes at once, in 128-bit vectors.
//!
//! A counted loop that steps by one, alone or with one inner counted loop (a matrix product), becomes one whose passes do the work of four (REAL)
//! or two (LREAL). Each lane computes what its pass would have computed, in the same order and with the same operations, so results are the same
//! bit for bit; sums that are carried from pass to pass stay sequential, lane after lane. Memory is the only other way from pass to pass: every
//! element that is stored is touched by its own pass alone, or the loop stays as it is.
//!
//! Nothing in such a body can trap but the look at the deadline in the header, where every variable holds what the last pass left. Code that charges
//! fuel is left alone: there each pass is charged for itself.

mod emit;
mod flatten;
mod kinds;

use crate::mir::{Block, Const, Control, Counted, Function, LoopId, Op, Results, Terminator, Type, Value, Var};

use super::ranges::Ranges;
use kinds::Kinds;

/// Most passes of a vectorised loop that are looked for: beyond it an index would not fit the analysis.
const MOST_PASSES: i64 = 1 << 24;

/// Most bodies with IFs that are tried in one function: each costs a walk over all of it.
const MOST_FLATTENED: usize = 32;

/// Runs it.
pub fn run(function: &mut Function) {
    // Other processors have other NaNs, which are made canonical operation by operation.
    if function.loops.is_empty() || !cfg!(target_arch = "x86_64") {
        return;
    }
    let ranges = Ranges::new(function);
    let mut blocks = blocks_of_loops(function);
    let (mut crossing, mut flattened) = (None, 0);
    let mut has_inner = vec![false; function.loops.len()];
    for data in &function.loops {
        if let Some(parent) = data.parent {
            has_inner[parent.index()] = true;
        }
    }
    // From the outside: what is vectorised around an inner loop leaves that one as it is.
    let mut done = vec![false; function.loops.len()];
    for number in 0..function.loops.len() {
        let id = LoopId(number as u32);
        if done[number] || countable(function, id, &ranges).is_none() {
            continue;
        }
        let crossing = crossing.get_or_insert_with(|| crossing_values(function)).as_slice();
        let may_flatten = !has_inner[number] && flattened < MOST_FLATTENED;
        let before = if may_flatten { flatten::flatten(function, id, &blocks[number]) } else { None };
        if before.is_some() {
            flattened += 1;
            blocks[number] = vec![function.loops[number].header];
        }
        let nest = Nest::find(function, id, &blocks, &ranges);
        let nest = nest.filter(|nest| nest.inner.is_none_or(|inner| !done[inner.index()]));
        let fresh = before.is_some().then(|| Ranges::new(function));
        let ranges = fresh.as_ref().unwrap_or(&ranges);
        let kinds = nest.as_ref().and_then(|nest| Kinds::find(function, nest, ranges, crossing));
        match (nest, kinds, before) {
            (Some(nest), Some(kinds), _) if emit::emit(function, &nest, &kinds) => {
                if let Some(inner) = nest.inner {
                    done[inner.index()] = true;
                }
            }
            (_, _, Some(before)) => flatten::restore(function, before),
            _ => {}
        }
    }
}

/// A loop of one block, or of three with another loop in the middle.
pub(super) struct Nest {
    pub id: LoopId,
    pub counted: Counted,
    pub control: Var,
    pub inner: Option<LoopId>,
    /// Header first, latch last.
    pub blocks: Vec<Block>,
    pub passes: i64,
}

impl Nest {
    fn find(function: &Function, id: LoopId, blocks: &[Vec<Block>], ranges: &Ranges) -> Option<Nest> {
        let (counted, passes) = countable(function, id, ranges)?;
        let Control::Var(control) = counted.control else { return None };
        let header = function.loops[id.index()].header;
        let (inner, order) = match blocks[id.index()].len() {
            1 => (None, vec![header]),
            2 => {
                let middle = single_target(function, header, ranges)?;
                let inner = function.blocks[middle.index()].innermost_loop?;
                let own = function.loops[inner.index()].parent == Some(id) && blocks[inner.index()] == [middle];
                countable(function, inner, ranges).filter(|_| own)?;
                let latch = leaves_to(function, middle)?;
                let latch_is_own = blocks[id.index()].contains(&latch) && latch != header;
                (Some(inner), if latch_is_own { vec![header, middle, latch] } else { return None })
            }
            _ => return None,
        };
        let latch = *order.last()?;
        let returns = matches!(&function.blocks[latch.index()].terminator,
            Terminator::Branch { then, .. } if then.block == header);
        let plain = order.iter().all(|block| is_plain(function, *block));
        (returns && plain).then_some(Nest { id, counted, control, inner, blocks: order, passes })
    }

    /// How many passes vectors of a type take together.
    pub fn lanes(ty: Type) -> i64 {
        if ty == Type::F32x4 { 4 } else { 2 }
    }
}

/// A loop by ones over an i32 with constant bounds, and how many passes it makes.
fn countable(function: &Function, id: LoopId, ranges: &Ranges) -> Option<(Counted, i64)> {
    let counted = function.loops[id.index()].counted?;
    let number = |value| ranges.constant(value).and_then(Const::as_i64);
    let (initial, bound, step) = (number(counted.initial)?, number(counted.bound)?, number(counted.step)?);
    let passes = bound.checked_sub(initial)?.checked_add(1)?;
    let is_plain = counted.ty == khz_bytecode::value::IntegerType::I32 && step == 1;
    // The last step must not leave the type.
    let ends = bound < i64::from(i32::MAX) - 64;
    (is_plain && ends && (1..MOST_PASSES).contains(&passes)).then_some((counted, passes))
}

/// Where a header leads to: the test whether the inner loop is empty is decided by its constants.
fn single_target(function: &Function, block: Block, ranges: &Ranges) -> Option<Block> {
    let data = &function.blocks[block.index()];
    match &data.terminator {
        Terminator::Jump(target) => Some(target.block),
        Terminator::Branch { condition, otherwise, .. } => {
            let test = data.instructions.iter().rev().find_map(|instruction| match &instruction.op {
                Op::ForIsEmpty(test) if instruction.results == Results::One(*condition) => Some(*test),
                _ => None,
            })?;
            let number = |value| ranges.constant(value).and_then(Const::as_i64);
            let runs = test.ty.is_signed() && number(test.step)? > 0 && number(test.control)? <= number(test.bound)?;
            runs.then_some(otherwise.block)
        }
        _ => None,
    }
}

/// Where a loop of one block leaves to.
fn leaves_to(function: &Function, block: Block) -> Option<Block> {
    match &function.blocks[block.index()].terminator {
        Terminator::Branch { then, otherwise, .. } if then.block == block => Some(otherwise.block),
        _ => None,
    }
}

fn is_plain(function: &Function, block: Block) -> bool {
    let data = &function.blocks[block.index()];
    data.parameters.is_empty() && data.terminator.targets().iter().all(|target| target.arguments.is_empty())
}

/// Blocks whose innermost loop each loop is.
fn blocks_of_loops(function: &Function) -> Vec<Vec<Block>> {
    let mut blocks = vec![Vec::new(); function.loops.len()];
    for (number, block) in function.blocks.iter().enumerate() {
        if let Some(id) = block.innermost_loop {
            blocks[id.index()].push(Block(number as u32));
        }
    }
    // A loop with more inner loops than one has more blocks than are looked for, or is refused by its shape.
    blocks
}

/// Which values are used in another loop than their own.
fn crossing_values(function: &mut Function) -> Vec<bool> {
    let mut home: Vec<Option<LoopId>> = vec![None; function.values.len()];
    for block in &function.blocks {
        for instruction in &block.instructions {
            for value in instruction.results.as_slice() {
                home[value.index()] = block.innermost_loop;
            }
        }
    }
    let mut crossing = vec![false; function.values.len()];
    for block in &mut function.blocks {
        let here = block.innermost_loop;
        let mut see = |value: &mut Value| {
            crossing[value.index()] |= home[value.index()] != here;
        };
        for instruction in &mut block.instructions {
            instruction.op.for_each_operand(&mut see);
        }
        match &mut block.terminator {
            Terminator::Branch { condition, .. } => see(condition),
            Terminator::Switch { value, .. } => see(value),
            Terminator::Return(values) => values.iter_mut().for_each(&mut see),
            Terminator::Jump(_) => {}
        }
        for target in block.terminator.targets_mut() {
            target.arguments.iter_mut().for_each(&mut see);
        }
    }
    crossing
}
