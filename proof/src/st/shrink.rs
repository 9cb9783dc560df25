//! Makes a program that shows something smaller, as long as it still shows it.

use super::tree::{Arg, Expr, ExprKind, Kind, Place, Source, Step, Stmt, Ty, Value};

/// Tries edits until none helps, at most `tries` of them; `shows` says whether a program still does what it is kept for.
#[must_use]
pub fn shrink(source: &Source, shows: &dyn Fn(&Source) -> bool, tries: usize) -> Source {
    let mut best = source.clone();
    let mut left = tries;
    loop {
        let mut helped = false;
        let mut number = 0;
        while left > 0 {
            let mut edited = best.clone();
            let mut editor = Editor { number, done: false };
            editor.source(&mut edited);
            if !editor.done {
                break;
            }
            left -= 1;
            if shows(&edited) {
                (best, helped) = (edited, true);
            } else {
                number += 1;
            }
        }
        if !helped || left == 0 {
            return best;
        }
    }
}

/// Walks the tree and makes edit number `number`.
struct Editor {
    number: usize,
    done: bool,
}

impl Editor {
    /// Whether the edit that stands here is the one.
    fn here(&mut self) -> bool {
        if self.done {
            return false;
        }
        if self.number == 0 {
            self.done = true;
            return true;
        }
        self.number -= 1;
        false
    }

    fn source(&mut self, source: &mut Source) {
        for unit in source.units.iter_mut().rev().filter(|unit| !unit.gone) {
            self.list(&mut unit.body);
        }
        let last = source.units.len().saturating_sub(1);
        for unit in &mut source.units[..last] {
            if !unit.gone && self.here() {
                unit.gone = true;
            }
        }
        for unit in &mut source.units {
            for var in unit.vars.iter_mut().filter(|var| !var.gone && var.class != super::tree::Class::Return) {
                if self.here() {
                    var.gone = true;
                }
                if var.init.is_some() && self.here() {
                    var.init = None;
                }
            }
        }
        for var in source.globals.iter_mut().filter(|var| !var.gone) {
            if self.here() {
                var.gone = true;
            }
        }
        for ty in source.types.iter_mut().filter(|ty| !ty.gone && !ty.name.is_empty()) {
            if self.here() {
                ty.gone = true;
            }
        }
    }

    fn list(&mut self, list: &mut Vec<Stmt>) {
        for at in (0..list.len()).rev() {
            if self.here() {
                list.remove(at);
                return;
            }
            for inner in bodies(&list[at]) {
                if self.here() {
                    list.splice(at..=at, inner);
                    return;
                }
            }
        }
        for stmt in list {
            self.stmt(stmt);
            if self.done {
                return;
            }
        }
    }

    fn stmt(&mut self, stmt: &mut Stmt) {
        match stmt {
            Stmt::Assign(place, value) => {
                self.place(place);
                self.expr(value);
            }
            Stmt::If(branches, otherwise) => {
                for (condition, body) in branches.iter_mut() {
                    self.expr(condition);
                    self.list(body);
                }
                self.list(otherwise);
            }
            Stmt::Case(selector, branches, otherwise) => {
                self.expr(selector);
                branches.iter_mut().for_each(|(_, body)| self.list(body));
                self.list(otherwise);
            }
            Stmt::For(_, from, to, by, body) => {
                self.expr(from);
                self.expr(to);
                by.iter_mut().for_each(|by| self.expr(by));
                self.list(body);
            }
            Stmt::While(_, _, condition, body) | Stmt::Repeat(_, _, condition, body) => {
                self.expr(condition);
                self.list(body);
            }
            Stmt::Call(place, args) => {
                self.place(place);
                self.args(args);
            }
            Stmt::Exit | Stmt::Continue | Stmt::Return => {}
        }
    }

    fn args(&mut self, args: &mut Vec<Arg>) {
        for at in 0..args.len() {
            if !matches!(args[at], Arg::InOut(..)) && self.here() {
                args.remove(at);
                return;
            }
        }
        for arg in args {
            match arg {
                Arg::In(_, value) => self.expr(value),
                Arg::InOut(_, place) | Arg::Out(_, place) => self.place(place),
            }
        }
    }

    fn place(&mut self, place: &mut Place) {
        for step in &mut place.steps {
            if let Step::Index(indices) = step {
                indices.iter_mut().for_each(|index| self.expr(index));
            }
        }
    }

    fn expr(&mut self, expr: &mut Expr) {
        if let Ty::K(kind) = expr.ty
            && !matches!(expr.kind, ExprKind::Lit(..))
            && self.here()
        {
            let zero = match kind {
                Kind::Real => Value::Real(1.0),
                Kind::Lreal => Value::Lreal(1.0),
                _ => Value::Int(1),
            };
            expr.kind = ExprKind::Lit(zero, true);
            return;
        }
        for part in parts(expr) {
            if part.ty == expr.ty && self.here() {
                *expr = part;
                return;
            }
        }
        match &mut expr.kind {
            ExprKind::Lit(..) => {}
            ExprKind::Get(place) => self.place(place),
            ExprKind::Bin(_, left, right) => {
                self.expr(left);
                self.expr(right);
            }
            ExprKind::Neg(inner)
            | ExprKind::Not(inner)
            | ExprKind::Widen(inner)
            | ExprKind::Conv(inner)
            | ExprKind::Trunc(inner) => {
                self.expr(inner);
            }
            ExprKind::Std(_, inputs) => inputs.iter_mut().for_each(|input| self.expr(input)),
            ExprKind::Call(_, args) => self.args(args),
        }
    }
}

/// The lists of statements in a statement.
fn bodies(stmt: &Stmt) -> Vec<Vec<Stmt>> {
    let all: Vec<&Vec<Stmt>> = match stmt {
        Stmt::If(branches, otherwise) => branches.iter().map(|(_, body)| body).chain([otherwise]).collect(),
        Stmt::Case(_, branches, otherwise) => branches.iter().map(|(_, body)| body).chain([otherwise]).collect(),
        Stmt::For(.., body) | Stmt::While(.., body) | Stmt::Repeat(.., body) => vec![body],
        _ => Vec::new(),
    };
    all.into_iter().filter(|body| !body.is_empty()).cloned().collect()
}

/// The expressions in an expression.
fn parts(expr: &Expr) -> Vec<Expr> {
    match &expr.kind {
        ExprKind::Bin(_, left, right) => vec![(**left).clone(), (**right).clone()],
        ExprKind::Neg(inner) | ExprKind::Not(inner) => vec![(**inner).clone()],
        ExprKind::Std(_, inputs) => inputs.clone(),
        _ => Vec::new(),
    }
}
