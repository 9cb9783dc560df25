//! The trap table: why an execution of a task may end before its end. One row a trap: number, name, text, values.

macro_rules! traps {
    ($(($code:literal, $variant:ident, $name:literal, [$($value:literal),*], $text:literal)),* $(,)?) => {
        /// Why an execution was abandoned.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum TrapCode { $(#[doc = $text] $variant = $code),* }

        impl TrapCode {
            /// Every trap, in the order of its number.
            pub const ALL: &'static [TrapCode] = &[$(TrapCode::$variant),*];

            /// The trap with this number.
            #[must_use]
            pub fn from_code(code: u8) -> Option<TrapCode> {
                match code { $($code => Some(TrapCode::$variant),)* _ => None }
            }

            /// The name that reports and tests use, for example `divide by zero`.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(TrapCode::$variant => $name),* }
            }

            /// What happened, in one sentence.
            #[must_use]
            pub fn text(self) -> &'static str {
                match self { $(TrapCode::$variant => $text),* }
            }

            /// Names of the values that explain the trap, in the order of `Trap::values`.
            #[must_use]
            pub fn value_names(self) -> &'static [&'static str] {
                match self { $(TrapCode::$variant => &[$($value),*]),* }
            }
        }
    };
}

traps! {
    (1, DivideByZero, "divide by zero", [], "An integer was divided by zero, or its remainder by zero was asked for."),
    (2, ArrayIndex, "array index", ["index", "lower", "upper"], "An array was indexed outside its declared bounds."),
    (3, Range, "range", ["value", "lower", "upper"], "A value outside the subrange of a variable was assigned to it, or a FOR loop has a step of zero."),
    (4, Reference, "reference", ["address"], "A reference that is NULL, or that points outside the memory it may reach, was used."),
    (5, CallDepth, "call depth", ["depth"], "Calls were nested deeper than the container allows."),
    (6, Watchdog, "watchdog", [], "The task ran longer than its watchdog time and was ended."),
    (7, Stopped, "stopped", [], "The run was ended from outside while the task was still running."),
}

impl std::fmt::Display for TrapCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
