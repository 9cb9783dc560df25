//! `--set` and `--inputs`: values that come from outside, all checked before the first scan.

use std::path::Path;

use khz_machine::image::Image;
use khz_machine::variables::{Variable, VariableTable};
use khz_scheduler::InputSource;
use kilohertz::files;

use super::output::Failure;

/// Applies each `NAME=VALUE` to the image.
pub fn set_values(names: &VariableTable, image: &mut Image, settings: &[String]) -> Result<(), Failure> {
    for setting in settings {
        let (name, value) =
            setting.split_once('=').ok_or_else(|| Failure::usage(format!("--set {setting}: NAME=VALUE is wanted")))?;
        let variable =
            names.resolve(name.trim()).map_err(|error| Failure::refused(format!("--set {setting}: {error}")))?;
        names
            .write(image, &variable, value.trim())
            .map_err(|error| Failure::refused(format!("--set {setting}: {error}")))?;
    }
    Ok(())
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
    /// Reads and checks a whole file. Every cell is written once to a copy of the image, so that a wrong one is refused here, by line and column.
    pub fn read(path: &Path, names: &VariableTable, image: &Image) -> Result<Self, Failure> {
        let bytes = files::read_file(path)?;
        let place =
            |line: u64, what: &dyn std::fmt::Display| Failure::refused(format!("{}:{line}: {what}", path.display()));
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes.as_slice());
        let header = reader.headers().map_err(|error| place(1, &error))?.clone();
        if header.get(0).is_none_or(|name| !name.eq_ignore_ascii_case("time_us")) {
            return Err(place(1, &"the first column must be time_us"));
        }
        let columns = header.iter().skip(1).map(|name| names.resolve(name));
        let columns: Vec<Variable> = columns.collect::<Result<_, _>>().map_err(|error| place(1, &error))?;
        let mut inputs = CsvInputs { names: names.clone(), columns, rows: Vec::new(), next: 0 };
        let mut scratch = image.clone();
        for record in reader.records() {
            let record = record.map_err(|error| {
                let line = error.position().map_or(1, csv::Position::line);
                place(line, &shape_error(error.kind()))
            })?;
            let line = record.position().map_or(0, csv::Position::line);
            let row = inputs.row(&record, &mut scratch).map_err(|reason| place(line, &reason))?;
            if inputs.rows.last().is_some_and(|last| last.time_us > row.time_us) {
                return Err(place(line, &format!("time_us goes back to {}", row.time_us)));
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
