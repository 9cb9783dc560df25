//! Improvements of the mid-level form: one file each, each a function of a [`Function`](crate::mir::Function) and what it calls.
//!
//! [`Improver`] gives the order, [`Passes`] switches them one by one, for measuring and for finding a fault. Each is linear in the size of the
//! function; long functions are [cut](crate::cut) into parts between inlining and the rest.

pub mod bools;
pub mod checks;
pub mod deadlines;
pub mod fold;
pub mod for_loops;
pub mod forward;
pub mod if_convert;
pub mod inline;
pub mod promote;
pub mod ranges;
pub mod repeats;
pub mod threads;
pub mod vectorise;

use crate::build::{ProgramMemory, Scope};
use crate::mir::Function;
use crate::{JitOptions, cut};

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
    /// [`forward`]: a load shortly behind a store takes the value from there.
    forward;
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
    options: JitOptions,
    /// Passes that have changed a function so far, where that is noted.
    fired: Option<Passes>,
}

impl<'a> Improver<'a> {
    /// Passes over the functions of a container. `calls_virtual`: whether calls count their depth, so that none may vanish.
    #[must_use]
    pub fn new(scope: &'a Scope<'a>, options: JitOptions, calls_virtual: bool) -> Self {
        let inliner = (options.passes.inline && !calls_virtual).then(|| inline::Inliner::new(scope));
        Improver { scope, inliner, options, fired: options.note_passes.then_some(Passes::NONE) }
    }

    /// Passes that have changed a function so far; `None` when that is not noted.
    #[must_use]
    pub fn fired(&self) -> Option<Passes> {
        self.fired
    }

    /// Runs the passes on a function as it was built; gives the parts that it was cut into, callees before callers.
    pub fn run(&mut self, function: &mut Function, program: ProgramMemory) -> Vec<Function> {
        self.noting(
            function,
            |fired| &mut fired.inline,
            |improver, function| {
                if let Some(inliner) = &mut improver.inliner {
                    inliner.run(function, program);
                }
            },
        );
        let mut parts = cut::run(function, self.options.part_items);
        for number in 0..parts.len() {
            let (before, rest) = parts.split_at_mut(number);
            if let Some(part) = rest.first_mut() {
                self.improve(part, before);
            }
        }
        self.improve(function, &parts);
        parts
    }

    /// Runs what works on one function, which calls parts.
    fn improve(&mut self, function: &mut Function, parts: &[Function]) {
        let JitOptions { passes, fuel, .. } = self.options;
        let effects = promote::CallEffects::new(self.scope.verified, parts);
        macro_rules! steps {
            ($($name:ident $(if $also:expr)? => $run:expr;)*) => { $(
                if passes.$name $(&& $also)? {
                    self.noting(function, |fired| &mut fired.$name, |_, function| ($run)(function));
                }
            )* };
        }
        steps! {
            promote => |function: &mut Function| promote::run(function, effects);
            fold => fold::run;
            checks => checks::run;
            deadlines => deadlines::run;
            vectorise if !fuel => vectorise::run;
            for_loops => for_loops::run;
            forward => forward::run;
            fold => fold::run;
            if_convert => if_convert::run;
            threads => threads::run;
            repeats => repeats::run;
            bools => bools::run;
        }
    }

    /// Runs a pass and notes whether it changed the function.
    fn noting(
        &mut self,
        function: &mut Function,
        row: fn(&mut Passes) -> &mut bool,
        pass: impl FnOnce(&mut Self, &mut Function),
    ) {
        // Names that a pass made up and dropped again are no change.
        let before = self.fired.map(|_| (function.blocks.clone(), function.loops.clone()));
        pass(self, function);
        if let (Some(fired), Some((blocks, loops))) = (&mut self.fired, before) {
            *row(fired) |= blocks != function.blocks || loops != function.loops;
        }
    }
}
