//! Several engines on one program in lock-step: after every round the same ending, the same tasks run and the same memory, byte for byte.
//!
//! Each engine drives a resource of its own under the scheduler, on a virtual clock, so that everything a program can see is the same for all. The
//! first side is what the others are compared with. Code that charges fuel and code that does not are different code, so both are compared
//! ([`Side::standard`](EngineUnderTest::standard)); where fuel ended the first, those without would not end and sit the round out.
//!
//! The comparison is made for thousands of rounds a second: images are compared as memory, names are looked at only when
//! they differ. Then the round is repeated from its last equal image by the third evaluator ([`replay`]), which says who is right and which
//! statement wrote the value last.

pub mod difference;
pub mod inputs;
mod recorder;
pub mod replay;
mod side;

use std::collections::BTreeMap;

use khz_jit::JitError;
use khz_machine::engine::Engine;
use khz_machine::image::{Image, ImageTooLarge};
use khz_machine::report::{DescribedPlace, describe as describe_place};
use khz_machine::trap::{CodePlace, TrapCode};
use khz_machine::variables::{Variable, VariableTable};
use khz_scheduler::{FaultReport, InputSource, Round, TimeNs, Wake};

use crate::pipeline::{EngineKind, Program};
use difference::Difference;
use inputs::RandomInputs;
use recorder::{Record, Recorder};
use side::{Side, State, Step};

/// One engine of a comparison.
pub struct EngineUnderTest {
    /// Its name in reports.
    pub name: String,
    /// The engine.
    pub engine: Box<dyn Engine>,
    /// Whether its code charges fuel.
    pub fuel: bool,
}

impl EngineUnderTest {
    /// Both engines, each with code that charges fuel and with code that does not: interpreter with fuel first.
    ///
    /// # Errors
    /// An image too large, or no native code.
    pub fn standard(program: &Program, max_image_bytes: u64) -> Result<Vec<EngineUnderTest>, OpenError> {
        let forms = [true, false].into_iter().flat_map(|fuel| EngineKind::BOTH.map(|kind| (kind, fuel)));
        forms.map(|(kind, fuel)| EngineUnderTest::new(program, kind, fuel, max_image_bytes)).collect()
    }

    /// One engine in one form.
    ///
    /// # Errors
    /// An image too large, or no native code.
    pub fn new(program: &Program, kind: EngineKind, fuel: bool, max_image_bytes: u64) -> Result<Self, OpenError> {
        let engine = program.engine(kind, &program.layout(max_image_bytes)?, fuel)?;
        let name = format!("{} {} fuel", kind.name(), if fuel { "with" } else { "without" });
        Ok(EngineUnderTest { name, engine, fuel })
    }
}

/// Why there is nothing to compare.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The image is larger than it may be.
    #[error(transparent)]
    Image(#[from] ImageTooLarge),
    /// No native code.
    #[error(transparent)]
    Engine(#[from] JitError),
    /// The host refused something.
    #[error("{0}")]
    Host(String),
}

/// What is done to a fresh image before the program starts.
pub type Prepare<'p> = dyn Fn(&mut Image) + 'p;

/// How a program is run.
pub struct Options<'p> {
    /// Largest memory image, in bytes.
    pub max_image_bytes: u64,
    /// Watchdog for tasks that set none, in microseconds of fuel (1 unit = 1 ns); 0: none.
    pub watchdog_us: u64,
    /// Values before the first round, set anew after each reset.
    pub prepare: Box<Prepare<'p>>,
    /// Time goes on, by 1 ms a round, when nothing can be due: inputs change between rounds and may start an event task.
    pub idle_goes_on: bool,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Options {
            max_image_bytes: khz_bytecode::limits::MAX_IMAGE_BYTES,
            watchdog_us: 0,
            prepare: Box::new(|_| ()),
            idle_goes_on: false,
        }
    }
}

/// How a round ended, on all sides.
#[derive(Debug, Clone, Copy)]
pub enum Progress {
    /// Without a trap.
    Ran {
        /// When, and how many tasks.
        round: Round,
        /// What comes next.
        wake: Wake,
    },
    /// In a trap; only a reset leads on.
    Trapped(FaultReport),
}

/// What a comparison came to that found no difference.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Summary {
    /// Rounds that were compared, the trapped ones among them.
    pub rounds: u64,
    /// Task cycles that were run on each side.
    pub cycles: u64,
    /// How many rounds ended in which trap.
    pub traps: BTreeMap<TrapCode, u64>,
    /// The trap that ended it.
    pub ended: Option<TrapCode>,
}

/// A program on several engines.
pub struct Lockstep<'p> {
    program: &'p Program,
    names: VariableTable,
    sides: Vec<Side>,
    record: Record,
    options: Options<'p>,
    rounds: u64,
}

impl<'p> Lockstep<'p> {
    /// Loads the program on every engine.
    ///
    /// # Errors
    /// An image too large, or something that the host refuses. Traps and differences come out of [`Lockstep::start`].
    pub fn open(
        program: &'p Program,
        engines: Vec<EngineUnderTest>,
        options: Options<'p>,
    ) -> Result<Lockstep<'p>, OpenError> {
        let record = Record::of(program.image(options.max_image_bytes)?);
        let mut sides: Vec<Side> = Vec::with_capacity(engines.len());
        for (position, mut under_test) in engines.into_iter().enumerate() {
            if position == 0 {
                under_test.engine = Box::new(Recorder::new(under_test.engine, record.clone()));
            }
            let never_ends = sides.first().is_some_and(|first| first.trap() == Some(TrapCode::Watchdog));
            let sits_out = never_ends && !under_test.fuel;
            sides.push(Side::load(program, under_test, &options, sits_out)?);
        }
        let names = VariableTable::of(program.container());
        Ok(Lockstep { program, names, sides, record, options, rounds: 0 })
    }

    /// Rows of inputs, one source for each side in order.
    pub fn set_inputs(&mut self, sources: Vec<Box<dyn InputSource>>) {
        for (side, source) in self.sides.iter_mut().zip(sources) {
            side.inputs = Some(source);
        }
    }

    /// The program.
    #[must_use]
    pub fn program(&self) -> &'p Program {
        self.program
    }

    /// Its variables by name.
    #[must_use]
    pub fn names(&self) -> &VariableTable {
        &self.names
    }

    /// How many engines.
    #[must_use]
    pub fn sides(&self) -> usize {
        self.sides.len()
    }

    /// Rounds so far, those before a reset included.
    #[must_use]
    pub fn rounds(&self) -> u64 {
        self.rounds
    }

    /// The memory of the first side.
    ///
    /// # Panics
    /// Never: there is one from [`Lockstep::open`] on, and no caller sees a round half done.
    #[must_use]
    pub fn image(&self) -> &Image {
        self.sides.first().and_then(Side::image).expect("the first side has an image")
    }

    /// Compares what the init function left, sets the values that are wanted, runs the startup function and compares again. A trap on all sides is returned.
    ///
    /// # Errors
    /// The first difference.
    pub fn start(&mut self) -> Result<Option<FaultReport>, Box<Difference>> {
        if let Some(fault) = self.settle()? {
            return Ok(Some(fault));
        }
        self.record.clear();
        for side in &mut self.sides {
            side.prepare(&self.options.prepare);
        }
        self.each_side(|side, _| {
            side.start();
            Step::of_fault(side)
        });
        self.settle()
    }

    /// Runs a function on each side, the first one first. Sides without fuel sit out what fuel ended on the first.
    fn each_side(&mut self, mut run: impl FnMut(&mut Side, bool) -> Step) {
        let mut never_ends = false;
        for (position, side) in self.sides.iter_mut().enumerate() {
            let sits_out = never_ends && !side.fuel;
            side.step = if sits_out { None } else { Some(run(side, self.options.idle_goes_on)) };
            never_ends |= position == 0 && side.trap() == Some(TrapCode::Watchdog);
        }
    }

    /// Compares the sides as they are now.
    fn settle(&mut self) -> Result<Option<FaultReport>, Box<Difference>> {
        if let Some(position) = self.first_unlike() {
            return Err(Box::new(difference::describe(self, position)));
        }
        Ok(self.sides.first().and_then(Side::fault).copied())
    }

    /// The first side that is not like the first one.
    fn first_unlike(&self) -> Option<usize> {
        let (first, others) = self.sides.split_first()?;
        let is_unlike = |side: &Side| {
            side.step.is_some()
                && (side.step != first.step
                    || first.image().zip(side.image()).is_some_and(|(a, b)| a.first_difference(b).is_some()))
        };
        others.iter().position(is_unlike).map(|position| position + 1)
    }

    /// Gives new random values to the inputs, the same on all sides.
    pub fn give(&mut self, inputs: &mut RandomInputs) {
        let Some((first, others)) = self.sides.split_first_mut() else { return };
        let Some(image) = first.running_image() else { return };
        inputs.apply(image);
        for other in others.iter_mut().filter_map(Side::running_image) {
            inputs.copy(image, other);
        }
    }

    /// Runs one round on every side and compares them.
    ///
    /// # Errors
    /// The first difference.
    pub fn round(&mut self) -> Result<Progress, Box<Difference>> {
        self.record.clear();
        self.rounds += 1;
        self.each_side(Side::round);
        if let Some(fault) = self.settle()? {
            return Ok(Progress::Trapped(fault));
        }
        let step = self.sides.first().and_then(|first| first.step);
        let (round, wake) = step.and_then(|step| step.round.zip(step.wake)).unwrap_or(NOTHING);
        Ok(Progress::Ran { round, wake })
    }

    /// Puts memory and time back on all sides, after a trap; then [`Lockstep::start`].
    pub fn reset(&mut self) {
        self.record.clear();
        self.each_side(|side, _| {
            side.reset();
            Step::of_fault(side)
        });
    }

    /// Runs up to `rounds` rounds. With random inputs a trap is followed by a reset, since other inputs may pass it; else it is the end.
    ///
    /// # Errors
    /// The first difference.
    pub fn run(&mut self, mut inputs: Option<&mut RandomInputs>, rounds: u64) -> Result<Summary, Box<Difference>> {
        let mut summary = Summary { ended: self.start()?.map(|fault| fault.trap.code), ..Summary::default() };
        while summary.rounds < rounds && summary.ended.is_none() {
            if let Some(inputs) = inputs.as_deref_mut() {
                self.give(inputs);
            }
            summary.rounds += 1;
            match self.round()? {
                Progress::Ran { round, wake } => {
                    summary.cycles += round.tasks as u64;
                    if wake == Wake::Never && !self.options.idle_goes_on {
                        break;
                    }
                }
                Progress::Trapped(fault) => {
                    *summary.traps.entry(fault.trap.code).or_default() += 1;
                    if inputs.is_none() {
                        summary.ended = Some(fault.trap.code);
                    } else {
                        self.reset();
                        summary.ended = self.start()?.map(|fault| fault.trap.code);
                    }
                }
            }
        }
        Ok(summary)
    }

    /// For each variable the statement of the last round that wrote it last, then the calls that led there, innermost first; empty: none did, or it is
    /// an array or a structure.
    ///
    /// # Errors
    /// Why the round can not be repeated, for people.
    pub fn writers(&self, variables: &[&Variable]) -> Result<Vec<Vec<DescribedPlace>>, String> {
        let layout = self.image().layout();
        let bytes: Vec<_> =
            variables.iter().map(|variable| self.names.bytes_of(layout, variable).unwrap_or(0..0)).collect();
        let replay = replay::replay(&self.program.verified, &self.record.lock(), &bytes)?;
        let container = self.program.container();
        let described =
            |places: &Vec<CodePlace>| places.iter().map(|place| describe_place(*place, container)).collect();
        Ok(replay.writers.iter().map(described).collect())
    }

    /// Runs on after a difference and adds the variables that come to differ later, until the pair of sides ends otherwise or has run `rounds` more rounds.
    pub fn follow(&mut self, found: &mut Difference, mut inputs: Option<&mut RandomInputs>, rounds: u64) {
        for _ in 0..rounds {
            let is_running = |side: &Side| matches!(side.state, State::Running(_));
            if !found.pair.iter().all(|position| self.sides.get(*position).is_some_and(is_running)) {
                return;
            }
            if let Some(inputs) = inputs.as_deref_mut() {
                self.give(inputs);
            }
            self.rounds += 1;
            self.each_side(Side::round);
            difference::add_variables(self, found, None);
        }
    }
}

/// A round in which nothing happened.
const NOTHING: (Round, Wake) = (Round { time: TimeNs::ZERO, tasks: 0 }, Wake::Never);
