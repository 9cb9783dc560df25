//! Expressions of a wanted type.

use super::functions::Function;
use super::generate::Generator;
use super::moments;
use super::tree::{Class, Def, Expr, ExprKind, Kind, Op, Ty, UnitKind, Value};

pub(super) fn boxed(expr: Expr) -> Box<Expr> {
    Box::new(expr)
}

pub(super) fn lit(kind: Kind, value: Value, typed: bool) -> Expr {
    Expr { ty: Ty::K(kind), kind: ExprKind::Lit(value, typed) }
}

impl Generator {
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
            Kind::Time | Kind::Ltime => {
                let ms = i128::from(self.r.between(-20, 60)) * 1_000_000;
                Value::Int(if self.r.chance(15) { i128::from(self.r.between(-1 << 45, 1 << 45)) } else { ms })
            }
            _ if kind.is_moment() => {
                let any = i128::from(self.r.integer(64));
                let near = i128::from(self.r.between(-800, 800));
                let value = match kind {
                    Kind::Date | Kind::Ldate => near,
                    _ => near * 3_600_000_000_000,
                };
                Value::Int(moments::sayable(kind, if self.r.chance(25) { any } else { value }))
            }
            Kind::Char | Kind::Wchar if self.r.chance(75) => {
                let unit = self.text(kind == Kind::Wchar, 1).first().copied();
                Value::Int(i128::from(unit.unwrap_or(u16::from(b'a'))))
            }
            _ => Value::Int(kind.wrap(i128::from(self.r.integer(64)))),
        }
    }

    /// The units of a text; wide ones are beyond Latin-1 too, and halves of what takes two.
    pub(super) fn text(&mut self, wide: bool, most: usize) -> Vec<u16> {
        let count = self.r.below(most.min(12) + 1);
        (0..count)
            .map(|_| {
                if wide && self.r.chance(20) {
                    return self.r.one_of([0x100, 0x3A9, 0x20AC, 0xD83D, 0xDE00, 0xFFFF, 0x0130]);
                }
                let narrow =
                    [b'a', b'b', b'A', b'0', b'1', b'7', b'-', b'$', b'\'', b'"', b'.', b'E', b' ', 0xE9, 0x0A, 0x09];
                u16::from(self.r.one_of(narrow))
            })
            .collect()
    }

    /// A value for a declared type.
    pub(super) fn value(&mut self, ty: Ty, depth: usize) -> Option<Expr> {
        match ty {
            Ty::K(kind) => {
                if self.r.chance(15) {
                    return Some(self.widened(kind, depth, Kind::becomes));
                }
                Some(self.expr(kind, depth))
            }
            Ty::S(_) | Ty::W(_) if self.r.chance(15) => Some(self.characters(ty.is_wide(), depth)),
            Ty::S(_) | Ty::W(_) => Some(self.string(ty.is_wide(), depth)),
            Ty::N(id) => match self.source.types[id].def.clone() {
                Def::Enum(_, values) => Some(self.enumerated(ty, &values, depth)),
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
                    let place = self.address_of(ty, false)?;
                    Some(Expr { ty, kind: ExprKind::Get(place) })
                }
            },
        }
    }

    /// A value of a type that another becomes by itself, or that meets it in it.
    fn widened(&mut self, kind: Kind, depth: usize, fits: fn(Kind, Kind) -> bool) -> Expr {
        let from: Vec<Kind> = Kind::ALL.into_iter().filter(|from| *from != kind && fits(*from, kind)).collect();
        let Some(from) = self.r.pick(&from).copied() else { return self.expr(kind, depth) };
        let inner = self.expr(from, depth);
        Expr { ty: Ty::K(kind), kind: ExprKind::Widen(boxed(inner)) }
    }

    /// A value of an enumeration.
    fn enumerated(&mut self, ty: Ty, values: &[(String, i64)], depth: usize) -> Expr {
        if depth > 0 && self.r.chance(25) {
            let function = self.r.one_of([Function::Sel, Function::Mux, Function::Move, Function::Min, Function::Max]);
            let mut inputs = Vec::new();
            match function {
                Function::Sel => inputs.push(self.expr(Kind::Bool, depth - 1)),
                Function::Mux => inputs.push(self.expr(Kind::Int, depth - 1)),
                _ => {}
            }
            for _ in 0..if function == Function::Move { 1 } else { 2 } {
                inputs.push(self.enumerated(ty, values, 0));
            }
            return Expr { ty, kind: ExprKind::Std(function, inputs) };
        }
        let read = if self.r.chance(60) { self.place(ty, false) } else { None };
        if let Some(place) = read {
            return Expr { ty, kind: ExprKind::Get(place) };
        }
        let value = self.r.pick(values).map_or(0, |(_, value)| i128::from(*value));
        // A bare name may belong to another enumeration too where nothing says which is meant.
        let typed = depth == 0 || self.r.chance(50);
        Expr { ty, kind: ExprKind::Lit(Value::Int(value), typed) }
    }

    pub(super) fn leaf(&mut self, kind: Kind) -> Expr {
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
    pub(super) fn right(&mut self, kind: Kind, left: &Expr, depth: usize) -> Expr {
        if !matches!(left.kind, ExprKind::Lit(..)) && matches!(left.ty, Ty::K(known) if known == kind) {
            if self.r.chance(30) {
                let value = self.number(kind);
                return lit(kind, value, false);
            }
            if self.r.chance(6)
                && let Some(bound) = self.bound(kind)
            {
                return bound;
            }
            if self.r.chance(12) {
                return self.widened(kind, depth, |from, to| from.meet(to) == Some(to));
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
            Kind::Time | Kind::Ltime => self.duration(kind, d),
            Kind::Date | Kind::Ldate | Kind::Char | Kind::Wchar => self.function(kind, d),
            _ if kind.is_moment() => {
                let op = self.r.one_of([Op::Add, Op::Sub]);
                let (left, right) = self.with_duration(kind, d);
                wrap(ExprKind::Bin(op, boxed(left), boxed(right)))
            }
            Kind::Real | Kind::Lreal => {
                if self.r.chance(15) {
                    let inner = self.expr(kind, d);
                    return wrap(ExprKind::Neg(boxed(inner)));
                }
                let op = self.r.one_of([Op::Add, Op::Sub, Op::Mul, Op::Div, Op::Pow]);
                if op == Op::Pow {
                    let left = self.expr(kind, d);
                    let right = self.exponent(kind, d);
                    return wrap(ExprKind::Bin(op, boxed(left), boxed(right)));
                }
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

    /// A time of day or moment, and a duration: the sum of the two is of a type, long if one of them is.
    pub(super) fn with_duration(&mut self, kind: Kind, depth: usize) -> (Expr, Expr) {
        let (short, long) = (if matches!(kind, Kind::Tod | Kind::Ltod) { Kind::Tod } else { Kind::Dt }, kind.long());
        let (left, right) = match self.r.below(3) {
            _ if long != Some(kind) => (kind, Kind::Time),
            0 => (kind, Kind::Time),
            1 => (short, Kind::Ltime),
            _ => (kind, Kind::Ltime),
        };
        (self.expr(left, depth), self.expr(right, depth))
    }

    /// Two values of one family: their difference is a TIME, or an LTIME if one of them is long.
    pub(super) fn apart(&mut self, kind: Kind, depth: usize) -> (Expr, Expr) {
        let short = self.r.one_of([Kind::Date, Kind::Tod, Kind::Dt]);
        let long = short.long().unwrap_or(short);
        let (left, right) = match self.r.below(3) {
            _ if kind == Kind::Time => (short, short),
            0 => (short, long),
            1 => (long, short),
            _ => (long, long),
        };
        (self.expr(left, depth), self.expr(right, depth))
    }

    fn duration(&mut self, kind: Kind, depth: usize) -> Expr {
        let wrap = |expr: ExprKind| Expr { ty: Ty::K(kind), kind: expr };
        if self.r.chance(20) {
            let (left, right) = self.apart(kind, depth);
            return wrap(ExprKind::Bin(Op::Sub, boxed(left), boxed(right)));
        }
        if self.r.chance(10) {
            let inner = self.expr(kind, depth);
            return wrap(ExprKind::Neg(boxed(inner)));
        }
        if self.r.chance(50) {
            let op = self.r.one_of([Op::Add, Op::Sub]);
            let left = self.expr(kind, depth);
            let right = self.expr(kind, depth);
            return wrap(ExprKind::Bin(op, boxed(left), boxed(right)));
        }
        let time = self.expr(kind, depth);
        let (op, number) = self.factor(depth);
        if op == Op::Mul && self.r.chance(30) {
            return wrap(ExprKind::Bin(op, boxed(number), boxed(time)));
        }
        wrap(ExprKind::Bin(op, boxed(time), boxed(number)))
    }

    /// What a duration is multiplied with or divided by.
    pub(super) fn factor(&mut self, depth: usize) -> (Op, Expr) {
        let op = self.r.one_of([Op::Mul, Op::Div]);
        (op, self.factor_of(op, depth))
    }

    pub(super) fn factor_of(&mut self, op: Op, depth: usize) -> Expr {
        match self.r.below(3) {
            0 => {
                let kind = self.r.one_of([Kind::Real, Kind::Lreal]);
                let inner = self.expr(kind, depth);
                // Floats meet durations as LREAL.
                if kind == Kind::Lreal {
                    inner
                } else {
                    Expr { ty: Ty::K(Kind::Lreal), kind: ExprKind::Widen(boxed(inner)) }
                }
            }
            1 if op == Op::Mul || !self.is_pure => {
                let kind = self.r.one_of(Kind::INTEGERS);
                let number = self.expr(kind, depth);
                if kind == Kind::Ulint {
                    // A duration is a LINT of nanoseconds, and that is where a ULINT meets it.
                    Expr { ty: Ty::K(Kind::Lint), kind: ExprKind::Widen(boxed(number)) }
                } else {
                    number
                }
            }
            _ => {
                let value = i128::from(self.r.one_of([1, 2, 3, 7, -1, -5]));
                lit(Kind::Int, Value::Int(value), true)
            }
        }
    }

    fn truth(&mut self, depth: usize) -> Expr {
        let wrap = |expr: ExprKind| Expr { ty: Ty::K(Kind::Bool), kind: expr };
        let compare = [Op::Eq, Op::Ne, Op::Lt, Op::Le, Op::Gt, Op::Ge];
        match self.r.below(10) {
            0..=3 => {
                let (op, kind) = (self.r.one_of(compare), self.kind());
                self.bin(op, kind, Kind::Bool, depth)
            }
            4 => {
                let op = self.r.one_of(compare);
                let wide = self.r.chance(40);
                let left = self.string(wide, depth);
                let right = if self.r.chance(20) { self.characters(wide, depth) } else { self.string(wide, depth) };
                wrap(ExprKind::Bin(op, boxed(left), boxed(right)))
            }
            5 => {
                let enums: Vec<Ty> = self.shapes.iter().map(|shape| shape.ty).filter(|ty| self.is_enum(*ty)).collect();
                let Some(ty) = self.r.pick(&enums).copied() else { return self.leaf(Kind::Bool) };
                let op = self.r.one_of(compare);
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

    pub(super) fn is_enum(&self, ty: Ty) -> bool {
        matches!(ty, Ty::N(id) if matches!(self.source.types[id].def, Def::Enum(..)))
    }

    /// A call of a function with a result type, if there is one.
    pub(super) fn call(&mut self, ty: Ty, _depth: usize) -> Option<Expr> {
        if self.is_pure {
            return None;
        }
        let fits = |unit: &usize| {
            let unit = &self.source.units[*unit];
            unit.kind == UnitKind::Function
                && unit.vars.first().is_some_and(|var| var.class == Class::Return && var.ty == ty)
        };
        let found: Vec<usize> = (0..self.source.units.len()).filter(fits).collect();
        let unit = *self.r.pick(&found)?;
        let params: Vec<(Class, Ty)> = self.source.units[unit].vars.iter().map(|var| (var.class, var.ty)).collect();
        let mut args = self.args(&params, 85)?;
        if self.is_single(ty) {
            self.enable(&mut args, 12);
        }
        Some(Expr { ty, kind: ExprKind::Call(unit, args) })
    }
}
