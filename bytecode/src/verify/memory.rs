//! Memory: variables, instance map, initial and retained values, constants, budget.

use std::collections::BTreeSet;

use super::error::{Check, VerifyError};
use super::rules::Rule;
use super::types::TypeTable;
use crate::container::{BlockInstance, Constant, Container, InitRun, Owner, Region, Type};
use crate::ids::TypeId;
use crate::limits::{
    MAX_BLOCK_INSTANCES, MAX_CALL_DEPTH, MAX_STACK_DEPTH, NULL_GUARD_BYTES, REGION_ALIGN_BYTES, SLOT_BYTES,
};
use crate::value::Storage;

/// Bits of the one NaN of REAL.
const NAN_F32: u32 = 0xFFC0_0000;
/// Bits of the one NaN of LREAL.
const NAN_F64: u64 = 0xFFF8_0000_0000_0000;

fn is_foreign_f32(bits: u32) -> bool {
    f32::from_bits(bits).is_nan() && bits != NAN_F32
}

fn is_foreign_f64(bits: u64) -> bool {
    f64::from_bits(bits).is_nan() && bits != NAN_F64
}

/// Checks what the header asks for. Returns the size of the memory image.
pub(super) fn check_header(container: &Container) -> Check<u64> {
    let parameters = &container.parameters;
    let slots = container.types.slots.len();
    let limits = [
        ("max_stack_depth", usize::from(parameters.max_stack_depth), usize::from(MAX_STACK_DEPTH)),
        ("max_call_depth", usize::from(parameters.max_call_depth), usize::from(MAX_CALL_DEPTH)),
        ("the number of slots", slots, usize::from(u16::MAX)),
        ("the number of functions", container.functions.len(), usize::from(u16::MAX)),
        ("the number of constants", container.constants.len(), usize::from(u16::MAX) + 1),
        ("the number of types", container.types.types.len(), usize::from(u16::MAX) + 1),
    ];
    if let Some((name, found, limit)) = limits.iter().find(|(_, found, limit)| found > limit) {
        return Err(VerifyError::whole(Rule::HeaderLimits, format!("{name} is {found}; at most {limit} is allowed")));
    }
    if usize::from(container.tasks.shared_globals) > slots {
        let message = format!("{} shared globals among {slots} slots", container.tasks.shared_globals);
        return Err(VerifyError::whole(Rule::SharedGlobals, message));
    }
    let bytes = image_bytes(container);
    if bytes > i32::MAX as u64 {
        return Err(VerifyError::whole(Rule::MemoryBudget, format!("the image would take {bytes} bytes")));
    }
    Ok(bytes)
}

/// Bytes of the memory image: the regions in their order, each on a cache line.
fn image_bytes(container: &Container) -> u64 {
    let parameters = &container.parameters;
    let slots = container.types.slots.len() as u64 * u64::from(SLOT_BYTES);
    let frames = std::iter::repeat_n(u64::from(parameters.frame_bytes), container.tasks.tasks.len().max(1));
    let images = [parameters.memory_image_bytes, parameters.output_image_bytes, parameters.input_image_bytes];
    let regions = [slots, u64::from(parameters.data_region_bytes)].into_iter().chain(frames);
    let regions = regions.chain(images.map(u64::from));
    regions.fold(0, |end, bytes| end.next_multiple_of(u64::from(REGION_ALIGN_BYTES)).saturating_add(bytes))
}

/// Checks the constant pool.
pub(super) fn check_constants(container: &Container) -> Check {
    for (index, constant) in container.constants.iter().enumerate() {
        let foreign = match constant {
            Constant::I64(_) => false,
            Constant::F32(bits) => is_foreign_f32(*bits),
            Constant::F64(bits) => is_foreign_f64(*bits),
        };
        if foreign {
            return Err(VerifyError::entry(Rule::ConstantNan, "constant", index, "it is a NaN, but not the one NaN"));
        }
    }
    Ok(())
}

/// Checks the variables of the data region and the program types.
pub(super) fn check_variables(container: &Container, types: &TypeTable<'_>) -> Check {
    let mut end = u64::from(NULL_GUARD_BYTES);
    for (index, variable) in container.types.data.iter().enumerate() {
        let error = |rule, message: String| Err(VerifyError::entry(rule, "data", index, message));
        if types.get(variable.ty).is_none() {
            return error(Rule::DataType, format!("type {} does not exist", variable.ty));
        }
        if variable.constant && types.has_block(variable.ty) {
            return error(Rule::DataType, "it is constant and holds a function block instance".into());
        }
        let extent = types.extent(variable.ty);
        let after = u64::from(variable.offset) + u64::from(extent.size);
        let aligned = variable.offset.is_multiple_of(extent.align.max(1));
        if u64::from(variable.offset) < end || after > u64::from(container.parameters.data_region_bytes) || !aligned {
            let region = container.parameters.data_region_bytes;
            let message = format!(
                "{} bytes with alignment {} at offset {}; it must begin at {end} or behind and end by {region}",
                extent.size, extent.align, variable.offset
            );
            return error(Rule::DataLayout, message);
        }
        end = after;
    }
    for (index, program) in container.types.programs.iter().enumerate() {
        let Some(block) = program.block else { continue };
        if !matches!(types.get(block), Some(Type::Struct(_))) {
            let message = format!("type {block} is no structure");
            return Err(VerifyError::entry(Rule::ProgramType, "program", index, message));
        }
    }
    Ok(())
}

/// Checks the function block instance table. Returns the offset of each program instance's data block.
///
/// Entry functions and their owners were checked before.
pub(super) fn check_instances(container: &Container, types: &TypeTable<'_>) -> Check<Vec<Option<u32>>> {
    let rows = &container.types.block_instances;
    let error = |index, message: String| VerifyError::entry(Rule::BlockInstances, "block_instance", index, message);
    let too_many = |index| error(index, format!("the variables hold more than {MAX_BLOCK_INSTANCES} instances"));
    // Steps left for listing what must be there: instances share it, so that many large ones do not add up.
    let mut budget = MAX_BLOCK_INSTANCES;
    let mut blocks = Vec::new();
    let mut own_variables = BTreeSet::new();
    let mut next = 0;
    for (number, instance) in container.tasks.instances.iter().enumerate() {
        let block_type = instance_block_type(container, number);
        let count = usize::from(instance.block_count);
        if count > 0 && usize::from(instance.block_offset) != next {
            let message =
                format!("instance {number} says that its rows begin at {}, not at {next}", instance.block_offset);
            return Err(error(next, message));
        }
        let own = rows.get(next..next + count);
        let own = own.ok_or_else(|| error(rows.len(), format!("instance {number} has rows behind the end")))?;
        let Some(block_type) = block_type else {
            if count > 0 {
                return Err(error(next, format!("instance {number} has rows, but its program type has no data block")));
            }
            blocks.push(None);
            continue;
        };
        let size = types.size(block_type);
        let first = own.first().filter(|row| row.ty == block_type && row.count == 1 && row.stride == size);
        let first =
            first.ok_or_else(|| error(next, format!("the first row of instance {number} is not its data block")))?;
        let variable = container.types.data.binary_search_by_key(&first.offset, |variable| variable.offset);
        let variable = variable.ok().and_then(|at| container.types.data.get(at));
        if !variable.is_some_and(|v| v.ty == block_type && !v.constant) || !own_variables.insert(first.offset) {
            let message =
                format!("the data block of instance {number} is no variable of its own at offset {}", first.offset);
            return Err(error(next, message));
        }
        let mut expected = Vec::new();
        if !types.block_rows(block_type, first.offset, budget, &mut expected) {
            return Err(too_many(next));
        }
        budget -= expected.len();
        compare_rows(&own[1..], &expected, next + 1)?;
        blocks.push(Some(first.offset));
        next += count;
    }
    let globals = rows.get(next..).unwrap_or_default();
    let mut expected = Vec::new();
    let mut variables = container.types.data.iter().filter(|variable| !own_variables.contains(&variable.offset));
    if !variables.all(|variable| types.block_rows(variable.ty, variable.offset, budget, &mut expected)) {
        return Err(too_many(next));
    }
    compare_rows(globals, &expected, next)?;
    Ok(blocks)
}

/// Type of the data block of a program instance whose entry was checked.
fn instance_block_type(container: &Container, number: usize) -> Option<TypeId> {
    let entry = container.tasks.instances.get(number)?.entry;
    match container.functions.get(entry.index())?.owner {
        Owner::Program(program) => container.types.programs.get(program.index())?.block,
        Owner::None | Owner::Block(_) => None,
    }
}

/// Checks that `rows` list exactly the instances that `expected` lists; `at` is the position of the first in the table.
///
/// The canonical rows are accepted as they are; other ways to put the same instances into rows are unfolded and compared one by one.
fn compare_rows(rows: &[BlockInstance], expected: &[BlockInstance], at: usize) -> Check {
    let key = |row: &BlockInstance| (row.offset, row.ty, row.stride, row.count);
    let sorted = |rows: &[BlockInstance]| {
        let mut keys: Vec<_> = rows.iter().map(key).collect();
        keys.sort_unstable();
        keys
    };
    if sorted(rows) == sorted(expected) {
        return Ok(());
    }
    let error = |position: usize, message: String| {
        Err(VerifyError::entry(Rule::BlockInstances, "block_instance", at + position, message))
    };
    let (Some(found), Some(wanted)) = (unfold(rows), unfold(expected)) else {
        return error(0, format!("more than {MAX_BLOCK_INSTANCES} instances, not listed by array"));
    };
    for (number, (offset, ty, row)) in found.iter().enumerate() {
        if wanted.get(number).map(|(offset, ty, _)| (offset, ty)) != Some((offset, ty)) {
            return error(
                *row,
                format!("it lists type {ty} at offset {offset}, where no instance is or one is missing"),
            );
        }
    }
    match wanted.get(found.len()) {
        Some((offset, ty, _)) => {
            error(rows.len(), format!("the instance of type {ty} at offset {offset} is not listed"))
        }
        None => Ok(()),
    }
}

/// Every instance of some rows as (offset, type, position of its row), ascending; none when they are too many or too far.
fn unfold(rows: &[BlockInstance]) -> Option<Vec<(u32, TypeId, usize)>> {
    let total = rows.iter().fold(0u64, |total, row| total.saturating_add(u64::from(row.count)));
    if total > MAX_BLOCK_INSTANCES as u64 {
        return None;
    }
    let mut all = Vec::new();
    for (position, row) in rows.iter().enumerate() {
        for number in 0..row.count {
            let offset = number.checked_mul(row.stride).and_then(|inside| row.offset.checked_add(inside))?;
            all.push((offset, row.ty, position));
        }
    }
    all.sort_unstable();
    Some(all)
}

fn region_bytes(container: &Container, region: Region) -> u64 {
    let parameters = &container.parameters;
    match region {
        Region::Slots => container.types.slots.len() as u64 * u64::from(SLOT_BYTES),
        Region::Data => u64::from(parameters.data_region_bytes),
        Region::Memory => u64::from(parameters.memory_image_bytes),
        Region::Output => u64::from(parameters.output_image_bytes),
    }
}

/// Checks that `(region, offset, bytes)` entries are inside their region, ascending and apart.
fn check_ranges(
    container: &Container,
    rule: Rule,
    table: &'static str,
    ranges: impl Iterator<Item = (Region, u32, u64)>,
) -> Check {
    let mut end = (Region::Slots, 0);
    for (index, (region, offset, bytes)) in ranges.enumerate() {
        let limit = region_bytes(container, region);
        let after = u64::from(offset).saturating_add(bytes);
        let ascends = region > end.0 || (region == end.0 && u64::from(offset) >= end.1);
        if bytes == 0 || after > limit || !ascends {
            let message = format!("{bytes} bytes at offset {offset} of a region of {limit} bytes");
            return Err(VerifyError::entry(rule, table, index, message));
        }
        end = (region, after);
    }
    Ok(())
}

/// Checks what a warm restart keeps.
pub(super) fn check_retain(container: &Container) -> Check {
    let retain = &container.types.retain;
    let ranges = retain.iter().map(|range| (range.region, range.offset, u64::from(range.bytes)));
    check_ranges(container, Rule::RetainLayout, "retain", ranges)?;
    for (index, range) in retain.iter().enumerate() {
        let whole = range.offset.is_multiple_of(SLOT_BYTES) && range.bytes.is_multiple_of(SLOT_BYTES);
        if range.region == Region::Slots && !whole {
            return Err(VerifyError::entry(Rule::RetainLayout, "retain", index, "it holds a slot in part"));
        }
    }
    Ok(())
}

/// Checks the init image.
pub(super) fn check_init(container: &Container, types: &TypeTable<'_>) -> Check {
    let runs = &container.types.init_image;
    let bytes = |run: &InitRun| (run.bytes.len() as u64).saturating_mul(u64::from(run.repeat));
    // An honest run repeats whole values, so there are no more different places of a float in it than it has bytes.
    let mut steps = runs.iter().fold(MAX_BLOCK_INSTANCES, |steps, run| steps.saturating_add(2 * run.bytes.len()));
    check_ranges(container, Rule::InitLayout, "init", runs.iter().map(|run| (run.region, run.offset, bytes(run))))?;
    for (index, run) in runs.iter().enumerate() {
        // `check_ranges` held the end inside a region of at most 2 GiB.
        let end = run.offset + bytes(run) as u32;
        match run.region {
            Region::Slots => check_init_slots(container, index, run.offset..end)?,
            Region::Data => check_init_data(container, types, index, run.offset..end, &mut steps)?,
            Region::Memory | Region::Output => {}
        }
    }
    Ok(())
}

fn check_init_slots(container: &Container, index: usize, range: std::ops::Range<u32>) -> Check {
    for slot in range.start / SLOT_BYTES..range.end.div_ceil(SLOT_BYTES) {
        let Some(storage) = container.types.slots.get(slot as usize).copied() else { continue };
        let value = u64::from_le_bytes(initial_bytes(container, Region::Slots, slot * SLOT_BYTES));
        let bits = storage.bytes() * 8;
        let upper = if bits < 64 { value >> bits } else { 0 };
        let wrong = match storage {
            Storage::Bool => value > 1,
            // The upper half is 0, or the other test refuses the slot.
            Storage::F32 => is_foreign_f32(value as u32),
            Storage::F64 => is_foreign_f64(value),
            _ => false,
        };
        if wrong || upper != 0 {
            let message = format!("slot {slot} of storage {storage} can not begin as {value:#x}");
            return Err(VerifyError::entry(Rule::InitValue, "init", index, message));
        }
    }
    Ok(())
}

fn check_init_data(
    container: &Container,
    types: &TypeTable<'_>,
    index: usize,
    range: std::ops::Range<u32>,
    steps: &mut usize,
) -> Check {
    let data = &container.types.data;
    let first = data.partition_point(|variable| variable.offset <= range.start).saturating_sub(1);
    let period = container.types.init_image.get(index).map_or(1, |run| run.bytes.len());
    let period = u32::try_from(period).unwrap_or(u32::MAX);
    for variable in data.iter().skip(first).take_while(|variable| variable.offset < range.end) {
        types.floats(variable.ty, variable.offset, &range, period, steps, &mut |offset, storage| {
            let value = u64::from_le_bytes(initial_bytes(container, Region::Data, offset));
            let foreign = match storage {
                Storage::F32 => is_foreign_f32(value as u32),
                _ => is_foreign_f64(value),
            };
            if !foreign {
                return Ok(());
            }
            let message = format!("the float at offset {offset} of the data region is a NaN, but not the one NaN");
            Err(VerifyError::entry(Rule::InitValue, "init", index, message))
        })?;
        if *steps == 0 {
            let message = "its bytes repeat at another distance than the floats they stand for, in too many places";
            return Err(VerifyError::entry(Rule::AnalysisSize, "init", index, message));
        }
    }
    Ok(())
}

/// Eight initial bytes from `offset` of a region on; what no run covers is 0.
fn initial_bytes(container: &Container, region: Region, offset: u32) -> [u8; 8] {
    let runs = &container.types.init_image;
    std::array::from_fn(|at| {
        let offset = offset.saturating_add(at as u32);
        let position = runs.partition_point(|run| (run.region, run.offset) <= (region, offset));
        let run = position.checked_sub(1).and_then(|position| runs.get(position));
        let Some(run) = run.filter(|run| run.region == region) else { return 0 };
        let inside = u64::from(offset - run.offset);
        let length = run.bytes.len() as u64;
        if length == 0 || inside >= length.saturating_mul(u64::from(run.repeat)) {
            return 0;
        }
        run.bytes.get((inside % length) as usize).copied().unwrap_or(0)
    })
}
