//! Records of fixed layout: header, task entry, program instance entry. One row a field; writer, reader and documents use these rows.
//!
//! Offsets and names are those of the reference design (`61131-task-support.md`); 232 to 243 of the header are additions of architecture §3.

/// Bytes of the header.
pub const HEADER_BYTES: usize = 256;
/// Bytes of a task entry.
pub const TASK_ENTRY_BYTES: usize = 32;
/// Bytes of a program instance entry.
pub const INSTANCE_ENTRY_BYTES: usize = 16;
/// First field of the header: the first bytes of the file are 43 4C 50 49.
pub const MAGIC: u32 = 0x4950_4C43;
/// The format version that this crate writes and reads.
pub const FORMAT_VERSION: u16 = 1;
/// No function or slot.
pub const NONE: u16 = 0xFFFF;
/// Flag: the container has a content signature.
pub const FLAG_CONTENT_SIGNATURE: u8 = 1;
/// Flag: the container has a debug section.
pub const FLAG_DEBUG: u8 = 2;
/// Flag: the container has a type section. Always set.
pub const FLAG_TYPES: u8 = 4;
/// Parts of the header that the content hash covers (without hashes of other parts, flags and directory).
pub const HASHED_HEADER_RANGES: [std::ops::Range<usize>; 4] = [0..7, 40..72, 104..136, 192..256];

/// What a field of a fixed record is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    /// One byte.
    U8,
    /// Two bytes, little-endian.
    U16,
    /// Four bytes, little-endian.
    U32,
    /// Eight bytes, little-endian.
    U64,
    /// A SHA-256 hash.
    Hash,
    /// So many bytes that must be zero.
    Zero(usize),
}

impl FieldType {
    /// Bytes of the field.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            FieldType::U8 => 1,
            FieldType::U16 => 2,
            FieldType::U32 => 4,
            FieldType::U64 => 8,
            FieldType::Hash => 32,
            FieldType::Zero(bytes) => bytes,
        }
    }

    /// Its name in documents.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            FieldType::U8 => "u8".into(),
            FieldType::U16 => "u16".into(),
            FieldType::U32 => "u32".into(),
            FieldType::U64 => "u64".into(),
            FieldType::Hash => "[u8; 32]".into(),
            FieldType::Zero(bytes) => format!("[u8; {bytes}]"),
        }
    }
}

/// A field of a fixed record.
pub trait RecordField: Copy + PartialEq + 'static {
    /// Every field, by offset.
    const ALL: &'static [Self];
    /// Bytes of the record.
    const RECORD_BYTES: usize;
    /// Its name in the reference design.
    fn name(self) -> &'static str;
    /// Byte offset in the record.
    fn offset(self) -> usize;
    /// Its form.
    fn ty(self) -> FieldType;
    /// What it says.
    fn meaning(self) -> &'static str;
}

macro_rules! record {
    ($(#[$doc:meta])* $name:ident($bytes:ident) { $($variant:ident $offset:literal $field:literal $ty:ident$(($size:literal))? $meaning:literal;)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $name { $(#[doc = $meaning] $variant),* }

        impl RecordField for $name {
            const ALL: &'static [Self] = &[$($name::$variant),*];
            const RECORD_BYTES: usize = $bytes;
            fn name(self) -> &'static str { match self { $($name::$variant => $field),* } }
            fn offset(self) -> usize { match self { $($name::$variant => $offset),* } }
            fn ty(self) -> FieldType { match self { $($name::$variant => FieldType::$ty$(($size))?),* } }
            fn meaning(self) -> &'static str { match self { $($name::$variant => $meaning),* } }
        }
    };
}

record! {
    /// Fields of the header.
    HeaderField(HEADER_BYTES) {
        Magic 0 "magic" U32 "`0x49504C43`.";
        Version 4 "format_version" U16 "1.";
        Profile 6 "profile" U8 "Reserved; zero.";
        Flags 7 "flags" U8 "Bit 0: content signature; bit 1: debug section; bit 2: type section (always set).";
        ContentHash 8 "content_hash" Hash "SHA-256 of the content (see Hashes).";
        SourceHash 40 "source_hash" Hash "SHA-256 of the source files' bytes in compile order.";
        DebugHash 72 "debug_hash" Hash "SHA-256 of the debug section; zero without one.";
        LayoutHash 104 "layout_hash" Hash "SHA-256 of the memory layout signature (see Hashes).";
        ContentSignatureOffset 136 "sig_section_offset" U32 "Where the content signature section begins; 0 without one.";
        ContentSignatureSize 140 "sig_section_size" U32 "Its bytes.";
        DebugSignatureOffset 144 "debug_sig_offset" U32 "Where the debug signature section begins; 0 without one.";
        DebugSignatureSize 148 "debug_sig_size" U32 "Its bytes.";
        TypeOffset 152 "type_section_offset" U32 "Where the type section begins.";
        TypeSize 156 "type_section_size" U32 "Its bytes.";
        TaskOffset 160 "task_section_offset" U32 "Where the task table section begins.";
        TaskSize 164 "task_section_size" U32 "Its bytes.";
        ConstantOffset 168 "const_section_offset" U32 "Where the constant pool section begins.";
        ConstantSize 172 "const_section_size" U32 "Its bytes.";
        CodeOffset 176 "code_section_offset" U32 "Where the code section begins.";
        CodeSize 180 "code_section_size" U32 "Its bytes.";
        DebugOffset 184 "debug_section_offset" U32 "Where the debug section begins; 0 without one.";
        DebugSize 188 "debug_section_size" U32 "Its bytes.";
        MaxStackDepth 192 "max_stack_depth" U16 "Deepest operand stack of a function, in entries.";
        MaxCallDepth 194 "max_call_depth" U16 "Deepest nesting of calls; an entry function is depth 1.";
        NumVariables 196 "num_variables" U16 "Rows of the `slots` table.";
        NumBlockInstances 198 "num_fb_instances" U16 "Rows of the `block_instances` table.";
        BlockInstanceBytes 200 "total_fb_instance_bytes" U32 "Bytes of the data region that the rows of `block_instances` cover, each byte once.";
        StringBytes 204 "total_str_var_bytes" U32 "Bytes of all STRING variables.";
        WideStringBytes 208 "total_wstr_var_bytes" U32 "Bytes of all WSTRINGs in the variables of the `data` table.";
        TempStrings 212 "num_temp_str_bufs" U16 "0: the instruction set has no temporary string buffers.";
        TempWideStrings 214 "num_temp_wstr_bufs" U16 "0, likewise.";
        MaxString 216 "max_str_length" U16 "Largest declared STRING length.";
        MaxWideString 218 "max_wstr_length" U16 "Largest capacity of a WSTRING in the `types` table.";
        NumFunctions 220 "num_functions" U16 "Functions of the code section.";
        NumBlockTypes 222 "num_fb_types" U16 "Function block types of the `types` table.";
        NumArrays 224 "num_arrays" U16 "Rows of the `arrays` table.";
        InputBytes 226 "input_image_bytes" U16 "Bytes of %I.";
        OutputBytes 228 "output_image_bytes" U16 "Bytes of %Q.";
        MemoryBytes 230 "memory_image_bytes" U16 "Bytes of %M.";
        StartupFunction 232 "startup_function_id" U16 "Function run once at start; `0xFFFF`: none.";
        InitFunction 234 "init_function_id" U16 "Function run once at load, before the startup function; `0xFFFF`: none.";
        DataRegionBytes 236 "data_region_bytes" U32 "Bytes of the data region, the unallocated first 16 included.";
        FrameBytes 240 "frame_bytes" U32 "Bytes of one task's frame memory.";
        Reserved 244 "reserved" Zero(12) "Zero.";
    }
}

record! {
    /// Fields of a task entry.
    TaskField(TASK_ENTRY_BYTES) {
        TaskId 0 "task_id" U16 "Unique identifier.";
        Priority 2 "priority" U16 "0 is the highest.";
        TaskType 4 "task_type" U8 "0 cyclic, 1 event, 2 freewheeling.";
        Flags 5 "flags" U8 "Bit 0: enabled at start; the others zero.";
        Interval 6 "interval_us" U64 "Interval in microseconds; 0 unless cyclic.";
        SingleVariable 14 "single_var_index" U16 "Slot of an event task's SINGLE variable; `0xFFFF`: none, or it stands in `task_extensions` only.";
        Watchdog 16 "watchdog_us" U64 "Watchdog time in microseconds; 0: none.";
        InputImage 24 "input_image_offset" Zero(2) "Zero.";
        OutputImage 26 "output_image_offset" Zero(2) "Zero.";
        Reserved 28 "reserved" Zero(4) "Zero.";
    }
}

record! {
    /// Fields of a program instance entry.
    InstanceField(INSTANCE_ENTRY_BYTES) {
        InstanceId 0 "instance_id" U16 "Unique identifier.";
        TaskId 2 "task_id" U16 "Its task.";
        EntryFunction 4 "entry_function_id" U16 "Its entry function.";
        SlotOffset 6 "var_table_offset" U16 "First slot of its partition.";
        SlotCount 8 "var_table_count" U16 "Slots of its partition.";
        BlockOffset 10 "fb_instance_offset" U16 "First row of its function block instances: its data block when it has one.";
        BlockCount 12 "fb_instance_count" U16 "Rows of function block instances, the data block included.";
        Reserved 14 "reserved" Zero(2) "Zero.";
    }
}

macro_rules! sections {
    ($($variant:ident $name:literal $offset:ident $size:ident $required:literal;)*) => {
        /// Sections in file order.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Section { $(#[doc = $name] $variant),* }

        impl Section {
            /// Every section, in file order.
            pub const ALL: [Section; 7] = [$(Section::$variant),*];

            /// Its name in messages.
            #[must_use]
            pub fn name(self) -> &'static str { match self { $(Section::$variant => $name),* } }

            /// The header field that has its offset.
            #[must_use]
            pub fn offset_field(self) -> HeaderField { match self { $(Section::$variant => HeaderField::$offset),* } }

            /// The header field that has its size.
            #[must_use]
            pub fn size_field(self) -> HeaderField { match self { $(Section::$variant => HeaderField::$size),* } }

            /// Whether every container has it.
            #[must_use]
            pub fn is_required(self) -> bool { match self { $(Section::$variant => $required),* } }
        }
    };
}

sections! {
    ContentSignature "content signature section" ContentSignatureOffset ContentSignatureSize false;
    DebugSignature "debug signature section" DebugSignatureOffset DebugSignatureSize false;
    Type "type section" TypeOffset TypeSize true;
    Task "task table section" TaskOffset TaskSize true;
    Constant "constant pool section" ConstantOffset ConstantSize true;
    Code "code section" CodeOffset CodeSize true;
    Debug "debug section" DebugOffset DebugSize false;
}

/// The bytes of one fixed record; fields by name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Record<F> {
    bytes: Vec<u8>,
    fields: std::marker::PhantomData<F>,
}

impl<F: RecordField> Record<F> {
    /// A record of zeros.
    pub fn zero() -> Self {
        Record { bytes: vec![0; F::RECORD_BYTES], fields: std::marker::PhantomData }
    }

    /// A record from the start of these bytes; what they lack is zero.
    pub fn of(bytes: &[u8]) -> Self {
        let mut record = Self::zero();
        for (to, from) in record.bytes.iter_mut().zip(bytes) {
            *to = *from;
        }
        record
    }

    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The bytes of one field.
    pub fn slice(&self, field: F) -> &[u8] {
        self.bytes.get(field.offset()..field.offset() + field.ty().bytes()).unwrap_or_default()
    }

    /// A number field, extended to 64 bits.
    pub fn get(&self, field: F) -> u64 {
        self.slice(field).iter().rev().take(8).fold(0, |value, byte| value << 8 | u64::from(*byte))
    }

    /// A number field of two bytes.
    pub fn get_u16(&self, field: F) -> u16 {
        self.slice(field).first_chunk().copied().map_or(0, u16::from_le_bytes)
    }

    /// A number field of four bytes.
    pub fn get_u32(&self, field: F) -> u32 {
        self.slice(field).first_chunk().copied().map_or(0, u32::from_le_bytes)
    }

    pub fn get_hash(&self, field: F) -> super::Hash {
        self.slice(field).first_chunk().copied().unwrap_or_default()
    }

    /// Sets a number field, whose width the value's type has.
    pub fn set(&mut self, field: F, value: impl Into<u64>) {
        self.set_bytes(field, &value.into().to_le_bytes());
    }

    pub fn set_bytes(&mut self, field: F, value: &[u8]) {
        let range = field.offset()..field.offset() + field.ty().bytes();
        for (to, from) in self.bytes.get_mut(range).unwrap_or_default().iter_mut().zip(value) {
            *to = *from;
        }
    }

    /// The first field that must be zero and is not.
    pub fn nonzero_reserved(&self) -> Option<F> {
        let mut reserved = F::ALL.iter().filter(|field| matches!(field.ty(), FieldType::Zero(_)));
        reserved.find(|field| self.slice(**field).iter().any(|byte| *byte != 0)).copied()
    }
}
