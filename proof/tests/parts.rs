//! Native code that was cut into parts does what it does in one piece.

use std::sync::Arc;

use khz_bytecode::ids::FunctionId;
use khz_bytecode::verify::Verified;
use khz_jit::{Jit, JitOptions, Passes, mir_text};
use khz_machine::engine::Engine;
use khz_machine::image::ImageLayout;
use khz_proof::bytecode::generate;
use khz_proof::oracle::{Maker, Plan, compare};
use khz_proof::statistics::Statistics;

/// How many parts the functions of a program are cut into, as their listings say.
fn parts_of(verified: &Verified, image_limit_bytes: u64, part_items: usize) -> usize {
    let layout = ImageLayout::new(verified.container(), image_limit_bytes).expect("a small image");
    let options = JitOptions { part_items, ..JitOptions::default() };
    let functions = (0..verified.container().functions.len()).filter_map(FunctionId::from_index);
    let listing = |function| mir_text(verified, &layout, options, function);
    functions.map(|at| listing(at).lines().filter(|line| line.starts_with("; part ")).count()).sum()
}

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
    let mut parts = [0; 2];
    for seed in 40_000..40_150 {
        let verified = Arc::new(generate(seed));
        let plan = Plan { seed, ..Plan::default() };
        parts[0] += parts_of(&verified, plan.image_limit_bytes, 4);
        parts[1] += parts_of(&verified, plan.image_limit_bytes, 20);
        let difference = compare(&verified, &makers, &plan, &mut Statistics::default()).difference();
        if let Some(difference) = difference {
            panic!("seed {seed}: {}", difference.description);
        }
    }
    assert!(parts[1] > 150 && parts[0] > 3 * parts[1], "{parts:?} parts of 4 and of 20 items: too little is cut");
}
