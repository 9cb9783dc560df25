//! Spoiled Structured Text: pieces of programs that go, come twice, change places or come from elsewhere, and what lexers and parsers dislike.
//!
//! The front end never refuses to look at a text, so nearly everything here is about pieces that are words of the language in an order that nobody
//! wrote. Pieces are found by the class of their characters alone, without the front end's lexer: what it does not know must come through, too.

use crate::random::Random;

/// Most bytes of a mutant, about.
const MAX_BYTES: usize = 1 << 17;

/// One way to spoil a text.
#[derive(Debug)]
pub struct Kind {
    /// Its name in reports.
    pub name: &'static str,
    weight: usize,
    spoil: fn(&mut Random, &[Vec<u8>], &mut Vec<u8>),
}

/// Every way, with its weight of 1,000 or so.
#[rustfmt::skip]
pub const KINDS: &[Kind] = &[
    Kind { name: "pieces deleted", weight: 180, spoil: delete },
    Kind { name: "pieces doubled", weight: 120, spoil: double },
    Kind { name: "pieces swapped", weight: 120, spoil: swap },
    Kind { name: "word replaced", weight: 140, spoil: replace },
    Kind { name: "splice", weight: 120, spoil: splice },
    Kind { name: "two halves", weight: 60, spoil: join },
    Kind { name: "byte noise", weight: 60, spoil: noise },
    Kind { name: "odd bytes", weight: 60, spoil: odd_bytes },
    Kind { name: "huge literal", weight: 50, spoil: literal },
    Kind { name: "open comment", weight: 40, spoil: comment },
    Kind { name: "nesting", weight: 20, spoil: nest },
    Kind { name: "line ends", weight: 20, spoil: line_ends },
    Kind { name: "long word", weight: 6, spoil: long_word },
    Kind { name: "piece many times", weight: 4, spoil: repeat },
];

/// A spoiled text.
#[derive(Debug, Clone)]
pub struct Mutant {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// What was done to it, in order: names of [`KINDS`].
    pub kinds: Vec<&'static str>,
}

/// The mutant of a seed, of one of the texts; they must not be none. It follows from them and the seed alone.
#[must_use]
pub fn mutant(texts: &[Vec<u8>], seed: u64) -> Mutant {
    let mut random = Random::new(seed ^ 0x5354);
    let mut bytes = random.pick(texts).cloned().unwrap_or_default();
    let weights: Vec<usize> = KINDS.iter().map(|kind| kind.weight).collect();
    let mut kinds = Vec::new();
    for _ in 0..random.one_of([1, 1, 2, 3, 6]) {
        let kind = &KINDS[random.weighted(&weights)];
        (kind.spoil)(&mut random, texts, &mut bytes);
        bytes.truncate(MAX_BYTES);
        kinds.push(kind.name);
    }
    Mutant { bytes, kinds }
}

/// Whether two neighbouring bytes belong to one piece.
fn is_one_piece(before: u8, after: u8) -> bool {
    let class = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'_' | b'#' | b'.' | 0x80.. => 0,
        b' ' | b'\t' | b'\r' | b'\n' => 1,
        _ => 2,
    };
    class(before) == class(after) && class(before) != 2
}

/// A piece: a word, a number, a run of blanks, or a sign.
fn piece(random: &mut Random, text: &[u8]) -> std::ops::Range<usize> {
    let at = random.below(text.len());
    let joined = |at: usize| is_one_piece(text[at - 1], text[at]);
    let start = (1..=at).rev().find(|at| !joined(*at)).unwrap_or(0);
    let end = (at + 1..text.len()).find(|at| !joined(*at)).unwrap_or(text.len());
    start..end.min(text.len())
}

/// Some pieces in a row.
fn pieces(random: &mut Random, text: &[u8]) -> std::ops::Range<usize> {
    let first = piece(random, text);
    let length = random.one_of([0, 0, 0, 8, 60, 400]);
    let end = (first.end + random.below(length + 1)).min(text.len());
    first.start..end
}

/// A word of one of the texts: keywords, types, operators and names as often as people write them.
fn word<'t>(random: &mut Random, texts: &'t [Vec<u8>]) -> &'t [u8] {
    let Some(text) = random.pick(texts) else { return b"" };
    let found = piece(random, text);
    let found = if text[found.clone()].iter().all(u8::is_ascii_whitespace) { piece(random, text) } else { found };
    &text[found]
}

fn delete(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let range = pieces(random, text);
    text.drain(range);
}

fn double(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let range = pieces(random, text);
    let copied = text[range.clone()].to_vec();
    text.splice(range.end..range.end, copied);
}

fn swap(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let (one, other) = (piece(random, text), piece(random, text));
    let (first, second) = if one.start <= other.start { (one, other) } else { (other, one) };
    if first.end > second.start {
        return;
    }
    let (early, late) = (text[first.clone()].to_vec(), text[second.clone()].to_vec());
    text.splice(second, early);
    text.splice(first, late);
}

fn replace(random: &mut Random, texts: &[Vec<u8>], text: &mut Vec<u8>) {
    let range = piece(random, text);
    text.splice(range, word(random, texts).iter().copied());
}

fn splice(random: &mut Random, texts: &[Vec<u8>], text: &mut Vec<u8>) {
    let Some(other) = random.pick(texts) else { return };
    let (from, to) = (pieces(random, other), pieces(random, text));
    text.splice(to, other[from].iter().copied());
}

fn join(random: &mut Random, texts: &[Vec<u8>], text: &mut Vec<u8>) {
    let Some(other) = random.pick(texts) else { return };
    let (cut, from) = (piece(random, text).start, piece(random, other).start);
    text.truncate(cut);
    text.extend_from_slice(&other[from..]);
}

fn noise(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    if random.chance(10) {
        text.push(random.bits() as u8);
    }
    for _ in 0..random.one_of([1, 1, 3, 20]) {
        let at = random.below(text.len());
        if let Some(byte) = text.get_mut(at) {
            *byte = if random.chance(50) { random.bits() as u8 } else { *byte ^ (1 << random.below(8)) };
        }
    }
}

fn insert(random: &mut Random, text: &mut Vec<u8>, what: &[u8]) {
    let at = if random.chance(50) { piece(random, text).start } else { random.below(text.len() + 1) };
    text.splice(at..at, what.iter().copied());
}

fn odd_bytes(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let odd: [&[u8]; 16] = [
        b"\0",
        b"\xFF",
        b"\xC0\x80",
        b"\xED\xA0\x80",
        b"\xF4\x90\x80\x80",
        b"\xE2\x82",
        b"\xEF\xBB\xBF",
        b"\xFF\xFE",
        b"\x1A",
        b"\x0B",
        b"\x0C",
        "\u{2028}".as_bytes(),
        "\u{200F}".as_bytes(),
        "e\u{301}".as_bytes(),
        "\u{1D7D8}".as_bytes(),
        b"\x7F",
    ];
    let what = random.one_of(odd);
    insert(random, text, what);
}

fn literal(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let digits = "9".repeat(random.one_of([10, 19, 20, 40, 400, 20_000]));
    let fixed = [
        "-2147483648..2147483647",
        "1..0",
        "16#FFFF_FFFF_FFFF_FFFF",
        "16#1_0000_0000_0000_0000",
        "2#",
        "8#9",
        "1e999999999",
        "-1.0e-999999",
        "T#106751d23h47m16s854.775807ms",
        "T#-99999999999999d",
        "LTIME#9223372036s854ms775us808ns",
        "D#9999-99-99",
        "DT#0000-00-00-99:99:99.999999999",
        "TOD#24:00:00",
        "STRING[65536]",
        "STRING[99999999999]",
        "'$'",
        "\"$D800\"",
        "%QX99999999999.7",
        "%IW*",
        "%MD4294967295",
        "__",
        "_1",
        "1__0",
        "SINT#-129",
        "ULINT#18446744073709551616",
        "ARRAY[0..65535, 0..65535] OF LREAL",
        "ARRAY[-2147483648..2147483647] OF BYTE",
        "[1000000000(0)]",
        "[1(1(1(2)))]",
        "#",
        "..",
        "^^^^",
        ":=:=",
        "=>",
        "**",
    ];
    let what = match random.below(4) {
        0 => digits,
        1 => format!(
            "{}{digits}",
            random.one_of(["16#", "2#1", "LREAL#0.", "1.0e", "T#", "STRING[", "'", "INT#-", "%IX", "DATE#"])
        ),
        _ => random.one_of(fixed).to_string(),
    };
    let range = piece(random, text);
    text.splice(range, what.into_bytes());
}

fn comment(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let what = random.one_of([
        "(*",
        "*)",
        "/*",
        "*/",
        "//",
        "{",
        "}",
        "(*(*(*",
        "(*)",
        "'",
        "\"",
        "$'",
        "{IF",
        "{END_IF}",
        "(* /* *) */",
    ]);
    insert(random, text, what.as_bytes());
}

/// Something that opens, many times, closed as often or not at all.
fn nest(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let (open, close) = random.one_of([
        ("(", ")"),
        ("NOT ", ""),
        ("-", ""),
        ("[", "]"),
        ("(*", "*)"),
        ("a[", "]"),
        ("f(", ")"),
        ("f(x := ", ")"),
        ("1+", ""),
        ("1**", ""),
        ("a.", ""),
        ("a^", ""),
        ("REF(", ")"),
        ("IF TRUE THEN ", " END_IF;"),
        ("CASE 1 OF 1: ", " END_CASE;"),
        ("FOR i := 1 TO 2 DO ", " END_FOR;"),
        ("WHILE TRUE DO ", " END_WHILE;"),
        ("REPEAT ", " UNTIL TRUE END_REPEAT;"),
        ("ELSIF TRUE THEN ", ""),
        ("ARRAY[0..1] OF ", ""),
        ("STRUCT a : ", "; END_STRUCT"),
        ("REF_TO ", ""),
        ("NAMESPACE n ", " END_NAMESPACE"),
        ("FUNCTION f : INT ", " END_FUNCTION"),
        ("{", "}"),
        ("2(", ")"),
        ("(a := ", ")"),
        ("VAR ", " END_VAR"),
        ("ELSE ", ""),
        ("a := ", ""),
        (";", ""),
    ]);
    let count = random.one_of([20, 120, 130, 260, 2_000, 20_000]).min(MAX_BYTES / 2 / open.len());
    let mut what = open.repeat(count);
    if random.chance(60) {
        what.push_str(random.one_of(["1", "x", "INT", ""]));
        what += &close.repeat(count);
    }
    insert(random, text, what.as_bytes());
}

fn line_ends(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let to: &[u8] = random.one_of([&b"\r\n"[..], b"\r", b" ", b"\n\r", b"\n\n\n", b""]);
    *text = text.split(|byte| *byte == b'\n').collect::<Vec<_>>().join(to);
}

fn long_word(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let unit = random.one_of(["x", " ", "_", "9", "\t", "\n", "é", "x_", "a.b", "\0", "$", "$41"]);
    let what = unit.repeat(random.one_of([300, 5_000, 40_000]));
    insert(random, text, what.as_bytes());
}

/// Pieces many times over: what grows faster than the text shows here.
fn repeat(random: &mut Random, _: &[Vec<u8>], text: &mut Vec<u8>) {
    let range = pieces(random, text);
    let count = random.one_of([50, 500, 5_000]).min(MAX_BYTES / 2 / range.len().max(1));
    let what = text[range.clone()].repeat(count);
    text.splice(range.end..range.end, what);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_the_same_mutant_and_every_kind_changes_something() {
        let texts =
            vec![b"PROGRAM p VAR x : INT; END_VAR\nx := (1 + 2);\nEND_PROGRAM\n".to_vec(), b"a".to_vec(), Vec::new()];
        assert_eq!(mutant(&texts, 5).bytes, mutant(&texts, 5).bytes);
        for kind in KINDS {
            let changed = (0..200).any(|seed| {
                let mut text = texts[0].clone();
                (kind.spoil)(&mut Random::new(seed), &texts, &mut text);
                text != texts[0]
            });
            assert!(changed, "{} changes nothing", kind.name);
            // Nothing to be found in an empty text.
            for seed in 0..50 {
                (kind.spoil)(&mut Random::new(seed), &texts[2..], &mut Vec::new());
            }
        }
    }
}
