//! What was made, what ran, and how it ended: a proof is worth what it reached.

use std::collections::BTreeMap;
use std::fmt::Write;

use khz_bytecode::instruction::{ControlOp, HelperOp, Instruction, NumericOp};
use khz_bytecode::trap::TrapCode;

use crate::campaign::Figures;

/// Opcodes lie below this.
const OPCODES: usize = 0x400;

/// Names of every instruction, by opcode.
fn names() -> BTreeMap<usize, &'static str> {
    let control = ControlOp::ALL.iter().map(|op| (*op as usize, op.mnemonic()));
    let numeric = NumericOp::ALL.iter().map(|op| (*op as usize, op.mnemonic()));
    let helpers = HelperOp::ALL.iter().map(|op| (*op as usize, op.mnemonic()));
    control.chain(numeric).chain(helpers).collect()
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
        names().into_iter().filter(|(opcode, _)| self.counts[*opcode] < least).map(|(_, name)| name).collect()
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
}

impl Figures for Statistics {
    fn merge(&mut self, later: Self) {
        self.programs += later.programs;
        self.without_fuel += later.without_fuel;
        self.runs += later.runs;
        self.trapped += later.trapped;
        self.executed.add(&later.executed);
        self.written.add(&later.written);
        for (name, count) in later.features {
            *self.features.entry(name).or_default() += count;
        }
    }
}

impl Statistics {
    /// Counts a program that has a property.
    pub fn feature(&mut self, name: &'static str, has: bool) {
        *self.features.entry(name).or_default() += u64::from(has);
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
        for code in TrapCode::ALL {
            let _ = writeln!(text, "trap {}: {}", code.name(), self.executed.trap_count(*code));
        }
        for (name, count) in &self.features {
            let _ = writeln!(text, "programs with {name}: {count}");
        }
        let _ = writeln!(text, "never executed: {:?}", self.executed.rare(1));
        let _ = writeln!(text, "executed less than 100 times: {:?}", self.executed.rare(100));
        text
    }
}
