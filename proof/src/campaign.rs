//! A search over many seeds on several threads, with one answer whatever their number.
//!
//! The seeds are cut into chunks of a fixed size. Threads take chunks in order and count into figures of the chunk's own; finished chunks are put
//! together in the order of their seeds, so that figures, findings and the place where a search ends depend on the seeds alone. A panic
//! while a seed is looked at is a finding like any other. No clock is read here: who wants to know how long it takes looks at his own.

use std::collections::BTreeMap;
use std::io;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

use khz_bytecode::canary::carried;

use crate::panics::caught;

/// Seeds that are looked at as one piece of work.
const CHUNK: u64 = 32;

/// Stack of a worker, in bytes: native code may need 6 MiB, and shrinkers and generators of trees recurse.
const STACK_BYTES: usize = 32 << 20;

/// Most threads of a search.
pub const MOST_THREADS: usize = 1024;

/// What a search counts. Figures of two ranges of seeds, put together, are the figures of both.
pub trait Figures: Default + Send {
    /// Adds the figures of the seeds that follow.
    fn merge(&mut self, later: Self);
}

impl Figures for () {
    fn merge(&mut self, (): ()) {}
}

impl<A: Figures, B: Figures> Figures for (A, B) {
    fn merge(&mut self, later: Self) {
        self.0.merge(later.0);
        self.1.merge(later.1);
    }
}

/// Which seeds to look at, and how.
#[derive(Debug, Clone, Copy)]
pub struct Campaign {
    /// The first seed.
    pub first: u64,
    /// How many seeds follow each other from there.
    pub count: u64,
    /// How many threads look at most (at least one does).
    pub threads: usize,
    /// The search ends with the chunk in which it has this many findings (at least one).
    pub most_findings: usize,
}

/// A seed that shows something.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The seed.
    pub seed: u64,
    /// What it shows, for people.
    pub description: String,
}

/// How far a search is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Seeds that were looked at, from the first on without a gap.
    pub done: u64,
    /// Seeds in all.
    pub count: u64,
    /// Seeds among those done that show something.
    pub findings: usize,
}

/// What a search brought.
#[derive(Debug)]
pub struct Report<F> {
    /// Seeds that were looked at: fewer than the campaign's only when it ended early.
    pub done: u64,
    /// What was found, by seed; no more than the campaign wants.
    pub findings: Vec<Finding>,
    /// What was counted.
    pub figures: F,
}

impl Campaign {
    /// Looks at every seed with `check`, which counts and says what it found, and tells `progress` after each chunk. There are no more threads than
    /// pieces of work, nor than [`MOST_THREADS`]; fewer when the machine has no more to spare.
    ///
    /// # Errors
    /// When there is not even one.
    pub fn run<F: Figures>(
        &self,
        check: impl Fn(u64, &mut F) -> Option<String> + Sync,
        progress: impl FnMut(Progress) + Send,
    ) -> io::Result<Report<F>> {
        let next = AtomicU64::new(0);
        let report = Report { done: 0, findings: Vec::new(), figures: F::default() };
        let collector = Mutex::new(Collector {
            campaign: *self,
            due: 0,
            early: BTreeMap::new(),
            report,
            progress,
            has_ended: false,
        });
        let work = || {
            while !lock(&collector).has_ended {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let Some(seeds) = self.chunk(number) else { break };
                let chunk = look_at(seeds, &check);
                lock(&collector).take(number, chunk);
            }
        };
        thread::scope(|scope| {
            for number in 0..self.workers() {
                let worker = thread::Builder::new().stack_size(STACK_BYTES);
                match worker.spawn_scoped(scope, carried(work)) {
                    Ok(_) => {}
                    Err(error) if number == 0 => return Err(error),
                    // The answer does not depend on how many there are.
                    Err(_) => break,
                }
            }
            Ok(())
        })?;
        Ok(collector.into_inner().unwrap_or_else(PoisonError::into_inner).report)
    }

    /// How many threads look: at least one, and none without a piece of work.
    fn workers(&self) -> usize {
        let chunks = usize::try_from(self.count.div_ceil(CHUNK)).unwrap_or(usize::MAX);
        self.threads.min(chunks).clamp(1, MOST_THREADS)
    }

    /// Seeds of a chunk; none beyond the last.
    fn chunk(&self, number: u64) -> Option<Range<u64>> {
        let start = number.checked_mul(CHUNK).filter(|start| *start < self.count)?;
        let end = (start + CHUNK).min(self.count);
        Some(self.first.saturating_add(start)..self.first.saturating_add(end))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Only the caller's own closure for progress panics under the lock, and that panic comes out where the threads are joined.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What one chunk brought.
struct Chunk<F> {
    seeds: u64,
    findings: Vec<Finding>,
    figures: F,
}

/// Puts chunks together in order.
struct Collector<F, P> {
    campaign: Campaign,
    /// The chunk that comes next.
    due: u64,
    /// Chunks that were ready before one that comes before them.
    early: BTreeMap<u64, Chunk<F>>,
    report: Report<F>,
    progress: P,
    has_ended: bool,
}

impl<F: Figures, P: FnMut(Progress)> Collector<F, P> {
    fn take(&mut self, number: u64, chunk: Chunk<F>) {
        self.early.insert(number, chunk);
        while !self.has_ended
            && let Some(chunk) = self.early.remove(&self.due)
        {
            self.due += 1;
            let report = &mut self.report;
            report.done += chunk.seeds;
            report.findings.extend(chunk.findings);
            report.figures.merge(chunk.figures);
            let findings = report.findings.len();
            (self.progress)(Progress { done: report.done, count: self.campaign.count, findings });
            let most = self.campaign.most_findings.max(1);
            self.has_ended = findings >= most;
            report.findings.truncate(most);
        }
    }
}

fn look_at<F: Figures>(seeds: Range<u64>, check: &impl Fn(u64, &mut F) -> Option<String>) -> Chunk<F> {
    let mut chunk = Chunk { seeds: seeds.end - seeds.start, findings: Vec::new(), figures: F::default() };
    for seed in seeds {
        // Figures that a panic left half counted are still figures of that seed: nobody relies on more.
        let description = caught(|| check(seed, &mut chunk.figures)).unwrap_or_else(Some);
        chunk.findings.extend(description.map(|description| Finding { seed, description }));
    }
    chunk
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every seed in the order in which it was merged.
    #[derive(Default)]
    struct Seen(Vec<u64>);

    impl Figures for Seen {
        fn merge(&mut self, later: Self) {
            self.0.extend(later.0);
        }
    }

    fn search(threads: usize, most_findings: usize, progress: impl FnMut(Progress) + Send) -> Report<(Seen, Seen)> {
        let check = |seed: u64, (all, odd): &mut (Seen, Seen)| {
            all.0.push(seed);
            if seed % 2 == 1 {
                odd.0.push(seed);
            }
            // The first chunk is the slowest, so that others are ready before it.
            (0..if seed < 1020 { 20_000 } else { 10 }).for_each(|number| _ = std::hint::black_box(number));
            assert!(seed != 1100, "seed {seed} is not liked");
            seed.is_multiple_of(70).then(|| format!("{seed} is round"))
        };
        Campaign { first: 1000, count: 1000, threads, most_findings }.run(check, progress).expect("a thread")
    }

    #[test]
    fn the_answer_does_not_depend_on_the_number_of_threads() {
        for threads in [0, 1, 2, 7] {
            let mut shown = Vec::new();
            let report = search(threads, usize::MAX, |progress| shown.push(progress));
            assert_eq!(report.figures.0.0, (1000..2000).collect::<Vec<u64>>());
            assert!(report.figures.1.0.iter().all(|seed| seed % 2 == 1) && report.figures.1.0.len() == 500);
            let seeds: Vec<u64> = report.findings.iter().map(|finding| finding.seed).collect();
            let mut wanted: Vec<u64> =
                (1000_u64..2000).filter(|seed| seed.is_multiple_of(70) || *seed == 1100).collect();
            wanted.sort_unstable();
            assert_eq!(seeds, wanted);
            assert!(report.findings[1].description.ends_with("seed 1100 is not liked"), "{:?}", report.findings);
            assert!(shown.is_sorted_by_key(|progress| progress.done));
            assert_eq!(shown.last(), Some(&Progress { done: 1000, count: 1000, findings: wanted.len() }));
        }
    }

    #[test]
    fn there_are_no_more_threads_than_work() {
        let workers = |threads, count| Campaign { first: 0, count, threads, most_findings: 1 }.workers();
        assert_eq!([workers(0, 1000), workers(7, 1000), workers(7, 65), workers(7, 0)], [1, 7, 3, 1]);
        assert_eq!(workers(usize::MAX, u64::MAX), MOST_THREADS);
        // As many as the machine gives, or else this is where it would end.
        let report = search(usize::MAX, usize::MAX, |_| ());
        assert_eq!(report.figures.0.0.len(), 1000);
    }

    #[test]
    fn a_search_ends_with_the_chunk_that_brings_enough() {
        for threads in [1, 3] {
            let report = search(threads, 3, |_| ());
            let seeds: Vec<u64> = report.findings.iter().map(|finding| finding.seed).collect();
            assert_eq!(seeds, [1050, 1100, 1120]);
            assert_eq!((report.done, report.figures.0.0.len()), (128, 128), "four chunks of 32");
        }
    }

    #[test]
    fn no_seeds_are_no_work_and_the_last_seed_is_the_end() {
        let run = |first, count| {
            let campaign = Campaign { first, count, threads: 2, most_findings: 1 };
            let check = |seed, seen: &mut Seen| {
                seen.0.push(seed);
                None
            };
            campaign.run(check, |_| ()).expect("a thread")
        };
        assert_eq!((run(5, 0).done, run(5, 0).figures.0.len()), (0, 0));
        assert_eq!(run(u64::MAX - 2, 100).figures.0, [u64::MAX - 2, u64::MAX - 1]);
    }
}
