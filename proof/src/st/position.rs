//! Where the parts of a tree stand in its text.
//!
//! A part is known by its address: the printer and the evaluator walk the same borrowed tree, so that the tree itself needs no numbers that an
//! edit would have to keep right. Addresses are only compared, never ordered into a result.

use std::collections::BTreeMap;

use super::tree::{Expr, Place, Stmt};

/// A part of one tree, while that is neither moved nor changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// An expression.
    Expr(usize),
    /// A statement.
    Stmt(usize),
    /// A place.
    Place(usize),
}

impl Key {
    /// The key of an expression.
    #[must_use]
    pub fn of_expr(expr: &Expr) -> Key {
        Key::Expr(std::ptr::from_ref(expr).addr())
    }

    /// The key of a statement.
    #[must_use]
    pub fn of_stmt(stmt: &Stmt) -> Key {
        Key::Stmt(std::ptr::from_ref(stmt).addr())
    }

    /// The key of a place.
    #[must_use]
    pub fn of_place(place: &Place) -> Key {
        Key::Place(std::ptr::from_ref(place).addr())
    }
}

/// Line and column, both from 1, of the first character of each part that can trap or call.
#[derive(Debug, Default)]
pub struct Positions {
    starts: BTreeMap<Key, usize>,
    /// Position of the first character of each line.
    lines: Vec<usize>,
    /// Positions of the bytes that begin no character: a column counts characters.
    inner: Vec<usize>,
}

impl Positions {
    pub(super) fn note(&mut self, key: Key, start: usize) {
        self.starts.insert(key, start);
    }

    pub(super) fn finish(&mut self, text: &str) {
        self.lines = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        self.inner = (0..text.len()).filter(|at| !text.is_char_boundary(*at)).collect();
    }

    /// Line and column of a part; none when it was not printed.
    #[must_use]
    pub fn of(&self, key: Key) -> Option<(u32, u32)> {
        let start = *self.starts.get(&key)?;
        let line = self.lines.partition_point(|first| *first <= start);
        let first = self.lines[line - 1];
        let before = |end: usize| self.inner.partition_point(|at| *at < end);
        let column = start - first - (before(start) - before(first)) + 1;
        Some((line as u32, column as u32))
    }
}
