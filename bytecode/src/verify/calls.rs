//! What holds between functions: no recursion, depth, frames, effects with those of callees.

use std::collections::BTreeSet;

use super::error::{Check, VerifyError};
use super::facts::{Effects, FunctionFacts, KnownPlace};
use super::rules::Rule;
use super::touch::TouchKind;
use super::typing::Draft;
use crate::container::{Container, Function, Owner};
use crate::ids::FunctionId;
use crate::limits::{FRAME_ALIGN_BYTES, MAX_ANALYSIS_ENTRIES};
use crate::value::{BytePlace, SlotPlace};

/// Effects that may be merged for each that may be listed: how often a list may be taken over by callers.
const MERGES_PER_ENTRY: usize = 8;

/// Functions in an order in which callees stand before their callers.
pub(super) fn callees_first(drafts: &[Draft]) -> Check<(Vec<FunctionId>, Vec<Vec<FunctionId>>)> {
    let callees: Vec<Vec<FunctionId>> = drafts.iter().map(callees).collect();
    let mut waiting: Vec<usize> = callees.iter().map(Vec::len).collect();
    let mut callers: Vec<Vec<FunctionId>> = vec![Vec::new(); drafts.len()];
    for (caller, own) in callees.iter().enumerate() {
        for callee in own {
            callers[callee.index()].push(FunctionId(caller as u16));
        }
    }
    let leaves = waiting.iter().enumerate().filter(|(_, count)| **count == 0);
    let mut order: Vec<FunctionId> = leaves.map(|(index, _)| FunctionId(index as u16)).collect();
    let mut next = 0;
    while let Some(done) = order.get(next).copied() {
        next += 1;
        for caller in &callers[done.index()] {
            waiting[caller.index()] -= 1;
            if waiting[caller.index()] == 0 {
                order.push(*caller);
            }
        }
    }
    match waiting.iter().position(|count| *count > 0) {
        None => Ok((order, callees)),
        Some(stuck) => {
            let cycle = find_cycle(&callees, &waiting, stuck);
            let text: Vec<String> = cycle.iter().map(ToString::to_string).collect();
            let message = format!("functions call each other in a circle: {}", text.join(" → "));
            Err(VerifyError::header(Rule::Recursion, cycle.first().copied().unwrap_or_default(), message))
        }
    }
}

fn callees(draft: &Draft) -> Vec<FunctionId> {
    let calls = draft.touches.iter().filter_map(|touch| match touch.kind {
        TouchKind::Call { function, .. } => Some(function),
        _ => None,
    });
    let unique: BTreeSet<FunctionId> = calls.collect();
    unique.into_iter().collect()
}

/// A circle of calls; every function that still waits calls another that waits.
fn find_cycle(callees: &[Vec<FunctionId>], waiting: &[usize], start: usize) -> Vec<FunctionId> {
    const SHOWN: usize = 16;
    let mut seen_at = vec![None; callees.len()];
    let mut path = Vec::new();
    let mut at = FunctionId(start as u16);
    while seen_at[at.index()].is_none() {
        seen_at[at.index()] = Some(path.len());
        path.push(at);
        match callees[at.index()].iter().find(|callee| waiting[callee.index()] > 0) {
            Some(next) => at = *next,
            None => break,
        }
    }
    let mut cycle = path.split_off(seen_at[at.index()].unwrap_or(0));
    cycle.truncate(SHOWN);
    cycle.push(at);
    cycle
}

/// Fills depth, frames and effects of every function.
pub(super) fn close(
    container: &Container,
    drafts: &[Draft],
    types_size: impl Fn(&Function) -> u32,
    facts: &mut [FunctionFacts],
) -> Check {
    let (order, callees) = callees_first(drafts)?;
    // Direct calls alone can not go deeper than was proved; only a virtual call can bring a function anywhere.
    let any_virtual = drafts.iter().any(|d| d.touches.iter().any(|t| matches!(t.kind, TouchKind::CallVirtual(_))));
    let (mut entries, mut merged) = (0, 0);
    for id in order {
        let function = &container.functions[id.index()];
        let own_callees = &callees[id.index()];
        let mut depth = 0;
        let mut frames = 0;
        for callee in own_callees {
            depth = depth.max(facts[callee.index()].call_depth);
            frames = frames.max(facts[callee.index()].frame_bytes_with_callees);
        }
        let frame = u64::from(types_size(function)).next_multiple_of(u64::from(FRAME_ALIGN_BYTES));
        let total = frame + u64::from(frames);
        let limit = container.parameters.frame_bytes;
        if total > u64::from(limit) {
            let message = format!("it and what it calls need {total} frame bytes; the header gives {limit}");
            return Err(VerifyError::header(Rule::FrameBytes, id, message));
        }
        if depth >= container.parameters.max_call_depth {
            let message = format!(
                "calls nest {} deep; max_call_depth is {}",
                u32::from(depth) + 1,
                container.parameters.max_call_depth
            );
            return Err(VerifyError::header(Rule::CallDepth, id, message));
        }
        // What is merged counts, too: many callers of many callees take time although their union is small.
        let inner = own_callees.iter().map(|callee| entry_count(&facts[callee.index()].effects));
        merged = inner.fold(merged, usize::saturating_add);
        let too_many = || VerifyError::header(Rule::AnalysisSize, id, "the effects of functions are too many");
        if merged > MAX_ANALYSIS_ENTRIES * MERGES_PER_ENTRY {
            return Err(too_many());
        }
        let effects = effects(function, &drafts[id.index()], own_callees, facts, any_virtual);
        entries += entry_count(&effects);
        if entries > MAX_ANALYSIS_ENTRIES {
            return Err(too_many());
        }
        let confined = own_callees.iter().all(|callee| facts[callee.index()].is_confined);
        let facts = &mut facts[id.index()];
        facts.is_confined = confined && !drafts[id.index()].reaches_out;
        facts.call_depth = depth + 1;
        // Both are below the limit, which is a u32.
        facts.frame_bytes = frame as u32;
        facts.frame_bytes_with_callees = total as u32;
        facts.calls_virtual = !effects.virtual_calls.is_empty();
        facts.effects = effects;
        facts.max_stack = drafts[id.index()].max_stack;
    }
    Ok(())
}

fn entry_count(effects: &Effects) -> usize {
    effects.globals_read.len()
        + effects.globals_written.len()
        + effects.program_read.len()
        + effects.program_written.len()
        + effects.bytes_read.len()
        + effects.bytes_written.len()
        + effects.read_through_references.len()
        + effects.written_through_references.len()
        + effects.virtual_calls.len()
}

/// Effects of one function whose callees' are known.
fn effects(
    function: &Function,
    draft: &Draft,
    callees: &[FunctionId],
    facts: &[FunctionFacts],
    any_virtual: bool,
) -> Effects {
    let mut effects = own_effects(function, draft);
    effects.traps |= any_virtual && (!callees.is_empty() || !effects.virtual_calls.is_empty());
    for callee in callees {
        let inner = &facts[callee.index()].effects;
        effects.globals_read.extend(&inner.globals_read);
        effects.globals_written.extend(&inner.globals_written);
        // A callee that names program slots belongs to the same program.
        effects.program_read.extend(&inner.program_read);
        effects.program_written.extend(&inner.program_written);
        effects.bytes_read.extend(&inner.bytes_read);
        effects.bytes_written.extend(&inner.bytes_written);
        effects.read_through_references.extend(&inner.read_through_references);
        effects.written_through_references.extend(&inner.written_through_references);
        effects.virtual_calls.extend(&inner.virtual_calls);
        effects.raw_writes |= inner.raw_writes;
        effects.traps |= inner.traps;
    }
    effects
}

fn own_effects(function: &Function, draft: &Draft) -> Effects {
    let owner = match function.owner {
        Owner::None => 0,
        Owner::Program(program) => program.0,
        Owner::Block(ty) => ty.0,
    };
    let known = |place: BytePlace, offset: u32| {
        let owner = if matches!(place, BytePlace::Block | BytePlace::This) { owner } else { 0 };
        KnownPlace { place, owner, offset }
    };
    let mut effects = Effects { traps: draft.traps, ..Effects::default() };
    for touch in &draft.touches {
        match touch.kind {
            TouchKind::SlotRead(SlotPlace::Global, slot) => _ = effects.globals_read.insert(slot),
            TouchKind::SlotWrite(SlotPlace::Global, slot) => _ = effects.globals_written.insert(slot),
            TouchKind::SlotRead(SlotPlace::Program, slot) => _ = effects.program_read.insert(slot),
            TouchKind::SlotWrite(SlotPlace::Program, slot) => _ = effects.program_written.insert(slot),
            TouchKind::SlotRead(SlotPlace::Local, _) | TouchKind::SlotWrite(SlotPlace::Local, _) => {}
            TouchKind::BytesRead(BytePlace::Frame, _) | TouchKind::BytesWrite(BytePlace::Frame, ..) => {}
            TouchKind::BytesRead(place, offset) => _ = effects.bytes_read.insert(known(place, offset)),
            TouchKind::BytesWrite(place, offset, _) => _ = effects.bytes_written.insert(known(place, offset)),
            TouchKind::ReferenceRead(reference) => _ = effects.read_through_references.insert(reference.target),
            TouchKind::ReferenceWrite { reference, origin } => {
                effects.written_through_references.insert(reference.target);
                // A reference that `address` made in this function was not made from an integer.
                effects.raw_writes |= reference.image && origin.is_none();
            }
            TouchKind::Call { .. } => {}
            TouchKind::CallVirtual(method) => _ = effects.virtual_calls.insert(method),
        }
    }
    effects
}
