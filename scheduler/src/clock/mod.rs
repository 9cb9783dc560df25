//! Clocks: the one thing a run's decisions depend on that is not in its inputs.

mod monotonic;
mod virtual_clock;

pub use monotonic::{MonotonicClock, monotonic_now_ns};
pub use virtual_clock::VirtualClock;

use crate::stop::StopHandle;
use crate::time::TimeNs;
use crate::wake::Wake;

/// Which kind of time a clock gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockKind {
    /// Execution takes time; watchdogs are deadlines.
    Real,
    /// Execution takes none; watchdogs are fuel.
    Virtual,
}

impl ClockKind {
    /// Its name on the command line: `real` or `virtual`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            ClockKind::Real => "real",
            ClockKind::Virtual => "virtual",
        }
    }
}

/// A resource's time: nanoseconds since it started, standing still while it is stopped.
pub trait Clock: Send {
    /// Real or virtual.
    fn kind(&self) -> ClockKind;

    /// Makes it `time` now.
    fn start_at(&mut self, time: TimeNs);

    /// The time.
    fn now(&self) -> TimeNs;

    /// Passes the time until `wake`; a stop request ends it early. Returns at once for [`Wake::Never`].
    fn wait(&mut self, wake: Wake, stop: &StopHandle);

    /// A resource's time as nanoseconds of CLOCK_MONOTONIC, for arming a deadline. `None` on a clock whose watchdogs are fuel.
    fn monotonic_ns(&self, time: TimeNs) -> Option<u64>;
}
