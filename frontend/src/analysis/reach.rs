//! Bodies: each resource's reachable units, with the globals that the resource sees; then the rest.

use std::collections::{BTreeMap, BTreeSet};

use super::Analyzer;
use super::config::Planned;
use super::expr::{Checker, Environment};
use super::tree::{Body, GlobalId, GlobalInfo, PouId, ResourcePlan, Usage, VarClass};
use super::types::Ty;
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::source::Span;

impl<'a> Analyzer<'a> {
    /// Checks all bodies and completes the plans of the resources.
    pub(super) fn check_bodies(&mut self, planned: Vec<Planned>) -> Vec<ResourcePlan> {
        let mut checked: BTreeSet<PouId> = BTreeSet::new();
        let mut calls: BTreeMap<PouId, BTreeMap<PouId, Span>> = BTreeMap::new();
        let mut plans = Vec::with_capacity(planned.len());
        for Planned { mut plan, environment } in planned {
            let mut waiting: Vec<PouId> = plan.instances.iter().map(|instance| instance.program).collect();
            let blocks = plan.instances.iter().flat_map(|instance| &instance.blocks);
            waiting.extend(blocks.map(|block| block.block));
            waiting.extend(plan.startup);
            let mut bodies: BTreeMap<PouId, Body> = BTreeMap::new();
            let mut seen: BTreeSet<PouId> = waiting.iter().copied().collect();
            while let Some(pou) = waiting.pop() {
                if bodies.contains_key(&pou) {
                    continue;
                }
                checked.insert(pou);
                let (body, usage) = self.check_body(pou, &environment);
                plan.usage.merge(usage);
                for (callee, span) in &body.callees {
                    calls.entry(pou).or_default().entry(*callee).or_insert(*span);
                    if seen.insert(*callee) {
                        waiting.push(*callee);
                    }
                }
                bodies.insert(pou, body);
            }
            plan.bodies = bodies.into_iter().collect();
            self.refuse_calls_of_block_tasks(&plan);
            plans.push(plan);
        }
        self.check_rest(&checked, &mut calls);
        self.refuse_recursion(&calls);
        self.share_globals(&mut plans);
        plans
    }

    /// Units that no resource reaches still have to be sound; they see every global.
    fn check_rest(&mut self, checked: &BTreeSet<PouId>, calls: &mut BTreeMap<PouId, BTreeMap<PouId, Span>>) {
        let mut everything = Environment::new();
        for (at, global) in (0u32..).zip(&self.globals).filter(|(_, global)| !global.qualified_only) {
            everything.entry(global.symbol).or_insert(GlobalId(at));
        }
        for at in 0..self.pou_decls.len() {
            let pou = PouId(u32::try_from(at).unwrap_or(u32::MAX));
            if checked.contains(&pou) || Some(self.pou_decls[at].span.file) == self.standard {
                continue;
            }
            let (body, _) = self.check_body(pou, &everything);
            for (callee, span) in &body.callees {
                calls.entry(pou).or_default().entry(*callee).or_insert(*span);
            }
            self.unreached.push((pou, body));
        }
    }

    fn check_body(&mut self, pou: PouId, environment: &Environment) -> (Body, Usage) {
        let Some(decl) = self.pou_decls.get(pou.0 as usize).copied() else {
            return (Body::default(), Usage::default());
        };
        self.check_externals(pou, environment);
        let mut checker = Checker::body(self, Some(pou), environment);
        let mut statements = checker.edge_statements(pou);
        statements.extend(checker.block(&decl.body));
        let callees = std::mem::take(&mut checker.callees).into_iter().collect();
        let usage = std::mem::take(&mut checker.usage);
        if let Some(test) = checker.test.take() {
            self.finish_test(pou, *test);
        }
        (Body { statements, callees }, usage)
    }

    fn check_externals(&mut self, pou: PouId, environment: &Environment) {
        let Some(info) = self.info(pou) else { return };
        for var in info.vars.iter().filter(|var| var.class == VarClass::External) {
            let Some(global) = environment.get(&var.symbol).and_then(|id| self.globals.get(id.0 as usize)).cloned()
            else {
                let message = format!("there is no global variable `{}`", var.name);
                self.report(&rules::EXTERNAL, var.span, message);
                continue;
            };
            if global.ty != var.ty && global.ty != Ty::Error && var.ty != Ty::Error {
                let (own, other) = (self.types.name(var.ty), self.types.name(global.ty));
                let message = format!("`{}` is {own} here, but the global is {other}", var.name);
                self.push(Diagnostic::new(&rules::EXTERNAL, var.span, message).label(global.span, "declared here"));
            } else if global.constant && !var.constant {
                let message = format!("the global `{}` is CONSTANT, so must be the VAR_EXTERNAL", var.name);
                self.push(Diagnostic::new(&rules::EXTERNAL, var.span, message).label(global.span, "declared here"));
            }
        }
    }

    /// Direct calls form no cycle.
    fn refuse_recursion(&mut self, calls: &BTreeMap<PouId, BTreeMap<PouId, Span>>) {
        let mut done: BTreeSet<PouId> = BTreeSet::new();
        for &start in calls.keys() {
            if done.contains(&start) {
                continue;
            }
            // Depth first, with the way so far on a list of its own: names come from users, so no recursion here.
            let mut way: Vec<(PouId, Vec<(PouId, Span)>)> = Vec::new();
            let mut on_way: BTreeSet<PouId> = BTreeSet::new();
            let next = |pou: PouId| -> Vec<(PouId, Span)> {
                calls
                    .get(&pou)
                    .map(|list| list.iter().rev().map(|(id, span)| (*id, *span)).collect())
                    .unwrap_or_default()
            };
            way.push((start, next(start)));
            on_way.insert(start);
            while let Some((pou, rest)) = way.last_mut() {
                let Some((callee, span)) = rest.pop() else {
                    done.insert(*pou);
                    on_way.remove(pou);
                    way.pop();
                    continue;
                };
                if on_way.contains(&callee) {
                    let name = self.info(callee).map(|info| info.name.clone()).unwrap_or_default();
                    let message = format!("this call leads back to `{name}`, which is still running then");
                    let first = self.info(callee).map(|info| info.span);
                    let mut found = Diagnostic::new(&rules::RECURSIVE_CALL, span, message);
                    if let Some(first) = first {
                        found = found.label(first, "declared here");
                    }
                    self.push(found.help("write a loop instead: calls never lead back"));
                } else if !done.contains(&callee) {
                    on_way.insert(callee);
                    way.push((callee, next(callee)));
                }
            }
        }
    }

    /// Gives each resource its globals; refuses that two resources use one.
    fn share_globals(&mut self, plans: &mut [ResourcePlan]) {
        // Tests run one after the other, each with globals of its own: those that it uses, and what may lie below others.
        let anew = self.tests.is_some();
        let alone = plans.len() <= 1 && !anew;
        let mut users: BTreeMap<GlobalId, usize> = BTreeMap::new();
        let mut clashes = Vec::new();
        for (at, plan) in plans.iter_mut().enumerate() {
            for (&global, &span) in &plan.usage.used_globals {
                let Some(info) = self.globals.get(global.0 as usize) else { continue };
                let folded = info.constant && info.located.is_none();
                if !anew
                    && info.resource.is_none()
                    && !folded
                    && users.insert(global, at).is_some_and(|other| other != at)
                {
                    clashes.push((span, info.name.clone(), info.span));
                }
            }
            let all = (0u32..).map(GlobalId).zip(&self.globals);
            let used = &plan.usage.used_globals;
            let belongs = |id: &GlobalId, global: &GlobalInfo| {
                alone || used.contains_key(id) || (anew && global.located.is_some())
            };
            plan.globals = all.filter(|(id, global)| belongs(id, global)).map(|(id, _)| id).collect();
        }
        for (span, name, declared) in clashes {
            let message = format!("two resources use the global `{name}`, and nothing shares it between them");
            self.push(Diagnostic::new(&rules::SHARED_GLOBAL, span, message).label(declared, "declared here"));
        }
    }
}
