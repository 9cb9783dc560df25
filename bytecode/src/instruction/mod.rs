//! Instructions: the enums, their encoding and decoding, all derived from [`table`].
//!
//! On the wire an instruction is its opcode (u16, little-endian) and its immediates in the order of its row.

pub mod table;

mod immediate;

pub use immediate::{DecodeError, Immediate, Reader, kind};

use crate::container::Type;
use crate::trap::TrapCode;
use crate::value::ValueType;

/// Most string operands of one helper.
pub const MAX_CAPACITIES: usize = 3;

/// What a helper instruction takes from the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HelperOperand {
    /// A writable reference to a `STRING`.
    Dst,
    /// A readable reference to a `STRING`.
    Src,
    /// A writable reference to a `WSTRING`.
    WideDst,
    /// A readable reference to a `WSTRING`.
    WideSrc,
    /// A value.
    Value(ValueType),
}

impl HelperOperand {
    /// Whether it is a string, so that it brings a capacity.
    #[must_use]
    pub fn is_string(self) -> bool {
        !matches!(self, HelperOperand::Value(_))
    }

    /// Whether it is a string that the row writes.
    #[must_use]
    pub fn is_destination(self) -> bool {
        matches!(self, HelperOperand::Dst | HelperOperand::WideDst)
    }

    /// Whether it is a `WSTRING`.
    #[must_use]
    pub fn is_wide(self) -> bool {
        matches!(self, HelperOperand::WideDst | HelperOperand::WideSrc)
    }

    /// Bytes of one character of a string operand; 0 for values.
    #[must_use]
    pub fn unit_bytes(self) -> u32 {
        match self {
            HelperOperand::Dst | HelperOperand::Src => 1,
            HelperOperand::WideDst | HelperOperand::WideSrc => 2,
            HelperOperand::Value(_) => 0,
        }
    }

    /// The string type that it takes, of this capacity; `None` for values.
    #[must_use]
    pub fn string_type(self, capacity: u16) -> Option<Type> {
        match self.unit_bytes() {
            0 => None,
            1 => Some(Type::String { capacity }),
            _ => Some(Type::WideString { capacity }),
        }
    }
}

macro_rules! numeric_traps {
    (total) => {
        None
    };
    (divide) => {
        Some(TrapCode::DivideByZero)
    };
}

macro_rules! define_numeric {
    ($(($code:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $traps:ident, $cost:literal, $doc:literal)),* $(,)?) => {
        /// An instruction that computes a value from values (rows of [`for_each_numeric!`](crate::for_each_numeric)).
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u16)]
        pub enum NumericOp { $(#[doc = $doc] $variant = $code),* }

        impl NumericOp {
            /// Every one, in the order of its opcode.
            pub const ALL: &'static [NumericOp] = &[$(NumericOp::$variant),*];

            /// Its name in assembly text.
            #[must_use]
            pub fn mnemonic(self) -> &'static str { match self { $(NumericOp::$variant => $mnemonic),* } }

            /// Types of its operands, first pushed first.
            #[must_use]
            pub fn operands(self) -> &'static [ValueType] { match self { $(NumericOp::$variant => &[$(ValueType::$operand),*]),* } }

            /// Type of its result.
            #[must_use]
            pub fn result(self) -> ValueType { match self { $(NumericOp::$variant => ValueType::$result),* } }

            /// The trap it may end in.
            #[must_use]
            pub fn trap(self) -> Option<TrapCode> { match self { $(NumericOp::$variant => numeric_traps!($traps)),* } }

            /// Fuel units.
            #[must_use]
            pub fn cost(self) -> u32 { match self { $(NumericOp::$variant => $cost),* } }

            /// What it computes.
            #[must_use]
            pub fn meaning(self) -> &'static str { match self { $(NumericOp::$variant => $doc),* } }

            fn from_opcode(opcode: u16) -> Option<NumericOp> { match opcode { $($code => Some(NumericOp::$variant),)* _ => None } }
        }
    };
}
crate::for_each_numeric!(define_numeric);

macro_rules! helper_operand {
    (Dst) => {
        HelperOperand::Dst
    };
    (Src) => {
        HelperOperand::Src
    };
    (WideDst) => {
        HelperOperand::WideDst
    };
    (WideSrc) => {
        HelperOperand::WideSrc
    };
    ($value:ident) => {
        HelperOperand::Value(ValueType::$value)
    };
}
macro_rules! helper_result {
    (Nothing) => {
        None
    };
    ($value:ident) => {
        Some(ValueType::$value)
    };
}

macro_rules! define_helper {
    ($(($code:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $cost:literal, $doc:literal)),* $(,)?) => {
        /// An instruction that works on strings in memory (rows of [`for_each_helper!`](crate::for_each_helper)).
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u16)]
        pub enum HelperOp { $(#[doc = $doc] $variant = $code),* }

        impl HelperOp {
            /// Every one, in the order of its opcode.
            pub const ALL: &'static [HelperOp] = &[$(HelperOp::$variant),*];

            /// Its name in assembly text.
            #[must_use]
            pub fn mnemonic(self) -> &'static str { match self { $(HelperOp::$variant => $mnemonic),* } }

            /// Its operands, first pushed first.
            #[must_use]
            pub fn operands(self) -> &'static [HelperOperand] { match self { $(HelperOp::$variant => &[$(helper_operand!($operand)),*]),* } }

            /// Type of its result, if it has one.
            #[must_use]
            pub fn result(self) -> Option<ValueType> { match self { $(HelperOp::$variant => helper_result!($result)),* } }

            /// Fuel units, without those for the bytes it may touch.
            #[must_use]
            pub fn base_cost(self) -> u32 { match self { $(HelperOp::$variant => $cost),* } }

            /// What it does.
            #[must_use]
            pub fn meaning(self) -> &'static str { match self { $(HelperOp::$variant => $doc),* } }

            /// How many string operands it has: so many capacities follow the opcode.
            #[must_use]
            pub fn capacity_count(self) -> usize { self.operands().iter().filter(|o| o.is_string()).count() }

            fn from_opcode(opcode: u16) -> Option<HelperOp> { match opcode { $($code => Some(HelperOp::$variant),)* _ => None } }
        }
    };
}
crate::for_each_helper!(define_helper);

macro_rules! define_instruction {
    ($(($code:literal, $variant:ident, $function:ident, $mnemonic:literal, { $($field:ident: $kind:ident),* }, $stack:literal, [$($trap:ident)*], $cost:literal, $doc:literal)),* $(,)?) => {
        /// One instruction with its immediates.
        #[derive(Debug, Clone, PartialEq, Eq)]
        pub enum Instruction {
            $(#[doc = $doc] $variant { $(#[doc = concat!("Immediate of kind ", stringify!($kind), ".")] $field: kind::$kind),* },)*
            /// Computes a value from values.
            Numeric(NumericOp),
            /// Works on strings in memory; one capacity for each string operand, the rest is 0.
            Helper(HelperOp, [u16; MAX_CAPACITIES]),
        }

        /// Control and memory instructions without their immediates: the key of their table rows.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u16)]
        pub enum ControlOp { $(#[doc = $doc] $variant = $code),* }

        impl ControlOp {
            /// Every one, in the order of its opcode.
            pub const ALL: &'static [ControlOp] = &[$(ControlOp::$variant),*];

            /// Its name in assembly text.
            #[must_use]
            pub fn mnemonic(self) -> &'static str { match self { $(ControlOp::$variant => $mnemonic),* } }

            /// Names and kinds of its immediates, in wire order.
            #[must_use]
            pub fn immediates(self) -> &'static [(&'static str, &'static str)] {
                match self { $(ControlOp::$variant => &[$((stringify!($field), stringify!($kind))),*]),* }
            }

            /// Its effect on the operand stack, for documents.
            #[must_use]
            pub fn stack_effect(self) -> &'static str { match self { $(ControlOp::$variant => $stack),* } }

            /// The traps it may end in, beside those of what it calls.
            #[must_use]
            pub fn traps(self) -> &'static [TrapCode] { match self { $(ControlOp::$variant => &[$(TrapCode::$trap),*]),* } }

            /// Fuel units, without those for the bytes it may touch.
            #[must_use]
            pub fn base_cost(self) -> u32 { match self { $(ControlOp::$variant => $cost),* } }

            /// What it does.
            #[must_use]
            pub fn meaning(self) -> &'static str { match self { $(ControlOp::$variant => $doc),* } }
        }

        impl Instruction {
            /// Its opcode on the wire.
            #[must_use]
            pub fn opcode(&self) -> u16 {
                match self {
                    $(Instruction::$variant { .. } => $code,)*
                    Instruction::Numeric(op) => *op as u16,
                    Instruction::Helper(op, _) => *op as u16,
                }
            }

            /// Its name in assembly text.
            #[must_use]
            pub fn mnemonic(&self) -> &'static str {
                match self {
                    $(Instruction::$variant { .. } => $mnemonic,)*
                    Instruction::Numeric(op) => op.mnemonic(),
                    Instruction::Helper(op, _) => op.mnemonic(),
                }
            }

            /// The row of a control or memory instruction; none for numeric instructions and helpers.
            #[must_use]
            pub fn control_op(&self) -> Option<ControlOp> {
                match self {
                    $(Instruction::$variant { .. } => Some(ControlOp::$variant),)*
                    Instruction::Numeric(_) | Instruction::Helper(..) => None,
                }
            }

            /// Appends its wire form.
            pub fn encode(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.opcode().to_le_bytes());
                match self {
                    $(Instruction::$variant { $($field),* } => { $($field.encode(out);)* })*
                    Instruction::Numeric(_) => {}
                    Instruction::Helper(op, capacities) => {
                        for capacity in &capacities[..op.capacity_count()] {
                            capacity.encode(out);
                        }
                    }
                }
            }

            /// Reads one instruction; `reader` stands behind it afterwards.
            ///
            /// # Errors
            /// An unknown opcode, an immediate that is no value of its kind, or code that ends in the middle.
            pub fn decode(reader: &mut Reader<'_>) -> Result<Instruction, DecodeError> {
                let at = reader.position();
                let opcode = u16::decode(reader)?;
                match opcode {
                    $($code => Ok(Instruction::$variant { $($field: <kind::$kind as Immediate>::decode(reader)?),* }),)*
                    _ => Self::decode_plain(opcode, at, reader),
                }
            }

            /// Writes its immediates as assembly text, each after a space.
            pub(crate) fn write_immediates(&self, out: &mut String) {
                match self {
                    $(Instruction::$variant { $($field),* } => { $(out.push(' '); $field.write_text(out);)* })*
                    Instruction::Numeric(_) => {}
                    Instruction::Helper(op, capacities) => {
                        for capacity in &capacities[..op.capacity_count()] {
                            out.push(' ');
                            capacity.write_text(out);
                        }
                    }
                }
            }

            /// Reads an instruction back from its mnemonic and the words of its immediates.
            ///
            /// # Errors
            /// The reason in words: an unknown mnemonic, too few or too many words, or a word that is no value of its kind.
            pub fn from_words(mnemonic: &str, words: &mut dyn Iterator<Item = &str>) -> Result<Instruction, String> {
                let instruction = match mnemonic {
                    $($mnemonic => Instruction::$variant { $($field: <kind::$kind as Immediate>::read_text(stringify!($field), words)?),* },)*
                    _ => Self::plain_from_words(mnemonic, words)?,
                };
                words.next().map_or(Ok(instruction), |word| Err(format!("`{word}` is one word too many after `{mnemonic}`")))
            }
        }
    };
}
crate::for_each_control!(define_instruction);

impl Instruction {
    fn decode_plain(opcode: u16, at: usize, reader: &mut Reader<'_>) -> Result<Instruction, DecodeError> {
        if let Some(op) = NumericOp::from_opcode(opcode) {
            return Ok(Instruction::Numeric(op));
        }
        let op = HelperOp::from_opcode(opcode).ok_or(DecodeError { at, reason: "unknown opcode" })?;
        let mut capacities = [0; MAX_CAPACITIES];
        for capacity in capacities.iter_mut().take(op.capacity_count()) {
            *capacity = u16::decode(reader)?;
        }
        Ok(Instruction::Helper(op, capacities))
    }

    fn plain_from_words(mnemonic: &str, words: &mut dyn Iterator<Item = &str>) -> Result<Instruction, String> {
        if let Some(op) = NumericOp::ALL.iter().find(|op| op.mnemonic() == mnemonic) {
            return Ok(Instruction::Numeric(*op));
        }
        let op = HelperOp::ALL.iter().find(|op| op.mnemonic() == mnemonic);
        let op = *op.ok_or_else(|| format!("unknown instruction `{mnemonic}`"))?;
        let mut capacities = [0; MAX_CAPACITIES];
        for capacity in capacities.iter_mut().take(op.capacity_count()) {
            *capacity = u16::read_text("capacity", words)?;
        }
        Ok(Instruction::Helper(op, capacities))
    }

    /// Targets that it may jump to, in order; empty for instructions that only fall through or end.
    #[must_use]
    pub fn targets(&self) -> Vec<crate::ids::Label> {
        match self {
            Instruction::Jump { target } | Instruction::JumpIf { target } | Instruction::JumpUnless { target } => {
                vec![*target]
            }
            Instruction::Switch { targets } => targets.clone(),
            Instruction::ForEnter { exit, .. } => vec![*exit],
            Instruction::ForNext { header, .. } => vec![*header],
            _ => Vec::new(),
        }
    }

    /// Whether execution may go on at the instruction behind it.
    #[must_use]
    pub fn falls_through(&self) -> bool {
        !matches!(self, Instruction::Jump { .. } | Instruction::Switch { .. } | Instruction::Return {})
    }

    /// Fuel units. `copied_bytes` is the extent of the type for `copy` (0 for others): moves cost 1 more for each 16 bytes.
    #[must_use]
    pub fn cost(&self, copied_bytes: u32) -> u32 {
        match self {
            Instruction::Numeric(op) => op.cost(),
            Instruction::Helper(op, capacities) => {
                let strings = op.operands().iter().filter(|operand| operand.is_string());
                let bytes: u32 = strings.zip(capacities).map(|(string, c)| string.unit_bytes() * u32::from(*c)).sum();
                op.base_cost() + bytes.div_ceil(16)
            }
            other => other.control_op().map_or(0, ControlOp::base_cost).saturating_add(copied_bytes.div_ceil(16)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn opcodes() -> Vec<u16> {
        let control = ControlOp::ALL.iter().map(|op| *op as u16);
        let numeric = NumericOp::ALL.iter().map(|op| *op as u16);
        control.chain(numeric).chain(HelperOp::ALL.iter().map(|op| *op as u16)).collect()
    }

    #[test]
    fn opcodes_and_mnemonics_are_unique() {
        let codes = opcodes();
        assert_eq!(codes.iter().collect::<BTreeSet<_>>().len(), codes.len());
        let names: Vec<_> = (ControlOp::ALL.iter().map(|op| op.mnemonic()))
            .chain(NumericOp::ALL.iter().map(|op| op.mnemonic()))
            .chain(HelperOp::ALL.iter().map(|op| op.mnemonic()))
            .collect();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
    }

    #[test]
    fn helpers_have_at_most_three_strings() {
        for op in HelperOp::ALL {
            assert!(op.capacity_count() <= MAX_CAPACITIES, "{op:?}");
        }
    }

    #[test]
    fn every_row_round_trips_through_bytes_and_text() {
        for opcode in opcodes() {
            let mut bytes = opcode.to_le_bytes().to_vec();
            bytes.extend_from_slice(&[1, 0, 0, 0].repeat(8));
            let mut reader = Reader::new(&bytes);
            let instruction = Instruction::decode(&mut reader).unwrap();
            let used = reader.position();
            let mut again = Vec::new();
            instruction.encode(&mut again);
            assert_eq!(again, bytes[..used], "{instruction:?}");
            let mut text = instruction.mnemonic().to_string();
            instruction.write_immediates(&mut text);
            let mut words = text.split_whitespace();
            let mnemonic = words.next().unwrap();
            assert_eq!(Instruction::from_words(mnemonic, &mut words).unwrap(), instruction, "{text}");
        }
    }

    #[test]
    fn decoding_garbage_names_the_place() {
        let mut reader = Reader::new(&[0xFF, 0xFF]);
        assert_eq!(Instruction::decode(&mut reader).unwrap_err().reason, "unknown opcode");
        let mut reader = Reader::new(&[0x01]);
        assert!(Instruction::decode(&mut reader).is_err());
    }
}
