//! Random programs run the same with and without passes: values, traps, places, fuel, and every byte of the image.

mod common;

use std::fmt::Write;

use common::load_with;
use khz_jit::{JitOptions, Passes};

/// A small generator of numbers (xorshift), so that a failing seed can be run again.
struct Random(u64);

impl Random {
    fn next(&mut self, below: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % below
    }

    fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.next(of.len() as u64) as usize]
    }
}

const SLOTS: &[&str] = &["g a", "g b", "g c", "g w", "p d", "p e", "p n", "l x", "l y"];
const CONTROLS: &[(&str, &str)] =
    &[("g a", "i32"), ("p n", "i16"), ("l x", "i32"), ("g s", "u8"), ("p d", "u32"), ("p t", "i8")];
const PURE: &[&str] = &[
    "i32.add",
    "i32.sub",
    "i32.mul",
    "i32.and",
    "i32.or",
    "i32.xor",
    "i32.lt_s",
    "i32.ge_u",
    "i32.eq",
    "i32.shl",
    "i32.shr_u",
    "i32.min_s",
    "i32.rotr8",
];

struct Writer {
    random: Random,
    text: String,
    labels: usize,
    loops: usize,
    for_lines: String,
    depth: usize,
}

impl Writer {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn label(&mut self) -> String {
        self.labels += 1;
        format!("l{}", self.labels)
    }

    fn constant(&mut self) {
        let number = match self.random.next(8) {
            0 => i64::from(i32::MAX),
            1 => i64::from(i32::MIN),
            2 => [-1, 100, 127, 128, 255, 256, 1000, -129][self.random.next(8) as usize],
            _ => self.random.next(12) as i64 - 2,
        };
        self.line(&format!("const.i32 {number}"));
    }

    fn expression(&mut self, depth: usize) {
        match self.random.next(if depth == 0 { 4 } else { 9 }) {
            0 => self.constant(),
            1..=3 => {
                let slot = self.random.one(SLOTS);
                self.line(&format!("slot.load {slot}"));
            }
            4 => {
                self.expression(depth - 1);
                let op = self.random.one(&["i32.eqz", "i32.extend8_s", "i32.extend16_u", "i32.neg", "i32.nez"]);
                self.line(op);
            }
            5 => {
                self.element(depth - 1);
                self.line("ref.load i32");
            }
            6 => {
                self.expression(depth - 1);
                self.expression(depth - 1);
                let op = self.random.one(&["i32.div_s", "i32.rem_s", "i32.rem_u"]);
                self.line(op);
            }
            _ => {
                self.expression(depth - 1);
                self.expression(depth - 1);
                let op = self.random.one(PURE);
                self.line(op);
            }
        }
    }

    /// A reference to an element of the array; the index may lie outside.
    fn element(&mut self, depth: usize) {
        self.line("address d v vector");
        match self.random.next(4) {
            0 => self.expression(depth),
            1 => {
                self.expression(depth);
                self.line("const.i32 7");
                self.line("i32.and");
            }
            _ => {
                let slot = self.random.one(&["g a", "l x", "p n"]);
                self.line(&format!("slot.load {slot}"));
            }
        }
        self.line("ref.index vector");
    }

    fn block(&mut self, count: u64) {
        for _ in 0..1 + self.random.next(count) {
            self.statement();
        }
    }

    fn statement(&mut self) {
        let nested = self.depth < 3;
        match self.random.next(if nested { 12 } else { 6 }) {
            0 => {
                self.element(1);
                self.expression(2);
                self.line("ref.store i32");
            }
            1 => {
                self.expression(1);
                self.line("call f");
                self.line("slot.store g b");
            }
            2..=5 => {
                self.expression(2);
                let slot = self.random.one(SLOTS);
                self.line(&format!("slot.store {slot}"));
            }
            6..=8 => self.branch(),
            9 | 10 => self.for_loop(),
            _ => self.while_loop(),
        }
    }

    fn branch(&mut self) {
        let (other, end) = (self.label(), self.label());
        self.depth += 1;
        self.expression(1);
        self.line(&format!("jump.unless {other}"));
        self.block(2);
        if self.random.next(2) == 0 {
            self.line(&format!("jump {end}"));
            self.line(&format!("{other}:"));
            self.block(2);
            self.line(&format!("{end}:"));
        } else {
            self.line(&format!("{other}:"));
        }
        self.line("nop");
        self.depth -= 1;
    }

    fn for_loop(&mut self) {
        let (pass, end) = (self.label(), self.label());
        self.loops += 1;
        let name = format!("k{}", self.loops);
        let (slot, ty) = CONTROLS[self.random.next(CONTROLS.len() as u64) as usize];
        let _ = writeln!(self.for_lines, "for {name} {slot} {ty}");
        self.depth += 1;
        if self.random.next(4) == 0 {
            self.expression(1);
        } else {
            self.constant();
        }
        if self.random.next(3) == 0 {
            self.expression(1);
        } else {
            self.constant();
        }
        let step = self.random.one(&["1", "1", "2", "-1", "-3", "100"]);
        if self.random.next(6) == 0 {
            self.expression(0);
        } else {
            self.line(&format!("const.i32 {step}"));
        }
        self.line(&format!("for.enter {name} {end}"));
        self.line(&format!("{pass}:"));
        self.block(3);
        if self.random.next(4) == 0 {
            self.expression(1);
            self.line(&format!("jump.if {end}"));
        }
        self.line(&format!("for.next {name} {pass}"));
        self.line(&format!("{end}:"));
        self.line("nop");
        self.depth -= 1;
    }

    fn while_loop(&mut self) {
        let (top, end) = (self.label(), self.label());
        self.depth += 1;
        self.line("nop");
        self.line(&format!("{top}:"));
        self.expression(1);
        self.line(&format!("jump.if {end}"));
        self.block(3);
        self.line(&format!("jump {top}"));
        self.line(&format!("{end}:"));
        self.line("nop");
        self.depth -= 1;
    }
}

fn program(seed: u64) -> String {
    let mut writer = Writer {
        random: Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1),
        text: String::new(),
        labels: 0,
        loops: 0,
        for_lines: String::new(),
        depth: 0,
    };
    writer.block(6);
    format!(
        "global a i32\nglobal b i32\nglobal c b1\nglobal s u8\nglobal w u16\ntype number scalar i32\narray vector number -1..8\ndata v vector\n\
         program main_\nslot d i32\nslot e b1\nslot n i16\nslot t i8\n\
         function main program main_\nlocal x i32\nlocal y b1\n{}{}return\nend\n\
         function f\nparam q i32\nresult i32\nslot.load l q\nslot.load g a\ni32.add\nslot.store g c\n\
         slot.load l q\nconst.i32 5\nslot.load l q\ni32.div_s\ni32.add\nreturn\nend\n",
        writer.for_lines, writer.text
    )
}

#[test]
fn random_programs_run_the_same_with_and_without_passes() {
    let mut trapped = 0;
    let mut ended = 0;
    for seed in 1..=400 {
        let text = program(seed);
        let options = |passes| JitOptions { fuel: true, verify_ir: true, passes, ..JitOptions::default() };
        let mut plain = load_with(&text, options(Passes::NONE));
        let mut passed = load_with(&text, options(Passes::ALL));
        for scan in 0..3 {
            let (expected, found) = (plain.run_with_fuel(20_000), passed.run_with_fuel(20_000));
            assert_eq!(found, expected, "seed {seed} scan {scan}\n{text}");
            let difference = passed.image.first_difference(&plain.image);
            assert_eq!(difference, None, "seed {seed} scan {scan} {expected:?}\n{text}");
            if expected.0.is_err() { trapped += 1 } else { ended += 1 }
        }
    }
    assert!(trapped > 100 && ended > 100, "{trapped} traps, {ended} ends");
}
