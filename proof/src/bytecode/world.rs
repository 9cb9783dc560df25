//! What a program works on: types, variables, program types, tasks, heads of functions.

use khz_bytecode::container::{
    ArrayDescriptor, BlockInstance, Container, DataVariable, Field, Function, InitRun, MethodSignature, Owner,
    ProgramInstance, ProgramType, Record, Region, Task, TaskExtension, TaskType, Type,
};
use khz_bytecode::ids::{ArrayId, FunctionId, InstanceId, MethodId, ProgramId, TaskId, TypeId};
use khz_bytecode::value::{LocalType, RefType, Storage, ValueType};
use khz_bytecode::verify::{Extent, block_rows};

use super::Size;
use super::idiom::swept;
use crate::random::Random;

/// What the program at hand shall have.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Profile {
    /// References made from integers, and copies out of the process image.
    pub raw: bool,
    /// Virtual calls.
    pub virtual_calls: bool,
    /// A union.
    pub unions: bool,
    /// How large it is.
    pub size: Size,
    /// How many instructions a function may have, about.
    pub instructions: usize,
    /// How often, in percent, care is taken that an index, divisor or address is right.
    pub care: usize,
}

/// A step from a type into it.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Way {
    Field(u16),
    Index(ArrayId),
}

/// Types with fewer bytes than this get variables of their own.
const LARGEST_VARIABLE_BYTES: u32 = 1500;
/// Places inside a type that are listed.
const LISTED_PLACES: usize = 48;

/// A container in the making.
#[derive(Debug)]
pub(crate) struct World {
    pub random: Random,
    pub container: Container,
    pub profile: Profile,
    pub extents: Vec<Extent>,
    /// For each type the places inside it, itself first: offset and type.
    pub inside: Vec<Vec<(u32, TypeId)>>,
    /// For each type how other types lead to it.
    pub ways: Vec<Vec<(TypeId, Way)>>,
    /// Whether a function block instance lies in each type.
    pub has_block: Vec<bool>,
    /// Places in the data region: offset, type, whether it may be written.
    pub data: Vec<(u32, TypeId, bool)>,
}

impl World {
    /// Everything but the code of the functions.
    pub fn new(seed: u64, size: Option<Size>) -> World {
        let mut random = Random::new(seed);
        let drawn = Size::drawn(&mut random);
        let size = size.unwrap_or(drawn);
        let instructions = size.instructions(&mut random);
        let profile = Profile {
            raw: random.chance(35),
            virtual_calls: random.chance(50),
            unions: random.chance(15),
            size,
            instructions,
            care: random.one_of([70, 92, 92, 99]),
        };
        let container = Container::default();
        let (extents, inside, ways) = (Vec::new(), Vec::new(), Vec::new());
        let mut world =
            World { random, container, profile, extents, inside, ways, has_block: Vec::new(), data: Vec::new() };
        world.make_types();
        world.make_images();
        world.make_programs();
        world.make_functions();
        world.make_data();
        world.make_initial_values();
        world
    }

    /// The types of scalars stand first, in the order of their storages.
    pub fn scalar(storage: Storage) -> TypeId {
        TypeId(storage as u16)
    }

    fn add(&mut self, ty: Type) -> TypeId {
        let id = TypeId(self.container.types.types.len() as u16);
        let mut inside = vec![(0, id)];
        let (extent, parts) = self.examine(&ty);
        for (offset, part, way) in parts {
            self.ways[part.index()].push((id, way));
            let deeper = self.inside[part.index()].iter().map(|(inner, ty)| (offset + inner, *ty));
            inside.extend(deeper.collect::<Vec<_>>());
        }
        inside.truncate(LISTED_PLACES);
        let has_block =
            matches!(ty, Type::Block { .. }) || inside.iter().skip(1).any(|(_, part)| self.has_block[part.index()]);
        self.has_block.push(has_block || self.parts_with_block(&ty));
        self.container.types.types.push(ty);
        self.extents.push(extent);
        self.inside.push(inside);
        self.ways.push(Vec::new());
        id
    }

    /// The list of places may be cut; fields and elements are not.
    fn parts_with_block(&self, ty: &Type) -> bool {
        match ty {
            Type::Array(array) => self.has_block[self.container.types.arrays[array.index()].element.index()],
            Type::Struct(record) | Type::Union(record) | Type::Block { record, .. } => {
                record.fields.iter().any(|field| self.has_block[field.ty.index()])
            }
            _ => false,
        }
    }

    /// Extent of a type, and some of its parts: each field; first, last and a middle element.
    fn examine(&self, ty: &Type) -> (Extent, Vec<(u32, TypeId, Way)>) {
        match ty {
            Type::Scalar(storage) => (Extent { size: storage.bytes(), align: storage.bytes() }, Vec::new()),
            Type::String { capacity } => (Extent { size: u32::from(*capacity) + 1, align: 1 }, Vec::new()),
            Type::WideString { capacity } => (Extent { size: 2 * (u32::from(*capacity) + 1), align: 2 }, Vec::new()),
            Type::Array(id) => {
                let array = &self.container.types.arrays[id.index()];
                let count: u32 = array
                    .dimensions
                    .iter()
                    .map(|(lower, upper)| (i64::from(*upper) - i64::from(*lower) + 1) as u32)
                    .product();
                let extent = Extent { size: count * array.stride, align: self.extents[array.element.index()].align };
                let mut elements = vec![0, count / 2, count - 1];
                elements.dedup();
                (extent, elements.into_iter().map(|at| (at * array.stride, array.element, Way::Index(*id))).collect())
            }
            Type::Struct(record) | Type::Union(record) | Type::Block { record, .. } => {
                let fields = record.fields.iter().enumerate();
                let parts = fields.map(|(number, field)| (field.offset, field.ty, Way::Field(number as u16)));
                (Extent { size: record.size, align: record.align }, parts.collect())
            }
        }
    }

    /// Lays fields out naturally behind those of `first`.
    fn record(&self, first: &[Field], types: &[TypeId], overlap: bool) -> Record {
        let mut fields = first.to_vec();
        let end_of = |field: &Field| field.offset + self.extents[field.ty.index()].size;
        let mut end = fields.last().map_or(0, end_of);
        for ty in types {
            let extent = self.extents[ty.index()];
            let offset = if overlap { 0 } else { end.next_multiple_of(extent.align) };
            fields.push(Field { offset, ty: *ty });
            end = end.max(offset + extent.size);
        }
        let align = fields.iter().map(|field| self.extents[field.ty.index()].align).max().unwrap_or(1);
        Record { size: end.next_multiple_of(align), align, fields }
    }

    /// Some type that is not too large; a scalar half of the time.
    fn any_type(&mut self, blocks: bool) -> TypeId {
        for _ in 0..8 {
            if self.random.chance(50) {
                break;
            }
            let ty = self.random.below(self.extents.len());
            if self.extents[ty].size < 300 && (blocks || !self.has_block[ty]) {
                return TypeId(ty as u16);
            }
        }
        TypeId(self.random.below(Storage::ALL.len()) as u16)
    }

    fn some_types(&mut self, most: usize, blocks: bool) -> Vec<TypeId> {
        (0..=self.random.below(most)).map(|_| self.any_type(blocks)).collect()
    }

    fn add_array(&mut self, element: TypeId) {
        let stride = self.extents[element.index()].size;
        let mut dimensions = Vec::new();
        let mut count = 1;
        for _ in 0..self.random.one_of([1, 1, 1, 2, 2, 3]) {
            let length = self.random.between(1, if count > 8 { 2 } else { 5 });
            let lower = match self.random.below(12) {
                0 => i64::from(i32::MIN),
                1 => i64::from(i32::MAX) - length + 1,
                2..=5 => 0,
                6..=8 => 1,
                _ => self.random.between(-4, 9),
            };
            dimensions.push((lower as i32, (lower + length - 1) as i32));
            count *= length;
        }
        if count * i64::from(stride) > i64::from(LARGEST_VARIABLE_BYTES) {
            dimensions = vec![(0, 1)];
        }
        self.add_descriptor(element, dimensions);
    }

    /// The array that stands for the characters of a string, so that code may go into it.
    fn add_characters(&mut self, string: usize) {
        let (unit, capacity) = match self.container.types.types[string] {
            Type::String { capacity } => (Storage::U8, capacity),
            Type::WideString { capacity } => (Storage::U16, capacity),
            _ => return,
        };
        if capacity > 0 && self.random.chance(60) {
            self.add_descriptor(World::scalar(unit), vec![(1, i32::from(capacity))]);
            let array = ArrayId(self.container.types.arrays.len() as u16 - 1);
            self.ways[World::scalar(unit).index()].push((TypeId(string as u16), Way::Index(array)));
        }
    }

    fn add_descriptor(&mut self, element: TypeId, dimensions: Vec<(i32, i32)>) {
        let stride = self.extents[element.index()].size;
        self.container.types.arrays.push(ArrayDescriptor { element, stride, dimensions });
        let id = ArrayId(self.container.types.arrays.len() as u16 - 1);
        self.add(Type::Array(id));
    }

    fn add_block(&mut self, base: Option<TypeId>) {
        let first = match base.map(|base| &self.container.types.types[base.index()]) {
            Some(Type::Block { record, .. }) => record.fields.clone(),
            _ => Vec::new(),
        };
        let mut types = self.some_types(4, true);
        if first.is_empty() {
            // A block at offset 0 of a block would share its address.
            types.insert(0, World::scalar(self.random.one_of([Storage::I32, Storage::I8, Storage::F32, Storage::I64])));
        }
        let mut record = self.record(&first, &types, false);
        if let Some(base) = base {
            let extent = self.extents[base.index()];
            record.align = record.align.max(extent.align);
            record.size = record.size.max(extent.size).next_multiple_of(record.align);
        }
        self.add(Type::Block { record, base, methods: Vec::new() });
    }

    fn make_types(&mut self) {
        for storage in Storage::ALL {
            self.add(Type::Scalar(*storage));
        }
        for _ in 0..3 {
            let capacity = self.random.one_of([0, 1, 2, 3, 7, 10, 16, 33, 80]);
            self.add(Type::String { capacity });
        }
        for _ in 0..2 {
            let capacity = self.random.one_of([0, 1, 2, 5, 7, 16, 33]);
            self.add(Type::WideString { capacity });
        }
        for at in Storage::ALL.len()..self.extents.len() {
            self.add_characters(at);
        }
        for _ in 0..self.random.between(1, 2) {
            let (element, bounds) = swept(&mut self.random);
            self.add_descriptor(element, vec![bounds]);
        }
        for _ in 0..self.random.between(1, 3) {
            let element = self.any_type(false);
            self.add_array(element);
        }
        for _ in 0..self.random.between(1, 3) {
            let types = self.some_types(5, false);
            let record = self.record(&[], &types, false);
            self.add(Type::Struct(record));
        }
        if self.profile.unions {
            let types = self.some_types(3, false);
            let record = self.record(&[], &types, true);
            self.add(Type::Union(record));
        }
        for number in 0..self.random.between(1, 3) {
            let last = TypeId(self.extents.len() as u16 - 1);
            let base = Some(last).filter(|_| number > 0 && self.random.chance(60));
            self.add_block(base);
        }
        for _ in 0..self.random.between(1, 3) {
            let element =
                if self.random.chance(40) { TypeId(self.extents.len() as u16 - 1) } else { self.any_type(true) };
            self.add_array(element);
        }
        for _ in 0..self.random.between(1, 3) {
            let types = self.some_types(4, true);
            let record = self.record(&[], &types, false);
            self.add(Type::Struct(record));
        }
        for _ in 0..self.random.between(1, 3) {
            let signature = MethodSignature { parameters: self.parameters(2), results: self.results() };
            self.container.types.methods.push(signature);
        }
    }

    fn storage(&mut self) -> Storage {
        Storage::ALL[self.random.below(Storage::ALL.len())]
    }

    fn parameters(&mut self, most: usize) -> Vec<LocalType> {
        (0..self.random.below(most + 1))
            .map(|_| {
                if self.random.chance(70) {
                    return LocalType::Scalar(self.storage());
                }
                let target = TypeId(self.random.below(self.extents.len()) as u16);
                LocalType::Ref(RefType { target, write: self.random.chance(60), image: self.random.chance(40) })
            })
            .collect()
    }

    fn results(&mut self) -> Vec<ValueType> {
        (0..self.random.one_of([0, 1, 1, 2])).map(|_| ValueType::ALL[self.random.below(4)]).collect()
    }

    fn make_images(&mut self) {
        let parameters = &mut self.container.parameters;
        parameters.input_image_bytes = self.random.one_of([0, 3, 16, 24]);
        parameters.output_image_bytes = self.random.one_of([1, 9, 16, 32]);
        parameters.memory_image_bytes = self.random.one_of([0, 8, 17, 40]);
        for _ in 0..2 {
            for storage in Storage::ALL {
                if self.random.chance(70) {
                    self.container.types.slots.push(*storage);
                }
            }
        }
        self.container.tasks.shared_globals = self.container.types.slots.len() as u16;
    }

    /// A structure among the types.
    fn any_struct(&mut self) -> Option<TypeId> {
        let types = self.container.types.types.iter().enumerate();
        let records: Vec<usize> = types.filter(|(_, ty)| matches!(ty, Type::Struct(_))).map(|(at, _)| at).collect();
        self.random.pick(&records).map(|at| TypeId(*at as u16))
    }

    fn make_programs(&mut self) {
        for _ in 0..self.random.between(1, 2) {
            let slots = (0..self.random.below(7)).map(|_| self.storage()).collect();
            let block = if self.random.chance(60) { self.any_struct() } else { None };
            self.container.types.programs.push(ProgramType { slots, block });
        }
        for id in 0..self.random.one_of([1, 1, 2, 3]) {
            let cyclic = self.random.chance(70);
            let task_type = if cyclic { TaskType::Cyclic } else { TaskType::Freewheeling };
            let interval_us = if cyclic { 1000 } else { 0 };
            self.container.tasks.tasks.push(Task {
                id: TaskId(id + 5),
                task_type,
                enabled: true,
                interval_us,
                ..Task::default()
            });
            self.container.types.task_extensions.push(TaskExtension::default());
        }
    }

    fn head(&mut self, owner: Owner, parameters: Vec<LocalType>, results: Vec<ValueType>) -> FunctionId {
        let frame = if self.random.chance(35) { self.any_struct() } else { None };
        let function = Function {
            owner,
            parameters: parameters.len() as u16,
            locals: parameters,
            results,
            frame,
            ..Function::default()
        };
        self.container.functions.push(function);
        FunctionId(self.container.functions.len() as u16 - 1)
    }

    /// Heads in an order in which each function calls only later ones.
    fn make_functions(&mut self) {
        if self.random.chance(30) {
            self.container.parameters.init_function = Some(self.head(Owner::None, Vec::new(), Vec::new()));
        }
        if self.random.chance(30) {
            self.container.parameters.startup_function = Some(self.head(Owner::None, Vec::new(), Vec::new()));
        }
        let programs = self.container.types.programs.len();
        let entries: Vec<FunctionId> = (0..programs)
            .map(|program| self.head(Owner::Program(ProgramId(program as u16)), Vec::new(), Vec::new()))
            .collect();
        for program in 0..programs {
            if self.random.chance(40) {
                let (parameters, results) = (self.parameters(3), self.results());
                self.head(Owner::Program(ProgramId(program as u16)), parameters, results);
            }
        }
        for _ in 0..self.random.below(3) {
            let (parameters, results) = (self.parameters(4), self.results());
            self.head(Owner::None, parameters, results);
        }
        for ty in 0..self.container.types.types.len() {
            self.make_methods(TypeId(ty as u16));
        }
        for number in 0..self.random.one_of([1, 1, 2, 3, 1, 2, 6]) {
            let program = self.random.below(programs);
            let task = self.random.below(self.container.tasks.tasks.len());
            let slots = self.container.types.programs[program].slots.clone();
            let instance = ProgramInstance {
                id: InstanceId(number + 3),
                task: self.container.tasks.tasks[task].id,
                entry: entries[program],
                slot_offset: self.container.types.slots.len() as u16,
                slot_count: slots.len() as u16,
                ..ProgramInstance::default()
            };
            self.container.types.slots.extend(slots);
            self.container.tasks.instances.push(instance);
        }
    }

    fn make_methods(&mut self, ty: TypeId) {
        if !matches!(self.container.types.types[ty.index()], Type::Block { .. }) {
            return;
        }
        let often = if self.profile.size == Size::Small { 30 } else { 60 };
        if self.random.chance(often) {
            let (parameters, results) = (self.parameters(2), self.results());
            self.head(Owner::Block(ty), parameters, results);
        }
        let mut own = Vec::new();
        for method in 0..self.container.types.methods.len() {
            if self.random.chance(often) {
                let signature = self.container.types.methods[method].clone();
                let function = self.head(Owner::Block(ty), signature.parameters, signature.results);
                own.push((MethodId(method as u16), function));
            }
        }
        if let Type::Block { methods, .. } = &mut self.container.types.types[ty.index()] {
            *methods = own;
        }
    }

    fn add_variable(&mut self, ty: TypeId, constant: bool) -> u32 {
        let extent = self.extents[ty.index()];
        let end = self.container.types.data.last().map_or(16, |last| last.offset + self.extents[last.ty.index()].size);
        let offset = end.next_multiple_of(extent.align.max(1));
        self.container.types.data.push(DataVariable { offset, ty, constant });
        let places = self.inside[ty.index()].clone();
        self.data.extend(places.into_iter().map(|(inner, ty)| (offset + inner, ty, !constant)));
        offset
    }

    fn make_data(&mut self) {
        for ty in 0..self.extents.len() {
            let id = TypeId(ty as u16);
            self.add_variable(id, false);
            if self.random.chance(20) && self.extents[ty].size < LARGEST_VARIABLE_BYTES {
                let constant = !self.has_block[ty] && self.random.chance(50);
                self.add_variable(id, constant);
            }
        }
        let globals: Vec<DataVariable> = self.container.types.data.clone();
        for number in 0..self.container.tasks.instances.len() {
            let entry = self.container.tasks.instances[number].entry;
            let Owner::Program(program) = self.container.functions[entry.index()].owner else { continue };
            let Some(block) = self.container.types.programs[program.index()].block else { continue };
            let places = self.data.len();
            let offset = self.add_variable(block, false);
            if self.random.chance(50) {
                // Then only the program itself reaches it, by `b`.
                self.data.truncate(places);
            }
            let first = self.container.types.block_instances.len();
            let row = BlockInstance { offset, stride: self.extents[block.index()].size, count: 1, ty: block };
            self.container.types.block_instances.push(row);
            self.add_rows(block, offset);
            let count = self.container.types.block_instances.len() - first;
            let instance = &mut self.container.tasks.instances[number];
            (instance.block_offset, instance.block_count) = (first as u16, count as u16);
        }
        globals.iter().for_each(|variable| self.add_rows(variable.ty, variable.offset));
        let end = self.container.types.data.last().map_or(16, |last| last.offset + self.extents[last.ty.index()].size);
        self.container.parameters.data_region_bytes = end.next_multiple_of(8);
    }

    fn add_rows(&mut self, ty: TypeId, offset: u32) {
        let rows = block_rows(&self.container.types, ty, offset).expect("the types are sound");
        self.container.types.block_instances.extend(rows);
    }

    fn make_initial_values(&mut self) {
        let mut runs = Vec::new();
        for (index, storage) in self.container.types.slots.iter().enumerate() {
            if self.random.chance(50) {
                let mut bytes = self.random.stored(*storage);
                bytes.resize(8, 0);
                runs.push(InitRun { region: Region::Slots, offset: index as u32 * 8, repeat: 1, bytes });
            }
        }
        for variable in &self.container.types.data {
            let bytes = match &self.container.types.types[variable.ty.index()] {
                Type::Scalar(storage) => self.random.stored(*storage),
                Type::String { capacity } => text(&mut self.random, usize::from(*capacity)),
                Type::WideString { capacity } => {
                    // Bytes beyond Latin-1 now and then: they have no narrow form.
                    let narrow = text(&mut self.random, usize::from(*capacity));
                    let high = if self.random.chance(30) { 0x20 } else { 0 };
                    narrow.iter().flat_map(|byte| [*byte, if *byte == b'b' { high } else { 0 }]).collect()
                }
                _ => continue,
            };
            runs.push(InitRun { region: Region::Data, offset: variable.offset, repeat: 1, bytes });
        }
        for (region, size) in [
            (Region::Memory, self.container.parameters.memory_image_bytes),
            (Region::Output, self.container.parameters.output_image_bytes),
        ] {
            if size > 0 && self.random.chance(60) {
                let bytes = (0..size).map(|_| self.random.bits() as u8).collect();
                runs.push(InitRun { region, offset: 0, repeat: 1, bytes });
            }
        }
        self.container.types.init_image = runs;
    }
}

/// A text of at most `capacity` bytes with its terminator: words that conversions know, or letters of few kinds, so that FIND finds.
fn text(random: &mut Random, capacity: usize) -> Vec<u8> {
    let words = [
        "12",
        "-7",
        "16#FF",
        "1.5E3",
        "TRUE",
        "T#1m30s",
        "t#2d_3.5h",
        "1e-400",
        "NaN",
        "-Infinity",
        "9999999999999999999",
        "2#1_0",
        "abcab",
        "",
    ];
    let mut bytes = if random.chance(60) {
        random.one_of(words).as_bytes().to_vec()
    } else {
        (0..random.below(capacity + 1)).map(|_| b'a' + random.below(3) as u8).collect()
    };
    bytes.truncate(capacity);
    bytes.push(0);
    bytes
}
