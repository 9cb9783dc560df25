//! What `--perf` writes, read back and held against the code.

mod common;

use common::{Scratch, khz, stderr};
use khz_bytecode::limits::MAX_IMAGE_BYTES;
use khz_frontend::{CompileOptions, SourceInput};
use khz_jit::{Jit, JitOptions, LineRange};
use kilohertz::pipeline;
use kilohertz::profilers::{jitdump, map};

/// Two instances of one program, a function block, and a function that is called for its loop.
const PROGRAM: &str = "\
FUNCTION Steps : DINT
VAR_INPUT n : DINT; END_VAR
VAR k : DINT; END_VAR
FOR k := 1 TO n DO Steps := Steps + (k XOR Steps) MOD 7; END_FOR;
FOR k := 1 TO n DO Steps := Steps * 3 + k; END_FOR;
END_FUNCTION
PROGRAM Plant
VAR n, m : DINT; END_VAR
n := n + Steps(m);
m := Steps(n) MOD 100;
END_PROGRAM
CONFIGURATION c RESOURCE r ON PLC
TASK t(INTERVAL := T#1ms, PRIORITY := 0);
PROGRAM left WITH t : Plant;
PROGRAM right WITH t : Plant;
END_RESOURCE END_CONFIGURATION
";

fn engine() -> Jit {
    let source = SourceInput { name: "plant.st".into(), bytes: PROGRAM.into() };
    let loaded = pipeline::compile(&[source], &CompileOptions::default()).unwrap();
    let layout = loaded.programs[0].layout(MAX_IMAGE_BYTES).unwrap();
    loaded.programs[0].jit(&layout, JitOptions { note_lines: true, ..JitOptions::default() }).unwrap()
}

/// What a map says of one function: address, size, name.
fn read_map(text: &str) -> Vec<(u64, u64, String)> {
    let line = |line: &str| {
        let mut words = line.splitn(3, ' ');
        let mut number = || u64::from_str_radix(words.next().unwrap(), 16).unwrap();
        let (address, bytes) = (number(), number());
        (address, bytes, words.next().unwrap().to_owned())
    };
    text.lines().map(line).collect()
}

/// A function of a jitdump.
#[derive(Debug, Default, PartialEq, Eq)]
struct Function {
    name: String,
    address: u64,
    index: u64,
    code: Vec<u8>,
    lines: Vec<(u64, u32, String)>,
}

/// Reads a jitdump by its format's description, and nothing of what writes it.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, bytes: usize) -> &'a [u8] {
        let (head, rest) = self.0.split_at(bytes);
        self.0 = rest;
        head
    }
    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take(4).try_into().unwrap())
    }
    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take(8).try_into().unwrap())
    }
    fn text(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap();
        let text = String::from_utf8(self.take(end).to_vec()).unwrap();
        self.take(1);
        text
    }
}

/// The functions of a jitdump; checks what every record must hold.
fn read_dump(bytes: &[u8], process: u32) -> Vec<Function> {
    let mut reader = Reader(bytes);
    assert_eq!([reader.u32(), reader.u32(), reader.u32()], [0x4A69_5444, 1, 40]);
    assert_eq!(reader.u32(), if cfg!(target_arch = "x86_64") { 62 } else { 183 });
    assert_eq!([reader.u32(), reader.u32()], [0, process]);
    let started = reader.u64();
    assert_eq!(reader.u64(), 0, "times are those of a clock, not of the processor");
    let (mut found, mut lines) = (Vec::new(), Vec::new());
    loop {
        let (kind, size, time) = (reader.u32(), reader.u32() as usize, reader.u64());
        assert!(time >= started);
        let mut body = Reader(reader.take(size - 16));
        match kind {
            0 => {
                assert_eq!([body.u32(), body.u32()], [process, process]);
                let (vma, address, bytes, index) = (body.u64(), body.u64(), body.u64(), body.u64());
                assert_eq!(vma, address);
                let name = body.text();
                assert_eq!(body.0.len() as u64, bytes, "{name}");
                found.push(Function { name, address, index, code: body.0.to_vec(), lines: std::mem::take(&mut lines) });
            }
            2 => {
                let (_, count) = (body.u64(), body.u64());
                for _ in 0..count {
                    let (address, line, _) = (body.u64(), body.u32(), body.u32());
                    lines.push((address, line, body.text()));
                }
                assert!(body.0.is_empty());
            }
            3 => break,
            other => panic!("a record of kind {other}"),
        }
    }
    assert!(reader.0.is_empty() && lines.is_empty());
    found
}

#[test]
fn a_map_names_every_byte_of_the_code_once() {
    let engine = engine();
    let symbols = engine.symbols();
    let read = read_map(&map(&symbols));
    let names: Vec<&str> = read.iter().map(|row| row.2.as_str()).collect();
    assert_eq!(names, ["Steps", "Plant [left]", "Plant [right]"]);
    for (row, symbol) in read.iter().zip(&symbols) {
        assert_eq!((row.0, row.1), (symbol.address(), symbol.code.len() as u64));
    }
    assert_eq!(read.iter().map(|row| row.1 as usize).sum::<usize>(), khz_machine::engine::Engine::code_bytes(&engine));
    let mut places: Vec<_> = read.iter().map(|row| row.0..row.0 + row.1).collect();
    places.sort_by_key(|place| place.start);
    assert!(places.windows(2).all(|pair| pair[0].end <= pair[1].start), "{places:?}");
}

#[test]
fn a_dump_holds_names_code_and_lines() {
    let engine = engine();
    let symbols = engine.symbols();
    let read = read_dump(&jitdump::dump(&symbols, 4711, 123_456), 4711);
    assert_eq!(read.len(), symbols.len());
    for ((function, symbol), index) in read.iter().zip(&symbols).zip(0..) {
        let line = |range: &LineRange| (symbol.address() + u64::from(range.offset), range.line, range.file.clone());
        let lines = symbol.lines.iter().map(line).collect();
        let (name, code) = (symbol.name.clone(), symbol.code.to_vec());
        assert_eq!(*function, Function { name, address: symbol.address(), index, code, lines });
        assert!(function.lines.windows(2).all(|pair| pair[0].0 < pair[1].0), "{:?}", function.lines);
    }
    let lines = |name: &str| -> Vec<u32> {
        let function = read.iter().find(|function| function.name == name).unwrap();
        let mut lines: Vec<u32> = function.lines.iter().map(|line| line.1).collect();
        lines.sort_unstable();
        lines.dedup();
        lines
    };
    assert_eq!((lines("Steps"), lines("Plant [right]")), (vec![4, 5], vec![9, 10]));
}

#[test]
fn code_without_notes_has_no_symbols() {
    let source = SourceInput { name: "plant.st".into(), bytes: PROGRAM.into() };
    let loaded = pipeline::compile(&[source], &CompileOptions::default()).unwrap();
    let layout = loaded.programs[0].layout(MAX_IMAGE_BYTES).unwrap();
    assert!(loaded.programs[0].jit(&layout, JitOptions::default()).unwrap().symbols().is_empty());
}

#[test]
fn runs_and_benches_write_them_when_asked() {
    let scratch = Scratch::new("perf");
    let source = scratch.write("plant.st", PROGRAM);
    let start = |words: &[&str]| {
        let mut command = khz();
        command.args(words).arg(&source).current_dir(scratch.path(""));
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped());
        let child = command.spawn().unwrap();
        let process = child.id();
        (process, child.wait_with_output().unwrap())
    };
    let (process, output) = start(&["run", "--clock", "virtual", "--scans", "3", "--perf", "jitdump"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let dump = std::fs::read(scratch.path(&format!("jit-{process}.dump"))).unwrap();
    let names: Vec<String> = read_dump(&dump, process).into_iter().map(|function| function.name).collect();
    assert_eq!(names, ["Steps", "Plant [left]", "Plant [right]"]);
    let (process, output) = start(&["bench", "--engine", "jit", "--scans", "10", "--perf", "map"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let path = format!("/tmp/perf-{process}.map");
    assert_eq!(read_map(&std::fs::read_to_string(&path).unwrap()).len(), 3);
    std::fs::remove_file(path).unwrap();
    let (_, output) = start(&["run", "--engine", "interp", "--scans", "3", "--perf", "map"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}
