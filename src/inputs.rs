//! The rows of an `--inputs` file: a table whose first column is `time_us` and whose others are variables; a row holds from its time on.
//!
//! The file comes from outside: everything in it is checked before the first scan, and what is wrong is named by line and column. What is kept is
//! one table of values, however many resources are given it: 20 bytes for a cell that is not empty, and each text once.

use std::sync::Arc;

use khz_machine::image::Image;
use khz_machine::variables::{Domain, Variable, VariableTable};
use khz_scheduler::InputSource;

use crate::traces::TraceError;
use crate::traces::sample::{self, Sample, Texts};
use crate::traces::table::{MAX_CELLS, csv_error, open};

/// A checked file.
#[derive(Debug)]
struct Table {
    names: VariableTable,
    columns: Vec<(Variable, Domain)>,
    texts: Texts,
    /// Times of the rows, ascending, and where the cells of each end.
    rows: Vec<(u64, u32)>,
    /// Columns of the cells that are not empty, and behind them their values: row by row, as an empty cell changes nothing.
    cells: Vec<u32>,
    values: Vec<Sample>,
}

/// The rows of an `--inputs` file, each holding from its time on. A clone shares the table and begins where this one is.
#[derive(Debug, Clone)]
pub struct CsvInputs {
    table: Arc<Table>,
    next: usize,
}

impl CsvInputs {
    /// Reads and checks the bytes of a whole file, called `file` in errors. Every cell is written once to a copy of the image, so that a wrong one is
    /// refused here.
    ///
    /// # Errors
    /// The first line that is no row of inputs for these variables, and one that is too much.
    pub fn parse(file: &str, bytes: &[u8], names: &VariableTable, image: &Image) -> Result<Self, TraceError> {
        let (mut reader, header) = open(file, bytes)?;
        let column = |(at, name): (usize, &str)| {
            let wrong = |reason: String| TraceError::at(file, 1, at as u64 + 1, reason);
            let variable = names.resolve(name).map_err(|error| wrong(error.to_string()))?;
            let domain = names.domain(&variable);
            let domain = domain
                .ok_or_else(|| wrong(format!("`{}` is no single value: name one of its parts", variable.name)))?;
            Ok((variable, domain))
        };
        let columns = header.iter().enumerate().skip(1).map(column).collect::<Result<_, TraceError>>()?;
        let mut table = Table {
            names: names.clone(),
            columns,
            texts: Texts::default(),
            rows: Vec::new(),
            cells: Vec::new(),
            values: Vec::new(),
        };
        let mut scratch = image.clone();
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record).map_err(|error| csv_error(file, &error))? {
            let line = record.position().map_or(0, csv::Position::line);
            table.row(&record, &mut scratch).map_err(|(column, reason)| TraceError::at(file, line, column, reason))?;
        }
        Ok(CsvInputs { table: Arc::new(table), next: 0 })
    }
}

impl Table {
    /// Adds a row; an error says its column.
    fn row(&mut self, record: &csv::StringRecord, scratch: &mut Image) -> Result<(), (u64, String)> {
        let time = record.get(0).unwrap_or_default();
        let time_us = time.parse().map_err(|_| (1, format!("`{time}` is no time in microseconds")))?;
        if self.rows.last().is_some_and(|(last, _)| *last > time_us) {
            return Err((1, format!("time_us goes back to {time_us}")));
        }
        for (position, (variable, domain)) in self.columns.iter().enumerate() {
            let Some(cell) = record.get(position + 1).filter(|cell| !cell.is_empty()) else { continue };
            let at = position as u64 + 2;
            if self.cells.len() >= MAX_CELLS {
                return Err((at, format!("more than the {MAX_CELLS} values that a table may have")));
            }
            let value = sample::literal(&self.names, &mut self.texts, scratch, (variable, domain), cell);
            self.values.push(value.map_err(|error| (at, error.to_string()))?);
            self.cells.push(position as u32);
        }
        self.rows.push((time_us, self.cells.len() as u32));
        Ok(())
    }
}

impl InputSource for CsvInputs {
    fn next_change_us(&self) -> Option<u64> {
        self.table.rows.get(self.next).map(|(time_us, _)| *time_us)
    }

    fn apply(&mut self, now_us: u64, image: &mut Image) {
        let Table { names, columns, texts, rows, cells, values } = &*self.table;
        while let Some((_, end)) = rows.get(self.next).filter(|(time_us, _)| *time_us <= now_us) {
            let begin = self.next.checked_sub(1).map_or(0, |before| rows[before].1);
            for at in begin as usize..*end as usize {
                let (variable, domain) = &columns[cells[at] as usize];
                sample::write(names, texts, image, (variable, domain), values[at]);
            }
            self.next += 1;
        }
    }
}
