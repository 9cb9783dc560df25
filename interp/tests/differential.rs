//! Random programs against the plainest possible evaluator of the stack code: one instruction at a time on a stack of bits, every
//! meaning from `khz_machine::semantics`. What the translation delays, fuses and redirects must not be seen.

mod common;

use std::fmt::Write;

use common::load;
use khz_bytecode::container::{Constant, ControlPlace, ForLoop, Type};
use khz_bytecode::ids::{FunctionId, SlotIndex};
use khz_bytecode::instruction::{Instruction, NumericOp};
use khz_bytecode::value::{BytePlace, LocalType, SlotPlace, Storage, ValueType};
use khz_bytecode::verify::Verified;
use khz_machine::image::Image;
use khz_machine::semantics::{self, Value};
use khz_machine::trap::{CodePlace, Trap, TrapCode};

/// The plain evaluator.
struct Plain<'a> {
    verified: &'a Verified,
    image: &'a mut Image,
    stack: Vec<u64>,
}

type Stop = (TrapCode, [i64; 3]);

/// The `L` slot of a control variable: these programs have no others.
fn local_control(descriptor: &ForLoop) -> SlotIndex {
    match descriptor.control {
        ControlPlace::Slot(SlotPlace::Local, control) => control,
        other => panic!("{other:?}"),
    }
}

impl Plain<'_> {
    fn pop(&mut self) -> u64 {
        self.stack.pop().unwrap()
    }

    fn bytes(&mut self, at: u64) -> &mut [u8] {
        &mut self.image.bytes_mut()[at as usize..]
    }

    fn load(&mut self, at: u64, storage: Storage) {
        let foreign = self.verified.facts().foreign_floats;
        let bytes = self.bytes(at);
        let value = if foreign {
            semantics::load_foreign_scalar(bytes, storage)
        } else {
            semantics::load_scalar(bytes, storage)
        };
        self.stack.push(value.bits());
    }

    fn store(&mut self, at: u64, storage: Storage, bits: u64) {
        let value = match storage.value_type() {
            ValueType::I32 => Value::I32(bits as i32),
            ValueType::I64 => Value::I64(bits as i64),
            ValueType::F32 => Value::F32(f32::from_bits(bits as u32)),
            ValueType::F64 => Value::F64(f64::from_bits(bits)),
        };
        semantics::store_scalar(self.bytes(at), storage, value);
    }

    fn slot(&self, place: SlotPlace, index: SlotIndex) -> (u64, Storage) {
        let first = match place {
            SlotPlace::Global => 0,
            _ => usize::from(self.verified.container().tasks.instances[0].slot_offset),
        };
        let index = first + index.index();
        (u64::from(self.image.layout().slots.start) + 8 * index as u64, self.verified.container().types.slots[index])
    }

    fn base(&self, place: BytePlace) -> u64 {
        u64::from(self.image.layout().fixed_start(place).unwrap())
    }

    fn call(&mut self, id: FunctionId) -> Result<(), Trap> {
        let verified = self.verified;
        let function = &verified.container().functions[id.index()];
        let facts = verified.function(id);
        let mut locals = vec![0_u64; function.locals.len()];
        let mut scratch = [0_u8; 8];
        let mut set = |locals: &mut Vec<u64>, index: usize, bits: u64| {
            let LocalType::Scalar(storage) = function.locals[index] else { return locals[index] = bits };
            if storage.value_type() != ValueType::I32 {
                return locals[index] = bits;
            }
            semantics::store_scalar(&mut scratch, storage, Value::I32(bits as i32));
            locals[index] = semantics::load_scalar(&scratch, storage).bits();
        };
        for index in (0..usize::from(function.parameters)).rev() {
            let bits = self.pop();
            set(&mut locals, index, bits);
        }
        let mut at = 0;
        let target = |label: khz_bytecode::ids::Label| {
            facts.instructions.iter().position(|placed| placed.offset == label.0).unwrap()
        };
        loop {
            let placed = &facts.instructions[at];
            let place = CodePlace { function: id, offset: placed.offset };
            at += 1;
            match &placed.instruction {
                Instruction::Return {} => return Ok(()),
                Instruction::Jump { target: label } => at = target(*label),
                Instruction::JumpIf { target: label } if self.pop() as u32 != 0 => at = target(*label),
                Instruction::JumpUnless { target: label } if self.pop() as u32 == 0 => at = target(*label),
                Instruction::JumpIf { .. } | Instruction::JumpUnless { .. } => {}
                Instruction::SlotLoad { place: SlotPlace::Local, index } => self.stack.push(locals[index.index()]),
                Instruction::SlotStore { place: SlotPlace::Local, index } => {
                    let bits = self.pop();
                    set(&mut locals, index.index(), bits);
                }
                Instruction::ForEnter { id, exit } => {
                    let descriptor = function.for_loops[id.index()];
                    let control = local_control(&descriptor);
                    let (step, bound, initial) = (self.pop(), self.pop(), self.pop());
                    locals[descriptor.step.index()] = step;
                    locals[descriptor.bound.index()] = bound;
                    set(&mut locals, control.index(), initial);
                    let control = locals[control.index()] as i64;
                    if !semantics::for_is_due(descriptor.ty, control, bound as i64, step as i64) {
                        at = target(*exit);
                    }
                }
                Instruction::ForNext { id, header } => {
                    let descriptor = function.for_loops[id.index()];
                    let control = local_control(&descriptor);
                    let value = |slot: SlotIndex| locals[slot.index()] as i64;
                    let (bound, step) = (value(descriptor.bound), value(descriptor.step));
                    let (next, goes_on) = semantics::for_next(descriptor.ty, value(control), bound, step);
                    set(&mut locals, control.index(), next as u64);
                    if goes_on {
                        at = target(*header);
                    }
                }
                Instruction::Call { function } => {
                    self.call(*function).map_err(|mut trap| {
                        trap.push_caller(place);
                        trap
                    })?;
                }
                other => self.simple(other).map_err(|(code, values)| Trap::new(code, place, values))?,
            }
        }
    }

    fn simple(&mut self, instruction: &Instruction) -> Result<(), Stop> {
        match instruction {
            Instruction::Nop {} => {}
            Instruction::ConstI32 { value } => self.stack.push(u64::from(*value as u32)),
            Instruction::Const { id } => self.stack.push(match self.verified.container().constants[id.index()] {
                Constant::I64(value) => value as u64,
                Constant::F32(bits) => u64::from(bits),
                Constant::F64(bits) => bits,
            }),
            Instruction::Drop {} => {
                self.pop();
            }
            Instruction::Dup {} => {
                let top = self.pop();
                self.stack.extend([top, top]);
            }
            Instruction::Select {} => {
                let (condition, second, first) = (self.pop(), self.pop(), self.pop());
                self.stack.push(if condition as u32 != 0 { first } else { second });
            }
            Instruction::Numeric(op) => {
                let from = self.stack.len() - op.operands().len();
                let operands = self.stack.split_off(from);
                let operands = operands.iter().zip(op.operands()).map(|(bits, ty)| Value::from_bits(*ty, *bits));
                let result = semantics::eval_numeric(*op, &operands.collect::<Vec<_>>());
                self.stack.push(result.map_err(|code| (code, [0; 3]))?.bits());
            }
            Instruction::CheckI32 { kind, lower, upper } => {
                let (value, lower, upper) = (*self.stack.last().unwrap() as i64, i64::from(*lower), i64::from(*upper));
                if !semantics::check_range(*kind, value, lower, upper) {
                    return Err((TrapCode::Range, semantics::range_values(*kind, value, lower, upper)));
                }
            }
            Instruction::SlotLoad { place, index } => {
                let (at, storage) = self.slot(*place, *index);
                let bits = semantics::load_scalar(self.bytes(at), storage).bits();
                self.stack.push(bits);
            }
            Instruction::SlotStore { place, index } => {
                let ((at, storage), bits) = (self.slot(*place, *index), self.pop());
                self.store(at, storage, bits);
            }
            Instruction::Load { place, storage, offset } => {
                self.load(self.base(*place) + u64::from(*offset), *storage);
            }
            Instruction::Store { place, storage, offset } => {
                let bits = self.pop();
                self.store(self.base(*place) + u64::from(*offset), *storage, bits);
            }
            other => return self.reference(other),
        }
        Ok(())
    }

    fn reference(&mut self, instruction: &Instruction) -> Result<(), Stop> {
        match instruction {
            Instruction::Address { place, offset, .. } => self.stack.push(self.base(*place) + u64::from(*offset)),
            Instruction::RefLoad { storage } => {
                let at = self.pop();
                self.load(at, *storage);
            }
            Instruction::RefStore { storage } => {
                let (bits, at) = (self.pop(), self.pop());
                self.store(at, *storage, bits);
            }
            Instruction::RefField { owner, field } => {
                let Type::Struct(record) = &self.verified.container().types.types[owner.index()] else { panic!() };
                let at = self.pop() + u64::from(record.fields[usize::from(*field)].offset);
                self.stack.push(at);
            }
            Instruction::RefIndex { array } => {
                let descriptor = &self.verified.container().types.arrays[array.index()];
                let from = self.stack.len() - descriptor.dimensions.len();
                let indices: Vec<i32> = self.stack.split_off(from).iter().map(|bits| *bits as i32).collect();
                let position = semantics::element_position(&indices, &descriptor.dimensions);
                let position = position.map_err(|values| (TrapCode::ArrayIndex, values))?;
                let at = self.pop() + u64::from(position * descriptor.stride);
                self.stack.push(at);
            }
            other => panic!("the generator does not make {other:?}"),
        }
        Ok(())
    }
}

/// Makes programs. Every program ends: its loops are FOR loops of few passes whose control variables nothing else writes.
struct Generator {
    state: u64,
    text: String,
    loops: usize,
    labels: usize,
    in_function: bool,
}

const SCALARS: [&str; 9] = ["b1", "i8", "u8", "i16", "u16", "i32", "i64", "f32", "f64"];

fn value_type(storage: &str) -> ValueType {
    Storage::from_name(storage).unwrap().value_type()
}

impl Generator {
    fn below(&mut self, limit: usize) -> usize {
        // xorshift64*: the same programs on every machine.
        self.state ^= self.state >> 12;
        self.state ^= self.state << 25;
        self.state ^= self.state >> 27;
        (self.state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % limit
    }

    fn line(&mut self, line: &str) {
        let _ = writeln!(self.text, "{line}");
    }

    /// A scalar variable of a value type: its storage and the rest of an access, as (load, store).
    fn variable(&mut self, ty: ValueType) -> (String, String) {
        let fitting: Vec<&str> = SCALARS.into_iter().filter(|storage| value_type(storage) == ty).collect();
        let storage = fitting[self.below(fitting.len())];
        let number = self.below(2);
        match self.below(7) {
            0 => (format!("slot.load g g_{storage}{number}"), format!("slot.store g g_{storage}{number}")),
            1 => (format!("load d {storage} d_{storage}"), format!("store d {storage} d_{storage}")),
            2 if !self.in_function => (format!("slot.load p p_{storage}"), format!("slot.store p p_{storage}")),
            // Most of what the translation does is done with `L` slots.
            _ => (format!("slot.load l l_{storage}{number}"), format!("slot.store l l_{storage}{number}")),
        }
    }

    /// A reference to a scalar in an array; its storage.
    fn element(&mut self, depth: usize) -> &'static str {
        let choice = self.below(4);
        let (place, indices, storage) = match choice {
            0 => ("vector", 1, "i16"),
            1 => ("matrix", 2, "f64"),
            2 => ("pairs", 1, "i32"),
            _ => ("cube", 3, "u8"),
        };
        self.line(&format!("address d {place} {place}_t"));
        for _ in 0..indices {
            match self.below(8) {
                0 => self.expression(ValueType::I32, depth),
                1 => self.line("slot.load l l_i320"),
                2..=4 => {
                    self.expression(ValueType::I32, depth);
                    self.line("const.i32 1\ni32.and");
                }
                _ => {
                    let index = self.below(3);
                    self.line(&format!("const.i32 {index}"));
                }
            }
        }
        self.line(&format!("ref.index {place}_t"));
        if place == "pairs" {
            let field = self.below(2);
            self.line(&format!("ref.field pair {field}"));
        }
        storage
    }

    fn constant(&mut self, ty: ValueType) {
        let small = self.below(7) as i64 - 2;
        let wide = (self.below(1 << 20) as i64).wrapping_mul(0x0123_4567_89AB) - 5;
        let number = if self.below(2) == 0 { wide } else { small };
        match ty {
            ValueType::I32 => self.line(&format!("const.i32 {}", number as i32)),
            ValueType::I64 => self.line(&format!("const i64 {number}")),
            ValueType::F32 => self.line(&format!("const f32 {:?}", number as f32 / 4.0)),
            ValueType::F64 => self.line(&format!("const f64 {:?}", number as f64 / 8.0)),
        }
    }

    fn expression(&mut self, ty: ValueType, depth: usize) {
        if depth == 0 || self.below(4) == 0 {
            if self.below(3) == 0 {
                return self.constant(ty);
            }
            let (load, _) = self.variable(ty);
            return self.line(&load);
        }
        match self.below(16) {
            0 => {
                (0..2).for_each(|_| self.expression(ty, depth - 1));
                self.expression(ValueType::I32, depth - 1);
                self.line("select");
            }
            1 if ty == ValueType::I32 => {
                self.expression(ty, depth - 1);
                self.line("dup\ni32.add");
            }
            2 if ty == ValueType::I32 => {
                self.expression(ty, depth - 1);
                self.line("check.i32 i32 -2000000000 2000000000");
            }
            3..=5 => {
                let start = self.text.len();
                let storage = self.element(depth - 1);
                if value_type(storage) == ty {
                    return self.line(&format!("ref.load {storage}"));
                }
                self.text.truncate(start);
                self.expression(ty, depth - 1);
            }
            6 if ty == ValueType::I32 && !self.in_function => {
                self.expression(ValueType::I32, depth - 1);
                self.expression(ValueType::I64, depth - 1);
                self.line("call helper\ndrop");
            }
            _ => {
                let rows: Vec<NumericOp> = NumericOp::ALL.iter().copied().filter(|op| op.result() == ty).collect();
                let op = rows[self.below(rows.len())];
                op.operands().iter().for_each(|operand| self.expression(*operand, depth - 1));
                self.line(op.mnemonic());
            }
        }
    }

    fn any_type(&mut self) -> ValueType {
        [ValueType::I32, ValueType::I32, ValueType::I64, ValueType::F32, ValueType::F64][self.below(5)]
    }

    fn statement(&mut self, depth: usize) {
        match self.below(if depth == 0 { 5 } else { 9 }) {
            0..=1 => {
                let ty = self.any_type();
                self.expression(ty, 3);
                let (_, store) = self.variable(ty);
                self.line(&store);
            }
            2..=3 => {
                let storage = self.element(2);
                self.expression(value_type(storage), 3);
                self.line(&format!("ref.store {storage}"));
            }
            4 => {
                // An entry that waits on the stack while something else happens.
                let ty = self.any_type();
                let waiting = self.below(3);
                self.expression(ty, waiting);
                self.statement(depth.saturating_sub(1));
                let (_, store) = self.variable(ty);
                self.line(&store);
            }
            5 => {
                let storage = self.element(2);
                self.statement(depth - 1);
                self.expression(value_type(storage), 1);
                self.line(&format!("ref.store {storage}"));
            }
            6..=7 => {
                self.labels += 1;
                let label = self.labels;
                let jump = ["jump.if", "jump.unless"][self.below(2)];
                self.expression(ValueType::I32, 2);
                self.line(&format!("{jump} else{label}"));
                self.statement(depth - 1);
                self.line(&format!("jump end{label}\nelse{label}:"));
                self.statement(depth - 1);
                self.line(&format!("end{label}:"));
            }
            _ if self.in_function || self.loops == 3 => self.statement(depth - 1),
            _ => {
                let number = self.loops;
                self.loops += 1;
                let (from, to) = (self.below(4) as i64 - 1, self.below(4));
                let step = ["const.i32 1", "const.i32 -1", "const.i32 2", "slot.load l l_one"][self.below(4)];
                self.line(&format!("const.i32 {from}\nconst.i32 {to}\n{step}\nfor.enter for{number} done{number}"));
                self.line(&format!("pass{number}:"));
                (0..2).for_each(|_| self.statement(depth - 1));
                self.line(&format!("for.next for{number} pass{number}\ndone{number}:"));
            }
        }
    }

    fn locals(&mut self) {
        for storage in SCALARS {
            self.line(&format!("local l_{storage}0 {storage}\nlocal l_{storage}1 {storage}"));
        }
    }

    fn program(seed: u64) -> String {
        let mut generator = Generator {
            state: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1,
            text: String::new(),
            loops: 0,
            labels: 0,
            in_function: false,
        };
        let mut end = String::new();
        let g = &mut generator;
        for storage in SCALARS {
            g.line(&format!("type t_{storage} scalar {storage}\ndata d_{storage} t_{storage}"));
            g.line(&format!("global g_{storage}0 {storage}\nglobal g_{storage}1 {storage}"));
        }
        g.line("type pair struct t_i32 t_i32\narray vector_t t_i16 0..2\narray matrix_t t_f64 0..1 0..2\narray pairs_t pair 0..2");
        g.line("array cube_t t_u8 0..2 0..1 0..2\ndata vector vector_t\ndata matrix matrix_t\ndata pairs pairs_t\ndata cube cube_t");
        g.line("program prog");
        SCALARS.iter().for_each(|storage| g.line(&format!("slot p_{storage} {storage}")));
        g.line("function main program prog");
        g.locals();
        g.line("local l_one i32");
        for (number, kind) in ["i32", "i16", "u8"].into_iter().enumerate() {
            g.line(&format!("local c{number} {kind}\nfor for{number} l c{number} {kind}"));
        }
        g.line("const.i32 1\nslot.store l l_one");
        (0..6).for_each(|_| g.statement(3));
        // Each FOR descriptor wants its loop.
        for number in g.loops..3 {
            g.line(&format!("const.i32 0\nconst.i32 1\nconst.i32 1\nfor.enter for{number} done{number}"));
            g.line(&format!("pass{number}:\nfor.next for{number} pass{number}\ndone{number}:"));
        }
        // What stands in the `L` slots at the end is seen as well.
        for storage in SCALARS {
            let wide = value_type(storage);
            g.line(&format!("slot.load l l_{storage}0\nslot.store g end_{storage}0\nslot.load l l_{storage}1\nslot.store g end_{storage}1"));
            end.push_str(&format!("global end_{storage}0 {wide}\nglobal end_{storage}1 {wide}\n"));
        }
        g.line("return\nend\nfunction helper\nparam p_a i16\nparam p_b i64\nresult i32 i64");
        g.locals();
        g.in_function = true;
        g.line("slot.load l p_a\nslot.store l l_i320\nslot.load l p_b\nslot.store l l_i640");
        (0..2).for_each(|_| g.statement(2));
        g.expression(ValueType::I32, 2);
        g.expression(ValueType::I64, 2);
        g.line("return\nend");
        end + &generator.text
    }
}

#[test]
fn random_programs_do_what_the_plain_evaluator_does() {
    let mut traps = 0;
    for seed in 0..600 {
        let text = Generator::program(seed);
        let mut loaded = load(&text, seed % 2 == 0);
        let mut image = loaded.image.clone();
        for scan in 0..3 {
            let verified = loaded.verified.clone();
            let mut plain = Plain { verified: &verified, image: &mut image, stack: Vec::new() };
            let expected = plain.call(verified.container().tasks.instances[0].entry);
            let found = loaded.run();
            assert_eq!(found, expected, "seed {seed} scan {scan}\n{text}\n{}", loaded.engine.listing());
            let difference = loaded.image.first_difference(&image);
            assert_eq!(difference, None, "seed {seed} scan {scan}\n{text}\n{}", loaded.engine.listing());
            traps += usize::from(found.is_err());
        }
    }
    assert!((100..1700).contains(&traps), "both ends must be common, of 1800 runs {traps} trapped");
}
