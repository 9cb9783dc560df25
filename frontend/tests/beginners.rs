//! What beginners and those who come from other languages write: each mistake gives exactly one error, with a line that says what to do.

use khz_frontend::diagnostics::Diagnostic;
use khz_frontend::{CompileOptions, SourceInput, check};

/// Source, code and help. An `@` stands for [`HEAD`], and END_PROGRAM follows.
const MISTAKES: &[(&str, &str, &str)] = &[
    ("@  a = 5;\n", "P0019", "assign with `:=`"),
    ("@  IF a := 5 THEN b := 1; END_IF;\n", "P0020", "compare with `=`"),
    ("@  IF x THEN\n    a := 1;\n", "P0017", "write `END_IF` there"),
    ("@  a := 1\n  b := 2;\n", "P0004", "write `;` there"),
    ("@  a := 1\n", "P0004", "write `;` there"),
    ("@  IF x\n    a := 1;\n  END_IF;\n", "P0004", "write `THEN` there"),
    ("@  x := a == b;\n", "P0021", "write `=`"),
    ("@  x := a != b;\n", "P0021", "write `<>`"),
    ("@  x := x && y;\n", "P0021", "write `AND`"),
    ("@  x := x || y;\n", "P0021", "write `OR`"),
    ("@  x := !y;\n", "P0021", "write `NOT`"),
    ("@  a := a % 2;\n", "P0004", "the remainder of a division is `MOD`"),
    ("@  a++;\n", "P0022", "add one with `a := a + 1`"),
    ("@  a += 1;\n", "P0022", "write `a := a + …`"),
    ("@  if (a > 1) { b := 1; }\n", "P0004", "write `THEN` there"),
    ("@  a := a << 2;\n", "P0004", "shift with `SHL(a, n)`"),
    ("@  a := x ? 1 : 2;\n", "P0005", "choose with `SEL(condition, if_false, if_true)`"),
    ("@  s := `hello`;\n", "P0005", "strings stand in `'`"),
    ("@  s := 'hello;\n", "P0007", "a line break in a string is written `$N`, a quote `$'`"),
    ("@  aa := 1;\n", "S0001", "declare it in a VAR section, or correct its name"),
    ("@  WHILE x DOO a := 1; END_WHILE;\n", "P0023", "did you mean `DO`?"),
    ("@  WHILE x\n    a := 1;\n  END_WHILE;\n", "P0004", "write `DO` there"),
    ("@  FOR i := 1 TO 3\n    a := i;\n  END_FOR;\n", "P0004", "write `DO` there"),
    ("@  FOR i = 1 TO 3 DO\n    a := i;\n  END_FOR;\n", "P0019", "write `:=`"),
    ("@  FOR i := 1 .. 3 DO\n    a := i;\n  END_FOR;\n", "P0004", "a range of a loop is `1 TO 3`"),
    ("@  CASE a\n    1: b := 1;\n  END_CASE;\n", "P0004", "write `OF` there"),
    ("@  CASE a OF\n    CASE 1: b := 1;\n  END_CASE;\n", "P0004", "leave `CASE` out: `1: …`"),
    (
        "@  CASE a OF\n    1: b := 1;\n    default: b := 2;\n  END_CASE;\n",
        "S0001",
        "what no label names stands behind `ELSE`",
    ),
    (
        "@  IF x THEN\n    a := 1;\n  ELSE IF y THEN\n    a := 2;\n  END_IF;\n",
        "P0017",
        "`ELSE IF` begins another IF with an END_IF of its own; `ELSIF` goes on with the same one",
    ),
    ("@  IF x THEN\n    a := 1;\n  ELSEIF y THEN\n    a := 2;\n  END_IF;\n", "P0023", "did you mean `ELSIF`?"),
    ("@  IF x THEN\n    a := 1;\n  ELIF y THEN\n    a := 2;\n  END_IF;\n", "P0023", "did you mean `ELSIF`?"),
    ("@  IF x THEN\n    a := 1;\n  ENDIF;\n", "P0023", "did you mean `END_IF`?"),
    ("@  IF x THEN\n    a := 1;\n  END IF;\n", "P0023", "write it with `_`"),
    ("@  IF x THEN\n    a := 1;\n  END;\n", "P0023", "did you mean `END_IF`?"),
    ("@  a + 1;\n", "P0022", "assign it to a variable: `name := …;`"),
    ("@  a;\n", "P0022", "assign to it with `:=`, or call it with `(…)`"),
    ("@  5;\n", "P0004", "a statement begins with a name or a word like `IF`"),
    ("@  a := '5';\n", "T0001", "read the number in it with `STRING_TO_INT(…)` or the like"),
    ("@  s := 5;\n", "T0001", "strings stand in `'`: `'5'`"),
    ("@  a := 1.5;\n", "T0001", "round it with `REAL_TO_INT(…)`, or declare the variable as REAL"),
    ("@  a := r;\n", "T0001", "convert it: REAL_TO_INT(…)"),
    ("@  IF a THEN b := 1; END_IF;\n", "T0004", "compare it: `value <> 0`"),
    ("@  a := x + 1;\n", "T0002", "convert the BOOL: `BOOL_TO_INT(…)`"),
    ("@  s := s + 'x';\n", "T0002", "join strings with `CONCAT(a, b)`"),
    ("@  arr(1) := 5;\n", "S0015", "elements of arrays are written `a[1]`; the result of a call is no variable"),
    ("@  arr[4] := 5;\n", "T0006", "the first index is 1, the last one 3"),
    ("@  arr[0] := 5;\n", "T0006", "the first index is 1, the last one 3"),
    ("@  t := 5s;\n", "P0009", "durations are written `T#5s`"),
    ("@  t := 5;\n", "T0001", "durations are written `T#5s`"),
    ("@  a := (a + b;\n", "P0004", "write `)` there"),
    ("@  a := (a + b));\n", "P0004", "leave it out, or open it with `(`"),
    (
        "@  x := tm(IN := x, PT := T#1s);\n",
        "S0010",
        "the call is a statement, its outputs are fields of the instance: `timer.Q`",
    ),
    ("@  TON(IN := x, PT := T#1s);\n", "S0010", "declare an instance of it, `myTON : TON;`, and call that"),
    ("@  tm(IN = x, PT := T#1s);\n", "S0001", "declare it in a VAR section, or correct its name"),
    ("@  tm(IN := x, PT := T#1s, Q := y);\n", "S0011", "outputs are taken with `Q => …`"),
    ("@  RETURN a;\n", "P0004", "a function gives what is assigned to its name: `name := value; RETURN;`"),
    ("@  WHILE x DO break; END_WHILE;\n", "P0022", "leave a loop with `EXIT;`"),
    ("@  # comment\n  a := 1;\n", "P0004", "a comment is `// …` or `(* … *)`"),
    ("@  -- comment\n  a := 1;\n", "P0004", "a comment is `// …` or `(* … *)`; subtract one with `a := a - 1`"),
    ("@  x := a <> b <> 1;\n", "T0002", "compare two by two: `a < b AND b < c`"),
    ("@  x := 1 < a < 3;\n", "T0002", "compare two by two: `a < b AND b < c`"),
    ("@  x := a is b;\n", "P0004", "write `;` there"),
    ("@  a := 0x1F;\n", "P0009", "hexadecimal numbers are written `16#1F`"),
    ("@  a := 0b101;\n", "P0009", "binary numbers are written `2#101`"),
    ("@  r := r ^ 2.0;\n", "P0021", "write `**`"),
    ("@  print('x');\n", "S0001", "nothing is printed: look at variables with `khz run --watch`"),
    ("@  END := 1;\n", "S0001", "declare it in a VAR section, or correct its name"),
    ("@  a : 5;\n", "P0004", "write `:=` or `(` there"),
    ("@  a : = 5;\n", "P0019", "write `:=`"),
    ("@  a =: 5;\n", "P0019", "write `:=`"),
    ("@  a => 5;\n", "P0004", "assign with `:=`; `=>` takes an output of a call"),
    ("@  a := b.;\n", "P0004", "write the name of a member after `.` there"),
    ("@  r := 1,5;\n", "P0004", "the decimal point is `.`"),
    ("@  r := 5mm;\n", "P0009", "a name begins with a letter or `_`, and units stand in a comment"),
    ("@  REPEAT\n    a := a + 1;\n  END_REPEAT;\n", "P0004", "write `UNTIL` there"),
    ("@  CONTINUE;\n", "S0017", "leave the program, function or function block with `RETURN`"),
    ("@  EXIT;\n", "S0017", "leave the program, function or function block with `RETURN`"),
    (
        "PROGRAM main\nVAR CONSTANT\n  c : INT := 1;\nEND_VAR\n  c := 2;\nEND_PROGRAM\n",
        "S0016",
        "leave CONSTANT out there, or assign to another variable",
    ),
    ("PROGRAM main\nVAR\n  a : INTT;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n", "S0003", "did you mean `INT`?"),
    ("PROGRAM main\nVAR\n  int a;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n", "P0004", "write `a : int;`"),
    ("PROGRAM main\nVAR\n  a : int32;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n", "S0003", "did you mean `DINT`?"),
    ("PROGRAM main\nVAR\n  a : FLOAT;\nEND_VAR\n  a := 1.0;\nEND_PROGRAM\n", "S0003", "did you mean `REAL`?"),
    ("PROGRAM main\nVAR\n  a : BOOLEAN;\nEND_VAR\n  a := TRUE;\nEND_PROGRAM\n", "S0003", "did you mean `BOOL`?"),
    ("PROGRAM main\nVAR\n  a : INT = 5;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n", "P0019", "write `:=`"),
    ("PROGRAM main\nVAR\n  a : INT\n  b : INT;\nEND_VAR\n  a := 1; b := 2;\nEND_PROGRAM\n", "P0004", "write `;` there"),
    ("PROGRAM main\nVAR\n  a INT;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n", "P0004", "write `:` there"),
    ("PROGRAM main\nVAR\n  a : INT;\n  a := 1;\nEND_PROGRAM\n", "P0017", "write `END_VAR` there"),
    ("PROGRAM main\nVAR\n  a : INT;\nEND_VAR\n  a := 1;\n", "P0017", "write `END_PROGRAM` there"),
    (
        "PROGRAM main\nVAR\n  a : INT;\n  A : INT;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n",
        "S0002",
        "give one of them another name",
    ),
    (
        "PROGRAM main\nVAR\n  END_IF : INT;\nEND_VAR\nEND_PROGRAM\n",
        "P0015",
        "give it another name, `_` and a letter more for example",
    ),
    (
        "PROGRAM main\nVAR\n  type : INT;\nEND_VAR\n  ;\nEND_PROGRAM\n",
        "P0015",
        "give it another name, `_` and a letter more for example",
    ),
    (
        "PROGRAM main\nVAR\n  by : INT; a : INT;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n",
        "P0015",
        "give it another name, `_` and a letter more for example",
    ),
    (
        "PROGRAM main\nVAR\n  1a : INT;\nEND_VAR\n  ;\nEND_PROGRAM\n",
        "P0004",
        "a declaration is `name : INT;`; a name begins with a letter or `_`",
    ),
    ("PROGRAM main\nVAR\n  a-b : INT;\nEND_VAR\n  ;\nEND_PROGRAM\n", "P0004", "write `:` there"),
    (
        "PROGRAM main\nVAR\n  größe : INT;\nEND_VAR\n  größe := 1;\nEND_PROGRAM\n",
        "P0016",
        "names are made of A to Z, a to z, 0 to 9 and `_` (IEC 61131-3 6.1.2)",
    ),
    (
        "PROGRAM main\nVAR\n  a : INT[10];\nEND_VAR\n  ;\nEND_PROGRAM\n",
        "P0004",
        "an array is declared `ARRAY[0..9] OF INT`",
    ),
    ("PROGRAM main\nVAR\n  a : ARRAY[10] OF INT;\nEND_VAR\n  a[1] := 1;\nEND_PROGRAM\n", "P0004", "write `..` there"),
    (
        "PROGRAM main\nVAR\n  a : ARRAY(1..10) OF INT;\nEND_VAR\n  a[1] := 1;\nEND_PROGRAM\n",
        "P0004",
        "bounds of arrays stand in `[ ]`",
    ),
    ("PROGRAM main\nVAR\n  a : ARRAY[1..10] INT;\nEND_VAR\n  a[1] := 1;\nEND_PROGRAM\n", "P0004", "write `OF` there"),
    (
        "FUNCTION f : \nVAR_INPUT a : INT; END_VAR\n  f := a;\nEND_FUNCTION\nPROGRAM main\nVAR b : INT; END_VAR\n  b := f(1);\nEND_PROGRAM\n",
        "P0004",
        "write a type there",
    ),
    (
        "FUNCTION f : INT\nVAR_INPUT a : INT; END_VAR\n  RETURN a;\nEND_FUNCTION\nPROGRAM main\nVAR b : INT; END_VAR\n  b := f(1);\nEND_PROGRAM\n",
        "P0004",
        "a function gives what is assigned to its name: `name := value; RETURN;`",
    ),
    (
        "TYPE p : STRUCT\n  x : INT;\nEND_TYPE\nPROGRAM main\nVAR b : p; END_VAR\n  b.x := 1;\nEND_PROGRAM\n",
        "P0017",
        "write `END_STRUCT` there",
    ),
    (
        "TYPE p : STRUCT\n  pos : INT;\nEND_STRUCT END_TYPE\nPROGRAM main\nVAR b : p; END_VAR\n  b.poss := 1;\nEND_PROGRAM\n",
        "S0008",
        "did you mean `pos`?",
    ),
    (
        "TYPE c : (Red, Green, Red); END_TYPE\nPROGRAM main\nVAR b : c; END_VAR\n  b := Green;\nEND_PROGRAM\n",
        "S0002",
        "give one of them another name",
    ),
    (
        "TYPE p : STRUCT\n  x : INT;\n  x : INT;\nEND_STRUCT END_TYPE\nPROGRAM main\nVAR b : p; END_VAR\n  b.x := 1;\nEND_PROGRAM\n",
        "S0002",
        "give one of them another name",
    ),
    (
        "TYPE p : STRUCT\n  x : q;\nEND_STRUCT END_TYPE\nTYPE q : STRUCT\n  y : p;\nEND_STRUCT END_TYPE\nPROGRAM main\nVAR b : p; END_VAR\n  ;\nEND_PROGRAM\n",
        "S0004",
        "a part of a type is of another type",
    ),
    (
        "PROGRAM main\nVAR CONSTANT\n  a : INT := b + 1; b : INT := a;\nEND_VAR\n  ;\nEND_PROGRAM\n",
        "S0006",
        "give it a value that does not need it",
    ),
    (
        "FUNCTION_BLOCK A\nVAR b : B; END_VAR\nEND_FUNCTION_BLOCK\nFUNCTION_BLOCK B\nVAR a : A; END_VAR\nEND_FUNCTION_BLOCK\nPROGRAM main\nVAR x : A; END_VAR\n  x();\nEND_PROGRAM\n",
        "S0004",
        "a part of a type is of another type",
    ),
    (
        "FUNCTION f : INT\n  f := g();\nEND_FUNCTION\nFUNCTION g : INT\n  g := f();\nEND_FUNCTION\nPROGRAM main\nVAR x : INT; END_VAR\n  x := f();\nEND_PROGRAM\n",
        "S0005",
        "write a loop instead: calls never lead back",
    ),
    (
        "TYPE p : q; END_TYPE\nTYPE q : p; END_TYPE\nPROGRAM main\nVAR b : p; END_VAR\n  ;\nEND_PROGRAM\n",
        "S0004",
        "a part of a type is of another type",
    ),
    (
        "CONFIGURATION c\nVAR_GLOBAL go, ok : BOOL; n : INT; END_VAR\nRESOURCE r ON PLC\nTASK t(SINGLE := go AND ok, PRIORITY := 1);\nPROGRAM p WITH t : main;\nEND_RESOURCE\nEND_CONFIGURATION\nPROGRAM main\nVAR x : INT; END_VAR\n  x := 1;\nEND_PROGRAM\n",
        "S0033",
        "assign what it is to a global BOOL in a program, and name that",
    ),
    (
        "CONFIGURATION c\nVAR_GLOBAL go, ok : BOOL; n : INT; END_VAR\nRESOURCE r ON PLC\nTASK t(SINGLE := NOT go, PRIORITY := 1);\nPROGRAM p WITH t : main;\nEND_RESOURCE\nEND_CONFIGURATION\nPROGRAM main\nVAR x : INT; END_VAR\n  x := 1;\nEND_PROGRAM\n",
        "S0033",
        "assign what it is to a global BOOL in a program, and name that",
    ),
    (
        "CONFIGURATION c\nVAR_GLOBAL go, ok : BOOL; n : INT; END_VAR\nRESOURCE r ON PLC\nTASK t(SINGLE := n, PRIORITY := 1);\nPROGRAM p WITH t : main;\nEND_RESOURCE\nEND_CONFIGURATION\nPROGRAM main\nVAR x : INT; END_VAR\n  x := 1;\nEND_PROGRAM\n",
        "S0033",
        "compare it in a program, and name the global BOOL that the result is assigned to",
    ),
    (
        "CONFIGURATION c\nVAR_GLOBAL go, ok : BOOL; n : INT; END_VAR\nRESOURCE r ON PLC\nTASK t(SINGLE := goo, PRIORITY := 1);\nPROGRAM p WITH t : main;\nEND_RESOURCE\nEND_CONFIGURATION\nPROGRAM main\nVAR x : INT; END_VAR\n  x := 1;\nEND_PROGRAM\n",
        "S0001",
        "did you mean `go`?",
    ),
    (
        "CONFIGURATION c\nVAR_GLOBAL w : WORD; a : ARRAY[1..3] OF BOOL; END_VAR\nRESOURCE r ON PLC\nTASK t(SINGLE := w.3, PRIORITY := 1);\nPROGRAM p WITH t : main;\nEND_RESOURCE\nEND_CONFIGURATION\nPROGRAM main\nVAR x : INT; END_VAR\n  x := 1;\nEND_PROGRAM\n",
        "S0033",
        "assign what it is to a global BOOL in a program, and name that",
    ),
    (
        "CONFIGURATION c\nVAR_GLOBAL w : WORD; a : ARRAY[1..3] OF BOOL; END_VAR\nRESOURCE r ON PLC\nTASK t(SINGLE := a[2], PRIORITY := 1);\nPROGRAM p WITH t : main;\nEND_RESOURCE\nEND_CONFIGURATION\nPROGRAM main\nVAR x : INT; END_VAR\n  x := 1;\nEND_PROGRAM\n",
        "S0033",
        "assign what it is to a global BOOL in a program, and name that",
    ),
    (
        "CONFIGURATION c\nRESOURCE r ON PLC\nTASK t(INTERVAL := 10ms, PRIORITY := 1);\nPROGRAM p WITH t : main;\nEND_RESOURCE\nEND_CONFIGURATION\nPROGRAM main\nVAR x : INT; END_VAR\n  x := 1;\nEND_PROGRAM\n",
        "P0009",
        "durations are written `T#5s`",
    ),
    (
        "#include <stdio.h>\nPROGRAM main\nVAR x : INT; END_VAR\n  x := 1;\nEND_PROGRAM\n",
        "P0004",
        "nothing is included: name all files, or list them in khz.toml",
    ),
    ("void main() {\n}\n", "P0004", "a program is `PROGRAM name … END_PROGRAM`"),
    ("PROGRAM main\n  x := 1;\nVAR x : INT; END_VAR\nEND_PROGRAM\n", "P0025", "move it up, in front of the statements"),
];

/// Variables for those mistakes that are in statements.
const HEAD: &str = "PROGRAM main\nVAR\n  a, b : INT; x, y : BOOL; r : REAL; s : STRING; t : TIME; i : INT; arr : ARRAY[1..3] OF INT; tm : TON;\nEND_VAR\n";

fn errors(text: &str) -> Vec<Diagnostic> {
    let source = SourceInput { name: "main.st".into(), bytes: text.as_bytes().into() };
    let found = check(&[source], &CompileOptions::default()).diagnostics;
    found.into_iter().filter(Diagnostic::is_error).collect()
}

fn source(mistake: &str) -> String {
    match mistake.strip_prefix('@') {
        Some(body) => format!("{HEAD}{body}END_PROGRAM\n"),
        None => mistake.to_string(),
    }
}

#[test]
fn each_mistake_gives_one_error_with_help() {
    let mut wrong = Vec::new();
    for (mistake, code, help) in MISTAKES {
        let found = errors(&source(mistake));
        let shown: Vec<(&str, Option<&str>)> = found.iter().map(|one| (one.code(), one.help.as_deref())).collect();
        if shown != [(*code, Some(*help))] {
            wrong.push(format!("{mistake}\n  {shown:?}\n  expected {code}: {help}"));
        }
    }
    assert!(MISTAKES.len() >= 100, "{} mistakes", MISTAKES.len());
    assert!(wrong.is_empty(), "{} of {}\n{}", wrong.len(), MISTAKES.len(), wrong.join("\n"));
}

/// What is there twice, or leads back to itself, says where the other place is.
#[test]
fn the_other_place_is_shown() {
    for (text, other) in [
        ("TYPE c : (Red, Green, Red); END_TYPE\n", 10),
        ("TYPE p : STRUCT x : INT; x : INT; END_STRUCT END_TYPE\n", 16),
        ("TYPE p : q; END_TYPE\nTYPE q : p; END_TYPE\n", 5),
        ("TYPE p : STRUCT x : p; END_STRUCT END_TYPE\n", 5),
        ("VAR_GLOBAL CONSTANT a : INT := b; b : INT := a; END_VAR\n", 20),
        ("FUNCTION f : INT\n  f := g();\nEND_FUNCTION\nFUNCTION g : INT\n  g := f();\nEND_FUNCTION\n", 9),
        (
            "FUNCTION_BLOCK A\nVAR b : B; END_VAR\nEND_FUNCTION_BLOCK\nFUNCTION_BLOCK B\nVAR a : A; END_VAR\nEND_FUNCTION_BLOCK\n",
            15,
        ),
    ] {
        let found = errors(&format!("{text}PROGRAM main\nEND_PROGRAM\n"));
        let places: Vec<Vec<u32>> =
            found.iter().map(|one| one.labels.iter().map(|(span, _)| span.start).collect()).collect();
        assert_eq!(places, [[other]], "{text}: {found:?}");
    }
}
