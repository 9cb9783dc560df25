//! Programs of nothing but arithmetic: every operation of every kind comes up in a few hundred of them.

use super::super::case::value;
use super::super::functions::Function;
use super::super::tree::{Base, Class, Expr, ExprKind, Kind, Op, Place, Source, Stmt, Ty, Unit, UnitKind, Value, Var};
use super::is_number;
use crate::random::Random;

/// Statements of a program.
const STATEMENTS: usize = 24;

/// The program of a seed: assignments between two variables of each kind, which begin with values at which something may break.
#[must_use]
pub fn dense(seed: u64) -> Source {
    let mut random = Random::new(seed ^ 0x0064_656E_7365);
    let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(|kind| is_number(*kind)).collect();
    let mut source = Source::default();
    let mut vars = Vec::new();
    for number in 0..2 * kinds.len() {
        let ty = Ty::K(kinds[number / 2]);
        let init = Some(value(&source, ty, &mut random));
        let name = format!("v{number}");
        vars.push(Var {
            name,
            ty,
            class: Class::Var,
            init,
            reserved: false,
            at: None,
            retain: false,
            edge: None,
            gone: false,
        });
    }
    let mut maker = Maker { random, kinds };
    let mut body = Vec::new();
    for _ in 0..STATEMENTS {
        let kind = maker.any();
        body.push(Stmt::Assign(maker.variable(kind), maker.expr(kind, 3)));
    }
    source.units.push(Unit { name: "main".to_string(), kind: UnitKind::Program, vars, body, gone: false });
    source
}

struct Maker {
    random: Random,
    kinds: Vec<Kind>,
}

fn boxed(expr: Expr) -> Box<Expr> {
    Box::new(expr)
}

impl Maker {
    fn any(&mut self) -> Kind {
        self.kinds[self.random.below(self.kinds.len())]
    }

    /// One of the two variables of a kind.
    fn variable(&mut self, kind: Kind) -> Place {
        let position = self.kinds.iter().position(|known| *known == kind).unwrap_or(0);
        Place { base: Base::Var(2 * position + self.random.below(2)), steps: Vec::new(), ty: Ty::K(kind) }
    }

    fn literal(&mut self, kind: Kind) -> Expr {
        let ty = Ty::K(kind);
        Expr { ty, kind: ExprKind::Lit(value(&Source::default(), ty, &mut self.random), true) }
    }

    fn leaf(&mut self, kind: Kind) -> Expr {
        if self.random.chance(20) {
            return self.literal(kind);
        }
        Expr { ty: Ty::K(kind), kind: ExprKind::Get(self.variable(kind)) }
    }

    fn bin(&mut self, op: Op, of: Kind, to: Kind, depth: usize) -> Expr {
        let (left, right) = (self.expr(of, depth), self.expr(of, depth));
        Expr { ty: Ty::K(to), kind: ExprKind::Bin(op, boxed(left), boxed(right)) }
    }

    fn expr(&mut self, kind: Kind, depth: usize) -> Expr {
        if depth == 0 || self.random.chance(15) {
            return self.leaf(kind);
        }
        let depth = depth - 1;
        let from = self.any();
        if from != kind && self.random.chance(35) {
            let inner = boxed(self.expr(from, depth));
            let cuts = from.is_real() && kind.is_integer() && self.random.chance(50);
            let conversion = if cuts { ExprKind::Trunc(inner) } else { ExprKind::Conv(inner) };
            return Expr { ty: Ty::K(kind), kind: conversion };
        }
        if self.random.chance(35) {
            return self.function(kind, depth);
        }
        if kind == Kind::Bool {
            return self.truth(depth);
        }
        if kind.is_bits() {
            let op = self.random.one_of([Op::And, Op::Or, Op::Xor, Op::And, Op::Add, Op::Sub, Op::Mul]);
            if self.random.chance(20) {
                return Expr { ty: Ty::K(kind), kind: ExprKind::Not(boxed(self.expr(kind, depth))) };
            }
            return self.bin(op, kind, kind, depth);
        }
        if (kind.is_signed() || kind.is_real()) && self.random.chance(15) {
            return Expr { ty: Ty::K(kind), kind: ExprKind::Neg(boxed(self.expr(kind, depth))) };
        }
        let op = self.random.one_of([Op::Add, Op::Sub, Op::Mul, Op::Div, Op::Mod]);
        match op {
            Op::Mod if kind.is_real() => self.bin(Op::Div, kind, kind, depth),
            Op::Div | Op::Mod if !kind.is_real() => self.divide(op, kind, depth),
            _ => self.bin(op, kind, kind, depth),
        }
    }

    /// Mostly by a number that is not zero, because a trap ends the program.
    fn divide(&mut self, op: Op, kind: Kind, depth: usize) -> Expr {
        let left = self.expr(kind, depth);
        let mut right = if self.random.chance(4) { self.expr(kind, depth) } else { self.literal(kind) };
        if let ExprKind::Lit(value, _) = &mut right.kind
            && *value == Value::Int(0)
        {
            *value = Value::Int(if kind.is_signed() { -1 } else { 3 });
        }
        Expr { ty: Ty::K(kind), kind: ExprKind::Bin(op, boxed(left), boxed(right)) }
    }

    fn truth(&mut self, depth: usize) -> Expr {
        let kind = self.any();
        match self.random.below(8) {
            0 => Expr { ty: Ty::K(Kind::Bool), kind: ExprKind::Not(boxed(self.expr(Kind::Bool, depth))) },
            1 | 2 => {
                let op = self.random.one_of([Op::And, Op::Or, Op::Xor, Op::AndThen, Op::OrElse]);
                self.bin(op, Kind::Bool, Kind::Bool, depth)
            }
            3 => {
                let op = self.random.one_of([Op::Eq, Op::Ne]);
                self.bin(op, Kind::Bool, Kind::Bool, depth)
            }
            _ if kind == Kind::Bool => self.leaf(kind),
            _ => {
                let op = self.random.one_of([Op::Eq, Op::Ne, Op::Lt, Op::Le, Op::Gt, Op::Ge]);
                self.bin(op, kind, Kind::Bool, depth)
            }
        }
    }

    fn function(&mut self, kind: Kind, depth: usize) -> Expr {
        let is_whole = kind.is_integer() || kind.is_bits();
        let functions = [Function::Sel, Function::Mux, Function::Min, Function::Max, Function::Limit, Function::Abs];
        let shifts = [Function::Shl, Function::Shr, Function::Rol, Function::Ror];
        let wanted = if is_whole && self.random.chance(50) {
            self.random.one_of(shifts)
        } else if kind.is_real() && self.random.chance(20) {
            Function::Sqrt
        } else {
            self.random.one_of(functions)
        };
        let (function, inputs) = match wanted {
            Function::Sel => {
                (wanted, vec![self.expr(Kind::Bool, depth), self.expr(kind, depth), self.expr(kind, depth)])
            }
            Function::Shl | Function::Shr | Function::Rol | Function::Ror => {
                let value = self.expr(kind, depth);
                let count = Value::Int(i128::from(self.random.between(0, i64::from(kind.bits()) + 2)));
                let count = Expr { ty: Ty::K(Kind::Int), kind: ExprKind::Lit(count, false) };
                let count = if self.random.chance(50) { count } else { self.expr(Kind::Usint, depth) };
                (wanted, vec![value, count])
            }
            Function::Min | Function::Max if kind != Kind::Bool => {
                (wanted, vec![self.expr(kind, depth), self.expr(kind, depth)])
            }
            Function::Limit if kind != Kind::Bool => {
                (wanted, vec![self.expr(kind, depth), self.expr(kind, depth), self.expr(kind, depth)])
            }
            Function::Abs if kind.is_integer() || kind.is_real() => (wanted, vec![self.expr(kind, depth)]),
            Function::Sqrt => (wanted, vec![self.expr(kind, depth)]),
            _ => {
                let inputs = [Kind::Usint, kind, kind, kind].map(|kind| self.expr(kind, depth));
                (Function::Mux, inputs.to_vec())
            }
        };
        Expr { ty: Ty::K(kind), kind: ExprKind::Std(function, inputs) }
    }
}
