//! Calls to instructions.

use khz_bytecode::container::ElementaryType;
use khz_bytecode::instruction::Instruction as I;
use khz_bytecode::value::{BytePlace, LocalType, RefType, SlotPlace, Storage};

use super::body::{CallContext, FunctionBuilder};
use super::place::{Address, Home};
use crate::analysis::tree::{Call, Enabled, Expr, ExprKind, Place, PouInfo, Stmt, StmtKind, VarClass, VarId};
use crate::analysis::types::{Const, Ty, Value};
use crate::source::Span;

impl FunctionBuilder<'_, '_> {
    /// A call for its effects.
    pub(super) fn call_statement(&mut self, call: &Call) {
        if call.instance.is_some() {
            self.block_call(call);
            return;
        }
        if self.function_call(call).is_some() {
            self.e.push(I::Drop {}, 1, 0);
        }
    }

    /// A call for its result: a scalar on the stack, or a reference to a temporary.
    pub(super) fn call_value(&mut self, call: &Call, ty: Ty) {
        self.when_enabled(call.en.as_ref(), ty, &mut |this, is_enabled| {
            if is_enabled {
                this.function_call(call);
            }
            if !(is_enabled && call.eno_is_given) {
                this.eno(call.eno.as_ref(), is_enabled, call.span);
            }
        });
    }

    /// A standard function with EN or ENO: its value as [`Self::call_value`] leaves it.
    pub(super) fn enabled_value(&mut self, enabled: &Enabled, whole: &Expr) {
        let ty = whole.ty;
        let room = if self.b.project.types.storage(ty).is_none() { Some(self.temporary(ty)) } else { None };
        self.when_enabled(enabled.en.as_ref(), ty, &mut |this, is_enabled| {
            match room {
                _ if !is_enabled => {}
                None => this.value(&enabled.value),
                // Where it is, the other way must leave it too.
                Some(offset) => {
                    this.push_address(BytePlace::Frame, offset, ty);
                    this.assign_text_from(&enabled.value, ty);
                    this.push_address(BytePlace::Frame, offset, ty);
                }
            }
            this.eno(enabled.eno.as_ref(), is_enabled, whole.span);
        });
    }

    /// What `make` leaves when it is told TRUE; not enabled, what a variable of the type begins with.
    fn when_enabled(&mut self, en: Option<&Expr>, ty: Ty, make: &mut dyn FnMut(&mut Self, bool)) {
        let Some(en) = en else {
            make(self, true);
            return;
        };
        let skip = self.e.label();
        let end = self.e.label();
        self.jump_when(en, skip, false);
        make(self, true);
        self.e.push(I::Jump { target: end }, 0, 0);
        self.e.bind(skip);
        make(self, false);
        let default = self.b.project.types.default(ty);
        if self.b.project.types.storage(ty).is_some() {
            let elementary = self.elementary(ty);
            let value = match (default, elementary) {
                (Value::Scalar(value), _) => value,
                (_, ElementaryType::Real) => Const::F32(0.0),
                (_, ElementaryType::Lreal) => Const::F64(0.0),
                _ => Const::Int(0),
            };
            self.constant(&value, elementary);
        } else {
            let offset = self.temporary(ty);
            let from = self.b.template(ty, &default);
            self.push_address(BytePlace::Frame, offset, ty);
            self.push_address(BytePlace::Data, from, ty);
            let target = self.b.type_id(ty);
            self.e.push(I::Copy { target }, 2, 0);
            self.push_address(BytePlace::Frame, offset, ty);
        }
        self.e.bind(end);
    }

    /// Says whether what stands inside an expression was computed.
    fn eno(&mut self, eno: Option<&Place>, was_made: bool, span: Span) {
        let Some(target) = eno.cloned() else { return };
        let value = Expr { kind: ExprKind::Const(Const::Int(i64::from(was_made))), ty: target.ty, span };
        self.statement(&Stmt { kind: StmtKind::Assign { target, value }, span });
    }

    /// Calls a function. Leaves its result: `None` when it has none.
    fn function_call(&mut self, call: &Call) -> Option<Ty> {
        let info = self.b.called_info(call)?;
        let mut outputs: Vec<(VarId, Home)> = Vec::new();
        let mut count = 0;
        for (id, var) in (0u32..).map(VarId).zip(&info.vars) {
            let scalar = self.b.project.types.storage(var.ty).is_some();
            match var.class {
                VarClass::Input => {
                    let Some((_, value)) = call.inputs.iter().find(|(other, _)| *other == id) else { continue };
                    if scalar {
                        self.value(value);
                    } else {
                        self.composed_as(value, var.ty);
                    }
                    count += 1;
                }
                VarClass::InOut => {
                    let Some((_, place)) = call.inouts.iter().find(|(other, _)| *other == id) else { continue };
                    self.reference(place);
                    count += 1;
                }
                VarClass::Output | VarClass::Result if !scalar => {
                    let offset = self.temporary(var.ty);
                    self.push_address(BytePlace::Frame, offset, var.ty);
                    outputs.push((id, Home::Bytes(BytePlace::Frame, offset)));
                    count += 1;
                }
                _ => {}
            }
        }
        self.e.mark(call.span);
        let function = self.b.called(call);
        let results: Vec<(VarId, Ty)> =
            result_vars(&info).filter(|(_, ty)| self.b.project.types.storage(*ty).is_some()).collect();
        let pushes = u32::try_from(results.len()).unwrap_or(0);
        self.e.push(I::Call { function }, count, pushes);
        let scalar_result = info.result.filter(|id| results.iter().any(|(other, _)| other == id));
        let mut taken = Vec::new();
        for (id, ty) in results.iter().rev().filter(|(id, _)| Some(*id) != info.result) {
            let storage = self.b.project.types.storage(*ty).unwrap_or(Storage::U8);
            let slot = self.scratch(storage);
            self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
            outputs.push((*id, Home::Slot(SlotPlace::Local, slot)));
            taken.push(slot);
        }
        let result_home =
            info.result.and_then(|id| outputs.iter().find(|(other, _)| *other == id).map(|(_, home)| *home));
        self.calls.push(CallContext { instance: Home::None, outputs });
        for statement in &call.after {
            self.statement(statement);
        }
        self.calls.pop();
        for slot in taken {
            self.release(slot);
        }
        let result = info.result?;
        let ty = info.vars.get(result.0 as usize)?.ty;
        if scalar_result.is_none()
            && let Some(Home::Bytes(place, offset)) = result_home
        {
            self.push_address(place, offset, ty);
        }
        Some(ty)
    }

    /// Calls the body of a function block instance.
    fn block_call(&mut self, call: &Call) {
        let Some(instance) = &call.instance else { return };
        let home = match self.address(instance) {
            Address::Bytes(place, offset) => Home::Bytes(place, offset),
            _ => {
                // The way to it is walked once; the reference waits in a slot of its own.
                let target = self.b.type_id(instance.ty);
                let slot = self.reference_slot(RefType {
                    target,
                    write: true,
                    image: self.b.may_be_image(self.unit, instance),
                });
                self.e.push(I::SlotStore { place: SlotPlace::Local, index: slot }, 1, 0);
                Home::Ref(slot)
            }
        };
        self.calls.push(CallContext { instance: home, outputs: Vec::new() });
        for statement in &call.before {
            self.statement(statement);
        }
        match home {
            Home::Bytes(place, offset) => self.push_address(place, offset, instance.ty),
            Home::Ref(slot) => self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1),
            _ => {}
        }
        let mut count = 1;
        for (_, place) in &call.inouts {
            self.reference(place);
            count += 1;
        }
        self.e.mark(call.span);
        let function = self.b.called(call);
        self.e.push(I::Call { function }, count, 0);
        for statement in &call.after {
            self.statement(statement);
        }
        self.calls.pop();
    }

    fn reference_slot(&mut self, ty: RefType) -> khz_bytecode::ids::SlotIndex {
        self.local(LocalType::Ref(ty))
    }

    /// A composed value or string as an argument of exactly a type.
    fn composed_as(&mut self, value: &Expr, ty: Ty) {
        if self.b.actual(value.ty) == ty {
            self.composed(value);
            return;
        }
        let offset = self.temporary(ty);
        self.push_address(BytePlace::Frame, offset, ty);
        self.assign_text_from(value, ty);
        self.push_address(BytePlace::Frame, offset, ty);
    }
}

/// Result and outputs of a function in the order in which they are pushed.
pub(super) fn result_vars(info: &PouInfo) -> impl Iterator<Item = (VarId, Ty)> + '_ {
    let all = (0u32..).map(VarId).zip(&info.vars);
    all.filter(|(_, var)| matches!(var.class, VarClass::Result | VarClass::Output)).map(|(id, var)| (id, var.ty))
}
