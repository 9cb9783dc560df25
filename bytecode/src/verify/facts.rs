//! What the verifier proved, handed out inside [`Verified`](super::Verified) so that no engine computes it again.

use std::collections::BTreeSet;

use crate::container::Container;
use crate::ids::{BlockId, ForId, FunctionId, LoopId, MethodId, SlotIndex, TypeId};
use crate::instruction::Instruction;
use crate::value::{BytePlace, StackType};

/// A container that passed every rule. Only [`verify`](super::verify()) makes one.
#[derive(Debug, Clone)]
pub struct Verified {
    container: Container,
    facts: Facts,
}

impl Verified {
    /// For the verifier only.
    pub(super) fn new(container: Container, facts: Facts) -> Self {
        Verified { container, facts }
    }

    /// The container.
    #[must_use]
    pub fn container(&self) -> &Container {
        &self.container
    }

    /// What was proved of the whole.
    #[must_use]
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// What was proved of one function.
    ///
    /// # Panics
    /// Never for an id that stands in this container.
    #[must_use]
    pub fn function(&self, id: FunctionId) -> &FunctionFacts {
        &self.facts.functions[id.index()]
    }
}

/// What was proved of a container.
#[derive(Debug, Clone, Default)]
pub struct Facts {
    /// One for each function.
    pub functions: Vec<FunctionFacts>,
    /// Bytes and alignment of each type of the type section.
    pub type_extents: Vec<Extent>,
    /// Program type of each program instance, in the order of the task table.
    pub instance_programs: Vec<crate::ids::ProgramId>,
    /// Offset in the data region of each program instance's data block; `None` when its type has none.
    pub instance_blocks: Vec<Option<u32>>,
    /// Whether a float in the data region or frame may be another NaN than the one: some reference made from an integer may write, a union
    /// has a float, a block copy may bring bytes out of %I, %Q or %M, or the copy of a base type may cut a float of a derived one. Then typed
    /// float loads from there canonicalise.
    pub foreign_floats: bool,
    /// Size in bytes of the memory image by region, for the budget that `khz verify` prints.
    pub image_bytes: u64,
}

/// Size and alignment of a type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Extent {
    /// Bytes.
    pub size: u32,
    /// Alignment in bytes: 1, 2, 4 or 8.
    pub align: u32,
}

/// One instruction at its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlacedInstruction {
    /// Byte offset in the function's code.
    pub offset: u32,
    /// The instruction.
    pub instruction: Instruction,
}

/// What was proved of one function.
#[derive(Debug, Clone, Default)]
pub struct FunctionFacts {
    /// Its instructions in code order.
    pub instructions: Vec<PlacedInstruction>,
    /// Its basic blocks in code order; block 0 is the entry. All are reachable.
    pub blocks: Vec<BasicBlock>,
    /// Its loops, outer before inner.
    pub loops: Vec<Loop>,
    /// What it may touch, its callees included.
    pub effects: Effects,
    /// Deepest operand stack.
    pub max_stack: u16,
    /// Bytes of its own frame, rounded up to [`crate::limits::FRAME_ALIGN_BYTES`].
    pub frame_bytes: u32,
    /// Frame bytes of it and its deepest chain of direct calls.
    pub frame_bytes_with_callees: u32,
    /// Depth of its deepest chain of direct calls; 1 when it calls nothing.
    pub call_depth: u16,
    /// Fuel charged at entry: the cost of its instructions outside loops.
    pub entry_fuel: u32,
    /// Whether it, or a function it calls, may call virtually.
    pub calls_virtual: bool,
    /// Whether all that it and its callees write in d, b, t and f lies in their own frames, in `this`, or in the targets of
    /// writable references passed to it: it makes no reference to other variables and calls nothing virtually.
    pub is_confined: bool,
}

/// A run of instructions that is entered only at its start and left only at its end.
#[derive(Debug, Clone, Default)]
pub struct BasicBlock {
    /// First instruction, as a position in [`FunctionFacts::instructions`].
    pub start: usize,
    /// Behind the last instruction.
    pub end: usize,
    /// Operand stack at its start, bottom first; the same on every way in.
    pub entry_stack: Vec<StackType>,
    /// Where its last instruction may go: the targets of a jump in their order (one for each, equal ones too), then the fall-through.
    pub successors: Vec<BlockId>,
    /// From where it is reached, ascending, each once.
    pub predecessors: Vec<BlockId>,
    /// Innermost loop that it belongs to.
    pub innermost_loop: Option<LoopId>,
    /// Immediate dominator; none for the entry.
    pub immediate_dominator: Option<BlockId>,
}

/// A natural loop of reducible control flow.
#[derive(Debug, Clone, Default)]
pub struct Loop {
    /// The block that every way into the loop goes through.
    pub header: BlockId,
    /// The loop around it.
    pub parent: Option<LoopId>,
    /// 1 for an outermost loop.
    pub depth: u16,
    /// All its blocks, those of inner loops included, ascending.
    pub blocks: Vec<BlockId>,
    /// Blocks that jump back to the header.
    pub back_edges: Vec<BlockId>,
    /// The FOR descriptor, when its only back edge is a `for.next` and it is entered by the `for.enter`.
    pub for_loop: Option<ForId>,
    /// For a FOR loop: neither its body nor a callee writes the control variable, so that its value is initial + k × step.
    pub control_is_proven: bool,
    /// Fuel charged at each arrival at the header: the cost of the body without inner loops.
    pub fuel: u32,
}

/// What a function may touch, its callees included. `L` slots and its own frame bytes are nobody else's business and not listed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Effects {
    /// Shared global slots it may read.
    pub globals_read: BTreeSet<SlotIndex>,
    /// Shared global slots it may write.
    pub globals_written: BTreeSet<SlotIndex>,
    /// The owner program's slots it may read.
    pub program_read: BTreeSet<SlotIndex>,
    /// The owner program's slots it may write.
    pub program_written: BTreeSet<SlotIndex>,
    /// Scalars it may read at known places: (place, owner type of T or B as a number or 0, offset).
    pub bytes_read: BTreeSet<KnownPlace>,
    /// Scalars it may write at known places.
    pub bytes_written: BTreeSet<KnownPlace>,
    /// Types of targets that it may read through references (scalars, strings, copies).
    pub read_through_references: BTreeSet<TypeId>,
    /// Types of targets that it may write through references (scalars, strings, copies).
    pub written_through_references: BTreeSet<TypeId>,
    /// Whether it may write through a reference that was made from an integer.
    pub raw_writes: bool,
    /// Whether it may end in a trap other than by watchdog.
    pub traps: bool,
    /// Method names it may call virtually.
    pub virtual_calls: BTreeSet<MethodId>,
}

/// A known place in byte memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct KnownPlace {
    /// Which memory.
    pub place: BytePlace,
    /// For `T` the function block type, for `B` the program type, as numbers; else 0.
    pub owner: u16,
    /// Offset in it.
    pub offset: u32,
}
