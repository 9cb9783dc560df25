//! What was made, what ran, and how it ended: a proof is worth what it reached.

use std::collections::BTreeMap;
use std::fmt::Write;

use khz_bytecode::instruction::{ControlOp, HelperOp, Instruction, NumericOp};
use khz_bytecode::trap::TrapCode;

use crate::campaign::Figures;

/// Opcodes lie below this.
const OPCODES: usize = 0x400;

/// A kind of instructions: what it is called, and the opcode and name of each.
type Kind = (&'static str, Vec<(usize, &'static str)>);

/// Every instruction by its kind. The last kind is the standard functions on strings.
fn kinds() -> [Kind; 3] {
    [
        ("control and memory", ControlOp::ALL.iter().map(|op| (*op as usize, op.mnemonic())).collect()),
        ("numeric", NumericOp::ALL.iter().map(|op| (*op as usize, op.mnemonic())).collect()),
        ("helper", HelperOp::ALL.iter().map(|op| (*op as usize, op.mnemonic())).collect()),
    ]
}

/// How often each instruction was met, and each trap.
#[derive(Debug, Clone)]
pub struct Executed {
    counts: Vec<u64>,
    traps: BTreeMap<TrapCode, u64>,
}

impl Default for Executed {
    fn default() -> Self {
        Executed { counts: vec![0; OPCODES], traps: BTreeMap::new() }
    }
}

impl Executed {
    /// Counts an instruction.
    pub fn ran(&mut self, instruction: &Instruction) {
        if let Some(count) = self.counts.get_mut(usize::from(instruction.opcode())) {
            *count += 1;
        }
    }

    /// Counts a trap.
    pub fn trapped(&mut self, code: TrapCode) {
        *self.traps.entry(code).or_default() += 1;
    }

    /// Adds what another counted.
    pub fn add(&mut self, other: &Executed) {
        self.counts.iter_mut().zip(&other.counts).for_each(|(own, other)| *own += other);
        for (code, count) in &other.traps {
            *self.traps.entry(*code).or_default() += count;
        }
    }

    /// Instructions in all.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Names of instructions that were met less than `least` times.
    #[must_use]
    pub fn rare(&self, least: u64) -> Vec<&'static str> {
        let all = kinds().into_iter().flat_map(|(_, instructions)| instructions);
        all.filter(|(opcode, _)| self.counts[*opcode] < least).map(|(_, name)| name).collect()
    }

    /// A line for each kind of instructions: how many of them were met, and which one least.
    fn coverage(&self) -> String {
        let mut text = String::new();
        for (kind, instructions) in kinds() {
            let met = instructions.iter().filter(|(opcode, _)| self.counts[*opcode] > 0).count();
            let least = instructions.iter().map(|(opcode, name)| (self.counts[*opcode], *name)).min();
            let (count, name) = least.unwrap_or_default();
            // A String takes everything.
            let _ = writeln!(text, "{kind} instructions: {met} of {}, least {name}: {count}", instructions.len());
        }
        text
    }

    /// How often a trap was met.
    #[must_use]
    pub fn trap_count(&self, code: TrapCode) -> u64 {
        self.traps.get(&code).copied().unwrap_or(0)
    }
}

/// What a series of comparisons reached.
#[derive(Debug, Clone, Default)]
pub struct Statistics {
    /// Programs that were compared.
    pub programs: u64,
    /// Of these, those that also ran without fuel.
    pub without_fuel: u64,
    /// Entries that were run in each engine.
    pub runs: u64,
    /// Runs that ended in a trap.
    pub trapped: u64,
    /// What the evaluator ran.
    pub executed: Executed,
    /// What stands in the code of the programs.
    pub written: Executed,
    /// How many programs have each property.
    pub features: BTreeMap<&'static str, u64>,
    /// In how many programs each pass of native code changed something.
    pub passes: BTreeMap<&'static str, u64>,
    /// How many programs have about so many instructions: less than the key, and at least half of it.
    pub sizes: BTreeMap<usize, u64>,
}

fn add<K: Ord>(counts: &mut BTreeMap<K, u64>, later: BTreeMap<K, u64>) {
    for (key, count) in later {
        *counts.entry(key).or_default() += count;
    }
}

impl Figures for Statistics {
    fn merge(&mut self, later: Self) {
        self.programs += later.programs;
        self.without_fuel += later.without_fuel;
        self.runs += later.runs;
        self.trapped += later.trapped;
        self.executed.add(&later.executed);
        self.written.add(&later.written);
        add(&mut self.features, later.features);
        add(&mut self.passes, later.passes);
        add(&mut self.sizes, later.sizes);
    }
}

impl Statistics {
    /// Counts a program that has a property.
    pub fn feature(&mut self, name: &'static str, has: bool) {
        *self.features.entry(name).or_default() += u64::from(has);
    }

    /// Counts a program in which a pass changed something, or not.
    pub fn pass(&mut self, name: &'static str, has_fired: bool) {
        *self.passes.entry(name).or_default() += u64::from(has_fired);
    }

    /// Counts a program by its size.
    pub fn size(&mut self, instructions: usize) {
        *self.sizes.entry((instructions + 1).next_power_of_two()).or_default() += 1;
    }

    /// The figures as text.
    #[must_use]
    pub fn report(&self) -> String {
        let mut text = String::new();
        let runs = self.runs.max(1);
        // A String takes everything.
        let _ = writeln!(
            text,
            "programs {} (without fuel too: {}), runs {}, trapped {} ({}%)",
            self.programs,
            self.without_fuel,
            self.runs,
            self.trapped,
            self.trapped * 100 / runs
        );
        let _ = writeln!(text, "instructions executed {}, written {}", self.executed.total(), self.written.total());
        for (below, count) in &self.sizes {
            let _ = writeln!(text, "programs of {} to {} instructions: {count}", below / 2, below - 1);
        }
        text.push_str(&self.executed.coverage());
        for code in TrapCode::ALL {
            let _ = writeln!(text, "trap {}: {}", code.name(), self.executed.trap_count(*code));
        }
        for (name, count) in &self.features {
            let _ = writeln!(text, "programs with {name}: {count}");
        }
        for (name, count) in &self.passes {
            let _ = writeln!(text, "programs in which pass {name} changed something: {count}");
        }
        let _ = writeln!(text, "never executed: {:?}", self.executed.rare(1));
        text
    }
}
