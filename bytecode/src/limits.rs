//! Every limit of the system, once, with the assertions that hold between them.

/// Cap of a resource's memory image in bytes unless the host raises it (`--max-image`).
pub const MAX_IMAGE_BYTES: u64 = 256 << 20;
/// Bytes at the start of the data region that are never allocated, so that reference 0 is NULL and small offsets from it miss.
pub const NULL_GUARD_BYTES: u32 = 16;
/// Bytes of one slot.
pub const SLOT_BYTES: u32 = 8;
/// Alignment of regions inside the memory image, in bytes (one cache line).
pub const REGION_ALIGN_BYTES: u32 = 64;
/// Alignment of a call's frame bytes.
pub const FRAME_ALIGN_BYTES: u32 = 8;
/// Largest number of dimensions of an array.
pub const MAX_DIMENSIONS: usize = 8;
/// Deepest nesting of types (a structure in an array in a structure…).
pub const MAX_TYPE_DEPTH: usize = 64;
/// Most alternatives that nested unions may multiply to: what a lookup in them may have to try.
pub const MAX_UNION_ALTERNATIVES: u32 = 256;
/// Deepest nesting of loops in a function.
pub const MAX_LOOP_DEPTH: u16 = 64;
/// Most results of a function.
pub const MAX_RESULTS: usize = 1024;
/// Most `l` slots that hold references beside the parameters of one function.
pub const MAX_REFERENCE_LOCALS: usize = 1024;
/// Most function block instances that the verifier lists one by one, and most steps of a proof that need not succeed.
pub const MAX_BLOCK_INSTANCES: usize = 1 << 20;
/// Most entries that the verifier's lists (stacks at block starts, effects of functions) may have in total.
pub const MAX_ANALYSIS_ENTRIES: usize = 8 << 20;
/// Largest operand stack a function may need.
pub const MAX_STACK_DEPTH: u16 = 4096;
/// Largest call nesting a container may ask for.
pub const MAX_CALL_DEPTH: u16 = 1024;
/// Most operands of one `switch`.
pub const MAX_SWITCH_TARGETS: u32 = 65_536;
/// Largest declared length of a STRING, in characters.
pub const MAX_STRING_LENGTH: u32 = 65_535;
/// Places that a trap report keeps of the call chain, innermost first.
pub const MAX_TRAP_CHAIN: usize = 16;
/// Longest name of a task, in bytes of UTF-8.
pub const MAX_TASK_NAME_BYTES: usize = 255;
/// Shortest INTERVAL of a task, in microseconds.
pub const MIN_INTERVAL_US: u64 = 1;
/// Watchdog of initialisation and startup functions when none is given, in microseconds.
pub const STARTUP_WATCHDOG_US: u64 = 1_000_000;

const _: () = assert!(NULL_GUARD_BYTES >= SLOT_BYTES);
const _: () = assert!(REGION_ALIGN_BYTES.is_multiple_of(FRAME_ALIGN_BYTES));
const _: () = assert!(MAX_STRING_LENGTH <= u16::MAX as u32);
