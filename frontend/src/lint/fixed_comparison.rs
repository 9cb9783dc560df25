//! T0121: a comparison whose answer follows from the types.

use super::{Linted, typed};
use crate::analysis::tree::{BinOp, Expr, ExprKind};
use crate::analysis::types::{Const, TyKind, TypeTable, is_bits, is_integer, limits, widen};
use crate::diagnostics::{Diagnostic, types as rules};

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    let types = &linted.project.types;
    for (_, body) in linted.bodies() {
        typed::expressions(&body.statements, &mut |expr| {
            let ExprKind::Binary(op, a, b) = &expr.kind else { return };
            if !op.is_comparison() {
                return;
            }
            let (Some(x), Some(y)) = (range(types, a), range(types, b)) else { return };
            if let Some(answer) = answer(*op, x, y) {
                let word = if answer { "TRUE" } else { "FALSE" };
                // The side with more than one value is the one whose type decides.
                let (low, high) = if x.0 == x.1 { y } else { x };
                let message = format!("this comparison is always {word}: the value is {low} to {high}");
                found.push(Diagnostic::new(&rules::FIXED_COMPARISON, expr.span, message));
            }
        });
    }
}

/// The numbers that an integer expression can have. `None`: it is no integer.
fn range(types: &TypeTable, expr: &Expr) -> Option<(i128, i128)> {
    let elementary = types.elementary(expr.ty).filter(|ty| is_integer(*ty) || is_bits(*ty))?;
    let all = limits(elementary)?;
    if matches!(types.kind(expr.ty), Some(TyKind::Enum { .. })) {
        return None;
    }
    Some(match &expr.kind {
        ExprKind::Const(Const::Int(value)) => (widen(elementary, *value), widen(elementary, *value)),
        // The expression may have the base type already; the place has its own.
        ExprKind::Load(place) => match types.kind(place.ty) {
            Some(TyKind::Subrange { low, high, .. }) => (widen(elementary, *low), widen(elementary, *high)),
            _ => all,
        },
        ExprKind::Convert { value, .. } => {
            range(types, value).filter(|(low, high)| all.0 <= *low && *high <= all.1).unwrap_or(all)
        }
        _ => all,
    })
}

/// What a comparison of any of these with any of those says, if it is always the same.
fn answer(op: BinOp, (a_low, a_high): (i128, i128), (b_low, b_high): (i128, i128)) -> Option<bool> {
    let apart = a_high < b_low || b_high < a_low;
    let (always, never) = match op {
        BinOp::Eq => (false, apart),
        BinOp::Ne => (apart, false),
        BinOp::Lt => (a_high < b_low, a_low >= b_high),
        BinOp::Le => (a_high <= b_low, a_low > b_high),
        BinOp::Gt => (a_low > b_high, a_high <= b_low),
        BinOp::Ge => (a_low >= b_high, a_high < b_low),
        _ => (false, false),
    };
    match (always, never) {
        (true, _) => Some(true),
        (_, true) => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::of_program;

    fn of(condition: &str) -> Vec<&'static str> {
        let declarations = "VAR\n  u : UINT;\n  b : BYTE;\n  s : INT (0..9);\n  i : INT;\n  d : DINT;\nEND_VAR";
        of_program(declarations, &format!("u := 1; b := 1; s := 1; i := 1; d := 1; IF {condition} THEN ; END_IF;"))
    }

    #[test]
    fn what_the_type_decides_is_reported() {
        for condition in ["u >= 0", "u < 0", "INT#0 > u", "s < 10", "s = 11", "s <> -1", "UINT_TO_DINT(u) > 65535"] {
            assert_eq!(of(condition), ["T0121"], "{condition}");
        }
    }

    #[test]
    fn what_the_value_decides_is_not() {
        for condition in ["u > 0", "s < 9", "s = 9", "i >= 0", "d > 65535", "INT_TO_DINT(i) > u", "i < s", "u = 65535"]
        {
            assert_eq!(of(condition), [""; 0], "{condition}");
        }
    }
}
