//! Slots that live in registers while a function runs, and operations that do several instructions' work: nobody may see either.

mod common;

use common::{cause, load, slots};
use khz_machine::trap::TrapCode;

/// Enough uses of a slot that it lives in a register; its value stays.
fn use_often(slot: &str) -> String {
    format!("slot.load {slot}\nslot.store {slot}\nslot.load {slot}\nslot.store {slot}\n")
}

#[test]
fn a_trap_puts_back_what_every_open_call_held() {
    let text = format!(
        "global x i32\nglobal y i16\nglobal n i32\nfunction main\n{}const.i32 2\nslot.store g x\ncall f\nconst.i32 3\nslot.store g x\nreturn\nend
        function f\n{}const.i32 -4\nslot.store g y\nconst.i32 1\nslot.load g n\ni32.div_s\nslot.store g n\nconst.i32 5\nslot.store g y\nreturn\nend\n",
        use_often("g x"),
        use_often("g y"),
    );
    let mut loaded = load(&text, false);
    assert!(loaded.engine.listing().matches("BringSlots").count() == 2, "both functions hold a slot");
    assert_eq!(cause(&loaded.run().unwrap_err()).0, TrapCode::DivideByZero);
    assert_eq!((loaded.slot(0), loaded.slot(1)), (2, 0xFFFC), "as they were at the division; above an INT stays 0");
}

#[test]
fn a_slot_that_a_callee_touches_is_not_held_by_its_caller() {
    let text = format!(
        "global x i32\nglobal y i32\nfunction main\n{}const.i32 2\nslot.store g x\ncall f\nslot.load g x\nslot.store g y\nreturn\nend
        function f\nslot.load g x\nconst.i32 10\ni32.mul\nslot.store g x\nreturn\nend\n",
        use_often("g x"),
    );
    assert_eq!(slots(&text, 2), [20, 20]);
}

#[test]
fn a_run_that_ends_before_its_slots_are_brought_leaves_them_alone() {
    let text = format!("global x i32\nfunction main\n{}return\nend\n", use_often("g x"));
    let mut loaded = load(&text, true);
    loaded.run().unwrap();
    let at = loaded.image.layout().slots.start as usize;
    loaded.image.bytes_mut()[at] = 77;
    let (result, _) = loaded.run_with_fuel(0);
    assert_eq!(cause(&result.unwrap_err()).0, TrapCode::Watchdog);
    assert_eq!(loaded.slot(0), 77);
}

#[test]
fn copies_on_the_stack_outlive_fused_operations() {
    // NOT x, twice; a product beside the sum that it is part of, as first and as second operand.
    let text = "global a i32\nglobal b i32\nglobal c i32\nfunction main\nlocal x b1\nlocal s f64\nlocal t f64
        slot.load l x\ni32.eqz\ndup\ni32.and\nslot.store g a
        const.i32 3\nf64.convert_i32_s\nslot.store l s
        slot.load l s\nslot.load l s\nf64.mul\ndup\nslot.load l s\nf64.add\nslot.store l t\nslot.load l t\nf64.add\nf64.round_i32\nslot.store g b
        slot.load l s\nslot.load l s\nf64.mul\ndup\nslot.load l s\nf64.add\nslot.store l s\nslot.load l s\nf64.add\nf64.round_i32\nslot.store g c
        return\nend\n";
    assert_eq!(slots(text, 3), [1, 9 + 12, 9 + 12]);
}

/// A field of 3 × 20,001 numbers: rows are further apart than 16 bits count. `body` has i = 1 and j = 3.
fn field(body: &str) -> String {
    format!(
        "type k scalar i32\narray m k 0..2 0..20000\nglobal x i32\ndata dm m\nfunction main\nlocal i i32\nlocal j i32
        const.i32 1\nslot.store l i\nconst.i32 3\nslot.store l j\n{body}\nreturn\nend\n"
    )
}

#[test]
fn rows_may_be_far_apart_and_indexes_may_have_constant_parts() {
    let next = "slot.load l i\nconst.i32 1\ni32.add";
    for (row, column) in [(next, "slot.load l j"), (next, "const.i32 3"), ("const.i32 2", "slot.load l j")] {
        let element = format!("address d dm m\n{row}\n{column}\nref.index m\n");
        let text = field(&format!("{element}const.i32 8\nref.store i32\n{element}ref.load i32\nslot.store g x"));
        let mut loaded = load(&text, false);
        loaded.run().unwrap();
        assert_eq!(loaded.slot(0), 8);
        assert_eq!(loaded.data(16 + (2 * 20_001 + 3) * 4, 4), 8_i32.to_le_bytes(), "{row} {column}");
    }
}

#[test]
fn an_index_with_a_constant_part_wraps_before_it_is_checked() {
    let element =
        |row: &str, column: &str| format!("address d dm m\n{row}\n{column}\nref.index m\nref.load i32\nslot.store g x");
    let cases = [
        ("slot.load l i\nconst.i32 2\ni32.add", "slot.load l j", [3, 0, 2]),
        ("const.i32 1", "slot.load l j\nconst.i32 4\ni32.sub", [-1, 0, 20_000]),
        (
            "slot.load l i",
            "const.i32 -2147483648\nslot.store l j\nslot.load l j\nconst.i32 1\ni32.sub",
            [i64::from(i32::MAX), 0, 20_000],
        ),
    ];
    for (row, column, values) in cases {
        let found = load(&field(&element(row, column)), false).run().unwrap_err();
        assert_eq!(cause(&found), (TrapCode::ArrayIndex, values), "{row} {column}");
    }
}
