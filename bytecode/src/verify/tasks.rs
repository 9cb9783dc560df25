//! Tasks, program instances, what starts them, and what the scheduler writes for them.

use std::collections::BTreeSet;

use super::error::{Check, VerifyError};
use super::rules::Rule;
use super::types::{TypeTable, Wanted};
use crate::container::{Container, Function, Owner, ProgramInstance, SingleSource, Task, TaskType};
use crate::ids::{FunctionId, ProgramId, SlotIndex};
use crate::limits::MIN_INTERVAL_US;
use crate::value::{BytePlace, Storage};

/// Most microseconds that are still less than 2^63 nanoseconds.
const MAX_TIME_US: u64 = i64::MAX as u64 / 1000;

/// Checks the task table. Returns the program type of each instance.
pub(super) fn check_tasks(container: &Container, types: &TypeTable<'_>) -> Check<Vec<ProgramId>> {
    check_task_entries(container)?;
    check_extensions(container, types)?;
    let mut programs = Vec::new();
    let mut ids = BTreeSet::new();
    let known: BTreeSet<_> = container.tasks.tasks.iter().map(|task| task.id).collect();
    let mut claimed = 0;
    for (index, instance) in container.tasks.instances.iter().enumerate() {
        let error = |rule, message: String| Err(VerifyError::entry(rule, "instance", index, message));
        if !ids.insert(instance.id) {
            return error(Rule::InstanceIds, format!("identifier {} is taken", instance.id));
        }
        if !known.contains(&instance.task) {
            return error(Rule::InstanceTask, format!("there is no task {}", instance.task));
        }
        // Partitions that are apart claim no more slots than there are. Whoever claims more is refused before all of them are looked at.
        claimed += usize::from(instance.slot_count);
        if claimed > container.types.slots.len() {
            let message =
                format!("the instances up to this one have {claimed} slots among {}", container.types.slots.len());
            return error(Rule::InstancePartition, message);
        }
        programs.push(check_instance(container, index, instance)?);
    }
    check_partitions(container)?;
    check_system_variables(container)?;
    for (name, function) in
        [("startup", container.parameters.startup_function), ("init", container.parameters.init_function)]
    {
        if let Some(id) = function {
            check_start_function(container, name, id)?;
        }
    }
    Ok(programs)
}

fn check_task_entries(container: &Container) -> Check {
    let mut ids = BTreeSet::new();
    for (index, task) in container.tasks.tasks.iter().enumerate() {
        let error = |rule, message: String| Err(VerifyError::entry(rule, "task", index, message));
        if !ids.insert(task.id) {
            return error(Rule::TaskIds, format!("identifier {} is taken", task.id));
        }
        let interval_is_right = match task.task_type {
            TaskType::Cyclic => (MIN_INTERVAL_US..=MAX_TIME_US).contains(&task.interval_us),
            TaskType::Event | TaskType::Freewheeling => task.interval_us == 0,
        };
        if !interval_is_right || task.watchdog_us > MAX_TIME_US {
            let message = format!(
                "a {:?} task with an interval of {} us and a watchdog of {} us",
                task.task_type, task.interval_us, task.watchdog_us
            );
            return error(Rule::TaskInterval, message);
        }
    }
    Ok(())
}

fn check_extensions(container: &Container, types: &TypeTable<'_>) -> Check {
    let extensions = &container.types.task_extensions;
    let tasks = &container.tasks.tasks;
    if extensions.len() != tasks.len() {
        let message = format!("{} extensions for {} tasks", extensions.len(), tasks.len());
        return Err(VerifyError::whole(Rule::TaskExtensions, message));
    }
    for (index, (task, extension)) in tasks.iter().zip(extensions).enumerate() {
        if extension.phase_us > MAX_TIME_US {
            let message = format!("a phase of {} us", extension.phase_us);
            return Err(VerifyError::entry(Rule::TaskInterval, "task", index, message));
        }
        check_single(container, types, task, extension.single)
            .map_err(|message| VerifyError::entry(Rule::SingleSource, "task", index, message))?;
    }
    Ok(())
}

fn check_single(container: &Container, types: &TypeTable<'_>, task: &Task, source: SingleSource) -> Result<(), String> {
    match task.task_type {
        TaskType::Event if source == SingleSource::None => return Err("an event task without a SINGLE source".into()),
        TaskType::Freewheeling if source != SingleSource::None => {
            return Err("a freewheeling task with a SINGLE source".into());
        }
        _ => {}
    }
    let in_entry = match source {
        SingleSource::Slot(slot) if task.task_type == TaskType::Event => Some(slot),
        _ => None,
    };
    if task.single_slot != in_entry {
        return Err(format!("the task entry names {:?}, its extension {source:?}", task.single_slot));
    }
    let exists = match source {
        SingleSource::None | SingleSource::Literal(_) => true,
        SingleSource::Slot(slot) => container.types.slots.get(slot.index()) == Some(&Storage::Bool),
        SingleSource::Data(offset) => types
            .data_variable(offset)
            .is_some_and(|variable| types.meets(variable.ty, offset - variable.offset, Wanted::Scalar(Storage::Bool))),
        SingleSource::Bit { place, offset, bit } => {
            bit < 8 && image_size(container, place).is_some_and(|size| offset < size)
        }
    };
    if exists { Ok(()) } else { Err(format!("{source:?} is no BOOL of this container")) }
}

/// Bytes of %I, %Q or %M; none for other places.
pub(super) fn image_size(container: &Container, place: BytePlace) -> Option<u32> {
    let parameters = &container.parameters;
    match place {
        BytePlace::Memory => Some(u32::from(parameters.memory_image_bytes)),
        BytePlace::Output => Some(u32::from(parameters.output_image_bytes)),
        BytePlace::Input => Some(u32::from(parameters.input_image_bytes)),
        BytePlace::Data | BytePlace::Block | BytePlace::This | BytePlace::Frame => None,
    }
}

fn takes_and_gives_nothing(function: &Function) -> bool {
    function.parameters == 0 && function.results.is_empty()
}

fn check_instance(container: &Container, index: usize, instance: &ProgramInstance) -> Check<ProgramId> {
    let error = |rule, message: String| Err(VerifyError::entry(rule, "instance", index, message));
    let function = container.functions.get(instance.entry.index());
    let Some(function) = function.filter(|function| takes_and_gives_nothing(function)) else {
        let message = format!("function {} does not exist, or has parameters or results", instance.entry);
        return error(Rule::InstanceEntry, message);
    };
    let Owner::Program(program) = function.owner else {
        return error(Rule::InstanceEntry, format!("function {} belongs to no program", instance.entry));
    };
    let Some(program_type) = container.types.programs.get(program.index()) else {
        return error(Rule::InstanceEntry, format!("program type {program} does not exist"));
    };
    let (start, count) = (usize::from(instance.slot_offset), usize::from(instance.slot_count));
    let slots = container.types.slots.get(start..start + count);
    let Some(slots) = slots.filter(|_| count == 0 || start >= usize::from(container.tasks.shared_globals)) else {
        let message = format!(
            "slots {start}..{} of {} with {} shared globals",
            start + count,
            container.types.slots.len(),
            container.tasks.shared_globals
        );
        return error(Rule::InstancePartition, message);
    };
    if let Some(at) = (0..count.max(program_type.slots.len())).find(|at| slots.get(*at) != program_type.slots.get(*at))
    {
        let message = format!("slot {at} of the partition is not that of program type {program}");
        return error(Rule::InstanceSlots, message);
    }
    Ok(program)
}

fn check_partitions(container: &Container) -> Check {
    let instances = container.tasks.instances.iter().enumerate();
    let mut partitions: Vec<_> =
        instances.filter(|(_, i)| i.slot_count > 0).map(|(n, i)| (i.slot_offset, i.slot_count, n)).collect();
    partitions.sort_unstable();
    for pair in partitions.windows(2) {
        let &[(start, count, first), (next, _, second)] = pair else { continue };
        if u32::from(start) + u32::from(count) > u32::from(next) {
            let message = format!("its slots overlap those of instance {first}");
            return Err(VerifyError::entry(Rule::InstancePartition, "instance", second, message));
        }
    }
    Ok(())
}

fn check_system_variables(container: &Container) -> Check {
    let mut kinds = BTreeSet::new();
    let mut slots: BTreeSet<SlotIndex> = BTreeSet::new();
    for (index, variable) in container.types.system_variables.iter().enumerate() {
        let shared = variable.slot.0 < container.tasks.shared_globals;
        let wide = container.types.slots.get(variable.slot.index()) == Some(&Storage::I64);
        if !shared || !wide || !kinds.insert(variable.kind) || !slots.insert(variable.slot) {
            let message = format!("{:?} in slot {}", variable.kind, variable.slot);
            return Err(VerifyError::entry(Rule::SystemVariables, "system", index, message));
        }
    }
    Ok(())
}

fn check_start_function(container: &Container, name: &str, id: FunctionId) -> Check {
    let function = container.functions.get(id.index());
    if function.is_some_and(|f| takes_and_gives_nothing(f) && f.owner == Owner::None) {
        return Ok(());
    }
    let message = format!("the {name} function is {id}, which does not exist or can not run on its own");
    Err(VerifyError::whole(Rule::StartFunctions, message))
}
