//! The operations, one C function for each and each kind: `add_INT`, `lt_REAL`, `INT_to_REAL`.

use std::fmt::Write;

use super::super::tree::Kind;
use super::{is_number, type_of};

/// What does not depend on a kind. `run` gives each scan a place to come back to when it traps.
const START: &str = r#"#include <math.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

static jmp_buf out;

static void trap(int code) { longjmp(out, code); }

static float real_of(uint32_t bits) { float value; memcpy(&value, &bits, 4); return value; }
static double lreal_of(uint64_t bits) { double value; memcpy(&value, &bits, 8); return value; }

static void show(uint64_t bits) { printf(" %llx", (unsigned long long)bits); }
static void show_REAL(float value) { uint32_t bits; memcpy(&bits, &value, 4); show(value != value ? 0xFFC00000u : bits); }
static void show_LREAL(double value) { uint64_t bits; memcpy(&bits, &value, 8); show(value != value ? 0xFFF8000000000000u : bits); }

static void run(int number, int scans, void (*first)(void), void (*scan)(void), void (*all)(void)) {
  first();
  for (volatile int left = scans; left > 0; left--) {
    volatile int code = setjmp(out);
    if (code == 0) scan();
    printf("%d %d", number, code);
    all();
    printf("\n");
    if (code != 0) break;
  }
}

static int64_t element(int64_t index, int64_t low, int64_t high) {
  if (index < low || index > high) trap(2);
  return index - low;
}
"#;

/// Operations of every integer and bit string; N its name, T its type, U the unsigned type of its width.
const WHOLE: &str = r"
static T add_N(T a, T b) { return (T)(U)((uint64_t)a + (uint64_t)b); }
static T sub_N(T a, T b) { return (T)(U)((uint64_t)a - (uint64_t)b); }
static T mul_N(T a, T b) { return (T)(U)((uint64_t)a * (uint64_t)b); }
static T neg_N(T a) { return (T)(U)((uint64_t)0 - (uint64_t)a); }
static T not_N(T a) { return (T)(U)~(uint64_t)a; }
static T and_N(T a, T b) { return (T)(U)((uint64_t)a & (uint64_t)b); }
static T or_N(T a, T b) { return (T)(U)((uint64_t)a | (uint64_t)b); }
static T xor_N(T a, T b) { return (T)(U)((uint64_t)a ^ (uint64_t)b); }
static T shl_N(T a, int64_t by) { return by < 0 || by >= W ? 0 : (T)(U)((uint64_t)(U)a << by); }
static T rol_N(T a, int64_t by) {
  uint64_t bits = (uint64_t)(U)a;
  int n = (int)((uint64_t)by % W);
  return n == 0 ? a : (T)(U)(bits << n | bits >> (W - n));
}
static T ror_N(T a, int64_t by) { return rol_N(a, W - (int64_t)((uint64_t)by % W)); }
";

const SIGNED: &str = r"
static T div_N(T a, T b) { if (b == 0) trap(1); return b == -1 ? neg_N(a) : (T)(a / b); }
static T mod_N(T a, T b) { if (b == 0) trap(1); return b == -1 ? 0 : (T)(a % b); }
static T shr_N(T a, int64_t by) {
  int n = by < 0 || by >= W ? W - 1 : (int)by;
  return a < 0 ? (T)~(T)((U)~a >> n) : (T)((U)a >> n);
}
static T abs_N(T a) { return a < 0 ? neg_N(a) : a; }
";

const UNSIGNED: &str = r"
static T div_N(T a, T b) { if (b == 0) trap(1); return (T)(a / b); }
static T mod_N(T a, T b) { if (b == 0) trap(1); return (T)(a % b); }
static T shr_N(T a, int64_t by) { return by < 0 || by >= W ? 0 : (T)(a >> by); }
static T abs_N(T a) { return a; }
";

const BOOL: &str = r"
static T not_N(T a) { return a == 0; }
static T and_N(T a, T b) { return a & b; }
static T or_N(T a, T b) { return a | b; }
static T xor_N(T a, T b) { return a ^ b; }
";

const FLOAT: &str = r"
static T add_N(T a, T b) { return a + b; }
static T sub_N(T a, T b) { return a - b; }
static T mul_N(T a, T b) { return a * b; }
static T div_N(T a, T b) { return a / b; }
static T neg_N(T a) { return -a; }
static T abs_N(T a) { return (T)fabs((double)a); }
";

/// What every kind has.
const ORDER: &str = r"
static uint8_t eq_N(T a, T b) { return a == b; }
static uint8_t ne_N(T a, T b) { return a != b; }
static uint8_t lt_N(T a, T b) { return a < b; }
static uint8_t le_N(T a, T b) { return a <= b; }
static uint8_t gt_N(T a, T b) { return a > b; }
static uint8_t ge_N(T a, T b) { return a >= b; }
static T min_N(T a, T b) { return b < a ? b : a; }
static T max_N(T a, T b) { return b > a ? b : a; }
static T check_N(T a, T low, T high) { if (a < low || a > high) trap(3); return a; }
";

/// The unsigned type of a kind's width.
pub(super) fn unsigned(kind: Kind) -> &'static str {
    match kind.bits() {
        1 | 8 => "uint8_t",
        16 => "uint16_t",
        32 => "uint32_t",
        _ => "uint64_t",
    }
}

fn fill(template: &str, kind: Kind) -> String {
    let mut text = String::new();
    // T, U and W stand alone, N behind an underscore.
    for piece in template.split_inclusive(|c: char| !(c.is_ascii_alphanumeric() || c == '_')) {
        let end = piece.trim_end_matches(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).len();
        let (word, rest) = piece.split_at(end);
        match word {
            "T" => text.push_str(type_of(kind)),
            "U" => text.push_str(unsigned(kind)),
            "W" => drop(write!(text, "{}", kind.bits())),
            _ => match word.strip_suffix("_N") {
                Some(operation) => drop(write!(text, "{operation}_{}", kind.name())),
                None => text.push_str(word),
            },
        }
        text.push_str(rest);
    }
    text
}

/// `A_to_B`, and from floats also `A_cut_B`, which cuts instead of rounding to even.
fn conversion(from: Kind, to: Kind) -> String {
    let (a, b) = (type_of(from), type_of(to));
    let name = |word: &str| format!("static {b} {}_{word}_{}({a} value)", from.name(), to.name());
    if to == Kind::Bool {
        return format!("{} {{ return value != 0; }}\n", name("to"));
    }
    if to.is_real() {
        return format!("{} {{ return ({b})value; }}\n", name("to"));
    }
    if !from.is_real() {
        return format!("{} {{ return ({b})({})(uint64_t)value; }}\n", name("to"), unsigned(to));
    }
    let (low, high) = to.limits();
    // One more than the highest is a power of two, which a double holds.
    let above = format!("{:.1}", (high as u128 + 1) as f64);
    let saturate = |whole: &str| {
        format!(
            "{{ double whole = {whole}((double)value); if (whole != whole) return 0; if (whole <= {low:.1}) return ({b})({u})0x{low_bits:X}u; if (whole >= {above}) return ({b})({u})0x{high:X}u; return ({b})whole; }}\n",
            low = low as f64,
            u = unsigned(to),
            low_bits = (low as u64) & (u64::MAX >> (64 - to.bits())),
        )
    };
    format!("{} {}{} {}", name("to"), saturate("rint"), name("cut"), saturate("trunc"))
}

/// Everything that programs name.
pub(super) fn text() -> String {
    let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(|kind| is_number(*kind)).collect();
    let mut text = String::from(START);
    for kind in &kinds {
        let own: &[&str] = match kind {
            Kind::Bool => &[BOOL],
            Kind::Real | Kind::Lreal => &[FLOAT],
            kind if kind.is_signed() => &[WHOLE, SIGNED],
            _ => &[WHOLE, UNSIGNED],
        };
        own.iter().chain(&[ORDER]).for_each(|template| text.push_str(&fill(template, *kind)));
    }
    text.push_str("static float sqrt_REAL(float a) { return sqrtf(a); }\n");
    text.push_str("static double sqrt_LREAL(double a) { return sqrt(a); }\n");
    for from in &kinds {
        kinds.iter().for_each(|to| text.push_str(&conversion(*from, *to)));
    }
    text
}
