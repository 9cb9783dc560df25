//! One function for each program organisation unit.

use khz_bytecode::container::{Function, Owner, ProgramType};
use khz_bytecode::ids::{FunctionId, ProgramId};
use khz_bytecode::instruction::Instruction as I;
use khz_bytecode::value::{BytePlace, LocalType, RefType, SlotPlace, Storage};

use super::body::FunctionBuilder;
use super::call::result_vars;
use super::open::has_open;
use super::place::Home;
use super::{Builder, FunctionCost};
use crate::analysis::tree::{BlockTask, InstancePlan, PouId, PouInfo, VarClass, VarId, VarInfo};
use crate::analysis::types::{Const, Ty, Value};
use crate::source::Span;
use crate::syntax::ast::PouKind;

impl<'p> Builder<'p> {
    /// All units that the resource reaches.
    pub(super) fn lower_units(&mut self) {
        let plan = self.plan;
        for (pou, _) in &plan.bodies {
            if self.info(*pou).is_some_and(|info| !has_open(self, &info)) {
                let id = FunctionId(self.id16(self.function_ids.len(), "functions"));
                self.function_ids.insert(*pou, id);
            }
        }
        for (pou, body) in &plan.bodies {
            let Some(info) = self.info(*pou).filter(|_| self.function_ids.contains_key(pou)) else { continue };
            let (function, marks, cost) = self.lower_unit(*pou, &info, &body.statements);
            self.add_function(info.name.clone(), function, marks, cost);
        }
        self.lower_instances();
    }

    pub(super) fn add_function(
        &mut self,
        name: String,
        function: Function,
        marks: Vec<(u32, Span)>,
        cost: FunctionCost,
    ) -> FunctionId {
        let id = FunctionId(self.id16(self.functions.len(), "functions"));
        self.functions.push(function);
        self.function_names.push(name);
        self.marks.push((id, marks));
        self.costs.push(cost);
        id
    }

    fn owner(&mut self, pou: PouId, info: &PouInfo) -> Owner {
        match info.kind {
            PouKind::Function => Owner::None,
            PouKind::Program => Owner::Program(self.programs.get(&pou).copied().unwrap_or_default()),
            PouKind::FunctionBlock => {
                info.block.map_or(Owner::None, |block| Owner::Block(self.type_id(Ty::User(block))))
            }
        }
    }

    pub(super) fn lower_unit(
        &mut self,
        pou: PouId,
        info: &PouInfo,
        statements: &'p [crate::analysis::tree::Stmt],
    ) -> (Function, Vec<(u32, Span)>, FunctionCost) {
        let owner = self.owner(pou, info);
        let homes = self.unit_homes.get(&pou).cloned().unwrap_or_default();
        let mut f = FunctionBuilder::new(self, Some(pou));
        f.homes = homes;
        f.homes.resize(info.vars.len(), Home::None);
        let hidden = f.declare_parameters(pou, info);
        f.declare_locals(info);
        f.e.mark(info.span);
        f.enter(info, &hidden);
        f.statements(statements);
        let info_for_end = info;
        f.finish(owner, |f| f.leave(info_for_end, &hidden))
    }

    /// The entry of an instance that has connections: copies in, calls the body, copies out.
    pub(super) fn lower_entry(&mut self, instance: &InstancePlan, info: &PouInfo) -> FunctionId {
        let owner = self.owner(instance.program, info);
        let function = self.function_id(instance.program);
        let homes = self.unit_homes.get(&instance.program).cloned().unwrap_or_default();
        let mut f = FunctionBuilder::new(self, Some(instance.program));
        f.homes = homes;
        f.e.mark(instance.span);
        f.statements(&instance.copy_in);
        for (_, place) in &instance.inouts {
            f.reference(place);
        }
        f.e.mark(instance.span);
        f.e.push(I::Call { function }, u32::try_from(instance.inouts.len()).unwrap_or(0), 0);
        f.statements(&instance.copy_out);
        let (function, marks, cost) = f.finish(owner, |_| {});
        self.add_function(instance.name.clone(), function, marks, cost)
    }

    /// The entry of a function block instance that a task runs. It belongs to a program without variables, and reaches the instance where it lies
    /// in the data region: `data` is where the variables of its program instance begin.
    pub(super) fn lower_block_entry(
        &mut self,
        instance: &InstancePlan,
        info: &PouInfo,
        block: &BlockTask,
        data: u32,
    ) -> FunctionId {
        let place = self.unit_homes.get(&instance.program).and_then(|homes| homes.get(block.var.0 as usize)).copied();
        let offset = match place {
            Some(Home::Bytes(BytePlace::Block, offset)) => data.saturating_add(offset),
            _ => data,
        };
        let empty = ProgramType::default();
        let known = self.section.programs.iter().position(|program| *program == empty);
        let owner = known.unwrap_or_else(|| {
            self.section.programs.push(empty);
            self.section.programs.len() - 1
        });
        let owner = Owner::Program(ProgramId(self.id16(owner, "program types")));
        let function = self.function_id(block.block);
        let mut f = FunctionBuilder::new(self, Some(instance.program));
        f.homes = vec![Home::None; info.vars.len()];
        f.set_home(block.var, Home::Bytes(BytePlace::Data, offset));
        f.e.mark(block.span);
        f.statements(&block.copy_in);
        if let Some(var) = info.vars.get(block.var.0 as usize) {
            f.push_address(BytePlace::Data, offset, var.ty);
        }
        f.e.mark(block.span);
        f.e.push(I::Call { function }, 1, 0);
        f.statements(&block.copy_out);
        let (function, marks, cost) = f.finish(owner, |_| {});
        self.add_function(block.name.clone(), function, marks, cost)
    }

    /// A function that calls another and drops its results.
    pub(super) fn lower_startup(&mut self, pou: PouId, info: &PouInfo) -> FunctionId {
        let function = self.function_id(pou);
        let results: Vec<Ty> = result_vars(info).map(|(_, ty)| ty).collect();
        if results.is_empty() {
            return function;
        }
        let mut f = FunctionBuilder::new(self, None);
        f.e.mark(info.span);
        let (mut arguments, mut pushed) = (0, 0);
        for ty in results {
            if f.b.project.types.storage(ty).is_some() {
                pushed += 1;
            } else {
                let offset = f.frame_room(ty);
                f.push_address(BytePlace::Frame, offset, ty);
                arguments += 1;
            }
        }
        f.e.push(I::Call { function }, arguments, pushed);
        for _ in 0..pushed {
            f.e.push(I::Drop {}, 1, 0);
        }
        let (function, marks, cost) = f.finish(Owner::None, |_| {});
        self.add_function("__startup".to_owned(), function, marks, cost)
    }
}

/// Where a composed parameter's reference is, by variable.
type Hidden = Vec<(VarId, khz_bytecode::ids::SlotIndex)>;

fn with_ids(info: &PouInfo) -> impl Iterator<Item = (VarId, &VarInfo)> {
    (0u32..).map(VarId).zip(&info.vars)
}

impl FunctionBuilder<'_, '_> {
    fn set_home(&mut self, id: VarId, home: Home) {
        if let Some(slot) = self.homes.get_mut(id.0 as usize) {
            *slot = home;
        }
    }

    /// Parameters in the order of declaration: the first `L` slots.
    fn declare_parameters(&mut self, pou: PouId, info: &PouInfo) -> Hidden {
        let is_function = info.kind == PouKind::Function;
        let mut hidden = Hidden::new();
        for (id, var) in with_ids(info) {
            let storage = self.b.project.types.storage(var.ty);
            let image = self.b.image_parameters.contains(&(pou, id));
            let reference = |this: &mut Self, write: bool, image: bool| {
                let target = this.b.type_id(var.ty);
                this.local(LocalType::Ref(RefType { target, write, image }))
            };
            match (var.class, storage) {
                (VarClass::InOut, _) => {
                    let slot = reference(self, true, image);
                    self.set_home(id, Home::Ref(slot));
                }
                (VarClass::Input, Some(storage)) if is_function => {
                    let slot = self.local(LocalType::Scalar(storage));
                    self.set_home(id, Home::Slot(SlotPlace::Local, slot));
                }
                (VarClass::Input, None) if is_function => hidden.push((id, reference(self, false, image))),
                (VarClass::Output | VarClass::Result, None) if is_function => {
                    hidden.push((id, reference(self, true, false)));
                }
                _ => {}
            }
        }
        self.parameters = self.b.id16(self.locals.len(), "parameters of one function");
        hidden
    }

    /// Variables that are fresh at each call: `L` slots, or the frame where they need an address.
    fn declare_locals(&mut self, info: &PouInfo) {
        let is_function = info.kind == PouKind::Function;
        let unit = self.unit.unwrap_or(PouId(u32::MAX));
        for (id, var) in with_ids(info) {
            let fresh = match var.class {
                VarClass::Temp => true,
                VarClass::Input | VarClass::Output | VarClass::Local | VarClass::Result => is_function,
                VarClass::InOut | VarClass::External => false,
            };
            if !fresh || var.located.is_some() {
                continue;
            }
            let storage = self.b.project.types.storage(var.ty);
            let addressed = self.b.plan.usage.addressed_vars.contains(&(unit, id));
            if let Some(value) = storage.filter(|_| var.class == VarClass::Result || var.class == VarClass::Output) {
                self.results.push(value.value_type());
            }
            match storage {
                Some(storage) if !addressed => {
                    let known = self.homes.get(id.0 as usize).is_some_and(|home| matches!(home, Home::Slot(..)));
                    if !known {
                        let slot = self.local(LocalType::Scalar(storage));
                        self.set_home(id, Home::Slot(SlotPlace::Local, slot));
                    }
                }
                _ => {
                    let offset = self.frame_room(var.ty);
                    // The parameter's own slot keeps what came in until `enter` moves it.
                    let incoming = self.homes.get(id.0 as usize).copied();
                    self.set_home(id, Home::Bytes(BytePlace::Frame, offset));
                    if let (Some(Home::Slot(place, index)), Some(storage)) = (incoming, storage) {
                        self.e.push(I::SlotLoad { place, index }, 0, 1);
                        self.e.push(I::Store { place: BytePlace::Frame, storage, offset }, 1, 0);
                    }
                }
            }
        }
    }

    /// Copies composed arguments into the frame and gives fresh variables their initial values.
    fn enter(&mut self, info: &PouInfo, hidden: &Hidden) {
        for (id, var) in with_ids(info) {
            let home = self.homes.get(id.0 as usize).copied().unwrap_or(Home::None);
            let is_local = matches!(home, Home::Slot(SlotPlace::Local, _) | Home::Bytes(BytePlace::Frame, _));
            if !is_local {
                continue;
            }
            if var.class == VarClass::Input {
                let slot = hidden.iter().find(|(other, _)| *other == id).map(|(_, slot)| *slot);
                if let (Some(slot), Home::Bytes(place, offset)) = (slot, home) {
                    self.push_address(place, offset, var.ty);
                    self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
                    let target = self.b.type_id(var.ty);
                    self.e.push(I::Copy { target }, 2, 0);
                }
                continue;
            }
            if !var.init.is_zero() {
                self.initialise(home, var);
            }
        }
    }

    fn initialise(&mut self, home: Home, var: &VarInfo) {
        let storage: Option<Storage> = self.b.project.types.storage(var.ty);
        match (home, storage, &var.init) {
            (Home::Slot(place, index), Some(_), Value::Scalar(value)) => {
                let value: Const = value.clone();
                let ty = self.elementary(var.ty);
                self.constant(&value, ty);
                self.e.push(I::SlotStore { place, index }, 1, 0);
            }
            (Home::Bytes(place, offset), Some(storage), Value::Scalar(value)) => {
                let value: Const = value.clone();
                let ty = self.elementary(var.ty);
                self.constant(&value, ty);
                self.e.push(I::Store { place, storage, offset }, 1, 0);
            }
            (Home::Bytes(place, offset), None, value) => {
                let from = self.b.template(var.ty, value);
                self.push_address(place, offset, var.ty);
                self.push_address(BytePlace::Data, from, var.ty);
                let target = self.b.type_id(var.ty);
                self.e.push(I::Copy { target }, 2, 0);
            }
            _ => {}
        }
    }

    /// Hands results back: composed ones through their references, scalars on the stack.
    fn leave(&mut self, info: &PouInfo, hidden: &Hidden) {
        if info.kind != PouKind::Function {
            return;
        }
        for (id, ty) in result_vars(info) {
            let home = self.homes.get(id.0 as usize).copied().unwrap_or(Home::None);
            let slot = hidden.iter().find(|(other, _)| *other == id).map(|(_, slot)| *slot);
            if let (Some(slot), Home::Bytes(place, offset)) = (slot, home) {
                self.e.push(I::SlotLoad { place: SlotPlace::Local, index: slot }, 0, 1);
                self.push_address(place, offset, ty);
                let target = self.b.type_id(ty);
                self.e.push(I::Copy { target }, 2, 0);
            }
        }
        for (id, ty) in result_vars(info) {
            let Some(storage) = self.b.project.types.storage(ty) else { continue };
            match self.homes.get(id.0 as usize).copied().unwrap_or(Home::None) {
                Home::Slot(place, index) => self.e.push(I::SlotLoad { place, index }, 0, 1),
                Home::Bytes(place, offset) => self.e.push(I::Load { place, storage, offset }, 0, 1),
                _ => {}
            }
        }
    }
}
