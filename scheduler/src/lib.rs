//! # khz-scheduler: when which task runs, for how long it may, and what it took
//!
//! One resource is one cooperative loop of *rounds* (architecture §8): read the clock, freeze inputs, write the up-time variables, sample
//! SINGLE sources, select the due tasks, run them by priority and then declaration order, flush outputs. This crate is that loop and
//! everything around it; it knows engines only as [`khz_machine::engine::Engine`].
//!
//! **Decisions are pure.** [`select`], [`grid`] and [`wake`] are functions over task states, a time and sampled values: no clock, no
//! memory, no thread. So every rule has a test that needs none of them, and a brute-force model can be held against them.
//! **Time is injected.** [`clock::MonotonicClock`] runs in real time, [`clock::VirtualClock`] makes a run reproducible: there,
//! execution takes no time and a watchdog is fuel (1 unit = 1 ns).
//!
//! **States are types.** [`Resource<Stopped>`](resource::Resource) has no `run_round`; a trap turns `Resource<Running>` into
//! `Resource<Faulted>`, from where only a reset leads on. Outputs of an abandoned round are not flushed.
//!
//! **A deadline ends what still runs.** A monitor thread ([`watchdog`]) expires the cell that running code looks at. Arming it costs
//! the scan thread two atomic operations and no system call; the monitor sleeps until the armed deadline itself, not on a raster.
//! The same thread carries out stop requests ([`stop`]), so that an endless loop without a watchdog can be ended too.
//!
//! A scan allocates nothing, takes no lock and makes no system call but the clock's; a test with a counting allocator holds this.
//! Linux only: sleeping and waking are futexes, so that a stop request ends every sleep at once. `unsafe` stands in `host.rs` alone.

pub mod clock;
pub mod grid;
pub mod hooks;
mod host;
pub mod report;
pub mod resource;
pub mod run;
pub mod select;
pub mod single;
pub mod statistics;
pub mod stop;
pub mod task;
pub mod time;
pub mod wake;
pub mod watchdog;

pub use clock::{Clock, ClockKind, MonotonicClock, VirtualClock};
pub use hooks::{Hooks, InputSource, IoDriver, NoInputs, NoIo, NoObserver, Observer};
pub use host::{HostFeature, HostOptions, HostRefusal, HostReport, on_scan_thread, stop_on_signals};
pub use report::{FaultPlace, FaultReport};
pub use resource::{Faulted, HoldsContainer, LoadError, LoadOptions, ResetKind, Resource, Round, Running, Stopped};
pub use run::{RunOptions, RunOutcome, run};
pub use statistics::{StatisticsReport, TaskReport};
pub use stop::StopHandle;
pub use task::{TaskIndex, TaskSet};
pub use time::TimeNs;
pub use wake::Wake;
