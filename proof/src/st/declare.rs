//! Types, globals and variables of a program.

use super::blocks::Standard;
use super::generate::Generator;
use super::tree::{Class, Def, Kind, Source, Ty, Type, UnitKind, Value, Var};

impl Generator {
    pub(super) fn types(&mut self) {
        for standard in Standard::ALL {
            self.source.types.push(Type { name: String::new(), def: Def::Standard(standard), gone: true });
        }
        for number in 0..self.r.between(2, 7) {
            let (name, def) = match self.r.below(6) {
                0 => {
                    let mut value = self.r.between(-3, 3);
                    let mut values = Vec::new();
                    for member in 0..self.r.between(2, 4) {
                        values.push((format!("e{number}_{member}"), value));
                        value += self.r.between(1, 5);
                    }
                    (format!("Enum{number}"), Def::Enum(values))
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
            1 => Ty::S(self.capacity()),
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
            Ty::S(capacity) => Some(Value::Str(self.text(usize::from(capacity)))),
            Ty::N(id) => match self.source.types[id].def.clone() {
                Def::Enum(values) => self.r.pick(&values).map(|(_, value)| Value::Int(i128::from(*value))),
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
        for number in 0..self.r.between(0, 4) {
            let ty = self.any_type(false);
            let init = self.init(ty, 50);
            let var = Var { name: format!("g{number}"), ty, class: Class::Var, init, reserved: false, gone: false };
            self.source.globals.push(var);
        }
    }

    fn declare(&mut self, name: String, ty: Ty, class: Class) {
        let percent = match class {
            Class::InOut | Class::Return => 0,
            Class::Constant => 100,
            _ => 50,
        };
        let init = self.init(ty, percent);
        self.unit.vars.push(Var { name, ty, class, init, reserved: false, gone: false });
    }

    /// Whether values of a type may be assigned whole.
    pub(super) fn is_copyable(&self, ty: Ty) -> bool {
        match ty {
            Ty::N(id) => match &self.source.types[id].def {
                Def::Struct(fields) => fields.iter().all(|(_, ty, _)| self.is_copyable(*ty)),
                // Of arrays without a name only one and the same would do.
                Def::Array(_, element) => !self.source.types[id].name.is_empty() && self.is_copyable(*element),
                Def::Enum(_) | Def::Subrange(..) => true,
                Def::Block(_) | Def::Standard(_) => false,
            },
            _ => true,
        }
    }

    /// Whether a type is no composite.
    pub(super) fn is_single(&self, ty: Ty) -> bool {
        !matches!(self.source.plain(ty), Ty::N(id) if !matches!(self.source.types[id].def, Def::Enum(_)))
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
        if kind == UnitKind::Function {
            let (name, ty) = (self.unit.name.clone(), self.whole_type());
            self.declare(name, ty, Class::Return);
        }
        let count = |generator: &mut Self, low, high| generator.r.between(low, high);
        if kind != UnitKind::Program {
            for number in 0..count(self, 0, 3) {
                let ty = self.whole_type();
                self.declare(format!("in{number}"), ty, Class::Input);
            }
            for number in 0..count(self, 0, 2) {
                let ty = self.single_type();
                self.declare(format!("out{number}"), ty, Class::Output);
            }
            for number in 0..count(self, 0, 2) {
                let global = self.r.pick(&self.source.globals).map(|var| var.ty);
                let ty = global.filter(|_| self.r.chance(50)).unwrap_or_else(|| self.any_type(false));
                if self.is_copyable(ty) {
                    self.declare(format!("io{number}"), ty, Class::InOut);
                }
            }
        }
        let (low, high) = if kind == UnitKind::Program { (6, 14) } else { (1, 4) };
        for number in 0..count(self, low, high) {
            let ty = if kind == UnitKind::Function { self.single_type() } else { self.any_type(false) };
            self.declare(format!("v{number}"), ty, Class::Var);
        }
        if kind != UnitKind::Function {
            for number in 0..count(self, 0, 2) {
                let ty = self.single_type();
                self.declare(format!("t{number}"), ty, Class::Temp);
            }
        }
        for number in 0..count(self, 0, 2) {
            let ty = Ty::K(self.kind());
            self.declare(format!("c{number}"), ty, Class::Constant);
        }
    }
}
