//! The tree of a generated program: every expression with its type, every name an index.

/// An elementary type that is no string.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Bool,
    Sint,
    Int,
    Dint,
    Lint,
    Usint,
    Uint,
    Udint,
    Ulint,
    Byte,
    Word,
    Dword,
    Lword,
    Real,
    Lreal,
    Time,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 16] = [
        Kind::Bool,
        Kind::Sint,
        Kind::Int,
        Kind::Dint,
        Kind::Lint,
        Kind::Usint,
        Kind::Uint,
        Kind::Udint,
        Kind::Ulint,
        Kind::Byte,
        Kind::Word,
        Kind::Dword,
        Kind::Lword,
        Kind::Real,
        Kind::Lreal,
        Kind::Time,
    ];
    /// SINT to ULINT.
    pub const INTEGERS: [Kind; 8] =
        [Kind::Sint, Kind::Int, Kind::Dint, Kind::Lint, Kind::Usint, Kind::Uint, Kind::Udint, Kind::Ulint];
    /// BYTE to LWORD.
    pub const BITS: [Kind; 4] = [Kind::Byte, Kind::Word, Kind::Dword, Kind::Lword];

    /// Its keyword.
    #[must_use]
    pub fn name(self) -> &'static str {
        const NAMES: [&str; 16] = [
            "BOOL", "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT", "BYTE", "WORD", "DWORD", "LWORD",
            "REAL", "LREAL", "TIME",
        ];
        NAMES[self as usize]
    }

    /// Width in bits; of BOOL 1.
    #[must_use]
    pub fn bits(self) -> u32 {
        [1, 8, 16, 32, 64, 8, 16, 32, 64, 8, 16, 32, 64, 32, 64, 64][self as usize]
    }

    /// SINT to LINT, TIME.
    #[must_use]
    pub fn is_signed(self) -> bool {
        matches!(self, Kind::Sint | Kind::Int | Kind::Dint | Kind::Lint | Kind::Time)
    }

    /// SINT to ULINT.
    #[must_use]
    pub fn is_integer(self) -> bool {
        Kind::INTEGERS.contains(&self)
    }

    /// BYTE to LWORD.
    #[must_use]
    pub fn is_bits(self) -> bool {
        Kind::BITS.contains(&self)
    }

    /// REAL and LREAL.
    #[must_use]
    pub fn is_real(self) -> bool {
        matches!(self, Kind::Real | Kind::Lreal)
    }

    /// Lowest and highest value of an integer, bit string, BOOL or TIME.
    #[must_use]
    pub fn limits(self) -> (i128, i128) {
        let bits = self.bits();
        if self.is_signed() { (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1 << bits) - 1) }
    }

    /// A number wrapped in the width of the type.
    #[must_use]
    pub fn wrap(self, value: i128) -> i128 {
        // The low bits alone count, so that a product or shift of which more is lost is right too.
        let bits = self.bits();
        let pattern = value & ((1 << bits) - 1);
        if self.is_signed() && pattern >> (bits - 1) == 1 { pattern - (1 << bits) } else { pattern }
    }

    /// What the standard converts to this type by itself.
    #[must_use]
    pub fn narrower(self) -> &'static [Kind] {
        match self {
            Kind::Int => &[Kind::Sint, Kind::Usint],
            Kind::Dint => &[Kind::Sint, Kind::Int, Kind::Usint, Kind::Uint],
            Kind::Lint => &[Kind::Sint, Kind::Int, Kind::Dint, Kind::Usint, Kind::Uint, Kind::Udint],
            Kind::Uint => &[Kind::Usint],
            Kind::Udint => &[Kind::Usint, Kind::Uint],
            Kind::Ulint => &[Kind::Usint, Kind::Uint, Kind::Udint],
            Kind::Word => &[Kind::Byte],
            Kind::Dword => &[Kind::Byte, Kind::Word],
            Kind::Lword => &[Kind::Byte, Kind::Word, Kind::Dword],
            Kind::Real => &[Kind::Sint, Kind::Int, Kind::Usint, Kind::Uint],
            Kind::Lreal => &[Kind::Sint, Kind::Int, Kind::Dint, Kind::Usint, Kind::Uint, Kind::Udint, Kind::Real],
            _ => &[],
        }
    }
}

/// A type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ty {
    /// Elementary.
    K(Kind),
    /// STRING of a capacity.
    S(u16),
    /// A position in [`Source::types`].
    N(usize),
}

/// A value of any type.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// BOOL, integers, bit strings, enumerations, TIME in nanoseconds.
    Int(i128),
    /// REAL.
    Real(f32),
    /// LREAL.
    Lreal(f64),
    /// STRING.
    Str(Vec<u8>),
    /// Elements of an array in memory order, fields of a structure, variables of a block.
    Many(Vec<Value>),
}

impl Value {
    /// The number of what is one.
    ///
    /// # Panics
    /// On another value: the tree is wrong.
    #[must_use]
    pub fn int(&self) -> i128 {
        match self {
            Value::Int(value) => *value,
            other => panic!("a number is wanted, not {other:?}"),
        }
    }

    /// The bytes of a string.
    ///
    /// # Panics
    /// On another value: the tree is wrong.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        match self {
            Value::Str(bytes) => bytes,
            other => panic!("a string is wanted, not {other:?}"),
        }
    }
}

/// What a type is.
#[derive(Debug, Clone)]
pub enum Def {
    /// STRUCT: names, types, initial values.
    Struct(Vec<(String, Ty, Option<Value>)>),
    /// Names and values; the base is INT.
    Enum(Vec<(String, i64)>),
    /// Base and limits.
    Subrange(Kind, i128, i128),
    /// Bounds and element; declared where it is used when it has no name.
    Array(Vec<(i32, i32)>, Ty),
    /// A function block of [`Source::units`].
    Block(usize),
    /// A standard function block.
    Standard(crate::st::blocks::Standard),
}

/// A type of the program.
#[derive(Debug, Clone)]
pub struct Type {
    /// Its name; empty for an array that is written out.
    pub name: String,
    /// What it is.
    pub def: Def,
    /// The shrinker took its declaration out.
    pub gone: bool,
}

/// Where a variable is declared.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    Input,
    Output,
    InOut,
    Var,
    Temp,
    Constant,
    /// The result of a function.
    Return,
}

/// A variable.
#[derive(Debug, Clone)]
pub struct Var {
    /// Its name.
    pub name: String,
    /// Its type.
    pub ty: Ty,
    /// Where it is declared.
    pub class: Class,
    /// Its initial value, if one is written.
    pub init: Option<Value>,
    /// A counter of a loop, which only the loop writes.
    pub reserved: bool,
    /// The shrinker took its declaration out.
    pub gone: bool,
}

/// Which POU.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnitKind {
    Function,
    Block,
    Program,
}

/// A POU.
#[derive(Debug, Clone)]
pub struct Unit {
    /// Its name.
    pub name: String,
    /// Which.
    pub kind: UnitKind,
    /// Its variables; of a function the first is the result.
    pub vars: Vec<Var>,
    /// Its statements.
    pub body: Vec<Stmt>,
    /// The shrinker took its declaration out.
    pub gone: bool,
}

/// A program with what belongs to it; the last unit is the PROGRAM.
#[derive(Debug, Clone, Default)]
pub struct Source {
    /// Types, each after those it is made of.
    pub types: Vec<Type>,
    /// Global variables.
    pub globals: Vec<Var>,
    /// POUs, each after those it calls.
    pub units: Vec<Unit>,
}

/// Where a place begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Base {
    /// A variable of the unit.
    Var(usize),
    /// A global.
    Global(usize),
}

/// A step into a composite.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Field of a structure or variable of a block.
    Field(usize),
    /// Element of an array.
    Index(Vec<Expr>),
}

/// A variable or a part of one.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Where it begins.
    pub base: Base,
    /// The way on.
    pub steps: Vec<Step>,
    /// Declared type of its end.
    pub ty: Ty,
}

/// Binary operators.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Op {
    Add,
    Sub,
    Mul,
    Div,
    Mod,
    And,
    Or,
    Xor,
    AndThen,
    OrElse,
    Eq,
    Ne,
    Lt,
    Le,
    Gt,
    Ge,
}

/// An expression.
#[derive(Debug, Clone, PartialEq)]
pub struct Expr {
    /// Its type; of a subrange the base.
    pub ty: Ty,
    /// What it is.
    pub kind: ExprKind,
}

/// An argument: position of the parameter among the unit's variables.
#[derive(Debug, Clone, PartialEq)]
pub enum Arg {
    /// `p := e`
    In(usize, Expr),
    /// `p := place`, by reference.
    InOut(usize, Place),
    /// `p => place`
    Out(usize, Place),
}

/// What an expression is.
#[derive(Debug, Clone, PartialEq)]
pub enum ExprKind {
    /// A literal, with its type before it or not.
    Lit(Value, bool),
    /// The value of a place.
    Get(Place),
    /// A binary operation.
    Bin(Op, Box<Expr>, Box<Expr>),
    /// `-e`
    Neg(Box<Expr>),
    /// `NOT e`
    Not(Box<Expr>),
    /// A conversion that nobody writes.
    Widen(Box<Expr>),
    /// `A_TO_B(e)`
    Conv(Box<Expr>),
    /// `TRUNC`-like: `A_TRUNC_B(e)`.
    Trunc(Box<Expr>),
    /// A standard function.
    Std(crate::st::functions::Function, Vec<Expr>),
    /// A function of the program.
    Call(usize, Vec<Arg>),
}

/// A branch of CASE: its labels, each from and to, and its statements.
pub type Branch = (Vec<(i128, i128)>, Vec<Stmt>);

/// A statement.
#[derive(Debug, Clone, PartialEq)]
pub enum Stmt {
    /// `place := e;`
    Assign(Place, Expr),
    /// IF, ELSIF, ELSE.
    If(Vec<(Expr, Vec<Stmt>)>, Vec<Stmt>),
    /// CASE: labels from, to.
    Case(Expr, Vec<Branch>, Vec<Stmt>),
    /// FOR over a reserved variable: from, to, by.
    For(usize, Expr, Expr, Option<Expr>, Vec<Stmt>),
    /// WHILE with a reserved counter: `c := 0; WHILE c < limit AND e DO c := c + 1; … END_WHILE`.
    While(usize, i64, Expr, Vec<Stmt>),
    /// REPEAT with a reserved counter.
    Repeat(usize, i64, Expr, Vec<Stmt>),
    /// A call of a block.
    Call(Place, Vec<Arg>),
    /// EXIT
    Exit,
    /// CONTINUE
    Continue,
    /// RETURN
    Return,
}

impl Source {
    /// Elements of an array type in all.
    #[must_use]
    pub fn elements(dims: &[(i32, i32)]) -> usize {
        dims.iter().map(|(low, high)| (high - low + 1) as usize).product()
    }

    /// The initial value of a type.
    #[must_use]
    pub fn initial(&self, ty: Ty) -> Value {
        match ty {
            Ty::K(Kind::Real) => Value::Real(0.0),
            Ty::K(Kind::Lreal) => Value::Lreal(0.0),
            Ty::K(_) => Value::Int(0),
            Ty::S(_) => Value::Str(Vec::new()),
            Ty::N(id) => match &self.types[id].def {
                Def::Struct(fields) => {
                    let value =
                        |(_, ty, init): &(String, Ty, Option<Value>)| init.clone().unwrap_or_else(|| self.initial(*ty));
                    Value::Many(fields.iter().map(value).collect())
                }
                Def::Enum(values) => Value::Int(i128::from(values[0].1)),
                Def::Subrange(_, low, _) => Value::Int(*low),
                Def::Array(dims, element) => Value::Many(vec![self.initial(*element); Source::elements(dims)]),
                Def::Block(unit) => self.instance(*unit),
                Def::Standard(standard) => standard.initial(),
            },
        }
    }

    /// The variables of a unit before it first runs.
    #[must_use]
    pub fn instance(&self, unit: usize) -> Value {
        Value::Many(self.units[unit].vars.iter().map(|var| self.first(var)).collect())
    }

    /// The initial value of a variable.
    #[must_use]
    pub fn first(&self, var: &Var) -> Value {
        var.init.clone().unwrap_or_else(|| self.initial(var.ty))
    }

    /// The elementary type or string under a type: a subrange is its base, an enumeration itself.
    #[must_use]
    pub fn plain(&self, ty: Ty) -> Ty {
        match ty {
            Ty::N(id) => match &self.types[id].def {
                Def::Subrange(base, ..) => Ty::K(*base),
                _ => ty,
            },
            _ => ty,
        }
    }

    /// The type of the variable in which a place of a unit's code begins.
    #[must_use]
    pub fn base(&self, unit: &Unit, place: &Place) -> Ty {
        match place.base {
            Base::Var(at) => unit.vars[at].ty,
            Base::Global(at) => self.globals[at].ty,
        }
    }

    /// The type behind a step into a composite.
    ///
    /// # Panics
    /// When there is nothing to step into: the tree is wrong.
    #[must_use]
    pub fn behind(&self, ty: Ty, step: &Step) -> Ty {
        let Ty::N(id) = ty else { panic!("a step into {ty:?}") };
        match (step, &self.types[id].def) {
            (Step::Field(at), Def::Struct(fields)) => fields[*at].1,
            (Step::Field(at), Def::Block(unit)) => self.units[*unit].vars[*at].ty,
            (Step::Field(at), Def::Standard(standard)) => Ty::K(standard.fields()[*at].1),
            (Step::Index(_), Def::Array(_, element)) => *element,
            (step, def) => panic!("{step:?} into {def:?}"),
        }
    }

    /// Paths, types and values of all parts of a value that are no composites and that a dump shows.
    pub fn leaves(&self, path: &str, ty: Ty, value: &Value, found: &mut Vec<(String, Ty, Value)>) {
        let (Ty::N(id), Value::Many(parts)) = (ty, value) else {
            found.push((path.to_string(), ty, value.clone()));
            return;
        };
        match &self.types[id].def {
            Def::Struct(fields) => {
                for ((name, ty, _), part) in fields.iter().zip(parts) {
                    self.leaves(&format!("{path}.{name}"), *ty, part, found);
                }
            }
            Def::Array(dims, element) => {
                for (at, part) in parts.iter().enumerate() {
                    let mut rest = at;
                    let mut indices = Vec::new();
                    for (low, high) in dims.iter().rev() {
                        let count = (high - low + 1) as usize;
                        indices.insert(0, (low + (rest % count) as i32).to_string());
                        rest /= count;
                    }
                    self.leaves(&format!("{path}[{}]", indices.join(", ")), *element, part, found);
                }
            }
            Def::Block(unit) => self.unit_leaves(path, *unit, parts, found),
            Def::Standard(standard) => {
                for ((name, kind, _), part) in standard.fields().iter().zip(parts) {
                    self.leaves(&format!("{path}.{name}"), Ty::K(*kind), part, found);
                }
            }
            Def::Enum(_) | Def::Subrange(..) => {}
        }
    }

    /// The same of a unit's variables.
    pub fn unit_leaves(&self, path: &str, unit: usize, parts: &[Value], found: &mut Vec<(String, Ty, Value)>) {
        for (var, part) in self.units[unit].vars.iter().zip(parts) {
            if matches!(var.class, Class::Input | Class::Output | Class::Var) && !var.gone {
                self.leaves(&format!("{path}.{}", var.name), var.ty, part, found);
            }
        }
    }
}
