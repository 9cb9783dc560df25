//! NOT of a BOOL becomes an exclusive OR with 1, except where a branch or a select asks for it, which test for zero anyway.

use khz_bytecode::instruction::NumericOp;

use super::ranges::{Interval, Ranges};
use crate::mir::{Const, Function, Instruction, Op, Results, Terminator, Type, Value};

/// Runs it.
pub fn run(function: &mut Function) {
    let ranges = Ranges::new(function);
    let asked = conditions(function);
    let mut values = std::mem::take(&mut function.values);
    for block in &mut function.blocks {
        let is_not = |instruction: &Instruction| match (&instruction.op, &instruction.results) {
            (Op::Numeric(NumericOp::I32Eqz, [operand, _]), Results::One(result)) => {
                let is_bool = ranges.of(*operand).is_inside(Interval { low: 0, high: 1 });
                is_bool && !asked[result.index()]
            }
            _ => false,
        };
        if !block.instructions.iter().any(is_not) {
            continue;
        }
        let before = std::mem::take(&mut block.instructions);
        for mut instruction in before {
            if is_not(&instruction) {
                values.push(Type::I32);
                let one = Value(values.len() as u32 - 1);
                let place = instruction.place;
                let constant = Op::Const(Const::I32(1));
                block.instructions.push(Instruction { op: constant, results: Results::One(one), place });
                if let Op::Numeric(op, [operand, other]) = &mut instruction.op {
                    (*op, *other) = (NumericOp::I32Xor, one);
                    debug_assert_ne!(*operand, one);
                }
            }
            block.instructions.push(instruction);
        }
    }
    function.values = values;
}

/// Which values branches and selects ask.
fn conditions(function: &Function) -> Vec<bool> {
    let mut asked = vec![false; function.values.len()];
    for block in &function.blocks {
        for instruction in &block.instructions {
            if let Op::Select { condition, .. } = instruction.op {
                asked[condition.index()] = true;
            }
        }
        if let Terminator::Branch { condition, .. } = block.terminator {
            asked[condition.index()] = true;
        }
    }
    asked
}
