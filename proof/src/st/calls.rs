//! Calls of standard functions, conversions, and strings.

use khz_machine::library::functions::{FunctionRow, ResultRule, TABLE, TypeClass};

use super::expression::{boxed, lit};
use super::functions::{Function, compares, row, takes};
use super::generate::Generator;
use super::moments;
use super::places::is_plain;
use super::tree::{Arg, Class, Expr, ExprKind, Kind, Op, Stmt, Ty, UnitKind, Value};

/// Whether a function can give a type.
fn gives(row: &FunctionRow, kind: Kind) -> bool {
    let generic = || row.parameters.iter().filter(|parameter| parameter.class.is_generic());
    match row.result {
        ResultRule::Bool => kind == Kind::Bool,
        ResultRule::Int => kind == Kind::Int,
        ResultRule::Generic => {
            generic().all(|parameter| takes(parameter.class, kind) || row.function == Function::Expt) && {
                // The remainder of a duration is not defined; EXPT gives what its base is.
                row.function != Function::Expt || kind.is_real()
            }
        }
        ResultRule::Of(ty) => moments::kind_of(ty) == Some(kind),
        // What it gives hangs on the place: see `conversion`.
        ResultRule::WantedInteger | ResultRule::String | ResultRule::Dint | ResultRule::Nothing => false,
    }
}

fn std(kind: Kind, function: Function, inputs: Vec<Expr>) -> Expr {
    Expr { ty: Ty::K(kind), kind: ExprKind::Std(function, inputs) }
}

impl Generator {
    /// A standard function or a conversion of a result type.
    pub(super) fn function(&mut self, kind: Kind, depth: usize) -> Expr {
        if self.r.chance(30) {
            return self.conversion(kind, depth);
        }
        let rows: Vec<&FunctionRow> = TABLE.iter().filter(|row| gives(row, kind)).collect();
        let Some(row) = self.r.pick(&rows).copied() else { return self.leaf(kind) };
        let function = row.function;
        match function {
            _ if compares(function) => self.comparison(row, depth),
            _ if moments::result(function).is_some() => self.of_moments(row, kind, depth),
            Function::IsValid | Function::IsValidBcd => {
                let class = row.parameters[0].class;
                let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(|kind| takes(class, *kind)).collect();
                let of = self.r.pick(&kinds).copied().unwrap_or(kind);
                std(kind, function, vec![self.expr(of, depth)])
            }
            Function::Len => {
                let wide = self.r.chance(40);
                std(kind, function, vec![self.string(wide, depth)])
            }
            Function::Find => {
                let wide = self.r.chance(40);
                let wanted = self.r.one_of(["a", "1", "ab", "A0", "", ".", "1.0", "\u{e9}"]).encode_utf16().collect();
                let text = self.string(wide, depth);
                let wanted = if self.r.chance(80) {
                    Expr { ty: Ty::text(wide, 3), kind: ExprKind::Lit(Value::Str(wanted), false) }
                } else {
                    self.string(wide, 0)
                };
                std(kind, function, vec![text, wanted])
            }
            Function::Div | Function::Mod if !kind.is_real() && !kind.is_duration() => {
                let left = self.expr(kind, depth);
                let right = self.divisor(kind, depth);
                std(kind, function, vec![left, right])
            }
            Function::Mul | Function::Div if kind.is_duration() => {
                let time = self.expr(kind, depth);
                let (op, number) = self.factor(depth);
                std(kind, if op == Op::Mul { Function::Mul } else { Function::Div }, vec![time, number])
            }
            Function::Expt => {
                let base = self.expr(kind, depth);
                let exponent = self.exponent(kind, depth);
                std(kind, function, vec![base, exponent])
            }
            _ => self.generic(row, kind, depth),
        }
    }

    /// A function of table 35 or 36 with types of its own; or ADD or SUB of the same.
    fn of_moments(&mut self, row: &FunctionRow, kind: Kind, depth: usize) -> Expr {
        if matches!(row.function, Function::Multime | Function::Divtime) {
            let op = if row.function == Function::Multime { Op::Mul } else { Op::Div };
            let time = self.expr(kind, depth);
            let number = self.factor_of(op, depth);
            return std(kind, row.function, vec![time, number]);
        }
        if row.name.starts_with("SUB") && self.r.chance(30) {
            let (function, (left, right)) = match kind {
                Kind::Time | Kind::Ltime => (Function::Sub, self.apart(kind, depth)),
                _ => (self.r.one_of([Function::Add, Function::Sub]), self.with_duration(kind, depth)),
            };
            return std(kind, function, vec![left, right]);
        }
        let mut inputs = Vec::new();
        let fine = self.r.below(3);
        for parameter in row.parameters {
            inputs.push(match parameter.class {
                TypeClass::Of(ty) => {
                    let wanted = moments::kind_of(ty).unwrap_or(kind);
                    match self.value(Ty::K(wanted), depth) {
                        Some(value) => value,
                        None => self.leaf(wanted),
                    }
                }
                // Those at the end may be left out.
                TypeClass::FinePart if inputs.len() + fine >= row.parameters.len() => break,
                _ => self.calendar_part(depth),
            });
        }
        std(kind, row.function, inputs)
    }

    /// A date or time of day into its parts: some of them, mostly in their order.
    pub(super) fn split(&mut self) -> Option<Stmt> {
        let rows: Vec<&FunctionRow> = TABLE.iter().filter(|row| moments::splits(row.function).is_some()).collect();
        let row = self.r.pick(&rows).copied()?;
        let kind = moments::splits(row.function)?;
        let mut args = vec![Arg::In(0, self.value(Ty::K(kind), 3)?)];
        let given = self.r.one_of([30, 60, 100]);
        for number in 1..=row.outputs.len() {
            if !self.r.chance(given) {
                continue;
            }
            let was = std::mem::replace(&mut self.is_pure, true);
            let target = (0..4).find_map(|_| {
                let kind = self.r.one_of(Kind::INTEGERS);
                self.place(Ty::K(kind), true).filter(is_plain)
            });
            self.is_pure = was;
            args.extend(target.map(|place| Arg::Out(number, place)));
        }
        if self.r.chance(10) {
            args.reverse();
        }
        self.enable(&mut args, 12);
        Some(Stmt::Split(row.function, args))
    }

    /// A year, a month, an hour …, mostly one that there is.
    fn calendar_part(&mut self, depth: usize) -> Expr {
        if self.r.chance(70) {
            let number = self.r.one_of([0, 1, 2, 11, 12, 13, 28, 29, 30, 31, 59, 60, 999, 1900, 1970, 2000, 2024, -1]);
            return lit(Kind::Int, Value::Int(number), self.r.chance(50));
        }
        let kind = self.r.one_of(Kind::INTEGERS);
        self.expr(kind, depth)
    }

    /// What is not nothing, so that no division traps, or anything.
    fn divisor(&mut self, kind: Kind, depth: usize) -> Expr {
        if !self.is_pure && self.r.chance(20) {
            return self.expr(kind, depth);
        }
        let value = match self.number(kind) {
            Value::Int(0) => Value::Int(3),
            other => other,
        };
        lit(kind, value, true)
    }

    /// A power's exponent: of any type of number that is brought to the type of the base.
    pub(super) fn exponent(&mut self, kind: Kind, depth: usize) -> Expr {
        let from = match self.r.below(4) {
            0 if kind == Kind::Lreal => Kind::Real,
            1 | 2 => self.r.one_of(Kind::INTEGERS),
            _ => return self.expr(kind, depth),
        };
        let inner = self.expr(from, depth);
        Expr { ty: Ty::K(kind), kind: ExprKind::Widen(boxed(inner)) }
    }

    /// A function by the classes of its parameters: the generic ones have the type of the result.
    fn generic(&mut self, row: &FunctionRow, kind: Kind, depth: usize) -> Expr {
        let more = if row.extensible { self.r.weighted(&[5, 3, 1]) } else { 0 };
        let last = row.parameters.len() - 1;
        let mut inputs: Vec<Expr> = Vec::new();
        let mut first: Option<usize> = None;
        for at in 0..row.parameters.len() + more {
            let input = match row.parameters[at.min(last)].class {
                TypeClass::Bool => self.expr(Kind::Bool, depth),
                TypeClass::Count => self.count(i64::from(kind.bits()), depth),
                // An integer where only floats are taken becomes an LREAL.
                TypeClass::AnyReal if kind == Kind::Lreal && row.parameters.len() == 1 && self.r.chance(15) => {
                    let from = self.r.one_of(Kind::INTEGERS);
                    let inner = self.expr(from, depth);
                    Expr { ty: Ty::K(kind), kind: ExprKind::Widen(boxed(inner)) }
                }
                _ => {
                    let known: Option<Expr> = first.map(|at| inputs[at].clone());
                    first = first.or(Some(at));
                    match known {
                        Some(known) => self.other(row.parameters[at.min(last)].class, kind, &known, depth),
                        None => self.expr(kind, depth),
                    }
                }
            };
            inputs.push(input);
        }
        std(kind, row.function, inputs)
    }

    /// A further generic input, of a type that the class takes too.
    fn other(&mut self, class: TypeClass, kind: Kind, known: &Expr, depth: usize) -> Expr {
        let found = self.right(kind, known, depth);
        match &found.kind {
            ExprKind::Widen(inner) if !matches!(inner.ty, Ty::K(from) if takes(class, from)) => self.expr(kind, depth),
            _ => found,
        }
    }

    /// A count of bits or characters, a position or a selector; mostly a small one.
    fn count(&mut self, most: i64, depth: usize) -> Expr {
        if self.r.chance(65) {
            let count = self.r.between(-1, most + 2);
            return lit(Kind::Int, Value::Int(i128::from(count)), false);
        }
        let kind = if self.r.chance(50) { Kind::Usint } else { self.r.one_of(Kind::INTEGERS) };
        self.expr(kind, depth)
    }

    /// Two or more values compared as functions do.
    fn comparison(&mut self, row: &FunctionRow, depth: usize) -> Expr {
        let more = if row.extensible { self.r.weighted(&[5, 2, 1]) } else { 0 };
        let mut inputs = Vec::new();
        if self.r.chance(15) {
            let wide = self.r.chance(40);
            for _ in 0..2 + more {
                inputs.push(self.string(wide, depth.min(1)));
            }
        } else {
            let kind = self.kind();
            for _ in 0..2 + more {
                inputs.push(self.expr(kind, depth));
            }
        }
        std(Kind::Bool, row.function, inputs)
    }

    /// A string that no integer type overflows at.
    fn place_of_short_string(&mut self) -> Option<Expr> {
        let ty = Ty::text(self.r.chance(40), self.r.one_of([2, 5, 8]));
        let place = self.place(ty, false)?;
        Some(Expr { ty, kind: ExprKind::Get(place) })
    }

    pub(super) fn conversion(&mut self, kind: Kind, depth: usize) -> Expr {
        let wrap = |inner: Expr| Expr { ty: Ty::K(kind), kind: ExprKind::Conv(boxed(inner)) };
        if self.r.chance(15) {
            let is_whole = kind.is_integer() || kind.is_bits();
            let text = if is_whole {
                self.place_of_short_string()
            } else {
                let wide = self.r.chance(40);
                Some(self.string(wide, depth))
            };
            return text.map_or_else(|| self.leaf(kind), wrap);
        }
        if self.r.chance(8) {
            let enums: Vec<Ty> = self.shapes.iter().map(|shape| shape.ty).filter(|ty| self.is_enum(*ty)).collect();
            if let Some(ty) = self.r.pick(&enums).copied()
                && let Some(value) = self.value(ty, 1)
            {
                return wrap(value);
            }
        }
        if kind != Kind::Dint && self.r.chance(8) {
            // TRUNC gives a DINT where a DINT is wanted.
            let from = self.r.one_of([Kind::Real, Kind::Lreal]);
            let inner = self.expr(from, depth);
            return wrap(std(Kind::Dint, Function::Trunc, vec![inner]));
        }
        if self.r.chance(6)
            && let Some(bound) = self.bound(if kind == Kind::Dint { Kind::Lint } else { Kind::Dint })
        {
            return wrap(bound);
        }
        if kind != Kind::Dint && self.r.chance(6) {
            // DAY_OF_WEEK gives a DINT there, too.
            let of = self.r.one_of([Kind::Ldate, Kind::Ldate, Kind::Date]);
            let inner = self.expr(of, depth);
            return wrap(std(Kind::Dint, Function::DayOfWeek, vec![inner]));
        }
        let from = self.kind();
        let results = self.source.units.iter().filter(|unit| unit.kind == UnitKind::Function);
        let result =
            |class: Class, ty: Ty| if let (Class::Return, Ty::K(kind)) = (class, ty) { Some(kind) } else { None };
        let results: Vec<Kind> =
            results.filter_map(|unit| unit.vars.first().and_then(|var| result(var.class, var.ty))).collect();
        let wanted = self.r.pick(&results).copied();
        if let Some(result) = wanted.filter(|from| *from != kind && from.converts(kind) && self.r.chance(50))
            && let Some(call) = self.call(Ty::K(result), depth)
        {
            return wrap(call);
        }
        if from == kind || !from.converts(kind) {
            return self.leaf(kind);
        }
        let inner = self.expr(from, depth);
        let cut = from.is_real() && kind.is_integer() && self.r.chance(40);
        if cut { Expr { ty: Ty::K(kind), kind: ExprKind::Trunc(boxed(inner)) } } else { wrap(inner) }
    }

    /// A CHAR where a STRING is wanted, or a WCHAR where a WSTRING is.
    pub(super) fn characters(&mut self, wide: bool, depth: usize) -> Expr {
        let inner = self.expr(if wide { Kind::Wchar } else { Kind::Char }, depth);
        Expr { ty: Ty::text(wide, 1), kind: ExprKind::Widen(boxed(inner)) }
    }

    /// A STRING or a WSTRING.
    pub(super) fn string(&mut self, wide: bool, depth: usize) -> Expr {
        let capacity = self.r.one_of([1, 2, 5, 8, 12, 20]);
        if depth == 0 || self.r.chance(40) {
            let ty = Ty::text(wide, capacity);
            let read = if self.r.chance(75) { self.place(ty, false) } else { None };
            return match read {
                Some(place) => Expr { ty, kind: ExprKind::Get(place) },
                None => {
                    let text = self.text(wide, 12);
                    Expr { ty: Ty::text(wide, 12), kind: ExprKind::Lit(Value::Str(text), self.r.chance(15)) }
                }
            };
        }
        let d = depth - 1;
        if self.r.chance(15)
            && let Some(call) = self.call(Ty::text(wide, capacity), d)
        {
            return call;
        }
        if self.r.chance(20) {
            let inner = if self.r.chance(25) {
                self.string(!wide, d.min(1))
            } else {
                let kind = self.kind();
                self.expr(kind, d)
            };
            return Expr { ty: Ty::text(wide, 80), kind: ExprKind::Conv(boxed(inner)) };
        }
        let takes_text = |row: &&FunctionRow| {
            let chooses = row.result == ResultRule::Generic
                && row.parameters.iter().any(|parameter| parameter.class == TypeClass::AnyElementary);
            row.result == ResultRule::String || chooses
        };
        let rows: Vec<&FunctionRow> = TABLE.iter().filter(takes_text).collect();
        let Some(found) = self.r.pick(&rows).copied() else { return self.string(wide, 0) };
        let more = if found.extensible && self.r.chance(25) { 1 } else { 0 };
        let mut inputs = Vec::new();
        let last = found.parameters.len() - 1;
        for at in 0..found.parameters.len() + more {
            inputs.push(match found.parameters[at.min(last)].class {
                TypeClass::Bool => self.expr(Kind::Bool, d),
                TypeClass::Count => self.count(9, d),
                TypeClass::AnyChars if self.r.chance(20) => self.characters(wide, 0),
                _ => self.string(wide, if at == 0 { d.min(1) } else { 0 }),
            });
        }
        debug_assert_eq!(row(found.function).name, found.name);
        Expr { ty: Ty::text(wide, 80), kind: ExprKind::Std(found.function, inputs) }
    }
}
