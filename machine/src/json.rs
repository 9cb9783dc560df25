//! Writing JSON text. The machine writes few and flat things, so it needs no serialiser.

use std::fmt::Write;

/// Appends `text` as a JSON string.
pub fn write_string(out: &mut String, text: impl IntoIterator<Item = char>) {
    out.push('"');
    for character in text {
        write_character(out, character);
    }
    out.push('"');
}

/// Appends UTF-16 code units as a JSON string; half a surrogate pair is written as its number.
pub fn write_utf16(out: &mut String, units: &[u16]) {
    out.push('"');
    for unit in char::decode_utf16(units.iter().copied()) {
        match unit {
            Ok(character) => write_character(out, character),
            Err(half) => write_unit(out, half.unpaired_surrogate()),
        }
    }
    out.push('"');
}

fn write_character(out: &mut String, character: char) {
    match character {
        '"' => out.push_str("\\\""),
        '\\' => out.push_str("\\\\"),
        '\n' => out.push_str("\\n"),
        '\r' => out.push_str("\\r"),
        '\t' => out.push_str("\\t"),
        control if control < ' ' || control == '\u{7f}' => write_unit(out, control as u16),
        other => out.push(other),
    }
}

fn write_unit(out: &mut String, unit: u16) {
    // Writing to a String does not fail.
    let _ = write!(out, "\\u{unit:04x}");
}
