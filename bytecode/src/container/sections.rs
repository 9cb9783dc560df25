//! What stands in each section: one row a struct, choice or table.

use super::error::{ReadCode, ReadError, WriteError};
use super::layout::{InstanceField, NONE, Record as Fixed, TaskField};
use super::model::*;
use super::wire::{Input, Shapes, Wire, wire_bytes, wire_choices, wire_ids, wire_structs, wire_tables};
use crate::ids::{ArrayId, FunctionId, InstanceId, MethodId, ProgramId, SlotIndex, TaskId, TypeId};
use crate::limits::MAX_TASK_NAME_BYTES;
use crate::value::{BytePlace, IntegerType, LocalType, RefType, SlotPlace, Storage, ValueType};

wire_ids! { ArrayId(u16) FunctionId(u16) MethodId(u16) ProgramId(u16) SlotIndex(u16) TypeId(u16) }

wire_bytes! {
    Storage { Bool, I8, U8, I16, U16, I32, I64, F32, F64 }
    ValueType { I32, I64, F32, F64 }
    IntegerType { I8, U8, I16, U16, I32, U32, I64, U64 }
    SlotPlace { Global, Program, Local }
    BytePlace { Data, Block, This, Frame, Memory, Output, Input }
    Region { Slots, Data, Memory, Output }
    OverrunPolicy { Grid, AtOnce, Realign }
    SystemVariableKind { UpTime, UpLtime }
    ElementaryType {
        Bool, Sint, Int, Dint, Lint, Usint, Uint, Udint, Ulint, Byte, Word, Dword, Lword, Real, Lreal, Time, Ltime, Date, Ldate,
        TimeOfDay, LtimeOfDay, DateAndTime, LdateAndTime, Char, Wchar
    }
}

wire_structs! {
    Record { size: u32, align: u32, fields: Vec<Field> }
    Field { offset: u32, ty: TypeId }
    ArrayDescriptor { element: TypeId, stride: u32, dimensions: Vec<(i32, i32)> }
    DataVariable { offset: u32, ty: TypeId, constant: bool }
    ProgramType { slots: Vec<Storage>, block: Option<TypeId> }
    BlockInstance { offset: u32, stride: u32, count: u32, ty: TypeId }
    RefType { target: TypeId, write: bool, image: bool }
    MethodSignature { parameters: Vec<LocalType>, results: Vec<ValueType> }
    InitRun { region: Region, offset: u32, repeat: u32, bytes: Vec<u8> }
    RetainRange { region: Region, offset: u32, bytes: u32 }
    TaskExtension {
        name: String => MAX_TASK_NAME_BYTES,
        single: SingleSource,
        phase_us: u64,
        watchdog_sensitivity: u16,
        overrun_policy: OverrunPolicy,
    }
    SystemVariable { kind: SystemVariableKind, slot: SlotIndex }
    SymbolHash { kind: u8, index: u32, hash: Hash }
    Function {
        owner: Owner,
        parameters: u16,
        locals: Vec<LocalType>,
        results: Vec<ValueType>,
        frame: Option<TypeId>,
        for_loops: Vec<ForLoop>,
        code: Vec<u8>,
    }
    ForLoop { control: ControlPlace, ty: IntegerType, bound: SlotIndex, step: SlotIndex }
    SourceFile { name: String, hash: Hash }
    LineEntry { function: FunctionId, offset: u32, file: u16, line: u32, column: u32 }
    DebugVariable { name: String, place: DebugPlace, ty: DebugTypeId, constant: bool }
}

wire_choices! {
    Type {
        0 Scalar(storage: Storage),
        1 String { capacity: u16 },
        2 WideString { capacity: u16 },
        3 Array(array: ArrayId),
        4 Struct(record: Record),
        5 Union(record: Record),
        6 Block { record: Record, base: Option<TypeId>, methods: Vec<(MethodId, FunctionId)> },
    }
    LocalType { 0 Scalar(storage: Storage), 1 Ref(reference: RefType) }
    SingleSource {
        0 None,
        1 Slot(slot: SlotIndex),
        2 Data(offset: u32),
        3 Bit { place: BytePlace, offset: u32, bit: u8 },
        4 Literal(value: bool),
    }
    Constant { 0 I64(value: i64), 1 F32(bits: u32), 2 F64(bits: u64) }
    Owner { 0 None, 1 Program(program: ProgramId), 2 Block(ty: TypeId) }
    ControlPlace { 0 Slot(place: SlotPlace, slot: SlotIndex), 1 Bytes(place: BytePlace, offset: u32) }
    DebugType {
        0 Elementary(ty: ElementaryType),
        1 Enumeration { name: String, base: ElementaryType, values: Vec<(String, i64)> },
        2 String { capacity: u16 },
        3 WideString { capacity: u16 },
        4 Array { element: DebugTypeId, stride: u32, dimensions: Vec<(i32, i32)> },
        5 Record { name: String, fields: Vec<(String, u32, DebugTypeId)> },
        6 Subrange { base: ElementaryType, lower: i64, upper: i64 },
    }
    DebugPlace {
        0 Slot(slot: SlotIndex),
        1 Bytes(place: BytePlace, offset: u32),
        2 Bit(place: BytePlace, offset: u32, bit: u8),
    }
}

wire_tables! { TypeSection TYPE_TABLES put_type_tables get_type_tables {
    1 types: Type = "Memory types.";
    2 arrays: ArrayDescriptor = "Array descriptors.";
    3 slots: Storage = "Form of each slot: shared globals, then each instance's partition.";
    4 data: DataVariable = "Variables of the data region.";
    5 programs: ProgramType = "Program types.";
    6 block_instances: BlockInstance = "Function block instances.";
    7 methods: MethodSignature = "Signatures of method names.";
    8 init_image: InitRun = "Initial values.";
    9 retain: RetainRange = "What a warm restart keeps.";
    10 task_extensions: TaskExtension = "One for each task entry. A name has at most 255 bytes.";
    11 system_variables: SystemVariable = "Slots that the scheduler writes.";
    12 symbol_hashes: SymbolHash = "Hashes of definitions, for online change.";
} }

wire_tables! { DebugSection DEBUG_TABLES put_debug_tables get_debug_tables {
    1 files: SourceFile = "Source files in compile order.";
    2 lines: LineEntry = "From code to source.";
    3 function_names: String = "One for each function.";
    4 types: DebugType = "Types as the source declares them.";
    5 variables: DebugVariable = "Globals and program variables.";
    6 instance_names: String = "One for each program instance.";
} }

/// For documents.
pub(crate) fn shapes() -> Shapes {
    Shapes {
        structs: STRUCTS,
        choices: CHOICES,
        bytes: byte_shapes(),
        tables: vec![("type section", TYPE_TABLES), ("debug section", DEBUG_TABLES)],
    }
}

/// The type section: the retain map's hash, then its tables.
pub(super) fn put_types(section: &TypeSection, retain_hash: &Hash, out: &mut Vec<u8>) -> Result<(), WriteError> {
    retain_hash.put(out)?;
    put_type_tables(section, out)
}

/// The type section and the hash that it claims for its retain map.
pub(super) fn get_types(input: &mut Input<'_>) -> Result<(TypeSection, Hash), ReadError> {
    let hash = Hash::get(input)?;
    let mut section = TypeSection::default();
    get_type_tables(&mut section, input)?;
    Ok((section, hash))
}

impl Wire for DebugSection {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        self.resource_name.put(out)?;
        self.configuration_name.put(out)?;
        put_debug_tables(self, out)
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        let resource_name = String::get(input)?;
        let configuration_name = String::get(input)?;
        let mut section = DebugSection { resource_name, configuration_name, ..DebugSection::default() };
        get_debug_tables(&mut section, input)?;
        Ok(section)
    }
}

impl Wire for TaskTable {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        count(self.tasks.len(), "tasks")?.put(out)?;
        count(self.instances.len(), "program instances")?.put(out)?;
        self.shared_globals.put(out)?;
        Task::put_all(&self.tasks, out)?;
        ProgramInstance::put_all(&self.instances, out)
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        let tasks = u16::get(input)?;
        let instances = u16::get(input)?;
        let shared_globals = u16::get(input)?;
        let tasks = Task::get_all(tasks.into(), input)?;
        Ok(TaskTable { shared_globals, tasks, instances: ProgramInstance::get_all(instances.into(), input)? })
    }
}

/// A number of things that a u16 of the format counts.
pub(super) fn count(count: usize, what: &str) -> Result<u16, WriteError> {
    u16::try_from(count).map_err(|_| WriteError::new(format!("{count} {what}; 65535 is the limit")))
}

/// An id for which 0xFFFF says that there is none.
pub(super) fn optional_id(id: Option<u16>, what: &str) -> Result<u16, WriteError> {
    match id {
        Some(NONE) => Err(WriteError::new(format!("{what} 65535; 65534 is the limit"))),
        id => Ok(id.unwrap_or(NONE)),
    }
}

impl Wire for Task {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        let mut entry = Fixed::zero();
        entry.set(TaskField::TaskId, self.id.0);
        entry.set(TaskField::Priority, self.priority);
        entry.set(TaskField::TaskType, self.task_type as u8);
        entry.set(TaskField::Flags, u8::from(self.enabled));
        entry.set(TaskField::Interval, self.interval_us);
        entry.set(TaskField::SingleVariable, optional_id(self.single_slot.map(|slot| slot.0), "SINGLE slot")?);
        entry.set(TaskField::Watchdog, self.watchdog_us);
        out.extend_from_slice(entry.bytes());
        Ok(())
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        let place = input.clone();
        let entry = Fixed::of(input.take(super::layout::TASK_ENTRY_BYTES)?);
        no_reserved(&entry, &place)?;
        let task_type = match entry.get(TaskField::TaskType) {
            0 => TaskType::Cyclic,
            1 => TaskType::Event,
            2 => TaskType::Freewheeling,
            other => return Err(place.error(ReadCode::Value, format!("{other} is no task_type"))),
        };
        let flags = entry.get(TaskField::Flags);
        if flags > 1 {
            return Err(place.error(ReadCode::Reserved, format!("unknown flags {flags:#04x} of a task")));
        }
        let single = entry.get_u16(TaskField::SingleVariable);
        Ok(Task {
            id: TaskId(entry.get_u16(TaskField::TaskId)),
            priority: entry.get_u16(TaskField::Priority),
            task_type,
            enabled: flags == 1,
            interval_us: entry.get(TaskField::Interval),
            single_slot: (single != NONE).then_some(SlotIndex(single)),
            watchdog_us: entry.get(TaskField::Watchdog),
        })
    }
}

impl Wire for ProgramInstance {
    fn put(&self, out: &mut Vec<u8>) -> Result<(), WriteError> {
        let mut entry = Fixed::zero();
        entry.set(InstanceField::InstanceId, self.id.0);
        entry.set(InstanceField::TaskId, self.task.0);
        entry.set(InstanceField::EntryFunction, self.entry.0);
        entry.set(InstanceField::SlotOffset, self.slot_offset);
        entry.set(InstanceField::SlotCount, self.slot_count);
        entry.set(InstanceField::BlockOffset, self.block_offset);
        entry.set(InstanceField::BlockCount, self.block_count);
        out.extend_from_slice(entry.bytes());
        Ok(())
    }

    fn get(input: &mut Input<'_>) -> Result<Self, ReadError> {
        let place = input.clone();
        let entry = Fixed::of(input.take(super::layout::INSTANCE_ENTRY_BYTES)?);
        no_reserved(&entry, &place)?;
        Ok(ProgramInstance {
            id: InstanceId(entry.get_u16(InstanceField::InstanceId)),
            task: TaskId(entry.get_u16(InstanceField::TaskId)),
            entry: FunctionId(entry.get_u16(InstanceField::EntryFunction)),
            slot_offset: entry.get_u16(InstanceField::SlotOffset),
            slot_count: entry.get_u16(InstanceField::SlotCount),
            block_offset: entry.get_u16(InstanceField::BlockOffset),
            block_count: entry.get_u16(InstanceField::BlockCount),
        })
    }
}

fn no_reserved<F: super::layout::RecordField>(entry: &Fixed<F>, place: &Input<'_>) -> Result<(), ReadError> {
    match entry.nonzero_reserved() {
        None => Ok(()),
        Some(field) => Err(place.error(ReadCode::Reserved, format!("`{}` is not zero", field.name()))),
    }
}
