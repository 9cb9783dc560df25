//! ST programs with what they must come to, on the virtual clock, in both engines: `tests/programs/*.st`.
//!
//! Comments at the start of a file say what is expected:
//! - `// scans: N` rounds to run (default 1)
//! - `// set: NAME = LITERAL` before the first round
//! - `// expect: NAME = LITERAL` afterwards (also after a trap); for arrays `[a, b]`
//! - `// trap: NAME at LINE:COLUMN` and `// values: name=value …`

mod common;

use common::{files, root};
use khz_frontend::{CompileOptions, SourceInput};
use khz_machine::engine::Entry;
use khz_machine::image::Image;
use khz_machine::report::TrapReport;
use khz_machine::variables::VariableTable;
use khz_scheduler::{FaultPlace, Hooks, LoadOptions, NoInputs, NoIo, NoObserver, Resource, RunOptions, RunOutcome, VirtualClock, run};
use kilohertz::pipeline::{self, EngineKind, Program};

#[derive(Default)]
struct Expected {
    scans: u64,
    set: Vec<(String, String)>,
    values: Vec<(String, String)>,
    trap: Option<String>,
    trap_values: Option<String>,
}

fn expected(text: &str) -> Expected {
    let mut expected = Expected { scans: 1, ..Expected::default() };
    let pair = |text: &str| text.split_once(" = ").map(|(a, b)| (a.trim().to_string(), b.trim().to_string())).unwrap();
    for line in text.lines().map_while(|l| l.strip_prefix("// ")) {
        match line.split_once(": ") {
            Some(("scans", n)) => expected.scans = n.parse().unwrap(),
            Some(("set", setting)) => expected.set.push(pair(setting)),
            Some(("expect", value)) => expected.values.push(pair(value)),
            Some(("trap", trap)) => expected.trap = Some(trap.to_string()),
            Some(("values", values)) => expected.trap_values = Some(values.to_string()),
            _ => {}
        }
    }
    expected
}

/// Runs a program to its end; gives the image and the trap in the words of the expectations.
fn outcome(program: &Program, kind: EngineKind, want: &Expected) -> (Image, Option<String>, Option<String>) {
    let layout = program.layout(1 << 24).unwrap();
    let engine = program.engine(kind, &layout, false).unwrap();
    let clock = Box::new(VirtualClock::new());
    let mut resource = Resource::load(program.verified.clone(), engine, clock, &LoadOptions::default()).unwrap();
    let names = VariableTable::of(program.container());
    for (name, value) in &want.set {
        let variable = names.resolve(name).unwrap();
        names.write(resource.image_mut(), &variable, value).unwrap();
    }
    let running = resource.start().map_err(|f| f.report().trap).unwrap();
    let (mut io, mut inputs, mut observer) = (NoIo, NoInputs, NoObserver);
    let mut hooks = Hooks { io: &mut io, inputs: &mut inputs, observer: &mut observer };
    match run(running, &mut hooks, RunOptions { scans: Some(want.scans) }) {
        RunOutcome::Completed(resource) | RunOutcome::NothingDue(resource) | RunOutcome::Stopped(resource) => (resource.image().clone(), None, None),
        RunOutcome::Faulted(faulted) => {
            let FaultPlace::Task { instance, .. } = faulted.report().place else { panic!("trap outside a task") };
            let report = TrapReport::new(&faulted.report().trap, Entry::Instance(instance), program.container());
            let source = report.place.source.as_ref().unwrap();
            let trap = format!("{} at {}:{}", report.trap, source.line, source.column);
            let values = report.values.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(" ");
            (faulted.image().clone(), Some(trap), Some(values))
        }
    }
}

fn check(name: &str, text: &str) -> Vec<String> {
    let want = expected(text);
    let source = SourceInput { name: name.to_string(), bytes: text.into() };
    let loaded = match pipeline::compile(&[source], &CompileOptions::default()) {
        Ok(loaded) => loaded,
        Err(pipeline::Refused::Diagnostics { diagnostics, sources }) => {
            return vec![khz_frontend::diagnostics::render::render_all(&diagnostics, &sources, Default::default())];
        }
        Err(other) => return vec![format!("{name}: {other}")],
    };
    let program = &loaded.programs[0];
    let names = VariableTable::of(program.container());
    let [interp, jit] = EngineKind::BOTH.map(|kind| outcome(program, kind, &want));
    let mut wrong = Vec::new();
    if let Some(at) = interp.0.first_difference(&jit.0) {
        wrong.push(format!("{name}: images differ at {at}"));
    }
    for (engine, (image, trap, values)) in [("interp", &interp), ("jit", &jit)] {
        if *trap != want.trap {
            wrong.push(format!("{name} ({engine}): trap {trap:?}, expected {:?}", want.trap));
        }
        if want.trap_values.is_some() && *values != want.trap_values {
            wrong.push(format!("{name} ({engine}): values {values:?}, expected {:?}", want.trap_values));
        }
        for (path, value) in &want.values {
            let got = match names.resolve(path) {
                Ok(variable) => names.text(image, &variable),
                Err(error) => error.to_string(),
            };
            if got != *value {
                wrong.push(format!("{name} ({engine}): {path} = {got}, expected {value}"));
            }
        }
    }
    wrong
}

#[test]
fn programs_come_to_what_they_say() {
    let programs = files(&root().join("tests/programs"), "st");
    assert!(programs.len() >= 20);
    let mut wrong = Vec::new();
    for path in programs {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        wrong.extend(check(&name, &std::fs::read_to_string(&path).unwrap()));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_wrong_expectation_is_noticed() {
    let text = "// expect: main.x = 2\nPROGRAM main VAR x : INT; END_VAR x := 1; END_PROGRAM";
    assert_eq!(check("wrong.st", text).len(), 2);
}
