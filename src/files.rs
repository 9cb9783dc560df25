//! Reading what a user names on the command line: source files, folders of them, or one container.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use khz_frontend::SourceInput;
use khz_frontend::diagnostics::Diagnostic;
use khz_frontend::source::SourceMap;
use khz_frontend::twincat;

use crate::project::{self, Settings};

/// Largest source or container file that is read, in bytes.
pub const MAX_FILE_BYTES: u64 = 1 << 30;
/// Files and folders below one folder that are looked at for sources: a whole disk, named by mistake, is refused soon.
pub const MAX_ENTRIES: usize = 200_000;
/// Endings of plain source files that are picked up from a folder; TwinCAT's are known to the front end.
const SOURCE_ENDINGS: [&str; 2] = ["st", "iecst"];
/// First bytes of every container.
const CONTAINER_MAGIC: [u8; 4] = 0x4950_4C43_u32.to_le_bytes();

/// What the command line named.
#[derive(Debug)]
pub enum Input {
    /// Sources, in the order given; those of a folder by path.
    Sources(Sources),
    /// One container and its file's name.
    Container(String, Vec<u8>),
}

/// Source files and how they are to be compiled.
#[derive(Debug, Default)]
pub struct Sources {
    /// The files, in compile order.
    pub files: Vec<SourceInput>,
    /// What their project says, if they are one's.
    pub settings: Settings,
}

/// Why a file could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refused it.
    #[error("{path}: {reason}")]
    Refused {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: std::io::Error,
    },
    /// It is larger than a file of its sort may be.
    #[error("{path}: the file is larger than the {limit} bytes that it may have")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Most bytes.
        limit: u64,
    },
    /// It is empty.
    #[error("{0}: the file is empty")]
    Empty(PathBuf),
    /// A folder without sources.
    #[error("{0}: no Structured Text file (.st) in this folder")]
    NoSources(PathBuf),
    /// A folder with too much in it.
    #[error("{0}: there are more than {MAX_ENTRIES} files and folders below this one; name one closer to the sources")]
    TooMany(PathBuf),
    /// A project file, or what it leads to, is wrong.
    #[error("the project file has errors")]
    Project {
        /// All that is wrong.
        diagnostics: Vec<Diagnostic>,
        /// The project files.
        sources: SourceMap,
    },
    /// A project among other files.
    #[error("{0}: a project is named by itself, not together with other files")]
    ProjectAmongOthers(PathBuf),
    /// A container among other files.
    #[error("{0}: a container is run by itself, not together with other files")]
    ContainerAmongOthers(PathBuf),
}

/// Reads everything that `paths` name: files, folders, or one project (its folder or its khz.toml).
///
/// # Errors
/// The first file that can not be taken.
pub fn read(paths: &[PathBuf]) -> Result<Input, FileError> {
    let (files, settings) = match paths {
        [path] => match project::file_of(path) {
            Some(file) => project::read(&file)?,
            None => (list(paths)?, Settings::default()),
        },
        _ => (list(paths)?, Settings::default()),
    };
    let mut sources = Vec::new();
    for path in &files {
        let bytes = read_file(path)?;
        if bytes.starts_with(&CONTAINER_MAGIC) || path.extension().is_some_and(|e| e.eq_ignore_ascii_case("iplc")) {
            if files.len() > 1 {
                return Err(FileError::ContainerAmongOthers(path.clone()));
            }
            return Ok(Input::Container(path.display().to_string(), bytes));
        }
        sources.push(SourceInput { name: path.display().to_string(), bytes });
    }
    Ok(Input::Sources(Sources { files: sources, settings }))
}

/// The files that `paths` name: each file itself, of a folder all sources below it by path.
///
/// # Errors
/// A folder that can not be listed or has no sources in it.
pub fn list(paths: &[PathBuf]) -> Result<Vec<PathBuf>, FileError> {
    let mut files = Vec::new();
    for path in paths {
        if is_project(path) {
            return Err(FileError::ProjectAmongOthers(path.clone()));
        }
        if path.is_dir() {
            let before = files.len();
            collect_folder(path, &mut files)?;
            if files.len() == before {
                return Err(FileError::NoSources(path.clone()));
            }
        } else {
            files.push(path.clone());
        }
    }
    Ok(files)
}

/// Reads one file whole.
///
/// # Errors
/// When it is missing, unreadable, empty or larger than [`MAX_FILE_BYTES`].
pub fn read_file(path: &Path) -> Result<Vec<u8>, FileError> {
    read_limited(path, MAX_FILE_BYTES)
}

/// Reads one file of at most `limit` bytes whole; of a pipe or device no more than those are read.
///
/// # Errors
/// When it is missing, unreadable, empty or too large.
pub fn read_limited(path: &Path, limit: u64) -> Result<Vec<u8>, FileError> {
    let too_large = || FileError::TooLarge { path: path.to_path_buf(), limit };
    let refused = |reason| FileError::Refused { path: path.to_path_buf(), reason };
    let file = File::open(path).map_err(refused)?;
    let metadata = file.metadata().map_err(refused)?;
    if metadata.is_file() && metadata.len() == 0 {
        return Err(FileError::Empty(path.to_path_buf()));
    }
    if metadata.len() > limit {
        return Err(too_large());
    }
    if !metadata.is_file() {
        // A pipe or device can not be mapped and has no size: it is read up to the limit and one byte, which says that there is more.
        let mut bytes = Vec::new();
        let most = limit.saturating_add(1);
        std::io::Read::read_to_end(&mut std::io::Read::take(file, most), &mut bytes).map_err(refused)?;
        if bytes.len() as u64 > limit {
            return Err(too_large());
        }
        return if bytes.is_empty() { Err(FileError::Empty(path.to_path_buf())) } else { Ok(bytes) };
    }
    // SAFETY: the mapping is only read, copied out at once, and dropped before this function returns. Should another process cut
    // the file off in between, the copy ends in SIGBUS like any read of a vanished mapping; no memory of ours is touched.
    let mapping = unsafe { memmap2::Mmap::map(&file) }.map_err(refused)?;
    Ok(mapping.to_vec())
}

/// Whether a file's ending says that it is a project file.
#[must_use]
pub fn is_project(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// Whether a file's ending says that it is a source.
#[must_use]
pub fn is_source(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    let mut known = SOURCE_ENDINGS.iter().chain(&twincat::ENDINGS);
    ending.is_some_and(|ending| known.any(|known| ending.eq_ignore_ascii_case(known)))
}

/// Adds all sources below a folder, by path.
///
/// # Errors
/// A folder that can not be listed; more than [`MAX_ENTRIES`] files and folders.
pub(crate) fn collect_folder(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), FileError> {
    let mut found = Vec::new();
    walk(folder, usize::MAX, MAX_ENTRIES, |path, is_folder| {
        if !is_folder && is_source(path) {
            found.push(path.to_path_buf());
        }
    })?;
    found.sort();
    files.append(&mut found);
    Ok(())
}

/// Shows everything below a folder, so many levels deep, in no order: each path and whether it is a folder. Hidden folders are passed over,
/// and links are not followed.
///
/// # Errors
/// A folder that can not be listed; more than `most` files and folders.
pub(crate) fn walk(
    folder: &Path,
    levels: usize,
    most: usize,
    mut show: impl FnMut(&Path, bool),
) -> Result<(), FileError> {
    // A work list instead of recursion: folders may be nested deeply. Links are not followed, so it ends.
    let mut folders = vec![(folder.to_path_buf(), 1)];
    let mut seen = 0;
    while let Some((inner, level)) = folders.pop() {
        let refused = |reason| FileError::Refused { path: inner.clone(), reason };
        for entry in fs::read_dir(&inner).map_err(refused)? {
            let entry = entry.map_err(refused)?;
            seen += 1;
            if seen > most {
                return Err(FileError::TooMany(folder.to_path_buf()));
            }
            let is_folder = entry.file_type().map_err(refused)?.is_dir();
            if is_folder && entry.file_name().to_string_lossy().starts_with('.') {
                continue;
            }
            let path = entry.path();
            show(&path, is_folder);
            if is_folder && level < levels {
                folders.push((path, level + 1));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_file_is_named() {
        let error = read(&[PathBuf::from("/nowhere/plant.st")]).unwrap_err();
        assert!(error.to_string().starts_with("/nowhere/plant.st: "), "{error}");
    }

    #[test]
    fn a_walk_ends_at_its_limit_and_depth() {
        let folder = std::env::temp_dir().join(format!("khz-walk-{}", std::process::id()));
        for name in ["a/b/c", "a/d", ".hidden/e"] {
            fs::create_dir_all(folder.join(name)).unwrap();
        }
        let count = |levels, most| {
            let mut seen = 0;
            walk(&folder, levels, most, |_, _| seen += 1).map(|()| seen)
        };
        // The hidden folder is looked at, but not shown.
        assert_eq!((count(9, 5).unwrap(), count(1, 5).unwrap(), count(2, 5).unwrap()), (4, 1, 3));
        let refused = count(9, 4).unwrap_err();
        assert!(matches!(refused, FileError::TooMany(_)) && refused.to_string().contains("khz-walk"), "{refused}");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_folder_gives_its_sources_by_path() {
        let folder = std::env::temp_dir().join(format!("khz-files-{}", std::process::id()));
        fs::create_dir_all(folder.join("b")).unwrap();
        for name in ["z.st", "b/a.ST", "notes.txt"] {
            fs::write(folder.join(name), "x").unwrap();
        }
        let Input::Sources(sources) = read(std::slice::from_ref(&folder)).unwrap() else { panic!("sources expected") };
        let names: Vec<_> = sources.files.iter().map(|s| s.name.rsplit('/').next().unwrap().to_string()).collect();
        assert_eq!(names, ["a.ST", "z.st"]);
        fs::write(folder.join("empty.st"), "").unwrap();
        assert!(matches!(read(std::slice::from_ref(&folder)), Err(FileError::Empty(_))));
        fs::remove_dir_all(folder).unwrap();
    }
}
