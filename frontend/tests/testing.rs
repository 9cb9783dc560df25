//! Unit tests in ST as the front end sees them: what is refused, what their words mean elsewhere, what a build makes of them.

use expect_test::{Expect, expect};
use khz_bytecode::verify::verify;
use khz_frontend::testing::MAX_TESTS;
use khz_frontend::{CompileOptions, SourceInput, check, compile, compile_tests};

fn sources(text: &str) -> Vec<SourceInput> {
    vec![SourceInput { name: "t.st".to_owned(), bytes: text.as_bytes().to_vec() }]
}

/// Every message, with its help.
fn messages(text: &str) -> String {
    let found = check(&sources(text), &CompileOptions::default());
    let lines = found.diagnostics.iter().map(|one| {
        let help = one.help.as_ref().map(|help| format!(" ({help})")).unwrap_or_default();
        format!("{} {} {}{help}\n", found.sources.place(one.span), one.code(), one.message)
    });
    lines.collect()
}

/// Messages about the statements of a test that has some variables and things to mock.
fn in_test(statements: &str, expected: &Expect) {
    let text = format!(
        "FUNCTION_BLOCK Pump VAR_INPUT run : BOOL; END_VAR VAR_OUTPUT running : BOOL; END_VAR running := run; END_FUNCTION_BLOCK \
         FUNCTION Act VAR_INPUT x : INT; END_VAR END_FUNCTION \
         FUNCTION Half : INT VAR_INPUT x : INT; END_VAR Half := x / 2; END_FUNCTION \
         TEST 't' VAR p : Pump; q : ARRAY[1..2] OF Pump; n : INT; t : TIME; s : STRING; a : ARRAY[0..2000] OF INT; END_VAR\n\
         {statements}\nEND_TEST\n"
    );
    expected.assert_eq(&messages(&text));
}

#[test]
fn assertions_want_their_operands() {
    in_test(
        "ASSERT_EQ(n);\nASSERT_EQ(n, 1, 'm', 2);\nASSERT_EQ(actual := n, wrong := 3);\nASSERT_EQ(n, 1, 5);\nASSERT_TRUE();",
        &expect![[r#"
            t.st:2:1 S0060 ASSERT_EQ takes ACTUAL, EXPECTED
            t.st:3:22 S0060 ASSERT_EQ takes ACTUAL, EXPECTED and a message
            t.st:4:24 S0060 ASSERT_EQ takes ACTUAL, EXPECTED and a message
            t.st:5:17 T0001 a message is a STRING or WSTRING, not an integer literal
            t.st:6:1 S0060 ASSERT_TRUE takes IN
        "#]],
    );
}

#[test]
fn assertions_compare_what_meets_in_one_type() {
    in_test(
        "ASSERT_EQ(n, t);\nASSERT_TRUE(n);\nASSERT_GT(a, a);\nASSERT_EQ(a, a);\nASSERT_EQ(p, p);\nASSERT_EQ(q, q);\n\
         ASSERT_NEAR(s, 'x', 1);\nASSERT_EQ(n, nobody);",
        &expect![[r#"
            t.st:2:1 S0060 ASSERT_EQ can not compare INT and TIME
            t.st:3:13 T0004 a condition is a BOOL, not INT (compare it: `value <> 0`)
            t.st:4:1 S0060 ASSERT_GT can not compare ARRAY[0..2000] OF INT and ARRAY[0..2000] OF INT
            t.st:5:1 S0060 an assertion compares at most 1024 values; compare parts
            t.st:6:1 S0060 ASSERT_EQ can not compare Pump and Pump
            t.st:7:1 S0060 ASSERT_EQ can not compare ARRAY[1..2] OF Pump and ARRAY[1..2] OF Pump
            t.st:8:1 S0060 ASSERT_NEAR can not compare STRING[80] and STRING[1]
            t.st:9:14 S0001 `nobody` is not declared (declare it in a VAR section, or correct its name)
        "#]],
    );
}

#[test]
fn time_moves_on_by_durations_and_nanoseconds() {
    in_test(
        "ADVANCE_TIME(T#-1s);\nADVANCE_TIME(1.5);\nADVANCE_TIME();\nADVANCE_TIME(s);\nADVANCE_TIME(n);",
        &expect![[r#"
            t.st:2:14 S0060 time only moves on
            t.st:3:14 S0060 time moves on by a TIME or an integer of nanoseconds, not LREAL
            t.st:4:1 S0060 ADVANCE_TIME takes a TIME or a number of nanoseconds
            t.st:5:14 S0060 time moves on by a TIME or an integer of nanoseconds, not STRING[80]
        "#]],
    );
}

#[test]
fn only_instances_and_functions_of_the_sources_are_mocked() {
    in_test(
        "MOCK n;\nMOCK nobody;\nMOCK_FUNCTION Halv RETURNS 3;\nMOCK_FUNCTION Act RETURNS 3;\nMOCK_FUNCTION SIN RETURNS 3.0;\n\
         MOCK_FUNCTION Half RETURNS 'x';\nMOCK_FUNCTION Half;\nMOCK_VERIFY_CALLED(n);\nMOCK_VERIFY_CALL_COUNT(p);\nMOCK q[1];",
        &expect![[r#"
            t.st:2:6 S0061 INT has no body to replace: an instance of a function block is mocked
            t.st:3:6 S0001 `nobody` is not declared (declare it in a VAR section, or correct its name)
            t.st:4:15 S0061 there is no FUNCTION `Halv` in these files (did you mean `Half`?)
            t.st:5:15 S0061 `Act` has no result that could be replaced
            t.st:6:15 S0061 there is no FUNCTION `SIN` in these files
            t.st:7:28 T0001 INT is wanted here, not STRING[1] (read the number in it with `STRING_TO_INT(…)` or the like)
            t.st:8:19 P0004 expected `RETURNS` and a value after the function, found `;` (write `RETURNS` and a value there)
            t.st:9:20 S0061 INT has no body to replace: an instance of a function block is mocked
            t.st:10:1 S0060 MOCK_VERIFY_CALL_COUNT takes INSTANCE, COUNT
        "#]],
    );
}

#[test]
fn outside_of_tests_and_in_expressions_the_words_are_unknown_functions() {
    let text = "PROGRAM p\nVAR n : INT; ok : BOOL; END_VAR\nASSERT_TRUE(n = 1);\nADVANCE_TIME(T#1s);\nEND_PROGRAM\n\
                TEST 't'\nVAR ok : BOOL; END_VAR\nok := ASSERT_TRUE(ok);\nEND_TEST\n";
    expect![[r#"
        t.st:3:1 S0001 there is no function `ASSERT_TRUE` (it means something only in a TEST, and as a statement)
        t.st:4:1 S0001 there is no function `ADVANCE_TIME` (it means something only in a TEST, and as a statement)
        t.st:8:7 S0001 there is no function `ASSERT_TRUE` (it means something only in a TEST, and as a statement)
    "#]]
    .assert_eq(&messages(text));
}

#[test]
fn a_file_has_one_fixture_and_tests_have_names_of_their_own() {
    let text = "TEST 'a' END_TEST\nTEST \"a\" END_TEST\nTEST '' END_TEST\nSETUP END_SETUP\nSETUP END_SETUP\n\
                TEST 'open'\nIF TRUE THEN\nEND_TEST\nTEST_PROGRAM b\nEND_PROGRAM\nTEST_PROGRAM c END_TEST_PROGRAM\n";
    expect![[r#"
        t.st:2:6 P0031 there are two tests `a` in this file
        t.st:3:6 P0031 a test has a name (say in it what holds: `TEST 'the motor stops at its limit'`)
        t.st:5:1 P0031 a file has one SETUP
        t.st:8:1 P0017 expected `END_IF`, found `END_TEST` (write `END_IF` there)
        t.st:9:15 P0004 expected `END_TEST_PROGRAM` after the TEST_PROGRAM, found `END_PROGRAM` (write `END_TEST_PROGRAM` there)
    "#]]
    .assert_eq(&messages(text));
}

#[test]
fn words_of_tests_are_names_elsewhere() {
    let text = "PROGRAM p\nVAR test, setup, mock, teardown, end_test, advance_time, assert_eq, mock_function : INT; END_VAR\n\
                test := setup; mock := 1; end_test := test; assert_eq := 3; mock_function := 3;\n\
                CASE mock OF 1: teardown := 1; END_CASE;\nEND_PROGRAM\n\
                FUNCTION ASSERT_TRUE : BOOL VAR_INPUT x : INT; END_VAR ASSERT_TRUE := x > 1; END_FUNCTION\n\
                FUNCTION_BLOCK TEST VAR_INPUT x : INT; END_VAR END_FUNCTION_BLOCK\n\
                TEST 't'\nVAR ok : BOOL; setup, mock : INT; END_VAR\nok := ASSERT_TRUE(3); setup := 1; mock := setup;\nEND_TEST\n";
    expect![[r#"
        t.st:2:44 S0070 the variable `advance_time` is never used (leave it out)
    "#]]
    .assert_eq(&messages(text));
}

#[test]
fn a_build_leaves_tests_alone() {
    let program = "PROGRAM p\nVAR t : TON; n : INT; END_VAR\nt(IN := n > 0, PT := T#1s);\nEND_PROGRAM\n";
    let tests = "SETUP VAR x : p; END_VAR END_SETUP\nTEST 'a'\nMOCK x.t;\nx();\nASSERT_EQ(x.n, 0);\nEND_TEST\n";
    let alone = compile(&sources(program), &CompileOptions::default());
    let both = compile(&sources(&format!("{program}{tests}")), &CompileOptions::default());
    assert_eq!(both.resources.len(), 1);
    assert!(both.diagnostics.is_empty());
    let (alone, both) = (&alone.resources[0].container, &both.resources[0].container);
    assert_eq!(alone.functions, both.functions);
    assert_eq!(alone.types, both.types);
}

#[test]
fn each_test_is_a_program_of_its_own_that_verifies() {
    let text = "PROGRAM p\nVAR t : TON; n : INT; END_VAR\nt(IN := n > 0, PT := T#1s);\nEND_PROGRAM\n\
                SETUP VAR x : p; END_VAR x.n := 1; END_SETUP\nTEARDOWN x(); END_TEARDOWN\n\
                TEST 'a'\nMOCK x.t;\nx();\nASSERT_EQ(x.n, 1);\nMOCK_VERIFY_CALLED(x.t);\nEND_TEST\n\
                TEST 'b'\nASSERT_TRUE(x.t.Q, 'why');\nEND_TEST\nTEST_PROGRAM c\nEND_TEST_PROGRAM\n";
    let found = compile_tests(&sources(text), &CompileOptions::default());
    assert!(found.diagnostics.is_empty(), "{:?}", found.diagnostics);
    let names: Vec<&str> = found.tests.iter().map(|test| test.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c"]);
    assert_eq!(found.tests.iter().map(|test| test.assertions.len()).collect::<Vec<_>>(), [2, 1, 0]);
    assert_eq!(found.tests.iter().map(|test| test.has_teardown).collect::<Vec<_>>(), [true, true, false]);
    assert!(found.tests[2].failed.is_none(), "nothing can fail in it");
    for test in found.tests {
        if let Err(error) = verify(test.container) {
            panic!("{}: {error}", test.name);
        }
    }
}

#[test]
fn more_tests_than_there_may_be_are_refused_and_not_compiled() {
    let text: String = (0..=MAX_TESTS).map(|number| format!("TEST '{number}' END_TEST\n")).collect();
    let found = compile_tests(&sources(&text), &CompileOptions::default());
    assert!(found.tests.is_empty());
    assert_eq!(found.diagnostics.len(), 1);
    assert_eq!(found.diagnostics[0].code(), "P0031");
}

#[test]
fn setup_may_not_leave_and_end_the_test() {
    let text = "SETUP VAR on : BOOL; END_VAR\nWHILE on DO IF on THEN RETURN; END_IF; END_WHILE;\nEND_SETUP\n\
                TEST 'a' ASSERT_TRUE(FALSE); END_TEST\nTEST 'b' RETURN; END_TEST\n";
    let found = compile_tests(&sources(text), &CompileOptions::default());
    let told: Vec<_> =
        found.diagnostics.iter().map(|it| (it.code(), found.sources.line_column(it.span).line)).collect();
    assert_eq!(told, [("P0031", 2)]);
}

#[test]
fn no_text_around_tests_hurts() {
    let text = include_str!("samples/everything.st");
    let tests = "SETUP VAR n : INT; END_VAR END_SETUP TEST 'a' MOCK n; MOCK_FUNCTION f RETURNS 1; ASSERT_EQ(n, 1, 'x'); END_TEST \
                 TEST_PROGRAM q ADVANCE_TIME(n); END_TEST_PROGRAM ";
    for cut in 0..tests.len() {
        for text in [format!("{text}\n{}", &tests[..cut]), format!("{}{text}", &tests[cut..])] {
            compile_tests(&sources(&text), &CompileOptions::default());
        }
    }
}

#[test]
fn a_fixture_does_not_grow_with_the_number_of_tests_without_end() {
    let setup: String = (0..2000).map(|_| "n := n + 1;\n").collect();
    let tests: String = (0..MAX_TESTS).map(|number| format!("TEST '{number}' END_TEST\n")).collect();
    let text = format!("SETUP VAR n : INT; END_VAR\n{setup}END_SETUP\n{tests}");
    let found = compile_tests(&sources(&text), &CompileOptions::default());
    assert!(found.tests.is_empty());
    assert_eq!(
        found.diagnostics.iter().map(khz_frontend::diagnostics::Diagnostic::code).collect::<Vec<_>>(),
        ["P0031"]
    );
}
