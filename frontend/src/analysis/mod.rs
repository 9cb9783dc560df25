//! From the syntax tree to the typed tree ([`tree`]): what the names mean, which types there are, whether the program is sound.
//!
//! Three steps, in this order. *Declarations* ([`declare`], [`spec`], [`init`]): every type, constant, variable and unit gets its
//! definition, on demand and with cycles detected, because a constant may stand in a type and an enumeration in a constant.
//! *Configuration* ([`config`]): resources, tasks, program instances. *Bodies* ([`stmt`], [`expr`], [`call`], [`convert`]): for each
//! resource the units that it reaches, with the globals that it sees; then the rest, so that nothing stays unchecked.
//!
//! A mistake is reported once: what is wrong has the type [`types::Ty::Error`], which fits everywhere.

pub(crate) mod ops;
pub mod tree;
pub mod types;
mod union;

mod bcd;
mod block_tasks;
mod call;
mod characters;
mod config;
mod configured;
mod convert;
mod declare;
mod edges;
mod enabled;
mod expr;
mod fold;
mod init;
mod moments;
mod open;
mod place;
mod reach;
mod spec;
mod standard;
mod stmt;
mod tasks;
mod testing;

use std::collections::BTreeMap;
use std::rc::Rc;

use self::tree::{GlobalId, GlobalInfo, PouId, PouInfo, Project};
use self::types::{Ty, TyId, TypeTable, Value};
use crate::compile::{CompileOptions, DefaultTask, Dialect};
use crate::diagnostics::similar::nearest;
use crate::diagnostics::{Diagnostic, Rule, Severity, semantic as rules};
use crate::source::{FileId, Span};
use crate::syntax::ast::{Ast, Declaration, Ident, Pou, TypeDecl, VarDecl, VarSection};
use crate::syntax::symbol::Symbol;
use crate::testing::{TestFindings, TestUnit};

/// How deep declarations may depend on one another (a constant on a constant, a type on a type).
const MAX_DEPENDENCE: u32 = 200;

/// Checks a parsed program. `standard` is the file of the standard function blocks. The project is complete only when no
/// diagnostic is an error.
pub fn analyze(ast: &Ast, options: &CompileOptions, standard: Option<FileId>) -> (Project, Vec<Diagnostic>) {
    let mut analyzer = Analyzer::new(ast, options, standard);
    analyzer.declare();
    let resources = analyzer.configure();
    let resources = analyzer.check_bodies(resources);
    let pous = analyzer.pous.into_iter().flatten().collect();
    let Analyzer { types, globals, unreached, diagnostics, .. } = analyzer;
    (Project { types, pous, globals, resources, unreached }, diagnostics)
}

/// The same for the PROGRAMs that tests were made to: a resource for each, in their order, and what was found in it.
pub fn analyze_tests(
    ast: &Ast,
    options: &CompileOptions,
    standard: Option<FileId>,
    units: &[TestUnit],
) -> (Project, Vec<TestFindings>, Vec<Diagnostic>) {
    let mut analyzer = Analyzer::new(ast, options, standard);
    analyzer.tests = Some(testing::Tests::new(units));
    analyzer.declare();
    let resources = analyzer.configure_tests(units);
    let resources = analyzer.check_bodies(resources);
    let mut tests = analyzer.tests.take().unwrap_or_default();
    let findings = units.iter().map(|unit| tests.take(unit)).collect();
    let pous = analyzer.pous.into_iter().flatten().collect();
    let Analyzer { types, globals, unreached, diagnostics, .. } = analyzer;
    (Project { types, pous, globals, resources, unreached }, findings, diagnostics)
}

/// For how many unknown names a known one is looked for that may have been meant.
const MAX_SUGGESTIONS: u32 = 100;

/// How far a definition is.
#[derive(Debug, Clone)]
enum State<T> {
    Waiting,
    Busy,
    Done(T),
}

/// What a type name stands for.
#[derive(Debug, Clone, Copy)]
enum TypeSource<'a> {
    Declared(&'a TypeDecl),
    Block(PouId),
}

#[derive(Debug)]
struct TypeEntry<'a> {
    source: TypeSource<'a>,
    state: State<(Ty, Value)>,
    span: Span,
}

/// Where a CONSTANT that declarations may use is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum ConstKey {
    /// By its name, in a unit or everywhere.
    Named(Option<PouId>, Symbol),
    /// As a member of a global variable list.
    Listed(GlobalId),
}

/// The global variable list that a declaration stands in.
#[derive(Debug, Clone, Copy)]
struct ListOf {
    name: Ident,
    /// `{attribute 'qualified_only'}`: its variables are known as `LIST.x` only.
    qualified_only: bool,
}

/// A CONSTANT that declarations may use.
#[derive(Debug)]
struct ConstEntry<'a> {
    decl: &'a VarDecl,
    state: State<Option<(Ty, Value)>>,
}

/// State of the whole analysis.
struct Analyzer<'a> {
    ast: &'a Ast,
    dialect: Dialect,
    /// The task of programs without a CONFIGURATION.
    default_task: &'a DefaultTask,
    standard: Option<FileId>,
    diagnostics: Vec<Diagnostic>,
    types: TypeTable,
    type_names: BTreeMap<Symbol, TypeEntry<'a>>,
    /// Enumeration values of declared types: the types that have one of this name.
    enum_owners: BTreeMap<Symbol, Vec<Symbol>>,
    /// Enumeration values of types without a name.
    nameless_enums: BTreeMap<Symbol, Vec<TyId>>,
    pou_decls: Vec<&'a Pou>,
    pou_names: BTreeMap<Symbol, PouId>,
    pous: Vec<Option<Rc<PouInfo>>>,
    /// Names of each unit's variables.
    scopes: Vec<BTreeMap<Symbol, tree::VarId>>,
    constants: BTreeMap<ConstKey, ConstEntry<'a>>,
    globals: Vec<GlobalInfo>,
    global_names: BTreeMap<Symbol, Vec<GlobalId>>,
    global_decls: Vec<GlobalDecl<'a>>,
    /// Global variable lists by name, each with its variables.
    lists: BTreeMap<Symbol, BTreeMap<Symbol, GlobalId>>,
    depth: u32,
    suggestions: u32,
    /// Declarations outside of POUs may have been lost.
    names_lost: bool,
    /// POUs whose own declarations may have been lost.
    lost_in: Vec<Span>,
    /// Bodies of units that no resource reaches.
    unreached: Vec<(PouId, tree::Body)>,
    /// Present when tests are compiled.
    tests: Option<testing::Tests>,
}

/// A global as declared.
#[derive(Debug, Clone, Copy)]
struct GlobalDecl<'a> {
    section: &'a VarSection,
    decl: &'a VarDecl,
    name: Ident,
    configuration: Option<u32>,
    resource: Option<u32>,
    list: Option<ListOf>,
}

impl GlobalDecl<'_> {
    /// Whether it is known as `LIST.x` only.
    fn is_qualified_only(&self) -> bool {
        self.list.is_some_and(|list| list.qualified_only)
    }
}

impl<'a> Analyzer<'a> {
    fn new(ast: &'a Ast, options: &'a CompileOptions, standard: Option<FileId>) -> Self {
        Analyzer {
            ast,
            dialect: options.dialect,
            default_task: &options.task,
            standard,
            diagnostics: Vec::new(),
            types: <TypeTable as Default>::default(),
            type_names: BTreeMap::new(),
            enum_owners: BTreeMap::new(),
            nameless_enums: BTreeMap::new(),
            pou_decls: Vec::new(),
            pou_names: BTreeMap::new(),
            pous: Vec::new(),
            scopes: Vec::new(),
            constants: BTreeMap::new(),
            globals: Vec::new(),
            global_names: BTreeMap::new(),
            global_decls: Vec::new(),
            lists: BTreeMap::new(),
            depth: 0,
            suggestions: 0,
            names_lost: ast.files.iter().any(|file| file.names_lost),
            lost_in: ast.declarations().filter_map(lost_span).collect(),
            unreached: Vec::new(),
            tests: None,
        }
    }

    fn text(&self, symbol: Symbol) -> &'a str {
        self.ast.names.text(symbol)
    }

    fn spelling(&self, ident: &Ident) -> &'a str {
        self.ast.names.text(ident.spelling)
    }

    fn report(&mut self, rule: &'static Rule, span: Span, message: impl Into<String>) {
        self.push(Diagnostic::new(rule, span, message));
    }

    /// Reports something that the standard refuses and vendors accept: a warning, under `--dialect iec` an error.
    fn report_vendor(&mut self, rule: &'static Rule, span: Span, message: impl Into<String>) {
        let mut found = Diagnostic::new(rule, span, message);
        if self.dialect == Dialect::Iec {
            found.severity = Severity::Error;
        }
        self.push(found);
    }

    fn push(&mut self, found: Diagnostic) {
        // The standard library's own text is ours: nothing in it is the user's to mend.
        if found.severity != Severity::Error && Some(found.span.file) == self.standard {
            return;
        }
        self.diagnostics.push(found);
    }

    fn info(&self, pou: PouId) -> Option<Rc<PouInfo>> {
        self.pous.get(pou.0 as usize).cloned().flatten()
    }

    /// Runs a step that may lead to itself through declarations; refuses when that goes too deep.
    fn nested<T>(&mut self, span: Span, step: impl FnOnce(&mut Self) -> T) -> Option<T> {
        if self.depth >= MAX_DEPENDENCE {
            let message = format!("declarations depend on one another more than {MAX_DEPENDENCE} levels deep");
            self.report(&rules::TOO_DEEP, span, message);
            return None;
        }
        self.depth += 1;
        let result = step(self);
        self.depth -= 1;
        Some(result)
    }

    /// Whether an unknown name may be one whose declaration was wrong, which has been reported there.
    fn may_be_lost(&self, span: Span) -> bool {
        let inside = |pou: &Span| pou.file == span.file && pou.start <= span.start && span.end <= pou.end;
        self.names_lost || self.lost_in.iter().any(inside)
    }

    /// Reports an unknown name with the nearest known one.
    fn report_unknown(
        &mut self,
        rule: &'static Rule,
        ident: &Ident,
        message: String,
        known: impl Iterator<Item = Symbol>,
    ) {
        if ident.is_missing() || self.may_be_lost(ident.span) {
            return;
        }
        let wanted = self.text(ident.symbol);
        // Looking through all names for each of very many unknown ones would take time in their product.
        self.suggestions += 1;
        let known = known.take(if self.suggestions <= MAX_SUGGESTIONS { usize::MAX } else { 0 });
        // A name that is known elsewhere but not here is no mistake of spelling.
        let known = known.filter(|symbol| *symbol != ident.symbol).map(|symbol| (self.text(symbol), symbol));
        let best = nearest(wanted, known);
        let mut found = Diagnostic::new(rule, ident.span, message);
        let default = match rule.code {
            "S0001" if wanted == "DEFAULT" => Some("what no label names stands behind `ELSE`".to_owned()),
            "S0001" if wanted == "PRINT" => {
                Some("nothing is printed: look at variables with `khz run --watch`".to_owned())
            }
            "S0001" => Some("declare it in a VAR section, or correct its name".to_owned()),
            "S0003" => Some("declare it with `TYPE … END_TYPE`, or correct its name".to_owned()),
            _ => None,
        };
        found.help = match best {
            Some(symbol) => Some(format!("did you mean `{}`?", self.ast.names.text_as_written(symbol))),
            None => default,
        };
        self.push(found);
    }
}

/// A POU whose declarations may have been lost.
fn lost_span(declaration: &Declaration) -> Option<Span> {
    match declaration {
        Declaration::Pou(pou) if pou.names_lost => Some(pou.span),
        _ => None,
    }
}

pub(crate) use fold::{NS_PER_MS, unit_ns};
pub(crate) use init::scalar_bytes;
pub(crate) use tasks::parse_duration_ns;
