//! What native code sees of the host: one structure, declared once; the lowering takes every offset from it.

use std::mem::{MaybeUninit, offset_of};
use std::sync::atomic::AtomicU32;

use khz_bytecode::limits::MAX_TRAP_CHAIN;

use crate::runtime::Virtuals;

/// Limits, trap record and host addresses of one run. Native code gets its address as second parameter.
///
/// What is only read after it was written starts without a value: a run of a short program is little more than the making of this.
#[derive(Debug)]
#[repr(C)]
pub struct Context {
    /// The word that ends the run when it is not 0.
    pub deadline: *const AtomicU32,
    /// Fuel units left.
    pub fuel: u64,
    /// Calls that are nested at the moment; the entry is 1. Kept only in code that calls virtually.
    pub depth: u32,
    /// The number that a trap has as its code: that of `TrapCode`, or [`OUT_OF_FUEL`].
    pub trap_code: u32,
    /// Where: a position in the engine's place table.
    pub trap_place: u32,
    /// How many calls lie around it; may exceed the chain's room.
    pub chain_len: u32,
    /// What explains the trap.
    pub trap_values: [i64; 3],
    /// First address behind the task's frame bytes.
    pub frame_limit: *mut u8,
    /// First byte of the image.
    pub image: *mut u8,
    /// Bytes of the image.
    pub image_bytes: u64,
    /// Where virtual calls go.
    pub virtuals: *const Virtuals,
    /// Code that the last look-up of a virtual call found; nothing before the first.
    pub found_code: MaybeUninit<*const u8>,
    /// Frame bytes of that code's function; nothing before the first look-up.
    pub found_frame_bytes: MaybeUninit<u64>,
    /// Places of the calls around the trap, innermost first: as many as `chain_len` says, of those that have room. The last entry takes all that have none.
    pub chain: [MaybeUninit<u32>; MAX_TRAP_CHAIN + 1],
}

/// Trap code of a charge larger than what is left; the host makes it *watchdog* and leaves no fuel.
pub const OUT_OF_FUEL: u32 = 0x100;

macro_rules! offsets {
    ($($(#[$doc:meta])* $name:ident = $field:ident;)*) => {
        $(
            $(#[$doc])*
            // The structure is smaller than 2 GiB, so each offset fits.
            pub const $name: i32 = offset_of!(Context, $field) as i32;
        )*
    };
}

offsets! {
    /// Byte offset of `deadline`.
    DEADLINE = deadline;
    /// Byte offset of `fuel`.
    FUEL = fuel;
    /// Byte offset of `depth`.
    DEPTH = depth;
    /// Byte offset of `trap_code`.
    TRAP_CODE = trap_code;
    /// Byte offset of `trap_place`.
    TRAP_PLACE = trap_place;
    /// Byte offset of `chain_len`.
    CHAIN_LEN = chain_len;
    /// Byte offset of `trap_values`.
    TRAP_VALUES = trap_values;
    /// Byte offset of `frame_limit`.
    FRAME_LIMIT = frame_limit;
    /// Byte offset of `found_code`.
    FOUND_CODE = found_code;
    /// Byte offset of `found_frame_bytes`.
    FOUND_FRAME_BYTES = found_frame_bytes;
    /// Byte offset of `chain`.
    CHAIN = chain;
}
