//! The oracle in C: generated programs through the C compiler, against the engines.
#![allow(dead_code, reason = "each user takes its part")]

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use khz_bytecode::trap::TrapCode;
use khz_bytecode::verify::verify;
use khz_machine::engine::{DeadlineCell, Entry, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::variables::{VariableTable, VariableValue};
use khz_proof::st::c::{Leaf, Program, Scan, Trap, dense, file, operations, results, subset};
use khz_proof::st::case::Case;
use khz_proof::st::constants::settle;
use khz_proof::st::generate;
use khz_proof::st::print::print;
use khz_proof::st::shrink::shrink_case;
use khz_proof::st::tree::{Def, Source, Ty};

use khz_proof::harness::engines;

pub const SCANS: usize = 4;
const IMAGE_LIMIT_BYTES: u64 = 1 << 22;

/// A folder of its own, removed when dropped.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Scratch {
        static NEXT: AtomicUsize = AtomicUsize::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("khz-c-oracle-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a scratch folder");
        Scratch(folder)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // A folder that stays behind in the temporary directory harms nobody.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Compiles and runs a C file; gives what it prints.
pub fn run_c(text: &str) -> String {
    let folder = Scratch::new();
    let (source, program) = (folder.0.join("oracle.c"), folder.0.join("oracle"));
    std::fs::write(&source, text).expect("a scratch file");
    let mut command = Command::new("cc");
    command.args(["-std=c11", "-O1", "-ffp-contract=off", "-w", "-o"]).arg(&program).arg(&source).arg("-lm");
    let made = command.output().unwrap_or_else(|error| {
        panic!("`cc` can not be started ({error}): this test compares with C; `cc` is what Rust links with")
    });
    assert!(made.status.success(), "`cc` refuses the programs:\n{}", String::from_utf8_lossy(&made.stderr));
    let ran = Command::new(&program).output().expect("the compiled programs start");
    assert!(ran.status.success(), "the compiled programs end with {}", ran.status);
    String::from_utf8(ran.stdout).expect("the output is text")
}

/// What a comparison reached.
#[derive(Debug, Default)]
pub struct Tally {
    pub programs: usize,
    pub scans: usize,
    pub values: usize,
    pub traps: [usize; 3],
    /// C functions of operations that programs call.
    pub called: BTreeSet<String>,
}

impl Tally {
    /// Notes which operations a program calls.
    fn calls(&mut self, text: &str) {
        let words = text.split_inclusive(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        let called = words.filter_map(|word| word.strip_suffix('(')).filter(|word| word.contains('_'));
        for word in called {
            if !self.called.contains(word) {
                self.called.insert(word.to_string());
            }
        }
    }

    /// How many operations there are, how many were called, and some that were not.
    pub fn coverage(&self) -> (usize, usize, Vec<String>) {
        let all = operations();
        let missing: Vec<String> = all.difference(&self.called).cloned().collect();
        (all.len(), all.len() - missing.len(), missing)
    }
}

/// The bits of a value as C shows them.
fn bits(source: &Source, leaf: &Leaf, value: &VariableValue) -> Option<u64> {
    Some(match value {
        VariableValue::Bool(value) => u64::from(*value),
        VariableValue::Signed(value) => {
            let width = match source.plain(leaf.ty) {
                Ty::K(kind) => kind.bits(),
                _ => 64,
            };
            *value as u64 & (u64::MAX >> (64 - width))
        }
        VariableValue::Unsigned(value) => *value,
        VariableValue::Real(value) => u64::from(value.to_bits()),
        VariableValue::Lreal(value) => value.to_bits(),
        VariableValue::Named(name) => match leaf.ty {
            Ty::N(id) => match &source.types[id].def {
                Def::Enum(.., values) => {
                    let own = name.rsplit(['#', '.']).next();
                    values.iter().find(|(known, _)| Some(known.as_str()) == own)?.1 as u64
                }
                _ => return None,
            },
            _ => return None,
        },
        _ => return None,
    })
}

/// Runs a program in every engine; the first difference to what C says.
pub fn compare(source: &Source, program: &Program, wanted: &[Scan], tally: &mut Tally) -> Option<String> {
    let container = match engines::compile(&print(source)) {
        Ok(container) => container,
        Err(refusal) => return Some(format!("refused: {}", refusal.text)),
    };
    let verified = Arc::new(verify(container).expect("what is compiled verifies"));
    let layout = ImageLayout::new(verified.container(), IMAGE_LIMIT_BYTES).expect("a small image");
    let names = VariableTable::of(verified.container());
    tally.programs += 1;
    tally.calls(&program.text);
    for maker in engines::makers() {
        let mut engine = (maker.make)(verified.clone(), &layout, false).expect("an engine");
        let mut image = Image::new(layout.clone(), verified.container());
        for (scan, wanted) in wanted.iter().enumerate() {
            let deadline = DeadlineCell::new();
            let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
            let ending = engine.run(Entry::Instance(0), &mut image, limits).err().map(|trap| trap.code);
            let known = wanted.ending.map(|trap| match trap {
                Trap::DivideByZero => TrapCode::DivideByZero,
                Trap::ArrayIndex => TrapCode::ArrayIndex,
                Trap::Range => TrapCode::Range,
            });
            let place = format!("{} scan {scan}", maker.name);
            if ending != known {
                return Some(format!("{place} ends with {ending:?}, C with {known:?}"));
            }
            for (leaf, wanted) in program.leaves.iter().zip(&wanted.leaves) {
                let Ok(variable) = names.resolve(&leaf.path) else { continue };
                let value = names.read(&image, &variable).expect("a leaf");
                if bits(source, leaf, &value) != Some(*wanted) {
                    return Some(format!("{place}: {} = {value:?}, in C {wanted:#x}", leaf.path));
                }
                tally.values += 1;
            }
            tally.scans += 1;
            if let Some(trap) = wanted.ending {
                tally.traps[trap as usize] += 1;
            }
        }
    }
    None
}

/// One program through C and the engines.
fn compare_one(source: &Source) -> Option<String> {
    let program = Program::new(source, 0);
    let output = run_c(&file(std::slice::from_ref(&program), SCANS));
    let mut scans = results(&output).expect("the output of the programs");
    compare(source, &program, &scans.remove(&0).unwrap_or_default(), &mut Tally::default())
}

/// Compares the programs of some seeds, all in one C file; what differs, the first of it made small.
pub fn compare_seeds(seeds: std::ops::Range<u64>, tally: &mut Tally) -> Vec<String> {
    // By turns programs with loops, arrays and structures, and such with nothing but arithmetic.
    let make = |seed: u64| {
        let mut source = if seed.is_multiple_of(2) { subset(&generate(seed), seed) } else { dense(seed) };
        // The compiler takes each: nothing in it traps by constants alone.
        settle(&mut source);
        source
    };
    let sources: Vec<Source> = seeds.clone().map(make).collect();
    let programs: Vec<Program> =
        sources.iter().enumerate().map(|(number, source)| Program::new(source, number)).collect();
    let output = run_c(&file(&programs, SCANS));
    let all = results(&output).expect("the output of the programs");
    let mut found = Vec::new();
    for ((seed, source), program) in seeds.zip(&sources).zip(&programs) {
        let Some(scans) = all.get(&program.number) else {
            found.push(format!("seed {seed}: nothing came of it in C"));
            continue;
        };
        let Some(difference) = compare(source, program, scans, tally) else { continue };
        if !found.is_empty() {
            found.push(format!("seed {seed}: {difference}"));
            continue;
        }
        let case = Case { source: source.clone(), rounds: Vec::new() };
        // A loop that the shrinker makes endless would be endless in C.
        let ends = |source: &Source| {
            let mut evaluator = khz_proof::st::evaluate::Evaluator::new(source, 10_000);
            (0..SCANS).all(|_| evaluator.scan(0) != Err(khz_proof::st::evaluate::Stop::TooLong))
        };
        let shows = |case: &Case| {
            let found = engines::compile(&print(&case.source)).is_ok() && ends(&case.source);
            found && compare_one(&case.source).is_some()
        };
        let (small, _) = shrink_case(&case, &shows, 200);
        let last = compare_one(&small.source).unwrap_or_default();
        found.push(format!("seed {seed}: {difference}\nsmall: {last}\n{}", print(&small.source)));
    }
    found
}
