//! An allocator that lays memory images between pages that nobody may touch: an access outside ends the process.
//!
//! An image asks for its bytes as one zeroed block without alignment and begins at the first cache line in it. While [`Guarded::run`] is open, such blocks
//! of its thread get pages of their own, with a page without rights before and one behind. With [`Side::Before`] the image begins
//! where the page before ends. With [`Side::Behind`] it ends at most 64 bytes before the page behind: nearer its start would not lie on a cache
//! line. What lies between the block and the page was zero at first, and must be so when the block is given back.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

const PAGE_BYTES: usize = 4096;
const LINE_BYTES: usize = 64;
/// Guarded blocks that may live at once.
const MOST_BLOCKS: usize = 8192;

/// At which end of an image the page without rights is near.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    Before,
    Behind,
}

thread_local! {
    static SIDE: Cell<Option<Side>> = const { Cell::new(None) };
}

/// Addresses of the guarded blocks that live; 0 where a place is free.
static BLOCKS: [AtomicUsize; MOST_BLOCKS] = [const { AtomicUsize::new(0) }; MOST_BLOCKS];
static EVER: AtomicU64 = AtomicU64::new(0);

/// The allocator: `#[global_allocator] static ALLOCATOR: Guarded = Guarded;`.
pub struct Guarded;

impl Guarded {
    /// Runs `work` with its images between guard pages.
    pub fn run<T>(side: Side, work: impl FnOnce() -> T) -> T {
        let before = SIDE.replace(Some(side));
        let result = work();
        SIDE.set(before);
        result
    }

    /// Blocks that have lain between guard pages so far.
    pub fn blocks_ever() -> u64 {
        EVER.load(Ordering::Relaxed)
    }
}

/// Bytes of the pages of a block, the guards left out.
fn pages(layout: Layout) -> usize {
    (layout.size() + LINE_BYTES).next_multiple_of(PAGE_BYTES)
}

/// How far from its first page a block begins.
fn offset(layout: Layout, side: Side) -> usize {
    match side {
        Side::Before => 0,
        // One behind a line: the image begins 63 bytes further, and then has a byte of its block behind it.
        Side::Behind => (pages(layout) - layout.size() - 1) / LINE_BYTES * LINE_BYTES + 1,
    }
}

fn guarded(layout: Layout, side: Side) -> *mut u8 {
    let bytes = pages(layout) + 2 * PAGE_BYTES;
    let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS;
    // SAFETY: a new mapping anywhere touches nothing that is there.
    let start = unsafe { libc::mmap(null_mut(), bytes, libc::PROT_NONE, flags, -1, 0) };
    if start == libc::MAP_FAILED {
        return null_mut();
    }
    let first = start.cast::<u8>().wrapping_add(PAGE_BYTES);
    // SAFETY: these pages belong to the mapping that was just made.
    let opened = unsafe { libc::mprotect(first.cast(), pages(layout), libc::PROT_READ | libc::PROT_WRITE) };
    let block = first.wrapping_add(offset(layout, side));
    let free =
        |place: &&AtomicUsize| place.compare_exchange(0, block as usize, Ordering::AcqRel, Ordering::Relaxed).is_ok();
    if opened != 0 || !BLOCKS.iter().any(|place| free(&place)) {
        // SAFETY: the mapping that was just made, which nobody else knows.
        unsafe { libc::munmap(start, bytes) };
        return null_mut();
    }
    EVER.fetch_add(1, Ordering::Relaxed);
    block
}

/// Takes a block off the list; false when it is none of these.
fn take(block: *mut u8) -> bool {
    // Others lie on 16 bytes, and not at a page's start but by chance.
    let may_be = (block as usize).is_multiple_of(PAGE_BYTES) || block as usize % LINE_BYTES == 1;
    let is_it =
        |place: &AtomicUsize| place.compare_exchange(block as usize, 0, Ordering::AcqRel, Ordering::Relaxed).is_ok();
    may_be && BLOCKS.iter().any(is_it)
}

fn give_back(block: *mut u8, layout: Layout) {
    let side = if block as usize % LINE_BYTES == 1 { Side::Behind } else { Side::Before };
    let first = block.wrapping_sub(offset(layout, side));
    let behind = block.wrapping_add(layout.size());
    let rest = (first as usize + pages(layout)) - behind as usize;
    for at in 0..rest {
        // SAFETY: the bytes between the block and the guard page belong to its mapping.
        if unsafe { behind.wrapping_add(at).read() } != 0 {
            // Unwinding out of an allocator is not allowed.
            std::process::abort();
        }
    }
    // SAFETY: the mapping of a block that was on the list, which its owner gives back.
    unsafe { libc::munmap(first.wrapping_sub(PAGE_BYTES).cast(), pages(layout) + 2 * PAGE_BYTES) };
}

// SAFETY: blocks are the system's, or fresh pages of a mapping of their own, large enough for the layout; an alignment of 1 suits any address. A block
// goes back to where it came from: the list says which.
unsafe impl GlobalAlloc for Guarded {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promise is handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        let side = SIDE.get().filter(|_| layout.align() == 1 && layout.size() > LINE_BYTES);
        match side {
            Some(side) => guarded(layout, side),
            // SAFETY: the caller's promise is handed on.
            None => unsafe { System.alloc_zeroed(layout) },
        }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        if layout.align() == 1 && layout.size() > LINE_BYTES && take(block) {
            return give_back(block, layout);
        }
        // SAFETY: the caller's promise is handed on; the block is the system's.
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Images never grow. What else was guarded by chance stays so until it does.
        if layout.align() == 1 && layout.size() > LINE_BYTES && take(block) {
            // SAFETY: the caller gives a size that fits the alignment.
            let wanted = unsafe { Layout::from_size_align_unchecked(size, 1) };
            // SAFETY: the caller gives a size that is not 0.
            let larger = unsafe { System.alloc(wanted) };
            if !larger.is_null() {
                // SAFETY: both blocks have that many bytes and are apart.
                unsafe { larger.copy_from_nonoverlapping(block, layout.size().min(size)) };
            }
            give_back(block, layout);
            return larger;
        }
        // SAFETY: the caller's promise is handed on; the block is the system's.
        unsafe { System.realloc(block, layout, size) }
    }
}
