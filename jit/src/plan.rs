//! What has to be compiled, and for whose memory.

use std::collections::{BTreeMap, BTreeSet};

use khz_bytecode::container::{Owner, Region, Type};
use khz_bytecode::ids::{FunctionId, MethodId};
use khz_bytecode::instruction::Instruction;
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::value::Storage;
use khz_bytecode::verify::Verified;
use khz_machine::image::ImageLayout;

use crate::SHARED_FROM_INSTANCES;
use crate::build::{ProgramMemory, Scope};
use crate::code::Key;
use crate::passes::inline;

/// What all functions of a container are compiled under.
pub(crate) fn scope<'a>(verified: &'a Verified, layout: &'a ImageLayout) -> Scope<'a> {
    Scope { verified, layout, clean_bools: initial_bools_are_clean(verified) }
}

/// Whether every initial value of a BOOL slot is 0 or 1. Code only ever stores these.
fn initial_bools_are_clean(verified: &Verified) -> bool {
    let types = &verified.container().types;
    let runs = types.init_image.iter().filter(|run| run.region == Region::Slots);
    runs.into_iter().all(|run| {
        let bytes = run.bytes.iter().cycle().take(run.bytes.len().saturating_mul(run.repeat as usize));
        let first = run.offset as usize;
        bytes.enumerate().all(|(position, byte)| {
            let at = first + position;
            let slot = types.slots.get(at / SLOT_BYTES as usize);
            *byte <= 1 || slot != Some(&Storage::Bool) || !at.is_multiple_of(SLOT_BYTES as usize)
        })
    })
}

/// One entry of the container: its function, and what its memory is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EntryPoint {
    /// What is run.
    pub key: Key,
    /// Image offsets of the instance's slots and data block, where its code is shared.
    pub shared: Option<(u32, u32)>,
}

/// Functions to compile, each for the memory it works on.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    /// The init function.
    pub init: Option<EntryPoint>,
    /// The startup function.
    pub startup: Option<EntryPoint>,
    /// By position in the task table.
    pub instances: Vec<EntryPoint>,
    /// Everything that is reached, and what it calls directly.
    pub functions: BTreeMap<Key, BTreeSet<Key>>,
    /// Whether anything calls virtually, so that calls may recurse.
    pub calls_virtual: bool,
    /// Instructions of everything that is reached, bytes of their encoding, and what inlining may add: what memory is set aside for.
    pub instructions: usize,
}

impl Plan {
    pub fn new(scope: &Scope<'_>) -> Plan {
        let container = scope.verified.container();
        let plain = |function: FunctionId| EntryPoint { key: (function, ProgramMemory::None), shared: None };
        let mut plan = Plan {
            init: container.parameters.init_function.map(plain),
            startup: container.parameters.startup_function.map(plain),
            instances: instances(scope),
            ..Plan::default()
        };
        let entries = plan.init.iter().chain(&plan.startup).chain(&plan.instances);
        let mut open: Vec<Key> = entries.map(|entry| entry.key).collect();
        let mut methods = BTreeSet::new();
        loop {
            while let Some(key) = open.pop() {
                if !plan.functions.contains_key(&key) {
                    let callees = plan.callees(scope, key, &mut methods);
                    open.extend(callees.iter().copied());
                    plan.functions.insert(key, callees);
                }
            }
            if methods.is_empty() {
                return plan;
            }
            open = meanings(scope, &std::mem::take(&mut methods));
        }
    }

    fn callees(&mut self, scope: &Scope<'_>, key: Key, methods: &mut BTreeSet<MethodId>) -> BTreeSet<Key> {
        let functions = &scope.verified.container().functions;
        let facts = scope.verified.function(key.0);
        self.instructions += facts.instructions.len() + functions[key.0.index()].code.len() / 8;
        let calls = facts.instructions.iter().filter(|placed| matches!(placed.instruction, Instruction::Call { .. }));
        // An instruction of the mid-level form takes far fewer bytes than is set aside for one of bytecode.
        self.instructions += inline::most_growth(calls.count()) / 8;
        let mut callees = BTreeSet::new();
        for placed in &facts.instructions {
            match placed.instruction {
                Instruction::Call { function } => {
                    let of_program = matches!(functions[function.index()].owner, Owner::Program(_));
                    callees.insert((function, if of_program { key.1 } else { ProgramMemory::None }));
                }
                Instruction::CallVirtual { method } => {
                    self.calls_virtual = true;
                    methods.insert(method);
                }
                _ => {}
            }
        }
        callees
    }
}

/// Every function that one of these method names may mean.
fn meanings(scope: &Scope<'_>, names: &BTreeSet<MethodId>) -> Vec<Key> {
    let blocks = scope.verified.container().types.types.iter();
    let methods = blocks.filter_map(|ty| match ty {
        Type::Block { methods, .. } => Some(methods),
        _ => None,
    });
    let meant = methods.flatten().filter(|(method, _)| names.contains(method));
    meant.map(|(_, function)| (*function, ProgramMemory::None)).collect()
}

fn instances(scope: &Scope<'_>) -> Vec<EntryPoint> {
    let facts = scope.verified.facts();
    let mut counts: BTreeMap<_, usize> = BTreeMap::new();
    for program in &facts.instance_programs {
        *counts.entry(*program).or_default() += 1;
    }
    let table = scope.verified.container().tasks.instances.iter();
    let known = facts.instance_programs.iter().zip(&facts.instance_blocks);
    let entries = table.zip(known).map(|(instance, (program, block))| {
        let (slots, block) = (u32::from(instance.slot_offset), block.unwrap_or(0));
        if counts.get(program).is_some_and(|count| *count >= SHARED_FROM_INSTANCES) {
            let slots = scope.layout.slots.start + slots * SLOT_BYTES;
            let shared = Some((slots, scope.layout.data.start + block));
            EntryPoint { key: (instance.entry, ProgramMemory::Shared), shared }
        } else {
            EntryPoint { key: (instance.entry, ProgramMemory::Instance { slots, block }), shared: None }
        }
    });
    entries.collect()
}
