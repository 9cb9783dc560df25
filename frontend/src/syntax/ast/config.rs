//! Configurations, resources, tasks and program instances.

use super::{Attribute, DirectAddress, Expr, Ident, Init, Retention, TypeSpec, VarSection};
use crate::source::Span;

/// `CONFIGURATION … END_CONFIGURATION` (IEC 61131-3 6.8.2).
#[derive(Debug)]
pub struct Configuration {
    /// Its name.
    pub name: Ident,
    /// `VAR_GLOBAL` sections outside of resources.
    pub globals: Vec<VarSection>,
    /// The resources in order. Tasks and programs right in the configuration are one resource without a name.
    pub resources: Vec<Resource>,
    /// Entries of `VAR_CONFIG`.
    pub config_vars: Vec<ConfigVar>,
    /// Entries of `VAR_ACCESS`.
    pub access_vars: Vec<AccessVar>,
    /// Attribute pragmas before it.
    pub attributes: Vec<Attribute>,
    /// The whole configuration.
    pub span: Span,
}

/// `RESOURCE name ON processor … END_RESOURCE`.
#[derive(Debug)]
pub struct Resource {
    /// Its name; absent for tasks and programs that stand right in the configuration.
    pub name: Option<Ident>,
    /// The processor after `ON`.
    pub processor: Option<Ident>,
    /// `VAR_GLOBAL` sections.
    pub globals: Vec<VarSection>,
    /// The tasks in order.
    pub tasks: Vec<Task>,
    /// The program instances in order.
    pub programs: Vec<ProgramInstance>,
    /// Attribute pragmas before it.
    pub attributes: Vec<Attribute>,
    /// The whole resource.
    pub span: Span,
}

/// `TASK name(SINGLE := …, INTERVAL := …, PRIORITY := …);`
#[derive(Debug)]
pub struct Task {
    /// Its name.
    pub name: Ident,
    /// What stands in the parentheses, in order.
    pub params: Vec<TaskParam>,
    /// Attribute pragmas before it: watchdog, phase and so on.
    pub attributes: Vec<Attribute>,
    /// The whole declaration without its `;`.
    pub span: Span,
}

/// `name := value` of a task.
#[derive(Debug)]
pub struct TaskParam {
    /// Which; another name has been reported and is not in the tree.
    pub kind: TaskParamKind,
    /// The name as written.
    pub name: Ident,
    /// Any expression; the checker says which are allowed.
    pub value: Expr,
}

/// The parameters of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TaskParamKind {
    /// `SINGLE`: a rising edge starts the task.
    Single,
    /// `INTERVAL`: the period.
    Interval,
    /// `PRIORITY`: 0 is the highest.
    Priority,
}

/// `PROGRAM name WITH task : Type (connections);`
#[derive(Debug)]
pub struct ProgramInstance {
    /// The instance's name.
    pub name: Ident,
    /// `PROGRAM RETAIN name` or `PROGRAM NON_RETAIN name`.
    pub retention: Option<(Retention, Span)>,
    /// The task after `WITH`.
    pub task: Option<Ident>,
    /// The program type.
    pub ty: Ident,
    /// What stands in the parentheses.
    pub connections: Vec<Connection>,
    /// Attribute pragmas before it.
    pub attributes: Vec<Attribute>,
    /// The whole declaration without its `;`.
    pub span: Span,
}

/// An element of a program instance's parentheses.
#[derive(Debug)]
pub enum Connection {
    /// `in := source`: copied in before each call.
    Source {
        /// The program's variable.
        variable: Expr,
        /// A global, a direct address or a constant.
        source: Expr,
    },
    /// `out => sink`: copied out after each call.
    Sink {
        /// The program's variable.
        variable: Expr,
        /// A global or a direct address.
        sink: Expr,
    },
    /// `fb WITH task`: a function block instance that runs on a task of its own.
    FbTask {
        /// The instance.
        fb: Expr,
        /// The task.
        task: Ident,
    },
}

/// `resource.program.variable AT %… : type := value;` in VAR_CONFIG.
#[derive(Debug)]
pub struct ConfigVar {
    /// The path: names, and indices in brackets.
    pub path: Expr,
    /// `AT %…`.
    pub address: Option<DirectAddress>,
    /// The type.
    pub ty: TypeSpec,
    /// `:= …`.
    pub init: Option<Init>,
    /// The whole entry without its `;`.
    pub span: Span,
}

/// `name : path : type READ_ONLY;` in VAR_ACCESS.
#[derive(Debug)]
pub struct AccessVar {
    /// The name for the outside.
    pub name: Ident,
    /// What it stands for: a path or a direct address.
    pub target: Expr,
    /// The type.
    pub ty: TypeSpec,
    /// `READ_WRITE`; absent or `READ_ONLY`: false.
    pub writable: bool,
    /// The whole entry without its `;`.
    pub span: Span,
}
