//! Structured Text to containers.

pub mod diagnostics;
pub mod source;
pub mod syntax;
