//! # khz-machine: what both engines must agree on
//!
//! The interpreter and the native engine give the same results bit for bit because neither owns a meaning: the memory image
//! ([`image`]), the operations ([`semantics`]), the standard functions and function blocks ([`library`]), the traps ([`trap`]) and
//! the contract of an engine ([`engine`]) live here, once.
//!
//! Everything is pure over its arguments: no clock, no file, no environment. The scheduler sees engines only through
//! [`engine::Engine`].
#![forbid(unsafe_code)]

pub mod engine;
pub mod image;
pub mod instance_map;
pub mod json;
pub mod library;
pub mod report;
pub mod semantics;
pub mod trap;
pub mod variables;
