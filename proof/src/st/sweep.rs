//! What nothing uses any more in a program, and parameters that go together with their arguments.

use std::collections::BTreeSet;

use super::case::{Case, Input};
use super::tree::{Arg, Base, Class, Def, Expr, ExprKind, Source, Step, Stmt, Ty, UnitKind};
use super::visit::{Change, Node, change, each};

/// A declaration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Declaration {
    /// A POU.
    Unit(usize),
    /// A variable of a POU.
    Var(usize, usize),
    /// A global variable.
    Global(usize),
    /// A type.
    Type(usize),
}

/// All declarations that nothing which runs names.
pub(crate) fn unused(source: &Source) -> Vec<Declaration> {
    let mut used = Used { source, found: BTreeSet::new(), open: Vec::new() };
    for (number, unit) in source.units.iter().enumerate() {
        if source.config.is_none() && unit.kind == UnitKind::Program && !unit.gone {
            used.declaration(Declaration::Unit(number));
        }
    }
    if let Some(config) = &source.config {
        config.startup.iter().for_each(|unit| used.declaration(Declaration::Unit(*unit)));
        let waits = config.tasks.iter().filter_map(|task| task.single);
        waits.for_each(|global| used.declaration(Declaration::Global(global)));
        for instance in &config.instances {
            used.declaration(Declaration::Unit(instance.unit));
            used.args(instance.unit, &instance.args);
            for arg in &instance.args {
                if let Arg::In(_, Expr { kind: ExprKind::Get(place), .. }) | Arg::InOut(_, place) | Arg::Out(_, place) =
                    arg
                    && let Base::Global(at) = place.base
                {
                    used.declaration(Declaration::Global(at));
                }
            }
        }
    }
    while let Some(unit) = used.open.pop() {
        used.body(unit);
    }
    let mut all = Vec::new();
    for (number, unit) in source.units.iter().enumerate().filter(|(_, unit)| !unit.gone) {
        all.push(Declaration::Unit(number));
        let vars = unit.vars.iter().enumerate().filter(|(_, var)| !var.gone && var.class != Class::Return);
        all.extend(vars.map(|(at, _)| Declaration::Var(number, at)));
    }
    all.extend((0..source.globals.len()).filter(|at| !source.globals[*at].gone).map(Declaration::Global));
    let named = |at: &usize| !source.types[*at].gone && !source.types[*at].name.is_empty();
    all.extend((0..source.types.len()).filter(named).map(Declaration::Type));
    all.retain(|declaration| !used.found.contains(declaration));
    all
}

/// Takes a declaration out.
pub(crate) fn take_out(source: &mut Source, declaration: Declaration) {
    match declaration {
        Declaration::Unit(unit) => source.units[unit].gone = true,
        Declaration::Var(unit, at) => source.units[unit].vars[at].gone = true,
        Declaration::Global(at) => source.globals[at].gone = true,
        Declaration::Type(at) => source.types[at].gone = true,
    }
}

struct Used<'s> {
    source: &'s Source,
    found: BTreeSet<Declaration>,
    /// Units whose statements were not looked at yet.
    open: Vec<usize>,
}

impl Used<'_> {
    fn declaration(&mut self, declaration: Declaration) {
        if !self.found.insert(declaration) {
            return;
        }
        match declaration {
            Declaration::Unit(unit) => {
                self.open.push(unit);
                let results = self.source.units[unit].vars.iter().filter(|var| var.class == Class::Return);
                results.for_each(|var| self.ty(var.ty));
            }
            Declaration::Var(unit, at) => self.ty(self.source.units[unit].vars[at].ty),
            Declaration::Global(at) => self.ty(self.source.globals[at].ty),
            Declaration::Type(id) => match &self.source.types[id].def {
                Def::Struct(fields) => fields.iter().for_each(|(_, ty, _)| self.ty(*ty)),
                Def::Array(_, element) => self.ty(*element),
                Def::Block(unit) => self.declaration(Declaration::Unit(*unit)),
                Def::Enum(..) | Def::Subrange(..) | Def::Standard(_) => {}
            },
        }
    }

    fn ty(&mut self, ty: Ty) {
        if let Ty::N(id) = ty {
            self.declaration(Declaration::Type(id));
        }
    }

    fn body(&mut self, unit: usize) {
        let source = self.source;
        each(&source.units[unit].body, &mut |node| match node {
            Node::Stmt(Stmt::For(counter, ..) | Stmt::While(counter, ..) | Stmt::Repeat(counter, ..)) => {
                self.declaration(Declaration::Var(unit, *counter));
            }
            Node::Stmt(Stmt::Call(place, args)) => {
                if let Ty::N(id) = place.ty
                    && let Def::Block(callee) = source.types[id].def
                {
                    self.args(callee, args);
                }
            }
            Node::Stmt(Stmt::Do(callee, args)) => {
                self.declaration(Declaration::Unit(*callee));
                self.args(*callee, args);
            }
            Node::Stmt(_) => {}
            Node::Expr(Expr { kind: ExprKind::Call(callee, args), .. }) => {
                self.declaration(Declaration::Unit(*callee));
                self.args(*callee, args);
            }
            Node::Expr(expr) => self.ty(expr.ty),
            Node::Place(place) => {
                match place.base {
                    Base::Var(at) => self.declaration(Declaration::Var(unit, at)),
                    Base::Global(at) => self.declaration(Declaration::Global(at)),
                    Base::Direct(_) => {}
                }
                let mut ty = source.base(&source.units[unit], place);
                for step in &place.steps {
                    if let (Step::Field(at), Ty::N(id)) = (step, ty)
                        && let Def::Block(block) = source.types[id].def
                    {
                        self.declaration(Declaration::Var(block, *at));
                    }
                    ty = source.behind(ty, step);
                }
            }
        });
    }

    fn args(&mut self, callee: usize, args: &[Arg]) {
        for arg in args {
            parameter(arg).into_iter().for_each(|at| self.declaration(Declaration::Var(callee, at)));
        }
    }
}

/// Makes a parameter a variable of its own and takes its arguments out of all calls.
pub(crate) fn drop_parameter(source: &mut Source, unit: usize, at: usize) {
    source.units[unit].vars[at].class = Class::Var;
    source.units[unit].vars[at].edge = None;
    let blocks: Vec<Ty> = (0..source.types.len())
        .filter(|id| matches!(source.types[*id].def, Def::Block(of) if of == unit))
        .map(Ty::N)
        .collect();
    for instance in source.config.iter_mut().flat_map(|config| &mut config.instances) {
        if instance.unit == unit {
            instance.args.retain(|arg| parameter(arg) != Some(at));
        }
    }
    for caller in &mut source.units {
        change(&mut caller.body, &mut |node| match node {
            Change::Function(callee, args) if callee == unit => args.retain(|arg| parameter(arg) != Some(at)),
            Change::Block(ty, args) if blocks.contains(&ty) => args.retain(|arg| parameter(arg) != Some(at)),
            Change::Function(..) | Change::Block(..) | Change::Place(_) | Change::Expr(_) | Change::Store(..) => {}
        });
    }
}

/// The parameter of an argument; EN and ENO are none that a unit declares.
fn parameter(arg: &Arg) -> Option<usize> {
    match arg {
        Arg::In(at, _) | Arg::InOut(at, _) | Arg::Out(at, _) => Some(*at),
        Arg::En(_) | Arg::Eno(_) => None,
    }
}

/// Whether a place steps into a field of a structure.
pub(crate) fn uses_field(source: &Source, id: usize, at: usize) -> bool {
    let mut found = false;
    for unit in &source.units {
        each(&unit.body, &mut |node| {
            let Node::Place(place) = node else { return };
            let mut ty = source.base(unit, place);
            for step in &place.steps {
                found |= ty == Ty::N(id) && *step == Step::Field(at);
                ty = source.behind(ty, step);
            }
        });
    }
    found
}

/// Takes out of all rounds the values for globals that have a type in them.
pub(crate) fn drop_inputs_of(case: &mut Case, id: usize) {
    let source = &case.source;
    let is_one = |input: &Input| input.at.first().is_some_and(|at| contains(source, source.globals[*at].ty, id));
    case.rounds.iter_mut().for_each(|round| round.inputs.retain(|input| !is_one(input)));
}

/// Takes a field, which no place steps into, out of a structure.
pub(crate) fn drop_field(source: &mut Source, id: usize, at: usize) {
    drop_values_of(source, id);
    // The types of bases and steps are those of the whole program, so places are changed on a copy.
    let before = source.clone();
    if let Def::Struct(fields) = &mut source.types[id].def {
        fields.remove(at);
    }
    for (unit, own) in source.units.iter_mut().enumerate() {
        change(&mut own.body, &mut |node| {
            let Change::Place(place) = node else { return };
            let mut ty = before.base(&before.units[unit], place);
            for step in &mut place.steps {
                let next = before.behind(ty, step);
                if let Step::Field(field) = step
                    && ty == Ty::N(id)
                    && *field > at
                {
                    *field -= 1;
                }
                ty = next;
            }
        });
    }
}

/// Takes out the initial values of everything that has a type in it.
pub(crate) fn drop_values_of(source: &mut Source, id: usize) {
    let holds: Vec<bool> = (0..source.types.len()).map(|other| contains(source, Ty::N(other), id)).collect();
    let is_one = |ty: Ty| matches!(ty, Ty::N(other) if holds[other]);
    for var in source.units.iter_mut().flat_map(|unit| &mut unit.vars).chain(&mut source.globals) {
        if is_one(var.ty) {
            var.init = None;
        }
    }
    for ty in &mut source.types {
        if let Def::Struct(fields) = &mut ty.def {
            fields.iter_mut().filter(|(_, ty, _)| is_one(*ty)).for_each(|(_, _, init)| *init = None);
        }
    }
}

fn contains(source: &Source, ty: Ty, id: usize) -> bool {
    let Ty::N(own) = ty else { return false };
    own == id
        || match &source.types[own].def {
            Def::Struct(fields) => fields.iter().any(|(_, ty, _)| contains(source, *ty, id)),
            Def::Array(_, element) => contains(source, *element, id),
            Def::Enum(..) | Def::Subrange(..) | Def::Block(_) | Def::Standard(_) => false,
        }
}
