//! Seeded faults: what a search must find before its silence means anything.
//!
//! A generator that finds nothing has proved nothing until it has found a fault that is known to be there. Each row of the table is one
//! such fault in one crate; the place that has it asks [`planted`]. Without the feature `canary` (tests only: `cargo test -p khz-proof
//! --features canary`) that is the constant `false`, and the fault is not in the program. With the feature it still sleeps until a test of the
//! same thread plants it, so that the same build also shows what a sound tree does.
//!
//! The table stands here because every crate that can carry a fault sees this one.

macro_rules! faults {
    ($(($variant:ident, $text:literal)),* $(,)?) => {
        /// A fault that a test can plant.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Fault { $(#[doc = $text] $variant),* }

        impl Fault {
            /// Every fault, in the order of the table.
            pub const ALL: &'static [Fault] = &[$(Fault::$variant),*];

            /// What is wrong where it is planted, in one sentence.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self { $(Fault::$variant => $text),* }
            }
        }
    };
}

faults! {
    (Interp, "The interpreter rotates a 16-bit value by a constant count of its width or more as if the count were one larger."),
    (Jit, "The native engine leaves out the wrap to BOOL of a value that is known to fit USINT."),
    (Verifier, "The verifier takes a FOR loop's control variable as proven although a function called in the body writes it."),
    (Scheduler, "The scheduler counts a cycle that is collected exactly one interval late as not missed."),
    (Frontend, "The front end sign-extends a USINT where it is converted to a wider type."),
}

/// Whether the calling thread has planted this fault.
#[cfg(not(feature = "canary"))]
#[inline]
#[must_use]
pub const fn planted(_fault: Fault) -> bool {
    false
}

/// Work for another thread, in which what the calling thread has planted now is planted too.
#[cfg(not(feature = "canary"))]
#[inline]
pub fn carried<T, W: FnOnce() -> T>(work: W) -> W {
    work
}

#[cfg(feature = "canary")]
mod switch {
    use std::cell::Cell;

    use super::Fault;

    thread_local! {
        static PLANTED: Cell<Option<Fault>> = const { Cell::new(None) };
    }

    /// Whether the calling thread has planted this fault.
    #[must_use]
    pub fn planted(fault: Fault) -> bool {
        PLANTED.get() == Some(fault)
    }

    /// A fault that stays planted in the calling thread as long as this value lives.
    #[derive(Debug)]
    pub struct Planted(());

    /// Plants a fault in the calling thread, in place of another.
    #[must_use]
    pub fn plant(fault: Fault) -> Planted {
        PLANTED.set(Some(fault));
        Planted(())
    }

    /// Work for another thread, in which what the calling thread has planted now is planted too.
    pub fn carried<T>(work: impl FnOnce() -> T) -> impl FnOnce() -> T {
        let fault = PLANTED.get();
        move || {
            let _planted = fault.map(plant);
            work()
        }
    }

    impl Drop for Planted {
        fn drop(&mut self) {
            PLANTED.set(None);
        }
    }
}

#[cfg(feature = "canary")]
pub use switch::{Planted, carried, plant, planted};
