//! Which numbers an integer value can be: the analysis that several passes ask. It changes nothing.
//!
//! One walk gives each value an interval from its operands; what variables hold is the union of what they are set to, found by a first
//! walk. Inside a counted FOR loop its control variable lies between the first value and the bound.

use khz_bytecode::instruction::NumericOp;
use khz_bytecode::value::{IntegerType, Storage};

use crate::mir::{Block, Const, Control, Counted, Function, LoopId, Op, Results, Type, Value, Var};

/// Loops around a place that are looked at, innermost first: bounds the work for a nest of many levels.
pub const MOST_LEVELS: usize = 16;

/// All numbers from `low` to `high`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interval {
    /// Smallest.
    pub low: i64,
    /// Largest.
    pub high: i64,
}

impl Interval {
    const BOOL: Interval = Interval { low: 0, high: 1 };

    /// Every number of a type.
    #[must_use]
    pub fn of(ty: Type) -> Interval {
        match ty {
            Type::I32 => Interval { low: i64::from(i32::MIN), high: i64::from(i32::MAX) },
            _ => Interval { low: i64::MIN, high: i64::MAX },
        }
    }

    /// What a load of a storage can give.
    #[must_use]
    pub fn of_storage(storage: Storage) -> Interval {
        let (low, high) = match storage {
            Storage::Bool => (0, 1),
            Storage::I8 => (-128, 127),
            Storage::U8 => (0, 255),
            Storage::I16 => (-32_768, 32_767),
            Storage::U16 => (0, 65_535),
            Storage::I32 => (i64::from(i32::MIN), i64::from(i32::MAX)),
            Storage::I64 | Storage::F32 | Storage::F64 => (i64::MIN, i64::MAX),
        };
        Interval { low, high }
    }

    /// Whether every number lies in `other`.
    #[must_use]
    pub fn is_inside(self, other: Interval) -> bool {
        other.low <= self.low && self.high <= other.high
    }

    /// Whether a number is among them.
    #[must_use]
    pub fn contains(self, number: i64) -> bool {
        self.low <= number && number <= self.high
    }

    fn union(self, other: Interval) -> Interval {
        Interval { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The interval, or every number of the type when it leaves that type.
    fn within(low: i128, high: i128, ty: Type) -> Interval {
        let all = Interval::of(ty);
        match (i64::try_from(low), i64::try_from(high)) {
            (Ok(low), Ok(high)) if low <= high && low >= all.low && high <= all.high => Interval { low, high },
            _ => all,
        }
    }
}

/// The intervals of a function's values.
#[derive(Debug)]
pub struct Ranges {
    values: Vec<Interval>,
    constants: Vec<Option<Const>>,
}

impl Ranges {
    /// Finds them.
    #[must_use]
    pub fn new(function: &Function) -> Ranges {
        let nothing = vec![None; function.variables.len()];
        let first = Walk::run(function, &nothing);
        let variables = first.variables.clone();
        let second = Walk::run(function, &variables);
        Ranges { values: second.values, constants: second.constants }
    }

    /// What a value can be.
    #[must_use]
    pub fn of(&self, value: Value) -> Interval {
        self.values[value.index()]
    }

    /// Whether the bound of a loop is a number of the control variable's type for certain: only then the variable never wraps while the loop runs.
    #[must_use]
    pub fn bound_is_in_type(&self, counted: &Counted) -> bool {
        bound_is_in_type(counted, self.of(counted.bound))
    }

    /// The constant that a value is.
    #[must_use]
    pub fn constant(&self, value: Value) -> Option<Const> {
        self.constants[value.index()]
    }
}

fn bound_is_in_type(counted: &Counted, bound: Interval) -> bool {
    // Unsigned numbers of full width are bit patterns here; those that are not negative are in the type.
    let own = match counted.ty {
        IntegerType::U32 | IntegerType::U64 => Interval { low: 0, high: i64::MAX },
        ty => Interval::of_storage(ty.storage()),
    };
    bound.is_inside(own)
}

struct Walk<'a> {
    function: &'a Function,
    known: &'a [Option<Interval>],
    values: Vec<Interval>,
    constants: Vec<Option<Const>>,
    variables: Vec<Option<Interval>>,
}

impl<'a> Walk<'a> {
    fn run(function: &'a Function, known: &'a [Option<Interval>]) -> Walk<'a> {
        let values = function.values.iter().map(|ty| Interval::of(*ty)).collect();
        let variables = vec![None; function.variables.len()];
        let mut walk = Walk { function, known, values, constants: vec![None; function.values.len()], variables };
        for (number, block) in function.blocks.iter().enumerate() {
            for instruction in &block.instructions {
                if let Results::One(result) = instruction.results {
                    walk.values[result.index()] = walk.interval(Block(number as u32), &instruction.op, result);
                }
                match &instruction.op {
                    Op::Const(value) => {
                        if let Results::One(result) = instruction.results {
                            walk.constants[result.index()] = Some(*value);
                        }
                    }
                    Op::Set(var, value) => {
                        let set = walk.values[value.index()];
                        let joined = walk.variables[var.index()].map_or(set, |before| before.union(set));
                        walk.variables[var.index()] = Some(joined);
                    }
                    _ => {}
                }
            }
        }
        walk
    }

    fn interval(&self, block: Block, op: &Op, result: Value) -> Interval {
        let ty = self.function.ty(result);
        let all = Interval::of(ty);
        match op {
            Op::Const(value) => value.as_i64().map_or(all, |number| Interval { low: number, high: number }),
            Op::Get(var) => self.get(block, *var, all),
            Op::LoadSlot(slot, access) => {
                let own = Interval::of_storage(access.storage);
                self.control(block, |control| control == Control::Slot(*slot))
                    .filter(|c| c.is_inside(own))
                    .unwrap_or(own)
            }
            Op::Load(_, access) => Interval::of_storage(access.storage),
            Op::LoadBit(..) | Op::ForIsEmpty(_) | Op::ForContinues(_) => Interval::BOOL,
            Op::Select { then, otherwise, .. } => self.values[then.index()].union(self.values[otherwise.index()]),
            Op::Numeric(op, [a, b]) => numeric(*op, self.values[a.index()], self.values[b.index()], ty),
            _ => all,
        }
    }

    fn get(&self, block: Block, var: Var, all: Interval) -> Interval {
        let own = self.known[var.index()].unwrap_or(all);
        self.control(block, |control| control == Control::Var(var)).filter(|c| c.is_inside(own)).unwrap_or(own)
    }

    /// The interval of a control variable in one of the counted loops around a block.
    fn control(&self, block: Block, is_it: impl Fn(Control) -> bool) -> Option<Interval> {
        let innermost = self.function.blocks[block.index()].innermost_loop;
        let parent = |id: &LoopId| self.function.loops[id.index()].parent;
        let around = std::iter::successors(innermost, parent).take(MOST_LEVELS);
        let mut counted = around.filter_map(|id| self.function.loops[id.index()].counted);
        counted.find(|counted| is_it(counted.control)).and_then(|counted| self.counted(&counted))
    }

    /// Whether the bound is a number of the control variable's type. Beyond it the variable wraps and the loop goes on.
    fn bound_is_in_type(&self, counted: &Counted) -> bool {
        bound_is_in_type(counted, self.values[counted.bound.index()])
    }

    fn counted(&self, counted: &Counted) -> Option<Interval> {
        let of = |value: Value| self.values[value.index()];
        let (initial, bound, step) = (of(counted.initial), of(counted.bound), of(counted.step));
        let own = match counted.ty {
            // Their order is not that of i32 or i64.
            IntegerType::U32 | IntegerType::U64 => return None,
            ty => Interval::of_storage(ty.storage()),
        };
        if !self.bound_is_in_type(counted) {
            return None;
        }
        let (low, high) = if step.low > 0 {
            (initial.low, bound.high)
        } else if step.high < 0 {
            (bound.low, initial.high)
        } else {
            return None;
        };
        let (low, high) = (low.max(own.low), high.min(own.high));
        // A loop that never runs has no values; any interval does.
        (low <= high).then_some(Interval { low, high })
    }
}

fn numeric(op: NumericOp, a: Interval, b: Interval, ty: Type) -> Interval {
    use NumericOp as N;
    let all = Interval::of(ty);
    let wide = |i: Interval| (i128::from(i.low), i128::from(i.high));
    let ((al, ah), (bl, bh)) = (wide(a), wide(b));
    match op {
        N::I32Add | N::I64Add => Interval::within(al + bl, ah + bh, ty),
        N::I32Sub | N::I64Sub => Interval::within(al - bh, ah - bl, ty),
        N::I32Mul | N::I64Mul => {
            let products = [al * bl, al * bh, ah * bl, ah * bh];
            let low = products.iter().min().copied().unwrap_or(i128::MIN);
            Interval::within(low, products.iter().max().copied().unwrap_or(i128::MAX), ty)
        }
        N::I32And | N::I64And if a.low >= 0 || b.low >= 0 => {
            let high = [a, b].iter().filter(|i| i.low >= 0).map(|i| i.high).min().unwrap_or(all.high);
            Interval { low: 0, high }
        }
        N::I32Or | N::I32Xor if a.is_inside(Interval::BOOL) && b.is_inside(Interval::BOOL) => Interval::BOOL,
        N::I32RemS | N::I64RemS if bl > 0 => {
            let most = bh - 1;
            let low = if al >= 0 { 0 } else { (-most).max(al) };
            Interval::within(low, if ah >= 0 { most.min(ah) } else { 0 }, ty)
        }
        N::I32RemU | N::I64RemU if bl > 0 => Interval::within(0, bh - 1, ty),
        N::I32DivS | N::I64DivS if bl > 0 => {
            let quotients = [al / bl, al / bh, ah / bl, ah / bh];
            let low = quotients.iter().min().copied().unwrap_or(i128::MIN);
            Interval::within(low, quotients.iter().max().copied().unwrap_or(i128::MAX), ty)
        }
        N::I32ShrU if b.low == b.high && (1..32).contains(&b.low) => {
            Interval { low: 0, high: i64::from(u32::MAX >> b.low) }
        }
        N::I32MinS | N::I64MinS => Interval { low: a.low.min(b.low), high: a.high.min(b.high) },
        N::I32MaxS | N::I64MaxS => Interval { low: a.low.max(b.low), high: a.high.max(b.high) },
        N::I32Extend8S => extended(a, Storage::I8),
        N::I32Extend8U => extended(a, Storage::U8),
        N::I32Extend16S => extended(a, Storage::I16),
        N::I32Extend16U => extended(a, Storage::U16),
        N::I64ExtendI32S => a,
        N::I64ExtendI32U if a.low >= 0 => a,
        N::I32WrapI64 if a.is_inside(all) => a,
        _ if is_comparison(op) => Interval::BOOL,
        _ => all,
    }
}

fn extended(a: Interval, storage: Storage) -> Interval {
    let own = Interval::of_storage(storage);
    if a.is_inside(own) { a } else { own }
}

/// Whether an operation gives 0 or 1.
fn is_comparison(op: NumericOp) -> bool {
    use NumericOp as N;
    matches!(
        op,
        N::I32Eq
            | N::I32Ne
            | N::I32LtS
            | N::I32LtU
            | N::I32LeS
            | N::I32LeU
            | N::I32GtS
            | N::I32GtU
            | N::I32GeS
            | N::I32GeU
            | N::I32Eqz
            | N::I32Nez
            | N::I64Eq
            | N::I64Ne
            | N::I64LtS
            | N::I64LtU
            | N::I64LeS
            | N::I64LeU
            | N::I64GtS
            | N::I64GtU
            | N::I64GeS
            | N::I64GeU
            | N::I64Eqz
            | N::I64Nez
            | N::F32Eq
            | N::F32Ne
            | N::F32Lt
            | N::F32Le
            | N::F32Gt
            | N::F32Ge
            | N::F64Eq
            | N::F64Ne
            | N::F64Lt
            | N::F64Le
            | N::F64Gt
            | N::F64Ge
    )
}
