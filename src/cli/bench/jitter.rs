//! How late tasks start, on the real clock.

use std::time::Duration;

use khz_scheduler::time::DurationNs;
use khz_scheduler::{
    Faulted, Hooks, MonotonicClock, NoInputs, NoIo, NoObserver, Resource, RunOptions, RunOutcome, StatisticsReport,
    StopHandle, run as run_rounds, stop_on_signals,
};
use kilohertz::pipeline::EngineKind;

use super::super::args::{BenchArgs, EnginesArg, Format};
use super::super::output::{Failure, people, result, write_file};
use super::super::report::report_fault;
use super::super::session::{Opened, Session};
use super::super::{Outcome, Status};
use super::html;

/// Runs on the real clock for `--duration` and reports how late each task started.
pub fn run(args: &BenchArgs, session: &Session<'_>) -> Outcome {
    let kind = match args.engine {
        EnginesArg::Interp => EngineKind::Interp,
        EnginesArg::Jit => EngineKind::Jit,
        EnginesArg::Both => return Err(Failure::usage("--jitter measures one engine: choose --engine jit or interp")),
    };
    let stop = StopHandle::new();
    stop_on_signals(&stop).map_err(|error| Failure::Message(Status::Host, format!("signal handlers: {error}")))?;
    let faulted = |faulted: &Resource<Faulted>| {
        report_fault(faulted.report(), session.program.container(), args.common.format);
        Ok(Status::Trap)
    };
    let clock = Box::new(MonotonicClock::new(DurationNs(0)));
    let resource = match session.open(kind, clock, false, Some(stop.clone()), None)? {
        Opened::Ready(resource) => resource,
        Opened::Faulted(resource) => return faulted(&resource),
    };
    let mut rows = session.inputs(resource.image())?;
    let mut no_rows = NoInputs;
    let running = match resource.start() {
        Ok(running) => running,
        Err(resource) => return faulted(&resource),
    };
    let duration = Duration::from_secs(args.duration);
    std::thread::spawn(move || {
        std::thread::sleep(duration);
        stop.request();
    });
    let (mut io, mut observer) = (NoIo, NoObserver);
    let mut hooks = Hooks {
        io: &mut io,
        inputs: rows.as_mut().map_or(&mut no_rows as _, |rows| rows as _),
        observer: &mut observer,
    };
    match run_rounds(running, &mut hooks, RunOptions { scans: args.scans }) {
        RunOutcome::Completed(resource) | RunOutcome::NothingDue(resource) | RunOutcome::Stopped(resource) => {
            print(args, session, &resource.statistics())
        }
        RunOutcome::Faulted(resource) => faulted(&resource),
    }
}

fn print(args: &BenchArgs, session: &Session<'_>, statistics: &StatisticsReport) -> Outcome {
    let names = session.program.task_names();
    let text = statistics.to_json(&names);
    if let Some(path) = &args.json {
        write_file(path, text.as_bytes())?;
    }
    if let Some(path) = &args.report {
        write_file(path, html::jitter_page(statistics, &names).as_bytes())?;
    }
    if args.common.format == Format::Json {
        result(&text);
        return Ok(Status::Done);
    }
    for (name, task) in names.iter().zip(&statistics.tasks) {
        if let Some(late) = &task.jitter {
            let [median, p99, p999] = [late.median, late.p99, late.p999].map(Option::unwrap_or_default);
            people(&format!(
                "{name}: {} starts, late by {} / {median} / {p99} / {p999} / {} ns (min, median, p99, p99.9, max)",
                late.count, late.min, late.max
            ));
        }
    }
    Ok(Status::Done)
}
