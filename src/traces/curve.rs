//! A curve of a fixed size: of each stretch of time its first, least, greatest and last value.

/// Stretches of a curve: as wide as it is drawn.
pub const STRETCHES: usize = 800;

/// What a signal did in one stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Its first value there.
    pub first: f64,
    /// The least.
    pub least: f64,
    /// The greatest.
    pub greatest: f64,
    /// The last.
    pub last: f64,
}

/// A signal over time; between values it holds.
#[derive(Debug, Clone)]
pub struct Curve {
    begin_us: i64,
    end_us: i64,
    stretches: Vec<Option<Stretch>>,
}

impl Curve {
    /// An empty curve from a time to another.
    #[must_use]
    pub fn new(begin_us: i64, end_us: i64) -> Curve {
        Curve { begin_us, end_us: end_us.max(begin_us.saturating_add(1)), stretches: vec![None; STRETCHES] }
    }

    /// The stretch that a time is in.
    #[must_use]
    pub fn position(&self, time_us: i64) -> usize {
        let span = i128::from(self.end_us) - i128::from(self.begin_us);
        let at = i128::from(time_us.clamp(self.begin_us, self.end_us)) - i128::from(self.begin_us);
        ((at * STRETCHES as i128 / span) as usize).min(STRETCHES - 1)
    }

    /// Adds a value; what is not finite leaves a gap.
    pub fn add(&mut self, time_us: i64, value: f64) {
        if !value.is_finite() || time_us > self.end_us {
            return;
        }
        let position = self.position(time_us);
        match &mut self.stretches[position] {
            Some(stretch) => {
                // Before the begin only the last value counts.
                if time_us < self.begin_us {
                    *stretch = Stretch { first: value, least: value, greatest: value, last: value };
                    return;
                }
                stretch.least = stretch.least.min(value);
                stretch.greatest = stretch.greatest.max(value);
                stretch.last = value;
            }
            empty => *empty = Some(Stretch { first: value, least: value, greatest: value, last: value }),
        }
    }

    /// Its stretches that have a value, with their positions.
    pub fn stretches(&self) -> impl Iterator<Item = (usize, Stretch)> + '_ {
        self.stretches.iter().enumerate().filter_map(|(at, stretch)| stretch.map(|stretch| (at, stretch)))
    }

    /// Least and greatest value.
    #[must_use]
    pub fn bounds(&self) -> Option<(f64, f64)> {
        self.stretches().map(|(_, s)| (s.least, s.greatest)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Begin and end.
    #[must_use]
    pub fn span_us(&self) -> (i64, i64) {
        (self.begin_us, self.end_us)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_keeps_ends_and_peaks_of_each_stretch() {
        let mut curve = Curve::new(-100, 799_900);
        let (inf, nan) = (f64::INFINITY, f64::NAN);
        for (time, value) in [
            (-900, 9.0),
            (-500, 4.0),
            (0, 1.0),
            (10, 8.0),
            (20, 2.0),
            (799_900, 3.0),
            (799_901, 7.0),
            (30, inf),
            (31, nan),
        ] {
            curve.add(time, value);
        }
        let found: Vec<_> = curve.stretches().collect();
        assert_eq!(found[0], (0, Stretch { first: 4.0, least: 1.0, greatest: 8.0, last: 2.0 }));
        assert_eq!(found[1], (STRETCHES - 1, Stretch { first: 3.0, least: 3.0, greatest: 3.0, last: 3.0 }));
        assert_eq!((found.len(), curve.bounds()), (2, Some((1.0, 8.0))));
        let ends = Curve::new(i64::MIN, i64::MAX);
        assert_eq!(
            (ends.position(i64::MIN), ends.position(0), ends.position(i64::MAX)),
            (0, STRETCHES / 2, STRETCHES - 1)
        );
    }
}
