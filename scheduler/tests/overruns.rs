//! Overruns and jitter, on a clock on which execution takes the time a script says.

mod common;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use common::*;
use khz_bytecode::container::{Container, OverrunPolicy};
use khz_machine::engine::Entry;
use khz_scheduler::*;

/// A clock that the engine moves.
#[derive(Clone, Default)]
struct Scripted(Arc<AtomicU64>);

impl Scripted {
    fn spend_us(&self, us: u64) {
        self.0.fetch_add(us * 1000, Ordering::Relaxed);
    }
}

impl Clock for Scripted {
    fn kind(&self) -> ClockKind {
        ClockKind::Virtual
    }

    fn start_at(&mut self, time: TimeNs) {
        self.0.store(time.0, Ordering::Relaxed);
    }

    fn now(&self) -> TimeNs {
        TimeNs(self.0.load(Ordering::Relaxed))
    }

    fn wait(&mut self, wake: Wake, _stop: &StopHandle) {
        if let Wake::At { time, .. } = wake {
            self.0.fetch_max(time.0, Ordering::Relaxed);
        }
    }

    fn monotonic_ns(&self, _time: TimeNs) -> Option<u64> {
        None
    }
}

/// Runs with the execution times in µs that `times` gives for (instance, cycle).
fn scripted(container: Container, scans: u64, times: fn(usize, i64) -> u64) -> (Vec<String>, StatisticsReport) {
    let clock = Scripted::default();
    let engine_clock = clock.clone();
    let resource = load_with(container, Box::new(clock), &LoadOptions::default(), move |entry, image, _| {
        let Entry::Instance(instance) = entry else { return Ok(()) };
        let cycle = get(image, instance);
        set(image, instance, cycle + 1);
        engine_clock.spend_us(times(instance, cycle));
        Ok(())
    })
    .unwrap();
    let (trace, outcome) = traced(resource, vec![], scans);
    let RunOutcome::Completed(resource) = outcome else { panic!("{outcome:?}") };
    (trace, resource.statistics())
}

/// 2 ms a cycle, but 25 ms in the second.
fn one_long_cycle(_instance: usize, cycle: i64) -> u64 {
    if cycle == 1 { 25_000 } else { 2_000 }
}

#[test]
fn the_grid_is_kept() {
    let (trace, report) = scripted(container(&[with_policy(10_000, OverrunPolicy::Grid)]), 4, one_long_cycle);
    assert_eq!(trace, ["0 [0]", "10000 [0]", "40000 [0]", "50000 [0]"]);
    assert_eq!((report.tasks[0].overruns, report.tasks[0].lost_cycles), (1, 2));
}

#[test]
fn at_once() {
    let (trace, report) = scripted(container(&[with_policy(10_000, OverrunPolicy::AtOnce)]), 4, one_long_cycle);
    assert_eq!(trace, ["0 [0]", "10000 [0]", "35000 [0]", "40000 [0]"]);
    assert_eq!((report.tasks[0].overruns, report.tasks[0].lost_cycles), (1, 1));
}

#[test]
fn realigned() {
    let (trace, report) = scripted(container(&[with_policy(10_000, OverrunPolicy::Realign)]), 4, one_long_cycle);
    assert_eq!(trace, ["0 [0]", "10000 [0]", "45000 [0]", "55000 [0]"]);
    assert_eq!((report.tasks[0].overruns, report.tasks[0].lost_cycles), (1, 2));
}

#[test]
fn another_tasks_long_cycle_costs_points_but_is_no_overrun() {
    let times = |instance, cycle| if instance == 0 && cycle == 0 { 7_000 } else { 0 };
    let (trace, report) = scripted(container(&[cyclic(20_000, 0), cyclic(2_000, 1)]), 3, times);
    // The fast task starts at 7 ms for the point 0; 2, 4 and 6 are over when it ends.
    assert_eq!(trace, ["0 [0, 1]", "8000 [1]", "10000 [1]"]);
    assert_eq!((report.tasks[0].overruns, report.tasks[0].lost_cycles), (0, 0));
    assert_eq!((report.tasks[1].overruns, report.tasks[1].lost_cycles), (1, 3), "it ran past its due time");
    let jitter = report.tasks[1].jitter.unwrap();
    assert_eq!((jitter.last, jitter.min, jitter.max), (0, 0, 7_000_000));
    let execution = report.tasks[0].execution.unwrap();
    assert_eq!((execution.last, execution.count), (7_000_000, 1));
}
