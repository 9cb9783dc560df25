//! Plans of seeds.

use super::memory::INIT_STARTS;
use super::plan::{
    Action, Area, Bit, Command, Condition, Counter, Deed, Form, Home, Instance, Place, Plan, Policy, Row, Single, Task,
    Time, Trigger, Value,
};
use crate::random::Random;

/// Bits that programs, tasks and rows share.
const BITS: [(Area, u32, u8); 11] = [
    (Area::Input, 0, 0),
    (Area::Input, 0, 1),
    (Area::Input, 0, 7),
    (Area::Input, 1, 0),
    (Area::Input, 1, 1),
    (Area::Input, 1, 5),
    (Area::Output, 0, 0),
    (Area::Output, 0, 3),
    (Area::Output, 2, 5),
    (Area::Memory, 0, 0),
    (Area::Memory, 3, 7),
];
const MOST_TASKS: i64 = 8;

/// The plan of a seed.
#[must_use]
pub fn generate(seed: u64) -> Plan {
    let mut random = Random::new(seed ^ 0x7363_6865_6475_6C65);
    let form = [Form::Text, Form::BareText, Form::Assembly][random.weighted(&[42, 6, 52])];
    let time = [Time::Virtual, Time::MovingWithFuel, Time::MovingWithDeadlines][random.weighted(&[40, 20, 40])];
    let plan = Plan {
        seed,
        form,
        tasks: Vec::new(),
        programs: Vec::new(),
        instances: Vec::new(),
        globals: Vec::new(),
        init: None,
        startup: None,
        rows: Vec::new(),
        time,
        delays_ns: Vec::new(),
        input_poll_ns: 0,
        watchdog_us: 0,
        commands: Vec::new(),
    };
    let scale_us = random.one_of([1, 1, 10, 100, 1000]);
    let watched = random.chance(35);
    let mut generator = Generator { random, plan, scale_us, watched };
    generator.fill();
    generator.plan
}

struct Generator {
    random: Random,
    plan: Plan,
    /// What times are multiples of, mostly.
    scale_us: u64,
    /// Whether there are watchdogs.
    watched: bool,
}

impl Generator {
    fn fill(&mut self) {
        let globals = self.random.between(2, 5) as usize;
        self.plan.globals = (0..globals).map(|_| self.home()).collect();
        let programs = self.random.between(1, 5) as usize;
        self.plan.programs = (0..programs).map(|_| self.body(false)).collect();
        if self.plan.form == Form::BareText {
            self.bare();
        } else {
            self.configuration();
        }
        self.once();
        self.rows();
        self.world();
        self.commands();
    }

    fn home(&mut self) -> Home {
        match self.plan.form {
            Form::Assembly if self.random.chance(30) => Home::Data,
            Form::Text | Form::BareText if self.random.chance(25) => Home::At(self.bit(false)),
            _ => Home::Any,
        }
    }

    /// What the front end makes of programs without a configuration.
    fn bare(&mut self) {
        let trigger = Trigger::Cyclic { interval_us: 10_000, phase_us: 0, policy: Policy::Grid, single: None };
        self.plan.tasks = vec![Task { trigger, priority: 0, enabled: true, watchdog_us: 0, sensitivity: 0 }];
        let instance = |program| Instance { program, task: Some(0), source: None, sink: None };
        self.plan.instances = (0..self.plan.programs.len()).map(instance).collect();
    }

    fn configuration(&mut self) {
        let tasks = self.random.between(1, MOST_TASKS) as usize;
        let instances = self.random.between(1, 2 + tasks as i64 * 3 / 2) as usize;
        let without_task = self.plan.form == Form::Text && self.random.chance(30);
        for at in 0..instances {
            let program = self.random.below(self.plan.programs.len());
            // The first has a task, so that tasks that are written never stand for nothing.
            let alone = without_task && at > 0 && self.random.chance(30);
            let task = (!alone).then(|| self.random.below(tasks));
            let source = self.random.chance(40).then(|| self.shared(true));
            let sink = self.random.chance(30).then(|| self.shared(false));
            self.plan.instances.push(Instance { program, task, source, sink });
        }
        self.plan.tasks = (0..tasks).map(|_| self.task()).collect();
        if self.plan.instances.iter().any(|instance| instance.task.is_none()) {
            let trigger = Trigger::Freewheeling;
            self.plan.tasks.push(Task { trigger, priority: u16::MAX, enabled: true, watchdog_us: 0, sensitivity: 0 });
        }
    }

    fn task(&mut self) -> Task {
        let trigger = match self.random.weighted(&[52, 33, 15]) {
            0 => Trigger::Cyclic {
                interval_us: self.interval_us(),
                phase_us: if self.random.chance(25) {
                    self.interval_us() * self.random.between(0, 3) as u64
                } else {
                    0
                },
                policy: self.random.one_of([Policy::Grid, Policy::AtOnce, Policy::Realign]),
                single: self.random.chance(30).then(|| self.single()),
            },
            1 => Trigger::Event(self.single()),
            _ => Trigger::Freewheeling,
        };
        let watchdog_us = if self.watched && self.random.chance(50) { self.watchdog_us() } else { 0 };
        Task {
            trigger,
            priority: self.random.one_of([0, 1, 1, 2, 5, 65_535]),
            enabled: self.plan.form != Form::Assembly || !self.random.chance(8),
            watchdog_us,
            sensitivity: if self.watched { self.random.one_of([0, 1, 2, 3]) } else { 0 },
        }
    }

    fn interval_us(&mut self) -> u64 {
        let factor = self.random.one_of([1, 2, 3, 5, 7, 10, 13, 20]);
        let odd = u64::from(self.random.chance(20));
        self.scale_us * factor + odd
    }

    /// Under fuel a microsecond is 1000 units, about what three short programs cost.
    fn watchdog_us(&mut self) -> u64 {
        match self.plan.time {
            Time::Virtual | Time::MovingWithFuel => self.random.one_of([1, 1, 2, 3, 5, 20]),
            Time::MovingWithDeadlines => self.interval_us() * self.random.one_of([1, 1, 2, 3]),
        }
    }

    fn single(&mut self) -> Single {
        match self.random.weighted(&[40, 20, 32, 8]) {
            0 => Single::Global(self.random.below(self.plan.globals.len())),
            1 => {
                let instance = self.random.below(self.plan.instances.len());
                Single::Instance(instance, self.random.one_of([Place::Flag, Place::Sink, Place::Source]))
            }
            2 => Single::Bit(self.bit(true)),
            _ => Single::Literal(self.random.chance(60)),
        }
    }

    fn bit(&mut self, with_inputs: bool) -> Bit {
        let (area, byte, bit) = self.random.one_of(BITS);
        if area == Area::Input && !with_inputs {
            Bit { area: Area::Memory, byte, bit }
        } else {
            Bit { area, byte, bit }
        }
    }

    /// A BOOL that everybody sees.
    fn shared(&mut self, with_inputs: bool) -> Place {
        if self.random.chance(60) {
            Place::Global(self.random.below(self.plan.globals.len()))
        } else {
            Place::Bit(self.bit(with_inputs))
        }
    }

    /// A BOOL that a body writes (`to_write`) or reads; `once`: of init or startup function.
    fn place(&mut self, once: bool, to_write: bool) -> Place {
        let own = if to_write { Place::Sink } else { Place::Source };
        match self.random.weighted(&[if once { 0 } else { 25 }, if once { 0 } else { 15 }, 60]) {
            0 => Place::Flag,
            1 => own,
            _ => self.shared(!to_write),
        }
    }

    fn condition(&mut self, once: bool) -> Condition {
        let counter = if once {
            self.random.one_of([Counter::Starts, Counter::Order])
        } else {
            self.random.one_of([Counter::Runs, Counter::Runs, Counter::Kept, Counter::Order, Counter::Starts])
        };
        if self.random.chance(40) {
            let place = self.place(once, false);
            return Condition::Is(place, self.random.chance(50));
        }
        let modulus = self.random.between(2, 6);
        Condition::Every(counter, modulus, self.random.between(0, modulus - 1))
    }

    fn body(&mut self, once: bool) -> Vec<Action> {
        let count = self.random.between(1, 5);
        (0..count).map(|_| self.action(once)).collect()
    }

    fn action(&mut self, once: bool) -> Action {
        let when = self.random.chance(50).then(|| self.condition(once));
        let burns = if self.watched { 22 } else { 4 };
        match self.random.weighted(&[80, burns, 3]) {
            0 => {
                let place = self.place(once, true);
                let literal = self.random.chance(40);
                let value =
                    if literal { Value::Literal(self.random.chance(60)) } else { Value::Holds(self.condition(once)) };
                Action { when, deed: Deed::Set(place, value) }
            }
            1 => Action { when, deed: Deed::Burn(self.random.one_of([1, 20, 60, 120, 250, 700])) },
            _ => {
                let counter = if once {
                    Counter::Starts
                } else {
                    self.random.one_of([Counter::Runs, Counter::Order, Counter::Kept])
                };
                let value = if once { self.random.between(2, 4) } else { self.random.between(3, 60) };
                Action { when: Some(Condition::Once(counter, value)), deed: Deed::Trap }
            }
        }
    }

    /// Init and startup function.
    fn once(&mut self) {
        if self.plan.form == Form::Assembly && self.random.chance(25) {
            let mut actions = self.body(true);
            // The counter begins where the init function sets it.
            if self.random.chance(5) {
                actions.push(Action { when: None, deed: Deed::Trap });
            }
            self.plan.init = Some(actions);
        }
        if self.random.chance(30) {
            let mut actions = self.body(true);
            if self.plan.init.is_some() {
                for action in &mut actions {
                    if let Some(Condition::Once(Counter::Starts, value)) = &mut action.when {
                        *value += INIT_STARTS;
                    }
                }
            }
            self.plan.startup = Some(actions);
        }
        if self.watched && self.random.chance(25) {
            self.plan.watchdog_us = self.watchdog_us();
        }
    }

    fn rows(&mut self) {
        let bits = self.plan.bits().into_iter().filter(|bit| bit.area == Area::Input && bit.byte == 0);
        let bits: Vec<Bit> = bits.collect();
        let mut time_us = 0;
        for _ in 0..self.random.below(13) {
            time_us += self.random.one_of([0, 0, 1, self.scale_us, self.scale_us * 3, self.scale_us * 17 + 1]);
            let value = self.random.chance(55);
            if let Some(bit) = self.random.pick(&bits) {
                self.plan.rows.push(Row { time_us, bit: *bit, value });
            }
        }
    }

    fn world(&mut self) {
        // Ends that meet a grid point or a watchdog exactly are those where rules differ by one.
        let mut times: Vec<u64> = vec![self.scale_us * 1000];
        for task in &self.plan.tasks {
            if let Trigger::Cyclic { interval_us, .. } = task.trigger {
                times.push(interval_us * 1000);
            }
            if task.watchdog_us > 0 {
                times.push(task.watchdog_us * 1000);
                times.push(task.watchdog_us * 1000 * u64::from(task.sensitivity.max(1)));
            }
        }
        for _ in 0..self.random.between(2, 8) {
            let time = *self.random.pick(&times).unwrap_or(&1000);
            let factor = self.random.one_of([1, 1, 1, 2, 3]);
            let delay = match self.random.below(6) {
                0 => time * factor + 1,
                1 => (time * factor).saturating_sub(1),
                2 => time / 2,
                3 => time / 3,
                _ => time * factor,
            };
            self.plan.delays_ns.push(delay);
        }
        if self.random.chance(50) {
            self.plan.input_poll_ns = self.interval_us() * 1000;
        }
    }

    fn commands(&mut self) {
        if self.random.chance(95) {
            self.plan.commands.push(Command::Start);
        }
        for _ in 0..self.random.between(2, 9) {
            let command = match self.random.weighted(&[30, 28, 14, 6, 5, 4, 3, 2, 6]) {
                0 => Command::Run {
                    scans: self.random.between(0, 40) as u64,
                    stop_after: self.random.one_of([1, 20, 60, 60]),
                },
                1 => Command::Start,
                2 => Command::Step(self.random.between(1, 24) as u64),
                3 => Command::Stop,
                4 => Command::ResetWarm,
                5 => Command::ResetCold,
                6 => Command::ResetOrigin,
                7 => Command::ClearStatistics,
                _ => Command::Force(self.random.below(self.plan.globals.len()), self.random.chance(50)),
            };
            self.plan.commands.push(command);
        }
    }
}
