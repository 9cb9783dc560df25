//! `PROGRAM p : Type (fb WITH task)` (IEC 61131-3 6.8.2): a function block instance that a task of its own runs.
//!
//! Such an instance runs under that task only. So the body of its program may write its inputs and read its outputs, and must not call it.
//! To the resource it is one more entry, right behind that of its program instance.

use std::collections::BTreeMap;

use super::Analyzer;
use super::tree::{BlockTask, InstancePlan, ResourcePlan, VarClass, VarId};
use super::types::TyKind;
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::source::Span;
use crate::syntax::ast::{Expr, ExprKind, Ident};
use crate::syntax::symbol::Symbol;

impl Analyzer<'_> {
    /// Adds the instance to what the tasks run.
    pub(super) fn block_task(
        &mut self,
        fb: &Expr,
        task: &Ident,
        tasks: &BTreeMap<Symbol, (u32, Span)>,
        instance: &mut InstancePlan,
    ) {
        let task = self.known_task(task, tasks);
        let Some(info) = self.info(instance.program) else { return };
        let ExprKind::Name(name) = &fb.kind else {
            self.report(
                &rules::CONNECTION,
                fb.span,
                "a task runs a function block instance that is a variable of the program",
            );
            return;
        };
        let Some((var, found)) = (0u32..).map(VarId).zip(&info.vars).find(|(_, var)| var.symbol == name.symbol) else {
            let message = format!("{} has no variable `{}`", info.name, self.spelling(name));
            let known: Vec<Symbol> = info.vars.iter().map(|var| var.symbol).collect();
            self.report_unknown(&rules::UNKNOWN_PARAMETER, name, message, known.into_iter());
            return;
        };
        let block = match self.types.kind(found.ty) {
            Some(TyKind::Block { pou, .. }) if found.class == VarClass::Local => *pou,
            _ => {
                let message = format!("`{}` is no function block instance among the VAR of {}", found.name, info.name);
                self.report(&rules::CONNECTION, fb.span, message);
                return;
            }
        };
        let in_out =
            self.info(block).and_then(|block| block.vars.iter().find(|var| var.class == VarClass::InOut).cloned());
        if let Some(in_out) = in_out {
            let message = format!(
                "no task can run `{}`: its VAR_IN_OUT `{}` gets a variable in a call only",
                found.name, in_out.name
            );
            self.report(&rules::IN_OUT, fb.span, message);
            return;
        }
        if instance.blocks.iter().any(|other| other.var == var) {
            self.report(&rules::PARAMETER_TWICE, fb.span, format!("`{}` has a task already", found.name));
            return;
        }
        let Some(task) = task else { return };
        let name = format!("{}.{}", instance.name, found.name);
        let (copy_in, copy_out) = (Vec::new(), Vec::new());
        instance.blocks.push(BlockTask { name, var, block, task, copy_in, copy_out, span: fb.span });
    }

    /// Refuses that a body calls an instance that a task runs.
    pub(super) fn refuse_calls_of_block_tasks(&mut self, plan: &ResourcePlan) {
        for instance in &plan.instances {
            for block in &instance.blocks {
                if let Some(&call) = plan.usage.called_blocks.get(&(instance.program, block.var)) {
                    let message = "a task runs this instance, so its program can not call it; write its inputs and read its outputs";
                    self.push(Diagnostic::new(&rules::CONNECTION, call, message).label(block.span, "its task"));
                }
            }
        }
    }
}
