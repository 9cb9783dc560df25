//! What the parser makes of correct texts.

#[allow(dead_code, reason = "each test file uses its own part of what they share")]
mod support;

use khz_frontend::diagnostics::{Diagnostic, all_rules, has_errors};
use khz_frontend::syntax::ast::*;
use support::{Printer, SAMPLES, expression, messages, parse, statements};

#[test]
fn samples_have_nothing_to_say_about() {
    for (name, text) in SAMPLES {
        assert_eq!(messages(text), Vec::<String>::new(), "{name}");
    }
}

#[test]
fn operators_rank_as_table_71() {
    assert_eq!(
        expression("a OR b XOR c AND d = e < f + g * h ** i"),
        "(a OR (b XOR (c AND (d = (e < (f + (g * (h ** i))))))))"
    );
    assert_eq!(expression("-2 ** 2"), "((- 2) ** 2)", "unary minus binds tighter");
    assert_eq!(expression("a - b - c"), "((a - b) - c)");
    assert_eq!(expression("a ** b ** c"), "((a ** b) ** c)");
    assert_eq!(expression("a / b * c MOD d"), "(((a / b) * c) MOD d)");
    assert_eq!(expression("NOT a AND b"), "((NOT a) AND b)");
    assert_eq!(expression("NOT a = b"), "((NOT a) = b)");
    assert_eq!(expression("a & b AND_THEN c OR d OR_ELSE e"), "((((a AND b) AND_THEN c) OR d) OR_ELSE e)");
    assert_eq!(expression("a < b = c > d"), "((a < b) = (c > d))");
    assert_eq!(expression("(a + b) * - - c"), "((a + b) * (- (- c)))");
    assert_eq!(expression("a - -1"), "(a - (- 1))");
}

#[test]
fn variables_calls_and_literals() {
    assert_eq!(expression("a.b[1, i + 1].c^.d"), "a.b[1, (i + 1)].c^.d");
    assert_eq!(expression("w.3 + w.%X4 + w.%B1"), "((w.Bit3 + w.Bit4) + w.Byte1)");
    assert_eq!(expression("%IX1.2"), "%InputSome(Bit)[1, 2]");
    assert_eq!(expression("%m4"), "%MemoryNone[4]");
    assert_eq!(expression("f()"), "f()");
    assert_eq!(
        expression("f(1, b := 2, c => d, NOT e => g, h := , i => )"),
        "f(1, b := 2, c => d, NOT e => g, h := -, i => -)"
    );
    assert_eq!(expression("f(NOT a, a = b)"), "f((NOT a), (a = b))");
    assert_eq!(expression("Color#Red"), "Color#Red");
    assert_eq!(expression("INT#-16#7F"), "INT#Int { negative: true, magnitude: 127, based: true }");
    assert_eq!(expression("bool#1"), "bool#Bool(true)");
    assert_eq!(expression("T#1.5s"), "1500000000ns");
    assert_eq!(expression("'a$N'"), "String([97, 10])");
}

#[test]
fn statements_of_all_kinds() {
    assert_eq!(
        statements("IF a THEN b := 1; ELSIF c THEN ; ELSE d(); END_IF;"),
        ["IF a {b := 1} c {EMPTY} ELSE {d()}"]
    );
    assert_eq!(
        statements("IF a THEN IF b THEN EXIT; END_IF ELSE RETURN; END_IF"),
        ["IF a {IF b {EXIT}} ELSE {RETURN}"]
    );
    assert_eq!(
        statements(
            "CASE x OF 1, 3..5: a := 1; b := 2; -2: c(); Red: ; Color.Blue, Color#Green: d.e := 1; N + 1: ELSE f := 1; END_CASE;"
        ),
        [
            "CASE x [1, 3..5] {a := 1; b := 2} [(- 2)] {c()} [Red] {EMPTY} [Color.Blue, Color#Green] {d.e := 1} [(N + 1)] {} ELSE {f := 1}"
        ]
    );
    assert_eq!(
        statements("CASE x OF 1: CASE y OF 2: a(); END_CASE; 3: b(); END_CASE"),
        ["CASE x [1] {CASE y [2] {a()}} [3] {b()}"]
    );
    assert_eq!(statements("FOR i := 1 TO n - 1 BY -2 DO CONTINUE; END_FOR"), ["FOR i 1 (n - 1) (- 2) {CONTINUE}"]);
    assert_eq!(statements("while a do END_while; repeat b(); until c; end_repeat;"), ["WHILE a {}", "REPEAT {b()} c"]);
}

#[test]
fn words_of_one_place_are_names_elsewhere() {
    let text = "PROGRAM step
VAR retain, task : INT; single : BOOL; at : INT; on, with, interval, priority : DINT; r_edge : BOOL; LD, ST, action, transition : INT; END_VAR
  retain := 1; task := at; LD(ST); single := r_edge; action := 2; on := with + interval;
END_PROGRAM";
    assert_eq!(messages(text), Vec::<String>::new());
}

#[test]
fn spans_cover_what_was_written() {
    let text = "PROGRAM p\nVAR a, b : INT := 5; END_VAR\n  x := (a + b) * c;\n  IF a THEN b(); END_IF;\nEND_PROGRAM";
    let (ast, found, sources) = parse(text);
    assert!(found.is_empty());
    let Some(Declaration::Pou(pou)) = ast.declarations().next() else { panic!("a program") };
    assert_eq!(sources.snippet(pou.span), text);
    assert_eq!(sources.snippet(pou.sections[0].decls[0].span), "a, b : INT := 5");
    assert_eq!(sources.snippet(pou.body.statements[0].span), "x := (a + b) * c");
    assert_eq!(sources.snippet(pou.body.statements[1].span), "IF a THEN b(); END_IF");
    let StmtKind::Assign { value, op_span, .. } = &pou.body.statements[0].kind else { panic!("an assignment") };
    assert_eq!(sources.snippet(*op_span), ":=");
    let ExprKind::Binary { lhs, op_span, .. } = &value.kind else { panic!("a product") };
    assert_eq!((sources.snippet(lhs.span), sources.snippet(*op_span)), ("(a + b)", "*"));
}

#[test]
fn types_of_all_forms() {
    let (ast, found, _) = parse(
        "TYPE A : INT; B : INT (0..N); C : (x, y := 2); D : INT (x, y); E : (x) UINT; F : INT (x := 1);
         G : ARRAY[1..2, *] OF STRING[5]; H : STRUCT a, b : INT := 1; END_STRUCT I : UNION c : INT; END_UNION; J : REF_TO INT; K : POINTER TO ARRAY[0..1] OF BOOL; END_TYPE",
    );
    assert!(found.is_empty(), "{found:?}");
    let kinds: Vec<String> = ast
        .declarations()
        .map(|one| {
            let Declaration::Type(ty) = one else { panic!("a type") };
            match &ty.spec.kind {
                TypeSpecKind::Named(_) => "named".to_owned(),
                TypeSpecKind::String { .. } => "string".to_owned(),
                TypeSpecKind::Subrange { .. } => "subrange".to_owned(),
                TypeSpecKind::Enum { base, values } => format!("enum {} {}", base.is_some(), values.len()),
                TypeSpecKind::Array { dims, element } => format!(
                    "array {} {:?}",
                    dims.len(),
                    matches!(element.kind, TypeSpecKind::String { length: Some(_), .. })
                ),
                TypeSpecKind::Struct { union, fields } => format!("struct {union} {}", fields.len()),
                TypeSpecKind::Reference { kind, .. } => format!("{kind:?}"),
                TypeSpecKind::Error => "error".to_owned(),
            }
        })
        .collect();
    let expected = [
        "named",
        "subrange",
        "enum false 2",
        "enum true 2",
        "enum true 1",
        "enum true 1",
        "array 2 true",
        "struct false 1",
        "struct true 1",
        "RefTo",
        "PointerTo",
    ];
    assert_eq!(kinds, expected);
}

#[test]
fn sections_have_their_qualifiers() {
    let (ast, found, _) = parse(
        "PROGRAM p VAR_INPUT RETAIN a : BOOL R_EDGE; END_VAR VAR CONSTANT PERSISTENT b AT %MW1 : INT := 1; END_VAR END_PROGRAM",
    );
    assert!(found.is_empty(), "{found:?}");
    let Some(Declaration::Pou(pou)) = ast.declarations().next() else { panic!("a program") };
    let [input, local] = &pou.sections[..] else { panic!("two sections") };
    assert_eq!((input.kind, input.retention.map(|(one, _)| one)), (VarKind::Input, Some(Retention::Retain)));
    assert_eq!(input.decls[0].edge.map(|(edge, _)| edge), Some(Edge::Rising));
    assert!(local.constant.is_some() && local.retention.map(|(one, _)| one) == Some(Retention::Persistent));
    assert_eq!(local.decls[0].address.as_ref().map(|address| address.path.clone()), Some(vec![1]));
}

#[test]
fn initial_values_of_all_forms() {
    let (ast, found, _) = parse(
        "VAR_GLOBAL a : T := [1, 2(), 3(4, 5), 2([6]), N(0)]; b : P := (x := 1, y := (z := 2)); c : INT := (1 + 2); END_VAR",
    );
    assert!(found.is_empty(), "{found:?}");
    let Some(Declaration::Globals(section)) = ast.declarations().next() else { panic!("globals") };
    let init = |at: usize| section.decls[at].init.as_ref().map(|init| &init.kind);
    let Some(InitKind::Array(elements)) = init(0) else { panic!("an array") };
    let shape: Vec<_> = elements.iter().map(|one| (one.repeat.is_some(), one.values.len())).collect();
    assert_eq!(shape, [(false, 1), (true, 0), (true, 2), (true, 1), (false, 1)]);
    let Some(InitKind::Struct(fields)) = init(1) else { panic!("a structure") };
    assert!(matches!(fields[1].value.kind, InitKind::Struct(_)));
    assert!(matches!(init(2), Some(InitKind::Expr(_))));
}

#[test]
fn a_configuration_with_everything() {
    let (ast, found, sources) = parse(SAMPLES[0].1);
    assert!(found.is_empty());
    let names = Printer { names: &ast.names };
    let Some(Declaration::Configuration(plant)) = ast.declarations().last() else { panic!("a configuration") };
    assert_eq!(
        (plant.globals.len(), plant.resources.len(), plant.access_vars.len(), plant.config_vars.len()),
        (1, 1, 1, 1)
    );
    assert!(plant.access_vars[0].writable);
    assert_eq!(plant.config_vars[0].path.span.end - plant.config_vars[0].path.span.start, 9);
    let cpu = &plant.resources[0];
    assert_eq!(cpu.tasks[0].attributes[0].value.as_deref(), Some("T#10ms"));
    let params: Vec<_> =
        cpu.tasks.iter().map(|task| task.params.iter().map(|one| one.kind).collect::<Vec<_>>()).collect();
    assert_eq!(params[0], [TaskParamKind::Interval, TaskParamKind::Priority]);
    assert_eq!(params[1], [TaskParamKind::Single, TaskParamKind::Priority]);
    let app = &cpu.programs[0];
    assert_eq!(
        (names.name(&app.name), app.task.as_ref().map(|task| names.name(task))),
        ("app".into(), Some("fast".into()))
    );
    assert!(matches!(
        app.connections[..],
        [Connection::Source { .. }, Connection::Sink { .. }, Connection::FbTask { .. }]
    ));
    assert_eq!(sources.snippet(app.span), "PROGRAM app WITH fast : main(i := %IW0, k => g, e WITH ev)");
    assert_eq!((cpu.programs[1].retention.map(|(one, _)| one), cpu.programs[1].task), (Some(Retention::Retain), None));
}

#[test]
fn a_configuration_without_resource_has_one_without_name() {
    let (ast, found, _) = parse("CONFIGURATION c TASK t(INTERVAL := T#1ms); PROGRAM i WITH t : p; END_CONFIGURATION");
    assert!(found.is_empty(), "{found:?}");
    let Some(Declaration::Configuration(one)) = ast.declarations().next() else { panic!("a configuration") };
    assert_eq!(one.resources.len(), 1);
    assert!(
        one.resources[0].name.is_none() && one.resources[0].tasks.len() == 1 && one.resources[0].programs.len() == 1
    );
}

#[test]
fn attributes_stick_to_what_follows() {
    let (ast, found, _) = parse(
        "{attribute 'a'} {other} {attribute 'b' := 'c'} FUNCTION f VAR {attribute 'd'} x : INT; y : INT; END_VAR END_FUNCTION {last}",
    );
    assert!(found.is_empty(), "{found:?}");
    let Some(Declaration::Pou(pou)) = ast.declarations().next() else { panic!("a function") };
    let names: Vec<_> = pou.attributes.iter().map(|one| (one.name.as_str(), one.value.as_deref())).collect();
    assert_eq!(names, [("a", None), ("b", Some("c"))]);
    let decls = &pou.sections[0].decls;
    assert_eq!((decls[0].attributes.len(), decls[1].attributes.len()), (1, 0));
    let loose: Vec<_> = ast.files[0].pragmas.iter().map(|one| one.text.as_str()).collect();
    assert_eq!(loose, ["other", "last"]);
}

#[test]
fn names_are_equal_without_case() {
    let (ast, _, _) = parse("FUNCTION Abc END_FUNCTION FUNCTION aBC END_FUNCTION");
    let names: Vec<Ident> = ast
        .declarations()
        .filter_map(|one| match one {
            Declaration::Pou(pou) => Some(pou.name),
            _ => None,
        })
        .collect();
    assert_eq!(names[0].symbol, names[1].symbol);
    assert_eq!((ast.names.text(names[0].spelling), ast.names.text(names[1].spelling)), ("Abc", "aBC"));
}

#[test]
fn ids_of_expressions_are_dense_over_files() {
    let mut sources = khz_frontend::source::SourceMap::new();
    sources.add_text("a.st", "VAR_GLOBAL a : INT := 1 + 2; END_VAR");
    sources.add_text("b.st", "VAR_GLOBAL b : INT := 3; END_VAR");
    let (ast, found) = khz_frontend::parse(&sources);
    assert!(found.is_empty());
    let ids: Vec<u32> = ast
        .declarations()
        .filter_map(|one| match one {
            Declaration::Globals(section) => match &section.decls[0].init.as_ref()?.kind {
                InitKind::Expr(expr) => Some(expr.id.0),
                _ => None,
            },
            _ => None,
        })
        .collect();
    assert_eq!((ids, ast.expr_count), (vec![2, 3], 4));
}

#[test]
fn the_examples_of_the_syntax_table_say_what_they_show() {
    for rule in all_rules().filter(|rule| rule.code.starts_with('P') && !rule.wrong.is_empty()) {
        let (_, found, _) = parse(rule.wrong);
        let codes: Vec<_> = found.iter().map(Diagnostic::code).collect();
        assert_eq!(codes, [rule.code], "the wrong example of {}: {found:?}", rule.code);
        let (_, found, _) = parse(rule.right);
        assert!(!has_errors(&found) && found.is_empty(), "the right example of {}: {found:?}", rule.code);
    }
}
