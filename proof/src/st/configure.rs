//! A CONFIGURATION: programs, their instances and the tasks that run them.

use super::generate::Generator;
use super::tree::{Arg, Base, Class, Config, Expr, ExprKind, Instance, Kind, Place, Task, Ty, UnitKind, Var};

impl Generator {
    /// Makes programs, instances, tasks and connections; perhaps a startup function.
    pub(super) fn configuration(&mut self) {
        let programs = self.r.between(1, self.size.pick(2, 3, 4)) as usize;
        let single = self.r.chance(40).then(|| self.flag());
        let startup = self.r.chance(25).then(|| self.startup());
        let first = self.source.units.len();
        for number in 0..programs {
            self.make_unit(UnitKind::Program, format!("Program{number}"));
        }
        let mut tasks = Vec::new();
        for number in 0..self.r.between(1, 3) {
            let waits = single.filter(|_| number > 0 && self.r.chance(60));
            let periods = [1_000, 2_000, 3_000, 5_000, 10_000, 20_000, 100_000];
            let interval_us = if waits.is_some() && self.r.chance(60) { None } else { Some(self.r.one_of(periods)) };
            let priority = self.r.one_of([0, 1, 1, 2, 7, 65535]);
            tasks.push(Task { name: format!("task{number}"), interval_us, single: waits, priority });
        }
        let mut instances: Vec<Instance> = Vec::new();
        for number in 0..self.r.between(programs as i64, programs as i64 + 2) as usize {
            let unit = first + number % programs;
            let task = if self.r.chance(85) { Some(self.r.below(tasks.len())) } else { None };
            if let Some(args) = self.connections(unit) {
                instances.push(Instance { name: format!("run{number}"), task, unit, args });
            }
        }
        self.source.config = Some(Config { tasks, instances, startup });
    }

    /// A global BOOL that a task waits for.
    fn flag(&mut self) -> usize {
        let number = self.source.globals.len();
        self.source.globals.push(Var {
            name: format!("g{number}"),
            ty: Ty::K(Kind::Bool),
            class: Class::Var,
            init: None,
            reserved: false,
            at: None,
            retain: false,
            edge: None,
            gone: false,
        });
        number
    }

    /// A function without parameters that runs before the first round.
    fn startup(&mut self) -> usize {
        let configured = std::mem::replace(&mut self.configured, false);
        self.make_unit(UnitKind::Function, "start".to_string());
        self.configured = configured;
        self.source.units.len() - 1
    }

    /// What a program's parameters are connected to; none when a VAR_IN_OUT finds no global.
    fn connections(&mut self, unit: usize) -> Option<Vec<Arg>> {
        let vars: Vec<(Class, Ty)> = self.source.units[unit].vars.iter().map(|var| (var.class, var.ty)).collect();
        let mut args = Vec::new();
        for (at, (class, ty)) in vars.into_iter().enumerate() {
            match class {
                Class::Input if self.r.chance(70) => args.extend(self.source_of(ty).map(|value| Arg::In(at, value))),
                Class::Output if self.r.chance(60) => {
                    args.extend(self.any_global(ty, true).map(|place| Arg::Out(at, place)));
                }
                Class::InOut => args.push(Arg::InOut(at, self.any_global(ty, true)?)),
                _ => {}
            }
        }
        Some(args)
    }

    /// A literal or a global.
    fn source_of(&mut self, ty: Ty) -> Option<Expr> {
        if self.r.chance(60)
            && let Some(place) = self.any_global(ty, false)
        {
            return Some(Expr { ty, kind: ExprKind::Get(place) });
        }
        match ty {
            Ty::K(kind) => {
                let value = self.number(kind);
                Some(Expr { ty, kind: ExprKind::Lit(value, true) })
            }
            _ => None,
        }
    }

    fn any_global(&mut self, ty: Ty, writes: bool) -> Option<Place> {
        let fits = |var: &Var| var.ty == ty && var.at.is_none() && (!writes || var.class == Class::Var);
        let found: Vec<usize> = (0..self.source.globals.len()).filter(|at| fits(&self.source.globals[*at])).collect();
        let at = *self.r.pick(&found)?;
        Some(Place { base: Base::Global(at), steps: Vec::new(), ty })
    }
}
