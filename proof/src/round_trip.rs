//! What must come back as it was: a container through its file, through its text, and without its names.
//!
//! These need no second opinion: each pair of functions is held against itself. Formatting is held by [`harness::round_trips`](crate::harness::round_trips), which
//! knows the front end.

use std::sync::Arc;

use khz_bytecode::assembler::assemble;
use khz_bytecode::container::{Container, read, strip, write};
use khz_bytecode::disassembler::disassemble;
use khz_bytecode::verify::{Verified, verify};
use khz_machine::image::ImageLayout;
use khz_machine::trap::TrapCode;

use crate::oracle::Maker;
use crate::random::Random;
use crate::st::compare::{Side, set_time};

/// Writes a container, reads it and writes it again: the same container and the same bytes.
///
/// # Errors
/// What is not as it was.
pub fn through_bytes(container: &Container) -> Result<(), String> {
    let bytes = write(container).map_err(|error| format!("it can not be written: {error}"))?;
    let again = read(&bytes).map_err(|error| format!("what was written can not be read: {error}"))?;
    if again != *container {
        return Err("what is read is another container than what was written".to_string());
    }
    match write(&again) {
        Ok(second) if second == bytes => Ok(()),
        Ok(_) => Err("the second writing gives other bytes".to_string()),
        Err(error) => Err(format!("it can not be written again: {error}")),
    }
}

/// Disassembles a container and assembles the text: the same container.
///
/// # Errors
/// What is not as it was.
pub fn through_text(container: &Container) -> Result<(), String> {
    let text = disassemble(container);
    let again = assemble(&text).map_err(|error| format!("its own text can not be assembled: {error}"))?;
    if again == *container { Ok(()) } else { Err("its own text assembles to another container".to_string()) }
}

/// How a container runs for [`without_names`].
#[derive(Debug, Clone, Copy)]
pub struct Rounds {
    /// How many, each with new inputs and a later time.
    pub count: usize,
    /// Seed of inputs and times.
    pub seed: u64,
    /// Units of fuel of each run.
    pub fuel: u64,
    /// Largest memory image, in bytes; a container with a larger one is passed over.
    pub image_limit_bytes: u64,
}

/// Runs a container with its debug section and without: the same endings and memory, in each engine after each round.
///
/// # Errors
/// What is not the same.
pub fn without_names(verified: &Arc<Verified>, makers: &[Maker<'_>], rounds: &Rounds) -> Result<(), String> {
    let mut stripped = verified.container().clone();
    strip(&mut stripped);
    let stripped = verify(stripped).map_err(|error| format!("the stripped container is refused: {error}"))?;
    let stripped = Arc::new(stripped);
    let Ok(layout) = ImageLayout::new(verified.container(), rounds.image_limit_bytes) else { return Ok(()) };
    if ImageLayout::new(stripped.container(), rounds.image_limit_bytes).ok().as_ref() != Some(&layout) {
        return Err("the stripped container has another memory layout".to_string());
    }
    for maker in makers {
        let mut named = Side::new(maker, verified, &layout, true)?;
        let mut bare = Side::new(maker, &stripped, &layout, true)?;
        let mut random = Random::new(rounds.seed);
        let mut now = 0_i64;
        for round in 0..rounds.count {
            let inputs = layout.input.start as usize..layout.input.end as usize;
            let bytes: Vec<u8> = inputs.clone().map(|_| random.bits() as u8).collect();
            for (side, own) in [(&mut named, verified), (&mut bare, &stripped)] {
                side.image.bytes_mut()[inputs.clone()].copy_from_slice(&bytes);
                set_time(&mut side.image, own.container(), now);
            }
            let wanted = named.round(verified, Some(rounds.fuel));
            let found = bare.round(&stripped, Some(rounds.fuel));
            if wanted != found {
                return Err(format!("{}, round {round}: {found:?} without names, {wanted:?} with them", maker.name));
            }
            if let Some(at) = named.image.first_difference(&bare.image) {
                return Err(format!("{}, round {round}: without names the memory differs at {at}", maker.name));
            }
            if matches!(wanted, Err(trap) if trap.code != TrapCode::Watchdog) {
                break;
            }
            now += random.one_of([0, 1_000_000, 10_000_000, 35_000_001]);
        }
    }
    Ok(())
}
