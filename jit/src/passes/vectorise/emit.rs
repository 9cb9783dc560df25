//! The body of a loop for several passes at once.

use std::collections::BTreeMap;

use khz_bytecode::instruction::NumericOp as N;

use super::Nest;
use super::kinds::{Kind, Kinds};
use crate::mir::{Block, Const, Function, Instruction, Op, Place, Results, Type, Value, Var};

/// Bytes of a vector.
const VECTOR_BYTES: i64 = 16;
/// Most vectors that a body computes: what registers hold.
const MOST_VECTORS: i64 = 32;

/// Rewrites the loop; leaves it alone and says so where its step is not where `for.next` puts it.
pub(super) fn emit(function: &mut Function, nest: &Nest, kinds: &Kinds) -> bool {
    let lanes = Nest::lanes(kinds.ty);
    let abreast = abreast(nest, kinds, lanes);
    if !take_longer_steps(function, nest, lanes * abreast) {
        return false;
    }
    let mut variables = |var: &Var| (*var, (0..abreast).map(|_| function.new_variable(kinds.ty)).collect());
    let vectors = kinds.lanes.iter().map(&mut variables).collect();
    let (copies, splats) = (BTreeMap::new(), BTreeMap::new());
    let (out, serial, place) = (Vec::new(), Vec::new(), Place(0));
    let mut emit = Emit { kinds, lanes, abreast, vectors, copies, out, splats, serial, place };
    for block in &nest.blocks {
        emit.block(function, *block);
    }
    let Some(latch) = nest.blocks.last() else { return true };
    emit.out = std::mem::take(&mut function.blocks[latch.index()].instructions);
    emit.finish(function);
    function.blocks[latch.index()].instructions = std::mem::take(&mut emit.out);
    true
}

/// How many vectors go side by side, so that one need not wait for the result of the other: only around an inner loop, which is where sums are.
fn abreast(nest: &Nest, kinds: &Kinds, lanes: i64) -> i64 {
    let count = kinds.count() as i64;
    let fits = |abreast: &i64| nest.passes % (lanes * abreast) == 0 && count * abreast <= MOST_VECTORS;
    if nest.inner.is_some() { [4, 2].into_iter().find(fits).unwrap_or(1) } else { 1 }
}

/// The control variable steps over all the passes that run at once.
fn take_longer_steps(function: &mut Function, nest: &Nest, lanes: i64) -> bool {
    let Some(latch) = nest.blocks.last() else { return false };
    let instructions = &function.blocks[latch.index()].instructions;
    let mut at_set = None;
    for (at, instruction) in instructions.iter().enumerate() {
        if matches!(instruction.op, Op::Set(var, _) if var == nest.control) {
            at_set = Some(at);
        }
    }
    let Some(at_set) = at_set else { return false };
    let Op::Set(_, next) = instructions[at_set].op else { return false };
    let is_sum = |instruction: &Instruction| {
        instruction.results == Results::One(next)
            && matches!(instruction.op, Op::Numeric(N::I32Add, [_, step]) if step == nest.counted.step)
    };
    let Some(at_sum) = instructions.iter().position(is_sum) else { return false };
    let place = instructions[at_sum].place;
    let step = function.new_value(Type::I32);
    let instructions = &mut function.blocks[latch.index()].instructions;
    if let Op::Numeric(_, operands) = &mut instructions[at_sum].op {
        operands[1] = step;
    }
    for instruction in instructions.iter_mut() {
        if let Op::ForContinues(test) = &mut instruction.op {
            test.step = step;
        }
    }
    // Behind the header's checkpoint where the latch is the header.
    let at = usize::from(matches!(instructions.first().map(|first| &first.op), Some(Op::Checkpoint { .. })));
    let constant = Op::Const(Const::I32(lanes as i32));
    instructions.insert(at, Instruction { op: constant, results: Results::One(step), place });
    if let Some(counted) = &mut function.loops[nest.id.index()].counted {
        counted.step = step;
    }
    true
}

struct Emit<'a> {
    kinds: &'a Kinds,
    /// Lanes of a vector.
    lanes: i64,
    /// Vectors side by side.
    abreast: i64,
    /// The vectors that stand for each variable with lanes.
    vectors: BTreeMap<Var, Vec<Var>>,
    /// The vectors that stand for each value with lanes.
    copies: BTreeMap<Value, Vec<Value>>,
    out: Vec<Instruction>,
    /// Vectors of values that are the same in all passes, in the block at hand.
    splats: BTreeMap<Value, Value>,
    serial: Vec<Instruction>,
    place: Place,
}

impl Emit<'_> {
    fn define(&mut self, function: &mut Function, ty: Type, op: Op) -> Value {
        let value = function.new_value(ty);
        self.out.push(Instruction { op, results: Results::One(value), place: self.place });
        value
    }

    fn effect(&mut self, op: Op) {
        self.out.push(Instruction { op, results: Results::None, place: self.place });
    }

    fn block(&mut self, function: &mut Function, block: Block) {
        self.splats.clear();
        let instructions = std::mem::take(&mut function.blocks[block.index()].instructions);
        for instruction in instructions {
            self.place = instruction.place;
            match self.kind(&instruction) {
                Kind::Serial => self.serial.push(instruction),
                Kind::Lanes | Kind::Mask => {
                    for number in 0..self.abreast {
                        self.lanes_of(function, &instruction, number);
                    }
                }
                Kind::Same | Kind::Counting(_) => self.out.push(instruction),
            }
        }
        function.blocks[block.index()].instructions = std::mem::take(&mut self.out);
    }

    fn kind(&self, instruction: &Instruction) -> Kind {
        match (&instruction.op, &instruction.results) {
            (Op::Store(..), _) => Kind::Lanes,
            (Op::Set(var, _), _) if self.vectors.contains_key(var) => Kind::Lanes,
            (Op::Set(var, _), _) if self.kinds.carried.contains(var) => Kind::Serial,
            (_, Results::One(result)) => self.kinds.of(*result),
            _ => Kind::Same,
        }
    }

    /// One of the vectors that an instruction becomes.
    fn lanes_of(&mut self, function: &mut Function, instruction: &Instruction, number: i64) {
        let mut op = instruction.op.clone();
        let at = number as usize;
        match &mut op {
            Op::Numeric(N::F32ConvertI32S | N::F64ConvertI32S, [first, _])
                if matches!(self.kinds.of(*first), Kind::Counting(_)) =>
            {
                let Kind::Counting(growth) = self.kinds.of(*first) else { return };
                let first = self.later(function, *first, growth.wrapping_mul(number * self.lanes));
                // The analysis admits only what fits.
                op = Op::Ramp { first, growth: growth as i32 };
            }
            Op::Numeric(_, operands) => {
                for operand in operands {
                    *operand = self.vector(function, *operand, at);
                }
            }
            Op::Select { condition, then, otherwise } => {
                *condition = self.vector(function, *condition, at);
                *then = self.vector(function, *then, at);
                *otherwise = self.vector(function, *otherwise, at);
            }
            Op::Get(var) => *var = self.variable(*var, at),
            Op::Set(var, value) => {
                *var = self.variable(*var, at);
                *value = self.vector(function, *value, at);
            }
            Op::Load(address, _) => address.displacement = address.displacement.wrapping_add(number * VECTOR_BYTES),
            Op::Store(address, _, value) => {
                address.displacement = address.displacement.wrapping_add(number * VECTOR_BYTES);
                *value = self.vector(function, *value, at);
            }
            _ => {}
        }
        match instruction.results {
            Results::One(result) => {
                let vector = self.define(function, self.kinds.ty, op);
                self.copies.entry(result).or_default().push(vector);
            }
            _ => self.effect(op),
        }
    }

    fn variable(&self, var: Var, number: usize) -> Var {
        self.vectors.get(&var).and_then(|all| all.get(number)).copied().unwrap_or(var)
    }

    fn vector(&mut self, function: &mut Function, value: Value, number: usize) -> Value {
        if let Some(vector) = self.copies.get(&value).and_then(|all| all.get(number)) {
            return *vector;
        }
        if let Some(known) = self.splats.get(&value) {
            return *known;
        }
        let vector = self.define(function, self.kinds.ty, Op::Splat(value));
        self.splats.insert(value, vector);
        vector
    }

    /// An integer and a constant.
    fn later(&mut self, function: &mut Function, value: Value, distance: i64) -> Value {
        if distance == 0 {
            return value;
        }
        let ty = function.ty(value);
        let (constant, add) = match ty {
            Type::I64 => (Const::I64(distance), N::I64Add),
            _ => (Const::I32(distance as i32), N::I32Add),
        };
        let distance = self.define(function, ty, Op::Const(constant));
        self.define(function, ty, Op::Numeric(add, [value, distance]))
    }

    /// What goes one after the other, then the variables as the last pass leaves them.
    fn finish(&mut self, function: &mut Function) {
        let serial = std::mem::take(&mut self.serial);
        for lane in 0..self.lanes * self.abreast {
            let mut own: BTreeMap<Value, Value> = BTreeMap::new();
            for instruction in &serial {
                self.place = instruction.place;
                let mut op = instruction.op.clone();
                op.for_each_operand(|value| *value = self.in_lane(function, &mut own, *value, lane));
                match instruction.results {
                    Results::One(result) => {
                        let ty = function.ty(result);
                        let copy = self.define(function, ty, op);
                        own.insert(result, copy);
                    }
                    _ => self.effect(op),
                }
            }
        }
        let scalar = if self.kinds.ty == Type::F32x4 { Type::F32 } else { Type::F64 };
        for (var, vectors) in self.vectors.clone() {
            let Some(vector) = vectors.last() else { continue };
            let all = self.define(function, self.kinds.ty, Op::Get(*vector));
            let last = self.define(function, scalar, Op::Lane(all, self.lanes as u8 - 1));
            self.effect(Op::Set(var, last));
        }
    }

    /// A value as one of the passes has it.
    fn in_lane(&mut self, function: &mut Function, own: &mut BTreeMap<Value, Value>, value: Value, lane: i64) -> Value {
        if let Some(known) = own.get(&value) {
            return *known;
        }
        let copy = match self.kinds.of(value) {
            Kind::Same | Kind::Serial | Kind::Mask => return value,
            Kind::Lanes => {
                let scalar = if self.kinds.ty == Type::F32x4 { Type::F32 } else { Type::F64 };
                let vector = self.vector(function, value, (lane / self.lanes) as usize);
                self.define(function, scalar, Op::Lane(vector, (lane % self.lanes) as u8))
            }
            Kind::Counting(growth) => self.later(function, value, growth.wrapping_mul(lane)),
        };
        own.insert(value, copy);
        copy
    }
}
