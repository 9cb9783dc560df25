//! Names of columns and the variables that they are: the `--map` file.

use std::collections::{BTreeMap, BTreeSet};

use super::TraceError;
use super::table::csv_error;

/// Lines of a mapping, at most.
const MAX_LINES: usize = 100_000;

/// What a column is.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// Line of the mapping, from 1.
    pub line: u64,
    /// Name of the column in the trace.
    pub column: String,
    /// Our variable; empty: the column is left out.
    pub variable: String,
    /// The cell times this, plus that, is the variable's value.
    pub scale: Option<(f64, f64)>,
}

/// Every line of a mapping.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mapping {
    file: String,
    lines: Vec<Mapped>,
    /// Positions in `lines` by the column's name in lower case: no two lines are of the same name in any case.
    positions: BTreeMap<String, usize>,
}

impl Mapping {
    /// Reads lines `COLUMN,VARIABLE[,FACTOR[,OFFSET]]`; a first line `column,variable…` and lines that begin with `#` are passed over.
    ///
    /// # Errors
    /// What is wrong, with the file's name, line and column.
    pub fn read(file: &str, bytes: &[u8]) -> Result<Mapping, TraceError> {
        let mut reader = csv::ReaderBuilder::new();
        reader.trim(csv::Trim::All).has_headers(false).flexible(true).comment(Some(b'#'));
        let mut mapping = Mapping { file: file.to_string(), ..Mapping::default() };
        for (number, record) in reader.from_reader(bytes).records().enumerate() {
            let record = record.map_err(|error| csv_error(file, &error))?;
            let line = record.position().map_or(0, csv::Position::line);
            let wrong = |column, reason: String| TraceError::at(file, line, column, reason);
            let cell = |at: usize| record.get(at).filter(|cell| !cell.is_empty());
            let is = |at: usize, title: &str| cell(at).is_some_and(|name| name.eq_ignore_ascii_case(title));
            if number == 0 && is(0, "column") && is(1, "variable") {
                continue;
            }
            if record.len() > 4 {
                return Err(wrong(5, "COLUMN,VARIABLE,FACTOR,OFFSET are all there can be".to_string()));
            }
            let column = cell(0).ok_or_else(|| wrong(1, "the name of a column is missing".to_string()))?.to_string();
            if record.len() < 2 {
                return Err(wrong(
                    2,
                    format!("the variable of `{column}` is missing (empty, but for the comma: the column is left out)"),
                ));
            }
            let number = |at: usize, default: f64| match cell(at) {
                None => Ok(default),
                Some(text) => text
                    .parse()
                    .ok()
                    .filter(|number: &f64| number.is_finite())
                    .ok_or_else(|| wrong(at as u64 + 1, format!("`{text}` is not a number"))),
            };
            let (factor, offset) = (number(2, 1.0)?, number(3, 0.0)?);
            if factor == 0.0 {
                return Err(wrong(3, format!("a factor of 0 makes every cell of `{column}` the same")));
            }
            if mapping.find(&column).is_some() {
                return Err(wrong(1, format!("`{column}` stands here twice")));
            }
            if mapping.lines.len() >= MAX_LINES {
                return Err(wrong(1, format!("more than {MAX_LINES} lines")));
            }
            let scale = (cell(2).is_some() || cell(3).is_some()).then_some((factor, offset));
            mapping.positions.insert(column.to_ascii_lowercase(), mapping.lines.len());
            mapping.lines.push(Mapped { line, column, variable: cell(1).unwrap_or_default().to_string(), scale });
        }
        Ok(mapping)
    }

    /// What a column is, if it says so; names count in any case.
    #[must_use]
    pub fn find(&self, column: &str) -> Option<&Mapped> {
        self.positions.get(&column.to_ascii_lowercase()).and_then(|position| self.lines.get(*position))
    }

    /// An error in the line of a column.
    pub(super) fn wrong(&self, mapped: &Mapped, column: u64, reason: String) -> TraceError {
        TraceError::at(&self.file, mapped.line, column, reason)
    }

    /// Every line must be of a column that the trace has: a misspelt one would leave the column out without a word.
    ///
    /// # Errors
    /// The first line whose column is none of `columns`.
    pub(super) fn check_columns<'c>(&self, columns: impl Iterator<Item = &'c str>) -> Result<(), TraceError> {
        let there: BTreeSet<String> = columns.map(str::to_ascii_lowercase).collect();
        match self.lines.iter().find(|mapped| !there.contains(&mapped.column.to_ascii_lowercase())) {
            Some(Mapped { line, column, .. }) => {
                Err(TraceError::at(&self.file, *line, 1, format!("the trace has no column `{column}`")))
            }
            None => Ok(()),
        }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }
}
