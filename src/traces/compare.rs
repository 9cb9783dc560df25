//! Row by row: what the program has at the time of each row of a trace.

use std::collections::BTreeMap;
use std::sync::Arc;

use khz_machine::image::Image;
use khz_machine::report::DescribedPlace;
use khz_machine::variables::VariableTable;
use khz_scheduler::{FaultReport, Wake};

use super::curve::Curve;
use super::read::Trace;
use super::sample::{Sample, Texts, sample, text};
use super::tolerance::{Tolerance, Tolerances};
use crate::lockstep::difference::Difference;
use crate::lockstep::{Lockstep, Progress};

/// Rounds that are repeated for the statements that wrote something in them, at most: the third evaluator is slow.
const MAX_REPEATED: usize = 20;
/// Columns that get curves, at most.
pub const MAX_CURVES: usize = 256;

/// How to compare.
#[derive(Debug, Clone, Default)]
pub struct Terms {
    /// How far values may lie apart.
    pub tolerances: Tolerances,
    /// Added to the trace's times, in microseconds.
    pub offset_us: i64,
    /// Rows are changes: between them the trace's values hold, and the program is compared after each of its rounds too. Else rows are samples, and only
    /// at their times anything is known.
    pub on_change: bool,
    /// Keep curves.
    pub curves: bool,
}

/// A place where values lie apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Apart {
    /// Line of the row in the trace's file.
    pub line: u64,
    /// Time in the trace, in microseconds.
    pub trace_us: i64,
    /// Time of the program, in microseconds.
    pub time_us: i64,
    /// The trace's value and the program's.
    pub values: [Sample; 2],
    /// How far they lie apart; infinite when they are no numbers.
    pub deviation: f64,
    /// The round that the program's value is of, from 1.
    pub round: u64,
}

/// What a column came to.
#[derive(Debug, Clone)]
pub struct Compared {
    /// Position among the trace's columns.
    pub column: usize,
    /// What is allowed.
    pub tolerance: Tolerance,
    /// Values that were compared.
    pub rows: u64,
    /// Of these, those beyond the tolerance.
    pub beyond: u64,
    /// The largest deviation, when there is any.
    pub largest: Option<Apart>,
    /// The first one beyond the tolerance.
    pub first: Option<Apart>,
    /// The trace's curve and the program's.
    pub curves: Option<[Curve; 2]>,
}

/// A comparison while the program runs.
#[derive(Debug)]
pub struct Comparer {
    trace: Arc<Trace>,
    names: Arc<VariableTable>,
    terms: Terms,
    /// The trace's, and behind them the program's.
    texts: Texts,
    columns: Vec<Compared>,
    /// The program's values after its last round, one for each of `columns`.
    last: Vec<Sample>,
    /// The first row that is not compared yet.
    next: usize,
    /// Rounds so far.
    rounds: u64,
    /// Rows before the program's start.
    early: u64,
}

/// How a run along a trace ended.
#[derive(Debug, Clone, Copy)]
pub enum End {
    /// At the end of the trace.
    Over,
    /// In a trap.
    Trapped(FaultReport),
    /// The trace goes on, but no more rounds may run.
    TooLong,
}

impl Comparer {
    /// Begins a comparison.
    #[must_use]
    pub fn new(trace: &Arc<Trace>, names: &Arc<VariableTable>, terms: Terms) -> Comparer {
        let moved = |time: Option<&i64>| time.map_or(0, |time| time.saturating_add(terms.offset_us));
        let span = (moved(trace.times_us.first()).max(0), moved(trace.times_us.last()));
        let compared = trace.columns.iter().enumerate().filter(|(_, column)| !column.drives);
        let columns = compared.enumerate().map(|(position, (at, column))| Compared {
            column: at,
            tolerance: terms.tolerances.of(&column.name, &column.variable.name, &column.domain),
            rows: 0,
            beyond: 0,
            largest: None,
            first: None,
            curves: (terms.curves && position < MAX_CURVES).then(|| [(); 2].map(|()| Curve::new(span.0, span.1))),
        });
        let columns: Vec<Compared> = columns.collect();
        let last = vec![Sample::Nothing; columns.len()];
        let (trace, names, texts) = (trace.clone(), names.clone(), trace.texts.clone());
        Comparer { trace, names, terms, texts, columns, last, next: 0, rounds: 0, early: 0 }
    }

    /// Whether every row is compared.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.next >= self.trace.len()
    }

    /// What came of it.
    #[must_use]
    pub fn columns(&self) -> &[Compared] {
        &self.columns
    }

    /// Rows that lie before the program's start, and those that were not reached.
    #[must_use]
    pub fn not_compared(&self) -> (u64, u64) {
        (self.early, (self.trace.len() - self.next) as u64)
    }

    /// Columns with values beyond the tolerance.
    #[must_use]
    pub fn differing(&self) -> usize {
        self.columns.iter().filter(|column| column.beyond > 0).count()
    }

    /// Values that were compared.
    #[must_use]
    pub fn values(&self) -> u64 {
        self.columns.iter().map(|column| column.rows).sum()
    }

    fn row_time_us(&self, row: usize) -> i64 {
        self.trace.times_us[row].saturating_add(self.terms.offset_us)
    }

    /// Takes the values of a round at `time_us`, and compares the rows before it with those of the round before.
    pub fn round_ended(&mut self, time_us: i64, image: &Image) {
        while !self.is_over() && self.row_time_us(self.next) < time_us {
            self.compare_row();
        }
        for (column, last) in self.columns.iter_mut().zip(&mut self.last) {
            *last = sample(&self.names, &mut self.texts, image, &self.trace.columns[column.column].variable);
            if let (Some([_, ours]), Some(value)) = (&mut column.curves, last.number()) {
                ours.add(time_us, value);
            }
        }
        self.rounds += 1;
        let row_is_now = !self.is_over() && self.row_time_us(self.next) == time_us;
        if self.terms.on_change && !row_is_now && self.next > 0 && !self.is_over() {
            self.compare(self.next - 1, time_us);
        }
    }

    /// Compares the rows that are left with the values of the last round: nothing will change them any more.
    pub fn finish(&mut self) {
        while !self.is_over() {
            self.compare_row();
        }
    }

    fn compare_row(&mut self) {
        let (row, time_us) = (self.next, self.row_time_us(self.next));
        self.next += 1;
        if self.rounds == 0 || time_us < 0 {
            self.early += 1;
            return;
        }
        for column in &mut self.columns {
            if let (Some([theirs, _]), Some(value)) = (&mut column.curves, self.trace.cell(row, column.column).number())
            {
                theirs.add(time_us, value);
            }
        }
        self.compare(row, time_us);
    }

    /// Compares the values of a row with the program's.
    fn compare(&mut self, row: usize, time_us: i64) {
        for (column, ours) in self.columns.iter_mut().zip(&self.last) {
            let theirs = self.trace.cell(row, column.column);
            if theirs == Sample::Nothing {
                continue;
            }
            column.rows += 1;
            let deviation = theirs.deviation(*ours);
            if deviation == 0.0 {
                continue;
            }
            let apart = || Apart {
                line: self.trace.lines[row],
                trace_us: time_us.saturating_sub(self.terms.offset_us),
                time_us,
                values: [theirs, *ours],
                deviation,
                round: self.rounds,
            };
            if column.largest.as_ref().is_none_or(|largest| deviation > largest.deviation) {
                column.largest = Some(apart());
            }
            if deviation > column.tolerance.limit(theirs.number().unwrap_or(0.0)) {
                column.beyond += 1;
                if column.first.is_none() {
                    column.first = Some(apart());
                }
            }
        }
    }

    /// A value of a column, in words.
    #[must_use]
    pub fn text(&self, column: &Compared, value: Sample) -> String {
        text(value, &self.texts, &self.trace.columns[column.column].domain)
    }
}

/// Runs the program along a trace, up to `rounds` rounds, until `enough` rows are compared.
///
/// # Errors
/// The engines differ.
pub fn run(
    lockstep: &mut Lockstep<'_>,
    comparer: &mut Comparer,
    rounds: u64,
    enough: usize,
) -> Result<End, Box<Difference>> {
    if let Some(fault) = lockstep.start()? {
        return Ok(End::Trapped(fault));
    }
    let mut run = 0;
    while !comparer.is_over() && comparer.next < enough {
        if run >= rounds {
            return Ok(End::TooLong);
        }
        run += 1;
        match lockstep.round()? {
            Progress::Trapped(fault) => {
                // Rows before the round that trapped have the values of the round before.
                let time_us = i64::try_from(fault.time.as_us()).unwrap_or(i64::MAX);
                while !comparer.is_over() && comparer.row_time_us(comparer.next) < time_us {
                    comparer.compare_row();
                }
                return Ok(End::Trapped(fault));
            }
            Progress::Ran { round, wake } => {
                comparer.round_ended(i64::try_from(round.time.as_us()).unwrap_or(i64::MAX), lockstep.image());
                if wake == Wake::Never {
                    break;
                }
            }
        }
    }
    if comparer.next < enough {
        comparer.finish();
    }
    Ok(End::Over)
}

/// For each compared column with a first difference the statement that wrote the variable last in that round, then the calls that led there: `lockstep`, which
/// has not started, runs once more up to the last of these rounds. Empty: no statement of the round wrote it, or it is not known.
#[must_use]
pub fn writers(lockstep: &mut Lockstep<'_>, comparer: &Comparer) -> Vec<Vec<DescribedPlace>> {
    let mut found = vec![Vec::new(); comparer.columns.len()];
    let mut rounds: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    for (position, column) in comparer.columns.iter().enumerate() {
        if let Some(first) = &column.first {
            rounds.entry(first.round).or_default().push(position);
        }
    }
    if !matches!(lockstep.start(), Ok(None)) {
        return found;
    }
    let mut run = 0;
    for (round, positions) in rounds.into_iter().take(MAX_REPEATED) {
        while run < round {
            run += 1;
            if !matches!(lockstep.round(), Ok(Progress::Ran { .. })) {
                return found;
            }
        }
        let variables: Vec<_> =
            positions.iter().map(|at| &comparer.trace.columns[comparer.columns[*at].column].variable).collect();
        for (position, places) in positions.iter().zip(lockstep.writers(&variables).unwrap_or_default()) {
            found[*position] = places;
        }
    }
    found
}
