//! Faults of both engines and of the verifier, which generated containers find.

use std::sync::Arc;

use khz_bytecode::canary::{Fault, plant};
use khz_bytecode::verify::verify;
use khz_proof::bytecode::generate;
use khz_proof::oracle::{Difference, Plan, VERIFIER, compare, reduce};
use khz_proof::statistics::Statistics;

use super::hunt::hunt;
use khz_proof::harness::engines::makers;

fn plan(seed: u64) -> Plan {
    Plan { seed, ..Plan::default() }
}

/// Looks at one seed. Where the verifier is looked at, the evaluator alone says whether it is wrong.
fn difference(seed: u64, engine: &str, statistics: &mut Statistics) -> Option<Difference> {
    let makers = if engine == VERIFIER { Vec::new() } else { makers() };
    compare(&Arc::new(generate(seed)), &makers, &plan(seed), statistics).difference()
}

/// The fault is found in what `engine` does, and its container is made small: at most so many instructions.
fn is_found(fault: Fault, engine: &str, programs: u64, most_instructions: usize) {
    let finding = hunt(fault, programs, |seed, statistics: &mut Statistics| {
        difference(seed, engine, statistics).map(|found| format!("{}: {}", found.engine, found.description))
    });
    assert!(finding.description.starts_with(engine), "{}", finding.description);
    let seed = finding.seed;
    let (shrunk, description) = {
        let _planted = plant(fault);
        let only: Vec<_> = makers().into_iter().filter(|maker| maker.name == engine).collect();
        reduce(&Arc::new(generate(seed)), &only, &plan(seed), 4000)
    };
    assert!(shrunk.instructions <= most_instructions, "{} instructions\n{description}", shrunk.instructions);
    // The small container shows the fault and nothing else: read by the sound verifier, it runs the same everywhere.
    let sound = verify(shrunk.verified.container().clone()).expect("it verifies");
    let again = compare(&Arc::new(sound), &makers(), &plan(seed), &mut Statistics::default());
    assert!(again.difference().is_none(), "without the fault\n{description}");
}

#[test]
fn a_fault_of_the_interpreter_is_found_and_made_small() {
    is_found(Fault::Interp, "interp", 500, 20);
}

#[test]
fn a_fault_of_native_code_is_found_and_made_small() {
    is_found(Fault::Jit, "jit", 500, 20);
}

#[test]
fn a_fault_of_the_verifier_is_found_and_made_small() {
    is_found(Fault::Verifier, VERIFIER, 3000, 24);
}
