//! The table of diagnostics about names, declarations and configuration: S….

use super::rules;

rules! {
    /// All rows of this table.
    table;

    UNKNOWN_NAME = "S0001" Error "unknown name" {
        "No variable, function or enumeration value of this name is visible here. Declare it, or mend the spelling."
        wrong "PROGRAM p\nVAR\n  speed : INT;\nEND_VAR\n  sped := 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  speed : INT;\nEND_VAR\n  speed := 1;\nEND_PROGRAM\n"
    }
    DUPLICATE_NAME = "S0002" Error "declared twice" {
        "A name may be declared once in its scope. Case does not matter: `Motor` and `MOTOR` are one name."
        wrong "PROGRAM p\nVAR\n  a : INT;\n  A : BOOL;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\n  b : BOOL;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n"
    }
    UNKNOWN_TYPE = "S0003" Error "unknown type" {
        "No type of this name is declared, and it is no elementary type or standard function block."
        wrong "PROGRAM p\nVAR\n  a : INTT;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\nEND_PROGRAM\n"
    }
    RECURSIVE_TYPE = "S0004" Error "a type contains itself" {
        "A structure or function block that holds an instance of itself, directly or through others, would have no end."
        wrong "TYPE\n  Node : STRUCT\n    next : Node;\n  END_STRUCT;\nEND_TYPE\nPROGRAM p\nEND_PROGRAM\n"
        right "TYPE\n  Node : STRUCT\n    next : INT;\n  END_STRUCT;\nEND_TYPE\nPROGRAM p\nEND_PROGRAM\n"
    }
    RECURSIVE_CALL = "S0005" Error "a function calls itself" {
        "Calls form no cycle (IEC 61131-3 6.6.1): the memory of a task is known before it runs. Write a loop."
        wrong "FUNCTION f : INT\nVAR_INPUT\n  n : INT;\nEND_VAR\n  f := f(n - 1);\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
        right "FUNCTION f : INT\nVAR_INPUT\n  n : INT;\nEND_VAR\n  f := n - 1;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
    }
    RECURSIVE_CONSTANT = "S0006" Error "a constant depends on itself" {
        "The value of a CONSTANT is computed from others; following them must come to an end."
        wrong "VAR_GLOBAL CONSTANT\n  a : INT := b;\n  b : INT := a;\nEND_VAR\nPROGRAM p\nEND_PROGRAM\n"
        right "VAR_GLOBAL CONSTANT\n  a : INT := b;\n  b : INT := 1;\nEND_VAR\nPROGRAM p\nEND_PROGRAM\n"
    }
    NOT_CONSTANT = "S0007" Error "a constant is wanted" {
        "Initial values, array bounds, string lengths and CASE labels must be known when the program is compiled: literals, CONSTANT variables, and arithmetic on them."
        wrong "PROGRAM p\nVAR\n  n : INT := 3;\n  a : ARRAY[0..n] OF INT;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR CONSTANT\n  n : INT := 3;\nEND_VAR\nVAR\n  a : ARRAY[0..n] OF INT;\nEND_VAR\nEND_PROGRAM\n"
    }
    UNKNOWN_MEMBER = "S0008" Error "unknown field" {
        "The structure, function block or enumeration has nothing of this name."
        wrong "PROGRAM p\nVAR\n  t : TON;\n  b : BOOL;\nEND_VAR\n  b := t.QQ;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  t : TON;\n  b : BOOL;\nEND_VAR\n  b := t.Q;\nEND_PROGRAM\n"
    }
    HIDDEN_MEMBER = "S0009" Error "the variable is private to its function block" {
        "From outside only inputs and outputs of a function block are visible."
        wrong "FUNCTION_BLOCK F\nVAR\n  n : INT;\nEND_VAR\n  n := n + 1;\nEND_FUNCTION_BLOCK\nPROGRAM p\nVAR\n  f : F;\n  a : INT;\nEND_VAR\n  f();\n  a := f.n;\nEND_PROGRAM\n"
        right "FUNCTION_BLOCK F\nVAR_OUTPUT\n  n : INT;\nEND_VAR\n  n := n + 1;\nEND_FUNCTION_BLOCK\nPROGRAM p\nVAR\n  f : F;\n  a : INT;\nEND_VAR\n  f();\n  a := f.n;\nEND_PROGRAM\n"
    }
    NOT_CALLABLE = "S0010" Error "this can not be called" {
        "Functions and instances of function blocks are called. A type or a program is not; declare an instance. A function block has no value, so its call is a statement."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  TON(IN := TRUE);\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  t : TON;\nEND_VAR\n  t(IN := TRUE);\nEND_PROGRAM\n"
    }
    UNKNOWN_PARAMETER = "S0011" Error "unknown parameter" {
        "What is called has no parameter of this name, or it is given the wrong way: `:=` for inputs, `=>` for outputs."
        wrong "PROGRAM p\nVAR\n  t : TON;\nEND_VAR\n  t(INN := TRUE);\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  t : TON;\nEND_VAR\n  t(IN := TRUE);\nEND_PROGRAM\n"
    }
    ARGUMENT_COUNT = "S0012" Error "wrong number of arguments" {
        "The call has more arguments than there are parameters, or lacks one that has no default."
        wrong "PROGRAM p\nVAR\n  a : LREAL;\nEND_VAR\n  a := SQRT(a, a);\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : LREAL;\nEND_VAR\n  a := SQRT(a);\nEND_PROGRAM\n"
    }
    PARAMETER_TWICE = "S0013" Error "a parameter is given twice" {
        "Each parameter takes one value."
        wrong "PROGRAM p\nVAR\n  t : TON;\nEND_VAR\n  t(IN := TRUE, IN := FALSE);\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  t : TON;\nEND_VAR\n  t(IN := TRUE);\nEND_PROGRAM\n"
    }
    IN_OUT = "S0014" Error "VAR_IN_OUT without a variable" {
        "A VAR_IN_OUT stands for a variable of the caller, so each call connects one. A bit has no address and can not be connected."
        wrong "FUNCTION f : INT\nVAR_IN_OUT\n  x : INT;\nEND_VAR\n  x := 1;\n  f := x;\nEND_FUNCTION\nPROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := f();\nEND_PROGRAM\n"
        right "FUNCTION f : INT\nVAR_IN_OUT\n  x : INT;\nEND_VAR\n  x := 1;\n  f := x;\nEND_FUNCTION\nPROGRAM p\nVAR\n  a : INT;\n  b : INT;\nEND_VAR\n  a := f(x := b);\nEND_PROGRAM\n"
    }
    NOT_A_VARIABLE = "S0015" Error "a variable is wanted" {
        "Only a variable, or a part of one, can be assigned to or connected."
        wrong "FUNCTION f : INT\nVAR_IN_OUT\n  x : INT;\nEND_VAR\n  x := 1;\n  f := x;\nEND_FUNCTION\nPROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := f(x := 3);\nEND_PROGRAM\n"
        right "FUNCTION f : INT\nVAR_IN_OUT\n  x : INT;\nEND_VAR\n  x := 1;\n  f := x;\nEND_FUNCTION\nPROGRAM p\nVAR\n  a : INT;\n  b : INT;\nEND_VAR\n  a := f(x := b);\nEND_PROGRAM\n"
    }
    NOT_WRITABLE = "S0016" Error "this can not be written" {
        "CONSTANT variables, inputs of the process image (%I), system variables, and outputs of a function block from outside are only read."
        wrong "PROGRAM p\nVAR CONSTANT\n  a : INT := 1;\nEND_VAR\n  a := 2;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT := 1;\nEND_VAR\n  a := 2;\nEND_PROGRAM\n"
    }
    OUTSIDE_LOOP = "S0017" Error "EXIT or CONTINUE outside of a loop" {
        "EXIT leaves the innermost loop and CONTINUE starts its next pass, so both need one around them."
        wrong "PROGRAM p\n  EXIT;\nEND_PROGRAM\n"
        right "PROGRAM p\n  WHILE TRUE DO\n    EXIT;\n  END_WHILE;\nEND_PROGRAM\n"
    }
    UNREACHABLE = "S0018" Warning "statements that nothing gets to" {
        "Behind EXIT, CONTINUE or RETURN in the same list nothing runs."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  RETURN;\n  a := 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := 1;\n  RETURN;\nEND_PROGRAM\n"
    }
    EXTERNAL = "S0019" Error "VAR_EXTERNAL without its global" {
        "A VAR_EXTERNAL names a global variable that the resource sees, with the same type, and CONSTANT if that is."
        wrong "VAR_GLOBAL\n  g : INT;\nEND_VAR\nPROGRAM p\nVAR_EXTERNAL\n  g : BOOL;\nEND_VAR\n  g := TRUE;\nEND_PROGRAM\n"
        right "VAR_GLOBAL\n  g : INT;\nEND_VAR\nPROGRAM p\nVAR_EXTERNAL\n  g : INT;\nEND_VAR\n  g := 1;\nEND_PROGRAM\n"
    }
    BLOCK_NOT_HERE = "S0020" Error "a function block instance can not stand here" {
        "An instance keeps its state from call to call. Variables of a FUNCTION and VAR_TEMP are fresh at each call, so they hold none; pass it as VAR_IN_OUT."
        wrong "FUNCTION f : INT\nVAR\n  t : TON;\nEND_VAR\n  f := 1;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
        right "FUNCTION f : INT\nVAR_IN_OUT\n  t : TON;\nEND_VAR\n  f := 1;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
    }
    NOT_SUPPORTED = "S0021" Error "not of the language yet" {
        "The standard has this, and this compiler will; it does not yet."
        wrong "PROGRAM p\nVAR\n  r : REF_TO INT;\nEND_VAR\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  r : INT;\nEND_VAR\nEND_PROGRAM\n"
    }
    CASE_OVERLAP = "S0022" Error "a value selects two arms" {
        "Each value may stand in one arm of a CASE, alone or in a range."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  CASE a OF\n    1..5: a := 0;\n    3: a := 1;\n  END_CASE;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  CASE a OF\n    1..5: a := 0;\n    6: a := 1;\n  END_CASE;\nEND_PROGRAM\n"
    }
    BAD_ADDRESS = "S0023" Error "a wrong address" {
        "The size letter of an address must fit the variable's type: X one bit, B 8, W 16, D 32, L 64. %IX3.5 is bit 5 of byte 3, %IW1 are bytes 2 and 3."
        wrong "PROGRAM p\nVAR\n  a AT %QB0 : INT;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a AT %QW0 : INT;\nEND_VAR\n  a := 1;\nEND_PROGRAM\n"
    }
    AMBIGUOUS_NAME = "S0024" Error "several enumerations have this value" {
        "Where the type does not follow from the place, write it before the value."
        wrong "TYPE\n  A : (on, off);\n  B : (on, dim);\nEND_TYPE\nPROGRAM p\nVAR\n  b : BOOL;\nEND_VAR\n  b := on = on;\nEND_PROGRAM\n"
        right "TYPE\n  A : (on, off);\n  B : (on, dim);\nEND_TYPE\nPROGRAM p\nVAR\n  b : BOOL;\nEND_VAR\n  b := A#on = A#on;\nEND_PROGRAM\n"
    }
    NO_EFFECT = "S0025" Warning "the result is not used" {
        "A standard function does nothing but compute its result."
        wrong "PROGRAM p\nVAR\n  a : LREAL;\nEND_VAR\n  SQRT(a);\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : LREAL;\nEND_VAR\n  a := SQRT(a);\nEND_PROGRAM\n"
    }
    ZERO_STEP = "S0026" Warning "a step of zero" {
        "A FOR loop whose step is 0 would never end, so it traps when it starts."
        wrong "PROGRAM p\nVAR\n  i : INT;\nEND_VAR\n  FOR i := 1 TO 9 BY 0 DO\n    ;\n  END_FOR;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  i : INT;\nEND_VAR\n  FOR i := 1 TO 9 BY 1 DO\n    ;\n  END_FOR;\nEND_PROGRAM\n"
    }
    EDGE = "S0027" Error "R_EDGE or F_EDGE where there is no edge to see" {
        "The edge of an input shows between one call and the next, so it is for inputs of type BOOL of a function block or program; a function remembers nothing."
        wrong "FUNCTION f : BOOL\nVAR_INPUT\n  x : BOOL R_EDGE;\nEND_VAR\n  f := x;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
        right "FUNCTION_BLOCK F\nVAR_INPUT\n  x : BOOL R_EDGE;\nEND_VAR\nVAR_OUTPUT\n  n : INT;\nEND_VAR\n  IF x THEN\n    n := n + 1;\n  END_IF;\nEND_FUNCTION_BLOCK\nPROGRAM p\nVAR\n  f : F;\nEND_VAR\n  f(x := TRUE);\nEND_PROGRAM\n"
    }
    DUPLICATE_TASK = "S0030" Error "two tasks of one name" {
        "Task names are unique in their resource, so that WITH means one of them."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    TASK t(INTERVAL := T#2ms, PRIORITY := 1);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    TASK u(INTERVAL := T#2ms, PRIORITY := 1);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    PRIORITY = "S0031" Error "PRIORITY is missing or no priority" {
        "Each task says its PRIORITY: a whole number from 0, the highest, to 65535."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    INTERVAL = "S0032" Error "INTERVAL is no interval" {
        "INTERVAL is a TIME of at least 1 µs and a whole number of microseconds."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := 10, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#10ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    SINGLE = "S0033" Error "SINGLE is no BOOL source" {
        "SINGLE starts a task on the rising edge of a BOOL: a global, a variable of a program instance, a bit of the process image, or a literal."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(SINGLE := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    VAR_GLOBAL\n      go : BOOL;\n    END_VAR\n    TASK t(SINGLE := go, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    UNKNOWN_TASK = "S0034" Error "unknown task" {
        "WITH names a task of the same resource."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK fast(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH fats : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK fast(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH fast : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    UNKNOWN_PROGRAM = "S0035" Error "unknown program" {
        "A program instance is of a declared PROGRAM."
        wrong "PROGRAM main\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    PROGRAM i : mian;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM main\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    PROGRAM i : main;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    CONNECTION = "S0036" Error "a wrong connection" {
        "A program's inputs are connected with `:=` to a global, an address or a constant, its outputs with `=>` to a global or an address."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := 1;\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    PROGRAM i : p(a := 1);\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nVAR_INPUT\n  a : INT;\nEND_VAR\n  ;\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    PROGRAM i : p(a := 1);\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    NOTHING_RUNS = "S0037" Warning "nothing runs" {
        "A resource without a program instance has tasks with nothing to do."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    SHARED_GLOBAL = "S0038" Error "two resources use one global" {
        "Resources run on their own and share no memory, so a global of the configuration may be used by one of them. Declare it in the resource."
        wrong "PROGRAM p\n  g := g + 1;\nEND_PROGRAM\nCONFIGURATION c\n  VAR_GLOBAL\n    g : INT;\n  END_VAR\n  RESOURCE a ON cpu\n    PROGRAM i : p;\n  END_RESOURCE\n  RESOURCE b ON cpu\n    PROGRAM i : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\n  g := g + 1;\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE a ON cpu\n    VAR_GLOBAL\n      g : INT;\n    END_VAR\n    PROGRAM i : p;\n  END_RESOURCE\n  RESOURCE b ON cpu\n    VAR_GLOBAL\n      g : INT;\n    END_VAR\n    PROGRAM i : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    STARTUP = "S0039" Error "no startup function" {
        "The attribute 'startup' stands before one FUNCTION without parameters."
        wrong "{attribute 'startup'}\nFUNCTION f : INT\nVAR_INPUT\n  n : INT;\nEND_VAR\n  f := n;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
        right "{attribute 'startup'}\nFUNCTION f : INT\n  f := 1;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
    }
    ATTRIBUTE = "S0040" Error "a wrong attribute value" {
        "Attributes of a task: 'watchdog' and 'phase' are times as in 'T#10ms', 'watchdog_sensitivity' a number, 'overrun' is 'grid', 'at-once' or 'realign'."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    {attribute 'watchdog' := 'soon'}\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    {attribute 'watchdog' := 'T#5ms'}\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    FREEWHEELING = "S0041" Warning "a task without INTERVAL and SINGLE" {
        "Such a task runs in every round, as fast as the resource can."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    UNKNOWN_ATTRIBUTE = "S0042" Warning "an attribute that no task has" {
        "Attributes of a task are 'watchdog', 'watchdog_sensitivity', 'phase' and 'overrun'. Another one, perhaps of another tool or misspelt, changes nothing."
        wrong "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    {attribute 'watchdgo' := 'T#5ms'}\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    {attribute 'watchdog' := 'T#5ms'}\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
    }
    PLACELESS = "S0043" Error "a variable without its place" {
        "`AT %I*`, `AT %Q*` and `AT %M*` leave the address to VAR_CONFIG, which must give one for every instance of the program or function block."
        wrong "PROGRAM p\nVAR\n  a AT %I* : BOOL;\n  q : BOOL;\nEND_VAR\n  q := a;\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        right "PROGRAM p\nVAR\n  a AT %I* : BOOL;\n  q : BOOL;\nEND_VAR\n  q := a;\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\n  VAR_CONFIG\n    r.i.a AT %IX0.3 : BOOL;\n  END_VAR\nEND_CONFIGURATION\n"
    }
    CONFIG_VAR = "S0044" Error "a wrong entry of VAR_CONFIG" {
        "An entry is `resource.program.variable`, through function block instances, structures and arrays where the variable lies deeper. It gives an address to what is declared `AT %I*`, `%Q*` or `%M*`, in that area, and an initial value to any stored variable."
        wrong "PROGRAM p\nVAR\n  n : INT;\nEND_VAR\n  n := n + 1;\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\n  VAR_CONFIG\n    r.i.n AT %QW0 : INT;\n  END_VAR\nEND_CONFIGURATION\n"
        right "PROGRAM p\nVAR\n  n : INT;\nEND_VAR\n  n := n + 1;\nEND_PROGRAM\nCONFIGURATION c\n  RESOURCE r ON cpu\n    TASK t(INTERVAL := T#1ms, PRIORITY := 0);\n    PROGRAM i WITH t : p;\n  END_RESOURCE\n  VAR_CONFIG\n    r.i.n : INT := 5;\n  END_VAR\nEND_CONFIGURATION\n"
    }
    LIMIT = "S0050" Error "a limit of the container" {
        "The compiled form has room for 65535 of each kind of thing, and a memory image has a largest size. Split the project into resources."
        wrong ""
        right ""
    }
    TOO_DEEP = "S0051" Error "nested too deep" {
        "Types, declarations that depend on one another, and loops nest up to a fixed depth."
        wrong ""
        right ""
    }
    ASSERTION = "S0060" Error "a wrong assertion" {
        "Assertions compare values that meet in one type, arrays and structures only with EQ, NEQ and their like. Each takes its operands and, last, a message. ADVANCE_TIME takes a TIME or a number of nanoseconds."
        wrong "FUNCTION Half : INT\nVAR_INPUT\n  x : INT;\nEND_VAR\n  Half := x / 2;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\nTEST 'half'\n  ASSERT_EQ(Half(8));\nEND_TEST\n"
        right "FUNCTION Half : INT\nVAR_INPUT\n  x : INT;\nEND_VAR\n  Half := x / 2;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\nTEST 'half'\n  ASSERT_EQ(Half(8), 4);\nEND_TEST\n"
    }
    MOCK = "S0061" Error "nothing to mock" {
        "MOCK names an instance of a function block (or of a program), MOCK_FUNCTION a FUNCTION of the sources that has a result. Standard functions are what they are."
        wrong "PROGRAM p\nEND_PROGRAM\nTEST 'pump'\nVAR\n  speed : INT;\nEND_VAR\n  MOCK speed;\nEND_TEST\n"
        right "FUNCTION_BLOCK Pump\nEND_FUNCTION_BLOCK\nPROGRAM p\nEND_PROGRAM\nTEST 'pump'\nVAR\n  pump1 : Pump;\nEND_VAR\n  MOCK pump1;\nEND_TEST\n"
    }
    UNUSED_VARIABLE = "S0070" Warning "a variable that is never used" {
        "Nothing reads or writes it. Variables at an address, and those of a PROGRAM that have an initial value, are left alone: others may use them from outside."
        wrong "FUNCTION f : INT\nVAR\n  a : INT;\n  b : INT;\nEND_VAR\n  a := 1;\n  f := a;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
        right "FUNCTION f : INT\nVAR\n  a : INT;\nEND_VAR\n  a := 1;\n  f := a;\nEND_FUNCTION\nPROGRAM p\nEND_PROGRAM\n"
    }
    OUTPUT_NEVER_WRITTEN = "S0071" Warning "an output that is never written" {
        "The body neither assigns the output (or the function's result) nor hands it on, so it keeps its initial value."
        wrong "FUNCTION_BLOCK F\nVAR_INPUT\n  x : INT;\nEND_VAR\nVAR_OUTPUT\n  y : INT;\nEND_VAR\nVAR\n  z : INT;\nEND_VAR\n  z := x;\nEND_FUNCTION_BLOCK\nPROGRAM p\nEND_PROGRAM\n"
        right "FUNCTION_BLOCK F\nVAR_INPUT\n  x : INT;\nEND_VAR\nVAR_OUTPUT\n  y : INT;\nEND_VAR\n  y := x;\nEND_FUNCTION_BLOCK\nPROGRAM p\nEND_PROGRAM\n"
    }
    SELF_ASSIGNMENT = "S0072" Warning "a variable is assigned to itself" {
        "The assignment changes nothing; another variable is probably meant on one side."
        wrong "PROGRAM p\nVAR\n  a : INT;\n  b : INT;\nEND_VAR\n  b := 1;\n  a := a;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\n  b : INT;\nEND_VAR\n  b := 1;\n  a := b;\nEND_PROGRAM\n"
    }
    EMPTY_BODY = "S0073" Warning "a statement around nothing" {
        "There is no statement where the branch or loop should do something. A `;` says that nothing is meant to happen."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  IF a > 1 THEN\n  END_IF;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  IF a > 1 THEN\n    a := 0;\n  END_IF;\nEND_PROGRAM\n"
    }
    SHADOWED_GLOBAL = "S0074" Warning "a variable hides a global one" {
        "Inside of this unit the name means the unit's own variable; the global of the same name can not be reached. VAR_EXTERNAL says that the global is meant."
        wrong "VAR_GLOBAL\n  speed : INT;\nEND_VAR\nPROGRAM p\nVAR\n  speed : INT;\nEND_VAR\n  speed := 1;\nEND_PROGRAM\n"
        right "VAR_GLOBAL\n  speed : INT;\nEND_VAR\nPROGRAM p\nVAR_EXTERNAL\n  speed : INT;\nEND_VAR\n  speed := 1;\nEND_PROGRAM\n"
    }
    LOOP_VARIABLE = "S0075" Warning "the loop's own variable is changed in its body" {
        "How often the loop runs was fixed when it started, from its first value, last value and step; the standard forbids to change the control variable (7.3.3.4). Leave the loop with EXIT, or write WHILE."
        wrong "PROGRAM p\nVAR\n  i : INT;\nEND_VAR\n  FOR i := 1 TO 9 DO\n    i := i + 1;\n  END_FOR;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  i : INT;\nEND_VAR\n  FOR i := 1 TO 9 BY 2 DO\n    ;\n  END_FOR;\nEND_PROGRAM\n"
    }
    LITERAL_CONDITION = "S0076" Warning "a condition that is written as TRUE or FALSE" {
        "The branch is always or never taken: often something left over from a trial. A named CONSTANT makes a switch of it."
        wrong "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  IF FALSE THEN\n    a := 1;\n  END_IF;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\nVAR CONSTANT\n  trial : BOOL := FALSE;\nEND_VAR\n  IF trial THEN\n    a := 1;\n  END_IF;\nEND_PROGRAM\n"
    }
    MISSING_VALUES = "S0077" Note "a CASE leaves values of its enumeration out" {
        "For a value without an arm the CASE does nothing. An ELSE, even with `;` alone, says that this is meant."
        wrong "TYPE\n  C : (red, yellow, green);\nEND_TYPE\nPROGRAM p\nVAR\n  c : C;\n  a : INT;\nEND_VAR\n  CASE c OF\n    red: a := 1;\n    green: a := 2;\n  END_CASE;\nEND_PROGRAM\n"
        right "TYPE\n  C : (red, yellow, green);\nEND_TYPE\nPROGRAM p\nVAR\n  c : C;\n  a : INT;\nEND_VAR\n  CASE c OF\n    red: a := 1;\n    green: a := 2;\n  ELSE\n    a := 0;\n  END_CASE;\nEND_PROGRAM\n"
    }
    UNDERSCORES = "S0078" Warning "a name with underscores where the standard has none" {
        "A name is made of letters, digits and single underscores between or before them (6.1.2). This compiler takes the others too; many do not."
        wrong "PROGRAM p\nVAR\n  a__b : INT;\nEND_VAR\n  a__b := a__b + 1;\nEND_PROGRAM\n"
        right "PROGRAM p\nVAR\n  a_b : INT;\nEND_VAR\n  a_b := a_b + 1;\nEND_PROGRAM\n"
    }
}
