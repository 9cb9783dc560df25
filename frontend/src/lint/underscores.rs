//! S0078: a name with underscores where the standard has none (6.1.2): two in a row, or one at its end.

use super::Linted;
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::syntax::ast::Ident;

/// What is wrong with a name.
fn fault(name: &str) -> Option<&'static str> {
    if name.contains("__") {
        return Some("has two underscores in a row");
    }
    name.ends_with('_').then_some("ends with an underscore")
}

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    let mut name = |name: &Ident| {
        let text = linted.spelling(name);
        if let Some(fault) = fault(text) {
            let message = format!("the name `{text}` {fault}");
            let note = Diagnostic::new(&rules::UNDERSCORES, name.span, message);
            found.push(
                note.help("other compilers refuse it; one underscore between letters or digits is a part of a name"),
            );
        }
    };
    for pou in linted.pous() {
        name(&pou.name);
        pou.sections.iter().flat_map(|section| &section.decls).flat_map(|decl| &decl.names).for_each(&mut name);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::codes;

    #[test]
    fn doubled_and_last_ones() {
        let of = |name: &str| {
            codes(&format!("PROGRAM p\nVAR\n  {name} : INT;\nEND_VAR\n  {name} := {name} + 1;\nEND_PROGRAM\n"))
        };
        assert_eq!(of("a__b"), ["S0078"]);
        assert_eq!(of("a_"), ["S0078"]);
        assert_eq!(of("_a_b"), [""; 0]);
        assert_eq!(codes("PROGRAM p_\nEND_PROGRAM\n"), ["S0078"]);
    }
}
