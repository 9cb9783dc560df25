//! Registers, operations and image bytes as the dispatch loop reaches them: the only file of this crate with `unsafe`.
//!
//! The image is reached through bounds-checked slices always: one predicted branch an access is a small price for a second line of
//! defence behind the verifier. Registers and operations are reached without a check in release builds, because their numbers come
//! from this crate's own translation and never from a container; debug builds and the feature `checked` check them too.

use std::marker::PhantomData;

use crate::register_form::{FunctionEntry, Operation, Program};

/// Whether register and operation numbers are checked.
const CHECKED: bool = cfg!(any(debug_assertions, feature = "checked"));

/// Where the run stands in the operations of a program: the next operation.
///
/// A pointer instead of a number, so that fetching needs no arithmetic but the step itself.
pub(crate) struct Cursor<'a> {
    start: *const Operation,
    count: usize,
    next: *const Operation,
    operations: PhantomData<&'a [Operation]>,
}

impl<'a> Cursor<'a> {
    /// In front of the operation at `position`.
    ///
    /// # Safety
    /// Control flow that starts there must never leave `program.operations`: each jump target lies inside, the last operation of
    /// each function ends the call or jumps, and operations have the data behind them that they ask for with `fetch`.
    #[expect(unsafe_code, reason = "see the head of this file")]
    unsafe fn new(program: &'a Program, position: u32) -> Self {
        let operations = program.operations.as_slice();
        let start = operations.as_ptr();
        let mut cursor = Cursor { start, count: operations.len(), next: start, operations: PhantomData };
        cursor.jump(position);
        cursor
    }

    /// The same place.
    #[inline(always)]
    pub(crate) fn copy(&self) -> Self {
        Cursor { start: self.start, count: self.count, next: self.next, operations: PhantomData }
    }

    /// The next operation, and steps over it.
    #[inline(always)]
    #[expect(unsafe_code, reason = "see the head of this file")]
    pub(crate) fn fetch(&mut self) -> &'a Operation {
        if CHECKED {
            assert!((self.position() as usize) < self.count, "an operation outside the program");
        }
        // SAFETY: the caller of `new` promised that control flow stays inside.
        let operation = unsafe { &*self.next };
        // SAFETY: `next` is inside, so the place behind it is inside or at the end.
        self.next = unsafe { self.next.add(1) };
        operation
    }

    /// Goes to a position.
    #[inline(always)]
    #[expect(unsafe_code, reason = "see the head of this file")]
    pub(crate) fn jump(&mut self, position: u32) {
        if CHECKED {
            assert!((position as usize) < self.count, "a jump outside the program");
        }
        // SAFETY: the caller of `new` promised that jump targets are inside.
        self.next = unsafe { self.start.add(position as usize) };
    }

    /// Position of the next operation.
    #[inline(always)]
    pub(crate) fn position(&self) -> u32 {
        // A program has fewer than 2^32 operations: operands name them with 32 bits.
        ((self.next.addr() - self.start.addr()) / size_of::<Operation>()) as u32
    }
}

/// The cursor and the registers for a run from the start of `function`. None when the register file is too short for it.
#[expect(unsafe_code, reason = "see the head of this file")]
pub(crate) fn start<'a>(
    program: &'a Program,
    function: FunctionEntry,
    file: &'a mut [u64],
) -> Option<(Cursor<'a>, Registers<'a>)> {
    // SAFETY: the translation ends each function with a return or a jump, all its jumps go to blocks of the same function, and it puts
    // the data of an operation behind it. A `Program` comes from the translation only.
    let cursor = unsafe { Cursor::new(program, function.start) };
    // SAFETY: the translation names only registers below the window size in the function's entry, which each call enters with.
    let mut registers = unsafe { Registers::new(file) };
    registers.enter(0, function.registers).then_some((cursor, registers))
}

/// The register file, seen through the window of the running call.
///
/// The window is a pointer, so that the dispatch loop can keep it in one machine register. What is called out of line gets a
/// [`lend`](Self::lend) of it: a reference to the loop's own would force it into memory.
pub(crate) struct Registers<'a> {
    start: *mut u64,
    count: usize,
    window: *mut u64,
    file: PhantomData<&'a mut [u64]>,
}

impl<'a> Registers<'a> {
    /// The file, with an empty window at its start.
    ///
    /// # Safety
    /// After each [`enter`](Self::enter) with `count` registers, `get` and `set` must be asked only for registers below `count` until the
    /// next `enter` or `leave`; each `leave` must go back to a base that was entered before.
    #[expect(unsafe_code, reason = "see the head of this file")]
    unsafe fn new(file: &'a mut [u64]) -> Self {
        let start = file.as_mut_ptr();
        Registers { start, count: file.len(), window: start, file: PhantomData }
    }

    /// The same file and window for a function that is called meanwhile.
    #[inline(always)]
    pub(crate) fn lend(&mut self) -> Registers<'_> {
        Registers { start: self.start, count: self.count, window: self.window, file: PhantomData }
    }

    /// Position of the window in the file.
    #[inline(always)]
    pub(crate) fn base(&self) -> usize {
        (self.window.addr() - self.start.addr()) / size_of::<u64>()
    }

    /// Moves the window to `base`, where `count` registers are to be used. False, and nothing moved, when the file is too short.
    #[inline(always)]
    #[must_use]
    #[expect(unsafe_code, reason = "see the head of this file")]
    pub(crate) fn enter(&mut self, base: usize, count: u32) -> bool {
        let fits = base.saturating_add(count as usize) <= self.count;
        if fits {
            // SAFETY: `base` was just found to be inside the file or at its end.
            self.window = unsafe { self.start.add(base) };
        }
        fits
    }

    /// Moves the window back to that of a caller.
    #[inline(always)]
    #[expect(unsafe_code, reason = "see the head of this file")]
    pub(crate) fn leave(&mut self, base: usize) {
        if CHECKED {
            assert!(base <= self.count, "a window outside the register file");
        }
        // SAFETY: the caller of `new` promised that this base was entered before, and `enter` checked it.
        self.window = unsafe { self.start.add(base) };
    }

    /// A register of the window.
    #[inline(always)]
    #[expect(unsafe_code, reason = "see the head of this file")]
    fn at(&self, register: u32) -> *mut u64 {
        if CHECKED {
            assert!(self.base() + (register as usize) < self.count, "a register outside the register file");
        }
        // SAFETY: `enter` checked that the window lies in the file; the caller of `new` promised that the register is in the window.
        unsafe { self.window.add(register as usize) }
    }

    /// The bits in a register.
    #[inline(always)]
    #[expect(unsafe_code, reason = "see the head of this file")]
    pub(crate) fn get(&self, register: u32) -> u64 {
        // SAFETY: `at` gives a register of the file, which this borrows for reading.
        unsafe { *self.at(register) }
    }

    /// Puts bits into a register.
    #[inline(always)]
    #[expect(unsafe_code, reason = "see the head of this file")]
    pub(crate) fn set(&mut self, register: u32, bits: u64) {
        // SAFETY: `at` gives a register of the file, which this borrows for writing.
        unsafe { *self.at(register) = bits };
    }

    /// `count` registers of the window from `first` on.
    #[inline]
    #[expect(unsafe_code, reason = "see the head of this file")]
    pub(crate) fn range(&mut self, first: u32, count: u32) -> &mut [u64] {
        if CHECKED {
            assert!(self.base() + first as usize + count as usize <= self.count, "registers outside the register file");
        }
        // SAFETY: as in `at`; the caller of `new` promised that all of them are in the window.
        let start = unsafe { self.window.add(first as usize) };
        // SAFETY: they lie in the file, which this borrows for writing.
        unsafe { std::slice::from_raw_parts_mut(start, count as usize) }
    }

    /// Zeroes `count` registers from `first` on.
    #[inline]
    pub(crate) fn zero(&mut self, first: u32, count: u32) {
        self.range(first, count).fill(0);
    }

    /// Moves `count` registers from `first` on to the window's start.
    #[inline]
    pub(crate) fn move_to_start(&mut self, first: u32, count: u32) {
        (0..count).for_each(|register| self.set(register, self.get(first + register)));
    }
}

/// A number that a register holds as bits.
pub(crate) trait Lane: Copy {
    /// The number of these bits.
    fn from_bits(bits: u64) -> Self;
    /// Its bits, zero-extended.
    fn into_bits(self) -> u64;
}

macro_rules! lanes {
    ($($ty:ty: |$bits:ident| $from:expr, |$value:ident| $into:expr;)*) => { $(
        impl Lane for $ty {
            #[inline(always)]
            fn from_bits($bits: u64) -> Self { $from }

            #[inline(always)]
            fn into_bits(self) -> u64 {
                let $value = self;
                $into
            }
        }
    )* };
}
lanes! {
    i32: |bits| bits as i32, |value| u64::from(value as u32);
    i64: |bits| bits as i64, |value| value as u64;
    f32: |bits| f32::from_bits(bits as u32), |value| u64::from(value.to_bits());
    f64: |bits| f64::from_bits(bits), |value| value.to_bits();
}

/// A scalar as it lies in memory.
pub(crate) trait Scalar: Sized {
    /// Whether it has more than the 32 bits of an operand.
    const IS_WIDE: bool = size_of::<Self>() > size_of::<u32>();

    /// The bits of a register after a load.
    fn load(bytes: &[u8], at: usize) -> u64;
    /// Stores from the bits of a register.
    fn store(bytes: &mut [u8], at: usize, bits: u64);
}

macro_rules! scalars {
    ($($ty:ty: |$loaded:ident| $load:expr, |$bits:ident| $store:expr;)*) => { $(
        impl Scalar for $ty {
            #[inline(always)]
            fn load(bytes: &[u8], at: usize) -> u64 {
                let mut raw = [0; size_of::<$ty>()];
                raw.copy_from_slice(&bytes[at..at + size_of::<$ty>()]);
                let $loaded = <$ty>::from_le_bytes(raw);
                $load
            }

            #[inline(always)]
            fn store(bytes: &mut [u8], at: usize, $bits: u64) {
                bytes[at..at + size_of::<$ty>()].copy_from_slice(&($store).to_le_bytes());
            }
        }
    )* };
}
scalars! {
    i8: |value| u64::from(value as u32), |bits| bits as i8;
    u8: |value| u64::from(value), |bits| bits as u8;
    i16: |value| u64::from(value as u32), |bits| bits as i16;
    u16: |value| u64::from(value), |bits| bits as u16;
    i32: |value| u64::from(value as u32), |bits| bits as i32;
    i64: |value| value as u64, |bits| bits as i64;
    f32: |value| u64::from(value.to_bits()), |bits| bits as u32;
    f64: |value| value.to_bits(), |bits| bits;
}

impl Scalar for bool {
    #[inline(always)]
    fn load(bytes: &[u8], at: usize) -> u64 {
        u64::from(bytes[at] != 0)
    }

    #[inline(always)]
    fn store(bytes: &mut [u8], at: usize, bits: u64) {
        bytes[at] = u8::from(bits as u32 != 0);
    }
}
