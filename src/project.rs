//! Projects on disk: from a `khz.toml` to the files that it means. What stands in it, [`khz_frontend::project`] reads.
//!
//! Libraries come before the sources that use them, and a library with a `khz.toml` of its own brings its libraries along; only
//! the outermost project says how everything is compiled. A file that several entries mean is taken once. The order of files
//! follows from the project files and the names alone, so a project compiles to the same container on every machine.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use khz_frontend::diagnostics::{Diagnostic, files as rules, has_errors, tidy};
use khz_frontend::project::{self, Project, ProjectPath};
use khz_frontend::source::{FileId, MAX_FILES, SourceMap, Span};
use khz_frontend::{CompileOptions, DefaultTask, Dialect};

use crate::files::{self, FileError};

/// How many project files may lead to one another.
const MAX_PROJECTS: usize = 256;
/// What makes a path a pattern.
const WILD: [char; 3] = ['*', '?', '['];

/// How a project wants to be compiled.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Settings {
    /// Its name; the folder's, where khz.toml says none. `None`: this is no project.
    pub name: Option<String>,
    /// Which implicit conversions are taken.
    pub dialect: Option<Dialect>,
    /// The task of programs without a CONFIGURATION.
    pub task: Option<DefaultTask>,
}

impl Settings {
    /// Options of the compiler; what the command line says goes first.
    #[must_use]
    pub fn options(&self, dialect: Option<Dialect>) -> CompileOptions {
        CompileOptions {
            dialect: dialect.or(self.dialect).unwrap_or_default(),
            task: self.task.clone().unwrap_or_default(),
            ..CompileOptions::default()
        }
    }
}

/// The project file that a path means: itself, or the one in a folder.
#[must_use]
pub fn file_of(path: &Path) -> Option<PathBuf> {
    if files::is_project(path) {
        return Some(path.to_path_buf());
    }
    Some(path.join(project::FILE_NAME)).filter(|file| file.is_file())
}

/// The source files of a project in compile order, and its settings.
///
/// # Errors
/// What is wrong with the project file, one of its libraries, or the paths in them; all of it at once.
pub fn read(file: &Path) -> Result<(Vec<PathBuf>, Settings), FileError> {
    let mut reader = Reader::default();
    let project = reader.project(file)?.unwrap_or_default();
    if has_errors(&reader.diagnostics) {
        return Err(FileError::Project { diagnostics: tidy(reader.diagnostics), sources: reader.sources });
    }
    if reader.files.is_empty() {
        return Err(FileError::NoSources(folder_of(file)));
    }
    let folder = fs::canonicalize(folder_of(file)).ok();
    let folder_name = folder.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
    let name = project.name.or(folder_name).or_else(|| Some("project".to_owned()));
    Ok((reader.files, Settings { name, dialect: project.dialect, task: project.task }))
}

/// The folder of a file, so that `join` gives paths as people would write them.
fn folder_of(file: &Path) -> PathBuf {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

#[derive(Default)]
struct Reader {
    files: Vec<PathBuf>,
    /// The same, as the system knows them.
    taken: BTreeSet<PathBuf>,
    sources: SourceMap,
    diagnostics: Vec<Diagnostic>,
    /// Project files being read, outermost first.
    open: Vec<PathBuf>,
    projects: usize,
}

impl Reader {
    /// Takes a project's libraries and sources. `None`: it is being read already.
    fn project(&mut self, file: &Path) -> Result<Option<Project>, FileError> {
        let bytes = match files::read_file(file) {
            // An empty project file says: everything here, as always.
            Err(FileError::Empty(_)) => Vec::new(),
            other => other?,
        };
        let known = fs::canonicalize(file).unwrap_or_else(|_| file.to_path_buf());
        if self.open.contains(&known) || self.projects >= MAX_PROJECTS {
            return Ok(None);
        }
        self.open.push(known);
        self.projects += 1;
        let at = FileId(u32::try_from(self.sources.len()).unwrap_or(u32::MAX));
        let (project, found) = project::read(&mut self.sources, &file.display().to_string(), &bytes);
        self.diagnostics.extend(found);
        let folder = folder_of(file);
        for library in &project.libraries {
            self.entry(&folder, library, true)?;
        }
        match &project.sources {
            Some(list) => {
                for entry in list {
                    self.entry(&folder, entry, false)?;
                }
            }
            None => {
                if self.folder(&folder)? == 0 {
                    self.report(Span::new(at, 0, 0), "there is no source in this folder".to_owned());
                }
            }
        }
        self.open.pop();
        Ok(Some(project))
    }

    fn report(&mut self, span: Span, message: String) {
        self.diagnostics.push(Diagnostic::new(&rules::NO_SUCH_FILE, span, message));
    }

    /// Takes what one entry means; one that means too much is told where it stands.
    fn entry(&mut self, folder: &Path, entry: &ProjectPath, is_library: bool) -> Result<(), FileError> {
        match self.meaning(folder, entry, is_library) {
            Err(too_many @ FileError::TooMany(_)) => {
                self.report(entry.span, too_many.to_string());
                Ok(())
            }
            other => other,
        }
    }

    fn meaning(&mut self, folder: &Path, entry: &ProjectPath, is_library: bool) -> Result<(), FileError> {
        if entry.text.contains(WILD) {
            return self.pattern(folder, entry);
        }
        let path = folder.join(&entry.text);
        let inner = if is_library { file_of(&path).filter(|file| file.is_file()) } else { None };
        if let Some(file) = inner {
            if self.project(&file)?.is_none() {
                let message = format!("following libraries from here leads back to {}", file.display());
                self.diagnostics.push(Diagnostic::new(&rules::LIBRARY_CYCLE, entry.span, message));
            }
        } else if path.is_dir() {
            if self.folder(&path)? == 0 {
                self.report(entry.span, format!("there is no source in {}", path.display()));
            }
        } else if path.is_file() {
            self.take(path)?;
        } else {
            self.report(entry.span, format!("there is no file or folder {}", path.display()));
        }
        Ok(())
    }

    /// Takes what a pattern matches. It is looked for below the folder that its first parts name, and no deeper than it reaches.
    fn pattern(&mut self, folder: &Path, entry: &ProjectPath) -> Result<(), FileError> {
        let parts: Vec<&str> = entry.text.split('/').collect();
        let plain = parts.iter().take_while(|part| !part.contains(WILD)).count();
        let below = match &parts[..plain] {
            [] => folder.to_path_buf(),
            [""] => PathBuf::from("/"),
            plain => folder.join(plain.join("/")),
        };
        let pattern = match glob::Pattern::new(&parts[plain..].join("/")) {
            Ok(pattern) => pattern,
            Err(error) => {
                self.report(entry.span, format!("this pattern can not be read: {}", error.msg));
                return Ok(());
            }
        };
        let options = glob::MatchOptions {
            require_literal_separator: true,
            require_literal_leading_dot: true,
            ..glob::MatchOptions::new()
        };
        let levels = if parts.contains(&"**") { usize::MAX } else { parts.len() - plain };
        let mut found = Vec::new();
        // What is not there matches nothing, as is said below.
        if below.is_dir() {
            files::walk(&below, levels, files::MAX_ENTRIES, |path, is_folder| {
                let rest = path.strip_prefix(&below).unwrap_or(path);
                if pattern.matches_path_with(rest, options) && (is_folder || files::is_source(path)) {
                    found.push((path.to_path_buf(), is_folder));
                }
            })?;
        }
        found.sort();
        let mut any = false;
        for (path, is_folder) in found {
            if !is_folder {
                any = true;
                self.take(path)?;
            } else if self.folder(&path)? > 0 {
                any = true;
            }
        }
        if !any {
            self.report(entry.span, format!("no source matches `{}`", entry.text));
        }
        Ok(())
    }

    /// Takes all sources below a folder; gives their number.
    fn folder(&mut self, folder: &Path) -> Result<usize, FileError> {
        let mut found = Vec::new();
        files::collect_folder(folder, &mut found)?;
        let count = found.len();
        for path in found {
            self.take(path)?;
        }
        Ok(count)
    }

    fn take(&mut self, path: PathBuf) -> Result<(), FileError> {
        let known = fs::canonicalize(&path).map_err(|reason| FileError::Refused { path: path.clone(), reason })?;
        if self.taken.len() < MAX_FILES && self.taken.insert(known) {
            self.files.push(path);
        }
        Ok(())
    }
}
