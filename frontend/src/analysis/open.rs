//! Parameters of type `ARRAY[*] OF …` (IEC 61131-3 table 15): their bounds come with the argument.
//!
//! A function may have them as VAR_INPUT, VAR_OUTPUT and VAR_IN_OUT, a function block as VAR_IN_OUT, which it does not store. Each such
//! parameter has a type of its own ([`TyKind::Open`]), a call says which array stands for it, and the lowering makes one function for
//! each combination of arrays ([`crate::lower`]). So every access is checked against the bounds of the very array.

use std::rc::Rc;

use super::Analyzer;
use super::expr::{Checker, broken};
use super::tree::{Expr, ExprKind, PouId, PouInfo, Root, Stmt, StmtKind, VarClass, VarId, VarInfo};
use super::types::{Const, DINT, Ty, TyDef, TyKind, Value};
use crate::diagnostics::{semantic as names, types as rules};
use crate::source::Span;
use crate::syntax::ast::{ArrayDim, PouKind, TypeSpec, TypeSpecKind};

impl<'a> Analyzer<'a> {
    /// The type of a parameter `ARRAY[*, …] OF …`; `None`: it is written in another way.
    pub(super) fn open_array(
        &mut self,
        spec: &'a TypeSpec,
        kind: PouKind,
        class: VarClass,
        scope: Option<PouId>,
    ) -> Option<Ty> {
        let TypeSpecKind::Array { dims, element } = &spec.kind else { return None };
        let first = dims.iter().find_map(|dim| match dim {
            ArrayDim::Open(at) => Some(*at),
            ArrayDim::Range(_) => None,
        })?;
        let open = dims.iter().all(|dim| matches!(dim, ArrayDim::Open(_)));
        let here = match kind {
            PouKind::Function => matches!(class, VarClass::Input | VarClass::Output | VarClass::InOut),
            PouKind::FunctionBlock => class == VarClass::InOut,
            PouKind::Program => false,
        };
        if !here || !open || dims.len() > khz_bytecode::limits::MAX_DIMENSIONS {
            self.open_array_not_here(first);
            return Some(Ty::Error);
        }
        let element = self.resolve_spec(element, scope).0;
        if element == Ty::Error || self.too_deep(element, spec.span) {
            return Some(Ty::Error);
        }
        let stars = vec!["*"; dims.len()].join(", ");
        let name = format!("ARRAY[{stars}] OF {}", self.types.name(element));
        let (depth, alternatives) = (self.types.depth(element) + 1, self.types.alternatives(element));
        let kind = TyKind::Open { element, dims: dims.len() };
        let def = TyDef { name, kind, size: 0, align: 1, default: Value::Zero, depth, alternatives };
        Some(Ty::User(self.types.add(def)))
    }

    pub(super) fn open_array_not_here(&mut self, span: Span) {
        let message = "an array without bounds is a VAR_INPUT, VAR_OUTPUT or VAR_IN_OUT of a function or a VAR_IN_OUT of a \
                       function block, with `*` for every dimension";
        self.report(&rules::OPEN_ARRAY, span, message);
    }
}

impl Checker<'_, '_> {
    /// Whether a parameter's bounds come with its argument.
    pub(super) fn is_open(&self, ty: Ty) -> bool {
        matches!(self.an.types.kind(ty), Some(TyKind::Open { .. }))
    }

    /// Whether an argument's type can stand for a parameter's; reports when not.
    pub(super) fn stands_for(&mut self, var: &VarInfo, given: Ty, span: Span) -> bool {
        let Some(TyKind::Open { element, dims }) = self.an.types.kind(var.ty).cloned() else {
            return given == var.ty || var.ty == Ty::Error;
        };
        let fits = match self.an.types.kind(given) {
            Some(TyKind::Array { element: own, dims: bounds }) => *own == element && bounds.len() == dims,
            Some(TyKind::Open { element: own, dims: count }) => *own == element && *count == dims,
            _ => given == Ty::Error,
        };
        if !fits {
            let (wanted, found) = (self.an.types.name(var.ty), self.an.types.name(given));
            let message = format!("`{}` is {wanted}; {found} can not stand in for it", var.name);
            self.an.report(&rules::MISMATCH, span, message);
        }
        fits
    }

    /// Adds the arrays that outputs of a function call go to, where their parameters are open.
    pub(super) fn output_arrays(&self, info: &PouInfo, after: &[Rc<Stmt>], arrays: &mut Vec<(VarId, Ty)>) {
        for statement in after {
            if let StmtKind::Assign { target, value } = &statement.kind
                && let ExprKind::Load(from) = &value.kind
                && let Root::CallOutput(id) = from.root
                && info.vars.get(id.0 as usize).is_some_and(|var| self.is_open(var.ty))
            {
                arrays.push((id, target.ty));
            }
        }
    }

    /// The arrays of a call that stand for open ones, in the order of declaration.
    pub(super) fn in_order(mut arrays: Vec<(VarId, Ty)>) -> Vec<(VarId, Ty)> {
        arrays.sort_by_key(|(id, _)| *id);
        arrays
    }

    /// LOWER_BOUND and UPPER_BOUND.
    pub(super) fn array_bound(&mut self, array: &Expr, dim: &Expr, upper: bool, span: Span) -> Expr {
        let ExprKind::Const(Const::Int(number)) = dim.kind else {
            self.an.report(
                &names::NOT_CONSTANT,
                dim.span,
                "the number of a dimension is known when the program is compiled",
            );
            return broken(span);
        };
        let at = usize::try_from(number).ok().and_then(|number| number.checked_sub(1));
        let (Ty::User(id), Some(kind)) = (array.ty, self.an.types.kind(array.ty).cloned()) else { return broken(span) };
        let count = match &kind {
            TyKind::Array { dims, .. } => dims.len(),
            TyKind::Open { dims, .. } => *dims,
            _ => 0,
        };
        let Some(at) = at.filter(|at| *at < count) else {
            let message = format!("the array has {count} dimensions, here is number {number}");
            self.an.report(&rules::INDEX, dim.span, message);
            return broken(span);
        };
        match kind {
            TyKind::Array { dims, .. } => {
                let bound = if upper { dims[at].1 } else { dims[at].0 };
                Expr { kind: ExprKind::Const(Const::Wide(i128::from(bound))), ty: Ty::IntLit, span }
            }
            _ => Expr { kind: ExprKind::Bound(id, at, upper), ty: DINT, span },
        }
    }
}
