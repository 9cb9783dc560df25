//! # khz-interp: the interpreter
//!
//! Translates verified stack code once, at load, into a compact register form (`register_form`, `translate`), and runs that in one
//! dispatch loop (`run`). The stack machine on the wire is small and easy to verify; as it stands, most of what it does is moving values
//! between slots and stack. In the register form operands are named where they are, comparisons and branches are one operation, and
//! so are index check, address and access of an array element.
//!
//! It is the engine that starts at once, runs on any machine, and the one that the native engine is compared with: values, traps,
//! trap places and the whole memory image are equal, because every meaning comes from `khz_machine::semantics`.
//!
//! Instances of one program type share code: what differs between them (slots, data block) is reached through base registers that
//! each call sets. Nothing is allocated while running: registers and open calls have their room from the start.
#![deny(unsafe_code)]

mod calls;
mod helpers;
mod loops;
mod memory;
mod register_form;
mod run;
mod slots;
mod translate;

use std::sync::Arc;

use khz_bytecode::container::{Container, Owner};
use khz_bytecode::ids::FunctionId;
use khz_bytecode::limits::SLOT_BYTES;
use khz_bytecode::verify::Verified;
use khz_machine::engine::{Engine, Entry, Limits};
use khz_machine::image::{Image, ImageLayout};
use khz_machine::instance_map::InstanceMap;
use khz_machine::trap::Trap;

use calls::{Activation, trap_of};
use register_form::Program;
use run::{Surroundings, run};
use slots::write_back;

/// Choices at load.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct InterpreterOptions {
    /// Whether code charges fuel. Without it, [`Limits::fuel`] is not looked at; with it, a run without fuel is not charged.
    pub fuel: bool,
}

/// One resource's code, ready to be interpreted on the image of that resource.
pub struct Interpreter {
    verified: Arc<Verified>,
    layout: ImageLayout,
    program: Program,
    instances: InstanceMap,
    registers: Vec<u64>,
    calls: Vec<Activation>,
}

impl std::fmt::Debug for Interpreter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Interpreter").field("code_bytes", &self.program.bytes()).finish_non_exhaustive()
    }
}

impl Interpreter {
    /// Translates a resource. `layout` must be that of the images it will run on.
    #[must_use]
    #[allow(clippy::needless_pass_by_value, reason = "the engine keeps the container alive")]
    pub fn new(verified: Arc<Verified>, layout: &ImageLayout, options: InterpreterOptions) -> Interpreter {
        let program = translate::translate(&verified, layout, options.fuel);
        let registers = vec![0; program.register_count];
        let calls = Vec::with_capacity(usize::from(verified.container().parameters.max_call_depth));
        let instances = InstanceMap::new(verified.container());
        Interpreter { verified, layout: layout.clone(), program, instances, registers, calls }
    }

    /// The register form as text, one operation a line: for people who look for what to improve. Its form is no promise.
    #[must_use]
    pub fn listing(&self) -> String {
        self.program.listing()
    }

    /// Image offsets of the slots and the data block that `function` works on, when it is the entry of instance `instance`.
    fn instance_bases(&self, function: FunctionId, instance: Option<usize>) -> (u32, u32) {
        let container = self.verified.container();
        let Owner::Program(program) = container.functions[function.index()].owner else { return (0, 0) };
        // Without an instance of its own (init or startup code of a program) it is the first of its type.
        let facts = self.verified.facts();
        let instance = instance.or_else(|| facts.instance_programs.iter().position(|other| *other == program));
        let Some(instance) = instance else { return (0, 0) };
        let slot = container.tasks.instances.get(instance).map_or(0, |i| u32::from(i.slot_offset));
        let block = facts.instance_blocks.get(instance).copied().flatten().unwrap_or(0);
        (self.layout.slots.start + slot * SLOT_BYTES, self.layout.data.start + block)
    }
}

/// The function that an entry means, and the program instance it runs on. None for an init or startup function that the container does
/// not have, and for an instance that it does not have.
fn entry_function(container: &Container, entry: Entry) -> Option<(FunctionId, Option<usize>)> {
    match entry {
        Entry::Init => container.parameters.init_function.map(|function| (function, None)),
        Entry::Startup => container.parameters.startup_function.map(|function| (function, None)),
        Entry::Instance(index) => container.tasks.instances.get(index).map(|i| (i.entry, Some(index))),
    }
}

impl Engine for Interpreter {
    fn name(&self) -> &'static str {
        "interp"
    }

    /// An entry that the container does not have runs nothing and succeeds.
    ///
    /// # Panics
    /// When `image` has another layout than the one given at load.
    fn run(&mut self, entry: Entry, image: &mut Image, limits: Limits<'_>) -> Result<(), Trap> {
        assert!(*image.layout() == self.layout, "the image is not one of the resource that was loaded");
        let Some((function, instance)) = entry_function(self.verified.container(), entry) else { return Ok(()) };
        let (program_base, block_base) = self.instance_bases(function, instance);
        let frame = self.layout.frames.get(limits.task_index).or(self.layout.frames.first()).cloned().unwrap_or(0..0);
        let surroundings = Surroundings {
            program: &self.program,
            instances: &self.instances,
            layout: &self.layout,
            deadline: limits.deadline,
            program_base,
            block_base,
            frame_start: frame.start,
            frame_end: frame.end,
            max_depth: usize::from(self.verified.container().parameters.max_call_depth),
        };
        self.calls.clear();
        let function = self.program.functions[function.index()];
        // The register file was made for the deepest nesting, so the first window always fits.
        let (cursor, registers) = memory::start(&self.program, function, &mut self.registers)
            .expect("the register file has room for an entry");
        run(&surroundings, image.bytes_mut(), cursor, registers, &mut self.calls, limits.fuel).map_err(|stop| {
            write_back(&stop, &surroundings, &self.calls, &self.registers, image.bytes_mut());
            trap_of(&stop, &self.program, &self.calls)
        })
    }

    fn code_bytes(&self) -> usize {
        self.program.bytes()
    }
}
