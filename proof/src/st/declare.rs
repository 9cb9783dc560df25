//! Types, globals and variables of a program.

use super::blocks::Standard;
use super::generate::Generator;
use super::tree::{At, Class, Def, Edge, Kind, Source, Ty, Type, UnitKind, Value, Var};

impl Generator {
    pub(super) fn types(&mut self) {
        let blocks = Standard::all();
        for _ in 0..self.size.pick(3, 8, 12) {
            let def = Def::Standard(*self.r.pick(&blocks).unwrap_or(&blocks[0]));
            self.source.types.push(Type { name: String::new(), def, gone: true });
        }
        let (least, most) = self.size.pick((0, 2), (2, 7), (4, 10));
        for number in 0..self.r.between(least, most) {
            let (name, def) = match self.r.below(6) {
                0 => {
                    let base = if self.r.chance(40) { Some(self.r.one_of(Kind::INTEGERS)) } else { None };
                    let (lowest, highest) = base.unwrap_or(Kind::Int).limits();
                    let mut value = self.r.between(-3, 3).max(lowest.max(-3) as i64);
                    if self.r.chance(20) {
                        // Its last values are the last of the type.
                        value = i64::try_from(highest).unwrap_or(i64::MAX) - 24;
                    }
                    let mut values = Vec::new();
                    for member in 0..self.r.between(2, 4) {
                        values.push((format!("e{number}_{member}"), value));
                        value += self.r.between(1, 5);
                    }
                    (format!("Enum{number}"), Def::Enum(base, values))
                }
                1 => {
                    let kind = self.r.one_of(Kind::INTEGERS);
                    let (low, high) = kind.limits();
                    let least = i128::from(self.r.between(-10, 5)).max(low);
                    let most =
                        if self.r.chance(20) { high } else { (least + i128::from(self.r.between(1, 60))).min(high) };
                    (format!("Range{number}"), Def::Subrange(kind, least, most))
                }
                2 | 3 => {
                    let mut fields = Vec::new();
                    for field in 0..self.r.between(1, 4) {
                        let ty = self.any_type(field == 0);
                        let init = self.init(ty, 40);
                        fields.push((format!("m{field}"), ty, init));
                    }
                    (format!("Struct{number}"), Def::Struct(fields))
                }
                _ => {
                    let element = self.any_type(false);
                    let mut dims = Vec::new();
                    for _ in 0..self.r.weighted(&[0, 6, 3, 1]) {
                        let low = self.r.between(-3, 2) as i32;
                        dims.push((low, low + self.r.between(0, 3) as i32));
                    }
                    let name = if self.r.chance(60) { format!("Array{number}") } else { String::new() };
                    (name, Def::Array(dims, element))
                }
            };
            self.source.types.push(Type { name, def, gone: false });
            let last = Ty::N(self.source.types.len() - 1);
            if self.size(last) > 60 {
                self.source.types.pop();
            }
        }
    }

    /// How many single values a type has.
    fn size(&self, ty: Ty) -> usize {
        let mut found = Vec::new();
        self.source.leaves("", ty, &self.source.initial(ty), &mut found);
        found.len()
    }

    /// A type that may be a part of another.
    fn any_type(&mut self, plain: bool) -> Ty {
        match self.r.weighted(&[60, 12, if plain { 0 } else { 40 }]) {
            0 => Ty::K(self.kind()),
            1 => Ty::text(self.r.chance(40), self.capacity()),
            _ => {
                let count = self.source.types.len();
                Ty::N(self.r.below(count))
            }
        }
    }

    fn capacity(&mut self) -> u16 {
        self.r.one_of([1, 2, 5, 8, 12, 20])
    }

    fn init(&mut self, ty: Ty, percent: usize) -> Option<Value> {
        if !self.r.chance(percent) {
            return None;
        }
        match ty {
            Ty::K(kind) => Some(self.number(kind)),
            Ty::S(capacity) | Ty::W(capacity) => Some(Value::Str(self.text(ty.is_wide(), usize::from(capacity)))),
            Ty::N(id) => match self.source.types[id].def.clone() {
                Def::Enum(_, values) => self.r.pick(&values).map(|(_, value)| Value::Int(i128::from(*value))),
                Def::Subrange(_, low, high) => Some(Value::Int(if self.r.chance(50) { low } else { high })),
                Def::Array(dims, element) => {
                    let mut parts = Vec::new();
                    for _ in 0..Source::elements(&dims) {
                        parts.push(self.init(element, 100)?);
                    }
                    Some(Value::Many(parts))
                }
                Def::Struct(fields) => {
                    let mut parts = Vec::new();
                    for (_, ty, _) in fields {
                        parts.push(self.init(ty, 100)?);
                    }
                    Some(Value::Many(parts))
                }
                Def::Block(_) | Def::Standard(_) => None,
            },
        }
    }

    pub(super) fn globals(&mut self) {
        let (least, most) = self.size.pick((0, 2), (0, 4), (2, 8));
        for number in 0..self.r.between(least, most) {
            let ty = self.any_type(false);
            self.global(format!("g{number}"), ty);
        }
    }

    /// A global: sometimes CONSTANT, RETAIN, or in the process image.
    pub(super) fn global(&mut self, name: String, ty: Ty) {
        let class = if matches!(ty, Ty::K(_)) && self.r.chance(8) { Class::Constant } else { Class::Var };
        let at = if class == Class::Var { self.located(ty, 15) } else { None };
        let init = if at.is_some() { None } else { self.init(ty, if class == Class::Constant { 100 } else { 50 }) };
        let retain = class == Class::Var && at.is_none() && self.r.chance(10);
        self.source.globals.push(Var { name, ty, class, init, reserved: false, at, retain, edge: None, gone: false });
    }

    /// Sometimes an address. Floats have none, because bits from outside need be no number that the language knows.
    fn located(&mut self, ty: Ty, percent: usize) -> Option<At> {
        match ty {
            Ty::K(kind) if !kind.is_real() && self.r.chance(percent) => Some(self.address(kind)),
            _ => None,
        }
    }

    fn declare(&mut self, name: String, ty: Ty, class: Class) {
        let percent = match class {
            Class::InOut | Class::Return => 0,
            Class::Constant => 100,
            _ => 50,
        };
        let is_program = self.unit.kind == UnitKind::Program;
        let at = if is_program && class == Class::Var { self.located(ty, 6) } else { None };
        let init = if at.is_some() { None } else { self.init(ty, percent) };
        let may_retain = self.unit.kind != UnitKind::Function && class == Class::Var && at.is_none();
        let retain = may_retain && self.r.chance(8);
        self.unit.vars.push(Var { name, ty, class, init, reserved: false, at, retain, edge: None, gone: false });
    }

    /// Whether values of a type may be assigned whole.
    pub(super) fn is_copyable(&self, ty: Ty) -> bool {
        match ty {
            Ty::N(id) => match &self.source.types[id].def {
                Def::Struct(fields) => fields.iter().all(|(_, ty, _)| self.is_copyable(*ty)),
                // Of arrays without a name only one and the same would do.
                Def::Array(_, element) => !self.source.types[id].name.is_empty() && self.is_copyable(*element),
                Def::Enum(..) | Def::Subrange(..) => true,
                Def::Block(_) | Def::Standard(_) => false,
            },
            _ => true,
        }
    }

    /// Whether a type is no composite.
    pub(super) fn is_single(&self, ty: Ty) -> bool {
        !matches!(self.source.plain(ty), Ty::N(id) if !matches!(self.source.types[id].def, Def::Enum(..)))
    }

    fn single_type(&mut self) -> Ty {
        for _ in 0..4 {
            let ty = self.any_type(false);
            if self.is_single(ty) && self.source.plain(ty) == ty {
                return ty;
            }
        }
        Ty::K(self.kind())
    }

    /// Mostly a type that is no composite, else one that is passed and returned whole.
    fn whole_type(&mut self) -> Ty {
        let ty = self.any_type(false);
        let is_whole = self.is_copyable(ty) && self.source.plain(ty) == ty;
        if is_whole && self.r.chance(30) { ty } else { self.single_type() }
    }

    pub(super) fn variables(&mut self) {
        let kind = self.unit.kind;
        if kind == UnitKind::Function && self.r.chance(88) {
            let (name, ty) = (self.unit.name.clone(), self.whole_type());
            self.declare(name, ty, Class::Return);
        }
        // What runs at startup takes nothing.
        let takes = if kind == UnitKind::Program { self.configured } else { self.unit.name != "start" };
        if takes {
            self.parameters(kind);
        }
        let (low, high) = if kind == UnitKind::Program {
            self.size.pick((3, 6), (6, 14), (10, 24))
        } else {
            self.size.pick((0, 3), (1, 4), (2, 6))
        };
        for number in 0..self.r.between(low, high) {
            let ty = if kind == UnitKind::Function { self.single_type() } else { self.any_type(false) };
            self.declare(format!("v{number}"), ty, Class::Var);
        }
        if kind != UnitKind::Function {
            for number in 0..self.r.between(0, 2) {
                let ty = self.single_type();
                self.declare(format!("t{number}"), ty, Class::Temp);
            }
        }
        for number in 0..self.r.between(0, 2) {
            let ty = Ty::K(self.kind());
            self.declare(format!("c{number}"), ty, Class::Constant);
        }
    }

    fn parameters(&mut self, kind: UnitKind) {
        let is_program = kind == UnitKind::Program;
        let may_rise = kind != UnitKind::Function;
        for number in 0..self.r.between(0, 3) {
            let ty = match self.r.chance(20) {
                true if may_rise => Ty::K(Kind::Bool),
                _ if is_program => self.single_type(),
                _ => self.whole_type(),
            };
            self.declare(format!("in{number}"), ty, Class::Input);
            if may_rise
                && ty == Ty::K(Kind::Bool)
                && self.r.chance(70)
                && let Some(input) = self.unit.vars.last_mut()
            {
                input.edge = Some(self.r.one_of([Edge::Rising, Edge::Falling]));
            }
        }
        for number in 0..self.r.between(0, 2) {
            let ty = self.single_type();
            self.declare(format!("out{number}"), ty, Class::Output);
        }
        let most = if is_program { 1 } else { 2 };
        for number in 0..self.r.between(0, most) {
            let global = self.r.pick(&self.source.globals).filter(|var| var.class == Class::Var).map(|var| var.ty);
            let wanted = global.filter(|_| is_program || self.r.chance(50));
            let ty = if is_program { wanted } else { wanted.or_else(|| Some(self.any_type(false))) };
            if let Some(ty) = ty {
                self.declare(format!("io{number}"), ty, Class::InOut);
            }
        }
    }
}
