//! Where words go: people's to stderr, results to stdout. A closed pipe is no error of ours.

use std::io::{IsTerminal, Write};
use std::path::Path;

use khz_frontend::Dialect;
use khz_frontend::diagnostics::{Diagnostic, render};
use khz_frontend::source::SourceMap;
use kilohertz::files::FileError;
use kilohertz::pipeline::{self, Loaded, Program, Refused};
use serde_json::{Value, json};

use super::Status;
use super::args::{DialectArg, Format, Sources};

/// Why a subcommand ended early.
#[derive(Debug)]
pub enum Failure {
    /// The input was refused, with the whole reason.
    Refused(Refused),
    /// A message for people, and the status that goes with it.
    Message(Status, String),
}

impl Failure {
    /// The input was refused for a reason of one line.
    pub fn refused(reason: impl std::fmt::Display) -> Self {
        Failure::Message(Status::Refused, reason.to_string())
    }

    /// The command line asks for what can not be.
    pub fn usage(reason: impl std::fmt::Display) -> Self {
        Failure::Message(Status::Usage, reason.to_string())
    }

    /// Prints it and gives the status.
    pub fn report(self, format: Format) -> Status {
        match self {
            Failure::Refused(Refused::Diagnostics { diagnostics, sources }) => {
                print_diagnostics(&diagnostics, &sources, format);
                Status::Refused
            }
            Failure::Refused(other) => Failure::refused(other).report(format),
            Failure::Message(status, text) => {
                if format == Format::Json {
                    result(&json!({ "error": text }).to_string());
                }
                people(&format!("error: {text}"));
                status
            }
        }
    }
}

impl From<Refused> for Failure {
    fn from(refused: Refused) -> Self {
        Failure::Refused(refused)
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Project { diagnostics, sources } => {
                Failure::Refused(Refused::Diagnostics { diagnostics, sources })
            }
            other => Failure::refused(other),
        }
    }
}

/// A line for people, on stderr.
pub fn people(line: &str) {
    // Nothing can be done about a closed stderr.
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// A line of results, on stdout.
pub fn result(line: &str) {
    // A reader that went away (`| head`) wants no more.
    let _ = writeln!(std::io::stdout().lock(), "{line}");
}

/// Whether people see colours: only on a terminal.
pub fn colours() -> bool {
    std::io::stderr().is_terminal()
}

/// Writes a whole result file.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if kilohertz::files::is_source(path) || kilohertz::files::is_project(path) {
        // A slip of the hand would cost somebody's program.
        return Err(Failure::usage(format!(
            "{}: results do not go where sources stand, by their ending",
            path.display()
        )));
    }
    std::fs::write(path, bytes).map_err(|error| Failure::Message(Status::Host, format!("{}: {error}", path.display())))
}

/// The dialect that the command line asks for.
pub fn dialect(sources: &Sources) -> Option<Dialect> {
    sources.dialect.map(|dialect| match dialect {
        DialectArg::Iec => Dialect::Iec,
        DialectArg::Default => Dialect::Default,
    })
}

/// Reads and loads what the command line names.
pub fn load(sources: &Sources) -> Result<Loaded, Failure> {
    Ok(pipeline::load(kilohertz::files::read(&sources.files)?, dialect(sources))?)
}

/// The one RESOURCE that is meant.
pub fn choose(loaded: Loaded, wanted: Option<&str>) -> Result<Program, Failure> {
    let names: Vec<String> = loaded.programs.iter().map(|p| p.name.clone()).collect();
    let mut programs = loaded.programs.into_iter();
    match wanted {
        Some(wanted) => programs
            .find(|p| p.name.eq_ignore_ascii_case(wanted))
            .ok_or_else(|| Failure::usage(format!("there is no RESOURCE `{wanted}`; there is {}", names.join(", ")))),
        None if names.len() > 1 => {
            Err(Failure::usage(format!("choose a RESOURCE with --resource: {}", names.join(", "))))
        }
        None => programs.next().ok_or_else(|| Failure::refused("there is no PROGRAM to run in these files")),
    }
}

/// Prints diagnostics: text with source excerpts for people, one JSON array for programs.
pub fn print_diagnostics(diagnostics: &[Diagnostic], sources: &SourceMap, format: Format) {
    if format == Format::Json {
        let all: Vec<Value> = diagnostics.iter().map(|d| diagnostic_json(d, sources)).collect();
        result(&Value::Array(all).to_string());
        return;
    }
    for diagnostic in diagnostics {
        people(render::render(diagnostic, sources, render::Style { colour: colours() }).trim_end());
    }
}

/// A diagnostic as programs read it.
pub fn diagnostic_json(diagnostic: &Diagnostic, sources: &SourceMap) -> Value {
    let place = |span: khz_frontend::source::Span| {
        let at = sources.line_column(span);
        let end = sources.line_column(khz_frontend::source::Span::new(span.file, span.end, span.end));
        let file = sources.file(span.file).map_or("", |f| f.name());
        json!({ "file": file, "line": at.line, "column": at.column, "end_line": end.line, "end_column": end.column })
    };
    let labels: Vec<Value> =
        diagnostic.labels.iter().map(|(span, text)| json!({ "place": place(*span), "text": text })).collect();
    json!({
        "code": diagnostic.code(),
        "severity": diagnostic.severity.word(),
        "message": diagnostic.message,
        "place": place(diagnostic.span),
        "labels": labels,
        "help": diagnostic.help,
    })
}
