//! Spoiled containers and sources: what the reader, the verifier and the front end let through must still run the same in every engine, and
//! what they refuse must not hurt them.
//!
//! Two kinds of containers. Mutants of the file ([`bytes`](self)) change bits, bytes and numbers of it and get fresh hashes
//! ([`khz_bytecode::container::reseal`]), so that they reach what lies behind the hashes; nearly all break a rule. Mutants of the model change one thing that the
//! container says (an operand, an operation for another of the same shape, a bound, an offset, a right) or add something near a limit, and are
//! written as a file again; many are sound programs that no generator would write. [`KINDS`] is the list of the ways; each has a weight, so that rules behind which
//! few containers lie are reached as well. [`source`] spoils Structured Text.
//!
//! A [`Pool`] keeps the containers that are spoiled; a mutant follows from the pool and a seed alone.

use std::collections::BTreeMap;
use std::fmt::Write;

use khz_bytecode::container::{Container, ReadCode, read, reseal, write};
use khz_bytecode::verify::{Rule, Verified, verify};

use crate::bytecode::generate;
use crate::random::Random;

mod bytes;
mod code;
mod edges;
mod model;
pub mod source;

/// What became of a mutant.
#[derive(Debug)]
pub enum Verdict {
    /// It says more than a file can hold.
    Unwritable,
    /// It is no container.
    Unreadable(ReadCode),
    /// It breaks a rule.
    Refused(Rule),
    /// It verifies.
    Accepted(Box<Verified>),
}

impl Verdict {
    /// The code of what it breaks; `accepted` or `unwritable` when it breaks nothing.
    #[must_use]
    pub fn code(&self) -> String {
        match self {
            Verdict::Unwritable => "unwritable".to_string(),
            Verdict::Unreadable(code) => code.code().to_string(),
            Verdict::Refused(rule) => rule.code(),
            Verdict::Accepted(_) => "accepted".to_string(),
        }
    }
}

/// Reads and verifies bytes.
#[must_use]
pub fn classify(bytes: &[u8]) -> Verdict {
    match read(bytes) {
        Err(error) => Verdict::Unreadable(error.code),
        Ok(container) => match verify(container) {
            Err(error) => Verdict::Refused(error.rule),
            Ok(verified) => Verdict::Accepted(Box::new(verified)),
        },
    }
}

/// One way to spoil what a container says.
#[derive(Debug)]
pub struct Kind {
    /// Its name in reports.
    pub name: &'static str,
    /// How often it is chosen, relative to the others.
    weight: usize,
    /// Does it.
    spoil: fn(&mut Random, &mut Container),
}

/// Name in reports of the mutants of the file's bytes.
pub const BYTES_KIND: &str = "bytes";

/// Every way to spoil the model, with its weight of 20,000 or so.
#[rustfmt::skip]
pub const KINDS: &[Kind] = &[
    Kind { name: "code", weight: 11_000, spoil: code::spoil_code },
    Kind { name: "type", weight: 1_100, spoil: model::spoil_type },
    Kind { name: "function", weight: 1_100, spoil: model::spoil_function },
    Kind { name: "parameters", weight: 800, spoil: model::spoil_parameters },
    Kind { name: "constant", weight: 700, spoil: model::spoil_constant },
    Kind { name: "data", weight: 700, spoil: model::spoil_data },
    Kind { name: "tasks", weight: 800, spoil: model::spoil_tasks },
    Kind { name: "init image", weight: 700, spoil: model::spoil_init },
    Kind { name: "block rows", weight: 700, spoil: model::spoil_block_rows },
    Kind { name: "slots", weight: 500, spoil: model::spoil_slots },
    Kind { name: "programs", weight: 300, spoil: model::spoil_programs },
    Kind { name: "methods", weight: 300, spoil: model::spoil_methods },
    Kind { name: "retain map", weight: 300, spoil: model::spoil_retain },
    Kind { name: "task extensions", weight: 300, spoil: model::spoil_extensions },
    Kind { name: "system variables", weight: 300, spoil: model::spoil_system },
    Kind { name: "debug", weight: 200, spoil: model::spoil_debug },
    Kind { name: "repeated entries", weight: 150, spoil: edges::repeat_entries },
    Kind { name: "blocks in blocks", weight: 150, spoil: edges::nest_blocks },
    Kind { name: "checked references", weight: 150, spoil: edges::check_reference },
    Kind { name: "deep types", weight: 80, spoil: edges::deepen_types },
    Kind { name: "wide unions", weight: 80, spoil: edges::widen_unions },
    Kind { name: "deep loops", weight: 80, spoil: edges::deepen_loops },
    Kind { name: "many copies", weight: 4, spoil: edges::multiply_entries },
    Kind { name: "large stacks", weight: 1, spoil: edges::enlarge_stacks },
];

/// A container and its file.
#[derive(Debug, Clone)]
pub struct Base {
    container: Container,
    bytes: Vec<u8>,
}

impl Base {
    /// The container with its file; none when it can not be written.
    #[must_use]
    pub fn new(container: Container) -> Option<Base> {
        let bytes = write(&container).ok()?;
        Some(Base { container, bytes })
    }
}

/// A spoiled container.
#[derive(Debug, Clone)]
pub struct Mutant {
    /// Its file; none when it says more than a file can hold.
    pub bytes: Option<Vec<u8>>,
    /// What was done to it, in order: names of [`KINDS`], or [`BYTES_KIND`].
    pub kinds: Vec<&'static str>,
}

impl Mutant {
    /// Reads and verifies it.
    #[must_use]
    pub fn classify(&self) -> Verdict {
        self.bytes.as_deref().map_or(Verdict::Unwritable, classify)
    }
}

/// Spoils a container. `random` decides all.
#[must_use]
pub fn spoil(random: &mut Random, base: &Base) -> Mutant {
    if random.chance(75) {
        let mut container = base.container.clone();
        // Nobody can sign what others change; mutants of the file keep their signatures, which are wrong then.
        container.content_signature.clear();
        container.debug_signature.clear();
        let mut kinds = Vec::new();
        let weights: Vec<usize> = KINDS.iter().map(|kind| kind.weight).collect();
        for _ in 0..random.one_of([1, 1, 1, 2, 3]) {
            let kind = &KINDS[random.weighted(&weights)];
            (kind.spoil)(random, &mut container);
            kinds.push(kind.name);
        }
        return Mutant { bytes: write(&container).ok(), kinds };
    }
    let mut bytes = base.bytes.clone();
    for _ in 0..random.one_of([1, 1, 2, 5]) {
        bytes::spoil(random, &mut bytes);
    }
    reseal(&mut bytes);
    Mutant { bytes: Some(bytes), kinds: vec![BYTES_KIND] }
}

/// A spoiled form of a container, as file bytes; none when it can not be written.
pub fn mutant(random: &mut Random, container: &Container) -> Option<Vec<u8>> {
    spoil(random, &Base::new(container.clone())?).bytes
}

/// The mutants among `tries` of a generated container that verify, with their numbers: programs for the engines. The same for a seed on every machine.
pub fn accepted(seed: u64, tries: usize) -> impl Iterator<Item = (usize, Verified)> {
    let base = Base::new(generate(seed).container().clone());
    let mut random = Random::new(seed);
    (0..tries).filter_map(move |number| match spoil(&mut random, base.as_ref()?).classify() {
        Verdict::Accepted(verified) => Some((number, *verified)),
        _ => None,
    })
}

/// Containers to be spoiled, ascending by the size of their files.
#[derive(Debug, Clone)]
pub struct Pool {
    bases: Vec<Base>,
}

impl Pool {
    /// A pool of these containers; what can not be written is left out.
    pub fn new(containers: impl IntoIterator<Item = Container>) -> Pool {
        let mut bases: Vec<Base> = containers.into_iter().filter_map(Base::new).collect();
        // By content where sizes are equal: the order must not depend on that in which they came.
        bases.sort_by(|a, b| (a.bytes.len(), &a.bytes).cmp(&(b.bytes.len(), &b.bytes)));
        bases.dedup_by(|a, b| a.bytes == b.bytes);
        Pool { bases }
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bases.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bases.is_empty()
    }

    /// Bytes of the smallest, the middle and the largest file.
    #[must_use]
    pub fn sizes(&self) -> [usize; 3] {
        let size = |at: usize| self.bases.get(at).map_or(0, |base| base.bytes.len());
        [size(0), size(self.len() / 2), size(self.len().saturating_sub(1))]
    }

    /// The mutant of a seed: of a container among the smaller ones mostly, of any in one case of sixteen.
    ///
    /// # Panics
    /// When the pool is empty.
    #[must_use]
    pub fn mutant(&self, seed: u64) -> Mutant {
        let mut random = Random::new(seed);
        let any = random.below(self.len());
        let at =
            if random.below(16) == 0 { any } else { any.min(random.below(self.len())).min(random.below(self.len())) };
        spoil(&mut random, &self.bases[at])
    }
}

/// How many mutants went which way.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// By the code of what they break; "accepted" for those that verify.
    pub by_code: BTreeMap<String, u64>,
    /// All.
    pub total: u64,
    /// Those that verify.
    pub accepted: u64,
    /// For each kind how many mutants it had a part in, and how many of those verify.
    pub by_kind: BTreeMap<&'static str, (u64, u64)>,
}

impl Tally {
    /// Counts a mutant.
    pub fn count(&mut self, verdict: &Verdict) {
        let accepted = u64::from(matches!(verdict, Verdict::Accepted(_)));
        self.total += 1;
        self.accepted += accepted;
        *self.by_code.entry(verdict.code()).or_default() += 1;
    }

    /// Counts a mutant and what was done to it.
    pub fn count_mutant(&mut self, mutant: &Mutant, verdict: &Verdict) {
        self.count(verdict);
        let mut kinds = mutant.kinds.clone();
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            let (total, accepted) = self.by_kind.entry(kind).or_default();
            *total += 1;
            *accepted += u64::from(matches!(verdict, Verdict::Accepted(_)));
        }
    }

    /// Adds what another counted.
    pub fn add(&mut self, other: &Tally) {
        self.total += other.total;
        self.accepted += other.accepted;
        for (code, count) in &other.by_code {
            *self.by_code.entry(code.clone()).or_default() += count;
        }
        for (kind, (total, accepted)) in &other.by_kind {
            let own = self.by_kind.entry(kind).or_default();
            *own = (own.0 + total, own.1 + accepted);
        }
    }

    /// The rules that no mutant broke.
    #[must_use]
    pub fn unmet_rules(&self) -> Vec<Rule> {
        Rule::ALL.iter().copied().filter(|rule| !self.by_code.contains_key(&rule.code())).collect()
    }

    /// The figures as text, with the rules that no mutant broke. Shares are in millionths of all mutants.
    #[must_use]
    pub fn report(&self) -> String {
        let mut text = String::new();
        let millionths = |count: u64| count as f64 * 1e6 / self.total.max(1) as f64;
        // A String takes everything.
        let _ = writeln!(
            text,
            "mutants {}, accepted {} ({:.2}%)",
            self.total,
            self.accepted,
            millionths(self.accepted) / 1e4
        );
        for (code, count) in &self.by_code {
            let _ = writeln!(text, "  {code:<10} {count:>9}  {:>9.1} of a million", millionths(*count));
        }
        for (kind, (total, accepted)) in &self.by_kind {
            let share = *accepted as f64 * 100.0 / (*total).max(1) as f64;
            let _ = writeln!(text, "  {kind:<19} {total:>9} mutants, {accepted:>9} of them accepted ({share:.1}%)");
        }
        let unmet: Vec<String> = self.unmet_rules().iter().map(|rule| rule.code()).collect();
        let _ = writeln!(
            text,
            "rules that no mutant broke: {}",
            if unmet.is_empty() { "none".into() } else { unmet.join(" ") }
        );
        text
    }
}
