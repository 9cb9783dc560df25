//! Watchdogs and stop requests: a monitor thread that ends a task that is still running.
//!
//! The scan thread publishes the deadline of the cycle it starts as one word and takes it back with one atomic exchange; it makes no
//! system call and wakes nobody. The monitor sleeps until the deadline that it sees armed. A deadline armed later can not come before the shortest
//! watchdog time from now, so that is how long the monitor may sleep at most: it never misses one, and is never early or late by a raster.
//!
//! No false trips: the monitor first exchanges *this* deadline for *expired*, which fails when the cycle ended meanwhile, and only then sets
//! the cell; the scan thread that finds *expired* waits for the cell, so nothing of one cycle reaches the next.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

use khz_machine::engine::DeadlineCell;
use khz_machine::trap::TrapCode;

use crate::clock::monotonic_now_ns;
use crate::host::{self, Lift};
use crate::stop::StopHandle;
use crate::time::DurationNs;

/// No cycle is under a deadline.
const IDLE: u64 = 0;
/// The monitor has seen the deadline pass.
const EXPIRED: u64 = 1;
/// From the first stop request until a running task is ended.
const STOP_GRACE_NS: u64 = 1_000_000_000;
/// The monitor does not look more often than this; a shorter watchdog may be late by as much.
const MIN_LOOK_NS: u64 = 50_000;

/// What scan thread and monitor share. On cache lines of its own: the scan thread writes it in each cycle.
#[derive(Debug)]
#[repr(align(128))]
pub struct Guard {
    /// [`IDLE`], [`EXPIRED`], or the deadline in nanoseconds of CLOCK_MONOTONIC.
    armed: AtomicU64,
    cell: Arc<DeadlineCell>,
    stop: StopHandle,
    /// Shortest deadline that may be armed; 0: none ever is.
    shortest_ns: u64,
    shutdown: AtomicBool,
    lift: Lift,
}

impl Guard {
    /// A guard whose deadlines are at least `shortest` ahead when armed; zero: none will be armed.
    #[must_use]
    pub fn new(stop: StopHandle, shortest: DurationNs) -> Arc<Self> {
        Arc::new(Guard {
            armed: AtomicU64::new(IDLE),
            cell: DeadlineCell::new(),
            stop,
            shortest_ns: shortest.0,
            shutdown: AtomicBool::new(false),
            lift: Lift::default(),
        })
    }

    /// The cell that running code looks at.
    #[must_use]
    pub fn cell(&self) -> &DeadlineCell {
        &self.cell
    }

    /// The stop requests it carries out.
    #[must_use]
    pub fn stop(&self) -> &StopHandle {
        &self.stop
    }

    /// Puts what runs next under a deadline, in nanoseconds of CLOCK_MONOTONIC; `u64::MAX` never comes.
    #[inline]
    pub fn arm(&self, deadline_ns: u64) {
        self.armed.store(deadline_ns.max(EXPIRED + 1), Ordering::Release);
    }

    /// Takes the deadline back. True when it had passed; the cell is then expired.
    #[inline]
    pub fn disarm(&self) -> bool {
        if self.armed.swap(IDLE, Ordering::AcqRel) != EXPIRED {
            return false;
        }
        // The monitor stands between its two steps at most.
        while self.cell.expired().is_none() {
            std::thread::yield_now();
        }
        true
    }

    /// The calling thread runs rounds from now on, until [`Guard::end_run`].
    pub fn begin_run(&self) {
        self.lift.begin();
    }

    /// The calling thread has ended its run.
    pub fn end_run(&self) {
        self.lift.end();
    }

    /// Lets code run again after a fault or a stop.
    pub fn clear(&self) {
        self.disarm();
        self.cell.clear();
    }

    /// Looks once at the time `now_ns`. Returns until when to sleep; `None`: until something happens.
    fn look(&self, now_ns: u64, first_request_ns: &mut Option<u64>) -> Option<u64> {
        let stop_ns = self.look_at_stop(now_ns, first_request_ns);
        let watchdog_ns = (self.shortest_ns != 0).then(|| self.look_at_deadline(now_ns));
        match (stop_ns, watchdog_ns) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    fn look_at_deadline(&self, now_ns: u64) -> u64 {
        let latest = now_ns.saturating_add(self.shortest_ns.max(MIN_LOOK_NS));
        let armed = self.armed.load(Ordering::Acquire);
        if armed <= EXPIRED {
            return latest;
        }
        if armed > now_ns {
            return armed.min(latest);
        }
        if self.armed.compare_exchange(armed, EXPIRED, Ordering::AcqRel, Ordering::Relaxed).is_ok() {
            // Lifted first: once the cell is set, the scan thread may be past the end of its run.
            self.lift.lift();
            self.cell.expire(TrapCode::Watchdog);
        }
        latest
    }

    fn look_at_stop(&self, now_ns: u64, first_request_ns: &mut Option<u64>) -> Option<u64> {
        let requests = self.stop.requests();
        if requests == 0 {
            *first_request_ns = None;
            return None;
        }
        let end_ns = first_request_ns.get_or_insert(now_ns).saturating_add(STOP_GRACE_NS);
        if requests == 1 && now_ns < end_ns {
            return Some(end_ns);
        }
        self.lift.lift();
        self.cell.expire(TrapCode::Stopped);
        None
    }
}

/// The monitor thread of one resource; ends when dropped.
#[derive(Debug)]
pub struct Monitor {
    guard: Arc<Guard>,
    thread: Option<JoinHandle<()>>,
}

impl Monitor {
    /// Starts it, one step above `scan_priority` where the scan thread has a real-time priority, and as high as the host lets it otherwise.
    ///
    /// # Errors
    /// When the host gives no thread.
    pub fn start(guard: Arc<Guard>, scan_priority: Option<u8>) -> io::Result<Self> {
        let shared = Arc::clone(&guard);
        let thread =
            std::thread::Builder::new().name("khz-monitor".to_owned()).stack_size(256 << 10).spawn(move || {
                host::prepare_monitor_thread(scan_priority);
                let mut first_request_ns = None;
                loop {
                    let event = shared.stop.event();
                    if shared.shutdown.load(Ordering::Acquire) {
                        return;
                    }
                    let until_ns = shared.look(monotonic_now_ns(), &mut first_request_ns);
                    shared.stop.sleep(event, until_ns);
                }
            })?;
        Ok(Monitor { guard, thread: Some(thread) })
    }
}

impl Drop for Monitor {
    fn drop(&mut self) {
        self.guard.shutdown.store(true, Ordering::Release);
        self.guard.stop.notify();
        if let Some(thread) = self.thread.take() {
            // A panic there has been printed; there is nothing to add while dropping.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard(shortest: u64) -> Arc<Guard> {
        Guard::new(StopHandle::new(), DurationNs(shortest))
    }

    #[test]
    fn it_sleeps_until_the_armed_deadline_but_not_past_a_possible_one() {
        let guard = guard(1_000_000);
        let look = |now| guard.look(now, &mut None);
        assert_eq!(look(5), Some(1_000_005), "idle");
        guard.arm(600_000);
        assert_eq!(look(5), Some(600_000));
        guard.arm(9_000_000);
        assert_eq!(look(5), Some(1_000_005), "the next cycle may have a shorter one");
        assert!(guard.cell().expired().is_none());
        assert!(!guard.disarm());
    }

    #[test]
    fn a_passed_deadline_expires_the_cell_once() {
        let guard = guard(1_000_000);
        guard.arm(100);
        guard.look(100, &mut None);
        assert_eq!(guard.cell().expired(), Some(TrapCode::Watchdog));
        assert!(guard.disarm());
        guard.clear();
        guard.look(200, &mut None);
        assert_eq!(guard.cell().expired(), None, "an ended cycle has no deadline");
        guard.arm(u64::MAX);
        guard.look(u64::MAX - 1, &mut None);
        assert_eq!(guard.cell().expired(), None);
    }

    #[test]
    fn one_request_has_a_second_of_grace_and_two_have_none() {
        let guard = guard(0);
        let mut first = None;
        assert_eq!(guard.look(10, &mut first), None, "without watchdogs it sleeps until something happens");
        guard.stop().request();
        assert_eq!(guard.look(20, &mut first), Some(20 + STOP_GRACE_NS));
        assert_eq!(guard.look(30, &mut first), Some(20 + STOP_GRACE_NS));
        assert_eq!(guard.cell().expired(), None);
        guard.look(20 + STOP_GRACE_NS, &mut first);
        assert_eq!(guard.cell().expired(), Some(TrapCode::Stopped));
        guard.clear();
        guard.stop().clear();
        guard.look(40, &mut first);
        guard.stop().request();
        guard.stop().request();
        guard.look(50, &mut first);
        assert_eq!(guard.cell().expired(), Some(TrapCode::Stopped));
    }

    #[test]
    fn no_expiry_leaks_into_the_next_cycle() {
        let guard = guard(MIN_LOOK_NS);
        let monitor = Monitor::start(Arc::clone(&guard), None).unwrap();
        for round in 0..2_000 {
            let deadline_ns = monotonic_now_ns() + MIN_LOOK_NS + 10_000;
            guard.arm(deadline_ns);
            // The cycle ends around its deadline, so that its end races with the monitor.
            while monotonic_now_ns() < deadline_ns + round {
                std::hint::spin_loop();
            }
            if guard.disarm() {
                assert_eq!(guard.cell().expired(), Some(TrapCode::Watchdog), "the cell follows before the next cycle");
                guard.clear();
            }
            // How many expire depends on the host; that nothing leaks does not.
            assert_eq!(guard.cell().expired(), None);
        }
        drop(monitor);
    }
}
