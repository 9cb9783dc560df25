//! Statements: code that leaves the stack as it was.

use khz_bytecode::container::ForLoop;
use khz_bytecode::ids::{ForId, SlotIndex, TypeId};
use khz_bytecode::instruction::{HelperOp, Instruction, NumericOp};
use khz_bytecode::value::{IntegerType, LocalType, SlotPlace, Storage, ValueType};

use super::body::{Around, Body, Variable};
use super::world::World;

/// Loops in loops that the generator writes.
const DEEPEST_NESTING: usize = 3;

impl Body<'_> {
    /// One statement, or a few.
    pub fn statement(&mut self, depth: usize) {
        let nested = usize::from(depth > 0 && self.left > 0);
        let loops = nested * usize::from(self.around.len() < DEEPEST_NESTING);
        match self.world.random.weighted(&[
            26,
            12,
            6,
            10,
            2,
            4,
            8,
            10 * nested,
            4 * nested,
            7 * loops,
            7 * loops,
            4,
            2,
            1,
            8,
        ]) {
            0 => self.assignment(depth),
            1 => self.store_through(depth),
            2 => self.copy(depth),
            3 => self.text_statement(depth),
            4 => self.store_bit(depth),
            5 => self.reassign(depth),
            6 => self.call_statement(depth.min(2)),
            7 => self.choice(depth - 1),
            8 => self.switch(depth - 1),
            9 => self.for_loop(depth - 1),
            10 => self.counted_loop(depth - 1),
            11 => self.leave(depth),
            12 => {
                let ty = self.any_value_type();
                self.expression(ty, depth.min(2));
                self.put(Instruction::Drop {});
            }
            13 => self.put(Instruction::Nop {}),
            _ => self.idiom(),
        }
    }

    fn statements(&mut self, depth: usize) {
        (0..=self.world.random.below(2)).for_each(|_| self.statement(depth));
    }

    fn assignment(&mut self, depth: usize) {
        let ty = self.any_value_type();
        let variable = self.variable(ty, true);
        self.expression(ty, depth + 1);
        self.put(variable.store());
    }

    fn store_through(&mut self, depth: usize) {
        let storage = Storage::ALL[self.world.random.below(Storage::ALL.len())];
        self.reference(World::scalar(storage), true, false, depth + 1);
        self.waiting += 1;
        self.expression(storage.value_type(), depth.min(2));
        self.waiting -= 1;
        self.put(Instruction::RefStore { storage });
    }

    fn copy(&mut self, depth: usize) {
        let target = TypeId(self.world.random.below(self.world.extents.len()) as u16);
        self.reference(target, true, false, depth.min(2));
        self.waiting += 1;
        self.reference(target, false, false, depth.min(2));
        self.waiting -= 1;
        self.put(Instruction::Copy { target });
    }

    fn text_statement(&mut self, depth: usize) {
        let rows: Vec<HelperOp> = HelperOp::ALL.iter().copied().filter(|op| op.result().is_none()).collect();
        let op = rows[self.world.random.below(rows.len())];
        self.helper(op, depth.min(2));
    }

    fn store_bit(&mut self, depth: usize) {
        let Some((place, offset)) = self.image_place(1, true) else { return self.put(Instruction::Nop {}) };
        let bit = self.world.random.below(8) as u8;
        self.expression(ValueType::I32, depth.min(2));
        self.put(Instruction::StoreBit { place, offset, bit });
    }

    /// Gives a reference local another target.
    fn reassign(&mut self, depth: usize) {
        let Some((index, ty)) = self.world.random.pick(&self.references).copied() else {
            return self.assignment(depth);
        };
        self.reference(ty.target, ty.write, !ty.image, depth.min(2));
        self.put(Instruction::SlotStore { place: SlotPlace::Local, index });
    }

    fn choice(&mut self, depth: usize) {
        let (other, end) = (self.code.label(), self.code.label());
        self.expression(ValueType::I32, depth.min(2));
        let jump = if self.world.random.chance(60) {
            Instruction::JumpUnless { target: other }
        } else {
            Instruction::JumpIf { target: other }
        };
        self.put(jump);
        self.statements(depth);
        if self.world.random.chance(50) {
            self.put(Instruction::Jump { target: end });
            self.code.bind(other);
            self.statements(depth);
        } else {
            self.code.bind(other);
        }
        self.code.bind(end);
    }

    fn switch(&mut self, depth: usize) {
        let arms: Vec<_> = (0..self.world.random.between(1, 4)).map(|_| self.code.label()).collect();
        let end = self.code.label();
        let mut targets = arms.clone();
        // Some values share an arm; the last target takes the rest.
        targets.extend((0..self.world.random.below(3)).map(|_| arms[self.world.random.below(arms.len())]));
        targets.push(end);
        if self.world.random.chance(70) {
            self.expression(ValueType::I32, depth.min(2));
            self.integer(ValueType::I32, targets.len() as i64 + 1);
            self.put(Instruction::Numeric(NumericOp::I32RemU));
        } else {
            self.expression(ValueType::I32, depth.min(2));
        }
        self.put(Instruction::Switch { targets });
        for arm in arms {
            self.code.bind(arm);
            self.statements(depth);
            self.put(Instruction::Jump { target: end });
        }
        self.code.bind(end);
    }

    /// Leaves a loop, begins its next pass, or returns; each under a condition.
    fn leave(&mut self, depth: usize) {
        let reachable: Vec<Around> =
            self.around.iter().copied().filter(|around| around.waiting == self.waiting).collect();
        if let Some(around) = self.world.random.pick(&reachable).copied().filter(|_| self.world.random.chance(80)) {
            self.expression(ValueType::I32, depth.min(2));
            let target = if self.world.random.chance(60) { around.exit } else { around.next };
            let jump = if self.world.random.chance(60) {
                Instruction::JumpIf { target }
            } else {
                Instruction::JumpUnless { target }
            };
            return self.put(jump);
        }
        if self.waiting > 0 {
            return self.assignment(depth);
        }
        let on = self.code.label();
        self.expression(ValueType::I32, depth.min(2));
        self.put(Instruction::JumpIf { target: on });
        for result in self.function.results.clone() {
            self.held(result, 1);
        }
        self.waiting = 0;
        self.put(Instruction::Return {});
        self.code.bind(on);
    }

    fn body(&mut self, around: Around, depth: usize) {
        self.around.push(around);
        if self.world.random.chance(20) {
            self.put(Instruction::Nop {});
        }
        self.statements(depth);
        self.around.pop();
    }

    /// A loop that counts its passes in a local of its own; seldom one that does not.
    fn counted_loop(&mut self, depth: usize) {
        let (header, exit) = (self.code.label(), self.code.label());
        let counter = self.local(LocalType::Scalar(Storage::I32));
        let variable = Variable::Slot(SlotPlace::Local, counter);
        let passes = self.world.random.between(0, 5);
        let is_counted = self.world.random.chance(92);
        let around = Around { exit, next: header, waiting: self.waiting };
        self.integer(ValueType::I32, 0);
        self.put(variable.store());
        self.code.bind(header);
        let tests_first = self.world.random.chance(50);
        let count = |body: &mut Self| {
            body.put(variable.load());
            body.integer(ValueType::I32, 1);
            body.put(Instruction::Numeric(NumericOp::I32Add));
            body.put(Instruction::Dup {});
            body.put(variable.store());
            body.integer(ValueType::I32, passes);
            body.put(Instruction::Numeric(NumericOp::I32GtS));
        };
        self.counters.push(counter);
        if tests_first {
            if is_counted {
                count(self);
            } else {
                self.expression(ValueType::I32, 2);
            }
            self.put(Instruction::JumpIf { target: exit });
            self.body(around, depth);
            self.put(Instruction::Jump { target: header });
        } else {
            let next = self.code.label();
            self.body(Around { next, ..around }, depth);
            self.code.bind(next);
            if is_counted {
                count(self);
            } else {
                self.expression(ValueType::I32, 2);
            }
            self.put(Instruction::JumpUnless { target: header });
        }
        self.code.bind(exit);
    }

    fn for_loop(&mut self, depth: usize) {
        let ty = IntegerType::ALL[self.world.random.below(IntegerType::ALL.len())];
        let own = self.world.random.chance(65);
        let anywhere = if own { None } else { self.variable_of(ty.storage(), true) };
        let (control, counter) = anywhere.map_or_else(
            || {
                let index = self.local(LocalType::Scalar(ty.storage()));
                (Variable::Slot(SlotPlace::Local, index), Some(index))
            },
            |variable| (variable, None),
        );
        let keeper = match ty.value_type() {
            ValueType::I64 => LocalType::Scalar(Storage::I64),
            _ => LocalType::Scalar(Storage::I32),
        };
        let (bound, step): (SlotIndex, SlotIndex) = (self.local(keeper), self.local(keeper));
        let id = ForId(self.function.for_loops.len() as u16);
        self.function.for_loops.push(ForLoop { control: control.control(), ty, bound, step });
        let (header, next, exit) = (self.code.label(), self.code.label(), self.code.label());
        self.for_bounds(ty);
        self.put(Instruction::ForEnter { id, exit });
        self.code.bind(header);
        let written = counter.filter(|_| self.world.random.chance(8));
        self.counters.extend(counter);
        self.scalars.extend(written);
        self.body(Around { exit, next, waiting: self.waiting }, depth);
        if written.is_some() {
            self.scalars.pop();
        }
        self.code.bind(next);
        self.put(Instruction::ForNext { id, header });
        self.code.bind(exit);
    }

    /// Initial value, bound and step: mostly a few passes somewhere in the type's range, its ends among them.
    fn for_bounds(&mut self, ty: IntegerType) {
        let value = ty.value_type();
        if self.world.random.chance(12) {
            (0..3).for_each(|_| self.held(value, 1));
            self.waiting -= 3;
            return;
        }
        let width = ty.storage().bytes() * 8;
        let ends: (i128, i128) =
            if ty.is_signed() { (-(1 << (width - 1)), (1 << (width - 1)) - 1) } else { (0, (1 << width) - 1) };
        let size = match self.world.random.below(6) {
            0 => (ends.1 - ends.0) / 3,
            1 => 7,
            _ => 1,
        };
        let step = if self.world.random.chance(50) { size } else { -size };
        let first = match self.world.random.below(5) {
            0 => ends.0 + i128::from(self.world.random.between(0, 4)),
            1 => ends.1 - i128::from(self.world.random.between(0, 4)),
            _ => i128::from(self.world.random.between(0, 6)),
        };
        let last = (first + step * i128::from(self.world.random.between(-1, 4))).clamp(ends.0, ends.1);
        let first = first.clamp(ends.0, ends.1);
        // A narrow unsigned value stands zero-extended on the stack, as its variable would load it.
        self.bound(ty, first as i64);
        self.waiting += 1;
        self.bound(ty, last as i64);
        self.waiting += 1;
        let step = if self.world.random.chance(3) { 0 } else { step as i64 };
        self.bound(ty, step);
        self.waiting -= 2;
    }

    /// A number as a constant, or as one that only comes out at run time.
    fn bound(&mut self, ty: IntegerType, value: i64) {
        let width = ty.value_type();
        self.integer(width, value);
        if self.world.random.chance(25) {
            self.leaf(width);
            self.integer(width, 0);
            let wide = width == ValueType::I64;
            let (and, or) =
                if wide { (NumericOp::I64And, NumericOp::I64Or) } else { (NumericOp::I32And, NumericOp::I32Or) };
            self.put(Instruction::Numeric(and));
            self.put(Instruction::Numeric(or));
        }
    }
}
