//! S0076: IF with TRUE or FALSE as its condition, WHILE FALSE.
//!
//! A named constant is a switch and is left alone; WHILE TRUE and UNTIL FALSE are loops that EXIT leaves.

use super::{Linted, walk};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::syntax::ast::{Expr, ExprKind, LiteralValue, StmtKind};

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    for pou in linted.pous() {
        walk::statements(&pou.body, &mut |statement| match &statement.kind {
            StmtKind::If { branches, .. } => {
                for condition in branches.iter().map(|branch| &branch.condition) {
                    if let Some(value) = literal(condition) {
                        let word = if value { "always" } else { "never" };
                        let message = format!("this branch is {word} taken");
                        found.push(Diagnostic::new(&rules::LITERAL_CONDITION, condition.span, message));
                    }
                }
            }
            StmtKind::While { condition, .. } if literal(condition) == Some(false) => {
                let message = "this loop never runs";
                found.push(Diagnostic::new(&rules::LITERAL_CONDITION, condition.span, message));
            }
            _ => {}
        });
    }
}

fn literal(expr: &Expr) -> Option<bool> {
    match &expr.kind {
        ExprKind::Literal(literal) => match literal.value {
            LiteralValue::Bool(value) => Some(value),
            _ => None,
        },
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::of_program;

    fn of(body: &str) -> Vec<&'static str> {
        of_program(
            "VAR CONSTANT\n  debug : BOOL := FALSE;\nEND_VAR\nVAR\n  a : INT;\nEND_VAR",
            &format!("IF debug THEN a := 1; END_IF; {body}"),
        )
    }

    #[test]
    fn literals_are_reported_and_named_constants_are_not() {
        assert_eq!(of("IF FALSE THEN a := 2; ELSIF TRUE THEN a := 3; END_IF;"), ["S0076", "S0076"]);
        assert_eq!(of("WHILE FALSE DO a := 2; END_WHILE;"), ["S0076"]);
        assert_eq!(of("WHILE TRUE DO EXIT; END_WHILE; REPEAT EXIT; UNTIL FALSE END_REPEAT;"), [""; 0]);
    }
}
