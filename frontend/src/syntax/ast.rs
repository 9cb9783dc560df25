//! The syntax tree of Structured Text: what the parser makes and every later pass reads.
//!
//! The tree says what was written and nothing about what it means: `INT` is a name like any other, `f(1)` may turn out
//! to be a function, a function block instance or an array repetition, and a `SINGLE` of the wrong type is still an
//! expression. Meaning is attached from outside, in tables indexed by [`ExprId`], so that the tree never changes.
//!
//! Where the source was wrong the tree has holes: [`ExprKind::Error`], [`TypeSpecKind::Error`] and identifiers with
//! the symbol [`Symbol::MISSING`]. A hole has been reported already; a later pass stays silent about it.
//!
//! Parentheses leave no node; the span of the inner expression is widened to include them. Comments leave no node
//! either: a formatter works from [`crate::syntax::lexer::Lexed`], whose tokens include them.

use crate::source::{FileId, Span};
use crate::syntax::symbol::{Interner, Symbol};

/// All sources of one compilation, parsed.
#[derive(Debug, Default)]
pub struct Ast {
    /// One entry a source file, in compile order.
    pub files: Vec<SourceUnit>,
    /// Every name that occurs in the sources.
    pub names: Interner,
    /// How many [`ExprId`]s were given out: a side table of this length has room for all expressions.
    pub expr_count: u32,
}

impl Ast {
    /// All declarations of all files in compile order.
    pub fn declarations(&self) -> impl Iterator<Item = &Declaration> {
        self.files.iter().flat_map(|file| file.declarations.iter())
    }
}

/// One source file.
#[derive(Debug)]
pub struct SourceUnit {
    /// Which file.
    pub file: FileId,
    /// What it declares, in order.
    pub declarations: Vec<Declaration>,
    /// Pragmas that are no attributes, or that stand where no declaration follows; they have no meaning of their own.
    pub pragmas: Vec<Pragma>,
}

/// The number of an expression: dense, unique in an [`Ast`], in order of creation. Key of side tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ExprId(pub u32);

impl ExprId {
    /// The id as an index into a side table of [`Ast::expr_count`] entries.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A name as it was written at one place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ident {
    /// The case-folded name: two identifiers are the same name exactly if their symbols are equal.
    pub symbol: Symbol,
    /// The spelling at this place; [`Interner::text`] gives it as text.
    pub spelling: Symbol,
    /// Where it stands.
    pub span: Span,
}

impl Ident {
    /// Whether the parser put this here because the name is missing from the source.
    pub fn is_missing(&self) -> bool {
        self.symbol == Symbol::MISSING
    }
}

/// What a file may hold at its top level.
#[derive(Debug)]
pub enum Declaration {
    /// One entry of a `TYPE … END_TYPE` block (a block with several gives several declarations).
    Type(TypeDecl),
    /// `PROGRAM`, `FUNCTION` or `FUNCTION_BLOCK`.
    Pou(Pou),
    /// A `VAR_GLOBAL … END_VAR` outside of any configuration (a vendor's global variable list).
    Globals(VarSection),
    /// `CONFIGURATION … END_CONFIGURATION`.
    Configuration(Configuration),
}

/// `{attribute 'name'}` or `{attribute 'name' := 'value'}`, attached to the declaration that follows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// The name without its quotes, as written; compare without case.
    pub name: String,
    /// The value without its quotes.
    pub value: Option<String>,
    /// The whole pragma.
    pub span: Span,
}

/// A `{…}` that is no attribute.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pragma {
    /// The text between the braces.
    pub text: String,
    /// The whole pragma.
    pub span: Span,
}

// ---------------------------------------------------------------------------------------------------------------------
// Types
// ---------------------------------------------------------------------------------------------------------------------

/// `name : specification := initial value` in a TYPE block (IEC 61131-3 table 11).
#[derive(Debug)]
pub struct TypeDecl {
    /// The new type's name.
    pub name: Ident,
    /// What it is.
    pub spec: TypeSpec,
    /// Default initial value of its variables.
    pub init: Option<Init>,
    /// Attribute pragmas before it.
    pub attributes: Vec<Attribute>,
    /// The whole entry.
    pub span: Span,
}

/// A type as it is written in a declaration.
#[derive(Debug)]
pub struct TypeSpec {
    /// What it is.
    pub kind: TypeSpecKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of a type.
#[derive(Debug)]
pub enum TypeSpecKind {
    /// `INT`, `Motor`, `TON`: an elementary, derived or function block type, by name.
    Named(Ident),
    /// `STRING`, `STRING[20]`, `STRING(20)`, `WSTRING[…]`.
    String {
        /// WSTRING.
        wide: bool,
        /// The length in characters; absent: the default of the language.
        length: Option<Box<Expr>>,
    },
    /// `INT (0..100)`: values limited to a range of the base type.
    Subrange {
        /// The base type's name.
        base: Ident,
        /// Lowest and highest value.
        range: Box<Range>,
    },
    /// `(Red, Green := 5)`, `INT (Red, Green)` or `(Red, Green) INT`.
    Enum {
        /// The base type's name, where one is written.
        base: Option<Ident>,
        /// The values in order.
        values: Vec<EnumValue>,
    },
    /// `ARRAY[1..10, 0..3] OF INT`.
    Array {
        /// One entry a dimension.
        dims: Vec<ArrayDim>,
        /// Type of an element.
        element: Box<TypeSpec>,
    },
    /// `STRUCT … END_STRUCT` or `UNION … END_UNION`.
    Struct {
        /// UNION: the fields overlap.
        union: bool,
        /// The fields as written, `a, b : INT;` being one.
        fields: Vec<VarDecl>,
    },
    /// `REF_TO T`, `POINTER TO T`, `REFERENCE TO T`.
    Reference {
        /// Which of the three.
        kind: ReferenceKind,
        /// What it refers to.
        target: Box<TypeSpec>,
    },
    /// The source was wrong here and a diagnostic says so.
    Error,
}

/// The three spellings of a reference type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceKind {
    /// `REF_TO` (the standard's).
    RefTo,
    /// `POINTER TO` (vendors').
    PointerTo,
    /// `REFERENCE TO` (vendors'): dereferences itself.
    ReferenceTo,
}

/// `low..high`.
#[derive(Debug)]
pub struct Range {
    /// Lowest value.
    pub low: Expr,
    /// Highest value.
    pub high: Expr,
    /// Both.
    pub span: Span,
}

/// A dimension of an array type.
#[derive(Debug)]
pub enum ArrayDim {
    /// `low..high`.
    Range(Range),
    /// `*`: the bounds come with the argument.
    Open(Span),
}

/// One value of an enumeration.
#[derive(Debug)]
pub struct EnumValue {
    /// Its name.
    pub name: Ident,
    /// `:= value`.
    pub value: Option<Expr>,
    /// Attribute pragmas before it.
    pub attributes: Vec<Attribute>,
}

/// An initial value.
#[derive(Debug)]
pub struct Init {
    /// What it is.
    pub kind: InitKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of an initial value.
#[derive(Debug)]
pub enum InitKind {
    /// A constant expression.
    Expr(Expr),
    /// `[1, 2, 3(0), 2((a := 1))]`.
    Array(Vec<InitElement>),
    /// `(a := 1, b := [1, 2])`: a structure's fields or a function block's inputs.
    Struct(Vec<InitField>),
}

/// An entry of an array initialiser.
#[derive(Debug)]
pub struct InitElement {
    /// `n(…)`: how often the values follow one another. Only a literal counts as one here: `N(0)` with a named constant
    /// is one value, a call expression, for the checker to tell apart.
    pub repeat: Option<Expr>,
    /// The values: exactly one without `repeat`; with it any number (none means the element type's default).
    pub values: Vec<Init>,
    /// The whole entry.
    pub span: Span,
}

/// `name := value` in a structure initialiser.
#[derive(Debug)]
pub struct InitField {
    /// The field.
    pub name: Ident,
    /// Its value.
    pub value: Init,
}

// ---------------------------------------------------------------------------------------------------------------------
// Program organisation units and variables
// ---------------------------------------------------------------------------------------------------------------------

/// A program, function or function block.
#[derive(Debug)]
pub struct Pou {
    /// Which of them.
    pub kind: PouKind,
    /// Its name.
    pub name: Ident,
    /// The result type of a function; absent: it has none.
    pub result: Option<TypeSpec>,
    /// Its variable sections in order.
    pub sections: Vec<VarSection>,
    /// Its statements.
    pub body: Block,
    /// Attribute pragmas before it.
    pub attributes: Vec<Attribute>,
    /// From its first keyword to its END_….
    pub span: Span,
}

/// Kinds of program organisation units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PouKind {
    /// `PROGRAM`.
    Program,
    /// `FUNCTION`.
    Function,
    /// `FUNCTION_BLOCK`.
    FunctionBlock,
}

/// `VAR… qualifiers declarations END_VAR`.
#[derive(Debug)]
pub struct VarSection {
    /// Which section.
    pub kind: VarKind,
    /// `CONSTANT`.
    pub constant: Option<Span>,
    /// `RETAIN`, `NON_RETAIN` or `PERSISTENT`.
    pub retention: Option<(Retention, Span)>,
    /// The declarations.
    pub decls: Vec<VarDecl>,
    /// Attribute pragmas before the section.
    pub attributes: Vec<Attribute>,
    /// The whole section.
    pub span: Span,
}

/// Kinds of variable sections.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum VarKind {
    /// `VAR`.
    Local,
    /// `VAR_INPUT`.
    Input,
    /// `VAR_OUTPUT`.
    Output,
    /// `VAR_IN_OUT`.
    InOut,
    /// `VAR_GLOBAL`.
    Global,
    /// `VAR_EXTERNAL`.
    External,
    /// `VAR_TEMP`.
    Temp,
}

/// What happens to a variable's value over a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retention {
    /// `RETAIN`: kept over a warm start.
    Retain,
    /// `NON_RETAIN`: not kept.
    NonRetain,
    /// `PERSISTENT` (with or without RETAIN; vendors'): kept over a download too.
    Persistent,
}

/// `a, b AT %QX0.0 : BOOL := TRUE;`
#[derive(Debug)]
pub struct VarDecl {
    /// The declared names, at least one.
    pub names: Vec<Ident>,
    /// `AT %…`.
    pub address: Option<DirectAddress>,
    /// The type.
    pub ty: TypeSpec,
    /// `R_EDGE` or `F_EDGE` after the type of an input.
    pub edge: Option<(Edge, Span)>,
    /// `:= …`.
    pub init: Option<Init>,
    /// Attribute pragmas before it.
    pub attributes: Vec<Attribute>,
    /// The whole declaration without its `;`.
    pub span: Span,
}

/// An input that is TRUE only in the call that sees the edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// `R_EDGE`.
    Rising,
    /// `F_EDGE`.
    Falling,
}

/// A direct address: `%IX0.0`, `%QW3`, `%M4`, `%I*`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DirectAddress {
    /// Which image.
    pub area: Area,
    /// How many bits; absent (`%I0.0`): a bit.
    pub size: Option<AccessSize>,
    /// The numbers between the dots, outermost first; empty for `%I*`.
    pub path: Vec<u32>,
    /// Where it stands.
    pub span: Span,
}

impl DirectAddress {
    /// `%I*`: a place that VAR_CONFIG is to give.
    pub fn is_incomplete(&self) -> bool {
        self.path.is_empty()
    }
}

/// The areas of the process image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Area {
    /// `%I`.
    Input,
    /// `%Q`.
    Output,
    /// `%M`.
    Memory,
}

/// The size letter of a direct address or of a partial access.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AccessSize {
    /// `X`: 1 bit.
    Bit,
    /// `B`: 8 bits.
    Byte,
    /// `W`: 16 bits.
    Word,
    /// `D`: 32 bits.
    Double,
    /// `L`: 64 bits.
    Long,
}

impl AccessSize {
    /// The size in bits.
    pub fn bits(self) -> u32 {
        match self {
            Self::Bit => 1,
            Self::Byte => 8,
            Self::Word => 16,
            Self::Double => 32,
            Self::Long => 64,
        }
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// Configurations
// ---------------------------------------------------------------------------------------------------------------------

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
    /// The path's names.
    pub path: Vec<Ident>,
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

// ---------------------------------------------------------------------------------------------------------------------
// Statements
// ---------------------------------------------------------------------------------------------------------------------

/// A list of statements.
#[derive(Debug)]
pub struct Block {
    /// The statements in order.
    pub statements: Vec<Stmt>,
    /// From the first to the last; where there is none, the empty place where they would stand.
    pub span: Span,
}

/// A statement.
#[derive(Debug)]
pub struct Stmt {
    /// What it is.
    pub kind: StmtKind,
    /// The whole statement without its `;`.
    pub span: Span,
}

/// The forms of a statement.
#[derive(Debug)]
pub enum StmtKind {
    /// `target := value`.
    Assign {
        /// What is written to.
        target: Expr,
        /// The operator.
        op_span: Span,
        /// The value.
        value: Expr,
    },
    /// `f(…)`, `fb(…)`: the expression is an [`ExprKind::Call`].
    Call(Expr),
    /// `IF … THEN … ELSIF … ELSE … END_IF`.
    If {
        /// IF and every ELSIF.
        branches: Vec<IfBranch>,
        /// ELSE.
        otherwise: Option<Block>,
    },
    /// `CASE … OF … END_CASE`.
    Case {
        /// What is compared.
        selector: Expr,
        /// The arms in order.
        arms: Vec<CaseArm>,
        /// ELSE.
        otherwise: Option<Block>,
    },
    /// `FOR v := from TO to BY by DO … END_FOR`.
    For {
        /// The control variable.
        variable: Box<Expr>,
        /// First value.
        from: Box<Expr>,
        /// Last value.
        to: Box<Expr>,
        /// Step; absent: 1.
        by: Option<Box<Expr>>,
        /// The loop's statements.
        body: Block,
        /// `END_FOR`, where the loop jumps back.
        end_span: Span,
    },
    /// `WHILE … DO … END_WHILE`.
    While {
        /// Tested before each turn.
        condition: Expr,
        /// The loop's statements.
        body: Block,
        /// `END_WHILE`, where the loop jumps back.
        end_span: Span,
    },
    /// `REPEAT … UNTIL … END_REPEAT`.
    Repeat {
        /// The loop's statements.
        body: Block,
        /// Tested after each turn; TRUE ends the loop.
        until: Expr,
        /// `END_REPEAT`.
        end_span: Span,
    },
    /// `EXIT`.
    Exit,
    /// `CONTINUE`.
    Continue,
    /// `RETURN`.
    Return,
    /// A `;` alone.
    Empty,
    /// The source was wrong here and a diagnostic says so.
    Error,
}

/// A condition and what it guards.
#[derive(Debug)]
pub struct IfBranch {
    /// The condition.
    pub condition: Expr,
    /// The statements.
    pub body: Block,
}

/// `1, 3..5, Red: statements`.
#[derive(Debug)]
pub struct CaseArm {
    /// What selects the arm, at least one.
    pub labels: Vec<CaseLabel>,
    /// The statements.
    pub body: Block,
    /// Labels and body.
    pub span: Span,
}

/// A label of a CASE arm.
#[derive(Debug)]
pub enum CaseLabel {
    /// One value.
    Value(Expr),
    /// `low..high`.
    Range(Range),
}

// ---------------------------------------------------------------------------------------------------------------------
// Expressions
// ---------------------------------------------------------------------------------------------------------------------

/// An expression.
#[derive(Debug)]
pub struct Expr {
    /// Its number.
    pub id: ExprId,
    /// What it is.
    pub kind: ExprKind,
    /// Where it stands, with parentheses around it.
    pub span: Span,
}

/// The forms of an expression.
#[derive(Debug)]
pub enum ExprKind {
    /// A literal.
    Literal(Literal),
    /// A variable, constant, enumeration value or callee, by its name.
    Name(Ident),
    /// `Color#Red`.
    EnumValue {
        /// The enumeration.
        ty: Ident,
        /// The value.
        value: Ident,
    },
    /// `%IX0.0`.
    Direct(DirectAddress),
    /// `base.member`.
    Member {
        /// What has the member.
        base: Box<Expr>,
        /// The member.
        member: Ident,
    },
    /// `base[i, j]`.
    Index {
        /// The array (or string).
        base: Box<Expr>,
        /// One index a dimension, at least one.
        indices: Vec<Expr>,
    },
    /// `base^`.
    Deref {
        /// The reference.
        base: Box<Expr>,
    },
    /// `base.3`, `base.%X3`, `base.%B1`: a part of a bit string.
    Part {
        /// The bit string.
        base: Box<Expr>,
        /// How many bits (`base.3`: one).
        size: AccessSize,
        /// The number of the part, counted in parts of that size from the lowest.
        index: u32,
        /// What stands after the dot.
        part_span: Span,
    },
    /// `callee(arguments)`.
    Call {
        /// What is called.
        callee: Box<Expr>,
        /// The arguments in order.
        args: Vec<Arg>,
    },
    /// `-x`, `NOT x`.
    Unary {
        /// The operator.
        op: UnaryOp,
        /// Where the operator stands.
        op_span: Span,
        /// The operand.
        operand: Box<Expr>,
    },
    /// `a + b`.
    Binary {
        /// The operator.
        op: BinaryOp,
        /// Where the operator stands.
        op_span: Span,
        /// The left operand.
        lhs: Box<Expr>,
        /// The right operand.
        rhs: Box<Expr>,
    },
    /// The source was wrong here and a diagnostic says so.
    Error,
}

/// An argument of a call.
#[derive(Debug)]
pub struct Arg {
    /// What it is.
    pub kind: ArgKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of an argument.
#[derive(Debug)]
pub enum ArgKind {
    /// `value`.
    Positional(Expr),
    /// `name := value`: an input or in-out.
    Input {
        /// The parameter.
        name: Ident,
        /// The value; `name :=` alone leaves the parameter as it is.
        value: Option<Expr>,
    },
    /// `name => target`, `NOT name => target`: an output.
    Output {
        /// The parameter.
        name: Ident,
        /// `NOT`: the negated value is stored.
        negated: bool,
        /// Where the value goes; `name =>` alone drops it.
        target: Option<Expr>,
    },
}

/// Unary operators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnaryOp {
    /// `-`.
    Neg,
    /// `+`: no effect.
    Plus,
    /// `NOT`.
    Not,
}

/// Binary operators (IEC 61131-3 table 71).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinaryOp {
    /// `**`.
    Power,
    /// `*`.
    Mul,
    /// `/`.
    Div,
    /// `MOD`.
    Mod,
    /// `+`.
    Add,
    /// `-`.
    Sub,
    /// `<`.
    Less,
    /// `>`.
    Greater,
    /// `<=`.
    LessEqual,
    /// `>=`.
    GreaterEqual,
    /// `=`.
    Equal,
    /// `<>`.
    NotEqual,
    /// `AND`, `&`.
    And,
    /// `XOR`.
    Xor,
    /// `OR`.
    Or,
    /// `AND_THEN`: the right operand only if the left one is TRUE.
    AndThen,
    /// `OR_ELSE`: the right operand only if the left one is FALSE.
    OrElse,
}

impl BinaryOp {
    /// The operator as the standard spells it.
    pub fn text(self) -> &'static str {
        match self {
            Self::Power => "**",
            Self::Mul => "*",
            Self::Div => "/",
            Self::Mod => "MOD",
            Self::Add => "+",
            Self::Sub => "-",
            Self::Less => "<",
            Self::Greater => ">",
            Self::LessEqual => "<=",
            Self::GreaterEqual => ">=",
            Self::Equal => "=",
            Self::NotEqual => "<>",
            Self::And => "AND",
            Self::Xor => "XOR",
            Self::Or => "OR",
            Self::AndThen => "AND_THEN",
            Self::OrElse => "OR_ELSE",
        }
    }

    /// `<`, `>`, `<=`, `>=`, `=` or `<>`.
    pub fn is_comparison(self) -> bool {
        matches!(self, Self::Less | Self::Greater | Self::LessEqual | Self::GreaterEqual | Self::Equal | Self::NotEqual)
    }
}

impl UnaryOp {
    /// The operator as the standard spells it.
    pub fn text(self) -> &'static str {
        match self {
            Self::Neg => "-",
            Self::Plus => "+",
            Self::Not => "NOT",
        }
    }
}

/// A literal with the type name before its `#`, if any.
#[derive(Clone, Debug, PartialEq)]
pub struct Literal {
    /// `INT` of `INT#5`; absent in `5`. For times and dates the prefix is in [`LiteralValue`] and this is absent.
    pub ty: Option<Ident>,
    /// The value.
    pub value: LiteralValue,
}

/// The value of a literal.
#[derive(Clone, Debug, PartialEq)]
pub enum LiteralValue {
    /// `1_000`, `16#FF`, `INT#-5`: an integer.
    Int {
        /// The sign inside a typed literal (`INT#-5`). `-5` alone is a [`UnaryOp::Neg`] around a literal.
        negative: bool,
        /// The absolute value.
        magnitude: u64,
        /// Written with a base (`16#…`, `8#…`, `2#…`).
        based: bool,
    },
    /// `1.5`, `1.5E-3`, `REAL#-1.5`: finite, except that a number too large for an LREAL is infinite (and reported).
    Real {
        /// The nearest LREAL.
        value: f64,
        /// The nearest REAL, rounded once from the digits.
        value_f32: f32,
    },
    /// `TRUE`, `FALSE`, `BOOL#1`.
    Bool(bool),
    /// `T#…`, `TIME#…`, `LT#…`, `LTIME#…`.
    Time {
        /// LTIME.
        long: bool,
        /// Nanoseconds.
        value_ns: i64,
    },
    /// `D#…`, `DATE#…`, `LD#…`, `LDATE#…`.
    Date {
        /// LDATE.
        long: bool,
        /// Nanoseconds since 1970-01-01.
        value_ns: i64,
    },
    /// `TOD#…`, `TIME_OF_DAY#…`, `LTOD#…`, `LTIME_OF_DAY#…`.
    TimeOfDay {
        /// LTOD.
        long: bool,
        /// Nanoseconds since midnight.
        value_ns: i64,
    },
    /// `DT#…`, `DATE_AND_TIME#…`, `LDT#…`, `LDATE_AND_TIME#…`.
    DateAndTime {
        /// LDT.
        long: bool,
        /// Nanoseconds since 1970-01-01.
        value_ns: i64,
    },
    /// `'text'`: Latin-1 bytes, escapes resolved. A character that Latin-1 lacks has been reported.
    String(Vec<u8>),
    /// `"text"`: UTF-16 code units, escapes resolved.
    WString(Vec<u16>),
}
