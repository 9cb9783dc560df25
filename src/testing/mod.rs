//! Unit tests written in ST: compiled ([`khz_frontend::testing`]), run on the engines, told ([`report`]).
//!
//! A test runs under the scheduler like any program, on a clock that stands still unless the test moves it, with fuel so
//! that it ends. Each engine gets a fresh memory image; a test passes when it passes on all of them.

pub mod report;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use khz_bytecode::container::SystemVariableKind;
use khz_bytecode::limits::SLOT_BYTES;
use khz_frontend::diagnostics::Diagnostic;
use khz_frontend::source::SourceMap;
use khz_frontend::testing::{Assertion, OperandValue};
use khz_frontend::{CompileOptions, SourceInput};
use khz_machine::engine::Entry;
use khz_machine::image::Image;
use khz_machine::report::{SourcePosition, TrapReport};
use khz_machine::variables::{VariableTable, VariableValue};
use khz_scheduler::time::TimeNs;
use khz_scheduler::{
    Clock, ClockKind, FaultPlace, Faulted, HoldsContainer, Hooks, LoadError, LoadOptions, NoInputs, NoIo, NoObserver,
    Resource, Running, StopHandle, Wake,
};

use crate::pipeline::{self, EngineKind, Program, Refused};

/// How tests are run.
#[derive(Debug, Clone)]
pub struct TestOptions {
    /// On which engines, one after the other.
    pub engines: Vec<EngineKind>,
    /// How long a test may compute, in microseconds of fuel (1 unit = 1 ns); 0: without end.
    pub watchdog_us: u64,
    /// Largest memory image, in bytes.
    pub max_image_bytes: u64,
}

/// A test that is ready to run.
#[derive(Debug)]
pub struct Test {
    /// Its name.
    pub name: String,
    /// Where its name stands.
    pub place: SourcePosition,
    program: Program,
    has_teardown: bool,
    failed: Option<String>,
    assertions: Vec<(SourcePosition, Assertion)>,
}

/// The tests of some sources.
#[derive(Debug)]
pub struct Suite {
    /// In source order.
    pub tests: Vec<Test>,
    /// Warnings and notes.
    pub diagnostics: Vec<Diagnostic>,
    /// What they point into.
    pub sources: SourceMap,
}

/// What came of a test.
#[derive(Debug, Clone, PartialEq)]
pub struct TestResult {
    /// Its name.
    pub name: String,
    /// Where its name stands.
    pub place: SourcePosition,
    /// Why it did not pass; empty: it did. Engines with the same reason stand together.
    pub failures: Vec<(Vec<EngineKind>, Failure)>,
}

impl TestResult {
    /// Whether it passed on every engine.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.failures.is_empty()
    }
}

/// Why a test did not pass.
#[derive(Debug, Clone, PartialEq)]
pub enum Failure {
    /// An assertion did not hold.
    Assertion(FailedAssertion),
    /// A trap ended it.
    Trap(Box<TrapReport>),
    /// It could not be run at all.
    NotRun(String),
}

/// An assertion that did not hold.
#[derive(Debug, Clone, PartialEq)]
pub struct FailedAssertion {
    /// Where it stands.
    pub place: SourcePosition,
    /// Its word.
    pub word: &'static str,
    /// What was compared, by name: as an IEC literal and as JSON.
    pub values: Vec<(&'static str, String, String)>,
    /// Its message.
    pub message: Option<String>,
}

/// Compiles and verifies the tests of sources.
///
/// # Errors
/// Their diagnostics. A compiled container that does not verify is a fault of the compiler and says so.
pub fn compile(sources: &[SourceInput], options: &CompileOptions) -> Result<Suite, Refused> {
    let found = khz_frontend::compile_tests(sources, options);
    if khz_frontend::diagnostics::has_errors(&found.diagnostics) {
        return Err(Refused::Diagnostics { diagnostics: found.diagnostics, sources: found.sources });
    }
    let place = |span: khz_frontend::source::Span| {
        let at = found.sources.line_column(span);
        let file = found.sources.file(span.file).map_or_else(String::new, |file| file.name().to_owned());
        SourcePosition { file, line: at.line, column: at.column }
    };
    let mut tests = Vec::with_capacity(found.tests.len());
    for test in found.tests {
        let assertions = test.assertions.into_iter().map(|assertion| (place(assertion.span), assertion)).collect();
        tests.push(Test {
            place: place(test.span),
            program: pipeline::program(test.name.clone(), test.container)?,
            name: test.name,
            has_teardown: test.has_teardown,
            failed: test.failed,
            assertions,
        });
    }
    Ok(Suite { tests, diagnostics: found.diagnostics, sources: found.sources })
}

/// Runs a test on each engine.
#[must_use]
pub fn run(test: &Test, options: &TestOptions) -> TestResult {
    let mut failures: Vec<(Vec<EngineKind>, Failure)> = Vec::new();
    for &engine in &options.engines {
        let Err(failure) = run_on(test, engine, options) else { continue };
        match failures.iter_mut().find(|(_, known)| *known == *failure) {
            Some((engines, _)) => engines.push(engine),
            None => failures.push((vec![engine], *failure)),
        }
    }
    TestResult { name: test.name.clone(), place: test.place.clone(), failures }
}

fn run_on(test: &Test, engine: EngineKind, options: &TestOptions) -> Result<(), Box<Failure>> {
    let not_run = |why: &dyn std::fmt::Display| Box::new(Failure::NotRun(why.to_string()));
    let program = &test.program;
    let layout = program.layout(options.max_image_bytes).map_err(|error| not_run(&error))?;
    let fuel = options.watchdog_us > 0 || program.container().parameters.init_function.is_some();
    let engine = program.engine(engine, &layout, fuel).map_err(|error| not_run(&error))?;
    let time = Arc::new(AtomicU64::new(0));
    let clock = Box::new(TestClock(Arc::clone(&time)));
    let load = LoadOptions {
        max_image_bytes: options.max_image_bytes,
        watchdog_us: options.watchdog_us,
        ..LoadOptions::default()
    };
    let holder: Arc<dyn HoldsContainer> = program.verified.clone();
    let resource = match Resource::load(holder, engine, clock, &load) {
        Ok(resource) => resource,
        Err(LoadError::Faulted(faulted)) => return Err(trapped(&faulted)),
        Err(error) => return Err(not_run(&error)),
    };
    let names = VariableTable::of(program.container());
    let resource = resource.start().map_err(|faulted| trapped(&faulted))?;
    let resource = activate(resource)?;
    let outcome = failed_assertion(test, &names, resource.image());
    if !test.has_teardown {
        return outcome;
    }
    // TEARDOWN sees the time that the test made.
    time.store(up_time_ns(&resource), Ordering::Relaxed);
    let torn_down = activate(resource);
    // What went wrong first is what there is to say.
    outcome?;
    failed_assertion(test, &names, torn_down?.image())
}

fn activate(resource: Resource<Running>) -> Result<Resource<Running>, Box<Failure>> {
    let (mut io, mut inputs, mut observer) = (NoIo, NoInputs, NoObserver);
    let mut hooks = Hooks { io: &mut io, inputs: &mut inputs, observer: &mut observer };
    resource.run_round(&mut hooks).map(|(resource, _)| resource).map_err(|faulted| trapped(&faulted))
}

fn trapped(faulted: &Resource<Faulted>) -> Box<Failure> {
    let fault = faulted.report();
    let entry = match fault.place {
        FaultPlace::Init => Entry::Init,
        FaultPlace::Startup => Entry::Startup,
        FaultPlace::Task { instance, .. } => Entry::Instance(instance),
    };
    Box::new(Failure::Trap(Box::new(TrapReport::new(&fault.trap, entry, faulted.container()))))
}

/// The assertion whose number the test noted, with what it compared.
fn failed_assertion(test: &Test, names: &VariableTable, image: &Image) -> Result<(), Box<Failure>> {
    let value = |name: &str| names.resolve(name).and_then(|variable| names.read(image, &variable));
    let Some(failed) = &test.failed else { return Ok(()) };
    let number = match value(failed) {
        Ok(VariableValue::Unsigned(number)) => usize::try_from(number).unwrap_or(usize::MAX),
        Ok(_) => return Err(Box::new(Failure::NotRun(format!("`{failed}` is no number")))),
        Err(error) => return Err(Box::new(Failure::NotRun(error.to_string()))),
    };
    let Some((place, assertion)) = number.checked_sub(1).and_then(|at| test.assertions.get(at)) else { return Ok(()) };
    let values = assertion.operands.iter().map(|operand| match &operand.value {
        OperandValue::Text(text) => {
            let json = if matches!(*text, "TRUE" | "FALSE") { text.to_ascii_lowercase() } else { format!("{text:?}") };
            (operand.label, (*text).to_owned(), json)
        }
        OperandValue::Variable(name) => match names.resolve(name) {
            Ok(variable) => {
                let mut json = String::new();
                names.write_json(image, &variable, &mut json);
                (operand.label, names.text(image, &variable), json)
            }
            Err(error) => (operand.label, error.to_string(), "null".to_owned()),
        },
    });
    let message = assertion.message.as_deref().and_then(|name| match value(name) {
        Ok(VariableValue::String(bytes)) => Some(bytes.iter().map(|byte| char::from(*byte)).collect()),
        _ => None,
    });
    let failed = FailedAssertion { place: place.clone(), word: assertion.word, values: values.collect(), message };
    Err(Box::new(Failure::Assertion(failed)))
}

/// The time that the test sees, in nanoseconds; the round's where it looks at none.
fn up_time_ns(resource: &Resource<Running>) -> u64 {
    let variables = &resource.container().types.system_variables;
    let Some(found) = variables.iter().find(|variable| variable.kind == SystemVariableKind::UpLtime) else {
        return resource.time().0;
    };
    let image = resource.image();
    let start = image.layout().slots.start as usize + found.slot.index() * SLOT_BYTES as usize;
    let bytes = image.bytes().get(start..start + SLOT_BYTES as usize);
    let shown = bytes.and_then(|bytes| bytes.try_into().ok()).map(i64::from_le_bytes);
    shown.and_then(|shown| u64::try_from(shown).ok()).unwrap_or(resource.time().0)
}

/// A clock that the runner moves. Execution takes no time on it, so watchdogs are fuel.
struct TestClock(Arc<AtomicU64>);

impl Clock for TestClock {
    fn kind(&self) -> ClockKind {
        ClockKind::Virtual
    }

    fn start_at(&mut self, time: TimeNs) {
        self.0.store(time.0, Ordering::Relaxed);
    }

    fn now(&self) -> TimeNs {
        TimeNs(self.0.load(Ordering::Relaxed))
    }

    fn wait(&mut self, _wake: Wake, _stop: &StopHandle) {}

    fn monotonic_ns(&self, _time: TimeNs) -> Option<u64> {
        None
    }
}
