//! From a container to its bytes.

use super::error::WriteError;
use super::hashes::retain_hash;
use super::header::header;
use super::layout::{HeaderField, Record as Fixed};
use super::model::Container;
use super::sections::put_types;
use super::signature::check_signatures;
use super::wire::Wire;

/// The bytes of the sections in file order; empty where there is none.
pub(super) type SectionBytes<'a> = [&'a [u8]; 7];

/// The bytes of a container's one file.
///
/// # Errors
/// A part that exceeds the format (more than 65,535 slots, say), or a signature that does not belong to the content: such a file could not be read back.
pub fn write(container: &Container) -> Result<Vec<u8>, WriteError> {
    let (header, sections) = lay_out(container)?;
    let refused = check_signatures(&header, &container.content_signature, &container.debug_signature);
    refused.map_err(|(_, reason)| WriteError::new(reason))?;
    let mut file = header.bytes().to_vec();
    for section in &sections {
        file.extend_from_slice(section);
    }
    Ok(file)
}

/// Header and sections.
pub(super) fn lay_out(container: &Container) -> Result<(Fixed<HeaderField>, [Vec<u8>; 7]), WriteError> {
    let mut types = Vec::new();
    put_types(&container.types, &retain_hash(&container.types)?, &mut types)?;
    let mut debug = Vec::new();
    if let Some(section) = &container.debug {
        section.put(&mut debug)?;
    }
    let sections = [
        container.content_signature.clone(),
        container.debug_signature.clone(),
        types,
        bytes(&container.tasks)?,
        bytes(&container.constants)?,
        bytes(&container.functions)?,
        debug,
    ];
    let header = header(container, &sections.each_ref().map(Vec::as_slice))?;
    Ok((header, sections))
}

fn bytes(section: &impl Wire) -> Result<Vec<u8>, WriteError> {
    let mut out = Vec::new();
    section.put(&mut out)?;
    Ok(out)
}
