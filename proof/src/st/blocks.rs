//! The standard function blocks, by the standard's tables and figures.

use super::tree::{Kind, Value};

/// A standard function block.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standard {
    RTrig,
    FTrig,
    Sr,
    Rs,
    Ctu,
    Ctd,
    Ctud,
    Ton,
    Tof,
    Tp,
}

/// Name, type, whether it is an input.
type Field = (&'static str, Kind, bool);

impl Standard {
    /// All of them.
    pub const ALL: [Standard; 10] = [
        Standard::RTrig,
        Standard::FTrig,
        Standard::Sr,
        Standard::Rs,
        Standard::Ctu,
        Standard::Ctd,
        Standard::Ctud,
        Standard::Ton,
        Standard::Tof,
        Standard::Tp,
    ];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["R_TRIG", "F_TRIG", "SR", "RS", "CTU", "CTD", "CTUD", "TON", "TOF", "TP"][self as usize]
    }

    /// Inputs and outputs.
    #[must_use]
    pub fn fields(self) -> &'static [Field] {
        const B: Kind = Kind::Bool;
        match self {
            Standard::RTrig | Standard::FTrig => &[("CLK", B, true), ("Q", B, false)],
            Standard::Sr => &[("S1", B, true), ("R", B, true), ("Q1", B, false)],
            Standard::Rs => &[("S", B, true), ("R1", B, true), ("Q1", B, false)],
            Standard::Ctu => {
                &[("CU", B, true), ("R", B, true), ("PV", Kind::Int, true), ("Q", B, false), ("CV", Kind::Int, false)]
            }
            Standard::Ctd => {
                &[("CD", B, true), ("LD", B, true), ("PV", Kind::Int, true), ("Q", B, false), ("CV", Kind::Int, false)]
            }
            Standard::Ctud => &[
                ("CU", B, true),
                ("CD", B, true),
                ("R", B, true),
                ("LD", B, true),
                ("PV", Kind::Int, true),
                ("QU", B, false),
                ("QD", B, false),
                ("CV", Kind::Int, false),
            ],
            Standard::Ton | Standard::Tof | Standard::Tp => {
                &[("IN", B, true), ("PT", Kind::Time, true), ("Q", B, false), ("ET", Kind::Time, false)]
            }
        }
    }

    /// A fresh instance: its fields, then three numbers of its own.
    #[must_use]
    pub fn initial(self) -> Value {
        Value::Many(vec![Value::Int(0); self.fields().len() + 3])
    }

    /// One call at a time of the round in nanoseconds.
    ///
    /// # Panics
    /// When the value is none of the block.
    pub fn call(self, parts: &mut [Value], now: i128) {
        let count = self.fields().len();
        let mut v: Vec<i128> = parts.iter().map(Value::int).collect();
        let flag = i128::from;
        match self {
            Standard::RTrig => {
                v[1] = flag(v[0] != 0 && v[count] == 0);
                v[count] = v[0];
            }
            Standard::FTrig => {
                v[1] = flag(v[0] == 0 && v[count] != 0);
                v[count] = v[0];
            }
            Standard::Sr => v[2] = flag(v[0] != 0 || (v[1] == 0 && v[2] != 0)),
            Standard::Rs => v[2] = flag(v[1] == 0 && (v[0] != 0 || v[2] != 0)),
            Standard::Ctu => {
                let edge = v[0] != 0 && v[count] == 0;
                v[count] = v[0];
                if v[1] != 0 {
                    v[4] = 0;
                } else if edge && v[4] < 32767 {
                    v[4] += 1;
                }
                v[3] = flag(v[4] >= v[2]);
            }
            Standard::Ctd => {
                let edge = v[0] != 0 && v[count] == 0;
                v[count] = v[0];
                if v[1] != 0 {
                    v[4] = v[2];
                } else if edge && v[4] > -32768 {
                    v[4] -= 1;
                }
                v[3] = flag(v[4] <= 0);
            }
            Standard::Ctud => {
                let (up, down) = (v[0] != 0 && v[count] == 0, v[1] != 0 && v[count + 1] == 0);
                (v[count], v[count + 1]) = (v[0], v[1]);
                if v[2] != 0 {
                    v[7] = 0;
                } else if v[3] != 0 {
                    v[7] = v[4];
                } else if up && !down && v[7] < 32767 {
                    v[7] += 1;
                } else if down && !up && v[7] > -32768 {
                    v[7] -= 1;
                }
                (v[5], v[6]) = (flag(v[7] >= v[4]), flag(v[7] <= 0));
            }
            Standard::Ton => on_delay(&mut v, now),
            Standard::Tof => off_delay(&mut v, now),
            Standard::Tp => pulse(&mut v, now),
        }
        parts.iter_mut().zip(v).for_each(|(part, value)| *part = Value::Int(value));
    }
}

/// IN, PT, Q, ET, then: it is running, since when.
fn on_delay(v: &mut [i128], now: i128) {
    if v[0] == 0 {
        (v[2], v[3], v[4]) = (0, 0, 0);
        return;
    }
    if v[4] == 0 {
        (v[4], v[5]) = (1, now);
    }
    if v[2] == 0 {
        let passed = now - v[5];
        v[2] = i128::from(passed >= v[1]);
        // The scan of the edge shows 0, whatever PT is.
        v[3] = if passed >= v[1] && passed > 0 { v[1] } else { passed };
    }
}

/// The same fields: running means the delay after IN fell.
fn off_delay(v: &mut [i128], now: i128) {
    if v[0] != 0 {
        (v[2], v[3], v[4]) = (1, 0, 0);
        return;
    }
    if v[2] == 0 {
        return;
    }
    if v[4] == 0 {
        (v[4], v[5]) = (1, now);
    }
    let passed = now - v[5];
    v[3] = passed.min(v[1]);
    if passed >= v[1] {
        (v[2], v[4]) = (0, 0);
    }
}

/// The same fields, and the last IN: a pulse once begun lasts PT.
fn pulse(v: &mut [i128], now: i128) {
    let edge = v[0] != 0 && v[6] == 0;
    v[6] = v[0];
    if v[2] != 0 {
        v[3] = (now - v[5]).min(v[1]);
        v[2] = i128::from(now - v[5] < v[1]);
    } else if edge {
        (v[5], v[3]) = (now, 0);
        v[2] = i128::from(v[1] > 0);
    }
    if v[2] == 0 && v[0] == 0 {
        v[3] = 0;
    }
}
