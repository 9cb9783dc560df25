//! Improvements of the mid-level form: one file each, each a function of a [`Function`](crate::mir::Function) and what it calls.
//!
//! [`Improver::run`] gives the order, [`Passes`] switches them one by one, for measuring and for finding a fault. Each is linear in the size of the function.

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

use crate::JitOptions;
use crate::build::{ProgramMemory, Scope};
use crate::mir::Function;

macro_rules! passes {
    ($($(#[$doc:meta])* $name:ident;)*) => {
        /// A set of passes: which run, or which changed something.
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

            /// Each name with whether the pass is in the set, in the order of [`Passes::NAMES`].
            pub fn rows(self) -> impl Iterator<Item = (&'static str, bool)> {
                [$((stringify!($name), self.$name)),*].into_iter()
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

/// Improves one function after the other, and remembers what helps with the next ones.
pub struct Improver<'a> {
    scope: &'a Scope<'a>,
    /// `None` where nothing is inlined.
    inliner: Option<inline::Inliner<'a>>,
    passes: Passes,
    fuel: bool,
    /// Passes that have changed a function so far, where that is noted.
    fired: Option<Passes>,
}

impl<'a> Improver<'a> {
    /// Passes over the functions of a container. `calls_virtual`: whether calls count their depth, so that none may vanish.
    #[must_use]
    pub fn new(scope: &'a Scope<'a>, options: JitOptions, calls_virtual: bool) -> Self {
        let JitOptions { passes, fuel, note_passes, .. } = options;
        let inliner = (passes.inline && !calls_virtual).then(|| inline::Inliner::new(scope));
        Improver { scope, inliner, passes, fuel, fired: note_passes.then_some(Passes::NONE) }
    }

    /// Passes that have changed a function so far; `None` when that is not noted.
    #[must_use]
    pub fn fired(&self) -> Option<Passes> {
        self.fired
    }

    /// Runs the passes on a function as it was built.
    pub fn run(&mut self, function: &mut Function, program: ProgramMemory) {
        let Improver { scope, inliner, passes, fuel, fired } = self;
        let effects = promote::CallEffects::new(scope.verified);
        macro_rules! steps {
            ($($name:ident $(if $also:expr)? => $run:expr;)*) => { $(
                if passes.$name $(&& $also)? {
                    // Names that a pass made up and dropped again are no change.
                    let before = fired.is_some().then(|| (function.blocks.clone(), function.loops.clone()));
                    $run;
                    if let (Some(fired), Some((blocks, loops))) = (fired.as_mut(), before) {
                        fired.$name |= blocks != function.blocks || loops != function.loops;
                    }
                }
            )* };
        }
        steps! {
            inline => if let Some(inliner) = inliner { inliner.run(function, program) };
            promote => promote::run(function, effects);
            fold => fold::run(function);
            checks => checks::run(function);
            deadlines => deadlines::run(function);
            vectorise if !*fuel => vectorise::run(function);
            for_loops => for_loops::run(function);
            fold => fold::run(function);
            if_convert => if_convert::run(function);
            threads => threads::run(function);
            repeats => repeats::run(function);
            bools => bools::run(function);
        }
    }
}
