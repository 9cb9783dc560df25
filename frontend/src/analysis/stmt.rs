//! Statements.

use khz_bytecode::container::ElementaryType as E;
use khz_bytecode::value::IntegerType;

use super::expr::Checker;
use khz_bytecode::limits::MAX_LOOP_DEPTH;

use super::tree::{Call, CaseArm, Expr, ExprKind, ForStmt, Place, Step, Stmt, StmtKind, TextOp};
use super::types::{Const, DINT, Ty, TyKind, integer_type, is_bits, is_integer, limits, widen};
use crate::diagnostics::{Diagnostic, semantic as names, types as rules};
use crate::source::Span;
use crate::syntax::ast::{self, Block, CaseLabel};

/// How many missing values of an enumeration a message names.
const MAX_SHOWN_VALUES: usize = 5;

impl<'a> Checker<'_, 'a> {
    /// The statements of a block. What no way leads to is dropped, with a warning.
    pub(super) fn block(&mut self, block: &'a Block) -> Vec<Stmt> {
        let mut list = Vec::with_capacity(block.statements.len());
        let mut ended = false;
        let mut warned = false;
        for statement in &block.statements {
            let found = self.statement(statement);
            let mut before = self.take_pending();
            before.append(&mut self.pending);
            if ended {
                if !warned && !matches!(statement.kind, ast::StmtKind::Empty) {
                    self.an.report(&names::UNREACHABLE, statement.span, "nothing ever gets here");
                    warned = true;
                }
                continue;
            }
            if let Some(found) = found {
                list.extend(before);
                ended = matches!(found.kind, StmtKind::Return | StmtKind::Exit | StmtKind::Continue);
                list.push(found);
            }
        }
        list
    }

    fn statement(&mut self, statement: &'a ast::Stmt) -> Option<Stmt> {
        let span = statement.span;
        let kind = match &statement.kind {
            ast::StmtKind::Assign { target, value, .. } => return self.assign(target, value, span),
            ast::StmtKind::Call(expr) => return self.call_statement(expr).map(skip_when_disabled),
            ast::StmtKind::If { branches, otherwise } => StmtKind::If {
                branches: branches
                    .iter()
                    .map(|branch| {
                        let condition = self.condition(&branch.condition);
                        (condition, self.block(&branch.body))
                    })
                    .collect(),
                otherwise: otherwise.as_ref().map(|block| self.block(block)).unwrap_or_default(),
            },
            ast::StmtKind::Case { selector, arms, otherwise } => {
                return self.case(selector, arms, otherwise.as_ref(), span);
            }
            ast::StmtKind::For { variable, from, to, by, body, end_span } => {
                let control = self.control(variable);
                self.enter_loop(span);
                let body = self.block(body);
                self.loop_depth -= 1;
                return self.for_loop(control?, (from, to, by.as_deref()), body, span, *end_span);
            }
            ast::StmtKind::While { condition, body, end_span } => {
                self.enter_loop(span);
                let condition = self.condition(condition);
                let body = self.block(body);
                self.loop_depth -= 1;
                StmtKind::While { condition, body, end: *end_span }
            }
            ast::StmtKind::Repeat { body, until, .. } => {
                self.enter_loop(span);
                let body = self.block(body);
                let until = self.condition(until);
                self.loop_depth -= 1;
                StmtKind::Repeat { body, until }
            }
            ast::StmtKind::Exit | ast::StmtKind::Continue if self.loop_depth == 0 => {
                let found = Diagnostic::new(&names::OUTSIDE_LOOP, span, "EXIT and CONTINUE stand inside a loop");
                self.an.push(found.help("leave the program, function or function block with `RETURN`"));
                return None;
            }
            ast::StmtKind::Exit => StmtKind::Exit,
            ast::StmtKind::Continue => StmtKind::Continue,
            ast::StmtKind::Return => StmtKind::Return,
            ast::StmtKind::Empty | ast::StmtKind::Error => return None,
        };
        Some(Stmt { kind, span })
    }

    /// Counts a loop; the verifier takes no more than a fixed nesting of them.
    fn enter_loop(&mut self, span: Span) {
        self.loop_depth += 1;
        if self.loop_depth == u32::from(MAX_LOOP_DEPTH) + 1 {
            let message = format!("loops nest more than {MAX_LOOP_DEPTH} levels deep");
            self.an.report(&names::TOO_DEEP, span, message);
        }
    }

    fn assign(&mut self, target: &'a ast::Expr, value: &'a ast::Expr, span: Span) -> Option<Stmt> {
        let target = self.target(target);
        let want = target.as_ref().map_or(Ty::Void, |target| target.ty);
        let value = self.expr(value, want);
        let target = target?;
        let value = self.coerce(value, want);
        if value.ty == Ty::Error {
            return None;
        }
        Some(skip_when_disabled(Stmt { kind: StmtKind::Assign { target, value }, span }))
    }

    /// An assignment for connections of program instances.
    pub(super) fn assignment(&mut self, target: Place, value: Expr, span: Span) -> Option<Stmt> {
        let value = self.coerce(value, target.ty);
        (value.ty != Ty::Error).then_some(Stmt { kind: StmtKind::Assign { target, value }, span })
    }

    fn case(
        &mut self,
        selector: &'a ast::Expr,
        arms: &'a [ast::CaseArm],
        otherwise: Option<&'a Block>,
        span: Span,
    ) -> Option<Stmt> {
        let found = self.expr(selector, Ty::Void);
        let found = self.settle(found, Ty::Void);
        let elementary = self.an.types.elementary(found.ty).filter(|ty| is_integer(*ty) || is_bits(*ty));
        if elementary.is_none() && found.ty != Ty::Error {
            let message = format!("a CASE selects by an integer or enumeration, not {}", self.an.types.name(found.ty));
            self.an.report(&rules::SELECTOR, selector.span, message);
        }
        // What can not be selected by is reported once, not at each label again.
        let selected = if elementary.is_some() { found.ty } else { Ty::Error };
        let mut all: Vec<(i128, i128, Span)> = Vec::new();
        let mut list = Vec::with_capacity(arms.len());
        for arm in arms {
            let mut ranges = Vec::new();
            for label in &arm.labels {
                let (bounds, at) = match label {
                    CaseLabel::Value(value) => {
                        let bound = self.label(value, selected);
                        (bound.map(|bound| (bound, bound)), value.span)
                    }
                    CaseLabel::Range(range) => {
                        let (low, high) = (self.label(&range.low, selected), self.label(&range.high, selected));
                        (low.zip(high), range.span)
                    }
                };
                let Some((low, high)) = bounds else { continue };
                if low > high {
                    self.an.report(&rules::BOUNDS, at, format!("the range {low}..{high} is empty"));
                    continue;
                }
                ranges.push((low, high));
                all.push((low, high, at));
            }
            list.push(CaseArm { ranges, body: self.block(&arm.body) });
        }
        if otherwise.is_none() {
            self.note_missing_values(found.ty, &all, selector.span);
        }
        let otherwise = otherwise.map(|block| self.block(block)).unwrap_or_default();
        self.refuse_overlap(all);
        elementary?;
        Some(Stmt { kind: StmtKind::Case { selector: found, arms: list, otherwise }, span })
    }

    /// A CASE without ELSE on an enumeration does nothing for the values that no arm has.
    fn note_missing_values(&mut self, ty: Ty, arms: &[(i128, i128, Span)], span: Span) {
        let Some(TyKind::Enum { base, values, .. }) = self.an.types.kind(ty) else { return };
        let number = |value: i64| widen(*base, value);
        let has_arm = |value: i64| arms.iter().any(|(low, high, _)| (*low..=*high).contains(&number(value)));
        let missing: Vec<&str> =
            values.iter().filter(|value| !has_arm(value.2)).map(|value| value.1.as_str()).collect();
        // One arm for one of many values is an IF in other words.
        if missing.is_empty() || missing.len() * 2 > values.len() {
            return;
        }
        let shown =
            missing.iter().take(MAX_SHOWN_VALUES).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        let more = missing.len().saturating_sub(MAX_SHOWN_VALUES);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let found = Diagnostic::new(&names::MISSING_VALUES, span, format!("no arm for {shown}{more}"));
        self.an.push(found.help("say with ELSE what happens then; `ELSE ;` if nothing does"));
    }

    fn refuse_overlap(&mut self, mut all: Vec<(i128, i128, Span)>) {
        all.sort_by_key(|(low, high, span)| (*low, *high, span.start));
        let mut widest: Option<(i128, Span)> = None;
        for (low, high, span) in all {
            if let Some((_, first)) = widest.filter(|(end, _)| low <= *end) {
                let found = Diagnostic::new(&names::CASE_OVERLAP, span, format!("{low} is selected twice"));
                self.an.push(found.label(first, "first here"));
            }
            if widest.is_none_or(|(end, _)| high > end) {
                widest = Some((high, span));
            }
        }
    }

    fn label(&mut self, expr: &'a ast::Expr, ty: Ty) -> Option<i128> {
        let found = self.expr(expr, ty);
        if found.ty == Ty::Error || ty == Ty::Error {
            return None;
        }
        let base = self.an.types.without_range(ty);
        let found = if found.ty == Ty::IntLit && self.is_enum(ty) {
            // Numbers select enumeration values in vendors' code.
            let elementary = self.an.types.elementary(ty)?;
            self.literal(&found, elementary)
        } else {
            self.coerce(found, base)
        };
        match &found.kind {
            _ if found.ty == Ty::Error => None,
            ExprKind::Const(value) => self.number(ty, value),
            _ => {
                self.an.report(
                    &names::NOT_CONSTANT,
                    expr.span,
                    "a label of a CASE must be known when the program is compiled",
                );
                None
            }
        }
    }

    fn control(&mut self, variable: &'a ast::Expr) -> Option<Place> {
        let place = self.target(variable)?;
        let elementary = self.an.types.elementary(place.ty).filter(|ty| is_integer(*ty) || is_bits(*ty));
        let part = matches!(place.path.last(), Some(Step::Part(..)));
        if elementary.is_none() || part || matches!(self.an.types.kind(place.ty), Some(TyKind::Enum { .. })) {
            let message = format!("a FOR loop counts in an integer variable, not {}", self.an.types.name(place.ty));
            self.an.report(&rules::CONTROL, variable.span, message);
            return None;
        }
        // The loop's own reads and writes count as uses inside it.
        self.enter_loop(variable.span);
        self.note_use(place.root, variable.span);
        self.loop_depth -= 1;
        Some(place)
    }

    fn for_loop(
        &mut self,
        control: Place,
        (from, to, by): (&'a ast::Expr, &'a ast::Expr, Option<&'a ast::Expr>),
        body: Vec<Stmt>,
        span: Span,
        end: Span,
    ) -> Option<Stmt> {
        let elementary = self.an.types.elementary(control.ty)?;
        let plain = Ty::Elem(elementary);
        let from = self.expr_of(from, plain);
        let to = self.expr_of(to, plain);
        let wide = matches!(integer_type(elementary), Some(IntegerType::I64 | IntegerType::U64));
        let step_type = if wide { E::Lint } else { E::Dint };
        let by = match by {
            None => Expr { kind: ExprKind::Const(Const::Int(1)), ty: Ty::Elem(step_type), span: control.span },
            Some(by) => self.step_value(by, step_type),
        };
        if [&from, &to, &by].iter().any(|expr| expr.ty == Ty::Error) {
            return None;
        }
        if matches!(by.kind, ExprKind::Const(Const::Int(0))) {
            self.an.report(&names::ZERO_STEP, by.span, "a step of 0 always traps");
        }
        let found = ForStmt { control, from, to, by, body, end };
        Some(Stmt { kind: StmtKind::For(Box::new(found)), span })
    }

    fn step_value(&mut self, by: &'a ast::Expr, step_type: E) -> Expr {
        let found = self.expr(by, DINT);
        if found.ty == Ty::IntLit || found.ty == Ty::Error {
            return if found.ty == Ty::Error { found } else { self.literal(&found, step_type) };
        }
        match self.an.types.elementary(found.ty) {
            Some(ty) if (is_integer(ty) || is_bits(ty)) && !self.is_enum(found.ty) => {
                let (low, high) = limits(ty).unwrap_or((0, 0));
                let (least, most) = limits(step_type).unwrap_or((0, 0));
                if low < least || high > most {
                    let message = format!("the step is taken as {}", step_type.name());
                    self.an.report_vendor(&rules::SIGN_CHANGED, by.span, message);
                }
                self.convert(found, step_type, false)
            }
            _ => {
                let message = format!("a step is an integer, not {}", self.an.types.name(found.ty));
                self.an.report(&rules::CONTROL, by.span, message);
                Expr { ty: Ty::Error, ..found }
            }
        }
    }
}

/// A statement whose call has EN: with a FALSE EN neither the call nor the assignment of its result happens.
fn skip_when_disabled(stmt: Stmt) -> Stmt {
    let Stmt { mut kind, span } = stmt;
    let call = match &mut kind {
        StmtKind::Assign { value, .. } => assigned_call(value),
        StmtKind::Call(call) => Some(call.as_mut()),
        _ => None,
    };
    let Some(call) = call.filter(|call| call.en.is_some() || call.eno.is_some()) else { return Stmt { kind, span } };
    let (en, eno, is_given) = (call.en.take(), call.eno.take(), call.eno_is_given);
    Stmt { kind: guarded(en, eno.as_ref(), is_given, Stmt { kind, span }), span }
}

/// The call whose result is assigned. What converts or checks it by itself stands at the same place; a conversion that is written does not.
fn assigned_call(value: &mut Expr) -> Option<&mut Call> {
    let span = value.span;
    match &mut value.kind {
        ExprKind::Call(call) => Some(call),
        ExprKind::Convert { value: inner, .. } | ExprKind::Check(inner, ..) if inner.span == span => {
            assigned_call(inner)
        }
        // A CHAR where a STRING is wanted.
        ExprKind::Text(TextOp::FromCharacter, inner) => {
            inner.first_mut().filter(|inner| inner.span == span).and_then(assigned_call)
        }
        _ => None,
    }
}

fn guarded(en: Option<Expr>, eno: Option<&Place>, eno_is_given: bool, inner: Stmt) -> StmtKind {
    use super::types::BOOL;
    let span = inner.span;
    let set = |value: i64| {
        eno.cloned().map(|target| {
            let value = Expr { kind: ExprKind::Const(Const::Int(value)), ty: BOOL, span };
            Stmt { kind: StmtKind::Assign { target, value }, span }
        })
    };
    let condition = en.unwrap_or(Expr { kind: ExprKind::Const(Const::Int(1)), ty: BOOL, span });
    let mut body = vec![inner];
    body.extend(set(1).filter(|_| !eno_is_given));
    StmtKind::If { branches: vec![(condition, body)], otherwise: set(0).into_iter().collect() }
}
