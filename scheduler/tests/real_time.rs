//! The whole in real time: a scan thread, the monotonic clock, inputs that change by themselves.

mod common;

use common::*;
use khz_bytecode::container::{SingleSource, Task};
use khz_bytecode::value::BytePlace;
use khz_scheduler::time::DurationNs;
use khz_scheduler::*;

#[test]
fn a_cyclic_task_keeps_its_grid_on_a_scan_thread() {
    let outcome = on_scan_thread(&HostOptions::default(), |report| {
        assert!(report.first_refusal().is_none(), "nothing was asked for");
        let clock = Box::new(MonotonicClock::new(DurationNs(100_000)));
        let resource =
            load_with(container(&[cyclic(2_000, 0)]), clock, &LoadOptions::default(), |_, _, _| Ok(())).unwrap();
        run_plain(resource.start().unwrap(), Some(50))
    })
    .unwrap();
    let RunOutcome::Completed(resource) = outcome else { panic!("{outcome:?}") };
    let report = resource.statistics();
    let task = &report.tasks[0];
    assert_eq!((task.scans, report.rounds_with_tasks), (50, 50));
    // 50 cycles take 49 intervals, and what a busy host made them lose: no drift.
    let points = 49 + task.lost_cycles;
    let time_us = resource.time().as_us();
    let jitter = task.jitter.unwrap();
    assert!(time_us >= 49 * 2_000, "{time_us} µs for {points} intervals");
    assert!(time_us <= points * 2_000 + jitter.max / 1000 + 1, "{time_us} µs for {points} intervals");
    assert_eq!((jitter.count, task.execution.unwrap().count), (50, 50));
    assert!(jitter.min <= jitter.average && jitter.average <= jitter.max);
    show(&report.to_json(&["main".to_owned()]));
}

/// A bit of %I that rises by itself, every fourth time it is read.
struct Toggling {
    reads: u32,
}

impl IoDriver for Toggling {
    fn read_inputs(&mut self, inputs: &mut [u8]) {
        self.reads += 1;
        inputs[1] = u8::from(self.reads.is_multiple_of(4)) << 2;
    }

    fn write_outputs(&mut self, _outputs: &[u8]) {}

    fn input_poll(&self) -> Option<DurationNs> {
        Some(DurationNs(200_000))
    }
}

#[test]
fn an_event_task_on_an_input_bit_is_polled() {
    let single = SingleSource::Bit { place: BytePlace::Input, offset: 1, bit: 2 };
    let make = |clock: Box<dyn Clock>| {
        let resource =
            load_with(container(&[event(single, 0)]), clock, &LoadOptions::default(), |_, _, _| Ok(())).unwrap();
        let mut driver = Toggling { reads: 0 };
        let mut hooks = Hooks { io: &mut driver, inputs: &mut NoInputs, observer: &mut NoObserver };
        run(resource.start().unwrap(), &mut hooks, RunOptions { scans: Some(3) })
    };
    let RunOutcome::Completed(resource) = make(Box::new(MonotonicClock::new(DurationNs(0)))) else { panic!() };
    assert_eq!(resource.rounds(), 12);
    // Virtual time knows only inputs that are known beforehand.
    assert!(matches!(make(Box::new(VirtualClock::new())), RunOutcome::NothingDue(_)));
}

#[test]
fn a_disabled_task_polls_nothing() {
    let single = SingleSource::Bit { place: BytePlace::Input, offset: 1, bit: 2 };
    let (task, extension) = event(single, 0);
    let disabled = (Task { enabled: false, ..task }, extension);
    let clock = Box::new(MonotonicClock::new(DurationNs(0)));
    let resource = load_with(container(&[disabled]), clock, &LoadOptions::default(), |_, _, _| Ok(())).unwrap();
    let mut driver = Toggling { reads: 0 };
    let mut hooks = Hooks { io: &mut driver, inputs: &mut NoInputs, observer: &mut NoObserver };
    let outcome = run(resource.start().unwrap(), &mut hooks, RunOptions { scans: Some(1) });
    assert!(matches!(outcome, RunOutcome::NothingDue(_)), "it would never end");
}

#[test]
fn freewheeling_does_not_wait_in_real_time() {
    let clock = Box::new(MonotonicClock::new(DurationNs(0)));
    let tasks = [freewheeling(), cyclic(3_600_000_000, 0)];
    let resource = load_with(container(&tasks), clock, &LoadOptions::default(), |_, _, _| Ok(())).unwrap();
    let RunOutcome::Completed(resource) = run_plain(resource.start().unwrap(), Some(1000)) else { panic!() };
    let scans: Vec<u64> = resource.statistics().tasks.iter().map(|task| task.scans).collect();
    assert_eq!(scans, [1000, 1]);
    assert_eq!(resource.statistics().tasks[0].jitter, None, "a freewheeling task is never due by a time");
}

#[test]
fn a_bench_batch_moves_the_time_by_the_interval() {
    let mut container = container(&[cyclic(250, 0)]);
    container.types.system_variables = vec![khz_bytecode::container::SystemVariable {
        kind: khz_bytecode::container::SystemVariableKind::UpLtime,
        slot: khz_bytecode::ids::SlotIndex(5),
    }];
    let resource = load(container, |_, image, limits| {
        assert!(limits.fuel.is_none() && limits.deadline.expired().is_none());
        let value = get(image, 0);
        set(image, 0, value + 1);
        Ok(())
    });
    let (running, _) = resource.start().unwrap().bench_batch(TaskIndex(0), 40).unwrap();
    assert_eq!((get(running.image(), 0), get(running.image(), 5)), (40, 10_000_000));
    let (running, elapsed_ns) = running.bench_batch(TaskIndex(9), 40).unwrap();
    assert_eq!((get(running.image(), 0), elapsed_ns), (40, 0), "no such task");
}
