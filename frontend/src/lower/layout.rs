//! Types of the container, made on demand from those of the checker, and initial values as bytes.

use std::collections::BTreeMap;

use khz_bytecode::container::{
    ArrayDescriptor, Constant, DebugType, DebugTypeId, ElementaryType, Field, InitRun, Record, Region, Type,
};
use khz_bytecode::ids::{ArrayId, ConstantId, TypeId};
use khz_bytecode::value::Storage;

use super::Builder;
use crate::analysis::scalar_bytes;
use crate::analysis::types::{Const, Ty, TyKind, Value};

impl Builder<'_> {
    fn add_type(&mut self, ty: Type) -> TypeId {
        let id = self.id16(self.section.types.len(), "types");
        self.section.types.push(ty);
        TypeId(id)
    }

    /// The type of a scalar in memory.
    pub(super) fn scalar_type(&mut self, storage: Storage) -> TypeId {
        if let Some(&id) = self.scalars.get(&storage) {
            return id;
        }
        let id = self.add_type(Type::Scalar(storage));
        self.scalars.insert(storage, id);
        id
    }

    /// A structure of the compiler's own: data blocks and frames.
    pub(super) fn struct_type(&mut self, fields: Vec<Field>, size: u32, align: u32) -> TypeId {
        self.add_type(Type::Struct(Record { size, align, fields }))
    }

    /// The container's type of a type.
    pub(super) fn type_id(&mut self, ty: Ty) -> TypeId {
        let ty = self.actual(ty);
        if let Some(storage) = self.project.types.storage(ty) {
            return self.scalar_type(storage);
        }
        if let Some(&id) = self.types.get(&ty) {
            return id;
        }
        let project = self.project;
        let id = match (ty, project.types.kind(ty)) {
            (Ty::Str(capacity), _) => {
                self.longest_string = self.longest_string.max(capacity);
                self.add_type(Type::String { capacity })
            }
            (Ty::WStr(capacity), _) => self.add_type(Type::WideString { capacity }),
            (_, Some(TyKind::Array { element, dims })) => {
                let element_id = self.type_id(*element);
                let stride = project.types.extent(*element).0;
                let array = ArrayId(self.id16(self.section.arrays.len(), "array types"));
                self.section.arrays.push(ArrayDescriptor { element: element_id, stride, dimensions: dims.to_vec() });
                if let Ty::User(id) = ty {
                    self.arrays.insert(id, array);
                }
                self.add_type(Type::Array(array))
            }
            (_, Some(TyKind::Struct { fields } | TyKind::Union { fields } | TyKind::Block { fields, .. })) => {
                let list =
                    fields.iter().map(|field| Field { offset: field.offset, ty: self.type_id(field.ty) }).collect();
                let (size, align) = project.types.extent(ty);
                let record = Record { size, align, fields: list };
                match project.types.kind(ty) {
                    Some(TyKind::Block { .. }) => {
                        self.add_type(Type::Block { record, base: None, methods: Vec::new() })
                    }
                    Some(TyKind::Union { .. }) => self.add_type(Type::Union(record)),
                    _ => self.add_type(Type::Struct(record)),
                }
            }
            _ => self.scalar_type(Storage::U8),
        };
        self.types.insert(ty, id);
        id
    }

    /// The array type that stands for a string's characters.
    pub(super) fn character_array(&mut self, text: Ty) -> ArrayId {
        if let Some(&array) = self.characters.get(&text) {
            return array;
        }
        let unit = text.character().unwrap_or(ElementaryType::Char).storage();
        let element = self.scalar_type(unit);
        let array = ArrayId(self.id16(self.section.arrays.len(), "array types"));
        let dimensions = vec![(1, i32::from(text.capacity().unwrap_or(1)))];
        self.section.arrays.push(ArrayDescriptor { element, stride: unit.bytes(), dimensions });
        self.characters.insert(text, array);
        array
    }

    /// A constant of the pool.
    pub(super) fn constant(&mut self, value: Constant) -> ConstantId {
        let key = match value {
            Constant::I64(bits) => (0, bits.cast_unsigned()),
            Constant::F32(bits) => (1, u64::from(bits)),
            Constant::F64(bits) => (2, bits),
        };
        if let Some(&id) = self.pool.get(&key) {
            return id;
        }
        let id = ConstantId(self.id16(self.constants.len(), "constants"));
        self.constants.push(value);
        self.pool.insert(key, id);
        id
    }

    /// Bytes of a value, for a type of any size that an image may have.
    fn value_bytes(&self, ty: Ty, value: &Value, out: &mut [u8]) {
        let types = &self.project.types;
        match (value, types.kind(ty)) {
            (Value::Zero, _) => {}
            (Value::Scalar(value), _) => {
                let bytes = scalar_bytes(value, types.extent(ty).0);
                for (to, from) in out.iter_mut().zip(bytes) {
                    *to = from;
                }
                // What is longer than its place is cut, and ends in a terminator all the same.
                let terminator = match value {
                    Const::Str(_) => 1,
                    Const::WStr(_) => 2,
                    _ => 0,
                };
                out.iter_mut().rev().take(terminator).for_each(|byte| *byte = 0);
            }
            (Value::Array(runs), Some(TyKind::Array { element, .. })) => {
                let stride = types.extent(*element).0.max(1) as usize;
                let mut elements = out.chunks_exact_mut(stride);
                for (count, value) in runs.iter() {
                    for chunk in elements.by_ref().take(*count as usize) {
                        self.value_bytes(*element, value, chunk);
                    }
                }
            }
            (
                Value::Record(values),
                Some(TyKind::Struct { fields } | TyKind::Union { fields } | TyKind::Block { fields, .. }),
            ) => {
                for (at, value) in values.iter() {
                    let Some(field) = fields.get(*at as usize) else { continue };
                    let (start, size) = (field.offset as usize, types.extent(field.ty).0 as usize);
                    if let Some(part) = out.get_mut(start..start + size) {
                        self.value_bytes(field.ty, value, part);
                    }
                }
            }
            _ => {}
        }
    }

    /// Appends the runs of a value at an offset, ascending.
    pub(super) fn init_runs(&mut self, region: Region, offset: u32, ty: Ty, value: &Value) {
        if value.is_zero() {
            return;
        }
        let project = self.project;
        match (value, project.types.kind(ty)) {
            (Value::Array(runs), Some(TyKind::Array { element, .. })) => {
                let stride = project.types.extent(*element).0;
                let mut at = offset;
                for (count, value) in runs.iter() {
                    if *count > 1 && !value.is_zero() {
                        let mut bytes = vec![0; stride as usize];
                        self.value_bytes(*element, value, &mut bytes);
                        self.section.init_image.push(InitRun { region, offset: at, repeat: *count, bytes });
                    } else if *count == 1 {
                        self.init_runs(region, at, *element, value);
                    }
                    at = at.saturating_add(count.saturating_mul(stride));
                }
            }
            (
                Value::Record(values),
                Some(TyKind::Struct { fields } | TyKind::Union { fields } | TyKind::Block { fields, .. }),
            ) => {
                for (at, value) in values.iter() {
                    if let Some(field) = fields.get(*at as usize) {
                        self.init_runs(region, offset + field.offset, field.ty, value);
                    }
                }
            }
            _ => {
                let mut bytes = vec![0; project.types.extent(ty).0 as usize];
                self.value_bytes(ty, value, &mut bytes);
                if ty.is_text() {
                    let unit = if ty.is_wide_text() { 2 } else { 1 };
                    let used = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
                    bytes.truncate(used.max(1).next_multiple_of(unit));
                }
                self.section.init_image.push(InitRun { region, offset, repeat: 1, bytes });
            }
        }
    }

    /// Bytes of all strings in a variable of this type.
    pub(super) fn string_bytes(&self, ty: Ty) -> u64 {
        let types = &self.project.types;
        match (ty, types.kind(ty)) {
            (Ty::Str(capacity), _) => u64::from(capacity) + 1,
            (_, Some(TyKind::Array { element, .. })) => {
                let inner = self.string_bytes(*element);
                let (size, stride) = (u64::from(types.extent(ty).0), u64::from(types.extent(*element).0.max(1)));
                inner.saturating_mul(size / stride)
            }
            (_, Some(TyKind::Struct { fields } | TyKind::Union { fields } | TyKind::Block { fields, .. })) => {
                fields.iter().map(|field| self.string_bytes(field.ty)).sum()
            }
            _ => 0,
        }
    }
}

/// Debug types, made on demand.
#[derive(Debug, Default)]
pub(super) struct DebugTypes {
    pub(super) list: Vec<DebugType>,
    known: BTreeMap<Ty, DebugTypeId>,
    elementary: BTreeMap<ElementaryType, DebugTypeId>,
}

impl Builder<'_> {
    /// The debug type of a type.
    pub(super) fn debug_type(&mut self, debug: &mut DebugTypes, ty: Ty) -> DebugTypeId {
        if let Some(&id) = debug.known.get(&ty) {
            return id;
        }
        let project = self.project;
        let made = match (ty, project.types.kind(ty)) {
            (Ty::Str(capacity), _) => DebugType::String { capacity },
            (Ty::WStr(capacity), _) => DebugType::WideString { capacity },
            (_, Some(TyKind::Enum { base, values, .. })) => DebugType::Enumeration {
                name: project.types.name(ty),
                base: *base,
                values: values.iter().map(|(_, name, value)| (name.clone(), *value)).collect(),
            },
            (_, Some(&TyKind::Subrange { base, low, high })) => DebugType::Subrange { base, lower: low, upper: high },
            (_, Some(TyKind::Array { element, dims })) => DebugType::Array {
                element: self.debug_type(debug, *element),
                stride: project.types.extent(*element).0,
                dimensions: dims.to_vec(),
            },
            (_, Some(TyKind::Struct { fields } | TyKind::Union { fields } | TyKind::Block { fields, .. })) => {
                let visible = fields.iter().filter(|field| !field.name.starts_with("__"));
                let fields =
                    visible.map(|field| (field.name.clone(), field.offset, self.debug_type(debug, field.ty))).collect();
                DebugType::Record { name: project.types.name(ty), fields }
            }
            _ => {
                let elementary = project.types.elementary(ty).unwrap_or(ElementaryType::Byte);
                if let Some(&id) = debug.elementary.get(&elementary) {
                    return id;
                }
                let id = self.id16(debug.list.len(), "debug types");
                debug.list.push(DebugType::Elementary(elementary));
                debug.elementary.insert(elementary, id);
                return id;
            }
        };
        let id = self.id16(debug.list.len(), "debug types");
        debug.list.push(made);
        debug.known.insert(ty, id);
        id
    }
}
