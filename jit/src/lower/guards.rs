//! Guards and the cold blocks that they leave to.

use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{self, BlockArg, InstBuilder, types};
use khz_bytecode::limits::MAX_TRAP_CHAIN;
use khz_bytecode::trap::TrapCode;
use khz_bytecode::value::{IntegerType, ValueType};

use super::{Lowerer, clif_type};
use crate::context;
use crate::mir::{self, ForTest, Op};

impl Lowerer<'_, '_> {
    /// Lowers an instruction that may trap and computes nothing else.
    pub(super) fn guard(&mut self, instruction: &mir::Instruction) {
        match &instruction.op {
            Op::CheckIndex { index, lower, upper } => {
                let value = self.value(*index);
                let outside = self.outside_i32(value, *lower, *upper, IntegerType::I32);
                let values = [self.extend(value, true), self.i64(i64::from(*lower)), self.i64(i64::from(*upper))];
                self.trap_if(outside, TrapCode::ArrayIndex as u32, values);
            }
            Op::CheckRange { value, ty, lower, upper } => self.check_range(*value, *ty, *lower, *upper),
            Op::CheckDivisor(value) => {
                let value = self.value(*value);
                let is_zero = self.builder.ins().icmp_imm_s(IntCC::Equal, value, 0);
                self.plain_trap_if(is_zero, TrapCode::DivideByZero as u32);
            }
            Op::CheckStep(value) => {
                let value = self.value(*value);
                let is_zero = self.builder.ins().icmp_imm_s(IntCC::Equal, value, 0);
                self.plain_trap_if(is_zero, TrapCode::Range as u32);
            }
            Op::Checkpoint { fuel, deadline } => self.checkpoint(*fuel, *deadline),
            Op::RefCheck { offset, size, write } => {
                let offset = self.value(*offset);
                let reference = self.ref_check(offset, *size, *write);
                self.define(&instruction.results, reference);
            }
            _ => {}
        }
    }

    /// 1 when an i32 lies outside bounds, in the order of a type of at most 32 bits.
    fn outside_i32(&mut self, value: ir::Value, lower: i32, upper: i32, ty: IntegerType) -> ir::Value {
        let empty = if ty.is_signed() { lower > upper } else { lower as u32 > upper as u32 };
        if empty {
            return self.i32(1);
        }
        // One comparison: what lies below the lower bound wraps to more than the distance.
        let position = if lower == 0 { value } else { self.builder.ins().iadd_imm_s(value, -i64::from(lower)) };
        let distance = i64::from(upper.wrapping_sub(lower) as u32);
        let distance = self.builder.ins().iconst(types::I32, distance);
        self.builder.ins().icmp(IntCC::UnsignedGreaterThan, position, distance)
    }

    fn check_range(&mut self, value: mir::Value, ty: IntegerType, lower: i64, upper: i64) {
        let value = self.value(value);
        if ty.value_type() == ValueType::I32 {
            let outside = self.outside_i32(value, lower as i32, upper as i32, ty);
            let wide = |bound: i64| khz_machine::semantics::in_order(ty, bound);
            let values = [self.extend(value, ty.is_signed()), self.i64(wide(lower)), self.i64(wide(upper))];
            self.trap_if(outside, TrapCode::Range as u32, values);
            return;
        }
        let empty = if ty.is_signed() { lower > upper } else { lower as u64 > upper as u64 };
        let (lower_value, upper_value) = (self.i64(lower), self.i64(upper));
        let outside = if empty {
            self.i32(1)
        } else {
            let position = self.builder.ins().isub(value, lower_value);
            let distance = self.i64(upper.wrapping_sub(lower));
            self.builder.ins().icmp(IntCC::UnsignedGreaterThan, position, distance)
        };
        self.trap_if(outside, TrapCode::Range as u32, [value, lower_value, upper_value]);
    }

    fn extend(&mut self, value: ir::Value, signed: bool) -> ir::Value {
        if signed {
            self.builder.ins().sextend(types::I64, value)
        } else {
            self.builder.ins().uextend(types::I64, value)
        }
    }

    fn checkpoint(&mut self, fuel: u32, deadline: bool) {
        if deadline && self.settings.deadline {
            let flags = self.host_flags();
            let code = self.builder.ins().atomic_load(types::I32, flags, self.deadline);
            let zero = self.i64(0);
            self.leave_if(code, code, [zero; 3]);
        }
        if self.settings.fuel && fuel > 0 {
            let flags = self.host_flags();
            let left = self.builder.ins().load(types::I64, flags, self.context, context::FUEL);
            let too_little = self.builder.ins().icmp_imm_u(IntCC::UnsignedLessThan, left, i64::from(fuel));
            self.plain_trap_if(too_little, context::OUT_OF_FUEL);
            let rest = self.builder.ins().iadd_imm_s(left, -i64::from(fuel));
            self.builder.ins().store(flags, rest, self.context, context::FUEL);
        }
    }

    fn ref_check(&mut self, offset: ir::Value, size: u32, write: bool) -> ir::Value {
        let layout = self.scope.layout;
        let reach = if write { layout.writable() } else { layout.readable() };
        let last = i64::from(reach.end) - i64::from(reach.start) - i64::from(size);
        let outside = if last < 1 {
            self.i32(1)
        } else {
            // 1 to `last`; NULL wraps to the largest number.
            let position = self.builder.ins().iadd_imm_s(offset, -1);
            self.builder.ins().icmp_imm_u(IntCC::UnsignedGreaterThan, position, last - 1)
        };
        let zero = self.i64(0);
        self.trap_if(outside, TrapCode::Reference as u32, [offset, zero, zero]);
        let start = self.builder.ins().iadd_imm_s(self.image, i64::from(reach.start));
        self.builder.ins().iadd(start, offset)
    }

    /// Traps without values when the condition is not zero.
    fn plain_trap_if(&mut self, condition: ir::Value, code: u32) {
        let zero = self.i64(0);
        self.trap_if(condition, code, [zero; 3]);
    }

    /// Traps when the condition is not zero.
    pub(super) fn trap_if(&mut self, condition: ir::Value, code: u32, values: [ir::Value; 3]) {
        let code = self.builder.ins().iconst(types::I32, i64::from(code));
        self.leave_if(condition, code, values);
    }

    fn leave_if(&mut self, condition: ir::Value, code: ir::Value, values: [ir::Value; 3]) {
        let exit = self.trap_exit();
        // What is recorded is computed behind the function, in a cold block of each guard's own; the way past it only compares.
        let (cold, next) = (self.builder.create_block(), self.builder.create_block());
        self.builder.set_cold_block(cold);
        self.builder.ins().brif(condition, cold, &[], next, &[]);
        self.builder.switch_to_block(cold);
        let place = self.linker.place(&self.function.places, self.place);
        let place = self.builder.ins().iconst(types::I32, i64::from(place));
        let arguments = [code, place, values[0], values[1], values[2]].map(BlockArg::Value);
        self.builder.ins().jump(exit, &arguments);
        self.builder.switch_to_block(next);
    }

    /// Leaves when a call came back with a trap; its place joins the chain.
    pub(super) fn leave_if_trapped(&mut self, status: ir::Value) {
        let position = self.write_back.index();
        let exit = match self.call_exits[position] {
            Some(exit) => exit,
            None => {
                let exit = self.builder.create_block();
                self.builder.set_cold_block(exit);
                self.builder.append_block_param(exit, types::I32);
                self.call_exits[position] = Some(exit);
                exit
            }
        };
        let (cold, next) = (self.builder.create_block(), self.builder.create_block());
        self.builder.set_cold_block(cold);
        self.builder.ins().brif(status, cold, &[], next, &[]);
        self.builder.switch_to_block(cold);
        let place = self.linker.place(&self.function.places, self.place);
        let place = self.builder.ins().iconst(types::I32, i64::from(place));
        self.builder.ins().jump(exit, &[BlockArg::Value(place)]);
        self.builder.switch_to_block(next);
    }

    /// Leaves when a part of this function came back with a trap.
    pub(super) fn leave_if_part_trapped(&mut self, status: ir::Value) {
        let position = self.write_back.index();
        let exit = *self.part_exits[position].get_or_insert_with(|| {
            let exit = self.builder.create_block();
            self.builder.set_cold_block(exit);
            exit
        });
        let next = self.builder.create_block();
        self.builder.ins().brif(status, exit, &[], next, &[]);
        self.builder.switch_to_block(next);
    }

    /// The block that records a trap and leaves, for the write-back at hand.
    fn trap_exit(&mut self) -> ir::Block {
        let position = self.write_back.index();
        if let Some(exit) = self.trap_exits[position] {
            return exit;
        }
        let exit = self.builder.create_block();
        self.builder.set_cold_block(exit);
        for ty in [types::I32, types::I32, types::I64, types::I64, types::I64] {
            self.builder.append_block_param(exit, ty);
        }
        self.trap_exits[position] = Some(exit);
        exit
    }

    /// Fills the cold blocks, when every way into them is known.
    pub(super) fn finish_exits(&mut self) {
        for position in 0..self.trap_exits.len() {
            if let Some(exit) = self.trap_exits[position] {
                self.builder.switch_to_block(exit);
                self.record_trap(exit);
                self.leave(position);
            }
            if let Some(exit) = self.call_exits[position] {
                self.builder.switch_to_block(exit);
                self.record_caller(exit);
                self.leave(position);
            }
            if let Some(exit) = self.part_exits[position] {
                self.builder.switch_to_block(exit);
                self.leave(position);
            }
        }
    }

    fn record_trap(&mut self, exit: ir::Block) {
        let flags = self.host_flags();
        let parameters = self.builder.block_params(exit).to_vec();
        let v = context::TRAP_VALUES;
        let offsets = [context::TRAP_CODE, context::TRAP_PLACE, v, v + 8, v + 16];
        for (value, offset) in parameters.into_iter().zip(offsets) {
            self.builder.ins().store(flags, value, self.context, offset);
        }
    }

    /// Appends a place to the chain; what has no room goes to the entry behind the last.
    fn record_caller(&mut self, exit: ir::Block) {
        let flags = self.host_flags();
        let place = self.builder.block_params(exit)[0];
        let count = self.builder.ins().load(types::I32, flags, self.context, context::CHAIN_LEN);
        let room = self.builder.ins().iconst(types::I32, MAX_TRAP_CHAIN as i64);
        let at = self.builder.ins().umin(count, room);
        let at = self.builder.ins().uextend(types::I64, at);
        let at = self.builder.ins().ishl_imm_s(at, 2);
        let entry = self.builder.ins().iadd(self.context, at);
        self.builder.ins().store(flags, place, entry, context::CHAIN);
        let count = self.builder.ins().iadd_imm_s(count, 1);
        self.builder.ins().store(flags, count, self.context, context::CHAIN_LEN);
    }

    /// Writes back what registers hold and returns a trap.
    fn leave(&mut self, write_back: usize) {
        let function = self.function;
        for dirty in &function.write_backs[write_back] {
            let value = self.builder.use_var(self.variables[dirty.var.index()]);
            self.store_slot(dirty.slot, dirty.access, value);
        }
        let mut results = vec![self.i32(1)];
        for ty in &function.results {
            let zero = match clif_type(*ty) {
                types::F32 => self.builder.ins().f32const(0.0),
                types::F64 => self.builder.ins().f64const(0.0),
                int => self.builder.ins().iconst(int, 0),
            };
            results.push(zero);
        }
        self.builder.ins().return_(&results);
    }

    /// `for.enter`: 1 when no pass is due.
    pub(super) fn for_is_empty(&mut self, test: &ForTest) -> ir::Value {
        let (control, bound, step) = (self.value(test.control), self.value(test.bound), self.value(test.step));
        let (above, below) = if test.ty.is_signed() {
            (IntCC::SignedGreaterThan, IntCC::SignedLessThan)
        } else {
            (IntCC::UnsignedGreaterThan, IntCC::UnsignedLessThan)
        };
        let passed_up = self.builder.ins().icmp(above, control, bound);
        let passed_down = self.builder.ins().icmp(below, control, bound);
        let down = self.builder.ins().icmp_imm_s(IntCC::SignedLessThan, step, 0);
        let passed = self.builder.ins().select(down, passed_down, passed_up);
        self.builder.ins().uextend(types::I32, passed)
    }

    /// `for.next`: 1 when another pass follows; the distance to the bound is taken before the step.
    pub(super) fn for_continues(&mut self, test: &ForTest) -> ir::Value {
        let (control, bound, step) = (self.value(test.control), self.value(test.bound), self.value(test.step));
        let at_most = if test.ty.is_signed() { IntCC::SignedLessThanOrEqual } else { IntCC::UnsignedLessThanOrEqual };
        let down = self.builder.ins().icmp_imm_s(IntCC::SignedLessThan, step, 0);
        let low = self.builder.ins().select(down, bound, control);
        let high = self.builder.ins().select(down, control, bound);
        let not_passed = self.builder.ins().icmp(at_most, low, high);
        let distance = self.builder.ins().isub(high, low);
        let size = self.builder.ins().iabs(step);
        let far_enough = self.builder.ins().icmp(IntCC::UnsignedGreaterThanOrEqual, distance, size);
        // A step of 0 never gets here alive: `for.enter` traps; but `for.next` alone must not go on with it either.
        let moves = self.builder.ins().icmp_imm_s(IntCC::NotEqual, step, 0);
        let goes_on = self.builder.ins().band(not_passed, far_enough);
        let goes_on = self.builder.ins().band(goes_on, moves);
        self.builder.ins().uextend(types::I32, goes_on)
    }
}
