//! Where a trace begins in the program's time: the constant that makes them most alike, found by a bounded search.
//!
//! The program runs once along the trace, its first row laid on time 0. Each change of a compared column in the program and each change of that column in the trace
//! vote for the distance between them; the distances with most votes, and no distance at all, are then tried: the whole comparison, over the first rows,
//! on one engine. The fewest rows apart win, then the smallest sum of deviations, then the smallest distance from the first row.

use std::collections::BTreeMap;
use std::sync::Arc;

use khz_machine::variables::VariableTable;
use khz_scheduler::InputSource;

use super::compare::{Comparer, Terms, run};
use super::drive::Drive;
use super::read::Trace;
use super::sample::{Sample, sample};
use crate::lockstep::{Lockstep, Progress};

/// A distance from the first guess is no larger, in microseconds.
pub const MAX_SHIFT_US: i64 = 10_000_000;
/// Distances that are tried.
pub const MAX_TRIES: usize = 32;
/// Rows and rounds of a try.
const MAX_ROWS: usize = 20_000;
const MAX_ROUNDS: u64 = 200_000;
/// Columns that vote, and changes of each.
const MAX_VOTING: usize = 32;
const MAX_CHANGES: usize = 64;

/// What a search came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Found {
    /// To be added to the trace's times, in microseconds.
    pub offset_us: i64,
    /// Distances that were tried.
    pub tries: usize,
    /// Values of the first rows that are beyond their tolerance there, and all of them.
    pub beyond: u64,
    /// Values that were compared in all.
    pub compared: u64,
}

/// Looks for the offset. `lockstep` has one engine, and is reset between tries.
#[must_use]
pub fn find(lockstep: &mut Lockstep<'_>, trace: &Arc<Trace>, names: &Arc<VariableTable>, terms: &Terms) -> Found {
    let first_us = trace.times_us.first().copied().unwrap_or(0);
    let guess_us = -first_us;
    let drive = Drive::new(trace, names, guess_us);
    let mut candidates = vec![guess_us];
    if first_us.abs() <= MAX_SHIFT_US {
        candidates.push(0);
    }
    let votes = votes(lockstep, trace, names, drive.as_ref(), guess_us);
    let mut ranked: Vec<(i64, u64)> = votes.into_iter().collect();
    ranked.sort_by_key(|(offset, votes)| (std::cmp::Reverse(*votes), (offset - guess_us).abs(), *offset));
    candidates.extend(ranked.into_iter().map(|(offset, _)| offset));
    let spans: Vec<f64> = (0..trace.columns.len()).map(|column| span(trace, column)).collect();
    let mut seen = std::collections::BTreeSet::new();
    candidates.retain(|offset| seen.insert(*offset));
    candidates.truncate(MAX_TRIES);
    let tried = candidates.iter().map(|offset| {
        let (beyond, compared, sum) = attempt(lockstep, trace, names, drive.as_ref(), terms, &spans, *offset);
        (beyond, sum, (offset - guess_us).abs(), *offset, compared)
    });
    let best = tried.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then((a.2, a.3).cmp(&(b.2, b.3))));
    let (beyond, _, _, offset_us, compared) = best.unwrap_or((0, 0.0, 0, guess_us, 0));
    Found { offset_us, tries: candidates.len(), beyond, compared }
}

fn restart(lockstep: &mut Lockstep<'_>, drive: Option<&Drive>, offset_us: i64) {
    lockstep.reset();
    if let Some(drive) = drive {
        lockstep.set_inputs(vec![Box::new(drive.moved(offset_us)) as Box<dyn InputSource>]);
    }
}

/// One try: values beyond the tolerance or not compared, all values, the sum of each column's largest deviation by its [`scale`].
fn attempt(
    lockstep: &mut Lockstep<'_>,
    trace: &Arc<Trace>,
    names: &Arc<VariableTable>,
    drive: Option<&Drive>,
    terms: &Terms,
    spans: &[f64],
    offset_us: i64,
) -> (u64, u64, f64) {
    restart(lockstep, drive, offset_us);
    let terms = Terms { offset_us, curves: false, ..terms.clone() };
    let mut comparer = Comparer::new(trace, names, terms);
    // One engine has nothing to differ from.
    let _ = run(lockstep, &mut comparer, MAX_ROUNDS, MAX_ROWS.min(trace.len()));
    let columns = comparer.columns();
    let rows: u64 = columns.iter().map(|column| column.rows).sum();
    let beyond: u64 = columns.iter().map(|column| column.beyond).sum();
    let (early, _) = comparer.not_compared();
    let reached = trace.len().min(MAX_ROWS) as u64;
    let wanted = reached * columns.len() as u64;
    let missing = if rows == 0 { wanted } else { early * columns.len() as u64 };
    let largest = columns.iter().filter_map(|column| {
        let apart = column.largest.as_ref().filter(|apart| apart.deviation.is_finite())?;
        let limit = column.tolerance.limit(apart.values[0].number().unwrap_or(0.0));
        Some(apart.deviation / scale(limit, spans[column.column]))
    });
    (beyond + missing, rows, largest.sum())
}

/// What a deviation is measured by, so that nanoseconds do not outweigh a REAL: the tolerance where there is one, or how far the trace's values reach.
fn scale(limit: f64, span: f64) -> f64 {
    match (limit > 0.0, span > 0.0 && span.is_finite()) {
        (true, _) => limit,
        (false, true) => span,
        (false, false) => 1.0,
    }
}

/// How far the values of a column reach, over the rows that are tried.
fn span(trace: &Trace, column: usize) -> f64 {
    let numbers = (0..trace.len().min(MAX_ROWS)).filter_map(|row| trace.cell(row, column).number());
    let ends = numbers.filter(|number| number.is_finite()).map(|number| (number, number));
    ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).map_or(0.0, |(least, greatest)| greatest - least)
}

/// Distances between changes of the program and changes of the trace, each with how many pairs have it.
fn votes(
    lockstep: &mut Lockstep<'_>,
    trace: &Arc<Trace>,
    names: &Arc<VariableTable>,
    drive: Option<&Drive>,
    guess_us: i64,
) -> BTreeMap<i64, u64> {
    let voting: Vec<usize> =
        (0..trace.columns.len()).filter(|column| !trace.columns[*column].drives).take(MAX_VOTING).collect();
    let ours = changes_of_program(lockstep, trace, names, drive, guess_us, &voting);
    let mut votes = BTreeMap::new();
    for (column, ours) in voting.into_iter().zip(ours) {
        let mut theirs = Vec::new();
        for row in 1..trace.len().min(MAX_ROWS) {
            let (before, after) = (trace.cell(row - 1, column), trace.cell(row, column));
            if before != Sample::Nothing && before != after && theirs.len() < MAX_CHANGES {
                theirs.push((trace.times_us[row], after));
            }
        }
        for (time_us, value) in &ours {
            for (trace_us, wanted) in &theirs {
                let offset = time_us - trace_us;
                if (offset - guess_us).abs() <= MAX_SHIFT_US {
                    // A change to the same value says more.
                    *votes.entry(offset).or_insert(0) += if value == wanted { 4 } else { 1 };
                }
            }
        }
    }
    votes
}

/// Times at which the program changes each column, with the new values.
fn changes_of_program(
    lockstep: &mut Lockstep<'_>,
    trace: &Trace,
    names: &VariableTable,
    drive: Option<&Drive>,
    guess_us: i64,
    voting: &[usize],
) -> Vec<Vec<(i64, Sample)>> {
    let mut changes: Vec<Vec<(i64, Sample)>> = vec![Vec::new(); voting.len()];
    let mut last: Vec<Option<Sample>> = vec![None; voting.len()];
    let mut texts = trace.texts.clone();
    let end_us = trace.times_us.get(trace.len().min(MAX_ROWS) - 1).map_or(0, |time| time.saturating_add(guess_us));
    restart(lockstep, drive, guess_us);
    if !matches!(lockstep.start(), Ok(None)) {
        return changes;
    }
    for _ in 0..MAX_ROUNDS {
        let Ok(Progress::Ran { round, wake }) = lockstep.round() else { break };
        let time_us = i64::try_from(round.time.as_us()).unwrap_or(i64::MAX);
        for ((column, last), changes) in voting.iter().zip(&mut last).zip(&mut changes) {
            let now = sample(names, &mut texts, lockstep.image(), &trace.columns[*column].variable);
            if last.replace(now).is_some_and(|before| before != now) && changes.len() < MAX_CHANGES {
                changes.push((time_us, now));
            }
        }
        if time_us > end_us.saturating_add(MAX_SHIFT_US) || wake == khz_scheduler::Wake::Never {
            break;
        }
    }
    changes
}

#[cfg(test)]
mod tests {
    use super::scale;

    #[test]
    fn a_deviation_counts_by_its_tolerance_or_by_what_the_trace_spans() {
        // 1 ms of a time that runs over 1 s is less than half the span of a REAL.
        let (time, real) = (1e6 / scale(0.0, 1e9), 0.5 / scale(0.0, 1.0));
        assert!(time < real);
        assert!((scale(2e6, 1e9) - 2e6).abs() < 1e-9 && (scale(0.0, 0.0) - 1.0).abs() < 1e-9);
    }
}
