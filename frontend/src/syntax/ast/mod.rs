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

mod config;
mod expr;
mod stmt;
mod test;
mod types;
mod vars;

pub use config::{
    AccessVar, ConfigVar, Configuration, Connection, ProgramInstance, Resource, Task, TaskParam, TaskParamKind,
};
pub use expr::{Arg, ArgKind, BinaryOp, Expr, ExprKind, Literal, LiteralValue, UnaryOp};
pub use stmt::{Block, CaseArm, CaseLabel, IfBranch, Stmt, StmtKind};
pub use test::{Test, TestPart, TestSuite};
pub use types::{
    ArrayDim, EnumValue, Init, InitElement, InitField, InitKind, Range, ReferenceKind, TypeDecl, TypeSpec, TypeSpecKind,
};
pub use vars::{AccessSize, Area, DirectAddress, Edge, Pou, PouKind, Retention, VarDecl, VarKind, VarSection};

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
    /// The name of the global variable list that it is: its globals are known as `NAME.x` too.
    pub global_list: Option<Ident>,
    /// What it declares, in order.
    pub declarations: Vec<Declaration>,
    /// Its declarations outside of POUs were wrong in a way that may have lost names.
    pub names_lost: bool,
    /// Its unit tests.
    pub tests: TestSuite,
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
