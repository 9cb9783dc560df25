//! How far a value may lie from the trace's.

use khz_bytecode::container::ElementaryType;
use khz_machine::variables::Domain;

/// A deviation up to `absolute` + `relative` × |the trace's value| counts as equal.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tolerance {
    /// In the variable's unit: nanoseconds for times.
    pub absolute: f64,
    /// As a share of the trace's value.
    pub relative: f64,
}

impl Tolerance {
    /// Reads `ABS` or `ABS,REL`; ABS may be a duration such as T#5ms.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Tolerance, String> {
        let (absolute, relative) = text.split_once(',').unwrap_or((text, "0"));
        let number = |part: &str| {
            let part = part.trim();
            let duration = khz_machine::semantics::parse_time(part.as_bytes()).filter(|(_, used)| *used == part.len());
            let number = duration.map(|(ns, _)| ns as f64).or_else(|| part.parse().ok());
            number.filter(|number: &f64| number.is_finite() && *number >= 0.0).ok_or_else(|| {
                format!("`{part}` is no tolerance: a number that is not negative, or a duration such as T#5ms")
            })
        };
        Ok(Tolerance { absolute: number(absolute)?, relative: number(relative)? })
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
    named: Vec<(String, Tolerance)>,
}

impl Tolerances {
    /// Reads `NAME=ABS[,REL]` for a column or variable, and `ABS[,REL]` for every other REAL and LREAL.
    ///
    /// # Errors
    /// What is wrong with one of them.
    pub fn parse(texts: &[String]) -> Result<Tolerances, String> {
        let mut all = Tolerances::default();
        for text in texts {
            match text.rsplit_once('=') {
                Some((name, tolerance)) => all.named.push((name.trim().to_string(), Tolerance::parse(tolerance)?)),
                None => all.default = Tolerance::parse(text)?,
            }
        }
        Ok(all)
    }

    /// That of a column with this name, for this variable; the last one given counts.
    #[must_use]
    pub fn of(&self, column: &str, variable: &str, domain: &Domain) -> Tolerance {
        let is_meant = |name: &str| name.eq_ignore_ascii_case(column) || name.eq_ignore_ascii_case(variable);
        let named = self.named.iter().rev().find(|(name, _)| is_meant(name)).map(|(_, tolerance)| *tolerance);
        let is_real = matches!(domain, Domain::Elementary(ElementaryType::Real | ElementaryType::Lreal));
        named.unwrap_or(if is_real { self.default } else { Tolerance::default() })
    }

    /// Names that a tolerance is given for.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.named.iter().map(|(name, _)| name.as_str())
    }
}
