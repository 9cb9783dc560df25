//! Control flow: instruction boundaries, blocks, dominators, loops.
//!
//! A backward jump must go to a block that dominates it. So the order of the code is already a reverse postorder of the forward edges, which form no
//! cycle, and one pass over the blocks finds the dominators: an edge back to a dominator changes nothing. The nearest common
//! dominator is found along skip pointers (each block keeps one far ancestor beside its parent), so that no shape of code makes it slow.

use super::error::{Check, VerifyError};
use super::facts::{BasicBlock, Loop, PlacedInstruction};
use super::rules::Rule;
use crate::ids::{BlockId, ForId, FunctionId, Label, LoopId};
use crate::instruction::{Instruction, Reader};
use crate::limits::MAX_LOOP_DEPTH;

/// Decodes the whole code of a function.
pub(super) fn decode(function: FunctionId, code: &[u8]) -> Check<Vec<PlacedInstruction>> {
    if u32::try_from(code.len()).is_err() {
        let message = "the code is longer than 32 bits can count";
        return Err(VerifyError::header(Rule::InstructionBoundary, function, message));
    }
    let mut reader = Reader::new(code);
    let mut instructions = Vec::with_capacity(code.len() / 4);
    while !reader.is_at_end() {
        let offset = reader.position() as u32;
        let instruction = Instruction::decode(&mut reader)
            .map_err(|error| VerifyError::code(Rule::InstructionBoundary, function, offset, error.to_string()))?;
        instructions.push(PlacedInstruction { offset, instruction });
    }
    Ok(instructions)
}

/// Blocks and loops of one function under construction.
#[derive(Debug)]
pub(super) struct Flow<'f> {
    function: FunctionId,
    instructions: &'f [PlacedInstruction],
    /// Block of each instruction that begins one.
    starts: Vec<usize>,
    /// The blocks, complete but for their entry stacks.
    pub(super) blocks: Vec<BasicBlock>,
    /// The loops, complete but for `control_is_proven` and `fuel`.
    pub(super) loops: Vec<Loop>,
    depths: Vec<u32>,
    skips: Vec<usize>,
}

fn ends_block(instruction: &Instruction) -> bool {
    use Instruction::{ForEnter, ForNext, Jump, JumpIf, JumpUnless, Return, Switch};
    matches!(
        instruction,
        Jump { .. } | JumpIf { .. } | JumpUnless { .. } | Switch { .. } | ForEnter { .. } | ForNext { .. } | Return {}
    )
}

fn block_id(index: usize) -> BlockId {
    // A block has at least one instruction of two bytes, and code is counted in 32 bits.
    BlockId(index as u32)
}

impl<'f> Flow<'f> {
    /// Finds blocks, dominators and loops.
    pub(super) fn new(function: FunctionId, instructions: &'f [PlacedInstruction], for_loops: usize) -> Check<Self> {
        let mut flow = Flow {
            function,
            instructions,
            starts: Vec::new(),
            blocks: Vec::new(),
            loops: Vec::new(),
            depths: Vec::new(),
            skips: Vec::new(),
        };
        flow.find_blocks()?;
        flow.link_blocks()?;
        flow.find_dominators()?;
        let headers = flow.check_for_loops(for_loops)?;
        flow.find_loops(&headers)?;
        Ok(flow)
    }

    fn error<T>(&self, rule: Rule, instruction: usize, message: impl Into<String>) -> Check<T> {
        let offset = self.instructions.get(instruction).map_or(0, |placed| placed.offset);
        Err(VerifyError::code(rule, self.function, offset, message))
    }

    fn instruction_at(&self, label: Label) -> Option<usize> {
        self.instructions.binary_search_by_key(&label.0, |placed| placed.offset).ok()
    }

    fn find_blocks(&mut self) -> Check {
        let count = self.instructions.len();
        let mut is_start = vec![false; count];
        for (at, placed) in self.instructions.iter().enumerate() {
            for target in placed.instruction.targets() {
                let Some(position) = self.instruction_at(target) else {
                    return self.error(Rule::JumpTarget, at, format!("no instruction begins at byte {target}"));
                };
                let forward_only =
                    matches!(placed.instruction, Instruction::Switch { .. } | Instruction::ForEnter { .. });
                if forward_only && position <= at {
                    return self.error(Rule::ForwardOnly, at, format!("it goes back to byte {target}"));
                }
                is_start[position] = true;
            }
            if ends_block(&placed.instruction) && at + 1 < count {
                is_start[at + 1] = true;
            }
        }
        match self.instructions.last() {
            Some(last) if !last.instruction.falls_through() => {}
            Some(_) => {
                return self.error(Rule::FallOff, count - 1, "execution would go on behind the last instruction");
            }
            None => return Err(VerifyError::header(Rule::FallOff, self.function, "it has no instructions")),
        }
        is_start[0] = true;
        self.starts = (0..count).filter(|at| is_start[*at]).collect();
        let ends = self.starts.iter().skip(1).copied().chain([count]);
        self.blocks = self
            .starts
            .iter()
            .zip(ends)
            .map(|(&start, end)| BasicBlock { start, end, ..BasicBlock::default() })
            .collect();
        Ok(())
    }

    /// Block that begins at an instruction.
    fn block_of(&self, instruction: usize) -> usize {
        self.starts.partition_point(|start| *start <= instruction).saturating_sub(1)
    }

    fn link_blocks(&mut self) -> Check {
        let mut reached = vec![false; self.blocks.len()];
        reached[0] = true;
        for at in 0..self.blocks.len() {
            if !reached[at] {
                return self.error(Rule::Unreachable, self.blocks[at].start, "no path leads here");
            }
            let last = &self.instructions[self.blocks[at].end - 1].instruction;
            let targets = last.targets();
            let targets = targets.iter().filter_map(|label| self.instruction_at(*label));
            let mut successors: Vec<BlockId> = targets.map(|target| block_id(self.block_of(target))).collect();
            if last.falls_through() {
                // `find_blocks` made sure that something stands behind.
                successors.push(block_id(at + 1));
            }
            for successor in &successors {
                let predecessors = &mut self.blocks[successor.index()].predecessors;
                if predecessors.last() != Some(&block_id(at)) {
                    predecessors.push(block_id(at));
                }
                reached[successor.index()] = true;
            }
            self.blocks[at].successors = successors;
        }
        Ok(())
    }

    fn find_dominators(&mut self) -> Check {
        self.depths = vec![0; self.blocks.len()];
        self.skips = vec![0; self.blocks.len()];
        for at in 1..self.blocks.len() {
            let mut dominator: Option<usize> = None;
            for index in 0..self.blocks[at].predecessors.len() {
                let predecessor = self.blocks[at].predecessors[index].index();
                if predecessor >= at {
                    break;
                }
                dominator = Some(dominator.map_or(predecessor, |other| self.common_dominator(other, predecessor)));
            }
            // Every block is reached over a forward edge, so there is one.
            let parent = dominator.unwrap_or(0);
            self.blocks[at].immediate_dominator = Some(block_id(parent));
            self.depths[at] = self.depths[parent] + 1;
            let (skip, far) = (self.skips[parent], self.skips[self.skips[parent]]);
            let even = self.depths[parent] - self.depths[skip] == self.depths[skip] - self.depths[far];
            self.skips[at] = if even { far } else { parent };
        }
        for at in 0..self.blocks.len() {
            for index in 0..self.blocks[at].predecessors.len() {
                let source = self.blocks[at].predecessors[index].index();
                if source >= at && !self.dominates(at, source) {
                    let jump = self.blocks[source].end - 1;
                    let target = self.instructions[self.blocks[at].start].offset;
                    let message = format!("a path leads to this jump that does not pass its target, byte {target}");
                    return self.error(Rule::BackwardJump, jump, message);
                }
            }
        }
        Ok(())
    }

    fn parent(&self, block: usize) -> usize {
        self.blocks[block].immediate_dominator.map_or(0, BlockId::index)
    }

    /// The ancestor of `block` in the dominator tree at `depth`, or itself when it is not deeper.
    fn ancestor(&self, block: usize, depth: u32) -> usize {
        let mut at = block;
        while self.depths[at] > depth {
            at = if self.depths[self.skips[at]] >= depth { self.skips[at] } else { self.parent(at) };
        }
        at
    }

    fn common_dominator(&self, a: usize, b: usize) -> usize {
        let depth = self.depths[a].min(self.depths[b]);
        let (mut a, mut b) = (self.ancestor(a, depth), self.ancestor(b, depth));
        while a != b {
            // Blocks of one depth have skip pointers of one length.
            (a, b) = if self.skips[a] == self.skips[b] {
                (self.parent(a), self.parent(b))
            } else {
                (self.skips[a], self.skips[b])
            };
        }
        a
    }

    fn dominates(&self, dominator: usize, block: usize) -> bool {
        self.ancestor(block, self.depths[dominator]) == dominator
    }

    /// Checks the pairs of `for.enter` and `for.next`. Returns the header block of each FOR loop that has a `for.next`.
    fn check_for_loops(&self, count: usize) -> Check<Vec<(usize, ForId)>> {
        let mut enters: Vec<Option<usize>> = vec![None; count];
        let mut nexts: Vec<Option<usize>> = vec![None; count];
        for (at, placed) in self.instructions.iter().enumerate() {
            let (id, seen) = match placed.instruction {
                Instruction::ForEnter { id, .. } => (id, &mut enters),
                Instruction::ForNext { id, .. } => (id, &mut nexts),
                _ => continue,
            };
            match seen.get_mut(id.index()) {
                None => return self.error(Rule::OperandIndex, at, format!("there is no FOR descriptor {id}")),
                Some(Some(_)) => return self.error(Rule::ForPair, at, format!("FOR {id} has this instruction twice")),
                Some(empty) => *empty = Some(at),
            }
        }
        let mut headers = Vec::new();
        for (number, (enter, next)) in enters.into_iter().zip(nexts).enumerate() {
            let Some(enter) = enter else {
                let message = format!("FOR {number} has no `for.enter`");
                return match next {
                    Some(at) => self.error(Rule::ForPair, at, message),
                    None => Err(VerifyError::header(Rule::ForPair, self.function, message)),
                };
            };
            self.check_for_loop(number, enter, next)?;
            if next.is_some() {
                headers.push((self.block_of(enter + 1), ForId(number as u16)));
            }
        }
        headers.sort_unstable();
        Ok(headers)
    }

    fn check_for_loop(&self, number: usize, enter: usize, next: Option<usize>) -> Check {
        let header = self.block_of(enter + 1);
        let mut expected = vec![block_id(self.block_of(enter))];
        if let Some(next) = next {
            let wanted = self.instructions.get(enter + 1).map(|placed| placed.offset);
            let goes_back = matches!(self.instructions[next].instruction,
                Instruction::ForNext { header, .. } if Some(header.0) == wanted);
            if !goes_back || next <= enter {
                let message =
                    format!("`for.next` of FOR {number} does not go back to the instruction behind its `for.enter`");
                return self.error(Rule::ForPair, next, message);
            }
            expected.push(block_id(self.block_of(next)));
        }
        let exits_into_it = self.blocks[expected[0].index()].successors.first() == Some(&block_id(header));
        if self.blocks[header].predecessors != expected || exits_into_it {
            let message =
                format!("something else than its `for.enter` and `for.next` leads into the body of FOR {number}");
            return self.error(Rule::ForHeader, enter + 1, message);
        }
        Ok(())
    }

    fn find_loops(&mut self, for_headers: &[(usize, ForId)]) -> Check {
        for at in 0..self.blocks.len() {
            let sources = self.blocks[at].predecessors.iter().copied().filter(|source| source.index() >= at);
            let back_edges: Vec<BlockId> = sources.collect();
            if !back_edges.is_empty() {
                let for_loop = for_headers.binary_search_by_key(&at, |(block, _)| *block).ok();
                let for_loop = for_loop.map(|position| for_headers[position].1);
                self.loops.push(Loop { header: block_id(at), back_edges, for_loop, ..Loop::default() });
            }
        }
        // The outermost loop found so far around each loop, with shortened paths.
        let mut outermost: Vec<usize> = (0..self.loops.len()).collect();
        // An inner header stands behind its outer one, so inner loops are filled first.
        for number in (0..self.loops.len()).rev() {
            self.fill_loop(number, &mut outermost);
        }
        for number in 0..self.loops.len() {
            let depth = self.loops[number].parent.map_or(0, |parent| self.loops[parent.index()].depth) + 1;
            if depth > MAX_LOOP_DEPTH {
                let first = self.blocks[self.loops[number].header.index()].start;
                return self.error(
                    Rule::LoopDepth,
                    first,
                    format!("loops nest {depth} deep; at most {MAX_LOOP_DEPTH} are allowed"),
                );
            }
            self.loops[number].depth = depth;
        }
        for at in 0..self.blocks.len() {
            let mut around = self.blocks[at].innermost_loop;
            while let Some(number) = around {
                self.loops[number.index()].blocks.push(block_id(at));
                around = self.loops[number.index()].parent;
            }
        }
        Ok(())
    }

    /// Walks back from the back edges to the header: all that is met belongs to the loop.
    fn fill_loop(&mut self, number: usize, outermost: &mut [usize]) {
        let id = LoopId(number as u32);
        let header = self.loops[number].header;
        self.blocks[header.index()].innermost_loop = Some(id);
        let mut pending = self.loops[number].back_edges.clone();
        while let Some(block) = pending.pop() {
            let from = match self.blocks[block.index()].innermost_loop {
                None => {
                    self.blocks[block.index()].innermost_loop = Some(id);
                    block
                }
                Some(inner) => {
                    let inner = find_outermost(outermost, inner.index());
                    if inner == number {
                        continue;
                    }
                    outermost[inner] = number;
                    self.loops[inner].parent = Some(id);
                    self.loops[inner].header
                }
            };
            pending.extend_from_slice(&self.blocks[from.index()].predecessors);
        }
    }
}

fn find_outermost(outermost: &mut [usize], number: usize) -> usize {
    let mut at = number;
    while outermost[at] != at {
        outermost[at] = outermost[outermost[at]];
        at = outermost[at];
    }
    at
}
