//! Where variables live: slots, data region, data blocks, process image.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use khz_bytecode::container::{Field, ProgramType, SystemVariable, SystemVariableKind};
use khz_bytecode::ids::{ProgramId, SlotIndex};
use khz_bytecode::value::{BytePlace, SlotPlace, Storage};

use super::Builder;
use super::place::Home;
use crate::analysis::tree::{GlobalId, Located, PouId, SinglePlan, VarClass, VarId};
use crate::analysis::types::Ty;
use crate::syntax::ast::PouKind;
use crate::syntax::symbol::Interner;

/// Slots that one resource may have: a little below what 16 bits can count, for system variables.
const MAX_SLOTS: u64 = 65_000;

impl Builder<'_> {
    /// Decides where globals, program variables and fields are.
    pub(super) fn plan_memory(&mut self, names: &Interner) {
        self.choose_slots();
        self.plan_globals(names);
        let plan = self.plan;
        for (pou, _) in &plan.bodies {
            let Some(info) = self.info(*pou) else { continue };
            match info.kind {
                PouKind::Program => self.plan_program(*pou, names),
                PouKind::FunctionBlock => self.plan_block(*pou),
                PouKind::Function => {}
            }
        }
    }

    /// Whether a program variable is a scalar that may stand in a slot.
    fn wants_slot(&self, pou: PouId, var: VarId) -> bool {
        let Some(info) = self.infos.get(&pou).and_then(|info| info.vars.get(var.0 as usize)) else { return false };
        matches!(info.class, VarClass::Input | VarClass::Output | VarClass::Local)
            && info.located.is_none()
            && self.project.types.storage(info.ty).is_some()
            && !self.plan.usage.addressed_vars.contains(&(pou, var))
    }

    fn global_wants_slot(&self, global: GlobalId) -> bool {
        let Some(info) = self.project.globals.get(global.0 as usize) else { return false };
        info.located.is_none()
            && self.project.types.storage(info.ty).is_some()
            && !self.plan.usage.addressed_globals.contains(&global)
    }

    /// Where there are more scalars than slots, the hottest keep theirs.
    fn choose_slots(&mut self) {
        let mut instances: BTreeMap<PouId, u64> = BTreeMap::new();
        for instance in &self.plan.instances {
            *instances.entry(instance.program).or_default() += 1;
        }
        let mut wishes: Vec<(u64, u64, (Option<PouId>, u32))> = Vec::new();
        let heat = |key: &(Option<PouId>, u32)| self.plan.usage.heat.get(key).copied().unwrap_or(0);
        for global in self.plan.globals.iter().filter(|global| self.global_wants_slot(**global)) {
            let key = (None, global.0);
            wishes.push((heat(&key), 1, key));
        }
        for (pou, count) in &instances {
            let vars = self.infos.get(pou).map_or(0, |info| info.vars.len());
            for var in (0u32..).take(vars).filter(|var| self.wants_slot(*pou, VarId(*var))) {
                let key = (Some(*pou), var);
                wishes.push((heat(&key), *count, key));
            }
        }
        if wishes.iter().map(|(_, cost, _)| cost).sum::<u64>() <= MAX_SLOTS {
            return;
        }
        wishes.sort_by_key(|(heat, cost, key)| (Reverse(heat.saturating_mul(1 << 16) / cost), *key));
        let mut used = 0;
        for (_, cost, key) in wishes {
            if used + cost <= MAX_SLOTS {
                used += cost;
            } else {
                self.spilled.insert(key);
            }
        }
    }

    fn plan_globals(&mut self, names: &Interner) {
        let project = self.project;
        let plan = self.plan;
        // By qualified name; the system variables stand among them.
        let mut slots: Vec<(String, Option<GlobalId>, bool)> = Vec::new();
        for &global in &plan.globals {
            if self.global_wants_slot(global) && !self.spilled.contains(&(None, global.0)) {
                let symbol = project.globals.get(global.0 as usize).map(|global| global.symbol);
                slots.push((symbol.map_or("", |symbol| names.text(symbol)).to_owned(), Some(global), false));
            }
        }
        if plan.usage.up_time.is_some() {
            slots.push(("__SYSTEM_UP_TIME".to_owned(), None, false));
        }
        if plan.usage.up_ltime.is_some() {
            slots.push(("__SYSTEM_UP_LTIME".to_owned(), None, true));
        }
        slots.sort();
        for (_, global, long) in slots {
            let slot = SlotIndex(self.id16(self.section.slots.len(), "slots"));
            match global.and_then(|id| project.globals.get(id.0 as usize).map(|global| (id, global))) {
                Some((id, global)) => {
                    self.section.slots.push(project.types.storage(global.ty).unwrap_or(Storage::I64));
                    self.global_homes.insert(id, Home::Slot(SlotPlace::Global, slot));
                }
                None => {
                    self.section.slots.push(Storage::I64);
                    let kind = if long { SystemVariableKind::UpLtime } else { SystemVariableKind::UpTime };
                    self.section.system_variables.push(SystemVariable { kind, slot });
                    self.system[usize::from(long)] = Some(slot);
                }
            }
        }
        self.section.system_variables.sort_by_key(|variable| variable.kind);
        for &id in &plan.globals {
            let Some(global) = project.globals.get(id.0 as usize) else { continue };
            if self.global_homes.contains_key(&id) {
                continue;
            }
            let home = match global.located {
                Some(located) => located_home(located),
                None => {
                    let (size, align) = project.types.extent(global.ty);
                    let ty = self.type_id(global.ty);
                    let constant = global.constant && !project.types.holds_block(global.ty);
                    Home::Bytes(BytePlace::Data, self.data_room(ty, size, align, constant))
                }
            };
            self.global_homes.insert(id, home);
        }
    }

    /// Slots by name, then the data block by declaration.
    fn plan_program(&mut self, pou: PouId, names: &Interner) {
        let Some(info) = self.info(pou) else { return };
        let mut homes = vec![Home::None; info.vars.len()];
        let mut program = ProgramType::default();
        let is_slot =
            |this: &Self, at: u32| this.wants_slot(pou, VarId(at)) && !this.spilled.contains(&(Some(pou), at));
        let mut slots: Vec<(&str, u32)> = (0u32..)
            .zip(&info.vars)
            .filter(|(at, _)| is_slot(self, *at))
            .map(|(at, var)| (names.text(var.symbol), at))
            .collect();
        slots.sort_unstable();
        for (_, at) in slots {
            let slot = SlotIndex(self.id16(program.slots.len(), "slots of one program"));
            let Some(var) = info.vars.get(at as usize) else { continue };
            program.slots.push(self.project.types.storage(var.ty).unwrap_or(Storage::I64));
            homes[at as usize] = Home::Slot(SlotPlace::Program, slot);
        }
        let mut fields: Vec<Field> = Vec::new();
        let mut end: u64 = 0;
        for (at, var) in (0u32..).zip(&info.vars) {
            if !matches!(var.class, VarClass::Input | VarClass::Output | VarClass::Local) || is_slot(self, at) {
                continue;
            }
            if let Some(located) = var.located {
                homes[at as usize] = located_home(located);
                continue;
            }
            let (size, align) = self.project.types.extent(var.ty);
            end = end.next_multiple_of(u64::from(align.max(1)));
            let ty = self.type_id(var.ty);
            let Ok(offset) = u32::try_from(end) else {
                self.fail("bytes of program variables");
                continue;
            };
            fields.push(Field { offset, ty });
            homes[at as usize] = Home::Bytes(BytePlace::Block, offset);
            end += u64::from(size);
        }
        if !fields.is_empty() {
            match u32::try_from(end.next_multiple_of(8)) {
                Ok(size) => program.block = Some(self.struct_type(fields, size, 8)),
                Err(_) => self.fail("bytes of program variables"),
            }
        }
        let id = ProgramId(self.id16(self.section.programs.len(), "program types"));
        self.section.programs.push(program);
        self.programs.insert(pou, id);
        self.unit_homes.insert(pou, homes);
    }

    fn plan_block(&mut self, pou: PouId) {
        let Some(info) = self.info(pou) else { return };
        let fields = info.block.and_then(|block| self.project.types.fields(Ty::User(block)).cloned());
        let mut homes = vec![Home::None; info.vars.len()];
        for (home, var) in homes.iter_mut().zip(&info.vars) {
            let field = var.field.and_then(|at| fields.as_ref().and_then(|fields| fields.get(at as usize)));
            *home = match (var.located, field) {
                (Some(located), _) => located_home(located),
                (None, Some(field)) => Home::Bytes(BytePlace::This, field.offset),
                (None, None) => Home::None,
            };
        }
        self.unit_homes.insert(pou, homes);
    }

    /// Bytes of %I, %Q and %M that the resource uses.
    pub(super) fn image_bytes(&self) -> [u32; 3] {
        let mut bytes = self.plan.usage.image_bytes;
        let mut note = |located: Located, size: u32| {
            let at = match located.place {
                BytePlace::Input => 0,
                BytePlace::Output => 1,
                _ => 2,
            };
            bytes[at] = bytes[at].max(located.offset.saturating_add(if located.bit.is_some() { 1 } else { size }));
        };
        for global in self.plan.globals.iter().filter_map(|id| self.project.globals.get(id.0 as usize)) {
            if let Some(located) = global.located {
                note(located, self.project.types.extent(global.ty).0);
            }
        }
        for (pou, _) in &self.plan.bodies {
            for var in self.infos.get(pou).into_iter().flat_map(|info| &info.vars) {
                if let Some(located) = var.located {
                    note(located, self.project.types.extent(var.ty).0);
                }
            }
        }
        for task in &self.plan.tasks {
            if let SinglePlan::Bit(located) = task.single {
                note(located, 1);
            }
        }
        bytes
    }
}

/// The home of a variable in the process image.
pub(super) fn located_home(located: Located) -> Home {
    match located.bit {
        Some(bit) => Home::Bit(located.place, located.offset, bit),
        None => Home::Bytes(located.place, located.offset),
    }
}
