//! The oracle of generated Structured Text: compiled and run in both engines, against the tree run directly.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::campaign::Figures;
use crate::oracle::Maker;
use crate::random::Random;
use crate::st::constants::has_trap;
use crate::st::coverage::Coverage;
use crate::st::evaluate::{Evaluator, Stop};
use crate::st::position::Positions;
use crate::st::print::{print, print_positions};
use crate::st::rounds::Rounds;
use crate::st::shrink::shrink;
use crate::st::text::text_in;
use crate::st::tree::{Def, Source, Ty, Value};
use crate::st::{Size, generate};
use khz_bytecode::container::{Container, SystemVariableKind, TaskType};
use khz_bytecode::trap::TrapCode;
use khz_bytecode::verify::{Verified, verify};
use khz_jit::{Jit, JitOptions, Passes};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Fuel, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::report::describe;
use khz_machine::trap::{CodePlace, Trap};
use khz_machine::variables::{Variable, VariableTable, VariableValue};
use khz_scheduler::{
    FaultPlace, FaultReport, Hooks, LoadOptions, NoInputs, NoIo, NoObserver, Observer, Resource, Running, TaskIndex,
    TimeNs, VirtualClock,
};

const STEPS: u64 = 100_000;
const FUEL: u64 = 1 << 40;
/// The watchdog of tasks whose code charges fuel: longer than anything here runs.
const WATCHDOG_US: u64 = 1_000_000_000;
const IMAGE_LIMIT_BYTES: u64 = 1 << 22;

/// How much is done with each program.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Scans or rounds.
    pub scans: u64,
    /// One of how many programs is also run by code that charges fuel, which does not end.
    pub fuel: u64,
    /// Of one of how many programs it is noted which passes of native code changed something.
    pub passes: u64,
}

impl Default for Plan {
    fn default() -> Self {
        Plan { scans: 10, fuel: 4, passes: 16 }
    }
}

/// What a search reached.
#[derive(Default)]
pub struct Tally {
    /// Programs that were run.
    pub programs: u64,
    /// Their scans or rounds.
    pub scans: u64,
    /// Values of variables that were compared.
    pub values: u64,
    /// Programs whose own meaning did not come to an end in a bounded number of steps.
    pub too_long: u64,
    /// Globals that nothing uses, which the compiler left out.
    pub unused: u64,
    /// Refused where the tree, too, has a trap that constants alone make: no generated program has one, only what was made of one.
    pub refused: u64,
    /// Programs that native code of another kind ran too: without one of its passes, or in small parts.
    pub with_variant: u64,
    /// Task cycles whose place in their round was compared.
    pub cycles: u64,
    /// Programs that code with fuel ran too.
    pub with_fuel: u64,
    /// Programs whose passes were noted, and of how many each pass changed something.
    pub noted: u64,
    /// See `noted`.
    pub passes: BTreeMap<&'static str, u64>,
    /// Programs by the trap that ended them.
    pub traps: BTreeMap<String, u64>,
    /// What of the language was in them.
    pub coverage: Coverage,
}

impl Figures for Tally {
    fn merge(&mut self, later: Self) {
        self.programs += later.programs;
        self.scans += later.scans;
        self.values += later.values;
        self.too_long += later.too_long;
        self.unused += later.unused;
        self.refused += later.refused;
        self.with_variant += later.with_variant;
        self.cycles += later.cycles;
        self.with_fuel += later.with_fuel;
        self.noted += later.noted;
        later.passes.into_iter().for_each(|(name, count)| *self.passes.entry(name).or_default() += count);
        later.traps.into_iter().for_each(|(name, count)| *self.traps.entry(name).or_default() += count);
        self.coverage.merge(later.coverage);
    }
}

impl Tally {
    /// The figures, for people.
    pub fn report(&self) -> String {
        let unmet = |names: Vec<&'static str>, met: &dyn Fn(&str) -> bool| {
            let total = names.len();
            let missing: Vec<_> = names.into_iter().filter(|name| !met(name)).collect();
            format!("{} of {total}, not reached: {missing:?}", total - missing.len())
        };
        let traps =
            unmet(TrapCode::ALL.iter().map(|code| code.name()).collect(), &|name| self.traps.contains_key(name));
        let passes = unmet(Passes::NAMES.to_vec(), &|name| self.passes.get(name).is_some_and(|count| *count > 0));
        format!(
            "{}\ntraps {traps}; programs {:?}\npasses {passes}; programs of {} {:?}\n{} programs compared, {} refused for a constant trap of the tree; {} scans, {} values, {} task cycles; {} without an end in time, {} values of unused globals; {} also with fuel, {} also without one pass or in small parts",
            self.coverage.report(),
            self.traps,
            self.noted,
            self.passes,
            self.programs,
            self.refused,
            self.scans,
            self.values,
            self.cycles,
            self.too_long,
            self.unused,
            self.with_fuel,
            self.with_variant,
        )
    }
}

/// A difference: what kind, for the shrinker, and the words for people.
#[derive(Debug)]
pub struct Found {
    /// Its kind: a smaller program must differ in the same way.
    pub class: String,
    /// What differs, for people.
    pub text: String,
}

fn found(class: impl Into<String>, text: impl Into<String>) -> Found {
    Found { class: class.into(), text: text.into() }
}

struct Machine {
    name: String,
    engine: Box<dyn Engine>,
    image: Image,
    fuel: bool,
}

/// The one NaN for all.
fn same(source: &Source, ty: Ty, wanted: &Value, got: &VariableValue) -> bool {
    match (wanted, got) {
        (Value::Int(a), VariableValue::Bool(b)) => *a == i128::from(*b),
        (Value::Int(a), VariableValue::Signed(b)) => *a == i128::from(*b),
        (Value::Int(a), VariableValue::Unsigned(b)) => *a == i128::from(*b),
        (Value::Int(a), VariableValue::Time(_, b)) => *a == i128::from(*b),
        (Value::Real(a), VariableValue::Real(b)) if a.is_nan() => b.to_bits() == 0xFFC0_0000,
        (Value::Real(a), VariableValue::Real(b)) => a.to_bits() == b.to_bits(),
        (Value::Lreal(a), VariableValue::Lreal(b)) if a.is_nan() => b.to_bits() == 0xFFF8_0000_0000_0000,
        (Value::Lreal(a), VariableValue::Lreal(b)) => a.to_bits() == b.to_bits(),
        (Value::Str(a), VariableValue::String(b)) => text_in(a).iter().copied().eq(b.iter().copied().map(u16::from)),
        (Value::Str(a), VariableValue::WideString(b)) => text_in(a) == b,
        (Value::Int(a), VariableValue::String(b)) => matches!(b[..], [b] if *a == i128::from(b)),
        (Value::Int(a), VariableValue::WideString(b)) => matches!(b[..], [b] if *a == i128::from(b)),
        (Value::Int(a), VariableValue::Named(name)) => match ty {
            Ty::N(id) => match &source.types[id].def {
                Def::Enum(_, values) => values
                    .iter()
                    .any(|(known, value)| name.rsplit(['#', '.']).next() == Some(known) && i128::from(*value) == *a),
                _ => false,
            },
            _ => false,
        },
        _ => false,
    }
}

fn set_time(image: &mut Image, container: &Container, now: i64) {
    for variable in &container.types.system_variables {
        let value = match variable.kind {
            SystemVariableKind::UpTime => now - now % 1_000_000,
            SystemVariableKind::UpLtime => now,
        };
        let at = image.layout().slots.start as usize + variable.slot.index() * 8;
        image.bytes_mut()[at..at + 8].copy_from_slice(&value.to_le_bytes());
    }
}

/// Compares one program; `seed` gives the times of its rounds.
///
/// # Errors
/// The first difference.
pub fn check(source: &Source, seed: u64, plan: Plan, tally: &mut Tally) -> Result<(), Found> {
    let (text, positions) = print_positions(source);
    check_text(&text, Some(&positions), source, seed, plan, tally)
}

/// Compares a text with a tree, and where things stand in the text if that is known.
///
/// # Errors
/// The first difference.
pub fn check_text(
    text: &str,
    positions: Option<&Positions>,
    source: &Source,
    seed: u64,
    plan: Plan,
    tally: &mut Tally,
) -> Result<(), Found> {
    let container = match super::engines::compile(text) {
        Ok(container) => container,
        // A program that is generated has none; what is made of one on the way to a smaller one may.
        Err(_) if has_trap(source) => {
            tally.refused += 1;
            return Ok(());
        }
        Err(refusal) => return Err(found(format!("refused {}", refusal.code), refusal.text)),
    };
    let verified = verify(container).map_err(|error| found("verifier", error.to_string()))?;
    let verified = Arc::new(verified);
    let layout = ImageLayout::new(verified.container(), IMAGE_LIMIT_BYTES)
        .map_err(|error| found("layout", error.to_string()))?;
    tally.programs += 1;
    tally.coverage.count(source, Size::of(seed));
    if plan.passes != 0 && seed.is_multiple_of(plan.passes) {
        note_passes(&verified, &layout, tally)?;
    }
    let judge = Judge { source, verified: &verified, positions, names: VariableTable::of(verified.container()) };
    let with_fuel = plan.fuel != 0 && seed % plan.fuel == 1 % plan.fuel;
    let machines = judge.machines(&layout, with_fuel, seed)?;
    tally.with_fuel += u64::from(machines.iter().any(|machine| machine.fuel));
    tally.with_variant += u64::from(super::engines::variant(seed).is_some());
    if source.config.is_some() {
        judge.rounds(machines, plan, tally)
    } else {
        judge.scans(machines, plan, Random::new(seed ^ 0x7469_6D65), tally)
    }
}

fn note_passes(verified: &Arc<Verified>, layout: &ImageLayout, tally: &mut Tally) -> Result<(), Found> {
    let options = JitOptions { note_passes: true, ..JitOptions::default() };
    let jit = Jit::new(verified.clone(), layout, options).map_err(|error| found("engine", error.to_string()))?;
    if let Some(fired) = jit.passes_fired() {
        tally.noted += 1;
        fired.rows().for_each(|(name, fired)| *tally.passes.entry(name).or_default() += u64::from(fired));
    }
    Ok(())
}

/// What the two sides of a comparison share.
struct Judge<'a> {
    source: &'a Source,
    verified: &'a Arc<Verified>,
    positions: Option<&'a Positions>,
    names: VariableTable,
}

/// Paths and types of the values that are compared, with where an image has them.
type Places = Vec<(String, Ty, Option<Variable>)>;

impl Judge<'_> {
    fn places(&self, evaluator: &Evaluator<'_>) -> Places {
        let wanted = evaluator.variables().into_iter();
        wanted.map(|(path, ty, _)| (path.clone(), ty, self.names.resolve(&path).ok())).collect()
    }

    fn line(&self, place: CodePlace) -> Option<(u32, u32)> {
        describe(place, self.verified.container()).source.map(|source| (source.line, source.column))
    }

    /// Whether a scan ended as the tree says, and where.
    fn same_ending(
        &self,
        place: &str,
        evaluator: &Evaluator<'_>,
        expected: &Result<(), Stop>,
        result: &Result<(), Trap>,
    ) -> Result<(), Found> {
        let (code, values, trap) = match (expected, result) {
            (Ok(()), Ok(())) => return Ok(()),
            (Err(Stop::Trap(code, values)), Err(trap)) if *code == trap.code => (code, values, trap),
            _ => return Err(found("result", format!("{place}: {result:?} instead of {expected:?}"))),
        };
        // What a step of zero shows besides is not written down.
        let shown = matches!(code, TrapCode::ArrayIndex) || (*code == TrapCode::Range && *values != [0; 3]);
        if shown && *values != trap.values {
            return Err(found("trap values", format!("{place}: {:?} instead of {values:?}", trap.values)));
        }
        let Some(positions) = self.positions else { return Ok(()) };
        let got = std::iter::once(trap.place).chain(trap.chain().iter().copied()).map(|place| self.line(place));
        for (number, (key, got)) in evaluator.trapped_at().iter().zip(got).enumerate() {
            let wanted = positions.of(*key);
            if wanted != got {
                let what = if number == 0 { "trap place" } else { "trap chain" };
                let text = format!("{place}: {code} at {got:?} instead of {wanted:?} (caller {number})");
                return Err(found(what, text));
            }
        }
        if trap.chain().len() + 1 < evaluator.trapped_at().len() {
            return Err(found("trap chain", format!("{place}: {} calls are shown", trap.chain().len())));
        }
        Ok(())
    }

    /// Whether an image holds what the tree says.
    fn same_values(
        &self,
        place: &str,
        evaluator: &Evaluator<'_>,
        places: &Places,
        image: &Image,
        tally: &mut Tally,
    ) -> Result<(), Found> {
        let mut wanted = Vec::with_capacity(places.len());
        evaluator.values(&mut wanted);
        for ((path, ty, variable), value) in places.iter().zip(wanted) {
            let Some(variable) = variable else {
                if path.starts_with("main.") {
                    return Err(found("name", format!("{place}: {path} is not in the dump")));
                }
                tally.unused += 1;
                continue;
            };
            let got = self.names.read(image, variable).map_err(|error| found("read", format!("{path}: {error}")))?;
            tally.values += 1;
            if !same(self.source, *ty, value, &got) {
                return Err(found("value", format!("{place}: {path} = {got:?} instead of {value:?}")));
            }
        }
        let (outputs, markers) = evaluator.image_bytes();
        for (area, range, wanted) in [("%Q", &image.layout().output, outputs), ("%M", &image.layout().memory, markers)]
        {
            let got = &image.bytes()[range.start as usize..range.end as usize];
            let count = got.len().min(wanted.len());
            if got[..count] != wanted[..count] {
                return Err(found("image", format!("{place}: {area} {got:X?} instead of {wanted:X?}")));
            }
        }
        Ok(())
    }

    /// Every engine, with fuel too where it is wanted, and perhaps native code of another kind.
    fn machines(&self, layout: &ImageLayout, with_fuel: bool, seed: u64) -> Result<Vec<Machine>, Found> {
        let variant = super::engines::variant(seed);
        let mut makers = super::engines::makers();
        makers.extend(variant.as_ref().map(|(name, make)| Maker::new(name, &**make)));
        let mut machines = Vec::new();
        for fuel in [false, true].into_iter().filter(|fuel| with_fuel || !fuel) {
            for maker in &makers {
                let made = (maker.make)(self.verified.clone(), layout, fuel);
                let engine = made.map_err(|error| found("engine", error))?;
                let name = format!("{}{}", maker.name, if fuel { " with fuel" } else { "" });
                let image = Image::new(layout.clone(), self.verified.container());
                machines.push(Machine { name, engine, image, fuel });
            }
        }
        Ok(machines)
    }

    /// Every program instance in every scan, at times of the seed.
    fn scans(
        &self,
        mut machines: Vec<Machine>,
        plan: Plan,
        mut random: Random,
        tally: &mut Tally,
    ) -> Result<(), Found> {
        for machine in &mut machines {
            run(machine, Entry::Init).map_err(|trap| found("init", format!("{trap:?}")))?;
        }
        let mut evaluator = Evaluator::new(self.source, STEPS);
        let places = self.places(&evaluator);
        let mut now = 0;
        for scan in 0..plan.scans {
            evaluator.input_bytes().iter_mut().for_each(|byte| *byte = random.bits() as u8);
            let inputs = evaluator.input_bytes().to_vec();
            let expected = evaluator.scan(now);
            if expected == Err(Stop::TooLong) {
                tally.too_long += 1;
                return Ok(());
            }
            tally.scans += 1;
            for machine in &mut machines {
                set_time(&mut machine.image, self.verified.container(), now);
                set_inputs(&mut machine.image, &inputs);
                let result = run(machine, Entry::Instance(0));
                let place = format!("{} scan {scan}", machine.name);
                self.same_ending(&place, &evaluator, &expected, &result)?;
                self.same_values(&place, &evaluator, &places, &machine.image, tally)
                    .map_err(|found| after(found, &expected))?;
            }
            let images = machines.iter().map(|machine| (machine.name.as_str(), &machine.image));
            same_images(&format!("scan {scan}"), images)?;
            if let Err(Stop::Trap(code, _)) = expected {
                *tally.traps.entry(code.to_string()).or_default() += 1;
                return Ok(());
            }
            now += random.one_of([0, 1, 10_000_000, 7_500_000, 20_000_001]);
        }
        Ok(())
    }

    /// The rounds of a CONFIGURATION in the scheduler, on the virtual clock.
    fn rounds(&self, machines: Vec<Machine>, plan: Plan, tally: &mut Tally) -> Result<(), Found> {
        let mut evaluator = Evaluator::new(self.source, STEPS);
        let started = evaluator.start();
        let mut running: Vec<(String, Resource<Running>)> = Vec::new();
        for Machine { name, engine, fuel, .. } in machines {
            let watchdog_us = if fuel { WATCHDOG_US } else { 0 };
            let options = LoadOptions { max_image_bytes: IMAGE_LIMIT_BYTES, watchdog_us, ..LoadOptions::default() };
            let loaded = Resource::load(self.verified.clone(), engine, Box::new(VirtualClock::new()), &options);
            let stopped = loaded.map_err(|error| found("load", error.to_string()))?;
            let place = format!("{name} start");
            let result = match stopped.start() {
                Ok(resource) => {
                    running.push((name, resource));
                    Ok(())
                }
                Err(faulted) => Err(faulted.report().trap),
            };
            self.same_ending(&place, &evaluator, &started, &result)?;
        }
        if started.is_err() {
            return Ok(());
        }
        let places = self.places(&evaluator);
        let mut rounds = Rounds::new(self.source);
        for _ in 0..plan.scans {
            let expected = rounds.run(&mut evaluator);
            if expected == Err(Stop::TooLong) {
                tally.too_long += 1;
                return Ok(());
            }
            tally.scans += 1;
            let side = RoundSide { evaluator: &evaluator, rounds: &rounds, expected: &expected, places: &places };
            running = self.round(running, &side, tally)?;
            if let Err(Stop::Trap(code, _)) = expected {
                *tally.traps.entry(code.to_string()).or_default() += 1;
                return Ok(());
            }
            if !rounds.wait(&evaluator) {
                return Ok(());
            }
        }
        Ok(())
    }

    /// The same round in every engine; those that go on.
    fn round(
        &self,
        running: Vec<(String, Resource<Running>)>,
        side: &RoundSide<'_>,
        tally: &mut Tally,
    ) -> Result<Vec<(String, Resource<Running>)>, Found> {
        let RoundSide { evaluator, rounds, expected, places } = *side;
        let at = format!("round at {} ns", rounds.now_ns());
        let (mut next, mut faults) = (Vec::new(), Vec::new());
        for (name, resource) in running {
            let place = format!("{name}, {at}");
            let mut cycles = Cycles::default();
            let hooks = &mut Hooks { io: &mut NoIo, inputs: &mut NoInputs, observer: &mut cycles };
            match resource.run_round(hooks) {
                Ok((resource, _)) => {
                    self.same_ending(&place, evaluator, expected, &Ok(()))?;
                    self.same_cycles(&place, rounds, &cycles.rounds, tally)?;
                    self.same_values(&place, evaluator, places, resource.image(), tally)?;
                    next.push((name, resource));
                }
                Err(faulted) => {
                    let FaultReport { place: fault, trap, time, .. } = *faulted.report();
                    self.same_ending(&place, evaluator, expected, &Err(trap))?;
                    // Of a round that trapped only the last task is reported.
                    let task = match fault {
                        FaultPlace::Task { task, .. } => Some(self.task(task)),
                        FaultPlace::Init | FaultPlace::Startup => None,
                    };
                    let last = rounds.ran().last().map(|task| self.tree_task(*task));
                    if time.0 != rounds.now_ns() || task != last {
                        let text = format!("{place}: {task:?} trapped at {} ns instead of {last:?}", time.0);
                        return Err(found("tasks", text));
                    }
                    self.same_values(&place, evaluator, places, faulted.image(), tally)
                        .map_err(|found| after(found, expected))?;
                    faults.push((name, faulted));
                }
            }
        }
        same_images(&at, next.iter().map(|(name, resource)| (name.as_str(), resource.image())))?;
        same_images(&at, faults.iter().map(|(name, resource)| (name.as_str(), resource.image())))?;
        for (_, resource) in &mut next {
            let wake =
                resource.next_wake(&mut Hooks { io: &mut NoIo, inputs: &mut NoInputs, observer: &mut NoObserver });
            resource.wait(wake);
        }
        Ok(next)
    }

    /// The declared name of a task of the scheduler, whatever its letters; none for the one of the instances without a task.
    fn task(&self, task: TaskIndex) -> Option<String> {
        let container = self.verified.container();
        let is_declared = container.tasks.tasks[task.index()].task_type != TaskType::Freewheeling;
        container.types.task_name(task.index()).filter(|_| is_declared).map(str::to_ascii_lowercase)
    }

    /// The same of the tree.
    fn tree_task(&self, task: Option<usize>) -> Option<String> {
        let config = self.source.config.as_ref()?;
        Some(config.tasks[task?].name.to_ascii_lowercase())
    }

    /// Whether the scheduler ran the tasks of the tree's round, in its order and at its time.
    fn same_cycles(
        &self,
        place: &str,
        rounds: &Rounds<'_>,
        seen: &[(TimeNs, Vec<TaskIndex>)],
        tally: &mut Tally,
    ) -> Result<(), Found> {
        let wanted: Vec<_> = rounds.ran().iter().map(|task| self.tree_task(*task)).collect();
        let [(time, ran)] = seen else { return Err(found("tasks", format!("{place}: {} rounds", seen.len()))) };
        let got: Vec<_> = ran.iter().map(|task| self.task(*task)).collect();
        if time.0 != rounds.now_ns() || got != wanted {
            return Err(found("tasks", format!("{place}: {got:?} at {} ns instead of {wanted:?}", time.0)));
        }
        tally.cycles += got.len() as u64;
        Ok(())
    }
}

/// The tree's side of a round.
#[derive(Clone, Copy)]
struct RoundSide<'a> {
    evaluator: &'a Evaluator<'a>,
    rounds: &'a Rounds<'a>,
    expected: &'a Result<(), Stop>,
    places: &'a Places,
}

/// Which tasks ran when.
#[derive(Default)]
struct Cycles {
    rounds: Vec<(TimeNs, Vec<TaskIndex>)>,
}

impl Observer for Cycles {
    fn round_ended(&mut self, _image: &Image, time: TimeNs, ran: &[TaskIndex]) {
        self.rounds.push((time, ran.to_vec()));
    }
}

/// Whether all engines leave the same memory, to the byte.
fn same_images<'a>(place: &str, images: impl Iterator<Item = (&'a str, &'a Image)>) -> Result<(), Found> {
    let images: Vec<_> = images.collect();
    let Some(((first, image), others)) = images.split_first() else { return Ok(()) };
    for (other, others_image) in others {
        if let Some(at) = image.first_difference(others_image) {
            return Err(found("engines", format!("{place}: {first} and {other} differ at {at}")));
        }
    }
    Ok(())
}

/// A difference behind a trap is one of its own.
fn after(mut found: Found, expected: &Result<(), Stop>) -> Found {
    if expected.is_err() {
        found.class += " after a trap";
    }
    found
}

fn run(machine: &mut Machine, entry: Entry) -> Result<(), Trap> {
    let deadline = DeadlineCell::new();
    let mut fuel = Fuel { left: FUEL };
    let limits = Limits { deadline: &deadline, fuel: machine.fuel.then_some(&mut fuel), task_index: 0 };
    machine.engine.run(entry, &mut machine.image, limits)
}

fn set_inputs(image: &mut Image, inputs: &[u8]) {
    let range = image.layout().input.clone();
    let bytes = &mut image.bytes_mut()[range.start as usize..range.end as usize];
    let count = bytes.len().min(inputs.len());
    bytes[..count].copy_from_slice(&inputs[..count]);
}

/// The program of a seed, and if it differs the smallest that differs alike, with its text.
pub fn check_seed(seed: u64, plan: Plan, tally: &mut Tally, tries: usize) -> Option<String> {
    let source = generate(seed);
    let Err(first) = check(&source, seed, plan, tally) else { return None };
    if tries == 0 {
        return Some(format!("seed {seed}: {}\n{}", first.class, first.text));
    }
    let again = |source: &Source| check(source, seed, plan, &mut Tally::default());
    let shows = |source: &Source| matches!(again(source), Err(other) if other.class == first.class);
    let small = shrink(&source, &shows, tries);
    let last = again(&small).err().map_or(first.text.clone(), |found| found.text);
    Some(format!("seed {seed}: {}\nfirst: {}\nsmall: {last}\n{}", first.class, first.text, print(&small)))
}
