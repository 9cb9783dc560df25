//! S0072: a variable assigned to itself.

use super::{Linted, walk};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::syntax::ast::{Expr, ExprKind, LiteralValue, StmtKind};

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    for pou in linted.pous() {
        walk::statements(&pou.body, &mut |statement| {
            if let StmtKind::Assign { target, value, .. } = &statement.kind
                && same_place(target, value)
            {
                let message = "this assigns a variable to itself";
                found.push(Diagnostic::new(&rules::SELF_ASSIGNMENT, statement.span, message));
            }
        });
    }
}

/// Whether two expressions are one place. With calls in them they may be two.
fn same_place(a: &Expr, b: &Expr) -> bool {
    match (&a.kind, &b.kind) {
        (ExprKind::Name(a), ExprKind::Name(b)) => a.symbol == b.symbol,
        (ExprKind::Direct(a), ExprKind::Direct(b)) => (a.area, a.size, &a.path) == (b.area, b.size, &b.path),
        (ExprKind::Member { base: a, member: x }, ExprKind::Member { base: b, member: y }) => {
            x.symbol == y.symbol && same_place(a, b)
        }
        (ExprKind::Part { base: a, size: x, index: i, .. }, ExprKind::Part { base: b, size: y, index: j, .. }) => {
            (x, i) == (y, j) && same_place(a, b)
        }
        (ExprKind::Index { base: a, indices: x }, ExprKind::Index { base: b, indices: y }) => {
            x.len() == y.len()
                && same_place(a, b)
                && x.iter().zip(y).all(|(x, y)| same_place(x, y) || same_number(x, y))
        }
        _ => false,
    }
}

fn same_number(a: &Expr, b: &Expr) -> bool {
    match (&a.kind, &b.kind) {
        (ExprKind::Literal(a), ExprKind::Literal(b)) => {
            matches!(a.value, LiteralValue::Int { .. }) && a.value == b.value && a.ty == b.ty
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::of_program;

    fn of(body: &str) -> Vec<&'static str> {
        of_program(
            "VAR\n  a, b, i : INT;\n  l : ARRAY[0..3] OF INT;\n  w : WORD;\nEND_VAR",
            &format!("a := 1; b := a; i := b; l[0] := i; w := 1; {body}"),
        )
    }

    #[test]
    fn the_same_place_in_any_spelling() {
        assert_eq!(of("a := A;"), ["S0072"]);
        assert_eq!(of("l[i] := l[i]; l[2] := l[2]; w.3 := w.3;"), ["S0072", "S0072", "S0072"]);
    }

    #[test]
    fn other_places_and_values() {
        assert_eq!(of("a := b; l[i] := l[a]; l[2] := l[3]; w.3 := w.4; a := a + 1; a := -a;"), [""; 0]);
    }
}
