//! Reading a trace: all checks, by line and column, before anything runs.

use std::collections::BTreeMap;

use khz_bytecode::container::DebugPlace;
use khz_bytecode::value::BytePlace;
use khz_machine::image::Image;
use khz_machine::variables::{Domain, Variable, VariableTable};

use super::mapping::{Mapped, Mapping};
use super::sample::{Reader, Sample, Texts, is_number};
use super::table::{MAX_CELLS, csv_error, open};

/// What is wrong with a trace or a mapping, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{line}{}: {reason}", .column.map_or(String::new(), |column| format!(", column {column}")))]
pub struct TraceError {
    /// The file.
    pub file: String,
    /// Line, from 1.
    pub line: u64,
    /// Column, from 1.
    pub column: Option<u64>,
    /// What.
    pub reason: String,
}

impl TraceError {
    /// At a line and column.
    pub(crate) fn at(file: &str, line: u64, column: u64, reason: impl Into<String>) -> TraceError {
        TraceError { file: file.to_string(), line, column: Some(column), reason: reason.into() }
    }
}

/// Which columns are meant, and what for.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    /// What columns are.
    pub mapping: Mapping,
    /// Columns or variables that drive the program; `None`: those that are located at %I.
    pub drive: Option<Vec<String>>,
}

/// One column.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its name in the trace.
    pub name: String,
    /// The variable that it is.
    pub variable: Variable,
    /// What that can hold.
    pub domain: Domain,
    /// It drives the program; else it is compared.
    pub drives: bool,
    /// Position among the cells of a row.
    cell: usize,
}

impl Column {
    /// Whether a name means it: that of the trace, or the variable's.
    #[must_use]
    pub fn is_named(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name) || self.variable.name.eq_ignore_ascii_case(name)
    }
}

/// A whole trace.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Times of the rows in microseconds, ascending.
    pub times_us: Vec<i64>,
    /// Lines of the rows in the file.
    pub lines: Vec<u64>,
    /// Its columns.
    pub columns: Vec<Column>,
    /// Columns that are no variable and are left out.
    pub left_out: Vec<String>,
    /// Texts of its cells.
    pub texts: Texts,
    /// Row by row; an empty cell holds what the row before has.
    cells: Vec<Sample>,
}

impl Trace {
    /// Reads and checks a whole trace. `image` is of the program.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn read(
        file: &str,
        bytes: &[u8],
        choice: &Choice,
        names: &VariableTable,
        image: &Image,
    ) -> Result<Trace, TraceError> {
        let (mut reader, header) = open(file, bytes)?;
        let (mut trace, readers) = Trace::header(file, &header, choice, names)?;
        let mut scratch = image.clone();
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record).map_err(|error| csv_error(file, &error))? {
            let line = record.position().map_or(0, csv::Position::line);
            let time = record.get(0).unwrap_or_default();
            let time_us = parse_time_us(time)
                .ok_or_else(|| TraceError::at(file, line, 1, format!("`{time}` is no time in microseconds")))?;
            trace.begin_row(file, line, time_us)?;
            let row = trace.cells.len() - trace.columns.len();
            for (position, reader) in readers.iter().enumerate() {
                let at = trace.columns[position].cell;
                let Some(cell) = record.get(at).filter(|cell| !cell.is_empty()) else { continue };
                let read = reader.read(names, &mut trace.texts, &mut scratch, cell);
                trace.cells[row + position] =
                    read.map_err(|reason| TraceError::at(file, line, at as u64 + 1, reason))?;
            }
        }
        if trace.times_us.is_empty() {
            return Err(TraceError {
                file: file.to_string(),
                line: 2,
                column: None,
                reason: "there is no row".to_string(),
            });
        }
        Ok(trace)
    }

    fn header(
        file: &str,
        header: &csv::StringRecord,
        choice: &Choice,
        names: &VariableTable,
    ) -> Result<(Trace, Vec<Reader>), TraceError> {
        choice.mapping.check_columns(header.iter().skip(1))?;
        let mut trace = Trace {
            times_us: Vec::new(),
            lines: Vec::new(),
            columns: Vec::new(),
            left_out: Vec::new(),
            texts: Texts::default(),
            cells: Vec::new(),
        };
        let mut readers = Vec::new();
        let mut seen = BTreeMap::new();
        for (at, name) in header.iter().enumerate().skip(1) {
            let wrong = |reason: String| TraceError::at(file, 1, at as u64 + 1, reason);
            let mapped = choice.mapping.find(name);
            let variable = match mapped.map_or(name, |mapped| &mapped.variable) {
                "" => Err("the column has no name".to_string()),
                path => names.resolve(path).map_err(|error| error.to_string()),
            };
            let variable = match variable {
                Ok(variable) => variable,
                Err(_)
                    if mapped.is_some_and(|mapped| mapped.variable.is_empty())
                        || (mapped.is_none() && !choice.mapping.is_empty()) =>
                {
                    trace.left_out.push(name.to_string());
                    continue;
                }
                Err(reason) => return Err(wrong(format!("{reason} (--map says what the columns of a trace are)"))),
            };
            let domain = names.domain(&variable);
            let domain = domain
                .ok_or_else(|| wrong(format!("`{}` is no single value: name one of its parts", variable.name)))?;
            let drives = choice.drives(name, &variable);
            if drives && variable.constant {
                return Err(wrong(format!("`{}` is a CONSTANT and can not be driven", variable.name)));
            }
            let scale = mapped.and_then(|mapped: &Mapped| mapped.scale);
            if let Some(mapped) = mapped.filter(|mapped| mapped.scale.is_some() && !is_number(&domain)) {
                let reason = format!("`{}` is no number and no time: it has neither FACTOR nor OFFSET", variable.name);
                return Err(choice.mapping.wrong(mapped, 3, reason));
            }
            if let Some(twin) = seen.insert(variable.name.clone(), name) {
                return Err(wrong(format!("`{name}` is `{}`, as column `{twin}` is already", variable.name)));
            }
            readers.push(Reader { variable: variable.clone(), domain: domain.clone(), scale, strict: drives });
            trace.columns.push(Column { name: name.to_string(), variable, domain, drives, cell: at });
        }
        if trace.columns.is_empty() {
            return Err(TraceError::at(file, 1, 1, "no column is a variable of the program"));
        }
        Ok((trace, readers))
    }

    /// Adds a row that holds what the one before has; one of the same time goes on with it.
    fn begin_row(&mut self, file: &str, line: u64, time_us: i64) -> Result<(), TraceError> {
        let width = self.columns.len();
        match self.times_us.last() {
            Some(last) if *last > time_us => {
                return Err(TraceError::at(file, line, 1, format!("time_us goes back to {time_us}")));
            }
            Some(last) if *last == time_us => {
                self.lines.pop();
                self.lines.push(line);
                return Ok(());
            }
            Some(_) => self.cells.extend_from_within(self.cells.len() - width..),
            None => self.cells.resize(width, Sample::Nothing),
        }
        if self.cells.len() > MAX_CELLS {
            let reason = format!(
                "{} rows of {width} values are more than the {MAX_CELLS} values that a trace may have",
                self.times_us.len() + 1
            );
            return Err(TraceError { file: file.to_string(), line, column: None, reason });
        }
        self.times_us.push(time_us);
        self.lines.push(line);
        Ok(())
    }

    /// How many rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.times_us.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.times_us.is_empty()
    }

    /// The value of a column that holds at a row.
    #[must_use]
    pub fn cell(&self, row: usize, column: usize) -> Sample {
        self.cells.get(row * self.columns.len() + column).copied().unwrap_or(Sample::Nothing)
    }
}

impl Choice {
    fn drives(&self, column: &str, variable: &Variable) -> bool {
        let is_meant = |name: &String| name.eq_ignore_ascii_case(column) || name.eq_ignore_ascii_case(&variable.name);
        match &self.drive {
            Some(names) => names.iter().any(is_meant),
            None => {
                matches!(variable.place, DebugPlace::Bytes(BytePlace::Input, _) | DebugPlace::Bit(BytePlace::Input, ..))
            }
        }
    }
}

/// A time, whole or with a fraction that is rounded.
fn parse_time_us(text: &str) -> Option<i64> {
    /// 146,000 years: sums of two such times do not overflow.
    const FARTHEST_US: i64 = i64::MAX / 4;
    let time = text.parse::<i64>().ok().or_else(|| {
        let time = text.parse::<f64>().ok()?;
        (time.abs() < FARTHEST_US as f64).then(|| time.round() as i64)
    });
    time.filter(|time| (-FARTHEST_US..=FARTHEST_US).contains(time))
}
