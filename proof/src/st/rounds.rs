//! Which instances run when: the rules of tasks, over the virtual clock.

use super::evaluate::{Evaluator, Stop};
use super::tree::{Source, Task};

const MICROSECOND_NS: u64 = 1_000;
const MILLISECOND_NS: u64 = 1_000_000;

/// What is known of a task between rounds.
#[derive(Debug, Clone, Default)]
struct State {
    due_ns: u64,
    /// What its SINGLE was when the last round began.
    single: bool,
}

/// The rounds of a program with a CONFIGURATION.
#[derive(Debug)]
pub struct Rounds<'s> {
    source: &'s Source,
    states: Vec<State>,
    now_ns: u64,
    ran: Vec<Option<usize>>,
}

impl<'s> Rounds<'s> {
    /// Before the first round, which is at time 0.
    #[must_use]
    pub fn new(source: &'s Source) -> Self {
        let tasks = source.config.as_ref().map_or(0, |config| config.tasks.len());
        Rounds { source, states: vec![State::default(); tasks], now_ns: 0, ran: Vec::new() }
    }

    fn tasks(&self) -> &'s [Task] {
        self.source.config.as_ref().map_or(&[], |config| &config.tasks)
    }

    /// The time of the round that comes, in nanoseconds.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// The tasks that the last round began, in their order; none stands for the instances without a task.
    #[must_use]
    pub fn ran(&self) -> &[Option<usize>] {
        &self.ran
    }

    /// Runs a round: every task that is due, by priority, then declaration; last the instances without a task.
    ///
    /// # Errors
    /// A trap ends the round.
    pub fn run(&mut self, evaluator: &mut Evaluator<'_>) -> Result<(), Stop> {
        let Some(config) = &self.source.config else { return Ok(()) };
        let flags: Vec<bool> = self.flags(evaluator);
        let mut ready = Vec::new();
        for (at, task) in config.tasks.iter().enumerate() {
            let (state, flag) = (&mut self.states[at], flags[at]);
            let fell = state.single && !flag;
            let rose = flag && !state.single;
            state.single = flag;
            let is_due = match task.interval_us {
                None => rose,
                Some(_) if flag => false,
                Some(interval) => {
                    if fell {
                        // The points that passed meanwhile are gone.
                        state.due_ns = at_or_after(state.due_ns, interval, self.now_ns);
                    }
                    state.due_ns <= self.now_ns
                }
            };
            if is_due {
                ready.push((task.priority, at));
            }
        }
        ready.sort_unstable();
        let now = self.now_ns as i64;
        self.ran.clear();
        for (_, at) in ready {
            self.ran.push(Some(at));
            self.run_instances(evaluator, Some(at), now)?;
            if let Some(interval) = config.tasks[at].interval_us {
                let state = &mut self.states[at];
                state.due_ns = at_or_after(state.due_ns, interval, self.now_ns + 1);
            }
        }
        if config.instances.iter().any(|instance| instance.task.is_none()) {
            self.ran.push(None);
        }
        self.run_instances(evaluator, None, now)
    }

    fn run_instances(&self, evaluator: &mut Evaluator<'_>, task: Option<usize>, now: i64) -> Result<(), Stop> {
        let Some(config) = &self.source.config else { return Ok(()) };
        let instances = config.instances.iter().enumerate().filter(|(_, instance)| instance.task == task);
        for (at, _) in instances {
            evaluator.run_instance(at, now)?;
        }
        Ok(())
    }

    /// The value of each task's SINGLE now; FALSE without one.
    fn flags(&self, evaluator: &Evaluator<'_>) -> Vec<bool> {
        let flag = |task: &Task| task.single.is_some_and(|global| evaluator.global_flag(global));
        self.tasks().iter().map(flag).collect()
    }

    /// Goes on to the next round; false when nothing can be due any more.
    pub fn wait(&mut self, evaluator: &Evaluator<'_>) -> bool {
        let flags = self.flags(evaluator);
        let mut next: Option<u64> = None;
        for ((task, state), flag) in self.tasks().iter().zip(&self.states).zip(flags) {
            let at = match task.interval_us {
                // It rose while the round ran: it is seen as soon as there is a new time.
                None if flag && !state.single => self.now_ns + MICROSECOND_NS,
                None => continue,
                Some(_) if flag => continue,
                Some(interval) if state.single => at_or_after(state.due_ns, interval, self.now_ns + 1),
                Some(_) => state.due_ns,
            };
            next = Some(next.map_or(at, |next| next.min(at)));
        }
        let wheels =
            self.source.config.as_ref().is_some_and(|config| config.instances.iter().any(|one| one.task.is_none()));
        match next {
            Some(at) => self.now_ns = at.max(self.now_ns + MICROSECOND_NS),
            None if wheels => self.now_ns += MILLISECOND_NS,
            None => return false,
        }
        true
    }
}

/// The first point of a grid, which begins at `due_ns`, that is not before a time.
fn at_or_after(due_ns: u64, interval_us: u64, time_ns: u64) -> u64 {
    let interval = interval_us * MICROSECOND_NS;
    due_ns + time_ns.saturating_sub(due_ns).div_ceil(interval) * interval
}
