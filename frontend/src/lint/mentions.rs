//! Which names a unit mentions, and which ones others reach into it for.

use std::collections::BTreeSet;

use super::walk;
use crate::syntax::ast::{Ast, Block, Connection, Declaration, Expr, ExprKind, Pou, StmtKind, TestSuite, VarSection};
use crate::syntax::symbol::Symbol;

/// Names that a unit mentions anywhere behind their declarations.
pub(super) fn mentioned(pou: &Pou) -> BTreeSet<Symbol> {
    let mut found = BTreeSet::new();
    let mut note = |expr: &Expr| {
        if let ExprKind::Name(name) = &expr.kind {
            found.insert(name.symbol);
        }
    };
    each_expression(&pou.sections, &pou.body, &mut note);
    found
}

/// Names of variables that a unit writes, or hands to someone who may.
pub(super) fn written(body: &Block) -> BTreeSet<Symbol> {
    let mut found = BTreeSet::new();
    walk::statements(body, &mut |statement| {
        let target = match &statement.kind {
            StmtKind::Assign { target, .. } => Some(target),
            StmtKind::For { variable, .. } => Some(&**variable),
            _ => None,
        };
        found.extend(target.and_then(walk::root).map(|name| name.symbol));
        for expr in walk::own_expressions(statement) {
            walk::expressions(expr, &mut |inner| {
                if let ExprKind::Call { callee, args } = &inner.kind {
                    let given = args.iter().filter_map(|arg| walk::argument(&arg.kind));
                    let places = given.chain([&**callee]).filter_map(walk::root);
                    found.extend(places.map(|name| name.symbol));
                }
            });
        }
    });
    found
}

/// Names behind a dot anywhere: others reach into a unit by them.
pub(super) fn members(ast: &Ast) -> BTreeSet<Symbol> {
    let mut found = BTreeSet::new();
    let mut note = |expr: &Expr| {
        if let ExprKind::Member { member, .. } = &expr.kind {
            found.insert(member.symbol);
        }
    };
    for file in &ast.files {
        for declaration in &file.declarations {
            match declaration {
                Declaration::Pou(pou) => each_expression(&pou.sections, &pou.body, &mut note),
                Declaration::Configuration(configuration) => {
                    for resource in &configuration.resources {
                        let params = resource.tasks.iter().flat_map(|task| &task.params).map(|param| &param.value);
                        let connections = resource.programs.iter().flat_map(|program| &program.connections);
                        let ends = connections.flat_map(|connection| match connection {
                            Connection::Source { variable, source } => vec![variable, source],
                            Connection::Sink { variable, sink } => vec![variable, sink],
                            Connection::FbTask { fb, .. } => vec![fb],
                        });
                        params.chain(ends).for_each(|expr| walk::expressions(expr, &mut note));
                    }
                }
                Declaration::Type(_) | Declaration::Globals(_) => {}
            }
        }
        let TestSuite { setup, teardown, tests, .. } = &file.tests;
        let parts = setup.iter().chain(teardown).chain(tests.iter().map(|test| &test.part));
        parts.for_each(|part| each_expression(&part.sections, &part.body, &mut note));
    }
    found
}

fn each_expression<'a>(sections: &'a [VarSection], body: &'a Block, note: &mut dyn FnMut(&'a Expr)) {
    walk::section_expressions(sections, note);
    walk::statements(body, &mut |statement| {
        walk::own_expressions(statement).into_iter().for_each(|expr| walk::expressions(expr, note));
    });
}
