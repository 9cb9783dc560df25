//! S0074: a variable of a unit that hides a global one.

use std::collections::BTreeMap;

use super::Linted;
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::syntax::ast::VarKind;

pub(super) fn look(linted: &Linted<'_>, found: &mut Vec<Diagnostic>) {
    let globals = linted.project.globals.iter().filter(|global| !global.qualified_only);
    let globals: BTreeMap<_, _> = globals.map(|global| (global.symbol, global.span)).collect();
    for pou in linted.pous() {
        let sections = pou.sections.iter().filter(|section| matches!(section.kind, VarKind::Local | VarKind::Temp));
        for name in sections.flat_map(|section| &section.decls).flat_map(|decl| &decl.names) {
            if let Some(global) = globals.get(&name.symbol) {
                let message = format!("`{}` hides the global variable of that name", linted.spelling(name));
                let note = Diagnostic::new(&rules::SHADOWED_GLOBAL, name.span, message).label(*global, "hidden here");
                found.push(note.help("give one of them another name, or declare this one in VAR_EXTERNAL"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::codes;

    #[test]
    fn local_variables_hide_and_external_ones_do_not() {
        let of = |section: &str| {
            codes(&format!(
                "VAR_GLOBAL\n  speed : INT;\nEND_VAR\nPROGRAM p\n{section}\n  Speed : INT;\nEND_VAR\n  speed := 1;\nEND_PROGRAM\n"
            ))
        };
        assert_eq!(of("VAR"), ["S0074"]);
        assert_eq!(of("VAR_EXTERNAL"), [""; 0]);
        assert_eq!(of("VAR_INPUT"), [""; 0]);
    }
}
