//! Rounds and the life of a resource, by the rules.

use std::collections::VecDeque;

use khz_bytecode::trap::TrapCode;

use super::memory::Memory;
use super::plan::{Area, Command, Place, Plan, Single, Time};
use super::tasks::TaskModel;
use super::trace::{Code, Ending, Event, Next, Observed, Run, State, Statistics, Values};
use super::world::{Delay, World};

/// Watchdog of init and startup function when none is given, in nanoseconds.
const STARTUP_WATCHDOG_NS: u64 = 1_000_000_000;

/// A code that trapped.
struct Fault(Code, TrapCode);

struct Model<'p> {
    plan: &'p Plan,
    known: &'p [bool],
    world: World,
    memory: Memory,
    tasks: Vec<TaskModel>,
    state: State,
    /// The clock.
    now: u64,
    /// Time of the last round.
    time: u64,
    rounds: u64,
    rounds_with_tasks: u64,
    /// Rows that were applied.
    rows: usize,
    runs: VecDeque<Run>,
    stop_after: Option<u64>,
    events: Vec<Event>,
}

/// What has to happen when a plan runs. Of `observed` only the fuel that runs of code took is looked at, memory after a run whose fuel ended, and
/// which variables the container has.
#[must_use]
pub fn predict(plan: &Plan, observed: &Observed) -> Vec<Event> {
    let mut model = Model {
        plan,
        known: &observed.known,
        world: World::new(plan),
        memory: Memory::new(plan),
        tasks: plan.tasks.iter().map(|task| TaskModel::new(plan, *task)).collect(),
        state: State::Stopped,
        now: 0,
        time: 0,
        rounds: 0,
        rounds_with_tasks: 0,
        rows: 0,
        runs: observed.runs.iter().cloned().collect(),
        stop_after: None,
        events: Vec::new(),
    };
    model.initialise();
    model.look();
    for command in &plan.commands {
        if model.command(*command) {
            model.look();
        }
    }
    model.events
}

impl Model<'_> {
    /// Carries out a command, if the state allows it.
    fn command(&mut self, command: Command) -> bool {
        let allowed = match command {
            Command::Start => self.state == State::Stopped,
            Command::Run { .. } | Command::Step(_) | Command::Stop => self.state == State::Running,
            Command::ResetWarm | Command::ResetCold | Command::ResetOrigin => self.state != State::Running,
            Command::ClearStatistics => true,
            Command::Force(..) => self.state != State::Faulted,
        };
        if !allowed {
            return false;
        }
        self.events.push(Event::Commanded(command));
        match command {
            Command::Start => self.start(),
            Command::Run { scans, stop_after } => self.run(scans, stop_after),
            Command::Step(rounds) => self.step(rounds),
            Command::Stop => self.state = State::Stopped,
            Command::ResetWarm => self.reset(true),
            Command::ResetCold => self.reset(false),
            Command::ResetOrigin => {
                self.tasks.iter_mut().for_each(TaskModel::clear_statistics);
                self.reset(false);
            }
            Command::ClearStatistics => self.tasks.iter_mut().for_each(TaskModel::clear_statistics),
            Command::Force(global, value) => self.memory.write(Place::Global(global), "", value),
        }
        true
    }

    /// Notes what the resource is now.
    fn look(&mut self) {
        let statistics = Statistics {
            time_ns: self.time,
            rounds: self.rounds,
            rounds_with_tasks: self.rounds_with_tasks,
            tasks: self.tasks.iter().map(TaskModel::figures).collect(),
        };
        self.events.push(Event::Holds(self.state, self.time, self.rounds, self.values(), statistics));
    }

    fn values(&self) -> Values {
        let values = self.memory.values().into_iter();
        values.zip(self.known).map(|(value, known)| value.filter(|_| *known)).collect()
    }

    fn fault(&mut self, Fault(code, trap): Fault) {
        self.state = State::Faulted;
        self.events.push(Event::Fault(code, trap, self.time, self.rounds));
    }

    fn reset(&mut self, warm: bool) {
        let kept = self.memory.retained();
        self.memory.reset();
        self.tasks.iter_mut().for_each(TaskModel::reset);
        (self.now, self.time, self.rounds, self.rounds_with_tasks, self.rows) = (0, 0, 0, 0, 0);
        self.state = State::Stopped;
        self.initialise();
        // A reset that trapped has not come to giving back what was kept.
        if warm && self.state == State::Stopped {
            self.memory.restore(kept);
        }
    }

    fn initialise(&mut self) {
        let Some(actions) = &self.plan.init else { return };
        let actions = actions.clone();
        self.run_once(Code::Init, Delay::Init, &|memory| memory.run_init(&actions));
    }

    fn start(&mut self) {
        self.state = State::Running;
        let Some(actions) = &self.plan.startup else { return };
        let actions = actions.clone();
        self.run_once(Code::Startup, Delay::Startup, &|memory| memory.run_startup(&actions));
    }

    /// Runs init or startup function. Time stands still around them.
    fn run_once(&mut self, code: Code, delay: Delay, body: &dyn Fn(&mut Memory) -> Result<(), TrapCode>) {
        let limit = if self.plan.watchdog_us == 0 { STARTUP_WATCHDOG_NS } else { self.plan.watchdog_us * 1000 };
        let fuel = (self.plan.time != Time::MovingWithDeadlines).then_some(limit);
        let (result, _) = self.run_code(code, fuel, body);
        let took = self.world.delay_ns(delay);
        let late = took > limit && self.plan.time == Time::MovingWithDeadlines;
        match result {
            Err(trap) => self.fault(Fault(code, trap)),
            Ok(()) if late => self.fault(Fault(code, TrapCode::Watchdog)),
            Ok(()) => {}
        }
    }

    /// Runs code. Returns how it ended and the fuel it took.
    fn run_code(
        &mut self,
        code: Code,
        fuel: Option<u64>,
        body: &dyn Fn(&mut Memory) -> Result<(), TrapCode>,
    ) -> (Result<(), TrapCode>, u64) {
        self.events.push(Event::Began(code, fuel));
        let run = self.runs.pop_front().unwrap_or(Run { fuel_used: 0, out_of_fuel: None });
        match run.out_of_fuel {
            Some(values) => {
                self.memory.adopt(&values);
                (Err(TrapCode::Watchdog), run.fuel_used)
            }
            None => (body(&mut self.memory), run.fuel_used),
        }
    }

    fn run(&mut self, scans: u64, stop_after: u64) {
        self.stop_after = Some(stop_after);
        let mut ran = 0;
        let ending = loop {
            if ran >= scans {
                break Ending::Completed;
            }
            if self.stop_requested() {
                break Ending::Stopped;
            }
            let Some(with_tasks) = self.round() else { break Ending::Faulted };
            ran += u64::from(with_tasks);
            // After the last scan time stays that of the round.
            if ran >= scans {
                break Ending::Completed;
            }
            match self.next() {
                None => break Ending::NothingDue,
                Some(next) => self.wait(next),
            }
        };
        self.stop_after = None;
        self.events.push(Event::Ended(ending));
        if ending != Ending::Faulted {
            self.state = State::Stopped;
        }
    }

    fn step(&mut self, rounds: u64) {
        for _ in 0..rounds {
            if self.round().is_none() {
                return;
            }
            if let Some(next) = self.next() {
                self.wait(next);
            }
        }
    }

    fn stop_requested(&self) -> bool {
        self.stop_after == Some(0)
    }

    /// One round. Returns whether it ran a task; `None` after a trap.
    fn round(&mut self) -> Option<bool> {
        let time = self.now;
        self.time = time;
        self.freeze_inputs();
        let mut due = Vec::new();
        for task in 0..self.tasks.len() {
            let single = self.single(task);
            if self.tasks[task].sample(time, single) {
                due.push(task);
            }
        }
        let mut ran = Vec::new();
        while let Some(task) = self.take_first(&mut due) {
            ran.push(task);
            if let Err(fault) = self.cycle(task, time) {
                self.fault(fault);
                return None;
            }
        }
        if let Some(length) = self.size(Area::Output) {
            self.events.push(Event::Outputs(self.memory.outputs(length)));
            self.now += self.world.delay_ns(Delay::Outputs);
        }
        self.rounds += 1;
        self.rounds_with_tasks += u64::from(!ran.is_empty());
        let with_tasks = !ran.is_empty();
        self.events.push(Event::Round(time, ran, self.values()));
        self.stop_after = self.stop_after.map(|left| left.saturating_sub(1));
        Some(with_tasks)
    }

    /// Takes the task that runs first: the least priority number, among equals the first declared.
    fn take_first(&self, due: &mut Vec<usize>) -> Option<usize> {
        let mut best = 0;
        for at in 1..due.len() {
            if self.plan.tasks[due[at]].priority < self.plan.tasks[due[best]].priority {
                best = at;
            }
        }
        if due.is_empty() { None } else { Some(due.remove(best)) }
    }

    /// Bytes of an image, if it has any: up to the last that something names.
    fn size(&self, area: Area) -> Option<u32> {
        self.plan.bits().iter().filter(|bit| bit.area == area).map(|bit| bit.byte + 1).max()
    }

    fn freeze_inputs(&mut self) {
        if let Some(length) = self.size(Area::Input) {
            self.events.push(Event::Inputs);
            let byte = self.world.driver_byte();
            for bit in self.plan.bits().into_iter().filter(|bit| bit.area == Area::Input && bit.byte == 1) {
                self.memory.write(Place::Bit(bit), "", length > 1 && byte >> bit.bit & 1 != 0);
            }
            self.now += self.world.delay_ns(Delay::Inputs);
        }
        while let Some(row) = self.plan.rows.get(self.rows).filter(|row| row.time_us <= self.time / 1000) {
            self.memory.write(Place::Bit(row.bit), "", row.value);
            self.rows += 1;
        }
    }

    /// What a task's SINGLE is now.
    fn single(&self, task: usize) -> bool {
        match self.plan.tasks[task].single() {
            None => false,
            Some(Single::Literal(value)) => value,
            Some(Single::Global(global)) => self.memory.read(Place::Global(global), ""),
            Some(Single::Instance(instance, place)) => self.memory.read(place, &self.plan.instance_name(instance)),
            Some(Single::Bit(bit)) => self.memory.read(Place::Bit(bit), ""),
        }
    }

    /// A cycle of a task in a round at `time`.
    fn cycle(&mut self, task: usize, time: u64) -> Result<(), Fault> {
        let start = self.now;
        self.tasks[task].collect(time, start);
        let limit = self.tasks[task].limit();
        let mut fuel = if self.plan.time == Time::MovingWithDeadlines { None } else { limit };
        let instances = self.plan.instances_of(task);
        for instance in &instances {
            let code = Code::Instance(*instance, task);
            let plan = self.plan;
            let (result, used) = self.run_code(code, fuel, &|memory| memory.run_instance(plan, *instance, time));
            fuel = fuel.map(|left| left - used);
            self.now += self.world.delay_ns(Delay::Run(*instance));
            result.map_err(|trap| Fault(code, trap))?;
        }
        let end = self.now;
        let used = match (limit, fuel) {
            (Some(limit), Some(left)) => limit - left,
            _ => end - start,
        };
        if self.tasks[task].trips(used)
            && let Some(last) = instances.last()
        {
            return Err(Fault(Code::Instance(*last, task), TrapCode::Watchdog));
        }
        self.tasks[task].complete(start, end);
        Ok(())
    }

    /// When the next round is; `None`: nothing can ever be due.
    fn next(&self) -> Option<Next> {
        let singles: Vec<bool> = (0..self.tasks.len()).map(|task| self.single(task)).collect();
        if self.tasks.iter().zip(&singles).any(|(task, single)| task.edge_is_pending(*single)) {
            return Some(Next::Edge);
        }
        let dues = self.tasks.iter().zip(&singles).filter_map(|(task, single)| task.next_due(self.time, *single));
        let row = self.plan.rows.get(self.rows).map(|row| row.time_us * 1000);
        let polls =
            self.plan.time == Time::MovingWithDeadlines && self.plan.input_poll_ns > 0 && self.waits_for_input();
        let poll = polls.then_some(self.time + self.plan.input_poll_ns);
        let wheels = self.tasks.iter().any(TaskModel::wheels);
        match dues.chain(row).chain(poll).min() {
            Some(time) => Some(Next::At(time, wheels)),
            None => wheels.then_some(Next::Freewheel),
        }
    }

    /// Whether the SINGLE of a task that can run is a bit of %I.
    fn waits_for_input(&self) -> bool {
        let is_input = |single| matches!(single, Some(Single::Bit(bit)) if bit.area == Area::Input);
        self.plan.tasks.iter().any(|task| task.enabled && is_input(task.single()))
    }

    fn wait(&mut self, next: Next) {
        self.events.push(Event::Waits(next));
        if self.plan.time == Time::Virtual {
            self.now = match next {
                Next::Edge => self.now + 1000,
                Next::At(time, _) => time,
                Next::Freewheel => self.now + 1_000_000,
            };
            return;
        }
        // A stop request ends a sleep before it begins.
        if self.stop_requested() {
            return;
        }
        if let Next::At(time, false) = next {
            self.now = self.now.max(time);
        }
        self.now += self.world.delay_ns(Delay::Wake);
    }
}
