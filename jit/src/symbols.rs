//! What people and profilers call a piece of machine code, and which source lines it comes from.

use cranelift_codegen::MachSrcLoc;
use cranelift_codegen::ir::SourceLoc;
use khz_bytecode::container::{Container, DebugSection, LineEntry};
use khz_bytecode::ids::FunctionId;
use khz_bytecode::verify::Verified;
use khz_machine::trap::CodePlace;

use crate::build::ProgramMemory;
use crate::code::Key;
use crate::mir;

/// The machine code of a function, or of a part that was cut out of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Symbol<'a> {
    /// The function's name; in brackets the program instance whose code it is, or `shared`; then which part.
    pub name: String,
    /// The code, at its place in this process.
    pub code: &'a [u8],
    /// Where source lines start in it, by offset; bytes in front of the first are the function's entry.
    pub lines: Vec<LineRange>,
}

impl Symbol<'_> {
    /// Address of the first byte in this process.
    #[must_use]
    pub fn address(&self) -> u64 {
        self.code.as_ptr() as u64
    }
}

/// Bytes of machine code that come from one source line: up to the next range.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LineRange {
    /// Offset of the first byte in the function's code.
    pub offset: u32,
    /// Source file, as it was given.
    pub file: String,
    /// Line, from 1.
    pub line: u32,
}

/// What is kept of a compiled form for [`Symbol`]s.
#[derive(Debug, Clone)]
pub struct Note {
    /// The function.
    pub key: Key,
    /// The part of it.
    pub part: Option<u32>,
    /// Bytes of its code.
    pub bytes: usize,
    /// Offsets from which on the code comes from a place.
    pub lines: Vec<(u32, CodePlace)>,
}

/// Where places start in the code of a form whose instructions carry theirs.
pub(crate) fn lines_of(form: &mir::Function, ranges: &[MachSrcLoc<cranelift_codegen::Final>]) -> Vec<(u32, CodePlace)> {
    let places = ranges.iter().filter_map(|range| Some((range.start, place_of(form, range.loc)?)));
    places.collect()
}

/// The place that an instruction carries.
pub(crate) fn place_of(form: &mir::Function, location: SourceLoc) -> Option<CodePlace> {
    let place = Some(location).filter(|location| !location.is_default())?.bits();
    let data = form.places.get(place as usize)?;
    Some(CodePlace { function: data.function, offset: data.offset })
}

/// Symbols of all that was noted.
pub(crate) fn symbols<'a>(verified: &Verified, notes: impl Iterator<Item = (&'a Note, &'a [u8])>) -> Vec<Symbol<'a>> {
    let debug = verified.container().debug.as_ref();
    let names = Names::new(verified);
    let symbol = |(note, code): (&Note, &'a [u8])| {
        let mut lines: Vec<LineRange> = Vec::new();
        for (offset, place) in &note.lines {
            let Some((file, line)) = source_line(debug, *place) else { continue };
            if lines.last().is_none_or(|last| (last.file.as_str(), last.line) != (file, line)) {
                lines.push(LineRange { offset: *offset, file: file.to_owned(), line });
            }
        }
        Symbol { name: names.of(note.key, note.part), code, lines }
    };
    notes.map(symbol).collect()
}

/// The source file and line of a place, where the container tells.
pub(crate) fn source_line(debug: Option<&DebugSection>, place: CodePlace) -> Option<(&str, u32)> {
    let debug = debug?;
    let behind = debug.lines.partition_point(|line| (line.function, line.offset) <= (place.function, place.offset));
    let entry: &LineEntry = debug.lines.get(behind.checked_sub(1)?)?;
    let file = debug.files.get(usize::from(entry.file)).filter(|_| entry.function == place.function)?;
    Some((&file.name, entry.line))
}

/// What functions are called.
pub(crate) struct Names<'a> {
    container: &'a Container,
    /// Program instances by what tells their memory.
    instances: std::collections::BTreeMap<(u32, u32), usize>,
}

impl<'a> Names<'a> {
    pub fn new(verified: &'a Verified) -> Names<'a> {
        let container = verified.container();
        let blocks = &verified.facts().instance_blocks;
        // Of instances without memory, which share code, the first gives its name.
        let instances = container.tasks.instances.iter().zip(blocks).enumerate().rev();
        let instances = instances
            .map(|(number, (instance, block))| ((u32::from(instance.slot_offset), block.unwrap_or(0)), number))
            .collect();
        Names { container, instances }
    }

    /// Name of a function, or `function 3` where there is none.
    pub fn function(&self, id: FunctionId) -> String {
        let name = self.container.debug.as_ref().and_then(|debug| debug.function_names.get(id.index()));
        let name = name.filter(|name| !name.is_empty()).cloned();
        name.unwrap_or_else(|| format!("function {}", id.index()))
    }

    /// Name of what was compiled.
    pub fn of(&self, key: Key, part: Option<u32>) -> String {
        let mut name = self.function(key.0);
        match key.1 {
            ProgramMemory::None => {}
            ProgramMemory::Shared => name += " [shared]",
            ProgramMemory::Instance { slots, block } => {
                let number = self.instances.get(&(slots, block)).copied().unwrap_or_default();
                let named = self.container.debug.as_ref().and_then(|debug| debug.instance_names.get(number));
                let named = named.filter(|name| !name.is_empty()).cloned();
                name += &format!(" [{}]", named.unwrap_or_else(|| format!("instance {number}")));
            }
        }
        if let Some(part) = part {
            name += &format!(" part {part}");
        }
        name
    }
}
