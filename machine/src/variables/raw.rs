//! Variables by their bytes: what values one can hold, where it lies, and writing a value without its literal.
//!
//! For users that compare or make values by the million: literals cost a hundred times as much.

use std::ops::Range;

use khz_bytecode::container::{DebugPlace, ElementaryType};

use super::{Shape, Variable, VariableTable, place_range, store_at, store_text, store_wide_text};
use crate::image::{Image, ImageLayout};
use crate::semantics::Value;

/// What values a variable can hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Domain {
    /// Every value of an elementary type.
    Elementary(ElementaryType),
    /// From a least to a greatest value, as bits of the integer type.
    Subrange {
        /// The integer type.
        base: ElementaryType,
        /// Least value.
        lower: i64,
        /// Greatest value.
        upper: i64,
    },
    /// Some values of an integer type.
    Values {
        /// The integer type.
        base: ElementaryType,
        /// The values of the enumeration.
        values: Vec<i64>,
    },
    /// Up to `capacity` characters (WSTRING: code units).
    Text {
        /// WSTRING.
        wide: bool,
        /// Most characters.
        capacity: u16,
    },
}

impl VariableTable {
    /// What values a variable can hold; `None` for arrays, structures and what is of an unknown type.
    #[must_use]
    pub fn domain(&self, variable: &Variable) -> Option<Domain> {
        match self.shape(variable.ty) {
            Shape::Scalar(ty) => Some(Domain::Elementary(ty)),
            Shape::Subrange { base, lower, upper } => Some(Domain::Subrange { base, lower, upper }),
            Shape::Enumeration { base, values, .. } => {
                Some(Domain::Values { base, values: values.iter().map(|(_, value)| *value).collect() })
            }
            Shape::String { capacity } => Some(Domain::Text { wide: false, capacity }),
            Shape::WideString { capacity } => Some(Domain::Text { wide: true, capacity }),
            Shape::Array { .. } | Shape::Record { .. } | Shape::Unknown => None,
        }
    }

    /// The bytes of a variable that is no array or structure, as image offsets: of a bit its byte. `None`: it is one, or lies outside the image.
    #[must_use]
    pub fn bytes_of(&self, layout: &ImageLayout, variable: &Variable) -> Option<Range<usize>> {
        let room = place_range(layout, variable.place)?;
        let size = match (variable.place, self.domain(variable)?) {
            (DebugPlace::Bit(..), _) => 1,
            (_, Domain::Elementary(base) | Domain::Subrange { base, .. } | Domain::Values { base, .. }) => {
                base.storage().bytes() as usize
            }
            (_, Domain::Text { wide, capacity }) => (usize::from(capacity) + 1) << u8::from(wide),
        };
        Some(room.start..room.start.checked_add(size)?).filter(|bytes| bytes.end <= room.end)
    }

    /// Stores the low bits of `bits` in a variable that holds a number, BOOL, time or enumeration. The caller keeps to its [`Domain`], and gives the
    /// one NaN for every NaN. False, and nothing is written, for other variables and those outside the image.
    pub fn write_bits(&self, image: &mut Image, variable: &Variable, bits: u64) -> bool {
        let base = match self.domain(variable) {
            Some(Domain::Elementary(base) | Domain::Subrange { base, .. } | Domain::Values { base, .. }) => base,
            Some(Domain::Text { .. }) | None => return false,
        };
        let Some(bytes) = place_range(image.layout(), variable.place).and_then(|at| image.bytes_mut().get_mut(at))
        else {
            return false;
        };
        store_at(bytes, variable.place, base, Value::from_bits(base.storage().value_type(), bits)).is_some()
    }

    /// Stores the code units of a text in a STRING (the low byte of each) or WSTRING; those beyond its capacity are left out. False for other variables
    /// and those outside the image.
    pub fn write_units(&self, image: &mut Image, variable: &Variable, units: &[u16]) -> bool {
        let Some(Domain::Text { wide, capacity }) = self.domain(variable) else { return false };
        let Some(bytes) = place_range(image.layout(), variable.place).and_then(|at| image.bytes_mut().get_mut(at))
        else {
            return false;
        };
        let units = units.iter().copied().take(usize::from(capacity));
        let stored = if wide {
            store_wide_text(bytes, capacity, units.flat_map(u16::to_le_bytes))
        } else {
            store_text(bytes, capacity, units.map(|unit| unit as u8))
        };
        stored.is_some()
    }
}
