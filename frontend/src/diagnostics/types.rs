//! The table of diagnostics about types and values: T….

use super::rules;

rules! {
    /// All rows of this table.
    table;

    MISMATCH = "T0001" Error "the types do not fit" {
        "A value of this type does not become one of the wanted type by itself. Convert it with the function of the standard, as in REAL_TO_INT(x)."
        wrong "PROGRAM p\nVAR\n  a : INT;\n  r : REAL;\nEND_VAR\n  a := r;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\n  r : REAL;\nEND_VAR\n  a := REAL_TO_INT(r);\nEND_PROGRAM\n"
    }
    OPERATOR = "T0002" Error "the operator is not defined for these types" {
        "Arithmetic is for numbers and durations, AND, OR, XOR and NOT for BOOL and bit strings, comparisons for two values of one kind."
        wrong "PROGRAM p\nVAR\n  a : BOOL;\nEND_VAR\n  a := a + a;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : BOOL;\nEND_VAR\n  a := a OR a;\nEND_PROGRAM\n"
    }
    LITERAL_RANGE = "T0003" Error "the value does not fit the type" {
        "The type can not hold this number. Take a wider type or another number."
        wrong "PROGRAM p\nVAR\n  a : SINT;\nEND_VAR\n  a := 200;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : USINT;\nEND_VAR\n  a := 200;\nEND_PROGRAM\n"
    }
    CONDITION = "T0004" Error "a condition is a BOOL" {
        "IF, ELSIF, WHILE and UNTIL take a BOOL; compare numbers with something."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  IF a THEN\n    a := 0;\n  END_IF;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  IF a <> 0 THEN\n    a := 0;\n  END_IF;\nEND_PROGRAM\n"
    }
    BOUNDS = "T0005" Error "wrong bounds" {
        "The lower bound is at most the upper one, both are DINT, and an array fits a memory image."
        wrong "PROGRAM p\nVAR\n  a : ARRAY[5..1] OF INT;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : ARRAY[1..5] OF INT;\nEND_VAR\nEND_PROGRAM\n"
    }
    INDEX = "T0006" Error "a wrong index" {
        "An index is an integer inside the declared bounds, one for each dimension. What is known when the program is compiled is checked then."
        wrong "PROGRAM p\nVAR\n  a : ARRAY[1..5] OF INT;\nEND_VAR\n  a[6] := 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : ARRAY[1..5] OF INT;\nEND_VAR\n  a[5] := 1;\nEND_PROGRAM\n"
    }
    DIVISION_BY_ZERO = "T0007" Error "division by zero" {
        "The divisor is always zero, so this would trap each time."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := a / 0;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := a / 2;\nEND_PROGRAM\n"
    }
    SUBRANGE = "T0008" Error "the value is outside the subrange" {
        "A variable of a subrange type holds only values of its range."
        wrong "PROGRAM p\nVAR\n  a : INT (0..9) := 10;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT (0..9) := 9;\nEND_VAR\nEND_PROGRAM\n"
    }
    NOT_AN_ARRAY = "T0009" Error "an index on what is no array" {
        "Only arrays have elements."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a[1] := 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : ARRAY[0..1] OF INT;\nEND_VAR\n  a[1] := 1;\nEND_PROGRAM\n"
    }
    INITIALISER = "T0010" Error "a wrong initial value" {
        "The shape of the initial value must be that of the type: `[…]` for arrays with at most as many values as elements, `(field := …)` for structures and function blocks."
        wrong "PROGRAM p\nVAR\n  a : ARRAY[0..1] OF INT := [1, 2, 3];\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : ARRAY[0..1] OF INT := [1, 2];\nEND_VAR\nEND_PROGRAM\n"
    }
    CONTROL = "T0011" Error "a FOR loop counts in integers" {
        "The control variable and the step of a FOR loop are integers."
        wrong "PROGRAM p\nVAR\n  r : REAL;\nEND_VAR\n  FOR r := 1 TO 9 DO\n    ;\n  END_FOR;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  i : INT;\nEND_VAR\n  FOR i := 1 TO 9 DO\n    ;\n  END_FOR;\nEND_PROGRAM\n"
    }
    SELECTOR = "T0012" Error "a CASE selects by an integer" {
        "The selector of a CASE is an integer, a bit string or an enumeration value."
        wrong "PROGRAM p\nVAR\n  r : REAL;\n  a : INT;\nEND_VAR\n  CASE r OF\n    ELSE a := 1;\n  END_CASE;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  r : INT;\n  a : INT;\nEND_VAR\n  CASE r OF\n    ELSE a := 1;\n  END_CASE;\nEND_PROGRAM\n"
    }
    ARGUMENT = "T0013" Error "the function does not take this type" {
        "Each parameter of a standard function takes a class of types; the message names it."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := LEN(a);\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\n  s : STRING;\nEND_VAR\n  a := LEN(s);\nEND_PROGRAM\n"
    }
    STRING_LENGTH = "T0014" Error "a wrong length of a STRING" {
        "A STRING holds 1 to 65534 characters."
        wrong "PROGRAM p\nVAR\n  s : STRING[0];\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  s : STRING[1];\nEND_VAR\nEND_PROGRAM\n"
    }
    UNION = "T0015" Error "a type that no union may hold" {
        "The fields of a union share their bytes. A function block instance has bytes of its own, and a subrange could not keep its values inside its range when another field is written: give the field the subrange's base type."
        wrong "TYPE\n  U : UNION\n    level : INT (0..100);\n    raw : WORD;\n  END_UNION;\nEND_TYPE\nPROGRAM p\nVAR\n  u : U;\nEND_VAR\n  u.raw := 16#FFFF;\nEND_PROGRAM\n"
        right "TYPE\n  U : UNION\n    level : INT;\n    raw : WORD;\n  END_UNION;\nEND_TYPE\nPROGRAM p\nVAR\n  u : U;\nEND_VAR\n  u.raw := 16#FFFF;\nEND_PROGRAM\n"
    }
    OPEN_ARRAY = "T0016" Error "an array without bounds" {
        "`ARRAY[*]` takes its bounds from the argument of the call. It stands as VAR_INPUT, VAR_OUTPUT or VAR_IN_OUT of a function and as VAR_IN_OUT of a function block; every other array says its bounds. LOWER_BOUND and UPPER_BOUND tell them."
        wrong "PROGRAM p\nVAR\n  a : ARRAY[*] OF INT;\nEND_VAR\nEND_PROGRAM\n"
        right "FUNCTION clear\nVAR_IN_OUT\n  a : ARRAY[*] OF INT;\nEND_VAR\n  a[LOWER_BOUND(a, 1)] := 0;\nEND_FUNCTION\nPROGRAM p\nVAR\n  a : ARRAY[1..9] OF INT;\nEND_VAR\n  clear(a);\nEND_PROGRAM\n"
    }
    NARROWED = "T0101" Warning "narrowed" {
        "The wider value keeps only its low bits. Say that it is meant: DINT_TO_INT(x). Under `--dialect iec` this is an error."
        wrong "PROGRAM p\nVAR\n  a : INT;\n  b : DINT;\nEND_VAR\n  a := b;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\n  b : DINT;\nEND_VAR\n  a := DINT_TO_INT(b);\nEND_PROGRAM\n"
    }
    SIGN_CHANGED = "T0102" Warning "between signed and unsigned" {
        "The bits stay, but the same bits mean another number when the highest is set. Convert explicitly. Under `--dialect iec` this is an error."
        wrong "PROGRAM p\nVAR\n  a : INT;\n  b : UINT;\nEND_VAR\n  a := b;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\n  b : UINT;\nEND_VAR\n  a := UINT_TO_INT(b);\nEND_PROGRAM\n"
    }
    PRECISION = "T0103" Warning "an integer that floating point can not always hold" {
        "A REAL has 24 bits of precision, an LREAL 53; wider integers are rounded. Convert explicitly. Under `--dialect iec` this is an error."
        wrong "PROGRAM p\nVAR\n  r : REAL;\n  b : DINT;\nEND_VAR\n  r := b;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  r : REAL;\n  b : DINT;\nEND_VAR\n  r := DINT_TO_REAL(b);\nEND_PROGRAM\n"
    }
    BITS_AND_INTEGER = "T0104" Warning "between bit string and integer" {
        "The standard keeps BYTE, WORD, DWORD and LWORD apart from numbers. Convert explicitly. Under `--dialect iec` this is an error."
        wrong "PROGRAM p\nVAR\n  a : DINT;\n  b : DWORD;\nEND_VAR\n  b := a;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : DINT;\n  b : DWORD;\nEND_VAR\n  b := DINT_TO_DWORD(a);\nEND_PROGRAM\n"
    }
    REAL_NARROWED = "T0105" Warning "LREAL becomes REAL" {
        "More than half of the precision is lost. Say that it is meant: LREAL_TO_REAL(x). Under `--dialect iec` this is an error."
        wrong "PROGRAM p\nVAR\n  a : REAL;\n  b : LREAL;\nEND_VAR\n  a := b;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : REAL;\n  b : LREAL;\nEND_VAR\n  a := LREAL_TO_REAL(b);\nEND_PROGRAM\n"
    }
    BIT_ARITHMETIC = "T0106" Warning "arithmetic on bit strings, logic on integers" {
        "The standard has arithmetic for numbers and AND, OR, XOR and NOT for bit strings. Here bit strings count as unsigned numbers. Under `--dialect iec` this is an error."
        wrong "PROGRAM p\nVAR\n  a : BYTE;\nEND_VAR\n  a := a + 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : USINT;\nEND_VAR\n  a := a + 1;\nEND_PROGRAM\n"
    }
    COMPUTED_NARROW = "T0107" Warning "computed in a narrower type than it is stored in" {
        "An operation is computed in the type of its operands and wraps there; CODESYS computes in the machine's width. Convert an operand first if the wide result is meant."
        wrong "PROGRAM p\nVAR\n  a : INT;\n  b : DINT;\nEND_VAR\n  b := a * a;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\n  b : DINT;\nEND_VAR\n  b := INT_TO_DINT(a) * a;\nEND_PROGRAM\n"
    }
    ENUM_AS_INTEGER = "T0108" Warning "an enumeration value as a number" {
        "An enumeration without a base type has values, not numbers. Convert explicitly, or give it a base type. Under `--dialect iec` this is an error."
        wrong "TYPE\n  C : (red, green);\nEND_TYPE\nPROGRAM p\nVAR\n  c : C;\n  a : INT;\nEND_VAR\n  a := c;\nEND_PROGRAM\n"
        right "TYPE\n  C : INT (red, green);\nEND_TYPE\nPROGRAM p\nVAR\n  c : C;\n  a : INT;\nEND_VAR\n  a := c;\nEND_PROGRAM\n"
    }
    REAL_EQUALITY = "T0120" Warning "REAL values compared for equality" {
        "Two ways to compute the same number rarely end in the same bits: 0.1 + 0.2 is not 0.3. Comparing with a whole number, such as 0.0 before a division, is left alone."
        wrong "PROGRAM p\nVAR\n  a : REAL;\n  b : REAL;\n  q : BOOL;\nEND_VAR\n  q := a = b * 0.1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : REAL;\n  b : REAL;\n  q : BOOL;\nEND_VAR\n  q := ABS(a - b * 0.1) < 1.0E-6;\nEND_PROGRAM\n"
    }
    FIXED_COMPARISON = "T0121" Warning "a comparison that is always TRUE or always FALSE" {
        "The type of one side can not hold a value for which the answer would be another one: an unsigned number is never below 0."
        wrong "PROGRAM p\nVAR\n  n : UINT;\n  q : BOOL;\nEND_VAR\n  q := n >= 0;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  n : UINT;\n  q : BOOL;\nEND_VAR\n  q := n > 0;\nEND_PROGRAM\n"
    }
}
