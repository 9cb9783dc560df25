//! A scripted engine and small containers: the scheduler is tested without any real engine.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::io::Write as _;
use std::sync::{Arc, Mutex};

use khz_bytecode::container::{Container, OverrunPolicy, ProgramInstance, SingleSource, Task, TaskExtension, TaskType};
use khz_bytecode::ids::{FunctionId, InstanceId, SlotIndex, TaskId};
use khz_bytecode::value::Storage;
use khz_machine::engine::{Engine, Entry, Limits};
use khz_machine::image::Image;
use khz_machine::trap::{CodePlace, Trap, TrapCode};
use khz_scheduler::*;

/// What the engine does for each entry.
pub type Script = Box<dyn FnMut(Entry, &mut Image, Limits<'_>) -> Result<(), Trap> + Send>;

/// An engine that does what a test says.
pub struct MockEngine(pub Script);

impl Engine for MockEngine {
    fn name(&self) -> &'static str {
        "mock"
    }

    fn run(&mut self, entry: Entry, image: &mut Image, limits: Limits<'_>) -> Result<(), Trap> {
        (self.0)(entry, image, limits)
    }

    fn code_bytes(&self) -> usize {
        0
    }
}

/// A trap at a place that tests recognise.
pub fn trap(code: TrapCode) -> Trap {
    Trap::new(code, CodePlace { function: FunctionId(7), offset: 42 }, [1, 2, 3])
}

/// An endless loop: ends by deadline, or when its fuel is used up.
pub fn endless(mut limits: Limits<'_>) -> Result<(), Trap> {
    loop {
        if let Some(code) = limits.deadline.expired() {
            return Err(trap(code));
        }
        if let Some(fuel) = limits.fuel.as_deref_mut() {
            match fuel.left.checked_sub(1000) {
                Some(left) => fuel.left = left,
                None => {
                    fuel.left = 0;
                    return Err(trap(TrapCode::Watchdog));
                }
            }
        }
    }
}

/// Slots of every test container.
pub const SLOTS: usize = 32;

/// A task with one program instance.
pub fn task(task_type: TaskType, interval_us: u64, priority: u16) -> (Task, TaskExtension) {
    let task = Task { task_type, interval_us, priority, enabled: true, ..Task::default() };
    (task, TaskExtension::default())
}

pub fn cyclic(interval_us: u64, priority: u16) -> (Task, TaskExtension) {
    task(TaskType::Cyclic, interval_us, priority)
}

pub fn freewheeling() -> (Task, TaskExtension) {
    task(TaskType::Freewheeling, 0, 65_535)
}

pub fn event(single: SingleSource, priority: u16) -> (Task, TaskExtension) {
    let (task, extension) = task(TaskType::Event, 0, priority);
    (task, TaskExtension { single, ..extension })
}

pub fn gated(interval_us: u64, single: SingleSource) -> (Task, TaskExtension) {
    let (task, extension) = cyclic(interval_us, 0);
    (task, TaskExtension { single, ..extension })
}

pub fn with_policy(interval_us: u64, overrun_policy: OverrunPolicy) -> (Task, TaskExtension) {
    let (task, extension) = cyclic(interval_us, 0);
    (task, TaskExtension { overrun_policy, ..extension })
}

pub fn slot(index: u16) -> SingleSource {
    SingleSource::Slot(SlotIndex(index))
}

/// One program instance on each task, 2 bytes each of %I, %Q and %M.
pub fn container(tasks: &[(Task, TaskExtension)]) -> Container {
    let mut container = Container::default();
    container.parameters.input_image_bytes = 2;
    container.parameters.output_image_bytes = 2;
    container.parameters.memory_image_bytes = 2;
    container.parameters.data_region_bytes = 64;
    container.types.slots = vec![Storage::I64; SLOTS];
    for (position, (task, extension)) in tasks.iter().enumerate() {
        // Ids are names, not positions.
        let id = TaskId(100 + position as u16);
        container.tasks.tasks.push(Task { id, ..*task });
        container.types.task_extensions.push(extension.clone());
        container.tasks.instances.push(ProgramInstance {
            id: InstanceId(position as u16),
            task: id,
            entry: FunctionId(position as u16),
            ..ProgramInstance::default()
        });
    }
    container
}

pub fn slot_range(image: &Image, index: usize) -> std::ops::Range<usize> {
    let start = image.layout().slots.start as usize + index * 8;
    start..start + 8
}

pub fn get(image: &Image, index: usize) -> i64 {
    i64::from_le_bytes(image.bytes()[slot_range(image, index)].try_into().unwrap())
}

pub fn set(image: &mut Image, index: usize, value: i64) {
    let range = slot_range(image, index);
    image.bytes_mut()[range].copy_from_slice(&value.to_le_bytes());
}

pub fn load_with(
    container: Container,
    clock: Box<dyn Clock>,
    options: &LoadOptions,
    script: impl FnMut(Entry, &mut Image, Limits<'_>) -> Result<(), Trap> + Send + 'static,
) -> Result<Resource<Stopped>, LoadError> {
    Resource::load(Arc::new(container), Box::new(MockEngine(Box::new(script))), clock, options)
}

pub fn load(
    container: Container,
    script: impl FnMut(Entry, &mut Image, Limits<'_>) -> Result<(), Trap> + Send + 'static,
) -> Resource<Stopped> {
    load_with(container, Box::new(VirtualClock::new()), &LoadOptions::default(), script).unwrap()
}

/// Lines of a trace, shared by everything a test hooks in.
#[derive(Clone, Default)]
pub struct Log(Arc<Mutex<Vec<String>>>);

impl Log {
    pub fn add(&self, line: impl Into<String>) {
        self.0.lock().unwrap().push(line.into());
    }

    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap())
    }
}

/// Notes each round: time and tasks.
impl Observer for Log {
    fn round_ended(&mut self, _image: &Image, time: TimeNs, ran: &[TaskIndex]) {
        let ran: Vec<u16> = ran.iter().map(|task| task.0).collect();
        self.add(format!("{} {ran:?}", time.as_us()));
    }
}

/// Input rows: time, slot, value.
#[derive(Default)]
pub struct Rows(pub Vec<(u64, usize, i64)>);

impl InputSource for Rows {
    fn next_change_us(&self) -> Option<u64> {
        self.0.first().map(|row| row.0)
    }

    fn apply(&mut self, now_us: u64, image: &mut Image) {
        while let Some((_, slot, value)) = self.0.first().copied().filter(|row| row.0 <= now_us) {
            set(image, slot, value);
            self.0.remove(0);
        }
    }
}

/// Runs `scans` rounds with tasks on a fresh start; gives the trace and how it ended.
pub fn traced(resource: Resource<Stopped>, rows: Vec<(u64, usize, i64)>, scans: u64) -> (Vec<String>, RunOutcome) {
    let mut log = Log::default();
    let mut rows = Rows(rows);
    let mut hooks = Hooks { io: &mut NoIo, inputs: &mut rows, observer: &mut log };
    let outcome = run(resource.start().unwrap(), &mut hooks, RunOptions { scans: Some(scans) });
    (log.take(), outcome)
}

/// Shows a measurement; with `--nocapture` it is seen.
pub fn show(line: &str) {
    // A closed stderr is no failure of a test.
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// No hooks.
pub fn run_plain(resource: Resource<Running>, scans: Option<u64>) -> RunOutcome {
    let mut hooks = Hooks { io: &mut NoIo, inputs: &mut NoInputs, observer: &mut NoObserver };
    run(resource, &mut hooks, RunOptions { scans })
}
