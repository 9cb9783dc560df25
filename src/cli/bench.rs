//! `khz bench`: the time of a scan, in batches; or ([`jitter`]) start latency per task on the real clock.

mod html;
mod jitter;
mod measure;

use khz_scheduler::time::DurationNs;
use khz_scheduler::{HostOptions, MonotonicClock, on_scan_thread};
use kilohertz::files::{self, Input};
use kilohertz::pipeline::EngineKind;
use serde_json::{Value, json};

use super::args::{BenchArgs, EnginesArg, Format};
use super::output::{Failure, choose, dialect, load, people, result, write_file};
use super::report::report_fault;
use super::session::{Opened, Session};
use super::stopwatch::Stopwatch;
use super::{Outcome, Status};
use measure::{Distribution, Measured};

/// Figures of one engine.
pub struct Figures {
    /// `jit` or `interp`.
    pub engine: &'static str,
    /// Scans and their times.
    pub measured: Measured,
    /// Nanoseconds for sources to container, verification, container to engine.
    pub compile_ns: [u64; 3],
    /// Bytes of the container.
    pub container_bytes: usize,
    /// Bytes of the engine's code.
    pub code_bytes: usize,
}

/// Runs it.
pub fn run(args: &BenchArgs) -> Outcome {
    if args.resource.inputs.is_some() && !args.jitter {
        return Err(Failure::usage("--inputs goes with --jitter: timed scans leave the inputs out"));
    }
    let frontend_ns = frontend_ns(args)?;
    let program = choose(load(&args.sources)?, args.resource.resource.as_deref())?;
    let mut session = Session::new(program, &args.resource);
    session.profile_for(args.perf, args.engine != EnginesArg::Interp)?;
    let host = HostOptions::default();
    if args.jitter {
        let outcome = on_scan_thread(&host, |_| jitter::run(args, &session));
        return outcome.map_err(|error| Failure::Message(Status::Host, format!("no thread to scan on: {error}")))?;
    }
    let kinds: &[EngineKind] = match args.engine {
        EnginesArg::Jit => &[EngineKind::Jit],
        EnginesArg::Interp => &[EngineKind::Interp],
        EnginesArg::Both => &[EngineKind::Jit, EngineKind::Interp],
    };
    let mut all = Vec::new();
    for kind in kinds {
        let measured = on_scan_thread(&host, |_| bench_engine(args, &session, *kind, frontend_ns));
        match measured.map_err(|error| Failure::Message(Status::Host, format!("no thread to scan on: {error}")))?? {
            Some(figures) => all.push(figures),
            None => return Ok(Status::Trap),
        }
    }
    print(args, &all)
}

/// Time from source text to container; 0 for a container file.
fn frontend_ns(args: &BenchArgs) -> Result<u64, Failure> {
    let Input::Sources(sources) = files::read(&args.sources.files)? else { return Ok(0) };
    let options = sources.settings.options(dialect(&args.sources));
    let watch = Stopwatch::start();
    let compilation = khz_frontend::compile(&sources.files, &options);
    let ns = watch.ns();
    drop(compilation);
    Ok(ns)
}

/// Figures of one engine, or none after a trap, which was reported.
fn bench_engine(
    args: &BenchArgs,
    session: &Session<'_>,
    kind: EngineKind,
    frontend_ns: u64,
) -> Result<Option<Figures>, Failure> {
    let container = session.program.container().clone();
    let watch = Stopwatch::start();
    khz_bytecode::verify::verify(container).map_err(Failure::refused)?;
    let verify_ns = watch.ns();
    let layout = session.program.layout(args.resource.max_image).map_err(Failure::refused)?;
    let watch = Stopwatch::start();
    let engine = session.program.engine(kind, &layout, false).map_err(Failure::refused)?;
    let engine_ns = watch.ns();
    let (name, code_bytes) = (engine.name(), engine.code_bytes());
    drop(engine);
    // The monotonic clock arms real deadlines, as in production; the resource's own time moves on by the interval each scan.
    let clock = Box::new(MonotonicClock::new(DurationNs(0)));
    let faulted = match session.open(kind, clock, false, None, None)? {
        Opened::Faulted(faulted) => *faulted,
        Opened::Ready(resource) => match resource.start() {
            Err(faulted) => faulted,
            Ok(running) => match measure::measure(running, args.scans) {
                Ok(measured) => {
                    let compile_ns = [frontend_ns, verify_ns, engine_ns];
                    let container_bytes = session.program.container_bytes;
                    return Ok(Some(Figures { engine: name, measured, compile_ns, container_bytes, code_bytes }));
                }
                Err(faulted) => faulted,
            },
        },
    };
    report_fault(faulted.report(), session.program.container(), args.common.format);
    Ok(None)
}

fn print(args: &BenchArgs, all: &[Figures]) -> Outcome {
    let file = args.sources.files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(" ");
    let rows = Value::Array(all.iter().map(|figures| figures_json(&file, figures)).collect());
    if let Some(path) = &args.json {
        write_file(path, rows.to_string().as_bytes())?;
    }
    if let Some(path) = &args.report {
        write_file(path, html::page(&file, all).as_bytes())?;
    }
    if args.common.format == Format::Json {
        result(&rows.to_string());
        return Ok(Status::Done);
    }
    for figures in all {
        let Distribution { min, median, p99, p999, max, .. } = figures.measured.distribution;
        people(&format!(
            "{:<7} {median:.1} ns a scan (median of {} scans; min {min:.1}, p99 {p99:.1}, p99.9 {p999:.1}, max {max:.1})",
            figures.engine, figures.measured.scans
        ));
        let [frontend, verify, engine] = figures.compile_ns.map(|ns| ns as f64 / 1e6);
        people(&format!(
            "        compiled in {frontend:.2} ms + verified in {verify:.2} ms + made ready in {engine:.2} ms; container {} bytes, code {} bytes",
            figures.container_bytes, figures.code_bytes
        ));
    }
    Ok(Status::Done)
}

fn figures_json(file: &str, figures: &Figures) -> Value {
    let Distribution { min, median, p99, p999, max, mean } = figures.measured.distribution;
    let [frontend, verify, engine] = figures.compile_ns;
    json!({
        "file": file, "engine": figures.engine, "scans": figures.measured.scans,
        "ns_per_scan": { "min": min, "median": median, "p99": p99, "p999": p999, "max": max, "mean": mean },
        "compile_ns": { "frontend": frontend, "verify": verify, "engine": engine },
        "container_bytes": figures.container_bytes, "code_bytes": figures.code_bytes,
    })
}
