//! A difference in generated Structured Text becomes a small program with its traces.

mod common;

use std::sync::Arc;

use khz_bytecode::instruction::{Instruction, NumericOp, Reader};
use khz_bytecode::verify::{Verified, verify};
use khz_machine::engine::Engine;
use khz_machine::image::ImageLayout;
use khz_proof::oracle::Maker;
use khz_proof::st::case::Case;
use khz_proof::st::compare::{Bench, Sort};
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
        common::interpreter(Arc::new(verified), layout, fuel)
    }
}

/// The first program of some seeds that differs, made small, with what it was before.
fn find(makers: &[Maker<'_>], tries: usize) -> (Case, Report) {
    let bench = Bench { compile: &common::compile, makers, fuel: 1_000_000, image_limit_bytes: 1 << 22 };
    let compare =
        |text: &str, rounds: &[_]| bench.compare(text, rounds).filter(|found| !matches!(found.sort, Sort::Refused(_)));
    let found = (0..200).find_map(|seed| {
        let case = Case::new(generate(seed), seed, 6);
        reduce(&case, &compare, tries).map(|report| (case, report))
    });
    found.expect("a fault in a common operation differs in one of 200 programs")
}

#[test]
fn a_value_is_traced_to_a_small_program() {
    let wrong = confuse(NumericOp::I32Xor, NumericOp::I32Or);
    let makers = [
        Maker { name: "interp", make: &common::interpreter },
        Maker { name: "jit", make: &common::native },
        Maker { name: "wrong", make: &wrong },
    ];
    let (case, report) = find(&makers, 600);
    assert_eq!((&*report.difference.left, &*report.difference.right), ("interp", "wrong"));
    assert_eq!(report.difference.sort, Sort::Value);
    assert!(report.lines.1 <= 12 && report.lines.1 * 3 < report.lines.0, "{report}");
    assert!(report.text.contains(" XOR "), "{report}");
    assert!(report.case.rounds.len() <= case.rounds.len() && report.tries <= 600, "{report}");
    let shown = report.to_string();
    assert_eq!(shown.matches("<-- first difference").count(), 1, "{shown}");
    assert!(shown.contains("1 round\n"), "{shown}");
}
