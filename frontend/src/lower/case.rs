//! CASE: from a value to the arm that it selects.
//!
//! Values that stand close together share a `switch`; a few others are compared one by one; many form a tree of comparisons with switches and
//! single ranges as leaves, so that choosing among n arms takes log n steps.

use khz_bytecode::container::ElementaryType as E;
use khz_bytecode::ids::{Label, SlotIndex};
use khz_bytecode::instruction::{Instruction as I, NumericOp as N};
use khz_bytecode::value::{SlotPlace, ValueType};

use super::body::FunctionBuilder;
use crate::analysis::ops;
use crate::analysis::tree::{BinOp, CaseArm, Expr, Stmt};
use crate::analysis::types::{Const, wrap};

/// Largest span of values that one `switch` covers.
const MAX_SWITCH_SPAN: i128 = 1024;
/// Fewest ranges that make a `switch`.
const MIN_SWITCH_RANGES: usize = 4;
/// A `switch` has at most so many targets for each value that selects an arm.
const MAX_TARGETS_A_VALUE: i128 = 4;
/// Most leaves that are asked one after the other instead of in a tree.
const MAX_CHAIN_LEAVES: usize = 4;

/// Values that select one arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Range {
    low: i128,
    high: i128,
    label: Label,
}

/// Ranges next to each other that are decided at once: by one comparison where there is one, by a `switch` where there are more.
type Leaf<'a> = &'a [Range];

impl FunctionBuilder<'_, '_> {
    pub(super) fn case(&mut self, selector: &Expr, arms: &[CaseArm], otherwise: &[Stmt]) {
        let elementary = self.elementary(selector.ty);
        let labels: Vec<Label> = arms.iter().map(|_| self.e.label()).collect();
        let default = self.e.label();
        let end = self.e.label();
        self.value(selector);
        let ranges = ranges(arms, &labels);
        let leaves = leaves(&ranges, elementary.storage().value_type() == ValueType::I32);
        match leaves.as_slice() {
            [table] if table.len() > 1 => self.table(table, default),
            _ => {
                let slot = self.scratch(elementary.storage());
                self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
                self.decide(slot, elementary, &leaves, default);
                self.release(slot);
            }
        }
        for (arm, label) in arms.iter().zip(&labels) {
            self.e.bind(*label);
            self.statements(&arm.body);
            self.e.push(I::Jump { target: end }, 0, 0);
        }
        self.e.bind(default);
        self.statements(otherwise);
        self.e.bind(end);
    }

    /// Goes to the arm among these leaves, or to the default.
    fn decide(&mut self, slot: SlotIndex, ty: E, leaves: &[Leaf<'_>], default: Label) {
        let (below, above) = leaves.split_at(leaves.len() / 2);
        if let (true, Some(first)) = (leaves.len() > MAX_CHAIN_LEAVES, above.first().and_then(|leaf| leaf.first())) {
            let lower = self.e.label();
            self.compare(slot, ty, BinOp::Lt, first.low);
            self.e.push(I::JumpIf { target: lower }, 1, 0);
            self.decide(slot, ty, above, default);
            self.e.bind(lower);
            self.decide(slot, ty, below, default);
            return;
        }
        // A switch ends the way, so it comes last.
        let (tables, single): (Vec<Leaf<'_>>, Vec<Leaf<'_>>) = leaves.iter().partition(|leaf| leaf.len() > 1);
        for range in single.into_iter().flatten() {
            self.range(slot, ty, *range);
        }
        for (number, table) in tables.iter().enumerate() {
            let next = if number + 1 < tables.len() { self.e.label() } else { default };
            self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
            self.table(table, next);
            if next != default {
                self.e.bind(next);
            }
        }
        if tables.is_empty() {
            self.e.push(I::Jump { target: default }, 0, 0);
        }
    }

    /// A `switch` on the value on the stack.
    fn table(&mut self, table: Leaf<'_>, default: Label) {
        let (low, targets) = targets(table, default);
        self.i32_const(low);
        self.numeric(N::I32Sub);
        self.e.push(I::Switch { targets }, 1, 0);
    }

    fn range(&mut self, slot: SlotIndex, ty: E, Range { low, high, label }: Range) {
        if low == high {
            self.compare(slot, ty, BinOp::Eq, low);
        } else {
            self.compare(slot, ty, BinOp::Ge, low);
            self.compare(slot, ty, BinOp::Le, high);
            self.numeric(N::I32And);
        }
        self.e.push(I::JumpIf { target: label }, 1, 0);
    }

    fn compare(&mut self, slot: SlotIndex, ty: E, op: BinOp, value: i128) {
        self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
        self.constant(&Const::Int(wrap(ty, value)), ty);
        if let Some(op) = ops::binary(op, ty) {
            self.numeric(op);
        }
    }
}

/// What selects an arm, in ascending order. Two arms never share a value: that is an error of the source.
fn ranges(arms: &[CaseArm], labels: &[Label]) -> Vec<Range> {
    let of_arms = arms.iter().zip(labels).flat_map(|(arm, label)| arm.ranges.iter().map(move |range| (*range, *label)));
    let mut ranges: Vec<Range> = of_arms.map(|((low, high), label)| Range { low, high, label }).collect();
    ranges.sort_by_key(|range| range.low);
    ranges
}

/// Splits ranges in ascending order into leaves, each switch as long as it may be. `narrow`: whether a `switch` can take the value.
fn leaves(ranges: &[Range], narrow: bool) -> Vec<Leaf<'_>> {
    let mut leaves = Vec::new();
    let mut rest = ranges;
    while let Some(first) = rest.first() {
        let mut length = 1;
        let mut values = first.high - first.low + 1;
        for (number, next) in rest.iter().enumerate().skip(1).take_while(|_| narrow) {
            values += next.high - next.low + 1;
            let span = next.high - first.low + 1;
            if span > MAX_SWITCH_SPAN {
                break;
            }
            if number + 1 >= MIN_SWITCH_RANGES && values * MAX_TARGETS_A_VALUE >= span {
                length = number + 1;
            }
        }
        let (leaf, behind) = rest.split_at(length);
        leaves.push(leaf);
        rest = behind;
    }
    leaves
}

/// Targets of a `switch`: the lowest value, and one label for each value from there on.
fn targets(table: Leaf<'_>, default: Label) -> (i32, Vec<Label>) {
    let low = table.first().map_or(0, |range| range.low);
    let mut targets = Vec::new();
    for range in table {
        // Spans are held to MAX_SWITCH_SPAN.
        let (from, to) = ((range.low - low) as usize, (range.high - low) as usize);
        targets.resize(from, default);
        targets.resize(to + 1, range.label);
    }
    targets.push(default);
    #[expect(clippy::cast_possible_truncation, reason = "a value of 32 bits; UDINT wraps as the subtraction does")]
    let low = low as i64 as i32;
    (low, targets)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranges(values: impl IntoIterator<Item = (i128, i128)>) -> Vec<Range> {
        let numbered = values.into_iter().zip(0..);
        numbered.map(|((low, high), label)| Range { low, high, label: Label(label) }).collect()
    }

    fn lengths(ranges: &[Range], narrow: bool) -> Vec<usize> {
        leaves(ranges, narrow).into_iter().map(<[Range]>::len).collect()
    }

    #[test]
    fn close_values_share_a_switch_of_bounded_span() {
        let close = ranges((0..2500).map(|value| (value, value)));
        assert_eq!(lengths(&close, true), [1024, 1024, 452]);
        assert_eq!(lengths(&close[..3], true), [1; 3], "too few");
        assert_eq!(lengths(&close[..5], false), [1; 5], "a switch takes 32 bits");
    }

    #[test]
    fn values_far_apart_stand_alone_and_leave_the_others_together() {
        let mixed = ranges([(-9, -9), (100, 100), (101, 103), (104, 104), (106, 106), (5000, 6000), (9000, 90_000)]);
        assert_eq!(lengths(&mixed, true), [1, 4, 1, 1]);
        let (low, targets) = targets(&mixed[1..5], Label(99));
        assert_eq!(low, 100);
        assert_eq!(targets.iter().map(|label| label.0).collect::<Vec<_>>(), [1, 2, 2, 2, 3, 99, 4, 99]);
    }
}
