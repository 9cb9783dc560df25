//! Which variables a stretch reads on some way from its start before it assigns them.

use std::collections::{BTreeMap, BTreeSet};

use super::Cut;
use super::slices::{Order, Slice};
use crate::mir::{Function, Op, Var};

/// The variables that a stretch may read before it assigns them; `inner`: the parts that were cut out of it already.
///
/// One walk in the order of the blocks is enough: what is assigned on every way to a block can only grow along an edge back to a loop's header, so
/// such edges change nothing.
pub(super) fn variables(function: &Function, order: &Order, slice: Slice, inner: &[Cut]) -> BTreeSet<Var> {
    let mut found = BTreeSet::new();
    // What is assigned on every way that was seen to lead to a block.
    let mut before: BTreeMap<usize, BTreeSet<Var>> = BTreeMap::new();
    let mut assigned = BTreeSet::new();
    let mut inner = inner.iter().peekable();
    let mut at = slice.start;
    while at < slice.end {
        let (block, number) = order.item(at);
        if number == 0 && at > slice.start {
            assigned = before.remove(&block).unwrap_or_default();
        }
        if let Some(cut) = inner.next_if(|cut| cut.slice.start == at) {
            found.extend(cut.variables.iter().filter(|var| !assigned.contains(*var)));
            assigned.extend(&cut.results);
            at = cut.slice.end;
            if let (behind, 0) = order.item(at) {
                meet(&mut before, behind, &assigned);
            }
            continue;
        }
        let data = &function.blocks[block];
        match data.instructions.get(number).map(|instruction| &instruction.op) {
            Some(Op::Get(var)) if !assigned.contains(var) => {
                found.insert(*var);
            }
            Some(Op::Set(var, _)) => {
                assigned.insert(*var);
            }
            Some(_) => {}
            None => {
                for target in data.terminator.targets() {
                    meet(&mut before, target.block.index(), &assigned);
                }
            }
        }
        at += 1;
    }
    found
}

/// One more way leads to a block.
fn meet(before: &mut BTreeMap<usize, BTreeSet<Var>>, block: usize, assigned: &BTreeSet<Var>) {
    match before.get_mut(&block) {
        Some(known) => known.retain(|var| assigned.contains(var)),
        None => {
            before.insert(block, assigned.clone());
        }
    }
}
