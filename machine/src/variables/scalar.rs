//! One value of a variable: out of memory, as text, as JSON.

use std::fmt::Write;

use khz_bytecode::container::ElementaryType;

use crate::json;
use crate::semantics::{Value, write_date, write_date_and_time, write_f32, write_f64, write_time, write_time_of_day};

/// A value that is no array or structure.
#[derive(Debug, Clone, PartialEq)]
pub enum VariableValue {
    /// BOOL.
    Bool(bool),
    /// SINT to LINT.
    Signed(i64),
    /// USINT to ULINT, BYTE to LWORD.
    Unsigned(u64),
    /// REAL.
    Real(f32),
    /// LREAL.
    Lreal(f64),
    /// TIME, dates and times of day, with the type and nanoseconds.
    Time(ElementaryType, i64),
    /// CHAR and STRING: Latin-1.
    String(Vec<u8>),
    /// WCHAR and WSTRING: UTF-16 code units.
    WideString(Vec<u16>),
    /// A value of an enumeration that has a name.
    Named(String),
}

impl VariableValue {
    /// The value of a scalar as it was loaded.
    #[must_use]
    pub fn from_loaded(ty: ElementaryType, loaded: Value) -> VariableValue {
        use ElementaryType as E;
        let bits = loaded.bits();
        match (ty, loaded) {
            (E::Bool, _) => VariableValue::Bool(bits != 0),
            (E::Char, _) => VariableValue::String(vec![bits as u8]),
            (E::Wchar, _) => VariableValue::WideString(vec![bits as u16]),
            (_, Value::F32(value)) => VariableValue::Real(value),
            (_, Value::F64(value)) => VariableValue::Lreal(value),
            (E::Sint | E::Int | E::Dint | E::Lint, Value::I32(value)) => VariableValue::Signed(i64::from(value)),
            (E::Sint | E::Int | E::Dint | E::Lint, _) => VariableValue::Signed(bits as i64),
            _ if time_prefix(ty).is_some() => VariableValue::Time(ty, bits as i64),
            _ => VariableValue::Unsigned(bits),
        }
    }

    /// The bits of a whole number, as 64 signed bits.
    pub(super) fn whole_bits(&self) -> Option<i64> {
        match self {
            VariableValue::Signed(number) => Some(*number),
            VariableValue::Unsigned(number) => Some(*number as i64),
            _ => None,
        }
    }

    /// Appends it as an IEC literal that [`super::VariableTable::write`] reads back.
    pub fn write_text(&self, out: &mut String) {
        // Writing to a String does not fail.
        let _ = match self {
            VariableValue::Bool(value) => out.write_str(if *value { "TRUE" } else { "FALSE" }),
            VariableValue::Signed(value) => write!(out, "{value}"),
            VariableValue::Unsigned(value) => write!(out, "{value}"),
            VariableValue::Real(value) => write_f32(out, *value),
            VariableValue::Lreal(value) => write_f64(out, *value),
            VariableValue::Time(ty, value) => write_moment(out, *ty, *value),
            VariableValue::String(bytes) => write_quoted(out, '\'', bytes.iter().map(|byte| u16::from(*byte)), 2),
            VariableValue::WideString(units) => write_quoted(out, '"', units.iter().copied(), 4),
            VariableValue::Named(name) => out.write_str(name),
        };
    }

    /// Appends it as JSON: what is no number or BOOL is a string.
    pub fn write_json(&self, out: &mut String) {
        match self {
            VariableValue::Bool(value) => out.push_str(if *value { "true" } else { "false" }),
            VariableValue::Real(value) if !value.is_finite() => self.write_json_text(out),
            VariableValue::Lreal(value) if !value.is_finite() => self.write_json_text(out),
            VariableValue::Time(..) => self.write_json_text(out),
            VariableValue::String(bytes) => json::write_string(out, bytes.iter().map(|byte| char::from(*byte))),
            VariableValue::WideString(units) => json::write_utf16(out, units),
            VariableValue::Named(name) => json::write_string(out, name.chars()),
            _ => self.write_text(out),
        }
    }

    fn write_json_text(&self, out: &mut String) {
        let mut text = String::new();
        self.write_text(&mut text);
        json::write_string(out, text.chars());
    }
}

/// Prefix of the literals of a time or date type.
pub(super) fn time_prefix(ty: ElementaryType) -> Option<&'static str> {
    use ElementaryType as E;
    match ty {
        E::Time => Some("T"),
        E::Ltime => Some("LT"),
        E::Date => Some("D"),
        E::Ldate => Some("LD"),
        E::TimeOfDay => Some("TOD"),
        E::LtimeOfDay => Some("LTOD"),
        E::DateAndTime => Some("DT"),
        E::LdateAndTime => Some("LDT"),
        _ => None,
    }
}

fn write_moment(out: &mut String, ty: ElementaryType, value_ns: i64) -> std::fmt::Result {
    use ElementaryType as E;
    let prefix = time_prefix(ty).unwrap_or_default();
    if let E::Time | E::Ltime = ty {
        return write_time(out, prefix, value_ns);
    }
    write!(out, "{prefix}#")?;
    match ty {
        E::TimeOfDay | E::LtimeOfDay => write_time_of_day(out, value_ns),
        E::Date | E::Ldate => write_date(out, value_ns),
        _ => write_date_and_time(out, value_ns),
    }
}

/// Writes a character string literal (clause 6.3.3): what is not printable ASCII as `$` and `hex_digits` digits.
fn write_quoted(
    out: &mut String,
    quote: char,
    units: impl Iterator<Item = u16>,
    hex_digits: usize,
) -> std::fmt::Result {
    out.push(quote);
    for unit in units {
        match u8::try_from(unit).map(char::from) {
            Ok(character) if character == quote || character == '$' => {
                out.push('$');
                out.push(character);
            }
            Ok(character @ ' '..='~') => out.push(character),
            _ => write!(out, "${unit:0hex_digits$X}")?,
        }
    }
    out.push(quote);
    Ok(())
}
