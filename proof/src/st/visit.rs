//! Walks over statements: every place, expression and call in them, from outside in.

use super::tree::{Arg, Expr, ExprKind, Place, Step, Stmt, Ty};

/// What a walk comes by.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Node<'t> {
    /// A statement, before what is in it.
    Stmt(&'t Stmt),
    /// An expression, before what is in it.
    Expr(&'t Expr),
    /// A place, before its indices.
    Place(&'t Place),
}

/// Shows everything in a list of statements.
pub(crate) fn each<'t>(list: &'t [Stmt], see: &mut dyn FnMut(Node<'t>)) {
    for stmt in list {
        see(Node::Stmt(stmt));
        match stmt {
            Stmt::Assign(place, value) => {
                each_in_place(place, see);
                each_in_expr(value, see);
            }
            Stmt::If(branches, _) => branches.iter().for_each(|(condition, _)| each_in_expr(condition, see)),
            Stmt::Case(selector, ..) => each_in_expr(selector, see),
            Stmt::For(_, from, to, by, _) => [from, to].into_iter().chain(by).for_each(|expr| each_in_expr(expr, see)),
            Stmt::While(_, _, condition, _) | Stmt::Repeat(_, _, condition, _) => each_in_expr(condition, see),
            Stmt::Call(place, args) => {
                each_in_place(place, see);
                each_in_args(args, see);
            }
            Stmt::Do(_, args) | Stmt::Split(_, args) => each_in_args(args, see),
            Stmt::Exit | Stmt::Continue | Stmt::Return => {}
        }
        bodies(stmt).into_iter().for_each(|body| each(body, see));
    }
}

/// Shows everything in an expression, itself first.
pub(crate) fn each_in_expr<'t>(expr: &'t Expr, see: &mut dyn FnMut(Node<'t>)) {
    see(Node::Expr(expr));
    match &expr.kind {
        ExprKind::Lit(..) => {}
        ExprKind::Get(place) => each_in_place(place, see),
        ExprKind::Bin(_, left, right) => [left, right].into_iter().for_each(|expr| each_in_expr(expr, see)),
        ExprKind::Neg(inner)
        | ExprKind::Not(inner)
        | ExprKind::Widen(inner)
        | ExprKind::Conv(inner)
        | ExprKind::Trunc(inner) => each_in_expr(inner, see),
        ExprKind::Std(_, inputs) => inputs.iter().for_each(|input| each_in_expr(input, see)),
        ExprKind::Call(_, args) => each_in_args(args, see),
    }
}

fn each_in_args<'t>(args: &'t [Arg], see: &mut dyn FnMut(Node<'t>)) {
    for arg in args {
        match arg {
            Arg::In(_, value) | Arg::En(value) => each_in_expr(value, see),
            Arg::InOut(_, place) | Arg::Out(_, place) | Arg::Eno(place) => each_in_place(place, see),
        }
    }
}

/// Shows a place and everything in its indices.
pub(crate) fn each_in_place<'t>(place: &'t Place, see: &mut dyn FnMut(Node<'t>)) {
    see(Node::Place(place));
    for step in &place.steps {
        if let Step::Index(indices) = step {
            indices.iter().for_each(|index| each_in_expr(index, see));
        }
    }
}

/// The lists of statements in a statement.
pub(crate) fn bodies(stmt: &Stmt) -> Vec<&Vec<Stmt>> {
    match stmt {
        Stmt::If(branches, otherwise) => branches.iter().map(|(_, body)| body).chain([otherwise]).collect(),
        Stmt::Case(_, branches, otherwise) => branches.iter().map(|(_, body)| body).chain([otherwise]).collect(),
        Stmt::For(.., body) | Stmt::While(.., body) | Stmt::Repeat(.., body) => vec![body],
        Stmt::Assign(..)
        | Stmt::Call(..)
        | Stmt::Do(..)
        | Stmt::Split(..)
        | Stmt::Exit
        | Stmt::Continue
        | Stmt::Return => Vec::new(),
    }
}

/// The same, to change them.
pub(crate) fn bodies_mut(stmt: &mut Stmt) -> Vec<&mut Vec<Stmt>> {
    match stmt {
        Stmt::If(branches, otherwise) => branches.iter_mut().map(|(_, body)| body).chain([otherwise]).collect(),
        Stmt::Case(_, branches, otherwise) => branches.iter_mut().map(|(_, body)| body).chain([otherwise]).collect(),
        Stmt::For(.., body) | Stmt::While(.., body) | Stmt::Repeat(.., body) => vec![body],
        Stmt::Assign(..)
        | Stmt::Call(..)
        | Stmt::Do(..)
        | Stmt::Split(..)
        | Stmt::Exit
        | Stmt::Continue
        | Stmt::Return => Vec::new(),
    }
}

/// What a changing walk comes by.
pub(crate) enum Change<'t> {
    /// An expression, after what is in it.
    Expr(&'t mut Expr),
    /// What is stored in a place of a type, after what is in it.
    Store(Ty, &'t mut Expr),
    /// A place, after its indices.
    Place(&'t mut Place),
    /// The arguments of a call of a function, after what is in them.
    Function(usize, &'t mut Vec<Arg>),
    /// The arguments of a call of an instance of a type, after what is in them.
    Block(Ty, &'t mut Vec<Arg>),
}

/// Lets every place and call in a list of statements be changed.
pub(crate) fn change(list: &mut [Stmt], with: &mut dyn FnMut(Change<'_>)) {
    for stmt in list {
        match stmt {
            Stmt::Assign(place, value) => {
                change_place(place, with);
                change_expr(value, with);
                with(Change::Store(place.ty, value));
            }
            Stmt::If(branches, _) => branches.iter_mut().for_each(|(condition, _)| change_expr(condition, with)),
            Stmt::Case(selector, ..) => change_expr(selector, with),
            Stmt::For(_, from, to, by, _) => {
                [from, to].into_iter().chain(by).for_each(|expr| change_expr(expr, with));
            }
            Stmt::While(_, _, condition, _) | Stmt::Repeat(_, _, condition, _) => change_expr(condition, with),
            Stmt::Call(place, args) => {
                change_place(place, with);
                change_args(args, with);
                with(Change::Block(place.ty, args));
            }
            Stmt::Do(unit, args) => {
                change_args(args, with);
                with(Change::Function(*unit, args));
            }
            Stmt::Split(_, args) => change_args(args, with),
            Stmt::Exit | Stmt::Continue | Stmt::Return => {}
        }
        bodies_mut(stmt).into_iter().for_each(|body| change(body, with));
    }
}

fn change_expr(expr: &mut Expr, with: &mut dyn FnMut(Change<'_>)) {
    match &mut expr.kind {
        ExprKind::Lit(..) => {}
        ExprKind::Get(place) => change_place(place, with),
        ExprKind::Bin(_, left, right) => [left, right].into_iter().for_each(|expr| change_expr(expr, with)),
        ExprKind::Neg(inner)
        | ExprKind::Not(inner)
        | ExprKind::Widen(inner)
        | ExprKind::Conv(inner)
        | ExprKind::Trunc(inner) => change_expr(inner, with),
        ExprKind::Std(_, inputs) => inputs.iter_mut().for_each(|input| change_expr(input, with)),
        ExprKind::Call(unit, args) => {
            change_args(args, with);
            with(Change::Function(*unit, args));
        }
    }
    with(Change::Expr(expr));
}

fn change_args(args: &mut [Arg], with: &mut dyn FnMut(Change<'_>)) {
    for arg in args {
        match arg {
            Arg::In(_, value) | Arg::En(value) => change_expr(value, with),
            Arg::InOut(_, place) | Arg::Out(_, place) | Arg::Eno(place) => change_place(place, with),
        }
    }
}

fn change_place(place: &mut Place, with: &mut dyn FnMut(Change<'_>)) {
    for step in &mut place.steps {
        if let Step::Index(indices) = step {
            indices.iter_mut().for_each(|index| change_expr(index, with));
        }
    }
    with(Change::Place(place));
}
