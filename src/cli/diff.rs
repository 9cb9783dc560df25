//! `khz diff`: both engines in lock-step on the virtual clock; the first difference.

use khz_machine::image::Image;
use khz_machine::report::TrapReport;
use khz_scheduler::{FaultPlace, Faulted, Hooks, NoInputs, NoIo, NoObserver, Resource, Round, Running};
use khz_scheduler::{InputSource, Wake};
use kilohertz::pipeline::EngineKind;
use serde_json::json;

use super::args::{DiffArgs, Format};
use super::inputs::CsvInputs;
use super::output::{Failure, choose, load, people, result};
use super::session::{Opened, Session};
use super::{Outcome, Status};

/// One engine's side of the comparison.
struct Side {
    state: State,
    inputs: Option<CsvInputs>,
}

enum State {
    Running(Resource<Running>),
    Faulted(Box<Resource<Faulted>>),
    /// Only while a round runs.
    Between,
}

impl State {
    fn image(&self) -> Option<&Image> {
        match self {
            State::Running(resource) => Some(resource.image()),
            State::Faulted(resource) => Some(resource.image()),
            State::Between => None,
        }
    }
}

/// What both sides say of a round, to be compared.
#[derive(Debug, PartialEq)]
struct Step {
    round: Option<Round>,
    trap: Option<khz_machine::trap::Trap>,
    place: Option<FaultPlace>,
    wake: Option<Wake>,
}

impl Side {
    fn open(session: &Session<'_>, kind: EngineKind, fuel: bool) -> Result<Side, Failure> {
        let resource = match session.open_virtual(kind, fuel)? {
            Opened::Ready(resource) => resource,
            Opened::Faulted(faulted) => return Ok(Side { state: State::Faulted(faulted), inputs: None }),
        };
        let inputs = session.inputs(resource.image())?;
        let state = match resource.start() {
            Ok(running) => State::Running(running),
            Err(faulted) => State::Faulted(Box::new(faulted)),
        };
        Ok(Side { state, inputs })
    }

    fn step(&mut self) -> Step {
        let mut no_rows = NoInputs;
        let inputs: &mut dyn InputSource = match &mut self.inputs {
            Some(rows) => rows,
            None => &mut no_rows,
        };
        let (mut io, mut observer) = (NoIo, NoObserver);
        let mut hooks = Hooks { io: &mut io, inputs, observer: &mut observer };
        let mut step = Step { round: None, trap: None, place: None, wake: None };
        self.state = match std::mem::replace(&mut self.state, State::Between) {
            State::Running(resource) => match resource.run_round(&mut hooks) {
                Ok((mut resource, round)) => {
                    let wake = resource.next_wake(&mut hooks);
                    resource.wait(wake);
                    step.round = Some(round);
                    step.wake = Some(wake);
                    State::Running(resource)
                }
                Err(faulted) => State::Faulted(Box::new(faulted)),
            },
            other => other,
        };
        if let State::Faulted(faulted) = &self.state {
            step.trap = Some(faulted.report().trap);
            step.place = Some(faulted.report().place);
        }
        step
    }
}

/// Runs it.
pub fn run(args: &DiffArgs) -> Outcome {
    let program = choose(load(&args.sources)?, args.resource.resource.as_deref())?;
    let session = Session::new(program, &args.resource);
    let fuel = session.needs_fuel();
    let mut sides = [Side::open(&session, EngineKind::Interp, fuel)?, Side::open(&session, EngineKind::Jit, fuel)?];
    let mut rounds = 0;
    loop {
        let steps = [sides[0].step(), sides[1].step()];
        if let Some(difference) = difference(&session, &sides, &steps) {
            return Ok(report(args, rounds, &difference));
        }
        rounds += 1;
        let ended = steps[0].trap.is_some() || steps[0].wake == Some(Wake::Never);
        if ended || rounds >= args.scans {
            break;
        }
    }
    let trap = match &sides[0].state {
        State::Faulted(faulted) => Some(faulted.report().trap.code.name()),
        _ => None,
    };
    if args.common.format == Format::Json {
        result(&json!({ "equal": true, "rounds": rounds, "trap": trap }).to_string());
    } else {
        let ending = trap.map_or(String::new(), |trap| format!("; both trapped: {trap}"));
        people(&format!("equal after {rounds} rounds{ending}"));
    }
    Ok(Status::Done)
}

/// The first difference in words, if there is one.
fn difference(session: &Session<'_>, sides: &[Side; 2], steps: &[Step; 2]) -> Option<String> {
    if steps[0] != steps[1] {
        let describe = |step: &Step| match step.trap {
            Some(trap) => TrapReport::new(&trap, entry(step.place), session.program.container()).to_string(),
            None => format!("no trap, {} tasks ran", step.round.map_or(0, |round| round.tasks)),
        };
        return Some(format!("interp: {}\njit:    {}", describe(&steps[0]), describe(&steps[1])));
    }
    let (a, b) = (sides[0].state.image()?, sides[1].state.image()?);
    let at = a.first_difference(b)?;
    let differing = session.names.variables().flat_map(|v| session.names.leaves(&v, 10_000));
    let mut differing = differing.filter(|v| session.names.text(a, v) != session.names.text(b, v));
    Some(differing.next().map_or_else(
        || {
            format!(
                "memory image differs at offset {at}: interp {:#04x}, jit {:#04x}",
                a.bytes()[at as usize],
                b.bytes()[at as usize]
            )
        },
        |v| format!("{}: interp {}, jit {}", v.name, session.names.text(a, &v), session.names.text(b, &v)),
    ))
}

fn entry(place: Option<FaultPlace>) -> khz_machine::engine::Entry {
    use khz_machine::engine::Entry;
    match place {
        Some(FaultPlace::Task { instance, .. }) => Entry::Instance(instance),
        Some(FaultPlace::Init) => Entry::Init,
        Some(FaultPlace::Startup) | None => Entry::Startup,
    }
}

fn report(args: &DiffArgs, rounds: u64, difference: &str) -> Status {
    if args.common.format == Format::Json {
        result(&json!({ "equal": false, "round": rounds + 1, "difference": difference }).to_string());
    }
    people(&format!("the engines differ in round {}:\n{difference}", rounds + 1));
    Status::Differ
}
