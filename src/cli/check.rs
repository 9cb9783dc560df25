//! `khz check`: parse and analyse; every diagnostic of the run.

use khz_frontend::diagnostics::{Diagnostic, Severity, has_errors};
use khz_frontend::source::SourceMap;
use kilohertz::files::{self, FileError, Input};

use super::args::{CheckArgs, CheckFormat, Format};
use super::output::{dialect, load, people, print_diagnostics, result};
use super::sarif;
use super::{Outcome, Status};

/// Runs it.
pub fn run(args: &CheckArgs) -> Outcome {
    let input = match files::read(&args.sources.files) {
        // A wrong project file is reported like a wrong source.
        Err(FileError::Project { diagnostics, sources }) => return Ok(report(args, &diagnostics, &sources)),
        other => other?,
    };
    let Input::Sources(sources) = input else {
        // A container has no source to complain about: checking it is verifying it.
        load(&args.sources)?;
        return Ok(if args.format == CheckFormat::Human { Status::Done } else { report(args, &[], &SourceMap::new()) });
    };
    let checked = khz_frontend::check(&sources.files, &sources.settings.options(dialect(&args.sources)));
    Ok(report(args, &checked.diagnostics, &checked.sources))
}

fn report(args: &CheckArgs, diagnostics: &[Diagnostic], sources: &SourceMap) -> Status {
    match args.format {
        CheckFormat::Json => print_diagnostics(diagnostics, sources, Format::Json),
        CheckFormat::Sarif => result(&sarif::log(diagnostics, sources).to_string()),
        CheckFormat::Human => {
            print_diagnostics(diagnostics, sources, Format::Human);
            let count = |severity| diagnostics.iter().filter(|d| d.severity == severity).count();
            people(&format!("{} errors, {} warnings", count(Severity::Error), count(Severity::Warning)));
        }
    }
    if has_errors(diagnostics) { Status::Refused } else { Status::Done }
}
