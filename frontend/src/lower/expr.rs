//! Expressions to instructions.

use khz_bytecode::canary::{Fault, planted};
use khz_bytecode::container::{Constant, ElementaryType as E};
use khz_bytecode::instruction::{Instruction as I, NumericOp as N};
use khz_bytecode::value::{IntegerType, SlotPlace, ValueType};

use super::body::{FunctionBuilder, Kept};
use crate::analysis::ops;
use crate::analysis::tree::{BinOp, CalendarOp, Expr, ExprKind, TextOp, UnOp};
use crate::analysis::types::{
    Const, Ty, TyKind, integer_type, is_date, is_date_and_time, is_duration, is_real, is_signed, is_time,
    is_time_of_day, limits,
};
use crate::analysis::unit_ns;

impl FunctionBuilder<'_, '_> {
    pub(super) fn elementary(&self, ty: Ty) -> E {
        self.b.project.types.elementary(ty).unwrap_or(E::Dint)
    }

    /// Appends an operation on numbers.
    pub(super) fn numeric(&mut self, op: N) {
        let pops = u32::try_from(op.operands().len()).unwrap_or(0);
        self.e.push(I::Numeric(op), pops, 1);
    }

    pub(super) fn i32_const(&mut self, value: i32) {
        self.e.push(I::ConstI32 { value }, 0, 1);
    }

    pub(super) fn i64_const(&mut self, value: i64) {
        let id = self.b.constant(Constant::I64(value));
        self.e.push(I::Const { id }, 0, 1);
    }

    /// A constant of an elementary type.
    pub(super) fn constant(&mut self, value: &Const, ty: E) {
        match value {
            Const::Int(value) if ty.storage().value_type() == ValueType::I64 => self.i64_const(*value),
            #[expect(clippy::cast_possible_truncation, reason = "the low 32 bits are the value in a register")]
            Const::Int(value) => self.i32_const(*value as i32),
            Const::F32(value) => {
                let id = self.b.constant(Constant::F32(value.to_bits()));
                self.e.push(I::Const { id }, 0, 1);
            }
            Const::F64(value) => {
                let id = self.b.constant(Constant::F64(value.to_bits()));
                self.e.push(I::Const { id }, 0, 1);
            }
            // Literals without a type and strings are no scalars; the checker has given every scalar a type.
            Const::Wide(_) | Const::Lit(..) | Const::Str(_) | Const::WStr(_) => self.i32_const(0),
        }
    }

    /// Pushes a value: of a scalar itself, of anything else a reference to it.
    pub(super) fn value(&mut self, expr: &Expr) {
        if self.b.project.types.storage(expr.ty).is_none() {
            self.composed(expr);
            return;
        }
        let ty = self.elementary(expr.ty);
        match &expr.kind {
            ExprKind::Const(value) => self.constant(value, ty),
            ExprKind::Load(place) => self.load(place),
            ExprKind::Unary(op, operand) => self.unary(*op, operand),
            ExprKind::Binary(op, a, b) => self.binary(*op, a, b, ty, expr),
            ExprKind::Convert { value, truncates } => {
                self.value(value);
                let from = self.elementary(value.ty);
                self.convert(from, ty, *truncates);
            }
            ExprKind::ToIndex(value) => {
                self.value(value);
                match integer_type(self.elementary(value.ty)) {
                    Some(IntegerType::U32) => self.numeric(N::I32SaturateU32),
                    Some(IntegerType::I64) => self.numeric(N::I32SaturateI64S),
                    Some(IntegerType::U64) => self.numeric(N::I32SaturateI64U),
                    _ => {}
                }
            }
            ExprKind::Check(value, low, high) => {
                self.value(value);
                self.check(ty, *low, *high, expr.span);
            }
            ExprKind::Select(parts) => {
                let [condition, a, b] = parts.as_ref();
                // Evaluated from left to right: the condition waits in a slot.
                self.value(condition);
                let slot = self.scratch(khz_bytecode::value::Storage::Bool);
                self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
                self.value(a);
                self.value(b);
                self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
                self.numeric(N::I32Eqz);
                self.e.push(I::Select {}, 3, 1);
                self.release(slot);
            }
            ExprKind::Mux(parts) => self.mux(parts),
            ExprKind::Call(call) => self.call_value(call, expr.ty),
            ExprKind::Enabled(enabled) => self.enabled_value(enabled, expr),
            ExprKind::Keep(value) => {
                self.value(value);
                let slot = self.scratch(ty.storage());
                self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
                self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
                self.kept.push(Kept::Slot(slot));
            }
            ExprKind::Kept => {
                if let Some(Kept::Slot(slot)) = self.kept.pop() {
                    self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
                    self.release(slot);
                }
            }
            ExprKind::Text(op, parts) => self.text_scalar(*op, parts, ty),
            ExprKind::Calendar(op, parts) => self.calendar(*op, parts),
            ExprKind::Bound(array, dim, upper) => {
                let bounds = match self.b.project.types.kind(self.b.actual(Ty::User(*array))) {
                    Some(TyKind::Array { dims, .. }) => dims.get(*dim).copied(),
                    _ => None,
                };
                let (lower, highest) = bounds.unwrap_or_default();
                self.i32_const(if *upper { highest } else { lower });
            }
        }
    }

    /// Traps unless the value on the stack is inside a range.
    pub(super) fn check(&mut self, ty: E, low: i64, high: i64, span: crate::source::Span) {
        let Some(kind) = integer_type(ty) else { return };
        self.e.mark(span);
        if kind.value_type() == ValueType::I64 {
            self.e.push(I::CheckI64 { kind, lower: low, upper: high }, 1, 1);
        } else {
            #[expect(clippy::cast_possible_truncation, reason = "bounds of 32 bits")]
            let (lower, upper) = (low as i32, high as i32);
            self.e.push(I::CheckI32 { kind, lower, upper }, 1, 1);
        }
    }

    fn mux(&mut self, parts: &[Expr]) {
        let [selector, first, rest @ ..] = parts else { return };
        self.value(selector);
        self.i32_const(i32::try_from(rest.len()).unwrap_or(i32::MAX));
        self.numeric(N::I32MinU);
        let slot = self.scratch(khz_bytecode::value::Storage::I32);
        self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
        self.value(first);
        for (at, part) in (1i32..).zip(rest) {
            self.value(part);
            self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
            self.i32_const(at);
            self.numeric(N::I32Ne);
            self.e.push(I::Select {}, 3, 1);
        }
        self.release(slot);
    }

    fn unary(&mut self, op: UnOp, operand: &Expr) {
        self.value(operand);
        let ty = self.elementary(operand.ty);
        match op {
            UnOp::Not if ty == E::Bool => self.numeric(N::I32Eqz),
            // The absolute value of an unsigned number is the number.
            UnOp::Abs if !is_real(ty) && !is_signed(ty) && !is_duration(ty) => {}
            UnOp::SwapBytes => self.swap_bytes(ty),
            UnOp::FromBcd => self.digits_to_number(ty),
            UnOp::ToBcd => self.number_to_digits(ty),
            UnOp::IsValid => self.is_valid(ty),
            UnOp::IsValidBcd => self.is_valid_bcd(ty),
            _ => {
                if let Some(op) = ops::unary(op, ty.storage().value_type()) {
                    self.numeric(op);
                }
                self.wrap(ty);
            }
        }
    }

    /// Brings what is on the stack back into the width of a narrow type.
    pub(super) fn wrap(&mut self, ty: E) {
        match integer_type(ty) {
            Some(IntegerType::I8) => self.numeric(N::I32Extend8S),
            Some(IntegerType::U8) if ty != E::Bool => self.numeric(N::I32Extend8U),
            Some(IntegerType::I16) => self.numeric(N::I32Extend16S),
            Some(IntegerType::U16) => self.numeric(N::I32Extend16U),
            _ => {}
        }
    }

    /// MAX(b, a) of floats, `a` evaluated first; a constant need not wait in a slot.
    fn raise(&mut self, a: &Expr, b: &Expr, ty: E) {
        let Some(found) = ops::binary(BinOp::Max, ty) else { return };
        if matches!(a.kind, ExprKind::Const(_)) {
            self.value(b);
            self.value(a);
        } else {
            let storage =
                if ty == E::Real { khz_bytecode::value::Storage::F32 } else { khz_bytecode::value::Storage::F64 };
            self.value(a);
            let slot = self.scratch(storage);
            self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
            self.value(b);
            self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
            self.release(slot);
        }
        self.numeric(found);
    }

    fn binary(&mut self, op: BinOp, a: &Expr, b: &Expr, ty: E, whole: &Expr) {
        match op {
            BinOp::AndThen | BinOp::OrElse => {
                let short = self.e.label();
                let end = self.e.label();
                self.jump_when(whole, short, true);
                self.i32_const(0);
                self.e.push(I::Jump { target: end }, 0, 0);
                self.e.bind(short);
                self.i32_const(1);
                self.e.bind(end);
                return;
            }
            _ if a.ty.is_text() => {
                self.text_compare(op, a, b);
                return;
            }
            _ => {}
        }
        let (left, right) = (self.elementary(a.ty), self.elementary(b.ty));
        if op == BinOp::Raise {
            self.raise(a, b, left);
            return;
        }
        let scaled = is_duration(left) != is_duration(right) && (is_real(left) || is_real(right));
        self.value(a);
        if scaled && is_duration(left) {
            self.numeric(N::F64ConvertI64S);
        }
        self.value(b);
        if scaled {
            if is_duration(right) {
                self.numeric(N::F64ConvertI64S);
            }
            self.numeric(if op == BinOp::Div { N::F64Div } else { N::F64Mul });
            self.numeric(N::F64RoundI64);
            return;
        }
        let operand = if matches!(op, BinOp::Mul | BinOp::Div) && is_duration(ty) { E::Lint } else { left };
        let Some(found) = ops::binary(op, operand) else { return };
        if found.trap().is_some() {
            self.e.mark(whole.span);
        }
        // A shift of a narrow signed number is one of its extended form; a rotation has its own width.
        self.numeric(found);
        let wraps =
            matches!(op, BinOp::Add | BinOp::Sub | BinOp::Mul | BinOp::Div | BinOp::Shl | BinOp::Rol | BinOp::Ror);
        if wraps {
            self.wrap(ty);
        }
    }

    /// Jumps to `target` when a condition is `sense`, else falls through.
    pub(super) fn jump_when(&mut self, expr: &Expr, target: khz_bytecode::ids::Label, sense: bool) {
        match &expr.kind {
            ExprKind::Const(Const::Int(value)) => {
                if (*value != 0) == sense {
                    self.e.push(I::Jump { target }, 0, 0);
                }
            }
            ExprKind::Unary(UnOp::Not, inner) => self.jump_when(inner, target, !sense),
            ExprKind::Binary(op @ (BinOp::AndThen | BinOp::OrElse), a, b) => {
                // AND_THEN is decided early by FALSE, OR_ELSE by TRUE.
                let early = *op == BinOp::OrElse;
                if early == sense {
                    self.jump_when(a, target, sense);
                    self.jump_when(b, target, sense);
                } else {
                    let over = self.e.label();
                    self.jump_when(a, over, early);
                    self.jump_when(b, target, sense);
                    self.e.bind(over);
                }
            }
            _ => {
                self.value(expr);
                let jump = if sense { I::JumpIf { target } } else { I::JumpUnless { target } };
                self.e.push(jump, 1, 0);
            }
        }
    }

    /// Converts what is on the stack from one elementary type to another.
    pub(super) fn convert(&mut self, from: E, to: E, truncates: bool) {
        if from == to {
            return;
        }
        let (a, b) = (from.storage().value_type(), to.storage().value_type());
        if to == E::Bool {
            match a {
                ValueType::I32 => self.numeric(N::I32Nez),
                ValueType::I64 => self.numeric(N::I64Nez),
                ValueType::F32 => {
                    self.constant(&Const::F32(0.0), E::Real);
                    self.numeric(N::F32Ne);
                }
                ValueType::F64 => {
                    self.constant(&Const::F64(0.0), E::Lreal);
                    self.numeric(N::F64Ne);
                }
            }
            return;
        }
        if is_time(from) || is_time(to) {
            self.convert_time(from, to, truncates);
            return;
        }
        match (is_real(from), is_real(to)) {
            (true, true) => self.numeric(if to == E::Real { N::F32DemoteF64 } else { N::F64PromoteF32 }),
            (true, false) => {
                if let Some(op) = integer_type(to).map(|kind| ops::float_to_integer(a, kind, truncates)) {
                    self.numeric(op);
                }
            }
            (false, true) => {
                if let Some(kind) = integer_type(from) {
                    self.numeric(ops::integer_to_float(kind, b));
                }
            }
            (false, false) => self.convert_integer(from, to),
        }
    }

    fn convert_integer(&mut self, mut from: E, to: E) {
        if (from, to) == (E::Wchar, E::Char) {
            self.narrow_character();
            return;
        }
        if planted(Fault::Frontend) && from == E::Usint && to.storage().bytes() > 1 {
            self.numeric(N::I32Extend8S);
            from = E::Sint;
        }
        let (a, b) = (from.storage().value_type(), to.storage().value_type());
        match (a, b) {
            (ValueType::I32, ValueType::I64) => {
                let unsigned = integer_type(from) == Some(IntegerType::U32);
                self.numeric(if unsigned { N::I64ExtendI32U } else { N::I64ExtendI32S });
            }
            (ValueType::I64, ValueType::I32) => {
                self.numeric(N::I32WrapI64);
                self.wrap(to);
            }
            _ => {
                let (have, room) = (limits(from).unwrap_or((0, 0)), limits(to).unwrap_or((0, 0)));
                if have.0 < room.0 || have.1 > room.1 {
                    self.wrap(to);
                }
            }
        }
    }

    fn calendar(&mut self, op: CalendarOp, parts: &[Expr]) {
        parts.iter().for_each(|part| self.value(part));
        self.numeric(ops::calendar(op));
    }

    /// Durations, dates and times of day: among themselves, and with numbers in the unit that each type has.
    fn convert_time(&mut self, from: E, to: E, truncates: bool) {
        match (unit_ns(from), unit_ns(to)) {
            (Some(_), Some(_)) if is_date(to) && !is_date(from) => self.numeric(N::DateStart),
            (Some(_), Some(_)) if is_time_of_day(to) && (is_date(from) || is_date_and_time(from)) => {
                self.numeric(N::DateTime);
            }
            (Some(unit), None) => {
                if unit > 1 {
                    self.i64_const(unit);
                    self.numeric(N::I64DivS);
                }
                self.convert(E::Lint, to, truncates);
            }
            (None, Some(unit)) => {
                self.convert(from, E::Lint, truncates);
                if unit > 1 {
                    self.i64_const(unit);
                    self.numeric(N::I64Mul);
                }
                self.convert_time(E::Ltime, to, truncates);
            }
            _ => {}
        }
    }

    fn text_scalar(&mut self, op: TextOp, parts: &[Expr], ty: E) {
        use khz_bytecode::instruction::HelperOp as H;
        match op {
            TextOp::Len => {
                self.text_helper(if super::text::is_wide(parts) { H::WideLen } else { H::StringLen }, parts, None);
                self.wrap(ty);
            }
            TextOp::Find => {
                self.text_helper(if super::text::is_wide(parts) { H::WideFind } else { H::StringFind }, parts, None);
                self.wrap(ty);
            }
            TextOp::First => self.first_character(parts, ty),
            _ => {
                let (helper, made) = match ty {
                    E::Bool => (H::StringToBool, E::Bool),
                    E::Real => (H::StringToF32, E::Real),
                    E::Lreal => (H::StringToF64, E::Lreal),
                    E::Time | E::Ltime => (H::StringToTime, ty),
                    _ if is_date(ty) => (H::StringToDate, ty),
                    _ if is_time_of_day(ty) => (H::StringToTod, ty),
                    _ if is_date_and_time(ty) => (H::StringToDt, ty),
                    _ if is_signed(ty) => (H::StringToI64, E::Lint),
                    _ => (H::StringToU64, E::Ulint),
                };
                self.text_helper(helper, parts, None);
                if made != ty {
                    self.convert_integer(made, ty);
                }
            }
        }
    }
}
