//! Numbers: numeric rows, constants, range checks, string helpers.

use khz_bytecode::canary::{Fault, planted};
use khz_bytecode::container::Constant;
use khz_bytecode::ids::ConstantId;
use khz_bytecode::instruction::{HelperOp, MAX_CAPACITIES, NumericOp};
use khz_bytecode::value::{IntegerType, Storage, ValueType};

use super::Translator;
use super::stack::Pending;
use crate::register_form::{
    Code, Operation, RangeCheck, access_codes, branch_codes, element_operand_code, helper_number, numeric_code,
    numeric_const_code,
};

/// The operation that wraps a value as a store to an `L` slot of this storage and a load from it would; none where that changes nothing.
pub(super) fn wrap_code(storage: Storage) -> Option<Code> {
    match storage {
        Storage::Bool => Some(Code::I32Nez),
        Storage::I8 => Some(Code::I32Extend8S),
        Storage::U8 => Some(Code::I32Extend8U),
        Storage::I16 => Some(Code::I32Extend16S),
        Storage::U16 => Some(Code::I32Extend16U),
        Storage::I32 | Storage::I64 | Storage::F32 | Storage::F64 => None,
    }
}

/// A constant as a store to an `L` slot of this storage and a load from it would leave it.
pub(super) fn wrap_constant(storage: Storage, bits: u64) -> u64 {
    let signed = |value: i32| u64::from(value as u32);
    match storage {
        Storage::Bool => u64::from(bits as u32 != 0),
        Storage::I8 => signed(i32::from(bits as i8)),
        Storage::U8 => u64::from(bits as u8),
        Storage::I16 => signed(i32::from(bits as i16)),
        Storage::U16 => u64::from(bits as u16),
        Storage::I32 | Storage::I64 | Storage::F32 | Storage::F64 => bits,
    }
}

/// Whether the result of an operation is already as [`wrap_code`] would make it.
pub(super) fn is_wrapped(code: Code, storage: Storage) -> bool {
    let load = access_codes(storage).load;
    let by_load =
        [load.image, load.based, load.element, load.element_based, load.plane, load.plane_based].contains(&code);
    let is_bool = matches!(code, Code::I32Eqz | Code::I32Nez | Code::I64Eqz | Code::I64Nez | Code::LoadBit);
    let by_type = storage == Storage::Bool && (is_bool || branch_codes(code).is_some());
    by_load || by_type || wrap_code(storage) == Some(code)
}

/// Whether the operands may change places.
fn is_commutative(op: NumericOp) -> bool {
    use NumericOp::{
        I32Add, I32And, I32Eq, I32Mul, I32Ne, I32Or, I32Xor, I64Add, I64And, I64Eq, I64Mul, I64Ne, I64Or, I64Xor,
    };
    matches!(
        op,
        I32Add
            | I32And
            | I32Eq
            | I32Mul
            | I32Ne
            | I32Or
            | I32Xor
            | I64Add
            | I64And
            | I64Eq
            | I64Mul
            | I64Ne
            | I64Or
            | I64Xor
    )
}

impl Translator<'_> {
    pub(super) fn constant(&mut self, id: ConstantId) {
        let bits = match self.verified.container().constants[id.index()] {
            Constant::I64(value) => value as u64,
            Constant::F32(bits) => u64::from(bits),
            Constant::F64(bits) => bits,
        };
        self.push(Pending::Constant(bits));
    }

    pub(super) fn numeric(&mut self, op: NumericOp) {
        if op.trap().is_some() {
            self.settle_elements();
        }
        let (mut last, mut last_own) = self.pop();
        let mut first = None;
        let mut first_own = 0;
        if op.operands().len() == 2 {
            let (mut entry, mut own) = self.pop();
            if is_commutative(op) && matches!(entry.value, Pending::Constant(_)) {
                (entry, last, own, last_own) = (last, entry, last_own, own);
            }
            first = Some(self.in_register(&entry.value, own));
            first_own = own;
        }
        let dst = self.next_register();
        if let Some(a) = first
            && let Some(operation) = (self.with_negation(op, (a, first_own), &last.value, last_own))
                .or_else(|| self.with_product(op, (a, first_own), &last.value, last_own))
        {
            self.value(Operation { dst, ..operation });
            return self.push_result();
        }
        if let Some(a) = first
            && self.on_element(op, (a, first_own), &last.value, last_own)
        {
            return self.push_result();
        }
        let operation = match last.value {
            Pending::Constant(bits) => {
                let b = self.own_operand(op, bits);
                Operation { code: numeric_const_code(op), x: 0, dst, a: first.unwrap_or(0), b }
            }
            other => {
                let register = self.in_register(&other, last_own);
                let (a, b) = first.map_or((register, 0), |first| (first, register));
                Operation { code: numeric_code(op), x: 0, dst, a, b }
            }
        };
        self.value(operation);
        self.push_result();
    }

    /// A sum or an `OR` of which the operation just before computes one operand as a product or an `AND`: takes that back and gives the operation for both.
    /// Which operand it is does not matter: a sum of floats does not depend on their order, as there is one NaN.
    fn with_product(
        &mut self,
        op: NumericOp,
        (first, first_own): (u32, u32),
        second: &Pending,
        second_own: u32,
    ) -> Option<Operation> {
        let code_for = |product: Code| match (op, product) {
            (NumericOp::F32Add, Code::F32Mul) => Some(Code::F32MulAdd),
            (NumericOp::F64Add, Code::F64Mul) => Some(Code::F64MulAdd),
            (NumericOp::I32Or, Code::I32And) => Some(Code::OrAnd),
            (NumericOp::I32Or, Code::AndNot) => Some(Code::OrAndNot),
            _ => None,
        };
        let Pending::Register(second) = *second else { return None };
        let product = |last: Option<Operation>| last.and_then(|last| Some((last, code_for(last.code)?)));
        let (addend, (product, code)) = if second == second_own
            && let Some(product) = product(self.last_value(second))
        {
            (first, product)
        } else if first == first_own
            && let Some(product) = product(self.last_value(first))
        {
            (second, product)
        } else {
            return None;
        };
        // Another entry may be the same product, by `dup`: it is never above the operands of a sum, but may be the other operand.
        let x = i16::try_from(addend).ok().filter(|_| addend != product.dst)?;
        self.remove_last();
        Some(Operation { code, x, ..product })
    }

    /// An operation of which the load just before brings one operand from an array: the load becomes both.
    fn on_element(&mut self, op: NumericOp, (first, first_own): (u32, u32), second: &Pending, second_own: u32) -> bool {
        let Pending::Register(second) = *second else { return false };
        let (loaded, other) = if second == second_own && self.last_value(second).is_some() {
            (second, first)
        } else if first == first_own && first != second {
            (first, second)
        } else {
            return false;
        };
        let Some(load) = self.last_value(loaded).filter(|load| load.x == 0) else { return false };
        let Some((code, commutes)) = element_operand_code(numeric_code(op), load.code) else { return false };
        let Ok(x) = i16::try_from(other) else { return false };
        if other == loaded || (loaded != second && !commutes) {
            return false;
        }
        let dst = self.next_register();
        self.replace_last(Operation { code, x, dst, ..load });
        true
    }

    /// `AND` or `OR` of which the operation just before negates one operand: takes that back and gives the operation for both.
    fn with_negation(
        &mut self,
        op: NumericOp,
        (first, first_own): (u32, u32),
        second: &Pending,
        second_own: u32,
    ) -> Option<Operation> {
        let code = match op {
            NumericOp::I32And => Code::AndNot,
            NumericOp::I32Or => Code::OrNot,
            _ => return None,
        };
        let Pending::Register(second) = *second else { return None };
        let negation = |last: Option<Operation>| last.filter(|last| last.code == Code::I32Eqz).map(|last| last.a);
        let (a, b) = if second == second_own
            && let Some(b) = negation(self.last_value(second))
        {
            (first, b)
        } else if first == first_own
            && first != second
            && let Some(b) = negation(self.last_value(first))
        {
            (second, b)
        } else {
            return None;
        };
        self.remove_last();
        Some(Operation { code, x: 0, dst: 0, a, b })
    }

    /// The last operand of a numeric row as the operation itself carries it.
    fn own_operand(&mut self, op: NumericOp, bits: u64) -> u32 {
        match op.operands().last() {
            Some(ValueType::I64 | ValueType::F64) => self.constant_number(bits),
            _ => {
                let goes_round = matches!(op, NumericOp::I32Rotl16 | NumericOp::I32Rotr16) && bits as u32 >= 16;
                (bits as u32).wrapping_add(u32::from(planted(Fault::Interp) && goes_round))
            }
        }
    }

    pub(super) fn check_range(&mut self, kind: IntegerType, lower: i64, upper: i64) {
        self.settle_elements();
        let (entry, own) = self.pop();
        let a = self.in_register(&entry.value, own);
        let range = RangeCheck { kind, lower, upper };
        let b = self.program.ranges.len() as u32;
        self.program.ranges.push(range);
        self.effect(Operation { code: Code::CheckRange, x: 0, dst: 0, a, b });
        self.push(Pending::Register(a));
    }

    pub(super) fn helper(&mut self, op: HelperOp, capacities: [u16; MAX_CAPACITIES]) {
        self.settle_elements();
        let first = self.stack.len() - op.operands().len();
        for depth in first..self.stack.len() {
            self.settle(depth);
        }
        self.stack.truncate(first);
        let dst = self.next_register();
        let b = self.program.capacities.len() as u32;
        self.program.capacities.push(capacities);
        self.effect(Operation { code: Code::Helper, x: helper_number(op), dst, a: dst, b });
        if op.result().is_some() {
            self.push_result();
        }
    }
}
