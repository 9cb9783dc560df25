//! Configurations: resources, program instances and their connections (IEC 61131-3 6.8).

use std::collections::BTreeMap;
use std::rc::Rc;

use super::Analyzer;
use super::expr::{Checker, Environment};
use super::tree::{
    Expr, ExprKind, GlobalId, InstancePlan, Place, PouId, ResourcePlan, Root, SinglePlan, Stmt, TaskPlan, Usage,
    VarClass, VarId,
};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::source::Span;
use crate::syntax::ast::{
    Configuration, Connection, Declaration, ExprKind as AstKind, Ident, PouKind, ProgramInstance, Resource,
};
use crate::syntax::symbol::Symbol;

/// Priority of the task of programs without one: the lowest.
const FREEWHEELING_PRIORITY: u16 = 65_535;

/// A resource whose bodies are still to be checked.
pub(super) struct Planned {
    pub(super) plan: ResourcePlan,
    pub(super) environment: Rc<Environment>,
}

impl<'a> Analyzer<'a> {
    /// All resources with tasks, instances and connections.
    pub(super) fn configure(&mut self) -> Vec<Planned> {
        let ast = self.ast;
        let startup = self.startup_function();
        let mut planned = Vec::new();
        let (mut configuration, mut resource) = (0u32, 0u32);
        let mut any = false;
        for declaration in ast.declarations() {
            let Declaration::Configuration(found) = declaration else { continue };
            any = true;
            let mut names: BTreeMap<Symbol, Span> = BTreeMap::new();
            for declared in &found.resources {
                if let Some(name) = &declared.name
                    && let Some(first) = names.insert(name.symbol, name.span)
                {
                    let message = format!("there are two resources `{}`", self.spelling(name));
                    self.push(Diagnostic::new(&rules::DUPLICATE_NAME, name.span, message).label(first, "first here"));
                }
                planned.push(self.resource(found, declared, configuration, resource, startup));
                resource += 1;
            }
            let here = planned.len() - found.resources.len();
            self.config_entries(found, &mut planned[here..]);
            configuration += 1;
        }
        if !any {
            planned.extend(self.default_resource(startup));
            self.refuse_placeless(&planned, &[]);
        }
        planned
    }

    /// The function with `{attribute 'startup'}`.
    fn startup_function(&mut self) -> Option<PouId> {
        let mut found: Option<PouId> = None;
        for at in 0..self.pou_decls.len() {
            let pou = self.pou_decls[at];
            let Some(attribute) = pou.attributes.iter().find(|entry| entry.name.eq_ignore_ascii_case("startup")) else {
                continue;
            };
            let id = PouId(u32::try_from(at).unwrap_or(u32::MAX));
            let info = self.info(id);
            let plain = info.is_some_and(|info| {
                info.kind == PouKind::Function
                    && !info
                        .vars
                        .iter()
                        .any(|var| matches!(var.class, VarClass::Input | VarClass::InOut | VarClass::Output))
            });
            if !plain {
                self.report(&rules::STARTUP, attribute.span, "only a FUNCTION without parameters can run at the start");
            } else if found.is_some() {
                self.report(&rules::STARTUP, attribute.span, "there is another startup function already");
            } else {
                found = Some(id);
            }
        }
        found
    }

    fn default_resource(&mut self, startup: Option<PouId>) -> Option<Planned> {
        let mut instances = Vec::new();
        for at in 0..self.pou_decls.len() {
            let pou = self.pou_decls[at];
            if pou.kind != PouKind::Program || pou.name.is_missing() {
                continue;
            }
            let id = PouId(u32::try_from(at).unwrap_or(u32::MAX));
            let name = self.spelling(&pou.name).to_owned();
            self.refuse_unconnected(id, &[], pou.name.span);
            instances.push(InstancePlan {
                name,
                program: id,
                task: 0,
                copy_in: Vec::new(),
                inouts: Vec::new(),
                copy_out: Vec::new(),
                blocks: Vec::new(),
                values: Vec::new(),
                image_values: Vec::new(),
                span: pou.name.span,
            });
        }
        if instances.is_empty() {
            return None;
        }
        let task = TaskPlan {
            name: self.default_task.name.clone(),
            priority: self.default_task.priority,
            interval_us: Some(self.default_task.interval_us),
            single: SinglePlan::None,
            watchdog_us: 0,
            watchdog_sensitivity: 0,
            phase_us: 0,
            overrun_policy: khz_bytecode::container::OverrunPolicy::Grid,
        };
        let plan = ResourcePlan {
            name: "default_resource".to_owned(),
            configuration: "default_config".to_owned(),
            globals: Vec::new(),
            tasks: vec![task],
            instances,
            startup,
            bodies: Vec::new(),
            usage: Usage::default(),
        };
        Some(Planned { plan, environment: Rc::new(self.environment(None, None)) })
    }

    /// The globals that a resource sees: an inner name hides an outer one.
    pub(super) fn environment(&self, configuration: Option<u32>, resource: Option<u32>) -> Environment {
        let mut seen: BTreeMap<Symbol, (u8, GlobalId)> = BTreeMap::new();
        for (at, global) in (0u32..).zip(&self.globals).filter(|(_, global)| !global.qualified_only) {
            let rank = match (global.configuration, global.resource) {
                (None, _) => 0,
                (found, None) if found == configuration => 1,
                (found, inner) if found == configuration && inner == resource => 2,
                _ => continue,
            };
            let entry = seen.entry(global.symbol).or_insert((rank, GlobalId(at)));
            if rank > entry.0 {
                *entry = (rank, GlobalId(at));
            }
        }
        seen.into_iter().map(|(symbol, (_, id))| (symbol, id)).collect()
    }

    fn resource(
        &mut self,
        configuration: &'a Configuration,
        declared: &'a Resource,
        configuration_number: u32,
        number: u32,
        startup: Option<PouId>,
    ) -> Planned {
        let environment = self.environment(Some(configuration_number), Some(number));
        let mut plan = ResourcePlan {
            name: declared.name.as_ref().map_or("resource", |name| self.spelling(name)).to_owned(),
            configuration: self.spelling(&configuration.name).to_owned(),
            globals: Vec::new(),
            tasks: Vec::new(),
            instances: Vec::new(),
            startup,
            bodies: Vec::new(),
            usage: Usage::default(),
        };
        let mut task_names: BTreeMap<Symbol, (u32, Span)> = BTreeMap::new();
        for task in &declared.tasks {
            let at = u32::try_from(plan.tasks.len()).unwrap_or(u32::MAX);
            if let Some((_, first)) = task_names.get(&task.name.symbol).copied() {
                let message = format!("there are two tasks `{}` in this resource", self.spelling(&task.name));
                self.push(Diagnostic::new(&rules::DUPLICATE_TASK, task.name.span, message).label(first, "first here"));
            } else {
                task_names.insert(task.name.symbol, (at, task.name.span));
            }
            let found = self.task(task);
            plan.tasks.push(found);
        }
        let mut names: BTreeMap<Symbol, Span> = BTreeMap::new();
        let mut symbols: Vec<Symbol> = Vec::new();
        for program in &declared.programs {
            if let Some(first) = names.insert(program.name.symbol, program.name.span) {
                let message =
                    format!("there are two program instances `{}` in this resource", self.spelling(&program.name));
                self.push(
                    Diagnostic::new(&rules::DUPLICATE_NAME, program.name.span, message).label(first, "first here"),
                );
                continue;
            }
            if let Some(instance) = self.instance(program, &task_names, &environment, &mut plan) {
                plan.instances.push(instance);
                symbols.push(program.name.symbol);
            }
        }
        for (at, task) in declared.tasks.iter().enumerate() {
            self.single(task, at, &mut plan, &symbols, &environment);
        }
        if declared.programs.is_empty() {
            let span = declared.name.as_ref().map_or(declared.span, |name| name.span);
            self.report(&rules::NOTHING_RUNS, span, "this resource has no program instance, so nothing runs");
        }
        Planned { plan, environment: Rc::new(environment) }
    }

    fn instance(
        &mut self,
        program: &'a ProgramInstance,
        tasks: &BTreeMap<Symbol, (u32, Span)>,
        environment: &Environment,
        plan: &mut ResourcePlan,
    ) -> Option<InstancePlan> {
        let task = match &program.task {
            None => Some(freewheeling(plan)),
            Some(name) => self.known_task(name, tasks),
        };
        let pou = self.program_type(&program.ty)?;
        let mut instance = InstancePlan {
            name: self.spelling(&program.name).to_owned(),
            program: pou,
            task: task?,
            copy_in: Vec::new(),
            inouts: Vec::new(),
            copy_out: Vec::new(),
            blocks: Vec::new(),
            values: Vec::new(),
            image_values: Vec::new(),
            span: program.name.span,
        };
        let mut connected: Vec<VarId> = Vec::new();
        for connection in &program.connections {
            if let Connection::FbTask { fb, task } = connection {
                self.block_task(fb, task, tasks, &mut instance);
            }
            self.connection(connection, pou, environment, plan, &mut instance, &mut connected);
        }
        self.refuse_unconnected(pou, &connected, program.name.span);
        instance.inouts.sort_by_key(|(id, _)| *id);
        Some(instance)
    }

    pub(super) fn known_task(&mut self, name: &Ident, tasks: &BTreeMap<Symbol, (u32, Span)>) -> Option<u32> {
        let found = tasks.get(&name.symbol).map(|(at, _)| *at);
        if found.is_none() {
            let message = format!("this resource has no task `{}`", self.spelling(name));
            self.report_unknown(&rules::UNKNOWN_TASK, name, message, tasks.keys().copied());
        }
        found
    }

    fn program_type(&mut self, name: &Ident) -> Option<PouId> {
        let found = self.pou_names.get(&name.symbol).copied();
        let is_program = |id: &PouId| self.pou_decls.get(id.0 as usize).is_some_and(|pou| pou.kind == PouKind::Program);
        if let Some(id) = found.filter(is_program) {
            return Some(id);
        }
        let known: Vec<Symbol> =
            self.pou_decls.iter().filter(|pou| pou.kind == PouKind::Program).map(|pou| pou.name.symbol).collect();
        let message = format!("there is no program `{}`", self.spelling(name));
        self.report_unknown(&rules::UNKNOWN_PROGRAM, name, message, known.into_iter());
        None
    }

    fn refuse_unconnected(&mut self, pou: PouId, connected: &[VarId], span: Span) {
        let Some(info) = self.info(pou) else { return };
        for (id, var) in (0u32..).map(VarId).zip(&info.vars) {
            if var.class == VarClass::InOut && !connected.contains(&id) {
                let message = format!("the VAR_IN_OUT `{}` of {} must be connected to a global", var.name, info.name);
                self.report(&rules::IN_OUT, span, message);
            }
        }
    }

    fn connection(
        &mut self,
        connection: &'a Connection,
        pou: PouId,
        environment: &Environment,
        plan: &mut ResourcePlan,
        instance: &mut InstancePlan,
        connected: &mut Vec<VarId>,
    ) {
        let (variable, other, is_source) = match connection {
            Connection::Source { variable, source } => (variable, source, true),
            Connection::Sink { variable, sink } => (variable, sink, false),
            Connection::FbTask { .. } => return,
        };
        let Some(info) = self.info(pou) else { return };
        let AstKind::Name(name) = &variable.kind else {
            self.report(&rules::CONNECTION, variable.span, "a connection starts at an input or output of the program");
            return;
        };
        let Some((id, var)) = (0u32..).map(VarId).zip(&info.vars).find(|(_, var)| var.symbol == name.symbol) else {
            let message = format!("{} has no variable `{}`", info.name, self.spelling(name));
            let known: Vec<Symbol> = info.vars.iter().map(|var| var.symbol).collect();
            self.report_unknown(&rules::UNKNOWN_PARAMETER, name, message, known.into_iter());
            return;
        };
        if connected.contains(&id) && is_source {
            self.report(&rules::PARAMETER_TWICE, name.span, format!("`{}` is connected twice", var.name));
            return;
        }
        let fits = match var.class {
            VarClass::Input | VarClass::InOut => is_source,
            VarClass::Output => !is_source,
            _ => false,
        };
        if !fits {
            let message = format!("`{}` can not be connected this way: `:=` is for inputs, `=>` for outputs", var.name);
            self.report(&rules::CONNECTION, variable.span, message);
            return;
        }
        connected.push(id);
        let own = Place { root: Root::Var(id), path: Vec::new(), ty: var.ty, span: name.span };
        let mut checker = Checker::body(self, None, environment);
        if var.class == VarClass::InOut {
            let place = checker.inout(pou, id, var, Some(other), other.span);
            instance.inouts.extend(place.map(|place| (id, place)));
        } else if is_source {
            let value = checker.expr(other, own.ty);
            let statement: Option<Stmt> = checker.assignment(own, value, other.span);
            instance.copy_in.extend(statement);
        } else if let Some(target) = checker.target(other) {
            let (ty, span) = (own.ty, other.span);
            let value = Expr { kind: ExprKind::Load(Box::new(own)), ty, span };
            let statement = checker.assignment(target, value, span);
            instance.copy_out.extend(statement);
        }
        let usage = std::mem::take(&mut checker.usage);
        let callees = std::mem::take(&mut checker.callees);
        if let Some(span) = callees.values().next() {
            self.report(&rules::CONNECTION, *span, "a connection can not call functions");
        }
        plan.usage.merge(usage);
    }
}

/// The task of programs without one: made when the first is met, always the last.
fn freewheeling(plan: &mut ResourcePlan) -> u32 {
    let is_it = |task: &TaskPlan| {
        task.name == "freewheeling" && task.priority == FREEWHEELING_PRIORITY && task.interval_us.is_none()
    };
    if !plan.tasks.last().is_some_and(is_it) {
        plan.tasks.push(TaskPlan {
            name: "freewheeling".to_owned(),
            priority: FREEWHEELING_PRIORITY,
            interval_us: None,
            single: SinglePlan::None,
            watchdog_us: 0,
            watchdog_sensitivity: 0,
            phase_us: 0,
            overrun_policy: khz_bytecode::container::OverrunPolicy::Grid,
        });
    }
    u32::try_from(plan.tasks.len() - 1).unwrap_or(u32::MAX)
}

impl Usage {
    /// Adds what another part of the resource uses.
    pub(super) fn merge(&mut self, other: Usage) {
        let either = |a: Option<bool>, b: Option<bool>| match (a, b) {
            (None, found) | (found, None) => found,
            (Some(a), Some(b)) => Some(a || b),
        };
        self.up_time = either(self.up_time, other.up_time);
        self.up_ltime = either(self.up_ltime, other.up_ltime);
        self.addressed_vars.extend(other.addressed_vars);
        self.addressed_globals.extend(other.addressed_globals);
        for (global, span) in other.used_globals {
            self.used_globals.entry(global).or_insert(span);
        }
        for (own, found) in self.image_bytes.iter_mut().zip(other.image_bytes) {
            *own = (*own).max(found);
        }
        self.image_parameters.extend(other.image_parameters);
        self.parameter_edges.extend(other.parameter_edges);
        for (instance, span) in other.called_blocks {
            self.called_blocks.entry(instance).or_insert(span);
        }
        for (variable, weight) in other.heat {
            *self.heat.entry(variable).or_default() += weight;
        }
    }
}
