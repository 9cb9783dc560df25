//! Instruction counts, which repeat exactly whatever else the machine does: the front end, reading a container, the verifier, making both engines
//! ready, scans in both. `benches/instructions.sh` holds them against the baseline beside it. Needs valgrind and iai-callgrind-runner
//! (CONTRIBUTING.md). Native code is made for the processor that valgrind imitates.

#![allow(missing_docs, reason = "the macros make public items")]

mod programs;

use std::hint::black_box;

use iai_callgrind::{Callgrind, EntryPoint, LibraryBenchmarkConfig, library_benchmark, library_benchmark_group, main};
use khz_bytecode::container::{self, Container};
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_bytecode::verify::verify;
use khz_frontend::{CompileOptions, SourceInput, on_large_stack};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Limits};
use khz_machine::image::Image;
use kilohertz::pipeline::{EngineKind, Program};
use programs::{EMPTY, PID, ladder, program, source};

/// What the front end does on the thread that it makes for itself, which is counted by this function's name.
#[inline(never)]
fn front_end_work(sources: &[SourceInput]) -> usize {
    khz_frontend::compile(sources, &CompileOptions::default()).resources.len()
}

fn on_its_thread() -> LibraryBenchmarkConfig {
    let mut config = LibraryBenchmarkConfig::default();
    config.tool(Callgrind::default().entry_point(EntryPoint::Custom("*front_end_work*".into())));
    config
}

#[library_benchmark(config = on_its_thread())]
#[bench::ladder_500(source(&ladder(500)))]
#[bench::pid(source(PID))]
fn front_end(source: SourceInput) -> usize {
    let sources = [source];
    black_box(on_large_stack(|| front_end_work(&sources)))
}

fn bytes_of(text: &str) -> Vec<u8> {
    container::write(program(text).container()).expect("it fits")
}

#[library_benchmark]
#[bench::ladder_500(bytes_of(&ladder(500)))]
#[bench::pid(bytes_of(PID))]
fn load(bytes: Vec<u8>) -> bool {
    black_box(container::read(&bytes).is_ok())
}

fn container_of(text: &str) -> Container {
    program(text).container().clone()
}

#[library_benchmark]
#[bench::ladder_500(container_of(&ladder(500)))]
#[bench::pid(container_of(PID))]
fn verifier(container: Container) -> bool {
    black_box(verify(container).is_ok())
}

fn ready(kind: EngineKind, program: &Program) -> Box<dyn Engine> {
    let layout = program.layout(MAX_IMAGE_BYTES).expect("it fits");
    program.engine(kind, &layout, false).expect("it compiles")
}

#[library_benchmark]
#[bench::ladder_500(program(&ladder(500)))]
#[bench::pid(program(PID))]
fn jit_ready(program: Program) -> usize {
    black_box(ready(EngineKind::Jit, &program).code_bytes())
}

#[library_benchmark]
#[bench::ladder_500(program(&ladder(500)))]
#[bench::pid(program(PID))]
fn interp_ready(program: Program) -> usize {
    black_box(ready(EngineKind::Interp, &program).code_bytes())
}

fn scanning(kind: EngineKind, text: &str) -> (Box<dyn Engine>, Image) {
    let program = program(text);
    (ready(kind, &program), program.image(MAX_IMAGE_BYTES).expect("it fits"))
}

#[library_benchmark]
#[bench::jit_empty(scanning(EngineKind::Jit, EMPTY))]
#[bench::jit_ladder_500(scanning(EngineKind::Jit, &ladder(500)))]
#[bench::jit_pid(scanning(EngineKind::Jit, PID))]
#[bench::interp_empty(scanning(EngineKind::Interp, EMPTY))]
#[bench::interp_ladder_500(scanning(EngineKind::Interp, &ladder(500)))]
#[bench::interp_pid(scanning(EngineKind::Interp, PID))]
fn hundred_scans((mut engine, mut image): (Box<dyn Engine>, Image)) -> u8 {
    let deadline = DeadlineCell::new();
    for _ in 0..100 {
        let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
        engine.run(Entry::Instance(0), &mut image, limits).expect("no trap");
    }
    black_box(image.bytes()[0])
}

library_benchmark_group!(
    name = stages;
    benchmarks = front_end, load, verifier, jit_ready, interp_ready, hundred_scans
);
main!(library_benchmark_groups = stages);
