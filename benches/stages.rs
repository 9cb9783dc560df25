//! Criterion benches of each stage. Each checks its answer before it is timed; under `cargo test` each runs once.

mod programs;

use criterion::{BatchSize, Criterion, criterion_main};
use khz_bytecode::container;
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_bytecode::verify::verify;
use khz_frontend::CompileOptions;
use khz_machine::engine::{DeadlineCell, Entry, Limits};
use kilohertz::pipeline::EngineKind;
use programs::{EMPTY, PID, ladder, program, source};

fn frontend(c: &mut Criterion) {
    let sources = [source(&ladder(500))];
    assert!(khz_frontend::compile(&sources, &CompileOptions::default()).resources.len() == 1);
    c.bench_function("frontend/ladder_500", |b| b.iter(|| khz_frontend::compile(&sources, &CompileOptions::default())));
}

fn containers(c: &mut Criterion) {
    let container = program(&ladder(500)).container().clone();
    let bytes = container::write(&container).expect("it fits");
    assert_eq!(container::read(&bytes).expect("it reads"), container);
    c.bench_function("container/read_ladder_500", |b| b.iter(|| container::read(&bytes)));
    c.bench_function("verify/ladder_500", |b| b.iter_batched(|| container.clone(), verify, BatchSize::LargeInput));
}

fn engines(c: &mut Criterion) {
    let program = program(&ladder(500));
    let layout = program.layout(MAX_IMAGE_BYTES).expect("it fits");
    for kind in EngineKind::BOTH {
        assert!(program.engine(kind, &layout, false).expect("it compiles").code_bytes() > 0);
        c.bench_function(&format!("compile/{kind:?}_ladder_500").to_lowercase(), |b| {
            b.iter(|| program.engine(kind, &layout, false));
        });
    }
}

fn scans(c: &mut Criterion) {
    for (name, text) in [("pid", PID), ("ladder_500", &ladder(500)), ("empty", EMPTY)] {
        let program = program(text);
        let layout = program.layout(MAX_IMAGE_BYTES).expect("it fits");
        let deadline = DeadlineCell::new();
        let mut images = Vec::new();
        for kind in EngineKind::BOTH {
            let mut engine = program.engine(kind, &layout, false).expect("it compiles");
            let mut image = program.image(MAX_IMAGE_BYTES).expect("it fits");
            let mut scan = || {
                engine.run(Entry::Instance(0), &mut image, Limits { deadline: &deadline, fuel: None, task_index: 0 })
            };
            for _ in 0..100 {
                scan().expect("no trap");
            }
            c.bench_function(&format!("scan/{name}_{kind:?}").to_lowercase(), |b| b.iter(&mut scan));
            let mut check = program.image(MAX_IMAGE_BYTES).expect("it fits");
            for _ in 0..100 {
                let limits = Limits { deadline: &deadline, fuel: None, task_index: 0 };
                engine.run(Entry::Instance(0), &mut check, limits).expect("no trap");
            }
            images.push(check);
        }
        assert_eq!(images[0].first_difference(&images[1]), None, "{name}: the engines agree after 100 scans");
    }
}

#[allow(missing_docs, reason = "the macro makes a public function")]
mod group {
    use super::{containers, engines, frontend, scans};
    criterion::criterion_group!(benches, frontend, containers, engines, scans);
}

criterion_main!(group::benches);
