//! Assertions: what each compares, and how.

use khz_bytecode::container::ElementaryType as E;

use super::{constant, load};
use crate::analysis::expr::Checker;
use crate::analysis::place::step;
use crate::analysis::tree::{BinOp, Expr, ExprKind, Place, Step, Stmt, UnOp};
use crate::analysis::types::{BOOL, Const, DINT, Ty, TyKind, is_integer, is_real, is_time};
use crate::diagnostics::semantic as rules;
use crate::source::Span;
use crate::syntax::ast::{self, Arg};
use crate::testing::{Operand, OperandValue};

/// How many values the arrays and structures of one assertion may hold.
const MAX_COMPARED_VALUES: usize = 1024;

/// What an assertion asks.
#[derive(Debug, Clone, Copy)]
pub(super) enum Relation {
    /// One BOOL is this.
    Is(bool),
    /// The first compares so with the second.
    Compare(BinOp),
    /// The first two differ by no more than the third.
    Near,
}

/// An assertion: its word, its parameters in order, and what it asks.
pub(super) struct Row {
    pub(super) word: &'static str,
    pub(super) parameters: &'static [&'static str],
    pub(super) relation: Relation,
}

const fn row(word: &'static str, parameters: &'static [&'static str], relation: Relation) -> Row {
    Row { word, parameters, relation }
}

/// The assertions of both notations.
pub(super) static ASSERTIONS: &[Row] = &[
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
pub(super) static NEAR_IN_POU: Row = row("ASSERT_NEAR", &["EXPECTED", "ACTUAL", "DELTA"], Relation::Near);

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

impl<'a> Checker<'_, 'a> {
    pub(super) fn assertion(&mut self, row: &'static Row, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let (given, message) = self.test_arguments(row.word, row.parameters, args, span)?;
        let labels: Vec<&'static str> = row.parameters.iter().map(|parameter| label(parameter)).collect();
        let mut operands = Vec::with_capacity(2);
        let holds = match (row.relation, given.as_slice()) {
            (Relation::Is(wanted), [value]) => {
                let value = self.condition(value);
                let value = self.keep("actual", value, &mut operands)?;
                operands.push(Operand {
                    label: "expected",
                    value: OperandValue::Text(if wanted { "TRUE" } else { "FALSE" }),
                });
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
    pub(super) fn comparison(
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
        let comparable = a.ty.is_text() || self.an.types.elementary(a.ty).is_some();
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
        let number = |ty: E| is_integer(ty) || is_real(ty) || is_time(ty);
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

    fn too_many_values<T>(&mut self, span: Span) -> Option<T> {
        let message = format!("an assertion compares at most {MAX_COMPARED_VALUES} values; compare parts");
        self.an.report(&rules::ASSERTION, span, message);
        None
    }

    /// Two arrays or structures, value by value.
    fn all_equal(&mut self, a: &Expr, b: &Expr, span: Span) -> Option<Expr> {
        let (ExprKind::Load(a), ExprKind::Load(b)) = (&a.kind, &b.kind) else { return None };
        let (mut waiting, mut leaves) = (vec![((**a).clone(), (**b).clone())], Vec::new());
        while let Some((a, b)) = waiting.pop() {
            if leaves.len() >= MAX_COMPARED_VALUES {
                return self.too_many_values(span);
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
                    let Some(all) = elements(&dims) else {
                        return self.too_many_values(span);
                    };
                    for indices in all {
                        let list: std::rc::Rc<[Expr]> =
                            indices.iter().map(|index| constant(*index, DINT, span)).collect();
                        let part = |base: &Place| step(base.clone(), Step::Index(owner, list.clone()), element, span);
                        waiting.push((part(&a), part(&b)));
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
}

/// The indices of all elements, the last dimension fastest; `None` when there are more than can be compared.
fn elements(dims: &[(i32, i32)]) -> Option<Vec<Vec<i64>>> {
    let extents = dims.iter().map(|&(low, high)| usize::try_from(i64::from(high) - i64::from(low) + 1).unwrap_or(0));
    let count = extents.fold(1usize, usize::saturating_mul);
    if count > MAX_COMPARED_VALUES {
        return None;
    }
    let mut all: Vec<Vec<i64>> = vec![Vec::new()];
    for &(low, high) in dims {
        let one_longer = |indices: &Vec<i64>| {
            let indices = indices.clone();
            (i64::from(low)..=i64::from(high)).map(move |index| indices.iter().copied().chain([index]).collect())
        };
        all = all.iter().flat_map(one_longer).collect();
    }
    Some(all)
}
