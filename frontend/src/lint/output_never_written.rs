//! S0071: an output, or a function's result, that its body never writes.
//!
//! Handing it on counts as writing. A unit without statements is a stub (for mocks, say) and says nothing.

use super::{Linted, mentions};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::syntax::ast::VarKind;

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    for pou in linted.pous().filter(|pou| !pou.body.statements.is_empty()) {
        let written = mentions::written(&pou.body);
        let outputs = pou.sections.iter().filter(|section| section.kind == VarKind::Output);
        for decl in outputs.flat_map(|section| &section.decls).filter(|decl| decl.init.is_none()) {
            for name in decl.names.iter().filter(|name| !written.contains(&name.symbol)) {
                // The caller of ENO has it from EN unless the body says otherwise (6.6.1.7).
                if linted.spelling(name).eq_ignore_ascii_case("ENO") {
                    continue;
                }
                let message = format!("the output `{}` is never written", linted.spelling(name));
                found.push(Diagnostic::new(&rules::OUTPUT_NEVER_WRITTEN, name.span, message));
            }
        }
        if pou.result.is_some() && !written.contains(&pou.name.symbol) {
            let message = format!("the result of `{}` is never written", linted.spelling(&pou.name));
            let help = format!("the result is what is assigned to `{}`", linted.spelling(&pou.name));
            found.push(Diagnostic::new(&rules::OUTPUT_NEVER_WRITTEN, pou.name.span, message).help(help));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::codes;

    fn of_block(body: &str) -> Vec<&'static str> {
        codes(&format!(
            "TYPE\n  S : STRUCT\n    x : INT;\n  END_STRUCT;\nEND_TYPE\nFUNCTION Set\nVAR_IN_OUT\n  v : INT;\nEND_VAR\n  v := 1;\nEND_FUNCTION\n\
             FUNCTION_BLOCK F\nVAR_OUTPUT\n  q : INT;\nEND_VAR\nVAR\n  s : S;\nEND_VAR\n  {body}\nEND_FUNCTION_BLOCK\nPROGRAM p\nEND_PROGRAM\n"
        ))
    }

    #[test]
    fn every_way_of_writing_counts() {
        assert_eq!(of_block("s.x := q;"), ["S0071"]);
        assert_eq!(of_block("s.x := 1; q := s.x;"), [""; 0]);
        assert_eq!(of_block("s.x := 1; Set(v := q);"), [""; 0]);
        assert_eq!(of_block("FOR q := 1 TO 3 DO s.x := q; END_FOR;"), [""; 0]);
        assert_eq!(of_block("s.x := 1; q.0 := TRUE;"), [""; 0]);
    }

    #[test]
    fn a_function_without_its_result() {
        let text =
            "FUNCTION f : INT\nVAR_INPUT\n  x : INT;\nEND_VAR\n  x := x + 1;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n";
        assert_eq!(codes(text), ["S0071"]);
        assert_eq!(codes(&text.replace("x := x + 1", "f := x + 1")), [""; 0]);
        assert_eq!(codes(&text.replace("  x := x + 1;\n", "")), [""; 0], "a stub");
    }
}
