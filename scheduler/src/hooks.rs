//! What a resource meets outside: an I/O driver, rows of inputs, and someone who looks on. All are called from the scan thread, at
//! fixed places of a round, so what they do counts as the round's time.

use khz_machine::image::Image;

use crate::task::TaskIndex;
use crate::time::{DurationNs, TimeNs};

/// The hardware side of the process image.
pub trait IoDriver: Send {
    /// Copies the latest inputs into the %I snapshot. Called once at a round's start, when the resource has %I bytes.
    fn read_inputs(&mut self, inputs: &mut [u8]);

    /// Takes the %Q staging bytes of a round that ended without a trap. Called when the resource has %Q bytes.
    fn write_outputs(&mut self, outputs: &[u8]);

    /// In real time: how often to look at the inputs when a task waits for a bit of %I. `None`: they never change by themselves.
    fn input_poll(&self) -> Option<DurationNs> {
        None
    }
}

/// Inputs that are known beforehand, as `--inputs` gives them.
pub trait InputSource: Send {
    /// Time in microseconds of the next row that was not applied yet.
    fn next_change_us(&self) -> Option<u64>;

    /// Applies every row up to `now_us`. Called after the driver's inputs were read, so rows override them.
    fn apply(&mut self, now_us: u64, image: &mut Image);
}

/// Sees the image at the end of each round that ended without a trap.
pub trait Observer: Send {
    /// A round began at `time`; `ran` are the tasks it ran, in order.
    fn round_ended(&mut self, image: &Image, time: TimeNs, ran: &[TaskIndex]);
}

/// No hardware: %I keeps what rows and settings wrote.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoIo;

impl IoDriver for NoIo {
    fn read_inputs(&mut self, _inputs: &mut [u8]) {}

    fn write_outputs(&mut self, _outputs: &[u8]) {}
}

/// No rows.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoInputs;

impl InputSource for NoInputs {
    fn next_change_us(&self) -> Option<u64> {
        None
    }

    fn apply(&mut self, _now_us: u64, _image: &mut Image) {}
}

/// Nobody looks.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoObserver;

impl Observer for NoObserver {
    fn round_ended(&mut self, _image: &Image, _time: TimeNs, _ran: &[TaskIndex]) {}
}

/// The three together, borrowed for a run.
pub struct Hooks<'a> {
    /// Hardware.
    pub io: &'a mut dyn IoDriver,
    /// Known inputs.
    pub inputs: &'a mut dyn InputSource,
    /// Onlooker.
    pub observer: &'a mut dyn Observer,
}
