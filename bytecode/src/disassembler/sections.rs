//! Everything but functions and debug information.

use super::{local_type, push};
use crate::assembler::{quote, to_hex};
use crate::container::{
    Constant, Container, OverrunPolicy, Record, Region, SingleSource, SystemVariableKind, Task, TaskExtension,
    TaskType, Type, TypeSection,
};

pub(super) fn write(container: &Container, out: &mut String) {
    parameters(container, out);
    types(&container.types, out);
    memory(&container.types, out);
    tasks(container, out);
    for (index, constant) in container.constants.iter().enumerate() {
        match constant {
            Constant::I64(value) => push(out, format_args!("constant c{index} i64 {value}\n")),
            Constant::F32(bits) => {
                push(out, format_args!("constant c{index} f32 {bits:#010x} ; {:?}\n", f32::from_bits(*bits)));
            }
            Constant::F64(bits) => {
                push(out, format_args!("constant c{index} f64 {bits:#018x} ; {:?}\n", f64::from_bits(*bits)));
            }
        }
    }
}

fn parameters(container: &Container, out: &mut String) {
    let p = &container.parameters;
    let rows: [(&str, u64); 10] = [
        ("max_stack", p.max_stack_depth.into()),
        ("max_call_depth", p.max_call_depth.into()),
        ("inputs", p.input_image_bytes.into()),
        ("outputs", p.output_image_bytes.into()),
        ("memory", p.memory_image_bytes.into()),
        ("data_bytes", p.data_region_bytes.into()),
        ("frame_bytes", p.frame_bytes.into()),
        ("string_bytes", p.total_str_var_bytes.into()),
        ("max_string", p.max_str_length.into()),
        ("shared_globals", container.tasks.shared_globals.into()),
    ];
    for (name, value) in rows.iter().filter(|(_, value)| *value != 0) {
        push(out, format_args!("{name} {value}\n"));
    }
    if let Some(function) = p.startup_function {
        push(out, format_args!("startup {function}\n"));
    }
    if let Some(function) = p.init_function {
        push(out, format_args!("initialize {function}\n"));
    }
    push(out, format_args!("source_hash {}\n", to_hex(&container.source_hash)));
    let signatures =
        [("content_signature", &container.content_signature), ("debug_signature", &container.debug_signature)];
    for (name, bytes) in signatures.iter().filter(|(_, bytes)| !bytes.is_empty()) {
        push(out, format_args!("{name} {}\n", to_hex(bytes)));
    }
}

fn types(section: &TypeSection, out: &mut String) {
    for (index, array) in section.arrays.iter().enumerate() {
        push(out, format_args!("array a{index} {} stride {}", array.element, array.stride));
        for (lower, upper) in &array.dimensions {
            push(out, format_args!(" {lower}..{upper}"));
        }
        out.push('\n');
    }
    for (index, ty) in section.types.iter().enumerate() {
        push(out, format_args!("type t{index} "));
        match ty {
            Type::Scalar(storage) => push(out, format_args!("scalar {storage}")),
            Type::String { capacity } => push(out, format_args!("string {capacity}")),
            Type::WideString { capacity } => push(out, format_args!("wstring {capacity}")),
            Type::Array(array) => push(out, format_args!("array {array}")),
            Type::Struct(fields) => record("struct", fields, out),
            Type::Union(fields) => record("union", fields, out),
            Type::Block { record: fields, base, methods } => {
                record("block", fields, out);
                if let Some(base) = base {
                    push(out, format_args!(" base {base}"));
                }
                out.push_str(if methods.is_empty() { "" } else { " methods" });
                for (method, function) in methods {
                    push(out, format_args!(" {method}={function}"));
                }
            }
        }
        out.push('\n');
    }
    for (index, method) in section.methods.iter().enumerate() {
        push(out, format_args!("method m{index}"));
        for parameter in &method.parameters {
            push(out, format_args!(" param {}", local_type(*parameter)));
        }
        for result in &method.results {
            push(out, format_args!(" result {result}"));
        }
        out.push('\n');
    }
}

fn record(form: &str, record: &Record, out: &mut String) {
    push(out, format_args!("{form} size {} align {}", record.size, record.align));
    for field in &record.fields {
        push(out, format_args!(" {}:{}", field.offset, field.ty));
    }
}

fn region(region: Region) -> &'static str {
    match region {
        Region::Slots => "s",
        Region::Data => "d",
        Region::Memory => "m",
        Region::Output => "q",
    }
}

fn memory(section: &TypeSection, out: &mut String) {
    for row in section.slots.chunks(16) {
        out.push_str("slots");
        for storage in row {
            push(out, format_args!(" {storage}"));
        }
        out.push('\n');
    }
    for (index, variable) in section.data.iter().enumerate() {
        let constant = if variable.constant { " constant" } else { "" };
        push(out, format_args!("data d{index} {} at {}{constant}\n", variable.ty, variable.offset));
    }
    for (index, program) in section.programs.iter().enumerate() {
        push(out, format_args!("program p{index}"));
        if let Some(block) = program.block {
            push(out, format_args!(" block {block}"));
        }
        out.push('\n');
        for (slot, storage) in program.slots.iter().enumerate() {
            push(out, format_args!("slot s{slot} {storage}\n"));
        }
    }
    for row in &section.block_instances {
        push(out, format_args!("block_instance {} {} stride {} count {}\n", row.offset, row.ty, row.stride, row.count));
    }
    for run in &section.init_image {
        let place = region(run.region);
        push(out, format_args!("init {place} {} repeat {} bytes {}\n", run.offset, run.repeat, to_hex(&run.bytes)));
    }
    for range in &section.retain {
        push(out, format_args!("retain {} {} {}\n", region(range.region), range.offset, range.bytes));
    }
    for variable in &section.system_variables {
        let name = match variable.kind {
            SystemVariableKind::UpTime => "up_time",
            SystemVariableKind::UpLtime => "up_ltime",
        };
        push(out, format_args!("system {name} {}\n", variable.slot));
    }
    for symbol in &section.symbol_hashes {
        push(out, format_args!("symbol {} {} {}\n", symbol.kind, symbol.index, to_hex(&symbol.hash)));
    }
}

fn tasks(container: &Container, out: &mut String) {
    for (index, task) in container.tasks.tasks.iter().enumerate() {
        push(out, format_args!("task k{index} "));
        task_line(task, out);
    }
    for task in &container.types.task_extensions {
        extension_line(task, out);
    }
    for (index, row) in container.tasks.instances.iter().enumerate() {
        push(
            out,
            format_args!(
                "instance i{index} id {} task {} entry {} slots {} {} blocks {} {}\n",
                row.id, row.task, row.entry, row.slot_offset, row.slot_count, row.block_offset, row.block_count
            ),
        );
    }
}

fn task_line(task: &Task, out: &mut String) {
    match task.task_type {
        TaskType::Cyclic => push(out, format_args!("cyclic {}", task.interval_us)),
        TaskType::Event => push(out, format_args!("event interval {}", task.interval_us)),
        TaskType::Freewheeling => push(out, format_args!("freewheeling interval {}", task.interval_us)),
    }
    push(out, format_args!(" id {} priority {} watchdog {}", task.id, task.priority, task.watchdog_us));
    if let Some(slot) = task.single_slot {
        push(out, format_args!(" single_slot {slot}"));
    }
    out.push_str(if task.enabled { "\n" } else { " disabled\n" });
}

fn extension_line(task: &TaskExtension, out: &mut String) {
    push(
        out,
        format_args!(
            "extension name {} phase {} sensitivity {}",
            quote(&task.name),
            task.phase_us,
            task.watchdog_sensitivity
        ),
    );
    out.push_str(match task.overrun_policy {
        OverrunPolicy::Grid => " policy grid",
        OverrunPolicy::AtOnce => " policy at-once",
        OverrunPolicy::Realign => " policy realign",
    });
    match task.single {
        SingleSource::None => {}
        SingleSource::Slot(slot) => push(out, format_args!(" single slot {slot}")),
        SingleSource::Data(offset) => push(out, format_args!(" single data {offset}")),
        SingleSource::Bit { place, offset, bit } => push(out, format_args!(" single bit {place} {offset} {bit}")),
        SingleSource::Literal(value) => push(out, format_args!(" single {value}")),
    }
    out.push('\n');
}
