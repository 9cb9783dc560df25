//! `khz diff FILE`: both engines in lock-step, with and without fuel, on recorded or random inputs; the first difference and the
//! statement that made it.

use khz_frontend::source::SourceMap;
use khz_machine::image::Image;
use khz_machine::report::DescribedPlace;
use khz_scheduler::InputSource;
use kilohertz::lockstep::difference::{Difference, DifferingVariable, Verdict};
use kilohertz::lockstep::inputs::RandomInputs;
use kilohertz::lockstep::{EngineUnderTest, Lockstep, OpenError, Options};
use serde_json::{Value, json};

use super::super::args::{DiffArgs, Format};
use super::super::inputs::set_values;
use super::super::output::{Failure, choose, load, people, result};
use super::super::session::Session;
use super::super::{Outcome, Status};

/// Watchdog of the runs with fuel where nothing sets one, in microseconds: an endless loop ends, in both engines at the same place.
const DEFAULT_WATCHDOG_US: u64 = 100_000;
/// The same under random inputs, which may end every round so.
const RANDOM_WATCHDOG_US: u64 = 2_000;
/// Rounds that are compared without `--scans`.
const DEFAULT_ROUNDS: u64 = 1000;
/// Rounds that are run after a difference, to see what else comes to differ.
const FOLLOWED_ROUNDS: u64 = 10;

/// Runs it.
pub fn run(args: &DiffArgs) -> Outcome {
    let mut loaded = load(&args.sources)?;
    let sources = std::mem::replace(&mut loaded.sources, SourceMap::new());
    let program = choose(loaded, args.resource.resource.as_deref())?;
    let session = Session::new(program, &args.resource);
    let engines = EngineUnderTest::standard(&session.program, args.resource.max_image).map_err(refused)?;
    let mut lockstep = open(&session, engines, args.is_random())?;
    let mut inputs = random_inputs(args, &session, lockstep.image());
    let driven = inputs.as_ref().map(|inputs| (inputs.names().count(), inputs.is_nameless()));
    match driven {
        Some((0, false)) => people(
            "note: no input gets values: nothing is located at %I, and no program has VAR_INPUT, or --set holds them all",
        ),
        Some((0, true)) => people("note: the container names no variables: random values go to the bytes of %I"),
        _ => {}
    }
    match lockstep.run(inputs.as_mut(), args.scans.unwrap_or(DEFAULT_ROUNDS)) {
        Ok(summary) => {
            if args.common.format == Format::Json {
                let ended = summary.ended.map(khz_machine::trap::TrapCode::name);
                let traps: Value =
                    summary.traps.iter().map(|(trap, count)| (trap.name().to_string(), json!(count))).collect();
                let inputs = driven.map(|(variables, bytes)| json!({ "variables": variables, "bytes": bytes }));
                result(
                    &json!({ "equal": true, "rounds": summary.rounds, "trap": ended, "traps": traps, "random": inputs })
                        .to_string(),
                );
            } else {
                people(&summary.text());
            }
            Ok(Status::Done)
        }
        Err(mut found) => {
            lockstep.follow(&mut found, inputs.as_mut(), FOLLOWED_ROUNDS);
            Ok(report_difference(args.common.format, &found, &sources))
        }
    }
}

/// What can not be opened.
pub fn refused(error: OpenError) -> Failure {
    match error {
        OpenError::Host(reason) => Failure::Message(Status::Host, reason),
        other => Failure::refused(other),
    }
}

/// The program on these engines, with `--set` and `--inputs` given.
pub fn open<'s>(
    session: &'s Session<'_>,
    engines: Vec<EngineUnderTest>,
    idle_goes_on: bool,
) -> Result<Lockstep<'s>, Failure> {
    let count = engines.len();
    let (names, given) = (&session.names, &session.args.set);
    let mut scratch = session.program.image(session.args.max_image).map_err(Failure::refused)?;
    set_values(names, &mut scratch, given)?;
    // One table for all sides.
    let rows = session.inputs(&scratch)?;
    let sources = rows.iter().flat_map(|rows| std::iter::repeat_n(rows, count));
    let sources = sources.map(|rows| Box::new(rows.clone()) as Box<dyn InputSource>).collect();
    let watchdog_us = match session.args.watchdog_us {
        0 if idle_goes_on => RANDOM_WATCHDOG_US,
        0 => DEFAULT_WATCHDOG_US,
        given => given,
    };
    let options = Options {
        max_image_bytes: session.args.max_image,
        watchdog_us,
        // What can not be set was refused above.
        prepare: Box::new(|image| drop(set_values(names, image, given))),
        idle_goes_on,
    };
    let mut lockstep = Lockstep::open(&session.program, engines, options).map_err(refused)?;
    lockstep.set_inputs(sources);
    Ok(lockstep)
}

/// Random inputs, if they are wanted; what `--set` names keeps its value.
fn random_inputs(args: &DiffArgs, session: &Session<'_>, image: &Image) -> Option<RandomInputs> {
    let kept: Vec<String> = args
        .resource
        .set
        .iter()
        .filter_map(|set| set.split_once('='))
        .map(|(name, _)| name.trim().to_string())
        .collect();
    if !args.is_random() {
        return None;
    }
    let inputs = RandomInputs::new(&session.program, image.layout(), args.seed.unwrap_or(0), &kept);
    Some(if args.random_variables { inputs.and_variables(&kept) } else { inputs })
}

/// Tells a difference between engines.
pub fn report_difference(format: Format, found: &Difference, sources: &SourceMap) -> Status {
    if format == Format::Json {
        result(&difference_json(found, sources).to_string());
    }
    people(&difference_text(found, sources));
    Status::Differ
}

/// A difference for people.
fn difference_text(found: &Difference, sources: &SourceMap) -> String {
    let place = match found.round {
        0 => "before the first round".to_string(),
        round => format!("in round {round}, at {:.6} s", found.time.0 as f64 / 1e9),
    };
    let mut text = format!("the engines differ {place}:\n");
    text += &what_differs(found);
    for variable in &found.variables {
        text += &variable_text(found, variable, sources);
    }
    if found.more_variables > 0 {
        text += &format!("  and {} more variables\n", found.more_variables);
    }
    text += &match &found.verdict {
        Verdict::AgreesWith(sides) if sides.is_empty() => "the third evaluator agrees with neither of them".to_string(),
        Verdict::AgreesWith(sides) => format!("the third evaluator agrees with {}", sides.join(" and ")),
        Verdict::Unknown(reason) => format!("the third evaluator was not asked about this round: {reason}"),
    };
    text
}

fn what_differs(found: &Difference) -> String {
    let [first, second] = &found.sides;
    if let Some([a, b]) = &found.endings {
        return format!("{first}: {a}\n{second}: {b}\n");
    }
    match found.byte {
        Some((at, [a, b])) => {
            format!("memory image differs at offset {at}: {first} {a:#04x}, {second} {b:#04x}\n")
        }
        None => String::new(),
    }
}

fn variable_text(found: &Difference, variable: &DifferingVariable, sources: &SourceMap) -> String {
    let ([first, second], [a, b]) = (&found.sides, &variable.values);
    let mut text = format!("{}: {first} {a}, {second} {b}", variable.name);
    if variable.round != found.round {
        text += &format!(" (from round {} on)", variable.round);
    }
    text.push('\n');
    if let Some(value) = &variable.evaluator {
        text += &format!("  the third evaluator has {value}\n");
        text += &match variable.statement.split_first() {
            None => "  no statement of this round writes it there\n".to_string(),
            Some((place, callers)) => format!("  {}\n", written_text(place, callers, sources)),
        };
    }
    text
}

/// Where something was written last, with the line of the source and the calls that led there.
pub fn written_text(place: &DescribedPlace, callers: &[DescribedPlace], sources: &SourceMap) -> String {
    let line = source_line(place, sources).map_or_else(String::new, |line| format!("\n      {line}"));
    let callers: Vec<String> = callers.iter().map(|caller| format!("\n    called from {caller}")).collect();
    format!("written last at {place}{line}{}", callers.concat())
}

/// A place for programs.
pub fn place_json(place: &DescribedPlace, sources: &SourceMap) -> Value {
    let source = place.source.as_ref();
    json!({
        "function": place.function, "offset": place.offset, "file": source.map(|s| &s.file), "line": source.map(|s| s.line),
        "column": source.map(|s| s.column), "text": source_line(place, sources),
    })
}

/// The line of the source that a place is in, without the spaces around it.
fn source_line<'s>(place: &DescribedPlace, sources: &'s SourceMap) -> Option<&'s str> {
    let source = place.source.as_ref()?;
    let (_, file) = sources.files().find(|(_, file)| file.name() == source.file)?;
    Some(file.line_text(source.line).trim())
}

/// A difference for programs.
fn difference_json(found: &Difference, sources: &SourceMap) -> Value {
    let [first, second] = &found.sides;
    let pair = |values: &[String; 2]| json!({ first.as_str(): values[0], second.as_str(): values[1] });
    let place = |place: &DescribedPlace| place_json(place, sources);
    let variables: Vec<Value> = found.variables.iter().map(|variable| {
        json!({
            "name": variable.name, "round": variable.round, "time_us": variable.time.as_us(), "values": pair(&variable.values),
            "evaluator": variable.evaluator, "statement": variable.statement.first().map(place),
            "called_from": variable.statement.iter().skip(1).map(place).collect::<Vec<_>>(),
        })
    }).collect();
    let (agrees, unknown) = match &found.verdict {
        Verdict::AgreesWith(sides) => (Some(sides), None),
        Verdict::Unknown(reason) => (None, Some(reason)),
    };
    let byte = found
        .byte
        .map(|(offset, [a, b])| json!({ "offset": offset, "values": { first.as_str(): a, second.as_str(): b } }));
    json!({
        "equal": false, "round": found.round, "time_us": found.time.as_us(), "difference": difference_text(found, sources),
        "sides": found.sides, "endings": found.endings.as_ref().map(pair), "variables": variables,
        "more_variables": found.more_variables, "byte": byte,
        "evaluator": { "agrees_with": agrees, "not_asked": unknown },
    })
}
