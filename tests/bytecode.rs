//! Programs in assembly text that the front end does not write yet, in both engines: same values, same trap, same place, same image.
//!
//! Comments of a file say what is expected: `; trap: NAME`, `; values: 1 2 3`, `; slot: INDEX = VALUE` (the slot's 8 bytes as a number),
//! `; fuel: UNITS`, `; scans: N`.

mod common;

use std::sync::Arc;

use common::{files, root};
use khz_bytecode::assembler::assemble;
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_bytecode::verify::verify;
use khz_machine::engine::{DeadlineCell, Entry, Fuel, Limits};
use khz_machine::image::Image;
use khz_machine::trap::Trap;
use kilohertz::pipeline::{EngineKind, Program};

struct Expected {
    trap: Option<String>,
    values: Vec<i64>,
    slots: Vec<(usize, i64)>,
    fuel: Option<u64>,
    scans: usize,
}

fn expected(text: &str) -> Expected {
    let mut expected = Expected { trap: None, values: Vec::new(), slots: Vec::new(), fuel: None, scans: 1 };
    for line in text.lines().filter_map(|l| l.strip_prefix("; ")) {
        let Some((key, value)) = line.split_once(": ") else { continue };
        match key {
            "trap" => expected.trap = Some(value.to_string()),
            "values" => expected.values = value.split(' ').map(|v| v.parse().unwrap()).collect(),
            "slot" => {
                let (index, value) = value.split_once(" = ").unwrap();
                expected.slots.push((index.parse().unwrap(), value.parse().unwrap()));
            }
            "fuel" => expected.fuel = Some(value.parse().unwrap()),
            "scans" => expected.scans = value.parse().unwrap(),
            _ => {}
        }
    }
    expected
}

fn run(program: &Program, kind: EngineKind, fuel: Option<u64>, scans: usize) -> (Result<(), Trap>, Option<u64>, Image) {
    let layout = program.layout(MAX_IMAGE_BYTES).unwrap();
    let mut engine = program.engine(kind, &layout, fuel.is_some()).unwrap();
    let mut image = program.image(MAX_IMAGE_BYTES).unwrap();
    let deadline = DeadlineCell::new();
    let mut left = fuel.map(|left| Fuel { left });
    let mut result = Ok(());
    for _ in 0..scans {
        let limits = Limits { deadline: &deadline, fuel: left.as_mut(), task_index: 0 };
        result = engine.run(Entry::Instance(0), &mut image, limits);
        if result.is_err() {
            break;
        }
    }
    (result, left.map(|f| f.left), image)
}

#[test]
fn assembly_programs_do_the_same_in_both_engines() {
    let programs = files(&root().join("tests/bytecode"), "kasm");
    assert!(programs.len() >= 7);
    for path in programs {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path).unwrap();
        let want = expected(&text);
        let container = assemble(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let verified = verify(container).unwrap_or_else(|e| panic!("{name}: {e}"));
        let program =
            Program { name: name.clone(), verified: Arc::new(verified), container_bytes: 0, inputs: Vec::new() };
        for fuel in [want.fuel, Some(want.fuel.unwrap_or(10_000_000))] {
            let [interp, jit] = EngineKind::BOTH.map(|kind| run(&program, kind, fuel, want.scans));
            assert_eq!(interp.0, jit.0, "{name}: how it ends");
            assert_eq!(interp.1, jit.1, "{name}: fuel left");
            assert_eq!(interp.2.first_difference(&jit.2), None, "{name}: image");
            assert_eq!(interp.0.err().map(|t| t.code.name().to_string()), want.trap, "{name}: trap");
            for (at, value) in want.values.iter().enumerate() {
                assert_eq!(interp.0.unwrap_err().values[at], *value, "{name}: trap value {at}");
            }
            for (slot, value) in &want.slots {
                let bytes = interp.2.bytes()[slot * 8..slot * 8 + 8].try_into().unwrap();
                assert_eq!(i64::from_le_bytes(bytes), *value, "{name}: slot {slot}");
            }
        }
    }
}
