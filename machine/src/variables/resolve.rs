//! From dotted names to places: `app.fb.arr[3].x`, in any case.

use std::fmt::Write;

use khz_bytecode::container::{DebugPlace, DebugTypeId};
use khz_bytecode::limits::MAX_TYPE_DEPTH;

use super::{DirectAddress, Shape, Variable, VariableError, VariableTable, VariableType};
use crate::semantics::element_position;

impl Variable {
    /// The part of it that lies `offset` bytes behind its start; `None` where there is none.
    pub(super) fn part(&self, offset: u32, ty: DebugTypeId, suffix: std::fmt::Arguments<'_>) -> Option<Variable> {
        let place = part_place(self.place, offset)?;
        let mut name = self.name.clone();
        // Writing to a String does not fail.
        let _ = name.write_fmt(suffix);
        Some(Variable { name, place, ty: VariableType::Declared(ty), constant: self.constant })
    }
}

/// The place `offset` bytes behind another. Slots and bits have no parts.
pub(super) fn part_place(place: DebugPlace, offset: u32) -> Option<DebugPlace> {
    match place {
        DebugPlace::Bytes(place, start) => Some(DebugPlace::Bytes(place, start.checked_add(offset)?)),
        DebugPlace::Slot(_) if offset == 0 => Some(place),
        DebugPlace::Slot(_) | DebugPlace::Bit(..) => None,
    }
}

/// One step of a path.
enum Step<'p> {
    Field(&'p str),
    Indices(&'p str),
}

impl VariableTable {
    /// Finds a variable or a part of one by its path, or a direct address.
    ///
    /// # Errors
    /// What of the path does not exist.
    pub fn resolve(&self, path: &str) -> Result<Variable, VariableError> {
        let path = path.trim();
        if path.starts_with('%') {
            let address = DirectAddress::parse(path).ok_or_else(|| VariableError::Address(path.to_string()))?;
            let name = path.to_ascii_uppercase();
            let ty = VariableType::Elementary(address.ty);
            return Ok(Variable { name, place: address.place, ty, constant: false });
        }
        let (mut variable, mut rest) = self.resolve_root(path)?;
        for _ in 0..=2 * MAX_TYPE_DEPTH {
            if rest.is_empty() {
                return Ok(variable);
            }
            let (step, behind) = next_step(rest).ok_or_else(|| VariableError::Unknown(path.to_string()))?;
            variable = match step {
                Step::Field(field) => self.field(&variable, field)?,
                Step::Indices(indices) => self.element(&variable, indices)?,
            };
            rest = behind;
        }
        Err(VariableError::Unknown(path.to_string()))
    }

    /// The variable whose name is the longest start of the path, and what is left of the path.
    fn resolve_root<'p>(&self, path: &'p str) -> Result<(Variable, &'p str), VariableError> {
        let ends = path.char_indices().filter(|(_, c)| matches!(c, '.' | '[')).map(|(at, _)| at).take(MAX_TYPE_DEPTH);
        let ends: Vec<usize> = ends.chain([path.len()]).collect();
        let lower = path.to_ascii_lowercase();
        for end in ends.into_iter().rev() {
            let position = lower.get(..end).and_then(|name| self.by_name.get(name.trim_end()));
            if let Some(found) = position.and_then(|at| self.variables.get(*at)) {
                let ty = VariableType::Declared(found.ty);
                let variable = Variable { name: found.name.clone(), place: found.place, ty, constant: found.constant };
                return Ok((variable, &path[end..]));
            }
        }
        let name = path.to_string();
        Err(if self.is_stripped { VariableError::Stripped(name) } else { VariableError::Unknown(name) })
    }

    fn field(&self, variable: &Variable, field: &str) -> Result<Variable, VariableError> {
        let unknown = || VariableError::Field { name: variable.name.clone(), field: field.to_string() };
        let Shape::Record { fields, .. } = self.shape(variable.ty) else { return Err(unknown()) };
        let found = fields.iter().find(|(name, ..)| name.eq_ignore_ascii_case(field));
        let (name, offset, ty) = found.ok_or_else(unknown)?;
        let outside = || VariableError::Outside(format!("{}.{name}", variable.name));
        variable.part(*offset, *ty, format_args!(".{name}")).ok_or_else(outside)
    }

    fn element(&self, variable: &Variable, indices: &str) -> Result<Variable, VariableError> {
        let wrong = |dimensions| VariableError::Indices {
            name: variable.name.clone(),
            dimensions,
            indices: indices.to_string(),
        };
        let Shape::Array { element, stride, dimensions } = self.shape(variable.ty) else { return Err(wrong(0)) };
        let numbers: Option<Vec<i32>> = indices.split(',').map(|index| index.trim().parse().ok()).collect();
        let numbers = numbers.filter(|numbers| numbers.len() == dimensions.len());
        let numbers = numbers.ok_or_else(|| wrong(dimensions.len()))?;
        let position =
            element_position(&numbers, dimensions).map_err(|[index, lower, upper]| VariableError::Index {
                name: variable.name.clone(),
                // They come from numbers of 32 bits.
                index: index as i32,
                lower: lower as i32,
                upper: upper as i32,
            })?;
        let words: Vec<_> = numbers.iter().map(ToString::to_string).collect();
        let outside = || VariableError::Outside(format!("{}[{}]", variable.name, words.join(",")));
        let offset = position.checked_mul(stride).ok_or_else(outside)?;
        variable.part(offset, element, format_args!("[{}]", words.join(","))).ok_or_else(outside)
    }
}

/// The first step of what stands behind a name, and the rest.
fn next_step(rest: &str) -> Option<(Step<'_>, &str)> {
    if let Some(behind) = rest.strip_prefix('[') {
        let (indices, behind) = behind.split_once(']')?;
        return Some((Step::Indices(indices), behind));
    }
    let behind = rest.strip_prefix('.')?;
    let end = behind.find(['.', '[']).unwrap_or(behind.len());
    let (field, behind) = behind.split_at(end);
    Some((Step::Field(field.trim()), behind))
}
