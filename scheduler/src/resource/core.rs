//! What a resource is in every state, and the transitions between them.

use std::fmt;
use std::sync::Arc;

use khz_bytecode::container::{RetainRange, SystemVariable, SystemVariableKind};
use khz_bytecode::ids::FunctionId;
use khz_bytecode::limits::{SLOT_BYTES, STARTUP_WATCHDOG_US};
use khz_machine::engine::{Engine, Entry, Fuel, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::trap::{CodePlace, Trap, TrapCode};

use super::cycle::Watch;
use super::{HoldsContainer, LoadError, LoadOptions, ResetKind};
use crate::clock::{Clock, ClockKind};
use crate::report::{FaultPlace, FaultReport};
use crate::single::SingleTable;
use crate::statistics::{StatisticsReport, TaskStatistics};
use crate::task::{TaskIndex, TaskSet};
use crate::time::{DurationNs, TimeNs};
use crate::watchdog::{Guard, Monitor};

/// Everything of a resource. All buffers have their final size after load.
pub(super) struct Core {
    pub program: Arc<dyn HoldsContainer>,
    pub engine: Box<dyn Engine>,
    pub clock: Box<dyn Clock>,
    pub image: Image,
    pub tasks: TaskSet,
    /// One for each task.
    pub watches: Vec<Watch>,
    pub singles: SingleTable,
    /// Values of the SINGLE sources as this round sampled them, one for each task.
    pub samples: Vec<bool>,
    /// The same after the round.
    pub samples_after: Vec<bool>,
    /// Tasks of this round, in order.
    pub ready: Vec<TaskIndex>,
    pub statistics: Vec<TaskStatistics>,
    pub guard: Arc<Guard>,
    /// Time of the last round.
    pub time: TimeNs,
    /// Time at which it was stopped, and at which a start goes on.
    paused: TimeNs,
    pub rounds: u64,
    pub rounds_with_tasks: u64,
    /// Image offsets of the up-time slots.
    up_times: Vec<(SystemVariableKind, usize)>,
    /// Watchdog of init and startup function.
    startup_watchdog: DurationNs,
    /// Ends when the resource does.
    _monitor: Option<Monitor>,
}

impl fmt::Debug for Core {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Core")
            .field("engine", &self.engine.name())
            .field("clock", &self.clock.kind())
            .field("time", &self.time)
            .field("rounds", &self.rounds)
            .finish_non_exhaustive()
    }
}

impl Core {
    pub fn new(
        program: Arc<dyn HoldsContainer>,
        engine: Box<dyn Engine>,
        clock: Box<dyn Clock>,
        options: &LoadOptions,
    ) -> Result<Self, LoadError> {
        let container = program.container();
        let image = Image::new(ImageLayout::new(container, options.max_image_bytes)?, container);
        let tasks = TaskSet::new(container);
        let default_watchdog = DurationNs::from_us(options.watchdog_us);
        let watches: Vec<Watch> = tasks.indices().map(|task| Watch::new(tasks.info(task), default_watchdog)).collect();
        let startup_watchdog = match default_watchdog {
            DurationNs(0) => DurationNs::from_us(STARTUP_WATCHDOG_US),
            given => given,
        };
        let once = container.parameters.init_function.or(container.parameters.startup_function);
        let limits = watches.iter().map(|watch| watch.limit).chain(once.map(|_| startup_watchdog));
        // On the virtual clock watchdogs are fuel, and no deadline is armed.
        let shortest = match clock.kind() {
            ClockKind::Real => limits.filter(|limit| limit.0 != 0).min().unwrap_or_default(),
            ClockKind::Virtual => DurationNs(0),
        };
        let guard = Guard::new(options.stop.clone().unwrap_or_default(), shortest);
        let monitor = if options.stop.is_some() || shortest.0 != 0 {
            Some(Monitor::start(Arc::clone(&guard), options.real_time_priority).map_err(LoadError::Monitor)?)
        } else {
            None
        };
        let up_times = up_time_places(&container.types.system_variables, image.layout());
        Ok(Core {
            watches,
            singles: SingleTable::new(&tasks, image.layout()),
            samples: vec![false; tasks.len()],
            samples_after: vec![false; tasks.len()],
            ready: Vec::with_capacity(tasks.len()),
            statistics: tasks.indices().map(TaskStatistics::new).collect(),
            tasks,
            image,
            guard,
            time: TimeNs::ZERO,
            paused: TimeNs::ZERO,
            rounds: 0,
            rounds_with_tasks: 0,
            up_times,
            startup_watchdog,
            _monitor: monitor,
            program,
            engine,
            clock,
        })
    }

    /// Runs the init function, if there is one.
    pub fn initialise(&mut self) -> Result<(), Box<FaultReport>> {
        match self.program.container().parameters.init_function {
            Some(function) => self.run_once(Entry::Init, function, FaultPlace::Init),
            None => Ok(()),
        }
    }

    /// Runs the startup function, if there is one, and lets time go on.
    pub fn start(&mut self) -> Result<(), Box<FaultReport>> {
        self.guard.clear();
        if let Some(function) = self.program.container().parameters.startup_function {
            self.run_once(Entry::Startup, function, FaultPlace::Startup)?;
        }
        self.clock.start_at(self.paused);
        Ok(())
    }

    /// Lets time stand still until the next start.
    pub fn pause(&mut self) {
        // Measured cycles move the time of the last round, not the clock.
        self.paused = self.clock.now().max(self.time);
    }

    /// Puts everything back to before the first round, then initialises.
    pub fn reset(&mut self, kind: ResetKind) -> Result<(), Box<FaultReport>> {
        let program = Arc::clone(&self.program);
        let container = program.container();
        let retained: &[RetainRange] = if kind == ResetKind::Warm { &container.types.retain } else { &[] };
        let kept: Vec<Vec<u8>> = retained.iter().map(|range| self.retained_bytes(range).to_vec()).collect();
        self.guard.clear();
        self.image.reset(container);
        self.tasks.reset();
        self.samples.fill(false);
        for watch in &mut self.watches {
            watch.late_cycles = 0;
        }
        self.time = TimeNs::ZERO;
        self.paused = TimeNs::ZERO;
        self.rounds = 0;
        self.rounds_with_tasks = 0;
        if kind == ResetKind::Origin {
            self.clear_statistics();
        }
        self.initialise()?;
        // After the init function, which writes initial values over retained ones.
        for (range, bytes) in retained.iter().zip(&kept) {
            self.retained_bytes(range).copy_from_slice(bytes);
        }
        Ok(())
    }

    /// The bytes of a retained range; empty if it does not lie in its region, which the verifier excludes.
    fn retained_bytes(&mut self, range: &RetainRange) -> &mut [u8] {
        let region = self.image.layout().region(range.region);
        let start = region.start as usize + range.offset as usize;
        let end = start + range.bytes as usize;
        if end > region.end as usize {
            return &mut [];
        }
        self.image.bytes_mut().get_mut(start..end).unwrap_or_default()
    }

    /// Runs init or startup function, which is `function`, under its watchdog.
    fn run_once(&mut self, entry: Entry, function: FunctionId, place: FaultPlace) -> Result<(), Box<FaultReport>> {
        let limit = self.startup_watchdog;
        // Time stands still; this is for the deadline alone.
        self.clock.start_at(self.paused);
        let mut fuel = Fuel { left: limit.0 };
        let end = self.paused.after(limit);
        let deadline = self.clock.monotonic_ns(end);
        if let Some(deadline_ns) = deadline {
            self.guard.arm(deadline_ns);
        }
        let limits = Limits {
            deadline: self.guard.cell(),
            fuel: if deadline.is_none() { Some(&mut fuel) } else { None },
            task_index: 0,
        };
        let mut outcome = self.engine.run(entry, &mut self.image, limits);
        let expired = self.guard.disarm();
        if outcome.is_ok() && (expired || (deadline.is_some() && self.clock.now() > end)) {
            // It ended by itself, but too late: no instruction is to blame more than another.
            outcome = Err(Trap::new(TrapCode::Watchdog, CodePlace { function, offset: 0 }, [0; 3]));
        }
        outcome.map_err(|trap| Box::new(FaultReport { place, trap, time: self.time, rounds: self.rounds }))
    }

    /// Writes the up-time variables for a round at `time`: signed nanoseconds, `__SYSTEM_UP_TIME` in whole milliseconds.
    pub fn write_up_times(&mut self, time: TimeNs) {
        for (kind, offset) in &self.up_times {
            let value = match kind {
                SystemVariableKind::UpTime => time.0 - time.0 % DurationNs::MILLISECOND.0,
                SystemVariableKind::UpLtime => time.0,
            };
            if let Some(slot) = self.image.bytes_mut().get_mut(*offset..*offset + SLOT_BYTES as usize) {
                slot.copy_from_slice(&value.to_le_bytes());
            }
        }
    }

    pub fn statistics_report(&self) -> StatisticsReport {
        let tasks = self.tasks.indices().zip(&self.statistics);
        StatisticsReport {
            clock: self.clock.kind(),
            engine: self.engine.name(),
            time: self.time,
            rounds: self.rounds,
            rounds_with_tasks: self.rounds_with_tasks,
            tasks: tasks.map(|(task, s)| s.report(task, self.tasks.state(task), self.tasks.info(task))).collect(),
        }
    }

    pub fn clear_statistics(&mut self) {
        for statistics in &mut self.statistics {
            statistics.clear();
        }
    }
}

fn up_time_places(variables: &[SystemVariable], layout: &ImageLayout) -> Vec<(SystemVariableKind, usize)> {
    let offset = |variable: &SystemVariable| layout.slots.start as usize + variable.slot.index() * SLOT_BYTES as usize;
    // Only slots: a wrong index must not reach another region.
    let inside = |offset: usize| offset + SLOT_BYTES as usize <= layout.slots.end as usize;
    variables.iter().map(|variable| (variable.kind, offset(variable))).filter(|(_, at)| inside(*at)).collect()
}
