//! One cycle of one task: its program instances under its watchdog.

use khz_bytecode::container::Container;
use khz_machine::engine::{Engine, Entry, Fuel, Limits};
use khz_machine::image::Image;
use khz_machine::trap::{CodePlace, Trap, TrapCode};

use crate::task::{TaskIndex, TaskInfo};
use crate::time::DurationNs;
use crate::watchdog::Guard;

/// The watchdog of one task. As CODESYS: with sensitivity n it trips in the n-th consecutive cycle over the time, or in one over n times the time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Watch {
    /// Watchdog time; zero: none.
    pub time: DurationNs,
    /// Consecutive cycles over it that trip, at least 1.
    pub sensitivity: u16,
    /// What a single cycle may take: a running cycle is ended there. Zero: no limit.
    pub limit: DurationNs,
    /// Consecutive cycles over the time so far.
    pub late_cycles: u16,
}

impl Watch {
    /// The task's own watchdog time, or the default.
    pub fn new(info: &TaskInfo, default: DurationNs) -> Self {
        let time = if info.watchdog.0 == 0 { default } else { info.watchdog };
        let sensitivity = info.watchdog_sensitivity.max(1);
        Watch { time, sensitivity, limit: time.times(u64::from(sensitivity)), late_cycles: 0 }
    }

    /// Whether the watchdog trips after a cycle that took `used`.
    pub fn trips_after(&mut self, used: DurationNs) -> bool {
        if self.time.0 == 0 || used <= self.time {
            self.late_cycles = 0;
            return false;
        }
        self.late_cycles = self.late_cycles.saturating_add(1);
        // The limit counts for itself: whether a cycle that ran past it and then ended trips must not depend on when the monitor woke.
        self.late_cycles >= self.sensitivity || used > self.limit
    }
}

/// A trap in a program instance, by its position in the instance table.
#[derive(Debug)]
pub(super) struct InstanceTrap {
    pub instance: usize,
    pub trap: Trap,
}

/// What a cycle runs with.
pub(super) struct Cycle<'a> {
    pub engine: &'a mut dyn Engine,
    pub image: &'a mut Image,
    pub guard: &'a Guard,
    /// Positions in the instance table, in order.
    pub instances: &'a [usize],
    pub task: TaskIndex,
    /// Nanoseconds of CLOCK_MONOTONIC; `None`: nothing to arm.
    pub deadline_ns: Option<u64>,
    /// Units for all instances together.
    pub fuel: Option<&'a mut Fuel>,
}

impl Cycle<'_> {
    /// Runs the instances one after the other. Returns whether the deadline passed although they ended.
    #[inline]
    pub fn run(mut self) -> Result<bool, InstanceTrap> {
        if let Some(deadline_ns) = self.deadline_ns {
            self.guard.arm(deadline_ns);
        }
        let outcome = self.run_instances();
        let expired = self.deadline_ns.is_some() && self.guard.disarm();
        outcome.map(|()| expired)
    }

    #[inline]
    fn run_instances(&mut self) -> Result<(), InstanceTrap> {
        for &instance in self.instances {
            let limits =
                Limits { deadline: self.guard.cell(), fuel: self.fuel.as_deref_mut(), task_index: self.task.index() };
            self.engine
                .run(Entry::Instance(instance), self.image, limits)
                .map_err(|trap| InstanceTrap { instance, trap })?;
        }
        Ok(())
    }
}

/// The trap of a cycle that ended, but too late: at the entry of the task's last instance, since no instruction is to blame more than another.
pub(super) fn late_trap(container: &Container, instances: &[usize]) -> Option<InstanceTrap> {
    let instance = *instances.last()?;
    let function = container.tasks.instances.get(instance)?.entry;
    Some(InstanceTrap { instance, trap: Trap::new(TrapCode::Watchdog, CodePlace { function, offset: 0 }, [0; 3]) })
}

#[cfg(test)]
mod tests {
    use khz_bytecode::container::SingleSource;

    use super::*;
    use crate::time::TimeNs;

    fn watch(watchdog_ns: u64, watchdog_sensitivity: u16, default: u64) -> Watch {
        let info = TaskInfo {
            id: 0,
            phase: TimeNs::ZERO,
            single: SingleSource::None,
            watchdog: DurationNs(watchdog_ns),
            watchdog_sensitivity,
        };
        Watch::new(&info, DurationNs(default))
    }

    #[test]
    fn without_sensitivity_the_first_late_cycle_trips() {
        for sensitivity in [0, 1] {
            let mut watch = watch(100, sensitivity, 7);
            assert_eq!(watch.limit, DurationNs(100));
            assert!(!watch.trips_after(DurationNs(100)));
            assert!(watch.trips_after(DurationNs(101)));
        }
    }

    #[test]
    fn sensitivity_counts_consecutive_late_cycles() {
        let mut watch = watch(100, 3, 0);
        assert_eq!(watch.limit, DurationNs(300));
        let trips: Vec<bool> = [150, 150, 100, 150, 150, 150].map(|used| watch.trips_after(DurationNs(used))).to_vec();
        assert_eq!(trips, [false, false, false, false, false, true]);
    }

    #[test]
    fn one_cycle_over_the_whole_limit_trips_at_once() {
        let mut watch = watch(100, 3, 0);
        assert!(!watch.trips_after(DurationNs(300)));
        watch.late_cycles = 0;
        assert!(watch.trips_after(DurationNs(301)));
    }

    #[test]
    fn the_default_is_for_tasks_that_set_none() {
        assert_eq!(watch(0, 1, 7).time, DurationNs(7));
        let mut none = watch(0, 5, 0);
        assert_eq!(none.limit, DurationNs(0));
        assert!(!none.trips_after(DurationNs(u64::MAX)));
        assert_eq!(watch(u64::MAX, 5, 0).limit, DurationNs(u64::MAX));
    }
}
