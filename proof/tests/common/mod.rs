//! The engines that the tests compare.
#![allow(dead_code, reason = "each test file uses its part")]

use std::sync::Arc;

use khz_bytecode::verify::Verified;
use khz_interp::{Interpreter, InterpreterOptions};
use khz_jit::{Jit, JitOptions, Passes};
use khz_machine::engine::Engine;
use khz_machine::image::ImageLayout;
use khz_proof::oracle::Maker;

/// Makes an interpreter.
pub fn interpreter(verified: Arc<Verified>, layout: &ImageLayout, fuel: bool) -> Result<Box<dyn Engine>, String> {
    Ok(Box::new(Interpreter::new(verified, layout, InterpreterOptions { fuel })))
}

/// Makes native code with every pass.
pub fn native(verified: Arc<Verified>, layout: &ImageLayout, fuel: bool) -> Result<Box<dyn Engine>, String> {
    let options = JitOptions { fuel, ..JitOptions::default() };
    let jit = Jit::new(verified, layout, options).map_err(|error| error.to_string())?;
    Ok(Box::new(jit))
}

/// Makes native code with only some passes.
pub fn native_with(passes: Passes) -> impl Fn(Arc<Verified>, &ImageLayout, bool) -> Result<Box<dyn Engine>, String> {
    move |verified, layout, fuel| {
        let options = JitOptions { fuel, passes, ..JitOptions::default() };
        let jit = Jit::new(verified, layout, options).map_err(|error| error.to_string())?;
        Ok(Box::new(jit))
    }
}

/// Every engine.
pub fn makers() -> Vec<Maker<'static>> {
    vec![Maker { name: "interp", make: &interpreter }, Maker { name: "jit", make: &native }]
}
