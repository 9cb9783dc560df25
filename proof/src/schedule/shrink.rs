//! Makes a plan that shows something small: one part after another is left out as long as what is left still shows it.

use super::plan::{Action, Command, Deed, Form, Home, Instance, Plan, Policy, Single, Task, Time, Trigger};

/// The smallest plan found that still `shows` it, after at most `tries` questions.
pub fn shrink(plan: &Plan, shows: &mut dyn FnMut(&Plan) -> bool, tries: usize) -> Plan {
    let mut best = plan.clone();
    let mut left = tries;
    loop {
        let mut smaller = false;
        let mut at = 0;
        // A candidate that is taken gives way to a list of its own; what was tried before it stays behind.
        while let Some(candidate) = candidates(&best).into_iter().nth(at) {
            if left == 0 {
                return best;
            }
            left -= 1;
            if candidate != best && shows(&candidate) {
                best = candidate;
                smaller = true;
            } else {
                at += 1;
            }
        }
        if !smaller {
            return best;
        }
    }
}

/// Plans with one part less, the largest parts first.
fn candidates(plan: &Plan) -> Vec<Plan> {
    let mut found = Vec::new();
    let mut with = |change: &dyn Fn(&mut Plan)| {
        let mut candidate = plan.clone();
        change(&mut candidate);
        found.push(candidate);
    };
    let bare = plan.form == Form::BareText;
    for at in 0..plan.commands.len() {
        with(&|plan| _ = plan.commands.remove(at));
    }
    // The task of instances without WITH goes with the last of them.
    let written = plan.tasks.len() - usize::from(plan.instances.iter().any(|instance| instance.task.is_none()));
    if plan.tasks.len() > 1 {
        (0..written).for_each(|at| with(&|plan| remove_task(plan, at)));
    }
    if !bare {
        (0..plan.instances.len()).for_each(|at| with(&|plan| remove_instance(plan, at)));
    }
    with(&|plan| plan.init = None);
    with(&|plan| plan.startup = None);
    with(&|plan| plan.rows.clear());
    (0..plan.rows.len()).for_each(|at| with(&|plan| _ = plan.rows.remove(at)));
    for (program, body) in plan.programs.iter().enumerate() {
        (0..body.len()).for_each(|at| with(&|plan| _ = plan.programs[program].remove(at)));
        (0..body.len()).for_each(|at| with(&|plan| simplify_action(&mut plan.programs[program][at])));
    }
    for actions in [plan.init.as_ref(), plan.startup.as_ref()].into_iter().flatten() {
        (0..actions.len()).for_each(|at| with(&|plan| remove_once_action(plan, at)));
    }
    if !bare {
        for at in 0..plan.tasks.len() {
            for change in [plain_timing, plain_watchdog, plain_single, plain_order] {
                with(&|plan| change(&mut plan.tasks[at]));
            }
        }
        for at in 0..plan.instances.len() {
            with(&|plan| plan.instances[at].source = None);
            with(&|plan| plan.instances[at].sink = None);
        }
    }
    with(&|plan| plan.globals.fill(Home::Any));
    with(&|plan| plan.watchdog_us = 0);
    with(&|plan| plan.input_poll_ns = 0);
    with(&|plan| plan.time = Time::Virtual);
    (0..plan.delays_ns.len()).for_each(|at| with(&|plan| _ = plan.delays_ns.remove(at)));
    for (at, command) in plan.commands.iter().enumerate() {
        match *command {
            Command::Run { scans, stop_after } if scans > 1 => {
                with(&|plan| plan.commands[at] = Command::Run { scans: scans - 1, stop_after });
            }
            Command::Step(rounds) if rounds > 1 => with(&|plan| plan.commands[at] = Command::Step(rounds - 1)),
            _ => {}
        }
    }
    found
}

/// Removes a task with its instances.
fn remove_task(plan: &mut Plan, task: usize) {
    while let Some(at) = plan.instances_of(task).first().copied() {
        remove_instance(plan, at);
    }
    plan.tasks.remove(task);
    for instance in &mut plan.instances {
        instance.task = instance.task.map(|own| own - usize::from(own > task));
    }
}

fn remove_instance(plan: &mut Plan, at: usize) {
    let Instance { task, .. } = plan.instances.remove(at);
    for task in &mut plan.tasks {
        let moved = match task.single() {
            Some(Single::Instance(instance, _)) if instance == at => Some(Single::Literal(false)),
            Some(Single::Instance(instance, place)) if instance > at => Some(Single::Instance(instance - 1, place)),
            _ => None,
        };
        if let Some(moved) = moved {
            set_single(task, moved);
        }
    }
    if task.is_none() && plan.instances.iter().all(|instance| instance.task.is_some()) && plan.tasks.len() > 1 {
        plan.tasks.pop();
    }
}

fn remove_once_action(plan: &mut Plan, at: usize) {
    for actions in [plan.init.as_mut(), plan.startup.as_mut()].into_iter().flatten() {
        if at < actions.len() {
            actions.remove(at);
            return;
        }
    }
}

fn simplify_action(action: &mut Action) {
    if action.deed != Deed::Trap {
        action.when = None;
    }
}

fn set_single(task: &mut Task, to: Single) {
    match &mut task.trigger {
        Trigger::Cyclic { single, .. } => *single = Some(to),
        Trigger::Event(single) => *single = to,
        Trigger::Freewheeling => {}
    }
}

fn plain_timing(task: &mut Task) {
    if let Trigger::Cyclic { phase_us, policy, .. } = &mut task.trigger {
        (*phase_us, *policy) = (0, Policy::Grid);
    }
}

fn plain_watchdog(task: &mut Task) {
    (task.watchdog_us, task.sensitivity) = (0, 0);
}

fn plain_single(task: &mut Task) {
    if let Trigger::Cyclic { single, .. } = &mut task.trigger {
        *single = None;
    }
}

fn plain_order(task: &mut Task) {
    (task.priority, task.enabled) = (0, true);
}
