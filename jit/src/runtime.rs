//! Routines that native code calls. Their meaning stands in `khz_machine`; here they only get a C interface.
//!
//! This file may use `unsafe`: it turns the addresses that native code hands over back into slices. What native code may hand over
//! was proved by the verifier: references whose whole extent lies inside the image.

use std::slice;

use khz_bytecode::ids::MethodId;
use khz_bytecode::instruction::{HelperOp, NumericOp};
use khz_machine::instance_map::InstanceMap;
use khz_machine::semantics::{self, StringPlace};

use crate::context::Context;

/// Where virtual calls go: the instance map, and the code of each function that a method name can mean.
#[derive(Debug)]
pub struct Virtuals {
    /// Which function a method is for the instance at an address.
    pub map: InstanceMap,
    /// By function.
    pub entries: Vec<VirtualEntry>,
}

/// What a virtual call needs to know of a function.
#[derive(Debug, Clone, Copy)]
pub struct VirtualEntry {
    /// Its code; null when no method name means it.
    pub code: *const u8,
    /// Bytes of its own frame.
    pub frame_bytes: u32,
}

// SAFETY: the pointers name code, which never changes, and which whoever holds this also holds.
unsafe impl Send for Virtuals {}
// SAFETY: as above; nothing here is written after it is made.
unsafe impl Sync for Virtuals {}

/// One routine: its symbol and its address.
#[derive(Debug, Clone, Copy)]
pub struct Routine {
    /// Symbol in the module.
    pub name: &'static str,
    /// Its address in this process.
    pub address: *const u8,
}

/// Symbol of [`move_bytes`].
pub const MOVE_BYTES: &str = "khz.move_bytes";
/// Symbol of [`zero_bytes`].
pub const ZERO_BYTES: &str = "khz.zero_bytes";
/// Symbol of [`find_method`].
pub const FIND_METHOD: &str = "khz.find_method";

/// Moves bytes between two extents inside the image, which may overlap.
unsafe extern "C" fn move_bytes(destination: *mut u8, source: *const u8, size: u64) {
    // SAFETY: the verifier proved that both extents of `size` bytes lie inside the image, which outlives the run.
    unsafe { std::ptr::copy(source, destination, size as usize) };
}

/// Zeroes an extent inside the image.
unsafe extern "C" fn zero_bytes(destination: *mut u8, size: u64) {
    // SAFETY: the extent is a call's frame bytes, which lie inside the task's frame region.
    unsafe { std::ptr::write_bytes(destination, 0, size as usize) };
}

/// Looks up a virtual call; 1 when there is a method, whose code is then noted in the context.
unsafe extern "C" fn find_method(context: *mut Context, address: i64, method: u32) -> u32 {
    // SAFETY: native code passes on the context it was given, which outlives the run and which nobody else holds meanwhile.
    let context = unsafe { &mut *context };
    // SAFETY: the engine set this to a table that it owns.
    let virtuals = unsafe { &*context.virtuals };
    let method = u16::try_from(method).ok().map(MethodId);
    let found = method.and_then(|method| virtuals.map.find(address, method));
    let entry = found.and_then(|function| virtuals.entries.get(function.index()));
    match entry.filter(|entry| !entry.code.is_null()) {
        Some(entry) => {
            context.found_code.write(entry.code);
            context.found_frame_bytes.write(u64::from(entry.frame_bytes));
            1
        }
        None => 0,
    }
}

/// Rounds to nearest even, for CPUs that have no instruction for it.
extern "C" fn nearest_f32(value: f32) -> f32 {
    value.round_ties_even()
}

/// Rounds to nearest even, for CPUs that have no instruction for it.
extern "C" fn nearest_f64(value: f64) -> f64 {
    value.round_ties_even()
}

/// Stands for every symbol that is not on the list, so that nothing is ever looked up in the process. It is never called: the
/// lowering names only symbols of the list.
extern "C" fn unknown_symbol() -> ! {
    std::process::abort()
}

/// Where symbols lead that are not on the list.
#[must_use]
pub fn unknown() -> *const u8 {
    unknown_symbol as *const u8
}

/// A string operand: its offset in the image in the low half, its capacity above.
fn string_place(packed: u64) -> StringPlace {
    StringPlace { at: packed as u32, capacity: (packed >> 32) as u16 }
}

/// The image of a run as bytes.
///
/// # Safety
/// `context` is the context of the running code, and nobody else uses the image meanwhile.
unsafe fn image<'a>(context: *mut Context) -> &'a mut [u8] {
    // SAFETY: by the function's contract.
    let context = unsafe { &*context };
    // SAFETY: the engine set these two to the image it was lent for the run, and native code stands still meanwhile.
    unsafe { slice::from_raw_parts_mut(context.image, context.image_bytes as usize) }
}

/// Rust type of an operand as native code passes it.
macro_rules! abi {
    (Dst) => {
        u64
    };
    (Src) => {
        u64
    };
    (WideDst) => {
        u64
    };
    (WideSrc) => {
        u64
    };
    (I32) => {
        i32
    };
    (I64) => {
        i64
    };
    (F32) => {
        f32
    };
    (F64) => {
        f64
    };
    (Nothing) => {
        ()
    };
}
macro_rules! pass {
    (Dst, $value:ident) => {
        string_place($value)
    };
    (Src, $value:ident) => {
        string_place($value)
    };
    (WideDst, $value:ident) => {
        string_place($value)
    };
    (WideSrc, $value:ident) => {
        string_place($value)
    };
    ($other:ident, $value:ident) => {
        $value
    };
}

/// Gives each operand of a helper row a name, then defines the routine.
macro_rules! string_routine {
    ($function:ident $result:ident [] [$($names:ident)*] [$($name:ident: $kind:ident)*]) => {
        pub(super) unsafe extern "C" fn $function(context: *mut Context, $($name: abi!($kind)),*) -> abi!($result) {
            // SAFETY: native code passes on the context it was given.
            let memory = unsafe { image(context) };
            semantics::strings::$function(memory, $(pass!($kind, $name)),*)
        }
    };
    ($function:ident $result:ident [$kind:ident $($kinds:ident)*] [$name:ident $($names:ident)*] [$($done:tt)*]) => {
        string_routine!($function $result [$($kinds)*] [$($names)*] [$($done)* $name: $kind]);
    };
}

macro_rules! define_strings {
    ($(($code:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $cost:literal, $doc:literal)),* $(,)?) => {
        mod string_routines {
            use super::{Context, image, semantics, string_place};
            $( string_routine!($function $result [$($operand)*] [a b c d e] []); )*
        }

        /// The routine of a string instruction.
        #[must_use]
        pub fn string_routine(op: HelperOp) -> Routine {
            match op { $(HelperOp::$variant => Routine { name: $mnemonic, address: string_routines::$function as *const u8 },)* }
        }
    };
}
khz_bytecode::for_each_helper!(define_strings);

/// Defines the routine of a numeric row that never traps; those that may are compiled in place.
macro_rules! numeric_routine {
    (divide $function:ident $result:ident [$($kinds:ident)*]) => {};
    (total $function:ident $result:ident [$a:ident]) => {
        pub(super) extern "C" fn $function(a: abi!($a)) -> abi!($result) {
            semantics::$function(a)
        }
    };
    (total $function:ident $result:ident [$a:ident $b:ident]) => {
        pub(super) extern "C" fn $function(a: abi!($a), b: abi!($b)) -> abi!($result) {
            semantics::$function(a, b)
        }
    };
}
macro_rules! numeric_address {
    (divide $function:ident) => {
        None
    };
    (total $function:ident) => {
        Some(numeric_routines::$function as *const u8)
    };
}

macro_rules! define_numeric {
    ($(($code:literal, $variant:ident, $function:ident, $mnemonic:literal, [$($operand:ident)*] -> $result:ident, $traps:ident, $cost:literal, $doc:literal)),* $(,)?) => {
        mod numeric_routines {
            use super::semantics;
            $( numeric_routine!($traps $function $result [$($operand)*]); )*
        }

        /// The routine of a numeric instruction that never traps: what the lowering calls where it has no code of its own.
        #[must_use]
        pub fn numeric_routine(op: NumericOp) -> Option<Routine> {
            let address: Option<*const u8> = match op { $(NumericOp::$variant => numeric_address!($traps $function),)* };
            address.map(|address| Routine { name: op.mnemonic(), address })
        }
    };
}
khz_bytecode::for_each_numeric!(define_numeric);

/// Every routine that code may name.
#[must_use]
pub fn all() -> Vec<Routine> {
    let own = [
        Routine { name: MOVE_BYTES, address: move_bytes as *const u8 },
        Routine { name: ZERO_BYTES, address: zero_bytes as *const u8 },
        Routine { name: FIND_METHOD, address: find_method as *const u8 },
        Routine { name: "NearestF32", address: nearest_f32 as *const u8 },
        Routine { name: "NearestF64", address: nearest_f64 as *const u8 },
    ];
    let strings = HelperOp::ALL.iter().map(|op| string_routine(*op));
    let numbers = NumericOp::ALL.iter().filter_map(|op| numeric_routine(*op));
    own.into_iter().chain(strings).chain(numbers).collect()
}
