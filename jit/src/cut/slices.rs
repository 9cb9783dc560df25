//! Which stretches of a function may become functions of their own.
//!
//! Every instruction and every terminator is an item; a position is the place in front of one. Two positions bound a stretch that is entered
//! only at its start and left only at its end when the same edges lead across both; and no value leaves it when the same values are alive at both. Both
//! sets are kept as sums of random-looking numbers, one for each edge and value, so that one walk gives all of them.

use std::collections::BTreeMap;

use crate::mir::{Function, Value};

/// Blocks as stretches of items.
#[derive(Debug)]
pub struct Order {
    starts: Vec<usize>,
    /// How many items there are.
    pub count: usize,
}

impl Order {
    /// The items of a function.
    #[must_use]
    pub fn new(function: &Function) -> Order {
        let mut count = 0;
        let mut starts = Vec::with_capacity(function.blocks.len());
        for block in &function.blocks {
            starts.push(count);
            count += block.instructions.len() + 1;
        }
        Order { starts, count }
    }

    /// Position of a block's first item.
    #[must_use]
    pub fn start(&self, block: usize) -> usize {
        self.starts.get(block).copied().unwrap_or(self.count)
    }

    /// Block and number inside it of the item behind a position.
    #[must_use]
    pub fn item(&self, position: usize) -> (usize, usize) {
        let block = self.starts.partition_point(|start| *start <= position).saturating_sub(1);
        (block, position - self.start(block))
    }
}

/// The items from one position to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slice {
    /// In front of its first item.
    pub start: usize,
    /// Behind its last item.
    pub end: usize,
}

/// Stretches to cut out, inner ones before those around them, none across another: each of `most` items or little more where statements
/// are shorter than that, an inner stretch counted as one item.
#[must_use]
pub fn choose(function: &mut Function, order: &Order, most: usize) -> Vec<Slice> {
    let Some(keys) = keys(function, order) else { return Vec::new() };
    let mut chosen = Vec::new();
    // Where a stretch with this key may start, and what had been counted up to there.
    let mut starts: BTreeMap<(u64, u64), (usize, usize)> = BTreeMap::new();
    let mut open: Vec<usize> = Vec::new();
    let mut counted = 0;
    // The first block has the parameters and stays.
    let mut block = 1;
    for position in order.start(1)..order.count {
        let at_start = position == order.start(block);
        block += usize::from(at_start);
        let takes_values = at_start && !function.blocks[block - 1].parameters.is_empty();
        if !takes_values {
            let key = keys[position];
            match starts.get(&key) {
                Some((start, before)) if counted - before >= most => {
                    let (start, before) = (*start, *before);
                    chosen.push(Slice { start, end: position });
                    while let Some(inside) = open.pop_if(|inside| *inside > start) {
                        let inner = keys[inside];
                        if starts.get(&inner).is_some_and(|found| found.0 == inside) {
                            starts.remove(&inner);
                        }
                    }
                    counted = before + 1;
                    starts.insert(key, (position, counted));
                    open.push(position);
                }
                Some(_) => {}
                None => {
                    starts.insert(key, (position, counted));
                    open.push(position);
                }
            }
        }
        counted += 1;
    }
    chosen
}

/// For each position the edges across it and the values alive at it; nothing when a value's definition stands behind a use.
fn keys(function: &mut Function, order: &Order) -> Option<Vec<(u64, u64)>> {
    let mut edges = vec![0_u64; order.count + 2];
    let mut number = 0;
    for (block, data) in function.blocks.iter().enumerate() {
        let from = order.start(block + 1) - 1;
        let mut across = |first: usize, end: usize| {
            number += 1;
            if first < end {
                let name = scrambled(number);
                edges[first] = edges[first].wrapping_add(name);
                edges[end] = edges[end].wrapping_sub(name);
            }
        };
        let targets = data.terminator.targets();
        for target in &targets {
            let to = order.start(target.block.index());
            // An edge does not lead across the position that it comes to.
            if to > from { across(from + 1, to) } else { across(to + 1, from + 1) }
        }
        if targets.is_empty() {
            across(from + 1, order.count + 1);
        }
    }
    let mut values = vec![0_u64; order.count + 2];
    for (value, life) in lives(function, order)?.into_iter().enumerate() {
        let Some((definition, last_use)) = life else { continue };
        if definition < last_use {
            let name = scrambled(value as u64);
            values[definition + 1] = values[definition + 1].wrapping_add(name);
            values[last_use + 1] = values[last_use + 1].wrapping_sub(name);
        }
    }
    let (mut across, mut alive) = (0_u64, 0_u64);
    let sums = edges.iter().zip(&values).map(|(edge, value)| {
        across = across.wrapping_add(*edge);
        alive = alive.wrapping_add(*value);
        (across, alive)
    });
    Some(sums.collect())
}

/// For each value the items that define it and use it last; nothing for the function's own parameters, which every part may be given.
fn lives(function: &mut Function, order: &Order) -> Option<Vec<Option<(usize, usize)>>> {
    let mut lives: Vec<Option<(usize, usize)>> = vec![None; function.values.len()];
    let own = function.blocks[0].parameters.clone();
    // What a loop's control variable is compared with is asked for at its header.
    let mut at_header: Vec<Vec<Value>> = vec![Vec::new(); function.blocks.len()];
    for data in &function.loops {
        if let Some(counted) = &data.counted {
            at_header[data.header.index()].extend([counted.initial, counted.bound, counted.step]);
        }
    }
    let mut in_order = true;
    for (block, data) in function.blocks.iter_mut().enumerate() {
        let start = order.start(block);
        let mut used = |lives: &mut [Option<(usize, usize)>], value: Value, at: usize| match &mut lives[value.index()] {
            Some(life) => life.1 = at,
            None => in_order &= own.contains(&value),
        };
        at_header[block].iter().for_each(|value| used(&mut lives, *value, start));
        if block > 0 {
            data.parameters.iter().for_each(|value| lives[value.index()] = Some((start, start)));
        }
        let behind = start + data.instructions.len();
        for (number, instruction) in data.instructions.iter_mut().enumerate() {
            instruction.op.for_each_operand(|value| used(&mut lives, *value, start + number));
            for value in instruction.results.as_slice() {
                lives[value.index()] = Some((start + number, start + number));
            }
        }
        data.terminator.for_each_operand(|value| used(&mut lives, *value, behind));
    }
    in_order.then_some(lives)
}

/// A number as one of 64 bits that looks random (the finaliser of splitmix64).
fn scrambled(number: u64) -> u64 {
    let mut z = number.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
