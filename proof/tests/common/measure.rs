//! What one item of a search costs: time, and the most memory that was held at a time, by a counting allocator. An item without an end
//! ends the process, by its name.
#![allow(dead_code, reason = "each user takes its part")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::io::Write;
use std::time::Duration;

use khz_proof::watch::Watch;

thread_local! {
    /// Bytes that this thread has asked for and not given back; below 0 when it frees what another asked for.
    static HELD: Cell<i64> = const { Cell::new(0) };
    static MOST: Cell<i64> = const { Cell::new(0) };
}

/// Counts for each thread, and hands everything on to the system.
struct Counting;

fn count(change: i64) {
    // While a thread ends, its cells may be gone: nothing is measured then.
    let _ = HELD.try_with(|held| {
        held.set(held.get() + change);
        let _ = MOST.try_with(|most| most.set(most.get().max(held.get())));
    });
}

// SAFETY: every call goes to the system allocator with the arguments as they came; counting touches only thread-local cells that
// need no allocation and no destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as i64);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as i64);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        // Both may exist for a moment.
        count(new_size as i64);
        count(-(layout.size() as i64));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as i64));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Most bytes that one item may hold at a time.
pub const MOST_BYTES: u64 = 256 << 20;
/// Longest time that one item may take, in nanoseconds, on a machine that is not busy with something else.
pub const MOST_NS: u64 = 1_000_000_000;

/// What an item cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Cost {
    /// Wall time.
    pub time_ns: u64,
    /// Most memory that it held at a time, beyond what was there before.
    pub bytes: u64,
}

impl Cost {
    /// What is wrong with it, if anything.
    pub fn finding(self) -> Option<String> {
        let Cost { time_ns, bytes } = self;
        (time_ns > MOST_NS || bytes > MOST_BYTES)
            .then(|| format!("it took {} ms and {} MiB", time_ns / 1_000_000, bytes >> 20))
    }
}

/// A watch that ends the process with status 101 when an item of `what` runs for some seconds: it would stand still otherwise.
pub fn no_hang(what: &'static str, seconds: u64) -> Watch {
    Watch::new(seconds, Duration::from_secs(1), move |seed| {
        // Past whatever captures the output of a test. When nobody reads it, the status says it still.
        let _ = writeln!(std::io::stderr(), "{what}: seed {seed} has run for {seconds} s");
        std::process::exit(101);
    })
}

/// Does the item of a seed on this thread and says what it cost. Work handed to other threads is not counted.
#[allow(clippy::disallowed_methods, reason = "the cost of hostile input is what is looked for")]
pub fn measure<T>(watch: &Watch, seed: u64, work: impl FnOnce() -> T) -> (T, Cost) {
    let before = HELD.get();
    MOST.set(before);
    let start = std::time::Instant::now();
    let result = watch.over(seed, work);
    let time_ns = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    (result, Cost { time_ns, bytes: u64::try_from(MOST.get() - before).unwrap_or(0) })
}

/// The seed that cost most, in time and in memory.
#[derive(Debug, Default, Clone, Copy)]
pub struct Costs {
    slowest: (u64, u64),
    largest: (u64, u64),
    items: u64,
    time_ns: u64,
}

impl Costs {
    /// Counts the cost of a seed.
    pub fn count(&mut self, seed: u64, cost: Cost) {
        let one = Costs { slowest: (cost.time_ns, seed), largest: (cost.bytes, seed), items: 1, time_ns: cost.time_ns };
        self.add(one);
    }

    /// Adds what another counted.
    pub fn add(&mut self, other: Costs) {
        self.slowest = self.slowest.max(other.slowest);
        self.largest = self.largest.max(other.largest);
        self.items += other.items;
        self.time_ns += other.time_ns;
    }

    /// The figures, for people.
    pub fn report(&self) -> String {
        format!(
            "longest item {:.1} ms (seed {}), most memory of one item {:.1} MiB (seed {}), mean {:.1} us",
            self.slowest.0 as f64 / 1e6,
            self.slowest.1,
            self.largest.0 as f64 / f64::from(1 << 20),
            self.largest.1,
            self.time_ns as f64 / 1e3 / self.items.max(1) as f64
        )
    }
}
