//! Numeric instructions. What has no code of its own here calls the function that defines it.

use cranelift_codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift_codegen::ir::{self, InstBuilder, MemFlagsData, types};
use khz_bytecode::instruction::NumericOp;
use khz_machine::semantics::{NAN_F32_BITS, NAN_F64_BITS};

use super::{Lowerer, clif_type, clif_value_type};
use crate::mir::{Const, Instruction, Op, Operands};
use crate::runtime::numeric_routine;

/// How a conversion from floating point rounds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Rounding {
    Nearest,
    Cut,
}

impl Lowerer<'_, '_> {
    /// Lowers a numeric instruction.
    pub(super) fn numeric(&mut self, op: NumericOp, operands: Operands) -> ir::Value {
        let (a, b) = (self.value(operands[0]), self.value(operands[1]));
        let constant = self.constants[operands[1].index()];
        let integer = self.integer_arithmetic(op, a, b);
        let integer = integer.or_else(|| self.division(op, a, b, constant));
        let integer = integer.or_else(|| self.shift(op, a, b, constant));
        let integer = integer.or_else(|| self.integer_comparison(op, a, b));
        let number = integer.or_else(|| self.float(op, a, b));
        let number = number.or_else(|| self.float_comparison(op, a, b));
        let number = number.or_else(|| self.conversion(op, a));
        number.or_else(|| self.float_to_integer(op, a)).unwrap_or_else(|| self.by_routine(op, a, b))
    }

    /// Lowers what makes a vector, or takes a lane of one.
    pub(super) fn vector(&mut self, instruction: &Instruction) {
        let ty =
            instruction.results.as_slice().first().map_or(types::F32X4, |result| clif_type(self.function.ty(*result)));
        let result = match instruction.op {
            Op::Splat(value) => {
                let value = self.value(value);
                self.builder.ins().splat(ty, value)
            }
            Op::Lane(value, lane) => {
                let value = self.value(value);
                self.builder.ins().extractlane(value, lane)
            }
            Op::Ramp { first, growth } => {
                let first = self.value(first);
                let all = self.builder.ins().splat(types::I32X4, first);
                let distances: Vec<u8> = (0..4).flat_map(|lane| growth.wrapping_mul(lane).to_le_bytes()).collect();
                let distances = self.builder.func.dfg.constants.insert(distances.into());
                let distances = self.builder.ins().vconst(types::I32X4, distances);
                let ramp = self.builder.ins().iadd(all, distances);
                if ty == types::F32X4 {
                    self.builder.ins().fcvt_from_sint(ty, ramp)
                } else {
                    let wide = self.builder.ins().swiden_low(ramp);
                    self.builder.ins().fcvt_from_sint(ty, wide)
                }
            }
            _ => return,
        };
        self.define(&instruction.results, result);
    }

    fn by_routine(&mut self, op: NumericOp, a: ir::Value, b: ir::Value) -> ir::Value {
        let parameters: Vec<ir::Type> = op.operands().iter().map(|ty| clif_value_type(*ty)).collect();
        let arguments = &[a, b][..parameters.len().min(2)];
        let routine = numeric_routine(op).expect("an instruction that may trap is compiled in place");
        let result = self.call_routine(routine.name, &parameters, &[clif_value_type(op.result())], arguments);
        result.expect("a numeric instruction has a result")
    }

    fn integer_arithmetic(&mut self, op: NumericOp, a: ir::Value, b: ir::Value) -> Option<ir::Value> {
        use NumericOp as N;
        let ins = self.builder.ins();
        Some(match op {
            N::I32Add | N::I64Add => ins.iadd(a, b),
            N::I32Sub | N::I64Sub => ins.isub(a, b),
            N::I32Mul | N::I64Mul => ins.imul(a, b),
            N::I32And | N::I64And => ins.band(a, b),
            N::I32Or | N::I64Or => ins.bor(a, b),
            N::I32Xor | N::I64Xor => ins.bxor(a, b),
            N::I32Neg | N::I64Neg => ins.ineg(a),
            N::I32Abs | N::I64Abs => ins.iabs(a),
            N::I32Not | N::I64Not => ins.bnot(a),
            N::I32MinS | N::I64MinS => ins.smin(a, b),
            N::I32MinU | N::I64MinU => ins.umin(a, b),
            N::I32MaxS | N::I64MaxS => ins.smax(a, b),
            N::I32MaxU | N::I64MaxU => ins.umax(a, b),
            N::I32Extend8S => self.narrow(a, types::I8, true),
            N::I32Extend8U => self.narrow(a, types::I8, false),
            N::I32Extend16S => self.narrow(a, types::I16, true),
            N::I32Extend16U => self.narrow(a, types::I16, false),
            N::I64ExtendI32S => ins.sextend(types::I64, a),
            N::I64ExtendI32U => ins.uextend(types::I64, a),
            N::I32WrapI64 => ins.ireduce(types::I32, a),
            N::I32SaturateU32 => self.saturate(a, types::I32, IntCC::UnsignedLessThan),
            N::I32SaturateI64U => self.saturate(a, types::I64, IntCC::UnsignedLessThan),
            N::I32SaturateI64S => {
                let (low, high) = (self.i64(i64::from(i32::MIN)), self.i64(i64::from(i32::MAX)));
                let value = self.builder.ins().smax(a, low);
                let value = self.builder.ins().smin(value, high);
                self.builder.ins().ireduce(types::I32, value)
            }
            _ => return None,
        })
    }

    /// The smaller of an unsigned number and the largest i32.
    fn saturate(&mut self, a: ir::Value, ty: ir::Type, less: IntCC) -> ir::Value {
        let high = self.builder.ins().iconst(ty, i64::from(i32::MAX));
        let is_less = self.builder.ins().icmp(less, a, high);
        let value = self.builder.ins().select(is_less, a, high);
        if ty == types::I32 { value } else { self.builder.ins().ireduce(types::I32, value) }
    }

    fn narrow(&mut self, a: ir::Value, ty: ir::Type, signed: bool) -> ir::Value {
        let low = self.builder.ins().ireduce(ty, a);
        if signed { self.builder.ins().sextend(types::I32, low) } else { self.builder.ins().uextend(types::I32, low) }
    }

    /// Divisions. The divisor is not zero: a guard stands before them. A divisor of -1 gets another one, since MIN / -1 faults in hardware.
    fn division(&mut self, op: NumericOp, a: ir::Value, b: ir::Value, divisor: Option<Const>) -> Option<ir::Value> {
        use NumericOp as N;
        let harmless = divisor.and_then(Const::as_i64).is_some_and(|divisor| divisor != -1 && divisor != 0);
        Some(match op {
            N::I32DivU | N::I64DivU => self.builder.ins().udiv(a, b),
            N::I32RemU | N::I64RemU => self.builder.ins().urem(a, b),
            N::I32DivS | N::I64DivS if harmless => self.builder.ins().sdiv(a, b),
            N::I32RemS | N::I64RemS if harmless => self.builder.ins().srem(a, b),
            N::I32DivS | N::I64DivS => {
                let (is_minus_one, safe) = self.safe_divisor(b);
                let quotient = self.builder.ins().sdiv(a, safe);
                let negated = self.builder.ins().ineg(a);
                self.builder.ins().select(is_minus_one, negated, quotient)
            }
            N::I32RemS | N::I64RemS => {
                let (_, safe) = self.safe_divisor(b);
                self.builder.ins().srem(a, safe)
            }
            _ => return None,
        })
    }

    fn safe_divisor(&mut self, b: ir::Value) -> (ir::Value, ir::Value) {
        let ty = self.builder.func.dfg.value_type(b);
        let is_minus_one = self.builder.ins().icmp_imm_s(IntCC::Equal, b, -1);
        let one = self.builder.ins().iconst(ty, 1);
        let safe = self.builder.ins().select(is_minus_one, one, b);
        (is_minus_one, safe)
    }

    /// Shifts and rotates: the count is unsigned and may reach or exceed the width.
    fn shift(&mut self, op: NumericOp, a: ir::Value, b: ir::Value, count: Option<Const>) -> Option<ir::Value> {
        use NumericOp as N;
        let width = if op.result() == khz_bytecode::value::ValueType::I64 { 64 } else { 32 };
        let inside = count.is_some_and(|count| count.bits() < width);
        Some(match op {
            N::I32Shl | N::I64Shl => {
                let value = self.builder.ins().ishl(a, b);
                self.zero_from(value, b, width, inside)
            }
            N::I32ShrU | N::I64ShrU => {
                let value = self.builder.ins().ushr(a, b);
                self.zero_from(value, b, width, inside)
            }
            N::I32ShrS | N::I64ShrS => {
                let last = self.i32(width as i32 - 1);
                let count = if inside { b } else { self.builder.ins().umin(b, last) };
                self.builder.ins().sshr(a, count)
            }
            N::I32Rotl | N::I64Rotl => self.builder.ins().rotl(a, b),
            N::I32Rotr | N::I64Rotr => self.builder.ins().rotr(a, b),
            N::I32Rotl8 => self.rotate_narrow(a, b, types::I8, true),
            N::I32Rotr8 => self.rotate_narrow(a, b, types::I8, false),
            N::I32Rotl16 => self.rotate_narrow(a, b, types::I16, true),
            N::I32Rotr16 => self.rotate_narrow(a, b, types::I16, false),
            _ => return None,
        })
    }

    fn zero_from(&mut self, value: ir::Value, count: ir::Value, width: u64, inside: bool) -> ir::Value {
        if inside {
            return value;
        }
        let ty = self.builder.func.dfg.value_type(value);
        let zero = self.builder.ins().iconst(ty, 0);
        let fits = self.builder.ins().icmp_imm_u(IntCC::UnsignedLessThan, count, width as i64);
        self.builder.ins().select(fits, value, zero)
    }

    fn rotate_narrow(&mut self, a: ir::Value, count: ir::Value, ty: ir::Type, left: bool) -> ir::Value {
        let low = self.builder.ins().ireduce(ty, a);
        let rotated = if left { self.builder.ins().rotl(low, count) } else { self.builder.ins().rotr(low, count) };
        self.builder.ins().uextend(types::I32, rotated)
    }

    fn integer_comparison(&mut self, op: NumericOp, a: ir::Value, b: ir::Value) -> Option<ir::Value> {
        use IntCC as C;
        use NumericOp as N;
        let code = match op {
            N::I32Eq | N::I64Eq => C::Equal,
            N::I32Ne | N::I64Ne => C::NotEqual,
            N::I32LtS | N::I64LtS => C::SignedLessThan,
            N::I32LtU | N::I64LtU => C::UnsignedLessThan,
            N::I32LeS | N::I64LeS => C::SignedLessThanOrEqual,
            N::I32LeU | N::I64LeU => C::UnsignedLessThanOrEqual,
            N::I32GtS | N::I64GtS => C::SignedGreaterThan,
            N::I32GtU | N::I64GtU => C::UnsignedGreaterThan,
            N::I32GeS | N::I64GeS => C::SignedGreaterThanOrEqual,
            N::I32GeU | N::I64GeU => C::UnsignedGreaterThanOrEqual,
            N::I32Eqz | N::I64Eqz => return Some(self.compare_zero(C::Equal, a)),
            N::I32Nez | N::I64Nez => return Some(self.compare_zero(C::NotEqual, a)),
            _ => return None,
        };
        let flag = self.builder.ins().icmp(code, a, b);
        Some(self.builder.ins().uextend(types::I32, flag))
    }

    fn compare_zero(&mut self, code: IntCC, a: ir::Value) -> ir::Value {
        let flag = self.builder.ins().icmp_imm_s(code, a, 0);
        self.builder.ins().uextend(types::I32, flag)
    }

    fn float(&mut self, op: NumericOp, a: ir::Value, b: ir::Value) -> Option<ir::Value> {
        use NumericOp as N;
        let ins = self.builder.ins();
        let value = match op {
            N::F32Add | N::F64Add => ins.fadd(a, b),
            N::F32Sub | N::F64Sub => ins.fsub(a, b),
            N::F32Mul | N::F64Mul => ins.fmul(a, b),
            N::F32Div | N::F64Div => ins.fdiv(a, b),
            N::F32Sqrt | N::F64Sqrt => ins.sqrt(a),
            N::F32DemoteF64 => ins.fdemote(types::F32, a),
            N::F64PromoteF32 => ins.fpromote(types::F64, a),
            N::F32Neg | N::F64Neg => {
                let value = ins.fneg(a);
                return Some(self.canonical(value));
            }
            N::F32Abs | N::F64Abs => {
                let value = ins.fabs(a);
                return Some(self.canonical(value));
            }
            N::F32Min | N::F64Min => {
                let is_less = ins.fcmp(FloatCC::LessThan, b, a);
                return Some(self.builder.ins().select(is_less, b, a));
            }
            N::F32Max | N::F64Max => {
                let is_greater = ins.fcmp(FloatCC::GreaterThan, b, a);
                return Some(self.builder.ins().select(is_greater, b, a));
            }
            _ => return None,
        };
        Some(if self.settings.native_nan { value } else { self.canonical(value) })
    }

    /// The value, or the one NaN for any NaN.
    pub(super) fn canonical(&mut self, value: ir::Value) -> ir::Value {
        let nan = if self.builder.func.dfg.value_type(value) == types::F32 {
            self.constant(Const::F32(NAN_F32_BITS))
        } else {
            self.constant(Const::F64(NAN_F64_BITS))
        };
        let is_nan = self.builder.ins().fcmp(FloatCC::Unordered, value, value);
        self.builder.ins().select(is_nan, nan, value)
    }

    fn float_comparison(&mut self, op: NumericOp, a: ir::Value, b: ir::Value) -> Option<ir::Value> {
        use FloatCC as C;
        use NumericOp as N;
        let code = match op {
            N::F32Eq | N::F64Eq => C::Equal,
            N::F32Ne | N::F64Ne => C::NotEqual,
            N::F32Lt | N::F64Lt => C::LessThan,
            N::F32Le | N::F64Le => C::LessThanOrEqual,
            N::F32Gt | N::F64Gt => C::GreaterThan,
            N::F32Ge | N::F64Ge => C::GreaterThanOrEqual,
            _ => return None,
        };
        let flag = self.builder.ins().fcmp(code, a, b);
        let ty = self.builder.func.dfg.value_type(a);
        if ty.is_vector() {
            // All bits of a lane or none, in the type that it is asked in.
            return Some(self.builder.ins().bitcast(ty, MemFlagsData::new(), flag));
        }
        Some(self.builder.ins().uextend(types::I32, flag))
    }

    fn conversion(&mut self, op: NumericOp, a: ir::Value) -> Option<ir::Value> {
        use NumericOp as N;
        let ins = self.builder.ins();
        Some(match op {
            N::F32ConvertI32S | N::F32ConvertI64S => ins.fcvt_from_sint(types::F32, a),
            N::F64ConvertI32S | N::F64ConvertI64S => ins.fcvt_from_sint(types::F64, a),
            N::F32ConvertI64U => ins.fcvt_from_uint(types::F32, a),
            N::F64ConvertI64U => ins.fcvt_from_uint(types::F64, a),
            N::F32ConvertI32U => {
                let wide = ins.uextend(types::I64, a);
                self.builder.ins().fcvt_from_sint(types::F32, wide)
            }
            N::F64ConvertI32U => {
                let wide = ins.uextend(types::I64, a);
                self.builder.ins().fcvt_from_sint(types::F64, wide)
            }
            N::I32ReinterpretF32 => ins.bitcast(types::I32, MemFlagsData::new(), a),
            N::I64ReinterpretF64 => ins.bitcast(types::I64, MemFlagsData::new(), a),
            N::F32ReinterpretI32 => {
                let value = ins.bitcast(types::F32, MemFlagsData::new(), a);
                self.canonical(value)
            }
            N::F64ReinterpretI64 => {
                let value = ins.bitcast(types::F64, MemFlagsData::new(), a);
                self.canonical(value)
            }
            _ => return None,
        })
    }

    fn float_to_integer(&mut self, op: NumericOp, a: ir::Value) -> Option<ir::Value> {
        use NumericOp as N;
        use Rounding::{Cut, Nearest};
        Some(match op {
            N::F32RoundI8 | N::F64RoundI8 => self.narrow_from(a, Nearest, -128, 127),
            N::F32RoundU8 | N::F64RoundU8 => self.narrow_from(a, Nearest, 0, 255),
            N::F32RoundI16 | N::F64RoundI16 => self.narrow_from(a, Nearest, -32768, 32767),
            N::F32RoundU16 | N::F64RoundU16 => self.narrow_from(a, Nearest, 0, 65535),
            N::F32RoundI32 | N::F64RoundI32 => self.signed_from(a, Nearest, types::I32),
            N::F32RoundU32 | N::F64RoundU32 => self.unsigned_from(a, Nearest, types::I32),
            N::F32RoundI64 | N::F64RoundI64 => self.signed_from(a, Nearest, types::I64),
            N::F32RoundU64 | N::F64RoundU64 => self.unsigned_from(a, Nearest, types::I64),
            N::F32TruncI8 | N::F64TruncI8 => self.narrow_from(a, Cut, -128, 127),
            N::F32TruncU8 | N::F64TruncU8 => self.narrow_from(a, Cut, 0, 255),
            N::F32TruncI16 | N::F64TruncI16 => self.narrow_from(a, Cut, -32768, 32767),
            N::F32TruncU16 | N::F64TruncU16 => self.narrow_from(a, Cut, 0, 65535),
            N::F32TruncI32 | N::F64TruncI32 => self.signed_from(a, Cut, types::I32),
            N::F32TruncU32 | N::F64TruncU32 => self.unsigned_from(a, Cut, types::I32),
            N::F32TruncI64 | N::F64TruncI64 => self.signed_from(a, Cut, types::I64),
            N::F32TruncU64 | N::F64TruncU64 => self.unsigned_from(a, Cut, types::I64),
            _ => return None,
        })
    }

    fn rounded(&mut self, a: ir::Value, rounding: Rounding) -> ir::Value {
        if rounding == Rounding::Nearest { self.builder.ins().nearest(a) } else { a }
    }

    fn signed_from(&mut self, a: ir::Value, rounding: Rounding, ty: ir::Type) -> ir::Value {
        let a = self.rounded(a, rounding);
        self.builder.ins().fcvt_to_sint_sat(ty, a)
    }

    fn unsigned_from(&mut self, a: ir::Value, rounding: Rounding, ty: ir::Type) -> ir::Value {
        let a = self.rounded(a, rounding);
        self.builder.ins().fcvt_to_uint_sat(ty, a)
    }

    /// What saturates at an i32 saturates at a narrower type when it is cut to that type's range afterwards.
    fn narrow_from(&mut self, a: ir::Value, rounding: Rounding, low: i32, high: i32) -> ir::Value {
        let value = self.signed_from(a, rounding, types::I32);
        let (low, high) = (self.i32(low), self.i32(high));
        let value = self.builder.ins().smax(value, low);
        self.builder.ins().smin(value, high)
    }
}
