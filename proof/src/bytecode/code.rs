//! Code under construction: instructions with labels by number, turned into bytes at the end.

use khz_bytecode::ids::Label;
use khz_bytecode::instruction::Instruction;

/// A list of instructions whose jumps name labels of [`Code::label`].
#[derive(Debug, Default)]
pub(crate) struct Code {
    /// What was written so far.
    pub instructions: Vec<Instruction>,
    /// For each label the instruction that it stands before.
    labels: Vec<usize>,
}

impl Code {
    /// A label that stands nowhere yet.
    pub fn label(&mut self) -> Label {
        self.labels.push(0);
        Label(self.labels.len() as u32 - 1)
    }

    /// Puts a label here.
    pub fn bind(&mut self, label: Label) {
        self.labels[label.0 as usize] = self.instructions.len();
    }

    /// Appends an instruction.
    pub fn put(&mut self, instruction: Instruction) {
        self.instructions.push(instruction);
    }

    /// The bytes, with labels turned into offsets.
    pub fn finish(mut self) -> Vec<u8> {
        let targets = self.labels;
        encode(&mut self.instructions, |label| targets[label.0 as usize])
    }
}

/// Bytes of instructions whose labels `position_of` turns into positions in the list.
pub(crate) fn encode(instructions: &mut [Instruction], position_of: impl Fn(Label) -> usize) -> Vec<u8> {
    let mut offsets = Vec::with_capacity(instructions.len() + 1);
    let mut bytes = Vec::new();
    for instruction in instructions.iter() {
        offsets.push(Label(bytes.len() as u32));
        instruction.encode(&mut bytes);
    }
    offsets.push(Label(bytes.len() as u32));
    bytes.clear();
    for instruction in instructions.iter_mut() {
        relabel(instruction, |label| offsets[position_of(label)]);
        instruction.encode(&mut bytes);
    }
    bytes
}

/// Changes every label of an instruction.
pub(crate) fn relabel(instruction: &mut Instruction, change: impl Fn(Label) -> Label) {
    match instruction {
        Instruction::Jump { target } | Instruction::JumpIf { target } | Instruction::JumpUnless { target } => {
            *target = change(*target);
        }
        Instruction::Switch { targets } => targets.iter_mut().for_each(|target| *target = change(*target)),
        Instruction::ForEnter { exit, .. } => *exit = change(*exit),
        Instruction::ForNext { header, .. } => *header = change(*header),
        _ => {}
    }
}
