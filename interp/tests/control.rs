//! Control flow: FOR loops at the ends of their types, jumps, switch, fuel and deadlines.

mod common;

use common::{cause, load, slots, trap};
use khz_bytecode::ids::FunctionId;
use khz_bytecode::value::{IntegerType, ValueType};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Limits};
use khz_machine::trap::{CodePlace, TrapCode};

/// A FOR loop that counts its passes in slot `passes` and leaves its control variable's last value in `last`.
fn for_loop(kind: IntegerType, place: &str, from: i64, to: i64, by: i64) -> String {
    let storage = kind.storage();
    let (constant, value) = match kind.value_type() {
        ValueType::I64 => ("const i64", "i64"),
        _ => ("const.i32", "i32"),
    };
    let (variable, local, data) = match place {
        "l" => ("l i", format!("local i {storage}"), String::new()),
        "g" => ("g i", String::new(), format!("global i {storage}")),
        "p" => ("p i", String::new(), format!("program prog\nslot i {storage}")),
        _ => ("d i", String::new(), format!("type k scalar {storage}\ndata i k")),
    };
    let load = if place == "d" { format!("load d {storage} i") } else { format!("slot.load {variable}") };
    format!(
        "global passes i32\nglobal last {value}\n{data}\nfunction main{}\n{local}\nfor each {variable} {kind}
        {constant} {from}\n{constant} {to}\n{constant} {by}\nfor.enter each done\npass:
        slot.load g passes\nconst.i32 1\ni32.add\nslot.store g passes\nfor.next each pass\ndone:
        {load}\nslot.store g last\nreturn\nend\n",
        if place == "p" { " program prog" } else { "" }
    )
}

#[test]
fn for_loops_end_at_the_limits_of_their_types_wherever_the_control_variable_is() {
    use IntegerType::{I8, I16, I32, I64, U8, U16, U32, U64};
    // (type, from, to, by, passes, control behind the loop)
    let cases: &[(IntegerType, i64, i64, i64, u64, i64)] = &[
        (I32, 0, 9, 1, 10, 10),
        (I32, 9, 0, -1, 10, -1),
        (I32, 5, 4, 1, 0, 5),
        (I32, 4, 5, -1, 0, 4),
        (I32, 0, 10, 3, 4, 12),
        (I32, i64::from(i32::MAX) - 2, i64::from(i32::MAX), 1, 3, i64::from(i32::MIN)),
        (I32, i64::from(i32::MIN) + 2, i64::from(i32::MIN), -2, 2, i64::from(i32::MAX) - 1),
        (I32, i64::from(i32::MIN), i64::from(i32::MAX), i64::from(i32::MAX), 3, -3),
        (I16, 32766, 32767, 1, 2, -32768),
        (I16, -32767, -32768, -1, 2, 32767),
        (I8, 126, 127, 1, 2, -128),
        (U8, 253, 255, 1, 3, 0),
        (U8, 2, 0, -1, 3, 255),
        (U16, 65534, 65535, 1, 2, 0),
        (U32, -2, -1, 1, 2, 0),
        (U32, 1, -1, i64::from(i32::MAX), 3, i64::from(2_147_483_647_u32.wrapping_mul(3).wrapping_add(1) as i32)),
        (I64, i64::MAX - 1, i64::MAX, 1, 2, i64::MIN),
        (I64, i64::MIN, i64::MAX, i64::MAX, 3, -3),
        (U64, -3, -1, 2, 2, 1),
        (U64, 1, 0, -1, 2, -1),
    ];
    for (kind, from, to, by, passes, last) in cases {
        for place in ["l", "g", "p", "d"] {
            let found = slots(&for_loop(*kind, place, *from, *to, *by), 2);
            let last = if kind.value_type() == ValueType::I64 { *last as u64 } else { u64::from(*last as u32) };
            assert_eq!(found, [*passes, last], "{kind} {from} to {to} by {by} in {place}");
        }
    }
}

#[test]
fn a_step_of_zero_traps_before_anything_is_written() {
    for place in ["l", "g", "p", "d"] {
        let text = for_loop(IntegerType::I16, place, 7, 9, 0);
        let mut loaded = load(&text, false);
        let trap = loaded.run().unwrap_err();
        assert_eq!(cause(&trap), (TrapCode::Range, [0, 0, 0]));
        // Behind three `const.i32` of 6 bytes each.
        assert_eq!(trap.place, CodePlace { function: FunctionId(0), offset: 18 });
        assert!(loaded.data(16, 2) == [0, 0] || place != "d");
    }
}

#[test]
fn a_body_that_writes_its_control_variable_goes_on_from_there() {
    let text = "global passes i32\nfunction main\nlocal i i16\nfor each l i i16
        const.i32 0\nconst.i32 9\nconst.i32 1\nfor.enter each done\npass:
        slot.load g passes\nconst.i32 1\ni32.add\nslot.store g passes
        slot.load l i\nconst.i32 2\ni32.add\nslot.store l i\nfor.next each pass\ndone:\nreturn\nend\n";
    assert_eq!(slots(text, 1), [4]);
}

#[test]
fn a_switch_takes_its_default_for_everything_else() {
    for (value, expected) in [(0, 10), (1, 20), (2, 30), (3, 30), (-1, 30), (i32::MIN, 30)] {
        let text = format!(
            "global x i32\nfunction main\nlocal k i32\nconst.i32 {value}\nslot.store l k\nslot.load l k
            switch a b c\na:\nconst.i32 10\nslot.store g x\njump end_\nb:\nconst.i32 20\nslot.store g x\njump end_
            c:\nconst.i32 30\nslot.store g x\nend_:\nreturn\nend\n"
        );
        assert_eq!(slots(&text, 1), [expected], "{value}");
    }
}

#[test]
fn stack_entries_survive_branches_and_later_writes_of_their_source() {
    // x stands on the stack as it was before the write, across a branch that meets with another value.
    let text = "global x i32\nglobal y i32\nfunction main\nlocal a i32\nlocal b i32
        const.i32 5\nslot.store l a\nslot.load l a\nslot.load l a\nconst.i32 7\nslot.store l a\ni32.add\nslot.store g x
        slot.load l a\nconst.i32 1\nslot.load l a\nconst.i32 7\ni32.eq\njump.if other\ndrop\nconst.i32 100\nother:
        i32.add\nslot.store g y\nreturn\nend\n";
    assert_eq!(slots(text, 2), [10, 8]);
}

#[test]
fn select_and_dup_take_what_stands_there() {
    for (condition, expected) in [(0, 20), (1, 10), (256, 10)] {
        let text = format!(
            "global x i32\nglobal y i32\nfunction main\nlocal c i32\nconst.i32 {condition}\nslot.store l c
            const.i32 10\nconst.i32 20\nslot.load l c\nselect\ndup\nslot.store g x\ndup\ni32.add\nslot.store g y\nreturn\nend\n"
        );
        assert_eq!(slots(&text, 2), [expected, 2 * expected], "{condition}");
    }
}

const LOOP: &str = "global passes i32\nfunction main\nlocal i i32\nagain:
    slot.load g passes\nconst.i32 1\ni32.add\nslot.store g passes
    slot.load l i\nconst.i32 1\ni32.add\nslot.store l i\nslot.load l i\nconst.i32 5\ni32.lt_s\njump.if again\nreturn\nend\n";

#[test]
fn fuel_is_charged_at_entries_and_headers_and_runs_out_there() {
    let mut loaded = load(LOOP, true);
    let facts = loaded.verified.function(FunctionId(0)).clone();
    let (entry, pass) = (u64::from(facts.entry_fuel), u64::from(facts.loops[0].fuel));
    let whole = entry + 5 * pass;
    assert!(pass > 0 && entry > 0);
    let (result, left) = loaded.run_with_fuel(whole + 3);
    assert_eq!((result.is_ok(), left, loaded.slot(0)), (true, 3, 5));
    let (result, left) = loaded.run_with_fuel(whole - 1);
    let trap = result.unwrap_err();
    assert_eq!((cause(&trap), left), ((TrapCode::Watchdog, [0; 3]), 0));
    assert_eq!(trap.place, CodePlace { function: FunctionId(0), offset: 0 });
    assert_eq!(loaded.slot(0), 9, "four passes more, and none of the fifth");
    let (result, left) = loaded.run_with_fuel(entry - 1);
    assert_eq!((result.unwrap_err().code, left, loaded.slot(0)), (TrapCode::Watchdog, 0, 9));
    assert!(loaded.run().is_ok(), "without a limit nothing is charged");
    assert_eq!(loaded.slot(0), 14);
    let mut plain = load(LOOP, false);
    let (result, left) = plain.run_with_fuel(1);
    assert_eq!((result.is_ok(), left), (true, 1), "code without fuel charges none");
}

#[test]
fn fuel_of_loops_is_the_same_for_every_kind_of_back_edge() {
    let for_loop = for_loop(IntegerType::I32, "l", 0, 6, 1);
    let while_loop = "global x i32\nfunction main\nagain:\nslot.load g x\nconst.i32 4\ni32.ge_s\njump.if done
        slot.load g x\nconst.i32 1\ni32.add\nslot.store g x\njump again\ndone:\nreturn\nend\n";
    for (text, arrivals) in [(for_loop.as_str(), 7), (while_loop, 5)] {
        let mut loaded = load(text, true);
        let facts = loaded.verified.function(FunctionId(0)).clone();
        let whole = u64::from(facts.entry_fuel) + arrivals * u64::from(facts.loops[0].fuel);
        let (result, left) = loaded.run_with_fuel(whole);
        assert_eq!((result.is_ok(), left), (true, 0));
        let header = facts.instructions[facts.blocks[facts.loops[0].header.index()].start].offset;
        let mut loaded = load(text, true);
        let (result, _) = loaded.run_with_fuel(whole - 1);
        assert_eq!(result.unwrap_err().place, CodePlace { function: FunctionId(0), offset: header });
    }
}

#[test]
fn an_expired_deadline_ends_endless_loops_of_every_kind() {
    let kinds = [
        "nop\nagain:\nslot.load g x\nconst.i32 1\ni32.add\nslot.store g x\njump again\nend\n".to_string(),
        "nop\nagain:\nslot.load g x\nconst.i32 1\ni32.add\nslot.store g x\nconst.i32 1\njump.if again\nreturn\nend\n"
            .into(),
        "local i i32\nfor each l i i32\nconst.i32 0\nconst.i32 9\nconst.i32 1\nfor.enter each done\nagain:\nconst.i32 0
        slot.store l i\nfor.next each again\ndone:\nreturn\nend\n"
            .into(),
    ];
    for body in kinds {
        let text = format!("global x i32\nfunction main\n{body}");
        let mut loaded = load(&text, false);
        let facts = loaded.verified.function(FunctionId(0)).clone();
        let header = facts.instructions[facts.blocks[facts.loops[0].header.index()].start].offset;
        let deadline = DeadlineCell::new();
        let other = deadline.clone();
        let monitor = std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_millis(20));
            other.expire(TrapCode::Stopped);
        });
        let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
        let trap = loaded.engine.run(Entry::Instance(0), &mut loaded.image, limits).unwrap_err();
        monitor.join().unwrap();
        assert_eq!(cause(&trap), (TrapCode::Stopped, [0; 3]));
        assert_eq!(trap.place, CodePlace { function: FunctionId(0), offset: header });
        // Still expired: the next run ends at its entry.
        let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
        let trap = loaded.engine.run(Entry::Instance(0), &mut loaded.image, limits).unwrap_err();
        assert_eq!(trap.place, CodePlace { function: FunctionId(0), offset: 0 });
    }
}

#[test]
fn range_checks_report_value_and_bounds_in_the_order_of_their_type() {
    let check =
        |push: &str, check: &str| trap(&format!("global x i32\nfunction main\n{push}\n{check}\ndrop\nreturn\nend\n"));
    let found = check("const.i32 11", "check.i32 i16 -10 10");
    assert_eq!(cause(&found), (TrapCode::Range, [11, -10, 10]));
    assert_eq!(found.place.offset, 6);
    assert_eq!(cause(&check("const.i32 -1", "check.i32 u32 0 10")), (TrapCode::Range, [0xFFFF_FFFF, 0, 10]));
    assert_eq!(cause(&check("const i64 -1", "check.i64 u64 0 10")), (TrapCode::Range, [-1, 0, 10]));
    assert_eq!(cause(&check("const i64 -11", "check.i64 i64 -10 10")), (TrapCode::Range, [-11, -10, 10]));
    let text = "global x i32\nfunction main\nconst.i32 -10\ncheck.i32 i32 -10 10\nslot.store g x\nreturn\nend\n";
    assert_eq!(slots(text, 1), [u64::from(-10_i32 as u32)]);
}
