//! The standard library of IEC 61131-3, as tables: functions ([`functions`]) and function blocks ([`blocks`]).
//!
//! A function is one row: its name, its parameters' classes, the rule of its result. The front end maps a row to instructions, so a
//! function has the meaning of its instructions and nothing here runs. A function block is Structured Text of its own, compiled
//! with the program that uses it: both engines then agree on it because they agree on the language.

pub mod blocks;
pub mod functions;
