//! IEC literals (clause 6.3) as values for a variable of known type.

use khz_bytecode::container::ElementaryType;

use super::scalar::{VariableValue, time_prefix};
use crate::semantics::parse::{parse_integer, parse_real, parse_time};
use crate::semantics::{Value, parse_date, parse_date_and_time, parse_time_of_day};

/// Why a text is no value of a type, in words that follow "`x` is INT: ".
pub(super) type Reason = String;

/// Least and greatest value of an integer or bit string type; `None` for other types.
#[must_use]
pub fn integer_range(ty: ElementaryType) -> Option<(i128, i128)> {
    use ElementaryType as E;
    let bits = ty.storage().bytes() * 8;
    match ty {
        E::Sint | E::Int | E::Dint | E::Lint => Some((-(1_i128 << (bits - 1)), (1_i128 << (bits - 1)) - 1)),
        E::Usint | E::Uint | E::Udint | E::Ulint | E::Byte | E::Word | E::Dword | E::Lword | E::Char | E::Wchar => {
            Some((0, (1_i128 << bits) - 1))
        }
        _ => None,
    }
}

/// Reads a literal of type `ty`: in any case, with or without the type's name and `#` before it.
pub(super) fn parse_elementary(ty: ElementaryType, literal: &str) -> Result<Value, Reason> {
    use ElementaryType as E;
    let literal = strip_type(ty, literal.trim())?;
    match ty {
        E::Bool => parse_bool(literal),
        E::Real | E::Lreal => parse_float(ty, literal),
        E::Char if literal.starts_with('\'') => single(&parse_units(literal, '\'')?),
        E::Wchar if literal.starts_with('"') => single(&parse_units(literal, '"')?),
        _ if time_prefix(ty).is_some() => parse_moment(ty, literal),
        _ => parse_whole(ty, literal),
    }
}

/// Takes a type name before `#` away; that of another type is an error. Times keep theirs: their own readers know the prefixes.
fn strip_type(ty: ElementaryType, literal: &str) -> Result<&str, Reason> {
    let Some((prefix, rest)) = literal.split_once('#') else { return Ok(literal) };
    if prefix.eq_ignore_ascii_case(ty.name()) && time_prefix(ty).is_none() {
        return Ok(rest);
    }
    let other = ElementaryType::ALL.iter().find(|other| prefix.eq_ignore_ascii_case(other.name()));
    match other {
        Some(other) if *other != ty && !(is_duration(*other) && is_duration(ty)) => {
            Err(format!("`{literal}` is a literal of {}", other.name()))
        }
        _ => Ok(literal),
    }
}

fn is_duration(ty: ElementaryType) -> bool {
    matches!(ty, ElementaryType::Time | ElementaryType::Ltime)
}

fn parse_bool(literal: &str) -> Result<Value, Reason> {
    let is_any = |texts: [&str; 2]| texts.iter().any(|text| literal.eq_ignore_ascii_case(text));
    match (is_any(["TRUE", "1"]), is_any(["FALSE", "0"])) {
        (true, _) => Ok(Value::I32(1)),
        (_, true) => Ok(Value::I32(0)),
        _ => Err(format!("`{literal}` is neither TRUE nor FALSE")),
    }
}

fn parse_whole(ty: ElementaryType, literal: &str) -> Result<Value, Reason> {
    let integer = parse_integer(literal.as_bytes()).filter(|integer| integer.used == literal.len());
    let value = integer.ok_or_else(|| format!("`{literal}` is not a whole number"))?.value();
    let (least, most) = integer_range(ty).unwrap_or((0, 0));
    if !(least..=most).contains(&value) {
        return Err(format!("{literal} is outside {least} to {most}"));
    }
    Ok(Value::from_bits(ty.storage().value_type(), value as u64))
}

fn parse_float(ty: ElementaryType, literal: &str) -> Result<Value, Reason> {
    let real = parse_real(literal.as_bytes()).filter(|real| real.used == literal.len());
    let real = real.ok_or_else(|| format!("`{literal}` is not a number"))?;
    let (value, is_infinite) = match ty {
        ElementaryType::Real => (Value::F32(real.to_f32()), real.to_f32().is_infinite()),
        _ => (Value::F64(real.to_f64()), real.to_f64().is_infinite()),
    };
    if is_infinite && literal.bytes().any(|byte| byte.is_ascii_digit()) {
        return Err(format!("{literal} is beyond the largest number"));
    }
    Ok(value)
}

fn parse_moment(ty: ElementaryType, literal: &str) -> Result<Value, Reason> {
    use ElementaryType as E;
    if is_duration(ty) {
        let (duration_ns, used) = parse_time(literal.as_bytes()).unwrap_or_default();
        if used == 0 || used != literal.len() {
            return Err(format!("`{literal}` is not a duration, for example T#1m30s"));
        }
        let duration_ns = i64::try_from(duration_ns).map_err(|_| format!("{literal} is beyond 292 years"))?;
        return Ok(Value::I64(duration_ns));
    }
    let bytes = literal.as_bytes();
    let (parsed, example) = match ty {
        E::Date | E::Ldate => (parse_date(bytes), "D#2024-02-29"),
        E::TimeOfDay | E::LtimeOfDay => (parse_time_of_day(bytes), "TOD#12:34:56"),
        _ => (parse_date_and_time(bytes), "DT#2024-02-29-12:34:56"),
    };
    let moment_ns = parsed.filter(|(_, used)| *used == literal.len()).map(|(moment_ns, _)| moment_ns);
    let moment_ns = moment_ns.ok_or_else(|| format!("`{literal}` is not such a moment, for example {example}"))?;
    let moment_ns = i64::try_from(moment_ns).map_err(|_| format!("{literal} is beyond 292 years from 1970"))?;
    Ok(Value::I64(moment_ns))
}

fn single(units: &[u16]) -> Result<Value, Reason> {
    match units {
        [unit] => Ok(Value::I32(i32::from(*unit))),
        _ => Err(format!("{} characters where one is wanted", units.len())),
    }
}

/// Reads a whole number of the type `base` from `lower` to `upper`; these are bits of the base type.
pub(super) fn parse_subrange(base: ElementaryType, lower: i64, upper: i64, literal: &str) -> Result<Value, Reason> {
    let value = parse_elementary(base, literal)?;
    let is_inside = match VariableValue::from_loaded(base, value) {
        VariableValue::Signed(number) => (lower..=upper).contains(&number),
        VariableValue::Unsigned(number) => (lower as u64..=upper as u64).contains(&number),
        _ => false,
    };
    if !is_inside {
        let (literal, lower, upper) = (literal.trim(), bound_text(base, lower), bound_text(base, upper));
        return Err(format!("{literal} is outside {lower} to {upper}"));
    }
    Ok(value)
}

/// A bound of a subrange as a number of its base type.
pub(super) fn bound_text(base: ElementaryType, bits: i64) -> String {
    let mut text = String::new();
    VariableValue::from_loaded(base, Value::I64(bits)).write_text(&mut text);
    text
}

/// Reads the value of an enumeration: a name, with or without the type's name and `#` or `.`, or the number of one of its values.
pub(super) fn parse_enumeration(
    name: &str,
    base: ElementaryType,
    values: &[(String, i64)],
    literal: &str,
) -> Result<Value, Reason> {
    let literal = literal.trim();
    let qualified = literal.split_once(['#', '.']).filter(|(prefix, _)| prefix.eq_ignore_ascii_case(name));
    let wanted = qualified.map_or(literal, |(_, rest)| rest);
    if let Some((_, value)) = values.iter().find(|(name, _)| name.eq_ignore_ascii_case(wanted)) {
        return Ok(Value::from_bits(base.storage().value_type(), *value as u64));
    }
    let is_known = |value: &Value| {
        let number = VariableValue::from_loaded(base, *value).whole_bits();
        values.iter().any(|(_, known)| Some(*known) == number)
    };
    parse_elementary(base, wanted).ok().filter(is_known).ok_or_else(|| {
        let known: Vec<_> = values.iter().map(|(name, _)| name.as_str()).take(MAX_NAMES_SHOWN).collect();
        format!("`{wanted}` is none of its values ({})", known.join(", "))
    })
}

/// Names that an error lists at most.
const MAX_NAMES_SHOWN: usize = 20;

/// Reads a quoted character string: its code units, which for `'` are below 256.
pub(super) fn parse_string(literal: &str, quote: char) -> Result<Vec<u16>, Reason> {
    let units = parse_units(literal, quote)?;
    if units.contains(&0) { Err("character 0 ends a string and can not stand in it".into()) } else { Ok(units) }
}

fn parse_units(literal: &str, quote: char) -> Result<Vec<u16>, Reason> {
    let inner = literal.trim().strip_prefix(quote).and_then(|rest| rest.strip_suffix(quote));
    let inner = inner.ok_or_else(|| format!("a character string stands between two {quote}"))?;
    let hex_digits = if quote == '"' { 4 } else { 2 };
    let mut units = Vec::new();
    let mut rest = inner.chars();
    while let Some(character) = rest.next() {
        match character {
            '$' => push_escape(&mut units, &mut rest, hex_digits)?,
            _ if character == quote => return Err(format!("write ${quote} for {quote} inside a string")),
            _ if hex_digits == 2 => {
                let byte = u8::try_from(u32::from(character));
                units.push(u16::from(byte.map_err(|_| format!("STRING has no character `{character}` (Latin-1)"))?));
            }
            _ => units.extend_from_slice(character.encode_utf16(&mut [0; 2])),
        }
    }
    Ok(units)
}

/// Reads what follows a `$` (table 6 and 7).
fn push_escape(units: &mut Vec<u16>, rest: &mut std::str::Chars<'_>, hex_digits: usize) -> Result<(), Reason> {
    let text = rest.as_str();
    if let Some(unit) = text.get(..hex_digits).filter(|digits| digits.bytes().all(|b| b.is_ascii_hexdigit())) {
        units.push(u16::from_str_radix(unit, 16).unwrap_or_default());
        *rest = text[hex_digits..].chars();
        return Ok(());
    }
    let unit: &[u16] = match rest.next().map(|character| character.to_ascii_uppercase()) {
        Some('$') => &[0x24],
        Some('\'') => &[0x27],
        Some('"') => &[0x22],
        Some('L') => &[0x0A],
        Some('N') => &[0x0A],
        Some('P') => &[0x0C],
        Some('R') => &[0x0D],
        Some('T') => &[0x09],
        _ => return Err("`$` starts an escape: $$, $', $\", $L, $N, $P, $R, $T or hexadecimal digits".into()),
    };
    units.extend_from_slice(unit);
    Ok(())
}
