//! What the first side ran in a round, so that the round can be repeated from its start.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use khz_machine::engine::{Engine, Entry, Fuel, Limits};
use khz_machine::image::Image;
use khz_machine::trap::Trap;

/// One run of an engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recorded {
    /// What ran.
    pub entry: Entry,
    /// Whose frame memory it used.
    pub task_index: usize,
    /// The fuel that it was given, in units.
    pub fuel: Option<u64>,
    /// The fuel that it used.
    pub used: u64,
}

/// The runs since the last [`Record::clear`], and the image before the first of them.
#[derive(Debug)]
pub struct Runs {
    /// The image: inputs are frozen and the time is written.
    pub before: Image,
    /// In order.
    pub runs: Vec<Recorded>,
}

/// Shared between a [`Recorder`], which the resource owns, and who asks for the runs.
#[derive(Debug, Clone)]
pub struct Record(Arc<Mutex<Runs>>);

impl Record {
    /// A record over images of this layout.
    pub fn of(image: Image) -> Record {
        Record(Arc::new(Mutex::new(Runs { before: image, runs: Vec::new() })))
    }

    /// The runs.
    pub fn lock(&self) -> MutexGuard<'_, Runs> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a round.
    pub fn clear(&self) {
        self.lock().runs.clear();
    }
}

/// An engine that notes what it is asked to run.
pub struct Recorder {
    engine: Box<dyn Engine>,
    record: Record,
}

impl Recorder {
    /// Around an engine.
    pub fn new(engine: Box<dyn Engine>, record: Record) -> Self {
        Recorder { engine, record }
    }
}

impl Engine for Recorder {
    fn name(&self) -> &'static str {
        self.engine.name()
    }

    fn run(&mut self, entry: Entry, image: &mut Image, limits: Limits<'_>) -> Result<(), Trap> {
        let Limits { deadline, mut fuel, task_index } = limits;
        let given = fuel.as_ref().map(|fuel| fuel.left);
        let mut runs = self.record.lock();
        if runs.runs.is_empty() {
            runs.before.bytes_mut().copy_from_slice(image.bytes());
        }
        let inner = fuel.as_deref_mut();
        let result = self.engine.run(entry, image, Limits { deadline, fuel: inner, task_index });
        let left = fuel.map_or(0, |fuel: &mut Fuel| fuel.left);
        let used = given.unwrap_or(0).saturating_sub(left);
        runs.runs.push(Recorded { entry, task_index, fuel: given, used });
        result
    }

    fn code_bytes(&self) -> usize {
        self.engine.code_bytes()
    }
}
