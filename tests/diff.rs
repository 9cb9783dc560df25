//! `khz diff` on a program: what it says when engines differ, and random inputs.

mod common;

use std::collections::BTreeSet;

use common::{Scratch, khz, stderr, stdout};
use khz_frontend::{CompileOptions, SourceInput};
use khz_machine::engine::{Engine, Entry, Limits};
use khz_machine::image::Image;
use khz_machine::trap::{CodePlace, Trap, TrapCode};
use kilohertz::lockstep::difference::{Difference, Verdict};
use kilohertz::lockstep::inputs::RandomInputs;
use kilohertz::lockstep::{EngineUnderTest, Lockstep, Options};
use kilohertz::pipeline::{self, EngineKind, Program};

const MAX_IMAGE_BYTES: u64 = 1 << 24;

/// Two statements write `total`: the second one is the last.
const COUNTER: &str = "\
FUNCTION_BLOCK Sum
VAR_INPUT x : DINT; END_VAR
VAR_OUTPUT y : DINT; END_VAR
  y := y + x;
END_FUNCTION_BLOCK
PROGRAM main
VAR scan : DINT; total : DINT; other : INT; sum : Sum; END_VAR
  scan := scan + 1;
  total := 0;
  total := total + scan * 2;
  sum(x := scan);
  other := DINT_TO_INT(total);
END_PROGRAM
";

fn program(text: &str) -> Program {
    let source = SourceInput { name: "main.st".into(), bytes: text.into() };
    let loaded = pipeline::compile(&[source], &CompileOptions::default()).expect("it compiles");
    loaded.programs.into_iter().next().expect("one resource")
}

/// An engine that does something wrong in one of its runs, from 1.
struct Lying<F> {
    engine: Box<dyn Engine>,
    runs: u32,
    wrong_run: u32,
    lie: F,
}

impl<F: FnMut(&mut Image) -> Result<(), Trap> + Send> Engine for Lying<F> {
    fn name(&self) -> &'static str {
        "lying"
    }

    fn run(&mut self, entry: Entry, image: &mut Image, limits: Limits<'_>) -> Result<(), Trap> {
        self.runs += 1;
        self.engine.run(entry, image, limits)?;
        if self.runs == self.wrong_run { (self.lie)(image) } else { Ok(()) }
    }

    fn code_bytes(&self) -> usize {
        0
    }
}

/// The standard sides, where native code with fuel lies in its third run.
fn engines(
    program: &Program,
    lie: impl FnMut(&mut Image) -> Result<(), Trap> + Send + 'static,
) -> Vec<EngineUnderTest> {
    let mut engines = EngineUnderTest::standard(program, MAX_IMAGE_BYTES).unwrap();
    let position = engines.iter().position(|side| side.name == "jit with fuel").unwrap();
    let honest = EngineUnderTest::new(program, EngineKind::Jit, true, MAX_IMAGE_BYTES).unwrap();
    engines[position].engine = Box::new(Lying { engine: honest.engine, runs: 0, wrong_run: 3, lie });
    engines
}

/// The difference that a lie makes, with three more rounds looked at.
fn found(text: &str, lie: impl FnMut(&mut Image) -> Result<(), Trap> + Send + 'static) -> Difference {
    let program = program(text);
    let options = Options { watchdog_us: 10_000, ..Options::default() };
    let mut lockstep = Lockstep::open(&program, engines(&program, lie), options).unwrap();
    let mut found = lockstep.run(None, 10).expect_err("a lie is found");
    lockstep.follow(&mut found, None, 3);
    *found
}

/// Writes a literal to a variable.
fn set(text: &str, name: &str, literal: &'static str) -> impl FnMut(&mut Image) -> Result<(), Trap> + Send + use<> {
    let names = khz_machine::variables::VariableTable::of(program(text).container());
    let variable = names.resolve(name).unwrap();
    move |image| {
        names.write(image, &variable, literal).unwrap();
        Ok(())
    }
}

#[test]
fn a_wrong_value_is_told_with_its_round_and_its_statement() {
    let found = found(COUNTER, set(COUNTER, "main.total", "77"));
    assert_eq!((found.round, &found.endings, found.byte), (3, &None, None));
    assert_eq!(found.sides, ["interp with fuel", "jit with fuel"]);
    assert_eq!(found.verdict, Verdict::AgreesWith(vec!["interp with fuel".into()]));
    // `total` is computed anew each round, so nothing else comes to differ.
    assert_eq!(found.variables.len(), 1, "{found:?}");
    let variable = &found.variables[0];
    assert_eq!((variable.name.as_str(), variable.round), ("main.total", 3));
    assert_eq!((&variable.values, variable.evaluator.as_deref()), (&["6".to_string(), "77".to_string()], Some("6")));
    let place = variable.statement[0].source.as_ref().unwrap();
    assert_eq!((place.file.as_str(), place.line), ("main.st", 10), "the second statement that writes it");
}

#[test]
fn what_a_wrong_value_leads_to_is_told_with_its_own_round() {
    let found = found(COUNTER, set(COUNTER, "main.scan", "50"));
    let seen: Vec<(&str, u64)> = found.variables.iter().map(|v| (v.name.as_str(), v.round)).collect();
    assert_eq!(seen, [("main.scan", 3), ("main.total", 4), ("main.other", 4), ("main.sum.x", 4), ("main.sum.y", 4)]);
    assert!(found.variables[1].evaluator.is_none(), "only the first round is repeated");
}

#[test]
fn a_statement_in_a_block_is_told_with_the_calls_that_led_there() {
    let found = found(COUNTER, set(COUNTER, "main.sum.y", "-1"));
    let lines: Vec<u32> =
        found.variables[0].statement.iter().map(|place| place.source.as_ref().unwrap().line).collect();
    assert_eq!(lines, [4, 11]);
}

#[test]
fn a_variable_that_nobody_wrote_has_no_statement() {
    let text = "PROGRAM main VAR still, count : INT; END_VAR count := count + 1; END_PROGRAM";
    let found = found(text, set(text, "main.still", "9"));
    assert_eq!(found.variables[0].name, "main.still");
    assert!(found.variables[0].statement.is_empty());
}

#[test]
fn an_ending_of_another_kind_is_a_difference() {
    let trap = Trap::new(TrapCode::DivideByZero, CodePlace::default(), [0; 3]);
    let found = found(COUNTER, move |_| Err(trap));
    let endings = found.endings.expect("they end otherwise");
    assert!(endings[0].starts_with("no trap") && endings[1].contains("divide by zero"), "{endings:?}");
    assert_eq!(found.verdict, Verdict::AgreesWith(vec!["interp with fuel".into()]));
}

#[test]
fn a_byte_outside_of_all_variables_is_a_difference() {
    let found = found("PROGRAM main VAR a AT %MB4 : BYTE; END_VAR a := 1; END_PROGRAM", |image: &mut Image| {
        let first = image.layout().memory.start as usize;
        image.bytes_mut()[first] = 0xFF;
        Ok(())
    });
    assert!(found.variables.is_empty(), "{found:?}");
    assert_eq!(found.byte.map(|(_, values)| values), Some([0, 0xFF]));
}

/// Inputs of several types, and variables that are none.
const INPUTS: &str = "\
TYPE Mode : (off, slow, fast := 7); END_TYPE
TYPE Percent : INT (0..100); END_TYPE
PROGRAM main
VAR_INPUT go : BOOL; level : INT; share : Percent; mode : Mode; wait : TIME; flow : REAL; name : STRING[5]; END_VAR
VAR kept : INT := 5; END_VAR
VAR_OUTPUT result : INT; END_VAR
  IF go THEN result := level; END_IF;
END_PROGRAM
";

#[test]
fn random_inputs_are_values_of_their_types_and_change() {
    let program = program(INPUTS);
    let layout = program.layout(MAX_IMAGE_BYTES).unwrap();
    let mut image = program.image(MAX_IMAGE_BYTES).unwrap();
    let names = khz_machine::variables::VariableTable::of(program.container());
    let mut inputs = RandomInputs::new(&program, &layout, 1, &["MAIN.flow".to_string()]);
    assert_eq!(inputs.names().count(), 6, "kept ones and those that are no inputs are left out");
    let wanted = ["main.go", "main.level", "main.share", "main.mode", "main.wait", "main.name"];
    let mut seen: Vec<BTreeSet<String>> = vec![BTreeSet::new(); wanted.len()];
    for _ in 0..300 {
        inputs.apply(&mut image);
        for (name, seen) in wanted.iter().zip(&mut seen) {
            seen.insert(names.text(&image, &names.resolve(name).unwrap()));
        }
        for (name, value) in [("main.kept", "5"), ("main.flow", "0.0"), ("main.result", "0")] {
            assert_eq!(names.text(&image, &names.resolve(name).unwrap()), value, "{name}");
        }
    }
    assert_eq!(seen[0].len(), 2);
    assert!(seen[1].len() > 50 && seen[1].contains("32767"), "{:?}", seen[1]);
    assert!(seen[2].iter().all(|share| (0..=100).contains(&share.parse::<i32>().unwrap())), "{:?}", seen[2]);
    assert!(seen[2].contains("0") && seen[2].contains("100") && seen[2].len() > 20);
    assert_eq!(seen[3].len(), 3, "{:?}", seen[3]);
    assert!(seen[4].len() > 50, "{:?}", seen[4]);
    assert!(seen[5].len() > 50 && seen[5].contains("''"), "{:?}", seen[5]);
}

#[test]
fn located_inputs_come_before_those_of_programs() {
    let text = "PROGRAM main VAR_INPUT a : INT; END_VAR VAR bit AT %IX3.2 : BOOL; word AT %IW0 : INT; out AT %QW0 : INT; END_VAR out := word; END_PROGRAM";
    let program = program(text);
    let layout = program.layout(MAX_IMAGE_BYTES).unwrap();
    let mut inputs = RandomInputs::new(&program, &layout, 1, &[]);
    assert_eq!(inputs.names().collect::<Vec<_>>(), ["main.bit", "main.word"]);
    let [mut first, mut second] = [(); 2].map(|()| program.image(MAX_IMAGE_BYTES).unwrap());
    let mut changes = 0;
    for _ in 0..50 {
        let before = first.clone();
        inputs.apply(&mut first);
        changes += usize::from(before.first_difference(&first).is_some());
        inputs.copy(&first, &mut second);
        assert_eq!(first.first_difference(&second), None);
    }
    assert!(changes > 15, "{changes}");
    // Kept ones are not changed by way of their bytes.
    let kept = ["MAIN.bit", "main.word"].map(str::to_string);
    let mut none = RandomInputs::new(&program, &layout, 1, &kept);
    assert!(none.is_empty() && !none.is_nameless());
    let before = first.clone();
    (0..50).for_each(|_| none.apply(&mut first));
    assert_eq!(before.first_difference(&first), None);
}

#[test]
fn inputs_of_a_program_that_has_no_located_ones() {
    let program = program(
        "PROGRAM main VAR_INPUT a : INT; b : ARRAY[1..3] OF BOOL; END_VAR VAR c : INT; END_VAR c := a; END_PROGRAM",
    );
    let layout = program.layout(MAX_IMAGE_BYTES).unwrap();
    let inputs = RandomInputs::new(&program, &layout, 1, &[]);
    assert_eq!(inputs.names().collect::<Vec<_>>(), ["main.a", "main.b[1]", "main.b[2]", "main.b[3]"]);
}

/// Divides by an input: it traps now and then.
const TRAPS: &str =
    "PROGRAM main VAR_INPUT a : INT; END_VAR VAR scan, b : INT; END_VAR scan := scan + 1; b := 100 / a; END_PROGRAM";

#[test]
fn random_inputs_run_on_after_a_trap_from_a_seed() {
    let scratch = Scratch::new("diff-seed");
    let source = scratch.write("traps.st", TRAPS);
    let run = |words: &[&str]| {
        let output = khz().arg("diff").arg(&source).args(words).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stdout(&output)
    };
    let first = run(&["--seed", "4", "--scans", "400", "--format", "json"]);
    assert_eq!(first, run(&["--seed", "4", "--scans", "400", "--format", "json"]), "a seed is a run");
    assert_ne!(first, run(&["--seed", "5", "--scans", "400", "--format", "json"]));
    let told: serde_json::Value = serde_json::from_str(&first).unwrap();
    assert_eq!((&told["equal"], &told["rounds"]), (&true.into(), &400.into()));
    assert!(told["traps"]["divide by zero"].as_u64().is_some_and(|count| count > 3), "{told}");
    assert!(told["trap"].is_null(), "{told}");
    let still = run(&["--seed", "4", "--scans", "400", "--format", "json", "--set", "main.a=3"]);
    assert!(still.contains("\"traps\":{}"), "what --set names is left alone: {still}");
}

#[test]
fn random_and_recorded_inputs_exclude_each_other() {
    let output = khz().args(["diff", "examples/bottling.st", "--seed", "1", "--inputs", "x.csv"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

/// An event task waits for an input: time goes on although nothing is due.
#[test]
fn random_inputs_start_event_tasks() {
    let text = "PROGRAM main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM \
        CONFIGURATION c VAR_GLOBAL go AT %IX0.0 : BOOL; END_VAR RESOURCE r ON PLC \
        TASK t(SINGLE := go, PRIORITY := 0); PROGRAM p WITH t : main; END_RESOURCE END_CONFIGURATION";
    let program = program(text);
    let engines = EngineUnderTest::standard(&program, MAX_IMAGE_BYTES).unwrap();
    let options = Options { idle_goes_on: true, ..Options::default() };
    let mut lockstep = Lockstep::open(&program, engines, options).unwrap();
    let mut inputs = RandomInputs::new(&program, lockstep.image().layout(), 2, &[]);
    let summary = lockstep.run(Some(&mut inputs), 200).unwrap();
    assert_eq!(summary.rounds, 200);
    assert!((10..60).contains(&summary.cycles), "{summary:?}");
}

#[test]
fn generated_programs_are_the_same_whatever_the_threads() {
    let run = |words: &[&str]| {
        let output = khz().args(["diff", "--random", "41", "--seed", "12"]).args(words).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        (stdout(&output), stderr(&output))
    };
    let one = run(&["--threads", "1"]);
    assert_eq!(one, run(&["--threads", "3"]));
    assert!(one.1.contains("equal: 41 programs, 10 scans each, from seed 12 on ("), "{}", one.1);
    assert!(one.1.contains("containers: programs 20 "), "one of the pair is left out: {}", one.1);
    let told: serde_json::Value = serde_json::from_str(&run(&["--format", "json"]).0).unwrap();
    assert_eq!((&told["equal"], &told["programs"], &told["seed"]), (&true.into(), &41.into(), &12.into()));
    let (compared, refused) = (told["compared"].as_u64().unwrap(), told["refused"].as_u64().unwrap());
    assert!(compared >= 38 && compared + refused == 41, "every program is accounted for: {told}");
    assert!(one.1.contains(&format!("({compared} compared, {refused} refused by the compiler)")), "{}", one.1);
    assert!(told["reached"].as_str().is_some_and(|text| text.contains("Structured Text: ")), "{told}");
    let output = khz().args(["diff", "--random", "3", "examples/bottling.st"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

#[test]
fn options_that_would_count_for_nothing_are_refused() {
    let last = u64::MAX.to_string();
    let cases: [(&[&str], &str); 10] = [
        (&["--random", "0"], "0 is not in 1.."),
        (&["--random", "9", "--seed", &last], "beyond 64 bits"),
        (&["--random", "2", "--scans", "5"], "--scans"),
        (&["--random", "2", "--engine", "jit"], "--engine"),
        (&["--random", "2", "--tolerance", "1"], "--tolerance"),
        (&["--random", "2", "--watchdog-us", "5"], "--watchdog-us"),
        (&["--random", "2", "--max-image", "5000"], "--max-image"),
        (&["--threads", "2", "examples/bottling.st"], "--threads"),
        (&["--inputs", "x.csv", "--tolerance", "1", "examples/bottling.st"], "--tolerance"),
        (&["--engine", "jit", "examples/bottling.st"], "--against"),
    ];
    for (words, wanted) in cases {
        let output = khz().arg("diff").args(words).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{words:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(wanted), "{words:?}: {}", stderr(&output));
    }
}
