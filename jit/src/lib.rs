//! # khz-jit: the native-code engine of Kilohertz
//!
//! Verified bytecode becomes the mid-level form ([`mir`]) by [`build`], is improved by [`passes`], is lowered to CLIF by [`lower`], and
//! compiled by Cranelift; [`Jit`] holds the code and runs it.
//!
//! Why so:
//! - The image's base is a *parameter* and offsets are constants: absolute addresses would be made anew in every block. Each program instance
//!   has code of its own, until a type has so many instances that they share code which takes the two addresses of their memory.
//! - Traps need no signals. Each guard is a compare and a branch that is not taken, to a cold block behind the function, which writes back what
//!   is held in registers, records what happened in the [`context::Context`], and returns a status; callers hand it on.
//! - The lowering decides nothing, so that every improvement is a pass on one small form, with tests that show it before and after.
//! - Code is owned by an `Arc` that each handle holds and is freed when the last one goes. It is never written after it was finished.
//!
//! `unsafe` stands in two files: `code.rs` (memory of code, calling into it) and `runtime.rs` (what code calls).

pub mod build;
pub mod context;
pub mod cut;
pub mod listing;
pub mod lower;
pub mod mir;
pub mod passes;
pub mod text;

mod code;
mod counts;
mod plan;
mod run;
mod runtime;
mod symbols;

use std::sync::Arc;

use khz_bytecode::ids::FunctionId;
use khz_bytecode::verify::Verified;
use khz_machine::image::ImageLayout;

pub use code::Handle;
pub use counts::BlockCounts;
pub use passes::Passes;
pub use run::Jit;
pub use symbols::{LineRange, Symbol};
pub use text::{clif_text, mir_text};

/// What code is made like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct JitOptions {
    /// Whether code charges fuel. Code without takes no notice of a run's fuel; code with it runs unlimited where a run has none.
    pub fuel: bool,
    /// Whether Cranelift verifies what it is given: for tests, at 1.5 to 2 times the compile time.
    pub verify_ir: bool,
    /// Which passes run.
    pub passes: Passes,
    /// Whether it is noted which passes changed something ([`Jit::passes_fired`]): for tests, at the cost of a copy of each function for each pass.
    pub note_passes: bool,
    /// From how many instructions of the mid-level form on a stretch of a longer function is [cut out](cut): [`cut::PART_ITEMS`], but for tests.
    pub part_items: usize,
    /// Whether loops and calls look at the deadline: off only to measure what that costs. Nothing ends an endless loop then.
    pub deadline_checks: bool,
    /// Whether it is noted which bytes of the code come from which source line ([`Jit::symbols`]): for profilers. The code is the same.
    pub note_lines: bool,
    /// Whether the code counts how often each block is run ([`Jit::block_counts`]): for [`listing`]. It is slower then and otherwise the same.
    pub count_blocks: bool,
}

impl Default for JitOptions {
    fn default() -> Self {
        JitOptions {
            fuel: false,
            verify_ir: cfg!(debug_assertions),
            passes: Passes::default(),
            note_passes: false,
            part_items: cut::PART_ITEMS,
            deadline_checks: true,
            note_lines: false,
            count_blocks: false,
        }
    }
}

/// Why there is no native code.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JitError {
    /// The host can not be compiled for.
    #[error("this machine can not run native code: {0}")]
    Host(String),
    /// No memory for code, or it can not be made executable.
    #[error("there is no memory for native code: {0}")]
    Memory(String),
    /// Cranelift refused a function.
    #[error("function {function} can not be compiled: {reason}")]
    Function {
        /// Which.
        function: FunctionId,
        /// What Cranelift said.
        reason: String,
    },
    /// Calls may nest so deep that a thread's stack could not hold them.
    #[error("the program's calls may need {needed_bytes} bytes of native stack; {limit_bytes} are allowed")]
    Stack {
        /// What the deepest nesting may need.
        needed_bytes: u64,
        /// What is allowed: [`MAX_STACK_BYTES`].
        limit_bytes: u64,
    },
}

/// Most bytes of native stack that a program's calls may need. A thread that runs a [`Jit`] must have this much free, and 256 KiB for the host's
/// own routines; threads are made with 8 MiB.
pub const MAX_STACK_BYTES: u64 = 6 << 20;

/// From how many instances of a program type on they share code.
pub const SHARED_FROM_INSTANCES: usize = 5;

impl Jit {
    /// Compiles everything that the container's entries reach.
    ///
    /// # Errors
    /// A host without native code, too little memory, a function that Cranelift refuses, or calls that may nest too deep for a thread's stack.
    pub fn new(verified: Arc<Verified>, layout: &ImageLayout, options: JitOptions) -> Result<Jit, JitError> {
        let scope = plan::scope(&verified, layout);
        let plan = plan::Plan::new(&scope);
        let compiled = run::compile(&scope, &plan, options)?;
        let parts = run::Parts::new(&scope, &plan, compiled)?;
        Ok(Jit::from_parts(verified, parts))
    }
}
