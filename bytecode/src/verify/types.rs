//! Types: their structure is sound, and what follows from it (extents, what lies at an offset, the blocks inside).

use std::cell::Cell;

use super::error::{Check, VerifyError};
use super::facts::Extent;
use super::rules::Rule;
use crate::container::{ArrayDescriptor, BlockInstance, DataVariable, Record, Type, TypeSection};
use crate::ids::TypeId;
use crate::limits::{MAX_ANALYSIS_ENTRIES, MAX_DIMENSIONS, MAX_RESULTS, MAX_TYPE_DEPTH, MAX_UNION_ALTERNATIVES};
use crate::value::{LocalType, Storage};

/// What is known of one type beside its extent.
#[derive(Debug, Clone, Default)]
struct Traits {
    /// 1 for a scalar.
    depth: usize,
    /// How many ways a lookup in it may have to try: 1 without unions.
    alternatives: u32,
    has_float: bool,
    has_union: bool,
    has_block: bool,
    /// Whether a block instance stands at its first byte.
    begins_with_block: bool,
    /// Fields that hold block instances.
    block_fields: Vec<u32>,
}

/// What an access wants to meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// A scalar of this storage.
    Scalar(Storage),
    /// A variable, field or element of this type.
    Type(TypeId),
}

/// The verified types of a container.
#[derive(Debug)]
pub(super) struct TypeTable<'c> {
    section: &'c TypeSection,
    extents: Vec<Extent>,
    traits: Vec<Traits>,
    /// Steps left for trying the alternatives of unions, in all lookups together.
    tries: Cell<usize>,
}

impl<'c> TypeTable<'c> {
    /// Checks the structure of every type and array descriptor.
    pub(super) fn new(section: &'c TypeSection) -> Check<Self> {
        let mut table =
            TypeTable { section, extents: Vec::new(), traits: Vec::new(), tries: Cell::new(MAX_ANALYSIS_ENTRIES) };
        for (index, ty) in section.types.iter().enumerate() {
            let (extent, traits) = table.examine(index, ty)?;
            if traits.depth > MAX_TYPE_DEPTH {
                let message = format!("it nests {} types deep; at most {MAX_TYPE_DEPTH} are allowed", traits.depth);
                return Err(VerifyError::entry(Rule::TypeDepth, "type", index, message));
            }
            if traits.alternatives > MAX_UNION_ALTERNATIVES {
                let message = format!(
                    "its unions have {} alternatives; at most {MAX_UNION_ALTERNATIVES} are allowed",
                    traits.alternatives
                );
                return Err(VerifyError::entry(Rule::UnionWidth, "type", index, message));
            }
            table.extents.push(extent);
            table.traits.push(traits);
        }
        for (index, array) in section.arrays.iter().enumerate() {
            table.array_extent(index, array, "array", index)?;
        }
        table.check_signatures()?;
        Ok(table)
    }

    fn check_signatures(&self) -> Check {
        for (index, method) in self.section.methods.iter().enumerate() {
            if method.results.len() > MAX_RESULTS {
                let message = format!("{} results; at most {MAX_RESULTS} are allowed", method.results.len());
                return Err(VerifyError::entry(Rule::MethodSignature, "method", index, message));
            }
            for parameter in &method.parameters {
                if !self.local_is_valid(*parameter) {
                    let message = "a parameter refers to a type that does not exist";
                    return Err(VerifyError::entry(Rule::MethodSignature, "method", index, message));
                }
            }
        }
        Ok(())
    }

    /// Whether a local's type exists.
    pub(super) fn local_is_valid(&self, local: LocalType) -> bool {
        match local {
            LocalType::Scalar(_) => true,
            LocalType::Ref(reference) => self.get(reference.target).is_some(),
        }
    }

    fn examine(&self, index: usize, ty: &Type) -> Check<(Extent, Traits)> {
        let plain = Traits { depth: 1, alternatives: 1, ..Traits::default() };
        match ty {
            Type::Scalar(storage) => {
                let extent = Extent { size: storage.bytes(), align: storage.bytes() };
                Ok((extent, Traits { has_float: storage.is_float(), ..plain }))
            }
            Type::String { capacity } => Ok((Self::string_extent(*capacity, 1), plain)),
            Type::WideString { capacity } => Ok((Self::string_extent(*capacity, 2), plain)),
            Type::Array(array) => {
                let Some(descriptor) = self.section.arrays.get(array.index()) else {
                    let message = format!("array {array} does not exist");
                    return Err(VerifyError::entry(Rule::TypeOrder, "type", index, message));
                };
                self.earlier(index, descriptor.element)?;
                let extent = self.array_extent(array.index(), descriptor, "type", index)?;
                let element = &self.traits[descriptor.element.index()];
                // Field by field: a clone would copy the list of block fields only to drop it.
                let traits = Traits {
                    depth: element.depth + 1,
                    alternatives: element.alternatives,
                    has_float: element.has_float,
                    has_union: element.has_union,
                    has_block: element.has_block,
                    begins_with_block: element.begins_with_block,
                    block_fields: Vec::new(),
                };
                Ok((extent, traits))
            }
            Type::Struct(record) => self.examine_record(index, record, false),
            Type::Union(record) => self.examine_union(index, record),
            Type::Block { record, base, .. } => self.examine_block(index, record, *base),
        }
    }

    fn string_extent(capacity: u16, unit: u32) -> Extent {
        Extent { size: (u32::from(capacity) + 1) * unit, align: unit }
    }

    fn earlier(&self, index: usize, ty: TypeId) -> Check {
        if ty.index() < index.min(self.extents.len()) {
            return Ok(());
        }
        let message = format!("it refers to type {ty}, which does not stand before it");
        Err(VerifyError::entry(Rule::TypeOrder, "type", index, message))
    }

    /// Checks an array descriptor; `table` and `at` say whom to blame.
    fn array_extent(&self, id: usize, array: &ArrayDescriptor, table: &'static str, at: usize) -> Check<Extent> {
        let error = |rule, message: String| Err(VerifyError::entry(rule, table, at, message));
        let Some(element) = self.extents.get(array.element.index()) else {
            return error(Rule::TypeOrder, format!("the element type {} of array {id} does not exist", array.element));
        };
        if array.dimensions.is_empty() || array.dimensions.len() > MAX_DIMENSIONS {
            let message = format!("array {id} has {} dimensions, not 1 to {MAX_DIMENSIONS}", array.dimensions.len());
            return error(Rule::ArrayBounds, message);
        }
        if let Some((lower, upper)) = array.dimensions.iter().find(|(lower, upper)| lower > upper) {
            return error(Rule::ArrayBounds, format!("array {id} has a dimension {lower}..{upper}"));
        }
        if array.stride != element.size {
            let message = format!("array {id} has stride {} and elements of {} bytes", array.stride, element.size);
            return error(Rule::ArrayStride, message);
        }
        let size = element_count(array).and_then(|count| count.checked_mul(array.stride));
        match size {
            Some(size) => Ok(Extent { size, align: element.align }),
            None => error(Rule::TypeSize, format!("array {id} has more elements or bytes than 32 bits can count")),
        }
    }

    fn examine_union(&self, index: usize, record: &Record) -> Check<(Extent, Traits)> {
        let (extent, mut traits) = self.examine_record(index, record, true)?;
        if traits.has_block {
            let message = "a union holds a function block instance";
            return Err(VerifyError::entry(Rule::BlockAddress, "type", index, message));
        }
        let fields = record.fields.iter().map(|field| self.traits[field.ty.index()].alternatives);
        traits.alternatives = fields.fold(0, u32::saturating_add).max(1);
        traits.has_union = true;
        Ok((extent, traits))
    }

    fn examine_block(&self, index: usize, record: &Record, base: Option<TypeId>) -> Check<(Extent, Traits)> {
        let (extent, mut traits) = self.examine_record(index, record, false)?;
        let error = |rule, message: String| Err(VerifyError::entry(rule, "type", index, message));
        if extent.size == 0 {
            return error(Rule::BlockAddress, "a function block type has no bytes".into());
        }
        if traits.begins_with_block {
            return error(Rule::BlockAddress, "a function block instance stands at the first byte of another".into());
        }
        if let Some(base) = base {
            self.earlier(index, base)?;
            let Some(Type::Block { record: base_record, .. }) = self.get(base) else {
                return error(Rule::BlockBase, format!("its base, type {base}, is no function block type"));
            };
            let fits = base_record.size <= record.size && base_record.align <= record.align;
            if !fits || !record.fields.starts_with(&base_record.fields) {
                return error(Rule::BlockBase, format!("its first fields are not those of its base, type {base}"));
            }
            traits.depth = traits.depth.max(self.traits[base.index()].depth + 1);
        }
        traits.has_block = true;
        traits.begins_with_block = true;
        Ok((extent, traits))
    }

    fn examine_record(&self, index: usize, record: &Record, overlap: bool) -> Check<(Extent, Traits)> {
        let error = |rule, message: String| Err(VerifyError::entry(rule, "type", index, message));
        if !matches!(record.align, 1 | 2 | 4 | 8) || !record.size.is_multiple_of(record.align) {
            return error(Rule::RecordLayout, format!("size {} with alignment {}", record.size, record.align));
        }
        let mut traits = Traits { depth: 1, alternatives: 1, ..Traits::default() };
        let mut end = 0;
        for (number, field) in record.fields.iter().enumerate() {
            self.earlier(index, field.ty)?;
            let (extent, inner) = (self.extents[field.ty.index()], &self.traits[field.ty.index()]);
            if extent.align > record.align {
                let message =
                    format!("field {number} needs alignment {}, the record has {}", extent.align, record.align);
                return error(Rule::RecordLayout, message);
            }
            let after = u64::from(field.offset) + u64::from(extent.size);
            let in_order = if overlap { field.offset == 0 } else { u64::from(field.offset) >= end };
            if !in_order || after > u64::from(record.size) || !field.offset.is_multiple_of(extent.align) {
                let message = format!("field {number} at offset {} with {} bytes", field.offset, extent.size);
                return error(Rule::FieldLayout, message);
            }
            end = after;
            traits.depth = traits.depth.max(inner.depth + 1);
            traits.alternatives = traits.alternatives.max(inner.alternatives);
            traits.has_float |= inner.has_float;
            traits.has_union |= inner.has_union;
            traits.begins_with_block |= field.offset == 0 && inner.begins_with_block;
            if inner.has_block {
                traits.has_block = true;
                // A field takes more than one byte of the file, whose sections are counted in 32 bits.
                traits.block_fields.extend(u32::try_from(number));
            }
        }
        Ok((Extent { size: record.size, align: record.align }, traits))
    }

    /// The type, if it exists.
    pub(super) fn get(&self, id: TypeId) -> Option<&'c Type> {
        self.section.types.get(id.index())
    }

    /// Size and alignment of a type that exists.
    pub(super) fn extent(&self, id: TypeId) -> Extent {
        self.extents.get(id.index()).copied().unwrap_or_default()
    }

    /// Size in bytes of a type that exists.
    pub(super) fn size(&self, id: TypeId) -> u32 {
        self.extent(id).size
    }

    /// Whether a float lies in it.
    pub(super) fn has_float(&self, id: TypeId) -> bool {
        self.traits.get(id.index()).is_some_and(|traits| traits.has_float)
    }

    /// Whether a block instance lies in it.
    pub(super) fn has_block(&self, id: TypeId) -> bool {
        self.traits.get(id.index()).is_some_and(|traits| traits.has_block)
    }

    /// Whether any type is a union.
    pub(super) fn any_union(&self) -> bool {
        self.section.types.iter().any(|ty| matches!(ty, Type::Union(_)))
    }

    /// Whether some union holds a float.
    pub(super) fn union_with_float(&self) -> bool {
        let mut unions = self.section.types.iter().zip(&self.traits).filter(|(ty, _)| matches!(ty, Type::Union(_)));
        unions.any(|(_, traits)| traits.has_float)
    }

    /// Whether a base type may end inside a float of a type that derives from it: copying the base then moves half of that float.
    pub(super) fn base_ends_in_float(&self) -> bool {
        self.section.types.iter().any(|ty| {
            let Type::Block { record, base: Some(base), .. } = ty else { return false };
            let end = self.size(*base);
            record.fields.iter().any(|field| {
                let inside = field.offset < end && field.offset.saturating_add(self.size(field.ty)) > end;
                inside && self.has_float(field.ty)
            })
        })
    }

    /// The extents, for the facts.
    pub(super) fn into_extents(self) -> Vec<Extent> {
        self.extents
    }

    /// Whether block type `ty` is `ancestor` or has it among its bases.
    pub(super) fn derives_from(&self, ty: TypeId, ancestor: TypeId) -> bool {
        let mut at = Some(ty);
        // A base stands before its type, so this ends; the depth limit bounds it.
        while let Some(current) = at {
            if current == ancestor {
                return true;
            }
            at = match self.get(current) {
                Some(Type::Block { base, .. }) => *base,
                _ => None,
            };
        }
        false
    }

    /// Whether [`TypeTable::meets`] had to give up: there were too many alternatives of unions to try.
    pub(super) fn gave_up(&self) -> bool {
        self.tries.get() == 0
    }

    /// Whether `offset` inside `root` is the place of what is `wanted`. With unions it may give up, and then says no.
    pub(super) fn meets(&self, root: TypeId, offset: u32, wanted: Wanted) -> bool {
        let mut pending = Vec::new();
        let mut next = Some((root, offset));
        while let Some((ty, offset)) = next {
            if offset == 0 && self.is_wanted(ty, wanted) {
                return true;
            }
            if !pending.is_empty() {
                self.tries.set(self.tries.get().saturating_sub(1));
                if self.gave_up() {
                    return false;
                }
            }
            next = match self.get(ty) {
                Some(Type::Array(array)) => self.section.arrays.get(array.index()).and_then(|array| {
                    let inside = offset.checked_rem(array.stride).unwrap_or(0);
                    (offset < self.size(ty)).then_some((array.element, inside))
                }),
                Some(Type::Struct(record) | Type::Block { record, .. }) => {
                    let position = record.fields.partition_point(|field| field.offset <= offset);
                    let field = position.checked_sub(1).and_then(|position| record.fields.get(position));
                    field.map(|field| (field.ty, offset - field.offset))
                }
                Some(Type::Union(record)) => {
                    pending.extend(record.fields.iter().map(|field| (field.ty, offset)));
                    None
                }
                _ => None,
            };
            next = next.or_else(|| pending.pop());
        }
        false
    }

    fn is_wanted(&self, ty: TypeId, wanted: Wanted) -> bool {
        match wanted {
            Wanted::Type(wanted) => ty == wanted,
            Wanted::Scalar(storage) => matches!(self.get(ty), Some(Type::Scalar(found)) if *found == storage),
        }
    }

    /// The data variable that holds `offset` of the data region.
    pub(super) fn data_variable(&self, offset: u32) -> Option<&'c DataVariable> {
        let position = self.section.data.partition_point(|variable| variable.offset <= offset).checked_sub(1)?;
        self.section.data.get(position).filter(|variable| offset - variable.offset < self.size(variable.ty))
    }

    /// Calls `visit` with the offset and storage of every float that touches `range` of a variable of type `ty` at `offset`, floats in
    /// unions aside (they are canonicalised when loaded). Of the elements of an array that lie in the range whole, only the
    /// first `period / gcd(period, stride)` are visited: with bytes that repeat every `period`, the others look the same. Each step counts down `steps`; at
    /// 0 the walk ends, and what was not visited is not known.
    pub(super) fn floats<E>(
        &self,
        ty: TypeId,
        offset: u32,
        range: &std::ops::Range<u32>,
        period: u32,
        steps: &mut usize,
        visit: &mut dyn FnMut(u32, Storage) -> Result<(), E>,
    ) -> Result<(), E> {
        let end = offset.saturating_add(self.size(ty));
        *steps = steps.saturating_sub(1);
        if !self.has_float(ty) || offset >= range.end || end <= range.start || *steps == 0 {
            return Ok(());
        }
        match self.get(ty) {
            Some(Type::Scalar(storage)) => visit(offset, *storage),
            Some(Type::Struct(record) | Type::Block { record, .. }) => {
                let first =
                    record.fields.partition_point(|field| offset + field.offset <= range.start).saturating_sub(1);
                for field in record.fields.iter().skip(first).take_while(|field| offset + field.offset < range.end) {
                    self.floats(field.ty, offset + field.offset, range, period, steps, visit)?;
                }
                Ok(())
            }
            Some(Type::Array(array)) => {
                let Some(array) = self.section.arrays.get(array.index()) else { return Ok(()) };
                // A type with a float is not empty, so the stride is not 0.
                let stride = array.stride.max(1);
                let first = range.start.saturating_sub(offset) / stride;
                let last = (range.end.min(end) - 1 - offset) / stride;
                let distinct = (period / gcd(period, stride)).max(1);
                // One more at each edge, where an element may lie in the range only in part.
                let head = first..=last.min(first.saturating_add(distinct));
                let tail = (*head.end() + 1).max(last)..=last;
                for element in head.chain(tail) {
                    self.floats(array.element, offset + element * stride, range, period, steps, visit)?;
                    if *steps == 0 {
                        break;
                    }
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Appends the rows that list every function block instance inside a variable of type `ty` at `offset`: the canonical form that
    /// the function block instance table has. Gives up (returns false) beyond `limit` rows.
    pub(super) fn block_rows(&self, ty: TypeId, offset: u32, limit: usize, rows: &mut Vec<BlockInstance>) -> bool {
        self.block_rows_in(ty, offset, None, limit, rows)
    }

    fn block_rows_in(
        &self,
        ty: TypeId,
        offset: u32,
        array: Option<(u32, u32)>,
        limit: usize,
        rows: &mut Vec<BlockInstance>,
    ) -> bool {
        let Some(traits) = self.traits.get(ty.index()).filter(|traits| traits.has_block) else { return true };
        match self.get(ty) {
            Some(Type::Struct(record)) => self.block_rows_of_fields(record, traits, offset, array, limit, rows),
            Some(Type::Block { record, .. }) => {
                let (stride, count) = array.unwrap_or((record.size, 1));
                rows.push(BlockInstance { offset, stride, count, ty });
                rows.len() <= limit && self.block_rows_of_fields(record, traits, offset, array, limit, rows)
            }
            Some(Type::Array(id)) => {
                let Some(descriptor) = self.section.arrays.get(id.index()) else { return true };
                let count = element_count(descriptor).unwrap_or(0);
                if array.is_none() {
                    let array = Some((descriptor.stride, count));
                    return self.block_rows_in(descriptor.element, offset, array, limit, rows);
                }
                // A row has one stride: the outermost array's. Inner arrays are listed element by element.
                (0..count).all(|element| {
                    let offset = offset + element * descriptor.stride;
                    self.block_rows_in(descriptor.element, offset, array, limit, rows)
                })
            }
            _ => true,
        }
    }

    fn block_rows_of_fields(
        &self,
        record: &Record,
        traits: &Traits,
        offset: u32,
        array: Option<(u32, u32)>,
        limit: usize,
        rows: &mut Vec<BlockInstance>,
    ) -> bool {
        let fields = traits.block_fields.iter().filter_map(|number| record.fields.get(*number as usize));
        let mut fields = fields;
        fields.all(|field| self.block_rows_in(field.ty, offset + field.offset, array, limit, rows))
    }
}

/// Number of elements of an array, if it fits 32 bits.
pub(super) fn element_count(array: &ArrayDescriptor) -> Option<u32> {
    array.dimensions.iter().try_fold(1u32, |count, (lower, upper)| {
        let length = i64::from(*upper) - i64::from(*lower) + 1;
        u32::try_from(length).ok().and_then(|length| count.checked_mul(length))
    })
}

fn gcd(a: u32, b: u32) -> u32 {
    let (mut a, mut b) = (a, b);
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a.max(1)
}
