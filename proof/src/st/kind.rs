//! The elementary types of generated programs, and what holds for each.

/// An elementary type that is no string.
#[allow(missing_docs, reason = "the names are the standard's")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Bool,
    Sint,
    Int,
    Dint,
    Lint,
    Usint,
    Uint,
    Udint,
    Ulint,
    Byte,
    Word,
    Dword,
    Lword,
    Real,
    Lreal,
    Time,
    Ltime,
    Date,
    Ldate,
    Tod,
    Ltod,
    Dt,
    Ldt,
    Char,
    Wchar,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 25] = [
        Kind::Bool,
        Kind::Sint,
        Kind::Int,
        Kind::Dint,
        Kind::Lint,
        Kind::Usint,
        Kind::Uint,
        Kind::Udint,
        Kind::Ulint,
        Kind::Byte,
        Kind::Word,
        Kind::Dword,
        Kind::Lword,
        Kind::Real,
        Kind::Lreal,
        Kind::Time,
        Kind::Ltime,
        Kind::Date,
        Kind::Ldate,
        Kind::Tod,
        Kind::Ltod,
        Kind::Dt,
        Kind::Ldt,
        Kind::Char,
        Kind::Wchar,
    ];
    /// DATE to LDT.
    pub const MOMENTS: [Kind; 6] = [Kind::Date, Kind::Ldate, Kind::Tod, Kind::Ltod, Kind::Dt, Kind::Ldt];
    /// SINT to ULINT.
    pub const INTEGERS: [Kind; 8] =
        [Kind::Sint, Kind::Int, Kind::Dint, Kind::Lint, Kind::Usint, Kind::Uint, Kind::Udint, Kind::Ulint];
    /// BYTE to LWORD.
    pub const BITS: [Kind; 4] = [Kind::Byte, Kind::Word, Kind::Dword, Kind::Lword];

    /// Its keyword.
    #[must_use]
    pub fn name(self) -> &'static str {
        const NAMES: [&str; 25] = [
            "BOOL", "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "ULINT", "BYTE", "WORD", "DWORD", "LWORD",
            "REAL", "LREAL", "TIME", "LTIME", "DATE", "LDATE", "TOD", "LTOD", "DT", "LDT", "CHAR", "WCHAR",
        ];
        NAMES[self as usize]
    }

    /// Width in bits; of BOOL 1.
    #[must_use]
    pub fn bits(self) -> u32 {
        match self {
            Kind::Char => return 8,
            Kind::Wchar => return 16,
            _ if self.is_moment() => return 64,
            _ => {}
        }
        [1, 8, 16, 32, 64, 8, 16, 32, 64, 8, 16, 32, 64, 32, 64, 64, 64][self as usize]
    }

    /// SINT to LINT, TIME and LTIME, DATE to LDT.
    #[must_use]
    pub fn is_signed(self) -> bool {
        matches!(self, Kind::Sint | Kind::Int | Kind::Dint | Kind::Lint) || self.is_duration() || self.is_moment()
    }

    /// SINT to ULINT.
    #[must_use]
    pub fn is_integer(self) -> bool {
        Kind::INTEGERS.contains(&self)
    }

    /// BYTE to LWORD.
    #[must_use]
    pub fn is_bits(self) -> bool {
        Kind::BITS.contains(&self)
    }

    /// REAL and LREAL.
    #[must_use]
    pub fn is_real(self) -> bool {
        matches!(self, Kind::Real | Kind::Lreal)
    }

    /// Lowest and highest value of an integer, bit string, BOOL or TIME.
    #[must_use]
    pub fn limits(self) -> (i128, i128) {
        let bits = self.bits();
        if self.is_signed() { (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1 << bits) - 1) }
    }

    /// A number wrapped in the width of the type.
    #[must_use]
    pub fn wrap(self, value: i128) -> i128 {
        // The low bits alone count, so that a product or shift of which more is lost is right too.
        let bits = self.bits();
        let pattern = value & ((1 << bits) - 1);
        if self.is_signed() && pattern >> (bits - 1) == 1 { pattern - (1 << bits) } else { pattern }
    }

    /// TIME and LTIME.
    #[must_use]
    pub fn is_duration(self) -> bool {
        matches!(self, Kind::Time | Kind::Ltime)
    }

    /// DATE, TIME_OF_DAY, DATE_AND_TIME and their L-forms.
    #[must_use]
    pub fn is_moment(self) -> bool {
        Kind::MOMENTS.contains(&self)
    }

    /// CHAR and WCHAR, whose values are their codes.
    #[must_use]
    pub fn is_character(self) -> bool {
        matches!(self, Kind::Char | Kind::Wchar)
    }

    /// Whether `A_TO_B` exists. Characters are converted to and from strings, each other and whole numbers only.
    #[must_use]
    pub fn converts(self, to: Kind) -> bool {
        let fits = |kind: Kind| kind.is_character() || kind.is_integer() || kind.is_bits();
        !(self.is_character() || to.is_character()) || (fits(self) && fits(to))
    }

    /// The L-form of a duration, date or time of day; of an L-form itself.
    #[must_use]
    pub fn long(self) -> Option<Kind> {
        Some(match self {
            Kind::Time | Kind::Ltime => Kind::Ltime,
            Kind::Date | Kind::Ldate => Kind::Ldate,
            Kind::Tod | Kind::Ltod => Kind::Ltod,
            Kind::Dt | Kind::Ldt => Kind::Ldt,
            _ => return None,
        })
    }

    /// Whether a value of this type becomes one of another by itself: what the standard's figure has, and between numbers of any width
    /// what vendors have besides. Integers keep their low bits, an LREAL is rounded.
    #[must_use]
    pub fn becomes(self, to: Kind) -> bool {
        let whole = |kind: Kind| kind.is_integer() || kind.is_bits();
        self == to
            || (whole(self) && whole(to))
            || (self.is_integer() && to.is_real())
            || (self.is_real() && to.is_real())
            || (self == Kind::Bool && to.is_bits())
            || self.long() == Some(to)
    }

    /// The type in which the operands of an operation meet. Integers meet in the wider one, and in a signed one that holds both while
    /// there is one; a bit string and an integer in the wider one, of equals in the bit string; an integer and a float in the float if it holds every
    /// value of the integer, else in LREAL.
    #[must_use]
    pub fn meet(self, other: Kind) -> Option<Kind> {
        if self == other {
            return Some(self);
        }
        let pair = |test: fn(Kind) -> bool| match (test(self), test(other)) {
            (true, false) => Some((self, other)),
            (false, true) => Some((other, self)),
            _ => None,
        };
        if let (Some(long), Some(same)) = (self.long(), other.long()) {
            return (long == same).then_some(long);
        }
        if self.is_real() && other.is_real() {
            return Some(Kind::Lreal);
        }
        if let Some((real, number)) = pair(Kind::is_real) {
            let fits = number.is_integer() && number.bits() <= if real == Kind::Real { 16 } else { 64 };
            return number.is_integer().then_some(if fits { real } else { Kind::Lreal });
        }
        if let Some((_, bits)) = pair(|kind| kind == Kind::Bool) {
            return bits.is_bits().then_some(bits);
        }
        let whole = |kind: Kind| kind.is_integer() || kind.is_bits();
        if !whole(self) || !whole(other) {
            return None;
        }
        let wider = if self.bits() >= other.bits() { self } else { other };
        if let Some((bits, integer)) = pair(Kind::is_bits) {
            return Some(if integer.bits() > bits.bits() { integer } else { bits });
        }
        let Some((signed, unsigned)) = pair(Kind::is_signed).filter(|_| self.is_integer()) else { return Some(wider) };
        Some(match unsigned.bits() {
            bits if signed.bits() > bits => signed,
            8 => Kind::Int,
            16 => Kind::Dint,
            _ => Kind::Lint,
        })
    }
}
