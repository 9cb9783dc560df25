//! The stages in order, each a function from the previous stage's type to the next one's:
//! [`files::Input`](crate::files::Input) → [`compile`] or [`read`](khz_bytecode::container::read) → verify → [`Program`] → [`Program::engine`].

use std::sync::Arc;

use khz_bytecode::container::{self, Container, ReadError};
use khz_bytecode::verify::{Verified, VerifyError, verify};
use khz_frontend::diagnostics::Diagnostic;
use khz_frontend::source::SourceMap;
use khz_frontend::{CompileOptions, Dialect, SourceInput};
use khz_interp::{Interpreter, InterpreterOptions};
use khz_jit::{Jit, JitError, JitOptions};
use khz_machine::engine::Engine;
use khz_machine::image::{Image, ImageLayout, ImageTooLarge};

use crate::files::Input;

/// One RESOURCE, verified and ready for an engine.
#[derive(Debug, Clone)]
pub struct Program {
    /// Name of the RESOURCE; of a stripped container the file's.
    pub name: String,
    /// The verified container.
    pub verified: Arc<Verified>,
    /// Bytes of the container file.
    pub container_bytes: usize,
    /// VAR_INPUT of its program instances, as `instance.variable`; none when it was read from a container, which does not tell them apart.
    pub inputs: Vec<String>,
}

/// What came of sources or a container that were not refused.
#[derive(Debug)]
pub struct Loaded {
    /// One for each RESOURCE, in source order.
    pub programs: Vec<Program>,
    /// Warnings and notes.
    pub diagnostics: Vec<Diagnostic>,
    /// The sources that the diagnostics point into.
    pub sources: SourceMap,
}

/// Why there is no program.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// The sources have errors.
    #[error("the program has errors")]
    Diagnostics {
        /// All of them, and the warnings.
        diagnostics: Vec<Diagnostic>,
        /// What they point into.
        sources: SourceMap,
    },
    /// The container can not be read.
    #[error("{file}: {error}")]
    Read {
        /// The container's file.
        file: String,
        /// What is wrong with it.
        error: ReadError,
    },
    /// The container does not verify.
    #[error("{file}: {error}")]
    Verify {
        /// The container's file, or the RESOURCE.
        file: String,
        /// The rule it breaks.
        error: Box<VerifyError>,
    },
    /// A program that is right but too large for a container.
    #[error("{resource}: {reason}")]
    TooLarge {
        /// The RESOURCE.
        resource: String,
        /// Which limit.
        reason: String,
    },
}

/// Which engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EngineKind {
    /// Native code.
    Jit,
    /// The interpreter.
    Interp,
}

impl EngineKind {
    /// Both, the definition first.
    pub const BOTH: [EngineKind; 2] = [EngineKind::Interp, EngineKind::Jit];

    /// Its name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            EngineKind::Jit => "jit",
            EngineKind::Interp => "interp",
        }
    }
}

/// From files to verified programs. `dialect`: goes before what the files' project says.
///
/// # Errors
/// The diagnostics of sources, or what is wrong with a container.
pub fn load(input: Input, dialect: Option<Dialect>) -> Result<Loaded, Refused> {
    match input {
        Input::Sources(sources) => compile(&sources.files, &sources.settings.options(dialect)),
        Input::Container(file, bytes) => read(file, &bytes),
    }
}

/// From sources to verified programs.
///
/// # Errors
/// Their diagnostics. A compiled container that does not verify is a fault of the compiler and says so.
pub fn compile(sources: &[SourceInput], options: &CompileOptions) -> Result<Loaded, Refused> {
    let compilation = khz_frontend::compile(sources, options);
    if khz_frontend::diagnostics::has_errors(&compilation.diagnostics) {
        return Err(Refused::Diagnostics { diagnostics: compilation.diagnostics, sources: compilation.sources });
    }
    let programs = compilation.resources.into_iter().map(|resource| {
        let inputs = resource.inputs;
        program(resource.name, resource.container).map(|program| Program { inputs, ..program })
    });
    let programs = programs.collect::<Result<_, _>>()?;
    Ok(Loaded { programs, diagnostics: compilation.diagnostics, sources: compilation.sources })
}

pub(crate) fn program(name: String, container: Container) -> Result<Program, Refused> {
    let bytes = container::write(&container);
    let bytes = bytes.map_err(|error| Refused::TooLarge { resource: name.clone(), reason: error.to_string() })?;
    let verified = verify(container);
    let verified = verified.map_err(|error| Refused::Verify {
        file: format!("RESOURCE {name}, as compiled (a fault of khz: please report it)"),
        error: Box::new(error),
    })?;
    Ok(Program { name, verified: Arc::new(verified), container_bytes: bytes.len(), inputs: Vec::new() })
}

fn read(file: String, bytes: &[u8]) -> Result<Loaded, Refused> {
    let container = container::read(bytes).map_err(|error| Refused::Read { file: file.clone(), error })?;
    let verified = verify(container).map_err(|error| Refused::Verify { file: file.clone(), error: Box::new(error) })?;
    let name = verified.container().debug.as_ref().map_or(file, |debug| debug.resource_name.clone());
    let program = Program { name, verified: Arc::new(verified), container_bytes: bytes.len(), inputs: Vec::new() };
    Ok(Loaded { programs: vec![program], diagnostics: Vec::new(), sources: SourceMap::new() })
}

impl Program {
    /// The container.
    #[must_use]
    pub fn container(&self) -> &Container {
        self.verified.container()
    }

    /// Names of its tasks, in declaration order; `task 3` (its identifier) where one has none.
    #[must_use]
    pub fn task_names(&self) -> Vec<String> {
        self.container().task_names()
    }

    /// Where the regions of its memory image lie.
    ///
    /// # Errors
    /// When the image would be larger than `max_image_bytes`.
    pub fn layout(&self, max_image_bytes: u64) -> Result<ImageLayout, ImageTooLarge> {
        ImageLayout::new(self.container(), max_image_bytes)
    }

    /// A fresh memory image with the initial values.
    ///
    /// # Errors
    /// When it would be larger than `max_image_bytes`.
    pub fn image(&self, max_image_bytes: u64) -> Result<Image, ImageTooLarge> {
        Ok(Image::new(self.layout(max_image_bytes)?, self.container()))
    }

    /// An engine with the program's code, made to run on images of `layout`. `fuel`: its code charges fuel.
    ///
    /// # Errors
    /// When native code can not be made.
    pub fn engine(&self, kind: EngineKind, layout: &ImageLayout, fuel: bool) -> Result<Box<dyn Engine>, JitError> {
        let verified = Arc::clone(&self.verified);
        Ok(match kind {
            EngineKind::Interp => Box::new(Interpreter::new(verified, layout, InterpreterOptions { fuel })),
            EngineKind::Jit => Box::new(self.jit(layout, JitOptions { fuel, ..JitOptions::default() })?),
        })
    }

    /// The native-code engine, with all that can be chosen about it.
    ///
    /// # Errors
    /// When native code can not be made.
    pub fn jit(&self, layout: &ImageLayout, options: JitOptions) -> Result<Jit, JitError> {
        Jit::new(Arc::clone(&self.verified), layout, options)
    }
}
