//! Statistics of tasks: counted in every cycle, without allocating.

use std::fmt::Write as _;

use hdrhistogram::Histogram;

use crate::clock::ClockKind;
use crate::task::{TaskIndex, TaskInfo, TaskState, Trigger};
use crate::time::{DurationNs, TimeNs};

/// Longest time that a histogram tells apart, in nanoseconds: one minute. Longer ones count as this.
const HISTOGRAM_MAX_NS: u64 = 60_000_000_000;
/// Significant decimal digits of a histogram: 1 % of each value.
const HISTOGRAM_DIGITS: u8 = 2;
/// So many tasks, the first ones, have histograms (about 60 KB each); a container's size must not multiply into memory.
const TASKS_WITH_HISTOGRAMS: usize = 256;

/// One measured quantity, in nanoseconds.
#[derive(Debug, Clone)]
pub struct Measure {
    count: u64,
    last: u64,
    min: u64,
    max: u64,
    sum: u128,
    histogram: Option<Histogram<u64>>,
}

impl Measure {
    fn new(with_histogram: bool) -> Self {
        let histogram = if with_histogram {
            // Fixed bounds: no value makes it grow. These constants are inside what the crate accepts, a test holds it.
            Histogram::new_with_bounds(1, HISTOGRAM_MAX_NS, HISTOGRAM_DIGITS).ok()
        } else {
            None
        };
        Measure { count: 0, last: 0, min: u64::MAX, max: 0, sum: 0, histogram }
    }

    fn record(&mut self, duration: DurationNs) {
        let ns = duration.0;
        self.count += 1;
        self.last = ns;
        self.min = self.min.min(ns);
        self.max = self.max.max(ns);
        self.sum += u128::from(ns);
        if let Some(histogram) = &mut self.histogram {
            histogram.saturating_record(ns);
        }
    }

    fn clear(&mut self) {
        let histogram = self.histogram.take().map(|mut histogram| {
            histogram.clear();
            histogram
        });
        *self = Measure { histogram, ..Measure::new(false) };
    }

    fn summary(&self) -> Option<Summary> {
        if self.count == 0 {
            return None;
        }
        let quantile =
            |q| self.histogram.as_ref().map(|histogram| histogram.value_at_quantile(q).clamp(self.min, self.max));
        Some(Summary {
            count: self.count,
            last: self.last,
            min: self.min,
            // An average of u64 values is one.
            average: (self.sum / u128::from(self.count)) as u64,
            max: self.max,
            median: quantile(0.5),
            p99: quantile(0.99),
            p999: quantile(0.999),
        })
    }
}

/// Figures of a measured quantity, in nanoseconds; exact but for the quantiles (1 %).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// How many values.
    pub count: u64,
    /// The latest.
    pub last: u64,
    /// The least.
    pub min: u64,
    /// The mean.
    pub average: u64,
    /// The greatest.
    pub max: u64,
    /// Half of the values are at most this. `None`: no histogram is kept for this task.
    pub median: Option<u64>,
    /// 99 % are at most this.
    pub p99: Option<u64>,
    /// 99.9 % are at most this.
    pub p999: Option<u64>,
}

/// What is counted of one task.
#[derive(Debug, Clone)]
pub struct TaskStatistics {
    scans: u64,
    overruns: u64,
    lost_cycles: u64,
    execution: Measure,
    jitter: Measure,
}

impl TaskStatistics {
    /// Nothing counted yet, for the task at this position.
    #[must_use]
    pub fn new(task: TaskIndex) -> Self {
        let with_histogram = task.index() < TASKS_WITH_HISTOGRAMS;
        TaskStatistics {
            scans: 0,
            overruns: 0,
            lost_cycles: 0,
            execution: Measure::new(with_histogram),
            jitter: Measure::new(with_histogram),
        }
    }

    /// Grid points that nothing ran for.
    pub fn lose(&mut self, cycles: u64) {
        self.lost_cycles = self.lost_cycles.saturating_add(cycles);
    }

    /// A cycle started at `start` that was due at `due`: its own lateness, not one since the resource's start.
    pub fn started(&mut self, start: TimeNs, due: TimeNs) {
        self.jitter.record(start.since(due));
    }

    /// A cycle ended.
    pub fn ended(&mut self, execution: DurationNs, overrun: bool) {
        self.scans += 1;
        self.overruns += u64::from(overrun);
        self.execution.record(execution);
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.scans = 0;
        self.overruns = 0;
        self.lost_cycles = 0;
        self.execution.clear();
        self.jitter.clear();
    }

    /// The figures as they are now.
    #[must_use]
    pub fn report(&self, task: TaskIndex, state: &TaskState, info: &TaskInfo) -> TaskReport {
        TaskReport {
            task,
            id: info.id,
            priority: state.priority.0,
            trigger: state.trigger,
            watchdog: info.watchdog,
            enabled: state.enabled,
            scans: self.scans,
            overruns: self.overruns,
            lost_cycles: self.lost_cycles,
            execution: self.execution.summary(),
            jitter: self.jitter.summary(),
        }
    }
}

/// Figures of one task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskReport {
    /// Its position.
    pub task: TaskIndex,
    /// Its id in the task table.
    pub id: u16,
    /// Its priority.
    pub priority: u16,
    /// What makes it due.
    pub trigger: Trigger,
    /// Its watchdog time as the container says; zero: none of its own.
    pub watchdog: DurationNs,
    /// Whether it runs at all.
    pub enabled: bool,
    /// Cycles that ended without a trap.
    pub scans: u64,
    /// Cycles that ran past the next due time.
    pub overruns: u64,
    /// Grid points that nothing ran for.
    pub lost_cycles: u64,
    /// Execution time in nanoseconds; `None` before the first cycle.
    pub execution: Option<Summary>,
    /// Actual start after the due time in nanoseconds (event task: after the round that saw the edge). `None`: nothing was due by a time.
    pub jitter: Option<Summary>,
}

/// Figures of a resource.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StatisticsReport {
    /// Which time.
    pub clock: ClockKind,
    /// Name of the engine.
    pub engine: &'static str,
    /// Time of the last round.
    pub time: TimeNs,
    /// Rounds that ended.
    pub rounds: u64,
    /// Those of them in which a task ran.
    pub rounds_with_tasks: u64,
    /// Each task, in declaration order.
    pub tasks: Vec<TaskReport>,
}

impl StatisticsReport {
    /// As one JSON object. `names` are the tasks' names by position, where they are known.
    #[must_use]
    pub fn to_json(&self, names: &[String]) -> String {
        let mut out = String::new();
        // Writing to a String does not fail.
        let _ = write!(
            out,
            "{{\"clock\":\"{}\",\"engine\":\"{}\",\"time_us\":{},\"rounds\":{},\"rounds_with_tasks\":{},\"tasks\":[",
            self.clock.name(),
            self.engine,
            self.time.as_us(),
            self.rounds,
            self.rounds_with_tasks
        );
        for (position, task) in self.tasks.iter().enumerate() {
            if position > 0 {
                out.push(',');
            }
            write_task(&mut out, task, names.get(position).map(String::as_str));
        }
        out.push_str("]}");
        out
    }
}

fn write_task(out: &mut String, task: &TaskReport, name: Option<&str>) {
    let (kind, interval) = match task.trigger {
        Trigger::Cyclic { interval, .. } => ("cyclic", interval),
        Trigger::Event => ("event", DurationNs(0)),
        Trigger::Freewheeling => ("freewheeling", DurationNs(0)),
    };
    out.push_str("{\"name\":");
    write_string(out, name);
    let _ = write!(
        out,
        ",\"id\":{},\"type\":\"{kind}\",\"priority\":{},\"interval_us\":{},\"watchdog_us\":{},\"enabled\":{},\
         \"scans\":{},\"overruns\":{},\"lost_cycles\":{},\"execution_ns\":",
        task.id,
        task.priority,
        interval.0 / 1000,
        task.watchdog.0 / 1000,
        task.enabled,
        task.scans,
        task.overruns,
        task.lost_cycles
    );
    write_summary(out, task.execution);
    out.push_str(",\"start_jitter_ns\":");
    write_summary(out, task.jitter);
    out.push('}');
}

fn write_summary(out: &mut String, summary: Option<Summary>) {
    let Some(summary) = summary else {
        out.push_str("null");
        return;
    };
    let figures = [
        ("count", Some(summary.count)),
        ("last", Some(summary.last)),
        ("min", Some(summary.min)),
        ("average", Some(summary.average)),
        ("max", Some(summary.max)),
        ("median", summary.median),
        ("p99", summary.p99),
        ("p999", summary.p999),
    ];
    for (position, (name, value)) in figures.into_iter().enumerate() {
        out.push(if position == 0 { '{' } else { ',' });
        let _ = match value {
            Some(value) => write!(out, "\"{name}\":{value}"),
            None => write!(out, "\"{name}\":null"),
        };
    }
    out.push('}');
}

fn write_string(out: &mut String, text: Option<&str>) {
    let Some(text) = text else {
        out.push_str("null");
        return;
    };
    out.push('"');
    for character in text.chars() {
        match character {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            control if u32::from(control) < 0x20 => {
                let _ = write!(out, "\\u{:04x}", u32::from(control));
            }
            other => out.push(other),
        }
    }
    out.push('"');
}

#[cfg(test)]
mod tests {
    use khz_bytecode::container::{OverrunPolicy, SingleSource};

    use super::*;
    use crate::task::Priority;

    fn report(statistics: &TaskStatistics) -> TaskReport {
        let trigger = Trigger::Cyclic { interval: DurationNs(5000), gated: false, policy: OverrunPolicy::Grid };
        let state =
            TaskState { trigger, priority: Priority(3), enabled: true, next_due: TimeNs::ZERO, single_previous: false };
        let info = TaskInfo {
            id: 9,
            phase: TimeNs::ZERO,
            single: SingleSource::None,
            watchdog: DurationNs(0),
            watchdog_sensitivity: 1,
        };
        statistics.report(TaskIndex(0), &state, &info)
    }

    #[test]
    fn figures_are_exact_and_quantiles_close() {
        let mut statistics = TaskStatistics::new(TaskIndex(0));
        for ns in 1..=1000u64 {
            statistics.started(TimeNs(ns * 7 + 3), TimeNs(ns * 7));
            statistics.ended(DurationNs(ns * 100), ns % 10 == 0);
        }
        statistics.lose(4);
        let report = report(&statistics);
        assert_eq!((report.scans, report.overruns, report.lost_cycles), (1000, 100, 4));
        let execution = report.execution.unwrap();
        assert_eq!((execution.last, execution.min, execution.average, execution.max), (100_000, 100, 50_050, 100_000));
        let near = |value: Option<u64>, expected: u64| value.unwrap().abs_diff(expected) * 100 <= expected;
        assert!(near(execution.median, 50_000) && near(execution.p99, 99_000), "{execution:?}");
        let jitter = report.jitter.unwrap();
        assert_eq!((jitter.min, jitter.max, jitter.average), (3, 3, 3), "lateness of each cycle, not since the start");
    }

    #[test]
    fn extreme_values_saturate() {
        let mut statistics = TaskStatistics::new(TaskIndex(0));
        statistics.ended(DurationNs(0), false);
        statistics.ended(DurationNs(u64::MAX), true);
        statistics.lose(u64::MAX);
        statistics.lose(1);
        let report = report(&statistics);
        assert_eq!(report.lost_cycles, u64::MAX);
        let execution = report.execution.unwrap();
        assert_eq!((execution.min, execution.max, execution.average), (0, u64::MAX, u64::MAX / 2));
        statistics.clear();
        assert_eq!(super::tests::report(&statistics).execution, None);
        statistics.ended(DurationNs(5), false);
        assert_eq!(super::tests::report(&statistics).execution.unwrap().median, Some(5), "the histogram stays");
    }

    #[test]
    fn many_tasks_do_not_multiply_memory() {
        let statistics = TaskStatistics::new(TaskIndex(TASKS_WITH_HISTOGRAMS as u16));
        assert!(statistics.execution.histogram.is_none());
    }

    #[test]
    fn json_is_whole() {
        let mut statistics = TaskStatistics::new(TaskIndex(0));
        statistics.ended(DurationNs(5), false);
        let report = StatisticsReport {
            clock: ClockKind::Virtual,
            engine: "mock",
            time: TimeNs(12_000),
            rounds: 2,
            rounds_with_tasks: 1,
            tasks: vec![report(&statistics)],
        };
        assert_eq!(
            report.to_json(&["a\"\\\n".to_owned()]),
            "{\"clock\":\"virtual\",\"engine\":\"mock\",\"time_us\":12,\"rounds\":2,\"rounds_with_tasks\":1,\"tasks\":[\
             {\"name\":\"a\\\"\\\\\\u000a\",\"id\":9,\"type\":\"cyclic\",\"priority\":3,\"interval_us\":5,\"watchdog_us\":0,\
             \"enabled\":true,\"scans\":1,\"overruns\":0,\"lost_cycles\":0,\
             \"execution_ns\":{\"count\":1,\"last\":5,\"min\":5,\"average\":5,\"max\":5,\"median\":5,\"p99\":5,\"p999\":5},\
             \"start_jitter_ns\":null}]}"
        );
    }
}
