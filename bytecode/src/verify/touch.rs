//! What single instructions touch: the raw material of effects and of the proof about FOR control variables.

use crate::ids::{FunctionId, MethodId, SlotIndex};
use crate::value::{BytePlace, RefType, SlotPlace, Storage};

/// Where a reference certainly points: some bytes inside this extent of a known place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Origin {
    pub(super) place: BytePlace,
    pub(super) start: u32,
    pub(super) size: u32,
}

/// One thing that one instruction touches.
#[derive(Debug, Clone, Copy)]
pub(super) struct Touch {
    /// Position of the instruction in its function.
    pub(super) instruction: usize,
    pub(super) kind: TouchKind,
}

/// What is touched.
#[derive(Debug, Clone, Copy)]
pub(super) enum TouchKind {
    SlotRead(SlotPlace, SlotIndex),
    SlotWrite(SlotPlace, SlotIndex),
    BytesRead(BytePlace, u32),
    BytesWrite(BytePlace, u32, Storage),
    ReferenceRead(RefType),
    ReferenceWrite {
        reference: RefType,
        origin: Option<Origin>,
    },
    /// A direct call; its writable reference arguments are `Draft::arguments[first..first + count]`.
    Call {
        function: FunctionId,
        first: usize,
        count: usize,
    },
    CallVirtual(MethodId),
}
