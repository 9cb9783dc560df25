//! Containers (`.iplc`): one compiled RESOURCE.
//!
//! [`model`] is what a container says, as Rust values. Its byte layout is fixed by the reference design
//! (`61131-task-support.md`: header, task table) and by `docs/container.md` for the rest. [`layout`] has the fixed records, one row a
//! field; `wire` derives the form of everything else from one row a struct or choice, so that writer and reader can not drift apart.
//!
//! A container has exactly one file: [`write()`] is canonical, and [`read()`] refuses every other spelling. So `read(write(c)) == c` and
//! `write(read(b)) == b`, and the hashes name the content.

pub mod layout;
pub mod model;

mod error;
mod hashes;
mod header;
mod read;
mod seal;
mod sections;
mod signature;
mod wire;
mod write;

pub use error::{ReadCode, ReadError, WriteError};
pub use hashes::{content_hash, debug_hash, layout_hash, retain_hash};
pub use model::*;
pub use read::read;
pub use seal::{reseal, strip};
pub(crate) use sections::shapes;
pub use signature::{SIGNATURE_SECTION_BYTES, signature_section};
pub use write::write;

#[cfg(test)]
mod tests;
