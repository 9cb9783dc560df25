//! The one place of the command line that reads a clock for figures that are printed and never fed back.

use std::time::Instant;

/// Measures from its making on.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        #[expect(
            clippy::disallowed_methods,
            reason = "figures about the host: what a compilation or a batch of scans took"
        )]
        let now = Instant::now();
        Stopwatch(now)
    }

    /// Nanoseconds since the start.
    pub fn ns(self) -> u64 {
        u64::try_from(self.0.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }
}
