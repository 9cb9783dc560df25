//! Byte order, binary coded decimals and validity: no instruction of their own, but a few of the usual ones each, without a branch or a loop.

use khz_bytecode::container::ElementaryType as E;
use khz_bytecode::ids::SlotIndex;
use khz_bytecode::instruction::{Instruction as I, NumericOp as N};
use khz_bytecode::value::{SlotPlace, Storage, ValueType};

use super::body::FunctionBuilder;
use crate::analysis::ops;
use crate::analysis::tree::BinOp;
use crate::analysis::types::Const;

/// A number whose groups of `each` bits hold `group`, from the lowest bit on.
fn mask(each: u32, group: u64) -> u64 {
    (0..64 / each).fold(0, |all, at| all | group << (at * each))
}

impl FunctionBuilder<'_, '_> {
    fn is_wide(ty: E) -> bool {
        ty.storage().value_type() == ValueType::I64
    }

    /// Takes the value on the stack into a slot, from which it is read several times.
    fn hold(&mut self, ty: E) -> SlotIndex {
        let slot = self.scratch(if Self::is_wide(ty) { Storage::I64 } else { Storage::I32 });
        self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
        slot
    }

    fn held(&mut self, slot: SlotIndex) {
        self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
    }

    /// The stack's value and a constant, of which a narrow operation takes the low half.
    fn with(&mut self, op: BinOp, ty: E, constant: u64) {
        let register = if Self::is_wide(ty) { E::Ulint } else { E::Udint };
        let by_count = matches!(op, BinOp::Shl | BinOp::Shr | BinOp::Rol | BinOp::Ror);
        let of = if by_count { E::Dint } else { register };
        self.constant(&Const::Int(constant.cast_signed()), of);
        if let Some(op) = ops::binary(op, register) {
            self.numeric(op);
        }
    }

    fn both(&mut self, op: BinOp, ty: E) {
        let register = if Self::is_wide(ty) { E::Ulint } else { E::Udint };
        if let Some(op) = ops::binary(op, register) {
            self.numeric(op);
        }
    }

    /// The value with neighbouring groups of `bits` bits exchanged.
    fn exchange(&mut self, ty: E, bits: u32) {
        let low = mask(2 * bits, (1 << bits) - 1);
        let slot = self.hold(ty);
        self.held(slot);
        self.with(BinOp::Shr, ty, u64::from(bits));
        self.with(BinOp::And, ty, low);
        self.held(slot);
        self.with(BinOp::And, ty, low);
        self.with(BinOp::Shl, ty, u64::from(bits));
        self.both(BinOp::Or, ty);
        self.release(slot);
    }

    /// The bytes in reverse order.
    pub(super) fn swap_bytes(&mut self, ty: E) {
        match ty.storage().bytes() {
            2 => {
                self.i32_const(8);
                self.numeric(N::I32Rotl16);
                self.wrap(ty);
            }
            4 => {
                self.exchange(ty, 8);
                self.with(BinOp::Rol, ty, 16);
            }
            8 => {
                self.exchange(ty, 8);
                self.exchange(ty, 16);
                self.with(BinOp::Rol, ty, 32);
            }
            _ => {}
        }
    }

    /// Digits to a number: each group of bits holds a number, of which two make one of twice the width. A group of value `16^n * a + b` becomes
    /// `10^n * a + b`: what is too much in it is `(16^n - 10^n) * a`.
    pub(super) fn digits_to_number(&mut self, ty: E) {
        let mut bits = 4;
        while bits < ty.storage().bytes() * 8 {
            let digits = bits / 4;
            let slot = self.hold(ty);
            self.held(slot);
            self.held(slot);
            self.with(BinOp::Shr, ty, u64::from(bits));
            self.with(BinOp::And, ty, mask(2 * bits, (1 << bits) - 1));
            self.with(BinOp::Mul, ty, (1 << bits) - 10u64.pow(digits));
            self.both(BinOp::Sub, ty);
            self.release(slot);
            bits *= 2;
        }
    }

    /// A number to digits: digit i, which is `n / 10^i - 10 * (n / 10^(i+1))`, stands at `16^i`; summed up, that is n and
    /// `6 * 16^(i-1) * (n / 10^i)` for each i from 1 on.
    pub(super) fn number_to_digits(&mut self, ty: E) {
        let slot = self.hold(ty);
        self.held(slot);
        for digit in 1..ty.storage().bytes() * 2 {
            self.held(slot);
            self.with(BinOp::Div, ty, 10u64.pow(digit));
            self.with(BinOp::Mul, ty, 6 << (4 * (digit - 1)));
            self.both(BinOp::Add, ty);
        }
        self.release(slot);
    }

    /// Whether a float is a number: its absolute value is at most the largest one; a NaN is not.
    pub(super) fn is_valid(&mut self, ty: E) {
        if ty == E::Real {
            self.numeric(N::F32Abs);
            self.constant(&Const::F32(f32::MAX), ty);
            self.numeric(N::F32Le);
        } else {
            self.numeric(N::F64Abs);
            self.constant(&Const::F64(f64::MAX), ty);
            self.numeric(N::F64Le);
        }
    }

    /// Whether no digit has 8 and one of 4 and 2 in it.
    pub(super) fn is_valid_bcd(&mut self, ty: E) {
        let slot = self.hold(ty);
        self.held(slot);
        self.with(BinOp::Shl, ty, 1);
        self.held(slot);
        self.with(BinOp::Shl, ty, 2);
        self.both(BinOp::Or, ty);
        self.held(slot);
        self.both(BinOp::And, ty);
        self.with(BinOp::And, ty, mask(4, 8) & (u64::MAX >> (64 - ty.storage().bytes() * 8)));
        self.numeric(if Self::is_wide(ty) { N::I64Eqz } else { N::I32Eqz });
        self.release(slot);
    }
}
