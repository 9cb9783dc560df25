//! Runs assembly text as native code.
#![allow(dead_code, reason = "each test file uses its part")]

use std::sync::Arc;

use khz_bytecode::assembler::assemble;
use khz_bytecode::ids::FunctionId;
use khz_bytecode::verify::{Verified, verify};
use khz_jit::{Jit, JitOptions, Passes, mir_text};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Fuel, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::trap::{Trap, TrapCode};

/// A resource that is loaded.
pub struct Loaded {
    pub verified: Arc<Verified>,
    pub engine: Jit,
    pub image: Image,
}

pub fn verified(text: &str) -> Arc<Verified> {
    let container = assemble(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    Arc::new(verify(container).unwrap_or_else(|error| panic!("{error}\n{text}")))
}

/// Assembles, verifies and compiles; panics with the reason when the text is no sound container.
pub fn load_with(text: &str, options: JitOptions) -> Loaded {
    let verified = verified(text);
    let layout = ImageLayout::new(verified.container(), 1 << 24).unwrap();
    let engine = Jit::new(verified.clone(), &layout, options).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let image = Image::new(layout, verified.container());
    Loaded { verified, engine, image }
}

pub fn load(text: &str, fuel: bool) -> Loaded {
    load_with(text, JitOptions { fuel, ..JitOptions::default() })
}

/// The mid-level form of function 0 after some passes.
pub fn form(text: &str, passes: Passes) -> String {
    let verified = verified(text);
    let layout = ImageLayout::new(verified.container(), 1 << 24).unwrap();
    mir_text(&verified, &layout, JitOptions { passes, ..JitOptions::default() }, FunctionId(0))
}

impl Loaded {
    /// Runs the first instance's entry.
    pub fn run(&mut self) -> Result<(), Trap> {
        self.run_entry(Entry::Instance(0))
    }

    pub fn run_entry(&mut self, entry: Entry) -> Result<(), Trap> {
        let deadline = DeadlineCell::new();
        self.engine.run(entry, &mut self.image, Limits { deadline: &deadline, fuel: None, task_index: 0 })
    }

    /// Runs with so much fuel: the result and what is left.
    pub fn run_with_fuel(&mut self, left: u64) -> (Result<(), Trap>, u64) {
        let deadline = DeadlineCell::new();
        let mut fuel = Fuel { left };
        let limits = Limits { deadline: &deadline, fuel: Some(&mut fuel), task_index: 0 };
        (self.engine.run(Entry::Instance(0), &mut self.image, limits), fuel.left)
    }

    /// The 8 bytes of a slot.
    pub fn slot(&self, index: usize) -> u64 {
        let at = self.image.layout().slots.start as usize + 8 * index;
        u64::from_le_bytes(self.image.bytes()[at..at + 8].try_into().unwrap())
    }

    /// Bytes of the data region.
    pub fn data(&self, offset: usize, count: usize) -> &[u8] {
        let at = self.image.layout().data.start as usize + offset;
        &self.image.bytes()[at..at + count]
    }
}

/// Runs text once without a trap and gives the first `count` slots.
pub fn slots(text: &str, count: usize) -> Vec<u64> {
    let mut loaded = load(text, false);
    let result = loaded.run();
    assert!(result.is_ok(), "{result:?}\n{text}");
    (0..count).map(|index| loaded.slot(index)).collect()
}

/// Runs text once into a trap.
pub fn trap(text: &str) -> Trap {
    load(text, false).run().expect_err(text)
}

/// A trap's code and values.
pub fn cause(trap: &Trap) -> (TrapCode, [i64; 3]) {
    (trap.code, trap.values)
}
