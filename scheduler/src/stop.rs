//! Requests from outside to end a run. Everything here is safe to call in a signal handler: atomics and one futex wake.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use rustix::thread::futex;
use rustix::time::Timespec;

#[derive(Debug, Default)]
struct Shared {
    /// Stop requests so far.
    requests: AtomicU32,
    /// Counts everything a sleeper must wake for; the word that futexes sleep on.
    events: AtomicU32,
}

/// Ends a run: the first request at the end of the round; one second later, or at a second request, a running task is ended by trap *stopped*.
///
/// Clones are the same handle.
#[derive(Debug, Clone, Default)]
pub struct StopHandle(Arc<Shared>);

impl StopHandle {
    /// A handle without requests.
    #[must_use]
    pub fn new() -> Self {
        StopHandle::default()
    }

    /// Asks to stop. Async-signal-safe.
    pub fn request(&self) {
        // Saturates: a wrap to 0 would take the request back.
        let _ = self.0.requests.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |count| count.checked_add(1));
        self.notify();
    }

    /// How often it was asked for.
    #[must_use]
    pub fn requests(&self) -> u32 {
        self.0.requests.load(Ordering::Acquire)
    }

    /// Whether it was asked for.
    #[must_use]
    pub fn requested(&self) -> bool {
        self.requests() != 0
    }

    /// Forgets the requests, for the next run.
    pub fn clear(&self) {
        self.0.requests.store(0, Ordering::SeqCst);
        // The monitor forgets when the first one came.
        self.notify();
    }

    /// Wakes every sleeper so that it looks again. Async-signal-safe.
    pub(crate) fn notify(&self) {
        self.0.events.fetch_add(1, Ordering::SeqCst);
        // It fails only for a bad address, which this is not.
        let _ = futex::wake(&self.0.events, futex::Flags::PRIVATE, i32::MAX.unsigned_abs());
    }

    /// What to pass to [`StopHandle::sleep`]: read it before looking at what might have changed.
    pub(crate) fn event(&self) -> u32 {
        self.0.events.load(Ordering::SeqCst)
    }

    /// Sleeps until `until_ns` of CLOCK_MONOTONIC (`None`: without end), or until something happened since `event` was read. May wake early.
    ///
    /// An absolute futex timeout runs on the same high-resolution timer as `clock_nanosleep(TIMER_ABSTIME)`.
    pub(crate) fn sleep(&self, event: u32, until_ns: Option<u64>) {
        let timeout = until_ns.map(|ns| Timespec {
            tv_sec: i64::try_from(ns / 1_000_000_000).unwrap_or(i64::MAX),
            tv_nsec: (ns % 1_000_000_000) as i64,
        });
        // Timeout, wake, a changed word and a signal all mean the same: look again.
        let _ = futex::wait_bitset(&self.0.events, futex::Flags::PRIVATE, event, timeout.as_ref(), NonZeroU32::MAX);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::clock::monotonic_now_ns;

    #[test]
    fn a_request_ends_a_sleep() {
        let stop = StopHandle::new();
        let event = stop.event();
        let other = stop.clone();
        let thread = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(20));
            other.request();
        });
        let start_ns = monotonic_now_ns();
        while !stop.requested() {
            stop.sleep(event, None);
        }
        assert!(monotonic_now_ns() - start_ns >= 15_000_000);
        thread.join().unwrap();
        stop.sleep(event, None);
        stop.clear();
        assert!(!stop.requested());
    }
}
