//! Watchdogs and stop requests, in real and in virtual time. Only that they stop is asserted; the times are printed (`--nocapture`).

mod common;

use std::time::Duration;

use common::*;
use khz_bytecode::container::{Container, TaskExtension};
use khz_bytecode::ids::FunctionId;
use khz_machine::trap::TrapCode;
use khz_scheduler::clock::monotonic_now_ns;
use khz_scheduler::*;

fn watched(watchdog_us: u64) -> Container {
    let (mut task, extension) = cyclic(10_000, 0);
    task.watchdog_us = watchdog_us;
    container(&[(task, extension)])
}

fn real() -> Box<dyn Clock> {
    Box::new(MonotonicClock::new(khz_scheduler::time::DurationNs(0)))
}

fn fault(outcome: RunOutcome) -> Resource<Faulted> {
    match outcome {
        RunOutcome::Faulted(faulted) => faulted,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_watchdog_ends_an_endless_loop_in_real_time() {
    let mut late_us = Vec::new();
    for _ in 0..20 {
        let options = LoadOptions::default();
        let resource = load_with(watched(10_000), real(), &options, |_, _, limits| endless(limits)).unwrap();
        let start_ns = monotonic_now_ns();
        let faulted = fault(run_plain(resource.start().unwrap(), None));
        late_us.push((monotonic_now_ns() - start_ns) as i64 / 1000 - 10_000);
        assert_eq!(faulted.report().trap, trap(TrapCode::Watchdog));
        assert_eq!(faulted.report().place, FaultPlace::Task { task: TaskIndex(0), instance: 0 });
        assert!(late_us.iter().all(|late| *late >= 0), "never early");
    }
    late_us.sort_unstable();
    show(&format!("10 ms watchdog: late by median {} µs, max {} µs", late_us[10], late_us[19]));
}

#[test]
fn a_watchdog_does_not_trip_falsely_and_the_default_is_for_others() {
    let options = LoadOptions { watchdog_us: 50, ..LoadOptions::default() };
    // Its own watchdog is a second; the default of 50 µs is not for it.
    let resource = load_with(watched(1_000_000), real(), &options, |_, _, _| {
        std::thread::sleep(Duration::from_millis(1));
        Ok(())
    })
    .unwrap();
    let outcome = run_plain(resource.start().unwrap(), Some(20));
    assert!(matches!(outcome, RunOutcome::Completed(_)));
    let resource = load_with(watched(0), real(), &options, |_, _, limits| endless(limits)).unwrap();
    fault(run_plain(resource.start().unwrap(), None));
}

#[test]
fn a_cycle_that_ends_by_itself_too_late_trips_too() {
    let resource = load_with(watched(1_000), real(), &LoadOptions::default(), |_, _, _| {
        std::thread::sleep(Duration::from_millis(3));
        Ok(())
    })
    .unwrap();
    let faulted = fault(run_plain(resource.start().unwrap(), Some(1)));
    assert_eq!(faulted.report().trap.code, TrapCode::Watchdog);
    assert_eq!(faulted.report().trap.place.function, FunctionId(0));
    // A reset makes it run again: nothing of the fault stays behind.
    let again = faulted.reset(ResetKind::Warm).unwrap().start().unwrap();
    fault(run_plain(again, Some(1)));
}

#[test]
fn init_is_watched_in_real_time() {
    let mut container = watched(0);
    container.parameters.init_function = Some(FunctionId(0));
    let options = LoadOptions { watchdog_us: 5_000, ..LoadOptions::default() };
    let result = load_with(container, real(), &options, |_, _, limits| endless(limits));
    assert!(matches!(result, Err(LoadError::Faulted(_))));
}

#[test]
fn on_the_virtual_clock_a_watchdog_is_fuel() {
    let mut container = watched(10_000);
    let mut second = container.tasks.instances[0];
    second.id.0 = 1;
    container.tasks.instances.push(second);
    // Each instance takes 4 ms, then 6 ms: together they share the task's 10 ms.
    let mut used = 4_000_000;
    let mut calls = 0;
    let resource = load(container, move |_, _, limits| {
        calls += 1;
        used = if calls > 2 { 6_000_000 } else { used };
        let fuel = limits.fuel.unwrap();
        match fuel.left.checked_sub(used) {
            Some(left) => {
                fuel.left = left;
                Ok(())
            }
            None => Err(trap(TrapCode::Watchdog)),
        }
    });
    let faulted = fault(run_plain(resource.start().unwrap(), None));
    assert_eq!(faulted.report().place, FaultPlace::Task { task: TaskIndex(0), instance: 1 });
    assert_eq!(faulted.report().time.as_us(), 10_000);
    // Without a watchdog there is no fuel.
    let resource = load(watched(0), |_, _, limits| {
        assert!(limits.fuel.is_none());
        Ok(())
    });
    run_plain(resource.start().unwrap(), Some(3));
}

#[test]
fn sensitivity_counts_consecutive_cycles_over_the_time() {
    let (mut task, extension) = cyclic(10_000, 0);
    task.watchdog_us = 1_000;
    let container = container(&[(task, TaskExtension { watchdog_sensitivity: 3, ..extension })]);
    let resource = load(container, |_, _, limits| {
        let fuel = limits.fuel.unwrap();
        assert_eq!(fuel.left, 3_000_000, "a single cycle may take three times the time");
        fuel.left -= 1_500_000;
        Ok(())
    });
    let faulted = fault(run_plain(resource.start().unwrap(), None));
    assert_eq!(faulted.report().time.as_us(), 20_000, "the third one trips");
}

/// One request, or two, while a task loops without a watchdog.
fn stop_endless(clock: Box<dyn Clock>, requests: u32) -> (Resource<Faulted>, Duration) {
    let stop = StopHandle::new();
    let options = LoadOptions { stop: Some(stop.clone()), ..LoadOptions::default() };
    let resource = load_with(watched(0), clock, &options, |_, _, limits| endless(limits)).unwrap();
    let requester = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(20));
        for _ in 0..requests {
            stop.request();
        }
        monotonic_now_ns()
    });
    let faulted = fault(run_plain(resource.start().unwrap(), None));
    let took = Duration::from_nanos(monotonic_now_ns().saturating_sub(requester.join().unwrap()));
    (faulted, took)
}

#[test]
fn stop_requests_end_an_endless_loop() {
    for real_time in [true, false] {
        let clock = || if real_time { real() } else { Box::new(VirtualClock::new()) };
        let (faulted, took) = stop_endless(clock(), 2);
        assert_eq!(faulted.report().trap.code, TrapCode::Stopped);
        show(&format!("two requests: {took:?}"));
        let (faulted, took) = stop_endless(clock(), 1);
        assert_eq!(faulted.report().trap.code, TrapCode::Stopped);
        assert!(took >= Duration::from_millis(900), "one request leaves a second");
        show(&format!("one request: {took:?}"));
    }
}

#[test]
fn a_stop_request_ends_the_run_after_the_round_or_while_sleeping() {
    let stop = StopHandle::new();
    let options = LoadOptions { stop: Some(stop.clone()), ..LoadOptions::default() };
    let inner = stop.clone();
    let resource =
        load_with(container(&[cyclic(1_000, 0)]), Box::new(VirtualClock::new()), &options, move |_, image, _| {
            let count = get(image, 0) + 1;
            set(image, 0, count);
            if count == 7 {
                inner.request();
            }
            Ok(())
        })
        .unwrap();
    let RunOutcome::Stopped(resource) = run_plain(resource.start().unwrap(), None) else { panic!() };
    assert_eq!((get(resource.image(), 0), resource.rounds()), (7, 7));

    let stop = StopHandle::new();
    let options = LoadOptions { stop: Some(stop.clone()), ..LoadOptions::default() };
    let hour = container(&[cyclic(3_600_000_000, 0)]);
    let resource = load_with(hour, real(), &options, |_, _, _| Ok(())).unwrap();
    let requester = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(30));
        stop.request();
    });
    assert!(matches!(run_plain(resource.start().unwrap(), None), RunOutcome::Stopped(_)));
    requester.join().unwrap();
}
