//! From tests to PROGRAMs: a function from syntax tree to syntax tree.
//!
//! What it adds has names with a `$`, which no source can spell, and spans of what it was made for.

use std::collections::{BTreeMap, BTreeSet};

use super::{MAX_FIXTURE_BYTES, MAX_TESTS, TestUnit};
use crate::diagnostics::{Diagnostic, Severity, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{
    Ast, BinaryOp, Block, Declaration, Expr, ExprId, ExprKind, Ident, IfBranch, Literal, LiteralValue, Pou, PouKind,
    Stmt, StmtKind, Test, TestPart, TestSuite, TypeSpec, TypeSpecKind, VarDecl, VarKind, VarSection,
};
use crate::syntax::symbol::{Interner, Symbol};

/// Field of every function block, where tests mock: its body does not run.
pub(crate) const MOCKED: &str = "__$MOCKED";
/// Field of every function block, where tests mock: calls since it was mocked.
pub(crate) const CALLS: &str = "__$CALLS";
/// Variable of a test that has a TEARDOWN: the next activation is for that.
const TORN: &str = "__$TORN";

/// Name of the global that says whether a function (by its folded name) is mocked.
pub(crate) fn mocked_global(function: &str) -> String {
    format!("__$MOCKED {function}")
}

/// Name of the global with the value that a mocked function returns.
pub(crate) fn value_global(function: &str) -> String {
    format!("__$VALUE {function}")
}

/// Whether a file has tests.
pub(crate) fn has_tests(ast: &Ast) -> bool {
    ast.files
        .iter()
        .any(|file| !file.tests.tests.is_empty() || file.tests.setup.is_some() || file.tests.teardown.is_some())
}

/// Turns all tests into PROGRAMs, and makes what they test ready for them.
pub(crate) fn desugar(ast: &mut Ast) -> (Vec<TestUnit>, Vec<Diagnostic>) {
    let suites: Vec<TestSuite> = ast.files.iter_mut().map(|file| std::mem::take(&mut file.tests)).collect();
    let mut found = Vec::new();
    make_instantiable(ast);
    let mut maker = Maker { names: std::mem::take(&mut ast.names), next: ast.expr_count };
    if suites.iter().any(|suite| suite.mocks) {
        for file in &mut ast.files {
            file.declarations.iter_mut().for_each(|declaration| maker.mockable_block(declaration));
        }
    }
    let functions: BTreeSet<Symbol> =
        suites.iter().flat_map(|suite| &suite.mocked_functions).map(|function| function.symbol).collect();
    for file in &mut ast.files {
        let globals: Vec<VarSection> =
            file.declarations.iter_mut().filter_map(|found| maker.mockable_function(found, &functions)).collect();
        file.declarations.extend(globals.into_iter().map(Declaration::Globals));
    }
    let mut units = Vec::new();
    let mut fixture_bytes = 0;
    for (file, suite) in ast.files.iter_mut().zip(suites) {
        warn_of_twins(&suite, &mut found);
        found.extend(suite.setup.as_ref().and_then(leaves_early));
        for test in &suite.tests {
            fixture_bytes += fixture_size(test, &suite);
            if fixture_bytes > MAX_FIXTURE_BYTES {
                let message = "SETUP and TEARDOWN come to too much with all the tests before this one";
                let found_here = Diagnostic::new(&rules::BAD_TEST, test.name_span, message);
                found.push(found_here.help("move what they do to a FUNCTION_BLOCK"));
                break;
            }
            if units.len() >= MAX_TESTS {
                let message = format!("there are more than {MAX_TESTS} tests; this one and the rest are left out");
                found.push(
                    Diagnostic::new(&rules::BAD_TEST, test.name_span, message).help("test the folders one by one"),
                );
                break;
            }
            let (unit, pou) = maker.test(units.len(), test, &suite);
            units.push(unit);
            file.declarations.push(Declaration::Pou(pou));
        }
    }
    ast.names = maker.names;
    ast.expr_count = maker.next;
    (units, found)
}

/// Programs become function blocks; of configurations only the globals stay.
fn make_instantiable(ast: &mut Ast) {
    for declaration in ast.files.iter_mut().flat_map(|file| &mut file.declarations) {
        match declaration {
            Declaration::Pou(pou) if pou.kind == PouKind::Program => pou.kind = PouKind::FunctionBlock,
            Declaration::Configuration(configuration) => {
                configuration.config_vars.clear();
                for resource in &mut configuration.resources {
                    resource.tasks.clear();
                    resource.programs.clear();
                }
            }
            _ => {}
        }
    }
}

/// The bytes of the fixture that a test is compiled with.
fn fixture_size(test: &Test, suite: &TestSuite) -> u64 {
    let parts = [&suite.setup, &suite.teardown].into_iter().flatten().filter(|_| test.in_suite);
    parts.map(|part| u64::from(part.span.len())).sum()
}

/// Two tests of one name in one file can not be told apart in a report.
fn warn_of_twins(suite: &TestSuite, found: &mut Vec<Diagnostic>) {
    let mut names: BTreeMap<&str, Span> = BTreeMap::new();
    for test in suite.tests.iter().filter(|test| !test.name.is_empty()) {
        if let Some(first) = names.insert(&test.name, test.name_span) {
            let message = format!("there are two tests `{}` in this file", test.name);
            let mut twin = Diagnostic::new(&rules::BAD_TEST, test.name_span, message).label(first, "the first is here");
            // Both run all the same, as other runners do it.
            twin.severity = Severity::Warning;
            found.push(twin);
        }
    }
}

/// SETUP stands before the statements of each test: a RETURN in it would end the test, which would then seem to pass.
fn leaves_early(setup: &TestPart) -> Option<Diagnostic> {
    let mut blocks = vec![&setup.body];
    while let Some(block) = blocks.pop() {
        if let Some(leaves) = block.statements.iter().find(|statement| matches!(statement.kind, StmtKind::Return)) {
            let found =
                Diagnostic::new(&rules::BAD_TEST, leaves.span, "RETURN in SETUP would end every test before it begins");
            return Some(found.help("guard the rest of SETUP by an IF"));
        }
        blocks.extend(block.statements.iter().flat_map(Stmt::blocks));
    }
    None
}

/// Makes nodes of the tree.
struct Maker {
    names: Interner,
    next: u32,
}

impl Maker {
    fn test(&mut self, number: usize, test: &Test, suite: &TestSuite) -> (TestUnit, Pou) {
        let in_suite = test.in_suite;
        let (setup, teardown) = if in_suite { (suite.setup.as_ref(), suite.teardown.as_ref()) } else { (None, None) };
        let span = test.part.span;
        let mut sections: Vec<VarSection> = setup.map(|setup| setup.sections.clone()).unwrap_or_default();
        sections.extend(test.part.sections.iter().cloned());
        let mut statements: Vec<Stmt> = setup.map(|setup| setup.body.statements.clone()).unwrap_or_default();
        statements.extend(test.part.body.statements.iter().cloned());
        if let Some(TestPart { sections: own, body, .. }) = teardown {
            sections.extend(own.iter().cloned());
            sections.push(self.section(VarKind::Local, &[(TORN, "BOOL")], span));
            let torn = self.variable(TORN, span);
            statements.insert(0, self.set_true(TORN, span));
            let branch = IfBranch { condition: torn, body: body.clone() };
            let otherwise = Some(Block { statements, span: test.part.body.span });
            statements = vec![Stmt { kind: StmtKind::If { branches: vec![branch], otherwise }, span }];
        }
        let symbol = self.names.intern_folded(&format!("$TEST {number}"));
        let name =
            Ident { symbol, spelling: self.names.intern(&format!("TEST '{}'", test.name)), span: test.name_span };
        let body = Block { statements, span };
        let unit = TestUnit {
            symbol,
            name: test.name.clone(),
            span: test.name_span,
            in_suite,
            has_teardown: teardown.is_some(),
        };
        (
            unit,
            Pou {
                kind: PouKind::Program,
                name,
                result: None,
                sections,
                body,
                attributes: Vec::new(),
                names_lost: false,
                span,
            },
        )
    }

    /// Lets the instances of a function block be mocked: `IF mocked THEN calls := calls + 1; RETURN; END_IF` before its body.
    fn mockable_block(&mut self, declaration: &mut Declaration) {
        let Declaration::Pou(pou) = declaration else { return };
        if pou.kind != PouKind::FunctionBlock {
            return;
        }
        let span = pou.name.span;
        pou.sections.push(self.section(VarKind::Local, &[(MOCKED, "BOOL"), (CALLS, "UDINT")], span));
        let one = LiteralValue::Int { negative: false, magnitude: 1, based: false };
        let (lhs, rhs) = (Box::new(self.variable(CALLS, span)), Box::new(self.literal(one, span)));
        let sum = self.expr(ExprKind::Binary { op: BinaryOp::Add, op_span: span, lhs, rhs }, span);
        let count = StmtKind::Assign { target: self.variable(CALLS, span), op_span: span, value: sum };
        let mocked = self.variable(MOCKED, span);
        pou.body.statements.insert(0, leave_if(mocked, Stmt { kind: count, span }));
    }

    /// Lets a function be mocked, if it is one of these and has a result: `IF mocked THEN f := value; RETURN; END_IF` before its body.
    /// Gives the globals for that.
    fn mockable_function(&mut self, declaration: &mut Declaration, functions: &BTreeSet<Symbol>) -> Option<VarSection> {
        let Declaration::Pou(pou) = declaration else { return None };
        let result =
            pou.result.as_ref().filter(|_| pou.kind == PouKind::Function && functions.contains(&pou.name.symbol))?;
        let span = pou.name.span;
        let function = self.names.text(pou.name.symbol).to_owned();
        let (mocked, value) = (mocked_global(&function), value_global(&function));
        let mut globals = self.section(VarKind::Global, &[(&mocked, "BOOL")], span);
        globals.decls.push(self.declaration(&value, result.clone(), span));
        let target = self.expr(ExprKind::Name(pou.name), span);
        let assign = StmtKind::Assign { target, op_span: span, value: self.variable(&value, span) };
        let mocked = self.variable(&mocked, span);
        pou.body.statements.insert(0, leave_if(mocked, Stmt { kind: assign, span }));
        Some(globals)
    }

    fn section(&mut self, kind: VarKind, variables: &[(&str, &str)], span: Span) -> VarSection {
        let mut decls = Vec::with_capacity(variables.len());
        for (name, ty) in variables {
            let ty = TypeSpec { kind: TypeSpecKind::Named(self.ident(ty, span)), span };
            decls.push(self.declaration(name, ty, span));
        }
        VarSection { kind, constant: None, retention: None, decls, attributes: Vec::new(), span }
    }

    fn declaration(&mut self, name: &str, ty: TypeSpec, span: Span) -> VarDecl {
        VarDecl {
            names: vec![self.ident(name, span)],
            address: None,
            ty,
            edge: None,
            init: None,
            attributes: Vec::new(),
            span,
        }
    }

    fn set_true(&mut self, name: &str, span: Span) -> Stmt {
        let value = self.literal(LiteralValue::Bool(true), span);
        Stmt { kind: StmtKind::Assign { target: self.variable(name, span), op_span: span, value }, span }
    }

    fn literal(&mut self, value: LiteralValue, span: Span) -> Expr {
        self.expr(ExprKind::Literal(Literal { ty: None, value }), span)
    }

    fn variable(&mut self, name: &str, span: Span) -> Expr {
        let name = self.ident(name, span);
        self.expr(ExprKind::Name(name), span)
    }

    fn ident(&mut self, name: &str, span: Span) -> Ident {
        let spelling = self.names.intern(name);
        Ident { symbol: self.names.fold(spelling), spelling, span }
    }

    fn expr(&mut self, kind: ExprKind, span: Span) -> Expr {
        let id = ExprId(self.next);
        self.next = self.next.saturating_add(1);
        Expr { id, kind, span }
    }
}

/// `IF condition THEN statement; RETURN; END_IF`.
fn leave_if(condition: Expr, statement: Stmt) -> Stmt {
    let span = statement.span;
    let leave = Stmt { kind: StmtKind::Return, span };
    let body = Block { statements: vec![statement, leave], span };
    Stmt { kind: StmtKind::If { branches: vec![IfBranch { condition, body }], otherwise: None }, span }
}
