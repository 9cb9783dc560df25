//! The file format of `perf inject --jit` ("jitdump", version 1), little-endian: a header, then for each function its lines and its code.

use khz_jit::Symbol;

use super::printable;

/// First four bytes.
pub const MAGIC: u32 = 0x4A69_5444;
/// Version of the format.
pub const VERSION: u32 = 1;
/// Bytes of the header.
pub const HEADER_BYTES: u32 = 40;
/// Bytes in front of what a record holds: its kind, its size and its time.
pub const PREFIX_BYTES: u32 = 16;
/// Kind of a record with code.
pub const CODE_LOAD: u32 = 0;
/// Kind of a record with lines; that of their code follows.
pub const CODE_LINES: u32 = 2;
/// Kind of the record at the end.
pub const CODE_CLOSE: u32 = 3;
/// The number of the host's instruction set in ELF files.
#[cfg(target_arch = "x86_64")]
pub const MACHINE: u32 = 62;
/// The number of the host's instruction set in ELF files.
#[cfg(target_arch = "aarch64")]
pub const MACHINE: u32 = 183;
/// The number of the host's instruction set in ELF files: not known.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub const MACHINE: u32 = 0;

/// The whole file. `time_ns` is that of the clock that samples are taken with: `CLOCK_MONOTONIC` for `perf record -k mono`.
#[must_use]
pub fn dump(symbols: &[Symbol<'_>], process: u32, time_ns: u64) -> Vec<u8> {
    let mut out = Vec::new();
    for word in [MAGIC, VERSION, HEADER_BYTES, MACHINE, 0, process] {
        out.extend(word.to_le_bytes());
    }
    out.extend(time_ns.to_le_bytes());
    out.extend(0_u64.to_le_bytes());
    for (symbol, index) in symbols.iter().zip(0_u64..) {
        if !symbol.lines.is_empty() {
            record(&mut out, CODE_LINES, time_ns, &lines(symbol));
        }
        record(&mut out, CODE_LOAD, time_ns, &load(symbol, process, index));
    }
    record(&mut out, CODE_CLOSE, time_ns, &[]);
    out
}

fn record(out: &mut Vec<u8>, kind: u32, time_ns: u64, body: &[u8]) {
    let bytes = PREFIX_BYTES.saturating_add(u32::try_from(body.len()).unwrap_or(u32::MAX));
    out.extend(kind.to_le_bytes());
    out.extend(bytes.to_le_bytes());
    out.extend(time_ns.to_le_bytes());
    out.extend(body);
}

fn lines(symbol: &Symbol<'_>) -> Vec<u8> {
    let mut body = Vec::new();
    body.extend(symbol.address().to_le_bytes());
    body.extend((symbol.lines.len() as u64).to_le_bytes());
    for range in &symbol.lines {
        body.extend((symbol.address() + u64::from(range.offset)).to_le_bytes());
        body.extend(range.line.to_le_bytes());
        // Which of several pieces of code of one line: not told apart.
        body.extend(0_u32.to_le_bytes());
        text(&mut body, &range.file);
    }
    body
}

fn load(symbol: &Symbol<'_>, process: u32, index: u64) -> Vec<u8> {
    let mut body = Vec::new();
    // All threads of the process see the code; the field wants one.
    body.extend(process.to_le_bytes());
    body.extend(process.to_le_bytes());
    // Where it was written and where it runs are the same place.
    for word in [symbol.address(), symbol.address(), symbol.code.len() as u64, index] {
        body.extend(word.to_le_bytes());
    }
    text(&mut body, &symbol.name);
    body.extend(symbol.code);
    body
}

/// A text with the zero that ends it.
fn text(out: &mut Vec<u8>, text: &str) {
    out.extend(printable(text).as_bytes());
    out.push(0);
}
