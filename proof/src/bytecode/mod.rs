//! Containers that verify by construction, from a seed.
//!
//! `world` makes what a program works on: types up to nested function blocks, slots, data, program types, tasks, instances, heads of functions.
//! Then each function gets a `body`: statements and expressions written over a typed stack, so that operands always fit. Direct
//! calls go to later functions only, so they form no cycle; most loops count their passes. What may still run long (a FOR loop whose body writes its control
//! variable, loops in loops with calls, virtual recursion) is ended by fuel.

mod body;
mod call;
pub(crate) mod code;
mod expression;
mod idiom;
mod reference;
mod statement;
mod world;

use khz_bytecode::container::Container;
use khz_bytecode::ids::FunctionId;
use khz_bytecode::limits::{MAX_CALL_DEPTH, MAX_STACK_DEPTH};
use khz_bytecode::verify::{Verified, verify};

use crate::random::Random;

/// How large a container is: what it costs to compile it grows with that, what it may show does so only slowly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// Functions of a few statements, few methods.
    Small,
    /// Functions of some ten instructions.
    Medium,
    /// Loops in loops, long expressions.
    Large,
    /// Functions of hundreds of instructions.
    Huge,
}

impl Size {
    /// Every size, the smallest first.
    pub const ALL: [Size; 4] = [Size::Small, Size::Medium, Size::Large, Size::Huge];

    /// A size as often as [`generate`] makes it.
    fn drawn(random: &mut Random) -> Size {
        Size::ALL[random.weighted(&[70, 22, 7, 1])]
    }

    /// How many instructions each function may have, about.
    fn instructions(self, random: &mut Random) -> usize {
        match self {
            Size::Small => random.one_of([4, 8, 12]),
            Size::Medium => random.one_of([15, 25, 40]),
            Size::Large => random.one_of([60, 80, 150]),
            Size::Huge => random.one_of([200, 400]),
        }
    }
}

/// A container of a seed, verified. The same on every machine. Most are small, few huge.
///
/// # Panics
/// When the container does not verify: the generator or the verifier is wrong.
#[must_use]
pub fn generate(seed: u64) -> Verified {
    write(seed, world::World::new(seed, None))
}

/// A container of a seed in one size, verified.
///
/// # Panics
/// When the container does not verify: the generator or the verifier is wrong.
#[must_use]
pub fn generate_sized(seed: u64, size: Size) -> Verified {
    write(seed, world::World::new(seed, Some(size)))
}

fn write(seed: u64, mut world: world::World) -> Verified {
    for id in 0..world.container.functions.len() {
        body::Body::new(&mut world, FunctionId(id as u16)).write();
    }
    let parameters = &mut world.container.parameters;
    parameters.max_stack_depth = MAX_STACK_DEPTH;
    parameters.max_call_depth = MAX_CALL_DEPTH;
    parameters.frame_bytes = u32::MAX >> 8;
    let generous = checked(seed, world.container.clone());
    let functions = &generous.facts().functions;
    let depth = functions.iter().map(|function| function.call_depth).max().unwrap_or(1);
    let frames = functions.iter().map(|function| function.frame_bytes_with_callees).max().unwrap_or(0);
    let parameters = &mut world.container.parameters;
    // Virtual calls may nest deeper than direct ones: some get little room, in depth or in frames.
    parameters.max_call_depth = depth + world.random.one_of([0, 1, 3, 20]);
    parameters.frame_bytes = frames + world.random.one_of([0, 24, 400, 4000]);
    checked(seed, world.container)
}

fn checked(seed: u64, container: Container) -> Verified {
    verify(container).unwrap_or_else(|error| panic!("the container of seed {seed} is refused: {error}"))
}
