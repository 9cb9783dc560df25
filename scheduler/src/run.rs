//! Running rounds until something ends it.

use crate::hooks::Hooks;
use crate::resource::{Faulted, Resource, Running, Stopped};
use crate::wake::Wake;

/// When to end a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RunOptions {
    /// Rounds in which a task ran; `None`: until stopped.
    pub scans: Option<u64>,
}

/// How a run ended.
#[derive(Debug)]
pub enum RunOutcome {
    /// All rounds asked for have run.
    Completed(Resource<Stopped>),
    /// Nothing can ever be due again.
    NothingDue(Resource<Stopped>),
    /// A stop was requested, and the round had ended.
    Stopped(Resource<Stopped>),
    /// A trap.
    Faulted(Resource<Faulted>),
}

/// Runs rounds on the calling thread.
pub fn run(resource: Resource<Running>, hooks: &mut Hooks<'_>, options: RunOptions) -> RunOutcome {
    let guard = resource.guard();
    guard.begin_run();
    let outcome = run_rounds(resource, hooks, options);
    guard.end_run();
    outcome
}

fn run_rounds(mut resource: Resource<Running>, hooks: &mut Hooks<'_>, options: RunOptions) -> RunOutcome {
    let mut scans = 0;
    loop {
        if options.scans.is_some_and(|wanted| scans >= wanted) {
            return RunOutcome::Completed(resource.stop());
        }
        if resource.stop_requested() {
            return RunOutcome::Stopped(resource.stop());
        }
        match resource.run_round(hooks) {
            Ok((running, round)) => {
                resource = running;
                scans += u64::from(round.tasks != 0);
            }
            Err(faulted) => return RunOutcome::Faulted(faulted),
        }
        if options.scans.is_some_and(|wanted| scans >= wanted) {
            // Time stays that of the last round.
            continue;
        }
        match resource.next_wake(hooks) {
            Wake::Never => return RunOutcome::NothingDue(resource.stop()),
            wake => resource.wait(wake),
        }
    }
}
