//! Warnings about what is legal and most likely not meant. One file a rule, each with its own tests; their texts are rows of
//! [`crate::diagnostics`].
//!
//! They look at sound programs only: where something is wrong, what is unused or never written follows from that, and would only
//! hide it. The standard library's own text is passed over, tests are not looked at. A rule that would often be wrong is no rule:
//! `tests/lints.rs` runs all of them over the programs that this repository trusts.

mod empty_body;
mod fixed_comparison;
mod literal_condition;
mod loop_variable;
mod mentions;
mod output_never_written;
mod real_equality;
mod self_assignment;
mod shadowed_global;
mod typed;
mod underscores;
mod unused_variable;
mod walk;

use crate::analysis::tree::{Body, PouInfo, Project};
use crate::diagnostics::Diagnostic;
use crate::source::FileId;
use crate::syntax::ast::{Ast, Declaration, Ident, Pou};

/// What the rules look at.
struct Linted<'a> {
    ast: &'a Ast,
    project: &'a Project,
    standard: Option<FileId>,
}

/// The rules.
const RULES: [fn(&Linted<'_>, &mut Vec<Diagnostic>); 10] = [
    unused_variable::look,
    output_never_written::look,
    self_assignment::look,
    empty_body::look,
    shadowed_global::look,
    loop_variable::look,
    literal_condition::look,
    real_equality::look,
    fixed_comparison::look,
    underscores::look,
];

/// Everything that the rules have to say about a program without errors.
pub(crate) fn lint(ast: &Ast, project: &Project, standard: Option<FileId>) -> Vec<Diagnostic> {
    let linted = Linted { ast, project, standard };
    let mut found = Vec::new();
    for rule in RULES {
        rule(&linted, &mut found);
    }
    found
}

impl<'a> Linted<'a> {
    /// The user's units as written.
    fn pous(&self) -> impl Iterator<Item = &'a Pou> {
        let standard = self.standard;
        let files = self.ast.files.iter().filter(move |file| Some(file.file) != standard);
        files.flat_map(|file| &file.declarations).filter_map(|declaration| match declaration {
            Declaration::Pou(pou) => Some(pou),
            _ => None,
        })
    }

    /// The user's bodies as checked. A unit that several resources reach comes once for each.
    fn bodies(&self) -> impl Iterator<Item = (&'a PouInfo, &'a Body)> {
        let (project, standard) = (self.project, self.standard);
        let reached = project.resources.iter().flat_map(|resource| &resource.bodies);
        reached.chain(&project.unreached).filter_map(move |(pou, body)| {
            let info = project.pous.get(pou.0 as usize)?;
            (Some(info.span.file) != standard).then_some((&**info, body))
        })
    }

    fn spelling(&self, name: &Ident) -> &'a str {
        self.ast.names.text(name.spelling)
    }
}

#[cfg(test)]
mod tests {
    use crate::diagnostics::Diagnostic;
    use crate::{CompileOptions, SourceInput, check};

    /// Codes of the diagnostics of a program with these declarations and statements, in order.
    pub(super) fn of_program(declarations: &str, body: &str) -> Vec<&'static str> {
        codes(&format!("PROGRAM p\n{declarations}\n{body}\nEND_PROGRAM\n"))
    }

    /// Codes of the diagnostics of a text, in order.
    pub(super) fn codes(text: &str) -> Vec<&'static str> {
        let source = SourceInput { name: "a.st".to_owned(), bytes: text.as_bytes().to_vec() };
        check(&[source], &CompileOptions::default()).diagnostics.iter().map(Diagnostic::code).collect()
    }

    #[test]
    fn a_program_with_errors_gets_no_lints() {
        assert_eq!(
            of_program("VAR\n  a : REAL;\n  unused : INT;\nEND_VAR", "a := b;\nIF TRUE THEN END_IF;"),
            ["S0001"]
        );
    }
}
