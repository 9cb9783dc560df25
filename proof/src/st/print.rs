//! The tree as Structured Text.

use std::fmt::Write;

use super::tree::{
    Arg, Base, Class, Def, Expr, ExprKind, Kind, Op, Place, Source, Step, Stmt, Ty, Unit, UnitKind, Value, Var,
};

/// The text of a program. The parentheses are those that precedence needs.
#[must_use]
pub fn print(source: &Source) -> String {
    let mut out = String::new();
    let types = source.types.iter().filter(|ty| !ty.gone && !ty.name.is_empty());
    for ty in types {
        if let Some(def) = definition(source, &ty.def) {
            let _ = writeln!(out, "TYPE {} : {def}; END_TYPE", ty.name);
        }
    }
    let printer = Printer { source, unit: None };
    if source.globals.iter().any(|var| !var.gone) {
        out.push_str("VAR_GLOBAL\n");
        source.globals.iter().filter(|var| !var.gone).for_each(|var| printer.var(var, &mut out));
        out.push_str("END_VAR\n");
    }
    for unit in source.units.iter().filter(|unit| !unit.gone) {
        Printer { source, unit: Some(unit) }.unit(unit, &mut out);
    }
    out
}

fn definition(source: &Source, def: &Def) -> Option<String> {
    Some(match def {
        Def::Struct(fields) => {
            let mut text = String::from("STRUCT ");
            for (name, ty, init) in fields {
                let init =
                    init.as_ref().map_or(String::new(), |value| format!(" := {}", literal(source, *ty, value, false)));
                let _ = write!(text, "{name} : {}{init}; ", type_name(source, *ty));
            }
            text + "END_STRUCT"
        }
        Def::Enum(values) => {
            let parts: Vec<String> = values.iter().map(|(name, value)| format!("{name} := {value}")).collect();
            format!("({})", parts.join(", "))
        }
        Def::Subrange(base, low, high) => format!("{}({low}..{high})", base.name()),
        Def::Array(dims, element) => {
            let dims: Vec<String> = dims.iter().map(|(low, high)| format!("{low}..{high}")).collect();
            format!("ARRAY[{}] OF {}", dims.join(", "), type_name(source, *element))
        }
        Def::Block(_) | Def::Standard(_) => return None,
    })
}

fn type_name(source: &Source, ty: Ty) -> String {
    match ty {
        Ty::K(kind) => kind.name().to_string(),
        Ty::S(80) => "STRING".to_string(),
        Ty::S(capacity) => format!("STRING[{capacity}]"),
        Ty::N(id) => match &source.types[id].def {
            Def::Block(unit) => source.units[*unit].name.clone(),
            Def::Standard(standard) => standard.name().to_string(),
            def if source.types[id].name.is_empty() => definition(source, def).unwrap_or_default(),
            _ => source.types[id].name.clone(),
        },
    }
}

fn real(text: &str) -> String {
    match text.split_once('e') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.0e{exponent}"),
        None if !text.contains('.') => format!("{text}.0"),
        _ => text.to_string(),
    }
}

fn time(nanoseconds: i128) -> String {
    let sign = if nanoseconds < 0 { "-" } else { "" };
    let all = nanoseconds.unsigned_abs();
    format!("T#{sign}{}ms{}us{}ns", all / 1_000_000, all / 1000 % 1000, all % 1000)
}

fn quoted(bytes: &[u8]) -> String {
    let mut text = String::from("'");
    for byte in bytes {
        match byte {
            b'\'' => text.push_str("$'"),
            b'$' => text.push_str("$$"),
            32..=126 => text.push(char::from(*byte)),
            _ => drop(write!(text, "${byte:02X}")),
        }
    }
    text + "'"
}

/// A literal, with its type before it if `typed`.
pub(crate) fn literal(source: &Source, ty: Ty, value: &Value, typed: bool) -> String {
    let (prefix, plain) = match (ty, value) {
        (Ty::K(Kind::Bool), _) => return if value.int() == 0 { "FALSE" } else { "TRUE" }.to_string(),
        (Ty::K(Kind::Time), _) => return time(value.int()),
        (Ty::K(kind), Value::Int(value)) if kind.is_bits() => (kind.name(), format!("16#{value:X}")),
        (Ty::K(kind), Value::Int(value)) => (kind.name(), value.to_string()),
        (Ty::K(kind), Value::Real(value)) => (kind.name(), real(&format!("{value:?}"))),
        (Ty::K(kind), Value::Lreal(value)) => (kind.name(), real(&format!("{value:?}"))),
        (_, Value::Str(bytes)) => return quoted(bytes),
        (Ty::N(id), Value::Int(value)) => match &source.types[id].def {
            Def::Enum(values) => {
                let name = values.iter().find(|(_, known)| i128::from(*known) == *value).map_or("?", |(name, _)| name);
                return if typed { format!("{}#{name}", source.types[id].name) } else { name.to_string() };
            }
            _ => return value.to_string(),
        },
        (Ty::N(id), Value::Many(parts)) => {
            return match &source.types[id].def {
                Def::Array(_, element) => {
                    let parts: Vec<String> = parts.iter().map(|part| literal(source, *element, part, false)).collect();
                    format!("[{}]", parts.join(", "))
                }
                Def::Struct(fields) => {
                    let field = |((name, ty, _), part): (&(String, Ty, Option<Value>), &Value)| {
                        format!("{name} := {}", literal(source, *ty, part, false))
                    };
                    let parts: Vec<String> = fields.iter().zip(parts).map(field).collect();
                    format!("({})", parts.join(", "))
                }
                other => panic!("no literal of {other:?}"),
            };
        }
        _ => panic!("no literal of {ty:?}"),
    };
    if typed { format!("{prefix}#{plain}") } else { plain }
}

/// Binding strength, loosest first.
fn strength(op: Op) -> u8 {
    match op {
        Op::Or | Op::OrElse => 1,
        Op::Xor => 2,
        Op::And | Op::AndThen => 3,
        Op::Eq | Op::Ne => 4,
        Op::Lt | Op::Le | Op::Gt | Op::Ge => 5,
        Op::Add | Op::Sub => 6,
        Op::Mul | Op::Div | Op::Mod => 7,
    }
}

const UNARY: u8 = 8;
const ATOM: u8 = 9;

struct Printer<'s> {
    source: &'s Source,
    unit: Option<&'s Unit>,
}

impl Printer<'_> {
    fn var(&self, var: &Var, out: &mut String) {
        let init = var
            .init
            .as_ref()
            .map_or(String::new(), |value| format!(" := {}", literal(self.source, var.ty, value, false)));
        let _ = writeln!(out, "  {} : {}{init};", var.name, type_name(self.source, var.ty));
    }

    fn unit(&self, unit: &Unit, out: &mut String) {
        let (word, result) = match unit.kind {
            UnitKind::Function => ("FUNCTION", format!(" : {}", type_name(self.source, unit.vars[0].ty))),
            UnitKind::Block => ("FUNCTION_BLOCK", String::new()),
            UnitKind::Program => ("PROGRAM", String::new()),
        };
        let _ = writeln!(out, "{word} {}{result}", unit.name);
        let sections = [
            (Class::Input, "VAR_INPUT"),
            (Class::Output, "VAR_OUTPUT"),
            (Class::InOut, "VAR_IN_OUT"),
            (Class::Var, "VAR"),
            (Class::Temp, "VAR_TEMP"),
            (Class::Constant, "VAR CONSTANT"),
        ];
        for (class, heading) in sections {
            let vars = || unit.vars.iter().filter(|var| var.class == class && !var.gone);
            if vars().next().is_some() {
                let _ = writeln!(out, "{heading}");
                vars().for_each(|var| self.var(var, out));
                out.push_str("END_VAR\n");
            }
        }
        self.list(&unit.body, 1, out);
        let _ = writeln!(out, "END_{word}");
    }

    fn name(&self, at: usize) -> &str {
        self.unit.map_or("?", |unit| unit.vars[at].name.as_str())
    }

    fn place(&self, place: &Place) -> String {
        let (mut text, mut ty) = match place.base {
            Base::Global(at) => (self.source.globals[at].name.clone(), self.source.globals[at].ty),
            Base::Var(at) => (self.name(at).to_string(), self.unit.map_or(Ty::S(0), |unit| unit.vars[at].ty)),
        };
        for step in &place.steps {
            let Ty::N(id) = ty else { panic!("a step into {ty:?}") };
            match (step, &self.source.types[id].def) {
                (Step::Field(at), def) => {
                    let (name, next) = match def {
                        Def::Struct(fields) => (fields[*at].0.clone(), fields[*at].1),
                        Def::Block(unit) => {
                            let var = &self.source.units[*unit].vars[*at];
                            (var.name.clone(), var.ty)
                        }
                        Def::Standard(standard) => {
                            let (name, kind, _) = standard.fields()[*at];
                            (name.to_string(), Ty::K(kind))
                        }
                        other => panic!("no field of {other:?}"),
                    };
                    let _ = write!(text, ".{name}");
                    ty = next;
                }
                (Step::Index(indices), Def::Array(_, element)) => {
                    let indices: Vec<String> = indices.iter().map(|index| self.expr(index, 0)).collect();
                    let _ = write!(text, "[{}]", indices.join(", "));
                    ty = *element;
                }
                (step, def) => panic!("{step:?} into {def:?}"),
            }
        }
        text
    }

    /// An expression where at least `least` binding strength is wanted.
    fn expr(&self, expr: &Expr, least: u8) -> String {
        let (own, text) = match &expr.kind {
            ExprKind::Lit(value, typed) => {
                let text = literal(self.source, expr.ty, value, *typed);
                (if text.starts_with('-') { UNARY - 1 } else { ATOM }, text)
            }
            ExprKind::Get(place) => (ATOM, self.place(place)),
            ExprKind::Bin(op, left, right) => {
                const SIGNS: [&str; 16] = [
                    "+", "-", "*", "/", "MOD", "AND", "OR", "XOR", "AND_THEN", "OR_ELSE", "=", "<>", "<", "<=", ">",
                    ">=",
                ];
                let own = strength(*op);
                // Short forms in a chain with long ones would hang on how they group.
                let inner = if matches!(op, Op::AndThen | Op::OrElse) { UNARY } else { own };
                let left = self.expr(left, inner);
                let right = self.expr(right, inner + 1);
                let own = if matches!(op, Op::AndThen | Op::OrElse) { 0 } else { own };
                (own, format!("{left} {} {right}", SIGNS[*op as usize]))
            }
            ExprKind::Neg(inner) => (UNARY, format!("-{}", self.expr(inner, ATOM))),
            ExprKind::Not(inner) => (UNARY, format!("NOT {}", self.expr(inner, ATOM))),
            ExprKind::Widen(inner) => return self.expr(inner, least),
            ExprKind::Conv(inner) | ExprKind::Trunc(inner) => {
                let word = if matches!(expr.kind, ExprKind::Trunc(_)) { "TRUNC" } else { "TO" };
                let base = |ty: Ty| if let Ty::K(kind) = ty { kind.name() } else { "STRING" };
                (ATOM, format!("{}_{word}_{}({})", base(inner.ty), base(expr.ty), self.expr(inner, 0)))
            }
            ExprKind::Std(function, inputs) => {
                let inputs: Vec<String> = inputs.iter().map(|input| self.expr(input, 0)).collect();
                (ATOM, format!("{}({})", function.name(), inputs.join(", ")))
            }
            ExprKind::Call(unit, args) => {
                let callee = &self.source.units[*unit];
                (ATOM, format!("{}({})", callee.name, self.args(args, &|at| callee.vars[at].name.clone())))
            }
        };
        if own < least { format!("({text})") } else { text }
    }

    fn args(&self, args: &[Arg], name: &dyn Fn(usize) -> String) -> String {
        let arg = |arg: &Arg| match arg {
            Arg::In(at, value) => format!("{} := {}", name(*at), self.expr(value, 0)),
            Arg::InOut(at, place) => format!("{} := {}", name(*at), self.place(place)),
            Arg::Out(at, place) => format!("{} => {}", name(*at), self.place(place)),
        };
        args.iter().map(arg).collect::<Vec<_>>().join(", ")
    }

    fn list(&self, list: &[Stmt], depth: usize, out: &mut String) {
        for stmt in list {
            self.stmt(stmt, depth, out);
        }
    }

    fn stmt(&self, stmt: &Stmt, depth: usize, out: &mut String) {
        let pad = "  ".repeat(depth);
        // Writing to a String does not fail.
        let _ = match stmt {
            Stmt::Assign(place, value) => writeln!(out, "{pad}{} := {};", self.place(place), self.expr(value, 0)),
            Stmt::If(branches, otherwise) => {
                for (at, (condition, body)) in branches.iter().enumerate() {
                    let word = if at == 0 { "IF" } else { "ELSIF" };
                    let _ = writeln!(out, "{pad}{word} {} THEN", self.expr(condition, 0));
                    self.list(body, depth + 1, out);
                }
                if !otherwise.is_empty() {
                    let _ = writeln!(out, "{pad}ELSE");
                    self.list(otherwise, depth + 1, out);
                }
                writeln!(out, "{pad}END_IF;")
            }
            Stmt::Case(selector, branches, otherwise) => {
                let _ = writeln!(out, "{pad}CASE {} OF", self.expr(selector, 0));
                let label = |value: i128| literal(self.source, selector.ty, &Value::Int(value), false);
                for (labels, body) in branches {
                    let labels = labels.iter().map(|(low, high)| {
                        if low == high { label(*low) } else { format!("{}..{}", label(*low), label(*high)) }
                    });
                    let _ = writeln!(out, "{pad}{}:", labels.collect::<Vec<_>>().join(", "));
                    self.list(body, depth + 1, out);
                }
                if !otherwise.is_empty() {
                    let _ = writeln!(out, "{pad}ELSE");
                    self.list(otherwise, depth + 1, out);
                }
                writeln!(out, "{pad}END_CASE;")
            }
            Stmt::For(control, from, to, by, body) => {
                let by = by.as_ref().map_or(String::new(), |by| format!(" BY {}", self.expr(by, 0)));
                let (from, to) = (self.expr(from, 0), self.expr(to, 0));
                let _ = writeln!(out, "{pad}FOR {} := {from} TO {to}{by} DO", self.name(*control));
                self.list(body, depth + 1, out);
                writeln!(out, "{pad}END_FOR;")
            }
            Stmt::While(counter, limit, condition, body) => {
                let name = self.name(*counter);
                let _ = writeln!(out, "{pad}{name} := 0;");
                // The condition is not looked at when the counter is at its end.
                let _ = writeln!(out, "{pad}WHILE {name} < {limit} AND_THEN ({}) DO", self.expr(condition, 0));
                let _ = writeln!(out, "{pad}  {name} := {name} + 1;");
                self.list(body, depth + 1, out);
                writeln!(out, "{pad}END_WHILE;")
            }
            Stmt::Repeat(counter, limit, condition, body) => {
                let name = self.name(*counter);
                let _ = writeln!(out, "{pad}{name} := 0;\n{pad}REPEAT\n{pad}  {name} := {name} + 1;");
                self.list(body, depth + 1, out);
                writeln!(out, "{pad}UNTIL {name} >= {limit} OR_ELSE ({}) END_REPEAT;", self.expr(condition, 0))
            }
            Stmt::Call(place, args) => {
                let Ty::N(id) = place.ty else { panic!("a call of {place:?}") };
                let name = |at: usize| match &self.source.types[id].def {
                    Def::Block(unit) => self.source.units[*unit].vars[at].name.clone(),
                    Def::Standard(standard) => standard.fields()[at].0.to_string(),
                    _ => String::new(),
                };
                writeln!(out, "{pad}{}({});", self.place(place), self.args(args, &name))
            }
            Stmt::Exit => writeln!(out, "{pad}EXIT;"),
            Stmt::Continue => writeln!(out, "{pad}CONTINUE;"),
            Stmt::Return => writeln!(out, "{pad}RETURN;"),
        };
    }
}
