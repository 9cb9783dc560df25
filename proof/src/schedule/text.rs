//! A plan as Structured Text.

use std::fmt::Write;

use super::memory::{INIT_ORDER, INIT_STARTS};
use super::plan::{
    Action, Condition, Counter, Deed, Form, Instance, Place, Plan, Policy, Single, Task, Trigger, Value,
};

/// The whole source. A String takes everything that is written to it.
#[must_use]
pub fn print(plan: &Plan) -> String {
    let mut out = String::new();
    if scope(plan) == Scope::Project {
        print_globals(&mut out, plan, "VAR_GLOBAL");
    }
    for (name, actions) in [("initialise", &plan.init), ("prepare", &plan.startup)] {
        if let Some(actions) = actions {
            print_function(&mut out, plan, name, actions);
        }
    }
    for (at, actions) in plan.programs.iter().enumerate() {
        if plan.instances.iter().any(|instance| instance.program == at) {
            print_program(&mut out, plan, at, actions);
        }
    }
    if plan.form != Form::BareText {
        print_configuration(&mut out, plan);
    }
    out
}

/// Where the globals are declared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scope {
    Project,
    Configuration,
    Resource,
}

fn scope(plan: &Plan) -> Scope {
    match plan.seed % 3 {
        _ if plan.form == Form::BareText => Scope::Project,
        0 => Scope::Project,
        1 => Scope::Configuration,
        _ => Scope::Resource,
    }
}

/// The globals in blocks that begin with `word`, which is VAR_GLOBAL or VAR_EXTERNAL.
fn print_globals(out: &mut String, plan: &Plan, word: &str) {
    let declares = word == "VAR_GLOBAL";
    let retain = if declares { " RETAIN" } else { "" };
    let _ = write!(out, "{word}{retain} starts : LINT; END_VAR\n{word} order, burnt : LINT;");
    for global in 0..plan.globals.len() {
        let at =
            plan.located(global).filter(|_| declares).map_or(String::new(), |bit| format!(" AT {}", bit.address()));
        let _ = write!(out, " b{global}{at} : BOOL;");
    }
    out.push_str(" END_VAR\n");
}

/// A POU may say which globals it uses; it need not.
fn print_externals(out: &mut String, plan: &Plan) {
    if plan.seed % 2 == 1 {
        print_globals(out, plan, "VAR_EXTERNAL");
    }
}

/// Init function (which Structured Text has no way to say, so it is for people only) or startup function.
fn print_function(out: &mut String, plan: &Plan, name: &str, actions: &[Action]) {
    let is_init = name == "initialise";
    if !is_init {
        out.push_str("{attribute 'startup'}\n");
    }
    let _ = writeln!(out, "FUNCTION {name} : BOOL");
    print_externals(out, plan);
    out.push_str("VAR pass : DINT; END_VAR\n");
    if is_init {
        let _ = writeln!(out, "  starts := {INIT_STARTS};\n  order := {INIT_ORDER};");
    } else {
        out.push_str("  starts := starts + 1;\n  order := order + 1;\n");
    }
    actions.iter().for_each(|action| print_action(out, *action, "burnt"));
    out.push_str("END_FUNCTION\n\n");
}

fn print_program(out: &mut String, plan: &Plan, at: usize, actions: &[Action]) {
    let _ = writeln!(out, "PROGRAM P{at}");
    print_externals(out, plan);
    out.push_str("VAR_INPUT source : BOOL; END_VAR\nVAR_OUTPUT sink : BOOL; END_VAR\n");
    out.push_str("VAR runs, seen, done, spent : LINT; time : LTIME; time_ms : TIME; flag : BOOL; END_VAR\n");
    out.push_str("VAR RETAIN kept : LINT; END_VAR\nVAR pass : DINT; END_VAR\n");
    out.push_str("  order := order + 1;\n  runs := runs + 1;\n  kept := kept + 1;\n  seen := order;\n");
    out.push_str("  time := __SYSTEM_UP_LTIME;\n  time_ms := __SYSTEM_UP_TIME;\n");
    actions.iter().for_each(|action| print_action(out, *action, "spent"));
    out.push_str("  done := runs;\nEND_PROGRAM\n\n");
}

fn print_action(out: &mut String, action: Action, spent: &str) {
    out.push_str("  ");
    if let Some(condition) = action.when {
        let _ = write!(out, "IF {} THEN ", print_condition(condition));
    }
    let _ = match action.deed {
        Deed::Set(place, Value::Literal(value)) => write!(out, "{} := {};", print_place(place), print_bool(value)),
        Deed::Set(place, Value::Holds(condition)) => {
            write!(out, "{} := {};", print_place(place), print_condition(condition))
        }
        Deed::Burn(passes) => {
            write!(out, "FOR pass := 1 TO {passes} DO {spent} := {spent} + 1; END_FOR;")
        }
        // A constant zero would be refused.
        Deed::Trap => write!(out, "pass := 0; pass := 1 / pass;"),
    };
    out.push_str(if action.when.is_some() { " END_IF;\n" } else { "\n" });
}

fn print_bool(value: bool) -> &'static str {
    if value { "TRUE" } else { "FALSE" }
}

fn print_condition(condition: Condition) -> String {
    match condition {
        Condition::Every(counter, modulus, remainder) => {
            format!("{} MOD {modulus} = {remainder}", print_counter(counter))
        }
        Condition::Once(counter, value) => format!("{} = {value}", print_counter(counter)),
        Condition::Is(place, true) => print_place(place),
        Condition::Is(place, false) => format!("NOT {}", print_place(place)),
    }
}

fn print_counter(counter: Counter) -> &'static str {
    match counter {
        Counter::Runs => "runs",
        Counter::Kept => "kept",
        Counter::Order => "order",
        Counter::Starts => "starts",
    }
}

fn print_place(place: Place) -> String {
    match place {
        Place::Global(global) => format!("b{global}"),
        Place::Flag => "flag".to_string(),
        Place::Source => "source".to_string(),
        Place::Sink => "sink".to_string(),
        Place::Bit(bit) => bit.address(),
    }
}

fn print_configuration(out: &mut String, plan: &Plan) {
    out.push_str("CONFIGURATION plant\n");
    if scope(plan) == Scope::Configuration {
        print_globals(out, plan, "VAR_GLOBAL");
    }
    out.push_str("  RESOURCE cpu ON PLC\n");
    if scope(plan) == Scope::Resource {
        print_globals(out, plan, "VAR_GLOBAL");
    }
    let without = plan.instances.iter().any(|instance| instance.task.is_none());
    let written = plan.tasks.len() - usize::from(without);
    for (at, task) in plan.tasks.iter().take(written).enumerate() {
        print_task(out, plan, at, task);
    }
    for (at, Instance { program, task, source, sink }) in plan.instances.iter().enumerate() {
        let with = task.map_or(String::new(), |task| format!(" WITH t{task}"));
        let _ = write!(out, "    PROGRAM {}{with} : P{program}", plan.instance_name(at));
        let source = source.map(|place| format!("source := {}", print_place(place)));
        let sink = sink.map(|place| format!("sink => {}", print_place(place)));
        let connections: Vec<String> = source.into_iter().chain(sink).collect();
        if !connections.is_empty() {
            let _ = write!(out, "({})", connections.join(", "));
        }
        out.push_str(";\n");
    }
    out.push_str("  END_RESOURCE\nEND_CONFIGURATION\n");
}

fn print_task(out: &mut String, plan: &Plan, at: usize, task: &Task) {
    let mut attribute = |name: &str, value: &str| {
        let _ = writeln!(out, "    {{attribute '{name}' := '{value}'}}");
    };
    if task.watchdog_us > 0 {
        attribute("watchdog", &format!("T#{}us", task.watchdog_us));
    }
    if task.sensitivity > 0 {
        attribute("watchdog_sensitivity", &task.sensitivity.to_string());
    }
    let mut parameters = Vec::new();
    if let Some(single) = task.single() {
        parameters.push(format!("SINGLE := {}", print_single(plan, single)));
    }
    if let Trigger::Cyclic { interval_us, phase_us, policy, .. } = task.trigger {
        if phase_us > 0 {
            attribute("phase", &format!("T#{phase_us}us"));
        }
        if policy != Policy::Grid {
            attribute("overrun", policy.name());
        }
        parameters.push(format!("INTERVAL := T#{interval_us}us"));
    }
    parameters.push(format!("PRIORITY := {}", task.priority));
    // Only a container can say so; a front end would have to leave the task out.
    let note = if task.enabled { "" } else { " (* disabled *)" };
    let _ = writeln!(out, "    TASK t{at}({});{note}", parameters.join(", "));
}

fn print_single(plan: &Plan, single: Single) -> String {
    match single {
        Single::Global(global) => format!("b{global}"),
        Single::Instance(instance, place) => format!("{}.{}", plan.instance_name(instance), print_place(place)),
        Single::Bit(bit) => bit.address(),
        Single::Literal(value) => print_bool(value).to_string(),
    }
}
