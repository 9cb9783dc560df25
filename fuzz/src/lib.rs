//! The bodies of the fuzz targets: plain functions that panic when what they look at is wrong.
//!
//! `cargo fuzz` calls them through `fuzz_targets/`, for as long as one likes; `tests/fuzz_corpus.rs` includes this file and calls them under stable Rust
//! with the corpus and a fixed number of mutants. A hang and too much memory are libFuzzer's to see (`-timeout=1 -malloc_limit_mb=256`).
//!
//! Bytes alone seldom make a container, because of its hashes, or a program, because of its grammar. So half of the mutants come
//! from the mutators of `khz-proof`, which know both ([`mutated_container`], [`mutated_text`]), and the bodies that look behind the hashes give the
//! bytes fresh ones first.

use std::sync::{Arc, OnceLock};

use kilohertz::inputs::CsvInputs;
use kilohertz::khz_bytecode::container::{self, Container};
use kilohertz::khz_bytecode::disassembler::disassemble;
use kilohertz::khz_bytecode::verify::{Verified, verify};
use kilohertz::khz_frontend::diagnostics::render::{Style, render_all};
use kilohertz::khz_frontend::diagnostics::{Diagnostic, has_errors};
use kilohertz::khz_frontend::format::{FormatError, FormatOptions, format};
use kilohertz::khz_frontend::source::SourceMap;
use kilohertz::khz_frontend::{CompileOptions, SourceInput, check, on_large_stack, project};
use kilohertz::khz_machine::image::Image;
use kilohertz::khz_machine::variables::VariableTable;
use kilohertz::khz_proof::mutate::{self, Base};
use kilohertz::khz_proof::oracle::{Maker, Outcome, Plan, compare};
use kilohertz::khz_proof::random::Random;
use kilohertz::khz_proof::statistics::Statistics;
use kilohertz::khz_scheduler::InputSource;
use kilohertz::pipeline::{self, EngineKind, Program, Refused};
use kilohertz::traces::{Choice, MAX_CELLS, Mapping, Trace, TraceError};

/// Largest memory image of a program that is run, in bytes.
const MAX_IMAGE_BYTES: u64 = 1 << 16;

/// A fuzz target.
pub struct Target {
    /// Its name: of the file in `fuzz_targets/`.
    pub name: &'static str,
    /// The folder in `corpus/`; targets of the same bytes share one.
    pub corpus: &'static str,
    /// What it does with some bytes.
    pub body: fn(&[u8]),
    /// Makes other bytes of some.
    pub mutated: fn(&[u8], usize, u32) -> Option<Vec<u8>>,
}

/// Every target.
pub const TARGETS: &[Target] = &[
    Target { name: "source", corpus: "source", body: source, mutated: mutated_text },
    Target { name: "container_reader", corpus: "containers", body: container_reader, mutated: mutated_container },
    Target { name: "verifier", corpus: "containers", body: verifier, mutated: mutated_container },
    Target { name: "verified_execution", corpus: "containers", body: verified_execution, mutated: mutated_container },
    Target { name: "csv", corpus: "csv", body: csv, mutated: mutated_text },
    Target { name: "trace", corpus: "trace", body: trace, mutated: mutated_text },
    Target { name: "mapping", corpus: "mapping", body: mapping, mutated: mutated_text },
    Target { name: "toml", corpus: "toml", body: toml, mutated: mutated_text },
];

fn source_of(bytes: &[u8]) -> SourceInput {
    // XML is TwinCAT's; it is told by the name.
    let start = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
    let name = if start.starts_with(b"<") { "fuzz.TcPOU" } else { "fuzz.st" };
    SourceInput { name: name.into(), bytes: bytes.to_vec() }
}

fn shown(diagnostics: &[Diagnostic], sources: &SourceMap) {
    let text = render_all(diagnostics, sources, Style { colour: false });
    assert_eq!(text.is_empty(), diagnostics.is_empty(), "a diagnostic has words");
}

/// What `khz check`, `khz build` and `khz fmt` do with a source: what `check` takes compiles, what compiles verifies, and formatting twice is formatting once.
pub fn source(bytes: &[u8]) {
    on_large_stack(|| {
        let source = source_of(bytes);
        let is_text = source.name.ends_with(".st");
        let options = CompileOptions::default();
        let sources = [source];
        let checked = check(&sources, &options);
        shown(&checked.diagnostics, &checked.sources);
        match pipeline::compile(&sources, &options) {
            // Of the unit tests only `check` looks at the insides.
            Ok(_) | Err(Refused::TooLarge { .. }) => {}
            Err(Refused::Diagnostics { diagnostics, .. }) => {
                assert!(has_errors(&checked.diagnostics), "compiling finds more than checking: {diagnostics:?}");
            }
            Err(other) => panic!("{other}"),
        }
        if let Some(text) = std::str::from_utf8(bytes).ok().filter(|_| is_text) {
            formatted(text);
        }
    });
}

fn formatted(text: &str) {
    let options = FormatOptions::default();
    match format(text, &options) {
        Ok(once) => assert_eq!(format(&once, &options), Ok(once), "formatting twice is not formatting once"),
        Err(FormatError::Syntax(_)) => {}
        Err(error) => panic!("{error}"),
    }
}

/// A file that is read has no second spelling: written again it is the same.
pub fn container_reader(bytes: &[u8]) {
    let mut resealed = bytes.to_vec();
    container::reseal(&mut resealed);
    for bytes in [bytes, &resealed] {
        if let Ok(found) = container::read(bytes) {
            assert!(container::write(&found).as_deref() == Ok(bytes), "written again it is another file");
        }
    }
}

/// The container of these bytes behind their hashes, if they are one.
fn resealed(bytes: &[u8]) -> Option<Container> {
    let mut bytes = bytes.to_vec();
    container::reseal(&mut bytes);
    container::read(&bytes).ok()
}

fn verified(bytes: &[u8]) -> Option<Arc<Verified>> {
    verify(resealed(bytes)?).ok().map(Arc::new)
}

fn program(verified: Arc<Verified>) -> Program {
    Program { name: String::new(), verified, container_bytes: 0, inputs: Vec::new() }
}

/// Verifies, and shows what is sound in every way that needs no engine: as assembly text and, by the names of a debug section that nobody
/// checked, as variables.
pub fn verifier(bytes: &[u8]) {
    let Some(container) = resealed(bytes) else { return };
    let text = disassemble(&container);
    assert!(container.functions.is_empty() || !text.is_empty(), "a container with functions has a text");
    let Ok(verified) = verify(container) else { return };
    let program = program(Arc::new(verified));
    let Ok(image) = program.image(MAX_IMAGE_BYTES) else { return };
    let names = VariableTable::of(program.container());
    for variable in names.variables() {
        let leaves = names.leaves(&variable, 100);
        assert!(leaves.len() <= 100, "more leaves than were wanted");
        // A name may be anything, or stand twice.
        let _ = names.resolve(&variable.name);
    }
    let dump = names.dump_json(&image, 0, 0);
    assert!(dump.starts_with('{') && dump.trim_end().ends_with('}'), "{dump}");
    assert!(names.dump_text(&image).len() < 64 << 20);
}

/// Both engines, with fuel and without, do what the third evaluator does.
pub fn verified_execution(bytes: &[u8]) {
    let Some(verified) = verified(bytes) else { return };
    let make = |kind| {
        move |verified: Arc<Verified>, layout: &_, fuel| {
            program(verified).engine(kind, layout, fuel).map_err(|error| error.to_string())
        }
    };
    let (interpreter, native) = (make(EngineKind::Interp), make(EngineKind::Jit));
    let makers = [Maker::new("interp", &interpreter), Maker::new("jit", &native)];
    let plan = Plan { scans: 3, fuel: 5_000, image_limit_bytes: MAX_IMAGE_BYTES, ..Plan::default() };
    if let Outcome::Different(found) = compare(&verified, &makers, &plan, &mut Statistics::default()) {
        panic!("{}", found.description);
    }
}

/// Types of the variables that cells can be for.
const TYPES: &str =
    "TYPE Colour : (red, green, blue); Part : INT(-5..5); Pair : STRUCT a : INT; b : LREAL; END_STRUCT; END_TYPE";

/// Variables of every kind. Those of types that the front end does not know yet are left out.
const VARIABLES: &[&str] = &[
    "x : BOOL;",
    "n : INT;",
    "u : ULINT;",
    "r : REAL;",
    "l : LREAL;",
    "t : TIME;",
    "d : DATE;",
    "dt : DT;",
    "tod : LTOD;",
    "s : STRING[8];",
    "w : WSTRING[4];",
    "c : CHAR;",
    "e : Colour;",
    "p : Part;",
    "pair : Pair;",
    "a : ARRAY[1..3, 0..1] OF DINT;",
    "q AT %QX1.3 : BOOL;",
    "i AT %IW0 : INT;",
];

fn program_with(variables: &[&str]) -> Result<Program, Refused> {
    let text = format!("{TYPES} PROGRAM main VAR {} END_VAR END_PROGRAM", variables.concat());
    let source = SourceInput { name: "columns.st".into(), bytes: text.into() };
    pipeline::compile(&[source], &CompileOptions::default()).map(|mut loaded| loaded.programs.remove(0))
}

/// The names and the image of a program with [`VARIABLES`].
fn columns() -> &'static (VariableTable, Image) {
    static TABLE: OnceLock<(VariableTable, Image)> = OnceLock::new();
    TABLE.get_or_init(|| {
        let known: Vec<&str> = VARIABLES.iter().copied().filter(|one| program_with(&[one]).is_ok()).collect();
        assert!(known.len() >= 10, "only {known:?} compile");
        let program = program_with(&known).unwrap_or_else(|error| panic!("{error}"));
        let image = program.image(MAX_IMAGE_BYTES).unwrap_or_else(|error| panic!("{error}"));
        (VariableTable::of(program.container()), image)
    })
}

/// An `--inputs` file: refused with a line, or every row can be applied in the order of time.
pub fn csv(bytes: &[u8]) {
    let (names, image) = columns();
    let mut inputs = match CsvInputs::parse("inputs.csv", bytes, names, image) {
        Ok(inputs) => inputs,
        Err(error) => {
            return assert!(error.line > 0 && !error.reason.is_empty(), "an error without a place: {error:?}");
        }
    };
    let mut image = image.clone();
    let mut last = 0;
    while let Some(time_us) = inputs.next_change_us() {
        assert!(time_us >= last, "time goes back");
        last = time_us;
        inputs.apply(time_us, &mut image);
        assert!(inputs.next_change_us().is_none_or(|next| next > time_us), "a row was not applied");
    }
}

fn has_a_place(error: &TraceError) {
    assert!(
        error.line > 0 && error.column != Some(0) && !error.reason.is_empty(),
        "an error without a place: {error:?}"
    );
}

/// A trace that is read has rows in the order of time, and every cell of it can be asked for.
fn is_sound(trace: &Trace) {
    assert!(!trace.is_empty() && trace.lines.len() == trace.len() && !trace.columns.is_empty(), "{trace:?}");
    assert!(trace.times_us.is_sorted_by(|a, b| a < b), "time goes back");
    // Rows that a carriage return alone ends are of one line.
    assert!(trace.lines.is_sorted(), "lines go back");
    assert!(trace.len() * trace.columns.len() <= MAX_CELLS, "more cells than a trace may have");
    for column in 0..trace.columns.len() {
        // A number is a number, whatever the cell says.
        let _ = (0..trace.len()).filter_map(|row| trace.cell(row, column).number()).fold(0.0, f64::max);
    }
}

/// A trace: refused with a place, or sound; with columns that drive the program and without.
pub fn trace(bytes: &[u8]) {
    let (names, image) = columns();
    for drive in [None, Some(vec!["main.n".to_string(), "main.s".to_string()])] {
        let choice = Choice { mapping: Mapping::default(), drive };
        match Trace::read("trace.csv", bytes, &choice, names, image) {
            Ok(trace) => is_sound(&trace),
            Err(error) => has_a_place(&error),
        }
    }
}

/// The trace that mappings are for.
const MAPPED: &str = "time_us,x,n,r,speed,stamp\n0,1,2,1.5,30000,T#1s\n10,0,,-0.25,-3,1000\n1000,1,7,NaN,1e3,\n";

/// A `--map` file: refused with a place, or what it says of a trace is.
pub fn mapping(bytes: &[u8]) {
    let (names, image) = columns();
    let mapping = match Mapping::read("map.csv", bytes) {
        Ok(mapping) => mapping,
        Err(error) => return has_a_place(&error),
    };
    match Trace::read("trace.csv", MAPPED.as_bytes(), &Choice { mapping, drive: None }, names, image) {
        Ok(trace) => is_sound(&trace),
        Err(error) => has_a_place(&error),
    }
}

/// A `khz.toml`: what is wrong with it is said at a place.
pub fn toml(bytes: &[u8]) {
    let mut sources = SourceMap::new();
    let (found, diagnostics) = project::read(&mut sources, project::FILE_NAME, bytes);
    shown(&diagnostics, &sources);
    assert!(found.libraries.len() <= project::MAX_PATHS, "more paths than a project may have");
}

/// A mutant of a container's file, at most `most` bytes long; none for bytes that are no container, and for half of the seeds.
#[must_use]
pub fn mutated_container(bytes: &[u8], most: usize, seed: u32) -> Option<Vec<u8>> {
    let mut random = Random::new(u64::from(seed));
    let base = Base::new(resealed(bytes).filter(|_| random.chance(50))?)?;
    mutate::spoil(&mut random, &base).bytes.filter(|bytes| bytes.len() <= most)
}

/// A mutant of a text, at most `most` bytes long; none for half of the seeds.
#[must_use]
pub fn mutated_text(bytes: &[u8], most: usize, seed: u32) -> Option<Vec<u8>> {
    let mutant = mutate::source::mutant(&[bytes.to_vec()], u64::from(seed));
    Some(mutant.bytes).filter(|bytes| seed.is_multiple_of(2) && bytes.len() <= most)
}

/// Puts bytes at the start of a buffer that has room for them, and says how many they are.
pub fn put(buffer: &mut [u8], bytes: &[u8]) -> usize {
    buffer[..bytes.len()].copy_from_slice(bytes);
    bytes.len()
}
