//! Whole variables as text: JSON and IEC literals of one walk, and the leaves below a variable.

use std::fmt::Write;

use khz_bytecode::container::{DebugPlace, DebugTypeId};
use khz_bytecode::limits::MAX_TYPE_DEPTH;

use super::resolve::part_place;
use super::{Shape, Variable, VariableTable, VariableType, VariableValue};
use crate::image::Image;
use crate::json;

/// How values and what holds them are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Json,
    Literal,
}

impl Form {
    fn scalar(self, out: &mut String, value: &VariableValue) {
        match self {
            Form::Json => value.write_json(out),
            Form::Literal => value.write_text(out),
        }
    }

    fn field(self, out: &mut String, name: &str) {
        match self {
            Form::Json => {
                json::write_string(out, name.chars());
                out.push(':');
            }
            Form::Literal => {
                out.push_str(name);
                out.push_str(" := ");
            }
        }
    }

    /// What stands around the parts of an array or a record, and between them.
    fn brackets(self, is_array: bool) -> (char, &'static str, char) {
        match (self, is_array) {
            (Form::Json, true) => ('[', ",", ']'),
            (Form::Json, false) => ('{', ",", '}'),
            (Form::Literal, true) => ('[', ", ", ']'),
            (Form::Literal, false) => ('(', ", ", ')'),
        }
    }

    /// What stands for a value that can not be read.
    fn nothing(self) -> &'static str {
        match self {
            Form::Json => "null",
            Form::Literal => "?",
        }
    }
}

/// One dump: where it writes, and how long that may become. The debug section is not trusted: types that overlap in many ways could
/// ask for far more values than the image has bytes. Beyond the limit the rest reads `null`, or is left out of arrays.
struct Walk<'w> {
    table: &'w VariableTable,
    image: &'w Image,
    form: Form,
    out: &'w mut String,
    limit_bytes: usize,
}

/// Bytes that a dump may have for each byte of the image (a BOOL with a long field name takes many), and at least.
const DUMP_BYTES_PER_BYTE: usize = 256;
const LEAST_DUMP_BYTES: usize = 1 << 20;

/// How long a dump of this image may become.
fn dump_limit(image: &Image) -> usize {
    (image.layout().total_bytes() as usize).saturating_mul(DUMP_BYTES_PER_BYTE).saturating_add(LEAST_DUMP_BYTES)
}

impl Walk<'_> {
    fn is_full(&self) -> bool {
        self.out.len() >= self.limit_bytes
    }

    fn value(&mut self, place: DebugPlace, ty: VariableType, depth: usize) {
        if depth > MAX_TYPE_DEPTH || self.is_full() {
            self.out.push_str(self.form.nothing());
            return;
        }
        let table = self.table;
        match table.shape(ty) {
            Shape::Array { element, stride, dimensions } => {
                self.dimension(place, (VariableType::Declared(element), stride), dimensions, depth);
            }
            Shape::Record { fields, .. } => {
                let (open, between, close) = self.form.brackets(false);
                self.out.push(open);
                for (at, (name, offset, ty)) in fields.iter().enumerate() {
                    self.out.push_str(if at == 0 { "" } else { between });
                    self.form.field(self.out, name);
                    self.part(part_place(place, *offset), VariableType::Declared(*ty), depth + 1);
                }
                self.out.push(close);
            }
            _ => match table.read_scalar(self.image, place, ty) {
                Some(value) => self.form.scalar(self.out, &value),
                None => self.out.push_str(self.form.nothing()),
            },
        }
    }

    fn part(&mut self, place: Option<DebugPlace>, ty: VariableType, depth: usize) {
        match place {
            Some(place) => self.value(place, ty, depth),
            None => self.out.push_str(self.form.nothing()),
        }
    }

    /// One dimension of an array, the further ones nested in it. `element` is the type and its stride.
    fn dimension(&mut self, place: DebugPlace, element: (VariableType, u32), dimensions: &[(i32, i32)], depth: usize) {
        let Some(((lower, upper), inner)) = dimensions.split_first() else {
            return self.value(place, element.0, depth + 1);
        };
        let extents = inner.iter().map(|(lower, upper)| (i64::from(*upper) - i64::from(*lower) + 1).max(0) as u64);
        let step = extents.fold(u64::from(element.1), u64::saturating_mul);
        let (open, between, close) = self.form.brackets(true);
        self.out.push(open);
        for at in 0..=(i64::from(*upper) - i64::from(*lower)).max(-1) {
            if self.is_full() {
                break;
            }
            self.out.push_str(if at == 0 { "" } else { between });
            let offset = u32::try_from(step.saturating_mul(at as u64)).ok();
            match offset.and_then(|offset| part_place(place, offset)) {
                Some(place) if depth < MAX_TYPE_DEPTH => self.dimension(place, element, inner, depth + 1),
                _ => self.out.push_str(self.form.nothing()),
            }
        }
        self.out.push(close);
    }
}

impl VariableTable {
    fn write_form(&self, image: &Image, variable: &Variable, form: Form, limit_bytes: usize, out: &mut String) {
        Walk { table: self, image, form, out, limit_bytes }.value(variable.place, variable.ty, 0);
    }

    /// Appends the value of a variable, whole arrays and structures too, as JSON. What can not be read is `null`.
    pub fn write_json(&self, image: &Image, variable: &Variable, out: &mut String) {
        let limit_bytes = out.len().saturating_add(dump_limit(image));
        self.write_form(image, variable, Form::Json, limit_bytes, out);
    }

    /// Appends the value of a variable as an IEC literal: arrays as `[1, 2]`, structures as `(x := 1, y := 2)`. What can not be read is `?`.
    pub fn write_text(&self, image: &Image, variable: &Variable, out: &mut String) {
        let limit_bytes = out.len().saturating_add(dump_limit(image));
        self.write_form(image, variable, Form::Literal, limit_bytes, out);
    }

    /// The value of a variable as an IEC literal.
    #[must_use]
    pub fn text(&self, image: &Image, variable: &Variable) -> String {
        let mut out = String::new();
        self.write_text(image, variable, &mut out);
        out
    }

    /// The dump of `--dump-vars X.json`: time and number of rounds, then every global and program variable in the order of the debug section.
    #[must_use]
    pub fn dump_json(&self, image: &Image, time_us: u64, rounds: u64) -> String {
        let limit_bytes = dump_limit(image);
        let mut out = format!("{{\"time_us\":{time_us},\"rounds\":{rounds},\"variables\":{{");
        for (at, variable) in self.variables().enumerate() {
            out.push_str(if at == 0 { "" } else { "," });
            json::write_string(&mut out, variable.name.chars());
            out.push(':');
            self.write_form(image, &variable, Form::Json, limit_bytes, &mut out);
        }
        out.push_str("}}\n");
        out
    }

    /// The dump of `--dump-vars` with any other extension: lines `NAME := literal`, sorted by name.
    #[must_use]
    pub fn dump_text(&self, image: &Image) -> String {
        let mut variables: Vec<_> = self.variables().collect();
        variables.sort_by(|a, b| a.name.cmp(&b.name));
        let limit_bytes = dump_limit(image);
        let mut out = String::new();
        for variable in variables {
            // Writing to a String does not fail.
            let _ = write!(out, "{} := ", variable.name);
            self.write_form(image, &variable, Form::Literal, limit_bytes, &mut out);
            out.push('\n');
        }
        out
    }

    /// What `variable` consists of that is no array or structure, at most `limit` of them; itself when it is none.
    #[must_use]
    pub fn leaves(&self, variable: &Variable, limit: usize) -> Vec<Variable> {
        // Parts without leaves (empty records) must not make the walk longer than parts with them.
        let mut leaves =
            Leaves { table: self, limit, visits: limit.saturating_mul(VISITS_PER_LEAF), found: Vec::new() };
        leaves.collect(variable, 0);
        leaves.found
    }
}

/// Parts looked at for each leaf that may be found: a leaf is nested a few levels deep.
const VISITS_PER_LEAF: usize = MAX_TYPE_DEPTH;

struct Leaves<'t> {
    table: &'t VariableTable,
    limit: usize,
    visits: usize,
    found: Vec<Variable>,
}

impl Leaves<'_> {
    fn collect(&mut self, variable: &Variable, depth: usize) {
        if self.is_done() || depth > MAX_TYPE_DEPTH {
            return;
        }
        self.visits -= 1;
        let table = self.table;
        match table.shape(variable.ty) {
            Shape::Record { fields, .. } => {
                for (name, offset, ty) in fields {
                    if let Some(part) = variable.part(*offset, *ty, format_args!(".{name}")) {
                        self.collect(&part, depth + 1);
                    }
                }
            }
            Shape::Array { element, stride, dimensions } => {
                self.collect_elements(variable, (element, stride), dimensions, depth);
            }
            Shape::Unknown => {}
            _ => self.found.push(variable.clone()),
        }
    }

    fn collect_elements(
        &mut self,
        variable: &Variable,
        (element, stride): (DebugTypeId, u32),
        dimensions: &[(i32, i32)],
        depth: usize,
    ) {
        if dimensions.iter().any(|(lower, upper)| lower > upper) {
            return;
        }
        let mut indices: Vec<i32> = dimensions.iter().map(|(lower, _)| *lower).collect();
        let mut offset = Some(0_u32);
        while let Some(at) = offset.filter(|_| !self.is_done()) {
            let words: Vec<_> = indices.iter().map(ToString::to_string).collect();
            let Some(part) = variable.part(at, element, format_args!("[{}]", words.join(","))) else { return };
            self.collect(&part, depth + 1);
            offset = at.checked_add(stride).filter(|_| advance(&mut indices, dimensions));
        }
    }

    fn is_done(&self) -> bool {
        self.found.len() >= self.limit || self.visits == 0
    }
}

/// The next indices, the last dimension first; false behind the last element.
fn advance(indices: &mut [i32], dimensions: &[(i32, i32)]) -> bool {
    for (index, (lower, upper)) in indices.iter_mut().zip(dimensions).rev() {
        if *index < *upper {
            *index += 1;
            return true;
        }
        *index = *lower;
    }
    false
}
