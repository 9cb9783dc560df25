//! Instruction counts, which repeat exactly: reading a container, verify, JIT compile, scans in both engines. (The front end compiles on a
//! thread of its own, which callgrind does not count.) Needs valgrind and iai-callgrind-runner (CONTRIBUTING.md).

#![allow(missing_docs, reason = "the macros make public items")]

mod programs;

use std::hint::black_box;

use iai_callgrind::{library_benchmark, library_benchmark_group, main};
use khz_bytecode::container::{self, Container};
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_bytecode::verify::verify;
use khz_machine::engine::{DeadlineCell, Engine, Entry, Limits};
use khz_machine::image::Image;
use kilohertz::pipeline::{EngineKind, Program};
use programs::{PID, ladder, program};

fn ladder_bytes() -> Vec<u8> {
    container::write(program(&ladder(500)).container()).expect("it fits")
}

#[library_benchmark]
#[bench::ladder_500(ladder_bytes())]
fn load(bytes: Vec<u8>) -> bool {
    black_box(container::read(&bytes).is_ok())
}

fn ladder_container() -> Container {
    program(&ladder(500)).container().clone()
}

#[library_benchmark]
#[bench::ladder_500(ladder_container())]
fn verifier(container: Container) -> bool {
    black_box(verify(container).is_ok())
}

#[library_benchmark]
#[bench::ladder_500(program(&ladder(500)))]
fn jit_compile(program: Program) -> usize {
    let layout = program.layout(MAX_IMAGE_BYTES).expect("it fits");
    black_box(program.engine(EngineKind::Jit, &layout, false).expect("it compiles").code_bytes())
}

fn ready(kind: EngineKind) -> (Box<dyn Engine>, Image) {
    let program = program(PID);
    let image = program.image(MAX_IMAGE_BYTES).expect("it fits");
    (program.engine(kind, image.layout(), false).expect("it compiles"), image)
}

#[library_benchmark]
#[bench::jit_pid(ready(EngineKind::Jit))]
#[bench::interp_pid(ready(EngineKind::Interp))]
fn hundred_scans((mut engine, mut image): (Box<dyn Engine>, Image)) -> u8 {
    let deadline = DeadlineCell::new();
    for _ in 0..100 {
        let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
        engine.run(Entry::Instance(0), &mut image, limits).expect("no trap");
    }
    black_box(image.bytes()[0])
}

library_benchmark_group!(name = stages; benchmarks = load, verifier, jit_compile, hundred_scans);
main!(library_benchmark_groups = stages);
