//! `khz fmt`: files in place, or stdin to stdout.
//!
//! A file is either replaced as a whole or not touched: the new text is written beside it and renamed over it. One that
//! has syntax errors is not touched, and does not keep the others from being formatted.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use khz_frontend::diagnostics::{Diagnostic, syntax};
use khz_frontend::format::{FormatError, FormatOptions, KeywordCase, format};
use khz_frontend::source::SourceMap;
use khz_frontend::twincat;
use kilohertz::files::{self, MAX_FILE_BYTES};
use serde_json::{Value, json};

use super::args::{FmtArgs, Format, KeywordsArg};
use super::output::{Failure, diagnostic_json, people, print_diagnostics, result};
use super::{Outcome, Status};

/// The byte order mark of UTF-8.
const BYTE_ORDER_MARK: &[u8] = &[0xEF, 0xBB, 0xBF];

/// Runs it.
pub fn run(args: &FmtArgs) -> Outcome {
    let stdin = Path::new("-");
    match args.files.as_slice() {
        [only] if only == stdin => from_stdin(args),
        files if files.iter().any(|file| file == stdin) => {
            Err(Failure::usage("`-` is stdin, which is formatted by itself, not together with files"))
        }
        _ => in_place(args),
    }
}

fn options(args: &FmtArgs) -> FormatOptions {
    let keywords = match args.keywords {
        KeywordsArg::Upper => KeywordCase::Upper,
        KeywordsArg::Keep => KeywordCase::Keep,
    };
    FormatOptions { indent: args.indent, width: args.width, keywords }
}

/// What came of one file.
enum Formatted {
    /// It is laid out as it should be.
    Unchanged,
    /// It should have, or now has, these bytes.
    Changed(Vec<u8>),
    /// It has errors.
    Refused(Vec<Diagnostic>, SourceMap),
    /// It is too large, is no file, or the system refused it.
    Failed(Status, String),
}

impl Formatted {
    /// The word that programs read.
    fn word(&self) -> &'static str {
        match self {
            Self::Unchanged => "unchanged",
            Self::Changed(_) => "changed",
            Self::Refused(..) => "refused",
            Self::Failed(..) => "failed",
        }
    }

    fn to_json(&self, file: &str) -> Value {
        match self {
            Self::Unchanged | Self::Changed(_) => json!({ "file": file, "status": self.word() }),
            Self::Refused(found, sources) => {
                let found: Vec<Value> = found.iter().map(|one| diagnostic_json(one, sources)).collect();
                json!({ "file": file, "status": self.word(), "diagnostics": found })
            }
            Self::Failed(_, reason) => json!({ "file": file, "status": self.word(), "error": reason }),
        }
    }

    /// Tells people why it was not formatted.
    fn complain(&self) {
        match self {
            Self::Refused(found, sources) => print_diagnostics(found, sources, Format::Human),
            Self::Failed(_, reason) => people(&format!("error: {reason}")),
            Self::Unchanged | Self::Changed(_) => {}
        }
    }

    /// The exit status that it asks for; `check`: nothing is written.
    fn status(&self, check: bool) -> Status {
        match self {
            Self::Unchanged => Status::Done,
            Self::Changed(_) if !check => Status::Done,
            Self::Changed(_) | Self::Refused(..) => Status::Refused,
            Self::Failed(status, _) => *status,
        }
    }
}

/// Formats the bytes of a file, in the encoding that it has.
fn format_bytes(name: &str, bytes: &[u8], options: &FormatOptions) -> Formatted {
    let mut sources = SourceMap::new();
    let (id, found) = sources.add_bytes(name, bytes);
    let latin1 = found.iter().any(|one| one.rule == &syntax::READ_AS_LATIN1);
    if khz_frontend::diagnostics::has_errors(&found) {
        return Formatted::Refused(found, sources);
    }
    let text = match format(sources.file(id).map_or("", |file| file.text()), options) {
        Ok(text) => text,
        Err(FormatError::Syntax(found)) => return Formatted::Refused(found, sources),
        Err(error) => return Formatted::Failed(Status::Refused, format!("{name}: {error}")),
    };
    let mut new = Vec::with_capacity(text.len() + BYTE_ORDER_MARK.len());
    if latin1 {
        // The text came from Latin-1 and has the same characters, so each is one byte.
        new.extend(text.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?')));
    } else {
        if bytes.starts_with(BYTE_ORDER_MARK) {
            new.extend_from_slice(BYTE_ORDER_MARK);
        }
        new.extend_from_slice(text.as_bytes());
    }
    if new == bytes { Formatted::Unchanged } else { Formatted::Changed(new) }
}

fn in_place(args: &FmtArgs) -> Outcome {
    let options = options(args);
    let (mut status, mut all) = (Status::Done, Vec::new());
    let (mut changed, mut unchanged) = (0_usize, 0_usize);
    for path in files::list(&args.files)? {
        let name = path.display().to_string();
        // TwinCAT keeps its XML in order by itself.
        if twincat::is_twincat(&name) {
            continue;
        }
        let formatted = format_file(&path, &name, &options, args.check);
        match formatted {
            Formatted::Changed(_) => changed += 1,
            Formatted::Unchanged => unchanged += 1,
            Formatted::Refused(..) | Formatted::Failed(..) => {}
        }
        if args.common.format == Format::Json {
            all.push(formatted.to_json(&name));
        } else {
            formatted.complain();
            if matches!(formatted, Formatted::Changed(_)) {
                result(&name);
            }
        }
        // The statuses are ordered by how bad they are.
        if formatted.status(args.check) as u8 > status as u8 {
            status = formatted.status(args.check);
        }
    }
    if args.common.format == Format::Json {
        result(&Value::Array(all).to_string());
    } else {
        let verb = if args.check { "would change" } else { "changed" };
        people(&format!("{changed} {verb}, {unchanged} unchanged"));
    }
    Ok(status)
}

/// Formats one file and, unless it is only checked, writes it.
fn format_file(path: &Path, name: &str, options: &FormatOptions, check: bool) -> Formatted {
    let bytes = match files::read_file(path) {
        Ok(bytes) => bytes,
        Err(files::FileError::Empty(_)) => return Formatted::Unchanged,
        Err(error) => return Formatted::Failed(Status::Refused, error.to_string()),
    };
    let formatted = format_bytes(name, &bytes, options);
    if let Formatted::Changed(new) = &formatted
        && !check
        && let Err(error) = replace(path, new)
    {
        return Formatted::Failed(Status::Host, format!("{name}: {error}"));
    }
    formatted
}

/// Replaces a file by a new one with its permissions. Whoever reads it meanwhile, and whoever finds it after a crash, has
/// the old text or the new one.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    // A link stays a link: what it leads to is replaced.
    let path = fs::canonicalize(path)?;
    let permissions = fs::metadata(&path)?.permissions();
    if permissions.readonly() {
        // The rename would succeed; whoever protected the file did not want that.
        return Err(io::Error::from(io::ErrorKind::PermissionDenied));
    }
    let beside = beside(&path);
    let mut file = OpenOptions::new().write(true).create_new(true).open(&beside)?;
    let written = write_new(&mut file, bytes, permissions).and_then(|()| fs::rename(&beside, &path));
    if written.is_err() {
        // It is of no use to anybody; the first error is the one to report.
        let _ = fs::remove_file(&beside);
    }
    written
}

fn write_new(file: &mut File, bytes: &[u8], permissions: fs::Permissions) -> io::Result<()> {
    file.write_all(bytes)?;
    file.set_permissions(permissions)?;
    file.sync_all()
}

/// The name under which the new text of a file is written: in its folder, where renaming is one step, and not that of a
/// source file.
fn beside(path: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.khz-fmt", std::process::id()));
    path.with_file_name(name)
}

fn from_stdin(args: &FmtArgs) -> Outcome {
    let mut bytes = Vec::new();
    let refused = |error: io::Error| Failure::Message(Status::Host, format!("stdin: {error}"));
    io::stdin().lock().take(MAX_FILE_BYTES).read_to_end(&mut bytes).map_err(refused)?;
    let formatted = format_bytes("stdin", &bytes, &options(args));
    if args.common.format == Format::Json {
        let mut value = formatted.to_json("-");
        if let (false, Formatted::Changed(new), Some(fields)) = (args.check, &formatted, value.as_object_mut()) {
            fields.insert("text".to_owned(), Value::String(String::from_utf8_lossy(new).into_owned()));
        }
        result(&Value::Array(vec![value]).to_string());
        return Ok(formatted.status(args.check));
    }
    formatted.complain();
    let output: &[u8] = match &formatted {
        _ if args.check => &[],
        Formatted::Unchanged => &bytes,
        Formatted::Changed(new) => new,
        Formatted::Refused(..) | Formatted::Failed(..) => &[],
    };
    if args.check && matches!(formatted, Formatted::Changed(_)) {
        result("-");
    }
    // A reader that went away wants no more.
    let _ = io::stdout().lock().write_all(output);
    Ok(formatted.status(args.check))
}
