//! Loops over arrays of floats give the same bits in vectors as one pass after the other: random bodies, with and without the pass.

mod common;

use std::fmt::Write;

use common::{form, load_with};
use khz_jit::{JitOptions, Passes};

/// A small generator of numbers (xorshift), so that a failing seed can be run again.
struct Random(u64);

impl Random {
    fn next(&mut self, below: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) % below as u64) as usize
    }

    fn one<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.next(of.len())]
    }
}

/// Writes bodies over arrays `a`, `b`, `c` of 0..=79 of one type, scalars `s`, `t`, `u`, and control variables.
struct Writer {
    random: Random,
    ty: &'static str,
    text: String,
    labels: usize,
}

impl Writer {
    fn index(&mut self, controls: &[&str]) -> String {
        let control = self.random.one(controls);
        let other = self.random.one(controls);
        match self.random.next(12) {
            0 => format!("slot.load p {control}\nconst.i32 1\ni32.add\n"),
            1 => format!("slot.load p {control}\nconst.i32 2\ni32.mul\n"),
            2 => "const.i32 3\n".to_owned(),
            3 => format!("const.i32 20\nslot.load p {control}\ni32.sub\n"),
            4..=6 => format!("slot.load p {other}\nconst.i32 4\ni32.mul\nslot.load p {control}\ni32.add\n"),
            _ => format!("slot.load p {control}\n"),
        }
    }

    fn element(&mut self, controls: &[&str]) -> String {
        let array = self.random.one(&["a", "b", "c"]);
        let index = self.index(controls);
        format!("address d {array} v\n{index}ref.index v\n")
    }

    fn expression(&mut self, controls: &[&str], depth: usize) {
        let ty = self.ty;
        match self.random.next(if depth == 0 { 6 } else { 10 }) {
            0 => {
                let number = self.random.one(&["1.5", "-0.25", "3.0", "1e30"]);
                let _ = writeln!(self.text, "const {ty} {number}");
            }
            1 => {
                let scalar = self.random.one(&["s", "t", "u"]);
                let _ = writeln!(self.text, "slot.load p {scalar}");
            }
            2 => {
                let control = self.random.one(controls);
                let _ = writeln!(self.text, "slot.load p {control}\n{ty}.convert_i32_s");
            }
            3..=5 => {
                let element = self.element(controls);
                let _ = writeln!(self.text, "{element}ref.load {ty}");
            }
            _ => {
                self.expression(controls, depth - 1);
                self.expression(controls, depth - 1);
                let op = self.random.one(&["add", "sub", "mul", "div", "add", "mul"]);
                let _ = writeln!(self.text, "{ty}.{op}");
            }
        }
    }

    fn statement(&mut self, controls: &[&str]) {
        let ty = self.ty;
        match self.random.next(5) {
            0 => {
                let scalar = self.random.one(&["s", "t", "u"]);
                self.expression(controls, 2);
                let _ = writeln!(self.text, "slot.store p {scalar}");
            }
            1 => {
                let scalar = self.random.one(&["s", "t", "u"]);
                let _ = writeln!(self.text, "slot.load p {scalar}");
                self.expression(controls, 2);
                let _ = writeln!(self.text, "{ty}.add\nslot.store p {scalar}");
            }
            _ => {
                let element = self.element(controls);
                self.text.push_str(&element);
                self.expression(controls, 2);
                let _ = writeln!(self.text, "ref.store {ty}");
            }
        }
    }

    /// An IF, with or without ELSE.
    fn choice(&mut self, controls: &[&str]) {
        let ty = self.ty;
        self.labels += 1;
        let label = self.labels;
        self.expression(controls, 1);
        self.expression(controls, 1);
        let test = self.random.one(&["gt", "lt", "ge", "le", "eq", "ne"]);
        let _ = writeln!(self.text, "{ty}.{test}\njump.unless else{label}");
        self.statement(controls);
        let nested = self.random.next(3) == 0 && self.labels < 6;
        if self.random.next(2) == 0 {
            let _ = writeln!(self.text, "jump end{label}\nelse{label}:");
            if nested {
                self.choice(controls);
            } else {
                self.statement(controls);
            }
            let _ = writeln!(self.text, "end{label}:\nnop");
        } else {
            let _ = writeln!(self.text, "else{label}:\nnop");
        }
    }

    fn statements(&mut self, controls: &[&str], most: usize) {
        for _ in 0..self.random.next(most) + 1 {
            if self.random.next(4) == 0 { self.choice(controls) } else { self.statement(controls) }
        }
    }

    fn for_loop(&mut self, name: &str, body: impl FnOnce(&mut Writer)) {
        let last = [7, 3, 11, 15, 5, 0][self.random.next(6)];
        let first = if self.random.next(4) == 0 { 1 } else { 0 };
        let _ = writeln!(
            self.text,
            "const.i32 {first}\nconst.i32 {last}\nconst.i32 1\nfor.enter {name} {name}_end\n{name}_top:"
        );
        body(self);
        let _ = writeln!(self.text, "for.next {name} {name}_top\n{name}_end:\nnop");
    }
}

fn program(seed: u64) -> String {
    let ty = if seed.is_multiple_of(3) { "f64" } else { "f32" };
    let mut writer =
        Writer { random: Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1), ty, text: String::new(), labels: 0 };
    for (outer, control, inner, within) in [("ka", "i", "kb", "k"), ("kc", "j", "kd", "k")] {
        writer.for_loop(outer, |writer| {
            if writer.random.next(2) == 0 {
                writer.statements(&[control], 2);
                if writer.random.next(2) == 0 {
                    let _ = writeln!(writer.text, "const {ty} 0.0\nslot.store p s");
                }
                writer.for_loop(inner, |writer| writer.statements(&[control, within], 2));
                writer.statements(&[control], 2);
            } else {
                writer.statements(&[control], 3);
            }
        });
    }
    let used = |name: &str, control: &str| {
        if writer.text.contains(&format!("for.enter {name} ")) {
            format!("for {name} p {control} i32\n")
        } else {
            String::new()
        }
    };
    let loops = used("ka", "i") + &used("kb", "k") + &used("kc", "j") + &used("kd", "k");
    format!(
        "type number scalar {ty}\narray v number 0..79\ndata a v\ndata b v\ndata c v\nprogram main_\nslot i i32\nslot j i32\nslot k i32\n\
         slot s {ty}\nslot t {ty}\nslot u {ty}\nfunction main program main_\n{loops}{}return\nend\n",
        writer.text
    )
}

#[test]
fn random_loops_over_floats_run_the_same_in_vectors() {
    let (mut in_vectors, mut chosen) = (0, 0);
    let without = Passes { vectorise: false, ..Passes::ALL };
    for seed in 1..=800 {
        let text = program(seed);
        let shown = form(&text, Passes::ALL);
        in_vectors += usize::from(shown.contains("splat"));
        chosen += usize::from(shown.contains(":f32x4 = select") || shown.contains(":f64x2 = select"));
        let options = |passes| JitOptions { fuel: false, verify_ir: true, passes, ..JitOptions::default() };
        let mut plain = load_with(&text, options(Passes::NONE));
        let mut scalar = load_with(&text, options(without));
        let mut vector = load_with(&text, options(Passes::ALL));
        for scan in 0..3 {
            let expected = plain.run();
            assert_eq!(scalar.run(), expected, "seed {seed} scan {scan}\n{text}");
            assert_eq!(vector.run(), expected, "seed {seed} scan {scan}\n{text}");
            assert_eq!(scalar.image.first_difference(&plain.image), None, "seed {seed} scan {scan}\n{text}");
            assert_eq!(vector.image.first_difference(&plain.image), None, "seed {seed} scan {scan}\n{text}");
        }
    }
    assert!(in_vectors > 40 && chosen > 3, "{in_vectors} programs in vectors, {chosen} with IFs");
}
