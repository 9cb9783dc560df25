//! Random inputs: what is located at %I, or where nothing is, VAR_INPUT of the program instances.

use std::ops::Range;

use khz_bytecode::container::{DebugPlace, ElementaryType};
use khz_bytecode::value::{BytePlace, ValueType};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::variables::{Domain, Variable, VariableTable};
use khz_proof::random::Random;

use crate::pipeline::Program;

/// Parts of one variable that get values, at most: of a large array the first ones.
const MAX_LEAVES: usize = 1000;
/// Parts that get values in all.
const MAX_INPUTS: usize = 10_000;
/// Percent of the other variables that change in a round, where they are meant too.
const STIR_PERCENT: usize = 4;
/// Percent of the inputs that change in a round. The others keep their value, so that timers run out and edges fall.
const CHANGE_PERCENT: usize = 40;
/// How the names begin that the scheduler writes the time to.
const SYSTEM_VARIABLES: &str = "__SYSTEM_";
/// Longest text that is given to a STRING.
const MAX_TEXT: usize = 40;

/// Gives values from a seed: at and around the places where programs decide otherwise.
#[derive(Debug, Clone)]
pub struct RandomInputs {
    random: Random,
    names: VariableTable,
    /// What changes, and how often: percent of the rounds.
    variables: Vec<(Variable, Domain, usize)>,
    /// %I where no variable is known by name: a stripped container's.
    nameless: Range<usize>,
    /// Bytes that were written last.
    written: Vec<Range<usize>>,
}

impl RandomInputs {
    /// The inputs of a program whose images have this layout. Variables in `kept` are left alone (names in any case).
    #[must_use]
    pub fn new(program: &Program, layout: &ImageLayout, seed: u64, kept: &[String]) -> RandomInputs {
        let names = VariableTable::of(program.container());
        let is_input = |place: DebugPlace| {
            matches!(place, DebugPlace::Bytes(BytePlace::Input, _) | DebugPlace::Bit(BytePlace::Input, ..))
        };
        let roots: Vec<Variable> = if layout.input.is_empty() {
            program.inputs.iter().filter_map(|name| names.resolve(name).ok()).collect()
        } else {
            names.variables().filter(|variable| is_input(variable.place)).collect()
        };
        let is_kept = |variable: &Variable| kept.iter().any(|name| name.eq_ignore_ascii_case(&variable.name));
        let leaves = roots.iter().flat_map(|root| names.leaves(root, MAX_LEAVES));
        let leaves = leaves.filter(|leaf| !leaf.constant && !is_kept(leaf)).take(MAX_INPUTS);
        let variables = leaves.filter_map(|leaf| names.domain(&leaf).map(|domain| (leaf, domain, CHANGE_PERCENT)));
        let variables = variables.collect();
        let region = layout.input.start as usize..layout.input.end as usize;
        let nameless = if names.variables().next().is_none() { region } else { 0..0 };
        RandomInputs { random: Random::new(seed), names, variables, nameless, written: Vec::new() }
    }

    /// Gives values to all other variables too, less often: states that a program would hardly come to. Those in `kept` are left alone.
    #[must_use]
    pub fn and_variables(mut self, kept: &[String]) -> RandomInputs {
        let is_kept = |variable: &Variable| {
            let is_input = self.variables.iter().any(|(input, ..)| input.name == variable.name);
            let is_clock = variable.name.starts_with(SYSTEM_VARIABLES);
            is_input || is_clock || kept.iter().any(|name| name.eq_ignore_ascii_case(&variable.name))
        };
        let leaves = self.names.variables().flat_map(|root| self.names.leaves(&root, MAX_LEAVES));
        let leaves = leaves.filter(|leaf| !leaf.constant && !is_kept(leaf)).take(MAX_INPUTS);
        let others: Vec<_> =
            leaves.filter_map(|leaf| self.names.domain(&leaf).map(|domain| (leaf, domain, STIR_PERCENT))).collect();
        self.variables.extend(others);
        self
    }

    /// Whether there is nothing to give values to.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.variables.is_empty() && self.nameless.is_empty()
    }

    /// Whether there are only bytes of %I, without variables to name them.
    #[must_use]
    pub fn is_nameless(&self) -> bool {
        !self.nameless.is_empty()
    }

    /// The variables that get values, by name.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.variables.iter().map(|(variable, ..)| variable.name.as_str())
    }

    /// Changes some inputs in the image.
    pub fn apply(&mut self, image: &mut Image) {
        self.written.clear();
        for byte in &mut image.bytes_mut()[self.nameless.clone()] {
            if self.random.chance(CHANGE_PERCENT) {
                *byte = if self.random.chance(30) { 0xFF } else { self.random.bits() as u8 };
            }
        }
        if !self.nameless.is_empty() {
            self.written.push(self.nameless.clone());
        }
        for (variable, domain, percent) in &self.variables {
            if !self.random.chance(*percent) {
                continue;
            }
            if let Domain::Text { wide, capacity } = domain {
                let units = text(&mut self.random, *wide, *capacity);
                self.names.write_units(image, variable, &units);
            } else {
                let bits = bits(&mut self.random, domain);
                self.names.write_bits(image, variable, bits);
            }
            self.written.extend(self.names.bytes_of(image.layout(), variable));
        }
    }

    /// Writes to another image what was written to `from` last.
    pub fn copy(&self, from: &Image, to: &mut Image) {
        for range in &self.written {
            to.bytes_mut()[range.clone()].copy_from_slice(&from.bytes()[range.clone()]);
        }
    }
}

fn bits(random: &mut Random, domain: &Domain) -> u64 {
    match domain {
        Domain::Elementary(ElementaryType::Bool) => random.bits() & 1,
        Domain::Elementary(ElementaryType::Time | ElementaryType::Ltime) if random.chance(70) => {
            // Durations that programs wait for, in whole milliseconds.
            random.between(0, 10_000).wrapping_mul(1_000_000) as u64
        }
        Domain::Elementary(ty) => match ty.storage().value_type() {
            float @ (ValueType::F32 | ValueType::F64) => random.value_bits(float),
            _ => random.integer(ty.storage().bytes() * 8) as u64,
        },
        Domain::Subrange { lower, upper, base } => subrange(random, *base, *lower, *upper),
        Domain::Values { values, .. } => random.pick(values).copied().unwrap_or(0) as u64,
        Domain::Text { .. } => 0,
    }
}

/// Half of the time an end of the range.
fn subrange(random: &mut Random, base: ElementaryType, lower: i64, upper: i64) -> u64 {
    if random.chance(50) {
        return (if random.chance(50) { lower } else { upper }) as u64;
    }
    if base == ElementaryType::Ulint && lower > upper {
        // Bits of unsigned numbers on both sides of the middle.
        return lower as u64 + random.bits() % (upper as u64 - lower as u64).max(1);
    }
    random.between(lower, upper) as u64
}

fn text(random: &mut Random, wide: bool, capacity: u16) -> Vec<u16> {
    let most = MAX_TEXT.min(usize::from(capacity));
    let length = if random.chance(20) { most } else { random.below(most.min(8) + 1) };
    let unit = |random: &mut Random| match random.below(8) {
        0 => random.between(0x80, if wide { 0xFFFD } else { 0xFF }) as u16,
        1 | 2 => random.between(i64::from(b'0'), i64::from(b'9')) as u16,
        _ => random.between(0x20, 0x7E) as u16,
    };
    (0..length).map(|_| unit(random)).collect()
}
