//! Short integer IFs become selects: an unpredictable branch costs more than a few operations that were not needed.
//!
//! Only arms of pure integer operations on variables; predictable clamps of floats stay branches.

use std::collections::BTreeMap;

use khz_bytecode::instruction::NumericOp;
use khz_bytecode::value::ValueType;

use crate::mir::{Block, Function, Instruction, Op, Place, Results, Target, Terminator, Type, Value, Var};

/// Most operations of an arm, reads and assignments not counted.
const MOST_OPERATIONS: usize = 4;
/// Most variables that the arms assign together.
const MOST_VARIABLES: usize = 2;

/// Runs it.
pub fn run(function: &mut Function) {
    let entered = ways_in(function);
    // Inner IFs stand behind the outer ones, so from the end an inner one is gone before its outer one is looked at.
    for number in (0..function.blocks.len()).rev() {
        if let Some(shape) = shape(function, number, &entered) {
            convert(function, number, &shape);
        }
    }
}

/// How many ways lead into each block.
fn ways_in(function: &Function) -> Vec<usize> {
    let mut entered = vec![0; function.blocks.len()];
    for block in &function.blocks {
        for target in block.terminator.targets() {
            entered[target.block.index()] += 1;
        }
    }
    entered
}

/// An IF: its arms (none: straight to the end) and where both lead.
struct Shape {
    condition: Value,
    then: Option<Block>,
    otherwise: Option<Block>,
    end: Block,
}

fn shape(function: &Function, number: usize, entered: &[usize]) -> Option<Shape> {
    let Terminator::Branch { condition, then, otherwise } = &function.blocks[number].terminator else { return None };
    let arm = |target: &Target| arm_end(function, number, target, entered);
    let (then_end, otherwise_end) = (arm(then), arm(otherwise));
    let straight = |target: &Target| target.arguments.is_empty().then_some(target.block);
    let (then_arm, otherwise_arm, end) = match (then_end, otherwise_end) {
        (Some(a), Some(b)) if a == b => (Some(then.block), Some(otherwise.block), a),
        (Some(end), _) if straight(otherwise) == Some(end) => (Some(then.block), None, end),
        (_, Some(end)) if straight(then) == Some(end) => (None, Some(otherwise.block), end),
        _ => return None,
    };
    let of = |arm: Option<Block>| arm.map_or_else(Vec::new, |arm| assigned(function, arm));
    let mut variables = of(then_arm);
    variables.extend(of(otherwise_arm));
    variables.sort_unstable();
    variables.dedup();
    let all_integers = variables.iter().all(|var| matches!(function.variables[var.index()], Type::I32 | Type::I64));
    let few = !variables.is_empty() && variables.len() <= MOST_VARIABLES;
    (few && all_integers).then_some(Shape { condition: *condition, then: then_arm, otherwise: otherwise_arm, end })
}

/// Where an arm leads, if it is short, pure and entered from here only.
fn arm_end(function: &Function, from: usize, target: &Target, entered: &[usize]) -> Option<Block> {
    let block = &function.blocks[target.block.index()];
    let own = target.arguments.is_empty() && block.parameters.is_empty() && entered[target.block.index()] == 1;
    let same_loop = block.innermost_loop == function.blocks[from].innermost_loop;
    let operations = block.instructions.iter().filter(|i| matches!(i.op, Op::Numeric(..) | Op::Select { .. })).count();
    if !own || !same_loop || operations > MOST_OPERATIONS || !block.instructions.iter().all(|i| is_pure(&i.op)) {
        return None;
    }
    match &block.terminator {
        Terminator::Jump(end) if end.arguments.is_empty() => Some(end.block),
        _ => None,
    }
}

fn is_pure(op: &Op) -> bool {
    match op {
        Op::Const(_) | Op::Get(_) | Op::Set(..) | Op::Select { .. } => true,
        Op::Numeric(op, _) => {
            let is_integer = |ty: ValueType| matches!(ty, ValueType::I32 | ValueType::I64);
            let cheap = !matches!(op, NumericOp::I32Mul | NumericOp::I64Mul);
            cheap && op.trap().is_none() && is_integer(op.result()) && op.operands().iter().all(|ty| is_integer(*ty))
        }
        _ => false,
    }
}

fn assigned(function: &Function, arm: Block) -> Vec<Var> {
    let instructions = function.blocks[arm.index()].instructions.iter();
    instructions.filter_map(|i| if let Op::Set(var, _) = i.op { Some(var) } else { None }).collect()
}

/// Moves both arms in front of the end and selects what each variable becomes.
fn convert(function: &mut Function, number: usize, shape: &Shape) {
    let place = function.blocks[number].instructions.last().map_or(Place(0), |last| last.place);
    let then = shape.then.map(|arm| flatten(function, number, arm)).unwrap_or_default();
    let otherwise = shape.otherwise.map(|arm| flatten(function, number, arm)).unwrap_or_default();
    let mut variables: Vec<Var> = then.keys().chain(otherwise.keys()).copied().collect();
    variables.sort_unstable();
    variables.dedup();
    let mut chosen = Vec::new();
    for var in variables {
        let ty = function.variables[var.index()];
        let value_of = |values: &BTreeMap<Var, Value>, function: &mut Function| match values.get(&var) {
            Some(value) => *value,
            None => define(function, number, ty, Op::Get(var), place),
        };
        let then = value_of(&then, function);
        let otherwise = value_of(&otherwise, function);
        let select = Op::Select { condition: shape.condition, then, otherwise };
        chosen.push((var, define(function, number, ty, select, place)));
    }
    let block = &mut function.blocks[number];
    let sets = chosen.into_iter().map(|(var, value)| Op::Set(var, value));
    block.instructions.extend(sets.map(|op| Instruction { op, results: Results::None, place }));
    block.terminator = Terminator::Jump(Target { block: shape.end, arguments: Vec::new() });
}

fn define(function: &mut Function, block: usize, ty: Type, op: Op, place: Place) -> Value {
    let value = function.new_value(ty);
    function.blocks[block].instructions.push(Instruction { op, results: Results::One(value), place });
    value
}

/// Appends an arm without its assignments; gives what each variable would be at its end.
fn flatten(function: &mut Function, into: usize, arm: Block) -> BTreeMap<Var, Value> {
    let instructions = std::mem::take(&mut function.blocks[arm.index()].instructions);
    let mut values: BTreeMap<Var, Value> = BTreeMap::new();
    // Reads behind an assignment in the arm give what was assigned.
    let mut same: BTreeMap<Value, Value> = BTreeMap::new();
    for mut instruction in instructions {
        instruction.op.for_each_operand(|value| *value = same.get(value).copied().unwrap_or(*value));
        match (&instruction.op, &instruction.results) {
            (Op::Set(var, value), _) => {
                values.insert(*var, *value);
            }
            (Op::Get(var), Results::One(result)) if values.contains_key(var) => {
                same.insert(*result, values[var]);
            }
            _ => function.blocks[into].instructions.push(instruction),
        }
    }
    // Values of the arm that blocks behind it use: an arm has no parameters to its end, so only these.
    debug_assert!(same.keys().all(|value| !values.values().any(|other| other == value)));
    values
}
