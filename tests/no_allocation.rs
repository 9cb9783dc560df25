//! A counting allocator proves that a scan allocates nothing, in either engine and in the scheduler around them, and that tables of inputs are kept small.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static HELD_BYTES: Cell<i64> = const { Cell::new(0) };
}

/// Counts what each thread asks for, and hands everything on to the system.
struct Counting;

// SAFETY: every call goes to the system allocator with the arguments as they came; counting touches only a thread-local cell
// that needs no allocation and no destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        HELD_BYTES.with(|bytes| bytes.set(bytes.get() + layout.size() as i64));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        HELD_BYTES.with(|bytes| bytes.set(bytes.get() - layout.size() as i64));
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
use khz_machine::variables::VariableTable;
use khz_scheduler::{Hooks, InputSource, LoadOptions, NoInputs, NoIo, NoObserver, Resource, Running, VirtualClock};
use kilohertz::inputs::CsvInputs;
use kilohertz::pipeline::{self, EngineKind, Program};
use kilohertz::traces::MAX_CELLS;

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

/// 20 bytes a cell and 16 a row, and at most twice that in lists that grow; every further user of the table has two words of it.
#[test]
fn a_table_of_inputs_is_held_once_and_compactly() {
    const ROWS: i64 = 50_000;
    let source = "PROGRAM main VAR a : BOOL; b : REAL; s : STRING[8]; END_VAR END_PROGRAM";
    let source = SourceInput { name: "main.st".into(), bytes: source.into() };
    let program = pipeline::compile(&[source], &CompileOptions::default()).unwrap().programs.remove(0);
    let (names, image) = (VariableTable::of(program.container()), program.image(1 << 20).unwrap());
    let rows = (0..ROWS).map(|row| format!("{row},{},{row}.5,'{}'\n", row % 2, row % 7));
    let text = format!("time_us,main.a,main.b,main.s\n{}", rows.collect::<String>());
    let before = HELD_BYTES.with(Cell::get);
    let inputs = CsvInputs::parse("rows.csv", text.as_bytes(), &names, &image).unwrap();
    let sides = [(); 4].map(|()| inputs.clone());
    let held = HELD_BYTES.with(Cell::get) - before;
    assert!(held < 2 * ROWS * (16 + 3 * 20) + 10_000, "{held} bytes");
    assert_eq!(sides[3].next_change_us(), Some(0));
}

#[test]
fn more_cells_than_a_table_may_have_are_refused_where_they_begin() {
    let source = SourceInput { name: "main.st".into(), bytes: "PROGRAM main VAR a : BOOL; END_VAR END_PROGRAM".into() };
    let program = pipeline::compile(&[source], &CompileOptions::default()).unwrap().programs.remove(0);
    let (names, image) = (VariableTable::of(program.container()), program.image(1 << 20).unwrap());
    let width = 9000;
    let row = format!("0{}\n", ",1".repeat(width));
    let text = format!("time_us{}\n{}", ",main.a".repeat(width), row.repeat(MAX_CELLS / width + 1));
    let refused = CsvInputs::parse("rows.csv", text.as_bytes(), &names, &image).unwrap_err();
    assert_eq!((refused.line, refused.column), ((MAX_CELLS / width + 2) as u64, Some((MAX_CELLS % width + 2) as u64)));
    assert!(refused.reason.contains("values that a table may have"), "{refused}");
}

#[test]
fn the_allocator_counts() {
    let before = allocations();
    drop(std::hint::black_box(vec![1_u8; 100]));
    assert_eq!(allocations(), before + 2);
}
