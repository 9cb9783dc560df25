//! The rows of an `--inputs` file: a table whose first column is `time_us` and whose others are variables; a row holds from its time on.
//!
//! The file comes from outside: everything in it is checked before the first scan, and what is wrong is named by line and column.

use khz_machine::image::Image;
use khz_machine::variables::{Variable, VariableTable};
use khz_scheduler::InputSource;

/// What is wrong with a file of inputs.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct CsvError {
    /// Line of the file, from 1 on.
    pub line: u64,
    /// What is wrong there; it begins with the column where one cell is to blame.
    pub reason: String,
}

impl CsvError {
    fn new(line: u64, reason: impl std::fmt::Display) -> CsvError {
        CsvError { line, reason: reason.to_string() }
    }
}

/// One row: a time and its cells; an empty cell changes nothing.
#[derive(Debug)]
struct Row {
    time_us: u64,
    cells: Vec<(usize, String)>,
}

/// The rows of an `--inputs` file, each holding from its time on.
#[derive(Debug)]
pub struct CsvInputs {
    names: VariableTable,
    columns: Vec<Variable>,
    rows: Vec<Row>,
    next: usize,
}

impl CsvInputs {
    /// Reads and checks the bytes of a whole file. Every cell is written once to a copy of the image, so that a wrong one is refused here.
    ///
    /// # Errors
    /// The first line that is no row of inputs for these variables.
    pub fn parse(bytes: &[u8], names: &VariableTable, image: &Image) -> Result<Self, CsvError> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
        let header = reader.headers().map_err(|error| CsvError::new(1, error))?.clone();
        if header.get(0).is_none_or(|name| !name.eq_ignore_ascii_case("time_us")) {
            return Err(CsvError::new(1, "the first column must be time_us"));
        }
        let columns = header.iter().skip(1).map(|name| names.resolve(name));
        let columns: Vec<Variable> = columns.collect::<Result<_, _>>().map_err(|error| CsvError::new(1, error))?;
        let mut inputs = CsvInputs { names: names.clone(), columns, rows: Vec::new(), next: 0 };
        let mut scratch = image.clone();
        for record in reader.records() {
            let record = record.map_err(|error| {
                let line = error.position().map_or(1, csv::Position::line);
                CsvError::new(line, shape_error(error.kind()))
            })?;
            let line = record.position().map_or(0, csv::Position::line);
            let row = inputs.row(&record, &mut scratch).map_err(|reason| CsvError::new(line, reason))?;
            if inputs.rows.last().is_some_and(|last| last.time_us > row.time_us) {
                return Err(CsvError::new(line, format!("time_us goes back to {}", row.time_us)));
            }
            inputs.rows.push(row);
        }
        Ok(inputs)
    }

    /// One row; an error begins with the column.
    fn row(&self, record: &csv::StringRecord, scratch: &mut Image) -> Result<Row, String> {
        let time = record.get(0).unwrap_or_default();
        let time_us = time.parse().map_err(|_| format!("`{time}` is no time in microseconds"))?;
        let mut cells = Vec::new();
        for (column, variable) in self.columns.iter().enumerate() {
            let Some(cell) = record.get(column + 1).filter(|cell| !cell.is_empty()) else { continue };
            let wrong = |error| format!("column {}: {error}", column + 2);
            self.names.write(scratch, variable, cell).map_err(wrong)?;
            cells.push((column, cell.to_string()));
        }
        Ok(Row { time_us, cells })
    }
}

/// What is wrong with the shape of a row.
fn shape_error(kind: &csv::ErrorKind) -> String {
    match kind {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} cells, but the header has {expected_len}")
        }
        csv::ErrorKind::Utf8 { .. } => "the text is not UTF-8".to_string(),
        other => format!("{other:?}"),
    }
}

impl InputSource for CsvInputs {
    fn next_change_us(&self) -> Option<u64> {
        self.rows.get(self.next).map(|row| row.time_us)
    }

    fn apply(&mut self, now_us: u64, image: &mut Image) {
        while let Some(row) = self.rows.get(self.next).filter(|row| row.time_us <= now_us) {
            for (column, cell) in &row.cells {
                // Every cell was written to a copy of this image when the file was read.
                let _ = self.names.write(image, &self.columns[*column], cell);
            }
            self.next += 1;
        }
    }
}
