//! Machine code and what keeps it: the only place that maps memory, links and calls native code.
//!
//! This file may use `unsafe`: it frees code when its last holder goes, and it calls code with the interface that the lowering gave it.

use std::collections::BTreeMap;
use std::mem::MaybeUninit;
use std::ops::Range;
use std::sync::Arc;

use cranelift_codegen::ir::{self, Signature};
use cranelift_codegen::isa::{OwnedTargetIsa, TargetIsa};
use cranelift_codegen::settings::{self, Configurable};
use cranelift_codegen::{CodegenResult, CompiledCode, Context as Compilation, control::ControlPlane};
use cranelift_jit::{ArenaMemoryProvider, JITBuilder, JITModule};
use cranelift_module::{FuncId, Linkage, Module, ModuleReloc};
use khz_bytecode::ids::FunctionId;
use khz_bytecode::limits::MAX_TRAP_CHAIN;
use khz_machine::engine::DeadlineCell;
use khz_machine::image::ImageLayout;
use khz_machine::trap::CodePlace;

use crate::build::ProgramMemory;
use crate::context::Context;
use crate::counts::{self, BlockCounts};
use crate::lower::Linker;
use crate::mir::{Place, PlaceData};
use crate::run::FormOf;
use crate::runtime::Virtuals;
use crate::symbols::{Note, lines_of};
use crate::{JitError, JitOptions, runtime};

/// A function as it is compiled for a program's memory.
pub type Key = (FunctionId, ProgramMemory);

/// Address space set aside for code, for each instruction of bytecode and once, in bytes. Only what is used gets memory.
const RESERVED_PER_INSTRUCTION: usize = 512;
const RESERVED_ALWAYS: usize = 1 << 20;

/// One row of the engine's table of places.
#[derive(Debug, Clone, Copy)]
pub struct PlaceEntry {
    /// Where in the bytecode.
    pub place: CodePlace,
    /// The inlined call around it.
    pub caller: Option<u32>,
}

/// Finished code. Freed when the last `Arc` of it goes.
pub struct Code {
    module: Option<JITModule>,
    /// Places that traps name.
    pub places: Vec<PlaceEntry>,
    addresses: BTreeMap<Key, *const u8>,
    notes: Vec<(Note, *const u8)>,
    counts: Option<Arc<BlockCounts>>,
    bytes: usize,
    image_bytes: u32,
    frames: Vec<Range<u32>>,
}

// SAFETY: finished code is never written; the addresses in it name its own memory.
unsafe impl Send for Code {}
// SAFETY: as above; all access is shared reading.
unsafe impl Sync for Code {}

impl std::fmt::Debug for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Code").field("bytes", &self.bytes).field("functions", &self.addresses.len()).finish()
    }
}

impl Drop for Code {
    fn drop(&mut self) {
        if let Some(module) = self.module.take() {
            // SAFETY: every handle that can call into this code holds an `Arc` of it, so none is left and none is running.
            unsafe { module.free_memory() };
        }
    }
}

impl Code {
    /// Bytes of machine code.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// What was noted of each function and part ([`crate::JitOptions::note_lines`]), and its machine code.
    pub fn notes(&self) -> impl Iterator<Item = (&Note, &[u8])> {
        self.notes.iter().map(|(note, address)| {
            // SAFETY: the module placed so many bytes of finished code there; nobody writes them, and they are freed when `self` goes.
            (note, unsafe { std::slice::from_raw_parts(*address, note.bytes) })
        })
    }

    /// The counters that the code moves, where it does ([`crate::JitOptions::count_blocks`]).
    #[must_use]
    pub fn counts(&self) -> Option<&Arc<BlockCounts>> {
        self.counts.as_ref()
    }

    /// The address of a function, for tables that this code itself reads.
    #[must_use]
    pub fn address(&self, key: Key) -> Option<*const u8> {
        self.addresses.get(&key).copied()
    }
}

/// A function that can be run; it keeps its code alive.
#[derive(Debug, Clone)]
pub struct Handle {
    code: Arc<Code>,
    address: *const u8,
    /// Image offsets of the program's slots and data block, for code that instances share.
    shared: Option<(u32, u32)>,
}

// SAFETY: the address names code that the handle keeps alive and that never changes.
unsafe impl Send for Handle {}

impl Handle {
    /// A handle of a function without parameters and results.
    #[must_use]
    pub fn new(code: Arc<Code>, key: Key, shared: Option<(u32, u32)>) -> Option<Handle> {
        let address = code.address(key)?;
        Some(Handle { code, address, shared })
    }

    /// The code it belongs to.
    #[must_use]
    pub fn code(&self) -> &Code {
        &self.code
    }

    /// Runs it on an image; shows `look` the status (0: it came to its end) and the context as the code left it, in place: it is large to move.
    ///
    /// # Panics
    /// When the image is not of the layout that the code was compiled for, or there is no such task.
    pub fn run<R>(
        &self,
        image: &mut [u8],
        task_index: usize,
        deadline: &DeadlineCell,
        fuel: u64,
        virtuals: &Virtuals,
        look: impl FnOnce(i32, &Context) -> R,
    ) -> R {
        assert!(image.len() == self.code.image_bytes as usize, "the image is of another layout than the code");
        let frame = self.code.frames.get(task_index).expect("the scheduler names only tasks that the container has");
        let start = image.as_mut_ptr();
        let mut context = Context {
            deadline: deadline.as_atomic(),
            fuel,
            depth: 1,
            trap_code: 0,
            trap_place: 0,
            chain_len: 0,
            trap_values: [0; 3],
            frame_limit: start.wrapping_add(frame.end as usize),
            image: start,
            image_bytes: image.len() as u64,
            virtuals,
            found_code: MaybeUninit::uninit(),
            found_frame_bytes: MaybeUninit::uninit(),
            chain: [MaybeUninit::uninit(); MAX_TRAP_CHAIN + 1],
        };
        // SAFETY: the image has the size of the layout that the code was compiled for and is lent to this call alone; the deadline cell and the
        // tables outlive it; entries have neither parameters nor results (the verifier's rule).
        let status = unsafe { self.enter(&mut context, start.wrapping_add(frame.start as usize)) };
        look(status, &context)
    }

    /// Calls the code.
    ///
    /// # Safety
    /// `context` is complete: its image is that of the layout that the code was compiled for, its deadline cell and tables outlive the call, and
    /// nobody else uses the image meanwhile. `frame` is the start of a task's frame bytes in that image. The function was compiled
    /// without parameters and results.
    unsafe fn enter(&self, context: &mut Context, frame: *mut u8) -> i32 {
        let image = context.image;
        match self.shared {
            None => {
                type Plain = extern "C" fn(*mut u8, *mut Context, *mut u8) -> i32;
                // SAFETY: the lowering gave functions without program parameters exactly this interface, in the host's C convention.
                let function = unsafe { std::mem::transmute::<*const u8, Plain>(self.address) };
                function(image, context, frame)
            }
            Some((slots, block)) => {
                type Shared = extern "C" fn(*mut u8, *mut Context, *mut u8, *mut u8, *mut u8) -> i32;
                // SAFETY: as above, with the two addresses that shared code takes.
                let function = unsafe { std::mem::transmute::<*const u8, Shared>(self.address) };
                let (slots, block) = (image.wrapping_add(slots as usize), image.wrapping_add(block as usize));
                function(image, context, frame, slots, block)
            }
        }
    }
}

impl Context {
    /// Places of the calls around a trap, innermost first.
    pub fn calls(&self) -> impl Iterator<Item = u32> {
        let recorded = (self.chain_len as usize).min(MAX_TRAP_CHAIN);
        // SAFETY: native code counts a call in `chain_len` only together with writing its entry, and entries that have no room lie behind these.
        self.chain.iter().take(recorded).map(|place| unsafe { place.assume_init() })
    }
}

/// What code is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// To be run, or to be shown as Cranelift sees it.
    Run,
    /// To be listed: the same code, and it is noted where its blocks start.
    List,
}

/// The host as a target, with its CPU's features.
///
/// # Errors
/// A host that Cranelift does not know.
pub fn host_isa(verify_ir: bool, what: Use) -> Result<OwnedTargetIsa, JitError> {
    let mut flags = settings::builder();
    let options = [
        ("opt_level", "speed"),
        ("machine_code_cfg_info", if what == Use::List { "true" } else { "false" }),
        ("enable_verifier", if verify_ir { "true" } else { "false" }),
        ("is_pic", "false"),
        ("use_colocated_libcalls", "false"),
        // Functions with several results return them as values; what has no register goes through memory.
        ("enable_multi_ret_implicit_sret", "true"),
        // Guards are explicit; nothing here relies on a guard page.
        ("enable_probestack", "false"),
        ("unwind_info", "false"),
    ];
    for (name, value) in options {
        flags.set(name, value).map_err(|error| JitError::Host(error.to_string()))?;
    }
    let builder = cranelift_native::builder().map_err(|error| JitError::Host(error.to_string()))?;
    builder.finish(settings::Flags::new(flags)).map_err(|error| JitError::Host(error.to_string()))
}

/// Compiles a lowered function as Cranelift does, but for what `change` does to it between the optimiser and the making of machine code.
///
/// # Errors
/// Code that Cranelift refuses.
pub(crate) fn compile_marked(
    compilation: &mut Compilation,
    isa: &dyn TargetIsa,
    change: impl FnOnce(&mut ir::Function),
) -> CodegenResult<CompiledCode> {
    compilation.optimize(isa, &mut ControlPlane::default())?;
    change(&mut compilation.func);
    let (function, dominators) = (&compilation.func, &compilation.domtree);
    let allocator = &mut Default::default();
    let stencil = isa.compile_function(function, dominators, allocator, false, &mut ControlPlane::default())?;
    Ok(stencil.apply_params(&function.params))
}

/// What a call in code goes to.
#[derive(Debug, Clone, Copy)]
pub enum Called {
    /// A function of the program.
    Function(Key),
    /// A routine of the host.
    Routine(&'static str),
}

/// Code in the making.
pub struct Assembly {
    module: JITModule,
    functions: BTreeMap<Key, FuncId>,
    signatures: Box<dyn Fn(Key) -> Signature + Send>,
    routines: BTreeMap<&'static str, FuncId>,
    places: Vec<PlaceEntry>,
    /// For the form that is at hand: local place to table position.
    known_places: BTreeMap<Place, u32>,
    /// Parts of the function that is at hand.
    parts: BTreeMap<u32, FuncId>,
    /// Bytes of native stack of each, with what it calls of them.
    part_stack_bytes: Vec<u32>,
    bytes: usize,
    stack_bytes: BTreeMap<Key, u32>,
    failure: Option<JitError>,
    /// Whether [`Note`]s are taken.
    note_lines: bool,
    notes: Vec<(Note, FuncId)>,
    /// The counters of code that counts.
    counting: Option<BlockCounts>,
}

impl Assembly {
    /// An empty module. `instructions`: how much bytecode will be compiled; `signatures` gives the signature of any function.
    ///
    /// # Errors
    /// No memory for code.
    pub fn new(
        isa: OwnedTargetIsa,
        instructions: usize,
        options: JitOptions,
        signatures: Box<dyn Fn(Key) -> Signature + Send>,
    ) -> Result<Self, JitError> {
        let mut builder = JITBuilder::with_isa(isa, Box::new(|call| format!("{call:?}")));
        let reserved = instructions.saturating_mul(RESERVED_PER_INSTRUCTION).saturating_add(RESERVED_ALWAYS);
        let arena =
            ArenaMemoryProvider::new_with_size(reserved).map_err(|error| JitError::Memory(error.to_string()))?;
        builder.memory_provider(Box::new(arena));
        for routine in runtime::all() {
            builder.symbol(routine.name, routine.address);
        }
        // Asked before the search in the process, and never without an answer: nothing but the list above can be linked.
        builder.symbol_lookup_fn(Box::new(|_| Some(runtime::unknown())));
        Ok(Assembly {
            module: JITModule::new(builder),
            functions: BTreeMap::new(),
            signatures,
            routines: BTreeMap::new(),
            places: Vec::new(),
            known_places: BTreeMap::new(),
            parts: BTreeMap::new(),
            part_stack_bytes: Vec::new(),
            bytes: 0,
            stack_bytes: BTreeMap::new(),
            failure: None,
            note_lines: options.note_lines,
            notes: Vec::new(),
            counting: options.count_blocks.then(BlockCounts::default),
        })
    }

    /// A compilation for the module's target.
    #[must_use]
    pub fn compilation(&self) -> Compilation {
        self.module.make_context()
    }

    /// Forgets the places of the form before.
    pub fn start_form(&mut self) {
        self.known_places.clear();
    }

    /// Compiles a lowered form.
    ///
    /// # Errors
    /// Code that Cranelift refuses.
    pub fn define(&mut self, of: &FormOf<'_>, compilation: &mut Compilation) -> Result<(), JitError> {
        let declared = match of.part {
            None => self.declare(of.key),
            Some(number) => self.declare_part(number, &compilation.func.signature),
        };
        let id = declared.map_err(|error| self.failed(of.key, error))?;
        let stack_bytes = self.define_form(of, id, compilation)?;
        if of.part.is_some() {
            self.part_stack_bytes.push(stack_bytes);
        } else {
            self.stack_bytes.insert(of.key, stack_bytes);
            self.parts.clear();
            self.part_stack_bytes.clear();
        }
        Ok(())
    }

    fn define_form(&mut self, of: &FormOf<'_>, id: FuncId, compilation: &mut Compilation) -> Result<u32, JitError> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        let refused = |reason: String| JitError::Function { function: of.key.0, reason };
        let passed = compilation.func.signature.params.len() + compilation.func.signature.returns.len();
        let counting;
        let compiled = if let Some(counts) = &mut self.counting {
            counting = compile_marked(compilation, self.module.isa(), |function| counts::insert(function, counts));
            let compiled = counting.as_ref().map_err(|error| refused(format!("{error:?}")))?;
            let relocations = compiled.buffer.relocs().iter();
            let relocations: Vec<_> =
                relocations.map(|relocation| ModuleReloc::from_mach_reloc(relocation, &compilation.func, id)).collect();
            let (alignment, bytes) = (u64::from(compiled.buffer.alignment), compiled.code_buffer());
            let done = self.module.define_function_bytes(id, alignment, bytes, &relocations);
            done.map_err(|error| refused(format!("{error:?}")))?;
            Some(compiled)
        } else {
            let done = self.module.define_function_with_control_plane(id, compilation, &mut ControlPlane::default());
            done.map_err(|error| refused(format!("{error:?}")))?;
            compilation.compiled_code()
        };
        let mut stack_bytes = 0_u32;
        if let Some(compiled) = compiled {
            let bytes = compiled.code_buffer().len();
            self.bytes += bytes;
            // Above the frame lie the saved frame pointer, the return address and arguments that the caller pushed, which belong to the caller's frame.
            let frame = compiled.buffer.frame_layout().map_or(0, |layout| layout.frame_to_fp_offset);
            let called = of.form.parts().filter_map(|part| self.part_stack_bytes.get(part as usize)).max();
            stack_bytes = frame.saturating_add(16).saturating_add(called.copied().unwrap_or(0));
            // What is pushed for it counts here: at most 16 bytes each.
            stack_bytes = stack_bytes.saturating_add(u32::try_from(passed).unwrap_or(u32::MAX).saturating_mul(16));
            if self.note_lines {
                let lines = lines_of(of.form, compiled.buffer.get_srclocs_sorted());
                self.notes.push((Note { key: of.key, part: of.part, bytes, lines }, id));
            }
        }
        self.module.clear_context(compilation);
        Ok(stack_bytes)
    }

    /// What a call in code goes to: a function, one of its parts, or a routine of the host.
    #[must_use]
    pub fn named(&self) -> BTreeMap<u32, Called> {
        let functions = self.functions.iter().map(|(key, id)| (id.as_u32(), Called::Function(*key)));
        let routines = self.routines.iter().map(|(name, id)| (id.as_u32(), Called::Routine(name)));
        functions.chain(routines).collect()
    }

    /// The numbers that the parts of the function at hand have in code; forgets them.
    pub fn take_parts(&mut self) -> BTreeMap<u32, u32> {
        std::mem::take(&mut self.parts).into_iter().map(|(number, id)| (id.as_u32(), number)).collect()
    }

    fn declare_part(&mut self, number: u32, signature: &Signature) -> Result<FuncId, String> {
        if let Some(id) = self.parts.get(&number) {
            return Ok(*id);
        }
        let id = self.module.declare_anonymous_function(signature).map_err(|error| error.to_string())?;
        self.parts.insert(number, id);
        Ok(id)
    }

    fn failed(&self, key: Key, error: String) -> JitError {
        JitError::Function { function: key.0, reason: error }
    }

    fn declare(&mut self, key: Key) -> Result<FuncId, String> {
        if let Some(id) = self.functions.get(&key) {
            return Ok(*id);
        }
        let signature = (self.signatures)(key);
        let id = self.module.declare_anonymous_function(&signature).map_err(|error| error.to_string())?;
        self.functions.insert(key, id);
        Ok(id)
    }

    /// Bytes of native stack of each function.
    #[must_use]
    pub fn stack_bytes(&self) -> &BTreeMap<Key, u32> {
        &self.stack_bytes
    }

    /// Makes the code executable, and no longer writable. `layout` is that of the images it runs on.
    ///
    /// # Errors
    /// Memory that can not be protected.
    pub fn finish(mut self, layout: &ImageLayout) -> Result<Code, JitError> {
        self.module.finalize_definitions().map_err(|error| JitError::Memory(error.to_string()))?;
        let address = |id: &FuncId| self.module.get_finalized_function(*id);
        let addresses = self.functions.iter().map(|(key, id)| (*key, address(id))).collect();
        let notes = self.notes.into_iter().map(|(note, id)| (note, address(&id))).collect();
        Ok(Code {
            module: Some(self.module),
            places: self.places,
            addresses,
            notes,
            counts: self.counting.map(Arc::new),
            bytes: self.bytes,
            image_bytes: layout.total_bytes(),
            frames: layout.frames.clone(),
        })
    }
}

impl Linker for Assembly {
    fn function(&mut self, into: &mut ir::Function, id: FunctionId, program: ProgramMemory) -> ir::FuncRef {
        match self.declare((id, program)) {
            Ok(declared) => self.module.declare_func_in_func(declared, into),
            Err(error) => {
                self.failure = Some(self.failed((id, program), error));
                ir::FuncRef::from_u32(0)
            }
        }
    }

    fn part(&mut self, into: &mut ir::Function, number: u32, signature: &Signature) -> ir::FuncRef {
        match self.declare_part(number, signature) {
            Ok(declared) => self.module.declare_func_in_func(declared, into),
            Err(error) => {
                self.failure = Some(JitError::Host(error));
                ir::FuncRef::from_u32(0)
            }
        }
    }

    fn routine(&mut self, into: &mut ir::Function, name: &'static str, signature: &Signature) -> ir::FuncRef {
        let declared = match self.routines.get(name) {
            Some(id) => Ok(*id),
            None => self.module.declare_function(name, Linkage::Import, signature),
        };
        match declared {
            Ok(id) => {
                self.routines.insert(name, id);
                self.module.declare_func_in_func(id, into)
            }
            Err(error) => {
                self.failure = Some(JitError::Host(error.to_string()));
                ir::FuncRef::from_u32(0)
            }
        }
    }

    fn place(&mut self, places: &[PlaceData], place: Place) -> u32 {
        if let Some(known) = self.known_places.get(&place) {
            return *known;
        }
        let data = places[place.index()];
        // Inlining nests at most as deep as calls may.
        let caller = data.caller.map(|caller| self.place(places, caller));
        let entry = PlaceEntry { place: CodePlace { function: data.function, offset: data.offset }, caller };
        self.places.push(entry);
        let number = self.places.len() as u32 - 1;
        self.known_places.insert(place, number);
        number
    }
}
