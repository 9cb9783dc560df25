//! Shows a jitdump to a profiler that records this process: `perf record` notes executable mappings, and finds the file by that.
//!
//! This file may use `unsafe`: mapping a file is, since others may change it. Nothing here reads or runs the mapping.

use std::fs::File;
use std::io;

/// Maps a file executable, for a moment: the mapping is the message.
///
/// # Errors
/// A file system that is mounted without the right to execute, among others.
pub fn show(file: &File) -> io::Result<()> {
    // SAFETY: no reference to the mapped bytes is made, no code in them is called, and they are unmapped at once.
    let mapping = unsafe { memmap2::MmapOptions::new().map_exec(file) }?;
    drop(mapping);
    Ok(())
}
