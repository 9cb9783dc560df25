//! The target `trace`: its body is `khz_fuzz::trace`.
#![no_main]

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

fuzz_target!(|bytes: &[u8]| khz_fuzz::trace(bytes));

fuzz_mutator!(|bytes: &mut [u8], length: usize, most: usize, seed: u32| {
    match khz_fuzz::mutated_text(&bytes[..length], most, seed) {
        Some(text) => khz_fuzz::put(bytes, &text),
        None => fuzzer_mutate(bytes, length, most),
    }
});
