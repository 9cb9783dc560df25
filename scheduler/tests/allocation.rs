//! A round allocates nothing; and what it costs is printed (`--nocapture`).

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use common::*;
use khz_scheduler::clock::monotonic_now_ns;
use khz_scheduler::*;

struct Counting;

thread_local! {
    /// Of this thread: what a monitor thread does while it starts is no scan.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

// SAFETY: every call goes on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is ending has no counter any more, and no scan either.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Rounds with everything in them, counted after the first few.
fn rounds(clock: Box<dyn Clock>, watchdog_us: u64) -> u64 {
    let (mut watched, extension) = cyclic(100, 0);
    watched.watchdog_us = watchdog_us;
    let tasks = [(watched, extension), cyclic(70, 1), event(slot(3), 2), freewheeling(), gated(130, slot(4))];
    let options = LoadOptions { stop: Some(StopHandle::new()), ..LoadOptions::default() };
    let resource = load_with(container(&tasks), clock, &options, |_, image, _| {
        let value = get(image, 3);
        set(image, 3, 1 - value);
        set(image, 4, value);
        Ok(())
    })
    .unwrap();
    let mut hooks = Hooks { io: &mut NoIo, inputs: &mut NoInputs, observer: &mut NoObserver };
    let mut running = resource.start().unwrap();
    let mut before = 0;
    for round in 0..300 {
        if round == 20 {
            before = allocations();
        }
        running = running.run_round(&mut hooks).unwrap().0;
        let wake = running.next_wake(&mut hooks);
        running.wait(wake);
    }
    allocations() - before
}

#[test]
fn the_counter_counts() {
    let before = allocations();
    drop(std::hint::black_box(Box::new(1)));
    assert!(allocations() > before);
}

#[test]
fn a_round_allocates_nothing() {
    assert_eq!(rounds(Box::new(VirtualClock::new()), 10_000), 0);
    assert_eq!(rounds(Box::new(MonotonicClock::new(khz_scheduler::time::DurationNs(0))), 1_000_000), 0);

    let resource = load(container(&[cyclic(1_000, 0)]), |_, _, _| Ok(()));
    let mut hooks = Hooks { io: &mut NoIo, inputs: &mut NoInputs, observer: &mut NoObserver };
    let mut running = resource.start().unwrap();
    let count = 200_000;
    let start_ns = monotonic_now_ns();
    for _ in 0..count {
        running = running.run_round(&mut hooks).unwrap().0;
        let wake = running.next_wake(&mut hooks);
        running.wait(wake);
    }
    show(&format!("a round around an empty program: {} ns", (monotonic_now_ns() - start_ns) / count));
    let (_, batch_ns) = running.bench_batch(TaskIndex(0), 100_000).unwrap();
    show(&format!("a cycle of an empty program: {} ns", batch_ns / 100_000));
}
