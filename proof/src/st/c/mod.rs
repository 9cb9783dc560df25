//! The arithmetic of the tree as C, whose compilers know nothing of Kilohertz.
//!
//! [`subset`] leaves of a program what C can say: numbers, bit strings, BOOL, enumerations, subranges, arrays and structures of them,
//! operators, conversions and functions between them, every statement but calls. [`Program`] prints that as C with explicit widths: each operation is a
//! function of the prelude that computes in unsigned 64 bits and cuts, each operand a variable of its own, so that neither the
//! promotions of C nor its order of evaluation matter. A trap leaves the scan with a number. [`dense`] makes programs of nothing else. Many programs go into one [`file`], whose output says for
//! every program and scan how it ended and the bits of every variable.

mod dense;
mod prelude;
mod program;
mod subset;

pub use dense::dense;
pub use program::{Leaf, Program, Trap};
pub use subset::subset;

use std::collections::{BTreeMap, BTreeSet};

use super::tree::{Kind, Ty};

/// C's type for a kind.
fn type_of(kind: Kind) -> &'static str {
    match kind {
        Kind::Bool | Kind::Usint | Kind::Byte => "uint8_t",
        Kind::Sint => "int8_t",
        Kind::Int => "int16_t",
        Kind::Dint => "int32_t",
        Kind::Lint => "int64_t",
        Kind::Uint | Kind::Word => "uint16_t",
        Kind::Udint | Kind::Dword => "uint32_t",
        Kind::Ulint | Kind::Lword => "uint64_t",
        Kind::Real => "float",
        Kind::Lreal => "double",
        _ => "void",
    }
}

/// Whether C computes with a kind; TIME and its like are no numbers.
fn is_number(kind: Kind) -> bool {
    kind == Kind::Bool || kind.is_integer() || kind.is_bits() || kind.is_real()
}

/// The kind that a single value computes in: an enumeration in LINT.
fn kind_of(ty: Ty) -> Kind {
    if let Ty::K(kind) = ty { kind } else { Kind::Lint }
}

/// The names of the operations that the standard has: what programs can call.
#[must_use]
pub fn operations() -> BTreeSet<String> {
    let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(|kind| is_number(*kind)).collect();
    let text = prelude::text();
    let names = text.lines().filter_map(|line| line.strip_prefix("static ")?.split_once('('));
    let names = names.filter_map(|(head, _)| head.split_once(' ')).map(|(_, name)| name);
    let is_said = |name: &&str| {
        let Some((operation, last)) = name.rsplit_once('_') else { return false };
        let Some(kind) = kinds.iter().find(|kind| kind.name() == last) else { return false };
        match operation {
            "show" => false,
            "and" | "or" | "xor" | "not" => *kind == Kind::Bool || kind.is_bits(),
            "eq" | "ne" => true,
            "neg" => kind.is_signed() || kind.is_real(),
            "abs" | "div" | "mod" => !kind.is_bits(),
            "check" => kind.is_integer(),
            // Only what is cut to an integer has a name.
            _ if operation.ends_with("_cut") => kind.is_integer(),
            _ => *kind != Kind::Bool && operation.split('_').next() != Some(last),
        }
    };
    names.filter(is_said).map(str::to_string).collect()
}

/// A C file that runs some programs, each for `scans` scans or until it traps, and prints one line for each scan: the program's number,
/// how the scan ended, and its leaves as hexadecimal bits.
#[must_use]
pub fn file(programs: &[Program], scans: usize) -> String {
    let mut text = prelude::text();
    programs.iter().for_each(|program| text.push_str(&program.text));
    text.push_str("int main(void) {\n");
    for program in programs {
        let number = program.number;
        text.push_str(&format!("  run({number}, {scans}, p{number}_first, p{number}_scan, p{number}_show);\n"));
    }
    text.push_str("  return 0;\n}\n");
    text
}

/// What one scan of one program came to in C.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scan {
    /// How it ended.
    pub ending: Option<Trap>,
    /// The bits of the leaves, in their order.
    pub leaves: Vec<u64>,
}

/// Reads the output of a [`file`]: for each program, by its number, its scans. None: it is not such an output.
#[must_use]
pub fn results(output: &str) -> Option<BTreeMap<usize, Vec<Scan>>> {
    let mut found = BTreeMap::new();
    for line in output.lines() {
        let mut words = line.split(' ');
        let number: usize = words.next()?.parse().ok()?;
        let ending = match words.next()?.parse::<usize>().ok()? {
            0 => None,
            code => Some(*Trap::ALL.get(code - 1)?),
        };
        let leaves = words.map(|word| u64::from_str_radix(word, 16).ok()).collect::<Option<Vec<u64>>>()?;
        found.entry(number).or_insert_with(Vec::new).push(Scan { ending, leaves });
    }
    Some(found)
}
