//! Types as the checker sees them: small copyable handles, with the user's definitions in a table.
//!
//! Arrays and subranges are interned, so that two spellings of one type are one type. Aliases vanish: a name stands for
//! what it names. Sizes are computed when a type is defined, so that a type too large for any image is reported where it is declared.

use std::collections::BTreeMap;
use std::rc::Rc;

use khz_bytecode::container::ElementaryType;
use khz_bytecode::value::{IntegerType, Storage};

use super::tree::PouId;
use crate::syntax::symbol::Symbol;

/// A type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Ty {
    /// Something was wrong and has been reported; it fits everywhere.
    Error,
    /// No value.
    Void,
    /// An integer literal that has found no type yet; its constant is [`Const::Wide`].
    IntLit,
    /// A floating-point literal that has found no type yet.
    RealLit,
    /// An elementary type.
    Elem(ElementaryType),
    /// `STRING[n]`.
    Str(u16),
    /// `WSTRING[n]`.
    WStr(u16),
    /// A defined type.
    User(TyId),
}

impl Ty {
    /// Characters that a STRING or WSTRING of the type holds; `None` for other types.
    pub fn capacity(self) -> Option<u16> {
        match self {
            Ty::Str(capacity) | Ty::WStr(capacity) => Some(capacity),
            _ => None,
        }
    }

    /// Whether it is a STRING or WSTRING.
    pub fn is_text(self) -> bool {
        self.capacity().is_some()
    }

    /// Whether it is a WSTRING.
    pub fn is_wide_text(self) -> bool {
        matches!(self, Ty::WStr(_))
    }

    /// A STRING or WSTRING of a capacity.
    pub fn text(wide: bool, capacity: u16) -> Ty {
        if wide { Ty::WStr(capacity) } else { Ty::Str(capacity) }
    }

    /// The type of a STRING's or WSTRING's characters.
    pub fn character(self) -> Option<ElementaryType> {
        self.is_text().then_some(if self.is_wide_text() { ElementaryType::Wchar } else { ElementaryType::Char })
    }
}

/// Position in [`TypeTable::defs`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TyId(pub u32);

/// BOOL.
pub const BOOL: Ty = Ty::Elem(ElementaryType::Bool);
/// INT.
pub const INT: Ty = Ty::Elem(ElementaryType::Int);
/// DINT.
pub const DINT: Ty = Ty::Elem(ElementaryType::Dint);
/// Length of a STRING without one.
pub const DEFAULT_STRING_LENGTH: u16 = 80;

/// A constant.
#[derive(Debug, Clone, PartialEq)]
pub enum Const {
    /// Of a BOOL, integer, bit string, character, duration or enumeration: extended to 64 bits as its type says (ULINT, LWORD: the bits).
    Int(i64),
    /// Of an integer literal without a type.
    Wide(i128),
    /// Of a REAL.
    F32(f32),
    /// Of an LREAL.
    F64(f64),
    /// Of a floating-point literal without a type: computed in both widths.
    Lit(f64, f32),
    /// Of a STRING.
    Str(Rc<[u8]>),
    /// Of a WSTRING: UTF-16 code units.
    WStr(Rc<[u16]>),
}

/// An initial value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// All bytes zero.
    Zero,
    /// A scalar or string.
    Scalar(Const),
    /// Runs of equal elements, all elements of the array.
    Array(Rc<[(u32, Value)]>),
    /// Fields by position; the others are zero.
    Record(Rc<[(u32, Value)]>),
}

impl Value {
    /// Whether every byte is zero.
    pub fn is_zero(&self) -> bool {
        match self {
            Value::Zero => true,
            Value::Scalar(Const::Int(0)) => true,
            Value::Scalar(Const::F32(value)) => value.to_bits() == 0,
            Value::Scalar(Const::F64(value)) => value.to_bits() == 0,
            Value::Scalar(Const::Str(bytes)) => bytes.is_empty(),
            Value::Scalar(Const::WStr(units)) => units.is_empty(),
            Value::Scalar(_) => false,
            Value::Array(runs) => runs.iter().all(|(_, value)| value.is_zero()),
            Value::Record(fields) => fields.iter().all(|(_, value)| value.is_zero()),
        }
    }
}

/// What a defined type is.
#[derive(Debug, Clone)]
pub enum TyKind {
    /// An enumeration: its values over a base type.
    Enum {
        /// Integer type of its values.
        base: ElementaryType,
        /// Whether the base type was written.
        has_base: bool,
        /// Folded name, spelling, value.
        values: Rc<[(Symbol, String, i64)]>,
    },
    /// A part of an integer type.
    Subrange {
        /// The integer type.
        base: ElementaryType,
        /// Lowest value.
        low: i64,
        /// Highest value.
        high: i64,
    },
    /// An array.
    Array {
        /// Type of an element.
        element: Ty,
        /// Bounds of each dimension.
        dims: Rc<[(i32, i32)]>,
    },
    /// A parameter's array whose bounds come with the argument; each such parameter has a type of its own.
    Open {
        /// Type of an element.
        element: Ty,
        /// Number of dimensions.
        dims: usize,
    },
    /// A structure.
    Struct {
        /// Its fields.
        fields: Rc<[FieldDef]>,
    },
    /// A union: fields that all begin at offset 0.
    Union {
        /// Its fields.
        fields: Rc<[FieldDef]>,
    },
    /// A function block: its stored variables.
    Block {
        /// The function block.
        pou: PouId,
        /// Its fields, in the order of declaration.
        fields: Rc<[FieldDef]>,
    },
}

/// A field of a structure or function block.
#[derive(Debug, Clone)]
pub struct FieldDef {
    /// Folded name.
    pub symbol: Symbol,
    /// Name as declared.
    pub name: String,
    /// Its type.
    pub ty: Ty,
    /// Offset in bytes.
    pub offset: u32,
    /// Initial value.
    pub init: Value,
}

/// A defined type.
#[derive(Debug, Clone)]
pub struct TyDef {
    /// Its name, or how messages call it.
    pub name: String,
    /// What it is.
    pub kind: TyKind,
    /// Bytes.
    pub size: u32,
    /// Alignment in bytes.
    pub align: u32,
    /// Initial value of a variable without one.
    pub default: Value,
    /// How deep types nest in it.
    pub depth: u32,
    /// How many ways a lookup in it may have to try: 1 without unions (verifier rule V0011).
    pub alternatives: u32,
}

/// Lower and upper bound of each dimension.
pub type Bounds = Rc<[(i32, i32)]>;

/// All defined types.
#[derive(Debug, Default)]
pub struct TypeTable {
    /// The definitions, in order: a definition refers only to ones before it.
    pub defs: Vec<TyDef>,
    arrays: BTreeMap<(Ty, Bounds), TyId>,
    subranges: BTreeMap<(ElementaryType, i64, i64), TyId>,
}

impl TypeTable {
    /// The definition of an id.
    pub fn def(&self, id: TyId) -> &TyDef {
        &self.defs[id.0 as usize]
    }

    /// What a defined type is.
    pub fn kind(&self, ty: Ty) -> Option<&TyKind> {
        match ty {
            Ty::User(id) => Some(&self.def(id).kind),
            _ => None,
        }
    }

    /// Adds a definition.
    pub fn add(&mut self, def: TyDef) -> TyId {
        let id = TyId(u32::try_from(self.defs.len()).unwrap_or(u32::MAX));
        self.defs.push(def);
        id
    }

    /// The array type of these bounds; `None` when it is larger than any image may be.
    pub fn array(&mut self, element: Ty, dims: &[(i32, i32)], limit: u64) -> Option<TyId> {
        let dims: Rc<[(i32, i32)]> = dims.into();
        if let Some(&id) = self.arrays.get(&(element, dims.clone())) {
            return Some(id);
        }
        let mut count: u64 = 1;
        for (low, high) in dims.iter() {
            count = count.checked_mul(u64::try_from(i64::from(*high) - i64::from(*low) + 1).ok()?)?;
        }
        let (size, align) = self.extent(element);
        let bytes = count.checked_mul(u64::from(size)).filter(|bytes| *bytes <= limit)?;
        let default = self.default(element);
        let default = if default.is_zero() {
            Value::Zero
        } else {
            Value::Array(Rc::new([(u32::try_from(count).ok()?, default)]))
        };
        let bounds: Vec<String> = dims.iter().map(|(low, high)| format!("{low}..{high}")).collect();
        let name = format!("ARRAY[{}] OF {}", bounds.join(", "), self.name(element));
        let (depth, alternatives) = (self.depth(element) + 1, self.alternatives(element));
        let kind = TyKind::Array { element, dims: dims.clone() };
        let size = u32::try_from(bytes).ok()?;
        let id = self.add(TyDef { name, kind, size, align, default, depth, alternatives });
        self.arrays.insert((element, dims), id);
        Some(id)
    }

    /// The subrange type of these bounds.
    pub fn subrange(&mut self, base: ElementaryType, low: i64, high: i64) -> TyId {
        if let Some(&id) = self.subranges.get(&(base, low, high)) {
            return id;
        }
        let bytes = base.storage().bytes();
        let name = if is_signed(base) {
            format!("{} ({low}..{high})", base.name())
        } else {
            format!("{} ({}..{})", base.name(), low.cast_unsigned(), high.cast_unsigned())
        };
        let default = Value::Scalar(Const::Int(low));
        let kind = TyKind::Subrange { base, low, high };
        let id = self.add(TyDef { name, kind, size: bytes, align: bytes, default, depth: 1, alternatives: 1 });
        self.subranges.insert((base, low, high), id);
        id
    }

    /// How messages call a type.
    pub fn name(&self, ty: Ty) -> String {
        match ty {
            Ty::Error => "an erroneous type".to_owned(),
            Ty::Void => "no value".to_owned(),
            Ty::IntLit => "an integer literal".to_owned(),
            Ty::RealLit => "a floating-point literal".to_owned(),
            Ty::Elem(elementary) => elementary.name().to_owned(),
            Ty::Str(length) => format!("STRING[{length}]"),
            Ty::WStr(length) => format!("WSTRING[{length}]"),
            Ty::User(id) => self.def(id).name.clone(),
        }
    }

    /// Size and alignment in bytes.
    pub fn extent(&self, ty: Ty) -> (u32, u32) {
        match ty {
            Ty::Elem(elementary) => (elementary.storage().bytes(), elementary.storage().bytes()),
            Ty::Str(length) => (u32::from(length) + 1, 1),
            Ty::WStr(length) => (2 * (u32::from(length) + 1), 2),
            Ty::User(id) => (self.def(id).size, self.def(id).align),
            _ => (1, 1),
        }
    }

    /// Initial value of a variable without one.
    pub fn default(&self, ty: Ty) -> Value {
        match ty {
            Ty::User(id) => self.def(id).default.clone(),
            _ => Value::Zero,
        }
    }

    /// How deep types nest.
    pub fn depth(&self, ty: Ty) -> u32 {
        match ty {
            Ty::User(id) => self.def(id).depth,
            _ => 1,
        }
    }

    /// How many ways a lookup in a variable may have to try: 1 without unions.
    pub fn alternatives(&self, ty: Ty) -> u32 {
        match ty {
            Ty::User(id) => self.def(id).alternatives,
            _ => 1,
        }
    }

    /// The elementary type that a scalar's values have: itself, an enumeration's or subrange's base.
    pub fn elementary(&self, ty: Ty) -> Option<ElementaryType> {
        match ty {
            Ty::Elem(elementary) => Some(elementary),
            Ty::User(id) => match self.def(id).kind {
                TyKind::Enum { base, .. } | TyKind::Subrange { base, .. } => Some(base),
                _ => None,
            },
            _ => None,
        }
    }

    /// How a scalar lies in memory; `None` for strings and what is composed.
    pub fn storage(&self, ty: Ty) -> Option<Storage> {
        self.elementary(ty).map(ElementaryType::storage)
    }

    /// A subrange's base type; others are themselves.
    pub fn without_range(&self, ty: Ty) -> Ty {
        match self.kind(ty) {
            Some(TyKind::Subrange { base, .. }) => Ty::Elem(*base),
            _ => ty,
        }
    }

    /// Fields of a structure, union or function block.
    pub fn fields(&self, ty: Ty) -> Option<&Rc<[FieldDef]>> {
        match self.kind(ty)? {
            TyKind::Struct { fields } | TyKind::Union { fields } | TyKind::Block { fields, .. } => Some(fields),
            _ => None,
        }
    }

    /// Whether a function block instance stands at offset 0 of it.
    pub fn starts_with_block(&self, ty: Ty) -> bool {
        let mut ty = ty;
        for _ in 0..=khz_bytecode::limits::MAX_TYPE_DEPTH {
            ty = match self.kind(ty) {
                Some(TyKind::Block { .. }) => return true,
                Some(TyKind::Array { element, .. }) => *element,
                Some(TyKind::Struct { fields }) => match fields.first() {
                    Some(field) => field.ty,
                    None => return false,
                },
                _ => return false,
            };
        }
        false
    }

    /// Whether a function block instance stands anywhere in it.
    pub fn holds_block(&self, ty: Ty) -> bool {
        match self.kind(ty) {
            Some(TyKind::Block { .. }) => true,
            Some(TyKind::Array { element, .. }) => self.holds_block(*element),
            Some(TyKind::Struct { fields }) => fields.iter().any(|field| self.holds_block(field.ty)),
            _ => false,
        }
    }

    /// Lays fields out at their natural alignment; fills offsets, gives size and alignment, `None` beyond `limit` bytes.
    pub fn lay_out(&self, fields: &mut [FieldDef], is_block: bool, limit: u64) -> Option<(u32, u32)> {
        let mut at: u64 = 0;
        let mut align = if is_block { 8 } else { 1 };
        if is_block && fields.first().is_some_and(|field| self.starts_with_block(field.ty)) {
            at = 8;
        }
        for field in fields {
            let (size, field_align) = self.extent(field.ty);
            align = align.max(field_align);
            at = at.next_multiple_of(u64::from(field_align));
            field.offset = u32::try_from(at).ok()?;
            at += u64::from(size);
            if at > limit {
                return None;
            }
        }
        let size = at.max(1).next_multiple_of(u64::from(align));
        Some((u32::try_from(size).ok()?, align))
    }
}

/// Whether it is one of SINT, INT, DINT, LINT.
pub fn is_signed(ty: ElementaryType) -> bool {
    use ElementaryType as E;
    matches!(ty, E::Sint | E::Int | E::Dint | E::Lint)
}

/// Whether it is one of USINT, UINT, UDINT, ULINT.
pub fn is_unsigned(ty: ElementaryType) -> bool {
    use ElementaryType as E;
    matches!(ty, E::Usint | E::Uint | E::Udint | E::Ulint)
}

/// Whether it is an integer type.
pub fn is_integer(ty: ElementaryType) -> bool {
    is_signed(ty) || is_unsigned(ty)
}

/// Whether it is BYTE, WORD, DWORD or LWORD.
pub fn is_bits(ty: ElementaryType) -> bool {
    use ElementaryType as E;
    matches!(ty, E::Byte | E::Word | E::Dword | E::Lword)
}

/// Whether it is CHAR or WCHAR.
pub fn is_character(ty: ElementaryType) -> bool {
    matches!(ty, ElementaryType::Char | ElementaryType::Wchar)
}

/// Whether it is REAL or LREAL.
pub fn is_real(ty: ElementaryType) -> bool {
    matches!(ty, ElementaryType::Real | ElementaryType::Lreal)
}

/// Whether it is TIME or LTIME.
pub fn is_duration(ty: ElementaryType) -> bool {
    matches!(ty, ElementaryType::Time | ElementaryType::Ltime)
}

/// Whether it is DATE, TIME_OF_DAY, DATE_AND_TIME or one of their L-forms.
pub fn is_moment(ty: ElementaryType) -> bool {
    is_date(ty) || is_time_of_day(ty) || is_date_and_time(ty)
}

/// Whether it is DATE or LDATE.
pub fn is_date(ty: ElementaryType) -> bool {
    matches!(ty, ElementaryType::Date | ElementaryType::Ldate)
}

/// Whether it is TIME_OF_DAY or LTIME_OF_DAY.
pub fn is_time_of_day(ty: ElementaryType) -> bool {
    matches!(ty, ElementaryType::TimeOfDay | ElementaryType::LtimeOfDay)
}

/// Whether it is DATE_AND_TIME or LDATE_AND_TIME.
pub fn is_date_and_time(ty: ElementaryType) -> bool {
    matches!(ty, ElementaryType::DateAndTime | ElementaryType::LdateAndTime)
}

/// Whether its values are nanoseconds: durations, dates, times of day.
pub fn is_time(ty: ElementaryType) -> bool {
    is_duration(ty) || is_moment(ty)
}

/// The L-form of a duration, date or time of day; of an L-form itself.
pub fn long_form(ty: ElementaryType) -> Option<ElementaryType> {
    use ElementaryType as E;
    Some(match ty {
        E::Time | E::Ltime => E::Ltime,
        E::Date | E::Ldate => E::Ldate,
        E::TimeOfDay | E::LtimeOfDay => E::LtimeOfDay,
        E::DateAndTime | E::LdateAndTime => E::LdateAndTime,
        _ => return None,
    })
}

/// Width and sign of what is held in an integer register: integers, bit strings, BOOL, characters, durations, dates and times of day.
pub fn integer_type(ty: ElementaryType) -> Option<IntegerType> {
    use ElementaryType as E;
    Some(match ty {
        E::Bool | E::Usint | E::Byte | E::Char => IntegerType::U8,
        E::Sint => IntegerType::I8,
        E::Int => IntegerType::I16,
        E::Uint | E::Word | E::Wchar => IntegerType::U16,
        E::Dint => IntegerType::I32,
        E::Udint | E::Dword => IntegerType::U32,
        E::Lint => IntegerType::I64,
        _ if is_time(ty) => IntegerType::I64,
        E::Ulint | E::Lword => IntegerType::U64,
        _ => return None,
    })
}

/// Lowest and highest value.
pub fn limits(ty: ElementaryType) -> Option<(i128, i128)> {
    if ty == ElementaryType::Bool {
        return Some((0, 1));
    }
    let kind = integer_type(ty)?;
    let bits = kind.storage().bytes() * 8;
    Some(if kind.is_signed() { (-(1i128 << (bits - 1)), (1i128 << (bits - 1)) - 1) } else { (0, (1i128 << bits) - 1) })
}

/// The value of a canonical constant as a number.
pub fn widen(ty: ElementaryType, value: i64) -> i128 {
    match integer_type(ty) {
        Some(IntegerType::U64) => i128::from(value.cast_unsigned()),
        _ => i128::from(value),
    }
}

/// A number wrapped to a type's width, in the canonical form of [`Const::Int`].
pub fn wrap(ty: ElementaryType, value: i128) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "wrapping is what is asked for")]
    let low = value as i64;
    let bytes = low.to_le_bytes();
    match integer_type(ty) {
        Some(IntegerType::I8) => i64::from(i8::from_le_bytes([bytes[0]])),
        Some(IntegerType::U8) if ty == ElementaryType::Bool => i64::from(value != 0),
        Some(IntegerType::U8) => i64::from(bytes[0]),
        Some(IntegerType::I16) => i64::from(i16::from_le_bytes([bytes[0], bytes[1]])),
        Some(IntegerType::U16) => i64::from(u16::from_le_bytes([bytes[0], bytes[1]])),
        Some(IntegerType::I32) => i64::from(i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
        Some(IntegerType::U32) => i64::from(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
        _ => low,
    }
}

/// The elementary type of a keyword, in upper case.
pub fn elementary_by_name(name: &str) -> Option<ElementaryType> {
    use ElementaryType as E;
    let long = match name {
        "TIME_OF_DAY" => Some(E::TimeOfDay),
        "LTIME_OF_DAY" => Some(E::LtimeOfDay),
        "DATE_AND_TIME" => Some(E::DateAndTime),
        "LDATE_AND_TIME" => Some(E::LdateAndTime),
        _ => None,
    };
    let short = || ElementaryType::ALL.iter().copied().find(|ty| ty.name() == name);
    long.or_else(short)
}
