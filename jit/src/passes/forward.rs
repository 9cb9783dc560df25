//! Forwarding: a load that stands shortly behind the store, or another load, of the same memory takes the value from there.
//!
//! So a rung that reads the coil of the rung before does not wait for memory. Stores stay where they are, so memory is exact at every place that may
//! trap. The distance is bounded: a value that is kept long takes a register from others, and straight-line code has more of them than there
//! are registers. What is known at a block's end holds in each block that only it leads to.

use khz_bytecode::value::Storage;

use super::promote::wrap;
use super::repeats::single_ways;
use crate::mir::{Access, Address, Block, Function, Instruction, Op, Region, Results, Slot, Type, Value};

/// Most instructions between a store and a load that takes its value.
const STORE_REACH: usize = 48;
/// Most instructions between two loads of which the second takes the first one's value.
const LOAD_REACH: usize = 16;
/// Bytes that a vector is read and written with.
const VECTOR_BYTES: i64 = 16;
/// Most values that are kept in sight.
const MOST_KEPT: usize = 16;

/// What is read and written as a whole.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Cell {
    Slot(Slot, Access),
    /// Without an index.
    Bytes(Address, Access),
}

/// A value that memory holds.
#[derive(Debug, Clone, Copy)]
struct Kept {
    cell: Cell,
    value: Value,
    /// As a load gives it; else as it was before the store made it narrow.
    loaded: bool,
    /// The instruction from which on it is forgotten.
    until: usize,
}

/// What is known at a place.
#[derive(Debug, Clone, Default)]
struct Known {
    kept: Vec<Kept>,
    /// Instructions on the way.
    at: usize,
}

/// Runs it.
pub fn run(function: &mut Function) {
    let single = single_ways(function);
    let mut same: Vec<Value> = (0..function.values.len() as u32).map(Value).collect();
    let mut changed = false;
    let mut open: Vec<(Block, Known)> = vec![(Block(0), Known::default())];
    let mut seen = vec![false; function.blocks.len()];
    while let Some((block, mut known)) = open.pop() {
        if std::mem::replace(&mut seen[block.index()], true) {
            continue;
        }
        let mut instructions = std::mem::take(&mut function.blocks[block.index()].instructions);
        instructions.retain_mut(|instruction| {
            known.at += 1;
            let kept = keep(instruction, &mut known, &mut same, &function.values);
            changed |= !kept;
            kept
        });
        let data = &mut function.blocks[block.index()];
        data.instructions = instructions;
        known.kept.retain(|kept| kept.until > known.at);
        for target in data.terminator.targets() {
            // Passes behind this one meet definitions before uses in the order of the blocks.
            let goes_on = single[target.block.index()] && target.block > block;
            let handed = if goes_on { known.clone() } else { Known::default() };
            open.push((target.block, handed));
        }
    }
    if changed {
        rename(function, &same);
    }
}

/// Notes what an instruction does to memory; false when it is a load whose value is at hand.
fn keep(instruction: &mut Instruction, known: &mut Known, same: &mut [Value], types: &[Type]) -> bool {
    let of = |value: Value, same: &[Value]| same[value.index()];
    match &instruction.op {
        Op::LoadSlot(..) | Op::Load(..) => {
            let Results::One(result) = instruction.results else { return true };
            let Some(cell) = cell(&instruction.op) else { return true };
            match known.find(cell).filter(|kept| types[kept.value.index()] == types[result.index()]) {
                Some(kept) => match wrap(cell.access().storage).filter(|_| !kept.loaded) {
                    Some(op) => instruction.op = Op::Numeric(op, [kept.value; 2]),
                    None => {
                        same[result.index()] = kept.value;
                        return false;
                    }
                },
                None => known.add(cell, result, true, types),
            }
        }
        Op::StoreSlot(slot, _, value) => {
            known.kept.retain(|kept| !matches!(kept.cell, Cell::Slot(other, _) if other == *slot));
            if let Some(cell) = cell(&instruction.op) {
                known.add(cell, of(*value, same), false, types);
            }
        }
        Op::Store(address, access, value) => {
            let value = of(*value, same);
            let bytes = if is_vector(types[value.index()]) { VECTOR_BYTES } else { size(*access) };
            known.kept.retain(|kept| match kept.cell {
                Cell::Slot(..) => access.region != Region::Slots,
                Cell::Bytes(other, of_other) => are_apart(*address, bytes, other, size(of_other)),
            });
            if let Some(cell) = cell(&instruction.op) {
                known.add(cell, value, false, types);
            }
        }
        Op::StoreBit(..) | Op::Helper(..) | Op::Copy { .. } | Op::Zero(..) => {
            known.kept.retain(|kept| matches!(kept.cell, Cell::Slot(..)));
        }
        Op::Call(..) | Op::CallVirtual(..) | Op::Part(..) => known.kept.clear(),
        _ => {}
    }
    true
}

impl Known {
    fn find(&self, cell: Cell) -> Option<Kept> {
        self.kept.iter().rev().find(|kept| kept.cell == cell && kept.until > self.at).copied()
    }

    fn add(&mut self, cell: Cell, value: Value, loaded: bool, types: &[Type]) {
        if is_vector(types[value.index()]) {
            return;
        }
        let reach = if loaded { LOAD_REACH } else { STORE_REACH };
        if self.kept.len() >= MOST_KEPT {
            let at = self.at;
            self.kept.retain(|kept| kept.until > at);
        }
        if self.kept.len() >= MOST_KEPT {
            self.kept.remove(0);
        }
        self.kept.push(Kept { cell, value, loaded, until: self.at + reach });
    }
}

impl Cell {
    fn access(self) -> Access {
        match self {
            Cell::Slot(_, access) | Cell::Bytes(_, access) => access,
        }
    }
}

/// What a load or store reads or writes, where later ones can be told to mean the same.
fn cell(op: &Op) -> Option<Cell> {
    match op {
        Op::LoadSlot(slot, access) | Op::StoreSlot(slot, access, _) => Some(Cell::Slot(*slot, plain(*access))),
        Op::Load(address, access) | Op::Store(address, access, _) if address.index.is_none() => {
            Some(Cell::Bytes(*address, plain(*access)))
        }
        _ => None,
    }
}

/// The access without what a load does to values that no store of ours left: a value at hand needs neither.
fn plain(access: Access) -> Access {
    Access { canonicalise: false, normalise: false, ..access }
}

fn is_vector(ty: Type) -> bool {
    matches!(ty, Type::F32x4 | Type::F64x2)
}

/// Bytes that a scalar access reads or writes.
fn size(access: Access) -> i64 {
    match access.storage {
        Storage::Bool | Storage::I8 | Storage::U8 => 1,
        Storage::I16 | Storage::U16 => 2,
        Storage::I32 | Storage::F32 => 4,
        Storage::I64 | Storage::F64 => 8,
    }
}

/// Whether two extents can not meet: only those that count from the same base by known distances are told apart.
fn are_apart(a: Address, a_bytes: i64, b: Address, b_bytes: i64) -> bool {
    let known = a.base == b.base && a.index.is_none() && b.index.is_none();
    let end = |address: Address, bytes: i64| address.displacement.saturating_add(bytes);
    known && (end(a, a_bytes) <= b.displacement || end(b, b_bytes) <= a.displacement)
}

/// Each use of a load that went away becomes one of the value that stands for it.
fn rename(function: &mut Function, same: &[Value]) {
    let new = |value: &mut Value| *value = same[value.index()];
    for block in &mut function.blocks {
        block.instructions.iter_mut().for_each(|instruction| instruction.op.for_each_operand(new));
        block.terminator.for_each_operand(new);
    }
    for counted in function.loops.iter_mut().filter_map(|data| data.counted.as_mut()) {
        [&mut counted.initial, &mut counted.bound, &mut counted.step].into_iter().for_each(new);
    }
}
