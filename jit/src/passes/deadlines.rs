//! A loop that is short by proof needs no look at the deadline: a FOR loop with constant bounds, without calls, whose passes with all inner loops
//! come to few instructions. Fuel is charged as ever.

use super::ranges::Ranges;
use crate::mir::{Const, Counted, Function, LoopId, Op};

/// Most instructions of the mid-level form that a loop without a look at the deadline may run: some microseconds at most.
const MOST_INSTRUCTIONS: u64 = 4096;

/// Runs it.
pub fn run(function: &mut Function) {
    if function.loops.is_empty() {
        return;
    }
    let work = work_of(function);
    for number in 0..function.loops.len() {
        if work[number].is_none_or(|work| work > MOST_INSTRUCTIONS) {
            continue;
        }
        let header = function.loops[number].header;
        for instruction in &mut function.blocks[header.index()].instructions {
            if let Op::Checkpoint { deadline, .. } = &mut instruction.op {
                *deadline = false;
            }
        }
    }
}

/// Instructions that each loop may run from its entry to its end; nothing where that is not known.
fn work_of(function: &Function) -> Vec<Option<u64>> {
    let ranges = Ranges::new(function);
    let mut body: Vec<Option<u64>> = vec![Some(0); function.loops.len()];
    for block in &function.blocks {
        let Some(id) = block.innermost_loop else { continue };
        let calls = |op: &Op| {
            matches!(
                op,
                Op::Call(..) | Op::CallVirtual(..) | Op::Part(..) | Op::Helper(..) | Op::Copy { .. } | Op::Zero(..)
            )
        };
        let known = !block.instructions.iter().any(|instruction| calls(&instruction.op));
        let own = block.instructions.len() as u64 + 1;
        body[id.index()] = body[id.index()].filter(|_| known).map(|work| work.saturating_add(own));
    }
    // Inner loops stand behind outer ones.
    let mut work = vec![None; function.loops.len()];
    for number in (0..function.loops.len()).rev() {
        let data = &function.loops[LoopId(number as u32).index()];
        let passes = data.counted.and_then(|counted| passes(&counted, &ranges));
        work[number] = passes.zip(body[number]).map(|(passes, body)| passes.saturating_mul(body));
        if let Some(parent) = data.parent {
            let joined = body[parent.index()].zip(work[number]);
            body[parent.index()] = joined.map(|(outer, inner): (u64, u64)| outer.saturating_add(inner));
        }
    }
    work
}

/// Most passes of a FOR loop whose bounds and step are constants.
fn passes(counted: &Counted, ranges: &Ranges) -> Option<u64> {
    let number = |value| ranges.constant(value).and_then(Const::as_i64);
    let (initial, bound, step) = (number(counted.initial)?, number(counted.bound)?, number(counted.step)?);
    // Bit patterns of unsigned types are numbers only where they are not negative; beyond its type a bound is never reached.
    if step == 0 || (!counted.ty.is_signed() && initial < 0) || !ranges.bound_is_in_type(counted) {
        return None;
    }
    let distance = if step > 0 { bound.checked_sub(initial) } else { initial.checked_sub(bound) };
    let distance = u64::try_from(distance?.max(0)).ok()?;
    Some(distance / step.unsigned_abs() + 1)
}
