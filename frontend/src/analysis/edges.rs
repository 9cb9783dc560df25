//! R_EDGE and F_EDGE of inputs (IEC 61131-3 table 44): the body sees TRUE only in the call in which the input rose or fell.
//!
//! Such an input has two variables beside it that nobody can name: what the body sees, and the input at the call before. The body begins
//! with `seen := input AND NOT last; last := input` (F_EDGE: `seen := last AND NOT input`), as if an R_TRIG or F_TRIG stood before it.
//! From outside the input is what was written to it.

use super::Analyzer;
use super::expr::Checker;
use super::tree::{
    BinOp, EdgeInput, Expr, ExprKind, Place, PouId, Root, Stmt, StmtKind, UnOp, VarClass, VarId, VarInfo,
};
use super::types::{BOOL, Ty, Value};
use crate::diagnostics::semantic as rules;
use crate::source::Span;
use crate::syntax::ast::{Edge, PouKind, VarDecl};

impl Analyzer<'_> {
    /// The hidden variables of an input at position `at` with R_EDGE or F_EDGE; none without.
    pub(super) fn edge_input(
        &mut self,
        decl: &VarDecl,
        kind: PouKind,
        var: &mut VarInfo,
        at: VarId,
    ) -> Option<[VarInfo; 2]> {
        let (edge, span) = decl.edge?;
        let fits = var.class == VarClass::Input && var.ty == BOOL && kind != PouKind::Function && var.located.is_none();
        if !fits {
            if var.ty != Ty::Error {
                let message = "R_EDGE and F_EDGE are for inputs of type BOOL of a function block or program";
                self.report(&rules::EDGE, span, message);
            }
            return None;
        }
        let (seen, last) = (VarId(at.0.saturating_add(1)), VarId(at.0.saturating_add(2)));
        var.edge = Some(EdgeInput { falling: edge == Edge::Falling, seen, last });
        let hidden = |what: &str| VarInfo {
            name: format!("__{}_{what}", var.name),
            class: VarClass::Local,
            init: Value::Zero,
            edge: None,
            ..var.clone()
        };
        Some([hidden("edge"), hidden("last")])
    }
}

impl Checker<'_, '_> {
    /// What the body of a unit with such inputs begins with.
    pub(super) fn edge_statements(&mut self, pou: PouId) -> Vec<Stmt> {
        let Some(info) = self.an.info(pou) else { return Vec::new() };
        let mut found = Vec::new();
        for (id, var) in (0u32..).map(VarId).zip(&info.vars) {
            let Some(edge) = var.edge else { continue };
            let span = var.span;
            let (on, off) = if edge.falling { (edge.last, id) } else { (id, edge.last) };
            let off = self.unary_op(UnOp::Not, value(off, span), span);
            let seen = self.binary_op(BinOp::And, value(on, span), off, span, BOOL);
            found.push(assign(edge.seen, seen, span));
            found.push(assign(edge.last, value(id, span), span));
        }
        found
    }
}

fn place(var: VarId, span: Span) -> Place {
    Place { root: Root::Var(var), path: Vec::new(), ty: BOOL, span }
}

fn value(var: VarId, span: Span) -> Expr {
    Expr { kind: ExprKind::Load(Box::new(place(var, span))), ty: BOOL, span }
}

fn assign(target: VarId, value: Expr, span: Span) -> Stmt {
    Stmt { kind: StmtKind::Assign { target: place(target, span), value }, span }
}
