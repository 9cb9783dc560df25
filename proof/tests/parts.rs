//! Native code that was cut into parts does what it does in one piece.

use std::sync::Arc;

use khz_jit::{Jit, JitOptions, Passes};
use khz_machine::engine::Engine;
use khz_proof::bytecode::generate;
use khz_proof::oracle::{Maker, Plan, compare};
use khz_proof::statistics::Statistics;

#[test]
fn random_programs_in_small_parts_do_the_same() {
    let cut = |part_items, passes| {
        move |verified, layout: &_, fuel| {
            let options = JitOptions { fuel, passes, part_items, ..JitOptions::default() };
            let jit = Jit::new(verified, layout, options).map_err(|error| error.to_string())?;
            Ok(Box::new(jit) as Box<dyn Engine>)
        }
    };
    let (four, plain, twenty) = (cut(4, Passes::ALL), cut(7, Passes::NONE), cut(20, Passes::ALL));
    let makers = [
        Maker::new("jit in parts of 4", &four),
        Maker::new("jit in parts of 7 without passes", &plain),
        Maker::new("jit in parts of 20", &twenty),
    ];
    for seed in 40_000..40_150 {
        let verified = Arc::new(generate(seed));
        let plan = Plan { seed, ..Plan::default() };
        let difference = compare(&verified, &makers, &plan, &mut Statistics::default()).difference();
        if let Some(difference) = difference {
            panic!("seed {seed}: {}", difference.description);
        }
    }
}
