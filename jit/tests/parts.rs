//! Long functions are cut into parts: what is cut, and that nothing else changes.

mod common;

use std::fmt::Write;

use common::{load_with, verified};
use khz_bytecode::ids::FunctionId;
use khz_jit::{JitOptions, mir_text};
use khz_machine::image::ImageLayout;

fn options(part_items: usize) -> JitOptions {
    JitOptions { part_items, ..JitOptions::default() }
}

/// The mid-level form of function 0.
fn form(text: &str, part_items: usize) -> String {
    let verified = verified(text);
    let layout = ImageLayout::new(verified.container(), 1 << 24).unwrap();
    mir_text(&verified, &layout, options(part_items), FunctionId(0))
}

/// Sizes of the listed parts, in lines, and of what calls them.
fn lines(form: &str) -> Vec<usize> {
    let mut sizes = Vec::new();
    for line in form.lines() {
        if line.starts_with("; part") || line.starts_with("; what") {
            sizes.push(0);
        } else if let Some(size) = sizes.last_mut() {
            *size += 1;
        }
    }
    sizes
}

/// `count` statements that add to a local and to a global, one of which in an IF.
fn statements(count: usize) -> String {
    let mut text = String::new();
    for k in 0..count {
        let _ = write!(text, "slot.load l n\nconst.i32 {k}\ni32.add\nslot.store l n\n");
        let _ = write!(text, "slot.load g a\nconst.i32 {}\ni32.and\njump.unless over{k}\n", k % 8);
        let _ = write!(text, "slot.load g b\nslot.load l n\ni32.add\nslot.store g b\nover{k}:\n");
        let _ = write!(text, "slot.load g a\nconst.i32 1\ni32.add\nslot.store g a\n");
    }
    text
}

fn program(body: &str) -> String {
    format!(
        "global a i32\nglobal b i32\nglobal c i32\nfunction main\nlocal n i32\n{body}slot.load l n\nslot.store g c\nreturn\nend\n"
    )
}

/// The slots after two runs.
fn outcome(text: &str, part_items: usize) -> Vec<u64> {
    let mut loaded = load_with(text, options(part_items));
    for _ in 0..2 {
        loaded.run().unwrap();
    }
    (0..3).map(|index| loaded.slot(index)).collect()
}

#[test]
fn straight_code_becomes_parts_of_bounded_size() {
    let text = program(&statements(100));
    assert_eq!(lines(&form(&text, 1 << 20)), Vec::<usize>::new());
    let cut = lines(&form(&text, 100));
    assert!(cut.len() > 10 && cut.iter().all(|size| *size < 200), "{cut:?}");
    // A local is handed in and out.
    assert!(form(&text, 100).contains("= part 3(v"), "{}", form(&text, 100));
    assert_eq!(outcome(&text, 100), outcome(&text, 1 << 20));
}

#[test]
fn a_loop_and_the_arm_of_an_if_are_cut_inside() {
    let text = program(&format!(
        "const.i32 3\nslot.store l n\ntop:\n{}slot.load g a\nconst.i32 1\ni32.and\njump.if odd\n{}odd:\nslot.load g a\n\
         const.i32 1000\ni32.lt_s\njump.if top\n",
        statements(30),
        statements(30).replace("over", "under")
    ));
    let cut = form(&text, 100);
    assert!(lines(&cut).len() > 4 && lines(&cut).iter().all(|size| *size < 250), "{cut}");
    assert_eq!(outcome(&text, 100), outcome(&text, 1 << 20));
}

#[test]
fn what_a_turn_of_a_loop_leaves_for_the_next_one_survives_the_part_between() {
    // Nobody but the part reads or assigns `m`; of one in an arm only some turns assign it.
    let turn =
        "slot.load l m\nconst.i32 3\ni32.add\nslot.store l m\nslot.load g b\nslot.load l m\ni32.add\nslot.store g b\n";
    let some = format!("slot.load g a\nconst.i32 1\ni32.and\njump.if even\n{turn}even:\n");
    for counting in [turn, &some] {
        let text = program(&format!(
            "top:\n{counting}{}slot.load g a\nconst.i32 200\ni32.lt_s\njump.if top\n",
            statements(12).replace("g b", "g c")
        ));
        let text = text
            .replace("local n i32\n", "local n i32\nlocal m i32\n")
            .replace("slot.store g c\nreturn", "drop\nreturn");
        for items in [4, 12, 30] {
            assert!(form(&text, items).contains("part "), "{}", form(&text, items));
            assert_eq!(outcome(&text, items), outcome(&text, 1 << 20), "{items}");
        }
    }
}

#[test]
fn what_ends_a_function_early_is_not_cut_but_what_lies_around_it() {
    let early = "slot.load g b\nconst.i32 100\ni32.lt_s\njump.if on\nreturn\non:\n";
    let text = program(&format!("{}{early}{}", statements(20), statements(20).replace("over", "under")));
    assert!(lines(&form(&text, 50)).len() > 4);
    assert_eq!(outcome(&text, 50), outcome(&text, 1 << 20));
}

#[test]
fn a_trap_in_a_part_names_the_same_place_and_calls() {
    let body = statements(20) + "const.i32 1\nslot.load g a\nconst.i32 40\ni32.rem_s\ni32.div_s\nslot.store g a\n";
    let callee = program(&(statements(20).replace("over", "under") + &body));
    let text = callee.replace("function main", "function main\ncall f\nreturn\nend\nfunction f");
    let trap = |part_items| {
        let mut loaded = load_with(&text, options(part_items));
        (0..2).find_map(|_| loaded.run().err()).expect("it divides by zero")
    };
    let (whole, cut) = (trap(1 << 20), trap(30));
    assert_eq!(format!("{whole:?}"), format!("{cut:?}"));
    assert_eq!(cut.code, khz_bytecode::trap::TrapCode::DivideByZero);
}

#[test]
fn code_that_instances_share_is_cut_too() {
    let instances: String = (0..6).map(|n| format!("instance i{n}\n")).collect();
    let main =
        program(&statements(40)).replace("global a i32\n", "").replace("function main", "function main program p_");
    let text = main.replace("global c i32\n", &format!("global c i32\nprogram p_\nslot a i32\n{instances}"));
    let text = text.replace(" g a\n", " p a\n");
    assert!(form(&text, 60).contains("part 2(") && lines(&form(&text, 60)).len() > 4, "{}", form(&text, 60));
    assert_eq!(outcome(&text, 60), outcome(&text, 1 << 20));
}

#[test]
fn what_only_one_turn_assigns_in_a_part_is_still_there_after_the_loop() {
    let turn = "slot.load g a\nconst.i32 6\ni32.eq\njump.unless later\nslot.load g a\nslot.store l m\nlater:\n";
    let text = program(&format!(
        "const.i32 0\nslot.store g a\ntop:\n{}{turn}{}slot.load g a\nconst.i32 200\ni32.lt_s\njump.if top\nslot.load l m\nslot.store g b\n",
        statements(6),
        statements(6).replace("over", "under")
    ));
    let text = text.replace("local n i32\n", "local n i32\nlocal m i32\n");
    assert_eq!(outcome(&text, 1 << 20)[1], 6);
    for items in [4, 12, 30] {
        assert_eq!(outcome(&text, items), outcome(&text, 1 << 20), "{items}");
    }
}
