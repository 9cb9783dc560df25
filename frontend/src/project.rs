//! `khz.toml`: what belongs to a project, and how it is compiled.
//!
//! ```toml
//! name = "bottling"                  # of the container that `khz build` writes
//! sources = ["src", "gvl/*.TcGVL"]   # files, folders, patterns; without it the whole folder
//! libraries = ["../lib/motion"]      # the same, compiled before the sources
//! dialect = "iec"
//!
//! [task]                             # runs the programs where no CONFIGURATION says otherwise
//! interval = "T#5ms"
//! priority = 1
//! ```
//!
//! Here text becomes settings, each with its place; who reads files (the root package) follows the paths. What is not
//! known is refused, because a misspelt setting would otherwise be one without effect. The reader is given files by users:
//! size and depth are bounded (the TOML parser ends at 80 levels), and every message has its place in the file.

use khz_bytecode::limits::MIN_INTERVAL_US;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::analysis::parse_duration_ns;
use crate::compile::{DefaultTask, Dialect};
use crate::diagnostics::similar::nearest;
use crate::diagnostics::{Diagnostic, Rule, files as rules};
use crate::source::{FileId, SourceMap, Span};

/// The name of a project's file.
pub const FILE_NAME: &str = "khz.toml";

/// The largest project file that is read, in bytes.
pub const MAX_BYTES: usize = 1 << 20;

/// How many paths a project file may list.
pub const MAX_PATHS: usize = 4096;

/// Settings at the top.
const KEYS: [&str; 5] = ["name", "sources", "libraries", "dialect", "task"];

/// Settings of the task.
const TASK_KEYS: [&str; 3] = ["name", "interval", "priority"];

/// Longest name of a project or task, in bytes.
const MAX_NAME: usize = 128;

/// A path or pattern of a project file and where it stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProjectPath {
    /// As written: relative to the project file, `/` between folders.
    pub text: String,
    /// Where it stands.
    pub span: Span,
}

/// What a khz.toml says.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Project {
    /// The project's name.
    pub name: Option<String>,
    /// What to compile; `None`: everything beside the project file and below.
    pub sources: Option<Vec<ProjectPath>>,
    /// What to compile before that.
    pub libraries: Vec<ProjectPath>,
    /// Which implicit conversions are taken.
    pub dialect: Option<Dialect>,
    /// The task of programs without a CONFIGURATION.
    pub task: Option<DefaultTask>,
}

/// Reads the text of a khz.toml, which is added to `sources` under `name`, so that the diagnostics have a place. The project has
/// everything that could be understood; it counts only when no diagnostic is an error.
pub fn read(sources: &mut SourceMap, name: &str, bytes: &[u8]) -> (Project, Vec<Diagnostic>) {
    let text = (bytes.len() <= MAX_BYTES).then(|| std::str::from_utf8(bytes)).and_then(Result::ok);
    let Some(text) = text else {
        let file = sources.add_text(name, "");
        let message = if bytes.len() > MAX_BYTES {
            format!("the file has {} bytes; the limit is {MAX_BYTES}", bytes.len())
        } else {
            "the file is not UTF-8".to_owned()
        };
        return (Project::default(), vec![Diagnostic::new(&rules::NOT_TOML, Span::new(file, 0, 0), message)]);
    };
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let file = sources.add_text(name, text);
    let mut reader = Reader { file, diagnostics: Vec::new() };
    let mut project = Project::default();
    match DeTable::parse(text) {
        Ok(table) => reader.project(table.get_ref(), &mut project),
        Err(error) => {
            let message = error.message().lines().next().unwrap_or("this is no TOML").to_owned();
            reader.report(&rules::NOT_TOML, error.span().unwrap_or(0..0), message);
        }
    }
    (project, reader.diagnostics)
}

struct Reader {
    file: FileId,
    diagnostics: Vec<Diagnostic>,
}

impl Reader {
    fn span(&self, range: Range<usize>) -> Span {
        let offset = |at| u32::try_from(at).unwrap_or(u32::MAX);
        Span::new(self.file, offset(range.start), offset(range.end))
    }

    fn report(&mut self, rule: &'static Rule, range: Range<usize>, message: impl Into<String>) {
        let span = self.span(range);
        self.diagnostics.push(Diagnostic::new(rule, span, message));
    }

    fn wrong(&mut self, value: &Spanned<DeValue<'_>>, what: &str) {
        let found = value.get_ref().type_str();
        let found = match found {
            "string" | "integer" => String::new(),
            other => format!(", not a TOML {other}"),
        };
        self.report(&rules::WRONG_VALUE, value.span(), format!("{what} is wanted here{found}"));
    }

    fn unknown(&mut self, key: &str, range: Range<usize>, known: &[&'static str], place: &str) {
        let folded = key.to_ascii_lowercase();
        let mut found = Diagnostic::new(
            &rules::UNKNOWN_KEY,
            self.span(range),
            format!("{place} has no setting `{}`", printable(key)),
        );
        found.help = Some(match nearest(&folded, known.iter().map(|name| (*name, *name))) {
            Some(meant) => format!("did you mean `{meant}`?"),
            None => format!("there is {}", known.join(", ")),
        });
        self.diagnostics.push(found);
    }

    fn project(&mut self, table: &DeTable<'_>, project: &mut Project) {
        for (key, value) in table {
            match key.get_ref().as_ref() {
                "name" => project.name = self.name(value),
                "sources" => project.sources = Some(self.paths(value)),
                "libraries" => project.libraries = self.paths(value),
                "dialect" => project.dialect = self.dialect(value),
                "task" => project.task = self.task(value),
                other => self.unknown(other, key.span(), &KEYS, "a project"),
            }
        }
    }

    fn text<'v>(&mut self, value: &'v Spanned<DeValue<'_>>, what: &str) -> Option<&'v str> {
        let found = value.get_ref().as_str();
        if found.is_none() {
            self.wrong(value, what);
        }
        found
    }

    /// A name that can stand in a file name and in a container.
    fn name(&mut self, value: &Spanned<DeValue<'_>>) -> Option<String> {
        const WHAT: &str = "a name of letters, digits, `_` and `-`";
        let text = self.text(value, WHAT)?;
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if text.is_empty() || text.len() > MAX_NAME || !text.chars().all(fits) || text.starts_with('-') {
            self.wrong(value, WHAT);
            return None;
        }
        Some(text.to_owned())
    }

    fn paths(&mut self, value: &Spanned<DeValue<'_>>) -> Vec<ProjectPath> {
        const WHAT: &str = "a list of paths";
        let Some(list) = value.get_ref().as_array() else {
            self.wrong(value, WHAT);
            return Vec::new();
        };
        if list.len() > MAX_PATHS {
            self.report(&rules::WRONG_VALUE, value.span(), format!("more than {MAX_PATHS} paths"));
            return Vec::new();
        }
        let mut paths = Vec::with_capacity(list.len());
        for entry in list {
            let Some(text) = self.text(entry, "a path") else { continue };
            if text.is_empty() || text.contains('\0') {
                self.wrong(entry, "a path");
                continue;
            }
            paths.push(ProjectPath { text: text.to_owned(), span: self.span(entry.span()) });
        }
        paths
    }

    fn dialect(&mut self, value: &Spanned<DeValue<'_>>) -> Option<Dialect> {
        const WHAT: &str = "\"default\" or \"iec\"";
        match self.text(value, WHAT)? {
            "default" => Some(Dialect::Default),
            "iec" => Some(Dialect::Iec),
            _ => {
                self.wrong(value, WHAT);
                None
            }
        }
    }

    fn task(&mut self, value: &Spanned<DeValue<'_>>) -> Option<DefaultTask> {
        let Some(table) = value.get_ref().as_table() else {
            self.wrong(value, "a table [task]");
            return None;
        };
        let mut task = DefaultTask::default();
        for (key, value) in table {
            match key.get_ref().as_ref() {
                "name" => task.name = self.task_name(value).unwrap_or(task.name),
                "interval" => task.interval_us = self.interval(value).unwrap_or(task.interval_us),
                "priority" => task.priority = self.priority(value).unwrap_or(task.priority),
                other => self.unknown(other, key.span(), &TASK_KEYS, "the task of a project"),
            }
        }
        Some(task)
    }

    fn task_name(&mut self, value: &Spanned<DeValue<'_>>) -> Option<String> {
        const WHAT: &str = "an identifier";
        let text = self.text(value, WHAT)?;
        let first_fits = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        let all_fit = text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !first_fits || !all_fit || text.len() > MAX_NAME {
            self.wrong(value, WHAT);
            return None;
        }
        Some(text.to_owned())
    }

    fn interval(&mut self, value: &Spanned<DeValue<'_>>) -> Option<u64> {
        let what = format!("a time of whole microseconds, at least {MIN_INTERVAL_US}, as in \"T#10ms\",");
        let text = self.text(value, &what)?;
        let ns = parse_duration_ns(text).and_then(|ns| u64::try_from(ns).ok());
        let interval_us = ns.filter(|ns| ns % 1000 == 0).map(|ns| ns / 1000).filter(|us| *us >= MIN_INTERVAL_US);
        if interval_us.is_none() {
            self.wrong(value, &what);
        }
        interval_us
    }

    fn priority(&mut self, value: &Spanned<DeValue<'_>>) -> Option<u16> {
        let number = value.get_ref().as_integer();
        let number = number.and_then(|number| u16::from_str_radix(number.as_str(), number.radix()).ok());
        if number.is_none() {
            self.wrong(value, "a number from 0 to 65535");
        }
        number
    }
}

/// A key of a user as messages show it.
fn printable(key: &str) -> String {
    let mut shown: String = key.chars().take(40).map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect();
    if key.chars().nth(40).is_some() {
        shown.push('…');
    }
    shown
}
