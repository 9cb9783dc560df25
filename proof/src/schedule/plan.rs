//! What a configuration is made of. Everything that runs is in a plan, so a plan alone can be shrunk and printed.

/// Which notation the configuration is written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Structured Text with a CONFIGURATION.
    Text,
    /// Programs alone: the front end makes the configuration (one task of 10 ms, priority 0, instances in source order).
    BareText,
    /// Assembly of a container, which can say more: disabled tasks, an init function, triggers in the data region.
    Assembly,
}

/// How time passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Time {
    /// The scheduler's own virtual clock: execution takes no time, watchdogs are fuel.
    Virtual,
    /// Execution takes time, watchdogs are fuel.
    MovingWithFuel,
    /// Execution takes time, watchdogs are deadlines: real time in all but that the world makes it.
    MovingWithDeadlines,
}

/// One of the process images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Area {
    /// %I.
    Input,
    /// %Q.
    Output,
    /// %M.
    Memory,
}

/// One bit of a process image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Bit {
    /// Which image.
    pub area: Area,
    /// Byte in it.
    pub byte: u32,
    /// Bit of the byte, 0 to 7.
    pub bit: u8,
}

impl Bit {
    /// Its address as Structured Text writes it.
    #[must_use]
    pub fn address(self) -> String {
        let letter = match self.area {
            Area::Input => 'I',
            Area::Output => 'Q',
            Area::Memory => 'M',
        };
        format!("%{letter}X{}.{}", self.byte, self.bit)
    }
}

/// A BOOL that actions read and write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A global.
    Global(usize),
    /// The `flag` of the program's instance.
    Flag,
    /// Its input.
    Source,
    /// Its output.
    Sink,
    /// A bit.
    Bit(Bit),
}

/// Where a BOOL global lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Home {
    /// Wherever the front end puts it; in assembly a slot.
    Any,
    /// In the data region (assembly only).
    Data,
    /// It is a bit of %Q or %M (Structured Text only).
    At(Bit),
}

/// A counter that conditions look at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counter {
    /// Runs of the instance since the last reset.
    Runs,
    /// Its runs that a warm reset does not forget.
    Kept,
    /// Runs of all instances.
    Order,
    /// Starts, which a warm reset does not forget.
    Starts,
}

/// When something is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// The counter's remainder by `modulus` is `remainder`.
    Every(Counter, i64, i64),
    /// The counter has this value.
    Once(Counter, i64),
    /// A BOOL has this value.
    Is(Place, bool),
}

/// What a BOOL is set to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Value {
    /// A literal.
    Literal(bool),
    /// Whether a condition holds.
    Holds(Condition),
}

/// What is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deed {
    /// Sets a BOOL.
    Set(Place, Value),
    /// A loop of so many passes.
    Burn(i32),
    /// Divides by zero.
    Trap,
}

/// A step of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Action {
    /// Only then; `None`: always.
    pub when: Option<Condition>,
    /// What.
    pub deed: Deed,
}

/// Where a SINGLE comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Single {
    /// A global.
    Global(usize),
    /// The flag or the output of an instance.
    Instance(usize, Place),
    /// A bit.
    Bit(Bit),
    /// A literal.
    Literal(bool),
}

/// What follows an overrun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Policy {
    /// The first grid point after the end.
    Grid,
    /// At once.
    AtOnce,
    /// One interval after the end.
    Realign,
}

impl Policy {
    /// As the attribute and the assembly name it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Policy::Grid => "grid",
            Policy::AtOnce => "at-once",
            Policy::Realign => "realign",
        }
    }
}

/// What makes a task due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// On a grid, held off while its SINGLE is TRUE.
    Cyclic {
        /// Width of the grid in microseconds.
        interval_us: u64,
        /// Its first point in microseconds.
        phase_us: u64,
        /// What follows an overrun.
        policy: Policy,
        /// Holds it off.
        single: Option<Single>,
    },
    /// On a rising edge.
    Event(Single),
    /// In every round.
    Freewheeling,
}

/// A task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Task {
    /// What makes it due.
    pub trigger: Trigger,
    /// 0 is the highest.
    pub priority: u16,
    /// Whether it ever runs (assembly only).
    pub enabled: bool,
    /// Watchdog time in microseconds; 0: none of its own.
    pub watchdog_us: u64,
    /// Cycles over it that trip.
    pub sensitivity: u16,
}

impl Task {
    /// Its SINGLE.
    #[must_use]
    pub fn single(&self) -> Option<Single> {
        match self.trigger {
            Trigger::Cyclic { single, .. } => single,
            Trigger::Event(single) => Some(single),
            Trigger::Freewheeling => None,
        }
    }
}

/// A program instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Instance {
    /// Its program type.
    pub program: usize,
    /// Its task; `None`: it is written without WITH, so it runs in the freewheeling task that stands last in `tasks`.
    pub task: Option<usize>,
    /// The global or bit that its input is connected to.
    pub source: Option<Place>,
    /// The global or bit that its output is connected to.
    pub sink: Option<Place>,
}

/// From its time on a bit of %I has a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// When.
    pub time_us: u64,
    /// Which bit of %I.
    pub bit: Bit,
    /// Its value.
    pub value: bool,
}

/// What a host does. A command that the resource's state does not allow is left out: the types of a scheduler forbid it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Stopped to running.
    Start,
    /// Runs until so many rounds with tasks have run, or a stop was requested after so many rounds; stopped afterwards.
    Run {
        /// Rounds in which a task ran.
        scans: u64,
        /// Rounds after which a stop is requested.
        stop_after: u64,
    },
    /// So many rounds, each followed by its wait; running afterwards.
    Step(u64),
    /// Running to stopped.
    Stop,
    /// Puts back what a warm reset does.
    ResetWarm,
    /// A cold reset.
    ResetCold,
    /// An origin reset.
    ResetOrigin,
    /// Forgets the statistics.
    ClearStatistics,
    /// Writes a global.
    Force(usize, bool),
}

/// A configuration with its world and its host.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// Where it came from; also seeds the world.
    pub seed: u64,
    /// How it is written.
    pub form: Form,
    /// Tasks in declaration order.
    pub tasks: Vec<Task>,
    /// Program types.
    pub programs: Vec<Vec<Action>>,
    /// Program instances in declaration order.
    pub instances: Vec<Instance>,
    /// BOOL globals, `b0` and so on.
    pub globals: Vec<Home>,
    /// Runs at load and reset (assembly only).
    pub init: Option<Vec<Action>>,
    /// Runs at each start.
    pub startup: Option<Vec<Action>>,
    /// Input rows, ascending by time.
    pub rows: Vec<Row>,
    /// How time passes.
    pub time: Time,
    /// What the world's delays are picked from, in nanoseconds.
    pub delays_ns: Vec<u64>,
    /// How often a driver looks at the inputs, in nanoseconds; 0: it never says.
    pub input_poll_ns: u64,
    /// Watchdog of tasks that set none, and of init and startup function, in microseconds; 0: none, and 1 s for those two.
    pub watchdog_us: u64,
    /// What the host does.
    pub commands: Vec<Command>,
}

impl Plan {
    /// Every bit that something names, ascending.
    #[must_use]
    pub fn bits(&self) -> Vec<Bit> {
        let mut bits = Vec::new();
        let mut place = |place: Place| {
            if let Place::Bit(bit) = place {
                bits.push(bit);
            }
        };
        // A global at a bit makes the bit, even if nobody uses it.
        (0..self.globals.len()).filter_map(|global| self.located(global)).for_each(|bit| place(Place::Bit(bit)));
        let used = self.instances.iter().map(|instance| instance.program).collect::<Vec<_>>();
        let bodies = self.programs.iter().enumerate().filter(|(at, _)| used.contains(at)).map(|(_, body)| body);
        for action in bodies.chain(&self.init).chain(&self.startup).flatten() {
            if let Some(Condition::Is(found, _)) = action.when {
                place(found);
            }
            if let Deed::Set(target, value) = action.deed {
                place(target);
                if let Value::Holds(Condition::Is(found, _)) = value {
                    place(found);
                }
            }
        }
        self.instances.iter().flat_map(|instance| [instance.source, instance.sink]).flatten().for_each(&mut place);
        for task in &self.tasks {
            if let Some(Single::Bit(bit)) = task.single() {
                place(Place::Bit(bit));
            }
        }
        bits.sort_unstable();
        bits.dedup();
        bits
    }

    /// The bit that a global is, if it is one.
    #[must_use]
    pub fn located(&self, global: usize) -> Option<Bit> {
        match self.globals.get(global) {
            Some(Home::At(bit)) => Some(*bit),
            _ => None,
        }
    }

    /// Positions of a task's instances, in declaration order.
    #[must_use]
    pub fn instances_of(&self, task: usize) -> Vec<usize> {
        let last = self.tasks.len() - 1;
        let instances = self.instances.iter().enumerate();
        instances.filter(|(_, instance)| instance.task.unwrap_or(last) == task).map(|(at, _)| at).collect()
    }

    /// Whether some watchdog can end a task, or code runs before the first round: then code charges fuel where watchdogs are fuel.
    #[must_use]
    pub fn needs_fuel(&self) -> bool {
        let watched = self.watchdog_us > 0 || self.tasks.iter().any(|task| task.watchdog_us > 0);
        self.time != Time::MovingWithDeadlines && (watched || self.init.is_some() || self.startup.is_some())
    }
}
