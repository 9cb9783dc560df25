//! Functions: their frames, FOR loops, labels and instructions.

use super::tokens::{Line, Words, number};
use super::{Assembler, AssemblyError, Kind};
use crate::container::{Constant, ControlPlace, ForLoop, Function, Owner, Type};
use crate::ids::{ForId, ProgramId, SlotIndex, TypeId};
use crate::instruction::{ControlOp, Instruction};
use crate::value::{BytePlace, IntegerType, LocalType, SlotPlace, Storage};

/// What the lines before the code say.
const HEADER_WORDS: &[&str] = &["param", "local", "parameters", "result", "frame", "for"];

impl Assembler {
    /// `function NAME [program P | block T]` and the lines up to its `end`.
    pub(super) fn function(&mut self, header: &Line, lines: &[Line]) -> Result<(), AssemblyError> {
        self.names.retain(|(kind, _), _| !matches!(kind, Kind::Local | Kind::For | Kind::Label));
        let mut function = self.function_header(header)?;
        let mut body = Vec::new();
        for line in lines {
            if HEADER_WORDS.contains(&line.keyword()) {
                self.frame_line(&mut function, line)?;
            } else {
                body.push(line);
            }
        }
        // First pass: sizes, so that labels are known; second pass: the code.
        let mut offset = 0_usize;
        for line in &body {
            if let Some(label) = label(line) {
                let place = u32::try_from(offset).map_err(|_| line.error_at(1, "the code is too long"))?;
                self.define(Kind::Label, label, place, &line.words())?;
            } else {
                offset += self.code_line(&function, line, false)?.len();
            }
        }
        for line in body.iter().filter(|line| label(line).is_none()) {
            let bytes = self.code_line(&function, line, true)?;
            function.code.extend_from_slice(&bytes);
        }
        self.container.functions.push(function);
        Ok(())
    }

    fn function_header(&mut self, header: &Line) -> Result<Function, AssemblyError> {
        let mut words = header.words();
        words.next("keyword")?;
        let name = words.word("name")?;
        let owner = match words.peek() {
            Some("program") => {
                words.next("program")?;
                Owner::Program(ProgramId(self.id(Kind::Program, &mut words)?))
            }
            Some("block") => {
                words.next("block")?;
                Owner::Block(TypeId(self.id(Kind::Type, &mut words)?))
            }
            // The entry of a text that leaves its program out.
            _ if name == "main" && !self.exact => {
                self.default_program();
                Owner::Program(ProgramId(0))
            }
            _ => Owner::None,
        };
        words.end()?;
        Ok(Function { owner, ..Function::default() })
    }

    fn frame_line(&mut self, function: &mut Function, line: &Line) -> Result<(), AssemblyError> {
        let mut words = line.words();
        match words.word("keyword")? {
            "param" => {
                self.add_local(function, &mut words)?;
                function.parameters = function.parameters.saturating_add(1);
            }
            "local" => self.add_local(function, &mut words)?,
            // Only for containers that say something else than their locals.
            "parameters" => function.parameters = words.number("number of parameters")?,
            "result" => {
                while words.peek().is_some() {
                    function.results.push(Self::value_type(&mut words)?);
                }
            }
            "frame" => function.frame = Some(TypeId(self.id(Kind::Type, &mut words)?)),
            _ => self.for_line(function, &mut words)?,
        }
        words.end()
    }

    fn add_local(&mut self, function: &mut Function, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let name = words.word("name")?;
        let index = slot_number(function.locals.len(), words)?;
        self.define(Kind::Local, name, u32::from(index), words)?;
        function.locals.push(self.local_type(words)?);
        Ok(())
    }

    /// `for NAME PLACE VARIABLE INTEGER [bound SLOT] [step SLOT]`; slots that are left out are added as locals.
    fn for_line(&mut self, function: &mut Function, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        let name = words.word("name")?.to_string();
        let index = slot_number(function.for_loops.len(), words)?;
        self.define(Kind::For, &name, u32::from(index), words)?;
        let place = words.word("place")?;
        let variable = words.word("control variable")?;
        let control = match (SlotPlace::from_name(place), BytePlace::from_name(place)) {
            (Some(slot_place), _) => {
                let slot = self.slot(function, slot_place, variable).map_err(|message| words.error(message))?;
                ControlPlace::Slot(slot_place, SlotIndex(slot_number(slot as usize, words)?))
            }
            (None, Some(byte_place)) => {
                let offset = self.offset(function, byte_place, variable).map_err(|message| words.error(message))?;
                ControlPlace::Bytes(byte_place, offset)
            }
            _ => return Err(words.error(format!("`{place}` is no place"))),
        };
        let ty = words.word("integer type")?;
        let ty = IntegerType::from_name(ty).ok_or_else(|| words.error(format!("`{ty}` is no integer type")))?;
        let bound = self.for_slot(function, &name, "bound", ty, words)?;
        let step = self.for_slot(function, &name, "step", ty, words)?;
        function.for_loops.push(ForLoop { control, ty, bound, step });
        Ok(())
    }

    fn for_slot(
        &mut self,
        function: &mut Function,
        name: &str,
        role: &str,
        ty: IntegerType,
        words: &mut Words<'_>,
    ) -> Result<SlotIndex, AssemblyError> {
        if words.take(role) {
            return Ok(SlotIndex(self.id(Kind::Local, words)?));
        }
        let index = slot_number(function.locals.len(), words)?;
        self.define(Kind::Local, &format!("{name}.{role}"), u32::from(index), words)?;
        let wide = ty.value_type() == crate::value::ValueType::I64;
        function.locals.push(LocalType::Scalar(if wide { Storage::I64 } else { Storage::I32 }));
        Ok(SlotIndex(index))
    }

    /// The bytes of one line of code. Labels count as 0 until they are `known`.
    fn code_line(&mut self, function: &Function, line: &Line, known: bool) -> Result<Vec<u8>, AssemblyError> {
        let mut words = line.words();
        let mnemonic = words.word("instruction")?;
        if mnemonic == "bytes" {
            let bytes = words.bytes("code")?;
            words.end()?;
            return Ok(bytes);
        }
        let operands = self.operands(function, mnemonic, &mut words, known)?;
        let mut operands = operands.iter().map(String::as_str);
        let instruction = Instruction::from_words(mnemonic, &mut operands);
        let instruction = instruction.map_err(|message| words.error(message))?;
        let mut bytes = Vec::new();
        instruction.encode(&mut bytes);
        Ok(bytes)
    }

    /// The words behind a mnemonic with every name replaced by its number.
    fn operands(
        &mut self,
        function: &Function,
        mnemonic: &str,
        words: &mut Words<'_>,
        known: bool,
    ) -> Result<Vec<String>, AssemblyError> {
        let row = ControlOp::ALL.iter().find(|op| op.mnemonic() == mnemonic);
        let mut operands: Vec<String> = Vec::new();
        for (name, kind) in row.map_or(&[][..], |op| op.immediates()) {
            loop {
                let word = words.word(name)?;
                let text = self.operand(function, kind, operands.first().map(String::as_str), word, words, known)?;
                operands.push(text);
                if *kind != "Labels" || words.peek().is_none() {
                    break;
                }
            }
        }
        while words.peek().is_some() {
            operands.push(words.word("operand")?.to_string());
        }
        Ok(operands)
    }

    fn operand(
        &mut self,
        function: &Function,
        kind: &str,
        place: Option<&str>,
        word: &str,
        words: &mut Words<'_>,
        known: bool,
    ) -> Result<String, AssemblyError> {
        let number = match kind {
            "Constant" if matches!(word, "i64" | "f32" | "f64") => {
                let constant = Self::constant(word, words)?;
                self.pool_position(constant).ok_or_else(|| "the constant pool is full".to_string())
            }
            "Constant" => self.resolve(Kind::Constant, word),
            "Slot" => match place.and_then(SlotPlace::from_name) {
                Some(place) => self.slot(function, place, word),
                None => return Ok(word.to_string()),
            },
            "Offset" => match place.and_then(BytePlace::from_name) {
                Some(place) => self.offset(function, place, word),
                None => return Ok(word.to_string()),
            },
            "Type" => self.resolve(Kind::Type, word),
            "Array" => self.resolve(Kind::Array, word),
            "For" => self.resolve(Kind::For, word),
            "Function" => self.resolve(Kind::Function, word),
            "Method" => self.resolve(Kind::Method, word),
            "Label" | "Labels" => self.label_target(word, known),
            _ => return Ok(word.to_string()),
        };
        number.map(|number| number.to_string()).map_err(|message| words.error(message))
    }

    fn label_target(&self, word: &str, known: bool) -> Result<u32, String> {
        if let Some(raw) = word.strip_prefix('@') {
            return number(raw).ok_or_else(|| format!("`{word}` is no code offset"));
        }
        if !known {
            return Ok(0);
        }
        self.names.get(&(Kind::Label, word.to_string())).copied().ok_or_else(|| format!("there is no label `{word}`"))
    }

    fn pool_position(&mut self, constant: Constant) -> Option<u32> {
        let pool = &mut self.container.constants;
        let position = pool.iter().position(|c| *c == constant).unwrap_or_else(|| {
            pool.push(constant);
            pool.len() - 1
        });
        u16::try_from(position).ok().map(u32::from)
    }

    /// A slot by number or name; names of `p` are those of the owner's program.
    fn slot(&self, function: &Function, place: SlotPlace, word: &str) -> Result<u32, String> {
        match (place, function.owner) {
            (SlotPlace::Global, _) => self.resolve(Kind::Global, word),
            (SlotPlace::Local, _) => self.resolve(Kind::Local, word),
            (SlotPlace::Program, Owner::Program(program)) => self.resolve(Kind::ProgramSlot(program.index()), word),
            (SlotPlace::Program, _) => number(word).ok_or_else(|| "this function has no program".to_string()),
        }
    }

    /// An offset: `8`, in `d` also `name` or `name+8`, in `b`, `t` and `f` also `#2` for the field number 2.
    fn offset(&self, function: &Function, place: BytePlace, word: &str) -> Result<u32, String> {
        if let Some(field) = word.strip_prefix('#') {
            let field: usize = number(field).ok_or_else(|| format!("`{word}` is no field"))?;
            let ty = match (place, function.owner) {
                (BytePlace::Block, Owner::Program(program)) => {
                    self.container.types.programs.get(program.index()).and_then(|program| program.block)
                }
                (BytePlace::This, Owner::Block(ty)) => Some(ty),
                (BytePlace::Frame, _) => function.frame,
                _ => None,
            };
            return self.field_offset(ty, field).ok_or_else(|| format!("there is no field `{word}` here"));
        }
        match (place, word.split_once('+')) {
            (BytePlace::Data, Some((name, more))) => {
                let more: u32 = number(more).ok_or_else(|| format!("`{more}` is no number"))?;
                let start = self.resolve(Kind::Data, name)?;
                start.checked_add(more).ok_or_else(|| "this offset is too large".to_string())
            }
            (BytePlace::Data, None) => self.resolve(Kind::Data, word),
            _ => number(word).ok_or_else(|| format!("an offset can not be `{word}`")),
        }
    }

    fn field_offset(&self, ty: Option<TypeId>, field: usize) -> Option<u32> {
        let ty = self.container.types.types.get(ty?.index())?;
        let (Type::Struct(record) | Type::Union(record) | Type::Block { record, .. }) = ty else { return None };
        record.fields.get(field).map(|field| field.offset)
    }
}

/// `name:` alone on a line.
fn label(line: &Line) -> Option<&str> {
    let [only] = line.tokens.as_slice() else { return None };
    only.text.strip_suffix(':').filter(|_| !only.quoted)
}

fn slot_number(index: usize, words: &Words<'_>) -> Result<u16, AssemblyError> {
    // FOR loops have the same width of id.
    ForId::from_index(index).map(|id| id.0).ok_or_else(|| words.error("there are too many of these"))
}
