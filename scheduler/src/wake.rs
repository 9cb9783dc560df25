//! What comes after a round: when the next one can have something to do. Pure.

use crate::grid;
use crate::task::{TaskSet, Trigger};
use crate::time::TimeNs;

/// When the next round shall be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wake {
    /// A task's SINGLE source rose after it was sampled: as soon as possible (virtual clock: 1 µs later).
    EdgePending,
    /// The earliest next due time, input row or input poll. A freewheeling task does not wait for it in real time: `freewheeling`.
    At {
        /// When.
        time: TimeNs,
        /// Whether a freewheeling task would run at once.
        freewheeling: bool,
    },
    /// Only freewheeling tasks: at once (virtual clock: 1 ms later).
    Freewheel,
    /// Nothing can ever be due.
    Never,
}

/// Decides after the round at `now`. `singles` holds each task's SINGLE value as it is after the round; `external` is the earliest time at
/// which something from outside can change an input ([`TimeNs::NEVER`]: not at all).
///
/// An edge is pending where an event task would see a rise in the next sampling. A gated cyclic task sees levels, not edges: its due time follows
/// the value after the round, so that no extra round is needed for it.
#[must_use]
pub fn next_wake(tasks: &TaskSet, now: TimeNs, singles: &[bool], external: TimeNs) -> Wake {
    let mut earliest = external;
    let mut freewheeling = false;
    for task in tasks.indices() {
        let state = tasks.state(task);
        if !state.enabled {
            continue;
        }
        let single = singles.get(task.index()).copied().unwrap_or(false);
        match state.trigger {
            Trigger::Freewheeling => freewheeling = true,
            Trigger::Event if single && !state.single_previous => return Wake::EdgePending,
            Trigger::Event => {}
            Trigger::Cyclic { gated: true, .. } if single => {}
            // It fell in this round; the next sampling is later than `now`.
            Trigger::Cyclic { gated: true, interval, .. } if state.single_previous => {
                earliest = earliest.min(grid::after(state.next_due, interval, now));
            }
            Trigger::Cyclic { .. } => earliest = earliest.min(state.next_due),
        }
    }
    match (earliest, freewheeling) {
        (TimeNs::NEVER, true) => Wake::Freewheel,
        (TimeNs::NEVER, false) => Wake::Never,
        (time, freewheeling) => Wake::At { time, freewheeling },
    }
}

#[cfg(test)]
mod tests {
    use khz_bytecode::container::OverrunPolicy;

    use super::*;
    use crate::task::{Priority, TaskState};
    use crate::time::DurationNs;

    fn task(trigger: Trigger, next_due: u64) -> TaskState {
        TaskState { trigger, priority: Priority(0), enabled: true, next_due: TimeNs(next_due), single_previous: false }
    }

    fn cyclic(interval: u64, gated: bool) -> Trigger {
        Trigger::Cyclic { interval: DurationNs(interval), gated, policy: OverrunPolicy::Grid }
    }

    fn wake(states: &[TaskState], singles: &[bool], external: TimeNs) -> Wake {
        next_wake(&TaskSet::from_states(states), TimeNs(20), singles, external)
    }

    #[test]
    fn a_pending_edge_comes_first() {
        let states = [task(cyclic(10, false), 21), task(Trigger::Event, 0)];
        assert_eq!(wake(&states, &[false, true], TimeNs::NEVER), Wake::EdgePending);
        assert_eq!(wake(&states, &[false, false], TimeNs::NEVER), Wake::At { time: TimeNs(21), freewheeling: false });
        let seen = TaskState { single_previous: true, ..states[1] };
        assert_eq!(wake(&[seen], &[true], TimeNs::NEVER), Wake::Never, "a value that stays TRUE is no edge");
        assert_eq!(wake(&[seen], &[false], TimeNs::NEVER), Wake::Never, "a fall starts nothing");
        let disabled = TaskState { enabled: false, ..states[1] };
        assert_eq!(wake(&[disabled], &[true], TimeNs::NEVER), Wake::Never);
    }

    #[test]
    fn the_earliest_of_due_times_and_inputs() {
        let states = [task(cyclic(10, false), 40), task(cyclic(10, false), 30)];
        assert_eq!(wake(&states, &[], TimeNs(35)), Wake::At { time: TimeNs(30), freewheeling: false });
        assert_eq!(wake(&states, &[], TimeNs(25)), Wake::At { time: TimeNs(25), freewheeling: false });
    }

    #[test]
    fn freewheeling_goes_along_or_alone() {
        let wheel = task(Trigger::Freewheeling, 0);
        assert_eq!(wake(&[wheel], &[], TimeNs::NEVER), Wake::Freewheel);
        assert_eq!(wake(&[wheel], &[], TimeNs(50)), Wake::At { time: TimeNs(50), freewheeling: true });
        assert_eq!(
            wake(&[wheel, task(cyclic(10, false), 30)], &[], TimeNs::NEVER),
            Wake::At { time: TimeNs(30), freewheeling: true }
        );
    }

    #[test]
    fn a_gated_task_follows_the_value_after_the_round() {
        let gated = task(cyclic(10, true), 30);
        assert_eq!(wake(&[gated], &[true], TimeNs::NEVER), Wake::Never);
        assert_eq!(wake(&[gated], &[false], TimeNs::NEVER), Wake::At { time: TimeNs(30), freewheeling: false });
        let fell = TaskState { single_previous: true, next_due: TimeNs(0), ..gated };
        assert_eq!(
            wake(&[fell], &[false], TimeNs::NEVER),
            Wake::At { time: TimeNs(30), freewheeling: false },
            "the point at 20 is this round's own and gone"
        );
    }
}
