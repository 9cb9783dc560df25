//! What a container says, as Rust values: filled by the front end or the reader, checked by the verifier.
//!
//! Counts and sizes that follow from other parts (number of variables, section sizes) are not stored twice here: the writer derives
//! them and the reader refuses a file in which they disagree.

use crate::ids::{ArrayId, FunctionId, InstanceId, MethodId, ProgramId, SlotIndex, TaskId, TypeId};
use crate::value::{BytePlace, IntegerType, LocalType, SlotPlace, Storage, ValueType};

/// A SHA-256 hash.
pub type Hash = [u8; 32];

/// One compiled RESOURCE.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Container {
    /// Budgets and sizes of the header that do not follow from other parts.
    pub parameters: Parameters,
    /// SHA-256 over the source files' bytes in compile order.
    pub source_hash: Hash,
    /// Ed25519 signature section over the content hash, as bytes; empty when unsigned.
    pub content_signature: Vec<u8>,
    /// Ed25519 signature section over the debug hash, as bytes; empty when unsigned.
    pub debug_signature: Vec<u8>,
    /// Types, variables, initial values, program types, extensions of tasks.
    pub types: TypeSection,
    /// Tasks and program instances.
    pub tasks: TaskTable,
    /// Constant pool.
    pub constants: Vec<Constant>,
    /// Functions; a [`FunctionId`] is a position here.
    pub functions: Vec<Function>,
    /// Names and lines for people. No engine and no scheduler reads it.
    pub debug: Option<DebugSection>,
}

/// Header fields that the writer can not derive.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Parameters {
    /// Deepest operand stack of any function, in entries.
    pub max_stack_depth: u16,
    /// Deepest nesting of calls; the entry function is depth 1.
    pub max_call_depth: u16,
    /// Bytes of %I.
    pub input_image_bytes: u16,
    /// Bytes of %Q.
    pub output_image_bytes: u16,
    /// Bytes of %M.
    pub memory_image_bytes: u16,
    /// Bytes of the data region (header 236), the unallocated first 16 included.
    pub data_region_bytes: u32,
    /// Bytes of one task's frame memory (header 240): enough for its deepest direct calls.
    pub frame_bytes: u32,
    /// Function run once when the resource starts (header 232), after initialisation.
    pub startup_function: Option<FunctionId>,
    /// Function run once at load for initial values that need code (header 234).
    pub init_function: Option<FunctionId>,
    /// Bytes of all STRING variables (header 204).
    pub total_str_var_bytes: u32,
    /// Largest declared STRING length (header 216).
    pub max_str_length: u16,
}

/// The type section: tagged sub-tables.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TypeSection {
    /// Memory types; a [`TypeId`] is a position here. A type refers only to types before it.
    pub types: Vec<Type>,
    /// Array descriptors; an [`ArrayId`] is a position here.
    pub arrays: Vec<ArrayDescriptor>,
    /// Form of each slot: shared globals first, then each program instance's partition.
    pub slots: Vec<Storage>,
    /// Variables of the data region, ascending by offset, without overlap; program data blocks are among them.
    pub data: Vec<DataVariable>,
    /// Program types; a [`ProgramId`] is a position here.
    pub programs: Vec<ProgramType>,
    /// Function block instance table: for each program instance first its data block (when it has one), then its blocks; globals' blocks last.
    pub block_instances: Vec<BlockInstance>,
    /// Method names' signatures; a [`MethodId`] is a position here.
    pub methods: Vec<MethodSignature>,
    /// Initial values, ascending by region and offset, without overlap. What no run covers starts as 0.
    pub init_image: Vec<InitRun>,
    /// What a warm restart keeps.
    pub retain: Vec<RetainRange>,
    /// What the task entries of the task table have no room for, one for each task in the same order.
    pub task_extensions: Vec<TaskExtension>,
    /// Slots that the scheduler writes before each round.
    pub system_variables: Vec<SystemVariable>,
    /// Hashes of symbols for online change: (kind, index, hash), ascending.
    pub symbol_hashes: Vec<SymbolHash>,
}

impl Container {
    /// What people call each task, in the order of the task table: its name, or `task ID` when it has none.
    #[must_use]
    pub fn task_names(&self) -> Vec<String> {
        let tasks = self.tasks.tasks.iter().enumerate();
        tasks
            .map(|(position, task)| {
                self.types.task_name(position).map_or_else(|| format!("task {}", task.id), str::to_string)
            })
            .collect()
    }
}

impl TypeSection {
    /// Name of the task at this position of the task table, if it has one.
    #[must_use]
    pub fn task_name(&self, position: usize) -> Option<&str> {
        self.task_extensions.get(position).map(|extension| extension.name.as_str()).filter(|name| !name.is_empty())
    }
}

/// How a value lies in byte-addressed memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Type {
    /// One scalar.
    Scalar(Storage),
    /// `STRING[capacity]`: capacity + 1 bytes, zero-terminated.
    String {
        /// Characters, without the terminator.
        capacity: u16,
    },
    /// `WSTRING[capacity]`: 2 × (capacity + 1) bytes, zero-terminated.
    WideString {
        /// UTF-16 code units, without the terminator.
        capacity: u16,
    },
    /// An array.
    Array(ArrayId),
    /// A structure.
    Struct(Record),
    /// Fields that share their memory: every offset is 0.
    Union(Record),
    /// A function block (or class) type.
    Block {
        /// Its fields.
        record: Record,
        /// The type whose fields are a prefix of this one's, for EXTENDS.
        base: Option<TypeId>,
        /// Its methods, ascending by name: what `call.virtual` finds.
        methods: Vec<(MethodId, FunctionId)>,
    },
}

/// Size and fields of a structure, union, function block or data block.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Record {
    /// Extent in bytes, a multiple of `align`.
    pub size: u32,
    /// Alignment in bytes: 1, 2, 4 or 8.
    pub align: u32,
    /// Fields, ascending by offset; only a union's overlap. A field of block type does not stand at offset 0 of a block, so that an address names one instance.
    pub fields: Vec<Field>,
}

/// One field of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Byte offset from the record's start.
    pub offset: u32,
    /// Type of the field.
    pub ty: TypeId,
}

/// An array: what `ref.index` checks against.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArrayDescriptor {
    /// Type of one element.
    pub element: TypeId,
    /// Bytes from one element to the next: the element's size.
    pub stride: u32,
    /// Lower and upper bound of each dimension, the first varies slowest.
    pub dimensions: Vec<(i32, i32)>,
}

/// One variable of the data region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DataVariable {
    /// Offset from the region's start.
    pub offset: u32,
    /// Its type.
    pub ty: TypeId,
    /// No typed access writes it (string literals, CONSTANT variables).
    pub constant: bool,
}

/// What every instance of one PROGRAM has of its own.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ProgramType {
    /// Form of each of its slots, in slot order.
    pub slots: Vec<Storage>,
    /// Type of its data block (a `Struct`), when it has one.
    pub block: Option<TypeId>,
}

/// One row of the function block instance table: `count` instances, `stride` bytes apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockInstance {
    /// Offset of the first from the start of the data region.
    pub offset: u32,
    /// Bytes from one to the next (their size when there is just one).
    pub stride: u32,
    /// How many.
    pub count: u32,
    /// Their type: a `Block`, or the `Struct` of a program's data block.
    pub ty: TypeId,
}

/// What all methods of one name take and give, `this` excluded.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MethodSignature {
    /// Parameters in order.
    pub parameters: Vec<LocalType>,
    /// Results in order.
    pub results: Vec<ValueType>,
}

/// A region of the memory image that has initial or retained values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Region {
    /// Slots; offsets are slot index × 8.
    Slots = 0,
    /// Data region.
    Data = 1,
    /// %M.
    Memory = 2,
    /// %Q staging.
    Output = 3,
}

/// Initial bytes at one place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InitRun {
    /// Where.
    pub region: Region,
    /// Offset from the region's start.
    pub offset: u32,
    /// How often `bytes` stand one behind the other.
    pub repeat: u32,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Bytes that a warm restart keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetainRange {
    /// Where.
    pub region: Region,
    /// Offset from the region's start.
    pub offset: u32,
    /// How many bytes.
    pub bytes: u32,
}

/// What starts an event task, or holds off a periodic one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SingleSource {
    /// The task has no SINGLE.
    #[default]
    None,
    /// A BOOL slot, absolute.
    Slot(SlotIndex),
    /// A BOOL in the data region.
    Data(u32),
    /// One bit of %I, %Q or %M.
    Bit {
        /// Which image.
        place: BytePlace,
        /// Byte in it.
        offset: u32,
        /// Bit of the byte, 0 to 7.
        bit: u8,
    },
    /// A literal.
    Literal(bool),
}

/// When a cyclic task goes on after it ran past its next due time (architecture §8).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum OverrunPolicy {
    /// At the first grid point after the end.
    #[default]
    Grid = 0,
    /// At once.
    AtOnce = 1,
    /// One interval after the end.
    Realign = 2,
}

/// What a task entry has no room for.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TaskExtension {
    /// Its name as declared, at most [`MAX_TASK_NAME_BYTES`](crate::limits::MAX_TASK_NAME_BYTES) bytes. It stands here and not in the debug
    /// section because statistics and reports of a stripped container name their tasks, too.
    pub name: String,
    /// Its SINGLE source. A slot of an event task stands here and in the entry's `single_var_index`.
    pub single: SingleSource,
    /// Offset of its grid from the start, in microseconds.
    pub phase_us: u64,
    /// Consecutive overruns of the watchdog time until it trips; 0 and 1 mean the first.
    pub watchdog_sensitivity: u16,
    /// What follows an overrun.
    pub overrun_policy: OverrunPolicy,
}

/// A slot that the scheduler writes before each round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SystemVariable {
    /// What it holds.
    pub kind: SystemVariableKind,
    /// The shared global slot, of storage i64.
    pub slot: SlotIndex,
}

/// What a system variable holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum SystemVariableKind {
    /// `__SYSTEM_UP_TIME`: time of the round since start, nanoseconds in whole milliseconds.
    UpTime = 0,
    /// `__SYSTEM_UP_LTIME`: time of the round since start, nanoseconds. Timers read it.
    UpLtime = 1,
}

/// Hash of one symbol, for online change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SymbolHash {
    /// 0 type, 1 function, 2 variable.
    pub kind: u8,
    /// Position in the table of that kind.
    pub index: u32,
    /// Hash of its definition.
    pub hash: Hash,
}

/// The task table section.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TaskTable {
    /// Number of shared global slots.
    pub shared_globals: u16,
    /// Tasks in declaration order.
    pub tasks: Vec<Task>,
    /// Program instances in declaration order.
    pub instances: Vec<ProgramInstance>,
}

/// How a task is started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum TaskType {
    /// Every `interval_us`.
    #[default]
    Cyclic = 0,
    /// On a rising edge of its SINGLE source.
    Event = 1,
    /// In every round.
    Freewheeling = 2,
}

/// One task entry (32 bytes in the file).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Task {
    /// Unique identifier.
    pub id: TaskId,
    /// 0 is the highest.
    pub priority: u16,
    /// How it is started.
    pub task_type: TaskType,
    /// Whether it runs from the start (flags bit 0).
    pub enabled: bool,
    /// Interval in microseconds; 0 unless cyclic.
    pub interval_us: u64,
    /// Slot of an event task's SINGLE variable, if it is one.
    pub single_slot: Option<SlotIndex>,
    /// Watchdog time in microseconds; 0: none.
    pub watchdog_us: u64,
}

/// One program instance entry (16 bytes in the file).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ProgramInstance {
    /// Unique identifier.
    pub id: InstanceId,
    /// The task it belongs to.
    pub task: TaskId,
    /// Its entry function: owner `Program`, no parameters, no results.
    pub entry: FunctionId,
    /// First slot of its partition.
    pub slot_offset: u16,
    /// Slots of its partition: as many as its program type has.
    pub slot_count: u16,
    /// First row of its function block instances; its data block's row when its type has one.
    pub block_offset: u16,
    /// Rows of function block instances, the data block's included.
    pub block_count: u16,
}

/// One constant. A NaN is the one NaN.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Constant {
    /// 64-bit integer, bit string, time.
    I64(i64),
    /// Bits of a REAL.
    F32(u32),
    /// Bits of an LREAL.
    F64(u64),
}

impl Constant {
    /// Its type on the operand stack.
    #[must_use]
    pub fn value_type(self) -> ValueType {
        match self {
            Constant::I64(_) => ValueType::I64,
            Constant::F32(_) => ValueType::F32,
            Constant::F64(_) => ValueType::F64,
        }
    }
}

/// Whose memory a function works on beside its own frame and the shared globals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Owner {
    /// Nobody's: a FUNCTION.
    #[default]
    None,
    /// A program instance's: places `P` and `B`. Callable only from functions of the same owner and as an entry.
    Program(ProgramId),
    /// A function block instance's: place `T`; `this` is a hidden first argument, a writable reference to the type.
    Block(TypeId),
}

/// One function.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Function {
    /// Whose memory it works on.
    pub owner: Owner,
    /// Number of parameters: the first so many `L` slots (`this` is not among them).
    pub parameters: u16,
    /// Types of the `L` slots, parameters first.
    pub locals: Vec<LocalType>,
    /// Types of the results, pushed in order.
    pub results: Vec<ValueType>,
    /// Type (a `Struct`) of its frame bytes, when it has some.
    pub frame: Option<TypeId>,
    /// Its FOR loops.
    pub for_loops: Vec<ForLoop>,
    /// Encoded instructions.
    pub code: Vec<u8>,
}

impl Function {
    /// Types of the parameters.
    #[must_use]
    pub fn parameter_types(&self) -> &[LocalType] {
        self.locals.get(..usize::from(self.parameters)).unwrap_or(&self.locals)
    }
}

/// Where the control variable of a FOR loop stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlPlace {
    /// In a slot.
    Slot(SlotPlace, SlotIndex),
    /// In memory at a known place (not %I).
    Bytes(BytePlace, u32),
}

/// Descriptor of one FOR loop: what `for.enter` and `for.next` work on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ForLoop {
    /// Control variable.
    pub control: ControlPlace,
    /// Its type, which gives the order of the comparison with the bound.
    pub ty: IntegerType,
    /// `L` slot that keeps the bound; only this loop's two instructions touch it.
    pub bound: SlotIndex,
    /// `L` slot that keeps the step (signed); only this loop's two instructions touch it.
    pub step: SlotIndex,
}

/// Names and places for people: reports, dumps, disassembly.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DebugSection {
    /// Source files in compile order.
    pub files: Vec<SourceFile>,
    /// Ascending by function, then offset: a place holds up to the next.
    pub lines: Vec<LineEntry>,
    /// One for each function.
    pub function_names: Vec<String>,
    /// Types as the source declares them; a [`DebugTypeId`] is a position here. A type refers only to types before it.
    pub types: Vec<DebugType>,
    /// Globals and program variables, in the order of a dump.
    pub variables: Vec<DebugVariable>,
    /// One for each program instance, in order.
    pub instance_names: Vec<String>,
    /// Name of the RESOURCE.
    pub resource_name: String,
    /// Name of the CONFIGURATION.
    pub configuration_name: String,
}

/// One source file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceFile {
    /// Its name as it was given.
    pub name: String,
    /// SHA-256 of its bytes.
    pub hash: Hash,
}

/// From code to source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LineEntry {
    /// Function.
    pub function: FunctionId,
    /// Byte offset of the first instruction.
    pub offset: u32,
    /// Position in `files`.
    pub file: u16,
    /// 1-based line.
    pub line: u32,
    /// 1-based column, in characters.
    pub column: u32,
}

/// Position in [`DebugSection::types`].
pub type DebugTypeId = u16;

/// A type as the source names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DebugType {
    /// An elementary type other than STRING, with how it lies in memory.
    Elementary(ElementaryType),
    /// An enumeration: its values' names over a base type.
    Enumeration {
        /// Name of the type.
        name: String,
        /// Base type.
        base: ElementaryType,
        /// Names and values.
        values: Vec<(String, i64)>,
    },
    /// A part of an integer type (clause 6.4.4.4), lower <= upper.
    Subrange {
        /// The integer type.
        base: ElementaryType,
        /// Least value; of an unsigned type the bits of its number.
        lower: i64,
        /// Greatest value; of an unsigned type the bits of its number.
        upper: i64,
    },
    /// `STRING[capacity]`.
    String {
        /// Characters.
        capacity: u16,
    },
    /// `WSTRING[capacity]`.
    WideString {
        /// Code units.
        capacity: u16,
    },
    /// An array.
    Array {
        /// Element type.
        element: DebugTypeId,
        /// Bytes from one element to the next.
        stride: u32,
        /// Bounds, the first dimension varies slowest.
        dimensions: Vec<(i32, i32)>,
    },
    /// A structure, union or function block type.
    Record {
        /// Name of the type.
        name: String,
        /// Its visible fields: name, offset, type.
        fields: Vec<(String, u32, DebugTypeId)>,
    },
}

/// Where a variable is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DebugPlace {
    /// In a slot, absolute.
    Slot(SlotIndex),
    /// In bytes: `Data`, `Memory`, `Output` or `Input` at an offset.
    Bytes(BytePlace, u32),
    /// One bit of `Memory`, `Output` or `Input`.
    Bit(BytePlace, u32, u8),
}

/// One variable of a program instance, or a global.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DebugVariable {
    /// Name as declared; `instance.name` for those of a program instance.
    pub name: String,
    /// Where it is.
    pub place: DebugPlace,
    /// Its type.
    pub ty: DebugTypeId,
    /// Whether it was declared CONSTANT.
    pub constant: bool,
}

macro_rules! elementary_types {
    ($($variant:ident = $code:literal $name:literal $storage:ident),* $(,)?) => {
        /// Elementary types of IEC 61131-3 (table 10) other than strings.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum ElementaryType { $(#[doc = $name] $variant = $code),* }

        impl ElementaryType {
            /// Every one, in the order of its number.
            pub const ALL: &'static [ElementaryType] = &[$(ElementaryType::$variant),*];

            /// The one with this number.
            #[must_use]
            pub fn from_code(code: u8) -> Option<ElementaryType> {
                match code { $($code => Some(ElementaryType::$variant),)* _ => None }
            }

            /// Its keyword.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(ElementaryType::$variant => $name),* }
            }

            /// How it lies in memory.
            #[must_use]
            pub fn storage(self) -> Storage {
                match self { $(ElementaryType::$variant => Storage::$storage),* }
            }
        }
    };
}

elementary_types! {
    Bool = 0 "BOOL" Bool, Sint = 1 "SINT" I8, Int = 2 "INT" I16, Dint = 3 "DINT" I32, Lint = 4 "LINT" I64,
    Usint = 5 "USINT" U8, Uint = 6 "UINT" U16, Udint = 7 "UDINT" I32, Ulint = 8 "ULINT" I64,
    Byte = 9 "BYTE" U8, Word = 10 "WORD" U16, Dword = 11 "DWORD" I32, Lword = 12 "LWORD" I64,
    Real = 13 "REAL" F32, Lreal = 14 "LREAL" F64, Time = 15 "TIME" I64, Ltime = 16 "LTIME" I64,
    Date = 17 "DATE" I64, Ldate = 18 "LDATE" I64, TimeOfDay = 19 "TOD" I64, LtimeOfDay = 20 "LTOD" I64,
    DateAndTime = 21 "DT" I64, LdateAndTime = 22 "LDT" I64, Char = 23 "CHAR" U8, Wchar = 24 "WCHAR" U16,
}
