//! How far a value may lie from the trace's.

use khz_bytecode::container::ElementaryType;
use khz_machine::variables::Domain;

use super::read::Column;
use super::sample::{is_number, is_time};

/// A deviation up to `absolute` + `relative` × |the trace's value| counts as equal.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tolerance {
    /// In the variable's unit: nanoseconds for times.
    pub absolute: f64,
    /// As a share of the trace's value.
    pub relative: f64,
}

impl Tolerance {
    /// Reads `ABS` or `ABS,REL`; ABS may be a duration such as T#5ms, which is told with it.
    ///
    /// # Errors
    /// What is wrong with it.
    fn parse(text: &str) -> Result<(Tolerance, bool), String> {
        let (absolute, relative) = text.split_once(',').unwrap_or((text, "0"));
        let wrong = |part: &str| {
            format!("`{part}` is no tolerance: a number that is not negative, or a duration such as T#5ms")
        };
        let number = |part: &str| {
            let number = part.trim().parse().ok();
            number.filter(|number: &f64| number.is_finite() && *number >= 0.0).ok_or_else(|| wrong(part))
        };
        let part = absolute.trim();
        let duration = khz_machine::semantics::parse_time(part.as_bytes()).filter(|(_, used)| *used == part.len());
        let absolute = match duration {
            Some((ns, _)) if ns < 0 => return Err(wrong(part)),
            Some((ns, _)) => ns as f64,
            None => number(part)?,
        };
        Ok((Tolerance { absolute, relative: number(relative)? }, duration.is_some()))
    }

    /// How far a value may lie from the trace's.
    #[must_use]
    pub fn limit(&self, theirs: f64) -> f64 {
        let share = if self.relative > 0.0 && theirs.is_finite() { self.relative * theirs.abs() } else { 0.0 };
        self.absolute + share
    }
}

/// The tolerances of a comparison.
#[derive(Debug, Clone, Default)]
pub struct Tolerances {
    default: Tolerance,
    named: Vec<Named>,
}

#[derive(Debug, Clone)]
struct Named {
    name: String,
    tolerance: Tolerance,
    /// It was given as a duration.
    duration: bool,
}

impl Tolerances {
    /// Reads `NAME=ABS[,REL]` for a column or variable, and `ABS[,REL]` for every other REAL and LREAL.
    ///
    /// # Errors
    /// What is wrong with one of them.
    pub fn parse(texts: &[String]) -> Result<Tolerances, String> {
        let mut all = Tolerances::default();
        for text in texts {
            let (name, tolerance) =
                text.rsplit_once('=').map_or((None, text.as_str()), |(name, rest)| (Some(name), rest));
            let (tolerance, duration) = Tolerance::parse(tolerance)?;
            match name {
                Some(name) => all.named.push(Named { name: name.trim().to_string(), tolerance, duration }),
                None if duration => return Err(format!("`{text}` is a duration, but counts for REAL and LREAL")),
                None => all.default = tolerance,
            }
        }
        Ok(all)
    }

    /// Holds each named tolerance against the columns of a trace and their types.
    ///
    /// # Errors
    /// The first one that is for no column, or can not count for the type of its variable.
    pub fn check(&self, columns: &[Column]) -> Result<(), String> {
        for Named { name, duration, .. } in &self.named {
            let mut meant = columns.iter().filter(|column| column.is_named(name)).peekable();
            if meant.peek().is_none() {
                return Err(format!("no column of the trace is `{name}`"));
            }
            for column in meant {
                if !is_number(&column.domain) {
                    return Err(format!("`{name}` is no number and no time: it is compared exactly"));
                }
                if *duration && !is_time(&column.domain) {
                    return Err(format!("`{name}` is no time: its tolerance is a number"));
                }
            }
        }
        Ok(())
    }

    /// That of a column with this name, for this variable; the last one given counts.
    #[must_use]
    pub fn of(&self, column: &str, variable: &str, domain: &Domain) -> Tolerance {
        let is_meant = |name: &str| name.eq_ignore_ascii_case(column) || name.eq_ignore_ascii_case(variable);
        let named = self.named.iter().rev().find(|named| is_meant(&named.name)).map(|named| named.tolerance);
        let is_real = matches!(domain, Domain::Elementary(ElementaryType::Real | ElementaryType::Lreal));
        named.unwrap_or(if is_real { self.default } else { Tolerance::default() })
    }
}
