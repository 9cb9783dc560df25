//! Constant folding: what can be computed now is; wraps that change nothing and branches that are decided go away.
//!
//! Operations are computed by the same functions that define them. An operation that would trap stays: its guard traps at run time.

use khz_bytecode::canary::{Fault, planted};
use khz_bytecode::instruction::NumericOp;
use khz_bytecode::value::{Storage, ValueType};
use khz_machine::semantics::{Value as Number, eval_numeric};

use super::ranges::{Interval, Ranges};
use crate::mir::{Const, Function, Instruction, Op, Results, Terminator, Type, Value};

/// Runs it.
pub fn run(function: &mut Function) {
    let ranges = Ranges::new(function);
    let mut fold = Fold {
        same: (0..function.values.len() as u32).map(Value).collect(),
        constants: vec![None; function.values.len()],
        ranges,
    };
    let types = function.values.clone();
    for block in &mut function.blocks {
        block.instructions.retain_mut(|instruction| fold.keep(instruction, &types));
        fold.terminator(&mut block.terminator);
    }
    // Blocks and loops that stand behind their uses in this order.
    for data in &mut function.loops {
        if let Some(counted) = &mut data.counted {
            for value in [&mut counted.initial, &mut counted.bound, &mut counted.step] {
                *value = fold.same[value.index()];
            }
        }
    }
}

struct Fold {
    /// Which value stands for each.
    same: Vec<Value>,
    constants: Vec<Option<Const>>,
    ranges: Ranges,
}

impl Fold {
    /// Simplifies an instruction; false when it is not needed any more.
    fn keep(&mut self, instruction: &mut Instruction, types: &[Type]) -> bool {
        instruction.op.for_each_operand(|value| *value = self.same[value.index()]);
        let Results::One(result) = instruction.results else { return true };
        if let Op::Numeric(op, operands) = instruction.op {
            if self.changes_nothing(op, operands[0]) {
                self.same[result.index()] = operands[0];
                return false;
            }
            if let Some(value) = self.compute(op, operands) {
                instruction.op = Op::Const(value);
            }
        }
        if let Op::Select { condition, then, otherwise } = instruction.op {
            let decided = self.constants[condition.index()].and_then(Const::as_i64);
            let chosen = decided.map(|number| if number != 0 { then } else { otherwise });
            if let Some(chosen) = chosen.or_else(|| (then == otherwise).then_some(then)) {
                self.same[result.index()] = chosen;
                return false;
            }
        }
        if let Op::Const(value) = instruction.op {
            debug_assert_eq!(value.ty(), types[result.index()]);
            self.constants[result.index()] = Some(value);
        }
        true
    }

    /// Whether a wrap's operand is in the range already.
    fn changes_nothing(&self, op: NumericOp, operand: Value) -> bool {
        let storage = match op {
            NumericOp::I32Nez if planted(Fault::Jit) => Storage::U8,
            NumericOp::I32Nez => Storage::Bool,
            NumericOp::I32Extend8S => Storage::I8,
            NumericOp::I32Extend8U => Storage::U8,
            NumericOp::I32Extend16S => Storage::I16,
            NumericOp::I32Extend16U => Storage::U16,
            _ => return false,
        };
        self.ranges.of(operand).is_inside(Interval::of_storage(storage))
    }

    fn compute(&self, op: NumericOp, operands: [Value; 2]) -> Option<Const> {
        let count = op.operands().len().min(2);
        let mut numbers = [Number::I32(0); 2];
        for (position, ty) in op.operands().iter().enumerate().take(count) {
            let constant = self.constants[operands[position].index()]?;
            numbers[position] = number(*ty, constant);
        }
        let result = eval_numeric(op, &numbers[..count]).ok()?;
        Some(Const::from_bits(op.result(), result.bits()))
    }

    fn terminator(&mut self, terminator: &mut Terminator) {
        match terminator {
            Terminator::Branch { condition, .. } => *condition = self.same[condition.index()],
            Terminator::Switch { value, .. } => *value = self.same[value.index()],
            Terminator::Return(values) => values.iter_mut().for_each(|value| *value = self.same[value.index()]),
            Terminator::Jump(_) => {}
        }
        for target in terminator.targets_mut() {
            target.arguments.iter_mut().for_each(|value| *value = self.same[value.index()]);
        }
        let decided = match terminator {
            Terminator::Branch { condition, then, otherwise } => {
                let constant = self.constants[condition.index()].and_then(Const::as_i64);
                constant.map(|number| if number != 0 { then.clone() } else { otherwise.clone() })
            }
            Terminator::Switch { value, targets, default } => {
                let constant = self.constants[value.index()].map(Const::bits);
                let chosen = |number: u64| usize::try_from(number).ok().and_then(|number| targets.get(number));
                constant.map(|number| chosen(number).unwrap_or(default).clone())
            }
            _ => None,
        };
        if let Some(target) = decided {
            *terminator = Terminator::Jump(target);
        }
    }
}

fn number(ty: ValueType, constant: Const) -> Number {
    Number::from_bits(ty, constant.bits())
}
