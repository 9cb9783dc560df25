//! What `khz check` does to one source, and figures of many.
#![allow(dead_code, reason = "each user takes its part")]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};

use khz_frontend::diagnostics::render::{Style, render};
use khz_frontend::{CompileOptions, SourceInput};
use khz_proof::mutate::source::Mutant;

/// Checks a source and renders all that is said about it. The codes, or what a panic said.
pub fn check(bytes: &[u8]) -> Result<BTreeSet<&'static str>, String> {
    let source = SourceInput { name: "mutant.st".into(), bytes: bytes.to_vec() };
    let result = catch_unwind(AssertUnwindSafe(|| {
        let checked = khz_frontend::check(&[source], &CompileOptions::default());
        let mut length = 0;
        for diagnostic in &checked.diagnostics {
            length += render(diagnostic, &checked.sources, Style { colour: false }).len();
        }
        std::hint::black_box(length);
        checked.diagnostics.iter().map(khz_frontend::diagnostics::Diagnostic::code).collect()
    }));
    result.map_err(|panic| {
        let words = panic.downcast_ref::<String>().cloned();
        let words = words.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string));
        format!("panic: {}", words.unwrap_or_default())
    })
}

/// How many sources were looked at, and what was said about them.
#[derive(Debug, Default, Clone)]
pub struct Checked {
    /// All.
    pub total: u64,
    /// Those about which there was something to say.
    pub with_diagnostics: u64,
    /// Sources by code.
    pub codes: BTreeMap<&'static str, u64>,
    /// Sources by what was done to them.
    kinds: BTreeMap<&'static str, u64>,
}

impl Checked {
    /// Counts a source and its codes.
    pub fn count(&mut self, mutant: &Mutant, codes: &BTreeSet<&'static str>) {
        self.total += 1;
        self.with_diagnostics += u64::from(!codes.is_empty());
        for code in codes {
            *self.codes.entry(code).or_default() += 1;
        }
        let mut kinds = mutant.kinds.clone();
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            *self.kinds.entry(kind).or_default() += 1;
        }
    }

    /// Adds what another counted.
    pub fn add(&mut self, other: &Checked) {
        self.total += other.total;
        self.with_diagnostics += other.with_diagnostics;
        for (code, count) in &other.codes {
            *self.codes.entry(code).or_default() += count;
        }
        for (kind, count) in &other.kinds {
            *self.kinds.entry(kind).or_default() += count;
        }
    }

    /// The figures, for people.
    pub fn report(&self) -> String {
        let share = self.with_diagnostics as f64 * 100.0 / self.total.max(1) as f64;
        let mut text = format!("{} sources, {share:.1}% with diagnostics, {} codes\n", self.total, self.codes.len());
        for (code, count) in &self.codes {
            // A String takes everything.
            let _ = write!(text, "{code} {count}, ");
        }
        let _ = writeln!(text, "\n{:?}", self.kinds);
        text
    }
}
