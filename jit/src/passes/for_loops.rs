//! FOR loops become plain arithmetic: a test at the bottom that is one comparison where the step is a constant, and a control variable that is
//! carried as an i64, so that addresses need no extension.

use std::collections::BTreeMap;

use khz_bytecode::instruction::NumericOp;
use khz_bytecode::value::{IntegerType, ValueType};

use super::ranges::{MOST_LEVELS, Ranges};
use crate::mir::{
    Block, BlockData, Const, Control, Counted, ForTest, Function, Instruction, LoopId, Op, Place, Results, Type, Value,
    Var,
};

/// Runs it.
pub fn run(function: &mut Function) {
    let ranges = Ranges::new(function);
    expand_tests(function, &ranges);
    let wide: Vec<(LoopId, Counted, Var, i64)> = (0..function.loops.len() as u32)
        .map(LoopId)
        .filter_map(|id| {
            let counted = function.loops[id.index()].counted?;
            let step = ranges.constant(counted.step).and_then(Const::as_i64)?;
            let Control::Var(var) = counted.control else { return None };
            let carried = matches!(counted.ty, IntegerType::I8 | IntegerType::I16 | IntegerType::I32)
                || matches!(counted.ty, IntegerType::U8 | IntegerType::U16);
            (carried && ranges.bound_is_in_type(&counted)).then_some((id, counted, var, step))
        })
        .collect();
    if !wide.is_empty() {
        widen(function, &wide);
    }
}

/// Instructions in the making.
struct Emit<'a> {
    values: &'a mut Vec<Type>,
    out: &'a mut Vec<Instruction>,
    place: Place,
}

impl Emit<'_> {
    fn value(&mut self, ty: Type, op: Op) -> Value {
        self.values.push(ty);
        let value = Value(self.values.len() as u32 - 1);
        self.out.push(Instruction { op, results: Results::One(value), place: self.place });
        value
    }

    fn binary(&mut self, op: NumericOp, a: Value, b: Value) -> Value {
        self.value(op.result().into(), Op::Numeric(op, [a, b]))
    }

    fn unary(&mut self, op: NumericOp, a: Value) -> Value {
        self.value(op.result().into(), Op::Numeric(op, [a, a]))
    }

    fn i64(&mut self, number: i64) -> Value {
        self.value(Type::I64, Op::Const(Const::I64(number)))
    }

    fn i32(&mut self, number: i32) -> Value {
        self.value(Type::I32, Op::Const(Const::I32(number)))
    }
}

/// Tests with a constant step become comparisons.
fn expand_tests(function: &mut Function, ranges: &Ranges) {
    let mut values = std::mem::take(&mut function.values);
    for block in &mut function.blocks {
        let is_test = |i: &Instruction| matches!(i.op, Op::ForIsEmpty(_) | Op::ForContinues(_));
        if !block.instructions.iter().any(is_test) {
            continue;
        }
        let before = std::mem::take(&mut block.instructions);
        for mut instruction in before {
            let mut emit = Emit { values: &mut values, out: &mut block.instructions, place: instruction.place };
            let op = match &instruction.op {
                Op::ForIsEmpty(test) => is_empty(test, ranges),
                Op::ForContinues(test) => continues(test, ranges, &mut emit),
                _ => None,
            };
            if let Some(op) = op {
                instruction.op = op;
            }
            block.instructions.push(instruction);
        }
    }
    function.values = values;
}

fn step_of(test: &ForTest, ranges: &Ranges) -> Option<i64> {
    ranges.constant(test.step).and_then(Const::as_i64).filter(|step| *step != 0)
}

fn is_empty(test: &ForTest, ranges: &Ranges) -> Option<Op> {
    use NumericOp as N;
    let is_wide = test.ty.value_type() == ValueType::I64;
    let op = match (step_of(test, ranges)? > 0, is_wide, test.ty.is_signed()) {
        (true, false, true) => N::I32GtS,
        (true, false, false) => N::I32GtU,
        (true, true, true) => N::I64GtS,
        (true, true, false) => N::I64GtU,
        (false, false, true) => N::I32LtS,
        (false, false, false) => N::I32LtU,
        (false, true, true) => N::I64LtS,
        (false, true, false) => N::I64LtU,
    };
    Some(Op::Numeric(op, [test.control, test.bound]))
}

fn continues(test: &ForTest, ranges: &Ranges, emit: &mut Emit<'_>) -> Option<Op> {
    use NumericOp as N;
    let step = step_of(test, ranges)?;
    if test.ty.value_type() == ValueType::I64 {
        if !test.not_passed {
            return None;
        }
        // The bound is not passed, so the distance is exact as an unsigned number.
        let (high, low) = if step > 0 { (test.bound, test.control) } else { (test.control, test.bound) };
        let distance = emit.binary(N::I64Sub, high, low);
        let size = emit.i64(step.unsigned_abs() as i64);
        return Some(Op::Numeric(N::I64GeU, [distance, size]));
    }
    let compare_narrow = if step > 0 { N::I32LeS } else { N::I32GeS };
    if test.not_passed && stays_narrow(test, step, ranges) {
        let step = emit.i32(step as i32);
        let next = emit.binary(N::I32Add, test.control, step);
        return Some(Op::Numeric(compare_narrow, [next, test.bound]));
    }
    // Sums of two 32-bit numbers are exact in 64 bits; a bound that is passed already fails the same comparison.
    let extend = if test.ty.is_signed() { N::I64ExtendI32S } else { N::I64ExtendI32U };
    let control = emit.unary(extend, test.control);
    let step_value = emit.i64(step);
    let next = emit.binary(N::I64Add, control, step_value);
    let bound = emit.unary(extend, test.bound);
    Some(Op::Numeric(if step > 0 { N::I64LeS } else { N::I64GeS }, [next, bound]))
}

/// Whether bound + step is an i32 for certain, and the order that of i32.
fn stays_narrow(test: &ForTest, step: i64, ranges: &Ranges) -> bool {
    let bound = ranges.of(test.bound);
    let fits = |number: i64| i32::try_from(number).is_ok();
    let in_order = test.ty.is_signed() || (bound.low >= 0 && test.ty != IntegerType::U32);
    in_order && fits(bound.low.saturating_add(step)) && fits(bound.high.saturating_add(step))
}

/// Gives each loop an i64 that runs beside its control variable, and takes it wherever the control variable would be extended.
fn widen(function: &mut Function, loops: &[(LoopId, Counted, Var, i64)]) {
    let mut ways: BTreeMap<Block, Vec<usize>> = BTreeMap::new();
    for (id, ..) in loops {
        ways.insert(function.loops[id.index()].header, Vec::new());
    }
    for (number, block) in function.blocks.iter().enumerate() {
        for target in block.terminator.targets() {
            if let Some(ways) = ways.get_mut(&target.block) {
                ways.push(number);
            }
        }
    }
    let mut shadows: Shadows = BTreeMap::new();
    for (id, counted, var, step) in loops {
        let shadow = function.new_variable(Type::I64);
        let ways = ways.remove(&function.loops[id.index()].header).unwrap_or_default();
        if carry(function, *id, counted, (*var, shadow), *step, ways) {
            shadows.insert(*id, (*var, shadow));
        }
    }
    take_shadows(function, &shadows);
}

/// Control variable and shadow of each loop that has one.
type Shadows = BTreeMap<LoopId, (Var, Var)>;

/// Sets the shadow before the loop, moves it on in the latch, and derives the control variable from it in the header. `ways`: the blocks that
/// lead to the header.
fn carry(
    function: &mut Function,
    id: LoopId,
    counted: &Counted,
    (var, shadow): (Var, Var),
    step: i64,
    ways: Vec<usize>,
) -> bool {
    let header = function.loops[id.index()].header;
    let (inside, outside): (Vec<usize>, Vec<usize>) =
        ways.into_iter().partition(|number| function.loop_contains(id, function.blocks[*number].innermost_loop));
    let [latch] = inside[..] else { return false };
    let is_step = |i: &Instruction| matches!(i.op, Op::Set(to, _) if to == var);
    let Some(at) = function.blocks[latch].instructions.iter().rposition(is_step) else { return false };
    for number in outside {
        let place = last_place(&function.blocks[number]);
        append(function, number, place, |emit| {
            let wide = emit.unary(NumericOp::I64ExtendI32S, counted.initial);
            set(emit, shadow, wide);
        });
    }
    let place = function.blocks[latch].instructions[at].place;
    insert(function, latch, at, place, |emit| {
        let before = emit.value(Type::I64, Op::Get(shadow));
        let step = emit.i64(step);
        let next = emit.binary(NumericOp::I64Add, before, step);
        set(emit, shadow, next);
    });
    let place = Place(0);
    insert(function, header.index(), 0, place, |emit| {
        let wide = emit.value(Type::I64, Op::Get(shadow));
        let narrow = emit.unary(NumericOp::I32WrapI64, wide);
        set(emit, var, narrow);
    });
    true
}

fn set(emit: &mut Emit<'_>, var: Var, value: Value) {
    emit.out.push(Instruction { op: Op::Set(var, value), results: Results::None, place: emit.place });
}

fn last_place(block: &BlockData) -> Place {
    block.instructions.last().map_or(Place(0), |instruction| instruction.place)
}

fn append(function: &mut Function, block: usize, place: Place, f: impl FnOnce(&mut Emit<'_>)) {
    let at = function.blocks[block].instructions.len();
    insert(function, block, at, place, f);
}

fn insert(function: &mut Function, block: usize, at: usize, place: Place, f: impl FnOnce(&mut Emit<'_>)) {
    let rest = function.blocks[block].instructions.split_off(at);
    let out = &mut function.blocks[block].instructions;
    f(&mut Emit { values: &mut function.values, out, place });
    out.extend(rest);
}

/// The shadow of a variable in the innermost loop around that counts in it.
fn shadow_of(function: &Function, shadows: &Shadows, innermost: Option<LoopId>, var: Var) -> Option<(LoopId, Var)> {
    let around = std::iter::successors(innermost, |id| function.loops[id.index()].parent).take(MOST_LEVELS);
    let mut shadows = around.filter_map(|id| shadows.get(&id).map(|(control, shadow)| (id, *control, *shadow)));
    shadows.find(|(_, control, _)| *control == var).map(|(id, _, shadow)| (id, shadow))
}

/// Extensions of a control variable that was read in its loop become reads of the shadow.
fn take_shadows(function: &mut Function, shadows: &Shadows) {
    let mut reads: Vec<Option<(LoopId, Var)>> = vec![None; function.values.len()];
    for number in 0..function.blocks.len() {
        let innermost = function.blocks[number].innermost_loop;
        // What the shadow was before the latch moved it on, and values that are the same as that.
        let mut moved: BTreeMap<Var, Value> = BTreeMap::new();
        let mut same: BTreeMap<Value, Value> = BTreeMap::new();
        let mut last_sum = None;
        let mut instructions = std::mem::take(&mut function.blocks[number].instructions);
        for instruction in &mut instructions {
            if !same.is_empty() {
                instruction.op.for_each_operand(|value| *value = same.get(value).copied().unwrap_or(*value));
            }
            if let Op::Set(to, value) = instruction.op {
                if let Some((sum, before)) = last_sum.filter(|(sum, _)| *sum == value) {
                    let _: Value = sum;
                    moved.insert(to, before);
                }
                continue;
            }
            let Results::One(result) = instruction.results else { continue };
            match instruction.op {
                Op::Get(var) => {
                    reads[result.index()] = shadow_of(function, shadows, innermost, var);
                }
                Op::Numeric(NumericOp::I64Add, [before, _]) => last_sum = Some((result, before)),
                Op::Numeric(NumericOp::I64ExtendI32S, [narrow, _]) => {
                    // The same pass of the same loop: what goes round passes a block parameter, which is another value.
                    let read = reads[narrow.index()].filter(|(id, _)| function.loop_contains(*id, innermost));
                    let Some((_, shadow)) = read else { continue };
                    match moved.get(&shadow) {
                        None => instruction.op = Op::Get(shadow),
                        Some(before) => {
                            same.insert(result, *before);
                        }
                    }
                }
                _ => {}
            }
        }
        function.blocks[number].instructions = instructions;
    }
}
