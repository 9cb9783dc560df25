//! Places: which variables and parts of variables a unit can name.

use super::functions::Function;
use super::generate::Generator;
use super::memory::IMAGE_BYTES;
use super::tree::{Area, At, Base, Class, Def, Expr, ExprKind, Kind, Op, Place, Step, Ty, Value, Var};

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
}

impl Shape {
    /// Whether it is a global or a part of one.
    pub(super) fn is_global(&self) -> bool {
        matches!(self.base, Base::Global(_))
    }
}

/// Whether a place has no index that is evaluated.
pub(super) fn is_plain(place: &Place) -> bool {
    !place.steps.iter().any(|step| matches!(step, Step::Index(_)))
}

fn lit(kind: Kind, value: i128, typed: bool) -> Expr {
    Expr { ty: Ty::K(kind), kind: ExprKind::Lit(Value::Int(value), typed) }
}

impl Generator {
    /// Everything that the unit's code can name.
    pub(super) fn all_shapes(&mut self) -> Vec<Shape> {
        let mut found = Vec::new();
        let is_input = |var: &Var| var.at.is_some_and(|at| at.area == Area::Input);
        for (at, var) in self.unit.vars.iter().enumerate() {
            let is_writable = !matches!(var.class, Class::Constant | Class::Input) && !is_input(var);
            self.shapes_in(Shape { base: Base::Var(at), ways: Vec::new(), ty: var.ty, is_writable }, &mut found);
        }
        for (at, var) in self.source.globals.iter().enumerate() {
            let is_writable = var.class != Class::Constant && !is_input(var);
            self.shapes_in(Shape { base: Base::Global(at), ways: Vec::new(), ty: var.ty, is_writable }, &mut found);
        }
        let directs = if self.r.chance(25) { self.r.between(1, 3) } else { 0 };
        for _ in 0..directs {
            let kind = self.r.one_of([Kind::Bool, Kind::Byte, Kind::Word, Kind::Dword, Kind::Lword]);
            let at = self.address(kind);
            let is_writable = at.area != Area::Input;
            found.push(Shape { base: Base::Direct(at), ways: Vec::new(), ty: Ty::K(kind), is_writable });
        }
        found
    }

    /// A place for a type in the process image.
    pub(super) fn address(&mut self, kind: Kind) -> At {
        let bytes = (kind.bits() as usize).div_ceil(8);
        let area = self.r.one_of([Area::Input, Area::Output, Area::Memory]);
        let byte = self.r.below(IMAGE_BYTES / bytes) * bytes;
        At { area, byte, bit: if kind == Kind::Bool { self.r.below(8) } else { 0 } }
    }

    fn shapes_in(&self, shape: Shape, found: &mut Vec<Shape>) {
        let part = |way: Way, ty: Ty, is_writable: bool| {
            let mut ways = shape.ways.clone();
            ways.push(way);
            Shape { base: shape.base, ways, ty, is_writable }
        };
        if let Ty::N(id) = shape.ty {
            match &self.source.types[id].def {
                Def::Struct(fields) => {
                    for (at, (_, ty, _)) in fields.iter().enumerate() {
                        self.shapes_in(part(Way::Field(at), *ty, shape.is_writable), found);
                    }
                }
                Def::Array(_, element) => {
                    self.shapes_in(part(Way::Element, *element, shape.is_writable), found);
                }
                Def::Block(unit) => {
                    for (at, var) in self.source.units[*unit].vars.iter().enumerate() {
                        if var.class == Class::Output {
                            self.shapes_in(part(Way::Field(at), var.ty, false), found);
                        }
                    }
                }
                Def::Standard(standard) => {
                    for (at, (_, kind, is_input)) in standard.fields().iter().enumerate() {
                        if !is_input {
                            self.shapes_in(part(Way::Field(at), Ty::K(*kind), false), found);
                        }
                    }
                }
                Def::Enum(..) | Def::Subrange(..) => {}
            }
        }
        found.push(shape);
    }

    /// A place of exactly a type; for reading a subrange of it will do, and for a bit or byte a part of something wider.
    pub(super) fn place(&mut self, ty: Ty, writes: bool) -> Option<Place> {
        if let Ty::K(kind) = ty
            && self.r.chance(10)
            && let Some(place) = self.part(kind, writes)
        {
            return Some(place);
        }
        if let Ty::K(kind @ (Kind::Char | Kind::Wchar)) = ty
            && self.r.chance(40)
            && let Some(place) = self.character(kind, writes)
        {
            return Some(place);
        }
        self.address_of(ty, writes)
    }

    /// A character of a string.
    fn character(&mut self, kind: Kind, writes: bool) -> Option<Place> {
        let fits = |shape: &Shape| shape.ty.character() == Some(kind) && (!writes || shape.is_writable);
        let candidates: Vec<usize> = (0..self.shapes.len()).filter(|at| fits(&self.shapes[*at])).collect();
        let at = *self.r.pick(&candidates)?;
        let mut place = self.place_at(at)?;
        let index = self.index(1, i32::from(place.ty.capacity()?));
        place.steps.push(Step::Index(vec![index]));
        place.ty = Ty::K(kind);
        Some(place)
    }

    /// A place that has an address: what a VAR_IN_OUT may stand for, if it is no BOOL in the process image.
    pub(super) fn address_of(&mut self, ty: Ty, writes: bool) -> Option<Place> {
        let fits = |shape: &&Shape| {
            let is_type = shape.ty == ty || (!writes && self.source.plain(shape.ty) == ty);
            is_type && (!writes || shape.is_writable)
        };
        let candidates: Vec<usize> =
            self.shapes.iter().enumerate().filter(|(_, shape)| fits(shape)).map(|(at, _)| at).collect();
        let at = *self.r.pick(&candidates)?;
        self.place_at(at)
    }

    /// Some bits of an integer or bit string.
    fn part(&mut self, kind: Kind, writes: bool) -> Option<Place> {
        let count = kind.bits();
        if !matches!(kind, Kind::Bool | Kind::Byte | Kind::Word | Kind::Dword) {
            return None;
        }
        let wider =
            |ty: Ty| matches!(ty, Ty::K(whole) if (whole.is_integer() || whole.is_bits()) && whole.bits() > count);
        // Bits of an address have addresses of their own.
        let is_declared = |shape: &Shape| !matches!(shape.base, Base::Direct(_));
        let fits = |shape: &Shape| is_declared(shape) && wider(shape.ty) && (!writes || shape.is_writable);
        let candidates: Vec<usize> = (0..self.shapes.len()).filter(|at| fits(&self.shapes[*at])).collect();
        let at = *self.r.pick(&candidates)?;
        let mut place = self.place_at(at)?;
        let Ty::K(whole) = place.ty else { return None };
        let first = self.r.below((whole.bits() / count) as usize) as u32 * count;
        place.steps.push(Step::Part(first, count));
        place.ty = Ty::K(kind);
        Some(place)
    }

    fn place_at(&mut self, at: usize) -> Option<Place> {
        let shape = self.shapes[at].clone();
        let mut ty = match shape.base {
            Base::Var(at) => self.unit.vars[at].ty,
            Base::Global(at) => self.source.globals[at].ty,
            Base::Direct(_) => shape.ty,
        };
        let mut steps = Vec::new();
        for way in shape.ways {
            let Ty::N(id) = ty else { return None };
            match (way, self.source.types[id].def.clone()) {
                (Way::Element, Def::Array(dims, element)) => {
                    steps.push(Step::Index(dims.iter().map(|(low, high)| self.index(*low, *high)).collect()));
                    ty = element;
                }
                (Way::Field(at), def) => {
                    steps.push(Step::Field(at));
                    // The units are put aside while an expression without calls is made.
                    ty = match def {
                        Def::Block(unit) => self.source.units.get(unit).map_or(shape.ty, |unit| unit.vars[at].ty),
                        def => self.source.field_type(&def, at),
                    };
                }
                _ => return None,
            }
        }
        Some(Place { base: shape.base, steps, ty: shape.ty })
    }

    /// A variable of an integer type that is no part of something.
    fn integer_variable(&mut self) -> Option<Expr> {
        let fits = |var: &Var| matches!(var.ty, Ty::K(kind) if kind.is_integer() || kind.is_bits());
        let found: Vec<usize> = (0..self.unit.vars.len()).filter(|at| fits(&self.unit.vars[*at])).collect();
        let at = *self.r.pick(&found)?;
        let ty = self.unit.vars[at].ty;
        Some(Expr { ty, kind: ExprKind::Get(Place { base: Base::Var(at), steps: Vec::new(), ty }) })
    }

    /// A bound of an array that is declared, as a number of a type: like a literal it takes what type is wanted.
    pub(super) fn bound(&mut self, kind: Kind) -> Option<Expr> {
        let is_array = |shape: &&Shape| {
            shape.ways.iter().all(|way| matches!(way, Way::Field(_)))
                && matches!(shape.ty, Ty::N(id) if matches!(self.source.types[id].def, Def::Array(..)))
        };
        let arrays: Vec<Shape> = self.shapes.iter().filter(is_array).cloned().collect();
        let array = self.r.pick(&arrays)?.clone();
        let Ty::N(id) = array.ty else { return None };
        let Def::Array(dims, _) = &self.source.types[id].def else { return None };
        let (dims, at) = (dims.clone(), self.r.below(dims.len()));
        let function = self.r.one_of([Function::LowerBound, Function::UpperBound]);
        let value = i128::from(if function == Function::UpperBound { dims[at].1 } else { dims[at].0 });
        let (least, most) = kind.limits();
        if !kind.is_integer() || !(least..=most).contains(&value) {
            return None;
        }
        let steps =
            array.ways.iter().filter_map(|way| if let Way::Field(at) = way { Some(Step::Field(*at)) } else { None });
        let place = Place { base: array.base, steps: steps.collect(), ty: array.ty };
        let array = Expr { ty: array.ty, kind: ExprKind::Get(place) };
        Some(Expr {
            ty: Ty::K(kind),
            kind: ExprKind::Std(function, vec![array, lit(Kind::Dint, at as i128 + 1, false)]),
        })
    }

    fn index(&mut self, low: i32, high: i32) -> Expr {
        let (low, high) = (i128::from(low), i128::from(high));
        let around: Vec<usize> =
            self.loops.iter().filter(|(_, least, most)| low <= *least && *most <= high).map(|(at, ..)| *at).collect();
        if let Some(at) = self.r.pick(&around).copied().filter(|_| self.r.chance(70)) {
            let ty = self.unit.vars[at].ty;
            return Expr { ty, kind: ExprKind::Get(Place { base: Base::Var(at), steps: Vec::new(), ty }) };
        }
        if self.r.chance(6)
            && let Some(bound) = self.bound(Kind::Dint).filter(|_| !self.is_pure)
        {
            return bound;
        }
        let literal = lit(Kind::Dint, i128::from(self.r.between(low as i64, high as i64)), false);
        if self.r.chance(45) {
            return literal;
        }
        let Some(variable) = self.integer_variable() else { return literal };
        let Ty::K(kind) = variable.ty else { return literal };
        let (least, most) = kind.limits();
        if !self.is_pure && self.r.chance(45) {
            if self.r.chance(50) {
                let one = lit(kind, 1, false);
                return Expr { ty: variable.ty, kind: ExprKind::Bin(Op::Add, Box::new(variable), Box::new(one)) };
            }
            return variable;
        }
        if low < least || high > most {
            return literal;
        }
        let bound = |value| lit(kind, value, true);
        Expr { ty: variable.ty, kind: ExprKind::Std(Function::Limit, vec![bound(low), variable, bound(high)]) }
    }
}
