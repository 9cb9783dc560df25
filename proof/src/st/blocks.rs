//! The standard function blocks, by the standard's tables and figures.

use super::tree::{Kind, Value};

/// What a standard function block does.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Block {
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

/// A standard function block: what it does, and the type that its name tells, as `CTU_DINT` does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Standard {
    /// What it does.
    pub block: Block,
    /// Type in its name.
    pub form: Option<Kind>,
}

/// Name, type, whether it is an input.
pub type Field = (&'static str, Kind, bool);

impl Standard {
    /// All of them.
    #[must_use]
    pub fn all() -> Vec<Standard> {
        const COUNTS: [Option<Kind>; 6] =
            [None, Some(Kind::Int), Some(Kind::Dint), Some(Kind::Lint), Some(Kind::Udint), Some(Kind::Ulint)];
        const TIMES: [Option<Kind>; 3] = [None, Some(Kind::Time), Some(Kind::Ltime)];
        let rows: [(Block, &[Option<Kind>]); 10] = [
            (Block::RTrig, &[None]),
            (Block::FTrig, &[None]),
            (Block::Sr, &[None]),
            (Block::Rs, &[None]),
            (Block::Ctu, &COUNTS),
            (Block::Ctd, &COUNTS),
            (Block::Ctud, &COUNTS),
            (Block::Ton, &TIMES),
            (Block::Tof, &TIMES),
            (Block::Tp, &TIMES),
        ];
        rows.iter()
            .flat_map(|(block, forms)| forms.iter().map(|form| Standard { block: *block, form: *form }))
            .collect()
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> String {
        let name =
            ["R_TRIG", "F_TRIG", "SR", "RS", "CTU", "CTD", "CTUD", "TON", "TOF", "TP"][self.block as usize].to_string();
        self.form.map_or(name.clone(), |form| format!("{name}_{}", form.name()))
    }

    /// Inputs and outputs.
    #[must_use]
    pub fn fields(self) -> Vec<Field> {
        const B: Kind = Kind::Bool;
        let count = self.form.unwrap_or(Kind::Int);
        let time = self.form.unwrap_or(Kind::Time);
        match self.block {
            Block::RTrig | Block::FTrig => vec![("CLK", B, true), ("Q", B, false)],
            Block::Sr => vec![("S1", B, true), ("R", B, true), ("Q1", B, false)],
            Block::Rs => vec![("S", B, true), ("R1", B, true), ("Q1", B, false)],
            Block::Ctu => {
                vec![("CU", B, true), ("R", B, true), ("PV", count, true), ("Q", B, false), ("CV", count, false)]
            }
            Block::Ctd => {
                vec![("CD", B, true), ("LD", B, true), ("PV", count, true), ("Q", B, false), ("CV", count, false)]
            }
            Block::Ctud => vec![
                ("CU", B, true),
                ("CD", B, true),
                ("R", B, true),
                ("LD", B, true),
                ("PV", count, true),
                ("QU", B, false),
                ("QD", B, false),
                ("CV", count, false),
            ],
            Block::Ton | Block::Tof | Block::Tp => {
                vec![("IN", B, true), ("PT", time, true), ("Q", B, false), ("ET", time, false)]
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
        let (lowest, highest) = self.form.unwrap_or(Kind::Int).limits();
        match self.block {
            Block::RTrig => {
                v[1] = flag(v[0] != 0 && v[count] == 0);
                v[count] = v[0];
            }
            Block::FTrig => {
                v[1] = flag(v[0] == 0 && v[count] != 0);
                v[count] = v[0];
            }
            Block::Sr => v[2] = flag(v[0] != 0 || (v[1] == 0 && v[2] != 0)),
            Block::Rs => v[2] = flag(v[1] == 0 && (v[0] != 0 || v[2] != 0)),
            Block::Ctu => {
                let edge = v[0] != 0 && v[count] == 0;
                v[count] = v[0];
                if v[1] != 0 {
                    v[4] = 0;
                } else if edge && v[4] < highest {
                    v[4] += 1;
                }
                v[3] = flag(v[4] >= v[2]);
            }
            Block::Ctd => {
                let edge = v[0] != 0 && v[count] == 0;
                v[count] = v[0];
                if v[1] != 0 {
                    v[4] = v[2];
                } else if edge && v[4] > lowest {
                    v[4] -= 1;
                }
                v[3] = flag(v[4] <= 0);
            }
            Block::Ctud => {
                let (up, down) = (v[0] != 0 && v[count] == 0, v[1] != 0 && v[count + 1] == 0);
                (v[count], v[count + 1]) = (v[0], v[1]);
                if v[2] != 0 {
                    v[7] = 0;
                } else if v[3] != 0 {
                    v[7] = v[4];
                } else if up && !down && v[7] < highest {
                    v[7] += 1;
                } else if down && !up && v[7] > lowest {
                    v[7] -= 1;
                }
                (v[5], v[6]) = (flag(v[7] >= v[4]), flag(v[7] <= 0));
            }
            Block::Ton => on_delay(&mut v, now),
            Block::Tof => off_delay(&mut v, now),
            Block::Tp => pulse(&mut v, now),
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
