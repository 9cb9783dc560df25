//! Real time.

use rustix::time::{ClockId, clock_gettime};

use super::{Clock, ClockKind};
use crate::stop::StopHandle;
use crate::time::{DurationNs, TimeNs};
use crate::wake::Wake;

/// CLOCK_MONOTONIC in nanoseconds.
#[must_use]
pub fn monotonic_now_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    // Both parts are never negative on this clock.
    now.tv_sec.unsigned_abs().wrapping_mul(1_000_000_000).wrapping_add(now.tv_nsec.unsigned_abs())
}

/// CLOCK_MONOTONIC, shifted so that 0 is the resource's start; sleeps are absolute, so that lateness never adds up.
#[derive(Debug, Clone, Copy)]
pub struct MonotonicClock {
    /// CLOCK_MONOTONIC at time 0. Wraps below zero when time 0 lies before the machine's start.
    origin_ns: u64,
    spin: DurationNs,
}

impl MonotonicClock {
    /// A clock that starts now and spins for the last `spin` of each sleep, which buys start jitter with processor time.
    #[must_use]
    pub fn new(spin: DurationNs) -> Self {
        MonotonicClock { origin_ns: monotonic_now_ns(), spin }
    }

    fn sleep_until(&self, time: TimeNs, stop: &StopHandle) {
        let target_ns = self.origin_ns.wrapping_add(time.0);
        loop {
            let event = stop.event();
            let now = self.now();
            if stop.requested() || now >= time {
                return;
            }
            if time.since(now) <= self.spin {
                std::hint::spin_loop();
            } else {
                stop.sleep(event, Some(target_ns.saturating_sub(self.spin.0)));
            }
        }
    }
}

impl Clock for MonotonicClock {
    fn kind(&self) -> ClockKind {
        ClockKind::Real
    }

    fn start_at(&mut self, time: TimeNs) {
        self.origin_ns = monotonic_now_ns().wrapping_sub(time.0);
    }

    fn now(&self) -> TimeNs {
        TimeNs(monotonic_now_ns().wrapping_sub(self.origin_ns))
    }

    fn wait(&mut self, wake: Wake, stop: &StopHandle) {
        match wake {
            Wake::At { time, freewheeling: false } => self.sleep_until(time, stop),
            Wake::At { freewheeling: true, .. } | Wake::EdgePending | Wake::Freewheel | Wake::Never => {}
        }
    }

    fn monotonic_ns(&self, time: TimeNs) -> Option<u64> {
        // A deadline beyond the end of the counter never comes.
        Some(if time == TimeNs::NEVER { u64::MAX } else { self.origin_ns.wrapping_add(time.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_sleeps_until_the_time_and_not_less() {
        let stop = StopHandle::new();
        for spin in [DurationNs(0), DurationNs(200_000)] {
            let mut clock = MonotonicClock::new(spin);
            clock.start_at(TimeNs::ZERO);
            for step in 1..=5 {
                let time = TimeNs(step * 2_000_000);
                clock.wait(Wake::At { time, freewheeling: false }, &stop);
                assert!(clock.now() >= time);
            }
            clock.start_at(TimeNs(7));
            assert!(clock.now() >= TimeNs(7) && clock.now() < TimeNs(1_000_000_000));
        }
    }

    #[test]
    fn a_stop_request_ends_a_sleep() {
        let stop = StopHandle::new();
        stop.request();
        let mut clock = MonotonicClock::new(DurationNs(0));
        clock.wait(Wake::At { time: TimeNs::from_us(3_600_000_000), freewheeling: false }, &stop);
        assert!(clock.now() < TimeNs::from_us(60_000_000));
    }
}
