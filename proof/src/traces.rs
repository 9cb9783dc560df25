//! Two traces side by side: what two engines say of the same variables, round by round.
//!
//! A difference is understood by the values before it. [`Traces`] holds one row for each round and variable, in the order in which they
//! were watched, and its text marks the first cell that differs. It stays short: [`Traces::only`] leaves out what does not matter.

use std::fmt::{self, Display};

/// What two engines say of one variable after one round.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// Number of the round, from 0.
    pub round: usize,
    /// The variable's path, or [`ENDING`].
    pub name: String,
    /// Its value in the left engine, as an IEC literal.
    pub left: String,
    /// Its value in the right engine.
    pub right: String,
}

/// Name of the row that says how a round ended.
pub const ENDING: &str = "(end of the round)";

impl Row {
    /// Whether the engines say the same.
    #[must_use]
    pub fn is_equal(&self) -> bool {
        self.left == self.right
    }

    /// The variable without its parts: `main.a[1].b` is a part of `main.a`, `g[1]` of `g`.
    #[must_use]
    pub fn root(&self) -> &str {
        root_of(&self.name)
    }
}

/// The variable that a path leads into: a global, or `program.variable`.
fn root_of(path: &str) -> &str {
    let end = path.find('[').unwrap_or(path.len());
    let dots: Vec<usize> = path[..end].match_indices('.').map(|(at, _)| at).collect();
    dots.get(1).map_or(&path[..end], |second| &path[..*second])
}

/// The traces of two engines.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Traces {
    /// Name of the left engine.
    pub left: String,
    /// Name of the right engine.
    pub right: String,
    /// By round, then in the order of the dump.
    pub rows: Vec<Row>,
}

/// Longest value that is shown whole, in characters.
const LONGEST_VALUE: usize = 60;

impl Traces {
    /// Position of the first row in which the engines differ.
    #[must_use]
    pub fn first_difference(&self) -> Option<usize> {
        self.rows.iter().position(|row| !row.is_equal())
    }

    /// The rows of variables that matter: endings, what differs anywhere, and what `matters` says of a path, of which a part that
    /// never changes is left out, and all but the first `most`.
    #[must_use]
    pub fn only(&self, matters: &dyn Fn(&str) -> bool, most: usize) -> Traces {
        let differs = |name: &str| self.rows.iter().any(|row| row.name == name && !row.is_equal());
        let changes = |name: &str| {
            let mut values = self.rows.iter().filter(|row| row.name == name).map(|row| &row.left);
            let first = values.next();
            values.any(|value| Some(value) != first)
        };
        let is_part = |name: &str| root_of(name) != name;
        let names: Vec<&str> = match self.rows.first() {
            Some(first) => self.rows.iter().filter(|row| row.round == first.round).map(|row| &*row.name).collect(),
            None => Vec::new(),
        };
        let mut kept: Vec<&str> = names.iter().copied().filter(|name| *name == ENDING || differs(name)).collect();
        kept.truncate(most.max(1));
        let further = names
            .iter()
            .copied()
            .filter(|name| !differs(name) && *name != ENDING && matters(name) && (!is_part(name) || changes(name)));
        let room = most.saturating_sub(kept.len());
        kept.extend(further.take(room));
        let rows = self.rows.iter().filter(|row| kept.contains(&&*row.name)).cloned().collect();
        Traces { rows, ..self.clone() }
    }
}

fn cut(value: &str) -> String {
    if value.chars().count() <= LONGEST_VALUE {
        return value.to_string();
    }
    value.chars().take(LONGEST_VALUE - 1).chain(['…']).collect()
}

impl Display for Traces {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.rows.is_empty() {
            return Ok(());
        }
        let widest = |heading: &str, cells: &mut dyn Iterator<Item = &String>| {
            cells.map(|cell| cut(cell).chars().count()).chain([heading.chars().count()]).max().unwrap_or(0)
        };
        let name = widest("variable", &mut self.rows.iter().map(|row| &row.name));
        let left = widest(&self.left, &mut self.rows.iter().map(|row| &row.left));
        let right = widest(&self.right, &mut self.rows.iter().map(|row| &row.right));
        writeln!(f, "round  {:name$}  {:left$}  {}", "variable", self.left, self.right)?;
        let first = self.first_difference();
        for (at, row) in self.rows.iter().enumerate() {
            let mark = if first == Some(at) { "  <-- first difference" } else { "" };
            let (a, b) = (cut(&row.left), cut(&row.right));
            let line = format!("{:>5}  {:name$}  {a:left$}  {b:right$}{mark}", row.round, cut(&row.name));
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn traces() -> Traces {
        let row = |round, name: &str, left: &str, right: &str| Row {
            round,
            name: name.to_string(),
            left: left.to_string(),
            right: right.to_string(),
        };
        let rows = vec![
            row(0, "main.a", "1", "1"),
            row(0, "main.b[1]", "0", "0"),
            row(0, "main.b[2]", "0", "0"),
            row(0, "main.c", "7", "7"),
            row(1, "main.a", "255", "-1"),
            row(1, "main.b[1]", "0", "0"),
            row(1, "main.b[2]", "5", "5"),
            row(1, "main.c", "7", "7"),
        ];
        Traces { left: "interp".to_string(), right: "jit".to_string(), rows }
    }

    #[test]
    fn the_first_differing_cell_is_marked() {
        let text = traces().only(&|_| false, 8).to_string();
        assert_eq!(
            text,
            "round  variable  interp  jit\n    0  main.a    1       1\n    1  main.a    255     -1   <-- first difference\n"
        );
    }

    #[test]
    fn parts_that_never_change_are_left_out_and_the_number_is_bounded() {
        let names = |traces: &Traces| {
            let mut names: Vec<String> = traces.rows.iter().map(|row| row.name.clone()).collect();
            names.sort();
            names.dedup();
            names
        };
        assert_eq!(names(&traces().only(&|_| true, 8)), ["main.a", "main.b[2]", "main.c"]);
        assert_eq!(names(&traces().only(&|_| true, 2)), ["main.a", "main.b[2]"]);
        assert_eq!(names(&traces().only(&|path| root_of(path) == "main.c", 8)), ["main.a", "main.c"]);
        assert_eq!(["g", "g[1].x", "main.a.b", "main.a[1]"].map(root_of), ["g", "g", "main.a", "main.a"]);
    }

    #[test]
    fn a_long_value_is_cut() {
        let mut long = traces();
        long.rows[0].left = "x".repeat(500);
        assert!(long.to_string().lines().all(|line| line.chars().count() < 160));
    }
}
