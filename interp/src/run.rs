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
use crate::memory::{Cursor, Lane, Registers, Scalar};
use crate::register_form::table::for_each_operation;
use crate::register_form::{Code, FunctionEntry, Operation, Program};
use crate::slots::{bring, put_back};

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

/// A trap before its place is looked up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stop {
    /// The operation that trapped.
    pub position: u32,
    /// Where the running call's window starts in the register file.
    pub base: usize,
    /// Why.
    pub code: TrapCode,
    /// What explains it.
    pub values: [i64; 3],
}

/// Distance of an element from the first one in bytes; `data` is an element's bounds and stride as the translation laid them behind an
/// operation: `a` lower bound, `b` upper bound - lower bound, `x` stride.
#[inline(always)]
fn element_distance(data: &Operation, index: i32) -> Result<u64, [i64; 3]> {
    let position = (index as u32).wrapping_sub(data.a);
    if position > data.b {
        let lower = i64::from(data.a as i32);
        return Err([i64::from(index), lower, lower + i64::from(data.b)]);
    }
    // The element is inside an array, whose size the verifier held to 32 bits.
    Ok(u64::from(position.wrapping_mul(u32::from(data.x as u16))))
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
    (total, $result:expr) => {
        $result
    };
    (divide, $result:expr) => {
        match $result {
            Ok(value) => value,
            Err(code) => break (code, [0; 3]),
        }
    };
}

macro_rules! define_run {
    (
        [$(($opcode:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $traps:ident, $cost:literal, $doc:literal)),*]
        [$(($storage:ident, $ty:ty, $load:ident, $load_based:ident, $load_element:ident, $load_element_based:ident,
            $load_plane:ident, $load_plane_based:ident, $store:ident, $store_based:ident, $store_element:ident,
            $store_element_based:ident, $store_plane:ident, $store_plane_based:ident, $store_const:ident, $store_based_const:ident)),*]
        [$(($float:ident, $float_ty:ty, $canonical:ident, $foreign:ident, $foreign_based:ident, $foreign_element:ident, $foreign_element_based:ident,
            $foreign_plane:ident, $foreign_plane_based:ident)),*]
        [$(($compare:ident, $compare_function:ident, [$($compare_operand:ident)*], $if_:ident, $unless:ident, $if_const:ident, $unless_const:ident)),*]
        [$(($on_element:ident, $on_function:ident, $on_ty:ty, $on_load:ident, $on_load_plane:ident, $with_element:ident, $with_plane:ident, $commutes:literal)),*]
        [$(($sum:ident, $sum_add:ident, $sum_multiply:ident, $sum_ty:ty, $sum_product:ident, $sum_product_plane:ident, $sum_element:ident, $sum_plane:ident)),*]
    ) => {
        /// Runs from the start of `function` until it returns.
        ///
        /// `calls` must be empty, with room for the deepest nesting; after a trap it holds the activations that were open.
        ///
        /// # Errors
        /// Where and why it was abandoned.
        #[allow(clippy::too_many_lines, reason = "one arm an operation: a dispatch loop is one function")]
        pub(crate) fn run(
            surroundings: &Surroundings<'_>,
            memory: &mut [u8],
            cursor: Cursor<'_>,
            mut registers: Registers<'_>,
            calls: &mut Vec<Activation>,
            mut fuel: Option<&mut Fuel>,
        ) -> Result<(), Stop> {
            let program = surroundings.program;
            // Copies of their own, so that both pointers stay in machine registers: arguments of this size arrive in memory.
            let mut registers = registers.lend();
            let mut cursor = cursor.copy();
            let deadline: &AtomicU32 = surroundings.deadline.as_atomic();
            let mut frame = surroundings.frame_start;

            macro_rules! check_deadline {
                () => {
                    if deadline.load(Ordering::Relaxed) != 0 && let Some(code) = surroundings.deadline.expired() {
                        break (code, [0; 3]);
                    }
                };
            }
            // Image offset of an element; its bounds and stride stand behind the operation.
            macro_rules! element {
                ($op:ident, $base:expr) => { element!($op, i32::from($op.x), $base) };
                ($op:ident, $displacement:expr, $base:expr) => {{
                    let data = cursor.fetch();
                    let index = (registers.get($op.a) as i32).wrapping_add($displacement);
                    match element_distance(data, index) {
                        Ok(distance) => ($base + u64::from(data.dst) + distance) as usize,
                        Err(values) => break (TrapCode::ArrayIndex, values),
                    }
                }};
            }
            // The same for two dimensions; the second one's data names the register of its index.
            macro_rules! plane_element {
                ($op:ident, $base:expr) => {{
                    let data = cursor.fetch();
                    let inner = cursor.fetch();
                    match element_distance(data, registers.get($op.a) as i32) {
                        Ok(distance) => match element_distance(inner, registers.get(inner.dst) as i32) {
                            Ok(inner_distance) => ($base + u64::from(data.dst) + distance + inner_distance) as usize,
                            Err(values) => break (TrapCode::ArrayIndex, values),
                        },
                        Err(values) => break (TrapCode::ArrayIndex, values),
                    }
                }};
            }
            // The reference in a register: references are image offsets, which have 31 bits.
            macro_rules! reference {
                ($register:expr) => { u64::from(registers.get($register) as u32) };
            }
            macro_rules! jump_if {
                ($condition:expr, $op:ident) => { if $condition { cursor.jump($op.dst); } };
            }
            // Ends a pass of a FOR loop: `control` is the place of its variable before.
            macro_rules! next_pass {
                ($op:ident, $narrow:ty, $control:expr, |$next:ident| $keep:expr) => {{
                    let sum = $control + i64::from($op.x);
                    let $next = i32::from(sum as $narrow);
                    $keep;
                    let bound = i64::from(registers.get($op.b) as i32);
                    if if $op.x > 0 { sum <= bound } else { sum >= bound } {
                        cursor.jump($op.dst);
                        check_deadline!();
                    }
                }};
            }
            macro_rules! based {
                ($register:expr, $offset:expr) => { (reference!($register) + u64::from($offset)) as usize };
            }
            // Opens a call whose window starts at register `a`; the stop names the call, which is the operation that was fetched last.
            macro_rules! call {
                ($op:ident, $callee:expr) => {{
                    let callee: FunctionEntry = program.functions[$callee];
                    let callee_frame = frame + $op.dst;
                    let depth = calls.len() + 2;
                    let base = registers.base() + $op.a as usize;
                    if depth > surroundings.max_depth || callee_frame + callee.frame_bytes > surroundings.frame_end {
                        break (TrapCode::CallDepth, [depth as i64, 0, 0]);
                    }
                    let caller_base = registers.base();
                    if !registers.enter(base, callee.registers) {
                        break (TrapCode::CallDepth, [depth as i64, 0, 0]);
                    }
                    calls.push(Activation { return_position: cursor.position(), base: caller_base, frame });
                    frame = callee_frame;
                    cursor.jump(callee.start);
                }};
            }
            macro_rules! leave {
                () => {
                    match calls.pop() {
                        None => return Ok(()),
                        Some(caller) => {
                            registers.leave(caller.base);
                            frame = caller.frame;
                            cursor.jump(caller.return_position);
                        }
                    }
                };
            }

            let (code, values) = loop {
                let op = cursor.fetch();
                match op.code {
                    $(
                        Code::$variant => {
                            let result = compute!(registers, $function, [$($operand)*], registers, program, op);
                            registers.set(op.dst, value_or_stop!($traps, result).into_bits());
                        }
                        Code::$function => {
                            let result = compute!(own, $function, [$($operand)*], registers, program, op);
                            registers.set(op.dst, value_or_stop!($traps, result).into_bits());
                        }
                    )*
                    $(
                        Code::$load => registers.set(op.dst, <$ty as Scalar>::load(memory, op.a as usize)),
                        Code::$load_based => registers.set(op.dst, <$ty as Scalar>::load(memory, based!(op.a, op.b))),
                        Code::$load_element => registers.set(op.dst, <$ty as Scalar>::load(memory, element!(op, 0))),
                        Code::$load_element_based => registers.set(op.dst, <$ty as Scalar>::load(memory, element!(op, reference!(op.b)))),
                        Code::$load_plane => registers.set(op.dst, <$ty as Scalar>::load(memory, plane_element!(op, 0))),
                        Code::$load_plane_based => {
                            registers.set(op.dst, <$ty as Scalar>::load(memory, plane_element!(op, reference!(op.b))));
                        }
                        Code::$store_plane => <$ty as Scalar>::store(memory, plane_element!(op, 0), registers.get(op.dst)),
                        Code::$store_plane_based => {
                            <$ty as Scalar>::store(memory, plane_element!(op, reference!(op.b)), registers.get(op.dst));
                        }
                        Code::$store_const => {
                            let bits = if <$ty as Scalar>::IS_WIDE { program.constants[op.dst as usize] } else { u64::from(op.dst) };
                            <$ty as Scalar>::store(memory, op.a as usize, bits);
                        }
                        Code::$store_based_const => {
                            let bits = if <$ty as Scalar>::IS_WIDE { program.constants[op.dst as usize] } else { u64::from(op.dst) };
                            <$ty as Scalar>::store(memory, based!(op.a, op.b), bits);
                        }
                        Code::$store => <$ty as Scalar>::store(memory, op.a as usize, registers.get(op.dst)),
                        Code::$store_based => <$ty as Scalar>::store(memory, based!(op.a, op.b), registers.get(op.dst)),
                        Code::$store_element => <$ty as Scalar>::store(memory, element!(op, 0), registers.get(op.dst)),
                        Code::$store_element_based => <$ty as Scalar>::store(memory, element!(op, reference!(op.b)), registers.get(op.dst)),
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
                            let value = <$float_ty as Lane>::from_bits(<$float_ty as Scalar>::load(memory, element!(op, 0)));
                            registers.set(op.dst, semantics::$canonical(value).into_bits());
                        }
                        Code::$foreign_element_based => {
                            let value = <$float_ty as Lane>::from_bits(<$float_ty as Scalar>::load(memory, element!(op, reference!(op.b))));
                            registers.set(op.dst, semantics::$canonical(value).into_bits());
                        }
                        Code::$foreign_plane => {
                            let value = <$float_ty as Lane>::from_bits(<$float_ty as Scalar>::load(memory, plane_element!(op, 0)));
                            registers.set(op.dst, semantics::$canonical(value).into_bits());
                        }
                        Code::$foreign_plane_based => {
                            let value = <$float_ty as Lane>::from_bits(<$float_ty as Scalar>::load(memory, plane_element!(op, reference!(op.b))));
                            registers.set(op.dst, semantics::$canonical(value).into_bits());
                        }
                    )*
                    $(
                        Code::$if_ => jump_if!(compute!(registers, $compare_function, [$($compare_operand)*], registers, program, op) != 0, op),
                        Code::$unless => jump_if!(compute!(registers, $compare_function, [$($compare_operand)*], registers, program, op) == 0, op),
                        Code::$if_const => jump_if!(compute!(own, $compare_function, [$($compare_operand)*], registers, program, op) != 0, op),
                        Code::$unless_const => jump_if!(compute!(own, $compare_function, [$($compare_operand)*], registers, program, op) == 0, op),
                    )*
                    // `x` is the register of the first operand, so there is no constant part of the index.
                    $(
                        Code::$with_element => {
                            let at = element!(op, 0, reference!(op.b));
                            let element: $on_ty = Lane::from_bits(<$on_ty as Scalar>::load(memory, at));
                            let first = Lane::from_bits(registers.get(op.x as u32));
                            registers.set(op.dst, semantics::$on_function(first, element).into_bits());
                        }
                        Code::$with_plane => {
                            let at = plane_element!(op, reference!(op.b));
                            let element: $on_ty = Lane::from_bits(<$on_ty as Scalar>::load(memory, at));
                            let first = Lane::from_bits(registers.get(op.x as u32));
                            registers.set(op.dst, semantics::$on_function(first, element).into_bits());
                        }
                    )*
                    $(
                        Code::$sum_element => {
                            let at = element!(op, 0, reference!(op.b));
                            let element: $sum_ty = Lane::from_bits(<$sum_ty as Scalar>::load(memory, at));
                            let product = semantics::$sum_multiply(Lane::from_bits(registers.get(op.x as u32)), element);
                            let sum = semantics::$sum_add(Lane::from_bits(registers.get(op.dst)), product);
                            registers.set(op.dst, sum.into_bits());
                        }
                        Code::$sum_plane => {
                            let at = plane_element!(op, reference!(op.b));
                            let element: $sum_ty = Lane::from_bits(<$sum_ty as Scalar>::load(memory, at));
                            let product = semantics::$sum_multiply(Lane::from_bits(registers.get(op.x as u32)), element);
                            let sum = semantics::$sum_add(Lane::from_bits(registers.get(op.dst)), product);
                            registers.set(op.dst, sum.into_bits());
                        }
                    )*
                    Code::Enter => {
                        // Most functions have nothing to zero: then no call of a fill that does nothing.
                        if op.a != 0 {
                            registers.zero(op.dst, op.a);
                        }
                        if op.b != 0 {
                            memory[frame as usize..(frame + op.b) as usize].fill(0);
                        }
                        check_deadline!();
                    }
                    Code::Header => check_deadline!(),
                    Code::Charge => {
                        if let Some(fuel) = fuel.as_deref_mut() {
                            match fuel.left.checked_sub(u64::from(op.a)) {
                                Some(left) => fuel.left = left,
                                None => {
                                    fuel.left = 0;
                                    break (TrapCode::Watchdog, [0; 3]);
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
                    Code::Index => registers.set(op.dst, element!(op, 0) as u64),
                    Code::IndexBased => registers.set(op.dst, element!(op, reference!(op.b)) as u64),
                    Code::IndexWide => {
                        let base = if op.b == u32::MAX { 0 } else { reference!(op.b) };
                        let data = cursor.fetch();
                        let stride = cursor.fetch().a;
                        let index = (registers.get(op.a) as i32).wrapping_add(i32::from(op.x));
                        match element_distance(data, index) {
                            Ok(position) => {
                                let distance = u64::from((position as u32).wrapping_mul(stride));
                                registers.set(op.dst, base + u64::from(data.dst) + distance);
                            }
                            Err(values) => break (TrapCode::ArrayIndex, values),
                        }
                    }
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
                            None => break (TrapCode::Reference, [address, 0, 0]),
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
                            break (TrapCode::Range, semantics::range_values(range.kind, value, range.lower, range.upper));
                        }
                    }
                    Code::Helper => {
                        let capacities = program.capacities[op.b as usize];
                        run_helper(op, capacities, memory, &mut registers.lend());
                    }
                    Code::Jump => cursor.jump(op.dst),
                    Code::Repeat => {
                        cursor.jump(op.dst);
                        check_deadline!();
                    }
                    Code::JumpIf => jump_if!(registers.get(op.a) as u32 != 0, op),
                    Code::JumpUnless => jump_if!(registers.get(op.a) as u32 == 0, op),
                    Code::JumpIfMasked => jump_if!(registers.get(op.a) as u32 & op.b != 0, op),
                    Code::JumpUnlessMasked => jump_if!(registers.get(op.a) as u32 & op.b == 0, op),
                    Code::F32MulAdd => {
                        let product = semantics::f32_mul(Lane::from_bits(registers.get(op.a)), Lane::from_bits(registers.get(op.b)));
                        let sum = semantics::f32_add(Lane::from_bits(registers.get(op.x as u32)), product);
                        registers.set(op.dst, sum.into_bits());
                    }
                    Code::F64MulAdd => {
                        let product = semantics::f64_mul(Lane::from_bits(registers.get(op.a)), Lane::from_bits(registers.get(op.b)));
                        let sum = semantics::f64_add(Lane::from_bits(registers.get(op.x as u32)), product);
                        registers.set(op.dst, sum.into_bits());
                    }
                    Code::OrAnd => {
                        let both = registers.get(op.a) as u32 & registers.get(op.b) as u32;
                        registers.set(op.dst, u64::from(registers.get(op.x as u32) as u32 | both));
                    }
                    Code::OrAndNot => {
                        let both = registers.get(op.a) as u32 & u32::from(registers.get(op.b) as u32 == 0);
                        registers.set(op.dst, u64::from(registers.get(op.x as u32) as u32 | both));
                    }
                    Code::AndNot => {
                        let (first, second) = (registers.get(op.a) as u32, registers.get(op.b) as u32);
                        registers.set(op.dst, u64::from(first & u32::from(second == 0)));
                    }
                    Code::OrNot => {
                        let (first, second) = (registers.get(op.a) as u32, registers.get(op.b) as u32);
                        registers.set(op.dst, u64::from(first | u32::from(second == 0)));
                    }
                    Code::Switch => {
                        let case = (registers.get(op.a) as u32).min(op.dst - 1);
                        cursor.jump(program.jump_table[(op.b + case) as usize]);
                    }
                    Code::ForEnter => match enter_loop(&program.for_loops[op.a as usize], op.b, memory, &mut registers.lend()) {
                        Some(true) => {}
                        Some(false) => cursor.jump(op.dst),
                        None => break (TrapCode::Range, [0; 3]),
                    },
                    Code::ForNext => {
                        if next_pass(&program.for_loops[op.a as usize], memory, &mut registers.lend()) {
                            cursor.jump(op.dst);
                            check_deadline!();
                        }
                    }
                    Code::ForNextI32 => {
                        next_pass!(op, i32, i64::from(registers.get(op.a) as i32), |next| registers.set(op.a, next.into_bits()));
                    }
                    Code::ForNextI16 => {
                        next_pass!(op, i16, i64::from(registers.get(op.a) as i32), |next| registers.set(op.a, next.into_bits()));
                    }
                    Code::ForNextProgramI32 => {
                        let at = (surroundings.program_base + op.a) as usize;
                        next_pass!(op, i32, i64::from(i32::load(memory, at) as i32), |next| i32::store(memory, at, next as u64));
                    }
                    Code::ForNextProgramI16 => {
                        let at = (surroundings.program_base + op.a) as usize;
                        next_pass!(op, i16, i64::from(i16::load(memory, at) as i32), |next| i16::store(memory, at, next as u64));
                    }
                    Code::Call => call!(op, op.b as usize),
                    Code::CallVirtual => {
                        let address = registers.get(op.a) as i64;
                        // The translation took the number from a method id, so it fits.
                        match surroundings.instances.find(address, MethodId(op.b as u16)) {
                            None => break (TrapCode::Reference, [address, 0, 0]),
                            Some(function) => {
                                call!(op, function.index());
                                // The address is where the callee expects `this`, now register 0 of its window.
                                registers.set(0, u64::from(surroundings.layout.data.start).wrapping_add(address as u64));
                            }
                        }
                    }
                    Code::BringSlots => {
                        let runs = &program.slot_runs[op.a as usize..op.b as usize];
                        bring(runs, surroundings.program_base, memory, &mut registers.lend());
                    }
                    Code::PutSlotsBack => {
                        let runs = &program.slot_runs[op.a as usize..op.b as usize];
                        put_back(runs, surroundings.program_base, memory, &mut registers.lend());
                    }
                    // Never reached: the operation in front of it fetches it.
                    Code::Data => {}
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
            };
            Err(Stop { position: cursor.position() - 1, base: registers.base(), code, values })
        }
    };
}
macro_rules! with_own_rows {
    ($($numeric:tt),* $(,)?) => { for_each_operation!(@own define_run, [$($numeric),*]); };
}
khz_bytecode::for_each_numeric!(with_own_rows);
