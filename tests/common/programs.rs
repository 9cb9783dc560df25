//! ST programs that say in their first lines what they must come to; run on the virtual clock, in both engines.
//!
//! Comments at the start of a file:
//! - `// scans: N` rounds to run (default 1)
//! - `// dialect: iec` only the standard's implicit conversions
//! - `// set: NAME = LITERAL` before the first round
//! - `// expect: NAME = LITERAL` afterwards (also after a trap); for arrays `[a, b]`
//! - `// trap: NAME at LINE:COLUMN` and `// values: name=value …`
//! - `// error: CODE at LINE:COLUMN` the file is refused, with exactly this one error (`at LINE:COLUMN` alone: whatever the code)
//! - `// warning: CODE` at least once
//! - `// not yet` the standard has it, this compiler refuses it: with the error that is expected

use std::path::{Path, PathBuf};

use khz_frontend::diagnostics::{Diagnostic, Severity};
use khz_frontend::source::SourceMap;
use khz_frontend::{CompileOptions, Dialect, SourceInput};
use khz_machine::engine::Entry;
use khz_machine::image::Image;
use khz_machine::report::TrapReport;
use khz_machine::variables::VariableTable;
use khz_scheduler::{
    FaultPlace, Faulted, Hooks, LoadOptions, NoInputs, NoIo, NoObserver, Resource, RunOptions, RunOutcome,
    VirtualClock, run,
};
use kilohertz::pipeline::{self, EngineKind, Program};

/// Largest memory image of a test.
const MAX_IMAGE_BYTES: u64 = 1 << 24;

/// What the first lines of a file say.
#[derive(Default)]
pub struct Expected {
    /// The other comment lines, without `// `.
    pub notes: Vec<String>,
    /// `// not yet`
    pub not_yet: bool,
    /// `// error:`
    pub error: Option<String>,
    /// `// trap:`
    pub trap: Option<String>,
    scans: u64,
    dialect: Dialect,
    set: Vec<(String, String)>,
    /// `// expect:`
    pub values: Vec<(String, String)>,
    trap_values: Option<String>,
    warnings: Vec<String>,
}

impl Expected {
    /// Reads them.
    pub fn of(text: &str) -> Expected {
        let mut expected = Expected { scans: 1, ..Expected::default() };
        for line in text.lines().map_while(|line| line.strip_prefix("// ")) {
            let words = |text: &str| text.trim().to_string();
            match line.split_once(": ") {
                None if line == "not yet" => expected.not_yet = true,
                Some(("scans", count)) => expected.scans = count.parse().expect("a number of scans"),
                Some(("dialect", "iec")) => expected.dialect = Dialect::Iec,
                Some(("set", setting)) => expected.set.push(pair(setting)),
                Some(("expect", value)) => expected.values.push(pair(value)),
                Some(("trap", trap)) => expected.trap = Some(words(trap)),
                Some(("values", values)) => expected.trap_values = Some(words(values)),
                Some(("error", error)) => expected.error = Some(words(error)),
                Some(("warning", code)) => expected.warnings.push(words(code)),
                _ => expected.notes.push(line.to_string()),
            }
        }
        expected
    }
}

fn pair(text: &str) -> (String, String) {
    let (name, value) = text.split_once(" = ").expect("NAME = LITERAL");
    (name.trim().to_string(), value.trim().to_string())
}

/// What a run came to, in the words of the expectations.
struct Outcome {
    image: Image,
    trap: Option<String>,
    trap_values: Option<String>,
}

fn outcome(program: &Program, kind: EngineKind, want: &Expected) -> Result<Outcome, String> {
    let layout = program.layout(MAX_IMAGE_BYTES).map_err(|error| error.to_string())?;
    let engine = program.engine(kind, &layout, false).map_err(|error| error.to_string())?;
    let clock = Box::new(VirtualClock::new());
    let loaded = Resource::load(program.verified.clone(), engine, clock, &LoadOptions::default());
    let mut resource = loaded.map_err(|error| error.to_string())?;
    let names = VariableTable::of(program.container());
    for (name, value) in &want.set {
        let variable = names.resolve(name).map_err(|error| error.to_string())?;
        names.write(resource.image_mut(), &variable, value).map_err(|error| error.to_string())?;
    }
    let running = resource.start().map_err(|faulted| format!("at the start: {:?}", faulted.report().trap))?;
    let (mut io, mut inputs, mut observer) = (NoIo, NoInputs, NoObserver);
    let mut hooks = Hooks { io: &mut io, inputs: &mut inputs, observer: &mut observer };
    match run(running, &mut hooks, RunOptions { scans: Some(want.scans) }) {
        RunOutcome::Completed(resource) | RunOutcome::NothingDue(resource) | RunOutcome::Stopped(resource) => {
            Ok(Outcome { image: resource.image().clone(), trap: None, trap_values: None })
        }
        RunOutcome::Faulted(faulted) => trapped(&faulted, program),
    }
}

fn trapped(faulted: &Resource<Faulted>, program: &Program) -> Result<Outcome, String> {
    let FaultPlace::Task { instance, .. } = faulted.report().place else {
        return Err("a trap outside of tasks".into());
    };
    let report = TrapReport::new(&faulted.report().trap, Entry::Instance(instance), program.container());
    let source = report.place.source.as_ref().ok_or("a trap without a place")?;
    let values = report.values.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(" ");
    let trap = format!("{} at {}:{}", report.trap, source.line, source.column);
    Ok(Outcome { image: faulted.image().clone(), trap: Some(trap), trap_values: Some(values) })
}

fn found(diagnostics: &[Diagnostic], sources: &SourceMap, severity: Severity) -> Vec<(String, String)> {
    let wanted = diagnostics.iter().filter(|found| found.severity == severity);
    let place = |found: &Diagnostic| {
        let at = sources.line_column(found.span);
        format!("at {}:{}", at.line, at.column)
    };
    wanted.map(|found| (found.code().to_string(), place(found))).collect()
}

/// What a file does other than it says; nothing when all is well.
pub fn check(name: &str, text: &str) -> Vec<String> {
    let want = Expected::of(text);
    let source = SourceInput { name: name.to_string(), bytes: text.into() };
    let options = CompileOptions { dialect: want.dialect, ..CompileOptions::default() };
    let loaded = match pipeline::compile(&[source], &options) {
        Ok(loaded) => loaded,
        Err(pipeline::Refused::Diagnostics { diagnostics, sources }) => {
            return refused(name, &want, &diagnostics, &sources);
        }
        Err(other) => return vec![format!("{name}: {other}")],
    };
    if let Some(error) = &want.error {
        return vec![format!("{name}: is accepted, expected the error {error}")];
    }
    let mut wrong = Vec::new();
    let warnings = found(&loaded.diagnostics, &loaded.sources, Severity::Warning);
    for code in &want.warnings {
        if !warnings.iter().any(|warning| warning.0 == *code) {
            wrong.push(format!("{name}: expected the warning {code}, found {warnings:?}"));
        }
    }
    match loaded.programs.as_slice() {
        [program] => wrong.extend(compare(name, program, &want)),
        programs => wrong.push(format!("{name}: {} resources where one is wanted", programs.len())),
    }
    wrong
}

fn refused(name: &str, want: &Expected, diagnostics: &[Diagnostic], sources: &SourceMap) -> Vec<String> {
    let errors = found(diagnostics, sources, Severity::Error);
    if let (Some(wanted), [(code, place)]) = (&want.error, errors.as_slice())
        && (*wanted == format!("{code} {place}") || wanted == place)
    {
        return Vec::new();
    }
    let shown = khz_frontend::diagnostics::render::render_all(diagnostics, sources, Default::default());
    match &want.error {
        Some(wanted) => vec![format!("{name}: expected one error {wanted}, found {errors:?}\n{shown}")],
        None => vec![format!("{name}: is refused\n{shown}")],
    }
}

/// Both engines against the expectations and against each other.
fn compare(name: &str, program: &Program, want: &Expected) -> Vec<String> {
    let names = VariableTable::of(program.container());
    let mut wrong = Vec::new();
    let mut outcomes = Vec::new();
    for (engine, kind) in ["interp", "jit"].into_iter().zip(EngineKind::BOTH) {
        match outcome(program, kind, want) {
            Ok(found) => outcomes.push((engine, found)),
            Err(error) => wrong.push(format!("{name} ({engine}): {error}")),
        }
    }
    if let [(_, interp), (_, jit)] = outcomes.as_slice()
        && let Some(at) = interp.image.first_difference(&jit.image)
    {
        wrong.push(format!("{name}: the images differ at {at}"));
    }
    for (engine, found) in &outcomes {
        if found.trap != want.trap {
            wrong.push(format!("{name} ({engine}): trap {:?}, expected {:?}", found.trap, want.trap));
        }
        if want.trap_values.is_some() && found.trap_values != want.trap_values {
            wrong.push(format!("{name} ({engine}): values {:?}, expected {:?}", found.trap_values, want.trap_values));
        }
        for (path, value) in &want.values {
            let got = match names.resolve(path) {
                Ok(variable) => names.text(&found.image, &variable),
                Err(error) => error.to_string(),
            };
            if got != *value {
                wrong.push(format!("{name} ({engine}): {path} = {got}, expected {value}"));
            }
        }
    }
    wrong
}

/// Checks files, as many at once as there are processors. What is wrong comes in the order of the files.
pub fn check_all(root: &Path, files: &[PathBuf]) -> Vec<String> {
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let share = files.len().div_ceil(workers).max(1);
    let check_file = |path: &PathBuf| {
        let name = path.strip_prefix(root).unwrap_or(path).to_string_lossy().into_owned();
        let text = std::fs::read_to_string(path).expect("a readable file");
        check(&name, &text)
    };
    std::thread::scope(|scope| {
        let run = |part| scope.spawn(move || -> Vec<String> { <[PathBuf]>::iter(part).flat_map(check_file).collect() });
        let running: Vec<_> = files.chunks(share).map(run).collect();
        running.into_iter().flat_map(|worker| worker.join().expect("a file panicked")).collect()
    })
}
