//! Instruction counts, which repeat exactly: frontend, verify, JIT compile, a scan in both engines. Needs valgrind and iai-callgrind-runner (CONTRIBUTING.md).

mod programs;

use std::hint::black_box;

use iai_callgrind::{library_benchmark, library_benchmark_group, main};
use khz_bytecode::container::Container;
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_bytecode::verify::verify;
use khz_frontend::{CompileOptions, SourceInput};
use khz_machine::engine::{DeadlineCell, Engine, Entry, Limits};
use khz_machine::image::Image;
use kilohertz::pipeline::{EngineKind, Program};
use programs::{PID, ladder, program, source};

fn ladder_source() -> [SourceInput; 1] {
    [source(&ladder(500))]
}

#[library_benchmark]
#[bench::ladder_500(ladder_source())]
fn frontend(sources: [SourceInput; 1]) -> usize {
    black_box(khz_frontend::compile(&sources, &CompileOptions::default()).resources.len())
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

library_benchmark_group!(name = stages; benchmarks = frontend, verifier, jit_compile, hundred_scans);
main!(library_benchmark_groups = stages);
