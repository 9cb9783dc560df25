//! What `run`, `bench` and `diff` share: from arguments to a loaded resource.

use std::sync::Arc;

use khz_jit::JitOptions;
use khz_machine::engine::Engine;
use khz_machine::image::{Image, ImageLayout};
use khz_machine::variables::VariableTable;
use khz_scheduler::{Clock, Faulted, HoldsContainer, LoadError, LoadOptions, Resource, StopHandle, Stopped};
use kilohertz::pipeline::{EngineKind, Program};
use kilohertz::profilers::{self, Profile};

use super::Status;
use super::args::{PerfArg, ResourceArgs};
use super::inputs::{CsvInputs, read_csv, set_values};
use super::output::{Failure, people};

/// A program and what the command line gives it.
pub struct Session<'a> {
    /// The program.
    pub program: Program,
    /// Its variables by name.
    pub names: VariableTable,
    /// What it is given.
    pub args: &'a ResourceArgs,
    /// What is written for a profiler when native code is made.
    pub profile: Option<Profile>,
}

/// A resource that is ready to start, or one that trapped in its initialisation.
pub enum Opened {
    /// Ready.
    Ready(Resource<Stopped>),
    /// The init function trapped.
    Faulted(Box<Resource<Faulted>>),
}

impl<'a> Session<'a> {
    /// A session of one program.
    pub fn new(program: Program, args: &'a ResourceArgs) -> Self {
        let names = VariableTable::of(program.container());
        Session { program, names, args, profile: None }
    }

    /// Takes what `--perf` says. `native`: there will be native code.
    pub fn profile_for(&mut self, perf: Option<PerfArg>, native: bool) -> Result<(), Failure> {
        if perf.is_some() && !native {
            return Err(Failure::usage("--perf is about native code, which the interpreter has none of"));
        }
        self.profile = perf.map(|perf| match perf {
            PerfArg::Map => Profile::Map,
            PerfArg::Jitdump => Profile::Jitdump,
        });
        Ok(())
    }

    /// Whether code charges fuel on the virtual clock: some task has a watchdog, or code runs before the first round.
    pub fn needs_fuel(&self) -> bool {
        let container = self.program.container();
        let has_watchdog = self.args.watchdog_us > 0 || container.tasks.tasks.iter().any(|task| task.watchdog_us > 0);
        let starts_with_code =
            container.parameters.init_function.is_some() || container.parameters.startup_function.is_some();
        has_watchdog || starts_with_code
    }

    /// Loads the resource with an engine of its own and a clock, and applies `--set`.
    pub fn open(
        &self,
        kind: EngineKind,
        clock: Box<dyn Clock>,
        fuel: bool,
        stop: Option<StopHandle>,
        rt: Option<u8>,
    ) -> Result<Opened, Failure> {
        let layout = self.program.layout(self.args.max_image).map_err(Failure::refused)?;
        let engine = match self.profile {
            Some(profile) if kind == EngineKind::Jit => self.profiled(profile, &layout, fuel)?,
            _ => self.program.engine(kind, &layout, fuel).map_err(Failure::refused)?,
        };
        self.open_with(engine, clock, stop, rt)
    }

    /// Native code that a profiler is told about.
    fn profiled(&self, profile: Profile, layout: &ImageLayout, fuel: bool) -> Result<Box<dyn Engine>, Failure> {
        let options = JitOptions { fuel, note_lines: true, ..JitOptions::default() };
        let engine = self.program.jit(layout, options).map_err(Failure::refused)?;
        let path = profilers::write(profile, &engine.symbols());
        let path = path.map_err(|error| Failure::Message(Status::Host, format!("--perf: {error}")))?;
        people(&format!("native code is described in {}", path.display()));
        Ok(Box::new(engine))
    }

    /// Loads the resource with an engine that was made for its layout.
    pub fn open_with(
        &self,
        engine: Box<dyn Engine>,
        clock: Box<dyn Clock>,
        stop: Option<StopHandle>,
        rt: Option<u8>,
    ) -> Result<Opened, Failure> {
        let options = LoadOptions {
            max_image_bytes: self.args.max_image,
            watchdog_us: self.args.watchdog_us,
            stop,
            real_time_priority: rt,
        };
        let holder: Arc<dyn HoldsContainer> = self.program.verified.clone();
        let mut resource = match Resource::load(holder, engine, clock, &options) {
            Ok(resource) => resource,
            Err(LoadError::Faulted(faulted)) => return Ok(Opened::Faulted(faulted)),
            Err(LoadError::Image(error)) => return Err(Failure::refused(error)),
            Err(error) => return Err(Failure::Message(Status::Host, error.to_string())),
        };
        set_values(&self.names, resource.image_mut(), &self.args.set)?;
        Ok(Opened::Ready(resource))
    }

    /// The rows of `--inputs`, checked against the image.
    pub fn inputs(&self, image: &Image) -> Result<Option<CsvInputs>, Failure> {
        self.args.inputs.as_ref().map(|path| read_csv(path, &self.names, image)).transpose()
    }
}
