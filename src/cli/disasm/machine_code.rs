//! Machine code as text, under the source lines that it comes from; with the cost of each line where that was counted.

use std::collections::BTreeMap;
use std::fmt::Write;

use khz_frontend::source::SourceMap;
use khz_jit::listing::{Row, Unit};

/// Lines that the table of hot lines names: until they make up so much of all, and at most so many.
const TABLE_SHARE: f64 = 0.95;
const TABLE_LINES: usize = 20;
/// The share of all that one `#` behind a line stands for.
const MARK_SHARE: f64 = 0.05;

/// What was executed of each source line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Costs {
    /// Rounds that were run.
    pub rounds: u64,
    /// Machine instructions of all lines.
    pub total: u64,
    /// Machine instructions by file and line, the most expensive first.
    pub lines: Vec<((String, u32), u64)>,
}

impl Costs {
    /// The sums over all instructions. Code without a source line counts as line 0 of its unit.
    pub fn new(units: &[Unit], rounds: u64) -> Costs {
        let mut sums: BTreeMap<(String, u32), u64> = BTreeMap::new();
        for unit in units {
            for row in unit.rows.iter().filter(|row| row.executions.is_some_and(|count| count > 0)) {
                *sums.entry(line_of(unit, row)).or_default() += row.executions.unwrap_or_default();
            }
        }
        let total = sums.values().sum();
        let mut lines: Vec<_> = sums.into_iter().collect();
        lines.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        Costs { rounds, total, lines }
    }

    /// What part of all a number of instructions is.
    pub fn share(&self, instructions: u64) -> f64 {
        instructions as f64 / self.total.max(1) as f64
    }
}

/// All units one below the other.
pub fn text(units: &[Unit], sources: &SourceMap, costs: Option<&Costs>) -> String {
    let sources: BTreeMap<&str, _> = sources.files().map(|(_, file)| (file.name(), file)).collect();
    let source = |(file, line): &(String, u32)| match sources.get(file.as_str()) {
        Some(source) => format!("  {}", source.shown_line(*line).trim()),
        None => String::new(),
    };
    let mut out = String::new();
    // Writing to a String does not fail, here and below.
    if let Some(costs) = costs {
        let each = costs.total as f64 / costs.rounds.max(1) as f64;
        let _ = writeln!(
            out,
            "; {} machine instructions were run in {} rounds, {each:.1} a round; the routines that they call are not counted",
            costs.total, costs.rounds
        );
        let mut seen = 0;
        for (line, count) in costs.lines.iter().take(TABLE_LINES) {
            if costs.share(seen) >= TABLE_SHARE {
                break;
            }
            seen += count;
            let a_round = *count as f64 / costs.rounds.max(1) as f64;
            let share = costs.share(*count) * 100.0;
            let _ = writeln!(out, "; {share:5.1} % {a_round:12.1} a round  {}{}", place(line), source(line));
        }
        out.push('\n');
    }
    for unit in units {
        let _ = writeln!(out, "; {}: {} bytes", unit.name, unit.code.len());
        let mut last = None;
        for row in &unit.rows {
            let line = line_of(unit, row);
            if last.as_ref() != Some(&line) {
                let _ = writeln!(out, "; {}{}{}", place(&line), source(&line), mark(&line, costs));
                last = Some(line);
            }
            let executions = match (costs, row.executions) {
                (None, _) => String::new(),
                (_, None) => format!("{:14}", ""),
                (_, Some(count)) => format!("{count:14}"),
            };
            let callee = row.callee.as_ref().map(|callee| format!("  ; {callee}")).unwrap_or_default();
            let _ = writeln!(out, "{executions}  {:#06x}  {}{callee}", row.offset, row.text);
        }
        out.push('\n');
    }
    out
}

/// The file and line of a row; line 0 of its unit where it has none.
fn line_of(unit: &Unit, row: &Row) -> (String, u32) {
    row.source.clone().unwrap_or_else(|| (unit.name.clone(), 0))
}

/// A line for people.
fn place((file, line): &(String, u32)) -> String {
    if *line == 0 { format!("{file}, no line: ways in and out") } else { format!("{file}:{line}") }
}

/// What stands behind a source line: its share of all, and one `#` for each 5 %.
fn mark(line: &(String, u32), costs: Option<&Costs>) -> String {
    let Some(costs) = costs else { return String::new() };
    let count = costs.lines.iter().find(|(other, _)| other == line).map_or(0, |(_, count)| *count);
    let share = costs.share(count);
    format!("  ; {:.1} % {}", share * 100.0, "#".repeat((share / MARK_SHARE) as usize)).trim_end().to_owned()
}
