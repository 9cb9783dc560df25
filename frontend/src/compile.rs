//! The whole way: bytes of source files to containers.

use khz_bytecode::canary::carried;
use khz_bytecode::container::Container;
use khz_machine::library::blocks;
use std::cell::Cell;
use std::collections::BTreeSet;

use crate::analysis;
use crate::diagnostics::{Diagnostic, has_errors, tidy};
use crate::lint;
use crate::lower;
use crate::source::{FileId, SourceMap, Span};
use crate::syntax::ast::Ast;
use crate::syntax::parser::parse;
use crate::testing::{CompiledTest, TestCompilation, desugar};

/// Name of the file that holds the standard function blocks a program uses.
pub const STANDARD_FILE: &str = "<standard>";

/// Stack of the compiling thread. The tree's depth is limited (`syntax::parser`), and this is room for it in every build.
const STACK_BYTES: usize = 256 << 20;

/// Which implicit conversions are taken without a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dialect {
    /// What vendors take, with a warning for each.
    #[default]
    Default,
    /// Only what the standard's figure of implicit conversions has.
    Iec,
}

/// The task that runs every PROGRAM where the sources have no CONFIGURATION.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DefaultTask {
    /// Its name.
    pub name: String,
    /// Its interval in microseconds.
    pub interval_us: u64,
    /// Its priority; 0 is the highest.
    pub priority: u16,
}

impl Default for DefaultTask {
    fn default() -> Self {
        DefaultTask { name: "default_task".to_owned(), interval_us: 10_000, priority: 0 }
    }
}

/// How to compile.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CompileOptions {
    /// Which implicit conversions are taken.
    pub dialect: Dialect,
    /// The task of programs without a CONFIGURATION.
    pub task: DefaultTask,
    /// Leave the debug section out.
    pub strip: bool,
}

/// A source file: a name for messages and its bytes as they are on disk.
#[derive(Debug, Clone)]
pub struct SourceInput {
    /// The name that messages and the debug section show.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// One compiled RESOURCE.
#[derive(Debug, Clone)]
pub struct CompiledResource {
    /// Its name.
    pub name: String,
    /// What it is compiled to; not verified yet.
    pub container: Container,
    /// VAR_INPUT of its program instances, as `instance.variable`: the container does not tell them from other variables.
    pub inputs: Vec<String>,
}

/// What came of it.
#[derive(Debug)]
pub struct Compilation {
    /// One for each RESOURCE; empty when a diagnostic is an error.
    pub resources: Vec<CompiledResource>,
    /// Everything there is to say, in order of place.
    pub diagnostics: Vec<Diagnostic>,
    /// The sources, for places in messages.
    pub sources: SourceMap,
}

/// Compiles sources, in their order, to one container for each RESOURCE.
pub fn compile(sources: &[SourceInput], options: &CompileOptions) -> Compilation {
    on_large_stack(|| run(sources, options, false))
}

/// Finds everything there is to say about sources: compiles them, because limits of the container are found only when it is made,
/// and looks at their unit tests too. Gives no containers.
pub fn check(sources: &[SourceInput], options: &CompileOptions) -> Compilation {
    on_large_stack(|| run(sources, options, true))
}

/// Compiles the unit tests of sources ([`crate::testing`]).
pub fn compile_tests(sources: &[SourceInput], options: &CompileOptions) -> TestCompilation {
    on_large_stack(|| run_tests(sources, options))
}

thread_local! {
    /// Whether this thread has room for the front end.
    static HAS_ROOM: Cell<bool> = const { Cell::new(false) };
}

/// Does `work` on a thread with room for sources of any depth. [`compile`], [`check`] and [`compile_tests`] do so by themselves; who has very many
/// sources to look at calls them from here, and no thread is made for each.
pub fn on_large_stack<T: Send>(work: impl Fn() -> T + Sync) -> T {
    if HAS_ROOM.get() {
        return work();
    }
    let with_room = || {
        HAS_ROOM.set(true);
        work()
    };
    std::thread::scope(|scope| {
        let builder = std::thread::Builder::new().name("khz-frontend".to_owned()).stack_size(STACK_BYTES);
        match builder.spawn_scoped(scope, carried(with_room)) {
            Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            // No thread to be had: the caller's own stack does for programs of ordinary depth.
            Err(_) => work(),
        }
    })
}

/// Sources, read.
struct Parsed {
    sources: SourceMap,
    standard: Option<FileId>,
    ast: Ast,
    diagnostics: Vec<Diagnostic>,
}

fn read(inputs: &[SourceInput]) -> Parsed {
    let mut sources = SourceMap::new();
    let mut diagnostics = Vec::new();
    for input in inputs {
        let (_, found) = sources.add_bytes(input.name.clone(), &input.bytes);
        diagnostics.extend(found);
    }
    let standard = add_standard_blocks(&mut sources);
    let (ast, found) = parse(&sources);
    diagnostics.extend(found);
    Parsed { sources, standard, ast, diagnostics }
}

fn run(inputs: &[SourceInput], options: &CompileOptions, only_checks: bool) -> Compilation {
    let Parsed { sources, standard, mut ast, mut diagnostics } = read(inputs);
    let (project, found) = analysis::analyze(&ast, options, standard);
    diagnostics.extend(found);
    let mut resources = Vec::new();
    if !has_errors(&diagnostics) {
        let hashes = lower::Hashes::of(inputs, &sources);
        for plan in &project.resources {
            match lower::lower(&project, plan, &ast.names, &sources, &hashes, options.strip) {
                Ok(container) => {
                    let inputs = plan.program_inputs(&project);
                    resources.push(CompiledResource { name: plan.name.clone(), container, inputs });
                }
                Err(found) => diagnostics.push(*found),
            }
        }
    }
    if !has_errors(&diagnostics) {
        diagnostics.extend(lint::lint(&ast, &project, standard));
    }
    if only_checks && desugar::has_tests(&ast) {
        let (units, found) = desugar::desugar(&mut ast);
        diagnostics.extend(found);
        let (_, _, found) = analysis::analyze_tests(&ast, options, standard, &units);
        // What is wrong outside of the tests has been found already.
        let mut seen: BTreeSet<(Span, &str, String)> = BTreeSet::new();
        seen.extend(diagnostics.iter().map(|found| (found.span, found.code(), found.message.clone())));
        diagnostics.extend(
            found.into_iter().filter(|found| !seen.contains(&(found.span, found.code(), found.message.clone()))),
        );
    }
    if only_checks || has_errors(&diagnostics) {
        resources.clear();
    }
    Compilation { resources, diagnostics: tidy(diagnostics), sources }
}

fn run_tests(inputs: &[SourceInput], options: &CompileOptions) -> TestCompilation {
    let Parsed { sources, standard, mut ast, mut diagnostics } = read(inputs);
    let (units, found) = desugar::desugar(&mut ast);
    diagnostics.extend(found);
    let (project, findings, found) = analysis::analyze_tests(&ast, options, standard, &units);
    // Each test's resource checks what it reaches: a mistake there is found once for each.
    let mut seen: BTreeSet<(Span, &str, String)> = BTreeSet::new();
    diagnostics
        .extend(found.into_iter().filter(|found| seen.insert((found.span, found.code(), found.message.clone()))));
    let mut tests = Vec::new();
    if !has_errors(&diagnostics) {
        let hashes = lower::Hashes::of(inputs, &sources);
        for ((unit, plan), found) in units.iter().zip(&project.resources).zip(findings) {
            // The runner finds operands by their names, so the debug section stays.
            match lower::lower(&project, plan, &ast.names, &sources, &hashes, false) {
                Ok(container) => tests.push(CompiledTest {
                    name: unit.name.clone(),
                    span: unit.span,
                    has_teardown: unit.has_teardown,
                    container,
                    failed: found.failed,
                    assertions: found.assertions,
                }),
                Err(found) => diagnostics.push(*found),
            }
        }
        if has_errors(&diagnostics) {
            tests.clear();
        }
    }
    TestCompilation { tests, diagnostics: tidy(diagnostics), sources }
}

/// Adds a file with the standard function blocks whose names occur in the sources.
fn add_standard_blocks(sources: &mut SourceMap) -> Option<FileId> {
    let known: Vec<blocks::StandardBlock> = blocks::all().collect();
    let names: BTreeSet<&str> = known.iter().map(|block| block.name.as_str()).collect();
    let longest = names.iter().map(|name| name.len()).max().unwrap_or(0);
    let mut used: BTreeSet<String> = BTreeSet::new();
    for (_, file) in sources.files() {
        for word in file.text().split(|c: char| !c.is_ascii_alphanumeric() && c != '_') {
            if word.len() < 2 || word.len() > longest {
                continue;
            }
            let word = word.to_ascii_uppercase();
            if names.contains(word.as_str()) {
                used.insert(word);
            }
        }
    }
    if used.is_empty() {
        return None;
    }
    let text: String =
        known.iter().filter(|block| used.contains(&block.name)).map(|block| block.source.as_str()).collect();
    Some(sources.add_text(STANDARD_FILE, text))
}
