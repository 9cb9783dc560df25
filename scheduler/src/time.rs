//! Times and durations. Everything inside is nanoseconds; tables and scripts speak microseconds.

use std::fmt;

/// A point in time: nanoseconds since the resource started. Lasts 584 years; arithmetic saturates at [`TimeNs::NEVER`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct TimeNs(pub u64);

/// A length of time in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct DurationNs(pub u64);

impl TimeNs {
    /// When the resource starts.
    pub const ZERO: TimeNs = TimeNs(0);
    /// Later than anything that happens.
    pub const NEVER: TimeNs = TimeNs(u64::MAX);

    /// A time given in microseconds.
    #[must_use]
    pub fn from_us(us: u64) -> Self {
        TimeNs(us.saturating_mul(1000))
    }

    /// Whole microseconds.
    #[must_use]
    pub fn as_us(self) -> u64 {
        self.0 / 1000
    }

    /// This time and `duration` more.
    #[must_use]
    pub fn after(self, duration: DurationNs) -> Self {
        TimeNs(self.0.saturating_add(duration.0))
    }

    /// How long after `earlier` this is; zero when it is not after it.
    #[must_use]
    pub fn since(self, earlier: TimeNs) -> DurationNs {
        DurationNs(self.0.saturating_sub(earlier.0))
    }
}

impl DurationNs {
    /// One microsecond.
    pub const MICROSECOND: DurationNs = DurationNs(1_000);
    /// One millisecond.
    pub const MILLISECOND: DurationNs = DurationNs(1_000_000);

    /// A duration given in microseconds.
    #[must_use]
    pub fn from_us(us: u64) -> Self {
        DurationNs(us.saturating_mul(1000))
    }

    /// So many times as long.
    #[must_use]
    pub fn times(self, factor: u64) -> Self {
        DurationNs(self.0.saturating_mul(factor))
    }
}

impl fmt::Display for TimeNs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:03} µs", self.0 / 1000, self.0 % 1000)
    }
}
