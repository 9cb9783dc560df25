//! `--hot`: runs a program with code that counts its blocks, and says which source lines cost most.

use khz_frontend::source::SourceMap;
use khz_jit::listing::{Unit, listing};
use khz_jit::{BlockCounts, JitOptions};
use khz_machine::engine::Engine;
use khz_scheduler::{
    Faulted, Hooks, HostOptions, NoInputs, NoIo, NoObserver, Resource, RunOptions, RunOutcome, StopHandle,
    VirtualClock, on_scan_thread, run as run_rounds, stop_on_signals,
};
use kilohertz::pipeline::Program;
use serde_json::{Value, json};

use super::super::args::{DisasmArgs, Format};
use super::super::output::{Failure, result};
use super::super::report::report_fault;
use super::super::session::{Opened, Session};
use super::super::{Outcome, Status};
use super::machine_code::{self, Costs};

/// Runs it.
pub fn run(args: &DisasmArgs, program: Program, sources: &SourceMap) -> Outcome {
    let session = Session::new(program, &args.resource);
    let stop = StopHandle::new();
    stop_on_signals(&stop).map_err(|error| Failure::Message(Status::Host, format!("signal handlers: {error}")))?;
    let counted = on_scan_thread(&HostOptions::default(), |_| count(args, &session, stop));
    let counted =
        counted.map_err(|error| Failure::Message(Status::Host, format!("no thread to scan on: {error}")))??;
    let Some((units, rounds)) = counted else { return Ok(Status::Trap) };
    let costs = Costs::new(&units, rounds);
    let text = machine_code::text(&units, sources, Some(&costs));
    if args.common.format == Format::Json {
        let lines = costs.lines.iter().map(|((file, line), instructions)| {
            json!({ "file": file, "line": line, "instructions": instructions, "share": costs.share(*instructions) })
        });
        let lines: Vec<Value> = lines.collect();
        let name = &session.program.name;
        let figures =
            json!({ "resource": name, "rounds": rounds, "instructions": costs.total, "lines": lines, "text": text });
        result(&figures.to_string());
    } else {
        result(text.trim_end());
    }
    Ok(Status::Done)
}

/// All code with its counts, and how many rounds were run; none after a trap, which was reported.
fn count(args: &DisasmArgs, session: &Session<'_>, stop: StopHandle) -> Result<Option<(Vec<Unit>, u64)>, Failure> {
    let layout = session.program.layout(args.resource.max_image).map_err(Failure::refused)?;
    // Code as it runs on the real clock: it does not charge fuel.
    let options = JitOptions { count_blocks: true, ..JitOptions::default() };
    let engine = session.program.jit(&layout, options).map_err(Failure::refused)?;
    let Some(counts) = engine.block_counts() else { return Ok(None) };
    let engine: Box<dyn Engine> = Box::new(engine);
    let resource = match session.open_with(engine, Box::new(VirtualClock::new()), Some(stop), None)? {
        Opened::Ready(resource) => resource,
        Opened::Faulted(faulted) => return Ok(faulted_run(args, session, &faulted)),
    };
    let mut rows = session.inputs(resource.image())?;
    let mut no_rows = NoInputs;
    let running = match resource.start() {
        Ok(running) => running,
        Err(faulted) => return Ok(faulted_run(args, session, &faulted)),
    };
    // What runs once, before the first round, is not what a round costs.
    counts.clear();
    let (mut io, mut observer) = (NoIo, NoObserver);
    let inputs = rows.as_mut().map_or(&mut no_rows as _, |rows| rows as _);
    let mut hooks = Hooks { io: &mut io, inputs, observer: &mut observer };
    match run_rounds(running, &mut hooks, RunOptions { scans: Some(args.scans) }) {
        RunOutcome::Completed(resource) | RunOutcome::NothingDue(resource) | RunOutcome::Stopped(resource) => {
            let units = units(session, &counts).map_err(Failure::refused)?;
            Ok(Some((units, resource.rounds())))
        }
        RunOutcome::Faulted(faulted) => Ok(faulted_run(args, session, &faulted)),
    }
}

fn units(session: &Session<'_>, counts: &BlockCounts) -> Result<Vec<Unit>, Box<dyn std::error::Error>> {
    let layout = session.program.layout(session.args.max_image)?;
    Ok(listing(&session.program.verified, &layout, JitOptions::default(), Some(counts))?)
}

fn faulted_run<T>(args: &DisasmArgs, session: &Session<'_>, faulted: &Resource<Faulted>) -> Option<T> {
    report_fault(faulted.report(), session.program.container(), args.common.format);
    None
}
