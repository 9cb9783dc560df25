//! What a text that is not `exact` leaves out: partitions, block instances, the only task, budgets.

use super::Assembler;
use super::declarations::aligned;
use super::{Kind, PendingInstance};
use crate::container::{BlockInstance, DataVariable, Owner, ProgramInstance, ProgramType, Task, TaskExtension, Type};
use crate::ids::{FunctionId, TaskId, TypeId};
use crate::limits::NULL_GUARD_BYTES;

/// Operand stack and call depth of a text that names none: enough for any text by hand.
const DEFAULT_DEPTH: u16 = 64;
/// Frame bytes of a text that names none.
const DEFAULT_FRAME_BYTES: u32 = 4096;
/// Name of the task of a text that names none, as the front end calls it.
const DEFAULT_TASK: &str = "default_task";
/// Interval of the task of a text that names none, as in the reference design's default configuration.
const DEFAULT_INTERVAL_US: u64 = 10_000;

impl Assembler {
    /// A program type for a `main` without one.
    pub(super) fn default_program(&mut self) {
        if self.container.types.programs.is_empty() {
            self.container.types.programs.push(ProgramType::default());
        }
    }

    /// Next free offset for a variable of this type.
    pub(super) fn place_data(&self, ty: TypeId) -> Result<u32, String> {
        let (_, align) = self.extent(ty).ok_or("the layout needs a type that is declared above")?;
        aligned(self.data_end.max(NULL_GUARD_BYTES), align).ok_or_else(|| "the data region is too large".to_string())
    }

    /// Adds what was left out.
    pub(super) fn finish(&mut self) -> Result<(), String> {
        let mut globals = std::mem::take(&mut self.globals);
        self.container.tasks.shared_globals = self
            .container
            .tasks
            .shared_globals
            .checked_add(u16::try_from(globals.len()).map_err(|_| "there are too many globals")?)
            .ok_or("there are too many globals")?;
        globals.append(&mut self.container.types.slots);
        self.container.types.slots = globals;
        self.default_task();
        self.place_instances()?;
        let types = &mut self.container.types;
        types.data.sort_by_key(|variable| variable.offset);
        types.init_image.sort_by_key(|run| (run.region, run.offset));
        if types.task_extensions.is_empty() {
            types.task_extensions.append(&mut self.extensions);
        }
        self.budgets();
        Ok(())
    }

    fn default_task(&mut self) {
        if self.container.tasks.tasks.is_empty() {
            let task = Task { id: TaskId(0), enabled: true, interval_us: DEFAULT_INTERVAL_US, ..Task::default() };
            self.container.tasks.tasks.push(task);
            self.extensions.push(TaskExtension { name: DEFAULT_TASK.into(), ..TaskExtension::default() });
        }
        let main = self.resolve(Kind::Function, "main").ok().and_then(|id| u16::try_from(id).ok());
        if let (true, Some(main)) = (self.instances.is_empty(), main) {
            let task = self.container.tasks.tasks.first().map_or(TaskId(0), |task| task.id);
            let instance = ProgramInstance { task, entry: FunctionId(main), ..ProgramInstance::default() };
            self.instances.push(PendingInstance { instance, ..PendingInstance::default() });
        }
    }

    fn place_instances(&mut self) -> Result<(), String> {
        let global_data = self.container.types.data.clone();
        let explicit = self.given.contains("block_instance");
        for pending in std::mem::take(&mut self.instances) {
            let mut instance = pending.instance;
            let owner = self.container.functions.get(instance.entry.index()).map(|function| function.owner);
            let program = match owner {
                Some(Owner::Program(id)) => self.container.types.programs.get(id.index()).cloned(),
                _ => None,
            };
            let program = program.unwrap_or_default();
            if !pending.has_slots {
                let slots = &mut self.container.types.slots;
                instance.slot_offset = u16::try_from(slots.len()).map_err(|_| "there are too many slots")?;
                instance.slot_count = u16::try_from(program.slots.len()).map_err(|_| "there are too many slots")?;
                slots.extend_from_slice(&program.slots);
            }
            if let (false, false, Some(block)) = (pending.has_blocks, explicit, program.block) {
                let first = self.container.types.block_instances.len();
                self.place_block(block)?;
                let rows = self.container.types.block_instances.len();
                instance.block_offset = u16::try_from(first).map_err(|_| "there are too many block instances")?;
                instance.block_count = u16::try_from(rows - first).map_err(|_| "there are too many block instances")?;
            }
            self.container.tasks.instances.push(instance);
        }
        if !explicit {
            for variable in global_data {
                self.add_block_rows(variable.ty, variable.offset);
            }
        }
        Ok(())
    }

    /// A data variable and the rows for a program's data block.
    fn place_block(&mut self, block: TypeId) -> Result<(), String> {
        let offset = self.place_data(block)?;
        let size = self.extent(block).map_or(0, |extent| extent.0);
        self.data_end = offset.checked_add(size).ok_or("the data region is too large")?;
        self.container.types.data.push(DataVariable { offset, ty: block, constant: false });
        self.container.types.block_instances.push(BlockInstance { offset, stride: size, count: 1, ty: block });
        self.add_block_rows(block, offset);
        Ok(())
    }

    /// The rows that the verifier expects for a variable. Types that break a rule have none: the verifier says so itself.
    fn add_block_rows(&mut self, ty: TypeId, offset: u32) {
        let rows = crate::verify::block_rows(&self.container.types, ty, offset);
        self.container.types.block_instances.extend(rows.unwrap_or_default());
    }

    fn budgets(&mut self) {
        let given = |name| self.given.contains(name);
        let parameters = &mut self.container.parameters;
        if !given("max_stack") {
            parameters.max_stack_depth = DEFAULT_DEPTH;
        }
        if !given("max_call_depth") {
            parameters.max_call_depth = DEFAULT_DEPTH;
        }
        if !given("frame_bytes") {
            parameters.frame_bytes = DEFAULT_FRAME_BYTES;
        }
        if !given("data_bytes") {
            let end = aligned(self.data_end.max(NULL_GUARD_BYTES), 8);
            parameters.data_region_bytes = end.unwrap_or(u32::MAX);
        }
        let capacities = self.container.types.types.iter().filter_map(|ty| match ty {
            Type::String { capacity } => Some(*capacity),
            _ => None,
        });
        if !given("max_string") {
            parameters.max_str_length = capacities.max().unwrap_or(0);
        }
    }
}
