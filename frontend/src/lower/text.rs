//! Strings and composed values: references to where they are.

use khz_bytecode::instruction::{HelperOp as H, Instruction as I, MAX_CAPACITIES, NumericOp as N};
use khz_bytecode::value::{BytePlace, SlotPlace, Storage};
use khz_machine::semantics::strings::NO_LATIN_1;

use super::body::{FunctionBuilder, Kept};
use crate::analysis::ops;
use crate::analysis::tree::{BinOp, Expr, ExprKind, Place, TextOp};
use crate::analysis::types::{Const, Ty, is_date, is_date_and_time, is_duration, is_real, is_signed, is_time_of_day};
use khz_bytecode::container::ElementaryType as E;

fn capacity(ty: Ty) -> u16 {
    ty.capacity().unwrap_or(0)
}

/// Whether the strings that an operation without a string as its result reads are wide.
pub(super) fn is_wide(parts: &[Expr]) -> bool {
    parts.first().is_some_and(|part| part.ty.is_wide_text())
}

impl FunctionBuilder<'_, '_> {
    /// Pushes a reference to a value that is no scalar.
    pub(super) fn composed(&mut self, expr: &Expr) {
        match &expr.kind {
            ExprKind::Load(place) => self.reference(place),
            ExprKind::Const(text @ (Const::Str(_) | Const::WStr(_))) => {
                let offset = self.b.literal(text, expr.ty);
                self.push_address(BytePlace::Data, offset, expr.ty);
            }
            ExprKind::Call(call) => self.call_value(call, expr.ty),
            ExprKind::Enabled(enabled) => self.enabled_value(enabled, expr),
            ExprKind::Text(op, parts) => {
                let offset = self.temporary(expr.ty);
                self.push_address(BytePlace::Frame, offset, expr.ty);
                self.text_operation(*op, parts, expr.ty);
                self.push_address(BytePlace::Frame, offset, expr.ty);
            }
            ExprKind::Select(parts) => {
                let [condition, a, b] = parts.as_ref();
                self.choose(condition, &[a, b], expr.ty);
            }
            ExprKind::Mux(parts) => {
                if let Some((selector, inputs)) = parts.split_first() {
                    let inputs: Vec<&Expr> = inputs.iter().collect();
                    self.choose(selector, &inputs, expr.ty);
                }
            }
            ExprKind::Binary(op, a, b) => self.extreme(*op, a, b, expr.ty),
            ExprKind::Keep(value) => {
                let offset = self.temporary(expr.ty);
                self.push_address(BytePlace::Frame, offset, expr.ty);
                self.assign_text_from(value, expr.ty);
                self.push_address(BytePlace::Frame, offset, expr.ty);
                self.kept.push(Kept::Frame(offset));
            }
            ExprKind::Kept => {
                if let Some(Kept::Frame(offset)) = self.kept.pop() {
                    self.push_address(BytePlace::Frame, offset, expr.ty);
                }
            }
            _ => {
                let offset = self.temporary(expr.ty);
                self.push_address(BytePlace::Frame, offset, expr.ty);
            }
        }
    }

    /// SEL and MUX of strings: all inputs are evaluated, the chosen one is copied.
    fn choose(&mut self, selector: &Expr, inputs: &[&Expr], ty: Ty) {
        self.value(selector);
        let last = i32::try_from(inputs.len().saturating_sub(1)).unwrap_or(i32::MAX);
        self.i32_const(last);
        self.numeric(N::I32MinU);
        let slot = self.scratch(Storage::I32);
        self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
        let offset = self.temporary(ty);
        for (at, input) in (0i32..).zip(inputs) {
            let copy = self.temporary(ty);
            self.push_address(BytePlace::Frame, copy, ty);
            self.assign_text_from(input, ty);
            let skip = self.e.label();
            self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
            self.i32_const(at);
            self.numeric(N::I32Eq);
            self.e.push(I::JumpUnless { target: skip }, 1, 0);
            self.push_address(BytePlace::Frame, offset, ty);
            self.push_address(BytePlace::Frame, copy, ty);
            self.copy_text(ty, ty);
            self.e.bind(skip);
        }
        self.release(slot);
        self.push_address(BytePlace::Frame, offset, ty);
    }

    /// MIN and MAX of strings.
    fn extreme(&mut self, op: BinOp, a: &Expr, b: &Expr, ty: Ty) {
        let (first, second) = (self.temporary(ty), self.temporary(ty));
        self.push_address(BytePlace::Frame, first, ty);
        self.assign_text_from(a, ty);
        self.push_address(BytePlace::Frame, second, ty);
        self.assign_text_from(b, ty);
        let keep = self.e.label();
        self.push_address(BytePlace::Frame, second, ty);
        self.push_address(BytePlace::Frame, first, ty);
        self.compare_text(ty, ty);
        self.i32_const(0);
        self.numeric(if op == BinOp::Max { N::I32GtS } else { N::I32LtS });
        self.e.push(I::JumpUnless { target: keep }, 1, 0);
        self.push_address(BytePlace::Frame, first, ty);
        self.push_address(BytePlace::Frame, second, ty);
        self.copy_text(ty, ty);
        self.e.bind(keep);
        self.push_address(BytePlace::Frame, first, ty);
    }

    /// Copies the string on the stack into the one below it.
    fn copy_text(&mut self, to: Ty, from: Ty) {
        let op = if to.is_wide_text() { H::WideAssign } else { H::StringAssign };
        self.helper(op, &[capacity(to), capacity(from)]);
    }

    /// Leaves -1, 0 or 1 for the two strings on the stack.
    fn compare_text(&mut self, a: Ty, b: Ty) {
        let op = if a.is_wide_text() { H::WideCompare } else { H::StringCompare };
        self.helper(op, &[capacity(a), capacity(b)]);
    }

    fn helper(&mut self, op: H, capacities: &[u16]) {
        let mut list = [0; MAX_CAPACITIES];
        for (to, from) in list.iter_mut().zip(capacities) {
            *to = *from;
        }
        let pops = u32::try_from(op.operands().len()).unwrap_or(0);
        let pushes = u32::from(op.result().is_some());
        self.e.push(I::Helper(op, list), pops, pushes);
    }

    /// Pushes operands and calls a helper; `destination` is the capacity of the string whose reference is on the stack already.
    pub(super) fn text_helper(&mut self, op: H, parts: &[Expr], destination: Option<u16>) {
        let mut capacities: Vec<u16> = destination.into_iter().collect();
        for part in parts {
            self.value(part);
            capacities.extend(part.ty.capacity());
        }
        self.helper(op, &capacities);
    }

    /// An operation whose result goes to the string on the stack.
    fn text_operation(&mut self, op: TextOp, parts: &[Expr], ty: Ty) {
        let to = Some(capacity(ty));
        if let Some(row) = ops::text(op, ty.is_wide_text()) {
            self.text_helper(row, parts, to);
            return;
        }
        let (TextOp::From, Some(value)) = (op, parts.first()) else { return };
        let from = self.elementary(value.ty);
        self.value(value);
        let helper = match from {
            E::Bool => H::StringFromBool,
            E::Real => H::StringFromF32,
            E::Lreal => H::StringFromF64,
            _ if is_duration(from) => H::StringFromTime,
            _ if is_date(from) => H::StringFromDate,
            _ if is_time_of_day(from) => H::StringFromTod,
            _ if is_date_and_time(from) => H::StringFromDt,
            _ if is_signed(from) => {
                self.convert(from, E::Lint, false);
                H::StringFromI64
            }
            _ => {
                self.convert(from, E::Ulint, false);
                H::StringFromU64
            }
        };
        debug_assert!(!is_real(from) || matches!(helper, H::StringFromF32 | H::StringFromF64));
        self.helper(helper, &[capacity(ty)]);
    }

    /// Stores a string into the one whose reference is on the stack.
    pub(super) fn assign_text_from(&mut self, value: &Expr, ty: Ty) {
        self.value(value);
        self.copy_text(ty, value.ty);
    }

    /// `target := value` of strings.
    pub(super) fn assign_text(&mut self, target: &Place, value: &Expr) {
        self.reference(target);
        match &value.kind {
            // Straight into the target where that cuts no sooner than the operation itself: it reads all operands before it writes.
            ExprKind::Text(op, parts) if capacity(value.ty) >= capacity(target.ty) || parts.iter().all(is_apart) => {
                self.text_operation(*op, parts, target.ty);
            }
            _ => self.assign_text_from(value, target.ty),
        }
    }

    /// Leaves the first character of a string: 0, its terminator, of an empty one.
    pub(super) fn first_character(&mut self, parts: &[Expr], ty: E) {
        let [text] = parts else { return };
        self.value(text);
        self.i32_const(1);
        let array = self.b.character_array(text.ty);
        self.e.push(I::RefIndex { array }, 2, 1);
        self.e.push(I::RefLoad { storage: ty.storage() }, 1, 1);
    }

    /// Makes a CHAR of the WCHAR on the stack: `?` where Latin-1 has none.
    pub(super) fn narrow_character(&mut self) {
        let slot = self.scratch(Storage::I32);
        let local = SlotPlace::Local;
        self.e.push(I::SlotStore { place: local, index: slot }, 1, 0);
        self.e.push(I::SlotLoad { place: local, index: slot }, 0, 1);
        self.i32_const(i32::from(NO_LATIN_1));
        self.e.push(I::SlotLoad { place: local, index: slot }, 0, 1);
        self.i32_const(256);
        self.numeric(N::I32LtU);
        self.e.push(I::Select {}, 3, 1);
        self.release(slot);
    }

    /// Compares strings.
    pub(super) fn text_compare(&mut self, op: BinOp, a: &Expr, b: &Expr) {
        self.value(a);
        self.value(b);
        self.compare_text(a.ty, b.ty);
        self.i32_const(0);
        if let Some(op) = ops::binary(op, E::Dint) {
            self.numeric(op);
        }
    }
}

/// Whether an operand is surely not the target: a literal, a number known when the program is compiled, or an operation on such.
fn is_apart(part: &Expr) -> bool {
    match &part.kind {
        ExprKind::Const(_) => true,
        ExprKind::Text(_, parts) => parts.iter().all(is_apart),
        _ => false,
    }
}
