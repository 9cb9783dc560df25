//! Mutants of the model: types, heads of functions, header numbers, tasks, and the tables of the type section.

use khz_bytecode::container::{
    Constant, Container, ControlPlace, DebugPlace, DebugType, MethodSignature, OverrunPolicy, Region, RetainRange,
    SingleSource, SystemVariable, SystemVariableKind, TaskExtension, TaskType, Type,
};
use khz_bytecode::ids::{ArrayId, FunctionId, MethodId, SlotIndex, TypeId};
use khz_bytecode::value::{BytePlace, IntegerType, LocalType, RefType, Storage, ValueType};

use crate::random::Random;

/// A number near another, or an interesting one.
pub(super) fn nudge(random: &mut Random, number: i64) -> i64 {
    if random.chance(60) { number.wrapping_add(random.one_of([-8, -4, -1, 1, 2, 4, 8])) } else { random.integer(64) }
}

/// A number up to `limit`, which is one too many for a position in a table of that length.
pub(super) fn below16(random: &mut Random, limit: usize) -> u16 {
    random.below(limit + 1) as u16
}

fn storage(random: &mut Random) -> Storage {
    Storage::ALL[random.below(Storage::ALL.len())]
}

fn near32(random: &mut Random, number: u32) -> u32 {
    nudge(random, i64::from(number)) as u32
}

pub(super) fn spoil_constant(random: &mut Random, container: &mut Container) {
    let count = container.constants.len();
    let Some(constant) = container.constants.get_mut(random.below(count)) else { return };
    *constant = match random.below(3) {
        0 => Constant::I64(random.integer(64)),
        1 => Constant::F32(random.bits() as u32),
        _ => Constant::F64(random.bits()),
    };
}

pub(super) fn spoil_data(random: &mut Random, container: &mut Container) {
    let (count, types) = (container.types.data.len(), container.types.types.len());
    let Some(variable) = container.types.data.get_mut(random.below(count)) else { return };
    match random.below(3) {
        0 => variable.offset = near32(random, variable.offset),
        1 => variable.ty = TypeId(below16(random, types)),
        _ => variable.constant = !variable.constant,
    }
}

pub(super) fn spoil_init(random: &mut Random, container: &mut Container) {
    let count = container.types.init_image.len();
    let Some(run) = container.types.init_image.get_mut(random.below(count)) else { return };
    match random.below(3) {
        0 => run.offset = near32(random, run.offset),
        1 => run.repeat = near32(random, run.repeat),
        _ => run.bytes.iter_mut().for_each(|byte| *byte = random.bits() as u8),
    }
}

pub(super) fn spoil_block_rows(random: &mut Random, container: &mut Container) {
    let (count, types) = (container.types.block_instances.len(), container.types.types.len());
    let Some(row) = container.types.block_instances.get_mut(random.below(count)) else { return };
    match random.below(4) {
        0 => row.offset = near32(random, row.offset),
        1 => row.stride = near32(random, row.stride),
        2 => row.count = near32(random, row.count),
        _ => row.ty = TypeId(below16(random, types)),
    }
}

pub(super) fn spoil_slots(random: &mut Random, container: &mut Container) {
    let count = container.types.slots.len();
    if random.chance(10) {
        container.types.slots.push(storage(random));
    } else if let Some(slot) = container.types.slots.get_mut(random.below(count)) {
        *slot = storage(random);
    }
}

pub(super) fn spoil_programs(random: &mut Random, container: &mut Container) {
    let (count, types) = (container.types.programs.len(), container.types.types.len());
    let Some(program) = container.types.programs.get_mut(random.below(count)) else { return };
    let slots = program.slots.len();
    match random.below(4) {
        0 => program.block = random.chance(70).then(|| TypeId(below16(random, types))),
        1 => program.slots.push(storage(random)),
        2 => drop(program.slots.pop()),
        _ => program.slots.iter_mut().skip(random.below(slots)).take(1).for_each(|slot| *slot = storage(random)),
    }
}

/// Signatures of method names, and what the types say about their methods and bases.
pub(super) fn spoil_methods(random: &mut Random, container: &mut Container) {
    let (types, functions) = (container.types.types.len(), container.functions.len());
    if random.chance(30) {
        let count = container.types.methods.len();
        let Some(method) = container.types.methods.get_mut(random.below(count)) else {
            container.types.methods.push(MethodSignature::default());
            return;
        };
        let target =
            RefType { target: TypeId(below16(random, types)), write: random.chance(50), image: random.chance(50) };
        match random.below(4) {
            0 => method.parameters.push(LocalType::Scalar(storage(random))),
            1 => method.parameters.push(LocalType::Ref(target)),
            2 => drop(method.parameters.pop()),
            _ => method.results.push(ValueType::ALL[random.below(ValueType::ALL.len())]),
        }
        return;
    }
    let blocks: Vec<usize> = (0..types).filter(|at| matches!(container.types.types[*at], Type::Block { .. })).collect();
    let Some(&at) = random.pick(&blocks) else { return };
    let Type::Block { base, methods, .. } = &mut container.types.types[at] else { return };
    let (count, other) = (methods.len(), random.below(methods.len()));
    match (random.below(5), methods.get_mut(random.below(count))) {
        (0, Some(method)) => method.0 = MethodId(random.below(6) as u16),
        (1, Some(method)) => method.1 = FunctionId(below16(random, functions)),
        (2, Some(_)) => drop(methods.remove(other)),
        (3, _) => methods.push((MethodId(random.below(6) as u16), FunctionId(below16(random, functions)))),
        _ => *base = random.chance(70).then(|| TypeId(below16(random, at))),
    }
}

pub(super) fn spoil_retain(random: &mut Random, container: &mut Container) {
    let (slots, data) = (container.types.slots.len(), container.parameters.data_region_bytes);
    let retain = &mut container.types.retain;
    let count = retain.len();
    let region = random.one_of([Region::Slots, Region::Data, Region::Memory, Region::Output]);
    match (random.below(5), retain.get_mut(random.below(count))) {
        (0, Some(range)) => range.offset = near32(random, range.offset),
        (1, Some(range)) => range.bytes = near32(random, range.bytes),
        (2, Some(range)) => range.region = region,
        (3, Some(_)) => drop(retain.pop()),
        // A range that may be right, behind those that are there.
        _ if region == Region::Slots => {
            let offset = random.below(slots) as u32 * 8;
            retain.push(RetainRange { region, offset, bytes: random.one_of([8, 8, 16, 4]) });
        }
        _ => {
            let offset = random.below(data as usize) as u32;
            retain.push(RetainRange { region, offset, bytes: random.below(12) as u32 });
        }
    }
}

pub(super) fn spoil_extensions(random: &mut Random, container: &mut Container) {
    let extensions = &mut container.types.task_extensions;
    let count = extensions.len();
    let slot = SlotIndex(random.below(16) as u16);
    let place = BytePlace::ALL[random.below(BytePlace::ALL.len())];
    match (random.below(8), extensions.get_mut(random.below(count))) {
        (0, _) => extensions.push(TaskExtension::default()),
        (1, _) => drop(extensions.pop()),
        (2, Some(extension)) => extension.phase_us = random.integer(64) as u64,
        (3, Some(extension)) => extension.watchdog_sensitivity = random.bits() as u16,
        (4, Some(extension)) => {
            extension.overrun_policy =
                random.one_of([OverrunPolicy::Grid, OverrunPolicy::AtOnce, OverrunPolicy::Realign]);
        }
        (5, Some(extension)) => extension.name = "n".repeat(random.one_of([0, 1, 255, 256])),
        (_, Some(extension)) => {
            extension.single = match random.below(5) {
                0 => SingleSource::None,
                1 => SingleSource::Slot(slot),
                2 => SingleSource::Data(random.below(64) as u32),
                3 => SingleSource::Bit { place, offset: random.below(8) as u32, bit: random.below(9) as u8 },
                _ => SingleSource::Literal(random.chance(50)),
            }
        }
        _ => {}
    }
}

pub(super) fn spoil_system(random: &mut Random, container: &mut Container) {
    let shared = usize::from(container.tasks.shared_globals);
    let kind = random.one_of([SystemVariableKind::UpTime, SystemVariableKind::UpLtime]);
    // A wide slot may be one that is right.
    let wide: Vec<usize> = (0..shared).filter(|at| container.types.slots.get(*at) == Some(&Storage::I64)).collect();
    let any = random.below(shared + 1);
    let slot = if random.chance(60) { random.pick(&wide).copied().unwrap_or(any) } else { any };
    let variables = &mut container.types.system_variables;
    let count = variables.len();
    match (random.below(3), variables.get_mut(random.below(count))) {
        (0, Some(variable)) => variable.slot = SlotIndex(slot as u16),
        (1, Some(variable)) => variable.kind = kind,
        _ => variables.push(SystemVariable { kind, slot: SlotIndex(slot as u16) }),
    }
}

/// What people read: no rule looks at it, so whoever shows it must live with anything.
pub(super) fn spoil_debug(random: &mut Random, container: &mut Container) {
    let Some(debug) = &mut container.debug else { return };
    let (lines, variables, types, names) =
        (debug.lines.len(), debug.variables.len(), debug.types.len(), debug.function_names.len());
    let (line, variable) = (random.below(lines), random.below(variables));
    match random.below(8) {
        0 => debug.lines.iter_mut().skip(line).take(1).for_each(|entry| entry.file = random.bits() as u16),
        1 => debug.lines.iter_mut().skip(line).take(1).for_each(|entry| entry.offset = near32(random, entry.offset)),
        2 => debug.variables.iter_mut().skip(variable).take(1).for_each(|found| found.ty = below16(random, types)),
        3 => debug.variables.iter_mut().skip(variable).take(1).for_each(|found| {
            let place = BytePlace::ALL[random.below(BytePlace::ALL.len())];
            let offset = random.integer(32) as u32;
            found.place = match random.below(3) {
                0 => DebugPlace::Slot(SlotIndex(offset as u16)),
                1 => DebugPlace::Bytes(place, offset),
                _ => DebugPlace::Bit(place, offset, random.below(9) as u8),
            };
        }),
        4 => debug.function_names.truncate(random.below(names)),
        5 => debug.instance_names.clear(),
        6 => debug.files.clear(),
        _ => spoil_debug_type(random, &mut debug.types),
    }
}

fn spoil_debug_type(random: &mut Random, types: &mut [DebugType]) {
    let count = types.len();
    match types.get_mut(random.below(count)) {
        Some(DebugType::Array { element, stride, dimensions }) => match random.below(3) {
            0 => *element = below16(random, count),
            1 => *stride = near32(random, *stride),
            _ => dimensions.push((random.integer(32) as i32, random.integer(32) as i32)),
        },
        Some(DebugType::Record { fields, .. }) => {
            let number = random.below(fields.len());
            for (name, offset, ty) in fields.iter_mut().skip(number).take(1) {
                match random.below(3) {
                    0 => *offset = near32(random, *offset),
                    1 => *ty = below16(random, count),
                    _ => name.clear(),
                }
            }
        }
        Some(DebugType::String { capacity } | DebugType::WideString { capacity }) => *capacity = random.bits() as u16,
        Some(DebugType::Enumeration { values, .. }) => values.clear(),
        Some(DebugType::Subrange { lower, .. }) => *lower = random.integer(64),
        Some(other) => *other = DebugType::String { capacity: u16::MAX },
        None => {}
    }
}

pub(super) fn spoil_type(random: &mut Random, container: &mut Container) {
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

pub(super) fn spoil_function(random: &mut Random, container: &mut Container) {
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

pub(super) fn spoil_parameters(random: &mut Random, container: &mut Container) {
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

pub(super) fn spoil_tasks(random: &mut Random, container: &mut Container) {
    let (tasks, instances, functions) =
        (container.tasks.tasks.len(), container.tasks.instances.len(), container.functions.len());
    if random.chance(30) {
        let Some(task) = container.tasks.tasks.get_mut(random.below(tasks)) else { return };
        match random.below(7) {
            0 => task.id.0 = below16(random, 8),
            1 => task.interval_us = random.integer(64) as u64,
            2 => task.watchdog_us = random.integer(64) as u64,
            3 => task.task_type = random.one_of([TaskType::Cyclic, TaskType::Event, TaskType::Freewheeling]),
            4 => task.single_slot = random.chance(70).then(|| SlotIndex(random.below(8) as u16)),
            5 => task.enabled = !task.enabled,
            _ => task.priority = random.bits() as u16,
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
