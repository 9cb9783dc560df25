//! A fault that is planted on purpose, found by `khz diff`: `cargo test --features canary --test diff_canary`.

mod common;

use common::{Scratch, khz, stderr, stdout};
use serde_json::Value;

/// The planted interpreter rotates 16 bits by one too many from a constant count of 16 on: here from the fifth scan on.
const ROTATES: &str = "\
PROGRAM main
VAR scan : INT; word : WORD := 16#8001; turned : WORD; copy : WORD; END_VAR
  scan := scan + 1;
  turned := 0;
  IF scan >= 5 THEN
    turned := ROL(word, 19);
  END_IF;
  IF scan > 6 THEN
    copy := turned;
  END_IF;
END_PROGRAM
";

#[test]
fn a_planted_fault_is_told_with_variable_round_and_statement() {
    let scratch = Scratch::new("diff-canary");
    let source = scratch.write("turn.st", ROTATES);
    let sound = khz().arg("diff").arg(&source).output().unwrap();
    assert_eq!(sound.status.code(), Some(0), "without the fault: {}", stderr(&sound));
    let output = khz().args(["diff", "--plant", "interp", "--format", "json"]).arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
    let told: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&told["equal"], &told["round"]), (&false.into(), &5.into()), "{told}");
    let first = &told["variables"][0];
    assert_eq!(first["name"], "main.turned");
    assert_eq!(
        (&first["statement"]["line"], &first["statement"]["text"]),
        (&6.into(), &"turned := ROL(word, 19);".into())
    );
    assert_eq!(first["evaluator"], first["values"]["jit with fuel"], "{told}");
    assert_eq!(told["evaluator"]["agrees_with"], serde_json::json!(["jit with fuel"]));
    let later = told["variables"].as_array().unwrap().iter().find(|found| found["name"] == "main.copy").unwrap();
    assert_eq!(later["round"], 7);
    let people = stderr(&output);
    assert!(people.contains("turn.st:6:5 in main"), "{people}");
    assert!(people.contains("      turned := ROL(word, 19);"), "{people}");
}

#[test]
fn generated_programs_find_it_and_the_first_is_made_small() {
    let words = ["diff", "--random", "4000", "--seed", "1", "--plant", "interp", "--threads"];
    let run = |threads| khz().args(words).arg(threads).output().unwrap();
    let (one, two) = (run("1"), run("2"));
    assert_eq!(one.status.code(), Some(5), "{}", stderr(&one));
    assert_eq!(stderr(&one), stderr(&two), "threads change nothing");
    let told = stderr(&one);
    assert!(told.contains("differs: "), "{told}");
    assert!(told.contains("<-- first difference") || told.contains("rol") || told.contains("ROL"), "{told}");
}
