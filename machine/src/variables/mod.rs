//! Variables by name: what `--set`, `--watch`, `--inputs` and `--dump-vars` work on.
//!
//! Names come from the debug section, which is for people: nothing in it is trusted. Every read and write is checked against the image,
//! nesting is limited, and a dump ends when it would grow out of proportion to the image. A stripped container has no names; direct
//! addresses (`%QW2`) work all the same.
//!
//! A [`Variable`] is resolved once and used often: resolving allocates, reading and writing scalars through it does not search.

mod address;
mod dump;
mod literal;
mod raw;
mod resolve;
mod scalar;

use std::collections::BTreeMap;
use std::ops::Range;

use khz_bytecode::container::{DebugPlace, DebugSection, DebugType, DebugTypeId, DebugVariable, ElementaryType};
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::value::BytePlace;

pub use address::DirectAddress;
pub use literal::integer_range;
pub use raw::Domain;
pub use scalar::VariableValue;

use crate::image::{Image, ImageLayout};
use crate::semantics::{Value, load_foreign_scalar, store_scalar};

/// Type of a variable: one of the debug section's, or the elementary type of a direct address.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VariableType {
    /// A type of the debug section.
    Declared(DebugTypeId),
    /// BOOL, BYTE, WORD, DWORD or LWORD at a direct address.
    Elementary(ElementaryType),
}

/// A variable, or a part of one, that a name was resolved to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Variable {
    /// Its whole name in the spelling of its declaration.
    pub name: String,
    /// Where it is.
    pub place: DebugPlace,
    /// Its type.
    pub ty: VariableType,
    /// Whether it is, or lies in, what was declared CONSTANT: it can be read only.
    pub constant: bool,
}

/// Why a variable could not be found, read or written. Each names the variable.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum VariableError {
    /// No variable has this name.
    #[error("there is no variable `{0}`")]
    Unknown(String),
    /// The program was built without names.
    #[error(
        "there is no variable `{0}`: the container was stripped of its names; only direct addresses such as %QW2 can be used"
    )]
    Stripped(String),
    /// What looks like a direct address is none.
    #[error("`{0}` is not a direct address such as %IX0.1, %QW2 or %MD4")]
    Address(String),
    /// A field that the structure does not have.
    #[error("`{name}` has no field `{field}`")]
    Field {
        /// The structure.
        name: String,
        /// What was asked for.
        field: String,
    },
    /// An index on something else, a wrong number of indices, or one that is no number.
    #[error("`{name}` takes {dimensions} indices, not `[{indices}]`")]
    Indices {
        /// What was indexed.
        name: String,
        /// Its dimensions; 0 when it is no array.
        dimensions: usize,
        /// What was asked for.
        indices: String,
    },
    /// An index outside its bounds.
    #[error("index {index} of `{name}` is outside {lower}..{upper}")]
    Index {
        /// The array.
        name: String,
        /// What was asked for.
        index: i32,
        /// Lower bound.
        lower: i32,
        /// Upper bound.
        upper: i32,
    },
    /// A value was wanted where an array or structure is.
    #[error("`{name}` is {what}: name one of its parts")]
    NotScalar {
        /// The variable.
        name: String,
        /// `an array` or `a structure`.
        what: &'static str,
    },
    /// What was declared CONSTANT keeps its value.
    #[error("`{0}` is a CONSTANT and can not be written")]
    Constant(String),
    /// A text that is no value of the variable's type.
    #[error("`{name}` is {ty}: {reason}")]
    Literal {
        /// The variable.
        name: String,
        /// Its type.
        ty: String,
        /// What is wrong.
        reason: String,
    },
    /// A place outside the memory image: a wrong debug section, or a direct address beyond the end.
    #[error("`{0}` lies outside the memory of this program")]
    Outside(String),
}

/// The names of one resource.
#[derive(Debug, Clone, Default)]
pub struct VariableTable {
    types: Vec<DebugType>,
    variables: Vec<DebugVariable>,
    /// Position in `variables` by name in lower case.
    by_name: BTreeMap<String, usize>,
    is_stripped: bool,
}

/// What a type means for walking: everything is looked at through this, so that a bad type id is just one more case.
pub(crate) enum Shape<'t> {
    Scalar(ElementaryType),
    Enumeration { name: &'t str, base: ElementaryType, values: &'t [(String, i64)] },
    Subrange { base: ElementaryType, lower: i64, upper: i64 },
    String { capacity: u16 },
    WideString { capacity: u16 },
    Array { element: DebugTypeId, stride: u32, dimensions: &'t [(i32, i32)] },
    Record { name: &'t str, fields: &'t [(String, u32, DebugTypeId)] },
    Unknown,
}

impl VariableTable {
    /// The names of a debug section.
    #[must_use]
    pub fn new(debug: &DebugSection) -> VariableTable {
        let names = debug.variables.iter().enumerate();
        let by_name = names.map(|(at, variable)| (variable.name.to_ascii_lowercase(), at)).collect();
        VariableTable { types: debug.types.clone(), variables: debug.variables.clone(), by_name, is_stripped: false }
    }

    /// For a container without a debug section: direct addresses only.
    #[must_use]
    pub fn stripped() -> VariableTable {
        VariableTable { is_stripped: true, ..VariableTable::default() }
    }

    /// The table of a container, with names if it has some.
    #[must_use]
    pub fn of(container: &khz_bytecode::container::Container) -> VariableTable {
        container.debug.as_ref().map_or_else(VariableTable::stripped, VariableTable::new)
    }

    /// Globals and program variables, in the order of a dump.
    pub fn variables(&self) -> impl Iterator<Item = Variable> + '_ {
        self.variables.iter().map(|variable| Variable {
            name: variable.name.clone(),
            place: variable.place,
            ty: VariableType::Declared(variable.ty),
            constant: variable.constant,
        })
    }

    pub(crate) fn shape(&self, ty: VariableType) -> Shape<'_> {
        let id = match ty {
            VariableType::Elementary(ty) => return Shape::Scalar(ty),
            VariableType::Declared(id) => id,
        };
        match self.types.get(usize::from(id)) {
            Some(DebugType::Elementary(ty)) => Shape::Scalar(*ty),
            Some(DebugType::Enumeration { name, base, values }) => Shape::Enumeration { name, base: *base, values },
            Some(&DebugType::Subrange { base, lower, upper }) => Shape::Subrange { base, lower, upper },
            Some(DebugType::String { capacity }) => Shape::String { capacity: *capacity },
            Some(DebugType::WideString { capacity }) => Shape::WideString { capacity: *capacity },
            Some(DebugType::Array { element, stride, dimensions }) => {
                Shape::Array { element: *element, stride: *stride, dimensions }
            }
            Some(DebugType::Record { name, fields }) => Shape::Record { name, fields },
            None => Shape::Unknown,
        }
    }

    /// The name of a variable's type, as a person would write it.
    #[must_use]
    pub fn type_name(&self, variable: &Variable) -> String {
        match self.shape(variable.ty) {
            Shape::Scalar(ty) => ty.name().to_string(),
            Shape::Enumeration { name, .. } | Shape::Record { name, .. } => name.to_string(),
            Shape::Subrange { base, lower, upper } => {
                let [lower, upper] = [lower, upper].map(|bound| literal::bound_text(base, bound));
                format!("{} ({lower}..{upper})", base.name())
            }
            Shape::String { capacity } => format!("STRING[{capacity}]"),
            Shape::WideString { capacity } => format!("WSTRING[{capacity}]"),
            Shape::Array { dimensions, .. } => {
                let bounds: Vec<_> = dimensions.iter().map(|(lower, upper)| format!("{lower}..{upper}")).collect();
                format!("ARRAY[{}]", bounds.join(","))
            }
            Shape::Unknown => "of an unknown type".to_string(),
        }
    }

    /// Reads a variable that is no array or structure.
    ///
    /// # Errors
    /// It is one, or its place is outside the image.
    pub fn read(&self, image: &Image, variable: &Variable) -> Result<VariableValue, VariableError> {
        if let Some(what) = self.aggregate(variable.ty) {
            return Err(VariableError::NotScalar { name: variable.name.clone(), what });
        }
        let outside = || VariableError::Outside(variable.name.clone());
        self.read_scalar(image, variable.place, variable.ty).ok_or_else(outside)
    }

    fn aggregate(&self, ty: VariableType) -> Option<&'static str> {
        match self.shape(ty) {
            Shape::Array { .. } => Some("an array"),
            Shape::Record { .. } => Some("a structure"),
            _ => None,
        }
    }

    pub(crate) fn read_scalar(&self, image: &Image, place: DebugPlace, ty: VariableType) -> Option<VariableValue> {
        if let DebugPlace::Bit(_, _, bit) = place {
            let byte = *bytes_at(image, place)?.first()?;
            return Some(VariableValue::Bool(byte >> (bit & 7) & 1 != 0));
        }
        let bytes = bytes_at(image, place)?;
        match self.shape(ty) {
            Shape::Scalar(ty) | Shape::Subrange { base: ty, .. } => {
                Some(VariableValue::from_loaded(ty, load(bytes, ty)?))
            }
            Shape::Enumeration { base, values, .. } => {
                let value = VariableValue::from_loaded(base, load(bytes, base)?);
                let number = value.whole_bits();
                let named = values.iter().find(|(_, value)| Some(*value) == number);
                Some(named.map_or(value, |(name, _)| VariableValue::Named(name.clone())))
            }
            Shape::String { capacity } => {
                let room = bytes.get(..usize::from(capacity))?;
                let text = room.split(|byte| *byte == 0).next().unwrap_or_default();
                Some(VariableValue::String(text.to_vec()))
            }
            Shape::WideString { capacity } => {
                let room = bytes.get(..2 * usize::from(capacity))?;
                let units = room.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
                Some(VariableValue::WideString(units.take_while(|unit| *unit != 0).collect()))
            }
            Shape::Array { .. } | Shape::Record { .. } | Shape::Unknown => None,
        }
    }

    /// Writes an IEC literal to a variable that is no array or structure. BOOL also takes 0 and 1; enumerations take names and numbers of
    /// their values. A NaN enters as the one NaN.
    ///
    /// # Errors
    /// A CONSTANT, no value of the variable's type, one outside its range or subrange, or a string longer than its capacity; nothing is written then.
    pub fn write(&self, image: &mut Image, variable: &Variable, literal: &str) -> Result<(), VariableError> {
        let name = || variable.name.clone();
        let wrong = |reason| VariableError::Literal { name: name(), ty: self.type_name(variable), reason };
        if let Some(what) = self.aggregate(variable.ty) {
            return Err(VariableError::NotScalar { name: name(), what });
        }
        if variable.constant {
            return Err(VariableError::Constant(name()));
        }
        let outside = || VariableError::Outside(name());
        let range = place_range(image.layout(), variable.place).ok_or_else(outside)?;
        let bytes = image.bytes_mut().get_mut(range).ok_or_else(outside)?;
        match self.shape(variable.ty) {
            Shape::Scalar(ty) => {
                let value = literal::parse_elementary(ty, literal).map_err(wrong)?;
                store_at(bytes, variable.place, ty, value).ok_or_else(outside)
            }
            Shape::Subrange { base, lower, upper } => {
                let value = literal::parse_subrange(base, lower, upper, literal).map_err(wrong)?;
                store_at(bytes, variable.place, base, value).ok_or_else(outside)
            }
            Shape::Enumeration { name, base, values } => {
                let value = literal::parse_enumeration(name, base, values, literal).map_err(wrong)?;
                store_at(bytes, variable.place, base, value).ok_or_else(outside)
            }
            Shape::String { capacity } => {
                let units = string_units(literal, '\'', capacity).map_err(wrong)?;
                let text = units.into_iter().map(|unit| unit as u8);
                store_text(bytes, capacity, text).ok_or_else(outside)
            }
            Shape::WideString { capacity } => {
                let units = string_units(literal, '"', capacity).map_err(wrong)?;
                let text = units.into_iter().flat_map(u16::to_le_bytes);
                store_wide_text(bytes, capacity, text).ok_or_else(outside)
            }
            Shape::Array { .. } | Shape::Record { .. } | Shape::Unknown => Err(outside()),
        }
    }
}

fn string_units(literal: &str, quote: char, capacity: u16) -> Result<Vec<u16>, literal::Reason> {
    let units = literal::parse_string(literal, quote)?;
    if units.len() > usize::from(capacity) {
        return Err(format!("{} characters are more than it can hold", units.len()));
    }
    Ok(units)
}

/// Stores characters and the terminator; `None` when the variable does not lie inside `bytes`.
fn store_text(bytes: &mut [u8], capacity: u16, text: impl Iterator<Item = u8>) -> Option<()> {
    let room = bytes.get_mut(..=usize::from(capacity))?;
    room.iter_mut().zip(text.chain([0])).for_each(|(to, from)| *to = from);
    Some(())
}

fn store_wide_text(bytes: &mut [u8], capacity: u16, text: impl Iterator<Item = u8>) -> Option<()> {
    let room = bytes.get_mut(..2 * (usize::from(capacity) + 1))?;
    room.iter_mut().zip(text.chain([0, 0])).for_each(|(to, from)| *to = from);
    Some(())
}

fn load(bytes: &[u8], ty: ElementaryType) -> Option<Value> {
    let storage = ty.storage();
    bytes.get(..storage.bytes() as usize).map(|bytes| load_foreign_scalar(bytes, storage))
}

/// Stores a scalar at the start of `bytes`: into its one bit if the place is one.
fn store_at(bytes: &mut [u8], place: DebugPlace, ty: ElementaryType, value: Value) -> Option<()> {
    if let DebugPlace::Bit(_, _, bit) = place {
        let byte = bytes.first_mut()?;
        *byte = *byte & !(1 << (bit & 7)) | u8::from(value.bits() != 0) << (bit & 7);
        return Some(());
    }
    let storage = ty.storage();
    bytes.get_mut(..storage.bytes() as usize).map(|bytes| store_scalar(bytes, storage, value))
}

/// From a place to the end of its slot or region, as image offsets.
fn place_range(layout: &ImageLayout, place: DebugPlace) -> Option<Range<usize>> {
    let (region, offset) = match place {
        DebugPlace::Slot(slot) => {
            let start = layout.slots.start.checked_add(u32::from(slot.0).checked_mul(SLOT_BYTES)?)?;
            let end = start.checked_add(SLOT_BYTES).filter(|end| *end <= layout.slots.end)?;
            return Some(start as usize..end as usize);
        }
        DebugPlace::Bytes(place, offset) | DebugPlace::Bit(place, offset, _) => {
            let region = match place {
                BytePlace::Data => &layout.data,
                BytePlace::Memory => &layout.memory,
                BytePlace::Output => &layout.output,
                BytePlace::Input => &layout.input,
                BytePlace::Block | BytePlace::This | BytePlace::Frame => return None,
            };
            (region, offset)
        }
    };
    let start = region.start.checked_add(offset).filter(|start| *start < region.end)?;
    Some(start as usize..region.end as usize)
}

/// The bytes from a place to the end of its slot or region.
pub(crate) fn bytes_at(image: &Image, place: DebugPlace) -> Option<&[u8]> {
    image.bytes().get(place_range(image.layout(), place)?)
}
