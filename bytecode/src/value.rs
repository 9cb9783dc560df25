//! Types of values: on the operand stack, in memory, and of references.

use crate::ids::TypeId;

macro_rules! byte_enum {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $code:literal $text:literal),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum $name { $($(#[$vdoc])* $variant = $code),* }

        impl $name {
            /// Every one, in the order of its number.
            pub const ALL: &'static [$name] = &[$($name::$variant),*];

            /// The one with this number.
            #[must_use]
            pub fn from_code(code: u8) -> Option<$name> {
                match code { $($code => Some($name::$variant),)* _ => None }
            }

            /// Its name in assembly text.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $($name::$variant => $text),* }
            }

            /// The one with this name in assembly text.
            #[must_use]
            pub fn from_name(name: &str) -> Option<$name> {
                match name { $($text => Some($name::$variant),)* _ => None }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

byte_enum! {
    /// Type of a value on the operand stack that is not a reference.
    ValueType {
        /// 32 bits: BOOL (0 or 1), integers and bit strings up to 32 bits; narrow ones are kept extended as their type says.
        I32 = 0 "i32",
        /// 64 bits: LINT, ULINT, LWORD, and all times and dates in nanoseconds.
        I64 = 1 "i64",
        /// REAL.
        F32 = 2 "f32",
        /// LREAL.
        F64 = 3 "f64",
    }
}

byte_enum! {
    /// How a scalar lies in memory, and how it is extended when it is loaded.
    Storage {
        /// BOOL: one byte. A load yields byte <> 0, a store writes 0 or 1 (value <> 0).
        Bool = 0 "b1",
        /// SINT: one byte, sign-extended.
        I8 = 1 "i8",
        /// USINT, BYTE, CHAR: one byte, zero-extended.
        U8 = 2 "u8",
        /// INT: two bytes, sign-extended.
        I16 = 3 "i16",
        /// UINT, WORD: two bytes, zero-extended.
        U16 = 4 "u16",
        /// DINT, UDINT, DWORD: four bytes.
        I32 = 5 "i32",
        /// LINT, ULINT, LWORD, TIME, dates, references in memory: eight bytes.
        I64 = 6 "i64",
        /// REAL: four bytes.
        F32 = 7 "f32",
        /// LREAL: eight bytes.
        F64 = 8 "f64",
    }
}

impl Storage {
    /// Bytes in the data region, which are also its natural alignment. In a slot the value takes the low bytes.
    #[must_use]
    pub fn bytes(self) -> u32 {
        match self {
            Storage::Bool | Storage::I8 | Storage::U8 => 1,
            Storage::I16 | Storage::U16 => 2,
            Storage::I32 | Storage::F32 => 4,
            Storage::I64 | Storage::F64 => 8,
        }
    }

    /// Type of the value on the operand stack after a load.
    #[must_use]
    pub fn value_type(self) -> ValueType {
        match self {
            Storage::I64 => ValueType::I64,
            Storage::F32 => ValueType::F32,
            Storage::F64 => ValueType::F64,
            _ => ValueType::I32,
        }
    }

    /// Whether it holds a floating-point number.
    #[must_use]
    pub fn is_float(self) -> bool {
        matches!(self, Storage::F32 | Storage::F64)
    }
}

byte_enum! {
    /// Width and signedness of the control variable of a FOR loop and of range checks.
    IntegerType {
        /// SINT.
        I8 = 0 "i8",
        /// USINT, BYTE.
        U8 = 1 "u8",
        /// INT.
        I16 = 2 "i16",
        /// UINT, WORD.
        U16 = 3 "u16",
        /// DINT.
        I32 = 4 "i32",
        /// UDINT, DWORD.
        U32 = 5 "u32",
        /// LINT, TIME.
        I64 = 6 "i64",
        /// ULINT, LWORD.
        U64 = 7 "u64",
    }
}

impl IntegerType {
    /// Type on the operand stack.
    #[must_use]
    pub fn value_type(self) -> ValueType {
        match self {
            IntegerType::I64 | IntegerType::U64 => ValueType::I64,
            _ => ValueType::I32,
        }
    }

    /// How a variable of this type lies in memory.
    #[must_use]
    pub fn storage(self) -> Storage {
        match self {
            IntegerType::I8 => Storage::I8,
            IntegerType::U8 => Storage::U8,
            IntegerType::I16 => Storage::I16,
            IntegerType::U16 => Storage::U16,
            IntegerType::I32 | IntegerType::U32 => Storage::I32,
            IntegerType::I64 | IntegerType::U64 => Storage::I64,
        }
    }

    /// Whether order and division are those of signed numbers.
    #[must_use]
    pub fn is_signed(self) -> bool {
        matches!(self, IntegerType::I8 | IntegerType::I16 | IntegerType::I32 | IntegerType::I64)
    }
}

byte_enum! {
    /// Which file of slots.
    SlotPlace {
        /// Shared globals, absolute.
        Global = 0 "g",
        /// The program instance's own slots, relative to its `var_table_offset`.
        Program = 1 "p",
        /// The call's own slots: parameters, locals, VAR_TEMP, results. Zero at entry, fresh at each call.
        Local = 2 "l",
    }
}

byte_enum! {
    /// Which byte-addressed memory, for accesses whose offset is known.
    BytePlace {
        /// Data region, absolute (offset from the region's start; the first 16 bytes are never allocated).
        Data = 0 "d",
        /// The program instance's own data block (`PROGRAM` only).
        Block = 1 "b",
        /// The instance that a function block body or method was called on.
        This = 2 "t",
        /// The call's own frame bytes: zero at entry, fresh at each call.
        Frame = 3 "f",
        /// %M.
        Memory = 4 "m",
        /// %Q staging.
        Output = 5 "q",
        /// %I snapshot; never written by a program.
        Input = 6 "i",
    }
}

impl BytePlace {
    /// %I, %Q and %M: bytes without declared types, where accesses may overlap and foreign values may stand.
    #[must_use]
    pub fn is_image(self) -> bool {
        matches!(self, BytePlace::Memory | BytePlace::Output | BytePlace::Input)
    }
}

/// Type of a reference on the operand stack, in a parameter or in a local: what it points to and what may be done there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RefType {
    /// Type of what it points to; the whole extent of that type lies inside the image.
    pub target: TypeId,
    /// Whether writes through it are allowed (never for %I).
    pub write: bool,
    /// Whether it may point into %I, %Q or %M, where a float may be any NaN: loads through it canonicalise.
    pub image: bool,
}

impl RefType {
    /// Whether a reference of this type can stand where `wanted` is asked for (same target; rights may only shrink).
    #[must_use]
    pub fn fits(self, wanted: RefType) -> bool {
        self.target == wanted.target && (self.write || !wanted.write) && (!self.image || wanted.image)
    }
}

/// Type of an `L` slot or of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LocalType {
    /// A scalar; stores wrap to its width, loads extend.
    Scalar(Storage),
    /// A reference; assigned on every path before its use.
    Ref(RefType),
}

/// Type of one entry of the operand stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum StackType {
    /// A number or BOOL.
    Value(ValueType),
    /// A verified reference.
    Ref(RefType),
}

impl LocalType {
    /// Type on the operand stack after a load.
    #[must_use]
    pub fn stack_type(self) -> StackType {
        match self {
            LocalType::Scalar(storage) => StackType::Value(storage.value_type()),
            LocalType::Ref(reference) => StackType::Ref(reference),
        }
    }
}

impl std::fmt::Display for StackType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            StackType::Value(value) => value.fmt(f),
            StackType::Ref(reference) => reference.fmt(f),
        }
    }
}

impl std::fmt::Display for RefType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "ref{}{}(type {})",
            if self.write { "" } else { ".read" },
            if self.image { ".image" } else { "" },
            self.target
        )
    }
}
