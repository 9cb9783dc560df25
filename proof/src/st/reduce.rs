//! From a difference to the smallest program and rounds that still differ, and what people are told about it.

use std::fmt::{self, Display};

use super::case::{Case, Round, inputs_text};
use super::compare::Difference;
use super::flow::roots;
use super::print::print;
use super::shrink::shrink_case;
use crate::traces::Traces;

/// Says how a text differs over some rounds, if it does: [`Bench::compare`](super::compare::Bench::compare), or what its user has.
pub type Compare<'c> = dyn Fn(&str, &[Round]) -> Option<Difference> + 'c;

/// Most variables that a report shows.
pub const MOST_VARIABLES: usize = 10;

/// The smallest program found that still differs. Its text is the report.
#[derive(Debug, Clone)]
pub struct Report {
    /// The program and its rounds.
    pub case: Case,
    /// The program as Structured Text.
    pub text: String,
    /// The difference of the small program.
    pub difference: Difference,
    /// The traces of the variables that matter.
    pub traces: Traces,
    /// Programs that were tried.
    pub tries: usize,
    /// Lines of the program before and after.
    pub lines: (usize, usize),
}

/// Looks for a difference of a case and makes it small: the same engines and the same sort of difference stay. At most `tries`
/// programs are tried.
pub fn reduce(case: &Case, compare: &Compare<'_>, tries: usize) -> Option<Report> {
    let before = print(&case.source);
    let first = compare(&before, &case.rounds)?;
    let mut start = case.clone();
    // What happens behind the difference can not matter.
    start.rounds.truncate(first.round + 1);
    let shows = |case: &Case| {
        let found = compare(&print(&case.source), &case.rounds);
        found.is_some_and(|found| found.is_like(&first))
    };
    let (small, used) = shrink_case(&start, &shows, tries);
    let text = print(&small.source);
    let difference = compare(&text, &small.rounds).unwrap_or(first);
    let roots = roots(&small.source, difference.variable.as_deref());
    // Of a variable whose instance has another name than its program nothing is known: then every variable may matter.
    let matters = |path: &str| roots.is_empty() || roots.iter().any(|root| is_below(path, root));
    let traces = difference.traces.only(&matters, MOST_VARIABLES);
    let lines = (before.lines().count(), text.lines().count());
    Some(Report { case: small, text, difference, traces, tries: used, lines })
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Difference { left, right, round, description, statement, .. } = &self.difference;
        writeln!(f, "{left} and {right} differ in round {round}: {description}")?;
        if let Some(statement) = statement {
            writeln!(f, "made by {statement}")?;
        }
        let (before, after) = self.lines;
        writeln!(f, "the smallest program found ({before} lines became {after}, {} programs tried):\n", self.tries)?;
        writeln!(f, "{}", self.text)?;
        writeln!(f, "{}", inputs_text(&self.case.rounds))?;
        write!(f, "{}", self.traces)
    }
}

/// Whether a path is a variable or a part of it.
fn is_below(path: &str, root: &str) -> bool {
    path.strip_prefix(root).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}
