//! The typed tree: programs as the checker understood them.
//!
//! Every expression has a type, every conversion stands in the tree, every call knows its target. The lowering reads this and
//! never the syntax tree.

use std::rc::Rc;

use khz_bytecode::container::OverrunPolicy;
use khz_bytecode::value::BytePlace;

use super::types::{Const, Ty, TyId, TypeTable, Value};
use crate::source::Span;
use crate::syntax::ast::PouKind;
use crate::syntax::symbol::Symbol;

/// Position in [`Project::pous`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PouId(pub u32);

/// Position in [`PouInfo::vars`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VarId(pub u32);

/// Position in [`Project::globals`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GlobalId(pub u32);

/// Everything that was declared.
#[derive(Debug)]
pub struct Project {
    /// Defined types.
    pub types: TypeTable,
    /// Program organisation units in source order.
    pub pous: Vec<Rc<PouInfo>>,
    /// Global variables.
    pub globals: Vec<GlobalInfo>,
    /// One for each RESOURCE.
    pub resources: Vec<ResourcePlan>,
    /// Checked bodies of units that no resource reaches, ascending: nothing is made of them.
    pub unreached: Vec<(PouId, Body)>,
}

/// The declaration of a program organisation unit.
#[derive(Debug, Clone)]
pub struct PouInfo {
    /// Program, function or function block.
    pub kind: PouKind,
    /// Name as declared.
    pub name: String,
    /// Where its name stands.
    pub span: Span,
    /// Its variables in order; a function's result is one of them.
    pub vars: Vec<VarInfo>,
    /// Result variable of a function.
    pub result: Option<VarId>,
    /// Type of its instances, for a function block.
    pub block: Option<TyId>,
}

impl PouInfo {
    /// Whether the variable at this position is one of the hidden two beside an [`EdgeInput`].
    pub fn sees_edges(&self, at: usize) -> bool {
        let beside = |back: usize| at.checked_sub(back).and_then(|input| self.vars.get(input)?.edge);
        let is = |id: VarId| id.0 as usize == at;
        beside(1).is_some_and(|edge| is(edge.seen)) || beside(2).is_some_and(|edge| is(edge.last))
    }
}

/// Kinds of variables of a program organisation unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VarClass {
    /// VAR_INPUT.
    Input,
    /// VAR_OUTPUT.
    Output,
    /// VAR_IN_OUT.
    InOut,
    /// VAR.
    Local,
    /// VAR_TEMP.
    Temp,
    /// A function's result.
    Result,
    /// VAR_EXTERNAL: a global.
    External,
}

/// A variable of a program organisation unit.
#[derive(Debug, Clone)]
pub struct VarInfo {
    /// Folded name.
    pub symbol: Symbol,
    /// Name as declared.
    pub name: String,
    /// Where it is declared.
    pub span: Span,
    /// Its type.
    pub ty: Ty,
    /// Which section.
    pub class: VarClass,
    /// CONSTANT.
    pub constant: bool,
    /// Initial value.
    pub init: Value,
    /// AT %….
    pub located: Option<Located>,
    /// `AT %I*`: the area in which VAR_CONFIG gives each instance's its place.
    pub area: Option<BytePlace>,
    /// RETAIN or PERSISTENT.
    pub retain: bool,
    /// Position among the fields of its function block.
    pub field: Option<u32>,
    /// R_EDGE or F_EDGE.
    pub edge: Option<EdgeInput>,
}

/// An input of which the body sees the edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EdgeInput {
    /// F_EDGE.
    pub falling: bool,
    /// What the body sees in the input's place.
    pub seen: VarId,
    /// The input at the call before.
    pub last: VarId,
}

/// A global variable.
#[derive(Debug, Clone)]
pub struct GlobalInfo {
    /// Folded name.
    pub symbol: Symbol,
    /// Name as declared.
    pub name: String,
    /// Where it is declared.
    pub span: Span,
    /// The configuration (`Some(n)`) that it belongs to; `None`: all.
    pub configuration: Option<u32>,
    /// The resource that it belongs to; `None`: all of its configuration.
    pub resource: Option<u32>,
    /// Known as `LIST.x` only, of its global variable list.
    pub qualified_only: bool,
    /// Its type.
    pub ty: Ty,
    /// CONSTANT.
    pub constant: bool,
    /// Initial value.
    pub init: Value,
    /// AT %….
    pub located: Option<Located>,
    /// RETAIN or PERSISTENT.
    pub retain: bool,
}

/// A place in the process image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Located {
    /// %I, %Q or %M.
    pub place: BytePlace,
    /// First byte.
    pub offset: u32,
    /// The bit of the byte, for %…X addresses.
    pub bit: Option<u8>,
}

/// One RESOURCE as it will run.
#[derive(Debug)]
pub struct ResourcePlan {
    /// Its name.
    pub name: String,
    /// Its configuration's name.
    pub configuration: String,
    /// Global variables that it holds.
    pub globals: Vec<GlobalId>,
    /// Tasks.
    pub tasks: Vec<TaskPlan>,
    /// Program instances.
    pub instances: Vec<InstancePlan>,
    /// Function to run at start.
    pub startup: Option<PouId>,
    /// Checked bodies of all program organisation units that it reaches, ascending.
    pub bodies: Vec<(PouId, Body)>,
    /// What the bodies and connections use.
    pub usage: Usage,
}

impl ResourcePlan {
    /// VAR_INPUT of the program instances, as `instance.variable`.
    pub fn program_inputs(&self, project: &Project) -> Vec<String> {
        let inputs = self.instances.iter().flat_map(|instance| {
            let info = project.pous.get(instance.program.0 as usize);
            let inputs = info.into_iter().flat_map(|info| &info.vars).filter(|var| var.class == VarClass::Input);
            inputs.map(move |var| format!("{}.{}", instance.name, var.name))
        });
        inputs.collect()
    }
}

/// What the bodies of a resource use beyond declarations.
#[derive(Debug, Default, Clone)]
pub struct Usage {
    /// `__SYSTEM_UP_TIME` is used; by code of the user.
    pub up_time: Option<bool>,
    /// `__SYSTEM_UP_LTIME` is used; by code of the user.
    pub up_ltime: Option<bool>,
    /// Variables that a reference is made to: (unit, variable).
    pub addressed_vars: std::collections::BTreeSet<(PouId, VarId)>,
    /// Globals that a reference is made to.
    pub addressed_globals: std::collections::BTreeSet<GlobalId>,
    /// Globals that are used at all.
    pub used_globals: std::collections::BTreeMap<GlobalId, Span>,
    /// Highest byte + 1 of direct addresses: %I, %Q, %M.
    pub image_bytes: [u32; 3],
    /// Reference parameters that get a place in %I, %Q or %M.
    pub image_parameters: std::collections::BTreeSet<(PouId, VarId)>,
    /// Function block instances that are variables of a unit and that its body calls, and where.
    pub called_blocks: std::collections::BTreeMap<(PouId, VarId), Span>,
    /// Reference parameters (first) that get what another one (second) is.
    pub parameter_edges: std::collections::BTreeSet<((PouId, VarId), (PouId, VarId))>,
    /// How hot a variable is: uses, ten times as much in each loop.
    pub heat: std::collections::BTreeMap<(Option<PouId>, u32), u64>,
}

/// A task.
#[derive(Debug, Clone)]
pub struct TaskPlan {
    /// Its name.
    pub name: String,
    /// 0 is the highest.
    pub priority: u16,
    /// Interval in microseconds.
    pub interval_us: Option<u64>,
    /// SINGLE.
    pub single: SinglePlan,
    /// Watchdog in microseconds; 0: none.
    pub watchdog_us: u64,
    /// Consecutive overruns until the watchdog trips.
    pub watchdog_sensitivity: u16,
    /// Offset of its grid in microseconds.
    pub phase_us: u64,
    /// What follows an overrun.
    pub overrun_policy: OverrunPolicy,
}

/// What starts an event task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SinglePlan {
    /// Nothing.
    None,
    /// TRUE or FALSE.
    Literal(bool),
    /// A global.
    Global(GlobalId),
    /// A bit of the image.
    Bit(Located),
    /// A variable of a program instance.
    Instance(u32, VarId),
}

/// A program instance.
#[derive(Debug)]
pub struct InstancePlan {
    /// Its name.
    pub name: String,
    /// Its type.
    pub program: PouId,
    /// Position of its task in [`ResourcePlan::tasks`].
    pub task: u32,
    /// Statements before its body.
    pub copy_in: Vec<Stmt>,
    /// Places for its VAR_IN_OUT.
    pub inouts: Vec<(VarId, Place)>,
    /// Statements after its body.
    pub copy_out: Vec<Stmt>,
    /// Its function block instances that tasks of their own run.
    pub blocks: Vec<BlockTask>,
    /// Initial values that VAR_CONFIG gives to its variables in place of the declared ones.
    pub values: Vec<(VarId, Value)>,
    /// Initial values of places of the process image that VAR_CONFIG gives to its variables.
    pub image_values: Vec<(Located, Ty, Value)>,
    /// Where it is declared.
    pub span: Span,
}

/// `fb WITH task`: a function block instance of a program instance that a task runs.
#[derive(Debug)]
pub struct BlockTask {
    /// The instance's name with that of its program instance.
    pub name: String,
    /// The variable.
    pub var: VarId,
    /// The function block.
    pub block: PouId,
    /// Position of its task in [`ResourcePlan::tasks`].
    pub task: u32,
    /// Statements before its body.
    pub copy_in: Vec<Stmt>,
    /// Statements after its body.
    pub copy_out: Vec<Stmt>,
    /// Where it is written.
    pub span: Span,
}

/// A checked body.
#[derive(Debug, Default)]
pub struct Body {
    /// Its statements.
    pub statements: Vec<Stmt>,
    /// Units that it calls, ascending.
    pub callees: Vec<(PouId, Span)>,
}

/// A statement.
#[derive(Debug)]
pub struct Stmt {
    /// What it is.
    pub kind: StmtKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of a statement.
#[derive(Debug)]
pub enum StmtKind {
    /// `target := value`, of the same type.
    Assign {
        /// Where to.
        target: Place,
        /// The value.
        value: Expr,
    },
    /// A call whose result nobody wants.
    Call(Box<Call>),
    /// An expression evaluated for nothing but its traps.
    Evaluate(Expr),
    /// IF.
    If {
        /// Conditions and what they guard.
        branches: Vec<(Expr, Vec<Stmt>)>,
        /// ELSE.
        otherwise: Vec<Stmt>,
    },
    /// CASE.
    Case {
        /// An integer or enumeration value.
        selector: Expr,
        /// Ranges (canonical constants) and statements.
        arms: Vec<CaseArm>,
        /// ELSE.
        otherwise: Vec<Stmt>,
    },
    /// FOR.
    For(Box<ForStmt>),
    /// WHILE.
    While {
        /// The condition.
        condition: Expr,
        /// The body.
        body: Vec<Stmt>,
        /// END_WHILE.
        end: Span,
    },
    /// REPEAT.
    Repeat {
        /// The body.
        body: Vec<Stmt>,
        /// UNTIL.
        until: Expr,
    },
    /// EXIT.
    Exit,
    /// CONTINUE.
    Continue,
    /// RETURN.
    Return,
}

/// An arm of a CASE.
#[derive(Debug)]
pub struct CaseArm {
    /// Ranges, both ends included.
    pub ranges: Vec<(i128, i128)>,
    /// Statements.
    pub body: Vec<Stmt>,
}

/// A FOR loop.
#[derive(Debug)]
pub struct ForStmt {
    /// Control variable.
    pub control: Place,
    /// First value, of the control variable's elementary type.
    pub from: Expr,
    /// Last value.
    pub to: Expr,
    /// Step, of type DINT or LINT as the control variable is wide.
    pub by: Expr,
    /// The body.
    pub body: Vec<Stmt>,
    /// END_FOR.
    pub end: Span,
}

/// A variable, or a part of one.
#[derive(Debug, Clone)]
pub struct Place {
    /// Where the way starts.
    pub root: Root,
    /// The way.
    pub path: Vec<Step>,
    /// Type at its end.
    pub ty: Ty,
    /// Where it stands.
    pub span: Span,
}

/// Where a place starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Root {
    /// A variable of the unit whose body this is.
    Var(VarId),
    /// A global.
    Global(GlobalId),
    /// A direct address.
    Direct(Located),
    /// `__SYSTEM_UP_LTIME` (true) or `__SYSTEM_UP_TIME`.
    System(bool),
    /// The instance of the function block call that this is part of.
    CallInstance,
    /// An output of the function call that this is part of.
    CallOutput(VarId),
}

/// A step from a variable to a part of it.
#[derive(Debug, Clone)]
pub enum Step {
    /// A field, of the record type given.
    Field(TyId, u32),
    /// An element, of the array type given; one DINT index a dimension.
    Index(TyId, Rc<[Expr]>),
    /// A character of a string of the type given; a DINT index from 1. Always the last step.
    Character(Ty, Rc<Expr>),
    /// Bits of a bit string or integer: first bit and their number. Always the last step.
    Part(Ty, u32, u32),
}

/// An expression.
#[derive(Debug, Clone)]
pub struct Expr {
    /// What it is.
    pub kind: ExprKind,
    /// Its type.
    pub ty: Ty,
    /// Where it stands.
    pub span: Span,
}

/// The forms of an expression.
#[derive(Debug, Clone)]
pub enum ExprKind {
    /// A constant.
    Const(Const),
    /// The value of a variable (of a string or composed one: the variable itself).
    Load(Box<Place>),
    /// One operand.
    Unary(UnOp, Box<Expr>),
    /// Two operands of one type, but for shifts, rotations and durations.
    Binary(BinOp, Box<Expr>, Box<Expr>),
    /// To another elementary type.
    Convert {
        /// The value.
        value: Box<Expr>,
        /// From floating point: cut toward zero instead of rounding.
        truncates: bool,
    },
    /// To an index: a DINT, saturated.
    ToIndex(Box<Expr>),
    /// Into a subrange, checked.
    Check(Box<Expr>, i64, i64),
    /// A, if the condition is FALSE, else B; both are evaluated.
    Select(Box<[Expr; 3]>),
    /// Selector (DINT, unsigned) and inputs.
    Mux(Vec<Expr>),
    /// A call of a function.
    Call(Box<Call>),
    /// A value that is needed once more: the next [`ExprKind::Kept`] that is evaluated gives it again.
    Keep(Box<Expr>),
    /// The value of the last [`ExprKind::Keep`] that was not given again yet.
    Kept,
    /// A string operation on strings and DINT numbers.
    Text(TextOp, Vec<Expr>),
    /// What the calendar says of dates, or of numbers of months and days.
    Calendar(CalendarOp, Vec<Expr>),
    /// A bound of the array that stands for an open one ([`TyKind::Open`](super::types::TyKind)): dimension from 0, upper or lower.
    Bound(TyId, usize, bool),
    /// A standard function that is called with EN or ENO.
    Enabled(Box<Enabled>),
}

/// A value that is computed only when it is enabled; else it is what a variable of its type begins with.
#[derive(Debug, Clone)]
pub struct Enabled {
    /// EN; absent: TRUE.
    pub en: Option<Expr>,
    /// ENO: gets EN.
    pub eno: Option<Place>,
    /// The value.
    pub value: Expr,
}

/// Operators with one operand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnOp {
    Neg,
    Not,
    Abs,
    Sqrt,
    Ln,
    Log,
    Exp,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    /// The bytes in reverse order.
    SwapBytes,
    /// The number that a bit string holds as binary coded decimals, as the unsigned integer of the same width.
    FromBcd,
    /// The digits of an unsigned integer that has no more of them than the bit string of the same width.
    ToBcd,
    /// Whether a float is no NaN and no infinity.
    IsValid,
    /// Whether every digit of a bit string is 0 to 9.
    IsValidBcd,
}

/// Operators with two operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BinOp {
    Add,
    Sub,
    Mul,
    Div,
    Mod,
    Pow,
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
    Min,
    Max,
    /// MAX of floats with the second operand as its first: LIMIT raises its input to the lower limit, which is evaluated before.
    Raise,
    Shl,
    Shr,
    Rol,
    Ror,
    Atan2,
}

impl BinOp {
    /// How messages call it.
    pub fn text(self) -> &'static str {
        match self {
            BinOp::Add => "+",
            BinOp::Sub => "-",
            BinOp::Mul => "*",
            BinOp::Div => "/",
            BinOp::Mod => "MOD",
            BinOp::Pow => "**",
            BinOp::And => "AND",
            BinOp::Or => "OR",
            BinOp::Xor => "XOR",
            BinOp::AndThen => "AND_THEN",
            BinOp::OrElse => "OR_ELSE",
            BinOp::Eq => "=",
            BinOp::Ne => "<>",
            BinOp::Lt => "<",
            BinOp::Le => "<=",
            BinOp::Gt => ">",
            BinOp::Ge => ">=",
            BinOp::Min => "MIN",
            BinOp::Max | BinOp::Raise => "MAX",
            BinOp::Shl => "SHL",
            BinOp::Shr => "SHR",
            BinOp::Rol => "ROL",
            BinOp::Ror => "ROR",
            BinOp::Atan2 => "ATAN2",
        }
    }

    /// Whether it compares.
    pub fn is_comparison(self) -> bool {
        matches!(self, BinOp::Eq | BinOp::Ne | BinOp::Lt | BinOp::Le | BinOp::Gt | BinOp::Ge)
    }
}

/// Questions to the calendar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CalendarOp {
    /// Year of a moment, a DINT as the next three.
    Year,
    /// Month of a moment.
    Month,
    /// Day of the month of a moment.
    Day,
    /// Day of the week of a moment.
    Weekday,
    /// The start of a day: months since January of the year 0 and days of the month, both LINT.
    Of,
}

/// Operations on strings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextOp {
    Len,
    Find,
    Left,
    Right,
    Mid,
    Concat,
    Insert,
    Delete,
    Replace,
    /// From an elementary value.
    From,
    /// To an elementary value.
    To,
    /// A string of one character.
    FromCharacter,
    /// The first character, 0 of an empty string.
    First,
    /// STRING to WSTRING.
    Widen,
    /// WSTRING to STRING.
    Narrow,
}

/// A call of a function or function block.
#[derive(Debug, Clone)]
pub struct Call {
    /// What is called.
    pub target: PouId,
    /// The instance, of a function block.
    pub instance: Option<Place>,
    /// EN: the call is skipped when FALSE.
    pub en: Option<Expr>,
    /// ENO.
    pub eno: Option<Place>,
    /// The unit declares ENO itself, so after the call its own value counts.
    pub eno_is_given: bool,
    /// For a function: values of its inputs in order of declaration. For a function block: empty.
    pub inputs: Vec<(VarId, Expr)>,
    /// For a function block: assignments to its inputs.
    pub before: Vec<Rc<Stmt>>,
    /// VAR_IN_OUT in order of declaration.
    pub inouts: Vec<(VarId, Place)>,
    /// Assignments from its outputs.
    pub after: Vec<Rc<Stmt>>,
    /// The arrays that stand for open ones, by parameter in order of declaration.
    pub arrays: Vec<(VarId, Ty)>,
    /// Where it stands.
    pub span: Span,
}
