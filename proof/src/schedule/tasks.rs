//! The rules of one task: its grid, its edges, what is counted of it, its watchdog.

use super::plan::{Plan, Policy, Task, Trigger};
use super::trace::{Figures, TaskFigures};

const NS_PER_US: u64 = 1000;

/// A task as it changes.
#[derive(Debug, Clone)]
pub struct TaskModel {
    task: Task,
    /// The first grid point that was neither served nor lost, in nanoseconds.
    point: u64,
    /// What its SINGLE was at the last sampling.
    previous: bool,
    /// What its SINGLE is in this round.
    sample: bool,
    /// Watchdog time in nanoseconds; 0: none.
    watchdog: u64,
    /// Consecutive cycles over it.
    late: u64,
    scans: u64,
    overruns: u64,
    lost: u64,
    executions: Vec<u64>,
    jitters: Vec<u64>,
}

impl TaskModel {
    /// A task before the first round.
    pub fn new(plan: &Plan, task: Task) -> Self {
        let watchdog = if task.watchdog_us == 0 { plan.watchdog_us } else { task.watchdog_us } * NS_PER_US;
        let (executions, jitters) = (Vec::new(), Vec::new());
        let mut model = TaskModel {
            task,
            point: 0,
            previous: false,
            sample: false,
            watchdog,
            late: 0,
            scans: 0,
            overruns: 0,
            lost: 0,
            executions,
            jitters,
        };
        model.reset();
        model
    }

    /// Back to before the first round; the statistics stay.
    pub fn reset(&mut self) {
        self.point = match self.task.trigger {
            Trigger::Cyclic { phase_us, .. } => phase_us * NS_PER_US,
            Trigger::Event(_) | Trigger::Freewheeling => 0,
        };
        self.previous = false;
        self.sample = false;
        self.late = 0;
    }

    /// Forgets the statistics.
    pub fn clear_statistics(&mut self) {
        (self.scans, self.overruns, self.lost) = (0, 0, 0);
        self.executions.clear();
        self.jitters.clear();
    }

    /// Its SINGLE is sampled in a round at `now`. Returns whether the task is due.
    pub fn sample(&mut self, now: u64, single: bool) -> bool {
        self.previous = self.sample;
        self.sample = single;
        let due = match self.task.trigger {
            Trigger::Freewheeling => true,
            Trigger::Event(_) => single && !self.previous,
            Trigger::Cyclic { single: Some(_), .. } if single => false,
            Trigger::Cyclic { interval_us, single: gate, .. } => {
                // When it falls, the next grid point is due; those passed meanwhile are nobody's.
                while gate.is_some() && self.previous && self.point < now {
                    self.point += interval_us * NS_PER_US;
                }
                self.point <= now
            }
        };
        due && self.task.enabled
    }

    /// A due task is collected in a round at `now`, and starts at `start`.
    pub fn collect(&mut self, now: u64, start: u64) {
        match self.task.trigger {
            Trigger::Freewheeling => {}
            Trigger::Event(_) => self.jitters.push(start - now),
            Trigger::Cyclic { interval_us, .. } => {
                self.jitters.push(start - self.point);
                // The oldest point is served, the later ones up to now are lost.
                self.point += interval_us * NS_PER_US;
                while self.point <= now {
                    self.point += interval_us * NS_PER_US;
                    self.lost += 1;
                }
            }
        }
    }

    /// Whether its watchdog trips after a cycle that took `used` nanoseconds (or units of fuel).
    pub fn trips(&mut self, used: u64) -> bool {
        if self.watchdog == 0 {
            return false;
        }
        self.late = if used > self.watchdog { self.late + 1 } else { 0 };
        self.late >= self.sensitivity() || used > self.watchdog * self.sensitivity()
    }

    /// What one cycle may take; none: as long as it likes.
    pub fn limit(&self) -> Option<u64> {
        (self.watchdog != 0).then(|| self.watchdog * self.sensitivity())
    }

    fn sensitivity(&self) -> u64 {
        u64::from(self.task.sensitivity.max(1))
    }

    /// A cycle from `start` to `end` is over.
    pub fn complete(&mut self, start: u64, end: u64) {
        self.scans += 1;
        self.executions.push(end - start);
        let Trigger::Cyclic { interval_us, policy, .. } = self.task.trigger else { return };
        if end <= self.point {
            return;
        }
        self.overruns += 1;
        let interval = interval_us * NS_PER_US;
        match policy {
            // What it passed is counted when it is collected.
            Policy::AtOnce => {}
            Policy::Grid | Policy::Realign => {
                while self.point <= end {
                    self.point += interval;
                    self.lost += 1;
                }
                if policy == Policy::Realign {
                    self.point = end + interval;
                }
            }
        }
    }

    /// Whether a rise of its SINGLE, which is `single` after the round, would start it in the next round.
    pub fn edge_is_pending(&self, single: bool) -> bool {
        matches!(self.task.trigger, Trigger::Event(_)) && self.task.enabled && single && !self.sample
    }

    /// When it is due next after a round at `now`, if that is known; its SINGLE is `single` after the round.
    pub fn next_due(&self, now: u64, single: bool) -> Option<u64> {
        let Trigger::Cyclic { interval_us, single: gate, .. } = self.task.trigger else { return None };
        if !self.task.enabled || (gate.is_some() && single) {
            return None;
        }
        let mut point = self.point;
        // It fell in this round: the next round sees that, and is later than this one.
        while gate.is_some() && self.sample && point <= now {
            point += interval_us * NS_PER_US;
        }
        Some(point)
    }

    /// Whether it runs in every round.
    pub fn wheels(&self) -> bool {
        self.task.enabled && self.task.trigger == Trigger::Freewheeling
    }

    /// What was counted.
    pub fn figures(&self) -> TaskFigures {
        TaskFigures {
            scans: self.scans,
            overruns: self.overruns,
            lost_cycles: self.lost,
            execution: figures(&self.executions),
            jitter: figures(&self.jitters),
        }
    }
}

fn figures(values: &[u64]) -> Option<Figures> {
    Some(Figures {
        count: values.len() as u64,
        last: *values.last()?,
        min: *values.iter().min()?,
        average: values.iter().sum::<u64>() / values.len() as u64,
        max: *values.iter().max()?,
    })
}
