//! Programs that the benches share, and how they are loaded.

use std::fmt::Write;

use khz_frontend::{CompileOptions, SourceInput};
use kilohertz::pipeline::{self, Program};

/// A control loop with arrays and floats: 32 PID controllers against first-order plants.
pub const PID: &str = "
PROGRAM main
VAR
  i : DINT; sp, pv, integ, prev : ARRAY[0..31] OF LREAL; e, d, u, checksum : LREAL; scans : DINT;
END_VAR
  checksum := 0.0; scans := scans + 1;
  FOR i := 0 TO 31 DO
    sp[i] := 10.0 + DINT_TO_LREAL(i);
    e := sp[i] - pv[i];
    integ[i] := LIMIT(-50.0, integ[i] + e * 0.001, 50.0);
    d := (e - prev[i]) / 0.001; prev[i] := e;
    u := LIMIT(-100.0, 1.2 * e + 0.4 * integ[i] + 0.05 * d, 100.0);
    pv[i] := pv[i] + (u - pv[i]) * 0.005;
    checksum := checksum + pv[i];
  END_FOR;
END_PROGRAM";

/// An empty scan: what remains is the engine's and the scheduler's own time.
pub const EMPTY: &str = "PROGRAM main VAR scans : DINT; END_VAR scans := scans + 1; END_PROGRAM";

/// `rungs` boolean networks, each reading earlier coils.
pub fn ladder(rungs: usize) -> String {
    let mut text = String::from("PROGRAM main\nVAR scans : DINT;");
    for rung in 0..rungs {
        // Writing to a string does not fail.
        let _ = write!(text, " q{rung} : BOOL;");
    }
    text.push_str("\nEND_VAR\nscans := scans + 1; q0 := scans MOD 2 = 0;\n");
    for rung in 1..rungs {
        let (a, b, c) = (rung - 1, rung / 2, rung * 7 % rung);
        let _ = writeln!(text, "q{rung} := (q{a} AND NOT q{b}) OR (q{c} AND NOT q{rung});");
    }
    text + "END_PROGRAM"
}

/// One source file.
pub fn source(text: &str) -> SourceInput {
    SourceInput { name: "bench.st".into(), bytes: text.into() }
}

/// Compiled and verified.
pub fn program(text: &str) -> Program {
    let loaded = pipeline::compile(&[source(text)], &CompileOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    loaded.programs.into_iter().next().expect("one RESOURCE")
}
