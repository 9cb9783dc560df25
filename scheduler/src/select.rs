//! Which tasks are due, in which order, and what sampling and collecting change. No clock, no image: pure over its arguments.

use crate::grid;
use crate::task::{TaskIndex, TaskSet, TaskState, Trigger};
use crate::time::TimeNs;

/// The due time that counts for a cyclic task in a round at `now` whose sample of its SINGLE source is `single`; `None`: none at all.
///
/// A gated task has none while its SINGLE is TRUE; in the round that sees it fall, the first grid point from then on counts, and
/// the points passed meanwhile are not lost cycles.
fn due_in_round(state: &TaskState, now: TimeNs, single: bool) -> Option<TimeNs> {
    match state.trigger {
        Trigger::Cyclic { gated: true, .. } if single => None,
        Trigger::Cyclic { gated: true, interval, .. } if state.single_previous => {
            Some(grid::at_or_after(state.next_due, interval, now))
        }
        Trigger::Cyclic { .. } => Some(state.next_due),
        Trigger::Event | Trigger::Freewheeling => None,
    }
}

/// Whether a task is due in a round at `now` whose sample of its SINGLE source is `single`.
#[must_use]
pub fn is_due(state: &TaskState, now: TimeNs, single: bool) -> bool {
    state.enabled
        && match state.trigger {
            Trigger::Cyclic { .. } => due_in_round(state, now, single).is_some_and(|due| due <= now),
            Trigger::Event => single && !state.single_previous,
            Trigger::Freewheeling => true,
        }
}

/// Puts the tasks that are due into `ready`, by priority, then declaration.
///
/// `samples` holds the value of each task's SINGLE source, by task position; tasks without one do not care. `ready` is emptied first and
/// never grows beyond the number of tasks.
pub fn select(tasks: &TaskSet, now: TimeNs, samples: &[bool], ready: &mut Vec<TaskIndex>) {
    ready.clear();
    for task in tasks.order() {
        let single = samples.get(task.index()).copied().unwrap_or(false);
        if is_due(tasks.state(*task), now, single) {
            ready.push(*task);
        }
    }
}

/// What the collection of a due task says of the cycle that follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Collected {
    /// When it should have started; `None` for a freewheeling task. For an event task the time of the round that saw the edge.
    pub due: Option<TimeNs>,
    /// Grid points that nothing ran for.
    pub lost_cycles: u64,
}

/// Keeps what was sampled at `now`: edges are seen against it in the next round, and a gated task whose SINGLE fell gets its due time back.
pub fn note_sample(state: &mut TaskState, now: TimeNs, single: bool) {
    if let (Trigger::Cyclic { gated: true, .. }, Some(due)) = (state.trigger, due_in_round(state, now, single)) {
        state.next_due = due;
    }
    state.single_previous = single;
}

/// Collects a task that [`select`] gave, after [`note_sample`]: moves a cyclic task's due time on.
pub fn collect(state: &mut TaskState, now: TimeNs) -> Collected {
    match state.trigger {
        Trigger::Cyclic { interval, .. } => {
            let due = state.next_due;
            let step = grid::collect(due, interval, now);
            state.next_due = step.next_due;
            Collected { due: Some(due), lost_cycles: step.lost_cycles }
        }
        Trigger::Event => Collected { due: Some(now), lost_cycles: 0 },
        Trigger::Freewheeling => Collected { due: None, lost_cycles: 0 },
    }
}

#[cfg(test)]
mod tests;
