//! Documents generated from the tables: `docs/instructions.md`, and the tables of `docs/container.md`.
//!
//! A test holds that the committed files are fresh; `KHZ_BLESS=1 cargo test -p khz-bytecode` writes them anew.

use std::fmt::{Display, Write};

use crate::container::layout::{HeaderField, InstanceField, RecordField, TaskField};
use crate::container::{ReadCode, shapes};
use crate::instruction::{ControlOp, HelperOp, HelperOperand, NumericOp};
use crate::trap::TrapCode;

/// In `docs/container.md` everything behind this line is generated.
pub const GENERATED_MARK: &str = "<!-- Generated from here on: KHZ_BLESS=1 cargo test -p khz-bytecode -->";

fn row(out: &mut String, cells: &[&dyn Display]) {
    for cell in cells {
        // Writing to a String does not fail. A bar would end the cell.
        let _ = write!(out, "| {} ", cell.to_string().replace('|', "\\|"));
    }
    out.push_str("|\n");
}

fn heading(out: &mut String, cells: &[&str]) {
    let _ = writeln!(out, "| {} |\n|{}", cells.join(" | "), "---|".repeat(cells.len()));
}

fn trap_names(traps: &[TrapCode]) -> String {
    traps.iter().map(|trap| trap.name()).collect::<Vec<_>>().join(", ")
}

fn opcode(code: u16) -> String {
    format!("`{code:#06x}`")
}

/// The text of `docs/instructions.md`.
#[must_use]
pub fn instructions_markdown() -> String {
    let mut out = String::from(
        "# Instructions\n\nGenerated from the instruction table (`bytecode/src/instruction/table.rs`): `KHZ_BLESS=1 cargo test -p khz-bytecode`. \
         What values, places and references are: `docs/bytecode.md`.\n\nOn the wire an instruction is its opcode (u16, little-endian) and its immediates in the order \
         below. Cost is in fuel units; what moves or searches bytes costs 1 more for each 16 bytes it may touch.\n\n## Control, memory, references\n\n",
    );
    heading(&mut out, &["opcode", "instruction", "stack", "traps", "cost", "meaning"]);
    for op in ControlOp::ALL {
        let immediates: String = op.immediates().iter().map(|(name, kind)| format!(" *{name}*:{kind}")).collect();
        let name = format!("`{}`{immediates}", op.mnemonic());
        row(
            &mut out,
            &[&opcode(*op as u16), &name, &op.stack_effect(), &trap_names(op.traps()), &op.base_cost(), &op.meaning()],
        );
    }
    out.push_str("\nKinds of immediates: ");
    let kinds = IMMEDIATE_KINDS.iter().map(|(kind, meaning)| format!("*{kind}* {meaning}"));
    out.push_str(&kinds.collect::<Vec<_>>().join("; "));
    out.push_str(".\n\n## Values from values\n\n");
    heading(&mut out, &["opcode", "instruction", "stack", "traps", "cost", "meaning"]);
    for op in NumericOp::ALL {
        let operands = op.operands().iter().map(|ty| ty.name()).collect::<Vec<_>>().join(" ");
        let stack = format!("{operands} -> {}", op.result());
        let traps = op.trap().map_or("", TrapCode::name);
        let name = format!("`{}`", op.mnemonic());
        row(&mut out, &[&opcode(*op as u16), &name, &stack, &traps, &op.cost(), &op.meaning()]);
    }
    out.push_str("\n## Strings in memory\n\nOne capacity (u16) follows the opcode for each `dst` (writable) and `src` STRING and each `wide-dst` (writable) and `wide-src` WSTRING, in their order.\n\n");
    heading(&mut out, &["opcode", "instruction", "stack", "cost", "meaning"]);
    for op in HelperOp::ALL {
        let operands = op.operands().iter().map(|operand| match operand {
            HelperOperand::Dst => "dst",
            HelperOperand::Src => "src",
            HelperOperand::WideDst => "wide-dst",
            HelperOperand::WideSrc => "wide-src",
            HelperOperand::Value(ty) => ty.name(),
        });
        let result = op.result().map_or("", |ty| ty.name());
        let stack = format!("{} -> {result}", operands.collect::<Vec<_>>().join(" "));
        row(&mut out, &[&opcode(*op as u16), &format!("`{}`", op.mnemonic()), &stack, &op.base_cost(), &op.meaning()]);
    }
    out.push_str("\n## Traps\n\n");
    heading(&mut out, &["number", "name", "values", "meaning"]);
    for trap in TrapCode::ALL {
        row(&mut out, &[&(*trap as u8), &trap.name(), &trap.value_names().join(", "), &trap.text()]);
    }
    out
}

/// Wire form of the kinds that the table names.
const IMMEDIATE_KINDS: &[(&str, &str)] = &[
    ("I32, I64", "a number of that width"),
    ("Constant, Slot, Type, Field, Array, For, Function, Method", "a position (u16)"),
    ("SlotPlace", "u8: g 0, p 1, l 2"),
    ("BytePlace", "u8: d 0, b 1, t 2, f 3, m 4, q 5, i 6"),
    ("Storage", "u8: b1 0, i8 1, u8 2, i16 3, u16 4, i32 5, i64 6, f32 7, f64 8"),
    ("Integer", "u8: i8 0, u8 1, i16 2, u16 3, i32 4, u32 5, i64 6, u64 7"),
    ("Offset", "a byte offset (u32)"),
    ("Bit", "u8, 0 to 7"),
    ("Flag", "u8, 0 or 1"),
    ("Label", "a byte offset in the function's code (u32)"),
    ("Labels", "a count (u32) and so many labels"),
];

fn record<F: RecordField>(out: &mut String, title: &str) {
    let _ = writeln!(out, "\n### {title} ({} bytes)\n", F::RECORD_BYTES);
    heading(out, &["offset", "field", "type", "meaning"]);
    for field in F::ALL {
        row(out, &[&field.offset(), &field.name(), &field.ty().name(), &field.meaning()]);
    }
}

fn fields(fields: &[(&str, &str)]) -> String {
    fields.iter().map(|(name, ty)| format!("{name}: `{ty}`")).collect::<Vec<_>>().join(", ")
}

/// The generated part of `docs/container.md`.
#[must_use]
pub fn container_markdown() -> String {
    let mut out = String::from("\n## Fixed records\n");
    record::<HeaderField>(&mut out, "Header");
    record::<TaskField>(&mut out, "Task entry");
    record::<InstanceField>(&mut out, "Program instance entry");
    let shapes = shapes();
    for (section, tables) in &shapes.tables {
        let _ = writeln!(out, "\n## Tables of the {section}\n");
        heading(&mut out, &["tag", "table", "row", "holds"]);
        for (tag, name, row_type, meaning) in *tables {
            row(&mut out, &[tag, name, &format!("`{row_type}`"), meaning]);
        }
    }
    out.push_str("\n## Structs\n\n");
    heading(&mut out, &["struct", "fields in order"]);
    for (name, of) in shapes.structs {
        row(&mut out, &[name, &fields(of)]);
    }
    out.push_str("\n## Choices\n\n");
    heading(&mut out, &["choice", "number", "stands for", "fields in order"]);
    for (name, variants) in shapes.choices {
        for (code, variant, of) in *variants {
            row(&mut out, &[name, code, variant, &fields(of)]);
        }
    }
    out.push_str("\n## Bytes with a meaning\n\n");
    heading(&mut out, &["type", "values"]);
    for (name, values) in &shapes.bytes {
        let values = values.iter().map(|(code, value)| format!("{code} {value}")).collect::<Vec<_>>().join(", ");
        row(&mut out, &[name, &values]);
    }
    out.push_str("\n## Why a file is refused\n\n");
    heading(&mut out, &["code", "rule", "meaning"]);
    for code in ReadCode::ALL {
        row(&mut out, &[&code.code(), &code.title(), &code.explanation()]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fresh(name: &str, generate: impl Fn(&str) -> String) {
        let path = format!("{}/../docs/{name}", env!("CARGO_MANIFEST_DIR"));
        let committed = std::fs::read_to_string(&path).unwrap_or_default();
        let expected = generate(&committed);
        if std::env::var_os("KHZ_BLESS").is_some() {
            std::fs::write(&path, expected).unwrap();
        } else {
            assert!(committed == expected, "docs/{name} is stale: KHZ_BLESS=1 cargo test -p khz-bytecode");
        }
    }

    #[test]
    fn the_committed_documents_are_fresh() {
        fresh("instructions.md", |_| instructions_markdown());
        fresh("container.md", |committed| {
            let hand_written = committed.split(GENERATED_MARK).next().unwrap_or_default();
            format!("{hand_written}{GENERATED_MARK}\n{}", container_markdown())
        });
    }

    #[test]
    fn every_instruction_and_every_header_field_is_there() {
        let text = instructions_markdown();
        assert!(text.contains("| `0x001d` | `call.virtual` *method*:Method |"));
        let rows = text.lines().filter(|line| line.starts_with("| `0x")).count();
        assert_eq!(rows, ControlOp::ALL.len() + NumericOp::ALL.len() + HelperOp::ALL.len());
        assert!(container_markdown().contains("| 240 | frame_bytes | u32 |"));
    }
}
