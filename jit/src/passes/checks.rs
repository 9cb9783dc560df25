//! Guards that can not fire go away: indices that a FOR loop, a mask or a remainder holds inside their array, divisors that are not zero,
//! values inside their subrange.

use khz_bytecode::value::IntegerType;

use super::ranges::{Interval, Ranges};
use crate::mir::{Function, Op};

/// Runs it.
pub fn run(function: &mut Function) {
    let ranges = Ranges::new(function);
    for block in &mut function.blocks {
        block.instructions.retain(|instruction| !is_proven(&instruction.op, &ranges));
    }
}

fn is_proven(op: &Op, ranges: &Ranges) -> bool {
    match op {
        Op::CheckIndex { index, lower, upper } => {
            let bounds = Interval { low: i64::from(*lower), high: i64::from(*upper) };
            ranges.of(*index).is_inside(bounds)
        }
        Op::CheckDivisor(value) | Op::CheckStep(value) => !ranges.of(*value).contains(0),
        Op::CheckRange { value, ty, lower, upper } => {
            let range = ranges.of(*value);
            match ty {
                // Their order is that of the interval only for what is not negative.
                IntegerType::U8 | IntegerType::U16 | IntegerType::U32 | IntegerType::U64 => {
                    let bounds = Interval { low: *lower, high: *upper };
                    range.low >= 0 && *lower >= 0 && *upper >= 0 && range.is_inside(bounds)
                }
                _ => range.is_inside(Interval { low: *lower, high: *upper }),
            }
        }
        _ => false,
    }
}
