//! Statements that mean something in unit tests only: assertions, ADVANCE_TIME, mocks (`docs/testing.md`).
//!
//! Each becomes ordinary statements. An assertion evaluates its operands once, into hidden variables of their common type that
//! all assertions of the test share, and compares those: what a report prints is what was compared. Where it does not
//! hold, it notes its number and returns. A word of these is looked at only where a test calls a name that nothing declares, so
//! every one of them can be an identifier.

use std::collections::BTreeMap;

use khz_bytecode::container::{ElementaryType as E, OverrunPolicy};

use super::Analyzer;
use super::config::Planned;
use super::expr::{Checker, Environment};
use super::place::step;
use super::tree::{
    BinOp, Expr, ExprKind, GlobalId, InstancePlan, Place, PouId, ResourcePlan, Root, SinglePlan, Step, Stmt, StmtKind, TaskPlan, UnOp,
    Usage, VarClass, VarId, VarInfo,
};
use super::types::{BOOL, Const, DINT, Ty, TyId, TyKind, Value, is_duration, is_integer, is_real, widen};
use crate::diagnostics::{semantic as rules, types as type_rules};
use crate::source::Span;
use crate::syntax::ast::{self, Arg, ArgKind, Ident, PouKind};
use crate::syntax::symbol::Symbol;
use crate::testing::{Assertion, Operand, OperandValue, TEST_INSTANCE, TestFindings, TestUnit, desugar};

/// How many values the arrays and structures of one assertion may hold.
const MAX_COMPARED_VALUES: usize = 1024;

/// Name of the last, optional parameter of every assertion.
const MESSAGE: &str = "MESSAGE";

/// What an assertion asks.
#[derive(Debug, Clone, Copy)]
enum Relation {
    /// One BOOL is this.
    Is(bool),
    /// The first compares so with the second.
    Compare(BinOp),
    /// The first two differ by no more than the third.
    Near,
}

/// An assertion: its word, its parameters in order, and what it asks.
struct Row {
    word: &'static str,
    parameters: &'static [&'static str],
    relation: Relation,
}

const fn row(word: &'static str, parameters: &'static [&'static str], relation: Relation) -> Row {
    Row { word, parameters, relation }
}

/// The assertions of both notations.
static ASSERTIONS: &[Row] = &[
    row("ASSERT_TRUE", &["IN"], Relation::Is(true)),
    row("ASSERT_FALSE", &["IN"], Relation::Is(false)),
    row("ASSERT_EQ", &["ACTUAL", "EXPECTED"], Relation::Compare(BinOp::Eq)),
    row("ASSERT_NEQ", &["ACTUAL", "EXPECTED"], Relation::Compare(BinOp::Ne)),
    row("ASSERT_GT", &["ACTUAL", "BOUND"], Relation::Compare(BinOp::Gt)),
    row("ASSERT_LT", &["ACTUAL", "BOUND"], Relation::Compare(BinOp::Lt)),
    row("ASSERT_GE", &["ACTUAL", "BOUND"], Relation::Compare(BinOp::Ge)),
    row("ASSERT_LE", &["ACTUAL", "BOUND"], Relation::Compare(BinOp::Le)),
    row("ASSERT_EQUAL", &["EXPECTED", "ACTUAL"], Relation::Compare(BinOp::Eq)),
    row("ASSERT_NOT_EQUAL", &["EXPECTED", "ACTUAL"], Relation::Compare(BinOp::Ne)),
    row("ASSERT_GREATER", &["VALUE", "BOUND"], Relation::Compare(BinOp::Gt)),
    row("ASSERT_LESS", &["VALUE", "BOUND"], Relation::Compare(BinOp::Lt)),
    row("ASSERT_GREATER_OR_EQUAL", &["VALUE", "BOUND"], Relation::Compare(BinOp::Ge)),
    row("ASSERT_LESS_OR_EQUAL", &["VALUE", "BOUND"], Relation::Compare(BinOp::Le)),
    row("ASSERT_NEAR", &["ACTUAL", "EXPECTED", "TOLERANCE"], Relation::Near),
];

/// ASSERT_NEAR in a test that is a POU: the other order.
static NEAR_IN_POU: Row = row("ASSERT_NEAR", &["EXPECTED", "ACTUAL", "DELTA"], Relation::Near);

/// How reports call an operand.
fn label(parameter: &str) -> &'static str {
    match parameter {
        "EXPECTED" => "expected",
        "BOUND" => "bound",
        "TOLERANCE" => "tolerance",
        "DELTA" => "delta",
        "VALUE" => "value",
        _ => "actual",
    }
}

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
            planned.push(Planned { plan, environment: environment.clone() });
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
            std::rc::Rc::make_mut(slot).vars.extend(body.hidden);
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

    fn assertion(&mut self, row: &'static Row, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let (given, message) = self.test_arguments(row.word, row.parameters, args, span)?;
        let labels: Vec<&'static str> = row.parameters.iter().map(|parameter| label(parameter)).collect();
        let mut operands = Vec::with_capacity(2);
        let holds = match (row.relation, given.as_slice()) {
            (Relation::Is(wanted), [value]) => {
                let value = self.condition(value);
                let value = self.keep("actual", value, &mut operands)?;
                operands.push(Operand { label: "expected", value: OperandValue::Text(if wanted { "TRUE" } else { "FALSE" }) });
                if wanted { value } else { self.unary_op(UnOp::Not, value, span) }
            }
            (Relation::Compare(op), [a, b]) => {
                let (a, b) = self.operand_pair(a, b);
                self.comparison(row.word, op, (labels[0], a), (labels[1], b), &mut operands, span)?
            }
            (Relation::Near, [a, b, tolerance]) => self.near([a, b, tolerance], &labels, &mut operands, span)?,
            _ => return None,
        };
        self.require(row.word, holds, operands, message, span)
    }

    /// Two operands, where a bare enumeration value takes its type from the other.
    fn operand_pair(&mut self, lhs: &'a ast::Expr, rhs: &'a ast::Expr) -> (Expr, Expr) {
        let mut a = self.expr(lhs, Ty::Void);
        let b = self.expr(rhs, if self.is_enum(a.ty) { a.ty } else { Ty::Void });
        let bare = matches!(lhs.kind, ast::ExprKind::Name(_)) && matches!(a.kind, ExprKind::Const(_));
        if bare && self.is_enum(b.ty) && b.ty != a.ty {
            a = self.expr(lhs, b.ty);
        }
        (a, b)
    }

    /// Keeps both operands in their common type, and compares them.
    fn comparison(
        &mut self,
        word: &str,
        op: BinOp,
        (first, a): (&'static str, Expr),
        (second, b): (&'static str, Expr),
        operands: &mut Vec<Operand>,
        span: Span,
    ) -> Option<Expr> {
        let (x, y) = (a.ty, b.ty);
        let common = self.meet(a, b, span);
        let composed = x == y && matches!(self.an.types.kind(x), Some(TyKind::Array { .. } | TyKind::Struct { .. }));
        let Some((a, b)) = common.filter(|(a, _)| !composed || a.ty == x) else {
            return self.no_comparison(word, x, y, span);
        };
        if a.ty == Ty::Error || b.ty == Ty::Error {
            return None;
        }
        let comparable = matches!(a.ty, Ty::Str(_)) || self.an.types.elementary(a.ty).is_some();
        let by_parts = composed && matches!(op, BinOp::Eq | BinOp::Ne) && !self.an.types.holds_block(x);
        if !comparable && !by_parts {
            return self.no_comparison(word, x, y, span);
        }
        let a = self.keep(first, a, operands)?;
        let b = self.keep(second, b, operands)?;
        if comparable {
            return Some(self.binary_op(op, a, b, span, Ty::Void)).filter(|found| found.ty != Ty::Error);
        }
        let equal = self.all_equal(&a, &b, span)?;
        Some(if op == BinOp::Eq { equal } else { self.unary_op(UnOp::Not, equal, span) })
    }

    /// Brings two operands to one type, literals included.
    fn meet(&mut self, a: Expr, b: Expr, span: Span) -> Option<(Expr, Expr)> {
        let (a, b, ty) = self.unify(a, b, span, Ty::Void)?;
        if !matches!(ty, Ty::IntLit | Ty::RealLit) {
            return Some((a, b));
        }
        let (a, b) = (self.settle(a, Ty::Void), self.settle(b, Ty::Void));
        self.unify(a, b, span, Ty::Void).map(|(a, b, _)| (a, b))
    }

    fn no_comparison<T>(&mut self, word: &str, a: Ty, b: Ty, span: Span) -> Option<T> {
        if a != Ty::Error && b != Ty::Error {
            let message = format!("{word} can not compare {} and {}", self.an.types.name(a), self.an.types.name(b));
            self.an.report(&rules::ASSERTION, span, message);
        }
        None
    }

    /// `ABS(a - b) <= tolerance`, without the sign that wraps and with equal infinities.
    fn near(
        &mut self,
        [a, b, tolerance]: [&'a ast::Expr; 3],
        labels: &[&'static str],
        operands: &mut Vec<Operand>,
        span: Span,
    ) -> Option<Expr> {
        let (a, b) = (self.expr(a, Ty::Void), self.expr(b, Ty::Void));
        let (x, y) = (a.ty, b.ty);
        let Some((a, b)) = self.meet(a, b, span) else { return self.no_comparison("ASSERT_NEAR", x, y, span) };
        let number = |ty: E| is_integer(ty) || is_real(ty) || is_duration(ty);
        let elementary = self.an.types.elementary(a.ty).filter(|ty| number(*ty) && !self.is_enum(a.ty));
        if a.ty == Ty::Error || b.ty == Ty::Error {
            return None;
        }
        let Some(elementary) = elementary else { return self.no_comparison("ASSERT_NEAR", x, y, span) };
        let found = self.expr(tolerance, a.ty);
        // A tolerance wider than the values says what it says; it must not be squeezed into their type.
        let tolerance = if matches!(found.ty, Ty::IntLit | Ty::RealLit) && is_integer(elementary) {
            self.settle(found, Ty::Void)
        } else if matches!(found.ty, Ty::IntLit | Ty::RealLit) {
            self.coerce(found, a.ty)
        } else {
            found
        };
        let a = self.keep(labels[0], a, operands)?;
        let b = self.keep(labels[1], b, operands)?;
        let tolerance = self.keep(labels[2], tolerance, operands)?;
        let op = |this: &mut Self, op, x: &Expr, y: &Expr| this.binary_op(op, x.clone(), y.clone(), span, Ty::Void);
        let equal = op(self, BinOp::Eq, &a, &b);
        let mut sides = Vec::new();
        for (high, low) in [(&a, &b), (&b, &a)] {
            // Where the difference of signed integers wraps it is negative, and larger than any tolerance.
            let above = op(self, BinOp::Ge, high, low);
            let difference = op(self, BinOp::Sub, high, low);
            let back = op(self, BinOp::Ge, &difference, &self.zero_of(&difference));
            let inside = op(self, BinOp::Le, &difference, &tolerance);
            let both = op(self, BinOp::And, &back, &inside);
            sides.push(op(self, BinOp::And, &above, &both));
        }
        let either = op(self, BinOp::Or, &sides[0], &sides[1]);
        Some(op(self, BinOp::Or, &equal, &either)).filter(|found| found.ty != Ty::Error)
    }

    fn zero_of(&self, value: &Expr) -> Expr {
        let zero = self.zero(value.ty).unwrap_or(Const::Int(0));
        Expr { kind: ExprKind::Const(zero), ty: value.ty, span: value.span }
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
        let ty = match ty {
            Ty::Str(length) => Ty::Str([80, 254, 4095].into_iter().find(|room| length <= *room).unwrap_or(length)),
            other => other,
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
                field: None,
            });
        }
        let name = test.hidden.get((var.0 as usize).saturating_sub(declared)).map(|var| var.name.clone()).unwrap_or_default();
        (Place { root: Root::Var(var), path: Vec::new(), ty, span }, name)
    }

    /// Two arrays or structures, value by value.
    fn all_equal(&mut self, a: &Expr, b: &Expr, span: Span) -> Option<Expr> {
        let (ExprKind::Load(a), ExprKind::Load(b)) = (&a.kind, &b.kind) else { return None };
        let (mut waiting, mut leaves) = (vec![((**a).clone(), (**b).clone())], Vec::new());
        while let Some((a, b)) = waiting.pop() {
            if leaves.len() + waiting.len() > MAX_COMPARED_VALUES {
                let message = format!("an assertion compares at most {MAX_COMPARED_VALUES} values; compare parts");
                self.an.report(&rules::ASSERTION, span, message);
                return None;
            }
            let (Ty::User(owner), Some(kind)) = (a.ty, self.an.types.kind(a.ty).cloned()) else {
                leaves.push((a, b));
                continue;
            };
            match kind {
                TyKind::Struct { fields } => {
                    for (at, field) in (0u32..).zip(fields.iter()) {
                        let part = |base: &Place| step(base.clone(), Step::Field(owner, at), field.ty, span);
                        waiting.push((part(&a), part(&b)));
                    }
                }
                TyKind::Array { element, dims } => {
                    for indices in elements(&dims)? {
                        let list: std::rc::Rc<[Expr]> = indices.iter().map(|index| constant(*index, DINT, span)).collect();
                        let part = |base: &Place| step(base.clone(), Step::Index(owner, list.clone()), element, span);
                        waiting.push((part(&a), part(&b)));
                        if waiting.len() > MAX_COMPARED_VALUES {
                            break;
                        }
                    }
                }
                _ => leaves.push((a, b)),
            }
        }
        let mut equal: Vec<Expr> = Vec::with_capacity(leaves.len());
        for (a, b) in leaves {
            equal.push(self.binary_op(BinOp::Eq, load(a, span), load(b, span), span, Ty::Void));
        }
        // In pairs, so that the tree stays low.
        while equal.len() > 1 {
            let mut rest = equal.into_iter();
            let mut paired = Vec::new();
            while let Some(a) = rest.next() {
                paired.push(match rest.next() {
                    Some(b) => self.binary_op(BinOp::And, a, b, span, Ty::Void),
                    None => a,
                });
            }
            equal = paired;
        }
        Some(equal.pop().unwrap_or_else(|| constant(1, BOOL, span))).filter(|found| found.ty != Ty::Error)
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
            if !matches!(found.ty, Ty::Str(_)) {
                let text = format!("a message is a STRING, not {}", self.an.types.name(found.ty));
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

    /// `ADVANCE_TIME(t)`: the variables that timers read move on.
    fn advance_time(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let given = self.only_arguments::<1>("ADVANCE_TIME", "a TIME or a number of nanoseconds", args, span)?;
        let found = self.expr(given[0], Ty::Elem(E::Lint));
        let found = self.settle(found, Ty::Elem(E::Lint));
        let elementary = self.an.types.elementary(found.ty).filter(|ty| !self.is_enum(found.ty) && (is_integer(*ty) || is_duration(*ty)));
        let Some(elementary) = elementary else {
            if found.ty != Ty::Error {
                let message = format!("time moves on by a TIME or an integer of nanoseconds, not {}", self.an.types.name(found.ty));
                self.an.report(&rules::ASSERTION, given[0].span, message);
            }
            return None;
        };
        if matches!(&found.kind, ExprKind::Const(Const::Int(value)) if widen(elementary, *value) < 0) {
            self.an.report(&rules::ASSERTION, given[0].span, "time only moves on");
            return None;
        }
        let (long, lint, ltime) = (Root::System(true), E::Lint, E::Ltime);
        let place = |root, ty| Place { root, path: Vec::new(), ty: Ty::Elem(ty), span };
        self.note_use(long, span);
        self.note_use(Root::System(false), span);
        let step = if is_duration(elementary) { found } else { self.convert(found, lint, false) };
        let step = self.convert(step, ltime, false);
        let now = load(place(long, ltime), span);
        let later = self.binary_op(BinOp::Add, now.clone(), step, span, Ty::Void);
        self.before(assign(place(long, ltime), later));
        // The other one shows whole milliseconds.
        let number = self.convert(now, lint, false);
        let unit = constant(super::NS_PER_MS, Ty::Elem(lint), span);
        let whole = self.binary_op(BinOp::Div, number, unit.clone(), span, Ty::Void);
        let whole = self.binary_op(BinOp::Mul, whole, unit, span, Ty::Void);
        let whole = self.convert(whole, ltime, false);
        let whole = self.convert(whole, E::Time, false);
        Some(assign(place(Root::System(false), E::Time), whole))
    }

    fn only_arguments<const N: usize>(&mut self, word: &str, what: &str, args: &'a [Arg], span: Span) -> Option<[&'a ast::Expr; N]> {
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

    /// The instance of a MOCK statement and its hidden field.
    fn mock_field(&mut self, given: &'a ast::Expr, field: &str) -> Option<Place> {
        let place = self.place(given)?;
        let Some((owner, _)) = self.block_of(place.ty) else {
            let message = format!("{} has no body to replace: an instance of a function block is mocked", self.an.types.name(place.ty));
            self.an.report(&rules::MOCK, given.span, message);
            return None;
        };
        self.hidden_field(place, owner, field)
    }

    fn hidden_field(&mut self, place: Place, owner: TyId, field: &str) -> Option<Place> {
        let fields = self.an.types.fields(place.ty).cloned()?;
        let Some(at) = fields.iter().position(|found| found.name == field) else {
            self.an.report(&rules::MOCK, place.span, "nothing in these files is mocked");
            return None;
        };
        let (ty, span) = (fields[at].ty, place.span);
        Some(step(place, Step::Field(owner, u32::try_from(at).unwrap_or(u32::MAX)), ty, span))
    }

    fn mock(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let given = self.only_arguments::<1>("MOCK", "an instance of a function block", args, span)?;
        let mocked = self.mock_field(given[0], desugar::MOCKED)?;
        let calls = self.mock_field(given[0], desugar::CALLS)?;
        self.before(assign(calls, constant(0, UDINT, span)));
        Some(assign(mocked, constant(1, BOOL, span)))
    }

    fn mock_function(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let given = self.only_arguments::<2>("MOCK_FUNCTION", "a function and the value it shall return", args, span)?;
        let ast::ExprKind::Name(function) = &given[0].kind else {
            self.an.report(&rules::MOCK, given[0].span, "MOCK_FUNCTION wants the name of a function");
            return None;
        };
        let name = self.an.text(function.symbol);
        let pou = self.an.pou_names.get(&function.symbol).and_then(|pou| self.an.pou_decls.get(pou.0 as usize));
        let is_function = pou.is_some_and(|pou| pou.kind == PouKind::Function);
        let global = |this: &Self, name: &str| {
            let symbol = this.an.ast.names.lookup_folded(name)?;
            let id = *this.environment?.get(&symbol)?;
            Some((Root::Global(id), this.root_type(Root::Global(id))))
        };
        let flag = global(self, &desugar::mocked_global(name));
        let value = global(self, &desugar::value_global(name));
        let (Some((flag, _)), Some((value, ty))) = (flag, value) else {
            let spelling = self.an.spelling(function);
            let message = if is_function {
                format!("`{spelling}` has no result that could be replaced")
            } else {
                format!("there is no FUNCTION `{spelling}` in these files")
            };
            let known: Vec<Symbol> = self.an.pou_decls.iter().filter(|pou| pou.kind == PouKind::Function).map(|pou| pou.name.symbol).collect();
            let known = known.into_iter().filter(|_| !is_function);
            self.an.report_unknown(&rules::MOCK, function, message, known);
            return None;
        };
        let found = self.expr_of(given[1], ty);
        if found.ty == Ty::Error {
            return None;
        }
        self.note_use(flag, span);
        self.note_use(value, span);
        let place = |root, ty| Place { root, path: Vec::new(), ty, span };
        self.before(assign(place(value, ty), found));
        Some(assign(place(flag, BOOL), constant(1, BOOL, span)))
    }

    fn verify_called(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
        const WORD: &str = "MOCK_VERIFY_CALLED";
        let (given, message) = self.test_arguments(WORD, &["INSTANCE"], args, span)?;
        let calls = self.mock_field(given[0], desugar::CALLS)?;
        let mut operands = Vec::new();
        let calls = load(calls, span);
        let calls = self.keep("calls", calls, &mut operands)?;
        operands.push(Operand { label: "expected", value: OperandValue::Text("at least 1") });
        let holds = self.binary_op(BinOp::Gt, calls, constant(0, UDINT, span), span, Ty::Void);
        self.require(WORD, holds, operands, message, span)
    }

    fn verify_call_count(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
        const WORD: &str = "MOCK_VERIFY_CALL_COUNT";
        let (given, message) = self.test_arguments(WORD, &["INSTANCE", "COUNT"], args, span)?;
        let calls = self.mock_field(given[0], desugar::CALLS)?;
        let wanted = self.expr(given[1], UDINT);
        let mut operands = Vec::new();
        let calls = load(calls, span);
        let holds = self.comparison(WORD, BinOp::Eq, ("calls", calls), ("expected", wanted), &mut operands, span)?;
        self.require(WORD, holds, operands, message, span)
    }
}

/// The indices of all elements, the last dimension fastest; `None` when there are more than can be compared.
fn elements(dims: &[(i32, i32)]) -> Option<Vec<Vec<i64>>> {
    let mut all: Vec<Vec<i64>> = vec![Vec::new()];
    for &(low, high) in dims {
        let mut longer = Vec::new();
        for indices in &all {
            for index in i64::from(low)..=i64::from(high) {
                if longer.len() > MAX_COMPARED_VALUES {
                    return Some(longer);
                }
                let mut indices = indices.clone();
                indices.push(index);
                longer.push(indices);
            }
        }
        all = longer;
    }
    Some(all)
}

/// Whether a name means something as a statement of a test.
pub(super) fn is_test_word(word: &str) -> bool {
    let other = ["ADVANCE_TIME", "MOCK", "MOCK_FUNCTION", "MOCK_VERIFY_CALLED", "MOCK_VERIFY_CALL_COUNT"];
    ASSERTIONS.iter().any(|row| row.word == word) || other.contains(&word)
}
