//! Guards that repeat: what has been checked on the one way to a place is not checked again there.
//!
//! Values are the same when they are the same operation on the same values, and reads of a variable when nothing was assigned between. What is
//! known at a block's end holds in each block that only it leads to.

use std::collections::{BTreeMap, BTreeSet};

use khz_bytecode::instruction::NumericOp;

use crate::mir::{Block, Const, Function, Op, Results, Value, Var};

/// Most facts that are handed on: bounds the work in long straight-line code.
const MOST_FACTS: usize = 256;

/// What is known at a place.
#[derive(Debug, Clone, Default)]
struct Known {
    variables: BTreeMap<Var, Value>,
    operations: BTreeMap<(NumericOp, Value, Value), Value>,
    constants: BTreeMap<(u8, u64), Value>,
    /// Checked indices with their bounds.
    indices: BTreeSet<(Value, i32, i32)>,
    divisors: BTreeSet<Value>,
}

impl Known {
    fn len(&self) -> usize {
        self.variables.len() + self.operations.len() + self.constants.len() + self.indices.len()
    }
}

/// Runs it.
pub fn run(function: &mut Function) {
    let has_guards = function.blocks.iter().flat_map(|block| &block.instructions);
    let guards = has_guards.filter(|i| matches!(i.op, Op::CheckIndex { .. } | Op::CheckDivisor(_))).count();
    if guards < 2 {
        return;
    }
    let single = single_ways(function);
    let mut same: Vec<Value> = (0..function.values.len() as u32).map(Value).collect();
    let mut open: Vec<(Block, Known)> = vec![(Block(0), Known::default())];
    let mut seen = vec![false; function.blocks.len()];
    while let Some((block, mut known)) = open.pop() {
        if std::mem::replace(&mut seen[block.index()], true) {
            continue;
        }
        let data = &mut function.blocks[block.index()];
        data.instructions.retain(|instruction| keep(&instruction.op, &instruction.results, &mut known, &mut same));
        if known.len() > MOST_FACTS {
            known = Known::default();
        }
        for target in data.terminator.targets() {
            let handed = if single[target.block.index()] { known.clone() } else { Known::default() };
            open.push((target.block, handed));
        }
    }
}

/// Notes what an instruction says; false when it is a guard that repeats.
fn keep(op: &Op, results: &Results, known: &mut Known, same: &mut [Value]) -> bool {
    let of = |value: Value, same: &[Value]| same[value.index()];
    match (op, results) {
        (Op::Get(var), Results::One(result)) => {
            same[result.index()] = *known.variables.entry(*var).or_insert(*result);
        }
        (Op::Set(var, value), _) => {
            known.variables.insert(*var, of(*value, same));
        }
        (Op::Const(Const::I32(_) | Const::I64(_)), Results::One(result)) => {
            let Op::Const(constant) = op else { return true };
            let key = (constant.ty() as u8, constant.bits());
            same[result.index()] = *known.constants.entry(key).or_insert(*result);
        }
        (Op::Numeric(op, [a, b]), Results::One(result)) => {
            let key = (*op, of(*a, same), of(*b, same));
            same[result.index()] = *known.operations.entry(key).or_insert(*result);
        }
        (Op::CheckIndex { index, lower, upper }, _) => return known.indices.insert((of(*index, same), *lower, *upper)),
        (Op::CheckDivisor(value), _) => return known.divisors.insert(of(*value, same)),
        _ => {}
    }
    true
}

/// Blocks that exactly one way leads into.
pub(super) fn single_ways(function: &Function) -> Vec<bool> {
    let mut ways = vec![0usize; function.blocks.len()];
    for block in &function.blocks {
        for target in block.terminator.targets() {
            ways[target.block.index()] += 1;
        }
    }
    ways.into_iter().map(|count| count == 1).collect()
}
