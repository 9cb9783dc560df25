//! Types and initial values.

use super::{Attribute, Expr, Ident, VarDecl};
use crate::source::Span;

/// `name : specification := initial value` in a TYPE block (IEC 61131-3 table 11).
#[derive(Clone, Debug)]
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
#[derive(Clone, Debug)]
pub struct TypeSpec {
    /// What it is.
    pub kind: TypeSpecKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of a type.
#[derive(Clone, Debug)]
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
#[derive(Clone, Debug)]
pub struct Range {
    /// Lowest value.
    pub low: Expr,
    /// Highest value.
    pub high: Expr,
    /// Both.
    pub span: Span,
}

/// A dimension of an array type.
#[derive(Clone, Debug)]
pub enum ArrayDim {
    /// `low..high`.
    Range(Range),
    /// `*`: the bounds come with the argument.
    Open(Span),
}

/// One value of an enumeration.
#[derive(Clone, Debug)]
pub struct EnumValue {
    /// Its name.
    pub name: Ident,
    /// `:= value`.
    pub value: Option<Expr>,
    /// Attribute pragmas before it.
    pub attributes: Vec<Attribute>,
}

/// An initial value.
#[derive(Clone, Debug)]
pub struct Init {
    /// What it is.
    pub kind: InitKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of an initial value.
#[derive(Clone, Debug)]
pub enum InitKind {
    /// A constant expression.
    Expr(Expr),
    /// `[1, 2, 3(0), 2((a := 1))]`.
    Array(Vec<InitElement>),
    /// `(a := 1, b := [1, 2])`: a structure's fields or a function block's inputs.
    Struct(Vec<InitField>),
}

/// An entry of an array initialiser.
#[derive(Clone, Debug)]
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
#[derive(Clone, Debug)]
pub struct InitField {
    /// The field.
    pub name: Ident,
    /// Its value.
    pub value: Init,
}
