//! `khz test`: unit tests written in ST.

use khz_frontend::diagnostics::Severity;
use kilohertz::files::{self, Input};
use kilohertz::pipeline::{EngineKind, Refused};
use kilohertz::testing::{self, Suite, Test, TestOptions, TestResult, report};

use super::args::{EnginesArg, Format, TestArgs, TestFormat};
use super::output::{Failure, dialect, people, print_diagnostics, result};
use super::{Outcome, Status};

/// Runs it.
pub fn run(args: &TestArgs) -> Outcome {
    let Input::Sources(sources) = files::read(&args.sources.files)? else {
        return Err(Failure::refused("tests are Structured Text: name their sources, not a container"));
    };
    let suite = match testing::compile(&sources.files, &sources.settings.options(dialect(&args.sources))) {
        Ok(suite) => suite,
        Err(refused) => return refuse(args, refused),
    };
    if args.format == TestFormat::Human {
        print_diagnostics(&suite.diagnostics, &suite.sources, Format::Human);
    }
    let chosen = choose(&suite, args.filter.as_deref());
    if let Some(filter) = args.filter.as_deref().filter(|_| chosen.is_empty()) {
        people(&format!("no name of the {} tests holds `{filter}`", suite.tests.len()));
        return Ok(Status::Usage);
    }
    if args.list {
        list(args, &chosen);
        return Ok(Status::Done);
    }
    let options = TestOptions {
        engines: match args.engine {
            EnginesArg::Jit => vec![EngineKind::Jit],
            EnginesArg::Interp => vec![EngineKind::Interp],
            EnginesArg::Both => EngineKind::BOTH.to_vec(),
        },
        watchdog_us: args.watchdog_us,
        max_image_bytes: args.max_image,
    };
    let results: Vec<TestResult> = chosen.iter().map(|test| run_one(args, test, &options)).collect();
    match args.format {
        TestFormat::Human => people(&report::summary(&results)),
        TestFormat::Json => result(&report::json(&results).to_string()),
        TestFormat::Junit => result(&report::junit(&results)),
        TestFormat::Tap => result(&report::tap(&results)),
    }
    let (_, failed) = report::counts(&results);
    Ok(if failed == 0 { Status::Done } else { Status::Refused })
}

/// People see each result as it comes.
fn run_one(args: &TestArgs, test: &Test, options: &TestOptions) -> TestResult {
    let found = testing::run(test, options);
    if args.format == TestFormat::Human {
        people(&report::human(&found, options.engines.len()));
    }
    found
}

/// The tests whose names hold the text, in any case.
fn choose<'s>(suite: &'s Suite, filter: Option<&str>) -> Vec<&'s Test> {
    let wanted = filter.unwrap_or_default().to_lowercase();
    suite.tests.iter().filter(|test| test.name.to_lowercase().contains(&wanted)).collect()
}

fn list(args: &TestArgs, tests: &[&Test]) {
    if args.format == TestFormat::Json {
        result(&report::list_json(tests).to_string());
        return;
    }
    for test in tests {
        result(&format!("{}: {}", test.place, test.name));
    }
}

/// Sources that did not compile: the diagnostics, and a report that says so in the format that was asked for.
fn refuse(args: &TestArgs, refused: Refused) -> Outcome {
    let first = match &refused {
        Refused::Diagnostics { diagnostics, sources } => {
            let first = diagnostics.iter().find(|found| found.severity == Severity::Error);
            first.map_or_else(
                || refused.to_string(),
                |found| format!("{}: {} {}", sources.place(found.span), found.code(), found.message),
            )
        }
        other => other.to_string(),
    };
    match args.format {
        TestFormat::Junit => result(&report::junit_refused(&first)),
        TestFormat::Tap => result(&format!("TAP version 14\nBail out! {first}")),
        TestFormat::Human | TestFormat::Json => {}
    }
    Err(Failure::Refused(refused))
}
