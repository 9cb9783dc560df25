//! Structured Text by construction: a seed gives a well-typed program as a tree, the tree gives its text and, run directly, its meaning.
//!
//! The front end is held against what it never sees: [`generate()`] makes a [`tree::Source`], [`print()`](print::print) writes it as ST for the compiler, and
//! [`evaluate`] runs the same tree by the page of the semantics alone: exact integers wrapped by type, operands from left to right, traps with the
//! values that explain them. Where the page leaves something open (what of an assignment is evaluated first, whether inputs of a block
//! are stored before a later argument traps) the generator makes no program that could tell. Loops end by construction: their counters belong to nobody else.
//! [`shrink`] takes the tree apart as long as a difference stays.

pub mod blocks;
mod declare;
pub mod evaluate;
mod expression;
pub mod functions;
mod generate;
pub mod print;
pub mod shrink;
pub mod tree;

pub use generate::generate;
