//! # khz-bytecode: what a compiled PLC resource is
//!
//! One container holds one RESOURCE of an IEC 61131-3 configuration: its types and variables, its task table, its
//! constants and its code. This crate says what a container may hold ([`container`]), what its instructions are
//! ([`instruction`]), and which containers are sound ([`verify`]). It runs nothing: meaning lives in `khz-machine`.
//!
//! The way of the data: a front end fills a [`container::Container`]; [`container::write()`] lays it out byte for byte;
//! [`container::read()`] takes hostile bytes back into a `Container` and never panics; [`verify::verify`] is the only maker
//! of [`verify::Verified`], and both engines accept nothing else.
//!
//! Why a typed stack machine: the wire form stays small and has one obvious encoding, the verifier needs one
//! pass with a stack of types, and each engine derives the form it likes (registers, SSA) at load.
//!
//! One home for each thing: an instruction is one row of [`instruction::table`], a trap one row of [`trap`], a verifier
//! rule one row of [`verify::rules`], a container field one row of [`container::layout`].
#![forbid(unsafe_code)]

pub mod assembler;
pub mod canary;
pub mod container;
pub mod disassembler;
pub mod documentation;
pub mod ids;
pub mod instruction;
pub mod limits;
pub mod trap;
pub mod value;
pub mod verify;
