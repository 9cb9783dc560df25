//! The trap table: why an execution of a task may end before its end. One row a trap: number, name,
//! names of its values, text, a wrong and a right example.

macro_rules! traps {
    ($(($code:literal, $variant:ident, $name:literal, [$($value:literal),*], $text:literal, $wrong:literal, $right:literal)),* $(,)?) => {
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

            /// A program that ends in it, and the same program mended. Empty where today's language can not show it.
            #[must_use]
            pub fn examples(self) -> (&'static str, &'static str) {
                match self { $(TrapCode::$variant => ($wrong, $right)),* }
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
    (1, DivideByZero, "divide by zero", [], "An integer was divided by zero, or its remainder by zero was asked for.",
        "PROGRAM main\nVAR share, total, count : INT; END_VAR\n  share := total / count;\nEND_PROGRAM",
        "PROGRAM main\nVAR share, total, count : INT; END_VAR\n  IF count <> 0 THEN share := total / count; END_IF;\nEND_PROGRAM"),
    (2, ArrayIndex, "array index", ["index", "lower", "upper"], "An array was indexed outside its declared bounds.",
        "PROGRAM main\nVAR level : ARRAY[1..4] OF INT; i : INT; END_VAR\n  level[i] := 0;\nEND_PROGRAM",
        "PROGRAM main\nVAR level : ARRAY[1..4] OF INT; i : INT; END_VAR\n  level[LIMIT(1, i, 4)] := 0;\nEND_PROGRAM"),
    (3, Range, "range", ["value", "lower", "upper"], "A value outside the subrange of a variable was assigned to it, or a FOR loop has a step of zero.",
        "PROGRAM main\nVAR speed : INT(0..100); wanted : INT := 120; END_VAR\n  speed := wanted;\nEND_PROGRAM",
        "PROGRAM main\nVAR speed : INT(0..100); wanted : INT := 120; END_VAR\n  speed := LIMIT(0, wanted, 100);\nEND_PROGRAM"),
    (4, Reference, "reference", ["address"], "A reference that is NULL, or that points outside the memory it may reach, was used.",
        "",
        ""),
    (5, CallDepth, "call depth", ["depth"], "Calls were nested deeper than the container allows.",
        "",
        ""),
    (6, Watchdog, "watchdog", [], "The task ran longer than its watchdog time and was ended.",
        "PROGRAM main\nVAR ready : BOOL; END_VAR\n  WHILE NOT ready DO ; END_WHILE;\nEND_PROGRAM",
        "PROGRAM main\nVAR ready, waiting : BOOL; END_VAR\n  waiting := NOT ready;\nEND_PROGRAM"),
    (7, Stopped, "stopped", [], "The run was ended from outside while the task was still running.",
        "",
        ""),
}

impl std::fmt::Display for TrapCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
