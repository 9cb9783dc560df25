//! Tests of texts by people and of round trips.

use super::assemble;
use crate::container::{Owner, SingleSource, TaskType, Type};
use crate::disassembler::disassemble;
use crate::ids::{Label, ProgramId, SlotIndex};
use crate::instruction::{Instruction, Reader};

const EXAMPLE: &str = include_str!("../../../docs/assembly-example.kasm");

fn instructions(code: &[u8]) -> Vec<Instruction> {
    let mut reader = Reader::new(code);
    let mut all = Vec::new();
    while !reader.is_at_end() {
        all.push(Instruction::decode(&mut reader).unwrap());
    }
    all
}

#[test]
fn a_short_text_gets_program_task_and_budgets() {
    let c = assemble("global x i32\nfunction main\n const.i32 5\n slot.store g x\n return\nend\n").unwrap();
    assert_eq!(c.functions[0].owner, Owner::Program(ProgramId(0)));
    assert_eq!((c.tasks.tasks.len(), c.tasks.instances.len(), c.types.programs.len()), (1, 1, 1));
    assert_eq!(c.tasks.tasks[0].interval_us, 10_000);
    assert_eq!((c.tasks.shared_globals, c.types.slots.len()), (1, 1));
    assert_eq!(c.parameters.max_stack_depth, 64);
    assert_eq!(c.parameters.data_region_bytes, 16);
    let code = instructions(&c.functions[0].code);
    assert_eq!(code.len(), 3);
    assert_eq!(code[0], Instruction::ConstI32 { value: 5 });
}

#[test]
fn labels_forward_and_backward_are_byte_offsets() {
    let text = "function main\ntop:\n const.i32 1\n jump.if out\n jump top\nout:\n return\nend";
    let code = instructions(&assemble(text).unwrap().functions[0].code);
    assert_eq!(code[1], Instruction::JumpIf { target: Label(18) });
    assert_eq!(code[2], Instruction::Jump { target: Label(0) });
}

#[test]
fn the_example_of_the_docs_has_what_it_says_and_round_trips() {
    let c = assemble(EXAMPLE).unwrap();
    assert_eq!(c.tasks.tasks.len(), 2);
    assert_eq!(c.tasks.tasks[1].task_type, TaskType::Event);
    assert_eq!(c.tasks.tasks[1].single_slot, Some(SlotIndex(1)));
    assert_eq!(c.types.task_extensions[1].single, SingleSource::Slot(SlotIndex(1)));
    assert!(matches!(&c.types.types[2], Type::Block { record, .. } if record.size == 8));
    // Two instances with a data block and a block in it each, then the global block.
    let rows: Vec<_> = c.types.block_instances.iter().map(|row| row.ty.0).collect();
    assert_eq!(rows, [3, 2, 3, 2, 2]);
    assert_eq!(c.tasks.instances[1].block_offset, 2);
    assert_eq!(c.tasks.instances[1].slot_offset, c.tasks.instances[0].slot_offset + c.tasks.instances[0].slot_count);
    let text = disassemble(&c);
    assert_eq!(assemble(&text).unwrap(), c, "{text}");
    assert_eq!(disassemble(&assemble(&text).unwrap()), text);
}

#[test]
fn inline_constants_share_the_pool() {
    let text = "constant pi f64 3.25\nfunction main\n const f64 3.25\n drop\n const i64 0xffffffffffffffff\n drop\n const f32 nan\n drop\n const pi\n drop\n return\nend";
    let c = assemble(text).unwrap();
    let bits: Vec<_> = c.constants.iter().map(|c| format!("{c:?}")).collect();
    assert_eq!(bits, [format!("F64({})", 3.25_f64.to_bits()), "I64(-1)".into(), format!("F32({})", 0xFFC0_0000_u32)]);
}

#[test]
fn errors_name_line_and_column() {
    for (text, place, part) in [
        ("global x i33", (1, 10), "no storage"),
        ("function main\n  add\nend", (2, 3), "unknown instruction"),
        ("function main\n  slot.load g y\nend", (2, 15), "no global slot `y`"),
        ("function main\n  jump nowhere\nend", (2, 8), "no label"),
        ("function main\n return", (1, 1), "no `end`"),
        ("function main\n  return 1\nend", (2, 10), "too many"),
        ("global x i32\nglobal x i32", (2, 8), "second time"),
        ("type s struct nothing", (1, 15), "no type"),
        ("data x 7", (1, 8), "declared above"),
        ("nonsense", (1, 1), "unknown line"),
        ("debug\n file \"a", (2, 7), "closing quote"),
        ("max_stack 70000", (1, 11), "can not be"),
        ("init d 16 u8 300", (1, 14), "does not fit"),
        ("function main\n  switch\nend", (2, 3), "missing"),
    ] {
        let error = assemble(text).unwrap_err();
        assert_eq!((error.line, error.column), place, "{text}: {error}");
        assert!(error.message.contains(part), "{text}: {error}");
    }
}

#[test]
fn hostile_text_does_not_panic() {
    let words = [
        "function",
        "main",
        "end",
        "type",
        "struct",
        "block",
        "1:1",
        "for",
        "0x",
        "-",
        "99999999999999999999",
        "\"",
        "#5",
        "@9",
        "..",
        "a",
        "debug",
        "task",
        "array",
        "0..-1",
        "-2147483648..2147483647",
        "instance",
        "data",
        "at",
        "4294967295",
        "jump",
        "exact",
        ":",
        "0",
    ];
    let mut state = 1_u64;
    for _ in 0..3000 {
        let mut text = String::new();
        for _ in 0..24 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let pick = (state >> 33) as usize;
            text.push_str(words[pick % words.len()]);
            text.push(if pick.is_multiple_of(3) { '\n' } else { ' ' });
        }
        let _ = assemble(&text);
    }
}

#[test]
fn the_example_of_the_docs_verifies() {
    if let Err(error) = crate::verify::verify(assemble(EXAMPLE).unwrap()) {
        panic!("{error}");
    }
}

#[test]
fn switch_targets_raw_offsets_and_raw_bytes_round_trip() {
    let text = "function main\n const.i32 1\n switch a b a\na:\n jump @3\nb:\n return\n bytes ffff01\nend";
    let c = assemble(text).unwrap();
    let listing = disassemble(&c);
    // const.i32 6, switch 2 + 4 + 3 * 4, jump 6.
    assert!(listing.contains("switch L24 L30 L24\nL24:\n  jump @3\nL30:\n  return\n  bytes ffff01\nend"), "{listing}");
    assert_eq!(assemble(&listing).unwrap(), c);
}

#[test]
fn types_that_share_parts_do_not_take_forever() {
    let mut text = String::from("type t0 scalar i32\n");
    for level in 1..60 {
        text.push_str(&format!("type t{level} struct size 8 align 4 0:t{0} 0:t{0}\n", level - 1));
    }
    text.push_str("type self struct size 8 align 4 0:self 0:self\ndata x t59\ndata y self\n");
    assert_eq!(assemble(&text).unwrap().types.block_instances, []);
}

#[test]
fn comments_name_the_source_places() {
    let text = "function main\n nop\n return\nend\ndebug\n file \"a.st\"\n line main 2 0 7 3\n function \"Main\"\nend";
    let c = assemble(text).unwrap();
    let listing = crate::disassembler::disassemble_function(&c, crate::ids::FunctionId(0)).unwrap();
    assert_eq!(listing, "function f0 program 0 ; Main\n  nop\n  return  ; a.st:7:3\nend\n");
}
