//! The dispatch loop: one flat `match` over the operation codes.
//!
//! The arms of numeric rows, scalar accesses and fused branches come from the tables. State that every operation may need lives in
//! locals of [`run`]; what is rare is handed to functions in `calls.rs`, `loops.rs` and `helpers.rs`.

use std::sync::atomic::{AtomicU32, Ordering};

use khz_bytecode::ids::MethodId;
use khz_bytecode::trap::TrapCode;
use khz_machine::engine::{DeadlineCell, Fuel};
use khz_machine::image::ImageLayout;
use khz_machine::instance_map::InstanceMap;
use khz_machine::semantics;

use crate::calls::Activation;
use crate::helpers::run_helper;
use crate::loops::{enter_loop, next_pass};
use crate::memory::{Code as Operations, Lane, Registers, Scalar};
use crate::register_form::table::for_each_operation;
use crate::register_form::{Code, ElementAccess, FunctionEntry, Program};

/// What a run works with, fixed while it lasts.
pub(crate) struct Surroundings<'a> {
    /// The code.
    pub program: &'a Program,
    /// Where virtual calls look.
    pub instances: &'a InstanceMap,
    /// Where the image's regions lie.
    pub layout: &'a ImageLayout,
    /// What ends a run from outside.
    pub deadline: &'a DeadlineCell,
    /// Image offset of the program instance's slots.
    pub program_base: u32,
    /// Image offset of the program instance's data block.
    pub block_base: u32,
    /// Image offset of the entry's frame bytes.
    pub frame_start: u32,
    /// Image offset behind the task's frame bytes.
    pub frame_end: u32,
    /// Deepest nesting of calls.
    pub max_depth: usize,
}

/// A trap before its place is looked up: position of the operation, what happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stop {
    /// The operation that trapped.
    pub position: usize,
    /// Why.
    pub code: TrapCode,
    /// What explains it.
    pub values: [i64; 3],
}

/// The image offset of an element, counted from `base`.
#[inline(always)]
pub(crate) fn element_offset(access: &ElementAccess, base: u64, index: i32) -> Result<usize, [i64; 3]> {
    match semantics::array_position(index, access.lower, access.upper) {
        Some(position) => Ok((base
            .wrapping_add(u64::from(access.offset))
            .wrapping_add(u64::from(position) * u64::from(access.stride))) as usize),
        None => Err([i64::from(index), i64::from(access.lower), i64::from(access.upper)]),
    }
}

/// The last operand of an operation that carries it itself.
macro_rules! own_operand {
    (I32, $program:ident, $b:expr) => {
        $b as i32
    };
    (F32, $program:ident, $b:expr) => {
        f32::from_bits($b)
    };
    (I64, $program:ident, $b:expr) => {
        $program.constants[$b as usize] as i64
    };
    (F64, $program:ident, $b:expr) => {
        f64::from_bits($program.constants[$b as usize])
    };
}

/// Calls a numeric function on its operands: all in registers, or the last one in the operation.
macro_rules! compute {
    (registers, $function:ident, [$ta:ident], $registers:ident, $program:ident, $op:ident) => {
        semantics::$function(Lane::from_bits($registers.get($op.a)))
    };
    (registers, $function:ident, [$ta:ident $tb:ident], $registers:ident, $program:ident, $op:ident) => {
        semantics::$function(Lane::from_bits($registers.get($op.a)), Lane::from_bits($registers.get($op.b)))
    };
    (own, $function:ident, [$ta:ident], $registers:ident, $program:ident, $op:ident) => {
        semantics::$function(own_operand!($ta, $program, $op.b))
    };
    (own, $function:ident, [$ta:ident $tb:ident], $registers:ident, $program:ident, $op:ident) => {
        semantics::$function(Lane::from_bits($registers.get($op.a)), own_operand!($tb, $program, $op.b))
    };
}

/// The value of a numeric function, or the end of the run.
macro_rules! value_or_stop {
    (total, $result:expr, $pc:ident) => {
        $result
    };
    (divide, $result:expr, $pc:ident) => {
        match $result {
            Ok(value) => value,
            Err(code) => return Err(Stop { position: $pc - 1, code, values: [0; 3] }),
        }
    };
}

macro_rules! define_run {
    (
        [$(($opcode:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $traps:ident, $cost:literal, $doc:literal)),*]
        [$(($storage:ident, $ty:ty, $load:ident, $load_based:ident, $load_element:ident, $load_element_based:ident,
            $store:ident, $store_based:ident, $store_element:ident, $store_element_based:ident)),*]
        [$(($float:ident, $float_ty:ty, $canonical:ident, $foreign:ident, $foreign_based:ident, $foreign_element:ident, $foreign_element_based:ident)),*]
        [$(($compare:ident, $compare_function:ident, [$($compare_operand:ident)*], $if_:ident, $unless:ident, $if_const:ident, $unless_const:ident)),*]
    ) => {
        /// Runs from the start of `function` until it returns.
        ///
        /// `calls` must be empty, with room for the deepest nesting; after a trap it holds the activations that were open.
        ///
        /// # Errors
        /// Where and why it was abandoned.
        #[allow(clippy::too_many_lines, reason = "one arm an operation: a dispatch loop is one function")]
        pub(crate) fn run(
            function: FunctionEntry,
            surroundings: &Surroundings<'_>,
            memory: &mut [u8],
            operations: Operations<'_>,
            mut registers: Registers<'_>,
            calls: &mut Vec<Activation>,
            mut fuel: Option<&mut Fuel>,
        ) -> Result<(), Stop> {
            let program = surroundings.program;
            // A copy of its own, so that the window stays in a machine register: arguments of this size arrive in memory.
            let mut registers = registers.lend();
            let deadline: &AtomicU32 = surroundings.deadline.as_atomic();
            let mut pc = function.start as usize;
            let mut frame = surroundings.frame_start;

            macro_rules! stop {
                ($code:expr, $values:expr) => { return Err(Stop { position: pc - 1, code: $code, values: $values }) };
            }
            macro_rules! check_deadline {
                () => {
                    if deadline.load(Ordering::Relaxed) != 0 && let Some(code) = surroundings.deadline.expired() {
                        stop!(code, [0; 3]);
                    }
                };
            }
            macro_rules! element {
                (image, $op:ident) => {{
                    let access = &program.elements[$op.b as usize];
                    match element_offset(access, 0, registers.get($op.a) as i32) {
                        Ok(at) => at,
                        Err(values) => stop!(TrapCode::ArrayIndex, values),
                    }
                }};
                (based, $op:ident) => {{
                    let access = &program.elements[$op.b as usize];
                    match element_offset(access, registers.get(access.base), registers.get($op.a) as i32) {
                        Ok(at) => at,
                        Err(values) => stop!(TrapCode::ArrayIndex, values),
                    }
                }};
            }
            macro_rules! based {
                ($register:expr, $offset:expr) => { registers.get($register).wrapping_add(u64::from($offset)) as usize };
            }
            // Opens a call whose window starts at register `a`; the stop names the call, which is the operation before `pc`.
            macro_rules! call {
                ($op:ident, $callee:expr) => {{
                    let callee: FunctionEntry = program.functions[$callee];
                    let callee_frame = frame + $op.dst;
                    let depth = calls.len() + 2;
                    let base = registers.base() + $op.a as usize;
                    if depth > surroundings.max_depth || callee_frame + callee.frame_bytes > surroundings.frame_end {
                        stop!(TrapCode::CallDepth, [depth as i64, 0, 0]);
                    }
                    let caller_base = registers.base();
                    if !registers.enter(base, callee.registers) {
                        stop!(TrapCode::CallDepth, [depth as i64, 0, 0]);
                    }
                    calls.push(Activation { return_position: pc, base: caller_base, frame });
                    frame = callee_frame;
                    pc = callee.start as usize;
                }};
            }
            macro_rules! leave {
                () => {
                    match calls.pop() {
                        None => return Ok(()),
                        Some(caller) => {
                            registers.leave(caller.base);
                            frame = caller.frame;
                            pc = caller.return_position;
                        }
                    }
                };
            }

            loop {
                let op = operations.fetch(pc);
                pc += 1;
                match op.code {
                    $(
                        Code::$variant => {
                            let result = compute!(registers, $function, [$($operand)*], registers, program, op);
                            registers.set(op.dst, value_or_stop!($traps, result, pc).into_bits());
                        }
                        Code::$function => {
                            let result = compute!(own, $function, [$($operand)*], registers, program, op);
                            registers.set(op.dst, value_or_stop!($traps, result, pc).into_bits());
                        }
                    )*
                    $(
                        Code::$load => registers.set(op.dst, <$ty as Scalar>::load(memory, op.a as usize)),
                        Code::$load_based => registers.set(op.dst, <$ty as Scalar>::load(memory, based!(op.a, op.b))),
                        Code::$load_element => registers.set(op.dst, <$ty as Scalar>::load(memory, element!(image, op))),
                        Code::$load_element_based => registers.set(op.dst, <$ty as Scalar>::load(memory, element!(based, op))),
                        Code::$store => <$ty as Scalar>::store(memory, op.a as usize, registers.get(op.dst)),
                        Code::$store_based => <$ty as Scalar>::store(memory, based!(op.a, op.b), registers.get(op.dst)),
                        Code::$store_element => <$ty as Scalar>::store(memory, element!(image, op), registers.get(op.dst)),
                        Code::$store_element_based => <$ty as Scalar>::store(memory, element!(based, op), registers.get(op.dst)),
                    )*
                    $(
                        Code::$foreign => {
                            let value = <$float_ty as Lane>::from_bits(<$float_ty as Scalar>::load(memory, op.a as usize));
                            registers.set(op.dst, semantics::$canonical(value).into_bits());
                        }
                        Code::$foreign_based => {
                            let value = <$float_ty as Lane>::from_bits(<$float_ty as Scalar>::load(memory, based!(op.a, op.b)));
                            registers.set(op.dst, semantics::$canonical(value).into_bits());
                        }
                        Code::$foreign_element => {
                            let value = <$float_ty as Lane>::from_bits(<$float_ty as Scalar>::load(memory, element!(image, op)));
                            registers.set(op.dst, semantics::$canonical(value).into_bits());
                        }
                        Code::$foreign_element_based => {
                            let value = <$float_ty as Lane>::from_bits(<$float_ty as Scalar>::load(memory, element!(based, op)));
                            registers.set(op.dst, semantics::$canonical(value).into_bits());
                        }
                    )*
                    $(
                        Code::$if_ => {
                            if compute!(registers, $compare_function, [$($compare_operand)*], registers, program, op) != 0 {
                                pc = op.dst as usize;
                            }
                        }
                        Code::$unless => {
                            if compute!(registers, $compare_function, [$($compare_operand)*], registers, program, op) == 0 {
                                pc = op.dst as usize;
                            }
                        }
                        Code::$if_const => {
                            if compute!(own, $compare_function, [$($compare_operand)*], registers, program, op) != 0 {
                                pc = op.dst as usize;
                            }
                        }
                        Code::$unless_const => {
                            if compute!(own, $compare_function, [$($compare_operand)*], registers, program, op) == 0 {
                                pc = op.dst as usize;
                            }
                        }
                    )*
                    Code::Enter => {
                        check_deadline!();
                        registers.zero(op.dst, op.a);
                        memory[frame as usize..(frame + op.b) as usize].fill(0);
                    }
                    Code::Header => check_deadline!(),
                    Code::Charge => {
                        if let Some(fuel) = fuel.as_deref_mut() {
                            match fuel.left.checked_sub(u64::from(op.a)) {
                                Some(left) => fuel.left = left,
                                None => {
                                    fuel.left = 0;
                                    stop!(TrapCode::Watchdog, [0; 3]);
                                }
                            }
                        }
                    }
                    Code::ProgramBase => registers.set(op.dst, u64::from(surroundings.program_base)),
                    Code::BlockBase => registers.set(op.dst, u64::from(surroundings.block_base)),
                    Code::FrameBase => registers.set(op.dst, u64::from(frame)),
                    Code::Move => registers.set(op.dst, registers.get(op.a)),
                    Code::Constant => registers.set(op.dst, u64::from(op.a) | u64::from(op.b) << 32),
                    Code::Offset => registers.set(op.dst, based!(op.a, op.b) as u64),
                    Code::Index => registers.set(op.dst, element!(image, op) as u64),
                    Code::IndexBased => registers.set(op.dst, element!(based, op) as u64),
                    Code::LoadBit => registers.set(op.dst, u64::from(memory[op.a as usize] >> (op.b & 7) & 1)),
                    Code::StoreBit => {
                        let byte = &mut memory[op.a as usize];
                        let bit = u8::from(registers.get(op.dst) as u32 != 0);
                        *byte = *byte & !(1 << (op.b & 7)) | bit << (op.b & 7);
                    }
                    Code::ReferenceCheck => {
                        let address = registers.get(op.a) as i64;
                        match semantics::check_reference(surroundings.layout, address, op.b, op.x != 0) {
                            Some(at) => registers.set(op.dst, u64::from(at)),
                            None => stop!(TrapCode::Reference, [address, 0, 0]),
                        }
                    }
                    Code::Copy => {
                        let (to, from) = (registers.get(op.dst) as usize, registers.get(op.a) as usize);
                        memory.copy_within(from..from + op.b as usize, to);
                    }
                    Code::SelectUnless => {
                        if registers.get(op.a) as u32 == 0 {
                            registers.set(op.dst, registers.get(op.b));
                        }
                    }
                    Code::CheckRange => {
                        let range = &program.ranges[op.b as usize];
                        let value = registers.get(op.a) as i64;
                        if !semantics::check_range(range.kind, value, range.lower, range.upper) {
                            stop!(TrapCode::Range, semantics::range_values(range.kind, value, range.lower, range.upper));
                        }
                    }
                    Code::Helper => {
                        let capacities = program.capacities[op.b as usize];
                        run_helper(op, capacities, memory, &mut registers.lend());
                    }
                    Code::Jump => pc = op.dst as usize,
                    Code::Repeat => {
                        pc = op.dst as usize;
                        check_deadline!();
                    }
                    Code::JumpIf => {
                        if registers.get(op.a) as u32 != 0 {
                            pc = op.dst as usize;
                        }
                    }
                    Code::JumpUnless => {
                        if registers.get(op.a) as u32 == 0 {
                            pc = op.dst as usize;
                        }
                    }
                    Code::Switch => {
                        let case = (registers.get(op.a) as u32).min(op.dst - 1);
                        pc = program.jump_table[(op.b + case) as usize] as usize;
                    }
                    Code::ForEnter => match enter_loop(&program.for_loops[op.a as usize], op.b, memory, &mut registers.lend()) {
                        Some(true) => {}
                        Some(false) => pc = op.dst as usize,
                        None => stop!(TrapCode::Range, [0; 3]),
                    },
                    Code::ForNext => {
                        if next_pass(&program.for_loops[op.a as usize], memory, &mut registers.lend()) {
                            pc = op.dst as usize;
                            check_deadline!();
                        }
                    }
                    Code::ForNextI32 => {
                        let (control, bound) = (registers.get(op.a) as i32, registers.get(op.b) as i32);
                        let sum = i64::from(control) + i64::from(op.x);
                        registers.set(op.a, (sum as i32).into_bits());
                        if if op.x > 0 { sum <= i64::from(bound) } else { sum >= i64::from(bound) } {
                            pc = op.dst as usize;
                            check_deadline!();
                        }
                    }
                    Code::ForNextI16 => {
                        let (control, bound) = (registers.get(op.a) as i32, registers.get(op.b) as i32);
                        let sum = i64::from(control) + i64::from(op.x);
                        registers.set(op.a, i32::from(sum as i16).into_bits());
                        if if op.x > 0 { sum <= i64::from(bound) } else { sum >= i64::from(bound) } {
                            pc = op.dst as usize;
                            check_deadline!();
                        }
                    }
                    Code::ForNextProgramI32 => {
                        let at = (surroundings.program_base + op.a) as usize;
                        let (control, bound) = (i32::load(memory, at) as i32, registers.get(op.b) as i32);
                        let sum = i64::from(control) + i64::from(op.x);
                        i32::store(memory, at, sum as u64);
                        if if op.x > 0 { sum <= i64::from(bound) } else { sum >= i64::from(bound) } {
                            pc = op.dst as usize;
                            check_deadline!();
                        }
                    }
                    Code::ForNextProgramI16 => {
                        let at = (surroundings.program_base + op.a) as usize;
                        let (control, bound) = (i16::load(memory, at) as i32, registers.get(op.b) as i32);
                        let sum = i64::from(control) + i64::from(op.x);
                        i16::store(memory, at, sum as u64);
                        if if op.x > 0 { sum <= i64::from(bound) } else { sum >= i64::from(bound) } {
                            pc = op.dst as usize;
                            check_deadline!();
                        }
                    }
                    Code::Call => call!(op, op.b as usize),
                    Code::CallVirtual => {
                        let address = registers.get(op.a) as i64;
                        // The translation took the number from a method id, so it fits.
                        match surroundings.instances.find(address, MethodId(op.b as u16)) {
                            None => stop!(TrapCode::Reference, [address, 0, 0]),
                            Some(function) => {
                                call!(op, function.index());
                                // The address is where the callee expects `this`, now register 0 of its window.
                                registers.set(0, u64::from(surroundings.layout.data.start).wrapping_add(address as u64));
                            }
                        }
                    }
                    Code::Return => leave!(),
                    Code::ReturnOne => {
                        registers.set(0, registers.get(op.a));
                        leave!();
                    }
                    Code::ReturnMany => {
                        registers.move_to_start(op.a, op.b);
                        leave!();
                    }
                }
            }
        }
    };
}
macro_rules! with_own_rows {
    ($($numeric:tt),* $(,)?) => { for_each_operation!(@own define_run, [$($numeric),*]); };
}
khz_bytecode::for_each_numeric!(with_own_rows);
