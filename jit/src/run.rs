//! The engine: compiling a plan, and running entries.

use std::collections::BTreeMap;
use std::sync::Arc;

use cranelift_codegen::isa::OwnedTargetIsa;
use cranelift_frontend::FunctionBuilderContext;
use khz_bytecode::ids::FunctionId;
use khz_bytecode::trap::TrapCode;
use khz_bytecode::verify::Verified;
use khz_machine::engine::{Engine, Entry, Limits};
use khz_machine::image::Image;
use khz_machine::instance_map::InstanceMap;
use khz_machine::trap::{CodePlace, Trap};

use crate::build::{ProgramMemory, Scope, build};
use crate::code::{Assembly, Code, Handle, Key, Use, host_isa};
use crate::context::{Context, OUT_OF_FUEL};
use crate::counts::BlockCounts;
use crate::lower::{Settings, lower, signature};
use crate::passes::{Improver, Passes};
use crate::plan::{EntryPoint, Plan};
use crate::runtime::{VirtualEntry, Virtuals};
use crate::symbols::{Symbol, symbols};
use crate::{JitError, JitOptions, MAX_STACK_BYTES};

/// What lowering needs to know of a target.
pub(crate) fn settings_for(isa: &OwnedTargetIsa, plan: &Plan, options: JitOptions) -> Settings {
    Settings {
        convention: isa.default_call_conv(),
        fuel: options.fuel,
        deadline: options.deadline_checks,
        depth: plan.calls_virtual,
        native_nan: matches!(isa.triple().architecture, target_lexicon::Architecture::X86_64),
        source_lines: options.note_lines,
    }
}

/// Signatures of everything in a plan, by function.
pub(crate) fn signatures(
    scope: &Scope<'_>,
    plan: &Plan,
    convention: cranelift_codegen::isa::CallConv,
) -> BTreeMap<Key, cranelift_codegen::ir::Signature> {
    plan.functions.keys().map(|key| (*key, signature(scope, key.0, key.1, convention))).collect()
}

/// A module that knows the signatures of a plan's functions.
pub(crate) fn assembly(
    scope: &Scope<'_>,
    plan: &Plan,
    isa: OwnedTargetIsa,
    options: JitOptions,
) -> Result<Assembly, JitError> {
    let convention = isa.default_call_conv();
    let known = signatures(scope, plan, convention);
    let signature =
        move |key: Key| known.get(&key).cloned().unwrap_or_else(|| cranelift_codegen::ir::Signature::new(convention));
    Assembly::new(isa, plan.instructions, options, Box::new(signature))
}

/// What compiling a plan gives.
pub(crate) struct Compiled {
    code: Code,
    /// Bytes of native stack that the deepest nesting of calls may need.
    stack_bytes: u64,
    /// Passes that changed something, where that is noted.
    fired: Option<Passes>,
}

/// One form that is compiled: a part that was cut out of a function, or the function that is left.
pub(crate) struct FormOf<'a> {
    /// The function.
    pub key: Key,
    /// Number of the part; `None`: the function itself, which comes after its parts.
    pub part: Option<u32>,
    /// What is lowered.
    pub form: &'a crate::mir::Function,
}

/// Builds and improves functions in order and shows `take` every form of each. Gives the passes that changed something, where that is noted.
///
/// # Errors
/// The first one of `take`.
pub(crate) fn for_each_form(
    scope: &Scope<'_>,
    keys: impl IntoIterator<Item = Key>,
    calls_virtual: bool,
    options: JitOptions,
    mut take: impl FnMut(&FormOf<'_>) -> Result<(), JitError>,
) -> Result<Option<Passes>, JitError> {
    let mut improver = Improver::new(scope, options, calls_virtual);
    for key in keys {
        let mut function = build(scope, key.0, key.1);
        let parts = improver.run(&mut function, key.1);
        for (number, form) in (0..).zip(&parts) {
            take(&FormOf { key, part: Some(number), form })?;
        }
        take(&FormOf { key, part: None, form: &function })?;
    }
    Ok(improver.fired())
}

/// Compiles a plan.
pub(crate) fn compile(scope: &Scope<'_>, plan: &Plan, options: JitOptions) -> Result<Compiled, JitError> {
    let isa = host_isa(options.verify_ir, Use::Run)?;
    let settings = settings_for(&isa, plan, options);
    let mut assembly = assembly(scope, plan, isa, options)?;
    let mut compilation = assembly.compilation();
    let mut builder_context = FunctionBuilderContext::new();
    let fired = for_each_form(scope, plan.functions.keys().copied(), plan.calls_virtual, options, |of| {
        assembly.start_form();
        lower(scope, of.form, of.key.1, settings, &mut assembly, &mut compilation.func, &mut builder_context);
        assembly.define(of, &mut compilation)
    })?;
    let needed_bytes = stack_bytes(scope, plan, assembly.stack_bytes());
    if needed_bytes > MAX_STACK_BYTES {
        return Err(JitError::Stack { needed_bytes, limit_bytes: MAX_STACK_BYTES });
    }
    let code = assembly.finish(scope.layout)?;
    Ok(Compiled { code, stack_bytes: needed_bytes, fired })
}

/// What the deepest nesting of calls may take of a thread's stack: the longest chain of direct calls, or, where virtual calls may recurse, the
/// largest frame as often as calls may nest.
fn stack_bytes(scope: &Scope<'_>, plan: &Plan, frames: &BTreeMap<Key, u32>) -> u64 {
    let of = |key: &Key| u64::from(frames.get(key).copied().unwrap_or(0));
    if plan.calls_virtual {
        let largest = plan.functions.keys().map(&of).max().unwrap_or(0);
        return largest * u64::from(scope.verified.container().parameters.max_call_depth);
    }
    // Direct calls form no cycle: a callee's chain is shorter, so ascending order has it ready.
    let mut order: Vec<&Key> = plan.functions.keys().collect();
    order.sort_by_key(|key| scope.verified.function(key.0).call_depth);
    let mut chains: BTreeMap<Key, u64> = BTreeMap::new();
    for key in order {
        let callees = plan.functions.get(key).into_iter().flatten();
        let deepest = callees.filter_map(|callee| chains.get(callee)).max().copied().unwrap_or(0);
        chains.insert(*key, deepest + of(key));
    }
    chains.into_values().max().unwrap_or(0)
}

/// What an engine runs with.
#[derive(Debug)]
pub(crate) struct Parts {
    init: Option<Handle>,
    startup: Option<Handle>,
    instances: Vec<Handle>,
    virtuals: Box<Virtuals>,
    stack_bytes: u64,
    fired: Option<Passes>,
    code: Arc<Code>,
}

impl Parts {
    /// Handles of a plan's entries and the tables beside the code.
    pub fn new(scope: &Scope<'_>, plan: &Plan, compiled: Compiled) -> Result<Parts, JitError> {
        let Compiled { code, stack_bytes, fired } = compiled;
        let code = Arc::new(code);
        let handle = |entry: &EntryPoint| {
            let missing = JitError::Function { function: entry.key.0, reason: "it was not compiled".into() };
            Handle::new(Arc::clone(&code), entry.key, entry.shared).ok_or(missing)
        };
        let container = scope.verified.container();
        let entries = (0..container.functions.len()).filter_map(FunctionId::from_index).map(|function| VirtualEntry {
            code: code.address((function, ProgramMemory::None)).unwrap_or(std::ptr::null()),
            frame_bytes: scope.verified.function(function).frame_bytes,
        });
        Ok(Parts {
            init: plan.init.as_ref().map(handle).transpose()?,
            startup: plan.startup.as_ref().map(handle).transpose()?,
            instances: plan.instances.iter().map(handle).collect::<Result<_, _>>()?,
            virtuals: Box::new(Virtuals { map: InstanceMap::new(container), entries: entries.collect() }),
            stack_bytes,
            fired,
            code,
        })
    }
}

/// The native-code engine of one resource.
#[derive(Debug)]
pub struct Jit {
    verified: Arc<Verified>,
    parts: Parts,
}

impl Jit {
    pub(crate) fn from_parts(verified: Arc<Verified>, parts: Parts) -> Jit {
        Jit { verified, parts }
    }

    /// What it was compiled from.
    #[must_use]
    pub fn verified(&self) -> &Arc<Verified> {
        &self.verified
    }

    /// Bytes of native stack that the deepest nesting of calls may need, at most [`MAX_STACK_BYTES`].
    #[must_use]
    pub fn stack_bytes(&self) -> u64 {
        self.parts.stack_bytes
    }

    /// Which passes changed the form of any function; `None` unless [`JitOptions::note_passes`] asked for it.
    #[must_use]
    pub fn passes_fired(&self) -> Option<Passes> {
        self.parts.fired
    }

    /// What the machine code is made of, function by function, at its addresses in this process; nothing unless [`JitOptions::note_lines`] asked
    /// for it. For profilers.
    #[must_use]
    pub fn symbols(&self) -> Vec<Symbol<'_>> {
        symbols(&self.verified, self.parts.code.notes())
    }

    /// How often each block was run so far; `None` unless [`JitOptions::count_blocks`] asked for it. Shared with the code, which goes on counting.
    #[must_use]
    pub fn block_counts(&self) -> Option<Arc<BlockCounts>> {
        self.parts.code.counts().cloned()
    }

    fn handle(&self, entry: Entry) -> Option<&Handle> {
        match entry {
            Entry::Init => self.parts.init.as_ref(),
            Entry::Startup => self.parts.startup.as_ref(),
            Entry::Instance(position) => self.parts.instances.get(position),
        }
    }

    /// The trap that a run recorded.
    fn trap(&self, context: &Context) -> Trap {
        let code = if context.trap_code == OUT_OF_FUEL { TrapCode::Watchdog as u32 } else { context.trap_code };
        let code = u8::try_from(code).ok().and_then(TrapCode::from_code).unwrap_or(TrapCode::Stopped);
        let (place, mut caller) = self.place(context.trap_place);
        let mut trap = Trap::new(code, place, context.trap_values);
        let mut calls = context.calls();
        loop {
            // Inlined calls lie between a place and the call that is recorded next.
            while let Some(inlined) = caller {
                let (place, outer) = self.place(inlined);
                trap.push_caller(place);
                caller = outer;
            }
            let Some(call) = calls.next() else { return trap };
            let (place, outer) = self.place(call);
            trap.push_caller(place);
            caller = outer;
        }
    }

    fn place(&self, number: u32) -> (CodePlace, Option<u32>) {
        let entry = self.parts.code.places.get(number as usize);
        entry.map_or((CodePlace::default(), None), |entry| (entry.place, entry.caller))
    }
}

impl Engine for Jit {
    fn name(&self) -> &'static str {
        "jit"
    }

    /// # Panics
    /// When the container has no such instance, the image is not of the layout that the code was compiled for, or there is no such task.
    fn run(&mut self, entry: Entry, image: &mut Image, limits: Limits<'_>) -> Result<(), Trap> {
        let handle = match (self.handle(entry), entry) {
            (Some(handle), _) => handle,
            // A container without such a function has nothing to do there.
            (None, Entry::Init | Entry::Startup) => return Ok(()),
            (None, Entry::Instance(_)) => panic!("the scheduler runs only instances that the container has"),
        };
        let fuel = limits.fuel.as_ref().map_or(u64::MAX, |fuel| fuel.left);
        let virtuals = &self.parts.virtuals;
        let (deadline, left) = (limits.deadline, limits.fuel);
        handle.run(image.bytes_mut(), limits.task_index, deadline, fuel, virtuals, |status, context| {
            if let Some(left) = left {
                left.left = if context.trap_code == OUT_OF_FUEL { 0 } else { context.fuel };
            }
            if status == 0 { Ok(()) } else { Err(self.trap(context)) }
        })
    }

    fn code_bytes(&self) -> usize {
        self.parts.code.bytes()
    }
}
