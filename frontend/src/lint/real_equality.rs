//! T0120: REAL or LREAL compared for equality.
//!
//! Whole numbers of moderate size are exact, so comparing with one of them is left alone (`divisor = 0.0`), and so is comparing a
//! variable with itself, which asks for NaN.

use super::{Linted, typed};
use crate::analysis::tree::{BinOp, Expr, ExprKind, Place, Step};
use crate::analysis::types::{Const, is_real};
use crate::diagnostics::{Diagnostic, types as rules};

/// Whole numbers up to this are exact in a REAL.
const EXACT: f64 = 16_777_216.0;

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    let types = &linted.project.types;
    for (_, body) in linted.bodies() {
        typed::expressions(&body.statements, &mut |expr| {
            let ExprKind::Binary(op @ (BinOp::Eq | BinOp::Ne), a, b) = &expr.kind else { return };
            let Some(ty) = types.elementary(a.ty).filter(|ty| is_real(*ty)) else { return };
            if is_whole(a) || is_whole(b) || is_same(a, b) {
                return;
            }
            let message = format!("{} compares {} values bit for bit", op.text(), ty.name());
            let note = Diagnostic::new(&rules::REAL_EQUALITY, expr.span, message);
            found.push(note.help("compare the distance with a tolerance: `ABS(a - b) < 1.0E-6`"));
        });
    }
}

fn is_whole(expr: &Expr) -> bool {
    match expr.kind {
        ExprKind::Const(Const::F32(value)) => value.fract() == 0.0 && f64::from(value).abs() <= EXACT,
        ExprKind::Const(Const::F64(value)) => value.fract() == 0.0 && value.abs() <= EXACT,
        _ => false,
    }
}

fn is_same(a: &Expr, b: &Expr) -> bool {
    let (ExprKind::Load(a), ExprKind::Load(b)) = (&a.kind, &b.kind) else { return false };
    let fields = |place: &Place| -> Option<Vec<u32>> {
        let step = |step: &Step| match step {
            Step::Field(_, at) => Some(*at),
            _ => None,
        };
        place.path.iter().map(step).collect()
    };
    a.root == b.root && fields(a).is_some_and(|path| fields(b) == Some(path))
}

#[cfg(test)]
mod tests {
    use super::super::tests::of_program;

    fn of(condition: &str) -> Vec<&'static str> {
        of_program(
            "VAR\n  a, b : REAL;\n  c : LREAL;\n  i : INT;\nEND_VAR",
            &format!("a := b; c := a; i := 1; IF {condition} THEN ; END_IF;"),
        )
    }

    #[test]
    fn computed_values_are_reported() {
        assert_eq!(of("a = b"), ["T0120"]);
        assert_eq!(of("c <> a * 0.1"), ["T0120"]);
        assert_eq!(of("a = 0.1"), ["T0120"]);
    }

    #[test]
    fn whole_numbers_nan_and_order_are_not() {
        assert_eq!(of("a = 0.0 OR c <> 100.0 OR a <> a OR a < b OR i = 3"), [""; 0]);
    }
}
