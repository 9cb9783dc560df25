//! Columns that drive the program: rows of inputs like those of `--inputs`.

use std::sync::Arc;

use khz_machine::image::Image;
use khz_machine::variables::VariableTable;
use khz_scheduler::InputSource;

use super::read::{Column, Trace};
use super::sample;

/// Gives the driving columns of a trace to a program, each row from its time on.
#[derive(Debug, Clone)]
pub struct Drive {
    trace: Arc<Trace>,
    names: Arc<VariableTable>,
    /// Added to the trace's times.
    offset_us: i64,
    columns: Vec<usize>,
    /// Rows in which a driving column changes.
    rows: Arc<Vec<usize>>,
    next: usize,
}

impl Drive {
    /// At times moved by `offset_us`. `None`: no column drives.
    #[must_use]
    pub fn new(trace: &Arc<Trace>, names: &Arc<VariableTable>, offset_us: i64) -> Option<Drive> {
        let columns: Vec<usize> = (0..trace.columns.len()).filter(|column| trace.columns[*column].drives).collect();
        if columns.is_empty() {
            return None;
        }
        let changes = |row: &usize| {
            *row == 0 || columns.iter().any(|column| trace.cell(*row, *column) != trace.cell(*row - 1, *column))
        };
        let rows = Arc::new((0..trace.len()).filter(changes).collect());
        Some(Drive { trace: trace.clone(), names: names.clone(), offset_us, columns, rows, next: 0 })
    }

    /// The same from its first row on, at other times.
    #[must_use]
    pub fn moved(&self, offset_us: i64) -> Drive {
        Drive { offset_us, next: 0, ..self.clone() }
    }

    fn time_us(&self) -> Option<u64> {
        let row = self.rows.get(self.next)?;
        let time = self.trace.times_us.get(*row)?.saturating_add(self.offset_us);
        // What was before our start holds from it on.
        Some(u64::try_from(time).unwrap_or(0))
    }
}

impl InputSource for Drive {
    fn next_change_us(&self) -> Option<u64> {
        self.time_us()
    }

    fn apply(&mut self, now_us: u64, image: &mut Image) {
        while self.time_us().is_some_and(|time| time <= now_us) {
            let row = self.rows[self.next];
            for column in &self.columns {
                let Column { variable, domain, .. } = &self.trace.columns[*column];
                let value = self.trace.cell(row, *column);
                sample::write(&self.names, &self.trace.texts, image, (variable, domain), value);
            }
            self.next += 1;
        }
    }
}
