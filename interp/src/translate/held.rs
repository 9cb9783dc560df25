//! Which slots live in registers while a function runs.
//!
//! A slot is held when the function uses it often enough for the two copies to pay, and when no function that it calls touches it: then
//! nobody can tell that the image is behind until the end of the call, where they are put back, or a trap, which puts them back too.
//! Most programs work on their own slots in one function, so most of their variables are registers from start to end.

use std::collections::{BTreeMap, BTreeSet};

use khz_bytecode::container::{ControlPlace, Function};
use khz_bytecode::ids::{FunctionId, SlotIndex};
use khz_bytecode::instruction::Instruction;
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::value::{SlotPlace, Storage};
use khz_bytecode::verify::{FunctionFacts, Verified};
use khz_machine::image::ImageLayout;

use crate::register_form::SlotRun;

/// Most slots that a function holds: bounds what a call copies and what nested calls need in registers.
const MOST_SLOTS: usize = 4096;
/// Uses that pay for the two copies.
const LEAST_USES: u32 = 3;
/// How often a loop's body is taken to run.
const PASSES: u32 = 8;
/// Deepest loop whose passes still count more.
const MOST_DEPTH: u32 = 5;

/// A slot in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Slot {
    of_program: bool,
    index: SlotIndex,
}

#[derive(Debug, Clone, Copy, Default)]
struct Use {
    weight: u32,
    is_written: bool,
}

/// A slot in a register.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held {
    pub register: u32,
    pub storage: Storage,
}

/// The slots that a function holds.
#[derive(Debug, Clone, Default)]
pub(super) struct HeldRegisters {
    /// Register of the first one.
    first: u32,
    /// By slot.
    slots: BTreeMap<Slot, Held>,
    /// Their storages, by register.
    storages: Vec<Storage>,
    /// The copies.
    pub runs: Vec<SlotRun>,
}

impl HeldRegisters {
    /// Chooses; the slots stand in registers from `first` on.
    pub(super) fn choose(
        verified: &Verified,
        layout: &ImageLayout,
        function: &Function,
        facts: &FunctionFacts,
        storage_of: impl Fn(SlotPlace, SlotIndex) -> Option<Storage>,
        first: u32,
    ) -> Self {
        let mut uses = uses(function, facts);
        leave_to_callees(verified, facts, &mut uses);
        uses.retain(|_, usage| usage.weight >= LEAST_USES);
        if uses.len() > MOST_SLOTS {
            let mut order: Vec<(u32, Slot)> = uses.iter().map(|(slot, usage)| (usage.weight, *slot)).collect();
            order.sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
            order.truncate(MOST_SLOTS);
            let kept: BTreeSet<Slot> = order.into_iter().map(|(_, slot)| slot).collect();
            uses.retain(|slot, _| kept.contains(slot));
        }
        let mut held = HeldRegisters { first, ..HeldRegisters::default() };
        for (slot, usage) in uses {
            let place = if slot.of_program { SlotPlace::Program } else { SlotPlace::Global };
            let Some(storage) = storage_of(place, slot.index) else { continue };
            held.add(layout, slot, storage, usage.is_written);
        }
        held
    }

    fn add(&mut self, layout: &ImageLayout, slot: Slot, storage: Storage, is_written: bool) {
        let register = self.first + self.count();
        self.slots.insert(slot, Held { register, storage });
        self.storages.push(storage);
        let start = if slot.of_program { 0 } else { layout.slots.start };
        let offset = start + u32::from(slot.index.0) * SLOT_BYTES;
        let of_program = slot.of_program;
        if let Some(last) = self.runs.last_mut()
            && (last.of_program, last.is_written, last.storage) == (of_program, is_written, storage)
            && last.offset + last.count * SLOT_BYTES == offset
        {
            last.count += 1;
            return;
        }
        self.runs.push(SlotRun { register, count: 1, offset, of_program, is_written, storage });
    }

    /// How many there are.
    pub(super) fn count(&self) -> u32 {
        self.storages.len() as u32
    }

    /// Where a slot is held.
    pub(super) fn find(&self, place: SlotPlace, index: SlotIndex) -> Option<Held> {
        let of_program = match place {
            SlotPlace::Global => false,
            SlotPlace::Program => true,
            SlotPlace::Local => return None,
        };
        self.slots.get(&Slot { of_program, index }).copied()
    }

    /// What the slot in a register is.
    pub(super) fn storage(&self, register: u32) -> Option<Storage> {
        self.storages.get(register.checked_sub(self.first)? as usize).copied()
    }
}

/// All slots in memory that a function names, with how much it uses them.
fn uses(function: &Function, facts: &FunctionFacts) -> BTreeMap<Slot, Use> {
    let mut uses: BTreeMap<Slot, Use> = BTreeMap::new();
    for block in &facts.blocks {
        let depth = block.innermost_loop.map_or(0, |id| u32::from(facts.loops[id.index()].depth));
        let weight = PASSES.pow(depth.min(MOST_DEPTH));
        for placed in &facts.instructions[block.start..block.end] {
            let (place, index, is_written) = match placed.instruction {
                Instruction::SlotLoad { place, index } => (place, index, false),
                Instruction::SlotStore { place, index } => (place, index, true),
                Instruction::ForEnter { id, .. } | Instruction::ForNext { id, .. } => {
                    match function.for_loops[id.index()].control {
                        ControlPlace::Slot(place, index) => (place, index, true),
                        ControlPlace::Bytes(..) => continue,
                    }
                }
                _ => continue,
            };
            let of_program = match place {
                SlotPlace::Global => false,
                SlotPlace::Program => true,
                SlotPlace::Local => continue,
            };
            let usage = uses.entry(Slot { of_program, index }).or_default();
            usage.weight = usage.weight.saturating_add(weight);
            usage.is_written |= is_written;
        }
    }
    uses
}

/// Takes away what callees touch.
fn leave_to_callees(verified: &Verified, facts: &FunctionFacts, uses: &mut BTreeMap<Slot, Use>) {
    let mut callees: Vec<FunctionId> = Vec::new();
    for placed in &facts.instructions {
        if let Instruction::Call { function } = placed.instruction {
            callees.push(function);
        }
    }
    callees.sort_unstable();
    callees.dedup();
    for callee in callees {
        let effects = &verified.function(callee).effects;
        for (of_program, touched) in [
            (false, &effects.globals_read),
            (false, &effects.globals_written),
            (true, &effects.program_read),
            (true, &effects.program_written),
        ] {
            for index in touched {
                uses.remove(&Slot { of_program, index: *index });
            }
        }
    }
    // A method may touch any global, but has no way to the slots of a program.
    if facts.calls_virtual {
        uses.retain(|slot, _| slot.of_program);
    }
}
