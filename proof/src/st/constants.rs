//! What constants alone decide in a tree, and where that traps: there a compiler may refuse the program. A generated program has no such
//! place, so that every one of them is compared and each refusal is a difference.

use super::evaluate::Evaluator;
use super::functions::Function;
use super::tree::{Arg, Base, Class, Def, Expr, ExprKind, Kind, Op, Place, Source, Step, Stmt, Ty, Value};
use super::visit::{Change, Node, change, each_in_expr};

/// More than an expression has parts.
const STEPS: u64 = 1_000_000;

/// Gives each constant that divides by zero, indexes outside of the bounds or leaves its subrange another value. Returns how many there
/// were.
pub fn settle(source: &mut Source) -> usize {
    let mut count = 0;
    for unit in 0..source.units.len() {
        let mut body: Vec<Stmt> = std::mem::take(&mut source.units[unit].body);
        let mut settler = Settler { source, unit, evaluator: Evaluator::new(source, STEPS), count: 0 };
        change(&mut body, &mut |node| settler.node(node));
        count += settler.count;
        source.units[unit].body = body;
    }
    count
}

/// Whether constants alone make a trap somewhere in a program.
#[must_use]
pub fn has_trap(source: &Source) -> bool {
    settle(&mut source.clone()) != 0
}

struct Settler<'s> {
    source: &'s Source,
    unit: usize,
    evaluator: Evaluator<'s>,
    count: usize,
}

impl Settler<'_> {
    fn node(&mut self, node: Change<'_>) {
        match node {
            Change::Expr(Expr { kind: ExprKind::Bin(Op::Div | Op::Mod, _, divisor), .. }) => self.divisor(divisor),
            Change::Expr(Expr {
                kind: ExprKind::Std(Function::Div | Function::Mod | Function::Divtime, inputs),
                ..
            }) => {
                inputs.iter_mut().skip(1).for_each(|divisor| self.divisor(divisor));
            }
            Change::Expr(_) => {}
            Change::Store(ty, value) => self.stored(ty, value),
            Change::Place(place) => self.place(place),
            Change::Function(unit, args) => self.args(unit, args),
            Change::Block(Ty::N(id), args) => {
                if let Def::Block(unit) = self.source.types[id].def {
                    self.args(unit, args);
                }
            }
            Change::Block(..) => {}
        }
    }

    /// The value of an expression that reads nothing but literals and constants.
    fn value(&mut self, expr: &Expr) -> Option<Value> {
        let mut is_constant = true;
        let mut is_bounded = false;
        each_in_expr(expr, &mut |node| {
            is_constant &= match node {
                // A bound is known without a look into its array, of which nothing is indexed.
                Node::Place(_) if std::mem::take(&mut is_bounded) => true,
                Node::Expr(Expr { kind: ExprKind::Std(Function::LowerBound | Function::UpperBound, _), .. }) => {
                    is_bounded = true;
                    true
                }
                Node::Place(place) => self.is_constant(place),
                Node::Expr(expr) => !matches!(expr.kind, ExprKind::Call(..)),
                Node::Stmt(_) => false,
            };
        });
        // What traps in it was settled before: parts come before the whole.
        if is_constant { self.evaluator.constant(self.unit, expr).ok() } else { None }
    }

    fn is_constant(&self, place: &Place) -> bool {
        match place.base {
            Base::Var(at) => self.source.units[self.unit].vars[at].class == Class::Constant,
            Base::Global(at) => self.source.globals[at].class == Class::Constant,
            Base::Direct(_) => false,
        }
    }

    fn divisor(&mut self, divisor: &mut Expr) {
        if self.value(divisor) == Some(Value::Int(0)) {
            self.replace(divisor, 1);
        }
    }

    fn stored(&mut self, ty: Ty, value: &mut Expr) {
        if let Ty::N(id) = ty
            && let Def::Subrange(_, low, high) = self.source.types[id].def
            && let Some(Value::Int(known)) = self.value(value)
            && !(low..=high).contains(&known)
        {
            self.replace(value, low);
        }
    }

    fn args(&mut self, unit: usize, args: &mut [Arg]) {
        for arg in args {
            if let Arg::In(at, value) = arg {
                self.stored(self.source.units[unit].vars[*at].ty, value);
            }
        }
    }

    fn place(&mut self, place: &mut Place) {
        let mut ty = match place.base {
            Base::Var(at) => self.source.units[self.unit].vars[at].ty,
            Base::Global(at) => self.source.globals[at].ty,
            Base::Direct(_) => return,
        };
        for step in &mut place.steps {
            if let (Step::Index(indices), Some(capacity)) = (&mut *step, ty.capacity()) {
                self.index(&mut indices[0], 1, i128::from(capacity));
                return;
            }
            let Ty::N(id) = ty else { return };
            match (step, &self.source.types[id].def) {
                (Step::Field(at), def) => ty = self.source.field_type(def, *at),
                (Step::Index(indices), Def::Array(dims, element)) => {
                    for (index, (low, high)) in indices.iter_mut().zip(dims) {
                        self.index(index, i128::from(*low), i128::from(*high));
                    }
                    ty = *element;
                }
                _ => return,
            }
        }
    }

    fn index(&mut self, index: &mut Expr, low: i128, high: i128) {
        if let Some(Value::Int(known)) = self.value(index)
            && !(low..=high).contains(&known)
        {
            *index = Expr { ty: Ty::K(Kind::Dint), kind: ExprKind::Lit(Value::Int(low), false) };
            self.count += 1;
        }
    }

    /// Another constant instead; a literal with its type in front, as its neighbours may take theirs from it.
    fn replace(&mut self, expr: &mut Expr, value: i128) {
        expr.kind = ExprKind::Lit(Value::Int(value), true);
        self.count += 1;
    }
}
