//! Statements.

use super::{Expr, Range};
use crate::source::Span;

/// A list of statements.
#[derive(Clone, Debug)]
pub struct Block {
    /// The statements in order.
    pub statements: Vec<Stmt>,
    /// From the first to the last; where there is none, the empty place where they would stand.
    pub span: Span,
}

/// A statement.
#[derive(Clone, Debug)]
pub struct Stmt {
    /// What it is.
    pub kind: StmtKind,
    /// The whole statement without its `;`.
    pub span: Span,
}

impl Stmt {
    /// The blocks in it, of every arm.
    #[must_use]
    pub fn blocks(&self) -> Vec<&Block> {
        match &self.kind {
            StmtKind::If { branches, otherwise } => {
                branches.iter().map(|branch| &branch.body).chain(otherwise).collect()
            }
            StmtKind::Case { arms, otherwise, .. } => arms.iter().map(|arm| &arm.body).chain(otherwise).collect(),
            StmtKind::For { body, .. } | StmtKind::While { body, .. } | StmtKind::Repeat { body, .. } => vec![body],
            _ => Vec::new(),
        }
    }
}

/// The forms of a statement.
#[derive(Clone, Debug)]
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
#[derive(Clone, Debug)]
pub struct IfBranch {
    /// The condition.
    pub condition: Expr,
    /// The statements.
    pub body: Block,
}

/// `1, 3..5, Red: statements`.
#[derive(Clone, Debug)]
pub struct CaseArm {
    /// What selects the arm, at least one.
    pub labels: Vec<CaseLabel>,
    /// The statements.
    pub body: Block,
    /// Labels and body.
    pub span: Span,
}

/// A label of a CASE arm.
#[derive(Clone, Debug)]
pub enum CaseLabel {
    /// One value.
    Value(Expr),
    /// `low..high`.
    Range(Range),
}
