//! Lines outside functions: types, variables, tasks, constants, budgets.

use super::tokens::{Line, Words, number};
use super::{Assembler, AssemblyError, Kind, PendingInstance};
use crate::container::{
    ArrayDescriptor, BlockInstance, Constant, DataVariable, Field, Hash, InitRun, MethodSignature, OverrunPolicy,
    ProgramInstance, ProgramType, Record, Region, RetainRange, SingleSource, SymbolHash, SystemVariable,
    SystemVariableKind, Task, TaskExtension, TaskType, Type,
};
use crate::ids::{ArrayId, FunctionId, InstanceId, MethodId, SlotIndex, TaskId, TypeId};
use crate::limits::SLOT_BYTES;
use crate::value::{BytePlace, Storage};

impl Assembler {
    /// One line outside functions and debug blocks.
    pub(super) fn declaration(&mut self, line: &Line) -> Result<(), AssemblyError> {
        let mut words = line.words();
        let keyword = words.word("keyword")?;
        match keyword {
            "type" => self.type_line(&mut words)?,
            "array" => self.array_line(&mut words)?,
            "global" => self.global_line(&mut words)?,
            "slots" => {
                while words.peek().is_some() {
                    let storage = Self::storage(&mut words)?;
                    self.container.types.slots.push(storage);
                }
            }
            "data" => self.data_line(&mut words)?,
            "program" => self.program_line(&mut words)?,
            "slot" => self.program_slot(&mut words)?,
            "block_instance" => self.block_instance(&mut words)?,
            "method" => self.method_line(&mut words)?,
            "init" => self.init_line(&mut words)?,
            "retain" => {
                let (region, offset) = self.region_place(&mut words)?;
                let bytes = words.number("number of bytes")?;
                self.container.types.retain.push(RetainRange { region, offset, bytes });
            }
            "extension" => {
                let mut extension = TaskExtension::default();
                while words.peek().is_some() {
                    if !self.extension_word(&mut extension, &mut words)? {
                        words.next("keyword")?;
                        return Err(words.error("unknown word; known are name, single, phase, sensitivity, policy"));
                    }
                }
                self.container.types.task_extensions.push(extension);
            }
            "system" => self.system_line(&mut words)?,
            "symbol" => {
                let kind = words.number("kind")?;
                let index = words.number("index")?;
                let hash = Self::hash(&mut words)?;
                self.container.types.symbol_hashes.push(SymbolHash { kind, index, hash });
            }
            "task" => self.task_line(&mut words)?,
            "instance" => self.instance_line(&mut words)?,
            "constant" => {
                words.next("name")?;
                let ty = words.word("value type")?;
                let constant = Self::constant(ty, &mut words)?;
                self.container.constants.push(constant);
            }
            other => self.parameter_line(other, &mut words)?,
        }
        words.end()
    }

    fn parameter_line(&mut self, keyword: &str, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let container = &mut self.container;
        let parameters = &mut container.parameters;
        match keyword {
            "max_stack" => parameters.max_stack_depth = self.given.mark("max_stack", words.number(keyword)?),
            "max_call_depth" => parameters.max_call_depth = self.given.mark("max_call_depth", words.number(keyword)?),
            "inputs" => parameters.input_image_bytes = words.number("bytes of %I")?,
            "outputs" => parameters.output_image_bytes = words.number("bytes of %Q")?,
            "memory" => parameters.memory_image_bytes = words.number("bytes of %M")?,
            "data_bytes" => parameters.data_region_bytes = self.given.mark("data_bytes", words.number(keyword)?),
            "frame_bytes" => parameters.frame_bytes = self.given.mark("frame_bytes", words.number(keyword)?),
            "string_bytes" => parameters.total_str_var_bytes = self.given.mark("string_bytes", words.number(keyword)?),
            "max_string" => parameters.max_str_length = self.given.mark("max_string", words.number(keyword)?),
            "shared_globals" => container.tasks.shared_globals = words.number(keyword)?,
            "source_hash" => container.source_hash = Self::hash(words)?,
            "content_signature" => container.content_signature = words.bytes("signature section")?,
            "debug_signature" => container.debug_signature = words.bytes("signature section")?,
            "startup" => {
                let id = FunctionId(self.id(Kind::Function, words)?);
                self.container.parameters.startup_function = Some(id);
            }
            "initialize" => {
                let id = FunctionId(self.id(Kind::Function, words)?);
                self.container.parameters.init_function = Some(id);
            }
            other => return Err(words.error(format!("unknown line `{other}`"))),
        }
        Ok(())
    }

    pub(super) fn hash(words: &mut Words<'_>) -> Result<Hash, AssemblyError> {
        let bytes = words.bytes("hash")?;
        bytes.try_into().map_err(|_| words.error("a hash has 64 hexadecimal digits"))
    }

    /// The value of a constant whose type was just read. Floats are decimals, or their bits with 0x.
    pub(super) fn constant(ty: &str, words: &mut Words<'_>) -> Result<Constant, AssemblyError> {
        let word = words.word("value")?;
        let value = match ty {
            "i64" => number(word).map(Constant::I64).or_else(|| {
                // Bit strings are written without a sign.
                number::<u64>(word).map(|bits| Constant::I64(bits.cast_signed()))
            }),
            "f32" => float_bits(word, 0xFFC0_0000_u32, |v: f32| (v.is_nan(), v.to_bits())).map(Constant::F32),
            "f64" => float_bits(word, 0xFFF8_0000_0000_0000_u64, |v: f64| (v.is_nan(), v.to_bits())).map(Constant::F64),
            _ => return Err(words.error("a constant is i64, f32 or f64")),
        };
        value.ok_or_else(|| words.error(format!("`{word}` is no {ty}")))
    }

    /// `type NAME scalar|string|wstring|array|struct|union|block …`
    fn type_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        words.next("name")?;
        let form = words.word("form")?;
        let ty = match form {
            "scalar" => Type::Scalar(Self::storage(words)?),
            "string" => Type::String { capacity: words.number("capacity")? },
            "wstring" => Type::WideString { capacity: words.number("capacity")? },
            "array" => Type::Array(ArrayId(self.id(Kind::Array, words)?)),
            "struct" => Type::Struct(self.record(words, false)?),
            "union" => Type::Union(self.record(words, true)?),
            "block" => self.block_type(words)?,
            _ => return Err(words.error(format!("unknown form `{form}` of a type"))),
        };
        self.push_type(ty);
        Ok(())
    }

    fn push_type(&mut self, ty: Type) {
        let extent = self.extent_of(&ty);
        self.extents.push(extent);
        self.container.types.types.push(ty);
    }

    fn extent_of(&self, ty: &Type) -> Option<(u32, u32)> {
        match ty {
            Type::Scalar(storage) => Some((storage.bytes(), storage.bytes())),
            Type::String { capacity } => Some((u32::from(*capacity) + 1, 1)),
            Type::WideString { capacity } => Some((2 * (u32::from(*capacity) + 1), 2)),
            Type::Array(array) => {
                let array = self.container.types.arrays.get(array.index())?;
                let (_, align) = self.extent(array.element)?;
                let size = array.dimensions.iter().try_fold(array.stride, |size, (lower, upper)| {
                    let count = i64::from(*upper) - i64::from(*lower) + 1;
                    size.checked_mul(u32::try_from(count).ok()?)
                })?;
                Some((size, align))
            }
            Type::Struct(record) | Type::Union(record) | Type::Block { record, .. } => {
                Some((record.size, record.align))
            }
        }
    }

    /// Size and alignment of a type declared above.
    pub(super) fn extent(&self, ty: TypeId) -> Option<(u32, u32)> {
        self.extents.get(ty.index()).copied().flatten()
    }

    fn type_extent(&self, ty: TypeId, words: &Words<'_>) -> Result<(u32, u32), AssemblyError> {
        self.extent(ty).ok_or_else(|| words.error("the layout needs a type that is declared above"))
    }

    /// `[size N] [align N] [OFFSET:]TYPE…`; what is left out is laid out naturally.
    fn record(&self, words: &mut Words<'_>, union: bool) -> Result<Record, AssemblyError> {
        let size = if words.take("size") { Some(words.number("size")?) } else { None };
        let align = if words.take("align") { Some(words.number("align")?) } else { None };
        let mut record = Record { size: 0, align: 1, fields: Vec::new() };
        while words.peek().is_some_and(|word| word != "base" && word != "methods") {
            let word = words.word("field")?;
            let (offset, name) = word.split_once(':').map_or((None, word), |(offset, name)| (Some(offset), name));
            let ty = self.resolve(Kind::Type, name).map_err(|message| words.error(message))?;
            let ty = TypeId(u16::try_from(ty).map_err(|_| words.error("this type's number is too large"))?);
            let known = if size.is_some() && align.is_some() && offset.is_some() {
                None
            } else {
                Some(self.type_extent(ty, words)?)
            };
            let (field_size, field_align) = known.unwrap_or((0, 1));
            let offset = match offset {
                Some(offset) => number(offset).ok_or_else(|| words.error(format!("`{offset}` is no offset")))?,
                None if union => 0,
                None => aligned(record.size, field_align).ok_or_else(|| words.error("the record is too large"))?,
            };
            let end = u32::checked_add(offset, field_size).ok_or_else(|| words.error("the record is too large"))?;
            record.size = record.size.max(end);
            record.align = record.align.max(field_align);
            record.fields.push(Field { offset, ty });
        }
        record.align = align.unwrap_or(record.align);
        record.size = match size {
            Some(size) => size,
            None => aligned(record.size, record.align).ok_or_else(|| words.error("the record is too large"))?,
        };
        Ok(record)
    }

    /// A record, then `[base TYPE] [methods METHOD=FUNCTION…]`.
    fn block_type(&self, words: &mut Words<'_>) -> Result<Type, AssemblyError> {
        let record = self.record(words, false)?;
        let base = if words.take("base") { Some(TypeId(self.id(Kind::Type, words)?)) } else { None };
        let mut methods = Vec::new();
        if words.take("methods") {
            while words.peek().is_some() {
                let word = words.word("METHOD=FUNCTION")?;
                let pair = word.split_once('=').ok_or_else(|| words.error("a method is METHOD=FUNCTION"))?;
                let method = self.resolve(Kind::Method, pair.0).map_err(|message| words.error(message))?;
                let function = self.resolve(Kind::Function, pair.1).map_err(|message| words.error(message))?;
                let ids = u16::try_from(method).ok().zip(u16::try_from(function).ok());
                let (method, function) = ids.ok_or_else(|| words.error("this number is too large"))?;
                methods.push((MethodId(method), FunctionId(function)));
            }
        }
        Ok(Type::Block { record, base, methods })
    }

    /// `array NAME ELEMENT [stride N] LOWER..UPPER…`
    fn array_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        words.next("name")?;
        let element = TypeId(self.id(Kind::Type, words)?);
        let stride = if words.take("stride") { words.number("stride")? } else { self.type_extent(element, words)?.0 };
        let mut dimensions = Vec::new();
        while words.peek().is_some() {
            dimensions.push(bounds(words)?);
        }
        let id = ArrayId::from_index(self.container.types.arrays.len());
        self.container.types.arrays.push(ArrayDescriptor { element, stride, dimensions });
        if !self.exact {
            self.push_type(Type::Array(id.ok_or_else(|| words.error("there are too many arrays"))?));
        }
        Ok(())
    }

    fn global_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let name = words.word("name")?;
        let index = u16::try_from(self.globals.len()).map_err(|_| words.error("there are too many globals"))?;
        self.define(Kind::Global, name, u32::from(index), words)?;
        if self.exact {
            return Err(words.error("an exact text lists its `slots` and `shared_globals`"));
        }
        self.globals.push(Self::storage(words)?);
        Ok(())
    }

    /// `data NAME TYPE [at OFFSET] [constant]`
    fn data_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let name = words.word("name")?;
        let ty = TypeId(self.id(Kind::Type, words)?);
        let offset = match words.take("at") {
            true => words.number("offset")?,
            false => self.place_data(ty).map_err(|message| words.error(message))?,
        };
        let size = self.extent(ty).map_or(0, |extent| extent.0);
        self.data_end = self.data_end.max(offset.saturating_add(size));
        self.define(Kind::Data, name, offset, words)?;
        let constant = words.take("constant");
        self.container.types.data.push(DataVariable { offset, ty, constant });
        Ok(())
    }

    fn program_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        words.next("name")?;
        let block = if words.take("block") { Some(TypeId(self.id(Kind::Type, words)?)) } else { None };
        self.container.types.programs.push(ProgramType { slots: Vec::new(), block });
        Ok(())
    }

    /// `slot NAME STORAGE`: a slot of the program above.
    fn program_slot(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let name = words.word("name")?;
        let count = self.container.types.programs.len();
        let index = self.container.types.programs.last().map(|program| program.slots.len());
        let index = index.ok_or_else(|| words.error("there is no `program` line above"))?;
        let index = u16::try_from(index).map_err(|_| words.error("there are too many slots"))?;
        self.define(Kind::ProgramSlot(count - 1), name, u32::from(index), words)?;
        let storage = Self::storage(words)?;
        if let Some(program) = self.container.types.programs.last_mut() {
            program.slots.push(storage);
        }
        Ok(())
    }

    /// `block_instance OFFSET TYPE [stride N] [count N]`
    fn block_instance(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let offset = self.id(Kind::Data, words)?;
        let ty = TypeId(self.id(Kind::Type, words)?);
        let stride = if words.take("stride") { words.number("stride")? } else { self.type_extent(ty, words)?.0 };
        let count = if words.take("count") { words.number("count")? } else { 1 };
        self.given.insert("block_instance");
        self.container.types.block_instances.push(BlockInstance { offset, stride, count, ty });
        Ok(())
    }

    /// `method NAME (param TYPE | result TYPE)…`
    fn method_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        words.next("name")?;
        let mut signature = MethodSignature::default();
        while words.peek().is_some() {
            match words.word("param or result")? {
                "param" => signature.parameters.push(self.local_type(words)?),
                "result" => signature.results.push(Self::value_type(words)?),
                other => return Err(words.error(format!("`{other}` is neither param nor result"))),
            }
        }
        self.container.types.methods.push(signature);
        Ok(())
    }

    /// `REGION OFFSET`: s (slots), d, m, q; in s and d the offset may be a name.
    fn region_place(&self, words: &mut Words<'_>) -> Result<(Region, u32), AssemblyError> {
        let word = words.word("region")?;
        let region = match word {
            "s" => Region::Slots,
            "d" => Region::Data,
            "m" => Region::Memory,
            "q" => Region::Output,
            _ => return Err(words.error(format!("`{word}` is no region (s d m q)"))),
        };
        let word = words.word("offset")?;
        let offset = match (number(word), region) {
            (Some(offset), _) => Ok(offset),
            (None, Region::Slots) => self.resolve(Kind::Global, word).map(|slot| slot.saturating_mul(SLOT_BYTES)),
            (None, _) => self.resolve(Kind::Data, word),
        };
        Ok((region, offset.map_err(|message| words.error(message))?))
    }

    /// `init REGION OFFSET [repeat N] (bytes HEX | string "…" | STORAGE VALUE…)`
    fn init_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let (region, offset) = self.region_place(words)?;
        let repeat = if words.take("repeat") { words.number("repeat")? } else { 1 };
        let mut bytes = Vec::new();
        if words.take("bytes") {
            if words.peek().is_some() {
                bytes = words.bytes("initial bytes")?;
            }
        } else if words.take("string") {
            bytes = words.text("initial text")?.as_bytes().to_vec();
            bytes.push(0);
        } else {
            let storage = Self::storage(words)?;
            while words.peek().is_some() {
                scalar_bytes(storage, words, &mut bytes)?;
            }
        }
        self.container.types.init_image.push(InitRun { region, offset, repeat, bytes });
        Ok(())
    }

    fn system_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let kind = match words.word("up_time or up_ltime")? {
            "up_time" => SystemVariableKind::UpTime,
            "up_ltime" => SystemVariableKind::UpLtime,
            other => return Err(words.error(format!("unknown system variable `{other}`"))),
        };
        let slot = SlotIndex(self.id(Kind::Global, words)?);
        self.container.types.system_variables.push(SystemVariable { kind, slot });
        Ok(())
    }

    /// `task NAME cyclic US | event | freewheeling …`
    fn task_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let name = words.word("name")?;
        let id = TaskId::from_index(self.container.tasks.tasks.len());
        let id = id.ok_or_else(|| words.error("there are too many tasks"))?;
        let mut task = Task { id, enabled: true, ..Task::default() };
        match words.word("kind of task")? {
            "cyclic" => (task.task_type, task.interval_us) = (TaskType::Cyclic, words.number("interval in µs")?),
            "event" => task.task_type = TaskType::Event,
            "freewheeling" => task.task_type = TaskType::Freewheeling,
            other => return Err(words.error(format!("`{other}` is neither cyclic, event nor freewheeling"))),
        }
        let mut extension = TaskExtension { name: name.to_string(), ..TaskExtension::default() };
        while let Some(word) = words.peek() {
            if !self.exact && self.extension_word(&mut extension, words)? {
                continue;
            }
            words.next("keyword")?;
            match word {
                "id" => task.id = TaskId(words.number("task id")?),
                "priority" => task.priority = words.number("priority")?,
                "disabled" => task.enabled = false,
                "interval" => task.interval_us = words.number("interval in µs")?,
                "watchdog" => task.watchdog_us = words.number("watchdog time in µs")?,
                "single_slot" => task.single_slot = Some(SlotIndex(self.id(Kind::Global, words)?)),
                other => return Err(words.error(format!("unknown word `{other}` in a task"))),
            }
        }
        if let (false, TaskType::Event, SingleSource::Slot(slot)) = (self.exact, task.task_type, extension.single) {
            task.single_slot = task.single_slot.or(Some(slot));
        }
        self.extensions.push(extension);
        self.container.tasks.tasks.push(task);
        Ok(())
    }

    /// One of `name "…"`, `single …`, `phase US`, `sensitivity N`, `policy NAME`, if that is what comes next.
    fn extension_word(&self, extension: &mut TaskExtension, words: &mut Words<'_>) -> Result<bool, AssemblyError> {
        if words.take("name") {
            extension.name = words.text("name")?.to_string();
        } else if words.take("single") {
            extension.single = self.single_source(words)?;
        } else if words.take("phase") {
            extension.phase_us = words.number("phase in µs")?;
        } else if words.take("sensitivity") {
            extension.watchdog_sensitivity = words.number("sensitivity")?;
        } else if words.take("policy") {
            extension.overrun_policy = match words.word("policy")? {
                "grid" => OverrunPolicy::Grid,
                "at-once" => OverrunPolicy::AtOnce,
                "realign" => OverrunPolicy::Realign,
                other => return Err(words.error(format!("`{other}` is neither grid, at-once nor realign"))),
            };
        } else {
            return Ok(false);
        }
        Ok(true)
    }

    fn single_source(&self, words: &mut Words<'_>) -> Result<SingleSource, AssemblyError> {
        Ok(match words.word("source")? {
            "slot" => SingleSource::Slot(SlotIndex(self.id(Kind::Global, words)?)),
            "data" => SingleSource::Data(self.id(Kind::Data, words)?),
            "bit" => {
                let (place, offset, bit) = bit_place(words)?;
                SingleSource::Bit { place, offset, bit }
            }
            "true" => SingleSource::Literal(true),
            "false" => SingleSource::Literal(false),
            other => return Err(words.error(format!("`{other}` is neither slot, data, bit, true nor false"))),
        })
    }

    /// `instance NAME [task T] [entry F] [id N] [slots OFFSET COUNT] [blocks FIRST COUNT]`
    fn instance_line(&mut self, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        words.next("name")?;
        let id = InstanceId::from_index(self.instances.len());
        let id = id.ok_or_else(|| words.error("there are too many instances"))?;
        let entry = self.resolve(Kind::Function, "main").ok().and_then(|id| u16::try_from(id).ok());
        let mut pending = PendingInstance {
            instance: ProgramInstance { id, entry: FunctionId(entry.unwrap_or(0)), ..ProgramInstance::default() },
            ..PendingInstance::default()
        };
        let instance = &mut pending.instance;
        while words.peek().is_some() {
            match words.word("keyword")? {
                "id" => instance.id = InstanceId(words.number("instance id")?),
                "task" => instance.task = TaskId(self.id(Kind::Task, words)?),
                "entry" => instance.entry = FunctionId(self.id(Kind::Function, words)?),
                "slots" => {
                    pending.has_slots = true;
                    instance.slot_offset = words.number("first slot")?;
                    instance.slot_count = words.number("number of slots")?;
                }
                "blocks" => {
                    pending.has_blocks = true;
                    instance.block_offset = words.number("first row")?;
                    instance.block_count = words.number("number of rows")?;
                }
                other => return Err(words.error(format!("unknown word `{other}` in an instance"))),
            }
        }
        if self.exact {
            self.container.tasks.instances.push(pending.instance);
        }
        self.instances.push(pending);
        Ok(())
    }
}

/// Remembers which budgets a text gives itself.
trait Mark {
    fn mark<T>(&mut self, name: &'static str, value: T) -> T;
}

impl Mark for std::collections::BTreeSet<&'static str> {
    fn mark<T>(&mut self, name: &'static str, value: T) -> T {
        self.insert(name);
        value
    }
}

/// `LOWER..UPPER`
pub(super) fn bounds(words: &mut Words<'_>) -> Result<(i32, i32), AssemblyError> {
    let word = words.word("bounds")?;
    let pair = word.split_once("..").and_then(|(lower, upper)| number(lower).zip(number(upper)));
    pair.ok_or_else(|| words.error(format!("`{word}` is not LOWER..UPPER")))
}

/// `PLACE BYTE BIT`
pub(super) fn bit_place(words: &mut Words<'_>) -> Result<(BytePlace, u32, u8), AssemblyError> {
    let place = byte_place(words)?;
    Ok((place, words.number("byte offset")?, words.number("bit")?))
}

pub(super) fn byte_place(words: &mut Words<'_>) -> Result<BytePlace, AssemblyError> {
    let word = words.word("place")?;
    BytePlace::from_name(word).ok_or_else(|| words.error(format!("`{word}` is no place (d b t f m q i)")))
}

/// The next multiple of an alignment.
pub(super) fn aligned(offset: u32, align: u32) -> Option<u32> {
    offset.checked_next_multiple_of(align.max(1))
}

fn float_bits<F: std::str::FromStr, B: TryFrom<i128>>(word: &str, nan: B, bits: impl Fn(F) -> (bool, B)) -> Option<B> {
    if word.starts_with("0x") {
        return number(word);
    }
    let (is_nan, value) = bits(word.parse().ok()?);
    Some(if is_nan { nan } else { value })
}

fn scalar_bytes(storage: Storage, words: &mut Words<'_>, out: &mut Vec<u8>) -> Result<(), AssemblyError> {
    let bytes = match storage {
        Storage::F32 | Storage::F64 => match Assembler::constant(storage.name(), words)? {
            Constant::F32(bits) => bits.to_le_bytes().to_vec(),
            Constant::F64(bits) => bits.to_le_bytes().to_vec(),
            Constant::I64(value) => value.to_le_bytes().to_vec(),
        },
        _ => {
            let value: i128 = words.number("initial value")?;
            let bits = storage.bytes() * 8;
            if value < -(1 << (bits - 1)) || value >= 1 << bits {
                return Err(words.error(format!("this does not fit into {storage}")));
            }
            value.to_le_bytes().into_iter().take(storage.bytes() as usize).collect()
        }
    };
    out.extend_from_slice(&bytes);
    Ok(())
}
