//! Jump threading: where a block asks a variable that the way into it has just set to a constant, that way goes on without asking. So the flag that
//! ends a WHILE loop leaves the loop at once.
//!
//! What the block charges is charged on the way as well; the look at the deadline is left out, since the way leaves the loop or goes forward.

use crate::mir::{Block, BlockData, Const, Function, Instruction, LoopId, Op, Results, Target, Terminator, Value, Var};

/// Most empty blocks in a row that are skipped: bounds the work.
const MOST_EMPTY: usize = 8;

/// Runs it.
pub fn run(function: &mut Function) {
    skip_empty(function);
    let headers = headers(function);
    let asks: Vec<Option<Asks>> = (0..function.blocks.len()).map(|number| asks(function, number)).collect();
    for number in 0..asks.len() {
        let Terminator::Jump(target) = &function.blocks[number].terminator else { continue };
        let asking = target.block;
        let Some(asked) = asks.get(asking.index()).and_then(Option::as_ref) else { continue };
        let Some(known) = set_last(&function.blocks[number], asked.var) else { continue };
        let chosen = if known != 0 { asked.then } else { asked.otherwise };
        let around = function.blocks[chosen.index()].innermost_loop;
        let leaves = headers[asking.index()].is_none_or(|id| !function.loop_contains(id, around));
        if leaves && asking.index() != number {
            let way = way(function, asking, chosen);
            function.blocks[number].terminator = Terminator::Jump(Target { block: way, arguments: Vec::new() });
        }
    }
}

/// A block that does nothing but ask a variable.
struct Asks {
    var: Var,
    then: Block,
    otherwise: Block,
}

fn asks(function: &Function, number: usize) -> Option<Asks> {
    let block = &function.blocks[number];
    let Terminator::Branch { condition, then, otherwise } = &block.terminator else { return None };
    let plain = block.parameters.is_empty() && then.arguments.is_empty() && otherwise.arguments.is_empty();
    let asked = |instruction: &Instruction| match instruction.op {
        Op::Get(var) if instruction.results == Results::One(*condition) => Some(var),
        _ => None,
    };
    let short = block.instructions.len() <= 2;
    let only_asks = block.instructions.iter().all(|i| matches!(i.op, Op::Checkpoint { .. }) || asked(i).is_some());
    let var = block.instructions.iter().find_map(asked)?;
    let no_crossing = short && only_asks && plain;
    no_crossing.then_some(Asks { var, then: then.block, otherwise: otherwise.block })
}

/// The constant that a block's last assignment of a variable gives it.
fn set_last(block: &BlockData, var: Var) -> Option<i64> {
    let mut instructions = block.instructions.iter().rev();
    let value: Value = instructions.find_map(|instruction| match instruction.op {
        Op::Set(to, value) if to == var => Some(value),
        _ => None,
    })?;
    block.instructions.iter().find_map(|instruction| match instruction.op {
        Op::Const(constant) if instruction.results == Results::One(value) => Const::as_i64(constant),
        _ => None,
    })
}

/// A block that charges what the asking one does and goes on to what it would have chosen.
fn way(function: &mut Function, asking: Block, chosen: Block) -> Block {
    let asked = &function.blocks[asking.index()];
    let charges = asked.instructions.iter().filter_map(|instruction| match instruction.op {
        Op::Checkpoint { fuel, .. } => {
            Some(Instruction { op: Op::Checkpoint { fuel, deadline: false }, ..instruction.clone() })
        }
        _ => None,
    });
    let block = BlockData {
        parameters: Vec::new(),
        instructions: charges.collect(),
        terminator: Terminator::Jump(Target { block: chosen, arguments: Vec::new() }),
        innermost_loop: function.blocks[chosen.index()].innermost_loop,
        write_back: asked.write_back,
    };
    function.add_block(block)
}

fn headers(function: &Function) -> Vec<Option<LoopId>> {
    let mut headers = vec![None; function.blocks.len()];
    for (number, data) in function.loops.iter().enumerate() {
        headers[data.header.index()] = Some(LoopId(number as u32));
    }
    headers
}

/// Ways into blocks that only lead on lead on at once.
fn skip_empty(function: &mut Function) {
    let leads: Vec<Option<Block>> = function
        .blocks
        .iter()
        .map(|block| match &block.terminator {
            Terminator::Jump(target)
                if block.instructions.is_empty() && block.parameters.is_empty() && target.arguments.is_empty() =>
            {
                Some(target.block)
            }
            _ => None,
        })
        .collect();
    for block in &mut function.blocks {
        for target in block.terminator.targets_mut() {
            for _ in 0..MOST_EMPTY {
                match leads[target.block.index()] {
                    Some(next) if target.arguments.is_empty() => target.block = next,
                    _ => break,
                }
            }
        }
    }
}
