//! Generates a project as large as they come (30,000 lines, 500 units that call one another, types and globals) and measures how
//! long checking and building take and how much memory.
//!
//! ```sh
//! cargo run --release --example large_project              # 500 units of 60 lines
//! cargo run --release --example large_project 1000 60      # twice as many: times should double
//! ```

#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example measures and prints")]

use std::fmt::Write;
use std::time::Instant;

use khz_frontend::{CompileOptions, SourceInput};
use kilohertz::{khz_frontend, pipeline};

/// A file of the project: every tenth unit begins a new one, with a type of its own.
fn project(units: usize, lines: usize) -> Vec<SourceInput> {
    let mut files = Vec::new();
    let mut text = String::new();
    for unit in 0..units {
        if unit % 10 == 0 {
            types(&mut text, unit / 10);
        }
        block(&mut text, unit, lines);
        if unit % 10 == 9 || unit + 1 == units {
            let name = format!("part{}.st", files.len());
            files.push(SourceInput { name, bytes: std::mem::take(&mut text).into_bytes() });
        }
    }
    put(&mut text, format_args!("PROGRAM Main\nVAR\n  go : BOOL := TRUE;\n"));
    (0..units).for_each(|unit| put(&mut text, format_args!("  unit{unit} : Unit{unit};\n")));
    put(&mut text, format_args!("END_VAR\n"));
    (0..units).for_each(|unit| put(&mut text, format_args!("  unit{unit}(enable := go, value := {});\n", unit % 100)));
    put(&mut text, format_args!("END_PROGRAM\n"));
    files.push(SourceInput { name: "main.st".to_owned(), bytes: text.into_bytes() });
    files
}

fn put(text: &mut String, what: std::fmt::Arguments<'_>) {
    // Writing to a String does not fail.
    let _ = text.write_fmt(what);
}

fn types(text: &mut String, number: usize) {
    put(text, format_args!("TYPE\n  State{number} : (idle{number}, busy{number}, done{number}, failed{number});\n"));
    put(
        text,
        format_args!(
            "  Sample{number} : STRUCT\n    level : REAL;\n    count : DINT;\n    history : ARRAY[0..9] OF INT;\n"
        ),
    );
    put(text, format_args!("    state : State{number};\n  END_STRUCT;\nEND_TYPE\n"));
    put(text, format_args!("VAR_GLOBAL\n  total{number} : DINT;\n  limit{number} : REAL := 12.5;\nEND_VAR\n"));
    put(text, format_args!("FUNCTION Scale{number} : REAL\nVAR_INPUT\n  x : REAL;\n  k : INT;\nEND_VAR\n"));
    put(text, format_args!("  Scale{number} := x * INT_TO_REAL(k) + limit{number};\nEND_FUNCTION\n"));
}

/// A function block with an instance of the one before it.
fn block(text: &mut String, unit: usize, lines: usize) {
    let group = unit / 10;
    put(text, format_args!("FUNCTION_BLOCK Unit{unit}\nVAR_INPUT\n  enable : BOOL;\n  value : INT;\nEND_VAR\n"));
    put(
        text,
        format_args!(
            "VAR_OUTPUT\n  out : DINT;\n  alarm : BOOL;\nEND_VAR\nVAR\n  s : Sample{group};\n  i : INT;\n  timer : TON;\n"
        ),
    );
    if !unit.is_multiple_of(10) {
        put(text, format_args!("  inner : Unit{};\n", unit - 1));
    }
    put(text, format_args!("END_VAR\n  timer(IN := enable, PT := T#100ms);\n"));
    if !unit.is_multiple_of(10) {
        put(text, format_args!("  inner(enable := timer.Q, value := value, out => out);\n"));
    }
    let mut written = 17;
    while written + 9 < lines {
        let step = written;
        put(text, format_args!("  (* step {step} of unit {unit} *)\n  IF enable AND s.level < limit{group} THEN\n"));
        put(text, format_args!("    s.level := Scale{group}(s.level, value) + {step}.25;\n"));
        put(text, format_args!("    FOR i := 0 TO 9 DO\n      s.history[i] := s.history[i] + value;\n    END_FOR;\n"));
        put(text, format_args!("    total{group} := total{group} + INT_TO_DINT(s.history[{}]);\n", step % 10));
        put(text, format_args!("    s.state := busy{group};\n  END_IF;\n"));
        written += 9;
    }
    put(text, format_args!("  alarm := s.state = failed{group};\n  out := out + s.count;\nEND_FUNCTION_BLOCK\n"));
}

/// The most memory that this process had, in MiB.
fn peak_mib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) / 1024
}

fn main() {
    let mut words = std::env::args().skip(1).filter_map(|word| word.parse::<usize>().ok());
    let units = words.next().unwrap_or(500);
    let lines = words.next().unwrap_or(60);
    let files = project(units, lines);
    let count = |file: &SourceInput| file.bytes.iter().filter(|byte| **byte == b'\n').count();
    println!("{units} units, {} files, {} lines", files.len(), files.iter().map(count).sum::<usize>());
    let options = CompileOptions::default();
    for round in 1..=3 {
        let start = Instant::now();
        let checked = khz_frontend::check(&files, &options);
        let check_ms = start.elapsed().as_millis();
        if let Some(first) = checked.diagnostics.first() {
            println!("{} {} {}", checked.sources.place(first.span), first.code(), first.message);
        }
        drop(checked);
        let start = Instant::now();
        let built = pipeline::compile(&files, &options);
        let build_ms = start.elapsed().as_millis();
        let bytes = match &built {
            Ok(loaded) => loaded.programs.iter().map(|program| program.container_bytes).sum::<usize>(),
            Err(error) => {
                println!("refused: {error}");
                std::process::exit(1);
            }
        };
        println!(
            "round {round}: check {check_ms} ms, build with verification {build_ms} ms, container {bytes} bytes, peak {} MiB",
            peak_mib()
        );
    }
}
