//! From text to tree: names, tokens, tree, parser.

pub mod ast;
pub mod keyword;
pub mod lexer;
pub mod parser;
pub mod symbol;
