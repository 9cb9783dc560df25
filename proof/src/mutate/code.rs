//! Mutants of the code: operands, operations of the same shape, instructions that go, come or change places.

use khz_bytecode::container::Container;
use khz_bytecode::ids::{ArrayId, ConstantId, FunctionId, Label, MethodId, SlotIndex, TypeId};
use khz_bytecode::instruction::{HelperOp, Instruction, NumericOp};
use khz_bytecode::value::{BytePlace, IntegerType, SlotPlace, Storage};

use super::model::{below16, nudge};
use crate::random::Random;
use crate::shrink::{change_code, instructions_of};

pub(super) fn spoil_code(random: &mut Random, container: &mut Container) {
    let number = random.below(container.functions.len());
    let length = container.functions.get(number).map_or(0, |function| instructions_of(function).len());
    if length == 0 {
        return;
    }
    let at = random.below(length);
    let sizes = Sizes::new(container, number);
    let kind = random.weighted(&[12, 2, 1, 1]);
    change_code(&mut container.functions[number], |code| match kind {
        0 => {
            spoil_instruction(random, &mut code[at], &sizes, length);
            (0, 0, 0)
        }
        1 => {
            code.remove(at);
            (at, 1, 0)
        }
        2 => {
            let other = random.below(length);
            code.swap(at, other);
            (0, 0, 0)
        }
        _ => {
            let copied = code[random.below(length)].clone();
            code.insert(at, copied);
            (at, 0, 1)
        }
    });
}

/// How many there are of what an instruction may name.
struct Sizes {
    types: usize,
    arrays: usize,
    constants: usize,
    functions: usize,
    methods: usize,
    slots: usize,
}

impl Sizes {
    fn new(container: &Container, function: usize) -> Self {
        Sizes {
            types: container.types.types.len(),
            arrays: container.types.arrays.len(),
            constants: container.constants.len(),
            functions: container.functions.len(),
            methods: container.types.methods.len(),
            slots: container.functions[function].locals.len(),
        }
    }
}

fn spoil_instruction(random: &mut Random, instruction: &mut Instruction, sizes: &Sizes, length: usize) {
    match instruction {
        Instruction::Numeric(op) => {
            let fits = |row: &NumericOp| row.operands() == op.operands() && row.result() == op.result();
            let rows: Vec<NumericOp> = NumericOp::ALL.iter().copied().filter(fits).collect();
            *op = rows[random.below(rows.len())];
        }
        Instruction::Helper(op, capacities) => {
            let fits = |row: &HelperOp| row.operands() == op.operands() && row.result() == op.result();
            let rows: Vec<HelperOp> = HelperOp::ALL.iter().copied().filter(fits).collect();
            *op = rows[random.below(rows.len())];
            if random.chance(15) {
                capacities[0] = nudge(random, i64::from(capacities[0])) as u16;
            }
        }
        Instruction::ConstI32 { value } => *value = nudge(random, i64::from(*value)) as i32,
        Instruction::Const { id } => *id = ConstantId(below16(random, sizes.constants)),
        Instruction::CheckI32 { kind, lower, upper } => match random.below(3) {
            0 => *kind = IntegerType::ALL[random.below(6)],
            1 => *lower = nudge(random, i64::from(*lower)) as i32,
            _ => *upper = nudge(random, i64::from(*upper)) as i32,
        },
        Instruction::CheckI64 { lower, upper, .. } => {
            *lower = nudge(random, *lower);
            *upper = nudge(random, *upper);
        }
        Instruction::Jump { target } | Instruction::JumpIf { target } | Instruction::JumpUnless { target } => {
            *target = Label(random.below(length) as u32);
        }
        Instruction::Switch { targets } => {
            let (from, to) = (random.below(targets.len()), random.below(targets.len()));
            targets[to] = targets[from];
        }
        Instruction::ForEnter { exit, .. } => *exit = Label(random.below(length) as u32),
        Instruction::Call { function } => *function = FunctionId(below16(random, sizes.functions)),
        Instruction::CallVirtual { method } => *method = MethodId(below16(random, sizes.methods)),
        other => spoil_access(random, other, sizes),
    }
}

/// Memory and reference instructions; what has no operand becomes another instruction without one.
fn spoil_access(random: &mut Random, instruction: &mut Instruction, sizes: &Sizes) {
    let any_place = |random: &mut Random| BytePlace::ALL[random.below(BytePlace::ALL.len())];
    let near = |random: &mut Random, offset: u32| nudge(random, i64::from(offset)) as u32;
    match instruction {
        Instruction::SlotLoad { place, index } | Instruction::SlotStore { place, index } => {
            if random.chance(30) {
                *place = random.one_of([SlotPlace::Global, SlotPlace::Program, SlotPlace::Local]);
            }
            *index = SlotIndex(below16(random, sizes.slots));
        }
        Instruction::Load { place, storage, offset } | Instruction::Store { place, storage, offset } => {
            match random.below(3) {
                0 => *place = any_place(random),
                1 => *storage = Storage::ALL[random.below(Storage::ALL.len())],
                _ => *offset = near(random, *offset),
            }
        }
        Instruction::LoadBit { place, offset, bit } | Instruction::StoreBit { place, offset, bit } => {
            match random.below(3) {
                0 => *place = any_place(random),
                1 => *offset = near(random, *offset),
                _ => *bit = random.below(8) as u8,
            }
        }
        Instruction::Address { place, offset, target } => match random.below(3) {
            0 => *place = any_place(random),
            1 => *offset = near(random, *offset),
            _ => *target = TypeId(below16(random, sizes.types)),
        },
        Instruction::RefField { field, .. } => *field = below16(random, 4),
        Instruction::RefIndex { array } => *array = ArrayId(below16(random, sizes.arrays)),
        Instruction::RefCheck { target, write } => {
            if random.chance(50) {
                *write = !*write;
            } else {
                *target = TypeId(below16(random, sizes.types));
            }
        }
        _ => {
            *instruction = match random.below(3) {
                0 => Instruction::Nop {},
                1 => Instruction::Drop {},
                _ => Instruction::Dup {},
            };
        }
    }
}
