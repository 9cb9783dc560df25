//! A program against a trace that was recorded elsewhere: on another runtime, or on a controller.
//!
//! A trace is a CSV file: `time_us`, then a column for each variable; a row holds until the next one. Some columns are inputs and drive the program
//! ([`Drive`]), the others are compared with what the program makes of them ([`compare`]), each within its
//! [`Tolerance`](tolerance::Tolerance). The trace's time may lie beside ours by a constant, which is given or searched for ([`align`]).
//!
//! The trace is hostile until it is read: [`Trace::read`] refuses by line and column, and holds no more than [`MAX_CELLS`] values. The comparison
//! itself keeps nothing but figures and curves of a fixed size.

pub mod align;
pub mod compare;
pub mod curve;
mod drive;
mod mapping;
mod read;
pub mod sample;
pub mod table;
pub mod tolerance;

pub use drive::Drive;
pub use mapping::{Mapped, Mapping};
pub use read::{Choice, Column, Trace, TraceError};
pub use table::{MAX_CELLS, MAX_TABLE_BYTES};
