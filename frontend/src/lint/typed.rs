//! Ways through the typed tree.

use crate::analysis::tree::{Call, Expr, ExprKind, Place, Step, Stmt, StmtKind};

/// All expressions of statements, outer before inner.
pub(super) fn expressions<'a>(statements: &'a [Stmt], visit: &mut dyn FnMut(&'a Expr)) {
    for statement in statements {
        own_expressions(statement, visit);
        match &statement.kind {
            StmtKind::If { branches, otherwise } => {
                branches.iter().for_each(|(_, body)| expressions(body, visit));
                expressions(otherwise, visit);
            }
            StmtKind::Case { arms, otherwise, .. } => {
                arms.iter().for_each(|arm| expressions(&arm.body, visit));
                expressions(otherwise, visit);
            }
            StmtKind::For(found) => expressions(&found.body, visit),
            StmtKind::While { body, .. } | StmtKind::Repeat { body, .. } => expressions(body, visit),
            _ => {}
        }
    }
}

fn own_expressions<'a>(statement: &'a Stmt, visit: &mut dyn FnMut(&'a Expr)) {
    match &statement.kind {
        StmtKind::Assign { target, value } => {
            in_place(target, visit);
            in_expr(value, visit);
        }
        StmtKind::Call(call) => in_call(call, visit),
        StmtKind::Evaluate(expr) => in_expr(expr, visit),
        StmtKind::If { branches, .. } => branches.iter().for_each(|(condition, _)| in_expr(condition, visit)),
        StmtKind::Case { selector, .. } => in_expr(selector, visit),
        StmtKind::For(found) => [&found.from, &found.to, &found.by].into_iter().for_each(|expr| in_expr(expr, visit)),
        StmtKind::While { condition, .. } => in_expr(condition, visit),
        StmtKind::Repeat { until, .. } => in_expr(until, visit),
        StmtKind::Exit | StmtKind::Continue | StmtKind::Return => {}
    }
}

fn in_expr<'a>(expr: &'a Expr, visit: &mut dyn FnMut(&'a Expr)) {
    visit(expr);
    match &expr.kind {
        ExprKind::Const(_) | ExprKind::Kept | ExprKind::Bound(..) => {}
        ExprKind::Load(place) => in_place(place, visit),
        ExprKind::Unary(_, value) | ExprKind::Convert { value, .. } => in_expr(value, visit),
        ExprKind::ToIndex(value) | ExprKind::Check(value, ..) | ExprKind::Keep(value) => in_expr(value, visit),
        ExprKind::Binary(_, a, b) => {
            in_expr(a, visit);
            in_expr(b, visit);
        }
        ExprKind::Select(values) => values.iter().for_each(|value| in_expr(value, visit)),
        ExprKind::Mux(values) | ExprKind::Text(_, values) | ExprKind::Calendar(_, values) => {
            values.iter().for_each(|value| in_expr(value, visit));
        }
        ExprKind::Call(call) => in_call(call, visit),
        ExprKind::Enabled(enabled) => {
            enabled.en.iter().chain([&enabled.value]).for_each(|value| in_expr(value, visit));
            enabled.eno.iter().for_each(|place| in_place(place, visit));
        }
    }
}

fn in_call<'a>(call: &'a Call, visit: &mut dyn FnMut(&'a Expr)) {
    call.instance.iter().for_each(|place| in_place(place, visit));
    call.en.iter().for_each(|expr| in_expr(expr, visit));
    call.inputs.iter().for_each(|(_, expr)| in_expr(expr, visit));
    call.inouts.iter().for_each(|(_, place)| in_place(place, visit));
    for statement in call.before.iter().chain(&call.after) {
        own_expressions(statement, visit);
    }
}

fn in_place<'a>(place: &'a Place, visit: &mut dyn FnMut(&'a Expr)) {
    for step in &place.path {
        match step {
            Step::Index(_, indices) => indices.iter().for_each(|index| in_expr(index, visit)),
            Step::Character(_, index) => in_expr(index, visit),
            Step::Field(..) | Step::Part(..) => {}
        }
    }
}
