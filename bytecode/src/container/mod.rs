//! Containers (`.iplc`): one compiled RESOURCE.
//!
//! [`model`] is what a container says, as Rust values. Its byte layout is fixed by the reference design
//! (`61131-task-support.md`: header, task table) and by `docs/container.md` for the rest.

pub mod model;

pub use model::*;
