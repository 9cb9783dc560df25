//! Slots that live in registers while a function runs: brought in at its start, put back at its end and by every trap.
//!
//! Slots have no address, so nobody but slot instructions reaches them; the translation holds in registers only such that no callee
//! touches. So between start and end of a call nobody can tell that the image is behind.

use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::value::Storage;

use crate::calls::Activation;
use crate::memory::Registers;
use crate::register_form::SlotRun;
use crate::run::{Stop, Surroundings};

const WORD: usize = SLOT_BYTES as usize;

/// A slot's word as a load leaves it in a register. The bytes above the value are 0 by definition.
#[inline(always)]
fn loaded(storage: Storage, word: u64) -> u64 {
    match storage {
        Storage::Bool => u64::from((word as u8).min(1)),
        Storage::I8 => u64::from(i32::from(word as i8) as u32),
        Storage::I16 => u64::from(i32::from(word as i16) as u32),
        _ => word,
    }
}

/// The word of a slot whose value is in a register.
#[inline(always)]
fn stored(storage: Storage, bits: u64) -> u64 {
    match storage {
        Storage::I8 => u64::from(bits as u8),
        Storage::I16 => u64::from(bits as u16),
        _ => bits,
    }
}

fn read(bytes: &[u8], registers: &mut [u64], load: impl Fn(u64) -> u64) {
    for (word, register) in bytes.chunks_exact(WORD).zip(registers) {
        let mut raw = [0; WORD];
        raw.copy_from_slice(word);
        *register = load(u64::from_le_bytes(raw));
    }
}

fn write(bytes: &mut [u8], registers: &[u64], store: impl Fn(u64) -> u64) {
    for (word, register) in bytes.chunks_exact_mut(WORD).zip(registers) {
        word.copy_from_slice(&store(*register).to_le_bytes());
    }
}

/// Image bytes of a run of slots.
#[inline]
fn bytes_of(run: &SlotRun, program_base: u32) -> std::ops::Range<usize> {
    let start = (run.offset + if run.of_program { program_base } else { 0 }) as usize;
    start..start + run.count as usize * WORD
}

/// Brings slots into registers.
#[inline(never)]
pub(crate) fn bring(runs: &[SlotRun], program_base: u32, memory: &[u8], registers: &mut Registers<'_>) {
    for run in runs {
        let bytes = &memory[bytes_of(run, program_base)];
        let registers = registers.range(run.register, run.count);
        // One loop for each form, so that each is a copy.
        match run.storage {
            Storage::Bool => read(bytes, registers, |word| loaded(Storage::Bool, word)),
            Storage::I8 | Storage::I16 => read(bytes, registers, |word| loaded(run.storage, word)),
            _ => read(bytes, registers, |word| word),
        }
    }
}

fn put(run: &SlotRun, program_base: u32, memory: &mut [u8], registers: &[u64]) {
    let bytes = &mut memory[bytes_of(run, program_base)];
    match run.storage {
        Storage::I8 | Storage::I16 => write(bytes, registers, |bits| stored(run.storage, bits)),
        _ => write(bytes, registers, |bits| bits),
    }
}

/// Puts the slots that a function writes back into the image.
#[inline(never)]
pub(crate) fn put_back(runs: &[SlotRun], program_base: u32, memory: &mut [u8], registers: &mut Registers<'_>) {
    for run in runs.iter().filter(|run| run.is_written) {
        put(run, program_base, memory, registers.range(run.register, run.count));
    }
}

/// After a trap: puts back what each open call held.
#[cold]
pub(crate) fn write_back(
    stop: &Stop,
    surroundings: &Surroundings<'_>,
    calls: &[Activation],
    file: &[u64],
    memory: &mut [u8],
) {
    let waiting = calls.iter().map(|call| (call.return_position, call.base));
    for (position, base) in waiting.chain([(stop.position, stop.base)]) {
        let program = surroundings.program;
        let Some(held) = program.held.get(program.function_at(position)) else { continue };
        // A trap in front of the operation that brings them finds nothing in the registers.
        if position <= held.brought_at {
            continue;
        }
        for run in program.slot_runs[held.first as usize..held.end as usize].iter().filter(|run| run.is_written) {
            let start = base + run.register as usize;
            put(run, surroundings.program_base, memory, &file[start..start + run.count as usize]);
        }
    }
}
