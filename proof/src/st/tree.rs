//! The tree of a generated program: every expression with its type, every name an index.

pub use super::kind::Kind;

/// A type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ty {
    /// Elementary.
    K(Kind),
    /// STRING of a capacity.
    S(u16),
    /// WSTRING of a capacity.
    W(u16),
    /// A position in [`Source::types`].
    N(usize),
}

impl Ty {
    /// STRING or WSTRING of a capacity.
    #[must_use]
    pub fn text(wide: bool, capacity: u16) -> Ty {
        if wide { Ty::W(capacity) } else { Ty::S(capacity) }
    }

    /// How many units a STRING or WSTRING holds; of others none.
    #[must_use]
    pub fn capacity(self) -> Option<u16> {
        match self {
            Ty::S(capacity) | Ty::W(capacity) => Some(capacity),
            Ty::K(_) | Ty::N(_) => None,
        }
    }

    /// The type of a string's characters; of others none.
    #[must_use]
    pub fn character(self) -> Option<Kind> {
        self.capacity().map(|_| if self.is_wide() { Kind::Wchar } else { Kind::Char })
    }

    /// WSTRING.
    #[must_use]
    pub fn is_wide(self) -> bool {
        matches!(self, Ty::W(_))
    }
}

/// A value of any type.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// BOOL, integers, bit strings, enumerations, codes of characters, TIME in nanoseconds.
    Int(i128),
    /// REAL.
    Real(f32),
    /// LREAL.
    Lreal(f64),
    /// STRING, whose units are Latin-1, and WSTRING, whose units are UTF-16. In a variable a 0 ends it, and what was there before may lie behind that.
    Str(Vec<u16>),
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

    /// The units of a string.
    ///
    /// # Panics
    /// On another value: the tree is wrong.
    #[must_use]
    pub fn units(&self) -> &[u16] {
        match self {
            Value::Str(units) => units,
            other => panic!("a string is wanted, not {other:?}"),
        }
    }
}

/// What a type is.
#[derive(Debug, Clone)]
pub enum Def {
    /// STRUCT: names, types, initial values.
    Struct(Vec<(String, Ty, Option<Value>)>),
    /// The base type if one is written (else it is INT), names and values.
    Enum(Option<Kind>, Vec<(String, i64)>),
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

/// Which part of the process image.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Area {
    Input,
    Output,
    Memory,
}

/// An address in the process image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct At {
    /// Which part.
    pub area: Area,
    /// Byte in it; of anything wider than a byte a multiple of its size.
    pub byte: usize,
    /// Bit in the byte, of a BOOL.
    pub bit: usize,
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

/// Of an input the body sees only that it rose or fell since the last call.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    Rising,
    Falling,
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
    /// Its address, if it lies in the process image.
    pub at: Option<At>,
    /// Declared RETAIN.
    pub retain: bool,
    /// What of an input its body sees.
    pub edge: Option<Edge>,
    /// The shrinker took its declaration out.
    pub gone: bool,
}

impl Var {
    /// Whether a dump shows it under its own name.
    #[must_use]
    pub fn is_shown(&self) -> bool {
        matches!(self.class, Class::Input | Class::Output | Class::Var) && self.at.is_none() && !self.gone
    }
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
    /// Its variables; of a function that has a result the first.
    pub vars: Vec<Var>,
    /// Its statements.
    pub body: Vec<Stmt>,
    /// The shrinker took its declaration out.
    pub gone: bool,
}

/// A TASK.
#[derive(Debug, Clone)]
pub struct Task {
    /// Its name.
    pub name: String,
    /// INTERVAL in microseconds; none: it waits for its SINGLE alone.
    pub interval_us: Option<u64>,
    /// SINGLE: a global BOOL.
    pub single: Option<usize>,
    /// PRIORITY; 0 comes first.
    pub priority: u16,
}

/// A program instance.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Its name.
    pub name: String,
    /// Position of its task; none: it runs in every round, last.
    pub task: Option<usize>,
    /// Its PROGRAM.
    pub unit: usize,
    /// Its connections: literals and globals.
    pub args: Vec<Arg>,
}

/// A CONFIGURATION.
#[derive(Debug, Clone)]
pub struct Config {
    /// Its tasks, in the order of declaration.
    pub tasks: Vec<Task>,
    /// Its program instances, in the order of declaration.
    pub instances: Vec<Instance>,
    /// The function that runs before the first round.
    pub startup: Option<usize>,
}

/// A program with what belongs to it; the last unit is a PROGRAM, without a [`Config`] the only one.
#[derive(Debug, Clone, Default)]
pub struct Source {
    /// Types, each after those it is made of.
    pub types: Vec<Type>,
    /// Global variables.
    pub globals: Vec<Var>,
    /// POUs, each after those it calls.
    pub units: Vec<Unit>,
    /// Which task runs what; none: the last unit runs alone.
    pub config: Option<Config>,
    /// Bits that decide how things are spelt that can be spelt in several ways.
    pub style: u64,
}

/// Where a place begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Base {
    /// A variable of the unit.
    Var(usize),
    /// A global.
    Global(usize),
    /// An address without a declaration.
    Direct(At),
}

/// A step into a composite.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Field of a structure or variable of a block.
    Field(usize),
    /// Element of an array, character of a string.
    Index(Vec<Expr>),
    /// Bits of an integer or bit string: the first, and how many (1, 8, 16, 32).
    Part(u32, u32),
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
    /// `**`
    Pow,
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
    /// `EN := e`
    En(Expr),
    /// `ENO => place`
    Eno(Place),
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
    /// A call of a function of the program for its effects.
    Do(usize, Vec<Arg>),
    /// A call of a standard function that has outputs instead of a result; argument 0 is IN, the others are outputs, counted from 1.
    Split(crate::st::functions::Function, Vec<Arg>),
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
            Ty::S(_) | Ty::W(_) => Value::Str(Vec::new()),
            Ty::N(id) => match &self.types[id].def {
                Def::Struct(fields) => {
                    let value =
                        |(_, ty, init): &(String, Ty, Option<Value>)| init.clone().unwrap_or_else(|| self.initial(*ty));
                    Value::Many(fields.iter().map(value).collect())
                }
                Def::Enum(_, values) => Value::Int(i128::from(values[0].1)),
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
        let vars = &self.units[unit].vars;
        let edges = vars.iter().filter(|var| var.edge.is_some());
        // Behind the variables, for each edge: what the body sees, and the input at the last call.
        let hidden = edges.flat_map(|_| [Value::Int(0), Value::Int(0)]);
        Value::Many(vars.iter().map(|var| self.first(var)).chain(hidden).collect())
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
            // Nothing but a part of its bits is behind an address.
            Base::Direct(_) => place.ty,
        }
    }

    /// The type behind a step into a composite.
    ///
    /// # Panics
    /// When there is nothing to step into: the tree is wrong.
    #[must_use]
    pub fn behind(&self, ty: Ty, step: &Step) -> Ty {
        if let Step::Part(_, count) = step {
            let kinds = [Kind::Bool, Kind::Byte, Kind::Word, Kind::Dword];
            return kinds.into_iter().find(|kind| kind.bits() == *count).map_or(ty, Ty::K);
        }
        if let Some(kind) = ty.character() {
            return Ty::K(kind);
        }
        let Ty::N(id) = ty else { panic!("a step into {ty:?}") };
        match (step, &self.types[id].def) {
            (Step::Field(at), def) => self.field_type(def, *at),
            (Step::Index(_), Def::Array(_, element)) => *element,
            (step, def) => panic!("{step:?} into {def:?}"),
        }
    }

    /// Name, unit and connections of every program instance.
    #[must_use]
    pub fn programs(&self) -> Vec<(&str, usize, &[Arg])> {
        match &self.config {
            Some(config) => {
                config.instances.iter().map(|one| (one.name.as_str(), one.unit, one.args.as_slice())).collect()
            }
            None => {
                self.units.last().map(|unit| (unit.name.as_str(), self.units.len() - 1, &[][..])).into_iter().collect()
            }
        }
    }

    /// The type of a field of a structure or a variable of a block.
    ///
    /// # Panics
    /// When the tree is wrong.
    #[must_use]
    pub fn field_type(&self, def: &Def, at: usize) -> Ty {
        match def {
            Def::Struct(fields) => fields[at].1,
            Def::Block(unit) => self.units[*unit].vars[at].ty,
            Def::Standard(standard) => Ty::K(standard.fields()[at].1),
            other => panic!("no field of {other:?}"),
        }
    }

    /// The values of [`Source::leaves`] alone, in the same order.
    pub fn leaf_values<'v>(&self, ty: Ty, value: &'v Value, found: &mut Vec<&'v Value>) {
        let (Ty::N(id), Value::Many(parts)) = (ty, value) else {
            found.push(value);
            return;
        };
        match &self.types[id].def {
            Def::Struct(fields) => {
                fields.iter().zip(parts).for_each(|((_, ty, _), part)| self.leaf_values(*ty, part, found));
            }
            Def::Array(_, element) => parts.iter().for_each(|part| self.leaf_values(*element, part, found)),
            Def::Block(unit) => self.unit_leaf_values(*unit, parts, found),
            Def::Standard(standard) => found.extend(parts.iter().take(standard.fields().len())),
            Def::Enum(..) | Def::Subrange(..) => {}
        }
    }

    /// The same of a unit's variables.
    pub fn unit_leaf_values<'v>(&self, unit: usize, parts: &'v [Value], found: &mut Vec<&'v Value>) {
        let shown = self.units[unit].vars.iter().zip(parts).filter(|(var, _)| var.is_shown());
        shown.for_each(|(var, part)| self.leaf_values(var.ty, part, found));
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
            Def::Enum(..) | Def::Subrange(..) => {}
        }
    }

    /// The same of a unit's variables.
    pub fn unit_leaves(&self, path: &str, unit: usize, parts: &[Value], found: &mut Vec<(String, Ty, Value)>) {
        for (var, part) in self.units[unit].vars.iter().zip(parts) {
            if var.is_shown() {
                self.leaves(&format!("{path}.{}", var.name), var.ty, part, found);
            }
        }
    }
}
