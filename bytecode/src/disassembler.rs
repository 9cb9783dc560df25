//! The disassembler: from a [`Container`] to text that the [assembler](crate::assembler) reads back to the same container.

mod debug;
mod sections;

use std::collections::BTreeSet;
use std::fmt::Write;

use crate::assembler::to_hex;
use crate::container::{Container, ControlPlace, Function, LineEntry, Owner};
use crate::ids::FunctionId;
use crate::instruction::{ControlOp, Instruction, Reader};
use crate::value::LocalType;

/// The whole container as assembly text.
///
/// The text begins with `exact`, so that nothing is added when it is assembled: `assemble(&disassemble(c)) == c` for every container, sound
/// or not.
#[must_use]
pub fn disassemble(container: &Container) -> String {
    let mut out = String::from("exact\n");
    sections::write(container, &mut out);
    for index in 0..container.functions.len() {
        if let Some(text) = FunctionId::from_index(index).and_then(|id| disassemble_function(container, id)) {
            out.push('\n');
            out.push_str(&text);
        }
    }
    if let Some(debug) = &container.debug {
        debug::write(debug, &mut out);
    }
    out
}

/// One function, from its `function` line to its `end`, with the source places of the debug section as comments. `None` when there is no
/// such function.
#[must_use]
pub fn disassemble_function(container: &Container, id: FunctionId) -> Option<String> {
    let function = container.functions.get(id.index())?;
    let mut out = format!("function f{id}");
    match function.owner {
        Owner::None => {}
        Owner::Program(program) => push(&mut out, format_args!(" program {program}")),
        Owner::Block(ty) => push(&mut out, format_args!(" block {ty}")),
    }
    if let Some(name) = container.debug.as_ref().and_then(|debug| debug.function_names.get(id.index())) {
        push(&mut out, format_args!(" ; {}", name.escape_debug()));
    }
    out.push('\n');
    frame_lines(function, &mut out);
    code_lines(container, id, function, &mut out);
    out.push_str("end\n");
    Some(out)
}

/// Appends formatted text.
fn push(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a String does not fail.
    let _ = out.write_fmt(text);
}

fn local_type(ty: LocalType) -> String {
    match ty {
        LocalType::Scalar(storage) => storage.to_string(),
        LocalType::Ref(reference) => format!(
            "ref{}{}:{}",
            if reference.write { "" } else { ".read" },
            if reference.image { ".image" } else { "" },
            reference.target
        ),
    }
}

fn frame_lines(function: &Function, out: &mut String) {
    let parameters = usize::from(function.parameters);
    for (index, ty) in function.locals.iter().enumerate() {
        let keyword = if index < parameters { "param" } else { "local" };
        push(out, format_args!("  {keyword} l{index} {}\n", local_type(*ty)));
    }
    if parameters > function.locals.len() {
        push(out, format_args!("  parameters {parameters}\n"));
    }
    for result in &function.results {
        push(out, format_args!("  result {result}\n"));
    }
    if let Some(frame) = function.frame {
        push(out, format_args!("  frame {frame}\n"));
    }
    for (index, row) in function.for_loops.iter().enumerate() {
        let control = match row.control {
            ControlPlace::Slot(place, slot) => format!("{place} {slot}"),
            ControlPlace::Bytes(place, offset) => format!("{place} {offset}"),
        };
        push(out, format_args!("  for k{index} {control} {} bound {} step {}\n", row.ty, row.bound, row.step));
    }
}

/// Decoded instructions with their offsets, and where the rest that is no code begins.
fn decode(code: &[u8]) -> (Vec<(usize, Instruction)>, usize) {
    let mut reader = Reader::new(code);
    let mut instructions = Vec::new();
    while !reader.is_at_end() {
        let at = reader.position();
        match Instruction::decode(&mut reader) {
            Ok(instruction) => instructions.push((at, instruction)),
            Err(_) => return (instructions, at),
        }
    }
    (instructions, code.len())
}

fn code_lines(container: &Container, id: FunctionId, function: &Function, out: &mut String) {
    let (instructions, end) = decode(&function.code);
    let boundaries: BTreeSet<usize> = instructions.iter().map(|(at, _)| *at).collect();
    let targets = instructions.iter().flat_map(|(_, instruction)| instruction.targets());
    let targets: BTreeSet<usize> =
        targets.map(crate::ids::Label::index).filter(|target| boundaries.contains(target)).collect();
    for (at, instruction) in &instructions {
        if targets.contains(at) {
            push(out, format_args!("L{at}:\n"));
        }
        out.push_str("  ");
        instruction_text(instruction, &targets, out);
        if let Some(place) = source_place(container, id, *at) {
            push(out, format_args!("  ; {place}"));
        }
        out.push('\n');
    }
    if let Some(rest) = function.code.get(end..).filter(|rest| !rest.is_empty()) {
        push(out, format_args!("  bytes {}\n", to_hex(rest)));
    }
}

fn instruction_text(instruction: &Instruction, targets: &BTreeSet<usize>, out: &mut String) {
    out.push_str(instruction.mnemonic());
    let mut immediates = String::new();
    instruction.write_immediates(&mut immediates);
    let kinds = instruction.control_op().map_or(&[][..], ControlOp::immediates);
    for (index, word) in immediates.split_whitespace().enumerate() {
        // Label lists are the last immediate of their row.
        let kind = kinds.get(index).or(kinds.last()).map_or("", |(_, kind)| *kind);
        let is_label = matches!(kind, "Label" | "Labels");
        match word.parse::<usize>() {
            Ok(target) if is_label && targets.contains(&target) => push(out, format_args!(" L{target}")),
            Ok(target) if is_label => push(out, format_args!(" @{target}")),
            _ => push(out, format_args!(" {word}")),
        }
    }
}

/// File, line and column, if an entry of the line map begins at this instruction.
fn source_place(container: &Container, function: FunctionId, at: usize) -> Option<String> {
    let debug = container.debug.as_ref()?;
    let key = |entry: &LineEntry| (entry.function, entry.offset as usize);
    // A hostile line map may be unsorted; then some comments are missing, nothing worse.
    let found = debug.lines.binary_search_by_key(&(function, at), key).ok()?;
    let entry = debug.lines.get(found)?;
    let file = debug.files.get(usize::from(entry.file))?;
    Some(format!("{}:{}:{}", file.name.escape_debug(), entry.line, entry.column))
}
