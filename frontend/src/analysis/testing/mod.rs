//! Statements that mean something in unit tests only: assertions, ADVANCE_TIME, mocks (`docs/testing.md`).
//!
//! Each becomes ordinary statements. An assertion evaluates its operands once, into hidden variables of their common type that
//! all assertions of the test share, and compares those: what a report prints is what was compared. Where it does not
//! hold, it notes its number and returns. A word of these is looked at only where a test calls a name that nothing declares, so
//! every one of them can be an identifier.

mod assertions;
mod mocks;

use std::collections::BTreeMap;
use std::rc::Rc;

use khz_bytecode::container::{ElementaryType as E, OverrunPolicy};

use self::assertions::{ASSERTIONS, NEAR_IN_POU, Relation};
use super::Analyzer;
use super::config::Planned;
use super::expr::{Checker, Environment};
use super::tree::{
    Expr, ExprKind, GlobalId, InstancePlan, Place, PouId, ResourcePlan, Root, SinglePlan, Stmt, StmtKind, TaskPlan,
    UnOp, Usage, VarClass, VarId, VarInfo,
};
use super::types::{Const, Ty, Value};
use crate::diagnostics::{semantic as rules, types as type_rules};
use crate::source::Span;
use crate::syntax::ast::{self, Arg, ArgKind, Ident};
use crate::syntax::symbol::Symbol;
use crate::testing::{Assertion, Operand, OperandValue, TEST_INSTANCE, TestFindings, TestUnit};

/// Name of the last, optional parameter of every assertion.
const MESSAGE: &str = "MESSAGE";

/// The tests of a compilation, by the names of their PROGRAMs.
#[derive(Debug, Default)]
pub(super) struct Tests {
    in_suite: BTreeMap<Symbol, bool>,
    findings: BTreeMap<Symbol, TestFindings>,
}

impl Tests {
    pub(super) fn new(units: &[TestUnit]) -> Self {
        Tests { in_suite: units.iter().map(|unit| (unit.symbol, unit.in_suite)).collect(), findings: BTreeMap::new() }
    }

    /// What was found in a test.
    pub(super) fn take(&mut self, unit: &TestUnit) -> TestFindings {
        self.findings.remove(&unit.symbol).unwrap_or_default()
    }
}

/// What is collected while a test's body is checked.
#[derive(Debug)]
pub(super) struct TestBody {
    symbol: Symbol,
    in_suite: bool,
    /// Variables of the source, which come before the hidden ones.
    declared: usize,
    hidden: Vec<VarInfo>,
    by_use: BTreeMap<(&'static str, Ty), VarId>,
    assertions: Vec<Assertion>,
    /// Statements that stand before the one that is checked.
    pending: Vec<Stmt>,
}

impl<'a> Analyzer<'a> {
    /// One resource for each test, with all globals of the sources.
    pub(super) fn configure_tests(&mut self, units: &[TestUnit]) -> Vec<Planned> {
        let mut environment = Environment::new();
        for (at, global) in (0u32..).zip(&self.globals) {
            environment.entry(global.symbol).or_insert(GlobalId(at));
        }
        let environment = Rc::new(environment);
        let task = TaskPlan {
            name: TEST_INSTANCE.to_owned(),
            priority: 0,
            interval_us: None,
            single: SinglePlan::None,
            watchdog_us: 0,
            watchdog_sensitivity: 0,
            phase_us: 0,
            overrun_policy: OverrunPolicy::Grid,
        };
        let mut planned = Vec::with_capacity(units.len());
        for unit in units {
            let Some(&program) = self.pou_names.get(&unit.symbol) else { continue };
            let instance = InstancePlan {
                name: TEST_INSTANCE.to_owned(),
                program,
                task: 0,
                copy_in: Vec::new(),
                inouts: Vec::new(),
                copy_out: Vec::new(),
                blocks: Vec::new(),
                values: Vec::new(),
                image_values: Vec::new(),
                span: unit.span,
            };
            let plan = ResourcePlan {
                name: unit.name.clone(),
                configuration: "tests".to_owned(),
                globals: Vec::new(),
                tasks: vec![task.clone()],
                instances: vec![instance],
                startup: None,
                bodies: Vec::new(),
                usage: Usage::default(),
            };
            planned.push(Planned { plan, environment: Rc::clone(&environment) });
        }
        planned
    }

    /// What a body needs when it is a test's.
    pub(super) fn test_body(&self, pou: Option<PouId>) -> Option<Box<TestBody>> {
        let (tests, pou) = (self.tests.as_ref()?, pou?);
        let symbol = self.pou_decls.get(pou.0 as usize)?.name.symbol;
        let in_suite = *tests.in_suite.get(&symbol)?;
        let info = self.info(pou)?;
        Some(Box::new(TestBody {
            symbol,
            in_suite,
            declared: info.vars.len(),
            hidden: Vec::new(),
            by_use: BTreeMap::new(),
            assertions: Vec::new(),
            pending: Vec::new(),
        }))
    }

    /// Gives a test its hidden variables and keeps what was found in it.
    pub(super) fn finish_test(&mut self, pou: PouId, body: TestBody) {
        let failed = body.by_use.get(&(FAILED, UDINT)).and_then(|var| body.hidden.get(var.0 as usize - body.declared));
        let findings = TestFindings { failed: failed.map(|var| path(&var.name)), assertions: body.assertions };
        if let Some(tests) = &mut self.tests {
            tests.findings.insert(body.symbol, findings);
        }
        if let Some(slot) = self.pous.get_mut(pou.0 as usize).and_then(Option::as_mut) {
            Rc::make_mut(slot).vars.extend(body.hidden);
        }
    }
}

const UDINT: Ty = Ty::Elem(E::Udint);
const FAILED: &str = "failed";

/// The whole name of a variable of the test.
fn path(name: &str) -> String {
    format!("{TEST_INSTANCE}.{name}")
}

fn constant(value: i64, ty: Ty, span: Span) -> Expr {
    Expr { kind: ExprKind::Const(Const::Int(value)), ty, span }
}

fn load(place: Place, span: Span) -> Expr {
    Expr { ty: place.ty, kind: ExprKind::Load(Box::new(place)), span }
}

fn assign(target: Place, value: Expr) -> Stmt {
    Stmt { span: value.span, kind: StmtKind::Assign { target, value } }
}

impl<'a> Checker<'_, 'a> {
    /// Statements that a test's statement wants before itself.
    pub(super) fn take_pending(&mut self) -> Vec<Stmt> {
        self.test.as_mut().map(|test| std::mem::take(&mut test.pending)).unwrap_or_default()
    }

    /// A call of a name that nothing declares, if it is a word of tests and this is one. `Some(None)`: it was reported.
    pub(super) fn test_statement(&mut self, name: &Ident, args: &'a [Arg], span: Span) -> Option<Option<Stmt>> {
        let in_suite = self.test.as_ref()?.in_suite;
        let word = self.an.text(name.symbol);
        if let Some(row) = ASSERTIONS.iter().find(|row| row.word == word) {
            let row = if matches!(row.relation, Relation::Near) && !in_suite { &NEAR_IN_POU } else { row };
            return Some(self.assertion(row, args, span));
        }
        Some(match word {
            "ADVANCE_TIME" => self.advance_time(args, span),
            "MOCK" => self.mock(args, span),
            "MOCK_FUNCTION" => self.mock_function(args, span),
            "MOCK_VERIFY_CALLED" => self.verify_called(args, span),
            "MOCK_VERIFY_CALL_COUNT" => self.verify_call_count(args, span),
            _ => return None,
        })
    }

    /// The arguments in the order of the parameters, and the message. `None`: it was reported.
    fn test_arguments(
        &mut self,
        word: &str,
        parameters: &[&str],
        args: &'a [Arg],
        span: Span,
    ) -> Option<(Vec<&'a ast::Expr>, Option<&'a ast::Expr>)> {
        let mut given: Vec<Option<&'a ast::Expr>> = vec![None; parameters.len() + 1];
        for (position, arg) in args.iter().enumerate() {
            let (at, value) = match &arg.kind {
                ArgKind::Positional(value) => (Some(position), Some(value)),
                ArgKind::Input { name, value } => {
                    let text = self.an.text(name.symbol);
                    let at = parameters.iter().chain([&MESSAGE]).position(|parameter| *parameter == text);
                    (at, value.as_ref())
                }
                ArgKind::Output { .. } => (None, None),
            };
            let slot = at.and_then(|at| given.get_mut(at)).filter(|slot| slot.is_none());
            let (Some(slot), Some(value)) = (slot, value) else {
                let message = format!("{word} takes {} and a message", parameters.join(", "));
                self.an.report(&rules::ASSERTION, arg.span, message);
                return None;
            };
            *slot = Some(value);
        }
        let message = given.pop().flatten();
        let all: Option<Vec<&'a ast::Expr>> = given.into_iter().collect();
        if all.is_none() {
            self.an.report(&rules::ASSERTION, span, format!("{word} takes {}", parameters.join(", ")));
        }
        Some((all?, message))
    }

    /// Stores a value in the hidden variable of this use and type, which then stands for it.
    fn keep(&mut self, label: &'static str, value: Expr, operands: &mut Vec<Operand>) -> Option<Expr> {
        let value = self.settle(value, Ty::Void);
        if value.ty == Ty::Error {
            return None;
        }
        let ty = self.an.types.without_range(value.ty);
        let (target, name) = self.hidden(label, ty, value.span);
        let span = value.span;
        operands.push(Operand { label, value: OperandValue::Variable(path(&name)) });
        let kept = load(target.clone(), span);
        self.before(assign(target, value));
        Some(kept)
    }

    fn before(&mut self, statement: Stmt) {
        if let Some(test) = &mut self.test {
            test.pending.push(statement);
        }
    }

    /// The hidden variable of a use and type, and its name.
    fn hidden(&mut self, label: &'static str, ty: Ty, span: Span) -> (Place, String) {
        // Strings of all lengths share a few variables, each long enough.
        let ty = match ty.capacity() {
            Some(length) => {
                let room = [80, 254, 4095].into_iter().find(|room| length <= *room).unwrap_or(length);
                Ty::text(ty.is_wide_text(), room)
            }
            None => ty,
        };
        let Some(test) = &mut self.test else {
            return (Place { root: Root::CallInstance, path: Vec::new(), ty: Ty::Error, span }, String::new());
        };
        let (declared, count) = (test.declared, test.hidden.len());
        let var = *test.by_use.entry((label, ty)).or_insert(VarId(u32::try_from(declared + count).unwrap_or(u32::MAX)));
        if var.0 as usize == declared + count {
            test.hidden.push(VarInfo {
                symbol: Symbol::MISSING,
                name: format!("__${label} {count}"),
                span,
                ty,
                class: VarClass::Local,
                constant: false,
                init: Value::Zero,
                located: None,
                retain: false,
                edge: None,
                area: None,
                field: None,
            });
        }
        let name =
            test.hidden.get((var.0 as usize).saturating_sub(declared)).map(|var| var.name.clone()).unwrap_or_default();
        (Place { root: Root::Var(var), path: Vec::new(), ty, span }, name)
    }

    /// Leaves the test with this assertion's number unless `holds`.
    fn require(
        &mut self,
        word: &'static str,
        holds: Expr,
        operands: Vec<Operand>,
        message: Option<&'a ast::Expr>,
        span: Span,
    ) -> Option<Stmt> {
        let mut body = Vec::with_capacity(3);
        let mut message_name = None;
        if let Some(given) = message {
            let found = self.expr(given, Ty::Void);
            if found.ty == Ty::Error {
                return None;
            }
            if !found.ty.is_text() {
                let text = format!("a message is a STRING or WSTRING, not {}", self.an.types.name(found.ty));
                self.an.report(&type_rules::MISMATCH, given.span, text);
                return None;
            }
            let (target, name) = self.hidden("message", found.ty, given.span);
            body.push(assign(target, found));
            message_name = Some(path(&name));
        }
        let (failed, _) = self.hidden(FAILED, UDINT, span);
        let test = self.test.as_mut()?;
        test.assertions.push(Assertion { span, word, operands, message: message_name });
        let number = i64::try_from(test.assertions.len()).unwrap_or(i64::MAX);
        body.push(assign(failed, constant(number, UDINT, span)));
        body.push(Stmt { kind: StmtKind::Return, span });
        let broken = self.unary_op(UnOp::Not, holds, span);
        Some(Stmt { kind: StmtKind::If { branches: vec![(broken, body)], otherwise: Vec::new() }, span })
    }

    fn only_arguments<const N: usize>(
        &mut self,
        word: &str,
        what: &str,
        args: &'a [Arg],
        span: Span,
    ) -> Option<[&'a ast::Expr; N]> {
        let given: Option<Vec<&'a ast::Expr>> = args
            .iter()
            .map(|arg| match &arg.kind {
                ArgKind::Positional(value) => Some(value),
                _ => None,
            })
            .collect();
        let found = given.and_then(|given| <[&'a ast::Expr; N]>::try_from(given).ok());
        if found.is_none() {
            self.an.report(&rules::ASSERTION, span, format!("{word} takes {what}"));
        }
        found
    }
}

/// Whether a name means something as a statement of a test.
pub(super) fn is_test_word(word: &str) -> bool {
    let other = ["ADVANCE_TIME", "MOCK", "MOCK_FUNCTION", "MOCK_VERIFY_CALLED", "MOCK_VERIFY_CALL_COUNT"];
    ASSERTIONS.iter().any(|row| row.word == word) || other.contains(&word)
}
