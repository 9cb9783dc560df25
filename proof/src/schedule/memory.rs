//! What the plan's programs do to their variables: each by name, each action as it is written.

use std::collections::BTreeMap;

use khz_bytecode::trap::TrapCode;

use super::plan::{Action, Area, Bit, Condition, Counter, Deed, Form, Instance, Place, Plan, Value};

/// Variables that every instance has, as `instance.name`.
pub const OWN_NAMES: [&str; 10] =
    ["runs", "seen", "time", "time_ms", "done", "spent", "kept", "flag", "source", "sink"];
/// Global counters.
pub const GLOBAL_NAMES: [&str; 3] = ["order", "starts", "burnt"];
/// What the init function sets `starts` to.
pub const INIT_STARTS: i64 = 500;
/// What the init function sets `order` to.
pub const INIT_ORDER: i64 = 1000;

impl Plan {
    /// The name of an instance.
    #[must_use]
    pub fn instance_name(&self, instance: usize) -> String {
        // Without a configuration an instance is named as its program.
        if self.form == Form::BareText { format!("P{instance}") } else { format!("i{instance}") }
    }

    /// Names of all variables: global counters, BOOL globals that are no bits, each instance's own, bits.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = GLOBAL_NAMES.iter().map(ToString::to_string).collect();
        names.extend(
            (0..self.globals.len()).filter(|global| self.located(*global).is_none()).map(|at| format!("b{at}")),
        );
        for instance in 0..self.instances.len() {
            let of = self.instance_name(instance);
            names.extend(OWN_NAMES.iter().map(|own| format!("{of}.{own}")));
        }
        names.extend(self.bits().into_iter().map(Bit::address));
        names
    }
}

/// All variables by name.
#[derive(Debug, Clone)]
pub struct Memory {
    plan: Plan,
    names: Vec<String>,
    values: BTreeMap<String, i64>,
}

impl Memory {
    /// Everything 0.
    pub fn new(plan: &Plan) -> Self {
        let names = plan.names();
        let values = names.iter().map(|name| (name.clone(), 0)).collect();
        Memory { plan: plan.clone(), names, values }
    }

    /// The values in the order of the names.
    pub fn values(&self) -> Vec<Option<i64>> {
        self.names.iter().map(|name| Some(self.values[name])).collect()
    }

    /// Takes over values.
    pub fn adopt(&mut self, values: &[Option<i64>]) {
        for (name, value) in self.names.iter().zip(values) {
            if let Some(value) = value {
                self.values.insert(name.clone(), *value);
            }
        }
    }

    /// Everything 0 again.
    pub fn reset(&mut self) {
        self.values.values_mut().for_each(|value| *value = 0);
    }

    /// Values that a warm reset keeps.
    pub fn retained(&self) -> BTreeMap<String, i64> {
        let is_kept = |name: &String| name == "starts" || name.ends_with(".kept");
        self.values.iter().filter(|(name, _)| is_kept(name)).map(|(name, value)| (name.clone(), *value)).collect()
    }

    /// Puts retained values back.
    pub fn restore(&mut self, kept: BTreeMap<String, i64>) {
        self.values.extend(kept);
    }

    fn get(&self, name: &str) -> i64 {
        self.values.get(name).copied().unwrap_or(0)
    }

    fn set(&mut self, name: &str, value: i64) {
        if let Some(found) = self.values.get_mut(name) {
            *found = value;
        }
    }

    fn add(&mut self, name: &str, by: i64) {
        self.set(name, self.get(name) + by);
    }

    /// A BOOL of an instance, or one that all see.
    pub fn read(&self, place: Place, instance: &str) -> bool {
        self.get(&self.name_of(place, instance)) != 0
    }

    /// Writes a BOOL.
    pub fn write(&mut self, place: Place, instance: &str, value: bool) {
        self.set(&self.name_of(place, instance), i64::from(value));
    }

    /// The bytes of %Q, `length` of them.
    pub fn outputs(&self, length: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        for byte in 0..length {
            let bit = |bit| self.get(&Bit { area: Area::Output, byte, bit }.address()) != 0;
            bytes.push((0..8).map(|at| u8::from(bit(at)) << at).sum());
        }
        bytes
    }

    /// Runs an instance in a round at `time_ns`.
    pub fn run_instance(&mut self, plan: &Plan, at: usize, time_ns: u64) -> Result<(), TrapCode> {
        let Instance { program, source, sink, .. } = plan.instances[at];
        let own = plan.instance_name(at);
        if let Some(place) = source {
            self.write(Place::Source, &own, self.read(place, &own));
        }
        self.add("order", 1);
        self.add(&format!("{own}.runs"), 1);
        self.add(&format!("{own}.kept"), 1);
        self.set(&format!("{own}.seen"), self.get("order"));
        self.set(&format!("{own}.time"), time_ns as i64);
        self.set(&format!("{own}.time_ms"), (time_ns / 1_000_000 * 1_000_000) as i64);
        self.act(&plan.programs[program], &own, &format!("{own}.spent"))?;
        self.set(&format!("{own}.done"), self.get(&format!("{own}.runs")));
        if let Some(place) = sink {
            self.write(place, &own, self.read(Place::Sink, &own));
        }
        Ok(())
    }

    /// Runs the init function.
    pub fn run_init(&mut self, actions: &[Action]) -> Result<(), TrapCode> {
        self.set("starts", INIT_STARTS);
        self.set("order", INIT_ORDER);
        self.act(actions, "", "burnt")
    }

    /// Runs the startup function.
    pub fn run_startup(&mut self, actions: &[Action]) -> Result<(), TrapCode> {
        self.add("starts", 1);
        self.add("order", 1);
        self.act(actions, "", "burnt")
    }

    fn act(&mut self, actions: &[Action], own: &str, spent: &str) -> Result<(), TrapCode> {
        for action in actions {
            if action.when.is_some_and(|condition| !self.holds(condition, own)) {
                continue;
            }
            match action.deed {
                Deed::Set(place, Value::Literal(value)) => self.write(place, own, value),
                Deed::Set(place, Value::Holds(condition)) => {
                    let value = self.holds(condition, own);
                    self.write(place, own, value);
                }
                Deed::Burn(passes) => self.add(spent, i64::from(passes)),
                Deed::Trap => return Err(TrapCode::DivideByZero),
            }
        }
        Ok(())
    }

    fn holds(&self, condition: Condition, own: &str) -> bool {
        match condition {
            Condition::Every(counter, modulus, remainder) => self.count(counter, own) % modulus == remainder,
            Condition::Once(counter, value) => self.count(counter, own) == value,
            Condition::Is(place, value) => self.read(place, own) == value,
        }
    }

    /// The whole name of a BOOL.
    fn name_of(&self, place: Place, own: &str) -> String {
        match place {
            Place::Global(global) => self.plan.located(global).map_or_else(|| format!("b{global}"), Bit::address),
            Place::Flag => format!("{own}.flag"),
            Place::Source => format!("{own}.source"),
            Place::Sink => format!("{own}.sink"),
            Place::Bit(bit) => bit.address(),
        }
    }

    fn count(&self, counter: Counter, own: &str) -> i64 {
        self.get(&counter_name(counter, own))
    }
}

/// The whole name of a counter.
fn counter_name(counter: Counter, own: &str) -> String {
    match counter {
        Counter::Runs => format!("{own}.runs"),
        Counter::Kept => format!("{own}.kept"),
        Counter::Order => "order".to_string(),
        Counter::Starts => "starts".to_string(),
    }
}
