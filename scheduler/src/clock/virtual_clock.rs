//! Virtual time: a run depends on its inputs alone.

use super::{Clock, ClockKind};
use crate::stop::StopHandle;
use crate::time::{DurationNs, TimeNs};
use crate::wake::Wake;

/// Execution takes no time; time moves on between rounds only (architecture §8).
#[derive(Debug, Clone, Copy, Default)]
pub struct VirtualClock {
    now: TimeNs,
}

impl VirtualClock {
    /// A clock at time 0.
    #[must_use]
    pub fn new() -> Self {
        VirtualClock::default()
    }
}

impl Clock for VirtualClock {
    fn kind(&self) -> ClockKind {
        ClockKind::Virtual
    }

    fn start_at(&mut self, time: TimeNs) {
        self.now = time;
    }

    fn now(&self) -> TimeNs {
        self.now
    }

    fn wait(&mut self, wake: Wake, _stop: &StopHandle) {
        self.now = match wake {
            Wake::EdgePending => self.now.after(DurationNs::MICROSECOND),
            // Time always moves: an input source that stays in the past can not hold it.
            Wake::At { time, .. } => time.max(self.now.after(DurationNs::MICROSECOND)),
            Wake::Freewheel => self.now.after(DurationNs::MILLISECOND),
            Wake::Never => self.now,
        };
    }

    fn monotonic_ns(&self, _time: TimeNs) -> Option<u64> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_moves_on_as_the_rules_say() {
        let stop = StopHandle::new();
        let mut clock = VirtualClock::new();
        let mut times = Vec::new();
        let at = |us| Wake::At { time: TimeNs::from_us(us), freewheeling: true };
        for wake in [Wake::EdgePending, at(10_000), Wake::Freewheel, at(3), Wake::Never] {
            clock.wait(wake, &stop);
            times.push(clock.now().as_us());
        }
        assert_eq!(times, [1, 10_000, 11_000, 11_001, 11_001]);
    }
}
