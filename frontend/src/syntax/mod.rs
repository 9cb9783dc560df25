//! From text to tree: names, tree, lexer, parser.

pub mod ast;
pub mod symbol;
