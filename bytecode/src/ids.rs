//! Newtypes for everything that is named by an index. An index of one table can not be used in another.

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident($raw:ty);)*) => { $(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        pub struct $name(pub $raw);

        impl $name {
            /// The id as an index into its table.
            #[must_use]
            pub fn index(self) -> usize {
                self.0 as usize
            }

            /// The id of table position `index`, when the id's width can hold it.
            #[must_use]
            pub fn from_index(index: usize) -> Option<Self> {
                <$raw>::try_from(index).ok().map(Self)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    )* };
}

ids! {
    /// Position of a function in the code section.
    FunctionId(u16);
    /// Position of a type in the type section's `types` sub-table.
    TypeId(u16);
    /// Position of an array descriptor in the `arrays` sub-table.
    ArrayId(u16);
    /// Position of a constant in the constant pool.
    ConstantId(u16);
    /// Position of a program type (slots and data block of a PROGRAM) in the `programs` sub-table.
    ProgramId(u16);
    /// Name of a method across all function block types: position in the `methods` sub-table.
    MethodId(u16);
    /// Identifier of a task: `task_id` of its task entry.
    TaskId(u16);
    /// Identifier of a program instance: `instance_id` of its entry.
    InstanceId(u16);
    /// Index of a slot. In `G` absolute, in `P` relative to the program instance, in `L` relative to the call's frame.
    SlotIndex(u16);
    /// Position of a FOR descriptor in its function's `for_loops`.
    ForId(u16);
    /// Byte offset of a jump target inside its function's code.
    Label(u32);
    /// Position of a basic block in [`crate::verify::FunctionFacts::blocks`].
    BlockId(u32);
    /// Position of a loop in [`crate::verify::FunctionFacts::loops`].
    LoopId(u32);
}
