//! Tasks as the scheduler sees them: what the container says of each, and what changes from round to round.

use std::collections::BTreeMap;

use khz_bytecode::container::{Container, OverrunPolicy, SingleSource, TaskExtension, TaskType};
use khz_bytecode::limits::MIN_INTERVAL_US;

use crate::time::{DurationNs, TimeNs};

/// Position of a task in the task table: declaration order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct TaskIndex(pub u16);

impl TaskIndex {
    /// The position as an index.
    #[must_use]
    pub fn index(self) -> usize {
        usize::from(self.0)
    }
}

/// Priority of a task; 0 is the highest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Priority(pub u16);

/// What makes a task due (IEC 61131-3, tasks: INTERVAL, SINGLE).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// Every `interval` on a grid. `gated`: it also has a SINGLE source and has no due time while that is TRUE.
    Cyclic {
        /// Grid width, at least 1 µs.
        interval: DurationNs,
        /// Whether a SINGLE source holds it off.
        gated: bool,
        /// What follows a cycle that ran past the next due time.
        policy: OverrunPolicy,
    },
    /// On a rising edge of its SINGLE source.
    Event,
    /// In every round.
    Freewheeling,
}

/// What changes of one task, and what decisions about it need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskState {
    /// What makes it due.
    pub trigger: Trigger,
    /// Order among due tasks.
    pub priority: Priority,
    /// A disabled task is never due.
    pub enabled: bool,
    /// Next due time of a cyclic task; its grid is this plus multiples of the interval.
    pub next_due: TimeNs,
    /// Value of its SINGLE source when it was last sampled; FALSE before the first round.
    pub single_previous: bool,
}

/// What does not change of one task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskInfo {
    /// `task_id` of the task table.
    pub id: u16,
    /// First grid point of a cyclic task.
    pub phase: TimeNs,
    /// Where its SINGLE value comes from.
    pub single: SingleSource,
    /// Watchdog time of the container; zero: none.
    pub watchdog: DurationNs,
    /// Consecutive overruns of the watchdog time until it trips, at least 1 (the container's 0 and 1 both mean the first).
    pub watchdog_sensitivity: u16,
}

/// All tasks of a resource.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TaskSet {
    states: Vec<TaskState>,
    infos: Vec<TaskInfo>,
    /// Positions by priority, then declaration.
    order: Vec<TaskIndex>,
    /// Positions in the instance table of each task's program instances, in declaration order.
    instances: Vec<Vec<usize>>,
}

impl TaskSet {
    /// The tasks of a container, as they are before the first round.
    #[must_use]
    pub fn new(container: &Container) -> Self {
        let mut set = TaskSet::default();
        let mut by_id = BTreeMap::new();
        // The file's count is a u16, so no task is lost here.
        for (position, task) in container.tasks.tasks.iter().enumerate().take(usize::from(u16::MAX)) {
            let extension = container.types.task_extensions.get(position).cloned().unwrap_or_default();
            let single = single_source(task.single_slot, &extension);
            let trigger = match task.task_type {
                TaskType::Cyclic => Trigger::Cyclic {
                    interval: DurationNs::from_us(task.interval_us.max(MIN_INTERVAL_US)),
                    gated: single != SingleSource::None,
                    policy: extension.overrun_policy,
                },
                TaskType::Event => Trigger::Event,
                TaskType::Freewheeling => Trigger::Freewheeling,
            };
            let phase = TimeNs::from_us(extension.phase_us);
            by_id.entry(task.id).or_insert(position);
            set.push(
                TaskState {
                    trigger,
                    priority: Priority(task.priority),
                    enabled: task.enabled,
                    next_due: phase,
                    single_previous: false,
                },
                TaskInfo {
                    id: task.id.0,
                    phase,
                    single,
                    watchdog: DurationNs::from_us(task.watchdog_us),
                    watchdog_sensitivity: extension.watchdog_sensitivity.max(1),
                },
            );
        }
        for (position, instance) in container.tasks.instances.iter().enumerate() {
            if let Some(list) = by_id.get(&instance.task).and_then(|task| set.instances.get_mut(*task)) {
                list.push(position);
            }
        }
        set.order.sort_by_key(|task| (set.states[task.index()].priority, *task));
        set
    }

    /// Tasks made from states alone, for tests and models of the decisions.
    #[must_use]
    pub fn from_states(states: &[TaskState]) -> Self {
        let mut set = TaskSet::default();
        for state in states.iter().take(usize::from(u16::MAX)) {
            let info = TaskInfo {
                id: set.states.len() as u16,
                phase: state.next_due,
                single: SingleSource::None,
                watchdog: DurationNs(0),
                watchdog_sensitivity: 1,
            };
            set.push(*state, info);
        }
        set.order.sort_by_key(|task| (set.states[task.index()].priority, *task));
        set
    }

    fn push(&mut self, state: TaskState, info: TaskInfo) {
        // Both callers stop at u16::MAX tasks.
        self.order.push(TaskIndex(self.states.len() as u16));
        self.states.push(state);
        self.infos.push(info);
        self.instances.push(Vec::new());
    }

    /// How many tasks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Whether there is no task.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// All tasks in declaration order.
    pub fn indices(&self) -> impl Iterator<Item = TaskIndex> + use<> {
        (0..self.states.len() as u16).map(TaskIndex)
    }

    /// All tasks by priority, then declaration.
    #[must_use]
    pub fn order(&self) -> &[TaskIndex] {
        &self.order
    }

    /// State of one task; positions come from this set.
    #[must_use]
    pub fn state(&self, task: TaskIndex) -> &TaskState {
        &self.states[task.index()]
    }

    /// State of one task, to change.
    pub fn state_mut(&mut self, task: TaskIndex) -> &mut TaskState {
        &mut self.states[task.index()]
    }

    /// What does not change of one task.
    #[must_use]
    pub fn info(&self, task: TaskIndex) -> &TaskInfo {
        &self.infos[task.index()]
    }

    /// Positions in the instance table of a task's program instances, in declaration order.
    #[must_use]
    pub fn instances(&self, task: TaskIndex) -> &[usize] {
        &self.instances[task.index()]
    }

    /// Puts every task back to before the first round.
    pub fn reset(&mut self) {
        for (state, info) in self.states.iter_mut().zip(&self.infos) {
            state.next_due = info.phase;
            state.single_previous = false;
        }
    }
}

/// The extension says the source; a slot of an event task stands in the task entry too.
fn single_source(entry: Option<khz_bytecode::ids::SlotIndex>, extension: &TaskExtension) -> SingleSource {
    match (extension.single, entry) {
        (SingleSource::None, Some(slot)) => SingleSource::Slot(slot),
        (source, _) => source,
    }
}
