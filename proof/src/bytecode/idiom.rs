//! What compilers write over and over: loops over arrays, short choices, guards that repeat. Native code has a pass for each of these shapes, and
//! statements put together at random hardly ever have them.

use khz_bytecode::container::{ForLoop, Type};
use khz_bytecode::ids::{ArrayId, ForId, SlotIndex, TypeId};
use khz_bytecode::instruction::{Instruction, NumericOp};
use khz_bytecode::value::{IntegerType, LocalType, SlotPlace, Storage, ValueType};

use super::body::{Body, Place};

/// Passes of an inner loop of a sweep over one array in two dimensions.
const ROW: i64 = 4;

/// An array of scalars in one dimension, and where one lies.
#[derive(Debug, Clone, Copy)]
struct Row {
    place: Place,
    array: ArrayId,
    storage: Storage,
    lower: i64,
    upper: i64,
}

/// The loops around the body of a sweep: the inner one last.
type Controls = Vec<SlotIndex>;

impl Body<'_> {
    /// One of the shapes.
    pub fn idiom(&mut self) {
        match self.world.random.weighted(&[5, 3, 2, 3, 2]) {
            0 => self.sweep(),
            1 => self.short_choice(),
            2 => self.negation(),
            3 => self.repeated_index(),
            _ => self.repeated_divisor(),
        }
    }

    /// Arrays of scalars that may be written, of which `fits` holds.
    fn rows(&self, fits: impl Fn(Storage, i64) -> bool) -> Vec<Row> {
        let row = |place: &Place| {
            let Type::Array(array) = self.world.container.types.types[place.ty.index()] else { return None };
            let descriptor = &self.world.container.types.arrays[array.index()];
            let [(lower, upper)] = descriptor.dimensions[..] else { return None };
            let storage = *Storage::ALL.get(descriptor.element.index())?;
            let (lower, upper) = (i64::from(lower), i64::from(upper));
            (place.write && fits(storage, upper - lower + 1)).then_some(Row {
                place: *place,
                array,
                storage,
                lower,
                upper,
            })
        };
        self.places.iter().filter_map(row).collect()
    }

    fn load_local(&mut self, index: SlotIndex) {
        self.put(Instruction::SlotLoad { place: SlotPlace::Local, index });
    }

    fn store_local(&mut self, index: SlotIndex) {
        self.put(Instruction::SlotStore { place: SlotPlace::Local, index });
    }

    /// A FOR loop, or one in another, over the elements of arrays of REAL or LREAL.
    fn sweep(&mut self) {
        let is_nest = self.world.random.chance(25);
        let least = if is_nest { ROW * ROW } else { 3 };
        let rows = self.rows(|storage, count| matches!(storage, Storage::F32 | Storage::F64) && count >= least);
        let Some(first) = self.world.random.pick(&rows).copied() else { return self.short_choice() };
        let rows: Vec<Row> = rows.into_iter().filter(|row| row.storage == first.storage).collect();
        // Bounds that all of them have, but for one that is left out now and then.
        let careful = self.world.random.chance(self.world.profile.care);
        let lower = rows.iter().map(|row| row.lower).max().unwrap_or(0);
        let upper = rows.iter().map(|row| row.upper).min().unwrap_or(0);
        let common: Vec<Row> = if lower + least <= upper + 1 { rows } else { vec![first] };
        let (lower, upper) = if common.len() == 1 { (first.lower, first.upper) } else { (lower, upper) };
        let sum = self.local(LocalType::Scalar(first.storage));
        let (start, end) = if is_nest { (0, ROW - 1) } else { (lower, upper + i64::from(!careful)) };
        let control = self.local(LocalType::Scalar(Storage::I32));
        self.loop_by_ones(control, start, end, |body| {
            let mut controls = vec![control];
            if is_nest {
                if body.world.random.chance(50) {
                    let zero = body.world.random.one_of([0.0, 1.0]);
                    body.float(first.storage, zero);
                    body.store_local(sum);
                }
                let inner = body.local(LocalType::Scalar(Storage::I32));
                controls.push(inner);
                body.loop_by_ones(inner, 0, ROW - 1, |body| body.sweep_body(&common, &controls, sum));
                if body.world.random.chance(50) {
                    controls.pop();
                    body.sweep_store(&common, &controls, sum);
                }
            } else {
                body.sweep_body(&common, &controls, sum);
            }
        });
    }

    /// FOR `control` := `start` TO `end`: what it does is written by `inside`.
    fn loop_by_ones(&mut self, control: SlotIndex, start: i64, end: i64, inside: impl FnOnce(&mut Self)) {
        let keeper = LocalType::Scalar(Storage::I32);
        let (bound, step) = (self.local(keeper), self.local(keeper));
        let id = ForId(self.function.for_loops.len() as u16);
        let place = khz_bytecode::container::ControlPlace::Slot(SlotPlace::Local, control);
        self.function.for_loops.push(ForLoop { control: place, ty: IntegerType::I32, bound, step });
        let (header, exit) = (self.code.label(), self.code.label());
        for number in [start, end, 1] {
            self.integer(ValueType::I32, number);
        }
        self.put(Instruction::ForEnter { id, exit });
        self.code.bind(header);
        inside(self);
        self.put(Instruction::ForNext { id, header });
        self.code.bind(exit);
    }

    fn sweep_body(&mut self, rows: &[Row], controls: &Controls, sum: SlotIndex) {
        for _ in 0..self.world.random.between(1, 2) {
            if !self.world.random.chance(25) {
                self.sweep_store(rows, controls, sum);
                continue;
            }
            let storage = rows[0].storage;
            let (other, end) = (self.code.label(), self.code.label());
            self.lanes(rows, controls, sum, 1);
            self.lanes(rows, controls, sum, 1);
            let tests = [("f32.gt", "f64.gt"), ("f32.le", "f64.le"), ("f32.ne", "f64.ne")];
            let test = self.world.random.one_of(tests);
            self.float_op(storage, test);
            self.put(Instruction::JumpUnless { target: other });
            self.sweep_store(rows, controls, sum);
            if self.world.random.chance(50) {
                self.put(Instruction::Jump { target: end });
                self.code.bind(other);
                self.sweep_store(rows, controls, sum);
            } else {
                self.code.bind(other);
            }
            self.code.bind(end);
        }
    }

    /// Stores an element, or adds to the sum.
    fn sweep_store(&mut self, rows: &[Row], controls: &Controls, sum: SlotIndex) {
        let storage = rows[0].storage;
        if self.world.random.chance(30) {
            self.load_local(sum);
            self.lanes(rows, controls, sum, 2);
            self.float_op(storage, ("f32.add", "f64.add"));
            return self.store_local(sum);
        }
        self.element(rows, controls);
        self.lanes(rows, controls, sum, 2);
        self.put(Instruction::RefStore { storage });
    }

    /// A reference to the element of this pass in one of the arrays.
    fn element(&mut self, rows: &[Row], controls: &Controls) {
        let row = rows[self.world.random.below(rows.len())];
        self.put(Instruction::Address { place: row.place.place, offset: row.place.offset, target: row.place.ty });
        match controls[..] {
            [outer, inner] => {
                self.load_local(outer);
                self.integer(ValueType::I32, ROW);
                self.put(Instruction::Numeric(NumericOp::I32Mul));
                self.load_local(inner);
                self.put(Instruction::Numeric(NumericOp::I32Add));
                self.integer(ValueType::I32, row.lower);
                self.put(Instruction::Numeric(NumericOp::I32Add));
            }
            _ => self.load_local(controls[0]),
        }
        self.put(Instruction::RefIndex { array: row.array });
    }

    /// A float that may be another in each pass.
    fn lanes(&mut self, rows: &[Row], controls: &Controls, sum: SlotIndex, depth: usize) {
        let storage = rows[0].storage;
        match self.world.random.below(if depth == 0 { 5 } else { 9 }) {
            0 => {
                let number = self.world.random.float();
                self.float(storage, number);
            }
            1 => self.load_local(sum),
            2 => {
                self.load_local(controls[0]);
                self.float_op(storage, ("f32.convert_i32_s", "f64.convert_i32_s"));
            }
            3..=4 => {
                self.element(rows, controls);
                self.put(Instruction::RefLoad { storage });
            }
            _ => {
                self.lanes(rows, controls, sum, depth - 1);
                self.lanes(rows, controls, sum, depth - 1);
                let ops =
                    [("f32.add", "f64.add"), ("f32.sub", "f64.sub"), ("f32.mul", "f64.mul"), ("f32.div", "f64.div")];
                let op = self.world.random.one_of(ops);
                self.float_op(storage, op);
            }
        }
    }

    fn float(&mut self, storage: Storage, number: f64) {
        let narrow = number as f32;
        match storage {
            Storage::F32 if narrow.is_nan() => self.constant_bits(ValueType::F32, 0xFFC0_0000),
            Storage::F32 => self.constant_bits(ValueType::F32, u64::from(narrow.to_bits())),
            _ if number.is_nan() => self.constant_bits(ValueType::F64, 0xFFF8_0000_0000_0000),
            _ => self.constant_bits(ValueType::F64, number.to_bits()),
        }
    }

    fn float_op(&mut self, storage: Storage, (single, double): (&str, &str)) {
        let name = if storage == Storage::F32 { single } else { double };
        let op = NumericOp::ALL.iter().copied().find(|op| op.mnemonic() == name).expect("an instruction");
        self.put(Instruction::Numeric(op));
    }

    /// An integer local, one that anyone may write.
    fn integer_local(&mut self) -> (SlotIndex, ValueType) {
        let ty = self.world.random.one_of([ValueType::I32, ValueType::I32, ValueType::I64]);
        let fits = |index: &&SlotIndex| match self.function.locals[index.index()] {
            LocalType::Scalar(storage) => storage != Storage::Bool && storage.value_type() == ty,
            LocalType::Ref(_) => false,
        };
        let all: Vec<SlotIndex> = self.scalars.iter().filter(fits).copied().collect();
        // Each function has a local of each stack type.
        (all[self.world.random.below(all.len())], ty)
    }

    /// IF a < b THEN c := …; with ELSE or not: all on integer variables.
    fn short_choice(&mut self) {
        let (target, ty) = self.integer_local();
        let wide = ty == ValueType::I64;
        let (other, end) = (self.code.label(), self.code.label());
        let operations = [(NumericOp::I32Add, NumericOp::I64Add), (NumericOp::I32Xor, NumericOp::I64Xor)];
        let tests = [(NumericOp::I32LtS, NumericOp::I64LtS), (NumericOp::I32Eq, NumericOp::I64Eq)];
        let of = |(narrow, broad)| Instruction::Numeric(if wide { broad } else { narrow });
        let arm = |body: &mut Self| {
            body.leaf(ty);
            if body.world.random.chance(50) {
                body.load_local(target);
                let operation = body.world.random.one_of(operations);
                body.put(of(operation));
            }
            body.store_local(target);
        };
        self.load_local(target);
        self.leaf(ty);
        let test = self.world.random.one_of(tests);
        self.put(of(test));
        self.put(Instruction::JumpUnless { target: other });
        arm(self);
        if self.world.random.chance(50) {
            self.put(Instruction::Jump { target: end });
            self.code.bind(other);
            arm(self);
        } else {
            self.code.bind(other);
        }
        self.code.bind(end);
    }

    /// b := NOT c, of BOOL variables.
    fn negation(&mut self) {
        let (from, to) = (self.variable_of(Storage::Bool, false), self.variable_of(Storage::Bool, true));
        let (Some(from), Some(to)) = (from, to) else { return self.short_choice() };
        self.put(from.load());
        self.put(Instruction::Numeric(NumericOp::I32Eqz));
        self.put(to.store());
    }

    /// a[i] := a[i] op b[i], with one variable as index.
    fn repeated_index(&mut self) {
        let rows = self.rows(|storage, _| storage != Storage::Bool);
        let Some(row) = self.world.random.pick(&rows).copied() else { return self.short_choice() };
        let same: Vec<Row> =
            rows.into_iter().filter(|other| other.storage == row.storage && other.array == row.array).collect();
        let index = self.local(LocalType::Scalar(Storage::I32));
        self.counters.push(index);
        self.leaf(ValueType::I32);
        if self.world.random.chance(self.world.profile.care) {
            self.integer(ValueType::I32, row.upper - row.lower + 1);
            self.put(Instruction::Numeric(NumericOp::I32RemU));
            self.integer(ValueType::I32, row.lower);
            self.put(Instruction::Numeric(NumericOp::I32Add));
        }
        self.store_local(index);
        let controls = vec![index];
        let ty = row.storage.value_type();
        self.element(&same, &controls);
        for _ in 0..2 {
            self.element(&same, &controls);
            self.put(Instruction::RefLoad { storage: row.storage });
        }
        self.binary(ty);
        self.put(Instruction::RefStore { storage: row.storage });
    }

    /// x / d and y MOD d, with one variable as divisor.
    fn repeated_divisor(&mut self) {
        let (divisor, ty) = self.integer_local();
        let wide = ty == ValueType::I64;
        let (divide, modulo, or) = if wide {
            (NumericOp::I64DivU, NumericOp::I64RemU, NumericOp::I64Or)
        } else {
            (NumericOp::I32DivU, NumericOp::I32RemU, NumericOp::I32Or)
        };
        if self.world.random.chance(self.world.profile.care) {
            self.load_local(divisor);
            self.integer(ty, 1);
            self.put(Instruction::Numeric(or));
            self.store_local(divisor);
        }
        for op in [divide, modulo] {
            self.leaf(ty);
            self.load_local(divisor);
            self.put(Instruction::Numeric(op));
        }
        self.binary(ty);
        let target = self.variable(ty, true);
        self.put(target.store());
    }

    /// Any operation on two values of a type that gives one and does not trap.
    pub fn binary(&mut self, ty: ValueType) {
        let fits = |op: &NumericOp| op.result() == ty && op.operands() == [ty, ty] && op.trap().is_none();
        let rows: Vec<NumericOp> = NumericOp::ALL.iter().copied().filter(fits).collect();
        let op = rows[self.world.random.below(rows.len())];
        self.put(Instruction::Numeric(op));
    }
}

/// Types of arrays that [`Body::idiom`] sweeps over: element, bounds.
pub(crate) fn swept(random: &mut crate::random::Random) -> (TypeId, (i32, i32)) {
    let storage = random.one_of([Storage::F32, Storage::F64, Storage::F32, Storage::I32]);
    let lower = random.one_of([0, 0, 1, -3]);
    let length = random.one_of([5, 16, 17, 23, 40]);
    (TypeId(storage as u16), (lower, lower + length - 1))
}
