//! A trap as it happened: which, where, with which values.

use khz_bytecode::ids::FunctionId;
use khz_bytecode::limits::MAX_TRAP_CHAIN;
pub use khz_bytecode::trap::TrapCode;

/// A place in code: a function and the byte offset of an instruction in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct CodePlace {
    /// Function.
    pub function: FunctionId,
    /// Byte offset of the instruction.
    pub offset: u32,
}

/// Why and where an execution was abandoned. Fixed in size: making one allocates nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trap {
    /// Which trap.
    pub code: TrapCode,
    /// The instruction that trapped.
    pub place: CodePlace,
    /// The values that explain it, named by [`TrapCode::value_names`]; unused ones are 0.
    pub values: [i64; 3],
    /// The calls that led there, innermost first, at most [`MAX_TRAP_CHAIN`]: each the place of a `call` instruction.
    chain: [CodePlace; MAX_TRAP_CHAIN],
    chain_len: u8,
}

impl Trap {
    /// A trap at a place, with an empty call chain.
    #[must_use]
    pub fn new(code: TrapCode, place: CodePlace, values: [i64; 3]) -> Self {
        Trap { code, place, values, chain: [CodePlace::default(); MAX_TRAP_CHAIN], chain_len: 0 }
    }

    /// Adds the next outer call; beyond the limit the outermost calls are dropped.
    pub fn push_caller(&mut self, place: CodePlace) {
        if let Some(entry) = self.chain.get_mut(usize::from(self.chain_len)) {
            *entry = place;
            self.chain_len += 1;
        }
    }

    /// The calls that led to it, innermost first.
    #[must_use]
    pub fn chain(&self) -> &[CodePlace] {
        &self.chain[..usize::from(self.chain_len)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chain_keeps_the_innermost_calls() {
        let place = |offset| CodePlace { function: FunctionId(1), offset };
        let mut trap = Trap::new(TrapCode::CallDepth, place(0), [65, 0, 0]);
        assert!(trap.chain().is_empty());
        (1..100).for_each(|offset| trap.push_caller(place(offset)));
        let expected: Vec<_> = (1..=MAX_TRAP_CHAIN as u32).map(place).collect();
        assert_eq!(trap.chain(), expected);
    }
}
