//! A difference in generated Structured Text becomes a small program with its traces.

use std::sync::Arc;

use khz_bytecode::instruction::{Instruction, NumericOp, Reader};
use khz_bytecode::verify::{Verified, verify};
use khz_machine::engine::Engine;
use khz_machine::image::ImageLayout;
use khz_proof::harness::engines;
use khz_proof::oracle::Maker;
use khz_proof::st::case::{Case, Round};
use khz_proof::st::compare::{Bench, Difference, Sort};
use khz_proof::st::generate;
use khz_proof::st::reduce::{Report, reduce};

/// Makes an interpreter that takes one operation for another.
fn confuse(
    from: NumericOp,
    to: NumericOp,
) -> impl Fn(Arc<Verified>, &ImageLayout, bool) -> Result<Box<dyn Engine>, String> {
    move |verified, layout, fuel| {
        let mut container = verified.container().clone();
        for function in &mut container.functions {
            let mut code = Vec::new();
            let mut reader = Reader::new(&function.code);
            while !reader.is_at_end() {
                let instruction = Instruction::decode(&mut reader).map_err(|error| format!("{error:?}"))?;
                let is_it = instruction == Instruction::Numeric(from);
                (if is_it { Instruction::Numeric(to) } else { instruction }).encode(&mut code);
            }
            function.code = code;
        }
        let verified = verify(container).map_err(|error| error.to_string())?;
        engines::interpreter(Arc::new(verified), layout, fuel)
    }
}

/// Engines of which the last is wrong.
fn makers<'m>(wrong: &'m khz_proof::oracle::MakeEngine<'m>) -> [Maker<'m>; 3] {
    [Maker::new("interp", &engines::interpreter), Maker::new("jit", &engines::native), Maker::new("wrong", wrong)]
}

/// The first program of some seeds that differs in a wanted way, made small, and what it was before.
fn find(bench: &Bench<'_>, is_wanted: impl Fn(&Difference, &str, &[Round]) -> bool, tries: usize) -> (Case, Report) {
    let compare = |text: &str, rounds: &[Round]| {
        let found = bench.compare(text, rounds)?;
        (!matches!(found.sort, Sort::Refused(_)) && is_wanted(&found, text, rounds)).then_some(found)
    };
    let found = (0..400).find_map(|seed| {
        let case = Case::new(generate(seed), seed, 6);
        reduce(&case, &compare, tries).map(|report| (case, report))
    });
    found.expect("a fault in a common operation shows in one of 400 programs")
}

fn bench<'b>(makers: &'b [Maker<'b>]) -> Bench<'b> {
    Bench { compile: &engines::compile, makers, fuel: 1_000_000, image_limit_bytes: 1 << 22 }
}

#[test]
fn a_value_is_traced_to_a_small_program() {
    let wrong = confuse(NumericOp::I32Xor, NumericOp::I32Or);
    let makers = makers(&wrong);
    let is_written = |found: &Difference, _: &str, _: &[Round]| {
        found.statement.as_ref().is_some_and(|statement| statement.text.contains(" XOR "))
    };
    let (case, report) = find(&bench(&makers), is_written, 600);
    let found = &report.difference;
    assert_eq!((&*found.left, &*found.right, &found.sort), ("interp", "wrong", &Sort::Value));
    assert!(report.lines.1 <= 12 && report.lines.1 * 3 < report.lines.0, "{report}");
    assert!(report.case.rounds.len() <= case.rounds.len() && report.tries <= 600, "{report}");
    let statement = found.statement.as_ref().expect("somebody wrote the variable");
    assert!(statement.text.contains(" XOR ") && report.text.contains(&statement.text), "{report}");
    let shown = report.to_string();
    assert_eq!(shown.matches("<-- first difference").count(), 1, "{shown}");
    assert!(shown.contains("1 round\n") && shown.contains("made by main.st:"), "{shown}");
}

#[test]
fn a_trap_stays_a_trap() {
    let wrong = confuse(NumericOp::I32Add, NumericOp::I32Sub);
    let makers = makers(&wrong);
    let (_, report) = find(&bench(&makers), |found, _, _| found.sort == Sort::Trap, 600);
    assert_eq!(report.difference.sort, Sort::Trap);
    assert!(report.lines.1 <= 30 && report.lines.1 * 2 < report.lines.0, "{report}");
    assert!(report.to_string().contains("trap "), "{report}");
    let place = report.difference.statement.as_ref().map(|statement| statement.place.line as usize);
    assert!(place.is_some_and(|line| line <= report.lines.1), "{report}");
}

#[test]
fn values_from_outside_that_matter_stay_and_others_go() {
    let wrong = confuse(NumericOp::I64Add, NumericOp::I64Or);
    let makers = makers(&wrong);
    let bench = bench(&makers);
    let needs_inputs = |_: &Difference, text: &str, rounds: &[Round]| {
        let bare: Vec<Round> = rounds.iter().map(|round| Round { inputs: Vec::new(), ..round.clone() }).collect();
        bench.compare(text, &bare).is_none()
    };
    let (case, report) = find(&bench, needs_inputs, 600);
    let inputs = |case: &Case| -> Vec<String> {
        case.rounds.iter().flat_map(|round| &round.inputs).map(|input| input.name.clone()).collect()
    };
    let (before, after) = (inputs(&case), inputs(&report.case));
    assert!(after.len() == 1 && before.len() > 1, "{report}");
    assert!(report.case.rounds.len() < case.rounds.len(), "{report}");
    assert!(report.to_string().contains(&format!("{} := ", after[0])), "{report}");
}

#[test]
fn a_program_without_a_difference_is_left_alone_and_tries_are_bounded() {
    let wrong = confuse(NumericOp::I32Xor, NumericOp::I32Or);
    let makers = makers(&wrong);
    assert!(reduce(&Case::new(generate(0), 0, 4), &|_, _| None, 100).is_none());
    let (_, report) = find(&bench(&makers), |_, _, _| true, 5);
    assert_eq!(report.tries, 5);
    assert!(bench(&makers).compare(&report.text, &report.case.rounds).is_some(), "a cut search still differs");
}
