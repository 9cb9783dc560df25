//! The target `container_reader`: its body is `khz_fuzz::container_reader`.
#![no_main]

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

fuzz_target!(|bytes: &[u8]| khz_fuzz::container_reader(bytes));

fuzz_mutator!(|bytes: &mut [u8], length: usize, most: usize, seed: u32| {
    match khz_fuzz::mutated_container(&bytes[..length], most, seed) {
        Some(file) => khz_fuzz::put(bytes, &file),
        None => fuzzer_mutate(bytes, length, most),
    }
});
