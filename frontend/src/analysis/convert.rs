//! Conversions: which happen by themselves (IEC 61131-3 figure 12), which with a warning, which not; and common types.

use khz_bytecode::container::ElementaryType as E;

use super::expr::Checker;
use super::fold;
use super::tree::{BinOp, Expr, ExprKind};
use super::types::{
    Const, Ty, TyKind, integer_type, is_bits, is_character, is_integer, is_real, is_signed, is_time, limits, long_form,
    widen, wrap,
};
use crate::diagnostics::{Rule, types as rules};
use crate::source::Span;

/// What stands between two types.
#[derive(Debug, Clone, Copy)]
pub(super) enum Way {
    /// The standard converts.
    Standard,
    /// Vendors convert; the rule says what may go wrong.
    Vendor(&'static Rule),
    /// Nobody converts.
    None,
}

/// How a value of one elementary type becomes one of another by itself.
pub(super) fn implicit(from: E, to: E) -> Way {
    if from == to {
        return Way::Standard;
    }
    let bits = |ty: E| ty.storage().bytes() * 8;
    match (from, to) {
        (E::Real, E::Lreal) => Way::Standard,
        _ if long_form(from) == Some(to) => Way::Standard,
        (E::Lreal, E::Real) => Way::Vendor(&rules::REAL_NARROWED),
        _ if from == E::Bool && is_bits(to) => Way::Standard,
        _ if is_bits(from) && is_bits(to) => {
            if bits(from) < bits(to) {
                Way::Standard
            } else {
                Way::Vendor(&rules::NARROWED)
            }
        }
        _ if is_integer(from) && is_integer(to) => {
            let ((low, high), (least, most)) = (limits(from).unwrap_or((0, 0)), limits(to).unwrap_or((0, 0)));
            if low >= least && high <= most {
                Way::Standard
            } else if bits(from) > bits(to) {
                Way::Vendor(&rules::NARROWED)
            } else {
                Way::Vendor(&rules::SIGN_CHANGED)
            }
        }
        _ if is_integer(from) && is_real(to) => {
            let exact = if to == E::Real { 16 } else { 32 };
            if bits(from) <= exact { Way::Standard } else { Way::Vendor(&rules::PRECISION) }
        }
        _ if (is_integer(from) && is_bits(to)) || (is_bits(from) && is_integer(to)) => {
            Way::Vendor(&rules::BITS_AND_INTEGER)
        }
        _ => Way::None,
    }
}

/// The type in which two integers or bit strings meet.
fn common_integer(a: E, b: E) -> Option<(E, Option<&'static Rule>)> {
    let bits = |ty: E| ty.storage().bytes() * 8;
    if a == b {
        return Some((a, None));
    }
    if is_bits(a) != is_bits(b) {
        let (bit_type, integer) = if is_bits(a) { (a, b) } else { (b, a) };
        let meet = if bits(integer) > bits(bit_type) { integer } else { bit_type };
        return Some((meet, Some(&rules::BITS_AND_INTEGER)));
    }
    if is_bits(a) || is_signed(a) == is_signed(b) {
        return Some((if bits(a) >= bits(b) { a } else { b }, None));
    }
    let (signed, unsigned) = if is_signed(a) { (a, b) } else { (b, a) };
    if bits(signed) > bits(unsigned) {
        return Some((signed, None));
    }
    match bits(unsigned) {
        8 => Some((E::Int, None)),
        16 => Some((E::Dint, None)),
        32 => Some((E::Lint, None)),
        _ => Some((E::Lint, Some(&rules::SIGN_CHANGED))),
    }
}

/// The type in which two elementary types meet in an operation, with the warning that this deserves.
pub(super) fn common(a: E, b: E) -> Option<(E, Option<&'static Rule>)> {
    if a == b {
        return Some((a, None));
    }
    if let (Some(long), Some(other)) = (long_form(a), long_form(b)) {
        return (long == other).then_some((long, None));
    }
    if is_real(a) && is_real(b) {
        return Some((E::Lreal, None));
    }
    if is_real(a) || is_real(b) {
        let (real, other) = if is_real(a) { (a, b) } else { (b, a) };
        if !is_integer(other) {
            return None;
        }
        return match implicit(other, real) {
            Way::Standard => Some((real, None)),
            Way::Vendor(_) if matches!(implicit(other, E::Lreal), Way::Standard) => Some((E::Lreal, None)),
            Way::Vendor(rule) => Some((E::Lreal, Some(rule))),
            Way::None => None,
        };
    }
    if a == E::Bool && is_bits(b) {
        return Some((b, None));
    }
    if b == E::Bool && is_bits(a) {
        return Some((a, None));
    }
    let integer = |ty: E| is_integer(ty) || is_bits(ty);
    if integer(a) && integer(b) { common_integer(a, b) } else { None }
}

/// What to write where a value has the wrong type, and no conversion between elementary types says it.
fn mismatch_hint(from: Ty, to: Ty, target: Option<E>) -> Option<&'static str> {
    Some(match (from, to) {
        (Ty::IntLit | Ty::RealLit, _) if target.is_some_and(super::types::is_duration) => {
            "durations are written `T#5s`"
        }
        (Ty::IntLit | Ty::RealLit, _) if target == Some(E::Bool) => "a BOOL is TRUE or FALSE",
        (Ty::RealLit, _) if target.is_some() => "round it with `REAL_TO_INT(…)`, or declare the variable as REAL",
        (Ty::Str(_), _) if target.is_some() => "read the number in it with `STRING_TO_INT(…)` or the like",
        (Ty::IntLit | Ty::RealLit, Ty::Str(_)) => "strings stand in `'`: `'5'`",
        (_, Ty::Str(_)) => "make a text of it with `INT_TO_STRING(…)` or the like",
        _ => return None,
    })
}

impl Checker<'_, '_> {
    /// An expression of exactly the type `to`, converted if that happens by itself; else reports.
    pub(super) fn coerce(&mut self, expr: Expr, to: Ty) -> Expr {
        if expr.ty == to || to == Ty::Error || expr.ty == Ty::Error {
            return Expr { ty: if expr.ty == Ty::Error { Ty::Error } else { to }, ..expr };
        }
        let span = expr.span;
        if let Some(TyKind::Subrange { base, low, high }) = self.an.types.kind(to).cloned() {
            let inner = self.coerce(expr, Ty::Elem(base));
            return self.ranged(inner, to, base, (low, high));
        }
        match (expr.ty, to) {
            (Ty::IntLit | Ty::RealLit, Ty::Elem(elementary)) => return self.literal(&expr, elementary),
            (Ty::Str(_), Ty::Str(_)) | (Ty::WStr(_), Ty::WStr(_)) => return expr,
            _ => {}
        }
        let expr = match self.coerce_character(expr, to) {
            Ok(found) => return found,
            Err(expr) => *expr,
        };
        let from_enum = match self.an.types.kind(expr.ty) {
            Some(TyKind::Enum { has_base, .. }) => Some(*has_base),
            _ => None,
        };
        let target = match to {
            Ty::Elem(target) => Some(target),
            _ => None,
        };
        if let (Some(from), Some(target)) = (self.an.types.elementary(expr.ty), target) {
            if from_enum == Some(false) && (is_integer(target) || is_bits(target)) {
                let message = format!("a value of {} is used as {}", self.an.types.name(expr.ty), target.name());
                self.an.report_vendor(&rules::ENUM_AS_INTEGER, span, message);
            }
            match implicit(from, target) {
                Way::Standard => {
                    self.warn_narrow_computation(&expr, from, target);
                    return self.convert(expr, target, false);
                }
                Way::Vendor(rule) => {
                    if !matches!(expr.kind, ExprKind::Const(_)) || !self.constant_fits(&expr, from, target) {
                        let message = format!("{} becomes {} here", from.name(), target.name());
                        self.an.report_vendor(rule, span, message);
                    }
                    return self.convert(expr, target, false);
                }
                Way::None => {}
            }
        }
        self.mismatch(&expr, to);
        Expr { kind: ExprKind::Const(Const::Int(0)), ty: Ty::Error, span }
    }

    fn mismatch(&mut self, expr: &Expr, to: Ty) {
        let (from, wanted) = (self.an.types.name(expr.ty), self.an.types.name(to));
        let mut found = crate::diagnostics::Diagnostic::new(
            &rules::MISMATCH,
            expr.span,
            format!("{wanted} is wanted here, not {from}"),
        );
        let both = (self.an.types.elementary(expr.ty), self.an.types.elementary(to));
        if let (Some(from), Some(to), Ty::Elem(_)) = (both.0, both.1, to) {
            found = found.help(format!("convert it: {}_TO_{}(…)", from.name(), to.name()));
        }
        if found.help.is_none() {
            found.help = mismatch_hint(expr.ty, to, both.1).map(str::to_owned);
        }
        self.an.push(found);
    }

    fn constant_fits(&self, expr: &Expr, from: E, to: E) -> bool {
        let ExprKind::Const(Const::Int(value)) = &expr.kind else { return false };
        limits(to).is_some_and(|(low, high)| (low..=high).contains(&widen(from, *value)))
    }

    fn warn_narrow_computation(&mut self, expr: &Expr, from: E, to: E) {
        let computed = matches!(expr.kind, ExprKind::Binary(BinOp::Add | BinOp::Sub | BinOp::Mul, ..));
        if computed && is_integer(from) && is_integer(to) && from.storage().bytes() < to.storage().bytes() {
            let message = format!("computed in {} and wrapped there before it becomes {}", from.name(), to.name());
            self.an.report(&rules::COMPUTED_NARROW, expr.span, message);
        }
    }

    /// The conversion itself, folded when the value is known.
    pub(super) fn convert(&mut self, expr: Expr, to: E, truncates: bool) -> Expr {
        let (span, ty) = (expr.span, Ty::Elem(to));
        let from = self.an.types.elementary(expr.ty);
        if let (Some(from), ExprKind::Const(value)) = (from, &expr.kind)
            && let Some(value) = fold::convert(value, from, to, truncates)
        {
            return Expr { kind: ExprKind::Const(value), ty, span };
        }
        if from == Some(to) {
            return Expr { ty, ..expr };
        }
        Expr { kind: ExprKind::Convert { value: Box::new(expr), truncates }, ty, span }
    }

    fn ranged(&mut self, expr: Expr, to: Ty, base: E, (low, high): (i64, i64)) -> Expr {
        let span = expr.span;
        if expr.ty == Ty::Error {
            return expr;
        }
        if let ExprKind::Const(Const::Int(value)) = expr.kind {
            let inside = (widen(base, low)..=widen(base, high)).contains(&widen(base, value));
            if !inside {
                let message = format!("{} is not inside {}", widen(base, value), self.an.types.name(to));
                self.an.report(&rules::SUBRANGE, span, message);
                return Expr { ty: Ty::Error, ..expr };
            }
            return Expr { ty: to, ..expr };
        }
        Expr { kind: ExprKind::Check(Box::new(expr), low, high), ty: to, span }
    }

    /// A literal as a value of an elementary type.
    pub(super) fn literal(&mut self, expr: &Expr, to: E) -> Expr {
        let span = expr.span;
        let fail = Expr { kind: ExprKind::Const(Const::Int(0)), ty: Ty::Error, span };
        let value = match &expr.kind {
            ExprKind::Const(Const::Wide(value)) if is_real(to) => {
                #[expect(clippy::cast_precision_loss, reason = "rounding to nearest even is what a literal does")]
                let (wide, narrow) = (*value as f64, *value as f32);
                if to == E::Real { Const::F32(narrow) } else { Const::F64(wide) }
            }
            ExprKind::Const(Const::Wide(value))
                if to != E::Bool && !is_time(to) && integer_type(to).is_some() && !is_character(to) =>
            {
                let (low, high) = limits(to).unwrap_or((0, 0));
                if *value < low || *value > high {
                    let message = format!("{value} does not fit {}, which holds {low}..{high}", to.name());
                    self.an.report(&rules::LITERAL_RANGE, span, message);
                    return fail;
                }
                Const::Int(wrap(to, *value))
            }
            ExprKind::Const(Const::Wide(value @ (0 | 1))) if to == E::Bool => Const::Int(i64::from(*value == 1)),
            ExprKind::Const(Const::Lit(wide, narrow)) if is_real(to) => {
                if wide.is_finite() && to == E::Real && narrow.is_infinite() {
                    let message = format!("{wide:E} does not fit REAL, which holds up to {:E}", f32::MAX);
                    self.an.report(&rules::LITERAL_RANGE, span, message);
                    return fail;
                }
                if to == E::Real {
                    Const::F32(fold::canonical32(*narrow))
                } else {
                    Const::F64(fold::canonical64(*wide))
                }
            }
            ExprKind::Const(_) => {
                self.mismatch(expr, Ty::Elem(to));
                return fail;
            }
            // Operations on literals are folded, so that a literal type is always a constant.
            _ => return fail,
        };
        Expr { kind: ExprKind::Const(value), ty: Ty::Elem(to), span }
    }

    /// The smallest usual type that holds an integer literal.
    pub(super) fn literal_type(value: i128) -> E {
        for ty in [E::Dint, E::Lint, E::Ulint] {
            if limits(ty).is_some_and(|(low, high)| (low..=high).contains(&value)) {
                return ty;
            }
        }
        E::Lint
    }

    /// Gives a literal a type of its own: what is wanted if it can be that, else the usual one.
    pub(super) fn settle(&mut self, expr: Expr, want: Ty) -> Expr {
        let wanted = self.an.types.elementary(want);
        match (&expr.kind, expr.ty) {
            (ExprKind::Const(Const::Wide(value)), Ty::IntLit) => {
                let to = match wanted {
                    Some(to) if is_integer(to) || is_bits(to) || is_real(to) => to,
                    _ => Self::literal_type(*value),
                };
                self.literal(&expr, to)
            }
            (_, Ty::RealLit) => self.literal(&expr, if wanted == Some(E::Real) { E::Real } else { E::Lreal }),
            _ => expr,
        }
    }

    /// Brings two operands to one type. `None` when they have none; that has not been reported.
    pub(super) fn unify(&mut self, a: Expr, b: Expr, span: Span, want: Ty) -> Option<(Expr, Expr, Ty)> {
        if a.ty == Ty::Error || b.ty == Ty::Error {
            return Some((a, b, Ty::Error));
        }
        if a.ty == b.ty && !matches!(a.ty, Ty::IntLit | Ty::RealLit) {
            let ty = self.an.types.without_range(a.ty);
            return Some((Expr { ty, ..a }, Expr { ty, ..b }, ty));
        }
        let (a, b) = self.meet_characters(a, b);
        if let (Some(n), Some(m)) = (a.ty.capacity(), b.ty.capacity()) {
            let wide = a.ty.is_wide_text();
            return (wide == b.ty.is_wide_text()).then(|| (a, b, Ty::text(wide, n.max(m))));
        }
        if a.ty == b.ty && self.an.types.elementary(a.ty).is_some_and(is_character) {
            let ty = a.ty;
            return Some((a, b, ty));
        }
        let (a, b) = match (is_literal(a.ty), is_literal(b.ty)) {
            (true, true) => return Self::unify_literals(a, b),
            (true, false) => (self.adapt(&a, b.ty, want)?, b),
            (false, true) => {
                let adapted = self.adapt(&b, a.ty, want)?;
                (a, adapted)
            }
            (false, false) => (a, b),
        };
        let enums = |ty| matches!(self.an.types.kind(ty), Some(TyKind::Enum { .. }));
        if enums(a.ty) && enums(b.ty) && a.ty != b.ty {
            return None;
        }
        let (x, y) = (self.an.types.elementary(a.ty)?, self.an.types.elementary(b.ty)?);
        let (meet, rule) = common(x, y)?;
        if let Some(rule) = rule {
            let message = format!("{} and {} meet in {}", x.name(), y.name(), meet.name());
            self.an.report_vendor(rule, span, message);
        }
        let a = self.convert(a, meet, false);
        let b = self.convert(b, meet, false);
        Some((a, b, Ty::Elem(meet)))
    }

    fn unify_literals(a: Expr, b: Expr) -> Option<(Expr, Expr, Ty)> {
        if a.ty == b.ty {
            let ty = a.ty;
            return Some((a, b, ty));
        }
        // One is a real: both become reals, still in two widths.
        let real = |expr: Expr| match expr.kind {
            #[expect(clippy::cast_precision_loss, reason = "rounding to nearest even is what a literal does")]
            ExprKind::Const(Const::Wide(value)) => {
                Expr { kind: ExprKind::Const(Const::Lit(value as f64, value as f32)), ty: Ty::RealLit, span: expr.span }
            }
            _ => expr,
        };
        Some((real(a), real(b), Ty::RealLit))
    }

    /// A literal beside an operand of another type.
    fn adapt(&mut self, literal: &Expr, other: Ty, want: Ty) -> Option<Expr> {
        let other = self.an.types.elementary(other)?;
        if let (ExprKind::Const(Const::Wide(value)), true) = (&literal.kind, literal.ty == Ty::IntLit) {
            if is_real(other) {
                return Some(self.literal(literal, other));
            }
            if !(is_integer(other) || is_bits(other)) {
                return None;
            }
            let fits = limits(other).is_some_and(|(low, high)| (low..=high).contains(value));
            let to = if fits { other } else { Self::literal_type(*value) };
            return Some(self.literal(literal, to));
        }
        if is_real(other) {
            return Some(self.literal(literal, other));
        }
        if !is_integer(other) {
            return None;
        }
        let narrow = self.an.types.elementary(want) == Some(E::Real);
        Some(self.literal(literal, if narrow { E::Real } else { E::Lreal }))
    }
}

fn is_literal(ty: Ty) -> bool {
    matches!(ty, Ty::IntLit | Ty::RealLit)
}
