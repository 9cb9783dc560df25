//! Changing a container that is already laid out: new hashes for changed bytes, and stripping.

use super::hashes::{content_hash_of, debug_hash_of, layout_hash, retain_hash};
use super::layout::{HeaderField, RecordField, Section};
use super::model::{Container, Hash};
use super::read::File;

/// Gives changed bytes the hashes of what they now say, as far as they still say something: so tests reach what lies behind the hashes.
///
/// Without a readable directory nothing changes. Retain and layout hash follow when the sections can be parsed. Signatures stay, and are wrong then.
pub fn reseal(bytes: &mut [u8]) {
    let Ok(file) = File::open(bytes) else { return };
    let parsed = file.parse().ok().and_then(|(container, _)| {
        let retain = retain_hash(&container.types).ok()?;
        Some((retain, layout_hash(&container).ok()?))
    });
    let type_offset = file.offsets.get(Section::Type as usize).copied().unwrap_or_default();
    let debug = debug_hash_of(file.sections.last().copied().unwrap_or_default());
    if let Some((retain, layout)) = parsed {
        put(bytes, type_offset, &retain);
        put(bytes, HeaderField::LayoutHash.offset(), &layout);
    }
    put(bytes, HeaderField::DebugHash.offset(), &debug);
    // The content covers what was just changed.
    let content = File::open(bytes).ok().map(|file| content_hash_of(&file.header, &file.sections));
    if let Some(content) = content {
        put(bytes, HeaderField::ContentHash.offset(), &content);
    }
}

fn put(bytes: &mut [u8], offset: usize, hash: &Hash) {
    let target = bytes.get_mut(offset..).unwrap_or_default();
    for (to, from) in target.iter_mut().zip(hash) {
        *to = *from;
    }
}

/// Drops the debug section and its signature. Nothing behaves differently: no engine and no scheduler reads it, and the content hash stays.
pub fn strip(container: &mut Container) {
    container.debug = None;
    container.debug_signature.clear();
}
