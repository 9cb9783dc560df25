//! The engines that the tests compare.
#![allow(dead_code, reason = "each test file uses its part")]

use std::sync::Arc;

use khz_bytecode::container::Container;
use khz_bytecode::verify::Verified;
use khz_frontend::diagnostics::Severity;
use khz_frontend::diagnostics::render::render_all;
use khz_frontend::{CompileOptions, SourceInput};
use khz_interp::{Interpreter, InterpreterOptions};
use khz_jit::{Jit, JitOptions, Passes};
use khz_machine::engine::Engine;
use khz_machine::image::ImageLayout;
use khz_proof::oracle::Maker;
use khz_proof::st::compare::{FILE, Refusal};

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

/// Compiles a text to its first container; the code and the words of its first error.
pub fn compile(text: &str) -> Result<Container, Refusal> {
    let input = SourceInput { name: FILE.to_string(), bytes: text.as_bytes().to_vec() };
    let compilation = khz_frontend::compile(&[input], &CompileOptions::default());
    if let Some(error) = compilation.diagnostics.iter().find(|one| one.severity == Severity::Error) {
        let shown = render_all(std::slice::from_ref(error), &compilation.sources, Default::default());
        return Err(Refusal { code: error.code().to_string(), text: shown });
    }
    let resource = compilation.resources.into_iter().next();
    let nothing = || Refusal { code: String::new(), text: "there is no resource".to_string() };
    resource.map(|resource| resource.container).ok_or_else(nothing)
}
