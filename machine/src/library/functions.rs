//! Standard functions (IEC 61131-3 tables 28 to 36): one row a function.
//!
//! Conversions (`INT_TO_REAL`, `TO_REAL`, `REAL_TRUNC_DINT`) are not rows: there are hundreds, all with the shape that
//! [`conversion`] takes apart.

use khz_bytecode::container::ElementaryType;

/// What types a parameter takes (IEC 61131-3 figure 11).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TypeClass {
    /// Any type that has values of its own to move: elementary, string, enumeration.
    AnyElementary,
    /// Numbers and durations.
    AnyMagnitude,
    /// Integers and floating-point numbers.
    AnyNum,
    /// REAL and LREAL.
    AnyReal,
    /// Integers.
    AnyInt,
    /// BOOL and bit strings.
    AnyBit,
    /// BYTE, WORD, DWORD and LWORD.
    BitString,
    /// REAL and LREAL and nothing that would become one.
    Float,
    /// What lies in memory as a whole number: integers, bit strings, BOOL and durations.
    Bytes,
    /// Bit strings and integers that can be shifted; BOOL not.
    Shiftable,
    /// Strings.
    AnyString,
    /// STRING, WSTRING, CHAR, WCHAR.
    AnyChars,
    /// BOOL.
    Bool,
    /// An integer that is no part of the generic group: a count, a position, a selector.
    Count,
    /// A whole array.
    Array,
    /// A value of one type, or what becomes one by itself.
    Of(ElementaryType),
    /// An integer of any type: a year, an hour and the like.
    Part,
    /// As [`TypeClass::Part`], 0 where it and all behind it are left out.
    FinePart,
}

impl TypeClass {
    /// Whether all parameters of such classes are brought to one common type.
    #[must_use]
    pub fn is_generic(self) -> bool {
        !matches!(
            self,
            TypeClass::Bool
                | TypeClass::Count
                | TypeClass::AnyString
                | TypeClass::AnyChars
                | TypeClass::Array
                | TypeClass::Of(_)
                | TypeClass::Part
                | TypeClass::FinePart
        )
    }

    /// How messages call it.
    #[must_use]
    pub fn describe(self) -> &'static str {
        match self {
            TypeClass::AnyElementary => "a value of an elementary type",
            TypeClass::AnyMagnitude => "a number or a duration",
            TypeClass::AnyNum => "a number",
            TypeClass::AnyReal => "a REAL or LREAL",
            TypeClass::AnyInt => "an integer",
            TypeClass::AnyBit => "a BOOL or bit string",
            TypeClass::BitString => "a BYTE, WORD, DWORD or LWORD",
            TypeClass::Float => "a REAL or LREAL",
            TypeClass::Bytes => "an integer, bit string or duration",
            TypeClass::Shiftable => "a bit string or integer",
            TypeClass::AnyString => "a STRING or WSTRING",
            TypeClass::AnyChars => "a string or character",
            TypeClass::Bool => "a BOOL",
            TypeClass::Count | TypeClass::Part | TypeClass::FinePart => "an integer",
            TypeClass::Array => "an array",
            TypeClass::Of(ty) => ty.name(),
        }
    }
}

/// What type a result has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResultRule {
    /// The common type of the generic parameters.
    Generic,
    /// BOOL.
    Bool,
    /// INT.
    Int,
    /// DINT.
    Dint,
    /// A STRING that is long enough for every outcome.
    String,
    /// The integer type that the place of the call wants, DINT where it wants none.
    WantedInteger,
    /// A value of one type.
    Of(ElementaryType),
    /// None: the outputs say it.
    Nothing,
}

/// A parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter {
    /// Its formal name.
    pub name: &'static str,
    /// What it takes.
    pub class: TypeClass,
}

/// A row of the table.
#[derive(Debug, Clone, Copy)]
pub struct FunctionRow {
    /// Which function.
    pub function: StandardFunction,
    /// Its name.
    pub name: &'static str,
    /// Its parameters; of an extensible one the last stands for one or more.
    pub parameters: &'static [Parameter],
    /// Names of its outputs, each an integer of any type.
    pub outputs: &'static [&'static str],
    /// Whether the last parameter may be repeated. `IN`, then, means `IN1`, `IN2` and so on.
    pub extensible: bool,
    /// Type of the result.
    pub result: ResultRule,
    /// What it computes.
    pub meaning: &'static str,
    /// Where the standard defines it.
    pub clause: &'static str,
}

macro_rules! functions {
    ($(($variant:ident $name:literal [$($parameter:literal $class:ident $(($class_of:ident))?),*] $(=> [$($output:literal),*])? $($more:ident)?
        -> $result:ident $(($result_of:ident))?, $meaning:literal, $clause:literal)),* $(,)?) => {
        /// Every standard function that is a row.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum StandardFunction { $(#[doc = $meaning] $variant),* }

        /// The rows.
        pub static TABLE: &[FunctionRow] = &[$(FunctionRow {
            function: StandardFunction::$variant,
            name: $name,
            parameters: &[$(Parameter { name: $parameter, class: TypeClass::$class $((ElementaryType::$class_of))? }),*],
            outputs: &[$($($output),*)?],
            extensible: functions!(@more $($more)?),
            result: ResultRule::$result $((ElementaryType::$result_of))?,
            meaning: $meaning,
            clause: $clause,
        }),*];
    };
    (@more more) => { true };
    (@more) => { false };
}

functions! {
    (Abs "ABS" ["IN" AnyNum] -> Generic, "Absolute value; of the lowest integer, itself.", "table 28"),
    (Sqrt "SQRT" ["IN" AnyReal] -> Generic, "Square root.", "table 28"),
    (Ln "LN" ["IN" AnyReal] -> Generic, "Natural logarithm.", "table 28"),
    (Log "LOG" ["IN" AnyReal] -> Generic, "Logarithm to base 10.", "table 28"),
    (Exp "EXP" ["IN" AnyReal] -> Generic, "Natural exponential.", "table 28"),
    (Sin "SIN" ["IN" AnyReal] -> Generic, "Sine of radians.", "table 28"),
    (Cos "COS" ["IN" AnyReal] -> Generic, "Cosine of radians.", "table 28"),
    (Tan "TAN" ["IN" AnyReal] -> Generic, "Tangent of radians.", "table 28"),
    (Asin "ASIN" ["IN" AnyReal] -> Generic, "Arc sine.", "table 28"),
    (Acos "ACOS" ["IN" AnyReal] -> Generic, "Arc cosine.", "table 28"),
    (Atan "ATAN" ["IN" AnyReal] -> Generic, "Arc tangent.", "table 28"),
    (Atan2 "ATAN2" ["Y" AnyReal, "X" AnyReal] -> Generic, "Arc tangent of Y / X in the right quadrant.", "table 28"),
    (Trunc "TRUNC" ["IN" AnyReal] -> WantedInteger, "Cut toward zero, saturated.", "table 22"),
    (Add "ADD" ["IN1" AnyMagnitude, "IN2" AnyMagnitude] more -> Generic, "Sum.", "table 29"),
    (Mul "MUL" ["IN1" AnyMagnitude, "IN2" AnyMagnitude] more -> Generic, "Product.", "table 29"),
    (Sub "SUB" ["IN1" AnyMagnitude, "IN2" AnyMagnitude] -> Generic, "Difference.", "table 29"),
    (Div "DIV" ["IN1" AnyMagnitude, "IN2" AnyMagnitude] -> Generic, "Quotient; of integers cut toward zero.", "table 29"),
    (Mod "MOD" ["IN1" AnyInt, "IN2" AnyInt] -> Generic, "Remainder with the sign of the dividend.", "table 29"),
    (Expt "EXPT" ["IN1" AnyReal, "IN2" AnyNum] -> Generic, "IN1 to the power of IN2.", "table 29"),
    (Move "MOVE" ["IN" AnyElementary] -> Generic, "The value itself.", "table 29"),
    (Shl "SHL" ["IN" Shiftable, "N" Count] -> Generic, "Shift left, filled with zero.", "table 30"),
    (Shr "SHR" ["IN" Shiftable, "N" Count] -> Generic, "Shift right, filled with zero, of signed integers with the sign.", "table 30"),
    (Rol "ROL" ["IN" Shiftable, "N" Count] -> Generic, "Rotate left in the operand's own width.", "table 30"),
    (Ror "ROR" ["IN" Shiftable, "N" Count] -> Generic, "Rotate right in the operand's own width.", "table 30"),
    (And "AND" ["IN1" AnyBit, "IN2" AnyBit] more -> Generic, "Bitwise AND.", "table 31"),
    (Or "OR" ["IN1" AnyBit, "IN2" AnyBit] more -> Generic, "Bitwise OR.", "table 31"),
    (Xor "XOR" ["IN1" AnyBit, "IN2" AnyBit] more -> Generic, "Bitwise exclusive OR.", "table 31"),
    (Not "NOT" ["IN" AnyBit] -> Generic, "Bitwise complement.", "table 31"),
    (Sel "SEL" ["G" Bool, "IN0" AnyElementary, "IN1" AnyElementary] -> Generic, "IN0 if G is FALSE, else IN1; both are evaluated.", "table 32"),
    (Mux "MUX" ["K" Count, "IN0" AnyElementary, "IN1" AnyElementary] more -> Generic, "Input number K; the last one if there is none.", "table 32"),
    (Min "MIN" ["IN1" AnyElementary, "IN2" AnyElementary] more -> Generic, "The smallest, folded from the left: b if b < a, else a.", "table 32"),
    (Max "MAX" ["IN1" AnyElementary, "IN2" AnyElementary] more -> Generic, "The largest, folded from the left: b if b > a, else a.", "table 32"),
    (Limit "LIMIT" ["MN" AnyElementary, "IN" AnyElementary, "MX" AnyElementary] -> Generic, "MIN(MAX(IN, MN), MX).", "table 32"),
    (Gt "GT" ["IN1" AnyElementary, "IN2" AnyElementary] more -> Bool, "Whether each is greater than the next.", "table 33"),
    (Ge "GE" ["IN1" AnyElementary, "IN2" AnyElementary] more -> Bool, "Whether each is at least the next.", "table 33"),
    (Eq "EQ" ["IN1" AnyElementary, "IN2" AnyElementary] more -> Bool, "Whether all are equal.", "table 33"),
    (Le "LE" ["IN1" AnyElementary, "IN2" AnyElementary] more -> Bool, "Whether each is at most the next.", "table 33"),
    (Lt "LT" ["IN1" AnyElementary, "IN2" AnyElementary] more -> Bool, "Whether each is less than the next.", "table 33"),
    (Ne "NE" ["IN1" AnyElementary, "IN2" AnyElementary] -> Bool, "Whether they differ.", "table 33"),
    (Len "LEN" ["IN" AnyString] -> Int, "Number of characters.", "table 34"),
    (Left "LEFT" ["IN" AnyString, "L" Count] -> String, "The first L characters.", "table 34"),
    (Right "RIGHT" ["IN" AnyString, "L" Count] -> String, "The last L characters.", "table 34"),
    (Mid "MID" ["IN" AnyString, "L" Count, "P" Count] -> String, "L characters from position P.", "table 34"),
    (Concat "CONCAT" ["IN1" AnyChars, "IN2" AnyChars] more -> String, "One behind the other.", "table 34"),
    (Insert "INSERT" ["IN1" AnyString, "IN2" AnyChars, "P" Count] -> String, "IN2 put into IN1 after position P.", "table 34"),
    (Delete "DELETE" ["IN" AnyString, "L" Count, "P" Count] -> String, "IN without L characters from position P.", "table 34"),
    (Replace "REPLACE" ["IN1" AnyString, "IN2" AnyChars, "L" Count, "P" Count] -> String, "IN1 with L characters from position P replaced by IN2.", "table 34"),
    (LowerBound "LOWER_BOUND" ["ARR" Array, "DIM" Count] -> Dint, "The lowest index of dimension DIM, counted from 1.", "table 15"),
    (UpperBound "UPPER_BOUND" ["ARR" Array, "DIM" Count] -> Dint, "The highest index of dimension DIM, counted from 1.", "table 15"),
    (Find "FIND" ["IN1" AnyString, "IN2" AnyChars] -> Int, "Position of IN2 in IN1, 0 if it is not there.", "table 34"),
    (AddTodTime "ADD_TOD_TIME" ["IN1" Of(TimeOfDay), "IN2" Of(Time)] -> Of(TimeOfDay), "Sum; it may lie outside a day.", "table 35"),
    (AddLtodLtime "ADD_LTOD_LTIME" ["IN1" Of(LtimeOfDay), "IN2" Of(Ltime)] -> Of(LtimeOfDay), "Sum; it may lie outside a day.", "table 35"),
    (AddDtTime "ADD_DT_TIME" ["IN1" Of(DateAndTime), "IN2" Of(Time)] -> Of(DateAndTime), "Sum.", "table 35"),
    (AddLdtLtime "ADD_LDT_LTIME" ["IN1" Of(LdateAndTime), "IN2" Of(Ltime)] -> Of(LdateAndTime), "Sum.", "table 35"),
    (SubDateDate "SUB_DATE_DATE" ["IN1" Of(Date), "IN2" Of(Date)] -> Of(Time), "How long IN1 is after IN2.", "table 35"),
    (SubLdateLdate "SUB_LDATE_LDATE" ["IN1" Of(Ldate), "IN2" Of(Ldate)] -> Of(Ltime), "How long IN1 is after IN2.", "table 35"),
    (SubTodTime "SUB_TOD_TIME" ["IN1" Of(TimeOfDay), "IN2" Of(Time)] -> Of(TimeOfDay), "Difference; it may lie outside a day.", "table 35"),
    (SubLtodLtime "SUB_LTOD_LTIME" ["IN1" Of(LtimeOfDay), "IN2" Of(Ltime)] -> Of(LtimeOfDay), "Difference; it may lie outside a day.", "table 35"),
    (SubTodTod "SUB_TOD_TOD" ["IN1" Of(TimeOfDay), "IN2" Of(TimeOfDay)] -> Of(Time), "How long IN1 is after IN2.", "table 35"),
    (SubLtodLtod "SUB_LTOD_LTOD" ["IN1" Of(LtimeOfDay), "IN2" Of(LtimeOfDay)] -> Of(Ltime), "How long IN1 is after IN2.", "table 35"),
    (SubDtTime "SUB_DT_TIME" ["IN1" Of(DateAndTime), "IN2" Of(Time)] -> Of(DateAndTime), "Difference.", "table 35"),
    (SubLdtLtime "SUB_LDT_LTIME" ["IN1" Of(LdateAndTime), "IN2" Of(Ltime)] -> Of(LdateAndTime), "Difference.", "table 35"),
    (SubDtDt "SUB_DT_DT" ["IN1" Of(DateAndTime), "IN2" Of(DateAndTime)] -> Of(Time), "How long IN1 is after IN2.", "table 35"),
    (SubLdtLdt "SUB_LDT_LDT" ["IN1" Of(LdateAndTime), "IN2" Of(LdateAndTime)] -> Of(Ltime), "How long IN1 is after IN2.", "table 35"),
    (Multime "MULTIME" ["IN1" Of(Time), "IN2" AnyNum] -> Of(Time), "Product, as Edition 2 spells it.", "table 35"),
    (Divtime "DIVTIME" ["IN1" Of(Time), "IN2" AnyNum] -> Of(Time), "Quotient, as Edition 2 spells it.", "table 35"),
    (ConcatDateTod "CONCAT_DATE_TOD" ["DATE" Of(Date), "TOD" Of(TimeOfDay)] -> Of(DateAndTime), "The moment on a day.", "table 36"),
    (ConcatDateLtod "CONCAT_DATE_LTOD" ["DATE" Of(Date), "LTOD" Of(LtimeOfDay)] -> Of(LdateAndTime), "The moment on a day.", "table 36"),
    (ConcatLdateTod "CONCAT_LDATE_TOD" ["LDATE" Of(Ldate), "TOD" Of(TimeOfDay)] -> Of(LdateAndTime), "The moment on a day.", "table 36"),
    (ConcatLdateLtod "CONCAT_LDATE_LTOD" ["LDATE" Of(Ldate), "LTOD" Of(LtimeOfDay)] -> Of(LdateAndTime), "The moment on a day.", "table 36"),
    (ConcatDate "CONCAT_DATE" ["YEAR" Part, "MONTH" Part, "DAY" Part] -> Of(Date), "A day of the calendar; months and days beyond their ends count on.", "table 36"),
    (ConcatLdate "CONCAT_LDATE" ["YEAR" Part, "MONTH" Part, "DAY" Part] -> Of(Ldate), "A day of the calendar; months and days beyond their ends count on.", "table 36"),
    (ConcatTod "CONCAT_TOD" ["HOUR" Part, "MINUTE" Part, "SECOND" Part, "MILLISECOND" Part] -> Of(TimeOfDay), "A time of day; parts beyond their ends count on.", "table 36"),
    (ConcatLtod "CONCAT_LTOD" ["HOUR" Part, "MINUTE" Part, "SECOND" Part, "MILLISECOND" Part, "MICROSECOND" FinePart, "NANOSECOND" FinePart] -> Of(LtimeOfDay), "A time of day; parts beyond their ends count on.", "table 36"),
    (ConcatDt "CONCAT_DT" ["YEAR" Part, "MONTH" Part, "DAY" Part, "HOUR" Part, "MINUTE" Part, "SECOND" Part, "MILLISECOND" Part] -> Of(DateAndTime), "A moment; parts beyond their ends count on.", "table 36"),
    (ConcatLdt "CONCAT_LDT" ["YEAR" Part, "MONTH" Part, "DAY" Part, "HOUR" Part, "MINUTE" Part, "SECOND" Part, "MILLISECOND" Part, "MICROSECOND" FinePart, "NANOSECOND" FinePart] -> Of(LdateAndTime), "A moment; parts beyond their ends count on.", "table 36"),
    (SplitDate "SPLIT_DATE" ["IN" Of(Date)] => ["YEAR", "MONTH", "DAY"] -> Nothing, "The parts of a day.", "table 36"),
    (SplitLdate "SPLIT_LDATE" ["IN" Of(Ldate)] => ["YEAR", "MONTH", "DAY"] -> Nothing, "The parts of a day.", "table 36"),
    (SplitTod "SPLIT_TOD" ["IN" Of(TimeOfDay)] => ["HOUR", "MINUTE", "SECOND", "MILLISECOND"] -> Nothing, "The parts of a time of day, each with its sign.", "table 36"),
    (SplitLtod "SPLIT_LTOD" ["IN" Of(LtimeOfDay)] => ["HOUR", "MINUTE", "SECOND", "MILLISECOND", "MICROSECOND", "NANOSECOND"] -> Nothing, "The parts of a time of day, each with its sign.", "table 36"),
    (SplitDt "SPLIT_DT" ["IN" Of(DateAndTime)] => ["YEAR", "MONTH", "DAY", "HOUR", "MINUTE", "SECOND", "MILLISECOND"] -> Nothing, "The parts of a moment.", "table 36"),
    (SplitLdt "SPLIT_LDT" ["IN" Of(LdateAndTime)] => ["YEAR", "MONTH", "DAY", "HOUR", "MINUTE", "SECOND", "MILLISECOND", "MICROSECOND", "NANOSECOND"] -> Nothing, "The parts of a moment.", "table 36"),
    (DayOfWeek "DAY_OF_WEEK" ["IN" Of(Ldate)] -> WantedInteger, "0 on a Sunday to 6 on a Saturday.", "table 36"),
    (ToBigEndian "TO_BIG_ENDIAN" ["IN" Bytes] -> Generic, "The bytes in the order of a big-endian peer.", "table 37"),
    (ToLittleEndian "TO_LITTLE_ENDIAN" ["IN" Bytes] -> Generic, "The bytes in the order of a little-endian peer, which is that of the machine.", "table 37"),
    (BigEndianTo "BIG_ENDIAN_TO" ["IN" Bytes] -> Generic, "The value of bytes that stand in big-endian order.", "table 37"),
    (LittleEndianTo "LITTLE_ENDIAN_TO" ["IN" Bytes] -> Generic, "The value of bytes that stand in little-endian order, which is that of the machine.", "table 37"),
    (IsValid "IS_VALID" ["IN" Float] -> Bool, "Whether it is a number: no NaN and no infinity.", "table 39"),
    (IsValidBcd "IS_VALID_BCD" ["IN" BitString] -> Bool, "Whether every digit of a BCD number is 0 to 9.", "table 39"),
}

/// The row of a name, in any case.
#[must_use]
pub fn find(name: &str) -> Option<&'static FunctionRow> {
    TABLE.iter().find(|row| row.name.eq_ignore_ascii_case(name))
}

/// The row and the type of a typed function's name (IEC 61131-3 table 21): `ADD_INT`, `GT_DINT`, `SEL_REAL`. Whether the row takes the
/// type is for the caller to say. `name` is in upper case.
#[must_use]
pub fn typed(name: &str) -> Option<(&'static FunctionRow, &str)> {
    let (row, ty) = name.rsplit_once('_')?;
    Some((find(row)?, ty))
}

/// The parts of the name of a conversion from or to binary coded decimals (IEC 61131-3 table 22).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BcdConversion<'n> {
    /// Name of the source type; absent in `BCD_TO_UINT` and `TO_BCD_WORD`.
    pub from: Option<&'n str>,
    /// Name of the target type.
    pub to: &'n str,
    /// Whether the digits are the result: `UINT_TO_BCD_WORD`.
    pub makes_digits: bool,
}

/// Takes the name of a conversion of binary coded decimals apart: `WORD_BCD_TO_UINT`, `BCD_TO_UINT`, `UINT_TO_BCD_WORD`, `TO_BCD_WORD`.
/// Whether the parts are types that fit is for the caller to say. `name` is in upper case.
#[must_use]
pub fn bcd_conversion(name: &str) -> Option<BcdConversion<'_>> {
    if let Some(to) = name.strip_prefix("BCD_TO_") {
        return Some(BcdConversion { from: None, to, makes_digits: false });
    }
    if let Some(to) = name.strip_prefix("TO_BCD_") {
        return Some(BcdConversion { from: None, to, makes_digits: true });
    }
    if let Some((from, to)) = name.split_once("_BCD_TO_") {
        return Some(BcdConversion { from: Some(from), to, makes_digits: false });
    }
    let (from, to) = name.split_once("_TO_BCD_")?;
    Some(BcdConversion { from: Some(from), to, makes_digits: true })
}

/// The parts of a conversion's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conversion<'n> {
    /// Name of the source type; absent in `TO_INT`.
    pub from: Option<&'n str>,
    /// Name of the target type.
    pub to: &'n str,
    /// Whether it cuts toward zero (`REAL_TRUNC_INT`) where it would round.
    pub truncates: bool,
}

/// Takes the name of a conversion function apart (IEC 61131-3 tables 22 to 27): `INT_TO_REAL`, `TO_REAL`, `REAL_TRUNC_INT`, `TRUNC_INT`.
/// Whether the parts are types is for the caller to say. `name` is in upper case.
#[must_use]
pub fn conversion(name: &str) -> Option<Conversion<'_>> {
    if let Some(to) = name.strip_prefix("TO_") {
        return Some(Conversion { from: None, to, truncates: false });
    }
    if let Some(to) = name.strip_prefix("TRUNC_") {
        return Some(Conversion { from: None, to, truncates: true });
    }
    if let Some((from, to)) = name.split_once("_TO_") {
        return Some(Conversion { from: Some(from), to, truncates: false });
    }
    let (from, to) = name.split_once("_TRUNC_")?;
    Some(Conversion { from: Some(from), to, truncates: true })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique_and_found_in_any_case() {
        assert_eq!(TABLE.iter().map(|row| row.name).collect::<BTreeSet<_>>().len(), TABLE.len());
        assert_eq!(find("sqrt").map(|row| row.function), Some(StandardFunction::Sqrt));
        assert!(find("SQUIRT").is_none());
    }

    #[test]
    fn conversions_are_taken_apart() {
        assert_eq!(conversion("INT_TO_REAL"), Some(Conversion { from: Some("INT"), to: "REAL", truncates: false }));
        assert_eq!(conversion("TO_TIME"), Some(Conversion { from: None, to: "TIME", truncates: false }));
        assert_eq!(conversion("REAL_TRUNC_INT"), Some(Conversion { from: Some("REAL"), to: "INT", truncates: true }));
        assert_eq!(conversion("SQRT"), None);
    }

    #[test]
    fn typed_names_are_taken_apart() {
        assert_eq!(typed("ADD_INT").map(|(row, ty)| (row.function, ty)), Some((StandardFunction::Add, "INT")));
        let endian = typed("TO_BIG_ENDIAN_DWORD").map(|(row, ty)| (row.function, ty));
        assert_eq!(endian, Some((StandardFunction::ToBigEndian, "DWORD")));
        assert!(typed("ADD").is_none());
        assert!(typed("PLUS_INT").is_none());
    }

    #[test]
    fn conversions_of_decimals_are_taken_apart() {
        let parts = |name| bcd_conversion(name).map(|found| (found.from, found.to, found.makes_digits));
        assert_eq!(parts("WORD_BCD_TO_UINT"), Some((Some("WORD"), "UINT", false)));
        assert_eq!(parts("BCD_TO_UINT"), Some((None, "UINT", false)));
        assert_eq!(parts("UINT_TO_BCD_WORD"), Some((Some("UINT"), "WORD", true)));
        assert_eq!(parts("TO_BCD_WORD"), Some((None, "WORD", true)));
        assert_eq!(parts("UINT_TO_WORD"), None);
    }

    #[test]
    fn extensible_functions_have_a_parameter_to_repeat() {
        for row in TABLE {
            assert!(!row.parameters.is_empty(), "{}", row.name);
            assert!(!row.extensible || row.parameters.len() >= 2, "{}", row.name);
        }
    }
}
