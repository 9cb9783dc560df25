//! The debug section.

use super::push;
use crate::assembler::{quote, to_hex};
use crate::container::{DebugPlace, DebugSection, DebugType};

pub(super) fn write(debug: &DebugSection, out: &mut String) {
    out.push_str("\ndebug\n");
    push(out, format_args!("  resource {}\n", quote(&debug.resource_name)));
    push(out, format_args!("  configuration {}\n", quote(&debug.configuration_name)));
    for file in &debug.files {
        push(out, format_args!("  file {} {}\n", quote(&file.name), to_hex(&file.hash)));
    }
    let names = [("function", &debug.function_names), ("instance", &debug.instance_names)];
    for (keyword, names) in names {
        for name in names {
            push(out, format_args!("  {keyword} {}\n", quote(name)));
        }
    }
    for ty in &debug.types {
        debug_type(ty, out);
    }
    for variable in &debug.variables {
        let place = match variable.place {
            DebugPlace::Slot(slot) => format!("slot {slot}"),
            DebugPlace::Bytes(place, offset) => format!("bytes {place} {offset}"),
            DebugPlace::Bit(place, offset, bit) => format!("bit {place} {offset} {bit}"),
        };
        let constant = if variable.constant { " constant" } else { "" };
        push(out, format_args!("  variable {} {place} {}{constant}\n", quote(&variable.name), variable.ty));
    }
    for l in &debug.lines {
        push(out, format_args!("  line {} {} {} {} {}\n", l.function, l.offset, l.file, l.line, l.column));
    }
    out.push_str("end\n");
}

fn debug_type(ty: &DebugType, out: &mut String) {
    out.push_str("  type ");
    match ty {
        DebugType::Elementary(ty) => push(out, format_args!("elementary {}", ty.name())),
        DebugType::Enumeration { name, base, values } => {
            push(out, format_args!("enumeration {} {}", quote(name), base.name()));
            for (name, value) in values {
                push(out, format_args!(" {} {value}", quote(name)));
            }
        }
        DebugType::Subrange { base, lower, upper } => {
            push(out, format_args!("subrange {} {lower} {upper}", base.name()));
        }
        DebugType::String { capacity } => push(out, format_args!("string {capacity}")),
        DebugType::WideString { capacity } => push(out, format_args!("wstring {capacity}")),
        DebugType::Array { element, stride, dimensions } => {
            push(out, format_args!("array {element} {stride}"));
            for (lower, upper) in dimensions {
                push(out, format_args!(" {lower}..{upper}"));
            }
        }
        DebugType::Record { name, fields } => {
            push(out, format_args!("record {}", quote(name)));
            for (field, offset, ty) in fields {
                push(out, format_args!(" {} {offset} {ty}", quote(field)));
            }
        }
    }
    out.push('\n');
}
