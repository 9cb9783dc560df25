//! Slots, scalars, references, arrays, strings: what is loaded, what is stored, and when it traps.

mod common;

use common::{cause, load, slots, trap};
use khz_machine::trap::TrapCode;

#[test]
fn stores_wrap_and_loads_extend_in_every_place() {
    // (storage, value, value after a store and a load)
    let cases: &[(&str, i32, i32)] = &[
        ("b1", 256, 1),
        ("b1", 0, 0),
        ("b1", -1, 1),
        ("i8", 128, -128),
        ("u8", -1, 255),
        ("i16", 0x1_8000, -0x8000),
        ("u16", -1, 0xFFFF),
        ("i32", i32::MIN, i32::MIN),
    ];
    for (storage, value, expected) in cases {
        let text = format!(
            "outputs 8\nmemory 8\ntype k scalar {storage}\nglobal a i32\nglobal b i32\nglobal c i32\nglobal e i32\nglobal f i32
            global h i32\nglobal j i32\nglobal k i32\nglobal v {storage}\ndata dv k\nprogram prog block blk\ntype blk struct k\nslot s {storage}
            type fr struct k\nfunction main program prog\nlocal l {storage}\nlocal w i32\nframe fr
            const.i32 {value}\nslot.store l w
            slot.load l w\nslot.store l l\nslot.load l l\nslot.store g a
            const.i32 0\nslot.store l l\nslot.load l w\nconst.i32 0\ni32.add\nslot.store l l\nslot.load l l\nslot.store g k
            slot.load l w\nslot.store g v\nslot.load g v\nslot.store g b
            slot.load l w\nslot.store p s\nslot.load p s\nslot.store g c
            slot.load l w\nstore d {storage} dv\nload d {storage} dv\nslot.store g e
            slot.load l w\nstore b {storage} #0\nload b {storage} #0\nslot.store g f
            slot.load l w\nstore f {storage} #0\nload f {storage} #0\nslot.store g h
            slot.load l w\nstore q {storage} 3\nload q {storage} 3\nslot.store g j
            const.i32 {value}\nslot.store l l\nslot.load l l\nstore m {storage} 1\nreturn\nend\n"
        );
        let mut loaded = load(&text, false);
        loaded.run().unwrap();
        for index in 0..8 {
            assert_eq!(loaded.slot(index), u64::from(*expected as u32), "{storage} {value} place {index}");
        }
    }
}

#[test]
fn bits_are_read_and_written_alone() {
    let text = "outputs 2\nglobal x i32\nglobal y i32\nfunction main\nconst.i32 255\nstore q u8 1
        const.i32 0\nstore.bit q 1 3\nconst.i32 64\nstore.bit q 0 7\nload q u8 1\nslot.store g x
        load.bit q 0 7\nload.bit q 1 3\nconst.i32 2\ni32.mul\ni32.add\nslot.store g y\nreturn\nend\n";
    assert_eq!(slots(text, 2), [0xF7, 1]);
}

/// A program with a 1-dimensional array `v` of 3..7, a 2-dimensional `m` of -1..1 × 2..4, and slots x, y.
fn arrays(body: &str) -> String {
    format!(
        "type k scalar i32\ntype pair struct k k\narray v k 3..7\narray m k -1..1 2..4\narray p pair 0..2\nglobal x i32\nglobal y i32
        data dv v\ndata dm m\ndata dp p\nfunction main\nlocal i i32\nlocal j i32\n{body}\nreturn\nend\n"
    )
}

#[test]
fn elements_are_found_with_constant_and_variable_indices() {
    for (i, j) in [(-1, 2), (0, 3), (1, 4), (1, 2)] {
        let at = 16 + 20 + 4 * ((i + 1) * 3 + (j - 2));
        for (first, second) in [
            ("slot.load l i", "slot.load l j"),
            ("const.i32 {i}", "slot.load l j"),
            ("slot.load l i", "const.i32 {j}"),
            ("const.i32 {i}", "const.i32 {j}"),
        ] {
            let first = first.replace("{i}", &i.to_string());
            let second = second.replace("{j}", &j.to_string());
            let element = format!("address d dm m\n{first}\n{second}\nref.index m\n");
            let text = arrays(&format!(
                "const.i32 {i}\nslot.store l i\nconst.i32 {j}\nslot.store l j
                {element}const.i32 77\nref.store i32\n{element}ref.load i32\nslot.store g x"
            ));
            let mut loaded = load(&text, false);
            loaded.run().unwrap();
            assert_eq!(loaded.slot(0), 77);
            assert_eq!(loaded.data(at as usize, 4), 77_i32.to_le_bytes(), "{i} {j}");
        }
    }
}

#[test]
fn an_index_keeps_its_value_although_its_variable_changes_before_the_store() {
    // dv[i] := (i := 6), with i = 4 when the element is chosen; the same with a computed index.
    for index in ["slot.load l i", "slot.load l i\nconst.i32 0\ni32.add"] {
        let text = arrays(&format!(
            "const.i32 4\nslot.store l i\naddress d dv v\n{index}\nref.index v\nconst.i32 6\nslot.store l i\nslot.load l i
            const.i32 1\ni32.add\nref.store i32\nslot.load l i\nslot.store g x"
        ));
        let mut loaded = load(&text, false);
        loaded.run().unwrap();
        assert_eq!(loaded.data(16, 20), [0, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(loaded.slot(0), 6);
    }
}

#[test]
fn fields_of_elements_and_copies_of_them() {
    let text = arrays(
        "const.i32 1\nslot.store l i\naddress d dp p\nslot.load l i\nref.index p\nref.field pair 1\nconst.i32 9\nref.store i32
        address d dp p\nslot.load l i\nconst.i32 1\ni32.add\nref.index p\naddress d dp p\nslot.load l i\nref.index p\ncopy pair
        address d dp p\nconst.i32 2\nref.index p\nref.field pair 1\nref.load i32\nslot.store g x",
    );
    assert_eq!(slots(&text, 1), [9]);
}

#[test]
fn every_index_out_of_bounds_traps_with_its_place_and_bounds() {
    for (i, j, values) in [(2, 2, [2, -1, 1]), (-2, 9, [-2, -1, 1]), (0, 1, [1, 2, 4]), (0, 5, [5, 2, 4])] {
        for constant in [false, true] {
            let (first, second) = if constant {
                (format!("const.i32 {i}"), format!("const.i32 {j}"))
            } else {
                ("slot.load l i".to_string(), "slot.load l j".to_string())
            };
            for rest in ["ref.load i32\nslot.store g x", "const.i32 1\nref.store i32", "drop"] {
                let text = arrays(&format!(
                    "const.i32 {i}\nslot.store l i\nconst.i32 {j}\nslot.store l j\naddress d dm m\n{first}\n{second}\nref.index m\n{rest}"
                ));
                let found = trap(&text);
                assert_eq!(cause(&found), (TrapCode::ArrayIndex, values));
                let loaded = load(&text, false);
                let function = loaded.verified.function(found.place.function);
                let at = function.instructions.iter().find(|placed| placed.offset == found.place.offset).unwrap();
                assert_eq!(at.instruction.mnemonic(), "ref.index");
            }
        }
    }
}

#[test]
fn a_pending_index_check_comes_before_later_traps_and_writes() {
    // The index is wrong, and what follows before the store would trap, or write, itself.
    let later = [
        "const.i32 1\nslot.load l j\ni32.div_s\nref.store i32",
        "const.i32 99\nslot.store g x\nconst.i32 1\nref.store i32",
        "const.i32 99\ncheck.i32 i32 0 1\nref.store i32",
        "address d dv v\nconst.i32 0\nref.index v\nref.load i32\nref.store i32",
        "const.i32 99\naddress d dv v\nconst.i32 3\nref.index v\nconst.i32 5\nref.store i32\nref.store i32",
        "const i64 0\nref.check k 0\nref.load i32\nref.store i32",
    ];
    for body in later {
        let text = arrays(&format!(
            "const.i32 8\nslot.store l i\naddress d dv v\nslot.load l i\nconst.i32 0\ni32.add\nref.index v\n{body}"
        ));
        let mut loaded = load(&text, false);
        let found = loaded.run().unwrap_err();
        assert_eq!(cause(&found), (TrapCode::ArrayIndex, [8, 3, 7]), "{body}");
        assert_eq!(loaded.slot(0), 0, "{body}");
        assert!(loaded.data(16, 20).iter().all(|byte| *byte == 0), "{body}");
    }
}

#[test]
fn references_through_integers_are_checked() {
    let text = |address: i64, write: u8| {
        format!(
            "outputs 2\ninputs 4\ntype k scalar i32\ndata a k\ndata_bytes 24\nglobal x i32\nglobal at i64\nfunction main
            const i64 {address}\nslot.store g at\nslot.load g at\nref.check k {write}\n{}\nreturn\nend\n",
            if write == 1 { "const.i32 3\nref.store i32" } else { "ref.load i32\nslot.store g x" }
        )
    };
    for (address, write, ok) in [
        (16, 1, true),
        (1, 1, true),
        (0, 0, false),
        (-1, 0, false),
        (i64::MAX, 0, false),
        (i64::MIN, 0, false),
        (1 << 32 | 16, 0, false),
    ] {
        let mut loaded = load(&text(address, write), false);
        let result = loaded.run();
        assert_eq!(result.is_ok(), ok, "{address}");
        if let Err(found) = result {
            assert_eq!(cause(&found), (TrapCode::Reference, [address, 0, 0]));
        }
    }
    let layout = load(&text(16, 0), false).image.layout().clone();
    let (output_end, input_end) = (layout.output.end - layout.data.start, layout.input.end - layout.data.start);
    for (end, write) in [(output_end, 1), (input_end, 0)] {
        assert!(load(&text(i64::from(end) - 4, write), false).run().is_ok());
        assert_eq!(trap(&text(i64::from(end) - 3, write)).code, TrapCode::Reference);
    }
    // ref.to_int is the way back.
    let there_and_back = "type k scalar i32\ndata a k\nglobal x i64\nfunction main\naddress d a k\nref.to_int\nslot.store g x\nreturn\nend\n";
    assert_eq!(slots(there_and_back, 1), [16]);
}

#[test]
fn floats_of_foreign_bytes_become_the_one_nan() {
    let text =
        "memory 16\nglobal x f32\nglobal y f64\nfunction main\nconst.i32 -1\nstore m i32 4\nconst i64 -1\nstore m i64 8
        load m f32 4\nslot.store g x\nload m f64 8\nslot.store g y\nreturn\nend\n";
    assert_eq!(slots(text, 2), [0xFFC0_0000, 0xFFF8_0000_0000_0000]);
}

#[test]
fn strings_are_handed_to_their_helpers() {
    let text = "type s string 8\ndata a s\ndata b s\ninit d a string \"motor\"\nglobal n i32\nglobal found i32\nglobal value i64\nfunction main
        address d b s\naddress d a s\naddress d a s\nstring.concat 8 8 8
        address d b s\nstring.len 8\nslot.store g n
        address d b s\naddress d a s\nconst.i32 2\nstring.right 8 8\naddress d a s\naddress d b s\nstring.find 8 8\nslot.store g found
        address d b s\nconst i64 -42\nstring.from_i64 8\naddress d b s\nstring.to_i64 8\nslot.store g value\nreturn\nend\n";
    assert_eq!(slots(text, 3), [8, 4, -42_i64 as u64]);
}
