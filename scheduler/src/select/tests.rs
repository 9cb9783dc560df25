//! Rules one by one, then a brute-force model that knows nothing of the arithmetic.

use khz_bytecode::container::OverrunPolicy;

use super::*;
use crate::task::Priority;
use crate::time::DurationNs;

fn cyclic(interval: u64, phase: u64, gated: bool, priority: u16) -> TaskState {
    TaskState {
        trigger: Trigger::Cyclic { interval: DurationNs(interval), gated, policy: OverrunPolicy::Grid },
        priority: Priority(priority),
        enabled: true,
        next_due: TimeNs(phase),
        single_previous: false,
    }
}

fn other(trigger: Trigger, priority: u16) -> TaskState {
    TaskState { trigger, ..cyclic(1, 0, false, priority) }
}

fn selected(states: &[TaskState], now: u64, samples: &[bool]) -> Vec<u16> {
    let mut ready = Vec::new();
    select(&TaskSet::from_states(states), TimeNs(now), samples, &mut ready);
    ready.into_iter().map(|task| task.0).collect()
}

#[test]
fn order_is_priority_then_declaration() {
    let states =
        [cyclic(5, 0, false, 3), other(Trigger::Freewheeling, 1), cyclic(5, 0, false, 1), cyclic(5, 0, false, 0)];
    assert_eq!(selected(&states, 0, &[]), [3, 1, 2, 0]);
}

#[test]
fn a_cyclic_task_is_due_from_its_due_time_on() {
    let states = [cyclic(5, 7, false, 0)];
    assert!(selected(&states, 6, &[]).is_empty());
    assert_eq!(selected(&states, 7, &[]), [0]);
    assert_eq!(selected(&states, 100, &[]), [0]);
}

#[test]
fn an_event_task_needs_a_rise() {
    let low = other(Trigger::Event, 0);
    let high = TaskState { single_previous: true, ..low };
    assert_eq!(selected(&[low, low, high, high], 0, &[true, false, true, false]), [0]);
}

#[test]
fn disabled_tasks_are_never_due() {
    for trigger in [Trigger::Event, Trigger::Freewheeling, cyclic(5, 0, false, 0).trigger] {
        let state = TaskState { enabled: false, ..other(trigger, 0) };
        assert!(selected(&[state], 10, &[true]).is_empty());
    }
}

#[test]
fn a_gated_task_gets_the_next_grid_point_when_its_single_falls() {
    let mut state = cyclic(10, 0, true, 0);
    assert!(!is_due(&state, TimeNs(0), true), "held from the first round on");
    note_sample(&mut state, TimeNs(0), true);
    assert!(!is_due(&state, TimeNs(33), false), "the points passed while it was held are gone");
    note_sample(&mut state, TimeNs(33), false);
    assert_eq!(state.next_due, TimeNs(40));
    assert!(is_due(&state, TimeNs(40), false));
    note_sample(&mut state, TimeNs(40), false);
    assert_eq!(collect(&mut state, TimeNs(40)), Collected { due: Some(TimeNs(40)), lost_cycles: 0 });
    assert_eq!(state.next_due, TimeNs(50));
    note_sample(&mut state, TimeNs(45), true);
    assert!(is_due(&state, TimeNs(60), false), "a fall on a grid point is due at once");
}

/// Deterministic numbers for the model comparison (an LCG; nothing depends on its quality).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % bound
    }
}

/// The rules as sets of points in time: grid points are listed, never computed.
struct ModelTask {
    state: TaskState,
    grid: Vec<u64>,
    previous: bool,
}

impl ModelTask {
    fn new(state: &TaskState) -> Self {
        let interval = if let Trigger::Cyclic { interval, .. } = state.trigger { interval.0 } else { 1 };
        let grid = (0..10_000 / interval).map(|k| state.next_due.0 + k * interval).collect();
        ModelTask { state: *state, grid, previous: false }
    }

    /// Points neither served nor lost lie at the front. Returns its due time and the points lost, if it runs.
    fn round(&mut self, now: u64, single: bool) -> Option<(Option<u64>, u64)> {
        let rise = single && !self.previous;
        let fall = !single && self.previous;
        self.previous = single;
        match self.state.trigger {
            Trigger::Freewheeling => Some((None, 0)),
            Trigger::Event => rise.then_some((Some(now), 0)),
            Trigger::Cyclic { gated, .. } => {
                if gated && single {
                    return None;
                }
                if gated && fall {
                    self.grid.retain(|point| *point >= now);
                }
                let passed: Vec<u64> = self.grid.iter().copied().filter(|point| *point <= now).collect();
                self.grid.retain(|point| *point > now);
                passed.first().map(|first| (Some(*first), passed.len() as u64 - 1))
            }
        }
    }

    /// A cycle that ended at `end`: overrun, and points lost.
    fn end(&mut self, end: u64) -> (bool, u64) {
        let passed = self.grid.iter().filter(|point| **point <= end).count() as u64;
        let overrun = self.grid.first().is_some_and(|next| end > *next);
        if !overrun {
            return (false, 0);
        }
        self.grid.retain(|point| *point > end);
        (true, passed)
    }
}

fn random_tasks(numbers: &mut Numbers) -> Vec<TaskState> {
    let mut states = Vec::new();
    for _ in 0..1 + numbers.below(6) {
        let priority = numbers.below(3) as u16;
        states.push(match numbers.below(4) {
            0 => other(Trigger::Event, priority),
            1 => other(Trigger::Freewheeling, priority),
            kind => cyclic(1 + numbers.below(20), numbers.below(15), kind == 2, priority),
        });
    }
    states
}

#[test]
fn decisions_agree_with_a_brute_force_model() {
    for seed in 0..400 {
        let mut numbers = Numbers(seed);
        let states = random_tasks(&mut numbers);
        let mut model: Vec<ModelTask> = states.iter().map(ModelTask::new).collect();
        let mut set = TaskSet::from_states(&states);
        let mut now = 0;
        let mut ready = Vec::new();
        for _ in 0..60 {
            let samples: Vec<bool> = states.iter().map(|_| numbers.below(2) == 1).collect();
            let mut expected: Vec<(u16, u16, Option<u64>, u64)> = Vec::new();
            for (at, task) in model.iter_mut().enumerate() {
                if let Some((due, lost)) = task.round(now, samples[at]) {
                    expected.push((task.state.priority.0, at as u16, due, lost));
                }
            }
            expected.sort_unstable();
            select(&set, TimeNs(now), &samples, &mut ready);
            let chosen: Vec<u16> = ready.iter().map(|task| task.0).collect();
            assert_eq!(chosen, expected.iter().map(|e| e.1).collect::<Vec<_>>(), "seed {seed} at {now}");
            for task in set.indices() {
                note_sample(set.state_mut(task), TimeNs(now), samples[task.index()]);
            }
            let round = now;
            for (task, (_, _, due, lost)) in ready.iter().zip(&expected) {
                let collected = collect(set.state_mut(*task), TimeNs(round));
                assert_eq!((collected.due.map(|d| d.0), collected.lost_cycles), (*due, *lost), "seed {seed} at {now}");
            }
            for task in &ready {
                now += [0, 1, 3, 25][numbers.below(4) as usize];
                let state = set.state_mut(*task);
                if let Trigger::Cyclic { interval, policy, .. } = state.trigger {
                    let step = grid::complete(state.next_due, interval, TimeNs(now), policy);
                    state.next_due = step.next_due;
                    assert_eq!((step.overrun, step.lost_cycles), model[task.index()].end(now), "seed {seed} at {now}");
                }
            }
            now += numbers.below(12);
        }
    }
}
