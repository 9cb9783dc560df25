//! Expressions and literals.

use super::{AccessSize, DirectAddress, ExprId, Ident};
use crate::source::Span;

/// An expression.
#[derive(Clone, Debug)]
pub struct Expr {
    /// Its number.
    pub id: ExprId,
    /// What it is.
    pub kind: ExprKind,
    /// Where it stands, with parentheses around it.
    pub span: Span,
}

/// The forms of an expression.
#[derive(Clone, Debug)]
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
#[derive(Clone, Debug)]
pub struct Arg {
    /// What it is.
    pub kind: ArgKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of an argument.
#[derive(Clone, Debug)]
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
