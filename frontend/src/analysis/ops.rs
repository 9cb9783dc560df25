//! Which instruction an operation is: the folding computes with it, the lowering emits it.

use khz_bytecode::container::ElementaryType as E;
use khz_bytecode::instruction::{HelperOp as H, NumericOp as N};
use khz_bytecode::value::{IntegerType, ValueType};

use super::tree::{BinOp, CalendarOp, TextOp, UnOp};
use super::types::integer_type;

/// One operand.
pub(crate) fn unary(op: UnOp, ty: ValueType) -> Option<N> {
    use ValueType::{F32, F64, I32, I64};
    Some(match (op, ty) {
        (UnOp::Neg, I32) => N::I32Neg,
        (UnOp::Neg, I64) => N::I64Neg,
        (UnOp::Neg, F32) => N::F32Neg,
        (UnOp::Neg, F64) => N::F64Neg,
        (UnOp::Abs, I32) => N::I32Abs,
        (UnOp::Abs, I64) => N::I64Abs,
        (UnOp::Abs, F32) => N::F32Abs,
        (UnOp::Abs, F64) => N::F64Abs,
        (UnOp::Not, I32) => N::I32Not,
        (UnOp::Not, I64) => N::I64Not,
        (UnOp::Sqrt, F32) => N::F32Sqrt,
        (UnOp::Sqrt, F64) => N::F64Sqrt,
        (UnOp::Ln, F32) => N::F32Ln,
        (UnOp::Ln, F64) => N::F64Ln,
        (UnOp::Log, F32) => N::F32Log,
        (UnOp::Log, F64) => N::F64Log,
        (UnOp::Exp, F32) => N::F32Exp,
        (UnOp::Exp, F64) => N::F64Exp,
        (UnOp::Sin, F32) => N::F32Sin,
        (UnOp::Sin, F64) => N::F64Sin,
        (UnOp::Cos, F32) => N::F32Cos,
        (UnOp::Cos, F64) => N::F64Cos,
        (UnOp::Tan, F32) => N::F32Tan,
        (UnOp::Tan, F64) => N::F64Tan,
        (UnOp::Asin, F32) => N::F32Asin,
        (UnOp::Asin, F64) => N::F64Asin,
        (UnOp::Acos, F32) => N::F32Acos,
        (UnOp::Acos, F64) => N::F64Acos,
        (UnOp::Atan, F32) => N::F32Atan,
        (UnOp::Atan, F64) => N::F64Atan,
        _ => return None,
    })
}

/// A question to the calendar.
pub(crate) fn calendar(op: CalendarOp) -> N {
    match op {
        CalendarOp::Year => N::DateYear,
        CalendarOp::Month => N::DateMonth,
        CalendarOp::Day => N::DateDay,
        CalendarOp::Weekday => N::DateWeekday,
        CalendarOp::Of => N::DateOf,
    }
}

/// Two operands, of the type that decides width and sign.
pub(crate) fn binary(op: BinOp, ty: E) -> Option<N> {
    match ty {
        E::Real => float32(op),
        E::Lreal => float64(op),
        _ => {
            let kind = integer_type(ty)?;
            match (op, kind) {
                (BinOp::Rol, IntegerType::I8 | IntegerType::U8) => Some(N::I32Rotl8),
                (BinOp::Ror, IntegerType::I8 | IntegerType::U8) => Some(N::I32Rotr8),
                (BinOp::Rol, IntegerType::I16 | IntegerType::U16) => Some(N::I32Rotl16),
                (BinOp::Ror, IntegerType::I16 | IntegerType::U16) => Some(N::I32Rotr16),
                _ if kind.value_type() == ValueType::I64 => integer64(op, kind.is_signed()),
                // Narrow unsigned numbers are not negative in 32 bits, so that signed operations do for them, but not the other way round.
                _ => integer32(op, kind.is_signed()),
            }
        }
    }
}

macro_rules! integer_table {
    ($name:ident, $and:ident $or:ident $xor:ident $add:ident $sub:ident $mul:ident $eq:ident $ne:ident $shl:ident $rotl:ident $rotr:ident;
     $($op:ident $signed:ident $unsigned:ident),*) => {
        fn $name(op: BinOp, signed: bool) -> Option<N> {
            Some(match op {
                BinOp::And => N::$and,
                BinOp::Or => N::$or,
                BinOp::Xor => N::$xor,
                BinOp::Add => N::$add,
                BinOp::Sub => N::$sub,
                BinOp::Mul => N::$mul,
                BinOp::Eq => N::$eq,
                BinOp::Ne => N::$ne,
                BinOp::Shl => N::$shl,
                BinOp::Rol => N::$rotl,
                BinOp::Ror => N::$rotr,
                $(BinOp::$op => if signed { N::$signed } else { N::$unsigned },)*
                _ => return None,
            })
        }
    };
}

integer_table!(integer32, I32And I32Or I32Xor I32Add I32Sub I32Mul I32Eq I32Ne I32Shl I32Rotl I32Rotr;
    Div I32DivS I32DivU, Mod I32RemS I32RemU, Lt I32LtS I32LtU, Le I32LeS I32LeU, Gt I32GtS I32GtU, Ge I32GeS I32GeU,
    Min I32MinS I32MinU, Max I32MaxS I32MaxU, Shr I32ShrS I32ShrU);
integer_table!(integer64, I64And I64Or I64Xor I64Add I64Sub I64Mul I64Eq I64Ne I64Shl I64Rotl I64Rotr;
    Div I64DivS I64DivU, Mod I64RemS I64RemU, Lt I64LtS I64LtU, Le I64LeS I64LeU, Gt I64GtS I64GtU, Ge I64GeS I64GeU,
    Min I64MinS I64MinU, Max I64MaxS I64MaxU, Shr I64ShrS I64ShrU);

macro_rules! float_table {
    ($name:ident, $($op:ident $code:ident),*) => {
        fn $name(op: BinOp) -> Option<N> {
            Some(match op { $(BinOp::$op => N::$code,)* _ => return None })
        }
    };
}

float_table!(float32, Add F32Add, Sub F32Sub, Mul F32Mul, Div F32Div, Pow F32Pow, Atan2 F32Atan2, Min F32Min, Max F32Max,
    Eq F32Eq, Ne F32Ne, Lt F32Lt, Le F32Le, Gt F32Gt, Ge F32Ge);
float_table!(float64, Add F64Add, Sub F64Sub, Mul F64Mul, Div F64Div, Pow F64Pow, Atan2 F64Atan2, Min F64Min, Max F64Max,
    Eq F64Eq, Ne F64Ne, Lt F64Lt, Le F64Le, Gt F64Gt, Ge F64Ge);

/// A string operation on strings that are wide or not; `None` for what hangs on the type of a value.
pub(crate) fn text(op: TextOp, wide: bool) -> Option<H> {
    Some(match (op, wide) {
        (TextOp::Len, false) => H::StringLen,
        (TextOp::Len, true) => H::WideLen,
        (TextOp::Find, false) => H::StringFind,
        (TextOp::Find, true) => H::WideFind,
        (TextOp::Left, false) => H::StringLeft,
        (TextOp::Left, true) => H::WideLeft,
        (TextOp::Right, false) => H::StringRight,
        (TextOp::Right, true) => H::WideRight,
        (TextOp::Mid, false) => H::StringMid,
        (TextOp::Mid, true) => H::WideMid,
        (TextOp::Concat, false) => H::StringConcat,
        (TextOp::Concat, true) => H::WideConcat,
        (TextOp::Insert, false) => H::StringInsert,
        (TextOp::Insert, true) => H::WideInsert,
        (TextOp::Delete, false) => H::StringDelete,
        (TextOp::Delete, true) => H::WideDelete,
        (TextOp::Replace, false) => H::StringReplace,
        (TextOp::Replace, true) => H::WideReplace,
        (TextOp::FromCharacter, false) => H::StringFromChar,
        (TextOp::FromCharacter, true) => H::WideFromChar,
        (TextOp::Narrow, _) => H::StringFromWide,
        (TextOp::Widen, _) => H::WideFromString,
        (TextOp::To | TextOp::From | TextOp::First, _) => return None,
    })
}

/// REAL or LREAL to an integer: rounded to nearest even, or cut.
pub(crate) fn float_to_integer(from: ValueType, to: IntegerType, truncates: bool) -> N {
    use IntegerType::{I8, I16, I32, I64, U8, U16, U32, U64};
    match (from == ValueType::F32, truncates, to) {
        (true, false, I8) => N::F32RoundI8,
        (true, false, U8) => N::F32RoundU8,
        (true, false, I16) => N::F32RoundI16,
        (true, false, U16) => N::F32RoundU16,
        (true, false, I32) => N::F32RoundI32,
        (true, false, U32) => N::F32RoundU32,
        (true, false, I64) => N::F32RoundI64,
        (true, false, U64) => N::F32RoundU64,
        (true, true, I8) => N::F32TruncI8,
        (true, true, U8) => N::F32TruncU8,
        (true, true, I16) => N::F32TruncI16,
        (true, true, U16) => N::F32TruncU16,
        (true, true, I32) => N::F32TruncI32,
        (true, true, U32) => N::F32TruncU32,
        (true, true, I64) => N::F32TruncI64,
        (true, true, U64) => N::F32TruncU64,
        (false, false, I8) => N::F64RoundI8,
        (false, false, U8) => N::F64RoundU8,
        (false, false, I16) => N::F64RoundI16,
        (false, false, U16) => N::F64RoundU16,
        (false, false, I32) => N::F64RoundI32,
        (false, false, U32) => N::F64RoundU32,
        (false, false, I64) => N::F64RoundI64,
        (false, false, U64) => N::F64RoundU64,
        (false, true, I8) => N::F64TruncI8,
        (false, true, U8) => N::F64TruncU8,
        (false, true, I16) => N::F64TruncI16,
        (false, true, U16) => N::F64TruncU16,
        (false, true, I32) => N::F64TruncI32,
        (false, true, U32) => N::F64TruncU32,
        (false, true, I64) => N::F64TruncI64,
        (false, true, U64) => N::F64TruncU64,
    }
}

/// An integer to REAL or LREAL. Narrow unsigned numbers are positive in 32 bits.
pub(crate) fn integer_to_float(from: IntegerType, to: ValueType) -> N {
    match (from, to == ValueType::F32) {
        (IntegerType::U32, true) => N::F32ConvertI32U,
        (IntegerType::U32, false) => N::F64ConvertI32U,
        (IntegerType::I64, true) => N::F32ConvertI64S,
        (IntegerType::I64, false) => N::F64ConvertI64S,
        (IntegerType::U64, true) => N::F32ConvertI64U,
        (IntegerType::U64, false) => N::F64ConvertI64U,
        (_, true) => N::F32ConvertI32S,
        (_, false) => N::F64ConvertI32S,
    }
}
