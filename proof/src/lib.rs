//! # khz-proof: the engines held against each other
//!
//! A claim of Kilohertz is that the interpreter and the native engine are one machine: the same values, traps, trap places and memory,
//! after every scan. This crate looks for a program that says otherwise.
//!
//! [`bytecode`] makes containers that verify by construction, from a seed ([`random`]); [`evaluator`] is a third, slow, checked
//! reading of the documents; [`oracle`] runs one container in all engines and names the first difference; [`shrink`] makes what differs small; [`mutate`] spoils
//! container files to see whether the reader and the verifier let through anything that the engines then disagree about. [`st`] makes
//! Structured Text together with its meaning, for the front end. [`schedule`] makes configurations
//! of many tasks and foretells by a brute-force model what a scheduler must do with them. [`statistics`]
//! counts what was reached, because a search that never went there proves nothing; [`campaign`] spreads many seeds over threads, [`watch`] names the
//! one that does not end, [`arguments`] reads what a search is asked.
//!
//! All this knows engines only as [`khz_machine::engine::Engine`], made by makers that it is handed: a further engine, or one with a pass switched
//! off, is one more maker. [`harness`] alone names the front end, the engines and the scheduler. Nothing here reads a clock or the environment: a seed is a program.
//!
//! It is a tool of tests: where the verifier's promise is found broken it panics, and that is a finding.
#![forbid(unsafe_code)]
#![allow(clippy::missing_panics_doc, reason = "a panic of this crate is a finding, never a matter of its callers")]

pub mod arguments;
pub mod bytecode;
pub mod campaign;
pub mod evaluator;
pub mod harness;
pub mod mutate;
pub mod oracle;
pub mod panics;
pub mod random;
pub mod round_trip;
pub mod schedule;
pub mod shrink;
pub mod st;
pub mod statistics;
pub mod traces;
pub mod watch;
