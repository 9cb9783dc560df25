//! # Kilohertz: Structured Text at native speed, with every check in place
//!
//! Kilohertz compiles IEC 61131-3 Structured Text into verified bytecode containers and runs them, interpreted or as native code,
//! under a scheduler that measures every task cycle and ends what overruns. This crate is the façade: it joins the stages
//! ([`pipeline`]) reads files ([`files`]) and projects ([`project`]) and runs unit tests ([`testing`]). The stages themselves are crates of their own:
//!
//! - `khz-frontend`: text to containers, with diagnostics
//! - `khz-bytecode`: containers, instructions, the verifier
//! - `khz-machine`: what both engines must agree on
//! - `khz-interp`, `khz-jit`: the engines
//! - `khz-scheduler`: tasks, clocks, watchdogs, statistics
//!
//! [`lockstep`] holds engines against each other round by round, [`traces`] a program against a recorded trace; [`profilers`] tells `perf` what
//! native code is.
//!
//! The binary `khz` is in `src/main.rs`, a file for each subcommand in `src/cli/`.

pub mod files;
pub mod inputs;
pub mod lockstep;
pub mod pipeline;
pub mod profilers;
pub mod project;
pub mod testing;
pub mod traces;

pub use {khz_bytecode, khz_frontend, khz_interp, khz_jit, khz_machine, khz_proof, khz_scheduler};
