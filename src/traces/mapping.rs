//! Names of columns and the variables that they are: the `--map` file.

use super::TraceError;

/// Lines of a mapping, at most.
const MAX_LINES: usize = 100_000;

/// What a column is.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
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
    lines: Vec<Mapped>,
}

impl Mapping {
    /// Reads lines `COLUMN,VARIABLE[,FACTOR[,OFFSET]]`; a first line `column,variable…` and lines that begin with `#` are passed over.
    ///
    /// # Errors
    /// What is wrong, with the file's name, line and column.
    pub fn read(file: &str, bytes: &[u8]) -> Result<Mapping, TraceError> {
        let mut reader = csv::ReaderBuilder::new();
        reader.trim(csv::Trim::All).has_headers(false).flexible(true).comment(Some(b'#'));
        let mut mapping = Mapping::default();
        for (number, record) in reader.from_reader(bytes).records().enumerate() {
            let record = record.map_err(|error| TraceError::csv(file, &error))?;
            let line = record.position().map_or(0, csv::Position::line);
            let wrong = |column, reason: String| TraceError::at(file, line, column, reason);
            let cell = |at: usize| record.get(at).filter(|cell| !cell.is_empty());
            if number == 0 && cell(0).is_some_and(|name| name.eq_ignore_ascii_case("column")) {
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
            if mapping.find(&column).is_some() {
                return Err(wrong(1, format!("`{column}` stands here twice")));
            }
            if mapping.lines.len() >= MAX_LINES {
                return Err(wrong(1, format!("more than {MAX_LINES} lines")));
            }
            let scale = (cell(2).is_some() || cell(3).is_some()).then_some((factor, offset));
            mapping.lines.push(Mapped { column, variable: cell(1).unwrap_or_default().to_string(), scale });
        }
        Ok(mapping)
    }

    /// What a column is, if it says so: by its name as it stands, or else in any case.
    #[must_use]
    pub fn find(&self, column: &str) -> Option<&Mapped> {
        let exact = self.lines.iter().find(|mapped| mapped.column == column);
        exact.or_else(|| self.lines.iter().find(|mapped| mapped.column.eq_ignore_ascii_case(column)))
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }
}
