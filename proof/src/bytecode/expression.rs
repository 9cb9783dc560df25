//! Expressions: code that leaves one value of a type on the stack.

use khz_bytecode::container::Type;
use khz_bytecode::ids::TypeId;
use khz_bytecode::instruction::{HelperOp, HelperOperand, Instruction, MAX_CAPACITIES, NumericOp};
use khz_bytecode::value::{IntegerType, Storage, ValueType};

use super::body::Body;
use super::world::World;

impl Body<'_> {
    /// A constant or variable.
    pub fn leaf(&mut self, ty: ValueType) {
        if self.world.random.chance(35) {
            let bits = self.world.random.value_bits(ty);
            return self.constant_bits(ty, bits);
        }
        if ty == ValueType::I32
            && self.world.random.chance(10)
            && let Some((place, offset)) = self.image_place(1, false)
        {
            let bit = self.world.random.below(8) as u8;
            return self.put(Instruction::LoadBit { place, offset, bit });
        }
        let variable = self.variable(ty, false);
        self.put(variable.load());
    }

    /// A value of a type.
    pub fn expression(&mut self, ty: ValueType, depth: usize) {
        if depth == 0 || self.left == 0 || self.world.random.chance(15) {
            return self.leaf(ty);
        }
        match self.world.random.weighted(&[55, 5, 4, 4, 4, 12, 6, 5, 5, 3]) {
            0 => self.numeric(ty, depth),
            1 => {
                (0..2).for_each(|_| self.held(ty, depth - 1));
                self.expression(ValueType::I32, depth - 1);
                self.waiting -= 2;
                self.put(Instruction::Select {});
            }
            2 => self.conditional(ty, depth),
            3 => self.checked(ty, depth),
            4 => {
                self.held(ty, depth - 1);
                self.statement(depth - 1);
                self.waiting -= 1;
            }
            5 => self.loaded(ty, depth),
            6 => self.called(ty, depth),
            7 => self.text_value(ty, depth),
            8 if ty == ValueType::I64 => {
                let target = TypeId(self.world.random.below(self.world.extents.len()) as u16);
                self.reference(target, false, false, depth - 1);
                self.put(Instruction::RefToInt {});
            }
            8 => self.numeric(ty, depth),
            _ => self.doubled(ty, depth),
        }
    }

    /// An expression whose value waits on the stack.
    pub fn held(&mut self, ty: ValueType, depth: usize) {
        self.expression(ty, depth);
        self.waiting += 1;
    }

    fn numeric(&mut self, ty: ValueType, depth: usize) {
        let rows: Vec<NumericOp> = NumericOp::ALL.iter().copied().filter(|op| op.result() == ty).collect();
        let op = rows[self.world.random.below(rows.len())];
        let name = op.mnemonic();
        let operands = op.operands();
        self.expression(operands[0], depth - 1);
        if let Some(second) = operands.get(1) {
            self.waiting += 1;
            let is_shift = ["shl", "shr", "rot"].iter().any(|part| name.contains(part));
            if is_shift && self.world.random.chance(60) {
                let count = self.world.random.shift_count();
                self.integer(ValueType::I32, i64::from(count));
            } else if op.trap().is_some() && self.world.random.chance(self.world.profile.care) {
                self.divisor(*second, depth - 1);
            } else {
                self.expression(*second, depth - 1);
            }
            self.waiting -= 1;
        }
        self.put(Instruction::Numeric(op));
    }

    /// An integer that is hardly 0.
    fn divisor(&mut self, ty: ValueType, depth: usize) {
        if self.world.random.chance(50) {
            let bits = self.world.random.value_bits(ty).max(1);
            return self.constant_bits(ty, bits);
        }
        self.expression(ty, depth);
        self.integer(ty, 1);
        let wide = ty == ValueType::I64;
        self.put(Instruction::Numeric(if wide { NumericOp::I64Or } else { NumericOp::I32Or }));
    }

    fn conditional(&mut self, ty: ValueType, depth: usize) {
        let (other, end) = (self.code.label(), self.code.label());
        self.expression(ValueType::I32, depth - 1);
        let unless = self.world.random.chance(50);
        self.put(if unless {
            Instruction::JumpUnless { target: other }
        } else {
            Instruction::JumpIf { target: other }
        });
        self.expression(ty, depth - 1);
        self.put(Instruction::Jump { target: end });
        self.code.bind(other);
        self.expression(ty, depth - 1);
        self.code.bind(end);
    }

    fn checked(&mut self, ty: ValueType, depth: usize) {
        self.expression(ty, depth - 1);
        let kinds: Vec<IntegerType> = IntegerType::ALL.iter().copied().filter(|kind| kind.value_type() == ty).collect();
        let Some(kind) = self.world.random.pick(&kinds).copied() else { return };
        let wide = ty == ValueType::I64;
        let full = match (wide, kind.is_signed()) {
            (false, true) => (i64::from(i32::MIN), i64::from(i32::MAX)),
            (true, true) => (i64::MIN, i64::MAX),
            // As bits: 0 to all ones.
            (_, false) => (0, -1),
        };
        let (mut lower, mut upper) = full;
        if !self.world.random.chance(self.world.profile.care) {
            let width = if wide { 64 } else { 32 };
            (lower, upper) = (self.world.random.integer(width), self.world.random.integer(width));
            let key = |value: i64| {
                if kind.is_signed() {
                    i128::from(value)
                } else if wide {
                    i128::from(value as u64)
                } else {
                    i128::from(value as u32)
                }
            };
            if key(lower) > key(upper) {
                (lower, upper) = (upper, lower);
            }
        } else if self.world.random.chance(50) {
            // Cut first, then checked: the check holds.
            let op = match (wide, self.world.random.chance(50)) {
                (true, _) => NumericOp::I64Eqz,
                (false, true) => NumericOp::I32Nez,
                (false, false) => NumericOp::I32Extend8U,
            };
            self.put(Instruction::Numeric(op));
            if wide {
                self.put(Instruction::Numeric(NumericOp::I64ExtendI32U));
            }
            (lower, upper) = (0, 255);
        }
        self.put(if wide {
            Instruction::CheckI64 { kind, lower, upper }
        } else {
            Instruction::CheckI32 { kind, lower: lower as i32, upper: upper as i32 }
        });
    }

    /// A scalar through a reference.
    fn loaded(&mut self, ty: ValueType, depth: usize) {
        let storages: Vec<Storage> =
            Storage::ALL.iter().copied().filter(|storage| storage.value_type() == ty).collect();
        let storage = storages[self.world.random.below(storages.len())];
        self.reference(World::scalar(storage), false, false, depth);
        self.put(Instruction::RefLoad { storage });
    }

    /// Duplicates a value and computes with both.
    fn doubled(&mut self, ty: ValueType, depth: usize) {
        self.expression(ty, depth - 1);
        self.put(Instruction::Dup {});
        self.binary(ty);
    }

    fn text_value(&mut self, ty: ValueType, depth: usize) {
        let rows: Vec<HelperOp> = HelperOp::ALL.iter().copied().filter(|op| op.result() == Some(ty)).collect();
        match self.world.random.pick(&rows).copied() {
            Some(op) => self.helper(op, depth),
            None => self.leaf(ty),
        }
    }

    /// A string instruction with its operands.
    pub fn helper(&mut self, op: HelperOp, depth: usize) {
        let depth = depth.saturating_sub(1);
        let strings: Vec<(TypeId, u16, bool)> = (self.world.container.types.types.iter().enumerate())
            .filter_map(|(at, ty)| match ty {
                Type::String { capacity } => Some((TypeId(at as u16), *capacity, false)),
                Type::WideString { capacity } => Some((TypeId(at as u16), *capacity, true)),
                _ => None,
            })
            .collect();
        let mut capacities = [0; MAX_CAPACITIES];
        let mut count = 0;
        let before = self.waiting;
        for operand in op.operands() {
            match operand {
                HelperOperand::Value(ValueType::I32) if self.world.random.chance(60) => {
                    let number = self.world.random.between(-2, 12);
                    self.integer(ValueType::I32, number);
                }
                HelperOperand::Value(ty) => self.expression(*ty, depth),
                string => {
                    let fitting: Vec<_> = strings.iter().filter(|(.., wide)| *wide == string.is_wide()).collect();
                    let (ty, capacity, _) = *fitting[self.world.random.below(fitting.len())];
                    self.reference(ty, string.is_destination(), false, depth);
                    capacities[count] = capacity;
                    count += 1;
                }
            }
            self.waiting += 1;
        }
        self.waiting = before;
        self.put(Instruction::Helper(op, capacities));
    }
}
