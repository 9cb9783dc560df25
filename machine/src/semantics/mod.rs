//! What each instruction means: one pure function for each row of the numeric and helper tables, and the rules that
//! control and memory instructions share.
//!
//! Engines inline these functions, call them, or emit code for which these are the model; nobody else defines a meaning.
//! The dispatchers here are derived from the tables, so a row without its function does not compile.

mod calendar;
mod control;
mod convert;
mod float;
mod integer;
mod memory;
pub(crate) mod parse;
mod search;
pub mod strings;
mod text;
mod value;

use khz_bytecode::instruction::{HelperOp, NumericOp};
use khz_bytecode::trap::TrapCode;

pub use calendar::*;
pub use control::*;
pub use convert::*;
pub use float::*;
pub use integer::*;
pub use memory::*;
pub use parse::parse_time;
pub use strings::StringPlace;
pub use text::{TextBuffer, write_f32, write_f64, write_time};
pub use value::{Operand, Value};

/// Defines the functions of table rows: `name(operands) -> result = expression;`. The row holds the words; here stands the meaning.
macro_rules! operations {
    ($($name:ident($($operand:ident: $ty:ty),*) -> $result:ty = $body:expr;)*) => { $(
        #[doc = concat!("The meaning of the row `", stringify!($name), "` of the instruction table.")]
        #[inline]
        #[allow(clippy::missing_errors_doc, reason = "the table's column `traps` says it: divide by zero")]
        pub fn $name($($operand: $ty),*) -> $result { $body }
    )* };
}
use operations;

/// Wraps what a numeric function returns, by the column `traps` of its row.
macro_rules! numeric_result {
    (total, $call:expr) => {
        Ok($call.into_value())
    };
    (divide, $call:expr) => {
        $call.map(Operand::into_value)
    };
}

macro_rules! define_eval_numeric {
    ($(($code:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $traps:ident, $cost:literal, $doc:literal)),* $(,)?) => {
        /// Computes one numeric instruction from its operands, first pushed first. For callers that meet operations one at a time;
        /// operands of the wrong type count as their bits, missing ones as 0.
        ///
        /// # Errors
        /// The trap that the row names.
        pub fn eval_numeric(op: NumericOp, operands: &[Value]) -> Result<Value, TrapCode> {
            let mut operands = operands.iter().copied();
            match op { $(
                NumericOp::$variant => numeric_result!($traps, $function($(take_operand!($operand, operands)),*)),
            )* }
        }
    };
}
macro_rules! take_operand {
    ($variant:ident, $operands:ident) => {
        Operand::from_value($operands.next().unwrap_or(Value::I64(0)))
    };
}
khz_bytecode::for_each_numeric!(define_eval_numeric);

/// Wraps what a helper returns, by its row's result.
macro_rules! helper_result {
    (Nothing, $call:expr) => {{
        $call;
        None
    }};
    ($result:ident, $call:expr) => {
        Some($call.into_value())
    };
}
/// The next argument of a helper: a place for a string, else a value.
macro_rules! take_argument {
    (Dst, $strings:ident, $values:ident) => {
        $strings.next().unwrap_or_default()
    };
    (Src, $strings:ident, $values:ident) => {
        $strings.next().unwrap_or_default()
    };
    (WideDst, $strings:ident, $values:ident) => {
        $strings.next().unwrap_or_default()
    };
    (WideSrc, $strings:ident, $values:ident) => {
        $strings.next().unwrap_or_default()
    };
    ($variant:ident, $strings:ident, $values:ident) => {
        take_operand!($variant, $values)
    };
}

macro_rules! define_eval_helper {
    ($(($code:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $cost:literal, $doc:literal)),* $(,)?) => {
        /// Does one string instruction on the bytes of an image: `places` are its strings, `values` the others, each in
        /// operand order. Missing ones count as empty, or as 0.
        pub fn eval_helper(op: HelperOp, memory: &mut [u8], places: &[StringPlace], values: &[Value]) -> Option<Value> {
            let mut places = places.iter().copied();
            let mut values = values.iter().copied();
            match op { $(
                HelperOp::$variant => helper_result!($result, strings::$function(memory, $(take_argument!($operand, places, values)),*)),
            )* }
        }
    };
}
khz_bytecode::for_each_helper!(define_eval_helper);
