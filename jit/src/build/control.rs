//! FOR loops.

use khz_bytecode::container::{ControlPlace, ForLoop};
use khz_bytecode::ids::{BlockId, ForId};
use khz_bytecode::value::SlotPlace;

use super::{Builder, mir_block};
use crate::mir::{Control, Counted, ForTest, LoopId, Op, Slot, Terminator, Value};

/// What the `for.enter` of a loop left for its `for.next`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ForState {
    /// Bound and step as values, where the loop is entered only by this `for.enter` (which then dominates it).
    values: Option<(Value, Value)>,
    /// Whether the control variable is written by these two instructions only.
    proven: bool,
}

impl Builder<'_> {
    pub(super) fn for_enter(&mut self, id: ForId, exit: BlockId, header: BlockId) -> Terminator {
        let descriptor = self.code.for_loops[id.index()];
        let (step, bound, initial) = (self.pop(), self.pop(), self.pop());
        self.effect(Op::CheckStep(step));
        self.effect(Op::Set(self.locals[descriptor.bound.index()], bound));
        self.effect(Op::Set(self.locals[descriptor.step.index()], step));
        let wrapped = self.wrap(descriptor.ty.storage(), initial);
        self.store_control(&descriptor, wrapped);
        let state = self.for_state(id, header, (bound, step));
        if state.proven {
            let control = self.control(&descriptor);
            let counted = Counted { ty: descriptor.ty, control, initial: wrapped, bound, step };
            let entered = self.out.blocks[mir_block(header).index()].innermost_loop;
            if let Some(id) = entered {
                self.out.loops[id.index()].counted = Some(counted);
            }
        }
        self.for_values[id.index()] = state;
        let test = ForTest { ty: descriptor.ty, control: wrapped, bound, step, not_passed: false };
        let empty = self.define(crate::mir::Type::I32, Op::ForIsEmpty(test));
        self.branch(empty, exit, header)
    }

    fn for_state(&self, id: ForId, header: BlockId, values: (Value, Value)) -> ForState {
        let block = mir_block(header);
        let innermost = self.out.blocks[block.index()].innermost_loop;
        let entered = innermost.filter(|id| self.out.loops[id.index()].header == block);
        let facts = entered.map(|loop_id: LoopId| &self.facts.loops[loop_id.index()]);
        match facts.filter(|facts| facts.for_loop == Some(id)) {
            Some(facts) => ForState { values: Some(values), proven: facts.control_is_proven },
            None => ForState::default(),
        }
    }

    pub(super) fn for_next(&mut self, id: ForId, header: BlockId, exit: BlockId) -> Terminator {
        let descriptor = self.code.for_loops[id.index()];
        let state = self.for_values[id.index()];
        let control = self.load_control(&descriptor);
        let (bound, step) = match state.values {
            Some(values) => values,
            None => {
                let ty = descriptor.ty.value_type().into();
                let bound = self.define(ty, Op::Get(self.locals[descriptor.bound.index()]));
                (bound, self.define(ty, Op::Get(self.locals[descriptor.step.index()])))
            }
        };
        let add = if descriptor.ty.value_type() == khz_bytecode::value::ValueType::I64 {
            khz_bytecode::instruction::NumericOp::I64Add
        } else {
            khz_bytecode::instruction::NumericOp::I32Add
        };
        let next = self.binary(add, control, step);
        let wrapped = self.wrap(descriptor.ty.storage(), next);
        self.store_control(&descriptor, wrapped);
        let test = ForTest { ty: descriptor.ty, control, bound, step, not_passed: state.proven };
        let again = self.define(crate::mir::Type::I32, Op::ForContinues(test));
        self.branch(again, header, exit)
    }

    fn control(&self, descriptor: &ForLoop) -> Control {
        match descriptor.control {
            ControlPlace::Slot(SlotPlace::Local, index) => Control::Var(self.locals[index.index()]),
            ControlPlace::Slot(place, index) => Control::Slot(Slot { place, index }),
            ControlPlace::Bytes(..) => Control::Memory,
        }
    }

    fn load_control(&mut self, descriptor: &ForLoop) -> Value {
        match descriptor.control {
            ControlPlace::Slot(SlotPlace::Local, index) => {
                let var = self.locals[index.index()];
                self.define(descriptor.ty.value_type().into(), Op::Get(var))
            }
            ControlPlace::Slot(place, index) => self.load_slot(Slot { place, index }),
            ControlPlace::Bytes(place, offset) => self.load_place(place, offset, descriptor.ty.storage()),
        }
    }

    fn store_control(&mut self, descriptor: &ForLoop, value: Value) {
        match descriptor.control {
            ControlPlace::Slot(place, index) => self.slot_store(place, index, value),
            ControlPlace::Bytes(place, offset) => self.store_place(place, offset, descriptor.ty.storage(), value),
        }
    }
}
