//! A round (architecture §8): clock, inputs, up-time, SINGLE sources, selection, tasks, outputs.

use khz_machine::engine::Fuel;

use super::core::Core;
use super::cycle::{Cycle, InstanceTrap, late_trap};
use crate::clock::ClockKind;
use crate::grid;
use crate::hooks::Hooks;
use crate::report::{FaultPlace, FaultReport};
use crate::select;
use crate::task::{TaskIndex, Trigger};
use crate::time::{DurationNs, TimeNs};
use crate::wake::{self, Wake};

/// A round that ended without a trap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Round {
    /// When it began.
    pub time: TimeNs,
    /// How many tasks it ran.
    pub tasks: usize,
}

impl Core {
    pub(super) fn run_round(&mut self, hooks: &mut Hooks<'_>) -> Result<Round, Box<FaultReport>> {
        let time = self.clock.now();
        self.time = time;
        self.freeze_inputs(time, hooks);
        self.write_up_times(time);
        self.singles.sample(&self.image, &mut self.samples);
        select::select(&self.tasks, time, &self.samples, &mut self.ready);
        for task in self.singles.tasks() {
            let sample = self.samples.get(task.index()).copied().unwrap_or(false);
            select::note_sample(self.tasks.state_mut(task), time, sample);
        }
        // The end of one cycle is the start of the next; without a task there is nothing to time.
        let mut start = if self.ready.is_empty() { time } else { self.clock.now() };
        for position in 0..self.ready.len() {
            let task = self.ready[position];
            start = self.run_task(task, time, start).map_err(|InstanceTrap { instance, trap }| {
                let place = FaultPlace::Task { task, instance };
                Box::new(FaultReport { place, trap, time, rounds: self.rounds })
            })?;
        }
        let outputs = self.image.layout().output.clone();
        if !outputs.is_empty() {
            hooks.io.write_outputs(&self.image.bytes()[outputs.start as usize..outputs.end as usize]);
        }
        self.rounds += 1;
        self.rounds_with_tasks += u64::from(!self.ready.is_empty());
        hooks.observer.round_ended(&self.image, time, &self.ready);
        Ok(Round { time, tasks: self.ready.len() })
    }

    /// Driver buffer to %I snapshot, then the rows that hold by now.
    fn freeze_inputs(&mut self, time: TimeNs, hooks: &mut Hooks<'_>) {
        let inputs = self.image.layout().input.clone();
        if !inputs.is_empty() {
            hooks.io.read_inputs(&mut self.image.bytes_mut()[inputs.start as usize..inputs.end as usize]);
        }
        let now_us = time.as_us();
        if hooks.inputs.next_change_us().is_some_and(|change_us| change_us <= now_us) {
            hooks.inputs.apply(now_us, &mut self.image);
        }
    }

    /// Runs a cycle of a task that was selected in the round at `round`. Returns its end.
    fn run_task(&mut self, task: TaskIndex, round: TimeNs, start: TimeNs) -> Result<TimeNs, InstanceTrap> {
        let collected = select::collect(self.tasks.state_mut(task), round);
        let statistics = &mut self.statistics[task.index()];
        statistics.lose(collected.lost_cycles);
        if let Some(due) = collected.due {
            statistics.started(start, due);
        }
        let watch = &mut self.watches[task.index()];
        let limited = watch.limit.0 != 0;
        let deadline_ns = if limited { self.clock.monotonic_ns(start.after(watch.limit)) } else { None };
        let mut fuel = Fuel { left: watch.limit.0 };
        let fueled = limited && deadline_ns.is_none();
        let instances = self.tasks.instances(task);
        let cycle = Cycle {
            engine: &mut *self.engine,
            image: &mut self.image,
            guard: &self.guard,
            instances,
            task,
            deadline_ns,
            fuel: if fueled { Some(&mut fuel) } else { None },
        };
        let expired = cycle.run()?;
        let end = self.clock.now();
        let execution = end.since(start);
        let used = if fueled { DurationNs(watch.limit.0.saturating_sub(fuel.left)) } else { execution };
        if limited && (watch.trips_after(used) || expired) {
            if let Some(trap) = late_trap(self.program.container(), instances) {
                return Err(trap);
            }
            // No instance, so nothing ran late: the host took the processor away.
            self.guard.clear();
        }
        let mut overrun = false;
        let state = self.tasks.state_mut(task);
        if let Trigger::Cyclic { interval, policy, .. } = state.trigger {
            let step = grid::complete(state.next_due, interval, end, policy);
            state.next_due = step.next_due;
            statistics.lose(step.lost_cycles);
            overrun = step.overrun;
        }
        statistics.ended(execution, overrun);
        Ok(end)
    }

    /// When the next round can have something to do.
    pub(super) fn next_wake(&mut self, hooks: &mut Hooks<'_>) -> Wake {
        self.singles.sample(&self.image, &mut self.samples_after);
        let row = hooks.inputs.next_change_us().map_or(TimeNs::NEVER, TimeNs::from_us);
        // Inputs that change by themselves are looked at in rounds: often enough where a task waits for one.
        let poll = match self.clock.kind() {
            ClockKind::Real if self.singles.reads_inputs() => hooks.io.input_poll(),
            _ => None,
        };
        let external = row.min(poll.map_or(TimeNs::NEVER, |poll| self.time.after(poll)));
        wake::next_wake(&self.tasks, self.time, &self.samples_after, external)
    }

    pub(super) fn wait(&mut self, wake: Wake) {
        self.clock.wait(wake, self.guard.stop());
    }
}
