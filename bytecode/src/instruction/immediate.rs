//! Immediates: the operands that stand in the code itself, each kind with its wire form and its text form.

use crate::ids::{ArrayId, ConstantId, ForId, FunctionId, Label, MethodId, SlotIndex, TypeId};
use crate::limits::MAX_SWITCH_TARGETS;
use crate::value::{BytePlace, IntegerType, SlotPlace, Storage};

/// Rust types of the immediate kinds that table rows name.
pub mod kind {
    use super::{
        ArrayId, BytePlace as BytePlaceValue, ConstantId, ForId, FunctionId, IntegerType, Label as LabelValue,
        MethodId, SlotIndex, SlotPlace as SlotPlaceValue, Storage as StorageValue, TypeId,
    };

    /// A 32-bit number.
    pub type I32 = i32;
    /// A 64-bit number.
    pub type I64 = i64;
    /// A constant of the pool.
    pub type Constant = ConstantId;
    /// A file of slots.
    pub type SlotPlace = SlotPlaceValue;
    /// A slot.
    pub type Slot = SlotIndex;
    /// A byte-addressed place.
    pub type BytePlace = BytePlaceValue;
    /// A scalar's form in memory.
    pub type Storage = StorageValue;
    /// A byte offset inside a place.
    pub type Offset = u32;
    /// A bit of a byte, 0 to 7.
    pub type Bit = u8;
    /// A type of the type section.
    pub type Type = TypeId;
    /// Position of a field in its structure.
    pub type Field = u16;
    /// An array descriptor.
    pub type Array = ArrayId;
    /// Yes (1) or no (0).
    pub type Flag = bool;
    /// Width and sign.
    pub type Integer = IntegerType;
    /// A jump target.
    pub type Label = LabelValue;
    /// Jump targets; the last is the default.
    pub type Labels = Vec<LabelValue>;
    /// A FOR descriptor of the function.
    pub type For = ForId;
    /// A function.
    pub type Function = FunctionId;
    /// A method name.
    pub type Method = MethodId;
}

/// Why bytes are no instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{reason} at byte {at}")]
pub struct DecodeError {
    /// Byte offset inside the code that was read.
    pub at: usize,
    /// What is wrong.
    pub reason: &'static str,
}

/// A bounds-checked cursor over code bytes.
#[derive(Debug, Clone)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl<'a> Reader<'a> {
    /// A cursor at the start of `bytes`.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Reader { bytes, position: 0 }
    }

    /// Bytes read so far.
    #[must_use]
    pub fn position(&self) -> usize {
        self.position
    }

    /// Whether everything was read.
    #[must_use]
    pub fn is_at_end(&self) -> bool {
        self.position >= self.bytes.len()
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let error = DecodeError { at: self.position, reason: "the code ends inside an instruction" };
        let rest = self.bytes.get(self.position..).ok_or(error)?;
        let taken = rest.first_chunk::<N>().ok_or(error)?;
        self.position += N;
        Ok(*taken)
    }

    fn error(&self, reason: &'static str) -> DecodeError {
        DecodeError { at: self.position, reason }
    }
}

/// An operand that stands in the code.
pub trait Immediate: Sized {
    /// Appends the wire form.
    fn encode(&self, out: &mut Vec<u8>);

    /// Reads the wire form.
    ///
    /// # Errors
    /// Bytes that are no value of this kind, or too few.
    fn decode(reader: &mut Reader<'_>) -> Result<Self, DecodeError>;

    /// Appends the text form: one word, or for lists several.
    fn write_text(&self, out: &mut String);

    /// Reads the text form; `name` is the field's name for messages.
    ///
    /// # Errors
    /// A missing word, or one that is no value of this kind.
    fn read_text(name: &str, words: &mut dyn Iterator<Item = &str>) -> Result<Self, String>;
}

fn word<'w>(name: &str, words: &mut dyn Iterator<Item = &'w str>) -> Result<&'w str, String> {
    words.next().ok_or_else(|| format!("`{name}` is missing"))
}

macro_rules! number_immediate {
    ($($type:ty),*) => { $(
        impl Immediate for $type {
            fn encode(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            fn decode(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
                reader.take().map(<$type>::from_le_bytes)
            }

            fn write_text(&self, out: &mut String) {
                out.push_str(&self.to_string());
            }

            fn read_text(name: &str, words: &mut dyn Iterator<Item = &str>) -> Result<Self, String> {
                let word = word(name, words)?;
                word.parse().map_err(|_| format!("`{name}` can not be `{word}`"))
            }
        }
    )* };
}
number_immediate!(u8, u16, u32, i32, i64);

macro_rules! id_immediate {
    ($($type:ident($raw:ty)),*) => { $(
        impl Immediate for $type {
            fn encode(&self, out: &mut Vec<u8>) {
                self.0.encode(out);
            }

            fn decode(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
                <$raw>::decode(reader).map($type)
            }

            fn write_text(&self, out: &mut String) {
                self.0.write_text(out);
            }

            fn read_text(name: &str, words: &mut dyn Iterator<Item = &str>) -> Result<Self, String> {
                <$raw>::read_text(name, words).map($type)
            }
        }
    )* };
}
id_immediate!(
    ConstantId(u16),
    SlotIndex(u16),
    TypeId(u16),
    ArrayId(u16),
    ForId(u16),
    FunctionId(u16),
    MethodId(u16),
    Label(u32)
);

macro_rules! enum_immediate {
    ($($type:ident $reason:literal),*) => { $(
        impl Immediate for $type {
            fn encode(&self, out: &mut Vec<u8>) {
                out.push(*self as u8);
            }

            fn decode(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
                let error = reader.error($reason);
                $type::from_code(u8::decode(reader)?).ok_or(error)
            }

            fn write_text(&self, out: &mut String) {
                out.push_str(self.name());
            }

            fn read_text(name: &str, words: &mut dyn Iterator<Item = &str>) -> Result<Self, String> {
                let word = word(name, words)?;
                $type::from_name(word).ok_or_else(|| format!("`{name}` can not be `{word}`"))
            }
        }
    )* };
}
enum_immediate!(SlotPlace "unknown slot place", BytePlace "unknown byte place", Storage "unknown storage", IntegerType "unknown integer type");

impl Immediate for bool {
    fn encode(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }

    fn decode(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let error = reader.error("a flag that is neither 0 nor 1");
        match u8::decode(reader)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(error),
        }
    }

    fn write_text(&self, out: &mut String) {
        out.push(if *self { '1' } else { '0' });
    }

    fn read_text(name: &str, words: &mut dyn Iterator<Item = &str>) -> Result<Self, String> {
        match word(name, words)? {
            "0" => Ok(false),
            "1" => Ok(true),
            other => Err(format!("`{name}` is 0 or 1, not `{other}`")),
        }
    }
}

impl Immediate for Vec<Label> {
    fn encode(&self, out: &mut Vec<u8>) {
        // The front end keeps to MAX_SWITCH_TARGETS; a longer list would be refused when it is read.
        u32::try_from(self.len()).unwrap_or(u32::MAX).encode(out);
        for label in self {
            label.encode(out);
        }
    }

    fn decode(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let error = reader.error("too many switch targets, or none");
        let count = u32::decode(reader)?;
        if count == 0 || count > MAX_SWITCH_TARGETS {
            return Err(error);
        }
        // Each label takes four bytes of code, so the list can not outgrow the file.
        (0..count).map(|_| Label::decode(reader)).collect()
    }

    fn write_text(&self, out: &mut String) {
        let words: Vec<String> = self.iter().map(|label| label.0.to_string()).collect();
        out.push_str(&words.join(" "));
    }

    fn read_text(name: &str, words: &mut dyn Iterator<Item = &str>) -> Result<Self, String> {
        words.map(|word| word.parse().map(Label).map_err(|_| format!("`{name}` can not hold `{word}`"))).collect()
    }
}
