//! S0075: the control variable of a FOR loop, written in its body.

use super::{Linted, mentions, walk};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::syntax::ast::{ExprKind, StmtKind};

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    for pou in linted.pous() {
        walk::statements(&pou.body, &mut |statement| {
            let StmtKind::For { variable, body, .. } = &statement.kind else { return };
            let ExprKind::Name(control) = &variable.kind else { return };
            // Looked through before the places are: loops nest, and most bodies leave their control variable alone.
            if !mentions::written(body).contains(&control.symbol) {
                return;
            }
            walk::statements(body, &mut |inner| {
                let target = match &inner.kind {
                    StmtKind::Assign { target, .. } => target,
                    StmtKind::For { variable, .. } => variable,
                    _ => return,
                };
                if walk::root(target).is_some_and(|name| name.symbol == control.symbol) {
                    let message = format!("the loop counts in `{}`, which this changes", linted.spelling(control));
                    let note = Diagnostic::new(&rules::LOOP_VARIABLE, target.span, message);
                    found.push(note.label(variable.span, "counted here").help("leave a loop with EXIT"));
                }
            });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::of_program;

    fn of(body: &str) -> Vec<&'static str> {
        of_program("VAR\n  i, j : INT;\nEND_VAR", &format!("FOR i := 1 TO 9 DO {body} END_FOR;"))
    }

    #[test]
    fn writes_inside_are_reported() {
        assert_eq!(of("IF j > 3 THEN i := 9; END_IF; j := i;"), ["S0075"]);
        assert_eq!(of("FOR i := 1 TO 2 DO j := i; END_FOR;"), ["S0075"]);
    }

    #[test]
    fn reads_and_other_variables_are_not() {
        assert_eq!(of("j := i + 1; FOR j := i TO 2 DO ; END_FOR;"), [""; 0]);
    }
}
