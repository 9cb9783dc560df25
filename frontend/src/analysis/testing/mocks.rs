//! What a test does to the world of what it tests: time that moves on, bodies that do not run.

use khz_bytecode::container::ElementaryType as E;

use super::{UDINT, assign, constant, load};
use crate::analysis::NS_PER_MS;
use crate::analysis::expr::Checker;
use crate::analysis::place::step;
use crate::analysis::tree::{BinOp, ExprKind, Place, Root, Step, Stmt};
use crate::analysis::types::{BOOL, Const, Ty, TyId, is_duration, is_integer, widen};
use crate::diagnostics::semantic as rules;
use crate::source::Span;
use crate::syntax::ast::{self, Arg, PouKind};
use crate::syntax::symbol::Symbol;
use crate::testing::{Operand, OperandValue, desugar};

impl<'a> Checker<'_, 'a> {
    /// `ADVANCE_TIME(t)`: the variables that timers read move on.
    pub(super) fn advance_time(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let given = self.only_arguments::<1>("ADVANCE_TIME", "a TIME or a number of nanoseconds", args, span)?;
        let found = self.expr(given[0], Ty::Elem(E::Lint));
        let found = self.settle(found, Ty::Elem(E::Lint));
        let elementary = self
            .an
            .types
            .elementary(found.ty)
            .filter(|ty| !self.is_enum(found.ty) && (is_integer(*ty) || is_duration(*ty)));
        let Some(elementary) = elementary else {
            if found.ty != Ty::Error {
                let message = format!(
                    "time moves on by a TIME or an integer of nanoseconds, not {}",
                    self.an.types.name(found.ty)
                );
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
        let unit = constant(NS_PER_MS, Ty::Elem(lint), span);
        let whole = self.binary_op(BinOp::Div, number, unit.clone(), span, Ty::Void);
        let whole = self.binary_op(BinOp::Mul, whole, unit, span, Ty::Void);
        let whole = self.convert(whole, ltime, false);
        let whole = self.convert(whole, E::Time, false);
        Some(assign(place(Root::System(false), E::Time), whole))
    }

    /// The instance of a MOCK statement and its hidden field.
    fn mock_field(&mut self, given: &'a ast::Expr, field: &str) -> Option<Place> {
        let place = self.place(given)?;
        let Some((owner, _)) = self.block_of(place.ty) else {
            let message = format!(
                "{} has no body to replace: an instance of a function block is mocked",
                self.an.types.name(place.ty)
            );
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

    pub(super) fn mock(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let given = self.only_arguments::<1>("MOCK", "an instance of a function block", args, span)?;
        let mocked = self.mock_field(given[0], desugar::MOCKED)?;
        let calls = self.mock_field(given[0], desugar::CALLS)?;
        self.before(assign(calls, constant(0, UDINT, span)));
        Some(assign(mocked, constant(1, BOOL, span)))
    }

    pub(super) fn mock_function(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let given =
            self.only_arguments::<2>("MOCK_FUNCTION", "a function and the value it shall return", args, span)?;
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
            let known: Vec<Symbol> = self
                .an
                .pou_decls
                .iter()
                .filter(|pou| pou.kind == PouKind::Function)
                .map(|pou| pou.name.symbol)
                .collect();
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

    pub(super) fn verify_called(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
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

    pub(super) fn verify_call_count(&mut self, args: &'a [Arg], span: Span) -> Option<Stmt> {
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
