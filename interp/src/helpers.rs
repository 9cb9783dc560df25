//! String helpers: their operands stand in neighbouring registers.

use khz_bytecode::instruction::{HelperOp, MAX_CAPACITIES};
use khz_machine::semantics::strings::{self, StringPlace};

use crate::memory::{Lane, Registers};
use crate::register_form::Operation;

/// Takes the operands of a helper from registers and capacities, in operand order.
struct Operands<'a, 'r> {
    registers: &'a Registers<'r>,
    next: u32,
    capacities: std::array::IntoIter<u16, MAX_CAPACITIES>,
}

impl Operands<'_, '_> {
    fn bits(&mut self) -> u64 {
        let bits = self.registers.get(self.next);
        self.next += 1;
        bits
    }

    fn value<T: Lane>(&mut self) -> T {
        T::from_bits(self.bits())
    }

    fn string(&mut self) -> StringPlace {
        // References are image offsets below 2 GiB; the verifier allows at most as many strings as there are capacities.
        StringPlace { at: self.bits() as u32, capacity: self.capacities.next().unwrap_or(0) }
    }
}

macro_rules! operand {
    (Dst, $operands:ident) => {
        $operands.string()
    };
    (Src, $operands:ident) => {
        $operands.string()
    };
    (WideDst, $operands:ident) => {
        $operands.string()
    };
    (WideSrc, $operands:ident) => {
        $operands.string()
    };
    ($value:ident, $operands:ident) => {
        $operands.value()
    };
}
macro_rules! finish {
    (Nothing, $call:expr) => {{
        $call;
        None
    }};
    ($value:ident, $call:expr) => {
        Some($call.into_bits())
    };
}
macro_rules! define_run_helper {
    ($(($code:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $cost:literal, $doc:literal)),* $(,)?) => {
        /// Runs the helper of an operation.
        #[inline(never)]
        pub(crate) fn run_helper(operation: &Operation, capacities: [u16; MAX_CAPACITIES], memory: &mut [u8], registers: &mut Registers<'_>) {
            let Some(helper) = HelperOp::ALL.get(operation.x as usize) else { return };
            let mut operands = Operands { registers, next: operation.a, capacities: capacities.into_iter() };
            let result = match helper { $(
                // Arguments are evaluated from left to right, which is operand order.
                HelperOp::$variant => finish!($result, strings::$function(memory, $(operand!($operand, operands)),*)),
            )* };
            if let Some(bits) = result {
                registers.set(operation.dst, bits);
            }
        }
    };
}
khz_bytecode::for_each_helper!(define_run_helper);
