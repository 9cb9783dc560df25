//! One container in several engines: after every run result, fuel and memory image must be equal.
//!
//! The evaluator runs first, under fuel, so that every program ends. Each engine then repeats the same runs on an image of its own. When
//! no run of the evaluator came to the end of its fuel, the engines repeat them once more in their form without fuel, which must give the same. Lastly
//! the same runs are cut short by small amounts of fuel, so that the place where fuel ends is compared too, and one is stopped from outside.

use std::fmt::Write;
use std::sync::Arc;

use khz_bytecode::disassembler::disassemble_function;
use khz_bytecode::verify::Verified;
use khz_machine::engine::{DeadlineCell, Engine, Entry, Fuel, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::trap::{Trap, TrapCode};

use crate::evaluator::Evaluator;
use crate::panics::caught;
use crate::random::Random;
use crate::statistics::Statistics;

/// Makes an engine for a resource, in its form with fuel or without; or says why it can not.
pub type MakeEngine<'m> = dyn Fn(Arc<Verified>, &ImageLayout, bool) -> Result<Box<dyn Engine>, String> + 'm;

/// An engine to compare.
#[derive(Clone, Copy)]
pub struct Maker<'m> {
    /// Its name in reports.
    pub name: &'m str,
    /// Makes it.
    pub make: &'m MakeEngine<'m>,
    /// Which of its forms are compared.
    pub forms: Forms,
}

impl<'m> Maker<'m> {
    /// A maker whose engines are compared in both forms.
    #[must_use]
    pub fn new(name: &'m str, make: &'m MakeEngine<'m>) -> Self {
        Maker { name, make, forms: Forms::Both }
    }
}

/// The forms in which an engine is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Forms {
    /// With fuel, and without where every run ends by itself.
    Both,
    /// Without fuel where every run ends by itself, otherwise with it: for a further engine that shall not cost as much.
    One,
}

/// How to run a container.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Scans: each runs every program instance once, after new inputs.
    pub scans: u32,
    /// Units of fuel of each run.
    pub fuel: u64,
    /// Seed of the inputs.
    pub seed: u64,
    /// Largest memory image, in bytes.
    pub image_limit_bytes: u64,
    /// How many further series of runs are cut short by little fuel.
    pub cuts: u32,
}

impl Default for Plan {
    fn default() -> Self {
        Plan { scans: 3, fuel: 20_000, seed: 0, image_limit_bytes: 1 << 20, cuts: 1 }
    }
}

/// The name under which a difference stands that the evaluator finds alone: what it was handed was not what a verifier promises.
pub const VERIFIER: &str = "verifier";

/// A difference between two engines.
#[derive(Debug, Clone)]
pub struct Difference {
    /// The engine that is not like the evaluator, or [`VERIFIER`].
    pub engine: String,
    /// What differs, for people.
    pub description: String,
}

/// How a comparison ended.
#[derive(Debug, Clone)]
pub enum Outcome {
    /// All engines agree.
    Equal,
    /// One does not.
    Different(Difference),
    /// The memory image is larger than the plan allows.
    TooLarge,
}

impl Outcome {
    /// The difference, if there is one.
    #[must_use]
    pub fn difference(self) -> Option<Difference> {
        match self {
            Outcome::Different(difference) => Some(difference),
            Outcome::Equal | Outcome::TooLarge => None,
        }
    }
}

/// What one run is, and what it left behind.
struct Step {
    entry: Entry,
    task: usize,
    fuel: u64,
    /// Stopped from outside before it begins.
    stopped: bool,
    result: Result<(), Trap>,
    left: u64,
    image: Image,
}

/// The runs of a series: entry, task, number of the scan.
fn entries(verified: &Verified, scans: u32) -> Vec<(Entry, usize, u32)> {
    let container = verified.container();
    let starts =
        [(Entry::Init, container.parameters.init_function), (Entry::Startup, container.parameters.startup_function)];
    let starts = starts.into_iter().filter(|(_, function)| function.is_some());
    let mut entries: Vec<(Entry, usize, u32)> = starts.map(|(entry, _)| (entry, 0, 0)).collect();
    for scan in 0..scans {
        for (index, instance) in container.tasks.instances.iter().enumerate() {
            let task = container.tasks.tasks.iter().position(|task| task.id == instance.task).unwrap_or(0);
            entries.push((Entry::Instance(index), task, scan));
        }
    }
    entries
}

/// Writes the inputs that step `number` of a plan begins with.
fn give_inputs(image: &mut Image, seed: u64, number: usize) {
    let mut random = Random::new(seed ^ (number as u64).wrapping_mul(0x9E37_79B9));
    let range = image.layout().input.clone();
    for byte in &mut image.bytes_mut()[range.start as usize..range.end as usize] {
        *byte = if random.chance(30) { 0xFF } else { random.bits() as u8 };
    }
}

/// Runs one step in an engine: the result and the fuel that is left.
fn run(
    engine: &mut dyn Engine,
    image: &mut Image,
    entry: Entry,
    task: usize,
    fuel: Option<u64>,
    stopped: bool,
) -> (Result<(), Trap>, u64) {
    let deadline = DeadlineCell::new();
    if stopped {
        deadline.expire(TrapCode::Stopped);
    }
    let mut tank = Fuel { left: fuel.unwrap_or(0) };
    let limits = Limits { deadline: &deadline, fuel: fuel.map(|_| &mut tank), task_index: task };
    let result = engine.run(entry, image, limits);
    (result, tank.left)
}

/// Compares a container's runs in the evaluator and in all `makers`.
pub fn compare(verified: &Arc<Verified>, makers: &[Maker<'_>], plan: &Plan, statistics: &mut Statistics) -> Outcome {
    let Ok(layout) = ImageLayout::new(verified.container(), plan.image_limit_bytes) else { return Outcome::TooLarge };
    let first = Image::new(layout.clone(), verified.container());
    let mut evaluator = Evaluator::new(verified.clone(), &layout, true);
    let series = match caught(|| references(&mut evaluator, &first, plan, verified)) {
        Ok(series) => series,
        Err(words) => {
            let description = format!("the evaluator finds that the verifier is wrong: {words}");
            return Outcome::Different(Difference { engine: VERIFIER.to_string(), description });
        }
    };
    let ended = series[0].iter().all(|step| !matches!(step.result, Err(trap) if trap.code == TrapCode::Watchdog));
    note(statistics, &series, ended, verified, &evaluator);
    for maker in makers {
        let forms: &[bool] = match (maker.forms, ended) {
            (Forms::Both, true) => &[true, false],
            (Forms::One, true) => &[false],
            (_, false) => &[true],
        };
        for with_fuel in forms.iter().copied() {
            let failure = caught(|| match (maker.make)(verified.clone(), &layout, with_fuel) {
                Err(reason) => Some(format!("it can not be made: {reason}")),
                Ok(mut engine) => {
                    // Without fuel only the series that came to its end by itself is comparable.
                    let repeated = if with_fuel { &series[..] } else { &series[..1] };
                    repeated.iter().find_map(|steps| repeat(&mut *engine, &first, plan, steps, with_fuel, verified))
                }
            });
            let failure = failure.unwrap_or_else(|words| Some(format!("it panics: {words}")));
            if let Some(description) = failure {
                let form = if with_fuel { "with" } else { "without" };
                let description = format!("{} ({form} fuel) is not like the evaluator: {description}", maker.name);
                return Outcome::Different(Difference { engine: maker.name.to_string(), description });
            }
        }
    }
    Outcome::Equal
}

/// All series of a plan in the evaluator: the whole one first, then those that are cut short.
fn references(evaluator: &mut Evaluator, first: &Image, plan: &Plan, verified: &Verified) -> Vec<Vec<Step>> {
    let mut series = vec![reference(evaluator, first, plan, verified, None)];
    let mut random = Random::new(plan.seed ^ 0x4355_5453);
    for cut in 0..plan.cuts {
        let most = series[0].iter().map(|step| step.fuel - step.left).max().unwrap_or(0);
        let fuel = random.below(most as usize + 1) as u64;
        series.push(reference(evaluator, first, plan, verified, Some((fuel, cut == 0))));
    }
    series
}

fn reference(
    evaluator: &mut Evaluator,
    first: &Image,
    plan: &Plan,
    verified: &Verified,
    cut: Option<(u64, bool)>,
) -> Vec<Step> {
    let mut image = first.clone();
    let mut steps = Vec::new();
    for (number, (entry, task, scan)) in entries(verified, plan.scans).into_iter().enumerate() {
        give_inputs(&mut image, plan.seed, number);
        let fuel = cut.map_or(plan.fuel, |(fuel, _)| fuel);
        let stopped = cut.is_some_and(|(_, stops)| stops && scan == 1);
        let (result, left) = run(evaluator, &mut image, entry, task, Some(fuel), stopped);
        steps.push(Step { entry, task, fuel, stopped, result, left, image: image.clone() });
    }
    steps
}

/// Repeats a series; what is not like the evaluator did it, if anything.
fn repeat(
    engine: &mut dyn Engine,
    first: &Image,
    plan: &Plan,
    steps: &[Step],
    with_fuel: bool,
    verified: &Verified,
) -> Option<String> {
    let mut image = first.clone();
    for (number, step) in steps.iter().enumerate() {
        give_inputs(&mut image, plan.seed, number);
        let fuel = with_fuel.then_some(step.fuel);
        let (result, left) = run(engine, &mut image, step.entry, step.task, fuel, step.stopped);
        let place = format!("run {number} ({:?}, task {}, fuel {fuel:?})", step.entry, step.task);
        if result != step.result {
            let (wanted, found) = (describe(&step.result, verified), describe(&result, verified));
            return Some(format!(
                "{place} ends otherwise\n  evaluator: {wanted}\n  engine:    {found}\n{}",
                code_of(&step.result, &result, verified)
            ));
        }
        if with_fuel && left != step.left {
            return Some(format!("{place} leaves {left} units of fuel, not {}", step.left));
        }
        if image.first_difference(&step.image).is_some() {
            return Some(format!("{place} leaves another memory:\n{}", differing_bytes(&image, &step.image)));
        }
    }
    None
}

fn describe(result: &Result<(), Trap>, verified: &Verified) -> String {
    match result {
        Ok(()) => "it returns".to_string(),
        Err(trap) => {
            let facts = verified.facts().functions.get(trap.place.function.index());
            let placed =
                facts.and_then(|facts| facts.instructions.iter().find(|placed| placed.offset == trap.place.offset));
            let name = placed.map_or("no instruction", |placed| placed.instruction.mnemonic());
            let chain: Vec<String> =
                trap.chain().iter().map(|place| format!("{}@{}", place.function, place.offset)).collect();
            let (function, offset) = (trap.place.function, trap.place.offset);
            format!(
                "trap {} {:?} at function {function} byte {offset} ({name}), called from {chain:?}",
                trap.code, trap.values
            )
        }
    }
}

/// The text of the functions in which two results trapped.
fn code_of(wanted: &Result<(), Trap>, found: &Result<(), Trap>, verified: &Verified) -> String {
    let mut functions: Vec<_> =
        [wanted, found].iter().filter_map(|result| result.as_ref().err()).map(|trap| trap.place.function).collect();
    functions.dedup();
    functions.iter().filter_map(|id| disassemble_function(verified.container(), *id)).collect()
}

/// The first differing bytes of each region.
fn differing_bytes(found: &Image, wanted: &Image) -> String {
    let layout = found.layout();
    let regions = [
        ("slots", &layout.slots),
        ("data", &layout.data),
        ("%M", &layout.memory),
        ("%Q", &layout.output),
        ("%I", &layout.input),
    ];
    let mut text = String::new();
    for (name, range) in regions {
        let differing =
            (range.start..range.end).filter(|at| found.bytes()[*at as usize] != wanted.bytes()[*at as usize]);
        for at in differing.take(16) {
            let (found, wanted) = (found.bytes()[at as usize], wanted.bytes()[at as usize]);
            // A String takes everything.
            let _ = writeln!(text, "  {name} {}: {found:#04x}, the evaluator has {wanted:#04x}", at - range.start);
        }
    }
    text
}

/// Counts what a comparison reached.
fn note(statistics: &mut Statistics, series: &[Vec<Step>], ended: bool, verified: &Verified, evaluator: &Evaluator) {
    statistics.programs += 1;
    statistics.without_fuel += u64::from(ended);
    for step in series.iter().flatten() {
        statistics.runs += 1;
        statistics.trapped += u64::from(step.result.is_err());
    }
    statistics.executed.add(evaluator.executed());
    let facts = verified.facts();
    let written = statistics.written.total();
    for placed in facts.functions.iter().flat_map(|function| &function.instructions) {
        statistics.written.ran(&placed.instruction);
    }
    statistics.size((statistics.written.total() - written) as usize);
    let loops = || facts.functions.iter().flat_map(|function| &function.loops);
    statistics.feature("a FOR loop of proven control", loops().any(|found| found.control_is_proven));
    statistics.feature(
        "a FOR loop of unproven control",
        loops().any(|found| found.for_loop.is_some() && !found.control_is_proven),
    );
    statistics.feature("another loop", loops().any(|found| found.for_loop.is_none()));
    statistics.feature("nested loops", loops().any(|found| found.depth > 1));
    statistics.feature("foreign floats", facts.foreign_floats);
    statistics.feature("raw writes", facts.functions.iter().any(|function| function.effects.raw_writes));
    statistics.feature("virtual calls", facts.functions.iter().any(|function| function.calls_virtual));
    statistics.feature("frames", facts.functions.iter().any(|function| function.frame_bytes > 0));
    statistics.feature("data blocks", facts.instance_blocks.iter().any(Option::is_some));
    statistics.feature("several tasks", verified.container().tasks.tasks.len() > 1);
}

/// Makes the container of a difference small: `makers` is the engine that differed (others cost time). The text of the small container follows the new difference.
pub fn reduce(verified: &Verified, makers: &[Maker<'_>], plan: &Plan, tries: usize) -> (crate::shrink::Shrunk, String) {
    let difference = |verified: &Verified| {
        compare(&Arc::new(verified.clone()), makers, plan, &mut Statistics::default()).difference()
    };
    let differs = |verified: &Verified| difference(verified).is_some();
    let shrunk = crate::shrink::Shrinker { differs: &differs, tries }.shrink(verified);
    let description =
        difference(&shrunk.verified).map_or_else(|| "the difference is gone".to_string(), |found| found.description);
    let description = format!("{description}\n{}", shrunk.text);
    (shrunk, description)
}
