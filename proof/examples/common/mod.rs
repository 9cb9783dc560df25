//! What the searches of the examples share: their arguments, a line of progress, and how long it took.
#![allow(dead_code, reason = "each example uses its part")]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program for people")]

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Instant;

use khz_proof::campaign::{Campaign, Figures, Report};

/// `FIRST_SEED COUNT [--threads N] [--OPTION N]… [WORD]…`
pub struct Arguments {
    pub first: u64,
    pub count: u64,
    pub threads: usize,
    /// The findings after which a search ends.
    pub most_findings: usize,
    options: BTreeMap<String, u64>,
    /// What is neither a number nor an option.
    pub words: Vec<String>,
}

impl Arguments {
    /// Reads the command line; `options` are the names of numbers that the example knows beside `--threads` and `--findings`. Ends the
    /// process with the usage when it can not be understood.
    pub fn read(default_count: u64, options: &[&str]) -> Arguments {
        let mut read = Arguments {
            first: 0,
            count: default_count,
            threads: 2,
            most_findings: 20,
            options: BTreeMap::new(),
            words: Vec::new(),
        };
        let mut numbers = Vec::new();
        let mut arguments = std::env::args().skip(1);
        while let Some(word) = arguments.next() {
            let Some(name) = word.strip_prefix("--") else {
                match word.parse() {
                    Ok(number) => numbers.push(number),
                    Err(_) => read.words.push(word),
                }
                continue;
            };
            let value = arguments.next().and_then(|value| value.parse::<u64>().ok());
            match (name, value) {
                ("threads", Some(value)) => read.threads = value as usize,
                ("findings", Some(value)) => read.most_findings = value as usize,
                (_, Some(value)) if options.contains(&name) => _ = read.options.insert(name.to_string(), value),
                _ => usage(options),
            }
        }
        match numbers[..] {
            [] => {}
            [first] => read.first = first,
            [first, count] => (read.first, read.count) = (first, count),
            _ => usage(options),
        }
        read
    }

    /// The number of an option.
    pub fn option(&self, name: &str, default: u64) -> u64 {
        self.options.get(name).copied().unwrap_or(default)
    }

    /// Whether a word was given, or none at all.
    pub fn wants(&self, word: &str) -> bool {
        self.words.is_empty() || self.words.iter().any(|known| known == word)
    }

    /// Looks at all seeds, shows how far it is on standard error and how long it took on standard output.
    pub fn search<F: Figures>(&self, check: impl Fn(u64, &mut F) -> Option<String> + Sync) -> Report<F> {
        let campaign =
            Campaign { first: self.first, count: self.count, threads: self.threads, most_findings: self.most_findings };
        #[expect(clippy::disallowed_methods, reason = "only what people are shown, never a result")]
        let start = Instant::now();
        let mut shown_s = 0;
        let report = campaign.run(check, |progress| {
            let elapsed_s = start.elapsed().as_secs();
            if elapsed_s >= shown_s + 5 {
                shown_s = elapsed_s;
                eprintln!(
                    "{} of {} seeds, {} findings, {elapsed_s} s",
                    progress.done, progress.count, progress.findings
                );
            }
        });
        let elapsed_s = start.elapsed().as_secs_f64();
        let last = self.first.saturating_add(report.done).saturating_sub(1);
        println!(
            "seeds {} to {last} on {} threads: {elapsed_s:.1} s, {:.0} seeds a second, {} findings",
            self.first,
            self.threads.max(1),
            report.done as f64 / elapsed_s.max(1e-9),
            report.findings.len()
        );
        report
    }
}

/// How every example ends: with status 5 when it found anything.
pub fn finish(findings: usize) -> ExitCode {
    ExitCode::from(if findings == 0 { 0 } else { 5 })
}

fn usage(options: &[&str]) -> ! {
    let options: String = options.iter().map(|name| format!(" [--{name} N]")).collect();
    eprintln!("arguments: FIRST_SEED COUNT [--threads N] [--findings N]{options} [WORD]...");
    std::process::exit(2)
}
