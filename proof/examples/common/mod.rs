//! What the searches of the examples share: their arguments, a line of progress, and how long it took.
#![allow(dead_code, reason = "each example uses its part")]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program for people")]

use std::ops::{Range, RangeInclusive};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use khz_proof::arguments::{Grammar, Line};
use khz_proof::campaign::{Campaign, Figures, Report};
use khz_proof::watch::Watch;

/// Any number that an option may have.
pub const ANY: RangeInclusive<u64> = 0..=u64::MAX;
/// Seconds after which an item of a search is named: most take milliseconds.
pub const LATE_S: u64 = 10;

/// What an example knows beside `FIRST_SEED COUNT [--threads N] [--findings N]`.
#[derive(Default)]
pub struct Known<'k> {
    pub options: &'k [(&'k str, RangeInclusive<u64>)],
    pub words: &'k [&'k str],
    pub folders: bool,
}

/// `FIRST_SEED COUNT [--threads N] [--OPTION N]… [WORD]…`
pub struct Arguments {
    pub first: u64,
    pub count: u64,
    pub threads: usize,
    /// The findings after which a search ends.
    pub most_findings: usize,
    line: Line,
}

impl Arguments {
    /// Reads the command line. Ends the process with status 2 and the usage when a word means nothing.
    pub fn read(default_count: u64, known: &Known<'_>) -> Arguments {
        let mut options = vec![("threads", 1..=1024), ("findings", 1..=u64::MAX)];
        options.extend_from_slice(known.options);
        let grammar = Grammar {
            numbers: &["FIRST_SEED", "COUNT"],
            options: &options,
            words: known.words,
            folders: known.folders,
        };
        let read = grammar.read(std::env::args().skip(1)).and_then(|line| {
            let first = line.numbers.first().copied().unwrap_or(0);
            let count = line.numbers.get(1).copied().unwrap_or(default_count);
            let most = |name: &str, usual| line.options.get(name).copied().unwrap_or(usual) as usize;
            first.checked_add(count).ok_or_else(|| format!("{count} seeds from {first} on are beyond 64 bits"))?;
            Ok(Arguments { first, count, threads: most("threads", 2), most_findings: most("findings", 20), line })
        });
        read.unwrap_or_else(|wrong| refuse(&grammar, &wrong))
    }

    /// The number of an option.
    pub fn option(&self, name: &str, default: u64) -> u64 {
        self.line.options.get(name).copied().unwrap_or(default)
    }

    /// Whether a word was given.
    pub fn has(&self, word: &str) -> bool {
        self.line.words.iter().any(|known| known == word)
    }

    /// Whether a word was given, or none at all.
    pub fn wants(&self, word: &str) -> bool {
        self.line.words.is_empty() || self.has(word)
    }

    /// The folders that were given.
    pub fn folders(&self) -> &[PathBuf] {
        &self.line.folders
    }

    /// Looks at all seeds, shows how far it is on standard error and how long it took on standard output.
    pub fn search<F: Figures>(&self, check: impl Fn(u64, &mut F) -> Option<String> + Sync) -> Report<F> {
        self.search_batches(1, "seeds", |seeds: Range<u64>, figures: &mut F| check(seeds.start, figures))
    }

    /// As [`Arguments::search`], some seeds at a time; `what` are they in words. A finding has the first seed of its batch.
    pub fn search_batches<F: Figures>(
        &self,
        batch: u64,
        what: &str,
        check: impl Fn(Range<u64>, &mut F) -> Option<String> + Sync,
    ) -> Report<F> {
        let count = self.count.div_ceil(batch);
        let campaign = Campaign { first: 0, count, threads: self.threads, most_findings: self.most_findings };
        let end_of = |batches: u64| self.first + batches.saturating_mul(batch).min(self.count);
        // Only named: what is made small may take its time.
        let late = |seed| eprintln!("what begins with seed {seed} has run for {LATE_S} s");
        let watch = Watch::new(LATE_S, Duration::from_secs(1), late);
        let check = |number: u64, figures: &mut F| {
            let seeds = end_of(number)..end_of(number + 1);
            watch.over(seeds.start, || check(seeds, figures))
        };
        #[expect(clippy::disallowed_methods, reason = "only what people are shown, never a result")]
        let start = Instant::now();
        let mut shown_s = 0;
        let report = campaign.run(check, |progress| {
            let elapsed_s = start.elapsed().as_secs();
            if elapsed_s >= shown_s + 5 {
                shown_s = elapsed_s;
                let done = end_of(progress.done) - self.first;
                eprintln!("{done} of {} {what}, {} findings, {elapsed_s} s", self.count, progress.findings);
            }
        });
        let mut report = report.unwrap_or_else(|error| {
            eprintln!("no thread can be had: {error}");
            std::process::exit(1)
        });
        report.findings.iter_mut().for_each(|finding| finding.seed = end_of(finding.seed));
        let elapsed_s = start.elapsed().as_secs_f64();
        let end = end_of(report.done);
        println!(
            "{what} {} to {} on {} threads: {elapsed_s:.1} s, {:.0} {what} a second, {} findings",
            self.first,
            end.saturating_sub(1),
            self.threads,
            (end - self.first) as f64 / elapsed_s.max(1e-9),
            report.findings.len()
        );
        report
    }
}

/// How every example ends: with status 5 when it found anything.
pub fn finish(findings: usize) -> ExitCode {
    ExitCode::from(if findings == 0 { 0 } else { 5 })
}

/// Says what is wrong with a command line, and what it may be, and ends the process.
pub fn refuse(grammar: &Grammar<'_>, wrong: &str) -> ! {
    eprintln!("{wrong}\n{}", grammar.usage());
    std::process::exit(2)
}
