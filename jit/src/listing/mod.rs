//! Machine code as people read it: instruction by instruction with the source line of each, and how often it was run where that was counted.
//!
//! A unit is compiled here once more, in the way of [`Jit::new`](crate::Jit::new), to code of the same bytes. After Cranelift's optimiser, which
//! moves instructions out of loops, each is marked with its place in the program *and* the block that it came to lie in. Counts of blocks
//! ([`BlockCounts`]) so become counts of instructions; a line's cost is how many machine instructions of it were run. That is no time: an access to
//! memory that is far away, a division, or a routine of the host costs more than its one instruction.

mod decode;
mod executions;

use std::collections::BTreeMap;

use cranelift_codegen::FinalizedRelocTarget;
use cranelift_codegen::ir::{ExternalName, Function, SourceLoc};
use cranelift_codegen::isa::OwnedTargetIsa;
use cranelift_codegen::{CompiledCode, Context as Compilation};
use cranelift_frontend::FunctionBuilderContext;
use khz_bytecode::container::Owner;
use khz_bytecode::ids::FunctionId;
use khz_bytecode::verify::Verified;
use khz_machine::image::ImageLayout;

use crate::build::{ProgramMemory, Scope};
use crate::code::{Assembly, Called, Key, Use, compile_marked, host_isa};
use crate::counts::BlockCounts;
use crate::lower::{Settings, lower};
use crate::plan::{self, Plan};
use crate::run::{FormOf, assembly, for_each_form, settings_for};
use crate::symbols::{Names, place_of, source_line};
use crate::{JitError, JitOptions, mir};

/// A function, or a part that was cut out of it, as machine code.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unit {
    /// What it is called, as in [`Symbol`](crate::Symbol).
    pub name: String,
    /// The function.
    pub function: FunctionId,
    /// The code, with nothing filled in where it names other code.
    pub code: Vec<u8>,
    /// Its instructions and data, in order of their offsets.
    pub rows: Vec<Row>,
}

/// An instruction, or bytes that are none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// Where in the unit's code.
    pub offset: u32,
    /// Bytes.
    pub bytes: u32,
    /// As an assembler writes it.
    pub text: String,
    /// What it names outside of the unit.
    pub callee: Option<String>,
    /// Source file and line that it comes from, where the container tells. What the compiler adds belongs to the line before, or else behind, in the
    /// same block; blocks of nothing else, such as the way out of a function, have none. Moves between two blocks belong to the line above them.
    pub source: Option<(String, u32)>,
    /// What it is for.
    pub role: Role,
    /// How often it was run; `None`: it is no instruction, or nothing was counted.
    pub executions: Option<u64>,
}

/// What an instruction is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// What the program says, and what calls and loops need.
    Work,
    /// The comparison and the branch of a guard, on the way of a program that does not trap.
    Guard,
    /// What is only run when a guard fires.
    Cold,
}

/// Where an instruction lies: Cranelift's block, and its place in the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Mark {
    block: u32,
    place: SourceLoc,
    role: Role,
}

/// All machine code of a resource in the order of its functions; also of functions that nothing calls, where no `counts` are given, which come
/// from an engine that was made with the same options.
///
/// # Errors
/// A host whose machine code can not be taken apart, or a function that Cranelift refuses.
pub fn listing(
    verified: &Verified,
    layout: &ImageLayout,
    options: JitOptions,
    counts: Option<&BlockCounts>,
) -> Result<Vec<Unit>, JitError> {
    let scope = plan::scope(verified, layout);
    let plan = Plan::new(&scope);
    let isa = host_isa(options.verify_ir, Use::List)?;
    if !matches!(isa.triple().architecture, target_lexicon::Architecture::X86_64) {
        return Err(JitError::Host("its machine code can only be listed on x86-64".into()));
    }
    let options = JitOptions { note_lines: false, count_blocks: false, ..options };
    let mut lister = Lister {
        assembly: assembly(&scope, &plan, isa.clone(), options)?,
        settings: Settings { source_lines: true, ..settings_for(&isa, &plan, options) },
        isa,
        names: Names::new(verified),
        scope: &scope,
        counts,
        units: Vec::new(),
        calls: Vec::new(),
        parts: BTreeMap::new(),
    };
    let uncalled = uncalled(&scope, &plan).filter(|_| counts.is_none());
    let keys = plan.functions.keys().copied().chain(uncalled);
    let mut compilation = lister.assembly.compilation();
    let mut builder_context = FunctionBuilderContext::new();
    for_each_form(&scope, keys, plan.calls_virtual, options, |of| {
        lister.add(of, &mut compilation, &mut builder_context)
    })?;
    lister.finish()
}

/// Functions that no entry reaches. Those of a program have no memory to be compiled for.
fn uncalled<'a>(scope: &'a Scope<'_>, plan: &'a Plan) -> impl Iterator<Item = Key> + 'a {
    let functions = scope.verified.container().functions.iter().enumerate();
    let reached: std::collections::BTreeSet<FunctionId> = plan.functions.keys().map(|key| key.0).collect();
    functions.filter_map(move |(number, function)| {
        let id = FunctionId::from_index(number).filter(|id| !reached.contains(id))?;
        (!matches!(function.owner, Owner::Program(_))).then_some((id, ProgramMemory::None))
    })
}

struct Lister<'a> {
    assembly: Assembly,
    settings: Settings,
    isa: OwnedTargetIsa,
    names: Names<'a>,
    scope: &'a Scope<'a>,
    counts: Option<&'a BlockCounts>,
    units: Vec<Unit>,
    /// Rows that name what gets its name at the end: unit, row, number in code.
    calls: Vec<(usize, usize, u32)>,
    /// Names of parts by their numbers in code.
    parts: BTreeMap<u32, String>,
}

impl Lister<'_> {
    fn add(
        &mut self,
        of: &FormOf<'_>,
        compilation: &mut Compilation,
        builder_context: &mut FunctionBuilderContext,
    ) -> Result<(), JitError> {
        let function = of.key.0;
        self.assembly.start_form();
        lower(self.scope, of.form, of.key.1, self.settings, &mut self.assembly, &mut compilation.func, builder_context);
        let refused = |reason: String| JitError::Function { function, reason };
        let mut marks = Vec::new();
        let compiled = compile_marked(compilation, &*self.isa, |function| marks = mark(function));
        let compiled = compiled.map_err(|error| refused(format!("{error:?}")))?;
        let rows = self.rows(of.form, &compiled, &marks);
        let called = called(&compilation.func, &compiled);
        for (number, row) in rows.iter().enumerate() {
            let ids = called.range(row.offset..row.offset + row.bytes).map(|(_, id)| *id);
            self.calls.extend(ids.map(|id| (self.units.len(), number, id)));
        }
        if of.part.is_none() {
            let parts = self.assembly.take_parts();
            self.parts.extend(parts.into_iter().map(|(id, number)| (id, self.names.of(of.key, Some(number)))));
        }
        let (name, code) = (self.names.of(of.key, of.part), compiled.code_buffer().to_vec());
        self.units.push(Unit { name, function, code, rows });
        compilation.clear();
        Ok(())
    }

    fn rows(&self, form: &mir::Function, compiled: &CompiledCode, marks: &[Mark]) -> Vec<Row> {
        let code = compiled.code_buffer();
        let mut starts = compiled.bb_starts.clone();
        starts.sort_unstable();
        starts.dedup();
        if starts.is_empty() {
            starts.push(0);
        }
        let ranges = compiled.buffer.get_srclocs_sorted();
        let mark_at = |offset: u32| {
            let behind = ranges.partition_point(|range| range.start <= offset);
            let range = ranges.get(behind.checked_sub(1)?).filter(|range| offset < range.end)?;
            marks.get(range.loc.bits() as usize)
        };
        // What makes the frame lies in front of the first block and is run as often.
        let block_of = |offset: u32| starts.partition_point(|start| *start <= offset).saturating_sub(1);
        let decoded = decode::decode(code, &[starts.as_slice(), &[0]].concat());
        // Blocks of moves between two others carry no mark.
        let mut marked = vec![None; starts.len()];
        for (block, mark) in decoded.keys().filter_map(|at| Some((block_of(*at), mark_at(*at)?))) {
            marked[block] = Some(mark.block);
        }
        let count = |block: Option<u32>| Some(self.counts?.of(self.units.len(), block?));
        let counted: Vec<Option<u64>> = marked.iter().map(|block| count(*block)).collect();
        let executions = executions::executions(&starts, &compiled.bb_edges, &counted);
        let debug = self.scope.verified.container().debug.as_ref();
        let source = |offset: u32| {
            let place = place_of(form, mark_at(offset)?.place)?;
            source_line(debug, place).map(|(file, line)| (file.to_owned(), line))
        };
        let mut rows = Vec::new();
        let mut end = 0;
        for (offset, instruction) in decoded {
            rows.extend(data(end, offset));
            end = offset + instruction.bytes;
            rows.push(Row {
                offset,
                bytes: instruction.bytes,
                text: instruction.text,
                callee: None,
                source: source(offset),
                role: mark_at(offset).map_or(Role::Work, |mark| mark.role),
                executions: self.counts.and(executions.get(block_of(offset)).copied()),
            });
        }
        rows.extend(data(end, u32::try_from(code.len()).unwrap_or(u32::MAX)));
        let blocks: Vec<usize> = rows.iter().map(|row| block_of(row.offset)).collect();
        carry(&mut rows, &blocks, 0..blocks.len());
        carry(&mut rows, &blocks, (0..blocks.len()).rev());
        for at in 1..rows.len() {
            if marked[blocks[at]].is_none() {
                rows[at].source = rows[at - 1].source.clone();
            }
        }
        rows
    }

    fn finish(mut self) -> Result<Vec<Unit>, JitError> {
        let named = self.assembly.named();
        for (unit, row, id) in self.calls {
            self.units[unit].rows[row].callee = match named.get(&id) {
                Some(Called::Function(key)) => Some(self.names.of(*key, None)),
                Some(Called::Routine(name)) => Some((*name).to_owned()),
                None => self.parts.get(&id).cloned(),
            };
        }
        // Parts come before their function, as they were made.
        self.units.sort_by_key(|unit| unit.function);
        Ok(self.units)
    }
}

/// Marks the instructions of an optimised function; the marks that they now carry by number.
fn mark(function: &mut Function) -> Vec<Mark> {
    let mut marks = Vec::new();
    let blocks: Vec<_> = function.layout.blocks().collect();
    for block in blocks {
        let instructions: Vec<_> = function.layout.block_insts(block).collect();
        for instruction in instructions {
            let data = &function.dfg.insts[instruction];
            let targets = data.branch_destination(&function.dfg.jump_tables, &function.dfg.exception_tables);
            let leaves = targets.iter().any(|target| function.layout.is_cold(target.block(&function.dfg.value_lists)));
            let role = match function.layout.is_cold(block) {
                true => Role::Cold,
                false if leaves => Role::Guard,
                false => Role::Work,
            };
            let mark = Mark { block: block.as_u32(), place: function.srcloc(instruction), role };
            if marks.last() != Some(&mark) {
                marks.push(mark);
            }
            // A function has fewer instructions than 2^32.
            function.set_srcloc(instruction, SourceLoc::new(marks.len() as u32 - 1));
        }
    }
    marks
}

/// What code names outside, by offset.
fn called(function: &Function, compiled: &CompiledCode) -> BTreeMap<u32, u32> {
    let named = compiled.buffer.relocs().iter().filter_map(|relocation| match &relocation.target {
        FinalizedRelocTarget::ExternalName(ExternalName::User(name)) => {
            Some((relocation.offset, function.params.user_named_funcs()[*name].index))
        }
        _ => None,
    });
    named.collect()
}

/// A row for bytes that are no instructions.
fn data(start: u32, end: u32) -> Option<Row> {
    let bytes = end.checked_sub(start).filter(|bytes| *bytes > 0)?;
    let text = format!("; {bytes} bytes of constants, jump tables or filling");
    Some(Row { offset: start, bytes, text, callee: None, source: None, role: Role::Work, executions: None })
}

/// Gives rows without a source line that of the row before it, in some order, in the same block.
fn carry(rows: &mut [Row], blocks: &[usize], order: impl Iterator<Item = usize>) {
    let mut last: Option<usize> = None;
    for at in order {
        if rows[at].source.is_some() {
            last = Some(at);
        } else if let Some(from) = last.filter(|from| blocks[*from] == blocks[at]) {
            rows[at].source = rows[from].source.clone();
        }
    }
}
