//! Every row of the library with every type that it takes, in every way of calling it: with its inputs in order, by their names, by its typed
//! name, under EN, and as a constant. The right values come from the evaluator of `khz-proof`, which knows neither compiler nor engines.

mod common;
#[allow(dead_code, reason = "only `check` is used here")]
#[path = "common/programs.rs"]
mod programs;

use std::fmt::Write;

use khz_machine::library::functions::{FunctionRow, ResultRule, StandardFunction as F, TABLE, TypeClass};
use khz_proof::st::functions::{standard, takes};
use khz_proof::st::tree::{Kind, Value};

/// A type of inputs: an elementary one, STRING or WSTRING.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Of {
    Kind(Kind),
    Text,
    Wide,
}

impl Of {
    fn name(self) -> &'static str {
        match self {
            Of::Kind(kind) => kind.name(),
            Of::Text => "STRING",
            Of::Wide => "WSTRING",
        }
    }

    /// What functions are called with: no NaN comes of it.
    fn samples(self) -> Vec<Value> {
        let ints = |list: &[i128]| list.iter().map(|value| Value::Int(*value)).collect();
        match self {
            Of::Text => ["pear", "apple", "fig", "apple"].map(|text| Value::Str(text.encode_utf16().collect())).into(),
            Of::Wide => ["\u{3a9}\u{20ac}ar", "apple", "\u{3a9}g", "apple"]
                .map(|text| Value::Str(text.encode_utf16().collect()))
                .into(),
            Of::Kind(Kind::Real) => [0.5f32, 0.75, 0.25, 1.0].map(Value::Real).into(),
            Of::Kind(Kind::Lreal) => [0.5f64, 0.75, 0.25, 1.0].map(Value::Lreal).into(),
            Of::Kind(Kind::Bool) => ints(&[1, 0, 1, 1]),
            Of::Kind(kind) if kind.is_moment() => [20_000, -1, 3_600_000_000_001, 86_399_000_000_000]
                .map(|value| Value::Int(khz_proof::st::moments::sayable(kind, value)))
                .into(),
            Of::Kind(kind) => {
                let (low, high) = kind.limits();
                ints(&[5, high - 2, 3, low.max(-(1 << 40)) / 3, 0x29, 0x1A])
            }
        }
    }
}

fn literal(of: Of, value: &Value) -> String {
    let float = |text: String| if text.contains('.') { text } else { text.replace('e', ".0e") };
    match value {
        Value::Str(text) => {
            let quote = if of == Of::Wide { '"' } else { '\'' };
            format!("{quote}{}{quote}", String::from_utf16_lossy(text))
        }
        Value::Int(value) if of == Of::Kind(Kind::Bool) => if *value == 0 { "FALSE" } else { "TRUE" }.into(),
        Value::Int(value) if matches!(of, Of::Kind(kind) if kind.is_duration()) => {
            let sign = if *value < 0 { "-" } else { "" };
            format!("{}#{sign}{}ns", of.name(), value.unsigned_abs())
        }
        Value::Int(value) => match of {
            Of::Kind(Kind::Char) => format!("CHAR#'${value:02X}'"),
            Of::Kind(Kind::Wchar) => format!("WCHAR#\"${value:04X}\""),
            Of::Kind(kind) if kind.is_moment() => {
                format!("{}#{}", kind.name(), khz_proof::st::moments::text(kind, *value))
            }
            _ => format!("{}#{value}", of.name()),
        },
        Value::Real(value) => format!("REAL#{}", float(format!("{value:?}"))),
        Value::Lreal(value) => format!("LREAL#{}", float(format!("{value:?}"))),
        Value::Many(_) => panic!("no literal of {value:?}"),
    }
}

/// Name of an input: the last of an extensible function goes on counting.
fn formal(row: &FunctionRow, at: usize) -> String {
    let last = row.parameters.len() - 1;
    if at <= last {
        return row.parameters[at].name.to_string();
    }
    let first: usize = row.parameters[last].name.trim_start_matches("IN").parse().expect("IN and a number");
    format!("IN{}", first + at - last)
}

/// The inputs of call number `round`, and their types.
fn inputs(row: &FunctionRow, of: Of, round: usize) -> Vec<(Of, Value)> {
    let samples = of.samples();
    let last = row.parameters.len() - 1;
    let count = row.parameters.len() + if row.extensible { round % 2 } else { 0 };
    let scales = matches!(of, Of::Kind(kind) if kind.is_duration()) && matches!(row.function, F::Mul | F::Div);
    let count = if scales { 2 } else { count };
    let input = |at: usize| match row.parameters[at.min(last)].class {
        TypeClass::Bool => (Of::Kind(Kind::Bool), Value::Int(i128::from(round.is_multiple_of(2)))),
        TypeClass::Count => (Of::Kind(Kind::Int), Value::Int([2, 0, 9, 1][round % 4])),
        // Durations are multiplied with and divided by numbers.
        _ if scales && at == 1 => (Of::Kind(Kind::Dint), Value::Int([3, -2, 1000, 7][round % 4])),
        _ => (of, samples[(round * 2 + at) % samples.len()].clone()),
    };
    (0..count).map(input).collect()
}

fn result_type(row: &FunctionRow, of: Of) -> Of {
    match row.result {
        ResultRule::Generic => of,
        ResultRule::Bool => Of::Kind(Kind::Bool),
        ResultRule::Int => Of::Kind(Kind::Int),
        ResultRule::String => of,
        ResultRule::Dint | ResultRule::WantedInteger => Of::Kind(Kind::Dint),
        ResultRule::Of(_) | ResultRule::Nothing => panic!("{} has rows of its own", row.name),
    }
}

/// The ways to write a call.
fn forms(row: &FunctionRow, of: Of, inputs: &[(Of, Value)], round: usize) -> Vec<(String, bool)> {
    let variables: Vec<String> = (0..inputs.len()).map(|at| format!("v{round}_{at}")).collect();
    let named: Vec<String> =
        variables.iter().enumerate().map(|(at, name)| format!("{} := {name}", formal(row, at))).collect();
    let (plain, named) = (variables.join(", "), named.join(", "));
    let mut forms = vec![
        (format!("{}({plain})", row.name), false),
        (format!("{}({named})", row.name), false),
        (format!("{}(EN := TRUE, {named}, ENO => done)", row.name), true),
    ];
    let scales = inputs.iter().any(|(own, _)| *own == Of::Kind(Kind::Dint)) && of != Of::Kind(Kind::Dint);
    // `TRUNC_DINT` says its result; a duration is multiplied with what is none.
    if row.result != ResultRule::WantedInteger && !scales {
        forms.push((format!("{}_{}({plain})", row.name, of.name()), false));
    }
    forms
}

/// A program of calls of one row with one type, and how many of them there are.
fn program(row: &FunctionRow, of: Of) -> (String, usize) {
    let result = result_type(row, of);
    let (mut variables, mut constants, mut body) = (String::new(), String::new(), String::new());
    let mut calls = 0;
    for round in 0..4 {
        let given = inputs(row, of, round);
        let values: Vec<Value> = given.iter().map(|(_, value)| value.clone()).collect();
        let kind = match result {
            Of::Kind(kind) => kind,
            Of::Text | Of::Wide => Kind::Int,
        };
        // What divides by zero says nothing here.
        let Ok(Some(right)) = standard(row.function, kind, &values) else { continue };
        for (at, (own, value)) in given.iter().enumerate() {
            let _ = writeln!(variables, "  v{round}_{at} : {} := {};", own.name(), literal(*own, value));
        }
        let literals: Vec<String> = given.iter().map(|(own, value)| literal(*own, value)).collect();
        let _ = writeln!(constants, "  k{round} : {} := {}({});", result.name(), row.name, literals.join(", "));
        let right = literal(result, &right);
        for (call, says_so) in forms(row, of, &given, round) {
            let done = if says_so { "done AND " } else { "" };
            let _ = writeln!(body, "  done := FALSE; r := {call};\n  IF {done}(r = {right}) THEN n := n + 1; END_IF;");
            calls += 1;
        }
        let _ = writeln!(body, "  IF k{round} = {right} THEN n := n + 1; END_IF;");
        calls += 1;
    }
    let text = format!(
        "// expect: main.n = {calls}\nPROGRAM main\nVAR CONSTANT\n{constants}END_VAR\nVAR\n  n : INT; done : BOOL; r : {};\n{variables}END_VAR\n{body}END_PROGRAM\n",
        result.name()
    );
    (text, calls)
}

fn group(row: &FunctionRow) -> Vec<Of> {
    let generic: Vec<TypeClass> =
        row.parameters.iter().map(|parameter| parameter.class).filter(|class| class.is_generic()).collect();
    let mut group: Vec<Of> = Vec::new();
    if let Some(class) = generic.first() {
        // The remainder of a duration is not defined, and EXPT is over what its base is.
        // Turned bytes are no whole day and no time within one, which a literal could say.
        let unsaid =
            |kind: Kind| *class == TypeClass::Bytes && kind.is_moment() && !matches!(kind, Kind::Dt | Kind::Ldt);
        let taken = Kind::ALL.into_iter().filter(|kind| takes(*class, *kind) && !unsaid(*kind));
        group.extend(taken.map(Of::Kind));
    }
    if generic.is_empty() || generic.contains(&TypeClass::AnyElementary) {
        group.extend([Of::Text, Of::Wide]);
    }
    group
}

#[test]
fn every_row_with_every_type_that_it_takes() {
    let (mut wrong, mut calls) = (Vec::new(), 0);
    // Bounds are of arrays, not of values. Dates and times of day have conformance programs of their own.
    let of_values =
        |row: &&FunctionRow| !matches!(row.parameters[0].class, TypeClass::Array | TypeClass::Of(_) | TypeClass::Part);
    for row in TABLE.iter().filter(of_values) {
        for of in group(row) {
            let (text, count) = program(row, of);
            assert!(count > 0, "{} of {} is never called", row.name, of.name());
            let found = programs::check(&format!("{}_{}", row.name, of.name()), &text);
            wrong.extend(found.into_iter().map(|what| format!("{what}\n{text}")));
            calls += count;
        }
    }
    let heads: Vec<&str> = wrong.iter().filter_map(|what| what.lines().next()).collect();
    assert!(wrong.is_empty(), "{}\nthe first one:\n{}", heads.join("\n"), wrong[0]);
    assert!(calls > 8000, "{calls} calls");
}
