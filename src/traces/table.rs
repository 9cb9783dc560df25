//! Tables of values over time, as `--inputs` and traces are: what both readers share.

use super::TraceError;

/// Largest file of a table, in bytes.
pub const MAX_TABLE_BYTES: u64 = 256 << 20;
/// Most values of a table: 16 bytes each.
pub const MAX_CELLS: usize = 8 << 20;
/// Most columns.
pub(super) const MAX_COLUMNS: usize = 10_000;

/// A reader of the rows, and the header, whose first column is `time_us`.
///
/// # Errors
/// There is no such header.
pub fn open<'b>(file: &str, bytes: &'b [u8]) -> Result<(csv::Reader<&'b [u8]>, csv::StringRecord), TraceError> {
    let whole = |reason| TraceError { file: file.to_string(), line: 1, column: None, reason };
    if bytes.len() as u64 > MAX_TABLE_BYTES {
        return Err(whole(format!("{} bytes are more than the {MAX_TABLE_BYTES} that a table may have", bytes.len())));
    }
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let header = reader.headers().map_err(|error| csv_error(file, &error))?.clone();
    if header.get(0).is_none_or(|name| !name.eq_ignore_ascii_case("time_us")) {
        return Err(TraceError::at(file, 1, 1, "the first column must be time_us"));
    }
    if header.len() > MAX_COLUMNS {
        return Err(TraceError::at(file, 1, MAX_COLUMNS as u64, format!("more than {MAX_COLUMNS} columns")));
    }
    Ok((reader, header))
}

/// What is wrong with the shape of a row.
#[must_use]
pub fn csv_error(file: &str, error: &csv::Error) -> TraceError {
    let reason = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} cells, but the header has {expected_len}")
        }
        csv::ErrorKind::Utf8 { .. } => "the text is not UTF-8".to_string(),
        _ => error.to_string(),
    };
    let line = error.position().map_or(1, csv::Position::line);
    TraceError { file: file.to_string(), line, column: None, reason }
}
