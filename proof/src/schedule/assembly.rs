//! A plan as the assembly text of a container: also what Structured Text has no words for.

use std::fmt::Write;

use super::memory::{GLOBAL_NAMES, INIT_ORDER, INIT_STARTS, OWN_NAMES};
use super::plan::{Action, Area, Bit, Condition, Counter, Deed, Home, Place, Plan, Single, Task, Trigger, Value};

/// Slots of an instance: [`OWN_NAMES`] in their order, the last three of them BOOLs.
const OWN_BOOLS: usize = 3;
/// Types of the debug section, by position.
const DEBUG_TYPES: [&str; 4] = ["LINT", "BOOL", "LTIME", "TIME"];

/// The text of a container. A String takes everything that is written to it.
#[must_use]
pub fn print(plan: &Plan) -> String {
    let mut out = Printer { plan, text: String::new(), labels: 0 };
    out.memory();
    for (at, task) in plan.tasks.iter().enumerate() {
        out.task(at, task);
    }
    for (at, instance) in plan.instances.iter().enumerate() {
        let task = instance.task.unwrap_or(plan.tasks.len() - 1);
        out.line(&format!("instance i{at} task t{task} entry run{at}"));
    }
    for at in 0..plan.instances.len() {
        out.instance(at);
    }
    out.once("initialise", plan.init.as_deref());
    out.once("startup", plan.startup.as_deref());
    out.debug();
    out.text
}

struct Printer<'p> {
    plan: &'p Plan,
    text: String,
    labels: u32,
}

impl Printer<'_> {
    fn line(&mut self, line: &str) {
        let _ = writeln!(self.text, "{line}");
    }

    /// Where the slots of an instance begin.
    fn first_slot(&self, instance: usize) -> usize {
        let shared = GLOBAL_NAMES.len() + 2 + self.plan.globals.iter().filter(|home| **home != Home::Data).count();
        shared + instance * OWN_NAMES.len()
    }

    /// Slot of the variable `name` of an instance.
    fn own_slot(&self, instance: usize, name: &str) -> usize {
        self.first_slot(instance) + OWN_NAMES.iter().position(|own| *own == name).unwrap_or(0)
    }

    fn memory(&mut self) {
        for (word, area) in [("inputs", Area::Input), ("outputs", Area::Output), ("memory", Area::Memory)] {
            let last = self.plan.bits().into_iter().filter(|bit| bit.area == area).map(|bit| bit.byte + 1).max();
            if let Some(bytes) = last {
                self.line(&format!("{word} {bytes}"));
            }
        }
        self.line("type bool scalar b1");
        for name in GLOBAL_NAMES {
            self.line(&format!("global {name} i64"));
        }
        self.line("global ltime i64\nglobal time i64\nsystem up_time time\nsystem up_ltime ltime");
        for (at, home) in self.plan.globals.iter().enumerate() {
            let line = if *home == Home::Data { format!("data b{at} bool") } else { format!("global b{at} b1") };
            self.line(&line);
        }
        let used = |program: &usize| self.plan.instances.iter().any(|instance| instance.program == *program);
        for program in (0..self.plan.programs.len()).filter(used) {
            self.line(&format!("program P{program}"));
            for (at, name) in OWN_NAMES.iter().enumerate() {
                let storage = if at + OWN_BOOLS < OWN_NAMES.len() { "i64" } else { "b1" };
                self.line(&format!("slot {name} {storage}"));
            }
        }
        let starts = GLOBAL_NAMES.iter().position(|name| *name == "starts").unwrap_or(0);
        self.line(&format!("retain s {} 8", starts * 8));
        for instance in 0..self.plan.instances.len() {
            let slot = self.own_slot(instance, "kept");
            self.line(&format!("retain s {} 8", slot * 8));
        }
    }

    fn task(&mut self, at: usize, task: &Task) {
        let mut line = format!("task t{at} ");
        let _ = match task.trigger {
            Trigger::Cyclic { interval_us, phase_us, policy, .. } => {
                write!(line, "cyclic {interval_us} phase {phase_us} policy {}", policy.name())
            }
            Trigger::Event(_) => write!(line, "event"),
            Trigger::Freewheeling => write!(line, "freewheeling"),
        };
        let _ =
            write!(line, " priority {} watchdog {} sensitivity {}", task.priority, task.watchdog_us, task.sensitivity);
        if let Some(single) = task.single() {
            let _ = match single {
                Single::Global(global) if self.plan.globals[global] == Home::Data => {
                    write!(line, " single data b{global}")
                }
                Single::Global(global) => write!(line, " single slot b{global}"),
                Single::Instance(instance, place) => {
                    let slot = self.own_slot(instance, own_name(place));
                    write!(line, " single slot {slot}")
                }
                Single::Bit(bit) => write!(line, " single bit {} {} {}", letter(bit), bit.byte, bit.bit),
                Single::Literal(value) => write!(line, " single {value}"),
            };
        }
        if !task.enabled {
            line.push_str(" disabled");
        }
        self.line(&line);
    }

    fn instance(&mut self, at: usize) {
        let instance = self.plan.instances[at].clone();
        self.line(&format!("function run{at} program P{}", instance.program));
        if let Some(place) = instance.source {
            self.load(place);
            self.store(Place::Source);
        }
        self.increment("g order");
        self.increment("p runs");
        self.increment("p kept");
        for (from, to) in [("g order", "p seen"), ("g ltime", "p time"), ("g time", "p time_ms")] {
            self.line(&format!("slot.load {from}\nslot.store {to}"));
        }
        self.actions(&self.plan.programs[instance.program].clone(), "p spent");
        self.line("slot.load p runs\nslot.store p done");
        if let Some(place) = instance.sink {
            self.load(Place::Sink);
            self.store(place);
        }
        self.line("return\nend");
    }

    /// Init or startup function.
    fn once(&mut self, name: &str, actions: Option<&[Action]>) {
        let Some(actions) = actions else { return };
        let is_init = name == "initialise";
        let word = if is_init { "initialize" } else { "startup" };
        self.line(&format!("{word} {name}\nfunction {name}"));
        if is_init {
            self.number(INIT_STARTS);
            self.line("slot.store g starts");
            self.number(INIT_ORDER);
            self.line("slot.store g order");
        } else {
            self.increment("g starts");
            self.increment("g order");
        }
        self.actions(actions, "g burnt");
        self.line("return\nend");
    }

    fn number(&mut self, value: i64) {
        self.line(&format!("const.i32 {value}\ni64.extend_i32_s"));
    }

    fn increment(&mut self, slot: &str) {
        self.line(&format!("slot.load {slot}"));
        self.number(1);
        self.line(&format!("i64.add\nslot.store {slot}"));
    }

    fn label(&mut self) -> String {
        self.labels += 1;
        format!("label{}", self.labels)
    }

    fn actions(&mut self, actions: &[Action], spent: &str) {
        for action in actions {
            let after = self.label();
            if let Some(condition) = action.when {
                self.condition(condition);
                self.line(&format!("jump.unless {after}"));
            }
            match action.deed {
                Deed::Set(place, Value::Literal(value)) => {
                    self.line(&format!("const.i32 {}", u8::from(value)));
                    self.store(place);
                }
                Deed::Set(place, Value::Holds(condition)) => {
                    self.condition(condition);
                    self.store(place);
                }
                Deed::Burn(passes) => self.burn(passes, spent),
                Deed::Trap => self.line("const.i32 1\nconst.i32 0\ni32.div_s\ndrop"),
            }
            self.line(&format!("{after}:"));
        }
    }

    /// `spent` goes up to what it is and so many more.
    fn burn(&mut self, passes: i32, spent: &str) {
        let (header, done) = (self.label(), self.label());
        self.number(i64::from(passes));
        self.line(&format!("{header}:"));
        self.line(&format!("dup\ni64.eqz\njump.if {done}"));
        self.number(1);
        self.line("i64.sub");
        self.increment(spent);
        self.line(&format!("jump {header}\n{done}:\ndrop"));
    }

    /// Pushes whether a condition holds.
    fn condition(&mut self, condition: Condition) {
        match condition {
            Condition::Every(counter, modulus, remainder) => {
                self.counter(counter);
                self.number(modulus);
                self.line("i64.rem_s");
                self.number(remainder);
                self.line("i64.eq");
            }
            Condition::Once(counter, value) => {
                self.counter(counter);
                self.number(value);
                self.line("i64.eq");
            }
            Condition::Is(place, value) => {
                self.load(place);
                if !value {
                    self.line("i32.eqz");
                }
            }
        }
    }

    fn counter(&mut self, counter: Counter) {
        self.line(match counter {
            Counter::Runs => "slot.load p runs",
            Counter::Kept => "slot.load p kept",
            Counter::Order => "slot.load g order",
            Counter::Starts => "slot.load g starts",
        });
    }

    fn load(&mut self, place: Place) {
        self.access(place, "load");
    }

    fn store(&mut self, place: Place) {
        self.access(place, "store");
    }

    fn access(&mut self, place: Place, verb: &str) {
        let line = match place {
            Place::Global(global) if self.plan.globals[global] == Home::Data => format!("{verb} d b1 b{global}"),
            Place::Global(global) => format!("slot.{verb} g b{global}"),
            Place::Flag | Place::Source | Place::Sink => format!("slot.{verb} p {}", own_name(place)),
            Place::Bit(bit) => format!("{verb}.bit {} {} {}", letter(bit), bit.byte, bit.bit),
        };
        self.line(&line);
    }

    fn debug(&mut self) {
        self.line("debug\n  resource \"cpu\"\n  configuration \"plant\"");
        let instances = 0..self.plan.instances.len();
        let once = [("initialise", self.plan.init.is_some()), ("startup", self.plan.startup.is_some())];
        let once = once.into_iter().filter(|(_, has)| *has).map(|(name, _)| name.to_string());
        let functions: Vec<String> = instances.clone().map(|at| format!("run{at}")).chain(once).collect();
        functions.iter().for_each(|name| self.line(&format!("  function \"{name}\"")));
        instances.clone().for_each(|at| self.line(&format!("  instance \"i{at}\"")));
        DEBUG_TYPES.iter().for_each(|name| self.line(&format!("  type elementary {name}")));
        for (slot, name) in GLOBAL_NAMES.iter().enumerate() {
            self.line(&format!("  variable \"{name}\" slot {slot} 0"));
        }
        let (mut slot, mut byte) = (GLOBAL_NAMES.len() + 2, 16);
        for (at, home) in self.plan.globals.iter().enumerate() {
            if *home == Home::Data {
                self.line(&format!("  variable \"b{at}\" bytes d {byte} 1"));
                byte += 1;
            } else {
                self.line(&format!("  variable \"b{at}\" slot {slot} 1"));
                slot += 1;
            }
        }
        for instance in instances {
            for (at, name) in OWN_NAMES.iter().enumerate() {
                let ty = match *name {
                    "time" => 2,
                    "time_ms" => 3,
                    _ => usize::from(at + OWN_BOOLS >= OWN_NAMES.len()),
                };
                let slot = self.first_slot(instance) + at;
                self.line(&format!("  variable \"i{instance}.{name}\" slot {slot} {ty}"));
            }
        }
        self.line("end");
    }
}

/// The instance's variable that a place is.
fn own_name(place: Place) -> &'static str {
    match place {
        Place::Flag => "flag",
        Place::Source => "source",
        Place::Sink => "sink",
        Place::Global(_) | Place::Bit(_) => "",
    }
}

fn letter(bit: Bit) -> char {
    match bit.area {
        Area::Input => 'i',
        Area::Output => 'q',
        Area::Memory => 'm',
    }
}
