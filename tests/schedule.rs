//! The trace of a configuration with cyclic, event and freewheeling tasks, line by line, in both engines.

mod common;

use common::{Scratch, khz, root, stderr};
use expect_test::expect;

fn trace(engine: &str, scratch: &Scratch) -> String {
    let path = scratch.path(&format!("{engine}.csv"));
    let program = root().join("tests/schedules/three_tasks.st");
    let watch = "rounds,left_value,right_value,sum,supervisor.scans,trigger,events,seen";
    let output = khz()
        .args(["run", "--clock", "virtual", "--scans", "12", "--engine", engine, "--watch", watch, "--trace"])
        .arg(&path)
        .arg(&program)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn three_tasks_run_as_the_rules_say() {
    let scratch = Scratch::new("schedule");
    let interp = trace("interp", &scratch);
    assert_eq!(interp, trace("jit", &scratch));
    expect![[r#""#]].assert_eq(&interp);
}

#[test]
fn a_second_run_gives_the_same_bytes() {
    let scratch = Scratch::new("schedule-again");
    assert_eq!(trace("jit", &scratch), trace("jit", &scratch));
}
