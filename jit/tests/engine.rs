//! What a run promises: precise traps with values held in registers, the chain of calls, deadlines, fuel, shared code, no allocation.
#![allow(unsafe_code, reason = "a global allocator can not be counted otherwise")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::Duration;

use common::{cause, form, load, load_with};
use khz_jit::{JitOptions, Passes};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Limits};
use khz_machine::trap::TrapCode;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
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

/// Sums, counts and writes an array until something traps in pass 5; `sum` and `i` live in registers then.
fn summing(trapping: &str) -> String {
    format!(
        "global sum i32\nglobal i i32\nglobal seen b1\nglobal other i32\ntype n scalar i32\narray v n 0..4\ndata a v\n\
         function main\nfor k g i i32\nconst.i32 1\nconst.i32 9\nconst.i32 1\nfor.enter k out\ntop:\n\
         slot.load g sum\nslot.load g i\ni32.add\nslot.store g sum\nconst.i32 1\nslot.store g seen\n{trapping}\
         for.next k top\nout:\nreturn\nend\n\
         function f\nparam p i32\nconst.i32 7\nslot.load l p\nconst.i32 5\ni32.sub\ni32.div_s\nslot.store g other\nreturn\nend\n\
         function g\nparam p i32\nslot.load l p\ncall f\nreturn\nend\n"
    )
}

#[test]
fn traps_write_back_what_registers_hold() {
    let cases = [
        ("address d a v\nslot.load g i\nref.index v\nconst.i32 1\nref.store i32\n", TrapCode::ArrayIndex, [5, 0, 4]),
        ("const.i32 7\nslot.load g i\nconst.i32 5\ni32.sub\ni32.div_s\ndrop\n", TrapCode::DivideByZero, [0; 3]),
        ("slot.load g i\ncheck.i32 i32 0 4\ndrop\n", TrapCode::Range, [5, 0, 4]),
        (
            "slot.load g i\nconst.i32 5\ni32.ne\ni64.extend_i32_s\nconst i64 16\ni64.mul\nref.check n 0\ndrop\n",
            TrapCode::Reference,
            [0; 3],
        ),
        ("slot.load g i\ncall g\n", TrapCode::DivideByZero, [0; 3]),
    ];
    for (code, trap_code, values) in cases {
        let text = summing(code);
        assert!(form(&text, Passes::ALL).contains("traps w1"), "the loop holds nothing in variables\n{text}");
        for passes in [Passes::NONE, Passes::ALL] {
            let mut run = load_with(&text, JitOptions { passes, ..JitOptions::default() });
            let trap = run.run().unwrap_err();
            assert_eq!(cause(&trap), (trap_code, values), "{code}");
            assert_eq!((run.slot(0), run.slot(1), run.slot(2)), (15, 5, 1), "{code} {passes:?}");
        }
    }
}

#[test]
fn the_chain_names_the_calls_innermost_first() {
    let mut run = load(&summing("slot.load g i\ncall g\n"), false);
    let trap = run.run().unwrap_err();
    let functions: Vec<u16> = trap.chain().iter().map(|place| place.function.0).collect();
    assert_eq!((trap.place.function.0, functions), (1, vec![2, 0]));
    let facts = run.verified.function(trap.chain()[1].function);
    let at = facts.instructions.iter().find(|placed| placed.offset == trap.chain()[1].offset).unwrap();
    assert_eq!(at.instruction.mnemonic(), "call");
}

#[test]
fn an_endless_loop_ends_when_another_thread_says_so() {
    let text =
        "global n i32\nfunction main\ntop:\nslot.load g n\nconst.i32 1\ni32.add\nslot.store g n\njump top\nend\n";
    let mut run = load(text, false);
    let deadline = DeadlineCell::new();
    let other = deadline.clone();
    let watch = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(10));
        other.expire(TrapCode::Watchdog);
    });
    let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
    let trap = run.engine.run(Entry::Instance(0), &mut run.image, limits).unwrap_err();
    watch.join().unwrap();
    assert_eq!(cause(&trap), (TrapCode::Watchdog, [0; 3]));
    assert!(run.slot(0) > 0, "what the loop counted is in the image");
}

#[test]
fn fuel_runs_out_at_the_same_place_every_time() {
    let text =
        "global n i32\nfunction main\ntop:\nslot.load g n\nconst.i32 1\ni32.add\nslot.store g n\njump top\nend\n";
    let mut run = load(text, true);
    let (result, left) = run.run_with_fuel(52);
    assert_eq!((result.unwrap_err().code, left), (TrapCode::Watchdog, 0));
    assert_eq!(run.slot(0), 10, "5 units a pass");
}

#[test]
fn instances_of_a_type_share_code_from_a_number_on() {
    let text = |count: usize| {
        let instances: String = (0..count).map(|n| format!("instance i{n}\n")).collect();
        format!(
            "type n scalar i32\ntype pair struct n n\nglobal total i32\nprogram prog block pair\nslot own i32\n{instances}\
             function main program prog\nslot.load p own\nconst.i32 3\ni32.add\nslot.store p own\n\
             slot.load p own\nstore b i32 #1\nload b i32 #1\nslot.load g total\ni32.add\nslot.store g total\nreturn\nend\n"
        )
    };
    let bytes = |count: usize| load(&text(count), false).engine.code_bytes();
    assert!(bytes(4) > 3 * bytes(1));
    assert!(bytes(40) < 2 * bytes(1), "{} {}", bytes(40), bytes(1));
    let mut run = load(&text(40), false);
    for instance in [0, 39, 39] {
        run.run_entry(Entry::Instance(instance)).unwrap();
    }
    assert_eq!((run.slot(0), run.slot(1), run.slot(40)), (3 + 3 + 6, 3, 6));
}

#[test]
fn virtual_calls_recurse_down_to_the_limit_without_harm() {
    let text = "type k scalar i32\ntype counter block k methods down=down_counter\nmethod down param i32 result i32\n\
         data c counter\nglobal result i32\nmax_call_depth 1024\nfunction main\naddress d c counter\nref.to_int\nconst.i32 LEVELS\n\
         call.virtual down\nslot.store g result\nreturn\nend\n\
         function down_counter block counter\nparam n i32\nresult i32\nslot.load l n\ni32.eqz\njump.if bottom\n\
         address t 0 k\nref.to_int\nslot.load l n\nconst.i32 1\ni32.sub\ncall.virtual down\nconst.i32 1\ni32.add\nreturn\n\
         bottom:\nconst.i32 0\nreturn\nend\n";
    let mut run = load(&text.replace("LEVELS", "1022"), false);
    run.run().unwrap();
    assert_eq!(run.slot(0), 1022);
    assert!(run.engine.stack_bytes() >= 1024 * 16 && run.engine.stack_bytes() <= khz_jit::MAX_STACK_BYTES);
    let trap = load(&text.replace("LEVELS", "1023"), false).run().unwrap_err();
    assert_eq!((cause(&trap), trap.chain().len()), ((TrapCode::CallDepth, [1025, 0, 0]), 16));
}

#[test]
fn a_run_allocates_nothing() {
    let strings = "type s string 20\ndata t s\n";
    let text = format!(
        "{strings}{}",
        summing("address d t s\nslot.load g i\ni64.extend_i32_s\nstring.from_i64 20\nslot.load g i\ncall g\n")
    );
    let mut run = load(&text, true);
    let deadline = DeadlineCell::new();
    for _ in 0..3 {
        let before = ALLOCATIONS.with(Cell::get);
        let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
        let result = run.engine.run(Entry::Instance(0), &mut run.image, limits);
        assert_eq!(ALLOCATIONS.with(Cell::get), before);
        assert_eq!(result.unwrap_err().code, TrapCode::DivideByZero);
    }
}
