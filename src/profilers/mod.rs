//! What profilers outside of this process need to know of native code, which no file of the process holds: which function lies where, and which
//! source lines it comes from. Written before the first scan, and only when asked for.

pub mod jitdump;
mod marker;

use std::fmt::Write;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use khz_jit::Symbol;

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Profile {
    /// `/tmp/perf-PID.map`: names and places. `perf report` finds it by itself.
    Map,
    /// `jit-PID.dump` in the current folder: code and lines as well. `perf record -k mono`, `perf inject --jit`, then `perf report` or `perf annotate`.
    Jitdump,
}

/// Writes the file for this process and says where it is. `symbols` are of code that stays where it is while the process is profiled.
///
/// # Errors
/// What the system refuses.
pub fn write(profile: Profile, symbols: &[Symbol<'_>]) -> io::Result<PathBuf> {
    let process = std::process::id();
    match profile {
        Profile::Map => {
            let path = PathBuf::from(format!("/tmp/perf-{process}.map"));
            io::Write::write_all(&mut create(&path)?, map(symbols).as_bytes())?;
            Ok(path)
        }
        Profile::Jitdump => {
            let path = PathBuf::from(format!("jit-{process}.dump"));
            let mut file = create(&path)?;
            let time = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
            let time_ns = time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64;
            io::Write::write_all(&mut file, &jitdump::dump(symbols, process, time_ns))?;
            marker::show(&file)?;
            Ok(path)
        }
    }
}

/// Makes a file anew. What lies there is of an earlier process of this number, or a link that somebody laid: it goes, and is not followed.
fn create(path: &Path) -> io::Result<File> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    OpenOptions::new().read(true).write(true).create_new(true).open(path)
}

/// A map: address, size and name of each function.
#[must_use]
pub fn map(symbols: &[Symbol<'_>]) -> String {
    let mut out = String::new();
    for symbol in symbols {
        // Writing to a String does not fail.
        let _ = writeln!(out, "{:x} {:x} {}", symbol.address(), symbol.code.len(), printable(&symbol.name));
    }
    out
}

/// A name without what ends a line or a name: containers may hold any text.
fn printable(name: &str) -> String {
    name.replace(char::is_control, "?")
}
