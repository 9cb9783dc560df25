//! S0073: IF, FOR or WHILE around nothing, not even a `;`.

use super::{Linted, walk};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::source::Span;
use crate::syntax::ast::{Block, Stmt, StmtKind};

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    for pou in linted.pous() {
        walk::statements(&pou.body, &mut |statement| {
            for (span, what) in empty(statement) {
                let message = format!("{what} has nothing to do");
                let note = Diagnostic::new(&rules::EMPTY_BODY, span, message);
                found.push(note.help("write `;` there if nothing is meant to happen"));
            }
        });
    }
}

/// The empty parts of a statement and their names.
fn empty(statement: &Stmt) -> Vec<(Span, &'static str)> {
    let is_empty = |block: &Block| block.statements.is_empty();
    match &statement.kind {
        StmtKind::If { branches, .. } => {
            let nothing = branches.iter().filter(|branch| is_empty(&branch.body));
            nothing.map(|branch| (branch.condition.span, "this branch")).collect()
        }
        StmtKind::For { variable, body, .. } if is_empty(body) => vec![(variable.span, "this loop")],
        StmtKind::While { condition, body, .. } if is_empty(body) => vec![(condition.span, "this loop")],
        StmtKind::Repeat { until, body, .. } if is_empty(body) => vec![(until.span, "this loop")],
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::of_program;

    fn of(body: &str) -> Vec<&'static str> {
        of_program("VAR\n  a : INT;\nEND_VAR", body)
    }

    #[test]
    fn nothing_at_all_is_reported_and_a_semicolon_is_not() {
        assert_eq!(of("IF a > 1 THEN ELSIF a > 2 THEN a := 1; END_IF;"), ["S0073"]);
        assert_eq!(of("FOR a := 1 TO 3 DO END_FOR; WHILE a > 9 DO END_WHILE;"), ["S0073", "S0073"]);
        assert_eq!(of("IF a > 1 THEN ; END_IF; FOR a := 1 TO 3 DO ; END_FOR;"), [""; 0]);
    }
}
