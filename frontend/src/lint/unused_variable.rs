//! S0070: a variable that nothing mentions.
//!
//! Only VAR and VAR_TEMP: inputs and outputs belong to those who call. A variable at an address is there for the process image. A
//! PROGRAM's variable with an initial value may be a parameter that a screen or `--set` changes; one without is nothing to anybody.

use super::{Linted, mentions};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::syntax::ast::{PouKind, VarKind};

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    let members = mentions::members(linted.ast);
    for pou in linted.pous() {
        let mentioned = mentions::mentioned(pou);
        let sections = pou.sections.iter().filter(|section| matches!(section.kind, VarKind::Local | VarKind::Temp));
        for decl in sections.flat_map(|section| &section.decls) {
            let kept = decl.address.is_some() || (pou.kind == PouKind::Program && decl.init.is_some());
            let is_used = |symbol| mentioned.contains(&symbol) || members.contains(&symbol);
            for name in decl.names.iter().filter(|name| !kept && !is_used(name.symbol)) {
                let message = format!("the variable `{}` is never used", linted.spelling(name));
                found.push(Diagnostic::new(&rules::UNUSED_VARIABLE, name.span, message).help("leave it out"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{codes, of_program};

    #[test]
    fn what_is_mentioned_anywhere_is_used() {
        assert_eq!(of_program("VAR\n  a, b : INT;\nEND_VAR", "a := 1;"), ["S0070"]);
        assert_eq!(
            of_program("VAR CONSTANT\n  n : INT := 3;\nEND_VAR\nVAR\n  a : ARRAY[0..n] OF INT;\nEND_VAR", "a[1] := 1;"),
            [""; 0]
        );
        assert_eq!(of_program("VAR\n  t : TON;\nEND_VAR", "t(IN := TRUE);"), [""; 0]);
        assert_eq!(
            of_program("VAR\n  a AT %QW0 : INT;\n  b : INT := 3;\nEND_VAR\nVAR_INPUT\n  c : INT;\nEND_VAR", ";"),
            [""; 0]
        );
        assert_eq!(of_program("VAR_TEMP\n  b : INT;\nEND_VAR", ";"), ["S0070"]);
    }

    #[test]
    fn what_others_reach_for_is_used() {
        let block =
            "FUNCTION_BLOCK F\nVAR\n  n : INT := 1;\nEND_VAR\n  ;\nEND_FUNCTION_BLOCK\nPROGRAM p\nEND_PROGRAM\n";
        assert_eq!(codes(block), ["S0070"]);
        assert_eq!(
            codes(&format!("{block}TEST 't'\nVAR\n  f : F;\nEND_VAR\n  ASSERT_EQ(f.n, 1);\nEND_TEST\n")),
            [""; 0]
        );
    }
}
