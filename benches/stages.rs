//! Criterion benches of each stage. Each checks its answer before it is timed; under `cargo test` each runs once.

mod programs;

use criterion::{BatchSize, Criterion, criterion_main};
use khz_bytecode::container;
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_bytecode::verify::verify;
use khz_frontend::CompileOptions;
use khz_machine::engine::{DeadlineCell, Entry, Limits};
use khz_scheduler::{Hooks, LoadOptions, NoInputs, NoIo, NoObserver, Resource, VirtualClock};
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

/// A whole scheduling round on the virtual clock: selection, the scan, statistics, the next wake.
fn rounds(c: &mut Criterion) {
    let program = program(EMPTY);
    let layout = program.layout(MAX_IMAGE_BYTES).expect("it fits");
    for kind in EngineKind::BOTH {
        let engine = program.engine(kind, &layout, false).expect("it compiles");
        let holder = std::sync::Arc::clone(&program.verified);
        let resource = Resource::load(holder, engine, Box::new(VirtualClock::new()), &LoadOptions::default());
        let mut state = resource.expect("it loads").start().ok();
        let (mut io, mut inputs, mut observer) = (NoIo, NoInputs, NoObserver);
        let mut round = || {
            let mut hooks = Hooks { io: &mut io, inputs: &mut inputs, observer: &mut observer };
            let running = state.take().expect("it runs");
            let (mut running, _) = running.run_round(&mut hooks).map_err(|f| f.report().trap).expect("no trap");
            let wake = running.next_wake(&mut hooks);
            running.wait(wake);
            state = Some(running);
        };
        (0..10).for_each(|_| round());
        c.bench_function(&format!("round/empty_{kind:?}").to_lowercase(), |b| b.iter(&mut round));
        let statistics = state.expect("it runs").statistics();
        assert!(statistics.tasks[0].scans >= 10 && statistics.rounds == statistics.tasks[0].scans);
    }
}

#[allow(missing_docs, reason = "the macro makes a public function")]
mod group {
    use super::{containers, engines, frontend, rounds, scans};
    criterion::criterion_group!(benches, frontend, containers, engines, scans, rounds);
}

criterion_main!(group::benches);
