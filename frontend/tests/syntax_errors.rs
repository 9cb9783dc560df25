//! What the parser says about wrong texts: place, code, words, and that it says nothing more.

#[allow(dead_code, reason = "each test file uses its own part of what they share")]
mod support;

use support::{messages, parse};

/// The messages about statements, which begin on line 2.
fn body(text: &str) -> Vec<String> {
    messages(&format!("PROGRAM p\n{text}\nEND_PROGRAM\n"))
}

/// The help lines of a text.
fn helps(text: &str) -> Vec<String> {
    parse(text).1.into_iter().filter_map(|one| one.help).collect()
}

#[test]
fn a_missing_semicolon_is_shown_behind_the_statement() {
    assert_eq!(
        body("x := 1\ny := 2;\nz := ;"),
        ["2:7 P0004 expected `;` after this statement, found `y`", "4:6 P0004 expected an expression, found `;`",]
    );
    assert_eq!(
        body("f(1)\nIF a THEN EXIT END_IF;"),
        [
            "2:5 P0004 expected `;` after this statement, found `IF`",
            "3:15 P0004 expected `;` after this statement, found `END_IF`",
        ]
    );
    assert_eq!(
        messages("VAR_GLOBAL\n  a : INT\n  b : INT := 1\nEND_VAR"),
        [
            "2:10 P0004 expected `;` after this declaration, found `b`",
            "3:15 P0004 expected `;` after this declaration, found `END_VAR`",
        ]
    );
}

#[test]
fn operators_of_other_languages() {
    assert_eq!(
        body("x = 1;\nx == 1;\nx : = 1;"),
        [
            "2:3 P0019 `=` compares; it does not assign",
            "3:3 P0019 `==` compares; it does not assign",
            "4:3 P0019 `:=` is written without a space",
        ]
    );
    assert_eq!(
        body("IF a == b && !c || d != e THEN f := 1; END_IF;"),
        [
            "2:6 P0021 `==` is no operator of Structured Text",
            "2:11 P0021 `&&` is no operator of Structured Text",
            "2:14 P0021 `!` is no operator of Structured Text",
            "2:17 P0021 `||` is no operator of Structured Text",
            "2:22 P0021 `!=` is no operator of Structured Text",
        ]
    );
    assert_eq!(helps("PROGRAM p x := a != b; END_PROGRAM"), ["write `<>`"]);
    assert_eq!(body("IF a := b THEN c := 1; END_IF;"), ["2:6 P0020 `:=` assigns; it cannot stand in a condition"]);
    assert_eq!(body("FOR i = 1 TO 2 DO END_FOR;"), ["2:7 P0019 `=` compares; the first value is given with `:=`"]);
    assert_eq!(messages("VAR_GLOBAL a : INT = 1; END_VAR"), ["1:20 P0019 an initial value is given with `:=`"]);
}

#[test]
fn missing_ends_show_their_beginning() {
    let text = "PROGRAM p\nFOR i := 1 TO 2 DO\nIF a THEN\nb := 1;\nEND_FOR;\nc := 1;\nEND_PROGRAM\n";
    let (_, found, sources) = parse(text);
    assert_eq!(messages(text), ["5:1 P0017 expected `END_IF`, found `END_FOR`"]);
    assert_eq!(sources.place(found[0].labels[0].0), "a.st:3:1");
    assert_eq!(found[0].labels[0].1, "this IF has no `END_IF`");

    assert_eq!(body("WHILE a DO b := 1;"), ["3:1 P0017 expected `END_WHILE`, found `END_PROGRAM`"]);
    assert_eq!(
        body("CASE a OF 1: IF b THEN c := 1; 2: d := 1; END_CASE;"),
        ["2:32 P0017 expected `END_IF`, found `2`"]
    );
    assert_eq!(
        messages("PROGRAM p\nx := 1;\n\nFUNCTION f\nEND_FUNCTION"),
        ["4:1 P0017 expected `END_PROGRAM`, found `FUNCTION`"]
    );
    assert_eq!(
        messages("PROGRAM p\nx := 1;\nEND_FUNCTION\nFUNCTION f END_FUNCTION"),
        ["3:1 P0017 expected `END_PROGRAM`, found `END_FUNCTION`"]
    );
    assert_eq!(
        messages("PROGRAM p\nVAR\nx : INT;\nx := 1;\nIF x = 1 THEN x := 2; END_IF;\nEND_PROGRAM"),
        ["4:1 P0017 expected `END_VAR`, found `x`"]
    );
    assert_eq!(
        messages("PROGRAM p\nVAR\nx : INT;\nVAR_INPUT y : INT; END_VAR\nEND_PROGRAM"),
        ["4:1 P0017 expected `END_VAR`, found `VAR_INPUT`"]
    );
    assert_eq!(messages("TYPE a : STRUCT b : INT; END_TYPE"), ["1:26 P0017 expected `END_STRUCT`, found `END_TYPE`"]);
    assert_eq!(messages("TYPE a : INT;\nPROGRAM p END_PROGRAM"), ["2:1 P0017 expected `END_TYPE`, found `PROGRAM`"]);
    assert_eq!(messages("PROGRAM p\nx := 1;"), ["2:8 P0017 expected `END_PROGRAM`, found the end of the file"]);
}

#[test]
fn stray_ends() {
    assert_eq!(
        body("a := 1;\nEND_IF;\nb := 1;\nELSE c := 1;"),
        ["3:1 P0018 `END_IF` closes nothing here", "5:1 P0018 `ELSE` closes nothing here"]
    );
    assert_eq!(
        body("IF a THEN b := 1; ELSE c := 1; ELSIF d THEN e := 1; END_IF;"),
        ["2:32 P0018 `ELSIF` after `ELSE`"]
    );
    assert_eq!(body("END_VAR\na := 1;"), ["2:1 P0018 `END_VAR` closes nothing here"]);
}

#[test]
fn misspelt_words() {
    let text = "IFF a THEN b := 1; ELSEIF c THEN d := 1; ENDIF;\nWHLE a DO RETRUN; END WHILE;";
    assert_eq!(
        body(text)[1..],
        [
            "2:20 P0023 `ELSEIF` is no word of the language",
            "2:42 P0023 `ENDIF` is no word of the language",
            "3:1 P0023 `WHLE` is no word of the language",
            "3:11 P0023 `RETRUN` is no word of the language",
            "3:19 P0023 `END_WHILE` is one word",
        ]
    );
    assert_eq!(helps("PROGRAM p\nVAR_INPT x : INT; END_VAR\nEND_PROGRAM"), ["did you mean `VAR_INPUT`?"]);
    assert_eq!(
        helps("FUNCTIONBLOCK p\nEND_FUNCTIONBLOCK"),
        ["did you mean `FUNCTION_BLOCK`?", "did you mean `END_FUNCTION_BLOCK`?"]
    );
    assert_eq!(helps("VAR_GLOBAL a : INT; ENDVAR"), ["did you mean `END_VAR`?"]);
    assert_eq!(helps("PROGRAM p IF a THAN b := 1; END_IF; END_PROGRAM"), ["did you mean `THEN`?"]);
    assert_eq!(
        helps("CONFIGURATION c TASK t(INTERVALL := T#1s, PRIO := 1); END_CONFIGURATION")[..1],
        ["did you mean `INTERVAL`?"]
    );
}

#[test]
fn names_that_are_near_to_a_word_are_still_names() {
    assert_eq!(
        body("foo;\ncast;"),
        ["2:1 P0022 this has a value and does nothing with it", "3:1 P0022 this has a value and does nothing with it",]
    );
    assert_eq!(body("fort := 1; whille(a := 2); endif := 3; foo.bar := cast[1];"), Vec::<String>::new());
    assert_eq!(messages("VAR_GLOBAL endvar : INT; vars, cased AT %MW0 : INT; END_VAR"), Vec::<String>::new());
}

#[test]
fn missing_and_wrong_header_words() {
    assert_eq!(body("IF a b := 1; END_IF;"), ["2:5 P0004 expected `THEN` after the condition, found `b`"]);
    assert_eq!(body("IF a DO b := 1; END_IF;"), ["2:5 P0004 expected `THEN` after the condition, found `DO`"]);
    assert_eq!(body("WHILE a THEN b := 1; END_WHILE;"), ["2:8 P0004 expected `DO` after the condition, found `THEN`"]);
    assert_eq!(body("FOR i := 1 2 DO END_FOR;"), ["2:11 P0004 expected `TO` after the first value, found `2`"]);
    assert_eq!(body("CASE a 1: b := 1; END_CASE;"), ["2:7 P0004 expected `OF` after the selector, found `1`"]);
    assert_eq!(
        body("CASE a OF b := 1; 2: c := 1; END_CASE;"),
        ["2:11 P0004 expected the label of a CASE arm, found `b`"]
    );
}

#[test]
fn brackets() {
    assert_eq!(
        body("x := (a + b;\ny := f(1, 2;\nz := a[1;"),
        [
            "2:12 P0004 expected `)` after the expression, found `;`",
            "3:12 P0004 expected `)` after the arguments, found `;`",
            "4:9 P0004 expected `]` after the index, found `;`",
        ]
    );
    assert_eq!(body("f(a := 1\n  b := 2);"), ["2:9 P0004 expected `,` after this argument, found `b`"]);
    assert_eq!(body("f(a, );"), ["2:6 P0004 expected another argument after `,`, found `)`"]);
    assert_eq!(body("x := a);"), ["2:7 P0004 expected `;` after this statement, found `)`"]);
}

#[test]
fn things_that_are_no_statements() {
    assert_eq!(
        body("a;\nb.c;\nd + 1;\n5;\n);"),
        [
            "2:1 P0022 this has a value and does nothing with it",
            "3:1 P0022 this has a value and does nothing with it",
            "4:1 P0022 this computes a value and does nothing with it",
            "5:1 P0004 expected a statement, found `5`",
            "6:1 P0004 expected a statement, found `)`",
        ]
    );
}

#[test]
fn names_and_words() {
    assert_eq!(
        messages("PROGRAM p VAR if : INT; END_VAR END_PROGRAM"),
        ["1:15 P0015 `IF` is a reserved word and cannot be a name"]
    );
    assert_eq!(body("größe := größe + 1;"), ["2:1 P0016 the name `größe` has letters other than A to Z"]);
    assert_eq!(
        messages("PROGRAM VAR x : INT; END_VAR END_PROGRAM"),
        ["1:9 P0004 expected the name of the PROGRAM, found `VAR`"]
    );
    assert_eq!(
        messages("x := 1;\ny := 2;"),
        [
            "1:1 P0004 expected a declaration: `PROGRAM`, `FUNCTION`, `FUNCTION_BLOCK`, `TYPE`, `VAR_GLOBAL` or `CONFIGURATION`, found `x`",
        ]
    );
}

#[test]
fn lexical_mistakes() {
    assert_eq!(body("x := 'abc;\ny := 1;"), ["2:6 P0007 this string does not end on its line"]);
    assert_eq!(body("x := a \u{2013} b;"), ["2:8 P0005 `\u{2013}` has no meaning here"]);
    assert_eq!(body("x :=\u{A0}1;"), ["2:5 P0005 `\\u{a0}` has no meaning here"]);
    assert_eq!(body("x := 1 ? 2;"), ["2:8 P0005 `?` has no meaning here"]);
    assert_eq!(
        body("x := 2#12 + 1_ + 12ab + 16#FFFFFFFFFFFFFFFFF + T#5 + '$x' + %ZX1;"),
        [
            "2:6 P0009 `2` is no digit of base 2",
            "2:13 P0009 `1_`: a `_` may only stand between two digits",
            "2:18 P0009 `12ab` is neither a number nor a name",
            "2:25 P0010 `16#FFFFFFFFFFFFFFFFF` is too large for any type",
            "2:48 P0011 a unit is missing after `5`",
            "2:54 P0013 `$x` is no escape",
            "2:61 P0014 `%ZX1` is no address",
        ]
    );
    assert_eq!(
        messages("PROGRAM p\n(* (* *)\nEND_PROGRAM"),
        ["2:1 P0006 this comment has no end", "1:10 P0017 expected `END_PROGRAM`, found the end of the file",]
            .into_iter()
            .rev()
            .collect::<Vec<_>>()
    );
}

#[test]
fn sections_at_wrong_places_are_kept() {
    let (ast, found, _) = parse("PROGRAM p\nx := 1;\nVAR x : INT; END_VAR\nx := 2;\nEND_PROGRAM");
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].code(), "P0025");
    let khz_frontend::syntax::ast::Declaration::Pou(pou) = &ast.files[0].declarations[0] else { panic!("a program") };
    assert_eq!((pou.sections.len(), pou.body.statements.len()), (1, 2));
    assert_eq!(
        messages("PROGRAM p\nVAR_CONFIG a.b : INT; END_VAR\nEND_PROGRAM"),
        ["2:1 P0025 `VAR_CONFIG` stands in a CONFIGURATION only"]
    );
    assert_eq!(
        messages("PROGRAM p\n a, b : INT;\n c AT %MW0 : INT;\nEND_VAR\nEND_PROGRAM"),
        ["1:10 P0004 expected `VAR` after what stands before these declarations, found `a`"]
    );
}

#[test]
fn what_is_not_supported_is_skipped_whole() {
    let text = "FUNCTION_BLOCK f EXTENDS g IMPLEMENTS h, i\nMETHOD PUBLIC m : BOOL\nVAR x : INT; END_VAR\nm := x > 1;\nEND_METHOD\nEND_FUNCTION_BLOCK\nINTERFACE j\nMETHOD k : INT\nEND_METHOD\nEND_INTERFACE\nPROGRAM p END_PROGRAM";
    assert_eq!(
        messages(text),
        [
            "1:18 P0026 `EXTENDS` is not supported by this version",
            "1:28 P0026 `IMPLEMENTS` is not supported by this version",
            "2:1 P0026 `METHOD` is not supported by this version",
            "7:1 P0026 `INTERFACE` is not supported by this version",
        ]
    );
}

#[test]
fn configurations() {
    let config = |text: &str| messages(&format!("CONFIGURATION c\n{text}\nEND_CONFIGURATION"));
    assert_eq!(
        config("TASK t(INTERVAL = T#1s);\nPROGRAM i WITH t : p;"),
        ["2:16 P0004 expected `:=` after the name of the parameter, found `=`"]
    );
    assert_eq!(config("TASK t(FOO := 1, PRIORITY := 2);"), ["2:8 P0027 `FOO` is no parameter of a task"]);
    assert_eq!(
        config("RESOURCE r ON PLC\nTASK t(PRIORITY := 1)\nPROGRAM i WITH t : p;"),
        [
            "3:22 P0004 expected `;` after this task, found `PROGRAM`",
            "5:1 P0017 expected `END_RESOURCE`, found `END_CONFIGURATION`",
        ]
    );
    assert_eq!(
        config("PROGRAM i WITH t p;"),
        ["2:17 P0004 expected `:` after the name of the instance or its task, found `p`"]
    );
    assert_eq!(
        config("TSK t(PRIORITY := 1);\nx := 1;"),
        ["2:1 P0023 `TSK` is no word here", "3:1 P0004 expected `TASK`, `PROGRAM` or `END_CONFIGURATION`, found `x`"]
    );
    assert_eq!(
        messages("CONFIGURATION c\nTASK t(PRIORITY := 1);\nPROGRAM main\nVAR x : INT; END_VAR\nEND_PROGRAM"),
        ["3:1 P0017 expected `END_CONFIGURATION`, found `PROGRAM`"]
    );
}

#[test]
fn qualifiers_and_attributes() {
    assert_eq!(
        messages("VAR_GLOBAL RETAIN NON_RETAIN a : INT; END_VAR"),
        ["1:19 P0030 this contradicts or repeats the word before it"]
    );
    assert_eq!(messages("VAR_GLOBAL CONSTANT CONSTANT a : INT; END_VAR"), ["1:21 P0030 CONSTANT stands here twice"]);
    assert_eq!(
        body("{attribute 'x'}\na := 1;"),
        ["2:1 P0028 the attribute 'x' stands before nothing that can have it"]
    );
    assert_eq!(messages("{attribute x} PROGRAM p END_PROGRAM"), ["1:1 P0029 this attribute cannot be read"]);
    assert_eq!(messages("{attribute 'a'}"), ["1:1 P0028 the attribute 'a' stands before nothing that can have it"]);
}

#[test]
fn empty_texts_say_nothing() {
    for text in ["", " \n", "(* only *)", ";;", "// x"] {
        assert_eq!(messages(text), Vec::<String>::new());
    }
}
