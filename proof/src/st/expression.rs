//! Expressions of a wanted type, and places.

use super::functions::Function;
use super::generate::Generator;
use super::tree::{Base, Class, Def, Expr, ExprKind, Kind, Op, Place, Step, Ty, UnitKind, Value, Var};

/// A way into a variable: a field, or any element.
#[derive(Debug, Clone, Copy)]
pub(super) enum Way {
    Field(usize),
    Element,
}

/// A place but for its indices.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    base: Base,
    ways: Vec<Way>,
    pub ty: Ty,
    pub is_writable: bool,
    is_readable: bool,
}

impl Shape {
    /// Whether it is a global or a part of one.
    pub(super) fn is_global(&self) -> bool {
        matches!(self.base, Base::Global(_))
    }
}

fn boxed(expr: Expr) -> Box<Expr> {
    Box::new(expr)
}

fn lit(kind: Kind, value: Value, typed: bool) -> Expr {
    Expr { ty: Ty::K(kind), kind: ExprKind::Lit(value, typed) }
}

impl Generator {
    /// Everything that the unit's code can name.
    pub(super) fn all_shapes(&self) -> Vec<Shape> {
        let mut found = Vec::new();
        for (at, var) in self.unit.vars.iter().enumerate() {
            let is_writable = var.class != Class::Constant && var.class != Class::Input;
            let first = Shape { base: Base::Var(at), ways: Vec::new(), ty: var.ty, is_writable, is_readable: true };
            self.shapes_in(first, &mut found);
        }
        for (at, var) in self.source.globals.iter().enumerate() {
            let first =
                Shape { base: Base::Global(at), ways: Vec::new(), ty: var.ty, is_writable: true, is_readable: true };
            self.shapes_in(first, &mut found);
        }
        found
    }

    fn shapes_in(&self, shape: Shape, found: &mut Vec<Shape>) {
        let part = |way: Way, ty: Ty, is_writable: bool, is_readable: bool| {
            let mut ways = shape.ways.clone();
            ways.push(way);
            Shape { base: shape.base, ways, ty, is_writable, is_readable }
        };
        if let Ty::N(id) = shape.ty {
            match &self.source.types[id].def {
                Def::Struct(fields) => {
                    for (at, (_, ty, _)) in fields.iter().enumerate() {
                        self.shapes_in(part(Way::Field(at), *ty, shape.is_writable, true), found);
                    }
                }
                Def::Array(_, element) => {
                    self.shapes_in(part(Way::Element, *element, shape.is_writable, true), found);
                }
                Def::Block(unit) => {
                    for (at, var) in self.source.units[*unit].vars.iter().enumerate() {
                        if var.class == Class::Output {
                            self.shapes_in(part(Way::Field(at), var.ty, false, true), found);
                        }
                    }
                }
                Def::Standard(standard) => {
                    for (at, (_, kind, is_input)) in standard.fields().iter().enumerate() {
                        if !is_input {
                            self.shapes_in(part(Way::Field(at), Ty::K(*kind), false, true), found);
                        }
                    }
                }
                Def::Enum(_) | Def::Subrange(..) => {}
            }
        }
        found.push(shape);
    }

    /// A place of exactly a type; for reading a subrange of it will do.
    pub(super) fn place(&mut self, ty: Ty, writes: bool) -> Option<Place> {
        let fits = |shape: &&Shape| {
            let is_type = shape.ty == ty || (!writes && self.source.plain(shape.ty) == ty);
            is_type && if writes { shape.is_writable } else { shape.is_readable }
        };
        let candidates: Vec<usize> =
            self.shapes.iter().enumerate().filter(|(_, shape)| fits(shape)).map(|(at, _)| at).collect();
        let shape = self.shapes[*self.r.pick(&candidates)?].clone();
        let mut ty = match shape.base {
            Base::Var(at) => self.unit.vars[at].ty,
            Base::Global(at) => self.source.globals[at].ty,
        };
        let mut steps = Vec::new();
        for way in shape.ways {
            let Ty::N(id) = ty else { return None };
            let def = self.source.types[id].def.clone();
            match (way, def) {
                (Way::Element, Def::Array(dims, element)) => {
                    steps.push(Step::Index(dims.iter().map(|(low, high)| self.index(*low, *high)).collect()));
                    ty = element;
                }
                (Way::Field(at), def) => {
                    steps.push(Step::Field(at));
                    ty = match def {
                        Def::Struct(fields) => fields[at].1,
                        Def::Block(unit) => self.source.units.get(unit).map_or(shape.ty, |unit| unit.vars[at].ty),
                        Def::Standard(standard) => Ty::K(standard.fields()[at].1),
                        _ => return None,
                    };
                }
                _ => return None,
            }
        }
        Some(Place { base: shape.base, steps, ty: shape.ty })
    }

    /// A variable of an integer type that is no part of something.
    fn integer_variable(&mut self) -> Option<Expr> {
        let fits = |var: &Var| matches!(var.ty, Ty::K(kind) if kind.is_integer());
        let found: Vec<usize> = (0..self.unit.vars.len()).filter(|at| fits(&self.unit.vars[*at])).collect();
        let at = *self.r.pick(&found)?;
        let ty = self.unit.vars[at].ty;
        Some(Expr { ty, kind: ExprKind::Get(Place { base: Base::Var(at), steps: Vec::new(), ty }) })
    }

    fn index(&mut self, low: i32, high: i32) -> Expr {
        let (low, high) = (i128::from(low), i128::from(high));
        let around: Vec<usize> =
            self.loops.iter().filter(|(_, least, most)| low <= *least && *most <= high).map(|(at, ..)| *at).collect();
        if let Some(at) = self.r.pick(&around).copied().filter(|_| self.r.chance(70)) {
            let ty = self.unit.vars[at].ty;
            return Expr { ty, kind: ExprKind::Get(Place { base: Base::Var(at), steps: Vec::new(), ty }) };
        }
        let literal = lit(Kind::Dint, Value::Int(i128::from(self.r.between(low as i64, high as i64))), false);
        if self.r.chance(45) {
            return literal;
        }
        let Some(variable) = self.integer_variable() else { return literal };
        let Ty::K(kind) = variable.ty else { return literal };
        let (least, most) = kind.limits();
        if !self.is_pure && self.r.chance(20) {
            if self.r.chance(50) {
                let one = lit(kind, Value::Int(1), false);
                return Expr { ty: variable.ty, kind: ExprKind::Bin(Op::Add, boxed(variable), boxed(one)) };
            }
            return variable;
        }
        if low < least || high > most {
            return literal;
        }
        let bound = |value| lit(kind, Value::Int(value), true);
        Expr { ty: variable.ty, kind: ExprKind::Std(Function::Limit, vec![bound(low), variable, bound(high)]) }
    }

    /// A number at which something may break.
    pub(super) fn number(&mut self, kind: Kind) -> Value {
        match kind {
            Kind::Real | Kind::Lreal => {
                let value = self.r.float();
                let narrow = value as f32;
                match kind {
                    Kind::Real if narrow.is_finite() => Value::Real(narrow),
                    Kind::Lreal if value.is_finite() => Value::Lreal(value),
                    Kind::Real => Value::Real(1.5),
                    _ => Value::Lreal(-2.5),
                }
            }
            Kind::Time => {
                let ms = i128::from(self.r.between(-20, 60)) * 1_000_000;
                Value::Int(if self.r.chance(15) { i128::from(self.r.between(-1 << 45, 1 << 45)) } else { ms })
            }
            _ => Value::Int(kind.wrap(i128::from(self.r.integer(64)))),
        }
    }

    pub(super) fn text(&mut self, most: usize) -> Vec<u8> {
        let count = self.r.below(most.min(12) + 1);
        (0..count).map(|_| self.r.one_of([b'a', b'b', b'A', b'0', b'1', b'7', b'-', b'$', b'\'', 0xE9, 0x0A])).collect()
    }

    /// A value for a declared type.
    pub(super) fn value(&mut self, ty: Ty, depth: usize) -> Option<Expr> {
        match ty {
            Ty::K(kind) => {
                let narrower = kind.narrower();
                if let Some(narrow) = self.r.pick(narrower).copied().filter(|_| self.r.chance(12)) {
                    let inner = self.expr(narrow, depth);
                    return Some(Expr { ty, kind: ExprKind::Widen(boxed(inner)) });
                }
                Some(self.expr(kind, depth))
            }
            Ty::S(_) => Some(self.string(depth)),
            Ty::N(id) => match self.source.types[id].def.clone() {
                Def::Enum(values) => {
                    let read = if self.r.chance(60) { self.place(ty, false) } else { None };
                    if let Some(place) = read {
                        return Some(Expr { ty, kind: ExprKind::Get(place) });
                    }
                    let (_, value) = self.r.pick(&values)?;
                    let value = Value::Int(i128::from(*value));
                    let typed = self.r.chance(50);
                    Some(Expr { ty, kind: ExprKind::Lit(value, typed) })
                }
                Def::Subrange(base, low, high) => {
                    let safe = self.is_pure || self.r.chance(50);
                    if !safe {
                        return Some(self.expr(base, depth));
                    }
                    if self.r.chance(30) {
                        return Some(lit(base, Value::Int(if self.r.chance(50) { low } else { high }), true));
                    }
                    let inner = self.expr(base, depth.saturating_sub(1));
                    let inputs = vec![lit(base, Value::Int(low), true), inner, lit(base, Value::Int(high), true)];
                    Some(Expr { ty: Ty::K(base), kind: ExprKind::Std(Function::Limit, inputs) })
                }
                _ => {
                    if self.r.chance(50)
                        && let Some(call) = self.call(ty, depth)
                    {
                        return Some(call);
                    }
                    let place = self.place(ty, false)?;
                    Some(Expr { ty, kind: ExprKind::Get(place) })
                }
            },
        }
    }

    fn leaf(&mut self, kind: Kind) -> Expr {
        let read = if self.r.chance(75) { self.place(Ty::K(kind), false) } else { None };
        match read {
            Some(place) => Expr { ty: Ty::K(kind), kind: ExprKind::Get(place) },
            None => {
                let value = self.number(kind);
                lit(kind, value, true)
            }
        }
    }

    /// The right operand of an operation whose left one has the type: a literal without type or a narrower value will do.
    fn right(&mut self, kind: Kind, left: &Expr, depth: usize) -> Expr {
        if !matches!(left.kind, ExprKind::Lit(..)) && matches!(left.ty, Ty::K(known) if known == kind) {
            if self.r.chance(30) {
                let value = self.number(kind);
                return lit(kind, value, false);
            }
            if let Some(narrow) = self.r.pick(kind.narrower()).copied().filter(|_| self.r.chance(15)) {
                let inner = self.expr(narrow, depth);
                return Expr { ty: Ty::K(kind), kind: ExprKind::Widen(boxed(inner)) };
            }
        }
        self.expr(kind, depth)
    }

    fn bin(&mut self, op: Op, kind: Kind, result: Kind, depth: usize) -> Expr {
        let left = self.expr(kind, depth);
        let right = self.right(kind, &left, depth);
        Expr { ty: Ty::K(result), kind: ExprKind::Bin(op, boxed(left), boxed(right)) }
    }

    fn divide(&mut self, kind: Kind, depth: usize) -> Expr {
        let op = self.r.one_of([Op::Div, Op::Mod]);
        let left = self.expr(kind, depth);
        let right = if self.is_pure || self.r.chance(80) {
            let value = match self.number(kind) {
                Value::Int(0) => Value::Int(3),
                other => other,
            };
            lit(kind, value, true)
        } else {
            self.expr(kind, depth)
        };
        Expr { ty: Ty::K(kind), kind: ExprKind::Bin(op, boxed(left), boxed(right)) }
    }

    /// An expression of exactly an elementary type.
    pub(super) fn expr(&mut self, kind: Kind, depth: usize) -> Expr {
        if depth == 0 || self.r.chance(20) {
            return self.leaf(kind);
        }
        let d = depth - 1;
        if self.r.chance(25)
            && let Some(call) = self.call(Ty::K(kind), d)
        {
            return call;
        }
        let wrap = |expr: ExprKind| Expr { ty: Ty::K(kind), kind: expr };
        if self.r.chance(30) {
            return self.function(kind, d);
        }
        match kind {
            Kind::Bool => self.truth(d),
            Kind::Time => match self.r.below(4) {
                0 | 1 => {
                    let op = self.r.one_of([Op::Add, Op::Sub]);
                    self.bin_time(op, d)
                }
                2 => {
                    let left = self.expr(kind, d);
                    let number = self.r.one_of([Kind::Sint, Kind::Int, Kind::Dint]);
                    let right = self.expr(number, d);
                    wrap(ExprKind::Bin(Op::Mul, boxed(left), boxed(right)))
                }
                _ => {
                    let left = self.expr(kind, d);
                    let value = i128::from(self.r.one_of([1, 2, 3, 7, -1, -5]));
                    let right = lit(Kind::Int, Value::Int(value), true);
                    wrap(ExprKind::Bin(Op::Div, boxed(left), boxed(right)))
                }
            },
            Kind::Real | Kind::Lreal => {
                if self.r.chance(15) {
                    let inner = self.expr(kind, d);
                    return wrap(ExprKind::Neg(boxed(inner)));
                }
                let op = self.r.one_of([Op::Add, Op::Sub, Op::Mul, Op::Div]);
                self.bin(op, kind, kind, d)
            }
            _ if kind.is_bits() => match self.r.below(6) {
                0 => {
                    let inner = self.expr(kind, d);
                    wrap(ExprKind::Not(boxed(inner)))
                }
                1 => {
                    let op = self.r.one_of([Op::Add, Op::Sub, Op::Mul]);
                    self.bin(op, kind, kind, d)
                }
                _ => {
                    let op = self.r.one_of([Op::And, Op::Or, Op::Xor]);
                    self.bin(op, kind, kind, d)
                }
            },
            _ => match self.r.below(8) {
                0 | 1 => self.divide(kind, d),
                2 if kind.is_signed() => {
                    let inner = self.expr(kind, d);
                    wrap(ExprKind::Neg(boxed(inner)))
                }
                _ => {
                    let op = self.r.one_of([Op::Add, Op::Sub, Op::Mul]);
                    self.bin(op, kind, kind, d)
                }
            },
        }
    }

    fn bin_time(&mut self, op: Op, depth: usize) -> Expr {
        let (left, right) = (self.expr(Kind::Time, depth), self.expr(Kind::Time, depth));
        Expr { ty: Ty::K(Kind::Time), kind: ExprKind::Bin(op, boxed(left), boxed(right)) }
    }

    fn truth(&mut self, depth: usize) -> Expr {
        let wrap = |expr: ExprKind| Expr { ty: Ty::K(Kind::Bool), kind: expr };
        let compare = [Op::Eq, Op::Ne, Op::Lt, Op::Le, Op::Gt, Op::Ge];
        match self.r.below(10) {
            0..=3 => {
                let (op, kind) = (self.r.one_of(compare), self.kind());
                let op = if kind == Kind::Bool { self.r.one_of([Op::Eq, Op::Ne]) } else { op };
                self.bin(op, kind, Kind::Bool, depth)
            }
            4 => {
                let op = self.r.one_of(compare);
                let (left, right) = (self.string(depth), self.string(depth));
                wrap(ExprKind::Bin(op, boxed(left), boxed(right)))
            }
            5 => {
                let enums: Vec<Ty> = self.shapes.iter().map(|shape| shape.ty).filter(|ty| self.is_enum(*ty)).collect();
                let Some(ty) = self.r.pick(&enums).copied() else { return self.leaf(Kind::Bool) };
                let op = self.r.one_of([Op::Eq, Op::Ne]);
                let (left, right) = (self.value(ty, 1), self.value(ty, 1));
                match (left, right) {
                    (Some(left), Some(right)) => wrap(ExprKind::Bin(op, boxed(left), boxed(right))),
                    _ => self.leaf(Kind::Bool),
                }
            }
            6 => {
                let inner = self.expr(Kind::Bool, depth);
                wrap(ExprKind::Not(boxed(inner)))
            }
            7 => {
                let op = self.r.one_of([Op::AndThen, Op::OrElse]);
                self.bin(op, Kind::Bool, Kind::Bool, depth)
            }
            _ => {
                let op = self.r.one_of([Op::And, Op::Or, Op::Xor]);
                self.bin(op, Kind::Bool, Kind::Bool, depth)
            }
        }
    }

    fn is_enum(&self, ty: Ty) -> bool {
        matches!(ty, Ty::N(id) if matches!(self.source.types[id].def, Def::Enum(_)))
    }

    /// A standard function or a conversion of a result type.
    fn function(&mut self, kind: Kind, depth: usize) -> Expr {
        let wrap = |expr: ExprKind| Expr { ty: Ty::K(kind), kind: expr };
        let std = |function: Function, inputs: Vec<Expr>| wrap(ExprKind::Std(function, inputs));
        let number = kind.is_integer() || kind.is_real();
        match self.r.below(10) {
            0 if number => std(Function::Abs, vec![self.expr(kind, depth)]),
            0 | 1 if kind.is_real() => std(Function::Sqrt, vec![self.expr(kind, depth)]),
            1 => {
                let (condition, first) = (self.expr(Kind::Bool, depth), self.expr(kind, depth));
                let second = self.right(kind, &first, depth);
                std(Function::Sel, vec![condition, first, second])
            }
            2 => {
                let selector = self.r.one_of([Kind::Sint, Kind::Int, Kind::Dint, Kind::Usint]);
                let mut inputs = vec![self.expr(selector, depth)];
                for _ in 0..self.r.between(2, 4) {
                    inputs.push(self.expr(kind, depth));
                }
                std(Function::Mux, inputs)
            }
            3 | 4 if kind != Kind::Bool => {
                let function = self.r.one_of([Function::Min, Function::Max, Function::Limit]);
                let mut inputs = vec![self.expr(kind, depth)];
                let count = if function == Function::Limit { 2 } else { self.r.between(1, 3) };
                for _ in 0..count {
                    let next = self.right(kind, &inputs[0], depth);
                    inputs.push(next);
                }
                std(function, inputs)
            }
            5 if kind.is_bits() || kind.is_integer() => {
                let function = self.r.one_of([Function::Shl, Function::Shr, Function::Rol, Function::Ror]);
                let (value, width) = (self.expr(kind, depth), i64::from(kind.bits()));
                let count = if self.r.chance(70) {
                    let count = self.r.between(0, width + 2);
                    lit(Kind::Int, Value::Int(i128::from(count)), false)
                } else {
                    self.expr(Kind::Usint, depth)
                };
                std(function, vec![value, count])
            }
            6 if number => {
                let function = self.r.one_of([Function::Add, Function::Mul]);
                let mut inputs = Vec::new();
                for _ in 0..self.r.between(2, 3) {
                    inputs.push(self.expr(kind, depth));
                }
                std(function, inputs)
            }
            7 if kind == Kind::Int => {
                let text = self.string(depth);
                if self.r.chance(50) {
                    return std(Function::Len, vec![text]);
                }
                let wanted = self.r.one_of([&b"a"[..], b"1", b"ab", b"A0"]).to_vec();
                let wanted = Expr { ty: Ty::S(2), kind: ExprKind::Lit(Value::Str(wanted), false) };
                std(Function::Find, vec![text, wanted])
            }
            7 if kind.is_integer() && kind.bits() >= 32 => {
                let short = self.place_of_short_string();
                match short {
                    Some(text) => wrap(ExprKind::Conv(boxed(text))),
                    None => self.leaf(kind),
                }
            }
            8 => std(Function::Move, vec![self.expr(kind, depth)]),
            _ => self.conversion(kind, depth),
        }
    }

    /// A string that no integer type overflows at.
    fn place_of_short_string(&mut self) -> Option<Expr> {
        let ty = Ty::S(self.r.one_of([2, 5, 8]));
        let place = self.place(ty, false)?;
        Some(Expr { ty, kind: ExprKind::Get(place) })
    }

    fn conversion(&mut self, kind: Kind, depth: usize) -> Expr {
        let mut from = self.kind();
        let results = self.source.units.iter().filter(|unit| unit.kind == UnitKind::Function);
        let results: Vec<Kind> =
            results.filter_map(|unit| if let Ty::K(kind) = unit.vars[0].ty { Some(kind) } else { None }).collect();
        let wanted = self.r.pick(&results).copied().filter(|from| *from != Kind::Time && kind != Kind::Time);
        if let Some(result) = wanted.filter(|from| *from != kind && self.r.chance(50))
            && let Some(call) = self.call(Ty::K(result), depth)
        {
            return Expr { ty: Ty::K(kind), kind: ExprKind::Conv(boxed(call)) };
        }
        if kind == Kind::Time || from == Kind::Time {
            // Only what both tables have without rounding.
            from =
                if kind == Kind::Time { self.r.one_of([Kind::Int, Kind::Dint, Kind::Udint, Kind::Lint]) } else { from };
            if from == Kind::Time && !kind.is_integer() {
                return self.leaf(kind);
            }
        }
        if from == kind {
            return self.leaf(kind);
        }
        let inner = self.expr(from, depth);
        let cut = from.is_real() && kind.is_integer() && self.r.chance(40);
        let conversion = if cut { ExprKind::Trunc(boxed(inner)) } else { ExprKind::Conv(boxed(inner)) };
        Expr { ty: Ty::K(kind), kind: conversion }
    }

    /// An expression of a string type.
    pub(super) fn string(&mut self, depth: usize) -> Expr {
        let capacity = self.r.one_of([1, 2, 5, 8, 12, 20]);
        if depth == 0 || self.r.chance(40) {
            let read = if self.r.chance(75) { self.place(Ty::S(capacity), false) } else { None };
            return match read {
                Some(place) => Expr { ty: Ty::S(capacity), kind: ExprKind::Get(place) },
                None => {
                    let text = self.text(12);
                    Expr { ty: Ty::S(12), kind: ExprKind::Lit(Value::Str(text), false) }
                }
            };
        }
        let d = depth - 1;
        if self.r.chance(15)
            && let Some(call) = self.call(Ty::S(capacity), d)
        {
            return call;
        }
        if self.r.chance(15) {
            let kind = self.r.one_of(Kind::INTEGERS);
            let inner = self.expr(kind, d);
            return Expr { ty: Ty::S(20), kind: ExprKind::Conv(boxed(inner)) };
        }
        let functions = [
            Function::Left,
            Function::Right,
            Function::Mid,
            Function::Concat,
            Function::Insert,
            Function::Delete,
            Function::Replace,
        ];
        let function = self.r.one_of(functions);
        let mut inputs = vec![self.string(d.min(1))];
        if matches!(function, Function::Concat | Function::Insert | Function::Replace) {
            inputs.push(self.string(0));
        }
        let numbers = match function {
            Function::Concat => 0,
            Function::Left | Function::Right | Function::Insert => 1,
            _ => 2,
        };
        for _ in 0..numbers {
            let count = if self.r.chance(80) {
                let count = self.r.between(-1, 9);
                lit(Kind::Int, Value::Int(i128::from(count)), false)
            } else {
                self.expr(Kind::Int, d)
            };
            inputs.push(count);
        }
        Expr { ty: Ty::S(80), kind: ExprKind::Std(function, inputs) }
    }

    /// A call of a function with a result type, if there is one.
    fn call(&mut self, ty: Ty, _depth: usize) -> Option<Expr> {
        if self.is_pure {
            return None;
        }
        let fits = |unit: &usize| {
            let unit = &self.source.units[*unit];
            unit.kind == UnitKind::Function && unit.vars[0].ty == ty
        };
        let found: Vec<usize> = (0..self.source.units.len()).filter(fits).collect();
        let unit = *self.r.pick(&found)?;
        let params: Vec<(Class, Ty)> = self.source.units[unit].vars.iter().map(|var| (var.class, var.ty)).collect();
        let args = self.args(&params, 85)?;
        Some(Expr { ty, kind: ExprKind::Call(unit, args) })
    }
}
