//! A counting allocator proves that a scan allocates nothing: in either engine, and in the scheduler around them.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts what each thread asks for, and hands everything on to the system.
struct Counting;

// SAFETY: every call goes to the system allocator with the arguments as they came; counting touches only a thread-local cell
// that needs no allocation and no destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

use khz_frontend::{CompileOptions, SourceInput};
use khz_scheduler::{Hooks, LoadOptions, NoInputs, NoIo, NoObserver, Resource, Running, VirtualClock};
use kilohertz::pipeline::{self, EngineKind, Program};

fn program(path: &str) -> Program {
    let bytes = std::fs::read(common::root().join(path)).unwrap();
    let loaded = pipeline::compile(&[SourceInput { name: path.into(), bytes }], &CompileOptions::default());
    loaded.unwrap_or_else(|e| panic!("{path}: {e}")).programs.into_iter().next().unwrap()
}

fn rounds(mut resource: Resource<Running>, count: usize) -> Resource<Running> {
    let (mut io, mut inputs, mut observer) = (NoIo, NoInputs, NoObserver);
    let mut hooks = Hooks { io: &mut io, inputs: &mut inputs, observer: &mut observer };
    for _ in 0..count {
        let (running, _) = resource.run_round(&mut hooks).map_err(|f| f.report().trap).unwrap();
        resource = running;
        let wake = resource.next_wake(&mut hooks);
        resource.wait(wake);
    }
    resource
}

#[test]
fn a_round_allocates_nothing() {
    for path in [
        "examples/bottling.st",
        "tests/programs/strings.st",
        "tests/programs/blocks.st",
        "tests/schedules/three_tasks.st",
    ] {
        let program = program(path);
        for kind in EngineKind::BOTH {
            let layout = program.layout(1 << 24).unwrap();
            let engine = program.engine(kind, &layout, true).unwrap();
            let clock = Box::new(VirtualClock::new());
            let resource = Resource::load(program.verified.clone(), engine, clock, &LoadOptions::default()).unwrap();
            let running = rounds(resource.start().map_err(|f| f.report().trap).unwrap(), 1);
            let before = allocations();
            let running = rounds(running, 1000);
            assert_eq!(allocations(), before, "{path}, {kind:?}: a scan touched the allocator");
            drop(running);
        }
    }
}

#[test]
fn the_allocator_counts() {
    let before = allocations();
    drop(std::hint::black_box(vec![1_u8; 100]));
    assert_eq!(allocations(), before + 2);
}
