//! What of a program C can say.

use super::super::case::value;
use super::super::functions::Function;
use super::super::sweep::{take_out, unused};
use super::super::tree::{Base, Class, Def, Expr, ExprKind, Op, Place, Source, Step, Stmt, Ty, Unit, UnitKind};
use super::{is_number, kind_of};
use crate::random::Random;

/// A program without everything that C can not say: other statements, and what then nothing uses. Variables that would begin with zeros
/// begin with values that a seed decides, because most arithmetic on zeros says little.
#[must_use]
pub fn subset(source: &Source, seed: u64) -> Source {
    let mut small = source.clone();
    small.config = None;
    let last = small.units.len().saturating_sub(1);
    for unit in &mut small.units[..last] {
        unit.gone |= unit.kind == UnitKind::Program;
    }
    let mut body = source.units.last().map_or_else(Vec::new, |unit| unit.body.clone());
    if let Some(unit) = source.units.last() {
        Subset { source, unit }.list(&mut body);
    }
    if let Some(unit) = small.units.last_mut() {
        unit.body = body;
    }
    for declaration in unused(&small) {
        take_out(&mut small, declaration);
    }
    let mut random = Random::new(seed ^ 0x006F_7261_636C_6543);
    let own = small.units.last_mut().into_iter().flat_map(|unit| &mut unit.vars);
    for var in own.chain(&mut small.globals).filter(|var| var.init.is_none() && !var.reserved && !var.gone) {
        if matches!(var.ty, Ty::K(_)) && is_type(source, var.ty) {
            var.init = Some(value(source, var.ty, &mut random));
        }
    }
    small
}

/// Whether values of a type are numbers or made of numbers.
pub(super) fn is_type(source: &Source, ty: Ty) -> bool {
    match ty {
        Ty::K(kind) => is_number(kind),
        Ty::N(id) => match &source.types[id].def {
            Def::Struct(fields) => fields.iter().all(|(_, ty, _)| is_type(source, *ty)),
            Def::Array(_, element) => is_type(source, *element),
            Def::Subrange(base, ..) => is_number(*base),
            Def::Enum(..) => true,
            Def::Block(_) | Def::Standard(_) => false,
        },
        Ty::S(_) | Ty::W(_) => false,
    }
}

struct Subset<'s> {
    source: &'s Source,
    unit: &'s Unit,
}

impl Subset<'_> {
    fn list(&self, list: &mut Vec<Stmt>) {
        list.retain_mut(|stmt| self.stmt(stmt));
    }

    /// Takes out of a statement what can not be said; false: nothing is left.
    fn stmt(&self, stmt: &mut Stmt) -> bool {
        match stmt {
            Stmt::Assign(place, value) => self.place(place) && self.expr(value),
            Stmt::If(branches, otherwise) => {
                branches.retain_mut(|(condition, body)| {
                    self.list(body);
                    self.expr(condition)
                });
                self.list(otherwise);
                !branches.is_empty()
            }
            Stmt::Case(selector, branches, otherwise) => {
                branches.retain_mut(|(_, body)| {
                    self.list(body);
                    !body.is_empty()
                });
                self.list(otherwise);
                self.expr(selector) && !branches.is_empty()
            }
            Stmt::For(_, from, to, by, body) => {
                self.list(body);
                self.expr(from) && self.expr(to) && by.iter().all(|by| self.expr(by))
            }
            Stmt::While(_, _, condition, body) | Stmt::Repeat(_, _, condition, body) => {
                self.list(body);
                self.expr(condition)
            }
            Stmt::Exit | Stmt::Continue | Stmt::Return => true,
            _ => false,
        }
    }

    fn place(&self, place: &Place) -> bool {
        let var = if let Base::Var(at) = place.base {
            &self.unit.vars[at]
        } else if let Base::Global(at) = place.base {
            &self.source.globals[at]
        } else {
            return false;
        };
        let is_own = matches!(var.class, Class::Var | Class::Temp | Class::Constant);
        let is_step = |step: &Step| match step {
            Step::Index(indices) => indices.iter().all(|index| self.expr(index)),
            other => matches!(other, Step::Field(_)),
        };
        is_own && var.at.is_none() && is_type(self.source, var.ty) && place.steps.iter().all(is_step)
    }

    fn expr(&self, expr: &Expr) -> bool {
        let same = |a: &Expr, b: &Expr| kind_of(a.ty) == kind_of(b.ty);
        if !is_type(self.source, expr.ty) {
            return false;
        }
        match &expr.kind {
            ExprKind::Lit(..) => self.is_single(expr.ty),
            ExprKind::Get(place) => self.place(place),
            ExprKind::Bin(op, left, right) => {
                operation(*op).is_some() && same(left, right) && self.expr(left) && self.expr(right)
            }
            ExprKind::Neg(inner)
            | ExprKind::Not(inner)
            | ExprKind::Widen(inner)
            | ExprKind::Conv(inner)
            | ExprKind::Trunc(inner) => self.expr(inner),
            ExprKind::Std(function, inputs) => {
                let shapes = match function {
                    Function::Min | Function::Max | Function::Limit | Function::Add | Function::Mul => {
                        inputs.iter().all(|input| same(input, expr))
                    }
                    Function::Sel | Function::Mux => inputs[1..].iter().all(|input| same(input, expr)),
                    Function::Shl | Function::Shr | Function::Rol | Function::Ror => same(&inputs[0], expr),
                    Function::Abs | Function::Sqrt | Function::Move => same(&inputs[0], expr),
                    _ => false,
                };
                shapes && inputs.iter().all(|input| self.expr(input) && self.is_single(input.ty))
            }
            _ => false,
        }
    }

    fn is_single(&self, ty: Ty) -> bool {
        match ty {
            Ty::K(_) => true,
            Ty::N(id) => matches!(self.source.types[id].def, Def::Enum(..)),
            Ty::S(_) | Ty::W(_) => false,
        }
    }
}

/// The first part of the name of an operation's C function; none: it is not said.
pub(super) fn operation(op: Op) -> Option<&'static str> {
    const NAMES: [(Op, &str); 16] = [
        (Op::Add, "add"),
        (Op::Sub, "sub"),
        (Op::Mul, "mul"),
        (Op::Div, "div"),
        (Op::Mod, "mod"),
        (Op::And, "and"),
        (Op::AndThen, "and"),
        (Op::Or, "or"),
        (Op::OrElse, "or"),
        (Op::Xor, "xor"),
        (Op::Eq, "eq"),
        (Op::Ne, "ne"),
        (Op::Lt, "lt"),
        (Op::Le, "le"),
        (Op::Gt, "gt"),
        (Op::Ge, "ge"),
    ];
    NAMES.iter().find(|(known, _)| *known == op).map(|(_, name)| *name)
}
