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
    UNKNOWN_CHARACTER = "P0005" Error "a character that has no meaning" {
        "Outside of comments and strings only the characters of the language may stand. Typographic quotes and dashes come with text that was pasted from a document."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 1 \u{2013} 2;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 1 - 2;\nEND_PROGRAM\n"
    }
    UNTERMINATED_COMMENT = "P0006" Error "a comment has no end" {
        "A comment that begins with `(*` ends with `*)`, one that begins with `/*` ends with `*/`. Comments of one kind nest, so each opening inside of a comment needs an end too."
        wrong "(* outer (* inner *)\nPROGRAM p\nEND_PROGRAM\n"
        right "(* outer (* inner *) *)\nPROGRAM p\nEND_PROGRAM\n"
    }
    UNTERMINATED_STRING = "P0007" Error "a string has no end" {
        "A string ends on the line on which it begins. A quote inside of it is written `$'`, a line break `$N`."
        wrong "PROGRAM p\nVAR\n  s : STRING := 'ready;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  s : STRING := 'ready';\nEND_VAR\nEND_PROGRAM\n"
    }
    UNTERMINATED_PRAGMA = "P0008" Error "a pragma has no end" {
        "A pragma begins with `{` and ends with `}`."
        wrong "{attribute 'startup'\nFUNCTION f\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
        right "{attribute 'startup'}\nFUNCTION f\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
    }
    BAD_NUMBER = "P0009" Error "a number that cannot be read" {
        "Numbers are written `1_000`, `1.5`, `1.5E-3`, `16#FF`, `8#17`, `2#1010`. A `_` may stand between two digits. A name cannot begin with a digit."
        wrong "PROGRAM p\nVAR\n  x : INT := 2#102;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT := 2#101;\nEND_VAR\nEND_PROGRAM\n"
    }
    NUMBER_TOO_LARGE = "P0010" Error "a literal is too large" {
        "Integers are at most 18446744073709551615, reals are at most 1.797E308, times and dates have 64 bits of nanoseconds."
        wrong "PROGRAM p\nVAR\n  x : ULINT := 18446744073709551616;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : ULINT := 18446744073709551615;\nEND_VAR\nEND_PROGRAM\n"
    }
    BAD_TIME = "P0011" Error "a time that cannot be read" {
        "A time is a list of numbers with units, the larger units first and each at most once: d, h, m, s, ms, us, ns. Only the last number may have a fraction."
        wrong "PROGRAM p\nVAR\n  t : TIME := T#5ms3s;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  t : TIME := T#3s5ms;\nEND_VAR\nEND_PROGRAM\n"
    }
    BAD_DATE = "P0012" Error "a date or time of day that cannot be read" {
        "Dates are written year-month-day, times of day hour:minute:second, and both must exist."
        wrong "PROGRAM p\nVAR\n  x : DINT;\nEND_VAR\n  x := DATE_TO_DINT(D#2023-02-29);\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : DINT;\nEND_VAR\n  x := 1677628800;\nEND_PROGRAM\n"
    }
    BAD_STRING = "P0013" Error "a string with something wrong inside" {
        "After `$` one of `$ ' \" L N P R T` or hexadecimal digits must come. A STRING holds Latin-1 characters; others need a WSTRING."
        wrong "PROGRAM p\nVAR\n  s : STRING := 'costs $5';\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  s : STRING := 'costs $$5';\nEND_VAR\nEND_PROGRAM\n"
    }
    BAD_ADDRESS = "P0014" Error "a direct address that cannot be read" {
        "A direct address is `%`, then I, Q or M, then the size X, B, W, D or L, then numbers with dots: `%IX0.0`, `%QW3`, `%MD4`."
        wrong "PROGRAM p\nVAR\n  x AT %ZX0.0 : BOOL;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x AT %IX0.0 : BOOL;\nEND_VAR\nEND_PROGRAM\n"
    }
    RESERVED_WORD = "P0015" Error "a reserved word as a name" {
        "The word belongs to the language and cannot name anything."
        wrong "PROGRAM p\nVAR\n  to : INT;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  target : INT;\nEND_VAR\nEND_PROGRAM\n"
    }
    BAD_NAME = "P0016" Error "a name with other letters than A to Z" {
        "Names are made of the letters A to Z in either case, digits and `_`, and do not begin with a digit."
        wrong "PROGRAM p\nVAR\n  größe : INT;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  groesse : INT;\nEND_VAR\nEND_PROGRAM\n"
    }
    MISSING_END = "P0017" Error "something has no end" {
        "Each IF, CASE, FOR, WHILE, REPEAT, VAR, STRUCT, TYPE, PROGRAM and so on needs an END_… of its own. The label shows the beginning that has none; the mistake may also be in something inside of it."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  IF x > 0 THEN\n    x := 0;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  IF x > 0 THEN\n    x := 0;\n  END_IF;\nEND_PROGRAM\n"
    }
    STRAY_END = "P0018" Error "something ends that did not begin" {
        "There is an END_…, ELSE, ELSIF or UNTIL that belongs to nothing: its beginning is missing, or it ended earlier."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 0;\n  END_IF;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 0;\nEND_PROGRAM\n"
    }
    EQUALS_FOR_ASSIGN = "P0019" Error "`=` where `:=` is meant" {
        "`:=` assigns and gives initial values; `=` compares."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x = 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 1;\nEND_PROGRAM\n"
    }
    ASSIGN_IN_CONDITION = "P0020" Error "`:=` where `=` is meant" {
        "`=` compares; `:=` assigns, and an assignment is a statement that cannot stand inside of an expression."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  IF x := 1 THEN\n    x := 2;\n  END_IF;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  IF x = 1 THEN\n    x := 2;\n  END_IF;\nEND_PROGRAM\n"
    }
    FOREIGN_OPERATOR = "P0021" Error "an operator of another language" {
        "Structured Text compares with `=` and `<>` and writes AND, OR, NOT, MOD as words."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  IF x != 1 THEN\n    x := 1;\n  END_IF;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  IF x <> 1 THEN\n    x := 1;\n  END_IF;\nEND_PROGRAM\n"
    }
    NO_STATEMENT = "P0022" Error "an expression that does nothing" {
        "A statement assigns, calls or decides. An expression alone has a value that nothing takes. A function block without arguments is called with `()`."
        wrong "PROGRAM p\nVAR\n  t : TON;\nEND_VAR\n  t;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  t : TON;\nEND_VAR\n  t();\nEND_PROGRAM\n"
    }
    MISSPELT_KEYWORD = "P0023" Error "a misspelt word" {
        "The word is not known, and it is near to one of the language that can stand here."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  IF x > 0 THEN\n    x := 0;\n  ENDIF;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  IF x > 0 THEN\n    x := 0;\n  END_IF;\nEND_PROGRAM\n"
    }
    TOO_DEEP = "P0024" Error "nested too deep" {
        "Parentheses, statements, types and initial values may nest 256 levels deep, and an expression may have 512 operations in a row. Use intermediate variables, functions or named types."
        wrong ""
        right ""
    }
    MISPLACED_SECTION = "P0025" Error "a variable section at the wrong place" {
        "Variable sections stand before the first statement. VAR_CONFIG and VAR_ACCESS stand in a CONFIGURATION."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 1;\nVAR\n  y : INT;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\nVAR\n  y : INT;\nEND_VAR\n  x := 1;\nEND_PROGRAM\n"
    }
    NOT_SUPPORTED = "P0026" Error "not supported by this version" {
        "This is known, and this version of the compiler cannot translate it."
        wrong "FUNCTION_BLOCK Motor EXTENDS Drive\nEND_FUNCTION_BLOCK\nPROGRAM p\nEND_PROGRAM\n"
        right "FUNCTION_BLOCK Motor\nEND_FUNCTION_BLOCK\nPROGRAM p\nEND_PROGRAM\n"
    }
    UNKNOWN_TASK_PARAMETER = "P0027" Error "a task has no such parameter" {
        "A task has the parameters SINGLE, INTERVAL and PRIORITY. What else can be said about it is said with attributes before it."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  TASK t(INTERVALL := T#10ms, PRIORITY := 1);\n  PROGRAM i WITH t : p;\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  TASK t(INTERVAL := T#10ms, PRIORITY := 1);\n  PROGRAM i WITH t : p;\nEND_CONFIGURATION\n"
    }
    LOOSE_ATTRIBUTE = "P0028" Warning "an attribute that belongs to nothing" {
        "An attribute belongs to the declaration that follows it: a type, a POU, a variable, a section, a task. Before anything else it has no effect."
        wrong "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  {attribute 'startup'}\n  x := 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  x : INT;\nEND_VAR\n  x := 1;\nEND_PROGRAM\n"
    }
    BAD_ATTRIBUTE = "P0029" Warning "an attribute that cannot be read" {
        "Attributes are written `{attribute 'name'}` or `{attribute 'name' := 'value'}`. One that cannot be read has no effect."
        wrong "{attribute startup}\nFUNCTION f\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
        right "{attribute 'startup'}\nFUNCTION f\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
    }
    BAD_QUALIFIER = "P0030" Error "a qualifier that is too much" {
        "CONSTANT, RETAIN, NON_RETAIN and PERSISTENT may each stand once, and RETAIN and NON_RETAIN exclude one another."
        wrong "PROGRAM p\nVAR RETAIN NON_RETAIN\n  x : INT;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR RETAIN\n  x : INT;\nEND_VAR\nEND_PROGRAM\n"
    }
    BAD_TEST = "P0031" Error "a test file that cannot be read so" {
        "A test has a name, and a file has at most one SETUP and one TEARDOWN, which hold for all of its tests in blocks."
        wrong "PROGRAM p\nEND_PROGRAM\nTEST ''\n  ASSERT_TRUE(TRUE);\nEND_TEST\n"
        right "PROGRAM p\nEND_PROGRAM\nTEST 'truth is true'\n  ASSERT_TRUE(TRUE);\nEND_TEST\n"
    }
}
