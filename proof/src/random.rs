//! Random numbers from a seed: the same on every machine, and leaning to the values at which programs break.

use khz_bytecode::value::{Storage, ValueType};

/// A small generator (splitmix64). Two of one seed give the same numbers.
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
}

impl Random {
    /// A generator for a seed; neighbouring seeds give unrelated numbers.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut random = Random { state: seed ^ 0x6B68_7A2D_7072_6F6F };
        random.bits();
        random
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number below `limit`; 0 when the limit is 0.
    pub fn below(&mut self, limit: usize) -> usize {
        ((u128::from(self.bits()) * limit as u128) >> 64) as usize
    }

    /// A number from `low` to `high`, both included.
    pub fn between(&mut self, low: i64, high: i64) -> i64 {
        let span = u64::try_from(i128::from(high) - i128::from(low) + 1).unwrap_or(u64::MAX);
        low.wrapping_add(((u128::from(self.bits()) * u128::from(span)) >> 64) as i64)
    }

    /// True in `percent` of a hundred cases.
    pub fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    /// One of some things; none when there is none.
    pub fn pick<'a, T>(&mut self, from: &'a [T]) -> Option<&'a T> {
        from.get(self.below(from.len()))
    }

    /// One of a fixed list.
    ///
    /// # Panics
    /// Never: the list is not empty.
    pub fn one_of<T: Copy, const N: usize>(&mut self, from: [T; N]) -> T {
        const { assert!(N > 0) };
        from[self.below(N)]
    }

    /// Position of one of some weights, each as likely as it is heavy; 0 when all are 0.
    pub fn weighted(&mut self, weights: &[usize]) -> usize {
        let mut left = self.below(weights.iter().sum());
        for (position, weight) in weights.iter().enumerate() {
            match left.checked_sub(*weight) {
                Some(rest) => left = rest,
                None => return position,
            }
        }
        0
    }

    /// An integer of `width` bits (at most 64) at or near a place where something changes: 0, the ends of a type, powers of two; else small or any.
    pub fn integer(&mut self, width: u32) -> i64 {
        let near = self.between(-1, 1);
        let wide = match self.weighted(&[5, 2, 3, 3, 2]) {
            0 => self.between(-3, 10),
            1 => self.between(-300, 300),
            2 => (1_i64 << self.below(width as usize)).wrapping_add(near),
            3 => {
                let ends = [
                    i64::from(i8::MIN),
                    i64::from(u8::MAX),
                    i64::from(i16::MAX),
                    i64::from(u16::MAX),
                    i64::from(i32::MIN),
                ];
                let far = [i64::from(i32::MAX), i64::from(u32::MAX), i64::MIN, i64::MAX];
                let end = if width > 32 && self.chance(60) { self.one_of(far) } else { self.one_of(ends) };
                end.wrapping_add(near)
            }
            _ => self.bits() as i64,
        };
        if width <= 32 { i64::from(wide as i32) } else { wide }
    }

    /// A shift or rotate count, often around a width.
    pub fn shift_count(&mut self) -> i32 {
        let width = self.one_of([8, 16, 32, 64]);
        match self.below(4) {
            0 => width + self.between(-1, 1) as i32,
            1 => self.integer(32) as i32,
            _ => self.below(64) as i32,
        }
    }

    /// The bits of a REAL or LREAL, with the one NaN: zeros, infinities, NaN, subnormals, ends of integer types and their neighbours, halves.
    pub fn float(&mut self) -> f64 {
        match self.weighted(&[4, 3, 4, 3, 2]) {
            0 => {
                let plain = [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.5, 2.5, -2.5, 3.0, 10.0, 0.1];
                self.one_of(plain)
            }
            1 => {
                let odd = [
                    f64::INFINITY,
                    f64::NEG_INFINITY,
                    f64::from_bits(0xFFF8_0000_0000_0000),
                    f64::MAX,
                    f64::MIN_POSITIVE,
                ];
                let tiny = [5e-324, -5e-324, f64::from(f32::MIN_POSITIVE), 1e-45, f64::from(f32::MAX), 1e300, -1e-300];
                if self.chance(50) { self.one_of(odd) } else { self.one_of(tiny) }
            }
            2 => {
                let number = self.integer(64) as f64;
                number + self.one_of([0.0, 0.5, -0.5, 0.25])
            }
            3 => self.between(-1_000_000, 1_000_000) as f64 / 64.0,
            _ => {
                let any = f64::from_bits(self.bits());
                if any.is_nan() { 1.25 } else { any }
            }
        }
    }

    /// The bits of an interesting value of a type, as they stand in the low bytes of a slot; a NaN is the one NaN.
    pub fn value_bits(&mut self, ty: ValueType) -> u64 {
        match ty {
            ValueType::I32 => u64::from(self.integer(32) as u32),
            ValueType::I64 => self.integer(64) as u64,
            ValueType::F32 => {
                let value = self.float() as f32;
                u64::from(if value.is_nan() { 0xFFC0_0000 } else { value.to_bits() })
            }
            ValueType::F64 => {
                let value = self.float();
                if value.is_nan() { 0xFFF8_0000_0000_0000 } else { value.to_bits() }
            }
        }
    }

    /// The bytes of an interesting value as it lies in memory.
    pub fn stored(&mut self, storage: Storage) -> Vec<u8> {
        let bits = match storage {
            Storage::Bool => self.below(2) as u64,
            _ => self.value_bits(storage.value_type()),
        };
        bits.to_le_bytes()[..storage.bytes() as usize].to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_the_same_numbers_and_neighbours_others() {
        let first: Vec<u64> = (0..8)
            .map({
                let mut random = Random::new(7);
                move |_| random.bits()
            })
            .collect();
        let mut again = Random::new(7);
        assert!(first.iter().all(|bits| again.bits() == *bits));
        assert_ne!(Random::new(8).bits(), first[0]);
    }

    #[test]
    fn choices_stay_in_their_bounds_and_reach_them() {
        let mut random = Random::new(1);
        let mut seen = [0; 5];
        for _ in 0..2000 {
            let number = random.between(-2, 2);
            seen[(number + 2) as usize] += 1;
            assert!(random.weighted(&[0, 3, 0, 1]) % 2 == 1);
        }
        assert!(seen.iter().all(|count| *count > 200), "{seen:?}");
        assert_eq!((random.below(0), random.weighted(&[])), (0, 0));
        let floats: Vec<f64> = (0..2000).map(|_| random.float()).collect();
        for wanted in [f64::is_nan as fn(f64) -> bool, f64::is_infinite, f64::is_subnormal, f64::is_sign_negative] {
            assert!(floats.iter().any(|value| wanted(*value)));
        }
        assert!(
            (0..2000).any(|_| random.integer(64) == i64::MIN)
                && (0..2000).all(|_| i32::try_from(random.integer(32)).is_ok())
        );
    }
}
