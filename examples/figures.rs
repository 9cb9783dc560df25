//! Figures of docs/performance.md that no other command prints. The programs are the workloads of `../shared/workloads`, or the files given.
//!
//! - `deadlines`: what looking at the deadline costs: native code with and without, in pairs
//! - `guards`: how many guards there are, and how many bytes each takes on the hot path and behind it
//! - `first-scan`: from the start of the process `khz run FILE` to its end behind one scan (`khz` beside this example, release)
//!
//! `cargo build --release && cargo run --release --example figures -- deadlines|guards|first-scan [FILE…]`

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_jit::listing::{Role, listing};
use khz_jit::{Jit, JitOptions};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Limits};
use khz_machine::image::Image;
use kilohertz::files;
use kilohertz::pipeline::{self, Program};
use rustix::time::ClockId;

/// Pairs of measurements for each program; their median counts.
const PAIRS: usize = 101;
/// A measurement lasts about so long, in nanoseconds.
const MEASUREMENT_NS: u64 = 2_000_000;
/// Starts of the process for each program; their median counts.
const STARTS: usize = 21;

fn main() -> ExitCode {
    let mut words = std::env::args().skip(1);
    let what = words.next().unwrap_or_default();
    let mut given: Vec<PathBuf> = words.map(PathBuf::from).collect();
    if given.is_empty() {
        given.push(Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/workloads"));
    }
    let programs = match files::list(&given) {
        Ok(programs) => programs,
        Err(error) => return refuse(&error.to_string()),
    };
    match what.as_str() {
        "deadlines" => deadlines(&programs),
        "guards" => guards(&programs),
        "first-scan" => return first_scan(&programs),
        _ => return refuse("figures deadlines|guards|first-scan [FILE…]"),
    }
    ExitCode::SUCCESS
}

fn deadlines(programs: &[PathBuf]) {
    say("| program | without, ns | with, ns | ratio |\n|---|---|---|---|");
    let mut logarithms = Vec::new();
    for path in programs {
        let program = load(path);
        let mut with = Scanning::new(&program, JitOptions::default());
        let mut without = Scanning::new(&program, JitOptions { deadline_checks: false, ..JitOptions::default() });
        let mut scans = 1;
        // Both run the same scans, so that they are at the same point of their program.
        while with.ns(scans).min(without.ns(scans)) < MEASUREMENT_NS && scans < 1 << 30 {
            scans *= 2;
        }
        let mut rows = Vec::new();
        for pair in 0..PAIRS {
            // Who is first changes, so that a drift of the machine hits both alike.
            let (a, b) = if pair % 2 == 0 {
                let a = with.ns(scans);
                (a, without.ns(scans))
            } else {
                let b = without.ns(scans);
                (with.ns(scans), b)
            };
            rows.push((a as f64 / scans as f64, b as f64 / scans as f64));
        }
        let ratio = median(rows.iter().map(|row| row.0 / row.1));
        logarithms.push(ratio.ln());
        let (on, off) = (median(rows.iter().map(|row| row.0)), median(rows.iter().map(|row| row.1)));
        say(&format!("| {} | {off:.1} | {on:.1} | {ratio:.3} |", name(path)));
    }
    let mean = (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp();
    say(&format!("| geometric mean | | | {mean:.3} |"));
}

/// An engine and the image it runs on.
struct Scanning {
    engine: Jit,
    image: Image,
    instances: usize,
}

impl Scanning {
    fn new(program: &Program, options: JitOptions) -> Scanning {
        let image = program.image(MAX_IMAGE_BYTES).expect("it fits");
        let engine = program.jit(image.layout(), options).expect("it compiles");
        let mut scanning = Scanning { engine, image, instances: program.container().tasks.instances.len() };
        scanning.run(Entry::Init);
        scanning.run(Entry::Startup);
        scanning
    }

    fn run(&mut self, entry: Entry) {
        let deadline = DeadlineCell::new();
        let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
        self.engine.run(entry, &mut self.image, limits).expect("no trap");
    }

    /// Nanoseconds of processor time for so many scans, so that other load on the machine counts less.
    fn ns(&mut self, scans: u64) -> u64 {
        let start = now_ns(ClockId::ThreadCPUTime);
        for _ in 0..scans {
            (0..self.instances).for_each(|instance| self.run(Entry::Instance(instance)));
        }
        now_ns(ClockId::ThreadCPUTime) - start
    }
}

fn guards(programs: &[PathBuf]) {
    say(
        "| program | code, bytes | guards | on the hot path, bytes a guard | behind it, bytes a guard |\n|---|---|---|---|---|",
    );
    for path in programs {
        let program = load(path);
        let layout = program.layout(MAX_IMAGE_BYTES).expect("it fits");
        let counts = JitOptions::default();
        let units = listing(&program.verified, &layout, counts, None).expect("it can be listed");
        let rows: Vec<_> = units.iter().flat_map(|unit| &unit.rows).collect();
        let bytes = |role: Role| rows.iter().filter(|row| row.role == role).map(|row| row.bytes).sum::<u32>();
        // Each guard leaves by one conditional jump.
        let guards = rows.iter().filter(|row| row.role == Role::Guard && row.text.starts_with('j')).count();
        let each = |bytes: u32| f64::from(bytes) / guards.max(1) as f64;
        let code: usize = units.iter().map(|unit| unit.code.len()).sum();
        let (hot, cold) = (each(bytes(Role::Guard)), each(bytes(Role::Cold)));
        say(&format!("| {} | {code} | {guards} | {hot:.1} | {cold:.1} |", name(path)));
    }
}

fn first_scan(programs: &[PathBuf]) -> ExitCode {
    let Some(khz) = std::env::current_exe().ok().and_then(|path| Some(path.parent()?.parent()?.join("khz"))) else {
        return refuse("where this example lies is not known");
    };
    say("| program | median, ms | least, ms |\n|---|---|---|");
    for path in programs {
        let mut times = Vec::new();
        for _ in 0..STARTS {
            let start = now_ns(ClockId::Monotonic);
            let mut command = Command::new(&khz);
            command
                .args(["run", "--clock", "virtual", "--scans", "1"])
                .arg(path)
                .stdout(Stdio::null())
                .stderr(Stdio::null());
            match command.status() {
                Ok(status) if status.success() => times.push((now_ns(ClockId::Monotonic) - start) as f64 / 1e6),
                Ok(status) => return refuse(&format!("{}: {status}", path.display())),
                Err(error) => return refuse(&format!("{}: {error}", khz.display())),
            }
        }
        let least = times.iter().copied().fold(f64::INFINITY, f64::min);
        say(&format!("| {} | {:.1} | {least:.1} |", name(path), median(times.into_iter())));
    }
    ExitCode::SUCCESS
}

fn load(path: &Path) -> Program {
    let input = files::read(&[path.to_path_buf()]).unwrap_or_else(|error| panic!("{error}"));
    let loaded = pipeline::load(input, None).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    loaded.programs.into_iter().next().expect("a program")
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn name(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn now_ns(clock: ClockId) -> u64 {
    let time = rustix::time::clock_gettime(clock);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

#[expect(clippy::print_stdout, reason = "the figures are what this example is for")]
fn say(line: &str) {
    println!("{line}");
}

#[expect(clippy::print_stderr, reason = "an example has no other way to say what is wrong")]
fn refuse(reason: &str) -> ExitCode {
    eprintln!("{reason}");
    ExitCode::from(2)
}
