//! The verifier: the only door to the engines.

pub mod facts;

pub use facts::*;
