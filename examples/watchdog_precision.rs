//! How soon a watchdog ends an endless loop, on the real clock, in both engines: 20 runs each.
//!
//! `cargo run --release --example watchdog_precision`; with `taskset -c 0` in front for one processor.

use std::sync::Arc;
use std::time::Instant;

use khz_frontend::{CompileOptions, SourceInput};
use khz_scheduler::time::DurationNs;
use khz_scheduler::{
    Hooks, HostOptions, LoadOptions, MonotonicClock, NoInputs, NoIo, NoObserver, Resource, RunOptions, RunOutcome,
    on_scan_thread, run,
};
use kilohertz::pipeline::{self, EngineKind, Program};

const WATCHDOG_US: u64 = 10_000;
const RUNS: usize = 20;

fn main() {
    let source = SourceInput {
        name: "endless.st".into(),
        bytes: "PROGRAM main\n  WHILE TRUE DO END_WHILE;\nEND_PROGRAM".into(),
    };
    let loaded = pipeline::compile(&[source], &CompileOptions::default()).expect("it compiles");
    for kind in EngineKind::BOTH {
        let mut late_us: Vec<f64> = (0..RUNS)
            .map(|_| on_scan_thread(&HostOptions::default(), |_| late_us(&loaded.programs[0], kind)).expect("a thread"))
            .collect();
        late_us.sort_by(f64::total_cmp);
        #[expect(clippy::print_stdout, reason = "the figures are what this example is for")]
        {
            println!(
                "{kind:?}: stopped {:.0} µs after the deadline (median of {RUNS}; maximum {:.0} µs)",
                late_us[RUNS / 2],
                late_us[RUNS - 1]
            );
        }
    }
}

/// Microseconds between the deadline and the end of the run.
fn late_us(program: &Program, kind: EngineKind) -> f64 {
    let layout = program.layout(1 << 24).expect("it fits");
    let engine = program.engine(kind, &layout, false).expect("an engine");
    let options = LoadOptions { watchdog_us: WATCHDOG_US, ..LoadOptions::default() };
    let clock = Box::new(MonotonicClock::new(DurationNs(0)));
    let resource = Resource::load(Arc::clone(&program.verified) as _, engine, clock, &options).expect("it loads");
    let running = resource.start().expect("it starts");
    let (mut io, mut inputs, mut observer) = (NoIo, NoInputs, NoObserver);
    let mut hooks = Hooks { io: &mut io, inputs: &mut inputs, observer: &mut observer };
    #[expect(clippy::disallowed_methods, reason = "this measures real time")]
    let begin = Instant::now();
    let outcome = run(running, &mut hooks, RunOptions { scans: Some(1) });
    let took_us = begin.elapsed().as_secs_f64() * 1e6;
    let RunOutcome::Faulted(faulted) = outcome else { panic!("the loop ended by itself") };
    assert_eq!(faulted.report().trap.code.name(), "watchdog");
    took_us - WATCHDOG_US as f64
}
