//! Open calls, and what a trap says of them.

use khz_bytecode::ids::FunctionId;
use khz_machine::trap::{CodePlace, Trap};

use crate::register_form::Program;
use crate::run::Stop;

/// A call that waits for its callee.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Activation {
    /// Where it goes on: the operation behind the call.
    pub return_position: u32,
    /// Position of its window in the register file.
    pub base: usize,
    /// Image offset of its frame bytes.
    pub frame: u32,
}

/// The place of an operation in the container's code.
fn place_of(program: &Program, position: u32) -> CodePlace {
    // A container has at most 65,536 functions, so the position of one is an id.
    let function = FunctionId(program.function_at(position) as u16);
    CodePlace { function, offset: program.origins.get(position as usize).copied().unwrap_or(0) }
}

/// The trap that a stop with these open calls is.
#[cold]
pub(crate) fn trap_of(stop: &Stop, program: &Program, calls: &[Activation]) -> Trap {
    let mut trap = Trap::new(stop.code, place_of(program, stop.position), stop.values);
    for activation in calls.iter().rev() {
        trap.push_caller(place_of(program, activation.return_position - 1));
    }
    trap
}
