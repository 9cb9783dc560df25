//! The proof that nothing but `for.enter` and `for.next` writes the control variable of a FOR loop.
//!
//! Slots are never aliased, so for a control variable in a slot it is enough to look for stores to that slot and for callees that
//! write it. For one in byte memory every write in the body must be shown to go elsewhere: by its known place, by the extent its
//! reference came from, or because typed memory has no scalar of this storage where it writes. When in doubt, it is not proven.

use super::facts::{Effects, FunctionFacts, KnownPlace};
use super::scope::Scope;
use super::touch::TouchKind;
use super::types::Wanted;
use super::typing::Draft;
use crate::canary::{Fault, planted};
use crate::container::{ControlPlace, ForLoop, Owner, Type};
use crate::ids::{ForId, TypeId};
use crate::value::{BytePlace, SlotPlace, Storage};

/// Whether FOR loop `id` of a function, over the blocks of loop `number`, keeps its control variable. Each step taken counts down
/// `steps`; at 0 nothing is proven any more.
pub(super) fn control_is_proven(
    scope: &Scope<'_, '_>,
    own: &FunctionFacts,
    number: usize,
    id: ForId,
    draft: &Draft,
    facts: &[FunctionFacts],
    steps: &mut usize,
) -> bool {
    let Some(descriptor) = scope.function.for_loops.get(id.index()) else { return false };
    let proof = Proof { scope, draft, facts, descriptor };
    let touches = &draft.touches;
    own.loops[number].blocks.iter().all(|block| {
        let block = &own.blocks[block.index()];
        let first = touches.partition_point(|touch| touch.instruction < block.start);
        let touches = touches[first..].iter().take_while(|touch| touch.instruction < block.end);
        let mut touches = touches.filter(|touch| {
            use crate::instruction::Instruction::ForNext;
            // Its own `for.next` is what moves it on; its `for.enter` is outside.
            !matches!(own.instructions[touch.instruction].instruction, ForNext { id: next, .. } if next == id)
        });
        touches.all(|touch| {
            let cost = match touch.kind {
                TouchKind::Call { function: callee, .. } if matches!(descriptor.control, ControlPlace::Bytes(..)) => {
                    let effects = &facts[callee.index()].effects;
                    1 + effects.bytes_written.len() + effects.written_through_references.len()
                }
                _ => 1,
            };
            *steps = steps.saturating_sub(cost);
            *steps > 0 && proof.keeps(touch.kind)
        })
    })
}

struct Proof<'s, 'a, 'c> {
    scope: &'s Scope<'a, 'c>,
    draft: &'s Draft,
    facts: &'s [FunctionFacts],
    descriptor: &'s ForLoop,
}

impl Proof<'_, '_, '_> {
    fn keeps(&self, touch: TouchKind) -> bool {
        if planted(Fault::Verifier) && matches!(touch, TouchKind::Call { .. }) {
            return true;
        }
        match (self.descriptor.control, touch) {
            (ControlPlace::Slot(place, slot), TouchKind::SlotWrite(to, written)) => (place, slot) != (to, written),
            (ControlPlace::Slot(place, slot), TouchKind::Call { function: callee, .. }) => {
                let effects = &self.facts[callee.index()].effects;
                match place {
                    SlotPlace::Local => true,
                    SlotPlace::Program => !effects.program_written.contains(&slot),
                    SlotPlace::Global => !effects.globals_written.contains(&slot) && effects.virtual_calls.is_empty(),
                }
            }
            // A function block's method has no way to the slots of a program, but to those of all.
            (ControlPlace::Slot(place, _), TouchKind::CallVirtual(_)) => place != SlotPlace::Global,
            (ControlPlace::Slot(..), _) => true,
            (ControlPlace::Bytes(place, offset), touch) => self.keeps_bytes(place, offset, touch),
        }
    }

    fn storage(&self) -> Storage {
        self.descriptor.ty.storage()
    }

    fn keeps_bytes(&self, place: BytePlace, offset: u32, touch: TouchKind) -> bool {
        match touch {
            TouchKind::BytesWrite(to, written, storage) => {
                self.keeps_known(place, offset, to, written, u64::from(storage.bytes()), storage == self.storage())
            }
            TouchKind::ReferenceWrite { reference, origin: Some(origin) } => {
                let same = self.may_hold(reference.target);
                self.keeps_known(place, offset, origin.place, origin.start, u64::from(origin.size), same)
            }
            TouchKind::ReferenceWrite { reference, origin: None } => {
                !reference.image && !self.may_hold(reference.target)
            }
            TouchKind::Call { function, first, count } => {
                let callee = &self.facts[function.index()];
                (callee.is_confined && self.keeps_arguments(place, offset, first, count))
                    || self.keeps_callee(place, offset, &callee.effects)
            }
            TouchKind::CallVirtual(_) => false,
            _ => true,
        }
    }

    /// Whether a write of `bytes` at `to` `written` misses the control variable; `same_storage`: it may write a scalar of the control
    /// variable's storage (only such a write can meet it, where memory has no unions).
    fn keeps_known(
        &self,
        place: BytePlace,
        offset: u32,
        to: BytePlace,
        written: u32,
        bytes: u64,
        same_storage: bool,
    ) -> bool {
        if place == to {
            let (start, end) = (u64::from(offset), u64::from(offset) + u64::from(self.storage().bytes()));
            return u64::from(written) >= end || u64::from(written) + bytes <= start;
        }
        if place.is_image() || to.is_image() {
            return true;
        }
        // Frame bytes are apart from variables; `t` may be anywhere where a block instance may be.
        let apart = matches!(
            (place, to),
            (BytePlace::Frame, BytePlace::Data | BytePlace::Block)
                | (BytePlace::Data | BytePlace::Block, BytePlace::Frame)
        );
        apart || !(same_storage || self.scope.types.any_union())
    }

    /// Whether a scalar of the control variable's storage may lie in a target of this type.
    fn may_hold(&self, target: TypeId) -> bool {
        if self.scope.types.any_union()
            || matches!(self.descriptor.control, ControlPlace::Bytes(place, _) if place.is_image())
        {
            return true;
        }
        match self.scope.types.get(target) {
            Some(Type::Scalar(storage)) => *storage == self.storage(),
            Some(Type::String { .. } | Type::WideString { .. }) => false,
            _ => true,
        }
    }

    /// Whether a confined callee, which writes only where its arguments point, misses the control variable.
    fn keeps_arguments(&self, place: BytePlace, offset: u32, first: usize, count: usize) -> bool {
        let arguments = self.draft.arguments.iter().skip(first).take(count);
        let mut arguments = arguments.map(|origin| origin.as_ref());
        // It may write %M and %Q wherever it likes.
        !place.is_image()
            && arguments.all(|origin| {
                origin.is_some_and(|o| self.keeps_known(place, offset, o.place, o.start, u64::from(o.size), true))
            })
    }

    fn keeps_callee(&self, place: BytePlace, offset: u32, effects: &Effects) -> bool {
        let through = effects.written_through_references.iter().any(|target| self.may_hold(*target));
        if effects.raw_writes || !effects.virtual_calls.is_empty() || through {
            return false;
        }
        effects.bytes_written.iter().all(|known| self.keeps_callee_write(place, offset, *known))
    }

    fn keeps_callee_write(&self, place: BytePlace, offset: u32, known: KnownPlace) -> bool {
        if known.place.is_image() {
            // Its width is not listed: 8 bytes at most.
            return place != known.place || !near(offset, known.offset);
        }
        if place.is_image() {
            return true;
        }
        if place == BytePlace::Frame && matches!(known.place, BytePlace::Data | BytePlace::Block) {
            return true;
        }
        let own = match self.scope.function.owner {
            Owner::None => 0,
            Owner::Program(program) => program.0,
            Owner::Block(ty) => ty.0,
        };
        let is_same_place = place == known.place && matches!(place, BytePlace::Data | BytePlace::Block);
        if is_same_place && (place == BytePlace::Data || own == known.owner) && !self.scope.types.any_union() {
            // Two scalars at known places of one memory overlap only when they are one.
            return offset != known.offset;
        }
        let root = match known.place {
            BytePlace::This => Some((TypeId(known.owner), known.offset)),
            BytePlace::Data => {
                let variable = self.scope.types.data_variable(known.offset);
                variable.map(|variable| (variable.ty, known.offset - variable.offset))
            }
            _ => None,
        };
        let same = root.is_none_or(|(ty, inside)| self.scope.types.meets(ty, inside, Wanted::Scalar(self.storage())));
        !(same || self.scope.types.any_union())
    }
}

fn near(a: u32, b: u32) -> bool {
    a.abs_diff(b) < 8
}
