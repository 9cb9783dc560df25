//! What stands around the code: tasks, program instances, initial values, names, budgets.

use std::collections::BTreeMap;

use khz_bytecode::container::{
    BlockInstance, Container, DebugPlace, DebugSection, DebugVariable, InitRun, LineEntry, Parameters, ProgramInstance,
    Region, RetainRange, SingleSource, SourceFile, Task, TaskExtension, TaskTable, TaskType,
};
use khz_bytecode::ids::{FunctionId, InstanceId, SlotIndex, TaskId};
use khz_bytecode::limits::{FRAME_ALIGN_BYTES, MAX_CALL_DEPTH, MAX_STACK_DEPTH, MAX_TASK_NAME_BYTES, SLOT_BYTES};
use khz_bytecode::value::{BytePlace, SlotPlace};

use super::layout::DebugTypes;
use super::place::Home;
use super::{Builder, Hashes};
use crate::analysis::tree::{InstancePlan, PouInfo, SinglePlan, VarClass, VarId};
use crate::analysis::types::{Ty, Value};
use crate::source::SourceMap;

/// Where one program instance's variables start.
#[derive(Debug, Clone, Copy, Default)]
struct Base {
    slots: u16,
    data: u32,
}

/// The names of a program instance and of its function block instances that tasks run.
fn entry_names(instance: &InstancePlan) -> impl Iterator<Item = String> + '_ {
    std::iter::once(instance.name.clone()).chain(instance.blocks.iter().map(|block| block.name.clone()))
}

impl Builder<'_> {
    /// Puts everything together.
    pub(super) fn finish(&mut self, sources: &SourceMap, hashes: &Hashes) -> Container {
        let plan = self.plan;
        let shared_globals = self.id16(self.section.slots.len(), "slots");
        let mut bases = Vec::with_capacity(plan.instances.len());
        let mut instances = Vec::with_capacity(plan.instances.len());
        for (at, instance) in plan.instances.iter().enumerate() {
            let Some(info) = self.info(instance.program) else { continue };
            let connected =
                !instance.copy_in.is_empty() || !instance.copy_out.is_empty() || !instance.inouts.is_empty();
            let entry = if connected { self.lower_entry(instance, &info) } else { self.function_id(instance.program) };
            let (base, mut row) = self.place_instance(at, instance, entry);
            row.id = InstanceId(self.id16(instances.len(), "program instances"));
            bases.push(base);
            instances.push(row);
            for block in &instance.blocks {
                let entry = self.lower_block_entry(instance, &info, block, base.data);
                instances.push(ProgramInstance {
                    id: InstanceId(self.id16(instances.len(), "program instances")),
                    task: TaskId(self.id16(block.task as usize, "tasks")),
                    entry,
                    slot_offset: self.id16(self.section.slots.len(), "slots"),
                    slot_count: 0,
                    block_offset: self.id16(self.section.block_instances.len(), "function block instances"),
                    block_count: 0,
                });
            }
        }
        self.global_blocks();
        let startup_function = plan.startup.and_then(|pou| self.info(pou).map(|info| self.lower_startup(pou, &info)));
        self.initial_values(&bases);
        self.retained(&bases);
        let tasks = plan.tasks.iter().enumerate().map(|(at, task)| self.task(at, task, &bases));
        let (tasks, extensions) = tasks.collect();
        self.section.task_extensions = extensions;
        let debug = self.debug(sources, hashes, &bases);
        let parameters = self.parameters(startup_function);
        Container {
            parameters,
            source_hash: hashes.all,
            content_signature: Vec::new(),
            debug_signature: Vec::new(),
            types: std::mem::take(&mut self.section),
            tasks: TaskTable { shared_globals, tasks, instances },
            constants: std::mem::take(&mut self.constants),
            functions: std::mem::take(&mut self.functions),
            debug: Some(debug),
        }
    }

    fn place_instance(&mut self, at: usize, instance: &InstancePlan, entry: FunctionId) -> (Base, ProgramInstance) {
        let program = self
            .programs
            .get(&instance.program)
            .and_then(|id| self.section.programs.get(id.index()))
            .cloned()
            .unwrap_or_default();
        let slot_offset = self.id16(self.section.slots.len(), "slots");
        let slot_count = self.id16(program.slots.len(), "slots");
        if self.section.slots.len() + program.slots.len() < usize::from(u16::MAX) {
            self.section.slots.extend_from_slice(&program.slots);
        } else {
            self.fail("slots");
        }
        let block_offset = self.id16(self.section.block_instances.len(), "function block instances");
        let mut base = Base { slots: slot_offset, data: 0 };
        if let Some(block) = program.block {
            let extent = match self.section.types.get(block.index()) {
                Some(khz_bytecode::container::Type::Struct(record)) => (record.size, record.align),
                _ => (0, 1),
            };
            base.data = self.data_room(block, extent.0, extent.1, false);
            self.section.block_instances.push(BlockInstance {
                offset: base.data,
                stride: extent.0,
                count: 1,
                ty: block,
            });
            self.block_rows(block, base.data);
        }
        let block_end = self.id16(self.section.block_instances.len(), "function block instances");
        let row = ProgramInstance {
            id: InstanceId(self.id16(at, "program instances")),
            task: TaskId(self.id16(instance.task as usize, "tasks")),
            entry,
            slot_offset,
            slot_count,
            block_offset,
            block_count: block_end.saturating_sub(block_offset),
        };
        (base, row)
    }

    fn block_rows(&mut self, ty: khz_bytecode::ids::TypeId, offset: u32) {
        match khz_bytecode::verify::block_rows(&self.section, ty, offset) {
            Ok(rows) => self.section.block_instances.extend(rows),
            Err(_) => self.fail("function block instances"),
        }
    }

    fn global_blocks(&mut self) {
        let (project, plan) = (self.project, self.plan);
        for id in &plan.globals {
            let Some(global) = project.globals.get(id.0 as usize) else { continue };
            if !project.types.holds_block(global.ty) {
                continue;
            }
            if let Some(Home::Bytes(BytePlace::Data, offset)) = self.global_homes.get(id).copied() {
                let ty = self.type_id(global.ty);
                self.block_rows(ty, offset);
            }
        }
    }

    /// Calls back with every stored variable of the resource: home relative to nothing but the image, type, initial value, retained.
    fn each_variable(
        &self,
        bases: &[Base],
        mut found: impl FnMut(Option<(&InstancePlan, &PouInfo, usize)>, usize, Home),
    ) {
        for id in &self.plan.globals {
            if let Some(home) = self.global_homes.get(id) {
                found(None, id.0 as usize, *home);
            }
        }
        for (instance, base) in self.plan.instances.iter().zip(bases) {
            let (Some(info), Some(homes)) = (self.infos.get(&instance.program), self.unit_homes.get(&instance.program))
            else {
                continue;
            };
            for (at, home) in homes.iter().enumerate() {
                let home = match *home {
                    Home::Slot(SlotPlace::Program, slot) => {
                        Home::Slot(SlotPlace::Global, SlotIndex(slot.0.saturating_add(base.slots)))
                    }
                    Home::Bytes(BytePlace::Block, offset) => {
                        Home::Bytes(BytePlace::Data, base.data.saturating_add(offset))
                    }
                    other => other,
                };
                found(Some((instance, info, at)), at, home);
            }
        }
    }

    fn initial_values(&mut self, bases: &[Base]) {
        let project = self.project;
        let mut values: Vec<(Home, Ty, Value)> = Vec::new();
        self.each_variable(bases, |instance, at, home| {
            let found = match instance {
                Some((instance, info, at)) => info.vars.get(at).map(|var| {
                    let own = instance.values.iter().find(|(id, _)| id.0 as usize == at);
                    (var.ty, own.map_or_else(|| var.init.clone(), |(_, value)| value.clone()))
                }),
                None => project.globals.get(at).map(|global| (global.ty, global.init.clone())),
            };
            if let Some((ty, init)) = found {
                values.push((home, ty, init));
            }
        });
        self.located_block_values(&mut values);
        for (located, ty, value) in self.plan.instances.iter().flat_map(|instance| &instance.image_values) {
            values.push((super::memory::located_home(*located), *ty, value.clone()));
        }
        let mut image: BTreeMap<(Region, u32), u8> = BTreeMap::new();
        for (home, ty, value) in values {
            match home {
                Home::Slot(_, slot) => self.init_runs(Region::Slots, u32::from(slot.0) * SLOT_BYTES, ty, &value),
                Home::Bytes(BytePlace::Data, offset) => self.init_runs(Region::Data, offset, ty, &value),
                Home::Bytes(place, offset) => self.image_values(&mut image, place, offset, None, ty, &value),
                Home::Bit(place, offset, bit) => self.image_values(&mut image, place, offset, Some(bit), ty, &value),
                Home::Ref(_) | Home::None => {}
            }
        }
        for (ty, value, offset) in std::mem::take(&mut self.constants_in_data) {
            self.init_runs(Region::Data, offset, ty, &value);
        }
        // Variables in the process image may share bytes: what the last one says counts.
        for ((region, offset), byte) in image {
            match self.section.init_image.last_mut() {
                Some(last)
                    if last.region == region
                        && last.repeat == 1
                        && last.offset as usize + last.bytes.len() == offset as usize =>
                {
                    last.bytes.push(byte);
                }
                _ => self.section.init_image.push(InitRun { region, offset, repeat: 1, bytes: vec![byte] }),
            }
        }
        self.section.init_image.sort_by_key(|run| (run.region, run.offset));
    }

    /// Located variables of function blocks: one place for all instances.
    fn located_block_values(&self, values: &mut Vec<(Home, Ty, Value)>) {
        for (pou, _) in &self.plan.bodies {
            let Some(info) = self.infos.get(pou).filter(|info| info.block.is_some()) else { continue };
            for var in &info.vars {
                if let Some(located) = var.located {
                    values.push((super::memory::located_home(located), var.ty, var.init.clone()));
                }
            }
        }
    }

    fn image_values(
        &mut self,
        image: &mut BTreeMap<(Region, u32), u8>,
        place: BytePlace,
        offset: u32,
        bit: Option<u8>,
        ty: Ty,
        value: &Value,
    ) {
        let region = match place {
            BytePlace::Memory => Region::Memory,
            BytePlace::Output => Region::Output,
            _ => return,
        };
        if value.is_zero() {
            return;
        }
        if let Some(bit) = bit {
            *image.entry((region, offset)).or_default() |= 1u8 << (bit & 7);
            return;
        }
        let before = self.section.init_image.len();
        self.init_runs(region, offset, ty, value);
        for run in self.section.init_image.split_off(before) {
            let mut at = run.offset;
            for _ in 0..run.repeat {
                for byte in &run.bytes {
                    image.insert((region, at), *byte);
                    at = at.saturating_add(1);
                }
            }
        }
    }

    fn retained(&mut self, bases: &[Base]) {
        let project = self.project;
        let mut ranges: Vec<RetainRange> = Vec::new();
        self.each_variable(bases, |instance, at, home| {
            let found = match instance {
                Some((_, info, at)) => info.vars.get(at).map(|var| (var.ty, var.retain)),
                None => project.globals.get(at).map(|global| (global.ty, global.retain)),
            };
            let Some((ty, true)) = found else { return };
            match home {
                Home::Slot(_, slot) => {
                    ranges.push(RetainRange {
                        region: Region::Slots,
                        offset: u32::from(slot.0) * SLOT_BYTES,
                        bytes: SLOT_BYTES,
                    });
                }
                Home::Bytes(BytePlace::Data, offset) => {
                    ranges.push(RetainRange { region: Region::Data, offset, bytes: project.types.extent(ty).0 });
                }
                _ => {}
            }
        });
        ranges.sort_by_key(|range| (range.region, range.offset));
        self.section.retain = ranges;
    }

    fn task(&mut self, at: usize, plan: &crate::analysis::tree::TaskPlan, bases: &[Base]) -> (Task, TaskExtension) {
        let task_type = match (plan.interval_us, &plan.single) {
            (Some(_), _) => TaskType::Cyclic,
            (None, SinglePlan::None) => TaskType::Freewheeling,
            (None, _) => TaskType::Event,
        };
        let single = match &plan.single {
            SinglePlan::None => SingleSource::None,
            SinglePlan::Literal(value) => SingleSource::Literal(*value),
            SinglePlan::Bit(located) => {
                SingleSource::Bit { place: located.place, offset: located.offset, bit: located.bit.unwrap_or(0) }
            }
            SinglePlan::Global(global) => {
                source(self.global_homes.get(global).copied().unwrap_or(Home::None), Base::default())
            }
            SinglePlan::Instance(at, VarId(var)) => {
                let base = bases.get(*at as usize).copied().unwrap_or_default();
                let homes =
                    self.plan.instances.get(*at as usize).and_then(|instance| self.unit_homes.get(&instance.program));
                source(homes.and_then(|homes| homes.get(*var as usize)).copied().unwrap_or(Home::None), base)
            }
        };
        let single_slot = match single {
            SingleSource::Slot(slot) if task_type == TaskType::Event => Some(slot),
            _ => None,
        };
        let task = Task {
            id: TaskId(self.id16(at, "tasks")),
            priority: plan.priority,
            task_type,
            enabled: true,
            interval_us: plan.interval_us.unwrap_or(0),
            single_slot,
            watchdog_us: plan.watchdog_us,
        };
        if plan.name.len() > MAX_TASK_NAME_BYTES {
            self.fail("bytes of a TASK's name");
        }
        let extension = TaskExtension {
            name: plan.name.clone(),
            single,
            phase_us: plan.phase_us,
            watchdog_sensitivity: plan.watchdog_sensitivity,
            overrun_policy: plan.overrun_policy,
        };
        (task, extension)
    }

    fn parameters(&mut self, startup: Option<FunctionId>) -> Parameters {
        let mut known: Vec<Option<(u64, u64)>> = vec![None; self.costs.len()];
        // Every function of the container counts: one whose only call stands in dead code is in it too.
        let (mut depth, mut frame) = (1, 0);
        for function in (0..self.costs.len()).filter_map(FunctionId::from_index) {
            let (own_depth, own_frame) = self.deepest(function, &mut known);
            depth = depth.max(own_depth);
            frame = frame.max(own_frame);
        }
        let stack = self.costs.iter().map(|cost| cost.stack).max().unwrap_or(0).max(1);
        if depth > u64::from(MAX_CALL_DEPTH) {
            self.fail("levels of calls");
        }
        if stack > u32::from(MAX_STACK_DEPTH) {
            self.fail("operands of one expression");
        }
        let [input, output, memory] = self.image_bytes();
        let strings = self.string_total();
        Parameters {
            max_stack_depth: u16::try_from(stack).unwrap_or(u16::MAX),
            max_call_depth: u16::try_from(depth).unwrap_or(u16::MAX),
            input_image_bytes: u16::try_from(input).unwrap_or(u16::MAX),
            output_image_bytes: u16::try_from(output).unwrap_or(u16::MAX),
            memory_image_bytes: u16::try_from(memory).unwrap_or(u16::MAX),
            data_region_bytes: u32::try_from(self.data_end).unwrap_or(u32::MAX),
            frame_bytes: u32::try_from(frame).unwrap_or(u32::MAX),
            startup_function: startup,
            init_function: None,
            total_str_var_bytes: strings,
            max_str_length: self.longest_string,
        }
    }

    /// Depth and frame bytes of a function's deepest chain of calls. There is no cycle, so this ends.
    fn deepest(&self, id: FunctionId, known: &mut Vec<Option<(u64, u64)>>) -> (u64, u64) {
        if let Some(Some(found)) = known.get(id.index()) {
            return *found;
        }
        let Some(cost) = self.costs.get(id.index()) else { return (1, 0) };
        let (mut depth, mut frame) = (0, 0);
        for callee in &cost.callees {
            let (own_depth, own_frame) = self.deepest(*callee, known);
            depth = depth.max(own_depth);
            frame = frame.max(own_frame);
        }
        let found = (depth + 1, frame + u64::from(cost.frame_bytes.next_multiple_of(FRAME_ALIGN_BYTES)));
        if let Some(slot) = known.get_mut(id.index()) {
            *slot = Some(found);
        }
        found
    }

    fn string_total(&self) -> u32 {
        let globals =
            self.plan.globals.iter().filter_map(|id| self.project.globals.get(id.0 as usize)).map(|global| global.ty);
        let mut total: u64 = globals.map(|ty| self.string_bytes(ty)).sum();
        for instance in &self.plan.instances {
            let vars = self.infos.get(&instance.program).into_iter().flat_map(|info| &info.vars);
            total += vars.filter(|var| is_dumped(var.class)).map(|var| self.string_bytes(var.ty)).sum::<u64>();
        }
        u32::try_from(total).unwrap_or(u32::MAX)
    }

    fn debug(&mut self, sources: &SourceMap, hashes: &Hashes, bases: &[Base]) -> DebugSection {
        let plan = self.plan;
        let files: Vec<SourceFile> = sources
            .files()
            .map(|(id, file)| SourceFile {
                name: file.name().to_owned(),
                hash: hashes.files.get(id.index()).copied().unwrap_or_default(),
            })
            .collect();
        let mut types = DebugTypes::default();
        let variables = self.debug_variables(&mut types, bases);
        DebugSection {
            files,
            lines: self.lines(sources),
            function_names: self.function_names.clone(),
            types: types.list,
            variables,
            instance_names: plan.instances.iter().flat_map(entry_names).collect(),
            resource_name: plan.name.clone(),
            configuration_name: plan.configuration.clone(),
        }
    }

    fn debug_variables(&mut self, types: &mut DebugTypes, bases: &[Base]) -> Vec<DebugVariable> {
        let project = self.project;
        let mut found: Vec<(String, Home, Ty, bool)> = Vec::new();
        self.each_variable(bases, |instance, at, home| match instance {
            None => {
                if let Some(global) = project.globals.get(at) {
                    found.push((global.name.clone(), home, global.ty, global.constant));
                }
            }
            Some((instance, info, at)) => {
                if let Some(var) = info.vars.get(at).filter(|var| is_dumped(var.class) && !info.sees_edges(at)) {
                    found.push((format!("{}.{}", instance.name, var.name), home, var.ty, var.constant));
                }
            }
        });
        let usage = &self.plan.usage;
        for (used, long, name) in
            [(usage.up_time, false, "__SYSTEM_UP_TIME"), (usage.up_ltime, true, "__SYSTEM_UP_LTIME")]
        {
            if used == Some(true) {
                use khz_bytecode::container::ElementaryType as E;
                let ty = Ty::Elem(if long { E::Ltime } else { E::Time });
                found.push((name.to_owned(), self.system_home(long), ty, false));
            }
        }
        let mut list = Vec::with_capacity(found.len());
        for (name, home, ty, constant) in found {
            let place = match home {
                Home::Slot(_, slot) => DebugPlace::Slot(slot),
                Home::Bytes(place, offset) => DebugPlace::Bytes(place, offset),
                Home::Bit(place, offset, bit) => DebugPlace::Bit(place, offset, bit),
                Home::Ref(_) | Home::None => continue,
            };
            let ty = self.debug_type(types, ty);
            list.push(DebugVariable { name, place, ty, constant });
        }
        list
    }

    fn lines(&mut self, sources: &SourceMap) -> Vec<LineEntry> {
        let mut lines: Vec<LineEntry> = Vec::new();
        for (function, marks) in std::mem::take(&mut self.marks) {
            for (offset, span) in marks {
                let place = sources.line_column(span);
                let file = u16::try_from(span.file.index()).unwrap_or(u16::MAX);
                let entry = LineEntry { function, offset, file, line: place.line, column: place.column };
                match lines.last_mut() {
                    Some(last) if last.function == function && last.offset == offset => *last = entry,
                    Some(last)
                        if last.function == function
                            && (last.file, last.line, last.column) == (file, entry.line, entry.column) => {}
                    _ => lines.push(entry),
                }
            }
        }
        lines
    }
}

fn is_dumped(class: VarClass) -> bool {
    matches!(class, VarClass::Input | VarClass::Output | VarClass::Local)
}

fn source(home: Home, base: Base) -> SingleSource {
    match home {
        Home::Slot(SlotPlace::Program, slot) => SingleSource::Slot(SlotIndex(slot.0.saturating_add(base.slots))),
        Home::Slot(_, slot) => SingleSource::Slot(slot),
        Home::Bytes(BytePlace::Block, offset) => SingleSource::Data(base.data.saturating_add(offset)),
        Home::Bytes(BytePlace::Data, offset) => SingleSource::Data(offset),
        Home::Bit(place, offset, bit) => SingleSource::Bit { place, offset, bit },
        _ => SingleSource::None,
    }
}
