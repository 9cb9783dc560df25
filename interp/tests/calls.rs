//! Calls: arguments, results, frames, depth, virtual calls, and what a trap says of the way there.

mod common;

use common::{cause, load, slots, trap};
use khz_bytecode::ids::FunctionId;
use khz_machine::engine::Entry;
use khz_machine::trap::{CodePlace, TrapCode};

#[test]
fn arguments_and_results_pass_in_order_and_locals_start_as_zero() {
    let text = "global x i32\nglobal y i32\nglobal z i32\nfunction main\nlocal a i32\nconst.i32 3\nslot.store l a
        const.i32 1000\nslot.load l a\nconst.i32 300\nconst.i32 7\ncall f\nslot.store g x\nslot.store g y\ni32.add\nslot.store g z
        const.i32 1\nconst.i32 1\nconst.i32 1\ncall f\ndrop\nslot.store g y\ndrop\nreturn\nend
        function f\nparam a i32\nparam b u8\nparam c b1\nresult i32 i32 i32\nlocal n i32
        slot.load l n\nconst.i32 5\ni32.add\nslot.store l n
        slot.load l a\nslot.load l n\nslot.load l b\nslot.load l c\ni32.add\nreturn\nend\n";
    // f(3, 300, 7) = (3, 5, 44 + 1); 1000 stays below. The second call sees n as 0 again.
    assert_eq!(slots(text, 3), [45, 5, 1003]);
}

#[test]
fn frame_bytes_lie_behind_those_of_the_caller_and_start_as_zero() {
    let text = "type k scalar i32\ntype small struct k\ntype large struct k k k\nglobal x i64\nglobal y i64\nglobal z i32\nfunction main\nframe large
        address f #0 k\nref.to_int\nslot.store g x\ncall f\ncall f\nreturn\nend
        function f\nframe small\naddress f #0 k\nref.to_int\nslot.store g y\nload f i32 #0\nslot.load g z\ni32.add\nslot.store g z
        const.i32 9\nstore f i32 #0\nreturn\nend\n";
    let found = slots(text, 3);
    assert_eq!(found[1] - found[0], 16, "12 bytes, rounded up to 8");
    assert_eq!(found[2], 0);
}

#[test]
fn one_body_serves_every_instance() {
    let text =
        "type k scalar i32\ntype blk struct k\nprogram prog block blk\nslot count i32\nfunction main program prog
        slot.load p count\nconst.i32 1\ni32.add\nslot.store p count\ncall sub\nreturn\nend
        function sub program prog\nslot.load p count\nconst.i32 10\ni32.mul\nstore b i32 #0\nreturn\nend
        instance one\ninstance two\n";
    let mut loaded = load(text, false);
    for instance in [0, 1, 1] {
        loaded.run_entry(Entry::Instance(instance)).unwrap();
    }
    assert_eq!((loaded.slot(0), loaded.slot(1)), (1, 2));
    let facts = loaded.verified.facts().instance_blocks.clone();
    for (block, expected) in facts.iter().zip([10_i32, 20]) {
        assert_eq!(loaded.data(block.unwrap() as usize, 4), expected.to_le_bytes());
    }
}

#[test]
fn a_trap_names_its_place_and_the_calls_that_led_there() {
    let text = "global x i32\nfunction main\nnop\ncall f\nreturn\nend\nfunction f\nconst.i32 1\nslot.store g x\ncall g_\nconst.i32 2\nslot.store g x\nreturn\nend
        function g_\nconst.i32 1\nslot.load g x\nconst.i32 1\ni32.sub\ni32.div_s\ndrop\nreturn\nend\n";
    let mut loaded = load(text, false);
    let found = loaded.run().unwrap_err();
    assert_eq!(cause(&found), (TrapCode::DivideByZero, [0; 3]));
    let at = |function: u16, mnemonic: &str| {
        let facts = loaded.verified.function(FunctionId(function));
        let placed = facts.instructions.iter().find(|placed| placed.instruction.mnemonic() == mnemonic).unwrap();
        CodePlace { function: FunctionId(function), offset: placed.offset }
    };
    assert_eq!(found.place, at(2, "i32.div_s"));
    assert_eq!(found.chain(), [at(1, "call"), at(0, "call")]);
    assert_eq!(loaded.slot(0), 1, "what was written before stays, what comes behind did not happen");
}

/// A block type with a virtual method that calls itself through its own address, `levels` deep.
fn recursion(levels: i32, depth: u32, extra: &str) -> String {
    format!(
        "max_call_depth {depth}\n{extra}\ntype k scalar i32\ntype counter block k methods down=down_counter\nmethod down param i32 result i32
        type big struct k k\ndata c counter\nglobal x i32\nfunction main\naddress d c counter\nref.to_int\nconst.i32 {levels}\ncall.virtual down
        slot.store g x\nreturn\nend
        function down_counter block counter\nparam n i32\nresult i32\nframe big
        load f i32 #0\nload t i32 #0\ni32.add\nconst.i32 1\ni32.add\nstore t i32 #0\nconst.i32 5\nstore f i32 #0
        slot.load l n\ni32.eqz\njump.if end_
        address t #0 k\nref.to_int\nslot.load l n\nconst.i32 1\ni32.sub\ncall.virtual down\nslot.load l n\ni32.add\nreturn
        end_:\nconst.i32 100\nreturn\nend\n"
    )
}

#[test]
fn virtual_calls_may_recurse_down_to_the_depth_limit() {
    // `address t #0` is the instance's own address: its first field.
    let mut loaded = load(&recursion(5, 7, ""), false);
    loaded.run().unwrap();
    assert_eq!(loaded.slot(0), 115);
    assert_eq!(loaded.data(16, 4), 6_i32.to_le_bytes(), "six calls, each with fresh frame bytes");
    let mut loaded = load(&recursion(6, 7, ""), false);
    let found = loaded.run().unwrap_err();
    assert_eq!(cause(&found), (TrapCode::CallDepth, [8, 0, 0]));
    assert_eq!((found.place.function, found.chain().len()), (FunctionId(1), 6));
    assert_eq!(loaded.data(16, 4), 6_i32.to_le_bytes());
    // 8 bytes a level: the frame region is the limit before the depth is.
    let found = trap(&recursion(6, 64, "frame_bytes 32"));
    assert_eq!(cause(&found), (TrapCode::CallDepth, [6, 0, 0]));
}

#[test]
fn a_virtual_call_finds_the_method_of_the_instance_or_traps() {
    let text = |address: &str| {
        format!(
            "type k scalar i32\nmethod get result i32\ntype base block k methods get=base_get\ntype derived block k base base methods get=derived_get
            type plain block k base base\ndata a base\ndata b derived\ndata c plain\narray many derived 1..3\ndata e many\nglobal x i32\nfunction main
            {address}\ncall.virtual get\nslot.store g x\nreturn\nend
            function base_get block base\nresult i32\nload t i32 #0\nconst.i32 1\ni32.add\nreturn\nend
            function derived_get block derived\nresult i32\nload t i32 #0\nconst.i32 2\ni32.add\nreturn\nend
            init d a i32 10\ninit d b i32 20\ninit d c i32 30\ninit d e i32 1 2 40\n"
        )
    };
    for (address, expected) in [
        ("address d a base\nref.to_int", 11),
        ("address d b derived\nref.to_int", 22),
        ("address d c plain\nref.to_int", 31),
        ("address d e many\nconst.i32 3\nref.index many\nref.to_int", 42),
    ] {
        assert_eq!(slots(&text(address), 1), [expected], "{address}");
    }
    for (address, value) in
        [("const i64 0", 0), ("const i64 17", 17), ("const i64 -1", -1), ("const i64 4294967312", 1 << 32 | 16)]
    {
        assert_eq!(cause(&trap(&text(address))), (TrapCode::Reference, [value, 0, 0]), "{address}");
    }
}
