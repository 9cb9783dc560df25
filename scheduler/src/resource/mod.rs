//! A resource and its life: states are types, so that a stopped or faulted one has no `run_round`.
//!
//! ```text
//! load ──▶ Stopped ──start──▶ Running ──run_round──▶ Running …
//!             ▲  ▲               │  │
//!             │  └─────stop──────┘  └──trap──▶ Faulted
//!             └──────────reset (warm, cold, origin)──┘
//! ```
//! Loading runs the init function, starting runs the startup function, each under a watchdog; a trap in them faults the resource too.
//! Time stands still while it is stopped: a later start goes on where the stop was; a reset begins at 0 again.

mod bench;
mod core;
mod cycle;
mod round;

use std::io;
use std::sync::Arc;

use khz_bytecode::container::Container;
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_bytecode::verify::Verified;
use khz_machine::engine::Engine;
use khz_machine::image::{Image, ImageTooLarge};

use self::core::Core;
pub use self::round::Round;
use crate::clock::Clock;
use crate::hooks::Hooks;
use crate::report::FaultReport;
use crate::statistics::StatisticsReport;
use crate::stop::StopHandle;
use crate::task::{TaskIndex, TaskSet};
use crate::time::TimeNs;
use crate::wake::Wake;
use crate::watchdog::Guard;

/// Owner of a container: a verified one, or a bare one in tests. The scheduler reads tables only and checks every index it takes
/// from them; code it gives to engines, which accept nothing but [`Verified`].
pub trait HoldsContainer: Send + Sync {
    /// The container.
    fn container(&self) -> &Container;
}

impl HoldsContainer for Verified {
    fn container(&self) -> &Container {
        Verified::container(self)
    }
}

impl HoldsContainer for Container {
    fn container(&self) -> &Container {
        self
    }
}

/// How to load a resource.
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// Cap of the memory image in bytes.
    pub max_image_bytes: u64,
    /// Watchdog in microseconds for tasks that set none, and for init and startup function; 0: none, and 1 s for those two.
    pub watchdog_us: u64,
    /// Where stop requests come from. `None`: nothing stops a run from outside, and on the virtual clock there is no monitor thread.
    pub stop: Option<StopHandle>,
    /// SCHED_FIFO priority of the scan thread, so that the monitor can be above it.
    pub real_time_priority: Option<u8>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        LoadOptions { max_image_bytes: MAX_IMAGE_BYTES, watchdog_us: 0, stop: None, real_time_priority: None }
    }
}

/// Why a resource could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Its image is larger than it may be.
    #[error(transparent)]
    Image(#[from] ImageTooLarge),
    /// No thread for the monitor.
    #[error("the host gave no thread for the watchdog: {0}")]
    Monitor(#[source] io::Error),
    /// The init function trapped. The resource is there for dumps and a reset.
    #[error("the initialisation trapped: {}", .0.report().trap.code)]
    Faulted(Box<Resource<Faulted>>),
}

/// What a reset puts back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResetKind {
    /// Everything but retained variables.
    Warm,
    /// Everything.
    Cold,
    /// Everything, and the statistics: as if just loaded.
    Origin,
}

/// Loaded and initialised, not running.
#[derive(Debug)]
pub struct Stopped(());

/// Running rounds.
#[derive(Debug)]
pub struct Running(());

/// Ended by a trap; outputs hold their last flushed values.
#[derive(Debug)]
pub struct Faulted {
    report: Box<FaultReport>,
}

/// One resource in state `S`.
#[derive(Debug)]
pub struct Resource<S> {
    core: Box<Core>,
    state: S,
}

impl<S> Resource<S> {
    /// Its memory. Between rounds it is a snapshot of a round's end.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.core.image
    }

    /// Its tasks.
    #[must_use]
    pub fn tasks(&self) -> &TaskSet {
        &self.core.tasks
    }

    /// Its container.
    #[must_use]
    pub fn container(&self) -> &Container {
        self.core.program.container()
    }

    /// Time of the last round.
    #[must_use]
    pub fn time(&self) -> TimeNs {
        self.core.time
    }

    /// Rounds that ended since the last reset.
    #[must_use]
    pub fn rounds(&self) -> u64 {
        self.core.rounds
    }

    /// The engine, for reports.
    #[must_use]
    pub fn engine(&self) -> &dyn Engine {
        &*self.core.engine
    }

    /// Figures of all tasks since load, the last origin reset, or [`Resource::clear_statistics`]. They outlive stops, faults, warm and cold resets.
    #[must_use]
    pub fn statistics(&self) -> StatisticsReport {
        self.core.statistics_report()
    }

    /// Begins the figures anew.
    pub fn clear_statistics(&mut self) {
        self.core.clear_statistics();
    }

    /// What the monitor watches it through.
    pub(crate) fn guard(&self) -> Arc<Guard> {
        Arc::clone(&self.core.guard)
    }

    fn faulted(core: Box<Core>, report: Box<FaultReport>) -> Resource<Faulted> {
        Resource { core, state: Faulted { report } }
    }

    fn reset_from(self, kind: ResetKind) -> Result<Resource<Stopped>, Resource<Faulted>> {
        let mut core = self.core;
        match core.reset(kind) {
            Ok(()) => Ok(Resource { core, state: Stopped(()) }),
            Err(report) => Err(Self::faulted(core, report)),
        }
    }
}

impl Resource<Stopped> {
    /// Makes the image, with initial values, and runs the init function.
    ///
    /// # Errors
    /// An image too large, no monitor thread, a trap.
    pub fn load(
        program: Arc<dyn HoldsContainer>,
        engine: Box<dyn Engine>,
        clock: Box<dyn Clock>,
        options: &LoadOptions,
    ) -> Result<Self, LoadError> {
        let mut core = Box::new(Core::new(program, engine, clock, options)?);
        match core.initialise() {
            Ok(()) => Ok(Resource { core, state: Stopped(()) }),
            Err(report) => Err(LoadError::Faulted(Box::new(Self::faulted(core, report)))),
        }
    }

    /// Its memory, to set values before it runs.
    pub fn image_mut(&mut self) -> &mut Image {
        &mut self.core.image
    }

    /// Runs the startup function and goes on at the time at which it was stopped, or at 0.
    ///
    /// # Errors
    /// The faulted resource when the startup function trapped.
    pub fn start(self) -> Result<Resource<Running>, Resource<Faulted>> {
        let mut core = self.core;
        match core.start() {
            Ok(()) => Ok(Resource { core, state: Running(()) }),
            Err(report) => Err(Self::faulted(core, report)),
        }
    }

    /// Puts memory and time back and runs the init function.
    ///
    /// # Errors
    /// The faulted resource when the init function trapped.
    pub fn reset(self, kind: ResetKind) -> Result<Resource<Stopped>, Resource<Faulted>> {
        self.reset_from(kind)
    }
}

impl Resource<Running> {
    /// Runs one round at the clock's time (architecture §8).
    ///
    /// # Errors
    /// The faulted resource when a task trapped: its cycle and the round are abandoned, outputs are not flushed.
    pub fn run_round(mut self, hooks: &mut Hooks<'_>) -> Result<(Self, Round), Resource<Faulted>> {
        match self.core.run_round(hooks) {
            Ok(round) => Ok((self, round)),
            Err(report) => Err(Self::faulted(self.core, report)),
        }
    }

    /// When the next round can have something to do, after a round.
    pub fn next_wake(&mut self, hooks: &mut Hooks<'_>) -> Wake {
        self.core.next_wake(hooks)
    }

    /// Passes the time until then; a stop request ends it early.
    pub fn wait(&mut self, wake: Wake) {
        self.core.wait(wake);
    }

    /// Whether a stop was requested.
    #[must_use]
    pub fn stop_requested(&self) -> bool {
        self.core.guard.stop().requested()
    }

    /// Its memory, for forcing values between rounds.
    pub fn image_mut(&mut self) -> &mut Image {
        &mut self.core.image
    }

    /// Ends running. Memory, time and due times stay as they are.
    #[must_use]
    pub fn stop(self) -> Resource<Stopped> {
        let mut core = self.core;
        core.pause();
        Resource { core, state: Stopped(()) }
    }

    /// Runs `cycles` cycles of one task and measures them: returns the nanoseconds of all of them together.
    ///
    /// A cycle is arming the deadline, the task's instances, taking the deadline back. Selection, I/O and clock are left out; before each
    /// cycle the up-time variables move on by the task's interval (1 ms where it has none), so that timers run.
    ///
    /// # Errors
    /// The faulted resource when the task trapped.
    pub fn bench_batch(mut self, task: TaskIndex, cycles: u64) -> Result<(Self, u64), Resource<Faulted>> {
        match self.core.bench_batch(task, cycles) {
            Ok(elapsed_ns) => Ok((self, elapsed_ns)),
            Err(report) => Err(Self::faulted(self.core, report)),
        }
    }
}

impl Resource<Faulted> {
    /// What happened.
    #[must_use]
    pub fn report(&self) -> &FaultReport {
        &self.state.report
    }

    /// The only way on: puts memory and time back and runs the init function.
    ///
    /// # Errors
    /// The faulted resource when the init function trapped.
    pub fn reset(self, kind: ResetKind) -> Result<Resource<Stopped>, Resource<Faulted>> {
        self.reset_from(kind)
    }
}
