//! The table of diagnostics about names, declarations and configuration: S….

use super::rules;

rules! {
    /// All rows of this table.
    table;
}
