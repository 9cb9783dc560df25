//! Mutants that lie at a limit: types as deep, unions as wide, loops as nested, stacks as large as they may be or a little more, and tables
//! with entries many times over. What is added is sound below the limit, so about half of these mutants verify.

use khz_bytecode::container::{ArrayDescriptor, Constant, Container, Field, Function, Record, Type};
use khz_bytecode::ids::{ArrayId, ConstantId, Label, TypeId};
use khz_bytecode::instruction::Instruction;
use khz_bytecode::limits::{MAX_STACK_DEPTH, MAX_TYPE_DEPTH, MAX_UNION_ALTERNATIVES};
use khz_bytecode::value::Storage;

use super::model::below16;
use crate::random::Random;
use crate::shrink::change_code;

/// Most bytes of one entry's copies, so that a mutant stays below a few megabytes.
const MAX_COPIED_BYTES: usize = 2 << 20;

fn add_type(container: &mut Container, ty: Type) -> TypeId {
    container.types.types.push(ty);
    // Beyond 65,536 types the container can not be written, whatever is named here.
    TypeId((container.types.types.len() - 1) as u16)
}

fn record(size: u32, align: u32, fields: &[(u32, TypeId)]) -> Record {
    let fields = fields.iter().map(|(offset, ty)| Field { offset: *offset, ty: *ty }).collect();
    Record { size, align, fields }
}

/// A byte in structures and arrays, around the deepest nesting.
pub(super) fn deepen_types(random: &mut Random, container: &mut Container) {
    let depth = MAX_TYPE_DEPTH - 4 + random.below(9);
    let mut inner = add_type(container, Type::Scalar(Storage::U8));
    for _ in 1..depth {
        let ty = if random.chance(70) {
            Type::Struct(record(1, 1, &[(0, inner)]))
        } else {
            container.types.arrays.push(ArrayDescriptor { element: inner, stride: 1, dimensions: vec![(3, 3)] });
            Type::Array(ArrayId((container.types.arrays.len() - 1) as u16))
        };
        inner = add_type(container, ty);
    }
}

/// Unions of unions, around the most alternatives that they may multiply to.
pub(super) fn widen_unions(random: &mut Random, container: &mut Container) {
    let mut inner = add_type(container, Type::Scalar(Storage::U8));
    let mut alternatives = 1;
    while alternatives < MAX_UNION_ALTERNATIVES {
        let width = random.between(2, 20) as u32;
        alternatives *= width;
        if alternatives > MAX_UNION_ALTERNATIVES && random.chance(50) {
            break;
        }
        inner = add_type(container, Type::Union(record(1, 1, &vec![(0, inner); width as usize])));
    }
}

/// A function block type around another, or on top of it.
pub(super) fn nest_blocks(random: &mut Random, container: &mut Container) {
    let blocks: Vec<TypeId> = (container.types.types.iter().enumerate())
        .filter_map(|(at, ty)| matches!(ty, Type::Block { .. }).then_some(TypeId(at as u16)))
        .collect();
    let byte = add_type(container, Type::Scalar(Storage::U8));
    let plain = Type::Block { record: record(1, 1, &[(0, byte)]), base: None, methods: Vec::new() };
    let inner = random.pick(&blocks).copied().unwrap_or_else(|| add_type(container, plain));
    let Some(Type::Block { record: own, methods, .. }) = container.types.types.get(inner.index()).cloned() else {
        return;
    };
    let block = |record, base| Type::Block { record, base, methods: Vec::new() };
    let whole = record(own.size, own.align, &[(0, inner)]);
    let behind = own.align.max(1);
    let ty = match random.below(7) {
        0 => block(whole, None),
        1 => Type::Union(whole),
        2 => block(record(0, 1, &[]), None),
        3 => {
            let holder = add_type(container, Type::Struct(whole));
            block(record(own.size, own.align, &[(0, holder)]), None)
        }
        // These are sound: a byte before the inner block, and a block that derives from it.
        4 | 5 => block(record(own.size.saturating_add(behind), own.align, &[(0, byte), (behind, inner)]), None),
        _ => Type::Block { record: own, base: Some(inner), methods },
    };
    add_type(container, ty);
}

/// Loops in loops at the start of a function, around the deepest nesting. Their conditions are 0, so they pass once.
pub(super) fn deepen_loops(random: &mut Random, container: &mut Container) {
    let depth = random.between(58, 70) as usize;
    let number = random.below(container.functions.len());
    let Some(function) = container.functions.get_mut(number) else { return };
    change_code(function, |code| {
        let headers = std::iter::repeat_n(Instruction::Nop {}, depth);
        let ends = (0..depth).rev().flat_map(|header| {
            [Instruction::ConstI32 { value: 0 }, Instruction::JumpIf { target: Label(header as u32) }]
        });
        // Labels of what was there move by `change_code`; those of the new instructions stand before the place of the change, which it leaves alone.
        let new: Vec<Instruction> = headers.chain(ends).collect();
        let count = new.len();
        shift_labels(code, count as u32);
        code.splice(0..0, new);
        (code.len(), 0, 0)
    });
}

/// Moves the targets of all jumps, before as many instructions are put in front of them.
fn shift_labels(code: &mut [Instruction], by: u32) {
    for instruction in code {
        crate::bytecode::code::relabel(instruction, |label| Label(label.0 + by));
    }
}

/// A reference made from an integer, checked, and dropped: of a type of the container, or of an empty one.
pub(super) fn check_reference(random: &mut Random, container: &mut Container) {
    let number = random.below(container.functions.len());
    let types = container.types.types.len();
    let target = if random.chance(40) {
        add_type(container, Type::Struct(record(0, 1, &[])))
    } else {
        TypeId(below16(random, types))
    };
    container.constants.push(Constant::I64(random.between(0, 200)));
    let id = ConstantId((container.constants.len() - 1) as u16);
    let write = random.chance(50);
    let Some(function) = container.functions.get_mut(number) else { return };
    change_code(function, |code| {
        let new = [Instruction::Const { id }, Instruction::RefCheck { target, write }, Instruction::Drop {}];
        shift_labels(code, new.len() as u32);
        code.splice(0..0, new);
        (code.len(), 0, 0)
    });
}

/// A function whose stacks at block starts come near the most entries that the verifier lists, or go beyond.
pub(super) fn enlarge_stacks(random: &mut Random, container: &mut Container) {
    let height = usize::from(MAX_STACK_DEPTH) - 1 - random.below(60);
    let branches = random.between(1900, 2400) as usize;
    let push = Instruction::ConstI32 { value: 1 };
    let mut code = Vec::new();
    (0..height).for_each(|_| push.encode(&mut code));
    for _ in 0..branches {
        push.encode(&mut code);
        let mut jump = Vec::new();
        Instruction::JumpIf { target: Label(0) }.encode(&mut jump);
        let target = Label((code.len() + jump.len()) as u32);
        Instruction::JumpIf { target }.encode(&mut code);
    }
    (0..height).for_each(|_| Instruction::Drop {}.encode(&mut code));
    Instruction::Return {}.encode(&mut code);
    container.parameters.max_stack_depth = MAX_STACK_DEPTH;
    container.functions.push(Function { code, ..Function::default() });
}

/// An entry of a table a few times more.
pub(super) fn repeat_entries(random: &mut Random, container: &mut Container) {
    let count = random.one_of([1, 1, 2, 5, 20]);
    repeat(random, container, count);
}

/// An entry of a table some ten thousand times more, as far as that stays below a few megabytes.
pub(super) fn multiply_entries(random: &mut Random, container: &mut Container) {
    let count = random.one_of([3_000, 20_000, 60_000]);
    repeat(random, container, count);
}

fn repeat(random: &mut Random, container: &mut Container, count: usize) {
    let types = &mut container.types;
    let fixed = 16;
    match random.below(15) {
        0 => repeat_one(random, &mut types.types, count, |ty| match ty {
            Type::Struct(record) | Type::Union(record) => fixed + 8 * record.fields.len(),
            Type::Block { record, methods, .. } => fixed + 8 * record.fields.len() + 4 * methods.len(),
            _ => fixed,
        }),
        1 => repeat_one(random, &mut types.arrays, count, |array| fixed + 8 * array.dimensions.len()),
        2 => repeat_one(random, &mut types.slots, count, |_| fixed),
        3 => repeat_one(random, &mut types.data, count, |_| fixed),
        4 => repeat_one(random, &mut types.programs, count, |program| fixed + program.slots.len()),
        5 => repeat_one(random, &mut types.block_instances, count, |_| fixed),
        6 => repeat_one(random, &mut types.methods, count, |method| fixed + 8 * method.parameters.len()),
        7 => repeat_one(random, &mut types.init_image, count, |run| fixed + run.bytes.len()),
        8 => repeat_one(random, &mut types.task_extensions, count, |extension| fixed + extension.name.len()),
        9 => repeat_one(random, &mut container.tasks.tasks, count, |_| fixed),
        10 => repeat_one(random, &mut container.tasks.instances, count, |_| fixed),
        11 => repeat_one(random, &mut container.constants, count, |_| fixed),
        12 => repeat_one(random, &mut container.functions, count, |function| {
            10 * fixed + function.code.len() + 8 * (function.locals.len() + function.for_loops.len())
        }),
        kind => {
            let number = random.below(container.functions.len());
            let Some(function) = container.functions.get_mut(number) else { return };
            if kind == 13 {
                repeat_one(random, &mut function.locals, count, |_| fixed);
            } else {
                repeat_one(random, &mut function.for_loops, count, |_| fixed);
            }
        }
    }
}

/// Copies of an entry of about so many bytes behind it.
fn repeat_one<T: Clone>(random: &mut Random, table: &mut Vec<T>, count: usize, bytes: impl Fn(&T) -> usize) {
    let at = random.below(table.len());
    let Some(entry) = table.get(at).cloned() else { return };
    let count = count.min(MAX_COPIED_BYTES / bytes(&entry));
    table.splice(at..at, std::iter::repeat_n(entry, count));
}
