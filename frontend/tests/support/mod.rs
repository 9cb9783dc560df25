//! What the tests of the syntax share: parsing a text, and a tree as one line of text.

use khz_frontend::diagnostics::Diagnostic;
use khz_frontend::source::SourceMap;
use khz_frontend::syntax::ast::*;

/// The sample programs: name and text.
pub const SAMPLES: [(&str, &str); 6] = [
    ("everything", include_str!("../samples/everything.st")),
    ("machine", include_str!("../samples/machine.st")),
    ("pid", include_str!("../samples/pid.st")),
    ("sort", include_str!("../samples/sort.st")),
    ("strings", include_str!("../samples/strings.st")),
    ("crc32", include_str!("../samples/crc32.st")),
];

/// Parses one text.
pub fn parse(text: &str) -> (Ast, Vec<Diagnostic>, SourceMap) {
    let mut sources = SourceMap::new();
    sources.add_text("a.st", text);
    let (ast, found) = khz_frontend::parse(&sources);
    (ast, found, sources)
}

/// `LINE:COLUMN CODE message` of each diagnostic.
pub fn messages(text: &str) -> Vec<String> {
    let (_, found, sources) = parse(text);
    let line = |one: &Diagnostic| {
        let place = sources.line_column(one.span);
        format!("{}:{} {} {}", place.line, place.column, one.code(), one.message)
    };
    found.iter().map(line).collect()
}

/// The statements of a program's body as text, one each; panics if the text has errors.
pub fn statements(body: &str) -> Vec<String> {
    let text = format!("PROGRAM p\n{body}\nEND_PROGRAM\n");
    let (ast, found, _) = parse(&text);
    assert!(found.is_empty(), "{body}: {found:?}");
    let printer = Printer { names: &ast.names };
    match ast.declarations().next() {
        Some(Declaration::Pou(pou)) => pou.body.statements.iter().map(|one| printer.stmt(one)).collect(),
        other => panic!("no program: {other:?}"),
    }
}

/// An expression as text.
pub fn expression(text: &str) -> String {
    let mut all = statements(&format!("x := {text};"));
    assert_eq!(all.len(), 1);
    all.remove(0).trim_start_matches("x := ").to_owned()
}

/// Writes trees with all parentheses.
pub struct Printer<'a> {
    pub names: &'a khz_frontend::syntax::symbol::Interner,
}

impl Printer<'_> {
    pub fn name(&self, name: &Ident) -> String {
        self.names.text(name.spelling).to_owned()
    }

    pub fn expr(&self, expr: &Expr) -> String {
        let list = |all: &[Expr]| all.iter().map(|one| self.expr(one)).collect::<Vec<_>>().join(", ");
        match &expr.kind {
            ExprKind::Literal(literal) => match &literal.ty {
                Some(ty) => format!("{}#{:?}", self.name(ty), literal.value),
                None => match &literal.value {
                    LiteralValue::Int { magnitude, .. } => magnitude.to_string(),
                    LiteralValue::Real { value, .. } => format!("{value:?}"),
                    LiteralValue::Bool(value) => value.to_string(),
                    LiteralValue::Time { value_ns, .. } => format!("{value_ns}ns"),
                    other => format!("{other:?}"),
                },
            },
            ExprKind::Name(name) => self.name(name),
            ExprKind::EnumValue { ty, value } => format!("{}#{}", self.name(ty), self.name(value)),
            ExprKind::Direct(address) => format!("%{:?}{:?}{:?}", address.area, address.size, address.path),
            ExprKind::Member { base, member } => format!("{}.{}", self.expr(base), self.name(member)),
            ExprKind::Index { base, indices } => format!("{}[{}]", self.expr(base), list(indices)),
            ExprKind::Deref { base } => format!("{}^", self.expr(base)),
            ExprKind::Part { base, size, index, .. } => format!("{}.{size:?}{index}", self.expr(base)),
            ExprKind::Call { callee, args } => {
                let args: Vec<_> = args.iter().map(|arg| self.arg(arg)).collect();
                format!("{}({})", self.expr(callee), args.join(", "))
            }
            ExprKind::Unary { op, operand, .. } => format!("({} {})", op.text(), self.expr(operand)),
            ExprKind::Binary { op, lhs, rhs, .. } => format!("({} {} {})", self.expr(lhs), op.text(), self.expr(rhs)),
            ExprKind::Error => "<error>".to_owned(),
        }
    }

    fn arg(&self, arg: &Arg) -> String {
        let text = |value: &Option<Expr>| value.as_ref().map_or("-".to_owned(), |value| self.expr(value));
        match &arg.kind {
            ArgKind::Positional(value) => self.expr(value),
            ArgKind::Input { name, value } => format!("{} := {}", self.name(name), text(value)),
            ArgKind::Output { name, negated, target } => {
                format!("{}{} => {}", if *negated { "NOT " } else { "" }, self.name(name), text(target))
            }
        }
    }

    pub fn block(&self, block: &Block) -> String {
        let all: Vec<_> = block.statements.iter().map(|one| self.stmt(one)).collect();
        format!("{{{}}}", all.join("; "))
    }

    pub fn stmt(&self, stmt: &Stmt) -> String {
        match &stmt.kind {
            StmtKind::Assign { target, value, .. } => format!("{} := {}", self.expr(target), self.expr(value)),
            StmtKind::Call(call) => self.expr(call),
            StmtKind::If { branches, otherwise } => {
                let mut out = String::from("IF");
                for branch in branches {
                    out += &format!(" {} {}", self.expr(&branch.condition), self.block(&branch.body));
                }
                out + &otherwise.as_ref().map_or(String::new(), |block| format!(" ELSE {}", self.block(block)))
            }
            StmtKind::Case { selector, arms, otherwise } => {
                let mut out = format!("CASE {}", self.expr(selector));
                for arm in arms {
                    let labels: Vec<_> = arm.labels.iter().map(|label| self.label(label)).collect();
                    out += &format!(" [{}] {}", labels.join(", "), self.block(&arm.body));
                }
                out + &otherwise.as_ref().map_or(String::new(), |block| format!(" ELSE {}", self.block(block)))
            }
            StmtKind::For { variable, from, to, by, body, .. } => format!(
                "FOR {} {} {} {} {}",
                self.expr(variable),
                self.expr(from),
                self.expr(to),
                by.as_ref().map_or("-".to_owned(), |by| self.expr(by)),
                self.block(body)
            ),
            StmtKind::While { condition, body, .. } => format!("WHILE {} {}", self.expr(condition), self.block(body)),
            StmtKind::Repeat { body, until, .. } => format!("REPEAT {} {}", self.block(body), self.expr(until)),
            StmtKind::Exit => "EXIT".to_owned(),
            StmtKind::Continue => "CONTINUE".to_owned(),
            StmtKind::Return => "RETURN".to_owned(),
            StmtKind::Empty => "EMPTY".to_owned(),
            StmtKind::Error => "<error>".to_owned(),
        }
    }

    fn label(&self, label: &CaseLabel) -> String {
        match label {
            CaseLabel::Value(value) => self.expr(value),
            CaseLabel::Range(range) => format!("{}..{}", self.expr(&range.low), self.expr(&range.high)),
        }
    }
}
