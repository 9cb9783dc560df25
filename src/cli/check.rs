//! `khz check`: parse and analyse; every diagnostic of the run.

use khz_frontend::diagnostics::{Severity, has_errors};
use kilohertz::files;
use kilohertz::files::Input;

use super::args::{CheckArgs, Format};
use super::output::{dialect, load, people, print_diagnostics, result};
use super::{Outcome, Status};

/// Runs it.
pub fn run(args: &CheckArgs) -> Outcome {
    let input = files::read(&args.sources.files)?;
    let Input::Sources(sources) = input else {
        // A container has no source to complain about: checking it is verifying it.
        load(&args.sources)?;
        if args.common.format == Format::Json {
            result("[]");
        }
        return Ok(Status::Done);
    };
    let checked = khz_frontend::check(&sources.files, &sources.settings.options(dialect(&args.sources)));
    print_diagnostics(&checked.diagnostics, &checked.sources, args.common.format);
    if args.common.format == Format::Human {
        let count = |severity| checked.diagnostics.iter().filter(|d| d.severity == severity).count();
        people(&format!("{} errors, {} warnings", count(Severity::Error), count(Severity::Warning)));
    }
    Ok(if has_errors(&checked.diagnostics) { Status::Refused } else { Status::Done })
}
