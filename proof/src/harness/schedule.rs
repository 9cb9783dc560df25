//! Plans of many tasks under the real scheduler, and the comparison with the model: what the scheduler's clock, drivers and engines see is
//! written down as the model's events.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::{Arc, Mutex, MutexGuard};

use crate::campaign;
use crate::oracle::Maker;
use crate::schedule::plan::{Command, Form, Plan, Time, Trigger};
use crate::schedule::trace::{
    Code, Ending, Event, Figures, Next, Observed, Run, State, Statistics, TaskFigures, Values, difference,
};
use crate::schedule::world::{Delay, World};
use crate::schedule::{assembly, generate, predict, shrink, text};
use khz_bytecode::assembler::assemble;
use khz_bytecode::container::Container;
use khz_bytecode::verify::{Verified, verify};
use khz_frontend::{CompileOptions, SourceInput};
use khz_machine::engine::{Engine, Entry, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::trap::{Trap, TrapCode};
use khz_machine::variables::{Variable, VariableTable, VariableValue};
use khz_scheduler::statistics::Summary;
use khz_scheduler::time::DurationNs;
use khz_scheduler::{
    Clock, ClockKind, FaultPlace, Faulted, Hooks, InputSource, IoDriver, LoadError, LoadOptions, Observer, ResetKind,
    Resource, RunOptions, RunOutcome, Running, StopHandle, Stopped, TaskIndex, TimeNs, VirtualClock, Wake, run,
};

const IMAGE_LIMIT_BYTES: u64 = 1 << 20;

/// What 3000 plans reach at least, and how often: a search that never went there proves nothing.
pub const REACHES: &[(&str, u64)] = &[
    ("command ClearStatistics", 100),
    ("command ResetCold", 100),
    ("command ResetOrigin", 100),
    ("command ResetWarm", 100),
    ("command Start", 1000),
    ("command Stop", 200),
    ("cycle of a cyclic task", 10_000),
    ("cycle of a cyclic task with SINGLE", 4000),
    ("cycle of a freewheeling task", 10_000),
    ("cycle of an event task", 1000),
    ("fault divide by zero in Init", 10),
    ("fault divide by zero in Instance", 40),
    ("fault divide by zero in Startup", 5),
    ("fault watchdog in Init", 3),
    ("fault watchdog in Instance", 100),
    ("fault watchdog in Startup", 3),
    ("form Assembly", 1000),
    ("form BareText", 50),
    ("form Text", 600),
    ("lost cycles", 30_000),
    ("overruns", 4000),
    ("round of several tasks", 8000),
    ("run ended Completed", 400),
    ("run ended Faulted", 60),
    ("run ended NothingDue", 60),
    ("run ended Stopped", 300),
    ("time MovingWithDeadlines", 600),
    ("time MovingWithFuel", 300),
    ("time Virtual", 600),
    ("wait for a time", 8000),
    ("wait for an edge", 300),
    ("wait of freewheeling tasks alone", 800),
    ("wait with a freewheeling task", 5000),
];

/// What a search reached.
#[derive(Default, Debug)]
pub struct Tally {
    /// Plans that were carried out.
    pub plans: u64,
    /// Rounds in which a task ran.
    pub rounds: u64,
    /// Cycles of tasks.
    pub cycles: u64,
    /// Values of variables that were compared.
    pub values: u64,
    /// Values of variables that the container left out.
    pub unknown_values: u64,
    /// How often each thing happened.
    pub reached: BTreeMap<String, u64>,
}

impl Tally {
    /// The figures, for people.
    pub fn report(&self) -> String {
        let mut text = format!(
            "{} plans, {} rounds, {} cycles, {} values compared, {} of variables that the container left out\n",
            self.plans, self.rounds, self.cycles, self.values, self.unknown_values
        );
        for (what, count) in &self.reached {
            // A String takes everything.
            let _ = writeln!(text, "{what}: {count}");
        }
        text
    }

    fn reach(&mut self, what: impl Into<String>) {
        *self.reached.entry(what.into()).or_default() += 1;
    }

    fn note(&mut self, plan: &Plan, seen: &Seen) {
        self.plans += 1;
        self.reach(format!("form {:?}", plan.form));
        self.reach(format!("time {:?}", plan.time));
        let mut total = Vec::new();
        for event in &seen.observed.events {
            match event {
                Event::Round(_, ran, values) => {
                    self.rounds += 1;
                    self.cycles += ran.len() as u64;
                    for task in ran {
                        self.reach(match plan.tasks[*task].trigger {
                            Trigger::Cyclic { single: Some(_), .. } => "cycle of a cyclic task with SINGLE",
                            Trigger::Cyclic { .. } => "cycle of a cyclic task",
                            Trigger::Event(_) => "cycle of an event task",
                            Trigger::Freewheeling => "cycle of a freewheeling task",
                        });
                    }
                    if ran.len() > 1 {
                        self.reach("round of several tasks");
                    }
                    self.values += values.iter().flatten().count() as u64;
                    self.unknown_values += values.iter().filter(|value| value.is_none()).count() as u64;
                }
                Event::Waits(Next::Edge) => self.reach("wait for an edge"),
                Event::Waits(Next::At(_, true)) => self.reach("wait with a freewheeling task"),
                Event::Waits(Next::At(_, false)) => self.reach("wait for a time"),
                Event::Waits(Next::Freewheel) => self.reach("wait of freewheeling tasks alone"),
                Event::Ended(ending) => self.reach(format!("run ended {ending:?}")),
                Event::Fault(code, trap, ..) => {
                    let code = match code {
                        Code::Instance(..) => "Instance",
                        Code::Init => "Init",
                        Code::Startup => "Startup",
                    };
                    self.reach(format!("fault {trap} in {code}"));
                }
                Event::Commanded(Command::Run { .. } | Command::Step(_) | Command::Force(..)) => {}
                Event::Commanded(command) => self.reach(format!("command {command:?}")),
                Event::Holds(.., statistics) => total.clone_from(&statistics.tasks),
                _ => {}
            }
        }
        for task in total {
            for (name, count) in [("overruns", task.overruns), ("lost cycles", task.lost_cycles)] {
                *self.reached.entry(name.to_string()).or_default() += count;
            }
        }
    }
}

impl campaign::Figures for Tally {
    fn merge(&mut self, later: Self) {
        self.plans += later.plans;
        self.rounds += later.rounds;
        self.cycles += later.cycles;
        self.values += later.values;
        self.unknown_values += later.unknown_values;
        for (what, count) in later.reached {
            *self.reached.entry(what).or_default() += count;
        }
    }
}

/// What the hooks, the clock and the engine share.
struct Shared {
    world: World,
    now: u64,
    observed: Observed,
    names: VariableTable,
    variables: Vec<Option<Variable>>,
    stop: StopHandle,
    stop_left: Option<u64>,
    /// Between engines: every trap, and the memory after every round, mixed into a number.
    traps: Vec<Trap>,
    images: Vec<u64>,
}

type Link = Arc<Mutex<Shared>>;

fn lock(link: &Link) -> MutexGuard<'_, Shared> {
    link.lock().expect("no thread panics while it holds the lock")
}

impl Shared {
    fn push(&mut self, event: Event) {
        self.observed.events.push(event);
    }

    fn values(&self, image: &Image) -> Values {
        let read = |variable: &Variable| match self.names.read(image, variable) {
            Ok(VariableValue::Bool(value)) => i64::from(value),
            Ok(VariableValue::Signed(value) | VariableValue::Time(_, value)) => value,
            other => panic!("{}: {other:?}", variable.name),
        };
        self.variables.iter().map(|variable| variable.as_ref().map(read)).collect()
    }

    fn pass(&mut self, what: Delay) {
        self.now += self.world.delay_ns(what);
    }
}

/// FNV over all but the frames.
fn mixed(image: &Image) -> u64 {
    let frames = &image.layout().frames;
    let (start, end) = (frames.first().map_or(0, |f| f.start), frames.last().map_or(0, |f| f.end));
    let bytes = image.bytes();
    let counted = bytes[..start as usize].iter().chain(&bytes[end as usize..]);
    counted.fold(0xCBF2_9CE4_8422_2325, |mix, byte| (mix ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3))
}

/// An engine whose runs take the world's time.
struct TimedEngine {
    inner: Box<dyn Engine>,
    link: Link,
}

impl Engine for TimedEngine {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn run(&mut self, entry: Entry, image: &mut Image, limits: Limits<'_>) -> Result<(), Trap> {
        let Limits { deadline, mut fuel, task_index } = limits;
        let (code, delay) = match entry {
            Entry::Init => (Code::Init, Delay::Init),
            Entry::Startup => (Code::Startup, Delay::Startup),
            Entry::Instance(instance) => (Code::Instance(instance, task_index), Delay::Run(instance)),
        };
        let given = fuel.as_ref().map(|fuel| fuel.left);
        lock(&self.link).push(Event::Began(code, given));
        let result = self.inner.run(entry, image, Limits { deadline, fuel: fuel.as_deref_mut(), task_index });
        let mut shared = lock(&self.link);
        let fuel_used = given.map_or(0, |given| given - fuel.map_or(0, |fuel| fuel.left));
        let dry = matches!(result, Err(trap) if trap.code == TrapCode::Watchdog);
        let out_of_fuel = dry.then(|| shared.values(image));
        shared.observed.runs.push(Run { fuel_used, out_of_fuel });
        shared.traps.extend(result.err());
        shared.pass(delay);
        result
    }

    fn code_bytes(&self) -> usize {
        self.inner.code_bytes()
    }
}

/// The scheduler's virtual clock, or one that the world moves; both say what they are told.
struct TestClock {
    link: Link,
    virtual_clock: VirtualClock,
    time: Time,
}

impl Clock for TestClock {
    fn kind(&self) -> ClockKind {
        if self.time == Time::MovingWithDeadlines { ClockKind::Real } else { ClockKind::Virtual }
    }

    fn start_at(&mut self, time: TimeNs) {
        self.virtual_clock.start_at(time);
        lock(&self.link).now = time.0;
    }

    fn now(&self) -> TimeNs {
        if self.time == Time::Virtual { self.virtual_clock.now() } else { TimeNs(lock(&self.link).now) }
    }

    fn wait(&mut self, wake: Wake, stop: &StopHandle) {
        let next = match wake {
            Wake::EdgePending => Next::Edge,
            Wake::At { time, freewheeling } => Next::At(time.0, freewheeling),
            Wake::Freewheel => Next::Freewheel,
            Wake::Never => return,
        };
        let mut shared = lock(&self.link);
        shared.push(Event::Waits(next));
        if self.time == Time::Virtual {
            self.virtual_clock.wait(wake, stop);
            return;
        }
        if stop.requested() {
            return;
        }
        if let Next::At(time, false) = next {
            shared.now = shared.now.max(time);
        }
        shared.pass(Delay::Wake);
    }

    fn monotonic_ns(&self, _time: TimeNs) -> Option<u64> {
        // A deadline that never comes: the monitor has nothing to say, what a cycle took decides.
        (self.time == Time::MovingWithDeadlines).then_some(u64::MAX)
    }
}

struct Driver {
    link: Link,
    poll_ns: u64,
}

impl IoDriver for Driver {
    fn read_inputs(&mut self, inputs: &mut [u8]) {
        let mut shared = lock(&self.link);
        shared.push(Event::Inputs);
        let byte = shared.world.driver_byte();
        if let Some(found) = inputs.get_mut(1) {
            *found = byte;
        }
        shared.pass(Delay::Inputs);
    }

    fn write_outputs(&mut self, outputs: &[u8]) {
        let mut shared = lock(&self.link);
        shared.push(Event::Outputs(outputs.to_vec()));
        shared.pass(Delay::Outputs);
    }

    fn input_poll(&self) -> Option<DurationNs> {
        (self.poll_ns > 0).then_some(DurationNs(self.poll_ns))
    }
}

struct Rows<'p> {
    plan: &'p Plan,
    next: usize,
}

impl InputSource for Rows<'_> {
    fn next_change_us(&self) -> Option<u64> {
        self.plan.rows.get(self.next).map(|row| row.time_us)
    }

    fn apply(&mut self, now_us: u64, image: &mut Image) {
        let start = image.layout().input.start;
        while let Some(row) = self.plan.rows.get(self.next).filter(|row| row.time_us <= now_us) {
            // A plan that was made small may have lost what named the bit.
            if let Some(byte) = image.bytes_mut().get_mut((start + row.bit.byte) as usize) {
                *byte = *byte & !(1 << row.bit.bit) | u8::from(row.value) << row.bit.bit;
            }
            self.next += 1;
        }
    }
}

struct Onlooker {
    link: Link,
}

impl Observer for Onlooker {
    fn round_ended(&mut self, image: &Image, time: TimeNs, ran: &[TaskIndex]) {
        let mut shared = lock(&self.link);
        let values = shared.values(image);
        shared.push(Event::Round(time.0, ran.iter().map(|task| task.index()).collect(), values));
        shared.images.push(mixed(image));
        shared.stop_left = shared.stop_left.map(|left| left.saturating_sub(1));
        if shared.stop_left == Some(0) {
            shared.stop.request();
        }
    }
}

/// What was seen of a run in one engine.
pub struct Seen {
    /// Events and figures.
    pub observed: Observed,
    traps: Vec<Trap>,
    images: Vec<u64>,
}

/// A resource in any state.
enum Held {
    Stopped(Resource<Stopped>),
    Running(Resource<Running>),
    Faulted(Resource<Faulted>),
}

/// A plan under the scheduler.
struct Bench<'p> {
    link: Link,
    io: Driver,
    inputs: Rows<'p>,
    observer: Onlooker,
    stop: StopHandle,
}

impl Bench<'_> {
    fn fault(&self, resource: Resource<Faulted>) -> Held {
        let report = *resource.report();
        let code = match report.place {
            FaultPlace::Init => Code::Init,
            FaultPlace::Startup => Code::Startup,
            FaultPlace::Task { task, instance } => Code::Instance(instance, task.index()),
        };
        let mut shared = lock(&self.link);
        shared.traps.push(report.trap);
        shared.push(Event::Fault(code, report.trap.code, report.time.0, report.rounds));
        drop(shared);
        Held::Faulted(resource)
    }

    fn stopped(&self, result: Result<Resource<Stopped>, Resource<Faulted>>) -> Held {
        match result {
            Ok(resource) => Held::Stopped(resource),
            Err(resource) => self.fault(resource),
        }
    }

    fn reset(&mut self, held: Held, kind: ResetKind) -> Held {
        self.inputs.next = 0;
        match held {
            Held::Stopped(resource) => self.stopped(resource.reset(kind)),
            Held::Faulted(resource) => self.stopped(resource.reset(kind)),
            running => running,
        }
    }

    fn command(&mut self, held: Held, command: Command) -> Held {
        let allowed = matches!(
            (&held, command),
            (_, Command::ClearStatistics)
                | (Held::Stopped(_) | Held::Running(_), Command::Force(..))
                | (Held::Stopped(_), Command::Start)
                | (Held::Stopped(_) | Held::Faulted(_), Command::ResetWarm | Command::ResetCold | Command::ResetOrigin)
                | (Held::Running(_), Command::Run { .. } | Command::Step(_) | Command::Stop)
        );
        if !allowed {
            return held;
        }
        lock(&self.link).push(Event::Commanded(command));
        let held = self.carry_out(held, command);
        self.look(&held);
        held
    }

    fn carry_out(&mut self, held: Held, command: Command) -> Held {
        match (held, command) {
            (Held::Stopped(resource), Command::Start) => match resource.start() {
                Ok(resource) => Held::Running(resource),
                Err(resource) => self.fault(resource),
            },
            (Held::Running(resource), Command::Run { scans, stop_after }) => self.run(resource, scans, stop_after),
            (Held::Running(resource), Command::Step(rounds)) => self.step(resource, rounds),
            (Held::Running(resource), Command::Stop) => Held::Stopped(resource.stop()),
            (held, Command::ResetWarm) => self.reset(held, ResetKind::Warm),
            (held, Command::ResetCold) => self.reset(held, ResetKind::Cold),
            (held, Command::ResetOrigin) => self.reset(held, ResetKind::Origin),
            (mut held, Command::ClearStatistics) => {
                match &mut held {
                    Held::Stopped(resource) => resource.clear_statistics(),
                    Held::Running(resource) => resource.clear_statistics(),
                    Held::Faulted(resource) => resource.clear_statistics(),
                }
                held
            }
            (mut held, Command::Force(global, value)) => {
                let image = match &mut held {
                    Held::Stopped(resource) => Some(resource.image_mut()),
                    Held::Running(resource) => Some(resource.image_mut()),
                    Held::Faulted(_) => None,
                };
                let shared = lock(&self.link);
                let variable = shared.names.resolve(&format!("b{global}")).ok();
                if let (Some(image), Some(variable)) = (image, variable) {
                    let literal = if value { "TRUE" } else { "FALSE" };
                    shared.names.write(image, &variable, literal).expect("a BOOL");
                }
                held
            }
            (held, _) => held,
        }
    }

    fn run(&mut self, resource: Resource<Running>, scans: u64, stop_after: u64) -> Held {
        lock(&self.link).stop_left = Some(stop_after);
        let mut hooks = Hooks { io: &mut self.io, inputs: &mut self.inputs, observer: &mut self.observer };
        let outcome = run(resource, &mut hooks, RunOptions { scans: Some(scans) });
        self.stop.clear();
        let (held, ending) = match outcome {
            RunOutcome::Completed(resource) => (Held::Stopped(resource), Ending::Completed),
            RunOutcome::NothingDue(resource) => (Held::Stopped(resource), Ending::NothingDue),
            RunOutcome::Stopped(resource) => (Held::Stopped(resource), Ending::Stopped),
            RunOutcome::Faulted(resource) => (self.fault(resource), Ending::Faulted),
        };
        let mut shared = lock(&self.link);
        shared.stop_left = None;
        shared.push(Event::Ended(ending));
        drop(shared);
        held
    }

    fn step(&mut self, mut resource: Resource<Running>, rounds: u64) -> Held {
        for _ in 0..rounds {
            let mut hooks = Hooks { io: &mut self.io, inputs: &mut self.inputs, observer: &mut self.observer };
            match resource.run_round(&mut hooks) {
                Ok((running, _)) => resource = running,
                Err(resource) => return self.fault(resource),
            }
            let wake = resource.next_wake(&mut hooks);
            resource.wait(wake);
        }
        Held::Running(resource)
    }

    /// Notes what the resource is now.
    fn look(&self, held: &Held) {
        fn parts<S>(resource: &Resource<S>) -> (&Image, u64, u64, khz_scheduler::StatisticsReport) {
            (resource.image(), resource.time().0, resource.rounds(), resource.statistics())
        }
        let (state, (image, time, rounds, report)) = match held {
            Held::Stopped(resource) => (State::Stopped, parts(resource)),
            Held::Running(resource) => (State::Running, parts(resource)),
            Held::Faulted(resource) => (State::Faulted, parts(resource)),
        };
        let figures = |summary: Summary| Figures {
            count: summary.count,
            last: summary.last,
            min: summary.min,
            average: summary.average,
            max: summary.max,
        };
        let tasks = report.tasks.iter().map(|task| TaskFigures {
            scans: task.scans,
            overruns: task.overruns,
            lost_cycles: task.lost_cycles,
            execution: task.execution.map(figures),
            jitter: task.jitter.map(figures),
        });
        let statistics = Statistics {
            time_ns: report.time.0,
            rounds: report.rounds,
            rounds_with_tasks: report.rounds_with_tasks,
            tasks: tasks.collect(),
        };
        let mut shared = lock(&self.link);
        let values = shared.values(image);
        shared.images.push(mixed(image));
        shared.push(Event::Holds(state, time, rounds, values, statistics));
    }
}

/// The container of a plan.
///
/// # Errors
/// The words of what refused it.
pub fn container(plan: &Plan) -> Result<Container, String> {
    if plan.form == Form::Assembly {
        return assemble(&assembly::print(plan)).map_err(|error| format!("the assembly is refused: {error}"));
    }
    let input = SourceInput { name: "plan.st".to_string(), bytes: text::print(plan).into_bytes() };
    let compilation = khz_frontend::compile(&[input], &CompileOptions::default());
    if khz_frontend::diagnostics::has_errors(&compilation.diagnostics) {
        let render = khz_frontend::diagnostics::render::render_all;
        let shown = render(&compilation.diagnostics, &compilation.sources, Default::default());
        return Err(format!("the text is refused: {shown}"));
    }
    let resource = compilation.resources.into_iter().next();
    resource.map(|resource| resource.container).ok_or_else(|| "the text has no resource".to_string())
}

/// Runs a plan in one engine.
///
/// # Errors
/// What kept it from running.
pub fn observe(plan: &Plan, verified: &Arc<Verified>, maker: &Maker<'_>) -> Result<Seen, String> {
    let layout = ImageLayout::new(verified.container(), IMAGE_LIMIT_BYTES).map_err(|error| error.to_string())?;
    let inner = (maker.make)(verified.clone(), &layout, plan.needs_fuel())?;
    let names = VariableTable::of(verified.container());
    let variables: Vec<_> = plan.names().iter().map(|name| names.resolve(name).ok()).collect();
    let stop = StopHandle::new();
    let known = variables.iter().map(Option::is_some).collect();
    let link = Arc::new(Mutex::new(Shared {
        world: World::new(plan),
        now: 0,
        observed: Observed { known, ..Observed::default() },
        names,
        variables,
        stop: stop.clone(),
        stop_left: None,
        traps: Vec::new(),
        images: Vec::new(),
    }));
    let engine = Box::new(TimedEngine { inner, link: link.clone() });
    let clock = Box::new(TestClock { link: link.clone(), virtual_clock: VirtualClock::new(), time: plan.time });
    let mut bench = Bench {
        io: Driver { link: link.clone(), poll_ns: plan.input_poll_ns },
        inputs: Rows { plan, next: 0 },
        observer: Onlooker { link: link.clone() },
        link: link.clone(),
        stop: stop.clone(),
    };
    let options = LoadOptions { watchdog_us: plan.watchdog_us, stop: Some(stop), ..LoadOptions::default() };
    let mut held = match Resource::load(verified.clone(), engine, clock, &options) {
        Ok(resource) => Held::Stopped(resource),
        Err(LoadError::Faulted(resource)) => bench.fault(*resource),
        Err(error) => return Err(error.to_string()),
    };
    bench.look(&held);
    for command in &plan.commands {
        held = bench.command(held, *command);
    }
    drop((held, bench));
    let shared = Arc::into_inner(link).expect("nobody else holds it").into_inner().expect("not poisoned");
    Ok(Seen { observed: shared.observed, traps: shared.traps, images: shared.images })
}

/// Compares a plan's runs with the model and with each other; the first difference.
///
/// # Errors
/// The difference, for people.
pub fn check(plan: &Plan, makers: &[Maker<'_>], tally: &mut Tally) -> Result<(), String> {
    let container = container(plan)?;
    let verified = Arc::new(verify(container).map_err(|error| format!("the container is refused: {error}"))?);
    let mut first: Option<Seen> = None;
    for maker in makers {
        let seen = observe(plan, &verified, maker)?;
        let foretold = predict(plan, &seen.observed);
        if let Some(found) = difference(&seen.observed.events, &foretold, &plan.names()) {
            return Err(format!("{}: not as the rules say\n{found}", maker.name));
        }
        if let Some(first) = &first {
            if seen.traps != first.traps {
                return Err(format!("the engines trap otherwise: {:?} and {:?}", first.traps, seen.traps));
            }
            if seen.observed.runs != first.observed.runs || seen.images != first.images {
                return Err("the engines leave other memory or fuel".to_string());
            }
        }
        first = first.or(Some(seen));
    }
    if let Some(seen) = &first {
        tally.note(plan, seen);
    }
    Ok(())
}

/// The plan of a seed; if it is not as the model says, the smallest like it, with its text and both traces.
pub fn check_seed(seed: u64, makers: &[Maker<'_>], tally: &mut Tally, tries: usize) -> Option<String> {
    let plan = generate(seed);
    let first = check(&plan, makers, tally).err()?;
    // A text that is refused is another matter than a difference.
    let kind = |found: &str| found.lines().next().unwrap_or_default().split(':').next().unwrap_or_default().to_string();
    let mut shows =
        |plan: &Plan| matches!(check(plan, makers, &mut Tally::default()), Err(found) if kind(&found) == kind(&first));
    let small = shrink::shrink(&plan, &mut shows, tries);
    let last = check(&small, makers, &mut Tally::default()).err().unwrap_or_else(|| first.clone());
    let Plan { form, time, rows, delays_ns, input_poll_ns, watchdog_us, commands, .. } = &small;
    Some(format!(
        "seed {seed}: {first}\nsmall: {last}\n{}as {form:?}, time {time:?}, {rows:?} delays {delays_ns:?} poll {input_poll_ns} watchdog {watchdog_us}\n{commands:?}",
        text::print(&small)
    ))
}
