//! `khz run`: a program under the scheduler.

use std::path::Path;

use khz_machine::image::Image;
use khz_scheduler::time::DurationNs;
use khz_scheduler::{
    Clock, Faulted, Hooks, HostOptions, HostReport, InputSource, MonotonicClock, NoInputs, NoIo, Resource, RunOptions,
    RunOutcome, StatisticsReport, StopHandle, Stopped, VirtualClock, on_scan_thread, run as run_rounds,
    stop_on_signals,
};
use kilohertz::pipeline::EngineKind;

use super::args::{ClockArg, EngineArg, Format, RunArgs};
use super::output::{Failure, choose, load, people, print_diagnostics, result, write_file};
use super::report::report_fault;
use super::session::{Opened, Session};
use super::trace::Onlooker;
use super::{Outcome, Status};

/// Runs it.
pub fn run(args: &RunArgs) -> Outcome {
    let loaded = load(&args.sources)?;
    if args.common.format == Format::Human {
        print_diagnostics(&loaded.diagnostics, &loaded.sources, Format::Human);
    }
    let program = choose(loaded, args.resource.resource.as_deref())?;
    let mut session = Session::new(program, &args.resource);
    session.profile_for(args.perf, args.engine != EngineArg::Interp)?;
    let stop = StopHandle::new();
    stop_on_signals(&stop).map_err(|error| Failure::Message(Status::Host, format!("signal handlers: {error}")))?;
    let host =
        HostOptions { real_time_priority: args.rt, cpu: args.cpu.map(|cpu| cpu as usize), ..HostOptions::default() };
    let outcome = on_scan_thread(&host, |report| run_on_scan_thread(args, &session, stop, &report));
    outcome.map_err(|error| Failure::Message(Status::Host, format!("no thread to scan on: {error}")))?
}

fn run_on_scan_thread(args: &RunArgs, session: &Session<'_>, stop: StopHandle, host: &HostReport) -> Outcome {
    if let Some(refusal) = host.first_refusal() {
        return Err(Failure::Message(Status::Host, refusal.to_string()));
    }
    let clock: Box<dyn Clock> = match args.clock {
        ClockArg::Real => Box::new(MonotonicClock::new(DurationNs::from_us(args.spin_us))),
        ClockArg::Virtual => Box::new(VirtualClock::new()),
    };
    let fuel = args.clock == ClockArg::Virtual && session.needs_fuel();
    let kind = match args.engine {
        EngineArg::Jit => EngineKind::Jit,
        EngineArg::Interp => EngineKind::Interp,
    };
    let resource = match session.open(kind, clock, fuel, Some(stop), args.rt)? {
        Opened::Ready(resource) => resource,
        Opened::Faulted(faulted) => return end_faulted(args, session, &faulted),
    };
    let mut rows = session.inputs(resource.image())?;
    let trace = args.trace.as_deref().map(|path| (path, args.watch.as_slice()));
    let mut onlooker =
        Onlooker::new(trace, &session.names, args.common.format == Format::Human && args.clock == ClockArg::Real)?;
    let running = match resource.start() {
        Ok(running) => running,
        Err(faulted) => return end_faulted(args, session, &faulted),
    };
    let mut no_rows = NoInputs;
    let inputs: &mut dyn InputSource = match &mut rows {
        Some(rows) => rows,
        None => &mut no_rows,
    };
    let mut io = NoIo;
    let mut hooks = Hooks { io: &mut io, inputs, observer: &mut onlooker };
    let outcome = run_rounds(running, &mut hooks, RunOptions { scans: args.scans.filter(|_| !args.continuous) });
    onlooker.finish()?;
    end(args, session, outcome)
}

fn end(args: &RunArgs, session: &Session<'_>, outcome: RunOutcome) -> Outcome {
    let (resource, why): (Resource<Stopped>, &str) = match outcome {
        RunOutcome::Completed(resource) => (resource, "all scans done"),
        RunOutcome::NothingDue(resource) => (resource, "nothing can be due any more"),
        RunOutcome::Stopped(resource) => (resource, "stopped"),
        RunOutcome::Faulted(faulted) => return end_faulted(args, session, &faulted),
    };
    write_results(args, session, resource.image(), &resource.statistics())?;
    let statistics = resource.statistics();
    if args.common.format == Format::Json {
        result(&format!("{{\"ended\":\"{why}\",\"statistics\":{}}}", statistics_json(session, &statistics)));
    } else {
        people(&format!("{why} after {} rounds, {:.3} s", resource.rounds(), resource.time().as_us() as f64 / 1e6));
        summary(&statistics, session);
    }
    Ok(Status::Done)
}

fn end_faulted(args: &RunArgs, session: &Session<'_>, faulted: &Resource<Faulted>) -> Outcome {
    write_results(args, session, faulted.image(), &faulted.statistics())?;
    report_fault(faulted.report(), session.program.container(), args.common.format);
    Ok(Status::Trap)
}

/// The dump and the statistics, also after a trap.
fn write_results(
    args: &RunArgs,
    session: &Session<'_>,
    image: &Image,
    statistics: &StatisticsReport,
) -> Result<(), Failure> {
    if let Some(path) = &args.dump_vars {
        let text = if is_json(path) {
            session.names.dump_json(image, statistics.time.as_us(), statistics.rounds)
        } else {
            session.names.dump_text(image)
        };
        write_file(path, text.as_bytes())?;
    }
    if let Some(path) = &args.stats {
        write_file(path, statistics_json(session, statistics).as_bytes())?;
    }
    Ok(())
}

fn statistics_json(session: &Session<'_>, statistics: &StatisticsReport) -> String {
    statistics.to_json(&session.program.task_names())
}

fn is_json(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"))
}

/// One line a task: what it did and what it took.
fn summary(statistics: &StatisticsReport, session: &Session<'_>) {
    for (name, task) in session.program.task_names().iter().zip(&statistics.tasks) {
        let mut line =
            format!("  {name}: {} scans, {} overruns, {} cycles lost", task.scans, task.overruns, task.lost_cycles);
        if let Some(execution) = &task.execution {
            line += &format!(
                ", execution {} / {} / {} ns (min, average, max)",
                execution.min, execution.average, execution.max
            );
        }
        if let Some(jitter) = &task.jitter {
            line += &format!(", start jitter {} / {} ns (average, max)", jitter.average, jitter.max);
        }
        people(&line);
    }
}
