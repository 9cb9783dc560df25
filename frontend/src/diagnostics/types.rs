//! The table of diagnostics about types and values: T….

use super::rules;

rules! {
    /// All rows of this table.
    table;
}
