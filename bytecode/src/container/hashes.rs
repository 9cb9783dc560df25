//! The hashes of the header; `docs/container.md` defines them.

use sha2::{Digest, Sha256};

use super::error::WriteError;
use super::layout::{HASHED_HEADER_RANGES, HeaderField, Record as Fixed, Section};
use super::model::{Container, Hash, Type, TypeSection};
use super::wire::Wire;
use super::write::{SectionBytes, lay_out};

/// First bytes of the memory layout signature; the number counts its versions.
const LAYOUT_TAG: &[u8] = b"khz layout 1";

fn sha256(bytes: &[u8]) -> Hash {
    Sha256::digest(bytes).into()
}

/// SHA-256 over parameters, types, tasks, constants and code: what a content signature signs.
///
/// # Errors
/// A container that exceeds the format.
pub fn content_hash(container: &Container) -> Result<Hash, WriteError> {
    Ok(lay_out(container)?.0.get_hash(HeaderField::ContentHash))
}

/// SHA-256 over the debug section; zeros without one. What a debug signature signs.
///
/// # Errors
/// A container that exceeds the format.
pub fn debug_hash(container: &Container) -> Result<Hash, WriteError> {
    Ok(lay_out(container)?.0.get_hash(HeaderField::DebugHash))
}

/// The content hash of a header (its other fields set) and its sections.
pub(super) fn content_hash_of(header: &Fixed<HeaderField>, sections: &SectionBytes<'_>) -> Hash {
    let mut hasher = Sha256::new();
    for range in HASHED_HEADER_RANGES {
        hasher.update(header.bytes().get(range).unwrap_or_default());
    }
    for (section, bytes) in Section::ALL.iter().zip(sections) {
        if matches!(section, Section::Type | Section::Task | Section::Constant | Section::Code) {
            // The size field of the directory, which is not among the hashed bytes.
            hasher.update(u32::try_from(bytes.len()).unwrap_or(u32::MAX).to_le_bytes());
            hasher.update(bytes);
        }
    }
    hasher.finalize().into()
}

/// The hash of a debug section; zeros for none.
pub(super) fn debug_hash_of(bytes: &[u8]) -> Hash {
    if bytes.is_empty() { Hash::default() } else { sha256(bytes) }
}

/// SHA-256 over the retain map, as its table's count and rows; zeros when nothing is retained.
///
/// # Errors
/// A map that exceeds the format.
pub fn retain_hash(types: &TypeSection) -> Result<Hash, WriteError> {
    if types.retain.is_empty() {
        return Ok(Hash::default());
    }
    let mut bytes = Vec::new();
    types.retain.put(&mut bytes)?;
    Ok(sha256(&bytes))
}

/// SHA-256 over the memory layout signature: two containers with the same one have the same memory image, cell by cell.
///
/// # Errors
/// A container that exceeds the format.
pub fn layout_hash(container: &Container) -> Result<Hash, WriteError> {
    let mut out = LAYOUT_TAG.to_vec();
    let section = &container.types;
    let types: Vec<Type> = section.types.iter().map(without_methods).collect();
    types.put(&mut out)?;
    section.arrays.put(&mut out)?;
    section.slots.put(&mut out)?;
    section.data.iter().map(|variable| (variable.offset, variable.ty)).collect::<Vec<_>>().put(&mut out)?;
    section.programs.put(&mut out)?;
    section.block_instances.put(&mut out)?;
    container.tasks.shared_globals.put(&mut out)?;
    let partitions: Vec<_> = container
        .tasks
        .instances
        .iter()
        .map(|instance| ((instance.slot_offset, instance.slot_count), (instance.block_offset, instance.block_count)))
        .collect();
    partitions.put(&mut out)?;
    let parameters = &container.parameters;
    parameters.input_image_bytes.put(&mut out)?;
    parameters.output_image_bytes.put(&mut out)?;
    parameters.memory_image_bytes.put(&mut out)?;
    parameters.data_region_bytes.put(&mut out)?;
    Ok(sha256(&out))
}

/// A type as the layout sees it: code may change without it.
fn without_methods(ty: &Type) -> Type {
    match ty {
        Type::Block { record, base, .. } => Type::Block { record: record.clone(), base: *base, methods: Vec::new() },
        other => other.clone(),
    }
}
