//! The table of diagnostics about text and syntax: P….

use super::rules;

rules! {
    /// All rows of this table.
    table;

    NOT_SOURCE_TEXT = "P0001" Error "this file is no source text" {
        "The file is too large, holds NUL bytes, is UTF-16, or is full of control characters, so it cannot be Structured Text. Save it as UTF-8."
        wrong ""
        right ""
    }
    READ_AS_LATIN1 = "P0002" Note "the file is read as Latin-1" {
        "The file is not valid UTF-8, so each byte is taken as one Latin-1 character. Save it as UTF-8 to make this note go away."
        wrong ""
        right ""
    }
    TOO_MANY_ERRORS = "P0003" Note "further errors are not shown" {
        "A file gets at most 100 errors. Mend the first ones: most of the others tend to go with them."
        wrong ""
        right ""
    }
    EXPECTED = "P0004" Error "something else was expected here" {
        "The grammar wants something else at this place; the message says what. Often the mistake is just before it."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 1\n  x := 2;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 1;\n  x := 2;\nEND_PROGRAM\n"
    }
}
