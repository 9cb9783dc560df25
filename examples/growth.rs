//! What compiling costs as programs grow, stage by stage: ten times the program should take ten times the time.
//!
//! `cargo run --release --example growth [-- SHAPE…]` prints a table for each shape; SHAPE is one of those in [`SHAPES`].

use std::fmt::Write;
use std::process::Command;
use std::sync::Arc;

use khz_bytecode::container;
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_bytecode::verify::verify;
use khz_frontend::{CompileOptions, SourceInput};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Limits};
use kilohertz::pipeline::{EngineKind, Program};

/// What a program has many of, how many, and how its text is made.
type Shape = (&'static str, &'static [usize], fn(usize) -> String);

const SHAPES: &[Shape] = &[
    ("rungs", &[500, 5_000, 50_000, 100_000], rungs),
    ("instances", &[10, 100, 1_000, 10_000], instances),
    ("arms", &[10, 100, 1_000, 10_000], arms),
    ("ifs", &[100, 1_000, 10_000], ifs),
    ("loops", &[100, 1_000, 4_000], loops),
    ("steps", &[100, 1_000, 10_000], steps),
    ("functions", &[10, 100, 1_000, 10_000], functions),
];

/// Each figure is the least of so many runs.
const RUNS: usize = 3;
/// First argument of a process that measures one program.
const ONE: &str = "--one";
/// Runs whose scans are timed: at least so many instructions' worth of units.
const UNITS_TIMED: usize = 2_000_000;

/// Boolean networks one behind the other, over 200 coils.
fn rungs(count: usize) -> String {
    let mut text = declared("x", 200, "BOOL");
    for k in 0..count {
        let [q, a, b, c, d] = [31, 7, 13, 29, 7].map(|factor| k * factor % 200);
        let _ = writeln!(text, "x{q} := (x{a} AND NOT x{b}) OR (x{c} AND x{});", (d + 1) % 200);
    }
    text + "END_PROGRAM\n"
}

/// Instances of one function block with a timer in it, called one after the other.
fn instances(count: usize) -> String {
    let mut text = String::from(
        "FUNCTION_BLOCK St VAR_INPUT go : BOOL; END_VAR VAR_OUTPUT done : BOOL; END_VAR VAR n : DINT; t : TON; END_VAR\n\
         t(IN := go, PT := T#5ms);\nIF t.Q THEN n := n + 1; done := TRUE; ELSE done := FALSE; END_IF;\nEND_FUNCTION_BLOCK\n",
    );
    text += &declared("s", count, "St");
    for k in 0..count {
        let _ = writeln!(text, "s{k}(go := s{}.done);", k.saturating_sub(1));
    }
    text + "END_PROGRAM\n"
}

/// Arms of one CASE.
fn arms(count: usize) -> String {
    let mut text = String::from("PROGRAM main\nVAR n, m, sum : DINT; END_VAR\n");
    let _ = writeln!(text, "n := (n + 1) MOD {count};\nCASE n OF");
    for k in 0..count {
        let _ = writeln!(text, "{k}: sum := sum + m * {}; m := sum MOD {};", k % 7 + 1, k % 5 + 2);
    }
    text + "ELSE sum := 0;\nEND_CASE;\nEND_PROGRAM\n"
}

/// IF statements with an ELSIF and an ELSE.
fn ifs(count: usize) -> String {
    let mut text = declared("n", 100, "DINT");
    for k in 0..count {
        let [a, b, c] = [7, 13, 31].map(|factor| (k * factor + 1) % 100);
        let _ = writeln!(
            text,
            "IF n{a} > n{b} THEN n{c} := n{c} + 1; ELSIF n{b} = {k} THEN n{c} := 0; ELSE n{c} := n{a} - n{c}; END_IF;"
        );
    }
    text + "END_PROGRAM\n"
}

/// FOR loops over one array.
fn loops(count: usize) -> String {
    let mut text = String::from("PROGRAM main\nVAR i, n : DINT; v : ARRAY[0..9] OF DINT; END_VAR\n");
    for k in 0..count {
        let _ = writeln!(text, "FOR i := 0 TO 9 DO v[i] := v[(i * {}) MOD 10] + n; n := n + {k}; END_FOR;", k % 9 + 1);
    }
    text + "END_PROGRAM\n"
}

/// A sequence: one loop around a CASE whose arms hold rungs, ten each.
fn steps(count: usize) -> String {
    let mut text = declared("x", 200, "BOOL").replace("END_VAR", "step, i : DINT; END_VAR");
    let _ = writeln!(text, "FOR i := 0 TO 1 DO\nstep := (step + 1) MOD {};\nCASE step OF", count.div_ceil(10));
    for k in 0..count {
        if k % 10 == 0 {
            let _ = writeln!(text, "{}:", k / 10);
        }
        let [q, a, b, c] = [31, 7, 13, 29].map(|factor| k * factor % 200);
        let _ = writeln!(text, "IF x{a} AND NOT x{b} THEN x{q} := x{c}; ELSE x{q} := NOT x{c} OR x{b}; END_IF;");
    }
    text + "END_CASE;\nEND_FOR;\nEND_PROGRAM\n"
}

/// Functions, each of which calls the one before the last ten.
fn functions(count: usize) -> String {
    let mut text = String::new();
    for k in 0..count {
        let inner = if k % 10 == 0 { "a * 3".to_owned() } else { format!("f{}(a + 1)", k - 1) };
        let _ = writeln!(
            text,
            "FUNCTION f{k} : DINT VAR_INPUT a : DINT; END_VAR VAR i : DINT; END_VAR\nFOR i := 0 TO 3 DO f{k} := f{k} + {inner} MOD 7; \
             END_FOR;\nEND_FUNCTION"
        );
    }
    text += "PROGRAM main\nVAR n : DINT; END_VAR\n";
    for k in (0..count).filter(|k| k % 10 == 2) {
        let _ = writeln!(text, "n := n + f{k}(n);");
    }
    text + "END_PROGRAM\n"
}

/// The head of a program with so many variables of one type.
fn declared(name: &str, count: usize, ty: &str) -> String {
    let mut text = String::from("PROGRAM main\nVAR\n");
    for k in 0..count {
        let _ = writeln!(text, "{name}{k} : {ty};");
    }
    text + "END_VAR\n"
}

/// Processor time of each stage and of one scan.
#[derive(Clone, Copy)]
struct Row {
    frontend_ms: f64,
    load_ms: f64,
    verify_ms: f64,
    interp_ms: f64,
    jit_ms: f64,
    code_bytes: usize,
    scan_ns: [f64; 2],
}

/// Milliseconds of processor time, so that other load on the machine counts less; the front end's own thread is included.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let now = || {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 / 1e6
    };
    let start = now();
    let done = work();
    (done, now() - start)
}

fn measure(text: &str, units: usize) -> Row {
    let sources = [SourceInput { name: "growth.st".into(), bytes: text.as_bytes().to_vec() }];
    let (compilation, frontend_ms) = timed(|| khz_frontend::compile(&sources, &CompileOptions::default()));
    assert!(compilation.resources.len() == 1, "it compiles: {:?}", compilation.diagnostics.first());
    let bytes = container::write(&compilation.resources[0].container).expect("it fits");
    let (read, load_ms) = timed(|| container::read(&bytes).expect("it reads"));
    let (verified, verify_ms) = timed(|| verify(read).expect("it verifies"));
    let (name, container_bytes) = ("growth".into(), bytes.len());
    let program = Program { name, verified: Arc::new(verified), container_bytes, inputs: Vec::new() };
    let layout = program.layout(MAX_IMAGE_BYTES).expect("it fits");
    let (mut interp, interp_ms) = timed(|| program.engine(EngineKind::Interp, &layout, false).expect("it compiles"));
    let (mut jit, jit_ms) = timed(|| program.engine(EngineKind::Jit, &layout, false).expect("it compiles"));
    let scan_ns = [&mut jit, &mut interp].map(|engine| scan_ns(&program, engine.as_mut(), units));
    Row { frontend_ms, load_ms, verify_ms, interp_ms, jit_ms, code_bytes: jit.code_bytes(), scan_ns }
}

fn scan_ns(program: &Program, engine: &mut dyn Engine, units: usize) -> f64 {
    let mut image = program.image(MAX_IMAGE_BYTES).expect("it fits");
    let deadline = DeadlineCell::new();
    let scans = (UNITS_TIMED / units).max(10);
    let ((), ms) = timed(|| {
        for _ in 0..scans {
            let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
            engine.run(Entry::Instance(0), &mut image, limits).expect("no trap");
        }
    });
    ms * 1e6 / scans as f64
}

/// Columns of a row, as the child process writes them and the parent reads them.
impl Row {
    fn figures(&self) -> [f64; 8] {
        let [jit_ns, interp_ns] = self.scan_ns;
        let code_bytes = self.code_bytes as f64;
        [self.frontend_ms, self.load_ms, self.verify_ms, self.interp_ms, self.jit_ms, code_bytes, jit_ns, interp_ns]
    }
}

/// Measures once, in a process of its own: memory that an earlier measurement left behind would make small programs look cheap, since they fit into
/// it and need nothing new from the host.
fn measured_apart(name: &str, count: usize) -> [f64; 8] {
    let own = std::env::current_exe().expect("it has a path");
    let child = Command::new(own).args([ONE, name, &count.to_string()]).output().expect("it starts");
    assert!(child.status.success(), "{name} {count}: {}", String::from_utf8_lossy(&child.stderr));
    let text = String::from_utf8_lossy(&child.stdout);
    let figures: Vec<f64> = text.split_whitespace().map(|figure| figure.parse().expect("a figure")).collect();
    figures.try_into().expect("a row")
}

#[expect(clippy::print_stdout, reason = "the tables are what this example is for")]
fn main() {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    if let [mark, name, count] = asked.as_slice()
        && mark == ONE
    {
        let count: usize = count.parse().expect("a count");
        let text = SHAPES.iter().find(|row| row.0 == name).expect("a shape").2;
        println!("{}", measure(&text(count), count).figures().map(|figure| figure.to_string()).join(" "));
        return;
    }
    for (name, sizes, _) in SHAPES.iter().filter(|row| asked.is_empty() || asked.iter().any(|a| a == row.0)) {
        println!(
            "| {name} | front end, ms | load, ms | verify, ms | interp, ms | jit, ms | code, bytes | jit, µs each | scan jit, ns | scan interp, ns |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|");
        for &count in *sizes {
            let rows: Vec<[f64; 8]> = (0..RUNS).map(|_| measured_apart(name, count)).collect();
            let least = |of: usize| rows.iter().map(|row| row[of]).fold(f64::INFINITY, f64::min);
            let [frontend, load, verify, interp, jit, code, scan_jit, scan_interp] = std::array::from_fn(least);
            println!(
                "| {count} | {frontend:.2} | {load:.2} | {verify:.2} | {interp:.2} | {jit:.2} | {code} | {:.1} | {scan_jit:.0} | {scan_interp:.0} |",
                jit * 1e3 / count as f64,
            );
        }
        println!();
    }
}
