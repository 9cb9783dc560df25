//! The lines between `debug` and `end`.

use super::declarations::{bit_place, bounds, byte_place};
use super::tokens::{Line, Words, number};
use super::{Assembler, AssemblyError, Kind};
use crate::container::{DebugPlace, DebugSection, DebugType, DebugVariable, ElementaryType, LineEntry, SourceFile};
use crate::ids::{FunctionId, SlotIndex};

impl Assembler {
    /// A debug block; a second one goes on where the first ended.
    pub(super) fn debug(&mut self, lines: &[Line]) -> Result<(), AssemblyError> {
        let mut debug = self.container.debug.take().unwrap_or_default();
        for line in lines {
            let mut words = line.words();
            self.debug_line(&mut debug, &mut words)?;
            words.end()?;
        }
        self.container.debug = Some(debug);
        Ok(())
    }

    fn debug_line(&self, debug: &mut DebugSection, words: &mut Words<'_>) -> Result<(), AssemblyError> {
        match words.word("keyword")? {
            "resource" => debug.resource_name = words.text("name")?.to_string(),
            "configuration" => debug.configuration_name = words.text("name")?.to_string(),
            "file" => {
                let name = words.text("name")?.to_string();
                let hash = if words.peek().is_some() { Self::hash(words)? } else { [0; 32] };
                debug.files.push(SourceFile { name, hash });
            }
            "line" => {
                let function = FunctionId(self.id(Kind::Function, words)?);
                let entry = LineEntry {
                    function,
                    offset: words.number("code offset")?,
                    file: words.number("file")?,
                    line: words.number("line")?,
                    column: words.number("column")?,
                };
                debug.lines.push(entry);
            }
            "function" => debug.function_names.push(words.text("name")?.to_string()),
            "type" => debug.types.push(debug_type(words)?),
            "variable" => {
                let name = words.text("name")?.to_string();
                let place = self.debug_place(words)?;
                let ty = words.number("debug type")?;
                debug.variables.push(DebugVariable { name, place, ty, constant: words.take("constant") });
            }
            "instance" => debug.instance_names.push(words.text("name")?.to_string()),
            other => return Err(words.error(format!("unknown line `{other}` in a debug block"))),
        }
        Ok(())
    }

    fn debug_place(&self, words: &mut Words<'_>) -> Result<DebugPlace, AssemblyError> {
        Ok(match words.word("place")? {
            "slot" => DebugPlace::Slot(SlotIndex(self.id(Kind::Global, words)?)),
            "bytes" => {
                let place = byte_place(words)?;
                DebugPlace::Bytes(place, self.id(Kind::Data, words)?)
            }
            "bit" => {
                let (place, offset, bit) = bit_place(words)?;
                DebugPlace::Bit(place, offset, bit)
            }
            other => return Err(words.error(format!("`{other}` is neither slot, bytes nor bit"))),
        })
    }
}

fn elementary(words: &mut Words<'_>) -> Result<ElementaryType, AssemblyError> {
    let word = words.word("elementary type")?;
    let found = ElementaryType::ALL.iter().find(|ty| ty.name() == word);
    found.copied().ok_or_else(|| words.error(format!("`{word}` is no elementary type")))
}

fn debug_type(words: &mut Words<'_>) -> Result<DebugType, AssemblyError> {
    Ok(match words.word("form")? {
        "elementary" => DebugType::Elementary(elementary(words)?),
        "string" => DebugType::String { capacity: words.number("capacity")? },
        "wstring" => DebugType::WideString { capacity: words.number("capacity")? },
        "array" => {
            let element = words.number("debug type")?;
            let stride = words.number("stride")?;
            let mut dimensions = Vec::new();
            while words.peek().is_some() {
                dimensions.push(bounds(words)?);
            }
            DebugType::Array { element, stride, dimensions }
        }
        "subrange" => DebugType::Subrange {
            base: elementary(words)?,
            lower: words.number("least value")?,
            upper: words.number("greatest value")?,
        },
        "enumeration" => {
            let name = words.text("name")?.to_string();
            let base = elementary(words)?;
            let mut values = Vec::new();
            while words.peek().is_some() {
                values.push((words.text("name")?.to_string(), words.number("value")?));
            }
            DebugType::Enumeration { name, base, values }
        }
        "record" => {
            let name = words.text("name")?.to_string();
            let mut fields = Vec::new();
            while words.peek().is_some() {
                let field = words.text("name")?.to_string();
                let (offset, ty) = (words.word("offset")?, words.number("debug type")?);
                let offset = number(offset).ok_or_else(|| words.error(format!("`{offset}` is no offset")))?;
                fields.push((field, offset, ty));
            }
            DebugType::Record { name, fields }
        }
        other => return Err(words.error(format!("unknown form `{other}` of a type"))),
    })
}
