//! `WHILE TRUE DO END_WHILE` is ended: by a watchdog on both clocks, by signals without one; the report names the loop's
//! condition. How soon is measured by `examples/watchdog_precision.rs`,
//! not asserted here.

mod common;

use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use common::{Scratch, khz, stderr};

const ENDLESS: &str =
    "PROGRAM main\nVAR n : DINT; END_VAR\n  WHILE TRUE DO\n    n := n + 1;\n  END_WHILE;\nEND_PROGRAM\n";

/// A run that nothing ends is ended by the test, after this many pauses of 10 ms, and fails it: a minute, hundreds of times what it may take.
const PAUSES: u32 = 6_000;

/// What a run leaves behind. One that goes on for a minute is killed, and so has no exit status.
fn output_of(mut child: Child) -> Output {
    for _ in 0..PAUSES {
        if child.try_wait().unwrap().is_some() {
            return child.wait_with_output().unwrap();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait_with_output().unwrap()
}

/// Starts `khz` with its messages kept, and waits for its end.
fn ended(command: &mut Command) -> Output {
    output_of(command.stderr(Stdio::piped()).spawn().unwrap())
}

#[test]
fn a_watchdog_ends_an_endless_loop_on_both_clocks() {
    let scratch = Scratch::new("watchdog");
    let path = scratch.write("endless.st", ENDLESS);
    for engine in ["interp", "jit"] {
        for clock in ["real", "virtual"] {
            let arguments = ["run", "--engine", engine, "--clock", clock, "--watchdog-us", "10000"];
            let output = ended(khz().args(arguments).arg(&path));
            let text = stderr(&output);
            assert_eq!(output.status.code(), Some(3), "{engine} {clock}: {text}");
            assert!(text.contains("watchdog"), "{engine} {clock}: {text}");
            assert!(text.contains("endless.st:3:9"), "{engine} {clock}: {text}");
            assert!(text.contains("main"), "{engine} {clock}: {text}");
        }
    }
}

#[test]
fn fuel_stops_both_engines_at_the_same_place() {
    let scratch = Scratch::new("watchdog-fuel");
    let path = scratch.write("endless.st", ENDLESS);
    let dumps = ["interp", "jit"].map(|engine| {
        let dump = scratch.path(&format!("{engine}.json"));
        let arguments = ["run", "--engine", engine, "--clock", "virtual", "--watchdog-us", "10000", "--dump-vars"];
        let output = ended(khz().args(arguments).arg(&dump).arg(&path));
        assert_eq!(output.status.code(), Some(3));
        (std::fs::read_to_string(dump).unwrap(), stderr(&output))
    });
    assert_eq!(dumps[0], dumps[1]);
    assert!(dumps[0].0.contains("\"main.n\":"), "{}", dumps[0].0);
}

/// Starts an endless run, sends signals with the pauses between them, and gives its exit status.
fn signalled(engine: &str, name: &str, source: &str, signals: &[(&str, Duration)]) -> (Option<i32>, String) {
    let scratch = Scratch::new(&format!("{name}-{engine}"));
    let path = scratch.write("endless.st", source);
    let child = khz().args(["run", "--engine", engine]).arg(&path).stderr(Stdio::piped()).spawn().unwrap();
    for (signal, pause) in signals {
        std::thread::sleep(*pause);
        let sent = Command::new("kill").args([*signal, &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
    }
    let output = output_of(child);
    (output.status.code(), stderr(&output))
}

#[test]
fn a_second_signal_ends_an_endless_loop_without_a_watchdog() {
    for engine in ["interp", "jit"] {
        let signals = [("-INT", Duration::from_millis(800)), ("-INT", Duration::from_millis(100))];
        let (status, text) = signalled(engine, "two-signals", ENDLESS, &signals);
        assert_eq!(status, Some(3), "{engine}: {text}");
        assert!(text.contains("stopped") && text.contains("endless.st:3:9"), "{engine}: {text}");
    }
}

#[test]
fn one_signal_is_enough_after_a_second() {
    for engine in ["interp", "jit"] {
        let (status, text) = signalled(engine, "one-signal", ENDLESS, &[("-TERM", Duration::from_millis(800))]);
        assert_eq!(status, Some(3), "{engine}: {text}");
        assert!(text.contains("stopped"), "{engine}: {text}");
    }
}

#[test]
fn a_well_behaved_program_stops_with_status_0() {
    let source = "PROGRAM main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM";
    let (status, text) = signalled("jit", "clean-stop", source, &[("-INT", Duration::from_millis(800))]);
    assert_eq!(status, Some(0), "{text}");
    assert!(text.contains("stopped after"), "{text}");
}
