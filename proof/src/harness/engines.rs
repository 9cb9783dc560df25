//! The engines that the tests compare.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use crate::oracle::{Forms, MakeEngine, Maker};
use crate::st::compare::{FILE, Refusal};
use crate::statistics::Statistics;
use khz_bytecode::container::Container;
use khz_bytecode::verify::Verified;
use khz_frontend::diagnostics::Severity;
use khz_frontend::diagnostics::render::render_all;
use khz_frontend::{CompileOptions, SourceInput};
use khz_interp::{Interpreter, InterpreterOptions};
use khz_jit::{Jit, JitOptions, Passes};
use khz_machine::engine::Engine;
use khz_machine::image::ImageLayout;

/// Makes an interpreter.
///
/// # Errors
/// None: it takes every verified container.
pub fn interpreter(verified: Arc<Verified>, layout: &ImageLayout, fuel: bool) -> Result<Box<dyn Engine>, String> {
    Ok(Box::new(Interpreter::new(verified, layout, InterpreterOptions { fuel })))
}

/// Makes native code with every pass.
///
/// # Errors
/// What the native engine can not compile.
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

/// Makes native code with every pass, cut into parts of some items.
pub fn native_in_parts(items: usize) -> impl Fn(Arc<Verified>, &ImageLayout, bool) -> Result<Box<dyn Engine>, String> {
    move |verified, layout, fuel| {
        let options = JitOptions { fuel, part_items: items, ..JitOptions::default() };
        let jit = Jit::new(verified, layout, options).map_err(|error| error.to_string())?;
        Ok(Box::new(jit))
    }
}

/// Every engine.
pub fn makers() -> Vec<Maker<'static>> {
    vec![Maker::new("interp", &interpreter), Maker::new("jit", &native)]
}

/// One seed in this many also runs in native code of another kind.
const VARIANT_EVERY: u64 = 8;

/// Items of the parts that native code is cut into in some of the other kinds: generated functions are too short to be cut as they are.
const SMALL_PARTS: [usize; 3] = [4, 12, 40];

/// The engines for one seed of a search: all of them, native code that notes which passes changed something, and now and then native
/// code of another kind, which one by the seed: without one of the passes, or in small parts.
pub struct Engines {
    fired: Rc<Cell<Passes>>,
    native: Box<MakeEngine<'static>>,
    variant: Option<(String, Box<MakeEngine<'static>>)>,
}

impl Engines {
    /// Those of a seed.
    pub fn of_seed(seed: u64) -> Engines {
        Engines::in_parts(seed, JitOptions::default().part_items)
    }

    /// Those of a seed, native code in parts of some items.
    pub fn in_parts(seed: u64, part_items: usize) -> Engines {
        let fired = Rc::new(Cell::new(Passes::NONE));
        let noted = Rc::clone(&fired);
        let native = move |verified: Arc<Verified>, layout: &ImageLayout, fuel| {
            let options = JitOptions { fuel, note_passes: true, part_items, ..JitOptions::default() };
            let jit = Jit::new(verified, layout, options).map_err(|error| error.to_string())?;
            let fired = jit.passes_fired().unwrap_or(Passes::NONE);
            let both = fired.rows().filter(|(_, fired)| *fired).try_fold(noted.get(), |all, (name, _)| all.with(name));
            noted.set(both.expect("passes have known names"));
            let made: Box<dyn Engine> = Box::new(jit);
            Ok(made)
        };
        let variant = variant(seed);
        Engines { fired, native: Box::new(native), variant }
    }

    /// Makes each of them.
    pub fn makers(&self) -> Vec<Maker<'_>> {
        let mut makers = vec![Maker::new("interp", &interpreter), Maker::new("jit", &*self.native)];
        let variant = self.variant.as_ref();
        makers.extend(variant.map(|(name, make)| Maker { name, make: &**make, forms: Forms::One }));
        makers
    }

    /// Counts the passes that changed something in the program that was compared.
    pub fn note(&self, statistics: &mut Statistics) {
        self.fired.get().rows().for_each(|(name, fired)| statistics.pass(name, fired));
    }
}

/// Native code of another kind, which one by the seed, for one seed in [`VARIANT_EVERY`]; its name and how it is made.
pub fn variant(seed: u64) -> Option<(String, Box<MakeEngine<'static>>)> {
    seed.is_multiple_of(VARIANT_EVERY).then(|| {
        let kind = (seed / VARIANT_EVERY) as usize % (Passes::NAMES.len() + SMALL_PARTS.len());
        match Passes::NAMES.get(kind) {
            Some(off) => {
                let make: Box<MakeEngine<'static>> = Box::new(native_with(without(off)));
                (format!("jit without {off}"), make)
            }
            None => {
                let items = SMALL_PARTS[kind - Passes::NAMES.len()];
                let make: Box<MakeEngine<'static>> = Box::new(native_in_parts(items));
                (format!("jit in parts of {items}"), make)
            }
        }
    })
}

/// Every pass but one.
pub fn without(off: &str) -> Passes {
    let others = Passes::NAMES.iter().filter(|name| **name != off);
    others.fold(Passes::NONE, |passes, name| passes.with(name).expect("passes have known names"))
}

/// Compiles a text to its first container; the code and the words of its first error.
///
/// # Errors
/// The code and the words of the first error.
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
