//! Every numeric row over edge values, in every operand shape, against its meaning in `khz_machine::semantics`.

mod common;
#[path = "../../machine/tests/common/edges.rs"]
mod edges;

use std::fmt::Write;

use common::load;
use edges::edges;
use khz_bytecode::instruction::NumericOp;
use khz_machine::engine::Engine;
use khz_machine::semantics::{Value, eval_numeric};

fn push_constant(text: &mut String, value: Value) {
    let _ = match value {
        Value::I32(value) => writeln!(text, "const.i32 {value}"),
        Value::I64(value) => writeln!(text, "const i64 {value}"),
        Value::F32(value) => writeln!(text, "const f32 0x{:x}", value.to_bits()),
        Value::F64(value) => writeln!(text, "const f64 0x{:x}", value.to_bits()),
    };
}

/// All combinations of edge values for a row.
fn operand_lists(op: NumericOp) -> Vec<Vec<Value>> {
    op.operands().iter().fold(vec![Vec::new()], |lists, ty| {
        let longer = |list: &Vec<Value>| {
            edges(*ty).into_iter().map(|value| list.iter().copied().chain([value]).collect()).collect::<Vec<_>>()
        };
        lists.iter().flat_map(longer).collect()
    })
}

/// Code that pushes the operands: those whose bit in `shape` is set come out of an `L` slot, the others are constants.
fn push_operands(text: &mut String, operands: &[Value], shape: u32) {
    for (index, value) in operands.iter().enumerate() {
        if shape >> index & 1 == 1 {
            push_constant(text, *value);
            let _ = writeln!(text, "slot.store l {index}");
        }
    }
    for (index, value) in operands.iter().enumerate() {
        if shape >> index & 1 == 1 {
            let _ = writeln!(text, "slot.load l {index}");
        } else {
            push_constant(text, *value);
        }
    }
}

fn program(op: NumericOp, results: usize, body: &str) -> String {
    let mut text = String::new();
    for index in 0..results {
        let _ = writeln!(text, "global r{index} {}", op.result());
    }
    text.push_str("function main\n");
    for (index, ty) in op.operands().iter().enumerate() {
        let _ = writeln!(text, "local a{index} {ty}");
    }
    text.push_str(body);
    text.push_str("return\nend\n");
    text
}

#[test]
fn every_row_gives_what_it_means() {
    for op in NumericOp::ALL {
        let lists = operand_lists(*op);
        let (total, trapping): (Vec<_>, Vec<_>) = lists.into_iter().partition(|list| eval_numeric(*op, list).is_ok());
        for shape in 0..1 << op.operands().len() {
            let mut body = String::new();
            for (index, list) in total.iter().enumerate() {
                push_operands(&mut body, list, shape);
                let _ = writeln!(body, "{}\nslot.store g r{index}", op.mnemonic());
            }
            let results = common::slots(&program(*op, total.len(), &body), total.len());
            for (list, result) in total.iter().zip(results) {
                let expected = eval_numeric(*op, list).unwrap();
                assert_eq!(result, expected.bits(), "{op:?} {list:?} shape {shape}: {expected:?}");
            }
            for list in trapping.iter().take(4) {
                let mut body = String::new();
                push_operands(&mut body, list, shape);
                let _ = writeln!(body, "{}\nslot.store g r0", op.mnemonic());
                let trap = common::trap(&program(*op, 1, &body));
                assert_eq!(Some(trap.code), op.trap(), "{op:?} {list:?}");
            }
        }
    }
}

#[test]
fn every_comparison_branches_as_it_means() {
    let relations = ["eq", "ne", "lt", "le", "gt", "ge"];
    let is_comparison = |op: &&NumericOp| {
        let (_, name) = op.mnemonic().split_once('.').unwrap();
        relations.iter().any(|relation| name.split('_').next() == Some(relation)) || name == "eqz" || name == "nez"
    };
    for op in NumericOp::ALL.iter().filter(is_comparison) {
        let lists = operand_lists(*op);
        for (jump, when) in [("jump.if", true), ("jump.unless", false)] {
            for shape in 0..1 << op.operands().len() {
                let mut body = String::new();
                for (index, list) in lists.iter().enumerate() {
                    push_operands(&mut body, list, shape);
                    let _ = writeln!(body, "{}\n{jump} skip{index}", op.mnemonic());
                    let _ = writeln!(body, "const.i32 1\nslot.store g r{index}\nskip{index}:");
                }
                let text = program(*op, lists.len(), &body);
                let results = common::slots(&text, lists.len());
                for (list, result) in lists.iter().zip(results) {
                    let holds = eval_numeric(*op, list).unwrap().bits() != 0;
                    assert_eq!(result, u64::from(holds != when), "{op:?} {jump} {list:?} shape {shape}");
                }
            }
        }
    }
}

#[test]
fn an_interpreter_says_how_large_its_code_is() {
    let small = load("function main\nreturn\nend\n", false).engine.code_bytes();
    let large =
        load("global x i32\nfunction main\nslot.load g x\nconst.i32 1\ni32.add\nslot.store g x\nreturn\nend\n", false);
    assert!(small > 0 && large.engine.code_bytes() > small);
}
