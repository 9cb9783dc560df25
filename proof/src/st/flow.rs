//! Which variables a variable is computed from, roughly: whole variables, every path taken.

use std::collections::{BTreeMap, BTreeSet};

use super::tree::{Arg, Base, Def, Expr, ExprKind, Place, Source, Stmt, Ty, Unit};
use super::visit::{Node, bodies, each_in_expr, each_in_place};

/// Paths of the variables, in a dump's names, that a variable and its parts are computed from, itself among them; of all variables
/// when none is given.
pub(crate) fn roots(source: &Source, variable: Option<&str>) -> BTreeSet<String> {
    let mut flow = Flow { source, from: BTreeMap::new() };
    for unit in source.units.iter().filter(|unit| !unit.gone) {
        flow.list(unit, &unit.body, &BTreeSet::new());
    }
    let all = || {
        let globals = source.globals.iter().map(|var| var.name.clone());
        let own =
            source.units.iter().flat_map(|unit| unit.vars.iter().map(|var| format!("{}.{}", unit.name, var.name)));
        globals.chain(own)
    };
    let is_part = |path: &str, root: &str| {
        path.strip_prefix(root).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    let mut open: Vec<String> = match variable {
        Some(path) => all().filter(|root| is_part(path, root)).collect(),
        None => all().collect(),
    };
    let mut found = BTreeSet::new();
    while let Some(next) = open.pop() {
        if found.insert(next.clone()) {
            open.extend(flow.from.get(&next).into_iter().flatten().cloned());
        }
    }
    found
}

struct Flow<'s> {
    source: &'s Source,
    /// What each variable is computed from.
    from: BTreeMap<String, BTreeSet<String>>,
}

impl Flow<'_> {
    fn name(&self, unit: &Unit, place: &Place) -> String {
        match place.base {
            Base::Var(at) => format!("{}.{}", unit.name, unit.vars[at].name),
            Base::Global(at) => self.source.globals[at].name.clone(),
            Base::Direct(at) => format!("{at:?}"),
        }
    }

    fn flows(&mut self, to: &str, from: impl IntoIterator<Item = String>) {
        self.from.entry(to.to_string()).or_default().extend(from);
    }

    /// What an expression or the indices of a place read; calls in it let their arguments flow.
    fn reads<'t>(&mut self, unit: &Unit, walk: impl FnOnce(&mut dyn FnMut(Node<'t>))) -> BTreeSet<String> {
        let mut read = BTreeSet::new();
        let mut calls = Vec::new();
        walk(&mut |node| match node {
            Node::Place(place) => drop(read.insert(self.name(unit, place))),
            Node::Expr(Expr { kind: ExprKind::Call(callee, args), .. }) => calls.push((*callee, args)),
            Node::Expr(_) | Node::Stmt(_) => {}
        });
        for (callee, args) in calls {
            let callee = &self.source.units[callee];
            self.args(unit, callee, args);
            read.extend(callee.vars.first().map(|var| format!("{}.{}", callee.name, var.name)));
        }
        read
    }

    fn args(&mut self, unit: &Unit, callee: &Unit, args: &[Arg]) {
        let parameter = |at: usize| format!("{}.{}", callee.name, callee.vars[at].name);
        for arg in args {
            match arg {
                Arg::In(at, value) => {
                    let read = self.reads(unit, |see| each_in_expr(value, see));
                    self.flows(&parameter(*at), read);
                }
                Arg::InOut(at, place) | Arg::Out(at, place) => {
                    let name = self.name(unit, place);
                    self.flows(&name, [parameter(*at)]);
                    if matches!(arg, Arg::InOut(..)) {
                        self.flows(&parameter(*at), [name]);
                    }
                }
                Arg::En(value) => {
                    let read = self.reads(unit, |see| each_in_expr(value, see));
                    let vars = callee.vars.iter().map(|var| format!("{}.{}", callee.name, var.name));
                    vars.for_each(|name| self.flows(&name, read.iter().cloned()));
                }
                Arg::Eno(place) => {
                    let name = self.name(unit, place);
                    self.flows(&name, callee.vars.iter().map(|var| format!("{}.{}", callee.name, var.name)));
                }
            }
        }
    }

    fn list(&mut self, unit: &Unit, list: &[Stmt], conditions: &BTreeSet<String>) {
        for stmt in list {
            let mut inner = conditions.clone();
            match stmt {
                Stmt::Assign(place, value) => {
                    let mut read = self.reads(unit, |see| each_in_expr(value, see));
                    read.extend(self.reads(unit, |see| each_in_place(place, see)));
                    read.extend(conditions.iter().cloned());
                    let name = self.name(unit, place);
                    self.flows(&name, read);
                }
                Stmt::If(branches, _) => {
                    for (condition, _) in branches {
                        inner.extend(self.reads(unit, |see| each_in_expr(condition, see)));
                    }
                }
                Stmt::Case(selector, ..) => inner.extend(self.reads(unit, |see| each_in_expr(selector, see))),
                Stmt::For(counter, from, to, by, _) => {
                    for bound in [from, to].into_iter().chain(by) {
                        inner.extend(self.reads(unit, |see| each_in_expr(bound, see)));
                    }
                    let name = format!("{}.{}", unit.name, unit.vars[*counter].name);
                    self.flows(&name, inner.iter().cloned());
                }
                Stmt::While(counter, _, condition, _) | Stmt::Repeat(counter, _, condition, _) => {
                    inner.extend(self.reads(unit, |see| each_in_expr(condition, see)));
                    let name = format!("{}.{}", unit.name, unit.vars[*counter].name);
                    self.flows(&name, inner.iter().cloned());
                }
                Stmt::Call(place, args) => self.block(unit, place, args, conditions),
                Stmt::Do(callee, args) => self.args(unit, &self.source.units[*callee], args),
                Stmt::Split(_, args) => self.split(unit, args, conditions),
                Stmt::Exit | Stmt::Continue | Stmt::Return => {}
            }
            bodies(stmt).into_iter().for_each(|body| self.list(unit, body, &inner));
        }
    }

    /// What a standard function stores is computed from what it is given.
    fn split(&mut self, unit: &Unit, args: &[Arg], conditions: &BTreeSet<String>) {
        let mut read = conditions.clone();
        for arg in args {
            if let Arg::In(_, value) | Arg::En(value) = arg {
                read.extend(self.reads(unit, |see| each_in_expr(value, see)));
            }
        }
        for arg in args {
            if let Arg::Out(_, place) | Arg::Eno(place) = arg {
                let name = self.name(unit, place);
                self.flows(&name, read.iter().cloned());
            }
        }
    }

    /// An instance is computed from its arguments, and of a block of the program from what its body does.
    fn block(&mut self, unit: &Unit, place: &Place, args: &[Arg], conditions: &BTreeSet<String>) {
        let source = self.source;
        let instance = self.name(unit, place);
        self.flows(&instance, conditions.iter().cloned());
        let callee = match place.ty {
            Ty::N(id) => match source.types[id].def {
                Def::Block(callee) => Some(&source.units[callee]),
                _ => None,
            },
            _ => None,
        };
        if let Some(callee) = callee {
            self.args(unit, callee, args);
            self.flows(&instance, callee.vars.iter().map(|var| format!("{}.{}", callee.name, var.name)));
            return;
        }
        for arg in args {
            match arg {
                Arg::In(_, value) | Arg::En(value) => {
                    let read = self.reads(unit, |see| each_in_expr(value, see));
                    self.flows(&instance, read);
                }
                Arg::InOut(_, target) | Arg::Out(_, target) | Arg::Eno(target) => {
                    let name = self.name(unit, target);
                    self.flows(&name, [instance.clone()]);
                }
            }
        }
    }
}
