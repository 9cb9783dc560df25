//! Timing scans in batches.

use khz_scheduler::{Faulted, Resource, Running};

/// A batch lasts at least this long, in nanoseconds, so that reading the clock does not count.
const BATCH_NS: u64 = 100_000;
/// Batches between two looks at the median.
const BATCHES_A_LOOK: usize = 100;
/// Looks before a median may count as stable, and after which it is taken as it is.
const LOOKS: std::ops::RangeInclusive<usize> = 3..=40;
/// The median is stable when a look moves it by less than this share.
const STABLE_SHARE: f64 = 0.002;
/// Fewest batches of a run with a given number of scans.
const MIN_BATCHES: u64 = 25;

/// Times of a scan over all batches, in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distribution {
    /// Fastest batch.
    pub min: f64,
    /// Half of the batches were faster.
    pub median: f64,
    /// 99 in 100 batches were faster.
    pub p99: f64,
    /// 999 in 1000 batches were faster.
    pub p999: f64,
    /// Slowest batch.
    pub max: f64,
    /// Average of the batches.
    pub mean: f64,
}

/// What was measured of one engine.
#[derive(Debug, Clone)]
pub struct Measured {
    /// Scans in all batches.
    pub scans: u64,
    /// Their times.
    pub distribution: Distribution,
    /// Nanoseconds a scan of each batch, in the order of time.
    pub batches: Vec<f64>,
}

/// Measures a running resource: a scan is one cycle of each of its tasks.
pub fn measure(resource: Resource<Running>, scans: Option<u64>) -> Result<Measured, Resource<Faulted>> {
    let mut state = State { resource: Some(resource), batches: Vec::new() };
    let mut per_batch = 1_u64;
    // Also warms the caches up. The faster of two batches counts, so that one hiccup of the host does not end it early.
    while state.batch(per_batch)?.min(state.batch(per_batch)?) < BATCH_NS && per_batch < 1 << 40 {
        per_batch *= 2;
    }
    state.batches.clear();
    let count = scans.map(|scans| (scans / per_batch).max(MIN_BATCHES));
    let mut median = f64::NAN;
    for look in 1.. {
        for _ in 0..count.map_or(BATCHES_A_LOOK as u64, |count| count.min(1 << 20)) {
            state.batch(per_batch)?;
        }
        let now = distribution(&state.batches).median;
        let stable = (now - median).abs() <= now * STABLE_SHARE;
        if count.is_some() || (stable && look >= *LOOKS.start()) || look >= *LOOKS.end() {
            break;
        }
        median = now;
    }
    Ok(Measured {
        scans: per_batch * state.batches.len() as u64,
        distribution: distribution(&state.batches),
        batches: state.batches,
    })
}

struct State {
    /// `None` only while a batch runs.
    resource: Option<Resource<Running>>,
    batches: Vec<f64>,
}

impl State {
    /// Runs one batch of every task; gives its nanoseconds.
    fn batch(&mut self, scans: u64) -> Result<u64, Resource<Faulted>> {
        let Some(mut resource) = self.resource.take() else { return Ok(0) };
        let mut total_ns = 0;
        let tasks: u16 = u16::try_from(resource.tasks().len()).unwrap_or(u16::MAX);
        for task in 0..tasks {
            let (next, ns) = resource.bench_batch(khz_scheduler::TaskIndex(task), scans)?;
            resource = next;
            total_ns += ns;
        }
        self.resource = Some(resource);
        self.batches.push(total_ns as f64 / scans as f64);
        Ok(total_ns)
    }
}

/// Percentiles by nearest rank.
fn distribution(batches: &[f64]) -> Distribution {
    let mut sorted = batches.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = |share: f64| {
        sorted.get(((sorted.len() as f64 * share).ceil() as usize).saturating_sub(1)).copied().unwrap_or_default()
    };
    let mean = sorted.iter().sum::<f64>() / sorted.len().max(1) as f64;
    Distribution { min: rank(0.0), median: rank(0.5), p99: rank(0.99), p999: rank(0.999), max: rank(1.0), mean }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_by_nearest_rank() {
        let batches: Vec<f64> = (1..=1000).rev().map(f64::from).collect();
        let d = distribution(&batches);
        assert_eq!((d.min, d.median, d.p99, d.p999, d.max, d.mean), (1.0, 500.0, 990.0, 999.0, 1000.0, 500.5));
    }
}
