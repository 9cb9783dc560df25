//! The shrinker ends, gives the same every time, and leaves little.

use khz_bytecode::assembler::assemble;
use khz_bytecode::instruction::{Instruction, NumericOp};
use khz_bytecode::verify::Verified;
use khz_proof::bytecode::generate;
use khz_proof::shrink::Shrinker;

fn multiplies(verified: &Verified) -> bool {
    let functions = verified.facts().functions.iter();
    let mut placed = functions.flat_map(|function| &function.instructions);
    placed.any(|placed| placed.instruction == Instruction::Numeric(NumericOp::I64Mul))
}

#[test]
fn what_matters_stays_and_the_rest_goes() {
    let mut seeds = (0..).filter(|seed| multiplies(&generate(*seed)));
    for seed in [seeds.next().unwrap(), seeds.next().unwrap(), seeds.next().unwrap()] {
        let verified = generate(seed);
        let shrunk = || Shrinker { differs: &multiplies, tries: 3000 }.shrink(&verified);
        let (first, second) = (shrunk(), shrunk());
        assert_eq!(first.text, second.text, "seed {seed}");
        assert!(first.instructions <= 10, "seed {seed}: {}", first.text);
        assert!(multiplies(&first.verified));
        assert_eq!(assemble(&first.text).as_ref(), Ok(first.verified.container()), "the text says the same");
    }
}
