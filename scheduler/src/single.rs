//! SINGLE sources: where each task's trigger value lies in the memory image, resolved once at load.

use khz_bytecode::container::SingleSource;
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::value::BytePlace;
use khz_machine::image::{Image, ImageLayout};

use crate::task::{TaskIndex, TaskSet};

/// A source as an image offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// TRUE when the masked byte is not 0.
    Byte {
        offset: usize,
        mask: u8,
    },
    Literal(bool),
}

/// The SINGLE sources of a resource.
#[derive(Debug, Clone, Default)]
pub struct SingleTable {
    rows: Vec<(TaskIndex, Place)>,
    /// Whether a source of a task that can run lies in %I, where something outside can change it.
    reads_inputs: bool,
}

impl SingleTable {
    /// Resolves the sources of all tasks that have one.
    #[must_use]
    pub fn new(tasks: &TaskSet, layout: &ImageLayout) -> Self {
        let mut table = SingleTable::default();
        for task in tasks.indices() {
            let byte =
                |start: u32, offset: u32, mask| Place::Byte { offset: start.saturating_add(offset) as usize, mask };
            let place = match tasks.info(task).single {
                SingleSource::None => continue,
                SingleSource::Slot(slot) => byte(layout.slots.start, u32::from(slot.0) * SLOT_BYTES, 0xff),
                SingleSource::Data(offset) => byte(layout.data.start, offset, 0xff),
                SingleSource::Bit { place, offset, bit } => {
                    // A task that never runs waits for nothing.
                    table.reads_inputs |= place == BytePlace::Input && tasks.state(task).enabled;
                    // The verifier admits only places with a fixed start; another would read as FALSE for ever.
                    match layout.fixed_start(place) {
                        Some(start) => byte(start, offset, 1u8.checked_shl(u32::from(bit)).unwrap_or(0)),
                        None => Place::Literal(false),
                    }
                }
                SingleSource::Literal(value) => Place::Literal(value),
            };
            table.rows.push((task, place));
        }
        table
    }

    /// Writes each source's present value to its task's place in `samples`.
    pub fn sample(&self, image: &Image, samples: &mut [bool]) {
        if self.rows.is_empty() {
            return;
        }
        let bytes = image.bytes();
        for (task, place) in &self.rows {
            if let Some(sample) = samples.get_mut(task.index()) {
                *sample = match *place {
                    // Out of bounds is impossible behind the verifier, and FALSE without it.
                    Place::Byte { offset, mask } => bytes.get(offset).is_some_and(|byte| byte & mask != 0),
                    Place::Literal(value) => value,
                };
            }
        }
    }

    /// The tasks that have a source.
    pub fn tasks(&self) -> impl Iterator<Item = TaskIndex> + '_ {
        self.rows.iter().map(|(task, _)| *task)
    }

    /// Whether a source of a task that can run lies in %I.
    #[must_use]
    pub fn reads_inputs(&self) -> bool {
        self.reads_inputs
    }
}
