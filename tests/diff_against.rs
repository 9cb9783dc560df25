//! `khz diff --against`: a program against traces, recorded by ourselves and changed, and against files that are no traces.

mod common;

use std::path::{Path, PathBuf};
use std::process::Output;

use common::{Scratch, khz, stderr, stdout};
use khz_frontend::{CompileOptions, SourceInput};
use khz_proof::random::Random;
use kilohertz::pipeline;
use kilohertz::traces::{Choice, Mapping, Trace};
use serde_json::Value;

/// A tank that is filled through a valve; the inputs are located.
const TANK: &str = "\
TYPE Mode : (idle, filling, full); END_TYPE
PROGRAM main
VAR CONSTANT limit : REAL := 2.0; END_VAR
VAR
  open AT %IX0.0 : BOOL;
  inflow AT %ID1 : REAL;
  level : REAL; alarm : BOOL; count : DINT; wait : TON; name : STRING[8]; mode : Mode; since : TIME; big : ULINT;
  field : ARRAY[1..2] OF INT;
END_VAR
  IF open THEN level := level + inflow * 0.01; ELSE level := level * 0.99; END_IF;
  wait(IN := level > limit, PT := T#50ms);
  alarm := wait.Q;
  since := wait.ET;
  count := count + 1;
  big := 16#FFFF_FFFF_FFFF_FF00 + DINT_TO_ULINT(count);
  field[2] := DINT_TO_INT(count * 2);
  IF alarm THEN name := 'high'; mode := Mode#full; ELSIF open THEN name := 'ok'; mode := Mode#filling; ELSE name := 'a, b'; mode := Mode#idle; END_IF;
END_PROGRAM
CONFIGURATION c RESOURCE r ON PLC TASK t(INTERVAL := T#10ms, PRIORITY := 0); PROGRAM main WITH t : main; END_RESOURCE END_CONFIGURATION
";

const INPUTS: &str = "time_us,main.open,main.inflow\n0,0,0.0\n20000,1,10.0\n400000,0,10.0\n900000,1,2.5\n";
const WATCHED: &str =
    "main.open,main.inflow,main.level,main.alarm,main.name,main.mode,main.since,main.big,main.field[2]";

struct Recorded {
    scratch: Scratch,
    source: PathBuf,
    trace: PathBuf,
}

impl Recorded {
    /// The tank and 200 rounds of it.
    fn new(name: &str) -> Recorded {
        let scratch = Scratch::new(name);
        let source = scratch.write("tank.st", TANK);
        let (inputs, trace) = (scratch.write("inputs.csv", INPUTS), scratch.path("trace.csv"));
        let mut run = khz();
        run.args(["run", "--clock", "virtual", "--scans", "200", "--watch", WATCHED, "--inputs"]).arg(inputs);
        let output = run.arg("--trace").arg(&trace).arg(&source).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        Recorded { scratch, source, trace }
    }

    /// The trace's lines, each changed.
    fn changed(&self, name: &str, mut change: impl FnMut(usize, Vec<String>) -> Option<Vec<String>>) -> PathBuf {
        let text = std::fs::read_to_string(&self.trace).unwrap();
        let mut out = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes());
        for (line, row) in reader.records().enumerate() {
            let cells = row.unwrap().iter().map(str::to_string).collect();
            if let Some(cells) = change(line + 1, cells) {
                out.write_record(cells).unwrap();
            }
        }
        self.scratch.write(name, out.into_inner().unwrap())
    }
}

fn against(source: &Path, trace: &Path, words: &[&str]) -> Output {
    khz().arg("diff").arg(source).arg("--against").arg(trace).args(words).output().unwrap()
}

/// The answer for programs, after checking the status.
fn answer(source: &Path, trace: &Path, words: &[&str], status: i32) -> Value {
    let output = against(source, trace, &[words, &["--format", "json"]].concat());
    assert_eq!(output.status.code(), Some(status), "{}{}", stdout(&output), stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

fn variable<'v>(answer: &'v Value, name: &str) -> &'v Value {
    let all = answer["variables"].as_array().unwrap();
    all.iter().find(|variable| variable["variable"] == name).unwrap_or_else(|| panic!("no {name} in {answer}"))
}

#[test]
fn a_program_is_equal_to_its_own_trace() {
    let tank = Recorded::new("against-own");
    for engine in ["both", "jit", "interp"] {
        let told = answer(&tank.source, &tank.trace, &["--engine", engine], 0);
        assert_eq!((&told["equal"], &told["rows"], &told["offset_us"]), (&true.into(), &200.into(), &0.into()));
        assert_eq!(told["driven_by"], serde_json::json!(["main.open", "main.inflow"]));
        for variable in told["variables"].as_array().unwrap() {
            assert_eq!((&variable["compared"], &variable["beyond"]), (&200.into(), &0.into()), "{variable}");
            assert!(variable["largest"].is_null() && variable["first"].is_null(), "{variable}");
        }
    }
    let output = against(&tank.source, &tank.trace, &[]);
    assert!(stderr(&output).contains("equal within the tolerances"), "{}", stderr(&output));
}

#[test]
fn a_changed_program_differs_from_the_row_on_at_which_it_is_another() {
    let tank = Recorded::new("against-changed");
    let other = tank.scratch.write("other.st", TANK.replace("T#50ms", "T#70ms"));
    let told = answer(&other, &tank.trace, &[], 5);
    // The alarm rose in line 28, at 0.26 s, and now rises two scans later.
    let alarm = variable(&told, "main.alarm");
    assert_eq!(alarm["beyond"], 2);
    let first = serde_json::json!({ "line": 28, "trace_us": 260_000, "time_us": 260_000, "trace": "TRUE", "program": "FALSE", "deviation": 1.0 });
    assert_eq!(alarm["first"], first);
    let statement = &alarm["statement"];
    assert_eq!((&statement["line"], &statement["text"]), (&12.into(), &"alarm := wait.Q;".into()), "{alarm}");
    assert!(variable(&told, "main.level")["statement"].is_null(), "it does not differ");
    assert_eq!(variable(&told, "main.name")["first"]["trace"], "'high'");
    assert_eq!(variable(&told, "main.mode")["first"]["program"], "filling");
    assert_eq!(variable(&told, "main.level")["beyond"], 0);
    let human = against(&other, &tank.trace, &[]);
    assert!(
        stderr(&human).contains("first in line 28, at 0.260000 s: trace TRUE, program FALSE"),
        "{}",
        stderr(&human)
    );
    assert!(stderr(&human).contains("written last at ") && stderr(&human).contains("      alarm := wait.Q;\n"));
    assert!(stderr(&human).contains("differs from the trace in 4 of 7 variables"), "{}", stderr(&human));
}

#[test]
fn tolerances_count_for_their_variables_and_for_the_rest_of_the_reals() {
    let tank = Recorded::new("against-tolerance");
    let other =
        tank.scratch.write("other.st", TANK.replace("inflow * 0.01", "inflow * 0.0101").replace("T#50ms", "T#70ms"));
    let told = answer(&other, &tank.trace, &[], 5);
    let level = variable(&told, "main.level");
    assert!(level["beyond"].as_u64().unwrap() > 100, "{level}");
    let largest = level["largest"]["deviation"].as_f64().unwrap();
    assert!((0.03..0.06).contains(&largest), "1 % of 3.8: {level}");
    let beyond = |words: &[&str]| {
        let told = answer(&other, &tank.trace, words, 5);
        (
            variable(&told, "main.level")["beyond"].as_u64().unwrap(),
            variable(&told, "main.since")["beyond"].as_u64().unwrap(),
        )
    };
    let (level, since) = beyond(&["--tolerance", "0.06"]);
    assert!(level == 0 && since > 0);
    assert_eq!(beyond(&["--tolerance", "0,0.0101"]).0, 0, "relative");
    assert!(beyond(&["--tolerance", "MAIN.level=0.02"]).0 > 0);
    assert_eq!(
        beyond(&["--tolerance", "1", "--tolerance", "main.level=0"]).0,
        variable(&told, "main.level")["beyond"].as_u64().unwrap()
    );
    assert_eq!(beyond(&["--tolerance", "main.since=T#20ms"]).1, 0, "two scans");
    assert!(beyond(&["--tolerance", "main.since=T#19ms"]).1 > 0);
    let wrong =
        ["main.level=-1", "nan", "main.nothing=1", "main.level=1,x", "main.since=T#-5ms", "main.level=T#5ms", "T#5ms"];
    for wrong in wrong.into_iter().chain(["main.name=1", "main.mode=1", "main.alarm=1"]) {
        let output = against(&other, &tank.trace, &["--tolerance", wrong]);
        assert_eq!(output.status.code(), Some(2), "{wrong}: {}", stderr(&output));
    }
}

#[test]
fn a_mapping_gives_names_and_units() {
    let tank = Recorded::new("against-map");
    let names = ["time_us", "VALVE", "FLOW", "LEVEL_MM", "A1", "TEXT", "M", "ET", "spare", "F2"];
    let trace = tank.changed("foreign.csv", |line, mut cells| {
        if line == 1 {
            return Some(names.map(String::from).to_vec());
        }
        let level: f32 = cells[3].parse().unwrap();
        cells[3] = format!("{:.1}", f64::from(level) * 1000.0 + 5.0);
        cells[4] = if cells[4] == "TRUE" { "1" } else { "0" }.to_string();
        cells[5] = cells[5].trim_matches('\'').to_string();
        cells[8] = "anything".to_string();
        Some(cells)
    });
    let map = "column,variable\n# the valve\nvalve,main.open\nFLOW,main.inflow\nLEVEL_MM,main.level,0.001,-0.005\nA1,main.alarm\nTEXT,main.name\nM,main.mode\nET,main.since\nF2,main.field[2]\n";
    let map = tank.scratch.write("names.csv", map);
    let map = map.to_str().unwrap();
    let told = answer(&tank.source, &trace, &["--map", map, "--tolerance", "0.00006"], 0);
    assert_eq!(told["left_out"], serde_json::json!(["spare"]));
    assert_eq!(told["driven_by"], serde_json::json!(["VALVE", "FLOW"]));
    assert_eq!(told["variables"].as_array().unwrap().len(), 6);
    assert_eq!(variable(&told, "main.level")["column"], "LEVEL_MM");
    let told = answer(&tank.source, &trace, &["--map", map], 5);
    assert!(variable(&told, "main.level")["beyond"].as_u64().unwrap() > 0, "a tenth of a millimetre is not exact");
    let output = against(&tank.source, &trace, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("foreign.csv:1, column 2: there is no variable `VALVE`"), "{}", stderr(&output));
}

#[test]
fn a_driving_column_may_be_scaled_but_keeps_to_its_type() {
    let scratch = Scratch::new("against-drive");
    let source =
        scratch.write("p.st", "PROGRAM main VAR_INPUT a : INT; END_VAR VAR b : INT; END_VAR b := a + 1; END_PROGRAM");
    let map = scratch.write("names.csv", "in,main.a,10,0\nout,main.b\n");
    let words = ["--map", map.to_str().unwrap(), "--drive", "in"];
    let trace = scratch.write("t.csv", "time_us,in,out\n0,1.24,13\n100000,-2,-19\n");
    let told = answer(&source, &trace, &words, 0);
    assert_eq!(told["driven_by"], serde_json::json!(["in"]));
    let trace = scratch.write("t.csv", "time_us,in,out\n0,1,11\n100000,4000,1\n");
    let output = against(&source, &trace, &words);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("t.csv:3, column 2: 40000 is outside -32768 to 32767"), "{}", stderr(&output));
}

#[test]
fn which_columns_drive_can_be_said() {
    let tank = Recorded::new("against-which");
    let told = answer(&tank.source, &tank.trace, &["--drive", "none"], 5);
    assert_eq!(told["driven_by"], serde_json::json!([]));
    assert_eq!(variable(&told, "main.open")["first"]["line"], 4, "the valve never opens by itself");
    let told = answer(&tank.source, &tank.trace, &["--drive", "main.open,main.inflow,main.field[2]"], 0);
    assert_eq!(told["driven_by"], serde_json::json!(["main.open", "main.inflow", "main.field[2]"]));
    let output = against(&tank.source, &tank.trace, &["--drive", "main.opem"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

#[test]
fn a_constant_distance_of_the_times_is_given_or_found() {
    let tank = Recorded::new("against-align");
    for distance in [1_700_000_000_003_700_i64, -3_000, 4_321_000] {
        let trace = tank.changed("moved.csv", |line, mut cells| {
            if line > 1 {
                cells[0] = (cells[0].parse::<i64>().unwrap() + distance).to_string();
            }
            Some(cells)
        });
        let offset = (-distance).to_string();
        let told = answer(&tank.source, &trace, &["--align", &offset], 0);
        assert_eq!(told["rows_before_start"], 0);
        let told = answer(&tank.source, &trace, &["--align", "auto"], 0);
        assert_eq!((&told["offset_us"], &told["aligned"]["beyond"]), (&(-distance).into(), &0.into()));
        assert_eq!(variable(&told, "main.level")["compared"], 200);
    }
    let output = against(&tank.source, &tank.trace, &["--align", "soon"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

#[test]
fn what_compared_nothing_or_did_not_end_is_not_equal() {
    let tank = Recorded::new("against-nothing");
    let early = tank.changed("early.csv", |line, mut cells| {
        if line > 1 {
            cells[0] = (cells[0].parse::<i64>().unwrap() - 10_000_000).to_string();
        }
        Some(cells)
    });
    let empty = tank.scratch.write("empty.csv", "time_us,main.level,main.alarm\n0,,\n10000,,\n");
    for trace in [&early, &empty] {
        let page = tank.scratch.path("nothing.html");
        let told = answer(&tank.source, trace, &["--report", page.to_str().unwrap()], 1);
        assert_eq!((&told["equal"], &told["compared"]), (&false.into(), &0.into()));
        assert_eq!(told["verdict"], "nothing was compared");
        assert!(told["ended"].as_str().unwrap().contains("--align"), "{told}");
        assert!(std::fs::read_to_string(page).unwrap().contains("<b>nothing was compared</b>"));
    }
    let text = stderr(&against(&tank.source, &early, &[]));
    assert!(text.contains("--align") && !text.contains("equal"), "{text}");
    let trapping = TANK.replace("count := count + 1;", "count := count + 1 + 0 / (100 - count);");
    let trapping = tank.scratch.write("trap.st", trapping);
    for (source, words) in [(&trapping, &[][..]), (&tank.source, &["--scans", "50"])] {
        let text = stderr(&against(source, &tank.trace, words));
        assert!(text.contains("not compared to the end") && !text.contains("equal within"), "{text}");
    }
    // One variable of which nothing is known does not pass for equal.
    let partly = tank.scratch.write("partly.csv", "time_us,main.count,main.alarm\n0,1,\n10000,2,\n");
    let text = stderr(&against(&tank.source, &partly, &[]));
    assert!(text.contains("of 1 of 2 variables no value was compared"), "{text}");
    assert!(text.contains("main.alarm: 0 values\n"), "{text}");
}

#[test]
fn a_deviation_of_a_time_is_a_duration() {
    let tank = Recorded::new("against-duration");
    let other = tank.scratch.write("other.st", TANK.replace("T#50ms", "T#70ms"));
    let text = stderr(&against(&other, &tank.trace, &["--tolerance", "main.since=T#5ms"]));
    assert!(text.contains("differ (± T#5ms)") && text.contains("largest deviation T#20ms in line"), "{text}");
    assert!(!text.contains("000000 in line"), "{text}");
}

#[test]
fn columns_that_are_left_out_are_named() {
    let tank = Recorded::new("against-left-out");
    let trace = tank.scratch.write("t.csv", "time_us,N,extra,other\n0,1,x,y\n10000,2,x,y\n");
    let map = tank.scratch.write("names.csv", "N,main.count\n");
    let text = stderr(&against(&tank.source, &trace, &["--map", map.to_str().unwrap()]));
    assert!(text.contains("left out: extra, other\n"), "{text}");
}

#[test]
fn a_file_without_end_is_read_no_further_than_its_limit() {
    let read = kilohertz::files::read_limited(Path::new("/dev/zero"), 1000);
    assert!(matches!(read, Err(kilohertz::files::FileError::TooLarge { limit: 1000, .. })), "{read:?}");
    let tank = Recorded::new("against-limit");
    let bytes = std::fs::metadata(&tank.source).unwrap().len();
    assert_eq!(kilohertz::files::read_limited(&tank.source, bytes).unwrap().len() as u64, bytes);
    assert!(kilohertz::files::read_limited(&tank.source, bytes - 1).is_err());
}

/// More texts than a program's are kept for it: the trace's do not count.
#[test]
fn texts_of_a_long_trace_leave_room_for_the_programs() {
    let scratch = Scratch::new("against-texts");
    let source = scratch.write(
        "p.st",
        "PROGRAM main VAR s : STRING[8]; END_VAR s := 'other'; END_PROGRAM
        CONFIGURATION c RESOURCE r ON PLC TASK t(INTERVAL := T#10ms, PRIORITY := 0); PROGRAM main WITH t : main; END_RESOURCE END_CONFIGURATION",
    );
    let mut rows = String::from("time_us,main.s\n");
    for row in 0..100_001 {
        rows += &format!("{row},'t{row}'\n");
    }
    let trace = scratch.write("t.csv", rows);
    let told = answer(&source, &trace, &[], 5);
    assert_eq!(variable(&told, "main.s")["first"]["program"], "'other'");
}

/// A mapping of as many lines as there may be is read at once: looking each up in a list would be five thousand million steps.
#[test]
fn a_long_mapping_is_found_by_name() {
    let lines: String = (0..100_000).map(|line| format!("Column{line},v{line}\n")).collect();
    let mapping = Mapping::read("map.csv", lines.as_bytes()).unwrap();
    assert_eq!(
        mapping.find("cOLUMN99999").map(|mapped| (mapped.variable.as_str(), mapped.line)),
        Some(("v99999", 100_000))
    );
    assert!(mapping.find("Column100000").is_none());
}

/// The trace begins in the middle: no row lies on time 0, and nothing drives the program.
#[test]
fn the_search_finds_a_trace_that_begins_late() {
    let scratch = Scratch::new("against-late");
    let text = "PROGRAM main VAR n : DINT; q : BOOL; END_VAR n := n + 1; q := n MOD 37 < 5 OR n MOD 53 < 9; END_PROGRAM \
        CONFIGURATION c RESOURCE r ON PLC TASK t(INTERVAL := T#10ms, PRIORITY := 0); PROGRAM main WITH t : main; END_RESOURCE END_CONFIGURATION";
    let source = scratch.write("p.st", text);
    let mut trace = String::from("time_us,main.q\n");
    for n in 60..400_i64 {
        let q = n % 37 < 5 || n % 53 < 9;
        trace += &format!("{},{}\n", (n - 60) * 10_000 + 7_777_123, i32::from(q));
    }
    let trace = scratch.write("late.csv", trace);
    let told = answer(&source, &trace, &["--align", "auto"], 0);
    // Scan n, from 1, is at (n - 1) × 10 ms.
    assert_eq!(told["offset_us"], 590_000 - 7_777_123);
}

#[test]
fn rows_of_changes_hold_until_the_next() {
    let tank = Recorded::new("against-change");
    let mut last: Vec<String> = Vec::new();
    let trace = tank.changed("changes.csv", |_, cells| {
        // Of nine columns only some, and a row only where one of them changes.
        let kept: Vec<String> = [0, 1, 2, 4, 6].iter().map(|at| cells[*at].clone()).collect();
        let is_new = last.get(1..) != kept.get(1..);
        last.clone_from(&kept);
        is_new.then_some(kept)
    });
    let rows = std::fs::read_to_string(&trace).unwrap().lines().count() - 1;
    assert!((5..12).contains(&rows), "{rows}");
    let told = answer(&tank.source, &trace, &["--on-change"], 0);
    assert!(variable(&told, "main.alarm")["compared"].as_u64().unwrap() > 80, "between rows too: {told}");
    // An alarm that falls between two rows is seen only so.
    let blinks = TANK.replace("alarm := wait.Q;", "alarm := wait.Q AND NOT (count = 33);");
    let other = tank.scratch.write("other.st", blinks);
    answer(&other, &trace, &[], 0);
    let told = answer(&other, &trace, &["--on-change"], 5);
    let first = &variable(&told, "main.alarm")["first"];
    assert_eq!(
        (&first["time_us"], &first["trace"], &first["program"]),
        (&330_000.into(), &"TRUE".into(), &"FALSE".into())
    );
}

#[test]
fn an_empty_cell_holds_and_a_missing_begin_is_not_compared() {
    let tank = Recorded::new("against-empty");
    let trace = tank.changed("sparse.csv", |line, mut cells| {
        if (2..12).contains(&line) {
            cells[4].clear();
        }
        // The valve does not change in between, so its cells may be empty.
        if (10..20).contains(&line) {
            cells[1].clear();
        }
        Some(cells)
    });
    let told = answer(&tank.source, &trace, &[], 0);
    assert_eq!(
        (&variable(&told, "main.alarm")["compared"], &variable(&told, "main.level")["compared"]),
        (&190.into(), &200.into())
    );
}

#[test]
fn a_trap_and_a_trace_without_end_are_told() {
    let tank = Recorded::new("against-trap");
    let other =
        tank.scratch.write("other.st", TANK.replace("count := count + 1;", "count := count + 1 + 0 / (100 - count);"));
    let told = answer(&other, &tank.trace, &[], 3);
    assert!(told["ended"].as_str().unwrap().contains("divide by zero"), "{told}");
    assert_eq!((&told["equal"], &told["rows_not_reached"]), (&false.into(), &100.into()));
    let told = answer(&tank.source, &tank.trace, &["--scans", "50"], 1);
    assert!(told["ended"].as_str().unwrap().contains("--align auto"), "{told}");
}

#[test]
fn the_report_is_one_page_with_both_curves() {
    let tank = Recorded::new("against-report");
    let other = tank.scratch.write("other.st", TANK.replace("T#50ms", "T#70ms"));
    let page = tank.scratch.path("page.html");
    let output = against(&other, &tank.trace, &["--report", page.to_str().unwrap(), "--tolerance", "0.1"]);
    assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
    let page = std::fs::read_to_string(page).unwrap();
    // level, alarm, since, big and field[2] are numbers; name and mode are texts.
    for (part, count) in
        [("<svg", 5), ("class=\"theirs\"", 5), ("class=\"ours\"", 5), ("class=\"band\"", 1), ("class=\"first\"", 2)]
    {
        assert_eq!(page.matches(part).count(), count, "{part}");
    }
    assert!(page.contains("<title>line 28, 0.260000 s: trace TRUE, program FALSE</title>"));
    assert!(page.contains("<td>28</td><td>0.260000 s</td><td>TRUE</td><td>FALSE</td>"));
    assert!(!page.contains("<script") && !page.contains("http://") && !page.contains("https://"));
    let (head, body) = page.split_once("</head>").unwrap();
    assert!(head.contains(".theirs{") && !body.contains("<style"), "styles stand in the head");
    assert!(page.ends_with("</body></html>") && page.len() < 200_000, "{} bytes", page.len());
}

#[test]
fn what_is_no_trace_is_refused_by_line_and_column() {
    let tank = Recorded::new("against-wrong");
    let cases: [(&[u8], &str); 16] = [
        (b"time,main.level\n0,1\n", ":1, column 1: the first column must be time_us"),
        (b"time_us,main.level\n", ":2: there is no row"),
        (b"time_us\n0\n", ":1, column 1: no column is a variable"),
        (b"time_us,main.leval\n0,1\n", ":1, column 2: there is no variable `main.leval`"),
        (b"time_us,main.wait\n0,1\n", ":1, column 2: `main.wait` is no single value"),
        (b"time_us,main.level\n0,1\n5,low\n", ":3, column 2: `main.level` is REAL"),
        (b"time_us,main.alarm\n0,2x\n", ":2, column 2: `main.alarm` is BOOL"),
        (b"time_us,main.mode\n0,asleep\n", ":2, column 2: `main.mode` is Mode"),
        (b"time_us,main.level\n0,1\nsoon,1\n", ":3, column 1: `soon` is no time in microseconds"),
        (b"time_us,main.level\n1e300,1\n", ":2, column 1: `1e300` is no time"),
        (b"time_us,main.level\n9223372036854775807,1\n", ":2, column 1: `9223372036854775807` is no time"),
        (b"time_us,main.level\n5,1\n4,1\n", ":3, column 1: time_us goes back to 4"),
        (b"time_us,main.level\n5,1\n6\n", ":3: 1 cells, but the header has 2"),
        (b"time_us,main.level\n5,\xFF\n", ":2: the text is not UTF-8"),
        (b"time_us,main.open\n5,TRUE\n", "every column drives the program"),
        (b"time_us,main.open,main.alarm\n5,7,1\n", ":2, column 2: `main.open` is BOOL"),
    ];
    for (bytes, wanted) in cases {
        let trace = tank.scratch.write("wrong.csv", bytes);
        let output = against(&tank.source, &trace, &[]);
        assert!(matches!(output.status.code(), Some(1 | 2)), "{wanted}: {}", stderr(&output));
        assert!(stderr(&output).contains(wanted), "wanted {wanted}, got {}", stderr(&output));
    }
    let maps: [(&str, &str); 10] = [
        ("main.level,main.level\nmain.alram,main.alarm\n", "map.csv:2, column 1: the trace has no column `main.alram`"),
        ("A\n", ":1, column 2: the variable of `A` is missing"),
        (",main.level\n", ":1, column 1: the name of a column is missing"),
        ("A,main.level,much\n", ":1, column 3: `much` is not a number"),
        ("A,main.level\na,main.alarm\n", ":2, column 1: `a` stands here twice"),
        ("A,main.level,1,2,3\n", ":1, column 5: COLUMN,VARIABLE,FACTOR,OFFSET"),
        ("A,main.level,0\n", ":1, column 3: a factor of 0"),
        ("main.alarm,main.alarm,2\n", ":1, column 3: `main.alarm` is no number"),
        ("main.level,main.field[2]\n", "`main.field[2]` is `main.field[2]`, as column `main.level` is already"),
        ("column,main.level\n", ":1, column 1: the trace has no column `column`"),
    ];
    for (text, wanted) in maps {
        let map = tank.scratch.write("map.csv", text);
        let output = against(&tank.source, &tank.trace, &["--map", map.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains(wanted), "wanted {wanted}, got {}", stderr(&output));
    }
    // What is compared is not written over.
    let before = std::fs::read(&tank.trace).unwrap();
    for report in [&tank.trace, &tank.source] {
        let output = against(&tank.source, &tank.trace, &["--report", report.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    }
    assert!(std::fs::read(&tank.trace).unwrap() == before);
    let output = against(&tank.source, &tank.scratch.path("nowhere.csv"), &[]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
}

/// The tank, for reading traces without a process.
fn tank() -> pipeline::Program {
    program(TANK)
}

fn program(text: &str) -> pipeline::Program {
    let source = SourceInput { name: "tank.st".into(), bytes: text.into() };
    pipeline::compile(&[source], &CompileOptions::default()).unwrap().programs.remove(0)
}

#[test]
fn a_trace_holds_no_more_than_its_limit() {
    let width = 4000;
    let text = format!("PROGRAM main VAR a : ARRAY[1..{width}] OF BOOL; END_VAR END_PROGRAM");
    let program = program(&text);
    let (names, image) =
        (khz_machine::variables::VariableTable::of(program.container()), program.image(1 << 20).unwrap());
    let columns: String = (1..=width).map(|index| format!(",main.a[{index}]")).collect();
    let mut text = format!("time_us{columns}\n");
    let row = ",".repeat(width);
    for time in 0..kilohertz::traces::MAX_CELLS / width + 2 {
        text += &format!("{time}{row}\n");
    }
    let refused = Trace::read("wide.csv", text.as_bytes(), &Choice::default(), &names, &image).unwrap_err();
    assert!(refused.reason.contains("values that a trace may have"), "{refused}");
    assert_eq!(refused.line as usize, kilohertz::traces::MAX_CELLS / width + 2);
}

/// Bytes of a good trace and a good mapping, changed at random: read or refused, and never a panic.
#[test]
fn damaged_traces_and_mappings_are_read_or_refused() {
    let program = tank();
    let (names, image) =
        (khz_machine::variables::VariableTable::of(program.container()), program.image(1 << 20).unwrap());
    let good = "time_us,main.open,main.inflow,main.level,main.name,main.mode,main.since,main.big\n0,1,2.5,1.0,\"'a, b'\",full,T#5ms,18446744073709551615\n\
        10.5,FALSE,1e3,NaN,\"x\"\"y\",1,70,16#FF\n20,,,,,,,\n";
    let map = "column,variable\nmain.level,main.level,0.5,1\n# no\nmain.name,\n";
    let pieces: [&[u8]; 12] =
        [b"\"", b",", b"\n", b"\r", b"-", b"1e308", b"main.", b"\xFF", b"T#", b"'", b"99999999999999999999", b"\0"];
    Trace::read("trace.csv", good.as_bytes(), &Choice::default(), &names, &image).expect("the undamaged trace");
    let mut random = Random::new(0x0074_7261_6365);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..4000 {
        let damage = |random: &mut Random, text: &str| {
            let mut bytes = text.as_bytes().to_vec();
            for _ in 0..1 + random.below(4) {
                let at = random.below(bytes.len());
                if bytes.is_empty() {
                    break;
                }
                match random.below(4) {
                    0 => drop(bytes.remove(at)),
                    1 => bytes[at] = random.bits() as u8,
                    2 => drop(bytes.splice(at..at, random.pick(&pieces).unwrap().iter().copied())),
                    _ => bytes.truncate(at.max(1)),
                }
            }
            bytes
        };
        // One of the two, so that the other's damage is not all that is told.
        let (trace, map) = match random.below(2) {
            0 => (good.as_bytes().to_vec(), damage(&mut random, map)),
            _ => (damage(&mut random, good), map.as_bytes().to_vec()),
        };
        let mapping = match Mapping::read("map.csv", &map) {
            Ok(mapping) => mapping,
            Err(error) => {
                assert!(error.to_string().starts_with("map.csv:"), "{error}");
                refused += 1;
                continue;
            }
        };
        let choice = Choice { mapping, drive: None };
        match Trace::read("trace.csv", &trace, &choice, &names, &image) {
            Ok(trace) => {
                assert!(!trace.is_empty() && trace.times_us.is_sorted());
                read += 1;
            }
            Err(error) => {
                assert!(["trace.csv:", "map.csv:"].iter().any(|file| error.to_string().starts_with(file)), "{error}");
                refused += 1;
            }
        }
    }
    assert!(read > 300 && refused > 300, "{read} read, {refused} refused");
}
