//! Improvements of the mid-level form: one file each, each a function of a [`Function`](crate::mir::Function) and what it calls.
//!
//! [`run`] gives the order, [`Passes`] switches them one by one, for measuring and for finding a fault. Each is linear in the size of the function.

pub mod bools;
pub mod checks;
pub mod deadlines;
pub mod fold;
pub mod for_loops;
pub mod if_convert;
pub mod inline;
pub mod promote;
pub mod ranges;
pub mod repeats;
pub mod threads;
pub mod vectorise;

use khz_bytecode::verify::Verified;

use crate::mir::Function;

macro_rules! passes {
    ($($(#[$doc:meta])* $name:ident;)*) => {
        /// Which passes run.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct Passes { $($(#[$doc])* pub $name: bool,)* }

        impl Passes {
            /// All of them.
            pub const ALL: Passes = Passes { $($name: true),* };
            /// None: each instruction as it stands in the bytecode.
            pub const NONE: Passes = Passes { $($name: false),* };
            /// Their names, in the order in which they first run.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),*];

            /// The passes with one more, by its name.
            #[must_use]
            pub fn with(mut self, name: &str) -> Option<Passes> {
                match name {
                    $(stringify!($name) => self.$name = true,)*
                    _ => return None,
                }
                Some(self)
            }
        }
    };
}

passes! {
    /// [`inline`]: small functions where they are called. Runs before all others, on what is built.
    inline;
    /// [`promote`]: slots in variables while a loop runs.
    promote;
    /// [`fold`]: constants, wraps that change nothing, decided branches.
    fold;
    /// [`for_loops`]: FOR loops as plain arithmetic.
    for_loops;
    /// [`checks`]: guards that can not fire.
    checks;
    /// [`deadlines`]: no look at the deadline in loops that are short by proof.
    deadlines;
    /// [`vectorise`]: loops over independent elements in vectors. Not in code that charges fuel.
    vectorise;
    /// [`if_convert`]: short integer IFs as selects.
    if_convert;
    /// [`threads`]: no question where the answer was just set.
    threads;
    /// [`repeats`]: guards that were passed before.
    repeats;
    /// [`bools`]: NOT of a BOOL without a test.
    bools;
}

impl Default for Passes {
    fn default() -> Self {
        Passes::ALL
    }
}

/// Runs the passes on a function. `fuel`: whether its code charges fuel.
pub fn run(function: &mut Function, verified: &Verified, passes: Passes, fuel: bool) {
    if passes.promote {
        promote::run(function, promote::CallEffects::new(verified));
    }
    if passes.fold {
        fold::run(function);
    }
    if passes.checks {
        checks::run(function);
    }
    if passes.deadlines {
        deadlines::run(function);
    }
    if passes.vectorise && !fuel {
        vectorise::run(function);
    }
    if passes.for_loops {
        for_loops::run(function);
    }
    if passes.fold {
        fold::run(function);
    }
    if passes.if_convert {
        if_convert::run(function);
    }
    if passes.threads {
        threads::run(function);
    }
    if passes.repeats {
        repeats::run(function);
    }
    if passes.bools {
        bools::run(function);
    }
}
