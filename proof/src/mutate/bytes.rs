//! Mutants of the file: bits, bytes, numbers, pieces.

use crate::random::Random;

/// Changes something in the bytes of a file. An empty one stays.
pub(super) fn spoil(random: &mut Random, bytes: &mut Vec<u8>) {
    if bytes.is_empty() {
        return;
    }
    let at = random.below(bytes.len());
    match random.weighted(&[8, 6, 6, 4, 1, 2]) {
        0 => bytes[at] ^= 1 << random.below(8),
        1 => bytes[at] = random.one_of([0, 1, 2, 7, 8, 0x7F, 0x80, 0xFF]),
        kind @ (2 | 3) => {
            let width = if kind == 2 { 2 } else { 4 };
            let number = random.integer(32).to_le_bytes();
            bytes[at..].iter_mut().zip(number.iter().take(width)).for_each(|(to, from)| *to = *from);
        }
        4 => bytes.truncate(at),
        _ => {
            let copied: Vec<u8> = bytes[at..].iter().copied().take(8).collect();
            let to = random.below(bytes.len());
            bytes[to..].iter_mut().zip(copied).for_each(|(to, from)| *to = from);
        }
    }
}
