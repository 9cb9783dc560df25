//! A run allocates nothing, whether it ends well or in a trap.
#![allow(unsafe_code, reason = "a global allocator can not be counted otherwise")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use common::load;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_run_allocates_nothing() {
    let text = "type s string 20\ndata a s\ndata b s\ninit d a string \"motor\"\ntype k scalar i32\ntype counter block k methods down=down_counter
        method down param i32\ndata c counter\nglobal x i32\nglobal levels i32\nglobal runs i32\nfunction main\nlocal i i32\nfor each l i i32
        slot.load g runs\nconst.i32 1\ni32.add\nslot.store g runs
        const.i32 0\nconst.i32 9\nconst.i32 1\nfor.enter each done\npass:\naddress d b s\nslot.load l i\ni64.extend_i32_s\nstring.from_i64 20
        address d b s\naddress d a s\naddress d b s\nstring.concat 20 20 20\nconst.i32 2\ncall f\nfor.next each pass\ndone:
        slot.load g runs\nconst.i32 2\ni32.lt_s\njump.if shallow
        const.i32 1000\nslot.store g levels\nshallow:
        address d c counter\nref.to_int\nslot.load g levels\ncall.virtual down\nreturn\nend
        function f\nparam n i32\nslot.load l n\nslot.load g x\ni32.add\nslot.store g x\nreturn\nend
        function down_counter block counter\nparam n i32\nslot.load l n\ni32.eqz\njump.if end_
        address t #0 k\nref.to_int\nslot.load l n\nconst.i32 1\ni32.sub\ncall.virtual down\nend_:\nreturn\nend\n";
    let mut loaded = load(text, true);
    for run in 0..2 {
        let before = COUNT.with(Cell::get);
        let (result, _) = loaded.run_with_fuel(1 << 40);
        // The deadline cell of the test itself.
        assert_eq!(COUNT.with(Cell::get) - before, 1, "run {run}");
        assert_eq!(result.is_ok(), run == 0, "the second run recurses too deep");
    }
    assert_eq!(loaded.slot(0), 40);
}
