//! How often each block of the code is run: code that counts is the code that runs otherwise, with one addition at the start of each block.
//!
//! The additions come behind Cranelift's optimiser, so that the blocks are the same ones, hold the same instructions, and lie in the same
//! order as in code without: what is counted here is true of that code. No clock is read: the same run gives the same counts.

use std::sync::atomic::{AtomicU64, Ordering};

use cranelift_codegen::cursor::{Cursor, FuncCursor};
use cranelift_codegen::ir::{Function, InstBuilder, MemFlagsData, types};

/// Counters of all forms, in the order in which they are compiled.
#[derive(Debug, Default)]
pub struct BlockCounts {
    /// By the numbers of Cranelift's blocks. Boxes: code holds the addresses.
    forms: Vec<Box<[AtomicU64]>>,
}

impl BlockCounts {
    /// Starts anew from 0.
    pub fn clear(&self) {
        self.forms.iter().flatten().for_each(|count| count.store(0, Ordering::Relaxed));
    }

    /// How often a block of a form was run; 0 for what is not there.
    pub(crate) fn of(&self, form: usize, block: u32) -> u64 {
        let counts = self.forms.get(form);
        counts.and_then(|counts| counts.get(block as usize)).map_or(0, |count| count.load(Ordering::Relaxed))
    }
}

/// Makes each block of an optimised function count.
pub(crate) fn insert(function: &mut Function, counts: &mut BlockCounts) {
    let counters: Box<[AtomicU64]> = (0..function.dfg.num_blocks()).map(|_| AtomicU64::new(0)).collect();
    let blocks: Vec<_> = function.layout.blocks().collect();
    for block in blocks {
        let Some(counter) = counters.get(block.as_u32() as usize) else { continue };
        let mut cursor = FuncCursor::new(function).at_first_insertion_point(block);
        // The counters outlive the code: whoever holds the code holds them.
        let address = cursor.ins().iconst(types::I64, std::ptr::from_ref(counter) as i64);
        let flags = MemFlagsData::trusted();
        let count = cursor.ins().load(types::I64, flags, address, 0);
        let one = cursor.ins().iconst(types::I64, 1);
        let count = cursor.ins().iadd(count, one);
        cursor.ins().store(flags, count, address, 0);
    }
    counts.forms.push(counters);
}
