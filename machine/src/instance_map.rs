//! Where function block instances lie, and which function a method name means there: what `call.virtual` asks.
//!
//! The map is built once from a container and lies outside the memory image, so nothing that a PLC program writes can change
//! where a call goes. A program holds an instance as an integer (`ref.to_int`); [`InstanceMap::find`] answers with the function
//! or with nothing, and then the engine traps *reference*.
//!
//! Rows of instances inside arrays of blocks interleave (each element has its own inner blocks), so the search looks at every
//! row that spans the address, from the highest start downward. Their number is the nesting depth of block types in programs
//! that people write.

use khz_bytecode::container::{Container, Type};
use khz_bytecode::ids::{FunctionId, MethodId, TypeId};

/// Evenly spaced instances of one function block type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InstanceRow {
    /// Offset of the first instance from the start of the data region, in bytes.
    pub offset: u32,
    /// Bytes from one instance to the next; at least 1.
    pub stride: u32,
    /// How many instances; at least 1.
    pub count: u32,
    /// Their type, always a [`Type::Block`].
    pub ty: TypeId,
}

impl InstanceRow {
    /// First offset behind the places where an instance of this row may start.
    fn end(&self) -> u64 {
        u64::from(self.offset) + u64::from(self.stride) * u64::from(self.count)
    }

    /// Whether an instance of this row starts at this offset of the data region.
    #[must_use]
    pub fn starts_at(&self, address: u32) -> bool {
        let Some(distance) = address.checked_sub(self.offset) else { return false };
        distance.is_multiple_of(self.stride) && distance / self.stride < self.count
    }
}

/// Methods of one function block type and where the inherited ones are found.
#[derive(Debug, Clone, Default)]
struct BlockMethods {
    base: Option<TypeId>,
    /// Ascending by method.
    methods: Vec<(MethodId, FunctionId)>,
}

/// All function block instances of a resource, searchable by address.
#[derive(Debug, Clone, Default)]
pub struct InstanceMap {
    /// Ascending by offset; rows of one offset keep the order of the container.
    rows: Vec<InstanceRow>,
    /// For each row the largest end of it and of all rows before it: where a downward search may stop.
    reach: Vec<u64>,
    /// By type; types that are no blocks have no methods.
    types: Vec<BlockMethods>,
}

impl InstanceMap {
    /// The map of a container's instances. Data blocks of programs are no function blocks and are left out.
    #[must_use]
    pub fn new(container: &Container) -> Self {
        let types: Vec<BlockMethods> = container.types.types.iter().map(block_methods).collect();
        let is_block = |ty: TypeId| matches!(container.types.types.get(ty.index()), Some(Type::Block { .. }));
        let mut rows: Vec<InstanceRow> = (container.types.block_instances.iter())
            .filter(|row| is_block(row.ty) && row.count > 0)
            .map(|row| InstanceRow { offset: row.offset, stride: row.stride.max(1), count: row.count, ty: row.ty })
            .collect();
        rows.sort_by_key(|row| row.offset);
        let reach = rows.iter().scan(0, |reach, row| {
            *reach = row.end().max(*reach);
            Some(*reach)
        });
        let reach = reach.collect();
        InstanceMap { rows, reach, types }
    }

    /// All rows, ascending by offset.
    #[must_use]
    pub fn rows(&self) -> &[InstanceRow] {
        &self.rows
    }

    /// The function that `method` means for the instance at `address` (an offset from the data region's start, as `ref.to_int`
    /// gives it); nothing when no instance starts there, or when its type has no such method. Should a container name one
    /// address twice, the row of the highest offset, and of these the last, is asked first.
    #[must_use]
    pub fn find(&self, address: i64, method: MethodId) -> Option<FunctionId> {
        let address = u32::try_from(address).ok()?;
        let end = self.rows.partition_point(|row| row.offset <= address);
        let spanning = self.rows[..end].iter().zip(&self.reach[..end]).rev();
        let spanning = spanning.take_while(|(_, reach)| **reach > u64::from(address));
        let mut at_address = spanning.filter(|(row, _)| row.starts_at(address));
        at_address.find_map(|(row, _)| self.method(row.ty, method))
    }

    /// The function that `method` means for a type: its own, or its nearest base's.
    #[must_use]
    pub fn method(&self, ty: TypeId, method: MethodId) -> Option<FunctionId> {
        let mut next = Some(ty);
        while let Some(ty) = next {
            let block = self.types.get(ty.index())?;
            if let Ok(at) = block.methods.binary_search_by_key(&method, |(name, _)| *name) {
                return Some(block.methods[at].1);
            }
            // A type refers only to types before it, so the walk ends.
            next = block.base.filter(|base| *base < ty);
        }
        None
    }
}

fn block_methods(ty: &Type) -> BlockMethods {
    match ty {
        Type::Block { base, methods, .. } => BlockMethods { base: *base, methods: methods.clone() },
        _ => BlockMethods::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use khz_bytecode::container::{BlockInstance, Record};

    fn block(base: Option<u16>, methods: &[(u16, u16)]) -> Type {
        let methods = methods.iter().map(|(m, f)| (MethodId(*m), FunctionId(*f))).collect();
        Type::Block { record: Record::default(), base: base.map(TypeId), methods }
    }

    fn row(offset: u32, stride: u32, count: u32, ty: u16) -> BlockInstance {
        BlockInstance { offset, stride, count, ty: TypeId(ty) }
    }

    fn map(types: Vec<Type>, rows: Vec<BlockInstance>) -> InstanceMap {
        let mut container = Container::default();
        container.types.types = types;
        container.types.block_instances = rows;
        InstanceMap::new(&container)
    }

    #[test]
    fn interleaved_rows_are_told_apart() {
        // Three outer instances of 32 bytes from 64 on, each with an inner one at 8.
        let types = vec![block(None, &[(0, 10)]), block(None, &[(0, 20)]), Type::Struct(Record::default())];
        let map = map(types, vec![row(16, 200, 1, 2), row(64, 32, 3, 0), row(72, 32, 3, 1)]);
        for element in 0..3 {
            assert_eq!(map.find(64 + 32 * element, MethodId(0)), Some(FunctionId(10)));
            assert_eq!(map.find(72 + 32 * element, MethodId(0)), Some(FunctionId(20)));
        }
        for miss in [i64::MIN, -1, 0, 16, 63, 65, 160, 168, 200, 1 << 32 | 64, i64::MAX] {
            assert_eq!(map.find(miss, MethodId(0)), None, "{miss}");
        }
    }

    #[test]
    fn a_derived_type_overrides_and_inherits() {
        let types = vec![block(None, &[(0, 10), (2, 12)]), block(Some(0), &[(0, 20), (1, 21)])];
        let map = map(types, vec![row(16, 8, 1, 1), row(32, 8, 1, 0)]);
        assert_eq!(map.find(16, MethodId(0)), Some(FunctionId(20)));
        assert_eq!(map.find(16, MethodId(1)), Some(FunctionId(21)));
        assert_eq!(map.find(16, MethodId(2)), Some(FunctionId(12)));
        assert_eq!(map.find(16, MethodId(3)), None);
        assert_eq!(map.find(32, MethodId(1)), None);
    }
}
