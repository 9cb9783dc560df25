//! Structured Text by construction: a seed gives a well-typed program as a tree, the tree gives its text and, run directly, its meaning.
//!
//! The front end is held against what it never sees: [`generate()`] makes a [`tree::Source`], [`print()`](print::print) writes it as ST for the compiler, and
//! [`evaluate`] runs the same tree by the page of the semantics alone: exact integers wrapped by type, operands from left to right, traps with the
//! values that explain them. Where the page leaves something open (what of an assignment is evaluated first, whether inputs of a block
//! are stored before a later argument traps) the generator makes no program that could tell. Loops end by construction: their counters belong to nobody else.
//! [`case`] adds what comes from outside, [`compare`] runs text and rounds in the engines, and [`shrink`] takes both apart as long as a difference stays.

pub mod blocks;
pub mod c;
mod calls;
pub mod case;
pub mod compare;
mod configure;
pub mod constants;
pub mod coverage;
mod declare;
pub mod evaluate;
mod expression;
mod flow;
pub mod functions;
mod generate;
pub mod kind;
mod memory;
pub mod moments;
mod places;
pub mod position;
pub mod print;
pub mod reduce;
pub mod rounds;
pub mod shrink;
mod spelling;
mod sweep;
pub mod text;
pub mod tree;
mod visit;

pub use generate::{Size, generate};
