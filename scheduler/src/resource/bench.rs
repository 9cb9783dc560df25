//! Measuring a task's cycle alone.

use khz_machine::engine::Fuel;

use super::core::Core;
use super::cycle::Cycle;
use crate::clock::monotonic_now_ns;
use crate::report::{FaultPlace, FaultReport};
use crate::task::{TaskIndex, Trigger};
use crate::time::DurationNs;

impl Core {
    /// See [`super::Resource::bench_batch`]. A task that does not exist takes no time.
    pub(super) fn bench_batch(&mut self, task: TaskIndex, cycles: u64) -> Result<u64, Box<FaultReport>> {
        if task.index() >= self.tasks.len() {
            return Ok(0);
        }
        let step = match self.tasks.state(task).trigger {
            Trigger::Cyclic { interval, .. } => interval,
            Trigger::Event | Trigger::Freewheeling => DurationNs::MILLISECOND,
        };
        let limit = self.watches[task.index()].limit;
        let begin_ns = monotonic_now_ns();
        // Armed once for all cycles of the batch in value, but stored and taken back in each of them, as in a real cycle. Without a watchdog, or
        // with one that is fuel, the deadline never comes.
        let deadline_ns = match self.clock.monotonic_ns(self.clock.now()) {
            Some(_) if limit.0 != 0 => begin_ns.saturating_add(limit.times(cycles).0),
            _ => u64::MAX,
        };
        let fueled = limit.0 != 0 && self.clock.monotonic_ns(self.time).is_none();
        for _ in 0..cycles {
            self.time = self.time.after(step);
            self.write_up_times(self.time);
            let mut fuel = Fuel { left: limit.0 };
            let cycle = Cycle {
                engine: &mut *self.engine,
                image: &mut self.image,
                guard: &self.guard,
                instances: self.tasks.instances(task),
                task,
                deadline_ns: Some(deadline_ns),
                fuel: if fueled { Some(&mut fuel) } else { None },
            };
            let (time, rounds) = (self.time, self.rounds);
            let report = |place, trap| Box::new(FaultReport { place, trap, time, rounds });
            cycle.run().map_err(|at| report(FaultPlace::Task { task, instance: at.instance }, at.trap))?;
        }
        Ok(monotonic_now_ns().saturating_sub(begin_ns))
    }
}
