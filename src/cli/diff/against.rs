//! `khz diff FILE --against TRACE.csv`: the program along a trace that was recorded elsewhere.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use khz_bytecode::container::ElementaryType;
use khz_frontend::source::SourceMap;
use khz_machine::report::{DescribedPlace, TrapReport};
use khz_machine::variables::Domain;
use khz_scheduler::InputSource;
use kilohertz::files;
use kilohertz::lockstep::{EngineUnderTest, Lockstep};
use kilohertz::pipeline::EngineKind;
use kilohertz::traces::align::{self, Found};
use kilohertz::traces::compare::{self, Apart, Compared, Comparer, End, Terms};
use kilohertz::traces::sample::deviation_text;
use kilohertz::traces::tolerance::Tolerances;
use kilohertz::traces::{Choice, Drive, MAX_TABLE_BYTES, Mapping, Trace};
use serde_json::{Value, json};

use super::super::args::{DiffArgs, EnginesArg, Format};
use super::super::output::{Failure, choose, load, people, result, write_file};
use super::super::session::Session;
use super::super::{Outcome, Status};
use super::curves;
use super::engines::{open, place_json, refused, report_difference, written_text};

/// Rounds that the program may run along a trace without `--scans`.
const DEFAULT_ROUNDS: u64 = 10_000_000;

/// Says that nothing was compared.
const NOTHING_COMPARED: &str = "no value was compared: every row lies before the program's start, or is empty (--align auto or US: the trace begins at another time)";

/// Names of columns that are listed.
const MOST_NAMES: usize = 8;

/// What came of a comparison.
pub struct Outcomes<'o> {
    /// The trace's file.
    pub file: String,
    /// The trace.
    pub trace: &'o Trace,
    /// The figures.
    pub comparer: &'o Comparer,
    /// Added to the trace's times, in microseconds.
    pub offset_us: i64,
    /// How that was found, if it was.
    pub found: Option<Found>,
    /// Why the comparison says nothing about the whole trace, if so.
    pub ended: Option<String>,
    /// For each compared column the statement that made its first difference, and the calls that led there.
    statements: Vec<Vec<DescribedPlace>>,
    sources: &'o SourceMap,
}

/// Runs it.
pub fn run(args: &DiffArgs, path: &Path) -> Outcome {
    if let Some(report) = &args.report {
        let is_that =
            |input: &Path| fs::canonicalize(input).ok().is_some_and(|it| fs::canonicalize(report).ok() == Some(it));
        if is_that(path) || args.map.as_deref().is_some_and(is_that) {
            return Err(Failure::usage(format!("--report {}: that is what is to be compared", report.display())));
        }
    }
    let mut loaded = load(&args.sources)?;
    let sources = std::mem::replace(&mut loaded.sources, SourceMap::new());
    let program = choose(loaded, args.resource.resource.as_deref())?;
    let session = Session::new(program, &args.resource);
    let trace = Arc::new(read_trace(args, &session, path)?);
    let names = Arc::new(session.names.clone());
    let tolerances =
        Tolerances::parse(&args.tolerance).map_err(|reason| Failure::usage(format!("--tolerance: {reason}")))?;
    tolerances.check(&trace.columns).map_err(|reason| Failure::usage(format!("--tolerance: {reason}")))?;
    let mut terms = Terms { tolerances, offset_us: 0, on_change: args.on_change, curves: args.report.is_some() };
    let found = align(args, &session, &trace, &names, &mut terms)?;
    let offset_us = terms.offset_us;

    let drive = Drive::new(&trace, &names, offset_us);
    let mut lockstep = along(&session, engines(args, &session)?, drive.as_ref())?;
    let mut comparer = Comparer::new(&trace, &names, terms);
    let rounds = args.scans.unwrap_or(DEFAULT_ROUNDS);
    let end = match compare::run(&mut lockstep, &mut comparer, rounds, trace.len()) {
        Ok(end) => end,
        Err(found) => return Ok(report_difference(args.common.format, &found, &sources)),
    };
    let ended = match end {
        End::Over if comparer.values() == 0 => Some(NOTHING_COMPARED.to_string()),
        End::Over => None,
        End::Trapped(fault) => {
            let report = TrapReport::new(&fault.trap, fault.place.entry(), session.program.container());
            Some(format!("{report}\n  in round {}, at {:.6} s", fault.rounds + 1, fault.time.0 as f64 / 1e9))
        }
        End::TooLong => Some(format!(
            "the trace goes on after {rounds} rounds (--scans N: more of them; --align auto or US: it begins at another time)"
        )),
    };
    let statements = if comparer.differing() > 0 {
        compare::writers(&mut along(&session, vec![one_engine(args, &session)?], drive.as_ref())?, &comparer)
    } else {
        Vec::new()
    };
    let file = path.display().to_string();
    let outcomes =
        Outcomes { file, trace: &trace, comparer: &comparer, offset_us, found, ended, statements, sources: &sources };
    print(args.common.format, &outcomes);
    if let Some(path) = &args.report {
        write_file(path, curves::page(&outcomes).as_bytes())?;
    }
    Ok(match end {
        _ if comparer.differing() > 0 => Status::Differ,
        End::Over if comparer.values() == 0 => Status::Refused,
        End::Over => Status::Done,
        End::Trapped(_) => Status::Trap,
        End::TooLong => Status::Refused,
    })
}

fn read_trace(args: &DiffArgs, session: &Session<'_>, path: &Path) -> Result<Trace, Failure> {
    let mapping = match &args.map {
        Some(map) => Mapping::read(&map.display().to_string(), &files::read_limited(map, MAX_TABLE_BYTES)?)
            .map_err(Failure::refused)?,
        None => Mapping::default(),
    };
    let drive = match args.drive.as_deref().map(str::trim) {
        None => None,
        Some(none) if none.eq_ignore_ascii_case("none") => Some(Vec::new()),
        Some(names) => Some(split_names(names)),
    };
    let wanted = drive.clone().unwrap_or_default();
    let image = session.program.image(session.args.max_image).map_err(Failure::refused)?;
    let choice = Choice { mapping, drive };
    let bytes = files::read_limited(path, MAX_TABLE_BYTES)?;
    let trace = Trace::read(&path.display().to_string(), &bytes, &choice, &session.names, &image);
    let trace = trace.map_err(Failure::refused)?;
    let is_there = |name: &&String| trace.columns.iter().any(|column| column.is_named(name));
    if let Some(missing) = wanted.iter().find(|name| !is_there(name)) {
        return Err(Failure::usage(format!("--drive: no column of the trace is `{missing}`")));
    }
    if trace.columns.iter().all(|column| column.drives) {
        return Err(Failure::usage("every column drives the program: there is nothing to compare"));
    }
    Ok(trace)
}

/// Names between commas; those between brackets are indices.
fn split_names(text: &str) -> Vec<String> {
    let mut names = vec![String::new()];
    let mut depth = 0_usize;
    for character in text.chars() {
        match character {
            '[' => depth += 1,
            ']' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                names.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(name) = names.last_mut() {
            name.push(character);
        }
    }
    names.iter().map(|name| name.trim().to_string()).filter(|name| !name.is_empty()).collect()
}

/// Sets the offset that is given, or looks for one.
fn align(
    args: &DiffArgs,
    session: &Session<'_>,
    trace: &Arc<Trace>,
    names: &Arc<khz_machine::variables::VariableTable>,
    terms: &mut Terms,
) -> Result<Option<Found>, Failure> {
    let Some(wanted) = args.align.as_deref() else { return Ok(None) };
    if !wanted.eq_ignore_ascii_case("auto") {
        let offset = wanted.parse::<i64>().ok().filter(|offset| offset.abs() <= i64::MAX / 4);
        terms.offset_us =
            offset.ok_or_else(|| Failure::usage(format!("--align {wanted}: microseconds or `auto` are wanted")))?;
        return Ok(None);
    }
    let mut lockstep = open(session, vec![one_engine(args, session)?], false)?;
    let found = align::find(&mut lockstep, trace, names, terms);
    terms.offset_us = found.offset_us;
    Ok(Some(found))
}

/// The program on these engines, driven by the trace.
fn along<'s>(
    session: &'s Session<'_>,
    engines: Vec<EngineUnderTest>,
    drive: Option<&Drive>,
) -> Result<Lockstep<'s>, Failure> {
    let mut lockstep = open(session, engines, false)?;
    if let Some(drive) = drive {
        let sources = (0..lockstep.sides()).map(|_| Box::new(drive.clone()) as Box<dyn InputSource>);
        lockstep.set_inputs(sources.collect());
    }
    Ok(lockstep)
}

/// One engine, for runs beside the comparison.
fn one_engine(args: &DiffArgs, session: &Session<'_>) -> Result<EngineUnderTest, Failure> {
    EngineUnderTest::new(&session.program, EngineKind::Jit, true, args.resource.max_image).map_err(refused)
}

fn engines(args: &DiffArgs, session: &Session<'_>) -> Result<Vec<EngineUnderTest>, Failure> {
    let all = EngineUnderTest::standard(&session.program, args.resource.max_image).map_err(refused)?;
    let is_wanted = |side: &EngineUnderTest| match args.engine.unwrap_or(EnginesArg::Both) {
        EnginesArg::Both => true,
        EnginesArg::Jit => side.name.starts_with(EngineKind::Jit.name()),
        EnginesArg::Interp => side.name.starts_with(EngineKind::Interp.name()),
    };
    Ok(all.into_iter().filter(is_wanted).collect())
}

fn print(format: Format, outcomes: &Outcomes<'_>) {
    if format == Format::Json {
        result(&json(outcomes).to_string());
        return;
    }
    people(&first_line(outcomes));
    for (position, column) in outcomes.comparer.columns().iter().enumerate() {
        people(&format!("  {}", column_text(outcomes, column)));
        if let Some((place, callers)) = outcomes.statements.get(position).and_then(|places| places.split_first()) {
            people(&format!("    {}", written_text(place, callers, outcomes.sources)));
        }
    }
    if let Some(ended) = &outcomes.ended {
        people(ended);
    }
    people(&verdict(outcomes));
}

/// What was compared, and how it was aligned.
pub fn first_line(outcomes: &Outcomes<'_>) -> String {
    let Outcomes { trace, comparer, offset_us, .. } = outcomes;
    let driving: Vec<&str> = trace.columns.iter().filter(|c| c.drives).map(|c| c.variable.name.as_str()).collect();
    let mut line = format!("{} rows, {} variables compared", trace.len(), comparer.columns().len());
    line += &match driving.len() {
        0 => "; no column drives the program".to_string(),
        1..=MOST_NAMES => format!("; driven by {}", driving.join(", ")),
        count => format!("; driven by {count} columns"),
    };
    line += &match &outcomes.found {
        Some(found) => format!("; times moved by {offset_us} us (best of {} tries)", found.tries),
        None if *offset_us != 0 => format!("; times moved by {offset_us} us"),
        None => String::new(),
    };
    if !trace.left_out.is_empty() {
        line +=
            &format!("; left out: {}", trace.left_out.iter().take(MOST_NAMES).cloned().collect::<Vec<_>>().join(", "));
        let more = trace.left_out.len().saturating_sub(MOST_NAMES);
        line += &if more > 0 { format!(" and {more} more columns") } else { String::new() };
    }
    let (early, late) = comparer.not_compared();
    if early > 0 {
        line += &format!("; {early} rows lie before the program's start");
    }
    if late > 0 {
        line += &format!("; {late} rows were not reached");
    }
    line
}

/// The last line.
pub fn verdict(outcomes: &Outcomes<'_>) -> String {
    let Outcomes { comparer, ended, .. } = outcomes;
    let (differing, all) = (comparer.differing(), comparer.columns().len());
    match differing {
        0 if comparer.values() == 0 => "nothing was compared".to_string(),
        0 if ended.is_some() => format!("not compared to the end: {} values are equal so far", comparer.values()),
        0 => match comparer.columns().iter().filter(|column| column.rows == 0).count() {
            0 => "equal within the tolerances".to_string(),
            none => format!("equal within the tolerances; of {none} of {all} variables no value was compared"),
        },
        _ => format!("the program differs from the trace in {differing} of {all} variables"),
    }
}

/// What is allowed, in words.
pub fn tolerance_text(outcomes: &Outcomes<'_>, column: &Compared) -> String {
    let absolute = deviation_text(column.tolerance.absolute, &outcomes.trace.columns[column.column].domain);
    match (column.tolerance.absolute, column.tolerance.relative) {
        (0.0, 0.0) => "exact".to_string(),
        (_, 0.0) => format!("± {absolute}"),
        (_, relative) => format!("± ({absolute} + {relative} × |value|)"),
    }
}

/// The largest deviation in words, when it is one of numbers.
pub fn largest_text<'c>(outcomes: &Outcomes<'_>, column: &'c Compared) -> Option<(String, &'c Apart)> {
    let largest = column.largest.as_ref().filter(|largest| largest.deviation.is_finite())?;
    Some((deviation_text(largest.deviation, &outcomes.trace.columns[column.column].domain), largest))
}

/// A name, and the trace's when it is another one.
pub fn column_name(outcomes: &Outcomes<'_>, column: &Compared) -> String {
    let found = &outcomes.trace.columns[column.column];
    match found.name.eq_ignore_ascii_case(&found.variable.name) {
        true => found.variable.name.clone(),
        false => format!("{} ({})", found.variable.name, found.name),
    }
}

fn column_text(outcomes: &Outcomes<'_>, column: &Compared) -> String {
    let mut text = format!("{}: {} values", column_name(outcomes, column), column.rows);
    if let Some(first) = &column.first {
        let [theirs, ours] = first.values.map(|value| outcomes.comparer.text(column, value));
        text += &format!(
            ", {} differ ({}); first in line {}, at {:.6} s: trace {theirs}, program {ours}",
            column.beyond,
            tolerance_text(outcomes, column),
            first.line,
            first.time_us as f64 / 1e6
        );
    }
    let is_bool = outcomes.trace.columns[column.column].domain == Domain::Elementary(ElementaryType::Bool);
    match largest_text(outcomes, column) {
        Some((deviation, largest)) if !is_bool => {
            text += &format!(
                "; largest deviation {deviation} in line {}, at {:.6} s",
                largest.line,
                largest.time_us as f64 / 1e6
            );
        }
        None if column.largest.is_none() && column.rows > 0 => text += ", equal",
        _ => {}
    }
    text
}

fn json(outcomes: &Outcomes<'_>) -> Value {
    let Outcomes { trace, comparer, offset_us, .. } = outcomes;
    let apart = |column: &Compared, apart: &Option<Apart>| {
        apart.as_ref().map(|apart| {
            let [theirs, ours] = apart.values.map(|value| comparer.text(column, value));
            json!({
                "line": apart.line, "trace_us": apart.trace_us, "time_us": apart.time_us, "trace": theirs, "program": ours,
                "deviation": Some(apart.deviation).filter(|deviation| deviation.is_finite()),
            })
        })
    };
    let columns: Vec<Value> = comparer
        .columns()
        .iter()
        .enumerate()
        .map(|(position, column)| {
            let found = &trace.columns[column.column];
            let statement = outcomes.statements.get(position).and_then(|places| places.first());
            json!({
                "column": found.name, "variable": found.variable.name, "compared": column.rows, "beyond": column.beyond,
                "tolerance": { "absolute": column.tolerance.absolute, "relative": column.tolerance.relative },
                "largest": apart(column, &column.largest), "first": apart(column, &column.first),
                "statement": statement.map(|place| place_json(place, outcomes.sources)),
            })
        })
        .collect();
    let (early, late) = comparer.not_compared();
    let driving: Vec<&str> = trace.columns.iter().filter(|c| c.drives).map(|c| c.name.as_str()).collect();
    json!({
        "equal": comparer.differing() == 0 && outcomes.ended.is_none(), "trace": outcomes.file, "rows": trace.len(), "offset_us": offset_us,
        "aligned": outcomes.found.map(|found| json!({ "tries": found.tries, "beyond": found.beyond, "compared": found.compared })), "verdict": verdict(outcomes), "compared": comparer.values(),
        "driven_by": driving, "left_out": trace.left_out, "rows_before_start": early, "rows_not_reached": late, "ended": outcomes.ended,
        "variables": columns,
    })
}
