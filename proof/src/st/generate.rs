//! From a seed to a program: POUs and their statements.

use super::places::{Shape, is_plain};
use super::tree::{Arg, Base, Class, Def, Expr, ExprKind, Kind, Place, Source, Stmt, Ty, Unit, UnitKind, Value, Var};
use crate::random::Random;

/// A loop around the statement that is being made: control variable, its lowest and highest value.
pub(super) type Around = (usize, i128, i128);

/// How large a program is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Size {
    /// A few statements.
    Small,
    /// Some units, some dozens of statements.
    Usual,
    /// Many units.
    Large,
}

impl Size {
    /// The size of a seed's program: most are small, because what breaks mostly breaks there too.
    #[must_use]
    pub fn of(seed: u64) -> Size {
        match Random::new(seed ^ 0x7369_7A65).below(20) {
            0..=11 => Size::Small,
            12..=18 => Size::Usual,
            _ => Size::Large,
        }
    }

    /// One of three, by size.
    pub(super) fn pick<T>(self, small: T, usual: T, large: T) -> T {
        match self {
            Size::Small => small,
            Size::Usual => usual,
            Size::Large => large,
        }
    }
}

/// What is known while a program is made.
pub(super) struct Generator {
    pub r: Random,
    pub source: Source,
    /// The unit that is being made.
    pub unit: Unit,
    /// All places of the unit.
    pub shapes: Vec<Shape>,
    pub loops: Vec<Around>,
    /// Nothing that traps or stores may be made now.
    pub is_pure: bool,
    /// Statements that may still be made in the unit.
    pub budget: usize,
    pub size: Size,
    /// Whether a CONFIGURATION is made.
    pub configured: bool,
}

/// The program of a seed, which the compiler has to take: nothing in it traps by constants alone.
#[must_use]
pub fn generate(seed: u64) -> Source {
    let unit = Unit { name: String::new(), kind: UnitKind::Program, vars: Vec::new(), body: Vec::new(), gone: false };
    let mut generator = Generator {
        r: Random::new(seed),
        source: Source::default(),
        unit,
        shapes: Vec::new(),
        loops: Vec::new(),
        is_pure: false,
        budget: 0,
        size: Size::of(seed),
        configured: false,
    };
    generator.source.style = if generator.r.chance(70) { generator.r.bits() | 1 } else { 0 };
    generator.configured = generator.r.chance(25);
    generator.types();
    generator.globals();
    let most = generator.size.pick(2, 4, 7);
    for number in 0..generator.r.below(most) {
        generator.make_unit(UnitKind::Function, format!("f{number}"));
    }
    for number in 0..generator.r.below(most) {
        generator.make_unit(UnitKind::Block, format!("Block{number}"));
    }
    if generator.configured {
        generator.configuration();
    } else {
        generator.make_unit(UnitKind::Program, "main".to_string());
    }
    super::constants::settle(&mut generator.source);
    generator.source
}

impl Generator {
    pub(super) fn make_unit(&mut self, kind: UnitKind, name: String) {
        self.unit = Unit { name, kind, vars: Vec::new(), body: Vec::new(), gone: false };
        self.variables();
        self.shapes = self.all_shapes();
        let is_program = kind == UnitKind::Program;
        let share = if self.configured { 2 } else { 1 };
        self.budget = if is_program { self.size.pick(6, 24, 50) / share } else { self.size.pick(4, 9, 14) };
        let most = if is_program { self.size.pick(4, 14, 30) / share } else { self.size.pick(3, 5, 8) };
        let least = self.size.pick(1, 2, 4);
        let count = self.r.between(least, least.max(most as i64)) as usize;
        let mut body = self.list(count, 0);
        if let Some(result) = self.unit.vars.first().filter(|var| var.class == Class::Return).map(|var| var.ty) {
            let place = Place { base: Base::Var(0), steps: Vec::new(), ty: result };
            if let Some(value) = self.value(result, 3) {
                body.push(Stmt::Assign(place, value));
            }
        }
        self.unit.body = body;
        let made = self.unit.clone();
        let (is_block, name) = (kind == UnitKind::Block, made.name.clone());
        self.source.units.push(made);
        if is_block {
            self.block_types(name);
        }
    }

    /// Types of a block that has just been made: itself, perhaps an array or a structure with it.
    fn block_types(&mut self, name: String) {
        let def = Def::Block(self.source.units.len() - 1);
        self.source.types.push(super::tree::Type { name, def, gone: true });
        let block = Ty::N(self.source.types.len() - 1);
        if self.r.chance(40) {
            let low = self.r.between(-2, 1) as i32;
            let dims = vec![(low, low + self.r.between(1, 2) as i32)];
            let def = Def::Array(dims, block);
            self.source.types.push(super::tree::Type { name: String::new(), def, gone: false });
        } else if self.r.chance(40) {
            let count = Ty::K(self.kind());
            let fields = vec![("inner".to_string(), block, None), ("count".to_string(), count, None)];
            let name = format!("Holder{}", self.source.types.len());
            // It is declared after the units in the tree's order only; ST has no order.
            self.source.types.push(super::tree::Type { name, def: Def::Struct(fields), gone: false });
        }
    }

    pub(super) fn kind(&mut self) -> Kind {
        self.r.one_of(Kind::ALL)
    }

    fn list(&mut self, count: usize, depth: usize) -> Vec<Stmt> {
        let mut list = Vec::new();
        for _ in 0..count {
            if self.budget == 0 {
                break;
            }
            self.budget -= 1;
            list.extend(self.stmt(depth));
        }
        list
    }

    fn some(&mut self, depth: usize) -> Vec<Stmt> {
        let count = self.r.between(1, 3) as usize;
        self.list(count, depth + 1)
    }

    fn stmt(&mut self, depth: usize) -> Option<Stmt> {
        let nested = usize::from(depth < 3);
        let looping = usize::from(self.loops.len() < 2 && depth < 3);
        let leaving = usize::from(depth > 0);
        let weights = [40, 10 * nested, 6 * nested, 9 * looping, 4 * looping, 4 * looping, 14, 3 * leaving, 6, 4, 3];
        match self.r.weighted(&weights) {
            0 => self.assign(),
            1 => {
                let mut branches = Vec::new();
                for _ in 0..self.r.between(1, 3) {
                    let condition = self.expr(Kind::Bool, 3);
                    branches.push((condition, self.some(depth)));
                }
                let otherwise = if self.r.chance(40) { self.some(depth) } else { Vec::new() };
                Some(Stmt::If(branches, otherwise))
            }
            2 => self.case(depth),
            3 => Some(self.for_loop(depth)),
            4 => {
                let counter = self.reserve(Kind::Dint);
                let condition = self.expr(Kind::Bool, 2);
                let limit = self.r.between(1, 6);
                let body = self.looped((counter, 1, i128::from(limit)), depth);
                Some(Stmt::While(counter, limit, condition, body))
            }
            5 => {
                let counter = self.reserve(Kind::Dint);
                let condition = self.expr(Kind::Bool, 2);
                let limit = self.r.between(1, 6);
                let body = self.looped((counter, 1, i128::from(limit)), depth);
                Some(Stmt::Repeat(counter, limit, condition, body))
            }
            6 => self.call_block(),
            7 => {
                let condition = self.expr(Kind::Bool, 2);
                let leave = match self.r.below(5) {
                    0 => Stmt::Return,
                    1 | 2 if !self.loops.is_empty() => Stmt::Exit,
                    _ if !self.loops.is_empty() => Stmt::Continue,
                    _ => Stmt::Return,
                };
                Some(Stmt::If(vec![(condition, vec![leave])], Vec::new()))
            }
            8 => self.copy(),
            9 => self.call_function(),
            _ => self.split(),
        }
    }

    /// A function for what it does, whether it has a result or not.
    fn call_function(&mut self) -> Option<Stmt> {
        let functions = (0..self.source.units.len()).filter(|at| self.source.units[*at].kind == UnitKind::Function);
        let functions: Vec<usize> = functions.collect();
        let unit = *self.r.pick(&functions)?;
        let params: Vec<(Class, Ty)> = self.source.units[unit].vars.iter().map(|var| (var.class, var.ty)).collect();
        let mut args = self.args(&params, 85)?;
        self.enable(&mut args, 15);
        Some(Stmt::Do(unit, args))
    }

    /// Sometimes an EN before the arguments and an ENO behind them.
    pub(super) fn enable(&mut self, args: &mut Vec<Arg>, percent: usize) {
        if !self.r.chance(percent) {
            return;
        }
        let was = std::mem::replace(&mut self.is_pure, true);
        let condition = self.expr(Kind::Bool, 2);
        let eno = self.place(Ty::K(Kind::Bool), true).filter(is_plain);
        self.is_pure = was;
        args.insert(0, Arg::En(condition));
        args.extend(eno.filter(|_| self.r.chance(60)).map(Arg::Eno));
    }

    /// A whole structure or array to another of its type.
    fn copy(&mut self) -> Option<Stmt> {
        let wanted: Vec<Ty> = self
            .shapes
            .iter()
            .filter(|shape| shape.is_writable && self.is_copyable(shape.ty) && self.source.plain(shape.ty) == shape.ty)
            .map(|shape| shape.ty)
            .filter(|ty| matches!(ty, Ty::N(_)))
            .collect();
        let ty = *self.r.pick(&wanted)?;
        let was = std::mem::replace(&mut self.is_pure, true);
        let target = self.address_of(ty, true);
        let is_indexed = target.as_ref().is_some_and(|place| !is_plain(place));
        self.is_pure = was || is_indexed;
        let value = self.value(ty, 2);
        self.is_pure = was;
        Some(Stmt::Assign(target?, value?))
    }

    fn assign(&mut self) -> Option<Stmt> {
        let globals: Vec<usize> = (0..self.shapes.len()).filter(|at| self.shapes[*at].is_global()).collect();
        // What functions do to globals while an expression is evaluated shows in which order it is.
        let any = self.r.below(self.shapes.len());
        let is_function = self.unit.kind == UnitKind::Function;
        let ranges = (0..self.shapes.len()).filter(|at| self.source.plain(self.shapes[*at].ty) != self.shapes[*at].ty);
        let ranges: Vec<usize> = ranges.collect();
        let at = if self.r.chance(20) { self.r.pick(&ranges).copied() } else { None };
        let at =
            at.or_else(|| self.r.pick(&globals).copied().filter(|_| is_function && self.r.chance(50))).unwrap_or(any);
        let ty = self.shapes.get(at).filter(|shape| shape.is_writable).map(|shape| shape.ty)?;
        if !self.is_single(ty) {
            return self.copy();
        }
        // Either the place may trap, or the value may do something: nothing tells which of the two comes first.
        let place_is_safe = self.r.chance(85);
        let was = self.is_pure;
        self.is_pure |= place_is_safe;
        let place = self.place(ty, true);
        self.is_pure = was || !place_is_safe;
        let is_indexed = place.as_ref().is_some_and(|place| !is_plain(place));
        self.is_pure |= is_indexed && self.r.chance(50);
        let no_calls = is_indexed;
        let value = if no_calls { self.without_calls(ty) } else { self.value(ty, 4) };
        self.is_pure = was;
        let (place, mut value) = (place?, value?);
        self.settle_eno(&place, &mut value);
        Some(Stmt::Assign(place, value))
    }

    /// Whether the result or ENO is stored first is left open: no ENO that may be where the result goes.
    fn settle_eno(&self, target: &Place, value: &mut Expr) {
        match &mut value.kind {
            ExprKind::Widen(inner) => self.settle_eno(target, inner),
            ExprKind::Call(_, args) => args.retain(|arg| {
                let Arg::Eno(place) = arg else { return true };
                let Base::Var(at) = place.base else { return false };
                let var = &self.unit.vars[at];
                place.base != target.base && var.class != Class::InOut && var.at.is_none()
            }),
            _ => {}
        }
    }

    /// A value that may trap but stores nothing: indices of the target were evaluated before it, or after.
    fn without_calls(&mut self, ty: Ty) -> Option<Expr> {
        let units = std::mem::take(&mut self.source.units);
        let value = self.value(ty, 3);
        self.source.units = units;
        value
    }

    fn case(&mut self, depth: usize) -> Option<Stmt> {
        let enums: Vec<usize> =
            (0..self.source.types.len()).filter(|id| matches!(self.source.types[*id].def, Def::Enum(..))).collect();
        if let Some(id) = self.r.pick(&enums).copied().filter(|_| self.r.chance(40)) {
            let Def::Enum(_, values) = self.source.types[id].def.clone() else { return None };
            let selector = self.value(Ty::N(id), 2)?;
            let mut branches = Vec::new();
            for (_, value) in values.iter().take(2) {
                branches.push((vec![(i128::from(*value), i128::from(*value))], self.some(depth)));
            }
            let otherwise = if self.r.chance(50) { self.some(depth) } else { Vec::new() };
            return Some(Stmt::Case(selector, branches, otherwise));
        }
        let kind = if self.r.chance(15) { self.r.one_of(Kind::BITS) } else { self.r.one_of(Kind::INTEGERS) };
        let (low, high) = kind.limits();
        let selector = self.expr(kind, 2);
        let mut from = if self.r.chance(20) { low } else { i128::from(self.r.between(-3, 2)).max(low) };
        let mut branches = Vec::new();
        for _ in 0..self.r.between(1, 4) {
            let mut labels = Vec::new();
            for _ in 0..self.r.between(1, 2) {
                let span = if self.r.chance(30) { i128::from(self.r.between(1, 40)) } else { 0 };
                labels.push((from, from + span));
                from += span + i128::from(self.r.between(1, 3));
            }
            if from < high {
                branches.push((labels, self.some(depth)));
            }
        }
        let otherwise = if self.r.chance(50) { self.some(depth) } else { Vec::new() };
        if branches.is_empty() {
            return None;
        }
        Some(Stmt::Case(selector, branches, otherwise))
    }

    fn reserve(&mut self, kind: Kind) -> usize {
        let name = format!("k{}", self.unit.vars.len());
        let class = if self.unit.kind != UnitKind::Function && self.r.chance(50) { Class::Temp } else { Class::Var };
        self.unit.vars.push(Var {
            name,
            ty: Ty::K(kind),
            class,
            init: None,
            reserved: true,
            at: None,
            retain: false,
            edge: None,
            gone: false,
        });
        self.unit.vars.len() - 1
    }

    fn looped(&mut self, around: Around, depth: usize) -> Vec<Stmt> {
        self.loops.push(around);
        let body = self.some(depth);
        self.loops.pop();
        body
    }

    fn for_loop(&mut self, depth: usize) -> Stmt {
        let kind = self.r.one_of(Kind::INTEGERS);
        let control = self.reserve(kind);
        let (low, high) = kind.limits();
        let counts_down = kind.is_signed() && self.r.chance(30);
        let step = i128::from(self.r.between(1, 3)) * if counts_down { -1 } else { 1 };
        let span = i128::from(self.r.between(0, 6));
        let from = match self.r.below(5) {
            0 if counts_down => low + span,
            0 => high - span,
            _ => i128::from(self.r.between(-2, 4)).max(low),
        };
        let to = (from + span * step.signum()).clamp(low, high);
        let lit = |value: i128| Expr { ty: Ty::K(kind), kind: ExprKind::Lit(Value::Int(value), true) };
        let plain = |value: i128| Expr { ty: Ty::K(kind), kind: ExprKind::Lit(Value::Int(value), false) };
        let first = if self.r.chance(50) { lit(from) } else { plain(from) };
        let bound = if self.r.chance(30) {
            // A bound that is only known at run time, between the first value and the last.
            let (least, most) = (from.min(to), from.max(to));
            let inner = self.expr(kind, 2);
            let inputs = vec![lit(least), inner, lit(most)];
            Expr { ty: Ty::K(kind), kind: ExprKind::Std(super::functions::Function::Limit, inputs) }
        } else {
            plain(to)
        };
        let by = match (step, self.r.below(4)) {
            (1, 0..=2) => None,
            (1, _) if kind.is_signed() => {
                // 0 traps, -1 ends at once unless the bound is behind, where a few steps lead to it.
                let inner = self.expr(kind, 1);
                let inputs = vec![lit(if self.r.chance(10) { 0 } else { 1 }), inner, lit(2)];
                Some(Expr { ty: Ty::K(kind), kind: ExprKind::Std(super::functions::Function::Limit, inputs) })
            }
            _ => Some(plain(step)),
        };
        let body = self.looped((control, from.min(to), from.max(to)), depth);
        Stmt::For(control, first, bound, by, body)
    }

    fn call_block(&mut self) -> Option<Stmt> {
        let is_block =
            |ty: Ty| matches!(ty, Ty::N(id) if matches!(self.source.types[id].def, Def::Block(_) | Def::Standard(_)));
        let wanted: Vec<Ty> = self.shapes.iter().map(|shape| shape.ty).filter(|ty| is_block(*ty)).collect();
        let ty = *self.r.pick(&wanted)?;
        let Ty::N(id) = ty else { return None };
        let params: Vec<(Class, Ty)> = match &self.source.types[id].def {
            Def::Block(unit) => self.source.units[*unit].vars.iter().map(|var| (var.class, var.ty)).collect(),
            Def::Standard(standard) => {
                let class = |is_input: bool| if is_input { Class::Input } else { Class::Output };
                standard.fields().iter().map(|(_, kind, is_input)| (class(*is_input), Ty::K(*kind))).collect()
            }
            _ => return None,
        };
        // What is stored in the block when a later argument traps is left open: nothing here traps.
        let was = std::mem::replace(&mut self.is_pure, true);
        let place = self.address_of(ty, false);
        let mut args = self.args(&params, 80);
        if let Some(args) = &mut args {
            self.enable(args, 8);
        }
        self.is_pure = was;
        if matches!(self.source.types[id].def, Def::Standard(_)) {
            args.iter_mut().flatten().for_each(no_negative_time);
        }
        Some(Stmt::Call(place?, args?))
    }

    /// Arguments; none when a VAR_IN_OUT finds no variable.
    pub(super) fn args(&mut self, params: &[(Class, Ty)], given: usize) -> Option<Vec<Arg>> {
        let mut args = Vec::new();
        for (at, (class, ty)) in params.iter().enumerate() {
            match class {
                // What is no single value has no default to fall back to.
                Class::Input if !self.is_single(*ty) || self.r.chance(given) => {
                    let value = self.value(*ty, 2)?;
                    args.push(Arg::In(at, value));
                }
                Class::InOut => {
                    let place = self.address_of(*ty, true)?;
                    if self.is_bit(&place) {
                        return None;
                    }
                    args.push(Arg::InOut(at, place));
                }
                Class::Output if self.r.chance(40) => {
                    let was = std::mem::replace(&mut self.is_pure, true);
                    let target = self.place(*ty, true);
                    self.is_pure = was;
                    if let Some(target) = target.filter(is_plain) {
                        args.push(Arg::Out(at, target));
                    }
                }
                _ => {}
            }
        }
        Some(args)
    }

    /// Whether a place is a bit of the process image, which has no address.
    fn is_bit(&self, place: &Place) -> bool {
        let located = match place.base {
            Base::Var(at) => self.unit.vars[at].at.is_some(),
            Base::Global(at) => self.source.globals[at].at.is_some(),
            Base::Direct(_) => true,
        };
        located && place.ty == Ty::K(Kind::Bool)
    }
}

/// The standard's figures say nothing of a timer with a negative time.
fn no_negative_time(arg: &mut Arg) {
    if let Arg::In(_, value) = arg
        && matches!(value.ty, Ty::K(Kind::Time | Kind::Ltime))
    {
        let zero = Expr { ty: value.ty, kind: ExprKind::Lit(Value::Int(0), true) };
        let inputs = vec![zero, value.clone()];
        value.kind = ExprKind::Std(super::functions::Function::Max, inputs);
    }
}
