//! `khz diff`: both engines in lock-step on the virtual clock, with and without fuel; the first difference.

use khz_machine::image::Image;
use khz_machine::report::TrapReport;
use khz_machine::trap::TrapCode;
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

/// What a side says of a round, to be compared.
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

/// Watchdog of the runs with fuel where nothing sets one, in microseconds: an endless loop ends, in both engines at the same place.
const DEFAULT_WATCHDOG_US: u64 = 100_000;

/// Both engines, each with code that charges fuel and with code that does not (architecture §7): the first is the one that the others are compared with.
const SIDES: [(EngineKind, bool); 4] =
    [(EngineKind::Interp, true), (EngineKind::Jit, true), (EngineKind::Interp, false), (EngineKind::Jit, false)];

/// Runs it.
pub fn run(args: &DiffArgs) -> Outcome {
    let program = choose(load(&args.sources)?, args.resource.resource.as_deref())?;
    let mut given = args.resource.clone();
    if given.watchdog_us == 0 {
        given.watchdog_us = DEFAULT_WATCHDOG_US;
    }
    let session = Session::new(program, &given);
    let mut sides = Vec::with_capacity(SIDES.len());
    for (kind, fuel) in SIDES {
        sides.push(Side::open(&session, kind, fuel)?);
    }
    let mut rounds = 0;
    let trap = loop {
        let (with_fuel, without) = sides.split_at_mut(2);
        let mut steps: Vec<Step> = with_fuel.iter_mut().map(Side::step).collect();
        let trap = steps[0].trap.map(|trap| trap.code);
        // Code without fuel would not end where the watchdog ended the others.
        if trap != Some(TrapCode::Watchdog) {
            steps.extend(without.iter_mut().map(Side::step));
        }
        for (at, step) in steps.iter().enumerate().skip(1) {
            if let Some(difference) = difference(&session, [(0, &sides[0], &steps[0]), (at, &sides[at], step)]) {
                return Ok(report(args, rounds, &difference));
            }
        }
        rounds += 1;
        if trap.is_some() || steps[0].wake == Some(Wake::Never) || rounds >= args.scans {
            break trap;
        }
    };
    if args.common.format == Format::Json {
        result(&json!({ "equal": true, "rounds": rounds, "trap": trap.map(TrapCode::name) }).to_string());
    } else {
        let ending = trap.map_or(String::new(), |trap| format!("; both trapped: {trap}"));
        people(&format!("equal after {rounds} rounds{ending}"));
    }
    Ok(Status::Done)
}

/// How a side is called in messages.
fn side_name(at: usize) -> String {
    let (kind, fuel) = SIDES[at];
    let engine = if kind == EngineKind::Interp { "interp" } else { "jit" };
    format!("{engine} {} fuel", if fuel { "with" } else { "without" })
}

/// The first difference in words, if there is one.
fn difference(session: &Session<'_>, pair: [(usize, &Side, &Step); 2]) -> Option<String> {
    let [(first, a, step_a), (second, b, step_b)] = pair;
    let (first, second) = (side_name(first), side_name(second));
    if step_a != step_b {
        let describe = |step: &Step| match step.trap {
            Some(trap) => step.place.map_or_else(
                || trap.code.to_string(),
                |place| TrapReport::new(&trap, place.entry(), session.program.container()).to_string(),
            ),
            None => format!("no trap, {} tasks ran", step.round.map_or(0, |round| round.tasks)),
        };
        return Some(format!("{first}: {}\n{second}: {}", describe(step_a), describe(step_b)));
    }
    let (a, b) = (a.state.image()?, b.state.image()?);
    let at = a.first_difference(b)?;
    let differing = session.names.variables().flat_map(|v| session.names.leaves(&v, 10_000));
    let mut differing = differing.filter(|v| session.names.text(a, v) != session.names.text(b, v));
    Some(differing.next().map_or_else(
        || {
            let (x, y) = (a.bytes()[at as usize], b.bytes()[at as usize]);
            format!("memory image differs at offset {at}: {first} {x:#04x}, {second} {y:#04x}")
        },
        |v| format!("{}: {first} {}, {second} {}", v.name, session.names.text(a, &v), session.names.text(b, &v)),
    ))
}

fn report(args: &DiffArgs, rounds: u64, difference: &str) -> Status {
    if args.common.format == Format::Json {
        result(&json!({ "equal": false, "round": rounds + 1, "difference": difference }).to_string());
    }
    people(&format!("the engines differ in round {}:\n{difference}", rounds + 1));
    Status::Differ
}
