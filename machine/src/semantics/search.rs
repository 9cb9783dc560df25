//! The first place of one wide text in another, in time linear in their lengths and without allocation: the two-way algorithm of Crochemore and
//! Perrin, on code units. (A search for the bytes would also find places between two units.)

/// A code unit as it lies in memory.
type Unit = [u8; 2];

/// Position of the first `wanted` in `text`; `None` without one, and for an empty `wanted`.
pub(super) fn find_units(text: &[Unit], wanted: &[Unit]) -> Option<usize> {
    if wanted.is_empty() || wanted.len() > text.len() {
        return None;
    }
    // The later of the two maximal suffixes splits `wanted` at a critical place: there the local period is the whole one.
    let ((a, period_a), (b, period_b)) = (maximal_suffix(wanted, false), maximal_suffix(wanted, true));
    let (split, period) = if a > b { (a, period_a) } else { (b, period_b) };
    let repeats = wanted.get(period..period + split) == wanted.get(..split);
    // Without a short period, a mismatch on the left moves by more than half of `wanted`, and nothing is remembered.
    let period = if repeats { period } else { split.max(wanted.len() - split) + 1 };
    let (mut at, mut known) = (0, 0);
    while let Some(window) = text.get(at..at + wanted.len()) {
        let right = split.max(known);
        if let Some(miss) = first_difference(window, wanted, right..wanted.len()) {
            at += miss - split + 1;
            known = 0;
        } else if (known.min(split)..split).any(|i| window[i] != wanted[i]) {
            at += period;
            known = if repeats { wanted.len() - period } else { 0 };
        } else {
            return Some(at);
        }
    }
    None
}

fn first_difference(window: &[Unit], wanted: &[Unit], range: std::ops::Range<usize>) -> Option<usize> {
    range.into_iter().find(|i| window[*i] != wanted[*i])
}

/// Start of the suffix that is the largest, by an order of units or by its reverse, and that suffix's period.
fn maximal_suffix(wanted: &[Unit], reversed: bool) -> (usize, usize) {
    let (mut best, mut candidate, mut offset, mut period) = (0, 1, 0, 1);
    while let Some(new) = wanted.get(candidate + offset) {
        let old = &wanted[best + offset];
        if new == old {
            if offset + 1 == period {
                candidate += period;
                offset = 0;
            } else {
                offset += 1;
            }
        } else if (new < old) != reversed {
            candidate += offset + 1;
            offset = 0;
            period = candidate - best;
        } else {
            best = candidate;
            candidate += 1;
            offset = 0;
            period = 1;
        }
    }
    (best, period)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(text: &[u8]) -> Vec<Unit> {
        text.iter().map(|byte| [*byte, *byte]).collect()
    }

    /// All texts of up to `longest` letters out of two.
    fn words(longest: u32) -> Vec<Vec<Unit>> {
        let all = (0..=longest).flat_map(|length| (0..1u32 << length).map(move |bits| (length, bits)));
        let word = |(length, bits)| (0..length).map(|at| b'a' + (bits >> at & 1) as u8).collect::<Vec<u8>>();
        all.map(word).map(|text| units(&text)).collect()
    }

    #[test]
    fn finds_what_a_plain_search_finds() {
        let texts = words(10);
        for wanted in words(5) {
            for text in &texts {
                let plain = text.windows(wanted.len().max(1)).position(|window| window == wanted);
                assert_eq!(find_units(text, &wanted), plain, "{wanted:?} in {text:?}");
            }
        }
    }

    #[test]
    fn long_periods_and_long_texts_take_linear_time() {
        // Quadratic, these would be 10^9 steps each.
        let text = units(&[b"ab".repeat(16_000), b"b".to_vec(), b"a".repeat(30_000)].concat());
        let late = units(&[b"a".repeat(15_000), b"b".to_vec()].concat());
        assert_eq!(find_units(&text, &late), None);
        let early = units(&[b"b".to_vec(), b"a".repeat(29_000)].concat());
        assert_eq!(find_units(&text, &early), Some(32_000));
        let middle = units(&[b"a".repeat(9_000), b"b".to_vec(), b"a".repeat(9_000)].concat());
        assert_eq!(find_units(&text, &middle), None);
        let odd = units(&[b"ab".repeat(7_000), b"b".to_vec()].concat());
        assert_eq!(find_units(&text, &odd), Some(18_000));
    }

    #[test]
    fn nothing_is_found_between_units() {
        assert_eq!(find_units(&[[1, 2], [1, 2]], &[[2, 1]]), None);
    }
}
