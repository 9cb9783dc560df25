//! `khz test`: what it prints and exits with, for the sample tests in `tests/st/` (one file in each notation, with timers, mocks and
//! failing assertions) and for the example. `UPDATE_EXPECT=1 cargo test --test khz_test` renews the expected outputs.

mod common;

use std::process::Output;

use common::{Scratch, khz, run, stderr, stdout};
use expect_test::expect_file;
use serde_json::Value;

/// Runs the samples. An endless test is to end soon.
fn samples(words: &str) -> Output {
    run(&format!("test tests/st --watchdog-us 1000 {words}"))
}

#[test]
fn people_see_each_test_and_a_count() {
    let output = samples("");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(stdout(&output), "");
    expect_file!["st/expected/human.txt"].assert_eq(&stderr(&output));
    assert_eq!(stderr(&output).lines().last(), Some("6 passed, 7 failed"));
}

#[test]
fn programs_read_json() {
    let output = samples("--format json");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(stderr(&output), "");
    let found: Value = serde_json::from_str(&stdout(&output)).unwrap();
    expect_file!["st/expected/report.json"].assert_eq(&format!("{}\n", serde_json::to_string_pretty(&found).unwrap()));
}

#[test]
fn build_servers_read_junit_and_tap() {
    let junit = samples("--format junit");
    assert_eq!(junit.status.code(), Some(1));
    expect_file!["st/expected/junit.xml"].assert_eq(&stdout(&junit));
    let tap = samples("--format tap");
    assert_eq!(tap.status.code(), Some(1));
    expect_file!["st/expected/report.tap"].assert_eq(&stdout(&tap));
}

#[test]
fn each_engine_alone_says_the_same() {
    let of = |engine| samples(&format!("--engine {engine}"));
    let (interp, jit) = (of("interp"), of("jit"));
    assert_eq!((interp.status.code(), jit.status.code()), (Some(1), Some(1)));
    assert_eq!(stderr(&interp), stderr(&jit));
    assert_eq!(stderr(&interp), stderr(&samples("")));
}

#[test]
fn a_filter_chooses_tests_and_a_list_runs_none() {
    let output = samples("--filter PUMP");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).ends_with("\n4 passed, 0 failed\n"), "{}", stderr(&output));
    let none = samples("--filter nothing-like-it");
    assert_eq!(none.status.code(), Some(2), "a filter that chooses nothing is most likely misspelt");
    assert_eq!(stderr(&none).lines().last(), Some("no name of the 13 tests holds `nothing-like-it`"));
    let list = samples("--list --filter pump");
    assert_eq!(list.status.code(), Some(0));
    let listed = stdout(&list);
    assert_eq!(listed.lines().count(), 4);
    assert_eq!(listed.lines().next(), Some("tests/st/blocks.st:15:6: the pump needs two seconds"));
    let json: Value = serde_json::from_str(&stdout(&samples("--list --filter pump --format json"))).unwrap();
    assert_eq!(json[0]["name"], "the pump needs two seconds");
    assert_eq!(json[0]["line"], 15);
}

#[test]
fn what_does_not_compile_fails_in_every_format() {
    let scratch = Scratch::new("test-refused");
    let file = scratch.write("t.st", "TEST 'a'\n  ASSERT_EQ(nobody, 1);\nEND_TEST\n");
    let of = |format: &str| khz().args(["test", "--format", format]).arg(&file).output().unwrap();
    for format in ["human", "json", "junit", "tap"] {
        assert_eq!(of(format).status.code(), Some(1), "{format}");
    }
    assert!(stderr(&of("human")).contains("t.st:2:13: error[S0001]"), "{}", stderr(&of("human")));
    let json: Value = serde_json::from_str(&stdout(&of("json"))).unwrap();
    assert_eq!(json[0]["code"], "S0001");
    assert!(stdout(&of("junit")).contains("<error message="));
    assert!(stdout(&of("tap")).contains("\nBail out! "));
}

#[test]
fn the_watchdog_is_fuel_that_can_be_set() {
    let scratch = Scratch::new("test-fuel");
    let text = "TEST 'long'\nVAR i : DINT; n : DINT; END_VAR\nFOR i := 1 TO 100_000 DO n := n + i MOD 3; END_FOR;\nASSERT_GT(n, 0);\nEND_TEST\n";
    let file = scratch.write("t.st", text);
    let of = |us: &str| khz().args(["test", "--watchdog-us", us]).arg(&file).output().unwrap().status.code();
    assert_eq!(of("10"), Some(1), "100000 turns are more than 10 µs");
    assert_eq!(of("100000"), Some(0));
    assert_eq!(of("0"), Some(0), "0 is no limit");
}

#[test]
fn a_container_holds_no_tests() {
    let scratch = Scratch::new("test-container");
    let source = scratch.write("p.st", "PROGRAM p\nVAR n : INT; END_VAR\nn := n + 1;\nEND_PROGRAM\n");
    let container = scratch.path("p.iplc");
    let built = khz().arg("build").arg(&source).arg("-o").arg(&container).output().unwrap();
    assert!(built.status.success(), "{}", stderr(&built));
    let output = khz().arg("test").arg(&container).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("not a container"), "{}", stderr(&output));
}

#[test]
fn builds_and_runs_pass_over_tests() {
    let scratch = Scratch::new("test-ignored");
    let out = scratch.path("plant.iplc");
    let output = khz().args(["build", "tests/st", "-o"]).arg(&out).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(run("run tests/st --clock virtual --scans 3").status.code(), Some(0));
    // Checking looks at them.
    assert_eq!(run("check tests/st").status.code(), Some(0));
    let broken = scratch.write("broken.st", "TEST 'a'\n  ASSERT_EQ(1);\nEND_TEST\n");
    assert_eq!(khz().arg("check").arg(&broken).output().unwrap().status.code(), Some(1));
}

#[test]
fn the_example_passes() {
    let output = run("test examples/tests");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stderr(&output).lines().last(), Some("5 passed, 0 failed"));
}
