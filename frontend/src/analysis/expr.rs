//! Expressions: from names and operators to typed operations.

use std::collections::BTreeMap;
use std::rc::Rc;

use khz_bytecode::container::ElementaryType as E;

use super::fold::{self, Unfolded};
use super::testing::TestBody;
use super::tree::{BinOp, Expr, ExprKind, GlobalId, PouId, PouInfo, Root, Stmt, UnOp, Usage};
use super::types::{BOOL, Const, Ty, TyKind, Value, is_bits, is_duration, is_integer, is_real, is_signed, is_unsigned};
use super::{Analyzer, ConstKey, TypeSource};
use crate::diagnostics::{Diagnostic, semantic as names, types as rules};
use crate::source::Span;
use crate::syntax::ast::{self, Ident, LiteralValue, TypeSpecKind};
use crate::syntax::symbol::Symbol;

/// Globals that a body sees, by name.
pub(super) type Environment = BTreeMap<Symbol, GlobalId>;

/// Checks expressions and statements of one body, or constant expressions of declarations.
pub(super) struct Checker<'c, 'a> {
    pub(super) an: &'c mut Analyzer<'a>,
    /// The unit whose names are visible.
    pub(super) pou: Option<PouId>,
    pub(super) info: Option<Rc<PouInfo>>,
    /// Globals of the resource; absent while declarations are resolved, when only constants have values.
    pub(super) environment: Option<&'c Environment>,
    pub(super) usage: Usage,
    pub(super) callees: BTreeMap<PouId, Span>,
    pub(super) loop_depth: u32,
    /// Present in the body of a test.
    pub(super) test: Option<Box<TestBody>>,
    /// Statements that come before the one that is being checked.
    pub(super) pending: Vec<Stmt>,
}

/// An expression that could not be understood; it was reported.
pub(super) fn broken(span: Span) -> Expr {
    Expr { kind: ExprKind::Const(Const::Int(0)), ty: Ty::Error, span }
}

impl<'c, 'a> Checker<'c, 'a> {
    /// For constant expressions in declarations.
    pub(super) fn declarations(an: &'c mut Analyzer<'a>, pou: Option<PouId>) -> Self {
        Checker {
            an,
            pou,
            info: None,
            environment: None,
            usage: Usage::default(),
            callees: BTreeMap::new(),
            loop_depth: 0,
            test: None,
            pending: Vec::new(),
        }
    }

    /// For the body of a unit, with the globals that it sees.
    pub(super) fn body(an: &'c mut Analyzer<'a>, pou: Option<PouId>, environment: &'c Environment) -> Self {
        let info = pou.and_then(|pou| an.info(pou));
        let test = an.test_body(pou);
        Checker {
            an,
            pou,
            info,
            environment: Some(environment),
            usage: Usage::default(),
            callees: BTreeMap::new(),
            loop_depth: 0,
            test,
            pending: Vec::new(),
        }
    }

    /// Whether only constants have values here.
    pub(super) fn is_constant_context(&self) -> bool {
        self.environment.is_none()
    }

    /// The value of a constant expression, of type `want` unless that is [`Ty::Void`]. `None`: it was reported.
    pub(super) fn constant(&mut self, expr: &'a ast::Expr, want: Ty) -> Option<(Ty, Const)> {
        let found = self.expr(expr, want);
        let found = if want == Ty::Void { found } else { self.coerce(found, want) };
        match (found.kind, found.ty) {
            (_, Ty::Error) => None,
            (ExprKind::Const(value), ty) => Some((ty, value)),
            _ => {
                self.an.report(
                    &names::NOT_CONSTANT,
                    expr.span,
                    "the value here must be known when the program is compiled",
                );
                None
            }
        }
    }

    /// An expression of type `to`.
    pub(super) fn expr_of(&mut self, expr: &'a ast::Expr, to: Ty) -> Expr {
        let found = self.expr(expr, to);
        self.coerce(found, to)
    }

    /// A condition.
    pub(super) fn condition(&mut self, expr: &'a ast::Expr) -> Expr {
        let found = self.expr(expr, BOOL);
        if found.ty == BOOL || found.ty == Ty::Error {
            return found;
        }
        let message = format!("a condition is a BOOL, not {}", self.an.types.name(found.ty));
        self.an.push(Diagnostic::new(&rules::CONDITION, expr.span, message).help("compare it: `value <> 0`"));
        broken(expr.span)
    }

    /// An expression; `want` is the type that its place would like, [`Ty::Void`] if any will do.
    pub(super) fn expr(&mut self, expr: &'a ast::Expr, want: Ty) -> Expr {
        let span = expr.span;
        match &expr.kind {
            ast::ExprKind::Literal(literal) => {
                let found = self.literal_expr(literal, span);
                self.as_character(found, want)
            }
            ast::ExprKind::EnumValue { ty, value } => self.enum_value(ty, value, span),
            ast::ExprKind::Name(name) => self.name(expr, name, want),
            ast::ExprKind::Member { base, member } if self.list_of(base).is_some() => {
                self.listed_value(expr, base, member)
            }
            ast::ExprKind::Member { base, member } if self.names_enumeration(base).is_some() => {
                self.names_enumeration(base).map_or_else(|| broken(span), |ty| self.enum_value(ty, member, span))
            }
            ast::ExprKind::Direct(_)
            | ast::ExprKind::Member { .. }
            | ast::ExprKind::Index { .. }
            | ast::ExprKind::Deref { .. }
            | ast::ExprKind::Part { .. } => self.load(expr),
            ast::ExprKind::Call { callee, args } => self.call_expr(expr, callee, args, want),
            ast::ExprKind::Unary { op, operand, .. } => self.unary(*op, operand, span, want),
            ast::ExprKind::Binary { op, lhs, rhs, .. } => self.binary(*op, lhs, rhs, span, want),
            ast::ExprKind::Error => broken(span),
        }
    }

    fn literal_expr(&mut self, literal: &ast::Literal, span: Span) -> Expr {
        let (value, ty) = match &literal.value {
            LiteralValue::Int { negative, magnitude, .. } => {
                let value = i128::from(*magnitude);
                (Const::Wide(if *negative { -value } else { value }), Ty::IntLit)
            }
            LiteralValue::Real { value, value_f32 } => (Const::Lit(*value, *value_f32), Ty::RealLit),
            LiteralValue::Bool(value) => (Const::Int(i64::from(*value)), BOOL),
            LiteralValue::Time { long, value_ns } => {
                (Const::Int(*value_ns), Ty::Elem(if *long { E::Ltime } else { E::Time }))
            }
            LiteralValue::String(text) => match self.text_length(text.len(), span) {
                Some(length) => (Const::Str(text.as_slice().into()), Ty::Str(length)),
                None => return broken(span),
            },
            LiteralValue::WString(units) => match self.text_length(units.len(), span) {
                Some(length) => (Const::WStr(units.as_slice().into()), Ty::WStr(length)),
                None => return broken(span),
            },
            LiteralValue::Date { long, value_ns } => {
                (Const::Int(*value_ns), Ty::Elem(if *long { E::Ldate } else { E::Date }))
            }
            LiteralValue::TimeOfDay { long, value_ns } => {
                (Const::Int(*value_ns), Ty::Elem(if *long { E::LtimeOfDay } else { E::TimeOfDay }))
            }
            LiteralValue::DateAndTime { long, value_ns } => {
                (Const::Int(*value_ns), Ty::Elem(if *long { E::LdateAndTime } else { E::DateAndTime }))
            }
        };
        let found = Expr { kind: ExprKind::Const(value), ty, span };
        let Some(prefix) = &literal.ty else { return found };
        let (to, _) = self.an.resolve_type_name(prefix);
        match (found.ty, to) {
            (_, Ty::Error) => broken(span),
            (Ty::IntLit | Ty::RealLit | Ty::Str(_) | Ty::WStr(_), _) => self.coerce(found, to),
            _ if found.ty == to => found,
            _ => self.coerce(found, to),
        }
    }

    /// The enumeration that `Colour` in `Colour.red` names, where no variable has that name.
    fn names_enumeration<'e>(&mut self, base: &'e ast::Expr) -> Option<&'e Ident> {
        let ast::ExprKind::Name(name) = &base.kind else { return None };
        let is_enumeration = match self.an.type_names.get(&name.symbol)?.source {
            TypeSource::Declared(decl) => match &decl.spec.kind {
                TypeSpecKind::Enum { .. } => true,
                // Another name for one.
                TypeSpecKind::Named(_) => {
                    let ty = self.an.named_type(name.symbol, name.span).0;
                    self.is_enum(ty)
                }
                _ => false,
            },
            TypeSource::Block(_) => false,
        };
        (is_enumeration && self.find_variable(name.symbol).is_none()).then_some(name)
    }

    fn enum_value(&mut self, ty: &Ident, value: &Ident, span: Span) -> Expr {
        let (found, _) = self.an.resolve_type_name(ty);
        if found == Ty::Error || value.is_missing() {
            return broken(span);
        }
        let Some(TyKind::Enum { values, .. }) = self.an.types.kind(found).cloned() else {
            let message = format!("{} is no enumeration", self.an.types.name(found));
            self.an.report(&rules::MISMATCH, ty.span, message);
            return broken(span);
        };
        match values.iter().find(|entry| entry.0 == value.symbol) {
            Some(entry) => Expr { kind: ExprKind::Const(Const::Int(entry.2)), ty: found, span },
            None => {
                let message = format!("{} has no value `{}`", self.an.types.name(found), self.an.spelling(value));
                let known: Vec<Symbol> = values.iter().map(|entry| entry.0).collect();
                self.an.report_unknown(&names::UNKNOWN_MEMBER, value, message, known.into_iter());
                broken(span)
            }
        }
    }

    fn name(&mut self, expr: &'a ast::Expr, name: &Ident, want: Ty) -> Expr {
        let span = expr.span;
        if name.is_missing() {
            return broken(span);
        }
        if self.is_constant_context() {
            return self.constant_name(name, span, want);
        }
        if let Some(root) = self.find_variable(name.symbol) {
            if let Some((ty, value)) = self.constant_value(root) {
                self.note_use(root, span);
                return Expr { kind: ExprKind::Const(value), ty, span };
            }
            return self.load(expr);
        }
        if let Some(found) = self.enumerator(name, want, span) {
            return found;
        }
        self.load(expr)
    }

    fn constant_name(&mut self, name: &Ident, span: Span, want: Ty) -> Expr {
        let mut found = self.pou.and_then(|pou| self.an.constant_of(ConstKey::Named(Some(pou), name.symbol), span));
        if found.is_none() {
            found = self.an.constant_of(ConstKey::Named(None, name.symbol), span);
        }
        match found {
            Some((Ty::Error, _)) => return broken(span),
            Some((ty, Value::Scalar(value))) => return Expr { kind: ExprKind::Const(value), ty, span },
            Some((ty, Value::Zero)) => {
                if let Some(value) = self.zero(ty) {
                    return Expr { kind: ExprKind::Const(value), ty, span };
                }
            }
            Some(_) => {}
            None => {
                if let Some(found) = self.enumerator(name, want, span) {
                    return found;
                }
                if !self.an.global_names.contains_key(&name.symbol) && !self.declares(name.symbol) {
                    self.unknown_name(name);
                    return broken(span);
                }
            }
        }
        let message = format!("`{}` is no constant", self.an.spelling(name));
        self.an.report(&names::NOT_CONSTANT, span, message);
        broken(span)
    }

    /// `LIST.x`: the value of a variable of a global variable list.
    fn listed_value(&mut self, expr: &'a ast::Expr, base: &'a ast::Expr, member: &Ident) -> Expr {
        let span = expr.span;
        let Some(global) = self.list_of(base).and_then(|list| list.get(&member.symbol)).copied() else {
            return self.load(expr);
        };
        let root = Root::Global(global);
        if self.is_constant_context() {
            return match self.an.constant_of(ConstKey::Listed(global), span) {
                Some((Ty::Error, _)) => broken(span),
                Some((ty, Value::Scalar(value))) => Expr { kind: ExprKind::Const(value), ty, span },
                Some((ty, Value::Zero)) if self.zero(ty).is_some() => {
                    let value = self.zero(ty).unwrap_or(Const::Int(0));
                    Expr { kind: ExprKind::Const(value), ty, span }
                }
                _ => self.load(expr),
            };
        }
        match self.constant_value(root) {
            Some((ty, value)) => {
                self.note_use(root, span);
                Expr { kind: ExprKind::Const(value), ty, span }
            }
            None => self.load(expr),
        }
    }

    /// Whether the unit declares this name, as anything.
    fn declares(&self, symbol: Symbol) -> bool {
        let Some(pou) = self.pou.and_then(|pou| self.an.pou_decls.get(pou.0 as usize)) else { return false };
        let mut declared = pou.sections.iter().flat_map(|section| &section.decls).flat_map(|decl| &decl.names);
        declared.any(|name| name.symbol == symbol)
    }

    /// The constant zero of a scalar or string type.
    pub(super) fn zero(&self, ty: Ty) -> Option<Const> {
        match (ty, self.an.types.elementary(ty)) {
            (Ty::Str(_), _) => Some(Const::Str(Rc::new([]))),
            (Ty::WStr(_), _) => Some(Const::WStr(Rc::new([]))),
            (_, Some(E::Real)) => Some(Const::F32(0.0)),
            (_, Some(E::Lreal)) => Some(Const::F64(0.0)),
            (_, Some(_)) => Some(Const::Int(0)),
            _ => None,
        }
    }

    /// Type and value of a scalar or string CONSTANT.
    pub(super) fn constant_value(&self, root: Root) -> Option<(Ty, Const)> {
        let (ty, constant, init) = match root {
            Root::Var(var) => {
                let var = self.info.as_ref()?.vars.get(var.0 as usize)?;
                (var.ty, var.constant && var.located.is_none(), &var.init)
            }
            Root::Global(global) => {
                let global = self.an.globals.get(global.0 as usize)?;
                (global.ty, global.constant && global.located.is_none(), &global.init)
            }
            _ => return None,
        };
        match init {
            Value::Scalar(value) if constant => Some((ty, value.clone())),
            Value::Zero if constant => self.zero(ty).map(|value| (ty, value)),
            _ => None,
        }
    }

    /// An enumeration value by its bare name.
    fn enumerator(&mut self, name: &Ident, want: Ty, span: Span) -> Option<Expr> {
        let owners = self.an.enum_owners.get(&name.symbol).cloned().unwrap_or_default();
        let mut candidates: Vec<Ty> = owners.into_iter().map(|owner| self.an.named_type(owner, span).0).collect();
        if let Some(nameless) = self.an.nameless_enums.get(&name.symbol) {
            candidates.extend(nameless.iter().map(|id| Ty::User(*id)));
        }
        let mut found: Vec<(Ty, i64)> = Vec::new();
        for ty in candidates {
            if let Some(TyKind::Enum { values, .. }) = self.an.types.kind(ty) {
                let value = values.iter().find(|value| value.0 == name.symbol).map(|value| value.2);
                found.extend(value.map(|value| (ty, value)));
            }
        }
        if let Some(wanted) = found.iter().find(|(ty, _)| *ty == want) {
            found = vec![*wanted];
        }
        match found.as_slice() {
            [] => None,
            [(ty, value)] => Some(Expr { kind: ExprKind::Const(Const::Int(*value)), ty: *ty, span }),
            _ => {
                let message = format!("several enumerations have a value `{}`; write Type#{0}", self.an.spelling(name));
                self.an.report(&names::AMBIGUOUS_NAME, span, message);
                Some(broken(span))
            }
        }
    }

    fn unary(&mut self, op: ast::UnaryOp, operand: &'a ast::Expr, span: Span, want: Ty) -> Expr {
        let mut found = self.expr(operand, want);
        if let (ast::UnaryOp::Not, Ty::IntLit, Some(ty)) = (op, found.ty, self.an.types.elementary(want)) {
            // How many bits NOT turns over, the place says.
            found = self.literal(&found, ty);
        }
        if found.ty == Ty::Error {
            return broken(span);
        }
        let elementary = self.an.types.elementary(found.ty).filter(|_| !self.is_enum(found.ty));
        let (kind, allowed) = match op {
            ast::UnaryOp::Plus => {
                let fits = matches!(found.ty, Ty::IntLit | Ty::RealLit)
                    || elementary.is_some_and(|ty| is_integer(ty) || is_real(ty) || is_duration(ty));
                if fits {
                    return found;
                }
                (UnOp::Neg, false)
            }
            ast::UnaryOp::Neg => {
                let fits = matches!(found.ty, Ty::IntLit | Ty::RealLit)
                    || elementary.is_some_and(|ty| is_integer(ty) || is_real(ty) || is_duration(ty));
                (UnOp::Neg, fits)
            }
            ast::UnaryOp::Not => {
                let found_bits = elementary.is_some_and(|ty| ty == E::Bool || is_bits(ty) || is_integer(ty));
                (UnOp::Not, found_bits)
            }
        };
        if !allowed {
            let message = format!("{} is not defined for {}", op.text(), self.an.types.name(found.ty));
            self.an.report(&rules::OPERATOR, span, message);
            return broken(span);
        }
        if let (UnOp::Not, Some(ty)) = (kind, elementary)
            && is_integer(ty)
        {
            self.an.report_vendor(&rules::BIT_ARITHMETIC, span, format!("NOT works on the bits of {}", ty.name()));
        }
        self.unary_op(kind, found, span)
    }

    pub(super) fn is_enum(&self, ty: Ty) -> bool {
        matches!(self.an.types.kind(ty), Some(TyKind::Enum { .. }))
    }

    /// Builds an operation with one operand, folded when it is known.
    pub(super) fn unary_op(&mut self, op: UnOp, value: Expr, span: Span) -> Expr {
        let ty = self.an.types.without_range(value.ty);
        if let ExprKind::Const(known) = &value.kind
            && let Some(folded) = fold::unary(op, self.an.types.elementary(ty), known)
        {
            return Expr { kind: ExprKind::Const(folded), ty, span };
        }
        Expr { kind: ExprKind::Unary(op, Box::new(value)), ty, span }
    }

    fn binary(&mut self, op: ast::BinaryOp, lhs: &'a ast::Expr, rhs: &'a ast::Expr, span: Span, want: Ty) -> Expr {
        let op = operator(op);
        // What the place wants says nothing about the operands of a comparison, but its operands tell each other.
        let hint = if op.is_comparison() { Ty::Void } else { want };
        let mut a = self.expr(lhs, hint);
        let b = self.expr(rhs, if self.is_enum(a.ty) { a.ty } else { hint });
        if op.is_comparison()
            && self.is_enum(b.ty)
            && b.ty != a.ty
            && let ast::ExprKind::Name(_) = lhs.kind
            && matches!(a.kind, ExprKind::Const(_))
        {
            a = self.expr(lhs, b.ty);
        }
        self.binary_op(op, a, b, span, want)
    }

    /// Builds an operation with two operands.
    pub(super) fn binary_op(&mut self, op: BinOp, a: Expr, b: Expr, span: Span, want: Ty) -> Expr {
        if a.ty == Ty::Error || b.ty == Ty::Error {
            return broken(span);
        }
        if op == BinOp::Pow {
            return self.power(a, b, span, want);
        }
        if let Some(found) = self.moment_op(op, &a, &b, span).or_else(|| self.duration_op(op, &a, &b, span)) {
            return found;
        }
        let (x, y) = (a.ty, b.ty);
        let Some((a, b, ty)) = self.unify(a, b, span, want) else { return self.no_operator(op, x, y, span) };
        if matches!(ty, Ty::IntLit | Ty::RealLit) {
            let (ExprKind::Const(x), ExprKind::Const(y)) = (&a.kind, &b.kind) else { return broken(span) };
            return match fold::literals(op, x, y) {
                Ok(value) => {
                    let ty = if op.is_comparison() { BOOL } else { ty };
                    Expr { kind: ExprKind::Const(value), ty, span }
                }
                Err(why) => self.unfolded(why, op, a.ty, b.ty, span).unwrap_or_else(|| broken(span)),
            };
        }
        if !self.has_operator(op, ty) {
            return self.no_operator(op, x, y, span);
        }
        self.warn_bit_arithmetic(op, ty, span);
        let result = if op.is_comparison() { BOOL } else { ty };
        if let (ExprKind::Const(x), ExprKind::Const(y), Some(elementary)) =
            (&a.kind, &b.kind, self.an.types.elementary(ty).or(ty.character()))
        {
            match fold::binary(op, elementary, x, y) {
                Ok(value) => return Expr { kind: ExprKind::Const(value), ty: result, span },
                Err(why) => {
                    if let Some(found) = self.unfolded(why, op, a.ty, b.ty, span) {
                        return found;
                    }
                }
            }
        }
        if matches!(op, BinOp::Div | BinOp::Mod) && matches!(b.kind, ExprKind::Const(Const::Int(0))) {
            self.an.report(&rules::DIVISION_BY_ZERO, span, "this always divides by zero");
        }
        Expr { kind: ExprKind::Binary(op, Box::new(a), Box::new(b)), ty: result, span }
    }

    fn unfolded(&mut self, why: Unfolded, op: BinOp, a: Ty, b: Ty, span: Span) -> Option<Expr> {
        match why {
            Unfolded::DivideByZero => {
                self.an.report(&rules::DIVISION_BY_ZERO, span, "this always divides by zero");
                Some(broken(span))
            }
            Unfolded::Overflow => {
                self.an.report(&rules::LITERAL_RANGE, span, "the value is beyond every integer type");
                Some(broken(span))
            }
            Unfolded::Unknown if matches!(a, Ty::IntLit | Ty::RealLit) => Some(self.no_operator(op, a, b, span)),
            Unfolded::Unknown => None,
        }
    }

    fn no_operator(&mut self, op: BinOp, a: Ty, b: Ty, span: Span) -> Expr {
        let (x, y) = (self.an.types.name(a), self.an.types.name(b));
        let mut found =
            Diagnostic::new(&rules::OPERATOR, span, format!("{} is not defined for {x} and {y}", op.text()));
        let text = |ty| matches!(ty, Ty::Str(_));
        found.help = match op {
            BinOp::Add if text(a) && text(b) => Some("join strings with `CONCAT(a, b)`"),
            _ if text(a) != text(b) => Some("convert one of them, with `INT_TO_STRING` or `STRING_TO_INT` for example"),
            _ if op.is_comparison() && (a == BOOL) != (b == BOOL) => Some("compare two by two: `a < b AND b < c`"),
            _ if (a == BOOL) != (b == BOOL) => Some("convert the BOOL: `BOOL_TO_INT(…)`"),
            _ => None,
        }
        .map(str::to_owned);
        self.an.push(found);
        broken(span)
    }

    fn has_operator(&self, op: BinOp, ty: Ty) -> bool {
        if op.is_comparison() || matches!(op, BinOp::Min | BinOp::Max) {
            let equality = matches!(op, BinOp::Eq | BinOp::Ne);
            return ty.is_text() || self.an.types.elementary(ty).is_some() || (equality && ty == Ty::Error);
        }
        let Some(elementary) = self.an.types.elementary(ty) else { return false };
        if self.is_enum(ty) {
            return false;
        }
        let integer = is_integer(elementary) || is_bits(elementary);
        match op {
            BinOp::Add | BinOp::Sub => integer || is_real(elementary) || is_duration(elementary),
            BinOp::Mul | BinOp::Div => integer || is_real(elementary),
            BinOp::Mod => integer,
            BinOp::And | BinOp::Or | BinOp::Xor => integer || elementary == E::Bool,
            BinOp::AndThen | BinOp::OrElse => elementary == E::Bool,
            BinOp::Atan2 => is_real(elementary),
            _ => true,
        }
    }

    fn warn_bit_arithmetic(&mut self, op: BinOp, ty: Ty, span: Span) {
        let Some(elementary) = self.an.types.elementary(ty) else { return };
        let arithmetic = matches!(op, BinOp::Add | BinOp::Sub | BinOp::Mul | BinOp::Div | BinOp::Mod);
        let logical = matches!(op, BinOp::And | BinOp::Or | BinOp::Xor);
        if (arithmetic && is_bits(elementary)) || (logical && (is_signed(elementary) || is_unsigned(elementary))) {
            let message = format!("{} on {} is a vendor's extension", op.text(), elementary.name());
            self.an.report_vendor(&rules::BIT_ARITHMETIC, span, message);
        }
    }

    /// Durations times and by numbers (IEC 61131-3 table 30).
    fn duration_op(&mut self, op: BinOp, a: &Expr, b: &Expr, span: Span) -> Option<Expr> {
        let duration = |this: &Self, ty| this.an.types.elementary(ty).is_some_and(is_duration);
        let (left, right) = (duration(self, a.ty), duration(self, b.ty));
        if left == right || !matches!(op, BinOp::Mul | BinOp::Div) || (right && op == BinOp::Div) {
            return None;
        }
        let (time, number) = if left { (a.clone(), b.clone()) } else { (b.clone(), a.clone()) };
        let ty = time.ty;
        let number = self.settle(number, Ty::Elem(E::Lint));
        let elementary = self.an.types.elementary(number.ty).filter(|_| !self.is_enum(number.ty))?;
        if !is_integer(elementary) && !is_real(elementary) {
            return None;
        }
        let number = if is_real(elementary) {
            self.convert(number, E::Lreal, false)
        } else if elementary == E::Ulint {
            number
        } else {
            self.convert(number, E::Lint, false)
        };
        if let (ExprKind::Const(Const::Int(x)), ExprKind::Const(Const::Int(y))) = (&time.kind, &number.kind) {
            match fold::binary(op, E::Lint, &Const::Int(*x), &Const::Int(*y)) {
                Ok(value) => return Some(Expr { kind: ExprKind::Const(value), ty, span }),
                Err(why) => {
                    if let Some(found) = self.unfolded(why, op, ty, ty, span) {
                        return Some(found);
                    }
                }
            }
        }
        // The duration stands left, whichever way it was written: both sides have been evaluated in order.
        let kind = if left {
            ExprKind::Binary(op, Box::new(time), Box::new(number))
        } else {
            ExprKind::Binary(op, Box::new(number), Box::new(time))
        };
        Some(Expr { kind, ty, span })
    }

    fn power(&mut self, a: Expr, b: Expr, span: Span, want: Ty) -> Expr {
        let (x, y) = (a.ty, b.ty);
        let real = |this: &Self, ty| ty == Ty::RealLit || this.an.types.elementary(ty).is_some_and(is_real);
        let number = |this: &Self, ty| {
            real(this, ty)
                || ty == Ty::IntLit
                || this.an.types.elementary(ty).is_some_and(is_integer) && !this.is_enum(ty)
        };
        if !number(self, x) || !number(self, y) {
            return self.no_operator(BinOp::Pow, x, y, span);
        }
        let narrow = |this: &Self, ty| this.an.types.elementary(ty) == Some(E::Real);
        let any_lreal = [x, y].iter().any(|ty| self.an.types.elementary(*ty) == Some(E::Lreal));
        let to =
            if !any_lreal && (narrow(self, x) || narrow(self, y) || narrow(self, want)) { E::Real } else { E::Lreal };
        let bring = |this: &mut Self, expr: Expr| {
            if matches!(expr.ty, Ty::IntLit | Ty::RealLit) {
                this.literal(&expr, to)
            } else {
                this.convert(expr, to, false)
            }
        };
        let a = bring(self, a);
        let b = bring(self, b);
        if let (ExprKind::Const(x), ExprKind::Const(y)) = (&a.kind, &b.kind)
            && let Ok(folded) = fold::binary(BinOp::Pow, to, x, y)
        {
            return Expr { kind: ExprKind::Const(folded), ty: Ty::Elem(to), span };
        }
        Expr { kind: ExprKind::Binary(BinOp::Pow, Box::new(a), Box::new(b)), ty: Ty::Elem(to), span }
    }
}

fn operator(op: ast::BinaryOp) -> BinOp {
    match op {
        ast::BinaryOp::Power => BinOp::Pow,
        ast::BinaryOp::Mul => BinOp::Mul,
        ast::BinaryOp::Div => BinOp::Div,
        ast::BinaryOp::Mod => BinOp::Mod,
        ast::BinaryOp::Add => BinOp::Add,
        ast::BinaryOp::Sub => BinOp::Sub,
        ast::BinaryOp::Less => BinOp::Lt,
        ast::BinaryOp::Greater => BinOp::Gt,
        ast::BinaryOp::LessEqual => BinOp::Le,
        ast::BinaryOp::GreaterEqual => BinOp::Ge,
        ast::BinaryOp::Equal => BinOp::Eq,
        ast::BinaryOp::NotEqual => BinOp::Ne,
        ast::BinaryOp::And => BinOp::And,
        ast::BinaryOp::Xor => BinOp::Xor,
        ast::BinaryOp::Or => BinOp::Or,
        ast::BinaryOp::AndThen => BinOp::AndThen,
        ast::BinaryOp::OrElse => BinOp::OrElse,
    }
}
