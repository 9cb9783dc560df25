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
    expect![[r#"
        time_us,rounds,left_value,right_value,sum,supervisor.scans,trigger,events,seen
        0,1,3,10,13,1,FALSE,0,0
        5000,2,6,20,13,1,FALSE,0,0
        10000,3,9,30,39,2,TRUE,0,0
        10001,4,9,30,39,2,TRUE,1,39
        15000,5,12,40,39,2,TRUE,1,39
        20000,6,15,50,65,3,FALSE,1,39
        25000,7,18,60,65,3,FALSE,1,39
        30000,8,21,70,91,4,TRUE,1,39
        30001,9,21,70,91,4,TRUE,2,91
        35000,10,24,80,91,4,TRUE,2,91
        40000,11,27,90,117,5,FALSE,2,91
        45000,12,30,100,117,5,FALSE,2,91
    "#]]
    .assert_eq(&interp);
}

#[test]
fn a_second_run_gives_the_same_bytes() {
    let scratch = Scratch::new("schedule-again");
    assert_eq!(trace("jit", &scratch), trace("jit", &scratch));
}
