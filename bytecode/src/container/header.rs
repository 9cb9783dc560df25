//! The header: its fields from the model and back.

use super::error::WriteError;
use super::hashes::{content_hash_of, debug_hash_of, layout_hash};
use super::layout::{
    FLAG_CONTENT_SIGNATURE, FLAG_DEBUG, FLAG_TYPES, FORMAT_VERSION, HEADER_BYTES, HeaderField, MAGIC, NONE,
    Record as Fixed, Section,
};
use super::model::{Container, Parameters, Type, TypeSection};
use super::sections::{count, optional_id};
use super::write::SectionBytes;
use crate::ids::FunctionId;

/// The header of a container whose sections have these bytes.
pub(super) fn header(container: &Container, sections: &SectionBytes<'_>) -> Result<Fixed<HeaderField>, WriteError> {
    let mut header = Fixed::zero();
    header.set(HeaderField::Magic, MAGIC);
    header.set(HeaderField::Version, FORMAT_VERSION);
    header.set_bytes(HeaderField::SourceHash, &container.source_hash);
    header.set_bytes(HeaderField::LayoutHash, &layout_hash(container)?);
    set_parameters(&mut header, &container.parameters)?;
    set_derived(&mut header, container)?;
    directory(&mut header, sections)?;
    let debug = sections.last().copied().unwrap_or_default();
    header.set_bytes(HeaderField::DebugHash, &debug_hash_of(debug));
    let hash = content_hash_of(&header, sections);
    header.set_bytes(HeaderField::ContentHash, &hash);
    Ok(header)
}

fn set_parameters(header: &mut Fixed<HeaderField>, parameters: &Parameters) -> Result<(), WriteError> {
    header.set(HeaderField::MaxStackDepth, parameters.max_stack_depth);
    header.set(HeaderField::MaxCallDepth, parameters.max_call_depth);
    header.set(HeaderField::StringBytes, parameters.total_str_var_bytes);
    header.set(HeaderField::MaxString, parameters.max_str_length);
    header.set(HeaderField::InputBytes, parameters.input_image_bytes);
    header.set(HeaderField::OutputBytes, parameters.output_image_bytes);
    header.set(HeaderField::MemoryBytes, parameters.memory_image_bytes);
    header.set(HeaderField::DataRegionBytes, parameters.data_region_bytes);
    header.set(HeaderField::FrameBytes, parameters.frame_bytes);
    let startup = optional_id(parameters.startup_function.map(|id| id.0), "startup function")?;
    header.set(HeaderField::StartupFunction, startup);
    let init = optional_id(parameters.init_function.map(|id| id.0), "init function")?;
    header.set(HeaderField::InitFunction, init);
    Ok(())
}

/// The parameters that a header says.
pub(super) fn parameters(header: &Fixed<HeaderField>) -> Parameters {
    let function = |field| {
        let id = header.get_u16(field);
        (id != NONE).then_some(FunctionId(id))
    };
    Parameters {
        max_stack_depth: header.get_u16(HeaderField::MaxStackDepth),
        max_call_depth: header.get_u16(HeaderField::MaxCallDepth),
        input_image_bytes: header.get_u16(HeaderField::InputBytes),
        output_image_bytes: header.get_u16(HeaderField::OutputBytes),
        memory_image_bytes: header.get_u16(HeaderField::MemoryBytes),
        data_region_bytes: header.get_u32(HeaderField::DataRegionBytes),
        frame_bytes: header.get_u32(HeaderField::FrameBytes),
        startup_function: function(HeaderField::StartupFunction),
        init_function: function(HeaderField::InitFunction),
        total_str_var_bytes: header.get_u32(HeaderField::StringBytes),
        max_str_length: header.get_u16(HeaderField::MaxString),
    }
}

/// Counts and sums that follow from the sections.
fn set_derived(header: &mut Fixed<HeaderField>, container: &Container) -> Result<(), WriteError> {
    let types = &container.types;
    header.set(HeaderField::NumVariables, count(types.slots.len(), "slots")?);
    header.set(HeaderField::NumBlockInstances, count(types.block_instances.len(), "function block instance rows")?);
    let bytes = total("bytes of function block instances", covered_bytes(types))?;
    header.set(HeaderField::BlockInstanceBytes, bytes);
    header.set(HeaderField::WideStringBytes, total("bytes of WSTRING variables", wide_string_bytes(types))?);
    let wide = types.types.iter().filter_map(|ty| match ty {
        Type::WideString { capacity } => Some(*capacity),
        _ => None,
    });
    header.set(HeaderField::MaxWideString, wide.max().unwrap_or(0));
    header.set(HeaderField::NumFunctions, count(container.functions.len(), "functions")?);
    let blocks = types.types.iter().filter(|ty| matches!(ty, Type::Block { .. })).count();
    header.set(HeaderField::NumBlockTypes, count(blocks, "function block types")?);
    header.set(HeaderField::NumArrays, count(types.arrays.len(), "arrays")?);
    // Not in the header, but named by u16 ids all the same.
    count(types.types.len(), "types")?;
    count(types.programs.len(), "program types")?;
    count(types.methods.len(), "method names")?;
    count(container.constants.len(), "constants")?;
    Ok(())
}

fn total(what: &str, bytes: u64) -> Result<u32, WriteError> {
    u32::try_from(bytes).map_err(|_| WriteError::new(format!("{bytes} {what}; 4294967295 is the limit")))
}

/// Bytes of the data region that function block instances cover, each counted once.
fn covered_bytes(types: &TypeSection) -> u64 {
    let mut extents: Vec<(u64, u64)> = types
        .block_instances
        .iter()
        .map(|row| {
            let start = u64::from(row.offset);
            (start, start.saturating_add(u64::from(row.stride) * u64::from(row.count)))
        })
        .collect();
    extents.sort_unstable();
    let mut covered = 0_u64;
    let mut behind = 0;
    for (start, end) in extents {
        covered = covered.saturating_add(end.saturating_sub(start.max(behind)));
        behind = behind.max(end);
    }
    covered
}

/// Bytes of all WSTRINGs in the variables of the data region.
fn wide_string_bytes(types: &TypeSection) -> u64 {
    // A type refers only to types before it; what does not (the verifier refuses it) counts as 0.
    let mut bytes: Vec<u64> = Vec::with_capacity(types.types.len());
    for ty in &types.types {
        let of = |id: crate::ids::TypeId| bytes.get(id.index()).copied().unwrap_or(0);
        bytes.push(match ty {
            Type::WideString { capacity } => 2 * (u64::from(*capacity) + 1),
            Type::Array(array) => types.arrays.get(array.index()).map_or(0, |array| {
                array.dimensions.iter().fold(of(array.element), |bytes, (lower, upper)| {
                    let count = i64::from(*upper) - i64::from(*lower) + 1;
                    bytes.saturating_mul(u64::try_from(count).unwrap_or(0))
                })
            }),
            Type::Struct(record) | Type::Union(record) | Type::Block { record, .. } => {
                record.fields.iter().fold(0, |sum: u64, field| sum.saturating_add(of(field.ty)))
            }
            Type::Scalar(_) | Type::String { .. } => 0,
        });
    }
    let of = |id: crate::ids::TypeId| bytes.get(id.index()).copied().unwrap_or(0);
    types.data.iter().fold(0, |sum, variable| sum.saturating_add(of(variable.ty)))
}

/// Flags, offsets and sizes of sections that follow the header one behind the other.
fn directory(header: &mut Fixed<HeaderField>, sections: &SectionBytes<'_>) -> Result<(), WriteError> {
    let mut offset = HEADER_BYTES;
    let mut flags = FLAG_TYPES;
    for (section, bytes) in Section::ALL.iter().zip(sections) {
        if bytes.is_empty() {
            continue;
        }
        let end = offset.saturating_add(bytes.len());
        let place = u32::try_from(offset).ok().zip(u32::try_from(end).ok());
        let (start, end_u32) = place.ok_or_else(|| WriteError::new("the file is larger than 4 GiB"))?;
        header.set(section.offset_field(), start);
        header.set(section.size_field(), end_u32 - start);
        offset = end;
        flags |= match section {
            Section::ContentSignature => FLAG_CONTENT_SIGNATURE,
            Section::Debug => FLAG_DEBUG,
            _ => 0,
        };
    }
    header.set(HeaderField::Flags, flags);
    Ok(())
}
