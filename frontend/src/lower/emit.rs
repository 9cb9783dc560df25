//! Instructions of one function while it is made: labels, reachability, stack depth, places in the source.
//!
//! Code that no way leads to is dropped here, in one place, so that nothing above has to think of it: after a jump or return the emitter
//! is silent until a label that something jumps to.

use khz_bytecode::ids::{FunctionId, Label};
use khz_bytecode::instruction::Instruction;

use crate::source::Span;

/// A function's code in the making.
#[derive(Debug, Default)]
pub(super) struct Emitter {
    code: Vec<Instruction>,
    /// Position of each label once it is bound.
    labels: Vec<Option<usize>>,
    /// Stack depth that jumps bring to a label, once there is one.
    depths: Vec<Option<u32>>,
    marks: Vec<(usize, Span)>,
    unreachable: bool,
    depth: u32,
    pub(super) max_depth: u32,
    last_header: Option<usize>,
    /// Functions that it calls.
    pub(super) callees: Vec<FunctionId>,
}

impl Emitter {
    /// Whether the next instruction can be reached.
    pub(super) fn is_reachable(&self) -> bool {
        !self.unreachable
    }

    /// A label to be bound later.
    pub(super) fn label(&mut self) -> Label {
        self.labels.push(None);
        self.depths.push(None);
        Label(u32::try_from(self.labels.len() - 1).unwrap_or(u32::MAX))
    }

    /// Says that what follows belongs to this place in the source.
    pub(super) fn mark(&mut self, span: Span) {
        if !self.unreachable && self.marks.last().is_none_or(|(_, last)| *last != span) {
            self.marks.push((self.code.len(), span));
        }
    }

    /// Appends an instruction that takes `pops` entries and leaves `pushes`.
    pub(super) fn push(&mut self, instruction: Instruction, pops: u32, pushes: u32) {
        if self.unreachable {
            return;
        }
        if let Instruction::Call { function } = &instruction {
            self.callees.push(*function);
        }
        self.depth = self.depth.saturating_sub(pops) + pushes;
        self.max_depth = self.max_depth.max(self.depth).max(self.depth.saturating_sub(pushes) + pops);
        for label in instruction.targets() {
            if let Some(depth) = self.depths.get_mut(label.index()) {
                *depth = Some(self.depth);
            }
        }
        self.unreachable = !instruction.falls_through();
        self.code.push(instruction);
    }

    /// Puts a label here. Where nothing jumps to it, it changes nothing.
    pub(super) fn bind(&mut self, label: Label) {
        if let (true, Some(Some(depth))) = (self.unreachable, self.depths.get(label.index())) {
            self.unreachable = false;
            self.depth = *depth;
        }
        if let Some(slot) = self.labels.get_mut(label.index()) {
            *slot = Some(self.code.len());
        }
    }

    /// Puts the label of a loop header here: an instruction that is the header of no other loop, and not the function's first.
    pub(super) fn bind_header(&mut self) -> Label {
        if self.code.is_empty() || self.last_header == Some(self.code.len()) {
            self.push(Instruction::Nop {}, 0, 0);
        }
        self.last_header = Some(self.code.len());
        let label = self.label();
        self.bind(label);
        label
    }

    /// The header of a FOR loop: the instruction behind its `for.enter`.
    pub(super) fn bind_for_header(&mut self) -> Label {
        self.last_header = Some(self.code.len());
        let label = self.label();
        self.bind(label);
        label
    }

    /// Code bytes, and byte offsets with their places.
    pub(super) fn finish(self) -> (Vec<u8>, Vec<(u32, Span)>) {
        let mut scratch = Vec::new();
        let mut offsets = Vec::with_capacity(self.code.len() + 1);
        for instruction in &self.code {
            offsets.push(u32::try_from(scratch.len()).unwrap_or(u32::MAX));
            instruction.encode(&mut scratch);
        }
        offsets.push(u32::try_from(scratch.len()).unwrap_or(u32::MAX));
        let place = |label: Label| {
            let at = self.labels.get(label.index()).copied().flatten().unwrap_or(self.code.len());
            Label(offsets.get(at).copied().unwrap_or(0))
        };
        let mut bytes = Vec::with_capacity(scratch.len());
        for instruction in &self.code {
            let patched = match instruction {
                Instruction::Jump { target } => Instruction::Jump { target: place(*target) },
                Instruction::JumpIf { target } => Instruction::JumpIf { target: place(*target) },
                Instruction::JumpUnless { target } => Instruction::JumpUnless { target: place(*target) },
                Instruction::Switch { targets } => {
                    Instruction::Switch { targets: targets.iter().map(|target| place(*target)).collect() }
                }
                Instruction::ForEnter { id, exit } => Instruction::ForEnter { id: *id, exit: place(*exit) },
                Instruction::ForNext { id, header } => Instruction::ForNext { id: *id, header: place(*header) },
                other => other.clone(),
            };
            patched.encode(&mut bytes);
        }
        let marks = self.marks.iter().filter(|(at, _)| *at < self.code.len());
        let marks = marks.map(|(at, span)| (offsets[*at], *span)).collect();
        (bytes, marks)
    }
}
