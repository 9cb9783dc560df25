//! Spoiled containers: what the reader and the verifier let through must still run the same in every engine.
//!
//! Two kinds. Mutants of the file change bits, bytes and numbers of its bytes and get fresh hashes ([`reseal`]), so that they reach what lies behind the hashes;
//! nearly all break a rule. Mutants of the model change one thing that the container says (an operand, an operation for another of the same
//! shape, a bound, an offset, a right) and are written as a file again; many are sound programs that no generator would write.

use std::collections::BTreeMap;
use std::fmt::Write;

use khz_bytecode::container::{Constant, Container, ControlPlace, ReadCode, Type, read, reseal, write};
use khz_bytecode::ids::{ArrayId, ConstantId, FunctionId, Label, MethodId, SlotIndex, TypeId};
use khz_bytecode::instruction::{HelperOp, Instruction, NumericOp};
use khz_bytecode::value::{BytePlace, IntegerType, LocalType, SlotPlace, Storage};
use khz_bytecode::verify::{Rule, Verified, verify};

use crate::random::Random;
use crate::shrink::{change_code, instructions_of};

/// What became of a mutant.
#[derive(Debug)]
pub enum Verdict {
    /// It says more than a file can hold.
    Unwritable,
    /// It is no container.
    Unreadable(ReadCode),
    /// It breaks a rule.
    Refused(Rule),
    /// It verifies.
    Accepted(Box<Verified>),
}

/// Reads and verifies bytes.
#[must_use]
pub fn classify(bytes: &[u8]) -> Verdict {
    match read(bytes) {
        Err(error) => Verdict::Unreadable(error.code),
        Ok(container) => match verify(container) {
            Err(error) => Verdict::Refused(error.rule),
            Ok(verified) => Verdict::Accepted(Box::new(verified)),
        },
    }
}

/// How many mutants went which way.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// By the code of what they break; "accepted" for those that verify.
    pub by_code: BTreeMap<String, u64>,
    /// All.
    pub total: u64,
    /// Those that verify.
    pub accepted: u64,
}

impl Tally {
    /// Counts a mutant.
    pub fn count(&mut self, verdict: &Verdict) {
        let code = match verdict {
            Verdict::Unwritable => "unwritable".to_string(),
            Verdict::Unreadable(code) => code.code().to_string(),
            Verdict::Refused(rule) => rule.code(),
            Verdict::Accepted(_) => "accepted".to_string(),
        };
        self.total += 1;
        self.accepted += u64::from(matches!(verdict, Verdict::Accepted(_)));
        *self.by_code.entry(code).or_default() += 1;
    }

    /// The figures as text, with the rules that no mutant broke.
    #[must_use]
    pub fn report(&self) -> String {
        let mut text = String::new();
        // A String takes everything.
        let _ = writeln!(
            text,
            "mutants {}, accepted {} ({}%)",
            self.total,
            self.accepted,
            self.accepted * 100 / self.total.max(1)
        );
        for (code, count) in &self.by_code {
            let _ = write!(text, "{code} {count}, ");
        }
        let unmet: Vec<String> =
            Rule::ALL.iter().map(|rule| rule.code()).filter(|code| !self.by_code.contains_key(code)).collect();
        let _ = writeln!(text, "\nrules that no mutant broke: {}", unmet.join(" "));
        text
    }
}

/// A spoiled form of a container, as file bytes; none when it can not be written.
pub fn mutant(random: &mut Random, container: &Container) -> Option<Vec<u8>> {
    let mut container = container.clone();
    if random.chance(75) {
        for _ in 0..random.one_of([1, 1, 1, 2, 3]) {
            spoil_model(random, &mut container);
        }
        return write(&container).ok();
    }
    let mut bytes = write(&container).ok()?;
    for _ in 0..random.one_of([1, 1, 2, 5]) {
        spoil_bytes(random, &mut bytes);
    }
    reseal(&mut bytes);
    Some(bytes)
}

fn spoil_bytes(random: &mut Random, bytes: &mut Vec<u8>) {
    let at = random.below(bytes.len());
    match random.weighted(&[8, 6, 6, 4, 1, 1]) {
        0 => bytes[at] ^= 1 << random.below(8),
        1 => bytes[at] = random.one_of([0, 1, 2, 7, 8, 0x7F, 0x80, 0xFF]),
        kind @ (2 | 3) => {
            let width = if kind == 2 { 2 } else { 4 };
            let number = random.integer(32).to_le_bytes();
            bytes[at..].iter_mut().zip(number.iter().take(width)).for_each(|(to, from)| *to = *from);
        }
        4 => bytes.truncate(at),
        _ => {
            let copied: Vec<u8> = bytes[at..].iter().copied().take(8).collect();
            let to = random.below(bytes.len());
            bytes[to..].iter_mut().zip(copied).for_each(|(to, from)| *to = from);
        }
    }
}

/// A number near another, or an interesting one.
fn nudge(random: &mut Random, number: i64) -> i64 {
    if random.chance(60) { number.wrapping_add(random.one_of([-8, -4, -1, 1, 2, 4, 8])) } else { random.integer(64) }
}

fn below16(random: &mut Random, limit: usize) -> u16 {
    random.below(limit + 1) as u16
}

fn spoil_model(random: &mut Random, container: &mut Container) {
    match random.weighted(&[60, 6, 6, 4, 4, 4, 4, 4, 4, 4]) {
        0 => spoil_code(random, container),
        1 => spoil_type(random, container),
        2 => spoil_function(random, container),
        3 => spoil_parameters(random, container),
        4 => {
            let count = container.constants.len();
            if let Some(constant) = container.constants.get_mut(random.below(count)) {
                *constant = match random.below(3) {
                    0 => Constant::I64(random.integer(64)),
                    1 => Constant::F32(random.bits() as u32),
                    _ => Constant::F64(random.bits()),
                };
            }
        }
        5 => {
            let count = container.types.data.len();
            if let Some(variable) = container.types.data.get_mut(random.below(count)) {
                match random.below(3) {
                    0 => variable.offset = nudge(random, i64::from(variable.offset)) as u32,
                    1 => variable.ty = TypeId(random.below(24) as u16),
                    _ => variable.constant = !variable.constant,
                }
            }
        }
        6 => spoil_tasks(random, container),
        7 => {
            let count = container.types.init_image.len();
            if let Some(run) = container.types.init_image.get_mut(random.below(count)) {
                match random.below(3) {
                    0 => run.offset = nudge(random, i64::from(run.offset)) as u32,
                    1 => run.repeat = nudge(random, i64::from(run.repeat)) as u32,
                    _ => run.bytes.iter_mut().for_each(|byte| *byte = random.bits() as u8),
                }
            }
        }
        8 => {
            let count = container.types.block_instances.len();
            if let Some(row) = container.types.block_instances.get_mut(random.below(count)) {
                match random.below(4) {
                    0 => row.offset = nudge(random, i64::from(row.offset)) as u32,
                    1 => row.stride = nudge(random, i64::from(row.stride)) as u32,
                    2 => row.count = nudge(random, i64::from(row.count)) as u32,
                    _ => row.ty = TypeId(random.below(24) as u16),
                }
            }
        }
        _ => {
            let count = container.types.slots.len();
            if let Some(slot) = container.types.slots.get_mut(random.below(count)) {
                *slot = Storage::ALL[random.below(Storage::ALL.len())];
            }
        }
    }
}

fn spoil_type(random: &mut Random, container: &mut Container) {
    let (count, arrays) = (container.types.types.len(), container.types.arrays.len());
    if random.chance(25) {
        let Some(array) = container.types.arrays.get_mut(random.below(arrays)) else { return };
        let dimensions = array.dimensions.len();
        match random.below(3) {
            0 => array.element = TypeId(below16(random, count)),
            1 => array.stride = nudge(random, i64::from(array.stride)) as u32,
            _ => {
                if let Some((lower, upper)) = array.dimensions.get_mut(random.below(dimensions)) {
                    let end = if random.chance(50) { lower } else { upper };
                    *end = nudge(random, i64::from(*end)) as i32;
                }
            }
        }
        return;
    }
    match container.types.types.get_mut(random.below(count)) {
        Some(Type::Scalar(storage)) => *storage = Storage::ALL[random.below(Storage::ALL.len())],
        Some(Type::String { capacity } | Type::WideString { capacity }) => {
            *capacity = nudge(random, i64::from(*capacity)) as u16;
        }
        Some(Type::Array(array)) => *array = ArrayId(below16(random, arrays)),
        Some(Type::Struct(record) | Type::Union(record) | Type::Block { record, .. }) => {
            let fields = record.fields.len();
            match (random.below(4), record.fields.get_mut(random.below(fields))) {
                (0, Some(field)) => field.offset = nudge(random, i64::from(field.offset)) as u32,
                (1, Some(field)) => field.ty = TypeId(below16(random, count)),
                (2, _) => record.size = nudge(random, i64::from(record.size)) as u32,
                _ => record.align = random.one_of([1, 2, 4, 8]),
            }
        }
        None => {}
    }
}

fn spoil_function(random: &mut Random, container: &mut Container) {
    let (count, types) = (container.functions.len(), container.types.types.len());
    let Some(function) = container.functions.get_mut(random.below(count)) else { return };
    let (locals, loops) = (function.locals.len(), function.for_loops.len());
    match random.below(5) {
        0 => function.parameters = nudge(random, i64::from(function.parameters)) as u16,
        1 => {
            if let Some(local) = function.locals.get_mut(random.below(locals)) {
                match local {
                    LocalType::Scalar(storage) => *storage = Storage::ALL[random.below(Storage::ALL.len())],
                    LocalType::Ref(ty) if random.chance(50) => ty.write = !ty.write,
                    LocalType::Ref(ty) => ty.image = !ty.image,
                }
            }
        }
        2 => function.frame = Some(TypeId(below16(random, types))).filter(|_| random.chance(70)),
        3 => {
            function.results.pop();
        }
        _ => {
            let Some(descriptor) = function.for_loops.get_mut(random.below(loops)) else { return };
            match random.below(4) {
                0 => descriptor.ty = IntegerType::ALL[random.below(IntegerType::ALL.len())],
                1 => descriptor.bound = SlotIndex(below16(random, locals)),
                2 => descriptor.step = SlotIndex(below16(random, locals)),
                _ => match &mut descriptor.control {
                    ControlPlace::Slot(_, index) => *index = SlotIndex(below16(random, locals)),
                    ControlPlace::Bytes(_, offset) => *offset = nudge(random, i64::from(*offset)) as u32,
                },
            }
        }
    }
}

fn spoil_parameters(random: &mut Random, container: &mut Container) {
    let functions = container.functions.len();
    let parameters = &mut container.parameters;
    let near = |random: &mut Random, number: u16| nudge(random, i64::from(number)) as u16;
    match random.below(9) {
        0 => parameters.max_stack_depth = random.below(12) as u16,
        1 => parameters.max_call_depth = near(random, parameters.max_call_depth),
        2 => parameters.input_image_bytes = near(random, parameters.input_image_bytes),
        3 => parameters.output_image_bytes = near(random, parameters.output_image_bytes),
        4 => parameters.memory_image_bytes = near(random, parameters.memory_image_bytes),
        5 => parameters.data_region_bytes = nudge(random, i64::from(parameters.data_region_bytes)) as u32,
        6 => parameters.frame_bytes = nudge(random, i64::from(parameters.frame_bytes)) as u32,
        7 => parameters.startup_function = Some(FunctionId(below16(random, functions))),
        _ => container.tasks.shared_globals = near(random, container.tasks.shared_globals),
    }
}

fn spoil_tasks(random: &mut Random, container: &mut Container) {
    let (tasks, instances, functions) =
        (container.tasks.tasks.len(), container.tasks.instances.len(), container.functions.len());
    if random.chance(30) {
        let Some(task) = container.tasks.tasks.get_mut(random.below(tasks)) else { return };
        match random.below(3) {
            0 => task.id.0 = below16(random, 8),
            1 => task.interval_us = random.integer(64) as u64,
            _ => task.watchdog_us = random.integer(64) as u64,
        }
        return;
    }
    let Some(instance) = container.tasks.instances.get_mut(random.below(instances)) else { return };
    match random.below(6) {
        0 => instance.entry = FunctionId(below16(random, functions)),
        1 => instance.slot_offset = nudge(random, i64::from(instance.slot_offset)) as u16,
        2 => instance.slot_count = nudge(random, i64::from(instance.slot_count)) as u16,
        3 => instance.block_offset = nudge(random, i64::from(instance.block_offset)) as u16,
        4 => instance.task.0 = below16(random, 8),
        _ => instance.id.0 = below16(random, 8),
    }
}

fn spoil_code(random: &mut Random, container: &mut Container) {
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
