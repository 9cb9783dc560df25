//! What the verifier says when a container breaks a rule.

use super::rules::Rule;
use crate::ids::FunctionId;

/// The first rule that a container breaks, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VerifyError {
    /// The rule.
    pub rule: Rule,
    /// The function in whose header or code it is broken.
    pub function: Option<FunctionId>,
    /// Byte offset in that function's code of the offending instruction.
    pub offset: Option<u32>,
    /// The table entry that breaks it, outside functions.
    pub entry: Option<TableEntry>,
    /// What is wrong, with the facts.
    pub message: String,
}

/// An entry of a container's table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TableEntry {
    /// Name of the table, as assembly text calls it.
    pub table: &'static str,
    /// Position in it.
    pub index: usize,
}

/// Result of a check.
pub(super) type Check<T = ()> = Result<T, VerifyError>;

impl VerifyError {
    /// An error about the container as a whole.
    pub(super) fn whole(rule: Rule, message: impl Into<String>) -> Self {
        VerifyError { rule, function: None, offset: None, entry: None, message: message.into() }
    }

    /// An error about entry `index` of `table`.
    pub(super) fn entry(rule: Rule, table: &'static str, index: usize, message: impl Into<String>) -> Self {
        VerifyError { entry: Some(TableEntry { table, index }), ..Self::whole(rule, message) }
    }

    /// An error about a function's header.
    pub(super) fn header(rule: Rule, function: FunctionId, message: impl Into<String>) -> Self {
        VerifyError { function: Some(function), ..Self::whole(rule, message) }
    }

    /// An error about an instruction.
    pub(super) fn code(rule: Rule, function: FunctionId, offset: u32, message: impl Into<String>) -> Self {
        VerifyError { offset: Some(offset), ..Self::header(rule, function, message) }
    }
}

impl std::fmt::Display for VerifyError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.rule)?;
        if let Some(entry) = self.entry {
            write!(f, " in {} {}", entry.table, entry.index)?;
        }
        if let Some(function) = self.function {
            write!(f, " in function {function}")?;
        }
        if let Some(offset) = self.offset {
            write!(f, " at byte {offset}")?;
        }
        write!(f, ": {}", self.message)
    }
}

impl std::error::Error for VerifyError {}
