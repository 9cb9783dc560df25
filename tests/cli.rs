//! The command line as scripts see it: exit statuses, files, formats (docs: `khz --help`).

mod common;

use common::{Scratch, khz, run, stderr, stdout};
use serde_json::Value;

const PROGRAM: &str = "\
TYPE Colour : (Red, Green, Blue); Point : STRUCT x : INT := 3; y : LREAL := 0.1; END_STRUCT; END_TYPE
FUNCTION_BLOCK Count VAR_INPUT up : BOOL; END_VAR VAR_OUTPUT n : UINT; END_VAR IF up THEN n := n + 1; END_IF; END_FUNCTION_BLOCK
PROGRAM Main
VAR
  flag : BOOL := TRUE; small : SINT := -5; big : ULINT := 18446744073709551615; r : REAL := 0.1; nan : LREAL; inf : LREAL; zero : LREAL;
  t : TIME := T#1s500ms; s : STRING[20] := 'a\"b'; colour : Colour := Blue; list : ARRAY[0..2] OF INT := [1, 2, 3]; p : Point; c : Count;
  grid : ARRAY[0..1, 0..1] OF BOOL; input AT %IW0 : WORD; seen : WORD; step : INT (-1..5) := 2; far : ULINT (3..16#FFFF_FFFF_FFFF_FFFF) := 3;
END_VAR VAR CONSTANT fixed : ARRAY[0..1] OF INT := [4, 5]; END_VAR
  nan := zero / zero; inf := -1.0 / zero; c(up := flag); seen := input; list[2] := fixed[0] - 1;
END_PROGRAM
VAR_GLOBAL total : DINT := 7; END_VAR
";

fn dump(scratch: &Scratch, extra: &[&str]) -> Value {
    let source = scratch.write("plant.st", PROGRAM);
    let path = scratch.path("dump.json");
    let output = khz()
        .args(["run", "--clock", "virtual", "--scans", "2"])
        .args(extra)
        .arg("--dump-vars")
        .arg(&path)
        .arg(&source)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn a_dump_has_every_variable_as_the_page_says() {
    let scratch = Scratch::new("dump");
    let dump = dump(&scratch, &[]);
    assert_eq!(dump["rounds"], 2);
    assert_eq!(dump["time_us"], 10_000);
    let v = &dump["variables"];
    assert_eq!(v["Main.flag"], true);
    assert_eq!(v["Main.small"], -5);
    assert_eq!(v["Main.big"], 18_446_744_073_709_551_615_u64);
    assert_eq!(v["Main.r"].to_string(), "0.1");
    assert_eq!(v["Main.nan"], "NaN");
    assert_eq!(v["Main.inf"], "-Infinity");
    assert_eq!(v["Main.t"], "T#1s500ms");
    assert_eq!(v["Main.s"], "a\"b");
    assert_eq!(v["Main.colour"], "Blue");
    assert_eq!(v["Main.list"], serde_json::json!([1, 2, 3]));
    assert_eq!(v["Main.p"], serde_json::json!({ "x": 3, "y": 0.1 }));
    assert_eq!(v["Main.c"]["n"], 2);
    assert_eq!(v["Main.grid"], serde_json::json!([[false, false], [false, false]]));
    assert_eq!((&v["Main.step"], &v["Main.far"], &v["Main.fixed"][1]), (&2.into(), &3.into(), &5.into()));
    assert_eq!(v["total"], 7);
}

#[test]
fn values_can_be_set_and_rows_applied() {
    let scratch = Scratch::new("set");
    let rows = scratch.write("rows.csv", "time_us,%IW0,main.flag\n0,16#00FF,\n10000,5,false\n");
    let dump =
        dump(&scratch, &["--set", "MAIN.SMALL=16#7F", "--set", "main.p.x = 9", "--inputs", rows.to_str().unwrap()]);
    let v = &dump["variables"];
    assert_eq!((&v["Main.small"], &v["Main.p"]["x"]), (&Value::from(127), &Value::from(9)));
    assert_eq!((&v["Main.seen"], &v["Main.c"]["n"]), (&Value::from(5), &Value::from(1)));
}

#[test]
fn wrong_values_are_refused_with_their_place() {
    let scratch = Scratch::new("wrong-values");
    let source = scratch.write("plant.st", PROGRAM);
    let rows = scratch.write("rows.csv", "time_us,main.small\n0,5\n10,500\n");
    let order = scratch.write("order.csv", "time_us,main.small\n10,5\n0,5\n");
    let header = scratch.write("header.csv", "time,main.small\n10,5\n");
    let cases: [(&[&str], &str, i32); 10] = [
        (&["--set", "main.nothing=1"], "main.nothing", 1),
        (&["--set", "main.small=1000"], "main.small", 1),
        (&["--set", "main.step=6"], "`Main.step` is INT (-1..5): 6 is outside -1 to 5", 1),
        (&["--set", "main.far=2"], "2 is outside 3 to 18446744073709551615", 1),
        (&["--set", "main.colour=3"], "`Main.colour` is Colour: `3` is none of its values (Red, Green, Blue)", 1),
        (&["--set", "main.fixed[0]=1"], "`Main.fixed[0]` is a CONSTANT", 1),
        (&["--set", "main.small"], "NAME=VALUE", 2),
        (&["--inputs", rows.to_str().unwrap()], "rows.csv:3", 1),
        (&["--inputs", order.to_str().unwrap()], "order.csv:3", 1),
        (&["--inputs", header.to_str().unwrap()], "header.csv:1", 1),
    ];
    for (words, part, status) in cases {
        let output =
            khz().args(["run", "--clock", "virtual", "--scans", "1"]).args(words).arg(&source).output().unwrap();
        assert_eq!(output.status.code(), Some(status), "{words:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(part), "{words:?}: {}", stderr(&output));
    }
}

#[test]
fn a_stripped_container_behaves_the_same() {
    let scratch = Scratch::new("strip");
    let source = scratch.write("plant.st", PROGRAM);
    let (full, stripped) = (scratch.path("full.iplc"), scratch.path("stripped.iplc"));
    for (path, more) in [(&full, None), (&stripped, Some("--strip"))] {
        let output = khz().arg("build").arg(&source).arg("-o").arg(path).args(more).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    }
    assert!(std::fs::metadata(&stripped).unwrap().len() < std::fs::metadata(&full).unwrap().len());
    let read = |path| khz_bytecode::container::read(&std::fs::read(path).unwrap()).unwrap();
    let (mut whole, bare) = (read(&full), read(&stripped));
    assert!(bare.debug.is_none());
    khz_bytecode::container::strip(&mut whole);
    assert_eq!(whole, bare);
    for path in [&full, &stripped] {
        let verified = khz().arg("verify").arg(path).output().unwrap();
        assert_eq!(verified.status.code(), Some(0), "{}", stderr(&verified));
        let stats = scratch.path("stats.json");
        let ran =
            khz().args(["run", "--clock", "virtual", "--scans", "3", "--stats"]).args([&stats, path]).output().unwrap();
        assert_eq!(ran.status.code(), Some(0), "{}", stderr(&ran));
        assert!(stderr(&ran).contains("default_task: 3 scans"), "{}", stderr(&ran));
        let stats: Value = serde_json::from_str(&std::fs::read_to_string(stats).unwrap()).unwrap();
        assert_eq!(stats["tasks"][0]["name"], "default_task");
    }
}

#[test]
fn diagnostics_have_code_place_and_excerpt() {
    let scratch = Scratch::new("diagnostics");
    let source =
        scratch.write("bad.st", "PROGRAM main\nVAR x : INT; END_VAR\n  x := 'text';\n  y := 1;\nEND_PROGRAM\n");
    let output = khz().arg("check").arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let text = stderr(&output);
    assert!(text.contains("bad.st:3:8: error[T") && text.contains("bad.st:4:3: error[S"), "{text}");
    let output = khz().args(["check", "--format", "json"]).arg(&source).output().unwrap();
    let all: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(all.as_array().unwrap().len(), 2);
    assert_eq!(all[0]["place"]["line"], 3);
    let code = all[0]["code"].as_str().unwrap();
    let explained = run(&format!("explain {code}"));
    assert!(stdout(&explained).contains("Wrong:") && stdout(&explained).contains("Right:"), "{}", stdout(&explained));
}

#[test]
fn every_listed_code_is_explained() {
    let list = stdout(&run("explain"));
    assert!(list.lines().count() > 100);
    for code in ["V0001", "C0001", "P0001"] {
        let output = run(&format!("explain {code}"));
        assert_eq!(output.status.code(), Some(0), "{code}");
        assert!(stdout(&output).starts_with(code));
    }
    let text = stdout(&run("explain v0074"));
    assert!(text.contains("\nWrong:\n    function main\n") && text.contains("; error V0074"), "{text}");
    assert!(!text.contains("Right:"), "{text}");
    let output = khz().args(["explain", "divide by zero"]).output().unwrap();
    assert!(stdout(&output).contains("divided by zero"));
    assert_eq!(run("explain X9999").status.code(), Some(1));
}

#[test]
fn a_trap_is_one_json_object() {
    let scratch = Scratch::new("trap-json");
    let source = scratch.write(
        "trap.st",
        "PROGRAM main\nVAR a : ARRAY[1..3] OF INT; i : INT := 9; END_VAR\n  a[i] := 1;\nEND_PROGRAM\n",
    );
    let output = khz().args(["run", "--format", "json"]).arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let report: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(report["trap"], "array index");
    assert_eq!(
        (report["line"].as_u64(), report["function"].as_str(), report["instance"].as_str()),
        (Some(3), Some("main"), Some("main"))
    );
    assert_eq!(report["values"], serde_json::json!({ "index": 9, "lower": 1, "upper": 3 }));
    assert!(report["file"].as_str().unwrap().ends_with("trap.st"));
}

#[test]
fn several_resources_want_a_choice() {
    let scratch = Scratch::new("resources");
    let resource = |name: &str| {
        format!(
            "RESOURCE {name} ON PLC TASK t(INTERVAL := T#1ms, PRIORITY := 0); PROGRAM p WITH t : main; END_RESOURCE\n"
        )
    };
    let text = format!(
        "PROGRAM main VAR n : INT; END_VAR n := n + 1; END_PROGRAM\nCONFIGURATION c\n{}{}END_CONFIGURATION",
        resource("one"),
        resource("two")
    );
    let source = scratch.write("two.st", text);
    let output = khz().args(["run", "--scans", "1"]).arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("one, two"), "{}", stderr(&output));
    let output = khz().args(["run", "--scans", "1", "--resource", "TWO"]).arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let built = khz().arg("build").arg(&source).arg("-o").arg(scratch.path("out.iplc")).output().unwrap();
    assert_eq!(built.status.code(), Some(0), "{}", stderr(&built));
    assert!(scratch.path("out.one.iplc").exists() && scratch.path("out.two.iplc").exists());
}

#[test]
fn statistics_and_bench_figures_are_json() {
    let scratch = Scratch::new("figures");
    let source = scratch.write("plant.st", PROGRAM);
    let stats = scratch.path("stats.json");
    let output = khz()
        .args(["run", "--clock", "virtual", "--scans", "10", "--stats"])
        .arg(&stats)
        .arg(&source)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let stats: Value = serde_json::from_str(&std::fs::read_to_string(stats).unwrap()).unwrap();
    assert_eq!(stats["tasks"][0]["scans"], 10);
    let (json, html) = (scratch.path("bench.json"), scratch.path("bench.html"));
    let output = khz()
        .args(["bench", "--scans", "1000", "--json"])
        .arg(&json)
        .arg("--report")
        .arg(&html)
        .arg(&source)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let rows: Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    assert_eq!((rows[0]["engine"].as_str(), rows[1]["engine"].as_str()), (Some("jit"), Some("interp")));
    assert!(rows[0]["ns_per_scan"]["median"].as_f64().unwrap() > 0.0 && rows[0]["code_bytes"].as_u64().unwrap() > 0);
    let page = std::fs::read_to_string(html).unwrap();
    assert!(page.contains("<svg") && !page.contains("http"), "one self-contained page");
}

#[test]
fn disassembly_shows_each_form_beside_its_source() {
    let scratch = Scratch::new("disasm");
    let source = scratch.write("plant.st", PROGRAM);
    for (form, part) in
        [(None, "slot.store"), (Some("--mir"), "loop"), (Some("--clif"), "function"), (Some("--asm"), "ret")]
    {
        let output = khz().arg("disasm").args(form).arg(&source).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{form:?}: {}", stderr(&output));
        assert!(form == Some("--mir") || stdout(&output).contains(part), "{form:?}: {}", stdout(&output));
        assert!(stdout(&output).contains("plant.st:9"), "{form:?}: {}", stdout(&output));
    }
}

#[test]
fn the_engines_agree_on_every_example() {
    let scratch = Scratch::new("diff");
    let source = scratch.write("plant.st", PROGRAM);
    for path in [source.to_str().unwrap(), "examples/bottling.st", "tests/schedules/three_tasks.st"] {
        let output = khz().args(["diff", "--scans", "500", path]).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{path}: {}", stderr(&output));
        assert!(stderr(&output).contains("equal after 500 rounds"), "{path}: {}", stderr(&output));
    }
}

#[test]
fn what_the_host_refuses_is_status_4() {
    let output = khz().args(["run", "--cpu", "1000000", "--scans", "1", "examples/bottling.st"]).output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
    assert!(stderr(&output).contains("processor 1000000"), "{}", stderr(&output));
}

#[test]
fn diff_ends_an_endless_loop_by_itself() {
    let scratch = Scratch::new("diff-endless");
    let source = scratch
        .write("endless.st", "PROGRAM main VAR n : DINT; END_VAR WHILE TRUE DO n := n + 1; END_WHILE; END_PROGRAM");
    let output = khz().arg("diff").arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("both trapped: watchdog"), "{}", stderr(&output));
}

#[test]
fn a_misspelt_attribute_is_noticed() {
    let scratch = Scratch::new("attribute");
    let text = "PROGRAM main END_PROGRAM CONFIGURATION c RESOURCE r ON PLC {attribute 'watchdgo' := 'T#5ms'} \
                TASK t(INTERVAL := T#1ms, PRIORITY := 0); PROGRAM p WITH t : main; END_RESOURCE END_CONFIGURATION";
    let source = scratch.write("attribute.st", text);
    let output = khz().arg("check").arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("warning[S0042]"), "{}", stderr(&output));
}

#[test]
fn the_examples_of_traps_end_in_them_and_mended_they_do_not() {
    let scratch = Scratch::new("trap-examples");
    for trap in khz_bytecode::trap::TrapCode::ALL {
        let (wrong, right) = trap.examples();
        assert_eq!(wrong.is_empty(), right.is_empty(), "{trap}");
        for (text, status) in [(wrong, 3), (right, 0)].into_iter().filter(|(text, _)| !text.is_empty()) {
            let source = scratch.write("example.st", text);
            let words = ["run", "--clock", "virtual", "--scans", "2", "--watchdog-us", "1000"];
            let output = khz().args(words).arg(&source).output().unwrap();
            assert_eq!(output.status.code(), Some(status), "{trap}: {}", stderr(&output));
            assert!(status == 0 || stderr(&output).contains(trap.name()), "{trap}: {}", stderr(&output));
        }
    }
}
