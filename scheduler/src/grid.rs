//! Arithmetic of a cyclic task's grid (architecture §8). Pure.

use khz_bytecode::canary::{Fault, planted};
use khz_bytecode::container::OverrunPolicy;

use crate::time::{DurationNs, TimeNs};

/// What a step on the grid gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Step {
    /// The next due time.
    pub next_due: TimeNs,
    /// Grid points that nothing ran for.
    pub lost_cycles: u64,
    /// Whether the cycle ran past the next due time.
    pub overrun: bool,
}

/// Point `count` of the grid after `due`.
fn advance(due: TimeNs, interval: DurationNs, count: u64) -> TimeNs {
    due.after(interval.times(count))
}

/// A due task (`due` ≤ `now`) is collected for running: `missed = (now - due) / interval`, `due += (missed + 1) * interval`.
#[must_use]
pub fn collect(due: TimeNs, interval: DurationNs, now: TimeNs) -> Step {
    let missed = now.since(due).0 / interval.0.max(1);
    let lost_cycles = if missed == 1 && planted(Fault::Scheduler) { 0 } else { missed };
    Step { next_due: advance(due, interval, missed.saturating_add(1)), lost_cycles, overrun: false }
}

/// A cycle ended at `end` when `due` was its next due time. An end at the due time itself is no overrun.
#[must_use]
pub fn complete(due: TimeNs, interval: DurationNs, end: TimeNs, policy: OverrunPolicy) -> Step {
    if end <= due {
        return Step { next_due: due, lost_cycles: 0, overrun: false };
    }
    // Every grid point from `due` to `end`: none of them had a cycle of its own.
    let passed = end.since(due).0 / interval.0.max(1) + 1;
    match policy {
        OverrunPolicy::Grid => Step { next_due: advance(due, interval, passed), lost_cycles: passed, overrun: true },
        // Due since `due`: the next round collects it, and counts what it missed by then.
        OverrunPolicy::AtOnce => Step { next_due: due, lost_cycles: 0, overrun: true },
        OverrunPolicy::Realign => Step { next_due: end.after(interval), lost_cycles: passed, overrun: true },
    }
}

/// The first grid point at or after `now`.
#[must_use]
pub fn at_or_after(due: TimeNs, interval: DurationNs, now: TimeNs) -> TimeNs {
    if now <= due { due } else { advance(due, interval, now.since(due).0.div_ceil(interval.0.max(1))) }
}

/// The first grid point after `now`.
#[must_use]
pub fn after(due: TimeNs, interval: DurationNs, now: TimeNs) -> TimeNs {
    if now < due { due } else { advance(due, interval, now.since(due).0 / interval.0.max(1) + 1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEN: DurationNs = DurationNs(10);

    #[test]
    fn a_task_collected_in_time_goes_to_the_next_point() {
        let step = Step { next_due: TimeNs(30), lost_cycles: 0, overrun: false };
        assert_eq!(collect(TimeNs(20), TEN, TimeNs(20)), step);
        assert_eq!(collect(TimeNs(20), TEN, TimeNs(29)), step);
    }

    #[test]
    fn a_task_collected_late_loses_the_points_between_and_keeps_its_grid() {
        assert_eq!(collect(TimeNs(20), TEN, TimeNs(30)), Step { next_due: TimeNs(40), lost_cycles: 1, overrun: false });
        assert_eq!(collect(TimeNs(23), TEN, TimeNs(79)), Step { next_due: TimeNs(83), lost_cycles: 5, overrun: false });
    }

    #[test]
    fn the_three_policies_after_an_overrun() {
        let due = TimeNs(40);
        for policy in [OverrunPolicy::Grid, OverrunPolicy::AtOnce, OverrunPolicy::Realign] {
            assert_eq!(complete(due, TEN, TimeNs(40), policy), Step { next_due: due, lost_cycles: 0, overrun: false });
        }
        let late = |policy, end| complete(due, TEN, TimeNs(end), policy);
        assert_eq!(late(OverrunPolicy::Grid, 41), Step { next_due: TimeNs(50), lost_cycles: 1, overrun: true });
        // An end on a grid point has passed it.
        assert_eq!(late(OverrunPolicy::Grid, 50), Step { next_due: TimeNs(60), lost_cycles: 2, overrun: true });
        assert_eq!(late(OverrunPolicy::AtOnce, 65), Step { next_due: due, lost_cycles: 0, overrun: true });
        assert_eq!(late(OverrunPolicy::Realign, 65), Step { next_due: TimeNs(75), lost_cycles: 3, overrun: true });
    }

    #[test]
    fn grid_points_around_a_time() {
        for now in 0..100 {
            let points = (7..200).step_by(10);
            let expected = points.clone().find(|p| *p >= now).unwrap();
            assert_eq!(at_or_after(TimeNs(7), TEN, TimeNs(now)).0, expected, "at or after {now}");
            let expected = points.clone().find(|p| *p > now).unwrap();
            assert_eq!(after(TimeNs(7), TEN, TimeNs(now)).0, expected, "after {now}");
        }
    }

    #[test]
    fn the_end_of_time_saturates() {
        let step = collect(TimeNs(5), DurationNs(u64::MAX), TimeNs(9));
        assert_eq!(step.next_due, TimeNs::NEVER);
        let step = complete(TimeNs(5), DurationNs(u64::MAX), TimeNs(9), OverrunPolicy::Grid);
        assert_eq!(step.next_due, TimeNs::NEVER);
        assert_eq!(at_or_after(TimeNs(0), DurationNs(0), TimeNs(9)), TimeNs(0), "a zero interval does not divide");
    }
}
