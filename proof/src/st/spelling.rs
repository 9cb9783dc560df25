//! How types and constants are written.

use std::fmt::Write;

use super::moments;
use super::tree::{Area, At, Def, Kind, Source, Ty, Value};
use crate::random::Random;

/// Chooses among ways of writing the same. A style of 0 always takes the plainest.
pub(super) struct Style(Option<Random>);

impl Style {
    pub(super) fn new(style: u64) -> Style {
        Style((style != 0).then(|| Random::new(style)))
    }

    /// Whether to write it in the way that `percent` of a hundred have.
    pub(super) fn chance(&mut self, percent: usize) -> bool {
        self.0.as_mut().is_some_and(|random| random.chance(percent))
    }

    fn below(&mut self, limit: usize) -> usize {
        self.0.as_mut().map_or(0, |random| random.below(limit))
    }

    fn number(&mut self, value: i128) -> String {
        let plain = value.to_string();
        if value < 0 {
            return plain;
        }
        match self.below(10) {
            1 => format!("16#{value:X}"),
            2 => format!("2#{value:b}"),
            3 => format!("8#{value:o}"),
            4 if plain.len() > 3 => format!("{}_{}", &plain[..plain.len() - 3], &plain[plain.len() - 3..]),
            _ => plain,
        }
    }

    fn time(&mut self, long: bool, nanoseconds: i128) -> String {
        let prefix = match (long, self.chance(30)) {
            (false, false) => "T",
            (false, true) => "TIME",
            (true, false) => "LT",
            (true, true) => "LTIME",
        };
        let sign = if nanoseconds < 0 { "-" } else { "" };
        let all = nanoseconds.unsigned_abs();
        if self.chance(30) {
            return format!("{prefix}#{sign}{}s_{}ns", all / 1_000_000_000, all % 1_000_000_000);
        }
        if self.chance(20) {
            return format!("{prefix}#{sign}{}.{:06}ms", all / 1_000_000, all % 1_000_000);
        }
        format!("{prefix}#{sign}{}ms{}us{}ns", all / 1_000_000, all / 1000 % 1000, all % 1000)
    }

    fn moment(&mut self, kind: Kind, value: i128) -> String {
        let names = match kind {
            Kind::Date => ["D", "DATE"],
            Kind::Ldate => ["LD", "LDATE"],
            Kind::Tod => ["TOD", "TIME_OF_DAY"],
            Kind::Ltod => ["LTOD", "LTIME_OF_DAY"],
            Kind::Dt => ["DT", "DATE_AND_TIME"],
            _ => ["LDT", "LDATE_AND_TIME"],
        };
        let name = names[usize::from(self.chance(30))];
        let name = if self.chance(10) { name.to_lowercase() } else { name.to_string() };
        // What no literal can say is none that a compiler takes, so that the shrinker does not go there.
        let is_day = matches!(kind, Kind::Date | Kind::Ldate) && value % moments::DAY_NS != 0;
        let outside = matches!(kind, Kind::Tod | Kind::Ltod) && !(0..moments::DAY_NS).contains(&value);
        if is_day || outside { format!("{name}#0") } else { format!("{name}#{}", moments::text(kind, value)) }
    }

    /// A constant where a declaration wants one: numbers also as sums.
    pub(super) fn initial(&mut self, source: &Source, ty: Ty, value: &Value) -> String {
        if let (Ty::K(kind), Value::Int(number)) = (ty, value)
            && kind.is_integer()
            && *number > kind.limits().0
            && self.chance(25)
        {
            return format!("{} + 1", number - 1);
        }
        self.literal(source, ty, value, false)
    }

    fn list(&mut self, source: &Source, element: Ty, parts: &[Value]) -> String {
        let mut texts = Vec::new();
        let mut at = 0;
        while at < parts.len() {
            // By their text: 0.0 and -0.0 are equal, but not the same.
            let shown = format!("{:?}", parts[at]);
            let same = parts[at..].iter().take_while(|part| format!("{part:?}") == shown).count();
            let text = self.literal(source, element, &parts[at], false);
            if same > 1 && self.chance(60) {
                texts.push(format!("{same}({text})"));
                at += same;
            } else {
                texts.push(text);
                at += 1;
            }
        }
        format!("[{}]", texts.join(", "))
    }

    /// A literal, with its type before it if `typed`.
    pub(super) fn literal(&mut self, source: &Source, ty: Ty, value: &Value, typed: bool) -> String {
        let (prefix, plain) = match (ty, value) {
            (Ty::K(Kind::Bool), _) => {
                let word =
                    if value.int() == 0 { ["FALSE", "BOOL#0", "BOOL#FALSE"] } else { ["TRUE", "BOOL#1", "BOOL#TRUE"] };
                return word[if self.chance(10) { self.below(3) } else { 0 }].to_string();
            }
            (Ty::K(kind), Value::Int(value)) if kind.is_duration() => return self.time(kind == Kind::Ltime, *value),
            (Ty::K(kind), Value::Int(value)) if kind.is_moment() => return self.moment(kind, *value),
            (Ty::K(kind), Value::Int(value)) if kind.is_bits() => (kind.name(), format!("16#{value:X}")),
            (Ty::K(kind), Value::Int(value)) if kind.is_character() => {
                (kind.name(), self.quoted(kind == Kind::Wchar, &[*value as u16]))
            }
            (Ty::K(kind), Value::Int(value)) => (kind.name(), self.number(*value)),
            (Ty::K(kind), Value::Real(value)) => (kind.name(), real(&format!("{value:?}"))),
            (Ty::K(kind), Value::Lreal(value)) => (kind.name(), real(&format!("{value:?}"))),
            (_, Value::Str(units)) => {
                (if ty.is_wide() { "WSTRING" } else { "STRING" }, self.quoted(ty.is_wide(), units))
            }
            (Ty::N(id), Value::Int(value)) => match &source.types[id].def {
                Def::Enum(_, values) => {
                    let name = values.iter().find(|(_, known)| i128::from(*known) == *value);
                    let name = name.map_or("?", |(name, _)| name);
                    return if typed { format!("{}#{name}", source.types[id].name) } else { name.to_string() };
                }
                _ => return value.to_string(),
            },
            (Ty::N(id), Value::Many(parts)) => {
                return match &source.types[id].def {
                    Def::Array(_, element) => self.list(source, *element, parts),
                    Def::Struct(fields) => {
                        let mut texts = Vec::new();
                        for ((name, ty, _), part) in fields.iter().zip(parts) {
                            texts.push(format!("{name} := {}", self.literal(source, *ty, part, false)));
                        }
                        format!("({})", texts.join(", "))
                    }
                    other => panic!("no literal of {other:?}"),
                };
            }
            _ => panic!("no literal of {ty:?}"),
        };
        if typed { format!("{prefix}#{plain}") } else { plain }
    }

    /// A text in its quotes. Whatever can stand in it by itself may be written as a number too.
    fn quoted(&mut self, wide: bool, units: &[u16]) -> String {
        let quote = if wide { '"' } else { '\'' };
        let mut text = String::from(quote);
        for unit in units {
            let plain = char::from_u32(u32::from(*unit)).filter(|char| !char.is_control());
            match plain {
                Some('$') => text.push_str("$$"),
                Some(char @ ('"' | '\'')) if char == quote || self.chance(20) => drop(write!(text, "${char}")),
                Some(char) if char.is_ascii() && !self.chance(3) => text.push(char),
                Some(char) if !char.is_ascii() && self.chance(40) => text.push(char),
                _ => {
                    let (name, digits) = (named(*unit), if wide { 4 } else { 2 });
                    match name {
                        Some(name) if self.chance(50) => drop(write!(text, "${name}")),
                        _ if self.chance(30) => drop(write!(text, "${unit:0digits$x}")),
                        _ => drop(write!(text, "${unit:0digits$X}")),
                    }
                }
            }
        }
        text.push(quote);
        text
    }

    /// What stands behind the name of a type.
    pub(super) fn definition(&mut self, source: &Source, def: &Def) -> Option<String> {
        Some(match def {
            Def::Struct(fields) => {
                let mut text = String::from("STRUCT ");
                for (name, ty, init) in fields {
                    let init = init.as_ref().map(|value| format!(" := {}", self.initial(source, *ty, value)));
                    let _ = write!(text, "{name} : {}{}; ", type_name(source, *ty), init.unwrap_or_default());
                }
                text + "END_STRUCT"
            }
            Def::Enum(base, values) => {
                let parts: Vec<String> = values.iter().map(|(name, value)| format!("{name} := {value}")).collect();
                let base = base.map_or(String::new(), |base| format!("{} ", base.name()));
                format!("{base}({})", parts.join(", "))
            }
            Def::Subrange(..) | Def::Array(..) => plain_definition(source, def)?,
            Def::Block(_) | Def::Standard(_) => return None,
        })
    }
}

fn plain_definition(source: &Source, def: &Def) -> Option<String> {
    Some(match def {
        Def::Subrange(base, low, high) => format!("{}({low}..{high})", base.name()),
        Def::Array(dims, element) => {
            let dims: Vec<String> = dims.iter().map(|(low, high)| format!("{low}..{high}")).collect();
            format!("ARRAY[{}] OF {}", dims.join(", "), type_name(source, *element))
        }
        _ => return None,
    })
}

pub(super) fn type_name(source: &Source, ty: Ty) -> String {
    match ty {
        Ty::K(kind) => kind.name().to_string(),
        Ty::S(80) => "STRING".to_string(),
        Ty::W(80) => "WSTRING".to_string(),
        Ty::S(capacity) => format!("STRING[{capacity}]"),
        Ty::W(capacity) => format!("WSTRING[{capacity}]"),
        Ty::N(id) => match &source.types[id].def {
            Def::Block(unit) => source.units[*unit].name.clone(),
            Def::Standard(standard) => standard.name(),
            def if source.types[id].name.is_empty() => plain_definition(source, def).unwrap_or_default(),
            _ => source.types[id].name.clone(),
        },
    }
}

/// `%QX1.2`, `%MW4`: counted in units of the size.
pub(super) fn address(at: At, kind: Kind) -> String {
    let area = match at.area {
        Area::Input => 'I',
        Area::Output => 'Q',
        Area::Memory => 'M',
    };
    let (size, bytes) = match kind.bits() {
        1 => return format!("%{area}X{}.{}", at.byte, at.bit),
        8 => ('B', 1),
        16 => ('W', 2),
        32 => ('D', 4),
        _ => ('L', 8),
    };
    format!("%{area}{size}{}", at.byte / bytes)
}

/// The letter that a control character has in a text.
fn named(unit: u16) -> Option<char> {
    Some(match unit {
        0x09 => 't',
        0x0A => 'N',
        0x0C => 'p',
        0x0D => 'R',
        _ => return None,
    })
}

fn real(text: &str) -> String {
    match text.split_once('e') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.0e{exponent}"),
        None if !text.contains('.') => format!("{text}.0"),
        _ => text.to_string(),
    }
}
