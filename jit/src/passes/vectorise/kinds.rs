//! What each value of a loop's body is to the passes that run at once, and whether they may.

use std::collections::{BTreeMap, BTreeSet};

use khz_bytecode::instruction::NumericOp as N;
use khz_bytecode::value::Storage;

use super::Nest;
use crate::mir::{Address, Base, Const, Function, Op, Results, Type, Value, Var};
use crate::passes::ranges::{Interval, Ranges};

/// What a value is to several passes at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::passes) enum Kind {
    /// The same in all.
    Same,
    /// An integer that grows by this from pass to pass.
    Counting(i64),
    /// A float of its own in each.
    Lanes,
    /// An answer of its own in each, all bits or none: only a select asks for it.
    Mask,
    /// Depends on what the pass before left: computed one after the other.
    Serial,
}

/// An integer as a sum: a constant, multiples of variables that nothing in the loop sets, and of values that are taken as they are.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
struct Form {
    constant: i64,
    terms: BTreeMap<Term, i64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Term {
    Var(Var),
    Value(Value),
}

impl Form {
    fn of(term: Term) -> Form {
        Form { constant: 0, terms: BTreeMap::from([(term, 1)]) }
    }

    fn plus(&self, other: &Form, times: i64) -> Option<Form> {
        let mut sum = self.clone();
        sum.constant = sum.constant.checked_add(other.constant.checked_mul(times)?)?;
        for (term, factor) in &other.terms {
            let entry = sum.terms.entry(*term).or_default();
            *entry = entry.checked_add(factor.checked_mul(times)?)?;
        }
        sum.terms.retain(|_, factor| *factor != 0);
        Some(sum)
    }

    fn growth(&self, control: Var) -> i64 {
        self.terms.get(&Term::Var(control)).copied().unwrap_or(0)
    }
}

/// A load or store with an element that its own pass touches.
struct Access {
    base: Base,
    first: i128,
    behind: i128,
    stored: bool,
    form: Option<(i64, u32, Form)>,
}

/// What is known of a loop's body.
pub(in crate::passes) struct Kinds {
    kinds: BTreeMap<Value, Kind>,
    /// Variables that hold a float of its own in each pass.
    pub lanes: BTreeSet<Var>,
    /// Variables that are carried from pass to pass.
    pub carried: BTreeSet<Var>,
    /// Type of the vectors.
    pub ty: Type,
}

impl Kinds {
    /// Of a value; what the body does not define is the same in all passes.
    pub fn of(&self, value: Value) -> Kind {
        self.kinds.get(&value).copied().unwrap_or(Kind::Same)
    }

    /// How many values have lanes.
    pub fn count(&self) -> usize {
        self.kinds.values().filter(|kind| **kind == Kind::Lanes).count()
    }

    /// Kinds of everything in the loop, or nothing where the passes may not run at once or that would not pay.
    pub fn find(function: &Function, nest: &Nest, ranges: &Ranges, crossing: &[bool]) -> Option<Kinds> {
        let set = Sets::find(function, nest)?;
        let mut lanes = BTreeSet::new();
        loop {
            let mut walk = Walk::new(function, nest, ranges, &set, lanes);
            walk.run()?;
            if walk.grown {
                lanes = walk.lanes;
                continue;
            }
            // What flattening added is used in the body only.
            let known = |value: &Value| crossing.get(value.index()).copied().unwrap_or(false);
            let crosses = walk.kinds.iter().any(|(value, kind)| *kind != Kind::Same && known(value));
            let ty = walk.ty?;
            let even = nest.passes % Nest::lanes(ty) == 0;
            let pays = walk.kinds.values().any(|kind| *kind == Kind::Lanes);
            if crosses || !even || !pays || !independent(&walk.accesses) {
                return None;
            }
            return Some(Kinds { kinds: walk.kinds, lanes: walk.lanes, carried: set.carried, ty });
        }
    }
}

/// Whether what one pass stores is touched by no other pass.
fn independent(accesses: &[Access]) -> bool {
    let stores: Vec<&Access> = accesses.iter().filter(|access| access.stored).collect();
    stores.iter().all(|store| {
        accesses.iter().all(|other| {
            let apart = store.base == other.base && (store.behind <= other.first || other.behind <= store.first);
            let same = store.base == other.base && store.form.is_some() && store.form == other.form;
            apart || same
        })
    })
}

/// How the body treats variables.
struct Sets {
    /// Set in the body.
    set: BTreeSet<Var>,
    /// Read before they are set: carried from pass to pass.
    carried: BTreeSet<Var>,
}

impl Sets {
    fn find(function: &Function, nest: &Nest) -> Option<Sets> {
        let (mut set, mut read_first) = (BTreeSet::new(), BTreeSet::new());
        for block in &nest.blocks {
            for instruction in &function.blocks[block.index()].instructions {
                match instruction.op {
                    Op::Get(var) if !set.contains(&var) => {
                        read_first.insert(var);
                    }
                    Op::Set(var, _) => {
                        set.insert(var);
                    }
                    _ => {}
                }
            }
        }
        let carried = read_first.intersection(&set).copied().filter(|var| *var != nest.control).collect();
        Some(Sets { set, carried })
    }
}

/// Type of the vectors that a comparison of floats takes.
fn compared(op: N) -> Option<Type> {
    match op {
        N::F32Eq | N::F32Ne | N::F32Lt | N::F32Le | N::F32Gt | N::F32Ge => Some(Type::F32x4),
        N::F64Eq | N::F64Ne | N::F64Lt | N::F64Le | N::F64Gt | N::F64Ge => Some(Type::F64x2),
        _ => None,
    }
}

struct Walk<'a> {
    function: &'a Function,
    nest: &'a Nest,
    ranges: &'a Ranges,
    set: &'a Sets,
    kinds: BTreeMap<Value, Kind>,
    forms: BTreeMap<Value, Form>,
    lanes: BTreeSet<Var>,
    ty: Option<Type>,
    accesses: Vec<Access>,
    /// Whether a variable turned out to hold lanes: then the walk starts anew.
    grown: bool,
    in_inner: bool,
    stepped: bool,
}

impl<'a> Walk<'a> {
    fn new(
        function: &'a Function,
        nest: &'a Nest,
        ranges: &'a Ranges,
        set: &'a Sets,
        lanes: BTreeSet<Var>,
    ) -> Walk<'a> {
        let (kinds, forms) = (BTreeMap::new(), BTreeMap::new());
        let (accesses, ty) = (Vec::new(), None);
        let (grown, in_inner, stepped) = (false, false, false);
        Walk { function, nest, ranges, set, kinds, forms, lanes, ty, accesses, grown, in_inner, stepped }
    }

    fn run(&mut self) -> Option<()> {
        for (position, block) in self.nest.blocks.iter().enumerate() {
            self.in_inner = position == 1;
            for (at, instruction) in self.function.blocks[block.index()].instructions.iter().enumerate() {
                if let Op::Checkpoint { deadline, .. } = instruction.op {
                    // The header's is where a run may end; it stands before everything else.
                    if (position == 0 && at == 0) || !deadline {
                        continue;
                    }
                    return None;
                }
                let kind = self.kind(&instruction.op, &instruction.results)?;
                if let Results::One(result) = instruction.results {
                    self.kinds.insert(result, kind);
                }
            }
        }
        Some(())
    }

    fn of(&self, value: Value) -> Kind {
        self.kinds.get(&value).copied().unwrap_or(Kind::Same)
    }

    fn form(&self, value: Value) -> Form {
        let constant = self.ranges.constant(value).and_then(Const::as_i64);
        let known = || self.forms.get(&value).cloned().unwrap_or_else(|| Form::of(Term::Value(value)));
        constant.map_or_else(known, |constant| Form { constant, terms: BTreeMap::new() })
    }

    fn kind(&mut self, op: &Op, results: &Results) -> Option<Kind> {
        match op {
            Op::Const(_) => Some(Kind::Same),
            Op::Get(var) => self.get(*var, results),
            Op::Set(var, value) => self.set(*var, *value),
            Op::Numeric(op, operands) => self.numeric(*op, *operands, results),
            Op::Load(address, access) => {
                let kind = self.access(address, access.storage, false)?;
                (!access.canonicalise || kind == Kind::Same).then_some(kind)
            }
            Op::Store(address, access, value) => {
                let fits = matches!(self.of(*value), Kind::Lanes | Kind::Same);
                let kind = self.access(address, access.storage, true)?;
                (fits && kind == Kind::Lanes).then_some(kind)
            }
            Op::Select { condition, then, otherwise } => self.select(*condition, [*then, *otherwise]),
            // The tests of this loop and of the one inside ask for control variables.
            Op::ForContinues(_) => Some(Kind::Same),
            Op::ForIsEmpty(test) => (self.of(test.control) == Kind::Same).then_some(Kind::Same),
            _ => None,
        }
    }

    /// Chosen lane by lane where the answer is; elsewhere only where nothing has lanes.
    fn select(&mut self, condition: Value, values: [Value; 2]) -> Option<Kind> {
        let kinds = values.map(|value| self.of(value));
        let fits = kinds.iter().all(|kind| matches!(kind, Kind::Lanes | Kind::Same));
        let scalar = if self.ty? == Type::F32x4 { Type::F32 } else { Type::F64 };
        let of_type = self.function.ty(values[0]) == scalar;
        match self.of(condition) {
            Kind::Mask => (fits && of_type).then_some(Kind::Lanes),
            Kind::Same => (kinds == [Kind::Same; 2]).then_some(Kind::Same),
            _ => None,
        }
    }

    fn get(&mut self, var: Var, results: &Results) -> Option<Kind> {
        let Results::One(result) = *results else { return None };
        if var == self.nest.control {
            self.forms.insert(result, Form::of(Term::Var(var)));
            return (!self.stepped).then_some(Kind::Counting(1));
        }
        if self.inner_control() == Some(var) {
            return Some(Kind::Same);
        }
        if self.set.carried.contains(&var) {
            return (!self.in_inner).then_some(Kind::Serial);
        }
        if !self.set.set.contains(&var) {
            self.forms.insert(result, Form::of(Term::Var(var)));
        }
        Some(if self.lanes.contains(&var) { Kind::Lanes } else { Kind::Same })
    }

    fn inner_control(&self) -> Option<Var> {
        let counted = self.function.loops[self.nest.inner?.index()].counted?;
        match counted.control {
            crate::mir::Control::Var(var) => Some(var),
            _ => None,
        }
    }

    fn set(&mut self, var: Var, value: Value) -> Option<Kind> {
        if var == self.nest.control {
            self.stepped = true;
            return Some(Kind::Same);
        }
        let kind = self.of(value);
        if self.set.carried.contains(&var) && self.inner_control() != Some(var) {
            // What each pass sets anew from what is not carried has to be known lane by lane as well.
            return (!self.in_inner).then_some(Kind::Serial);
        }
        match kind {
            Kind::Same => Some(kind),
            Kind::Lanes => {
                self.grown |= self.lanes.insert(var);
                Some(kind)
            }
            Kind::Counting(_) | Kind::Serial | Kind::Mask => None,
        }
    }

    fn numeric(&mut self, op: N, operands: [Value; 2], results: &Results) -> Option<Kind> {
        let Results::One(result) = *results else { return None };
        let kinds = operands.map(|value| self.of(value));
        if op.trap().is_some() {
            return None;
        }
        if kinds.contains(&Kind::Mask) {
            return None;
        }
        if kinds.contains(&Kind::Serial) {
            return (!self.in_inner).then_some(Kind::Serial);
        }
        if kinds.contains(&Kind::Lanes) {
            if let Some(ty) = compared(op) {
                return self.vectors(ty).then_some(Kind::Mask);
            }
            return self.float(op).then_some(Kind::Lanes);
        }
        if let Some(form) = self.sum(op, operands, result) {
            let growth = form.growth(self.nest.control);
            self.forms.insert(result, form);
            return Some(if growth == 0 { Kind::Same } else { Kind::Counting(growth) });
        }
        if kinds == [Kind::Same; 2] {
            return Some(Kind::Same);
        }
        // Of what counts, only a plain i32 becomes a float.
        let counts = matches!(kinds[0], Kind::Counting(growth) if i32::try_from(growth).is_ok());
        let ty = match op {
            N::F32ConvertI32S => Type::F32x4,
            N::F64ConvertI32S => Type::F64x2,
            _ => return None,
        };
        (counts && self.vectors(ty)).then_some(Kind::Lanes)
    }

    /// Operations that give the same bits in a vector as alone.
    fn float(&mut self, op: N) -> bool {
        match op {
            N::F32Add | N::F32Sub | N::F32Mul | N::F32Div | N::F32Sqrt => self.vectors(Type::F32x4),
            N::F64Add | N::F64Sub | N::F64Mul | N::F64Div | N::F64Sqrt => self.vectors(Type::F64x2),
            _ => false,
        }
    }

    /// All vectors of a loop are of one type.
    fn vectors(&mut self, ty: Type) -> bool {
        *self.ty.get_or_insert(ty) == ty
    }

    /// Sums and multiples of integers that surely do not wrap on the way.
    fn sum(&self, op: N, [a, b]: [Value; 2], result: Value) -> Option<Form> {
        let form = match op {
            N::I32Add | N::I64Add => self.form(a).plus(&self.form(b), 1),
            N::I32Sub | N::I64Sub => self.form(a).plus(&self.form(b), -1),
            N::I32Mul | N::I64Mul => {
                let constant = |value: Value| self.ranges.constant(value).and_then(Const::as_i64);
                match (constant(a), constant(b)) {
                    (_, Some(factor)) => Form::default().plus(&self.form(a), factor),
                    (Some(factor), _) => Form::default().plus(&self.form(b), factor),
                    _ => None,
                }
            }
            N::I64ExtendI32S => Some(self.form(a)),
            _ => None,
        }?;
        let all = Interval::of(self.function.ty(result));
        let exact = op == N::I64ExtendI32S || self.ranges.of(result) != all;
        exact.then_some(form)
    }

    fn access(&mut self, address: &Address, storage: Storage, stored: bool) -> Option<Kind> {
        let size = match storage {
            Storage::F32 => 4,
            Storage::F64 => 8,
            Storage::Bool | Storage::I8 | Storage::U8 => 1,
            Storage::I16 | Storage::U16 => 2,
            Storage::I32 => 4,
            Storage::I64 => 8,
        };
        if let Base::Value(value) = address.base
            && self.of(value) != Kind::Same
        {
            return None;
        }
        let start = i128::from(address.displacement);
        let Some((index, stride)) = address.index else {
            let access = Access { base: address.base, first: start, behind: start + size, stored, form: None };
            self.accesses.push(access);
            return (!stored).then_some(Kind::Same);
        };
        let range = self.ranges.of(index);
        let at = |number: i64| start + i128::from(number) * i128::from(stride);
        let form = (address.displacement, stride, self.form(index));
        let (first, behind) = (at(range.low), at(range.high) + size);
        self.accesses.push(Access { base: address.base, first, behind, stored, form: Some(form) });
        match self.of(index) {
            Kind::Same => (!stored).then_some(Kind::Same),
            Kind::Counting(growth) => {
                let is_float = matches!(storage, Storage::F32 | Storage::F64);
                let ty = if storage == Storage::F32 { Type::F32x4 } else { Type::F64x2 };
                let dense = i128::from(growth) * i128::from(stride) == size;
                (is_float && dense && !(stored && self.in_inner) && self.vectors(ty)).then_some(Kind::Lanes)
            }
            Kind::Lanes | Kind::Serial | Kind::Mask => None,
        }
    }
}
