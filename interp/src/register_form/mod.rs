//! The register form: what the interpreter runs. Private to this crate and rebuilt at each load; no file holds it.
//!
//! An operation is 16 bytes: a code, a small number `x` and three 32-bit operands (`dst`, `a`, `b`), mostly registers of the running
//! call's window. Operations on array elements have the array's bounds and strides behind them, as operations of code `Data`.
//! Window of a call: `this` (functions of a block only), the `L` slots, the bases that the function needs (program slots, data block,
//! frame bytes), the slots that it holds (`translate/held.rs`), then one register for each depth of the operand stack. A callee's
//! window starts at its first argument, so arguments and results move nowhere. Registers hold bits: 32-bit values zero-extended,
//! references as image offsets.
//!
//! What does not fit an operand stands in side tables of [`Program`] and is named by position.

pub(crate) mod table;

use khz_bytecode::instruction::{HelperOp, NumericOp};
use khz_bytecode::value::{IntegerType, Storage};

use table::for_each_operation;

/// One operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub(crate) struct Operation {
    /// What to do.
    pub code: Code,
    /// A small number: flag, bit, step.
    pub x: i16,
    /// Register of the result; jump target of branches; register of the value for stores.
    pub dst: u32,
    /// First operand.
    pub a: u32,
    /// Second operand.
    pub b: u32,
}

const _: () = assert!(size_of::<Operation>() == 16);

macro_rules! define_code {
    (
        [$(($opcode:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $traps:ident, $cost:literal, $doc:literal)),*]
        [$(($storage:ident, $ty:ty, $load:ident, $load_based:ident, $load_element:ident, $load_element_based:ident,
            $load_plane:ident, $load_plane_based:ident, $store:ident, $store_based:ident, $store_element:ident,
            $store_element_based:ident, $store_plane:ident, $store_plane_based:ident, $store_const:ident, $store_based_const:ident)),*]
        [$(($float:ident, $float_ty:ty, $canonical:ident, $foreign:ident, $foreign_based:ident, $foreign_element:ident, $foreign_element_based:ident,
            $foreign_plane:ident, $foreign_plane_based:ident)),*]
        [$(($compare:ident, $compare_function:ident, [$($compare_operand:ident)*], $if_:ident, $unless:ident, $if_const:ident, $unless_const:ident)),*]
        [$(($on_element:ident, $on_function:ident, $on_ty:ty, $on_load:ident, $on_load_plane:ident, $with_element:ident, $with_plane:ident, $commutes:literal)),*]
        [$(($sum:ident, $sum_add:ident, $sum_multiply:ident, $sum_ty:ty, $sum_product:ident, $sum_product_plane:ident, $sum_element:ident, $sum_plane:ident)),*]
    ) => {
        /// What an operation does. Numeric rows appear twice: `I32Add` reads both operands from registers, `i32_add` takes the last one
        /// from `b` (32-bit types) or from constant number `b` (64-bit types).
        #[allow(non_camel_case_types, reason = "the table has two names for each numeric row, which are the names of its two forms")]
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u16)]
        pub(crate) enum Code {
            $($variant, $function,)*
            $($load, $load_based, $load_element, $load_element_based, $load_plane, $load_plane_based,
            $store, $store_based, $store_element, $store_element_based, $store_plane, $store_plane_based, $store_const, $store_based_const,)*
            $($foreign, $foreign_based, $foreign_element, $foreign_element_based, $foreign_plane, $foreign_plane_based,)*
            $($if_, $unless, $if_const, $unless_const,)*
            $($with_element, $with_plane,)*
            $($sum_element, $sum_plane,)*
            /// Start of a function: deadline; zeroes `a` registers from `dst` on and `b` frame bytes.
            Enter,
            /// Start of a loop's pass: deadline.
            Header,
            /// Takes `a` units of fuel.
            Charge,
            /// `dst` := start of the instance's program slots.
            ProgramBase,
            /// `dst` := start of the instance's data block.
            BlockBase,
            /// `dst` := start of the call's frame bytes.
            FrameBase,
            /// `dst` := `a`.
            Move,
            /// `dst` := the 64-bit number of `a` (low half) and `b` (high half).
            Constant,
            /// `dst` := reference `a` moved by `b` bytes.
            Offset,
            /// `dst` := reference to the element with index `a` (a register) + `x` of the array that the data operation behind it
            /// describes, counted from the image's start.
            Index,
            /// As `Index`, counted from the reference in `b`.
            IndexBased,
            /// As `IndexBased`, or as `Index` when `b` is `u32::MAX`, with a stride over 16 bits: the data says 1, and second data behind
            /// it has the stride in `a`.
            IndexWide,
            /// Not run but read by the operation in front of it. One dimension of an array: `a` lower bound, `b` upper bound - lower
            /// bound, `x` bytes from one element to the next (unsigned); `dst` for the first dimension the offset of the first element's
            /// accessed part, for the second one the register of the index.
            Data,
            /// `dst` := register `x` + `a` * `b`, with two roundings.
            F32MulAdd,
            /// As `F32MulAdd`.
            F64MulAdd,
            /// `dst` := register `x` or (`a` and `b`).
            OrAnd,
            /// `dst` := register `x` or (`a` and (`b` = 0)).
            OrAndNot,
            /// `dst` := `a` and (`b` = 0).
            AndNot,
            /// `dst` := `a` or (`b` = 0).
            OrNot,
            /// Brings the slots of rows `a` .. `b` of the slot runs into registers.
            BringSlots,
            /// Puts the written ones of these slots back into the image.
            PutSlotsBack,
            /// `dst` := bit `b` of byte `a` of the image.
            LoadBit,
            /// Bit `b` of byte `a` of the image := `dst` <> 0.
            StoreBit,
            /// `dst` := reference of integer `a` to `b` bytes, writable when `x` is 1.
            ReferenceCheck,
            /// Copies `b` bytes from reference `a` to reference `dst`.
            Copy,
            /// If `a` is zero: `dst` := `b`.
            SelectUnless,
            /// Checks the integer `a` against range number `b`.
            CheckRange,
            /// String helper number `x` on operands from register `a` on, capacities number `b`; result to `dst`.
            Helper,
            /// Goes to `dst`.
            Jump,
            /// Ends a loop's pass: deadline at the header before `dst`, then goes to `dst`.
            Repeat,
            /// Goes to `dst` if `a` (i32) is not zero.
            JumpIf,
            /// Goes to `dst` if `a` (i32) is zero.
            JumpUnless,
            /// Goes to `dst` if `a` (i32) has one of the bits `b`.
            JumpIfMasked,
            /// Goes to `dst` if `a` (i32) has none of the bits `b`.
            JumpUnlessMasked,
            /// Goes to entry min(`a`, `dst` - 1) of the jump table from `b` on.
            Switch,
            /// Starts FOR loop number `a` with initial value, bound and step in the registers from `b` on; `dst` is its exit.
            ForEnter,
            /// Ends a pass of FOR loop number `a`; `dst` as in `Repeat`.
            ForNext,
            /// `ForNext` of a loop whose 32-bit control variable is register `a`, its bound register `b`, its step `x`.
            ForNextI32,
            /// As `ForNextI32` for a 16-bit control variable.
            ForNextI16,
            /// As `ForNextI32` for a control variable at offset `a` of the instance's program slots.
            ForNextProgramI32,
            /// As `ForNextProgramI32` for a 16-bit control variable.
            ForNextProgramI16,
            /// Calls function `b`; its window starts at register `a`, its frame bytes `dst` bytes behind this call's.
            Call,
            /// Calls method `b` of the instance whose address is in register `a`; otherwise as `Call`.
            CallVirtual,
            /// Ends the call.
            Return,
            /// Ends the call with the result `a`.
            ReturnOne,
            /// Ends the call with `b` results from register `a` on.
            ReturnMany,
        }

        /// The operation that takes its operands from registers.
        pub(crate) fn numeric_code(op: NumericOp) -> Code {
            match op { $(NumericOp::$variant => Code::$variant,)* }
        }

        /// The operation that takes its last operand from the operation itself.
        pub(crate) fn numeric_const_code(op: NumericOp) -> Code {
            match op { $(NumericOp::$variant => Code::$function,)* }
        }

        /// The operations on scalars of a storage.
        pub(crate) fn access_codes(storage: Storage) -> AccessCodes {
            match storage { $(Storage::$storage => AccessCodes {
                load: LoadCodes {
                    image: Code::$load, based: Code::$load_based, element: Code::$load_element, element_based: Code::$load_element_based,
                    plane: Code::$load_plane, plane_based: Code::$load_plane_based,
                },
                store: LoadCodes {
                    image: Code::$store, based: Code::$store_based, element: Code::$store_element, element_based: Code::$store_element_based,
                    plane: Code::$store_plane, plane_based: Code::$store_plane_based,
                },
            },)* }
        }

        /// The stores of a constant: to an image offset, from a register. `dst` is the value, or for 64 bits its number in the constants.
        pub(crate) fn constant_store_codes(storage: Storage) -> (Code, Code) {
            match storage { $(Storage::$storage => (Code::$store_const, Code::$store_based_const),)* }
        }

        /// The loads of a storage from where any NaN may stand.
        pub(crate) fn foreign_load_codes(storage: Storage) -> LoadCodes {
            match storage {
                $(Storage::$float => LoadCodes {
                    image: Code::$foreign, based: Code::$foreign_based, element: Code::$foreign_element, element_based: Code::$foreign_element_based,
                    plane: Code::$foreign_plane, plane_based: Code::$foreign_plane_based,
                },)*
                _ => access_codes(storage).load,
            }
        }

        /// A numeric operation on registers whose last operand the operation `load` brings from an array: the operation on the
        /// element itself, and whether the operands may change places.
        pub(crate) fn element_operand_code(code: Code, load: Code) -> Option<(Code, bool)> {
            Some(match (code, load) {
                $((Code::$on_element, Code::$on_load) => (Code::$with_element, $commutes),)*
                $((Code::$on_element, Code::$on_load_plane) => (Code::$with_plane, $commutes),)*
                _ => return None,
            })
        }

        /// The operation that adds to its own result register the product that `product` computes.
        pub(crate) fn sum_code(add: Code, product: Code) -> Option<Code> {
            Some(match (add, product) {
                $((Code::$sum, Code::$sum_product) => Code::$sum_element,)*
                $((Code::$sum, Code::$sum_product_plane) => Code::$sum_plane,)*
                _ => return None,
            })
        }

        /// The branches that a comparison can be fused with: (if, unless).
        pub(crate) fn branch_codes(comparison: Code) -> Option<(Code, Code)> {
            Some(match comparison {
                $(Code::$compare => (Code::$if_, Code::$unless), Code::$compare_function => (Code::$if_const, Code::$unless_const),)*
                _ => return None,
            })
        }
    };
}
macro_rules! with_own_rows {
    ($($numeric:tt),* $(,)?) => { for_each_operation!(@own define_code, [$($numeric),*]); };
}
khz_bytecode::for_each_numeric!(with_own_rows);

/// One operation for each way to name a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LoadCodes {
    /// `a` is an image offset.
    pub image: Code,
    /// `a` is a register, `b` an offset.
    pub based: Code,
    /// `a` is the register of an index, to which `x` is added; the array's dimension stands behind the operation as `Data`.
    pub element: Code,
    /// As `element`; offsets count from the reference in `b`.
    pub element_based: Code,
    /// As `element` with two dimensions; `x` is 0.
    pub plane: Code,
    /// As `plane`; offsets count from the reference in `b`.
    pub plane_based: Code,
}

/// The operations on scalars of one storage.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AccessCodes {
    /// Loads to `dst`.
    pub load: LoadCodes,
    /// Stores of `dst`.
    pub store: LoadCodes,
}

/// Neighbouring slots of one storage that live in neighbouring registers while a function runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SlotRun {
    /// Register of the first one.
    pub register: u32,
    /// How many.
    pub count: u32,
    /// Offset of the first one, from the image's start or from the program instance's slots.
    pub offset: u32,
    /// Whether the offset counts from the program instance's slots.
    pub of_program: bool,
    /// Whether the function writes them.
    pub is_written: bool,
    /// How they lie in memory.
    pub storage: Storage,
}

/// Which slots live in registers while a function runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct HeldSlots {
    /// The first of its rows in the slot runs.
    pub first: u32,
    /// Behind the last of its rows.
    pub end: u32,
    /// Position of the operation that brings them.
    pub brought_at: u32,
}

/// The operands of `check.i32` and `check.i64`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RangeCheck {
    /// Type that gives the order.
    pub kind: IntegerType,
    /// Lower bound as a carrier.
    pub lower: i64,
    /// Upper bound as a carrier.
    pub upper: i64,
}

/// Where the control variable of a FOR loop is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Control {
    /// In a register.
    Register(u32),
    /// At an image offset.
    Image(u32),
    /// At an offset from a register.
    Based(u32, u32),
}

/// One FOR loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ForAccess {
    /// Type of the control variable.
    pub kind: IntegerType,
    /// The control variable.
    pub control: Control,
    /// Register of the bound.
    pub bound: u32,
    /// Register of the step.
    pub step: u32,
}

/// Where a function starts and what a call of it needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct FunctionEntry {
    /// Position of its first operation.
    pub start: u32,
    /// Registers of its window.
    pub registers: u32,
    /// Bytes of its frame.
    pub frame_bytes: u32,
}

/// All functions of a container in register form.
#[derive(Debug, Clone, Default)]
pub(crate) struct Program {
    /// All operations, function behind function.
    pub operations: Vec<Operation>,
    /// For each operation the offset of the instruction that it came from, for trap places.
    pub origins: Vec<u32>,
    /// By function id; `start` ascends.
    pub functions: Vec<FunctionEntry>,
    /// 64-bit operands.
    pub constants: Vec<u64>,
    /// Slots that live in registers, function behind function.
    pub slot_runs: Vec<SlotRun>,
    /// For each function its part of `slot_runs`.
    pub held: Vec<HeldSlots>,
    /// Range checks.
    pub ranges: Vec<RangeCheck>,
    /// FOR loops.
    pub for_loops: Vec<ForAccess>,
    /// Targets of switches.
    pub jump_table: Vec<u32>,
    /// Capacities of string operands.
    pub capacities: Vec<[u16; khz_bytecode::instruction::MAX_CAPACITIES]>,
    /// Registers that the deepest nesting of calls needs.
    pub register_count: usize,
}

impl Program {
    /// Bytes of everything that running it reads.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.operations.as_slice())
            + size_of_val(self.functions.as_slice())
            + size_of_val(self.constants.as_slice())
            + size_of_val(self.slot_runs.as_slice())
            + size_of_val(self.ranges.as_slice())
            + size_of_val(self.for_loops.as_slice())
            + size_of_val(self.jump_table.as_slice())
            + size_of_val(self.capacities.as_slice())
    }

    /// The function that an operation belongs to.
    pub(crate) fn function_at(&self, position: u32) -> usize {
        self.functions.partition_point(|function| function.start <= position).saturating_sub(1)
    }

    /// The operations as text, one a line: for tests and for people who look for what to improve.
    pub(crate) fn listing(&self) -> String {
        use std::fmt::Write;
        let mut out = String::new();
        for (at, (operation, origin)) in self.operations.iter().zip(&self.origins).enumerate() {
            if let Some(function) = self.functions.iter().position(|function| function.start as usize == at) {
                // Writing to a String can not fail.
                let _ = writeln!(out, "function {function}: {} registers", self.functions[function].registers);
            }
            let Operation { code, x, dst, a, b } = operation;
            let _ = writeln!(out, "{at:5} @{origin:<5} {code:?} x={x} dst={dst} a={a} b={b}");
        }
        out
    }
}

/// The helper of an operation's `x`.
pub(crate) fn helper_number(op: HelperOp) -> i16 {
    // There are a few dozen helpers, and ALL holds each of them.
    HelperOp::ALL.iter().position(|other| *other == op).map_or(0, |at| at as i16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_comparison_of_the_table_has_its_branches() {
        let relations = ["eq", "ne", "lt", "le", "gt", "ge"];
        for op in NumericOp::ALL {
            let (_, name) = op.mnemonic().split_once('.').unwrap();
            let name = name.trim_end_matches("_s").trim_end_matches("_u");
            let is_comparison = relations.contains(&name);
            assert_eq!(branch_codes(numeric_code(*op)).is_some(), is_comparison, "{op:?}");
            assert_eq!(branch_codes(numeric_const_code(*op)).is_some(), is_comparison, "{op:?}");
        }
    }
}
