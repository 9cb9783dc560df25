//! Single operations from the instruction table, over edge values, against their meaning in `khz_machine::semantics`.

mod common;
#[path = "../../machine/tests/common/edges.rs"]
mod edges;

use std::fmt::Write;

use common::{load, load_with, slots};
use edges::edges;
use khz_bytecode::instruction::{HelperOp, HelperOperand, NumericOp};
use khz_bytecode::value::{Storage, ValueType};
use khz_jit::{JitOptions, Passes};
use khz_machine::semantics::{StringPlace, Value, eval_helper, eval_numeric};

fn constant(value: Value) -> String {
    match value {
        Value::I32(value) => format!("const.i32 {value}\n"),
        Value::I64(value) => format!("const i64 {value}\n"),
        Value::F32(value) => format!("const f32 0x{:x}\n", value.to_bits()),
        Value::F64(value) => format!("const f64 0x{:x}\n", value.to_bits()),
    }
}

fn combinations(types: &[ValueType]) -> Vec<Vec<Value>> {
    types.iter().fold(vec![Vec::new()], |lists, ty| {
        let longer = |list: &Vec<Value>| -> Vec<Vec<Value>> {
            edges(*ty).into_iter().map(|value| list.iter().copied().chain([value]).collect()).collect()
        };
        lists.iter().flat_map(longer).collect()
    })
}

/// A function of the operation: the operands come as parameters (nothing can be folded), or the last one is a constant.
fn one_operation(op: NumericOp, total: &[Vec<Value>], last_is_constant: bool) -> String {
    let mut text = String::new();
    for index in 0..total.len() {
        let _ = writeln!(text, "global r{index} {}", op.result());
    }
    text.push_str("function main\n");
    let mut bodies = String::new();
    for (index, list) in total.iter().enumerate() {
        let given = list.len() - usize::from(last_is_constant);
        list[..given].iter().for_each(|value| text.push_str(&constant(*value)));
        let callee = if last_is_constant { format!("f{index}") } else { "f".into() };
        let _ = writeln!(text, "call {callee}\nslot.store g r{index}");
        if last_is_constant || index == 0 {
            let _ = writeln!(bodies, "function {callee}");
            for (number, ty) in op.operands().iter().enumerate().take(given) {
                let _ = writeln!(bodies, "param a{number} {ty}");
            }
            let _ = writeln!(bodies, "result {}", op.result());
            (0..given).for_each(|number| bodies.push_str(&format!("slot.load l a{number}\n")));
            list[given..].iter().for_each(|value| bodies.push_str(&constant(*value)));
            let _ = writeln!(bodies, "{}\nreturn\nend", op.mnemonic());
        }
    }
    format!("{text}return\nend\n{bodies}")
}

#[test]
fn every_numeric_row_gives_what_it_means() {
    for op in NumericOp::ALL {
        let lists = combinations(op.operands());
        let (total, trapping): (Vec<_>, Vec<_>) = lists.into_iter().partition(|list| eval_numeric(*op, list).is_ok());
        // Results of all combinations fit the shared slots; constants make a function each, so there a part is enough.
        for last_is_constant in [false, true] {
            let step = if last_is_constant { 3 } else { 1 };
            let lists: Vec<_> = total.iter().step_by(step).cloned().collect();
            let results = slots(&one_operation(*op, &lists, last_is_constant), lists.len());
            for (list, result) in lists.iter().zip(results) {
                let expected = eval_numeric(*op, list).unwrap();
                assert_eq!(result, expected.bits(), "{} {list:?} {last_is_constant}", op.mnemonic());
            }
        }
        for list in trapping.iter().step_by(5) {
            let trap = load(&one_operation(*op, std::slice::from_ref(list), false), false).run().unwrap_err();
            assert_eq!(Some(trap.code), op.trap(), "{} {list:?}", op.mnemonic());
        }
    }
}

#[test]
fn stores_wrap_and_loads_extend_in_every_place() {
    for storage in Storage::ALL {
        for value in edges(storage.value_type()) {
            let ty = storage.value_type();
            let mut expected = [0; 8];
            khz_machine::semantics::store_scalar(&mut expected, *storage, value);
            let loaded = khz_machine::semantics::load_scalar(&expected, *storage);
            let push = constant(value);
            let text = format!(
                "type t scalar {storage}\ntype pair struct t t\ntype fb block pair\nglobal s {storage}\ndata v pair\n
                 data keep fb\nmemory 16\noutputs 16\n
                 global r0 {ty}\nglobal r1 {ty}\nglobal r2 {ty}\nglobal r3 {ty}\nglobal r4 {ty}\nglobal r5 {ty}\nglobal r6 {ty}\n
                 program prog block pair\nslot ps {storage}\n
                 function main program prog\nlocal l {storage}\nframe pair\n
                 {push}slot.store g s\nslot.load g s\nslot.store g r0\n
                 {push}slot.store p ps\nslot.load p ps\nslot.store g r1\n
                 {push}slot.store l l\nslot.load l l\nslot.store g r2\n
                 {push}store d {storage} v+{size}\nload d {storage} v+{size}\nslot.store g r3\n
                 {push}store b {storage} #1\nload b {storage} #1\nslot.store g r4\n
                 {push}store f {storage} #1\nload f {storage} #1\nslot.store g r5\n
                 {push}store m {storage} 3\naddress m 3 t\nref.load {storage}\nslot.store g r6\n
                 return\nend\n",
                size = storage.bytes()
            );
            for passes in [Passes::NONE, Passes::ALL] {
                let mut run = load_with(&text, JitOptions { passes, ..JitOptions::default() });
                run.run().unwrap();
                assert_eq!(run.slot(0).to_le_bytes(), expected, "{storage} {value:?}");
                for result in 1..8 {
                    assert_eq!(run.slot(result), loaded.bits(), "{storage} {value:?} r{}", result - 1);
                }
            }
        }
    }
}

/// Initial value of a wide string: the text and a character that has no narrow form.
fn wide_init(at: u32, text: &str) -> String {
    let units = text.encode_utf16().chain([0x20AC]).take(20);
    let bytes: String = units.flat_map(u16::to_le_bytes).map(|byte| format!("{byte:02x}")).collect();
    format!("init d {at} bytes {bytes}\n")
}

#[test]
fn every_string_row_does_what_it_means() {
    let texts = ["", "motor", "TRUE", "-12.5e1", "T#1m30s", "12345678901234567890"];
    for op in HelperOp::ALL {
        for (round, text) in texts.iter().enumerate() {
            let other = texts[(round + 1) % texts.len()];
            let mut code = String::new();
            let mut values = Vec::new();
            let mut places = Vec::new();
            let mut names = [("b", 40u32), ("c", 80u32)].into_iter();
            for operand in op.operands() {
                match operand {
                    HelperOperand::Dst | HelperOperand::WideDst => {
                        places.push(if operand.is_wide() { 116 } else { 16 });
                        code.push_str(if operand.is_wide() { "address d wa w\n" } else { "address d a s\n" });
                    }
                    HelperOperand::Src => {
                        let (name, at) = names.next().unwrap();
                        places.push(at);
                        let _ = writeln!(code, "address d {name} s");
                    }
                    HelperOperand::WideSrc => {
                        let (name, at) = names.next().unwrap();
                        places.push(if at == 40 { 160 } else { 204 });
                        let _ = writeln!(code, "address d w{name} w");
                    }
                    HelperOperand::Value(ty) => {
                        let value = edges(*ty)[(round + 1) % 6];
                        values.push(value);
                        code.push_str(&constant(value));
                    }
                }
            }
            let capacities = " 20".repeat(op.capacity_count());
            let result = op.result().map_or(String::new(), |ty| format!("global r {ty}\n"));
            let store = if op.result().is_some() { "slot.store g r\n" } else { "" };
            let text = format!(
                "{result}type s string 20\ndata a s at 16\ndata b s at 40\ndata c s at 80\ninit d 16 string \"before\"\n
                 init d 40 string \"{text}\"\ninit d 80 string \"{other}\"\n
                 type w wstring 20\ndata wa w at 116\ndata wb w at 160\ndata wc w at 204\n{}{}function main\n{code}{}{capacities}\n{store}return\nend\n",
                wide_init(160, text),
                wide_init(204, other),
                op.mnemonic()
            );
            let mut run = load(&text, false);
            let start = run.image.layout().data.start;
            let mut expected = run.image.clone();
            let places: Vec<_> = places.iter().map(|at| StringPlace { at: start + at, capacity: 20 }).collect();
            let value = eval_helper(*op, expected.bytes_mut(), &places, &values);
            run.run().unwrap();
            if let Some(value) = value {
                assert_eq!(run.slot(0), value.bits(), "{}", op.mnemonic());
            }
            assert_eq!(run.data(0, 248), &expected.bytes()[start as usize..][..248], "{}", op.mnemonic());
        }
    }
}
