//! Program organisation units, variable sections and direct addresses.

use super::{Attribute, Block, Ident, Init, TypeSpec};
use crate::source::Span;

/// A program, function or function block.
#[derive(Clone, Debug)]
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
    /// Its declarations were wrong in a way that may have lost names: which ones are unknown can not be said.
    pub names_lost: bool,
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
#[derive(Clone, Debug)]
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
#[derive(Clone, Debug)]
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
