//! Listings of machine code and what is counted in them, against the code that runs.

mod common;

use std::collections::BTreeMap;

use common::{Scratch, khz, root, stderr, stdout};
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_frontend::{CompileOptions, SourceInput};
use khz_jit::listing::{Row, Unit, listing};
use khz_jit::{Jit, JitOptions, Symbol};
use khz_proof::harness::programs::PROGRAMS;
use kilohertz::pipeline::{self, Program};
use serde_json::Value;

/// 10 passes of a loop whose body is an IF that holds in 4 of them, a call that is not inlined for its loop, a run of elements in vectors.
const PROGRAM: &str = "\
FUNCTION Steps : DINT
VAR_INPUT n : DINT; END_VAR
VAR k : DINT; END_VAR
FOR k := 1 TO n DO
  Steps := Steps + (k XOR Steps) MOD 7;
END_FOR;
END_FUNCTION
PROGRAM Main
VAR i, n, m : DINT; v : ARRAY[0..63] OF LREAL; j : DINT; END_VAR
FOR i := 0 TO 9 DO
  IF i MOD 3 = 0 THEN
    n := n + Steps(i) * 3;
  END_IF;
END_FOR;
FOR j := 0 TO 63 DO
  v[j] := v[j] * 1.5 + 0.25;
END_FOR;
IF n < 0 THEN
  m := Steps(n);
END_IF;
END_PROGRAM
";

fn program(text: &str) -> Option<Program> {
    let source = SourceInput { name: "plant.st".into(), bytes: text.into() };
    pipeline::compile(&[source], &CompileOptions::default()).ok()?.programs.into_iter().next()
}

fn engine(program: &Program, options: JitOptions) -> Jit {
    program.jit(&program.layout(MAX_IMAGE_BYTES).unwrap(), options).unwrap()
}

fn units(program: &Program) -> Vec<Unit> {
    listing(&program.verified, &program.layout(MAX_IMAGE_BYTES).unwrap(), JitOptions::default(), None).unwrap()
}

/// Holds a listing against the code that runs: the same instructions, but for the addresses in those that name other code.
fn same_code(name: &str, unit: &Unit, symbol: &Symbol<'_>) {
    assert_eq!(unit.code.len(), symbol.code.len(), "{name}: {}", unit.name);
    for row in unit.rows.iter().filter(|row| row.callee.is_none()) {
        let bytes = row.offset as usize..(row.offset + row.bytes) as usize;
        assert_eq!(unit.code[bytes.clone()], symbol.code[bytes], "{name}: {} at {:#x}", unit.name, row.offset);
    }
    for range in &symbol.lines {
        let row = unit.rows.iter().find(|row| row.offset == range.offset);
        let row = row.unwrap_or_else(|| panic!("{name}: {}: a line starts inside of an instruction", unit.name));
        assert_eq!(row.source.as_ref(), Some(&(range.file.clone(), range.line)), "{name}: {}", unit.name);
    }
}

#[test]
fn what_is_listed_is_what_runs() {
    let mut compared = 0;
    let folders: Vec<_> = PROGRAMS.iter().map(|folder| root().join(folder)).collect();
    // A third of them, since all take a quarter of a minute.
    for file in kilohertz::files::list(&folders).unwrap().into_iter().step_by(3) {
        let Ok(text) = std::fs::read_to_string(&file) else { continue };
        let Some(program) = program(&text) else { continue };
        let engine = engine(&program, JitOptions { note_lines: true, ..JitOptions::default() });
        let (symbols, units) = (engine.symbols(), units(&program));
        assert_eq!(
            symbols.iter().map(|symbol| symbol.code.len()).sum::<usize>(),
            khz_machine::engine::Engine::code_bytes(&engine)
        );
        // A function that exists once for each combination of its open arrays has one name; both lists have them in the same order.
        let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
        for symbol in &symbols {
            let name = file.display().to_string();
            let same_name = seen.entry(&symbol.name).or_default();
            let unit = units.iter().filter(|unit| unit.name == symbol.name).nth(*same_name);
            *same_name += 1;
            same_code(&name, unit.unwrap_or_else(|| panic!("{name}: no listing of {}", symbol.name)), symbol);
            compared += 1;
        }
    }
    assert!(compared > 300, "{compared}");
}

#[test]
fn every_byte_is_listed_once_and_calls_say_where_to() {
    let units = units(&program(PROGRAM).unwrap());
    assert_eq!(units.iter().map(|unit| unit.name.as_str()).collect::<Vec<_>>(), ["Steps", "Main [Main]"]);
    for unit in &units {
        let mut end = 0;
        for row in &unit.rows {
            assert_eq!(row.offset, end, "{}", unit.name);
            end += row.bytes;
        }
        assert_eq!(end as usize, unit.code.len(), "{}", unit.name);
    }
    let calls = |row: &Row| row.callee.as_deref() == Some("Steps");
    assert!(units[1].rows.iter().any(calls), "{:?}", units[1].rows);
    assert!(units[1].rows.iter().filter(|row| calls(row)).all(|row| matches!(row.source, Some((_, 12 | 19)))));
}

/// What `--hot` counts of PROGRAM in so many rounds.
fn hot(scratch: &Scratch, rounds: &str) -> Value {
    let source = scratch.write("plant.st", PROGRAM);
    let words = ["disasm", "--asm", "--hot", "--format", "json", "--scans", rounds];
    let output = khz().args(words).arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

fn instructions(figures: &Value, line: u64) -> u64 {
    let lines = figures["lines"].as_array().unwrap();
    lines.iter().find(|row| row["line"] == line).map_or(0, |row| row["instructions"].as_u64().unwrap())
}

#[test]
fn each_instruction_is_counted_as_often_as_it_runs() {
    let scratch = Scratch::new("hot");
    let (ten, thirty) = (hot(&scratch, "10"), hot(&scratch, "30"));
    // The program does the same each round but for values: three times the rounds, three times the instructions, line by line.
    assert_eq!(ten["rounds"], 10);
    for line in 1..=30 {
        assert_eq!(instructions(&ten, line) * 3, instructions(&thirty, line), "line {line}");
    }
    let sum: u64 = ten["lines"].as_array().unwrap().iter().map(|row| row["instructions"].as_u64().unwrap()).sum();
    assert_eq!(ten["instructions"], sum);
    assert_eq!(instructions(&ten, 19), 0, "what is not run costs nothing");
    // 0 + 3 + 6 + 9 passes of the inner loop a round, 4 calls, 10 passes of the outer one.
    let text = ten["text"].as_str().unwrap();
    let count = |part: &str| -> Vec<u64> {
        let lines = text.lines().filter(|line| line.contains(part) && !line.starts_with(';'));
        lines.map(|line| line.split_whitespace().next().unwrap().parse().unwrap()).collect()
    };
    assert_eq!(count("; Steps"), [40, 0], "{text}");
    assert!(count("xorl").contains(&180), "{text}");
    // 64 elements, 2 in a vector, some vectors a pass: all multiplications together do 64 a round.
    let vectors: u64 = count("mulpd").iter().sum();
    assert_eq!(vectors * 2, 640, "{text}");
    assert_eq!(ten["text"], hot(&scratch, "10")["text"], "the same run, the same counts");
}

#[test]
fn hot_lines_name_the_most_expensive_first_and_need_asm() {
    let scratch = Scratch::new("hot-table");
    let source = scratch.write("plant.st", PROGRAM);
    let output = khz().args(["disasm", "--asm", "--hot"]).arg(&source).output().unwrap();
    let text = stdout(&output);
    let (first, second) = (text.lines().nth(1).unwrap(), text.lines().nth(2).unwrap());
    assert!(first.contains("plant.st:5  Steps := Steps + (k XOR Steps) MOD 7;") && first.contains('%'), "{text}");
    assert!(second.contains("plant.st:"), "{text}");
    for words in [&["disasm", "--hot"][..], &["disasm", "--asm", "--scans", "4"], &["disasm", "--set", "Main.n=4"]] {
        let output = khz().args(words).arg(&source).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{words:?}: {}", stderr(&output));
    }
}

#[test]
fn a_trap_while_counting_is_reported_as_in_a_run() {
    let scratch = Scratch::new("hot-trap");
    let source = scratch
        .write("trap.st", "PROGRAM Main VAR n : DINT := 3; m : DINT; END_VAR n := n - 1; m := 5 / n; END_PROGRAM");
    let output = khz().args(["disasm", "--asm", "--hot"]).arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("trap.st:1:"), "{}", stderr(&output));
}

#[test]
fn a_stripped_container_is_listed_without_lines() {
    let scratch = Scratch::new("hot-stripped");
    let (source, container) = (scratch.write("plant.st", PROGRAM), scratch.path("plant.iplc"));
    let built = khz().args(["build", "--strip", "-o"]).arg(&container).arg(&source).output().unwrap();
    assert_eq!(built.status.code(), Some(0), "{}", stderr(&built));
    let output = khz().args(["disasm", "--asm", "--hot"]).arg(&container).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).contains("; function 1 [instance 0]: "), "{}", stdout(&output));
}
