//! What the scheduler may ask of an engine, and what an engine may ask of its host while it runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use khz_bytecode::trap::TrapCode;

use crate::image::Image;
use crate::trap::Trap;

/// Whether, and why, running code shall end. Checked at function entries and at every arrival at a loop header.
///
/// A monitor thread or a signal handler sets it, running code reads it with a plain load. 0 means go on; any other value is
/// the code of the trap to end in.
#[derive(Debug, Default)]
pub struct DeadlineCell {
    code: AtomicU32,
}

impl DeadlineCell {
    /// A cell that lets code run.
    #[must_use]
    pub fn new() -> Arc<Self> {
        Arc::new(DeadlineCell::default())
    }

    /// Ends what runs under it, with trap `code` (`Watchdog` or `Stopped`). The first one wins.
    pub fn expire(&self, code: TrapCode) {
        // A lost race means that another reason was first, which is just as good.
        let _ = self.code.compare_exchange(0, code as u32, Ordering::Relaxed, Ordering::Relaxed);
    }

    /// Lets code run again.
    pub fn clear(&self) {
        self.code.store(0, Ordering::Relaxed);
    }

    /// The trap to end in, if it expired.
    #[must_use]
    pub fn expired(&self) -> Option<TrapCode> {
        u8::try_from(self.code.load(Ordering::Relaxed)).ok().and_then(TrapCode::from_code)
    }

    /// The word that native code compares with 0.
    #[must_use]
    pub fn as_atomic(&self) -> &AtomicU32 {
        &self.code
    }
}

/// Deterministic limit of work (architecture §7): units left. Without fuel, code without fuel accounting runs.
///
/// Charged at function entry and at each arrival at a loop header with the static costs of
/// [`khz_bytecode::verify::FunctionFacts`]. The charge that would make it negative traps *watchdog* at that place instead (place: the
/// function's first instruction, offset 0; or the header block's first instruction), and leaves 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fuel {
    /// Units left.
    pub left: u64,
}

/// What to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entry {
    /// The container's init function.
    Init,
    /// The container's startup function.
    Startup,
    /// The entry function of a program instance, by position in the task table.
    Instance(usize),
}

/// What a run is subject to.
#[derive(Debug)]
pub struct Limits<'a> {
    /// Checked while running.
    pub deadline: &'a DeadlineCell,
    /// Charged while running, when given.
    pub fuel: Option<&'a mut Fuel>,
    /// Which task's frame memory to use: position of the task in the task table (0 for init and startup).
    pub task_index: usize,
}

/// An engine: one resource's verified code, made ready to run on the image of that resource.
///
/// Order at a function entry: call depth check (by the caller, at the `call` instruction), then deadline, then fuel; at a loop header: deadline, then fuel.
/// The entry function is depth 1; a `call` that would exceed `max_call_depth` traps *call depth* at the call instruction with the depth it would reach.
/// After a trap the image is exactly what the definition says it is at the trapping instruction; frame bytes and `L` slots are nobody's business.
pub trait Engine: Send {
    /// Its name for reports: `jit` or `interp`.
    fn name(&self) -> &'static str;

    /// Runs one entry to its end. Allocates nothing, locks nothing.
    ///
    /// # Errors
    /// The trap that ended it.
    fn run(&mut self, entry: Entry, image: &mut Image, limits: Limits<'_>) -> Result<(), Trap>;

    /// Bytes of the code it runs: machine code, or register code.
    fn code_bytes(&self) -> usize;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_reason_to_end_wins_until_cleared() {
        let cell = DeadlineCell::new();
        assert_eq!(cell.expired(), None);
        cell.expire(TrapCode::Stopped);
        cell.expire(TrapCode::Watchdog);
        assert_eq!(cell.expired(), Some(TrapCode::Stopped));
        assert_ne!(cell.as_atomic().load(Ordering::Relaxed), 0, "native code sees it");
        cell.clear();
        assert_eq!(cell.expired(), None);
    }
}
