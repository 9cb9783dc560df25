//! Random containers from a seed: any values, sound or not.

use super::*;

/// A small generator (SplitMix64): the same seed gives the same container on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    fn coin(&mut self) -> bool {
        self.below(2) == 0
    }

    /// Edge values are as likely as others.
    fn u32(&mut self) -> u32 {
        match self.below(4) {
            0 => 0,
            1 => u32::MAX,
            2 => self.below(100) as u32,
            _ => self.next() as u32,
        }
    }

    fn u16(&mut self) -> u16 {
        self.u32() as u16
    }

    /// Never the number that says that there is none.
    fn some_id(&mut self) -> Option<u16> {
        self.coin().then(|| self.u16() & 0x7FFF)
    }

    fn list<T>(&mut self, make: impl Fn(&mut Random) -> T) -> Vec<T> {
        (0..self.below(4)).map(|_| make(self)).collect()
    }

    fn pick<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len() as u64) as usize]
    }

    fn ty(&mut self) -> TypeId {
        TypeId(self.u16())
    }

    fn hash(&mut self) -> Hash {
        std::array::from_fn(|_| self.next() as u8)
    }

    fn text(&mut self) -> String {
        let letters = ['a', 'Z', ' ', '"', '\\', ';', '\n', '\0', 'ß', '🦀', '\u{202e}', '\'', '\u{301}', '\t'];
        (0..self.below(8)).map(|_| self.pick(&letters)).collect()
    }

    fn local(&mut self) -> LocalType {
        match self.coin() {
            true => LocalType::Scalar(self.pick(Storage::ALL)),
            false => LocalType::Ref(RefType { target: self.ty(), write: self.coin(), image: self.coin() }),
        }
    }

    fn bounds(&mut self) -> (i32, i32) {
        (self.u32().cast_signed(), self.u32().cast_signed())
    }

    fn record(&mut self) -> Record {
        let fields = self.list(|r| Field { offset: r.u32(), ty: r.ty() });
        Record { size: self.u32(), align: self.u32(), fields }
    }
}

fn memory_type(r: &mut Random) -> Type {
    match r.below(7) {
        0 => Type::Scalar(r.pick(Storage::ALL)),
        1 => Type::String { capacity: r.u16() },
        2 => Type::WideString { capacity: r.u16() },
        3 => Type::Array(ArrayId(r.u16())),
        4 => Type::Struct(r.record()),
        5 => Type::Union(r.record()),
        _ => Type::Block {
            record: r.record(),
            base: r.some_id().map(TypeId),
            methods: r.list(|r| (MethodId(r.u16()), FunctionId(r.u16()))),
        },
    }
}

fn type_section(r: &mut Random) -> TypeSection {
    let region = |r: &mut Random| r.pick(&[Region::Slots, Region::Data, Region::Memory, Region::Output]);
    TypeSection {
        types: r.list(memory_type),
        arrays: r.list(|r| ArrayDescriptor { element: r.ty(), stride: r.u32(), dimensions: r.list(Random::bounds) }),
        slots: r.list(|r| r.pick(Storage::ALL)),
        data: r.list(|r| DataVariable { offset: r.u32(), ty: r.ty(), constant: r.coin() }),
        programs: r.list(|r| ProgramType { slots: r.list(|r| r.pick(Storage::ALL)), block: r.some_id().map(TypeId) }),
        block_instances: r
            .list(|r| BlockInstance {
                offset: r.u32(),
                stride: r.below(1000) as u32,
                count: r.below(1000) as u32,
                ty: r.ty(),
            })
            .into_iter()
            .map(|row| BlockInstance { offset: row.offset & 0xFFFF, ..row })
            .collect(),
        methods: r.list(|r| MethodSignature {
            parameters: r.list(Random::local),
            results: r.list(|r| r.pick(ValueType::ALL)),
        }),
        init_image: r.list(|r| InitRun {
            region: region(r),
            offset: r.u32(),
            repeat: r.u32(),
            bytes: r.list(|r| r.next() as u8),
        }),
        retain: r.list(|r| RetainRange { region: region(r), offset: r.u32(), bytes: r.u32() }),
        task_extensions: r.list(extension),
        system_variables: r.list(|r| SystemVariable {
            kind: r.pick(&[SystemVariableKind::UpTime, SystemVariableKind::UpLtime]),
            slot: SlotIndex(r.u16()),
        }),
        symbol_hashes: r.list(|r| SymbolHash { kind: r.next() as u8, index: r.u32(), hash: r.hash() }),
    }
}

fn extension(r: &mut Random) -> TaskExtension {
    TaskExtension {
        name: r.text(),
        single: match r.below(5) {
            0 => SingleSource::None,
            1 => SingleSource::Slot(SlotIndex(r.u16())),
            2 => SingleSource::Data(r.u32()),
            3 => SingleSource::Bit { place: r.pick(BytePlace::ALL), offset: r.u32(), bit: r.next() as u8 },
            _ => SingleSource::Literal(r.coin()),
        },
        phase_us: r.next(),
        watchdog_sensitivity: r.u16(),
        overrun_policy: r.pick(&[OverrunPolicy::Grid, OverrunPolicy::AtOnce, OverrunPolicy::Realign]),
    }
}

fn task_table(r: &mut Random) -> TaskTable {
    TaskTable {
        shared_globals: r.u16(),
        tasks: r.list(|r| Task {
            id: TaskId(r.u16()),
            priority: r.u16(),
            task_type: r.pick(&[TaskType::Cyclic, TaskType::Event, TaskType::Freewheeling]),
            enabled: r.coin(),
            interval_us: r.next(),
            single_slot: r.some_id().map(SlotIndex),
            watchdog_us: r.next(),
        }),
        instances: r.list(|r| ProgramInstance {
            id: InstanceId(r.u16()),
            task: TaskId(r.u16()),
            entry: FunctionId(r.u16()),
            slot_offset: r.u16(),
            slot_count: r.u16(),
            block_offset: r.u16(),
            block_count: r.u16(),
        }),
    }
}

fn function(r: &mut Random) -> Function {
    let mut code = Vec::new();
    for _ in 0..r.below(12) {
        // Opcodes with random immediates; some are no instruction.
        let opcode = r.pick(&[0, 1, 2, 6, 8, 0x10, 0x15, 0x16, 0x17, 0x19, 0x1a, 0x1c, 0x1e, 0x100, 0x305, 0x999_u16]);
        let mut bytes = opcode.to_le_bytes().to_vec();
        bytes.extend((0..8).map(|_| r.below(6) as u8));
        let mut reader = crate::instruction::Reader::new(&bytes);
        let keep = match crate::instruction::Instruction::decode(&mut reader) {
            Ok(_) => reader.position(),
            Err(_) if r.below(8) == 0 => bytes.len(),
            Err(_) => 0,
        };
        code.extend_from_slice(&bytes[..keep]);
    }
    Function {
        owner: match r.below(3) {
            0 => Owner::None,
            1 => Owner::Program(ProgramId(r.u16())),
            _ => Owner::Block(r.ty()),
        },
        parameters: r.below(6) as u16,
        locals: r.list(Random::local),
        results: r.list(|r| r.pick(ValueType::ALL)),
        frame: r.some_id().map(TypeId),
        for_loops: r.list(|r| ForLoop {
            control: match r.coin() {
                true => ControlPlace::Slot(r.pick(SlotPlace::ALL), SlotIndex(r.u16())),
                false => ControlPlace::Bytes(r.pick(BytePlace::ALL), r.u32()),
            },
            ty: r.pick(IntegerType::ALL),
            bound: SlotIndex(r.u16()),
            step: SlotIndex(r.u16()),
        }),
        code,
    }
}

fn debug(r: &mut Random) -> DebugSection {
    DebugSection {
        files: r.list(|r| SourceFile { name: r.text(), hash: r.hash() }),
        lines: r.list(|r| LineEntry {
            function: FunctionId(r.below(3) as u16),
            offset: r.below(20) as u32,
            file: r.below(3) as u16,
            line: r.u32(),
            column: r.u32(),
        }),
        function_names: r.list(Random::text),
        types: r.list(|r| match r.below(7) {
            0 => DebugType::Elementary(r.pick(ElementaryType::ALL)),
            1 => DebugType::Enumeration {
                name: r.text(),
                base: r.pick(ElementaryType::ALL),
                values: r.list(|r| (r.text(), r.next().cast_signed())),
            },
            2 => DebugType::String { capacity: r.u16() },
            3 => DebugType::WideString { capacity: r.u16() },
            4 => DebugType::Array { element: r.u16(), stride: r.u32(), dimensions: r.list(Random::bounds) },
            5 => DebugType::Subrange {
                base: r.pick(ElementaryType::ALL),
                lower: r.next().cast_signed(),
                upper: r.next().cast_signed(),
            },
            _ => DebugType::Record { name: r.text(), fields: r.list(|r| (r.text(), r.u32(), r.u16())) },
        }),
        variables: r.list(|r| DebugVariable {
            name: r.text(),
            place: match r.below(3) {
                0 => DebugPlace::Slot(SlotIndex(r.u16())),
                1 => DebugPlace::Bytes(r.pick(BytePlace::ALL), r.u32()),
                _ => DebugPlace::Bit(r.pick(BytePlace::ALL), r.u32(), r.next() as u8),
            },
            ty: r.u16(),
            constant: r.coin(),
        }),
        instance_names: r.list(Random::text),
        resource_name: r.text(),
        configuration_name: r.text(),
    }
}

/// A container of any values.
pub fn container(seed: u64) -> Container {
    let r = &mut Random(seed);
    Container {
        parameters: Parameters {
            max_stack_depth: r.u16(),
            max_call_depth: r.u16(),
            input_image_bytes: r.u16(),
            output_image_bytes: r.u16(),
            memory_image_bytes: r.u16(),
            data_region_bytes: r.u32(),
            frame_bytes: r.u32(),
            startup_function: r.some_id().map(FunctionId),
            init_function: r.some_id().map(FunctionId),
            total_str_var_bytes: r.u32(),
            max_str_length: r.u16(),
        },
        source_hash: r.hash(),
        content_signature: Vec::new(),
        debug_signature: Vec::new(),
        types: type_section(r),
        tasks: task_table(r),
        constants: r.list(|r| match r.below(3) {
            0 => Constant::I64(r.next().cast_signed()),
            1 => Constant::F32(r.u32()),
            _ => Constant::F64(r.next()),
        }),
        functions: r.list(function),
        debug: r.coin().then(|| debug(r)),
    }
}
