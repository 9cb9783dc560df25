//! Ways through the syntax tree. Its depth is limited by the parser.

use crate::syntax::ast::{
    ArgKind, ArrayDim, Block, CaseLabel, Expr, ExprKind, Ident, Init, InitKind, Stmt, StmtKind, TypeSpec, TypeSpecKind,
    VarSection,
};

/// All statements of a block, outer before inner.
pub(super) fn statements<'a>(block: &'a Block, visit: &mut dyn FnMut(&'a Stmt)) {
    for statement in &block.statements {
        visit(statement);
        for inner in statement.blocks() {
            statements(inner, visit);
        }
    }
}

/// The expressions of one statement itself, not of what it guards.
pub(super) fn own_expressions(statement: &Stmt) -> Vec<&Expr> {
    match &statement.kind {
        StmtKind::Assign { target, value, .. } => vec![target, value],
        StmtKind::Call(call) => vec![call],
        StmtKind::If { branches, .. } => branches.iter().map(|branch| &branch.condition).collect(),
        StmtKind::Case { selector, arms, .. } => {
            let mut all = vec![selector];
            for label in arms.iter().flat_map(|arm| &arm.labels) {
                match label {
                    CaseLabel::Value(value) => all.push(value),
                    CaseLabel::Range(range) => all.extend([&range.low, &range.high]),
                }
            }
            all
        }
        StmtKind::For { variable, from, to, by, .. } => {
            [variable, from, to].into_iter().chain(by).map(|expr| &**expr).collect()
        }
        StmtKind::While { condition, .. } => vec![condition],
        StmtKind::Repeat { until, .. } => vec![until],
        StmtKind::Exit | StmtKind::Continue | StmtKind::Return | StmtKind::Empty | StmtKind::Error => Vec::new(),
    }
}

/// An expression and all in it.
pub(super) fn expressions<'a>(expr: &'a Expr, visit: &mut dyn FnMut(&'a Expr)) {
    visit(expr);
    match &expr.kind {
        ExprKind::Member { base, .. } | ExprKind::Deref { base } | ExprKind::Part { base, .. } => {
            expressions(base, visit);
        }
        ExprKind::Index { base, indices } => {
            expressions(base, visit);
            indices.iter().for_each(|index| expressions(index, visit));
        }
        ExprKind::Call { callee, args } => {
            expressions(callee, visit);
            args.iter().filter_map(|arg| argument(&arg.kind)).for_each(|value| expressions(value, visit));
        }
        ExprKind::Unary { operand, .. } => expressions(operand, visit),
        ExprKind::Binary { lhs, rhs, .. } => {
            expressions(lhs, visit);
            expressions(rhs, visit);
        }
        ExprKind::Literal(_)
        | ExprKind::Name(_)
        | ExprKind::EnumValue { .. }
        | ExprKind::Direct(_)
        | ExprKind::Error => {}
    }
}

/// What an argument gives or takes.
pub(super) fn argument(kind: &ArgKind) -> Option<&Expr> {
    match kind {
        ArgKind::Positional(value) => Some(value),
        ArgKind::Input { value, .. } => value.as_ref(),
        ArgKind::Output { target, .. } => target.as_ref(),
    }
}

/// The expressions in variable sections: bounds, lengths, initial values.
pub(super) fn section_expressions<'a>(sections: &'a [VarSection], visit: &mut dyn FnMut(&'a Expr)) {
    for decl in sections.iter().flat_map(|section| &section.decls) {
        spec_expressions(&decl.ty, visit);
        if let Some(init) = &decl.init {
            init_expressions(init, visit);
        }
    }
}

fn spec_expressions<'a>(spec: &'a TypeSpec, visit: &mut dyn FnMut(&'a Expr)) {
    match &spec.kind {
        TypeSpecKind::String { length: Some(length), .. } => expressions(length, visit),
        TypeSpecKind::Subrange { range, .. } => {
            [&range.low, &range.high].into_iter().for_each(|e| expressions(e, visit));
        }
        TypeSpecKind::Enum { values, .. } => {
            values.iter().filter_map(|value| value.value.as_ref()).for_each(|value| expressions(value, visit));
        }
        TypeSpecKind::Array { dims, element } => {
            for dim in dims {
                if let ArrayDim::Range(range) = dim {
                    expressions(&range.low, visit);
                    expressions(&range.high, visit);
                }
            }
            spec_expressions(element, visit);
        }
        TypeSpecKind::Struct { fields, .. } => {
            for field in fields {
                spec_expressions(&field.ty, visit);
                field.init.iter().for_each(|init| init_expressions(init, visit));
            }
        }
        TypeSpecKind::Reference { target, .. } => spec_expressions(target, visit),
        TypeSpecKind::Named(_) | TypeSpecKind::String { length: None, .. } | TypeSpecKind::Error => {}
    }
}

fn init_expressions<'a>(init: &'a Init, visit: &mut dyn FnMut(&'a Expr)) {
    match &init.kind {
        InitKind::Expr(expr) => expressions(expr, visit),
        InitKind::Array(elements) => {
            for element in elements {
                element.repeat.iter().for_each(|repeat| expressions(repeat, visit));
                element.values.iter().for_each(|value| init_expressions(value, visit));
            }
        }
        InitKind::Struct(fields) => fields.iter().for_each(|field| init_expressions(&field.value, visit)),
    }
}

/// The variable that a place is, or is a part of.
pub(super) fn root(place: &Expr) -> Option<&Ident> {
    match &place.kind {
        ExprKind::Name(name) => Some(name),
        ExprKind::Member { base, .. }
        | ExprKind::Index { base, .. }
        | ExprKind::Deref { base }
        | ExprKind::Part { base, .. } => root(base),
        _ => None,
    }
}
