//! The tree as Structured Text.

use super::functions::{Function, row};
use super::position::{Key, Positions};
use super::spelling::{Style, address, type_name};
use super::tree::{
    Arg, Base, Class, Config, Def, Edge, Expr, ExprKind, Kind, Op, Place, Source, Step, Stmt, Ty, Unit, UnitKind,
    Value, Var,
};

/// The text of a program. The parentheses are those that precedence needs.
#[must_use]
pub fn print(source: &Source) -> String {
    print_positions(source).0
}

/// The text of a program, and where its parts stand in it.
#[must_use]
pub fn print_positions(source: &Source) -> (String, Positions) {
    let style = Style::new(source.style);
    let mut printer = Printer { source, unit: None, style, out: String::new(), positions: Positions::default() };
    printer.types();
    printer.globals();
    for (at, unit) in source.units.iter().enumerate().filter(|(_, unit)| !unit.gone) {
        printer.unit = Some(unit);
        let startup = source.config.as_ref().is_some_and(|config| config.startup == Some(at));
        printer.unit(unit, startup);
    }
    printer.unit = None;
    if let Some(config) = &source.config {
        printer.config(config);
    }
    printer.positions.finish(&printer.out);
    (printer.out, printer.positions)
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
        Op::Pow => 8,
    }
}

const UNARY: u8 = 9;
const ATOM: u8 = 10;

fn sign(op: Op) -> &'static str {
    match op {
        Op::Add => "+",
        Op::Sub => "-",
        Op::Mul => "*",
        Op::Div => "/",
        Op::Mod => "MOD",
        Op::And => "AND",
        Op::Or => "OR",
        Op::Xor => "XOR",
        Op::AndThen => "AND_THEN",
        Op::OrElse => "OR_ELSE",
        Op::Eq => "=",
        Op::Ne => "<>",
        Op::Lt => "<",
        Op::Le => "<=",
        Op::Gt => ">",
        Op::Ge => ">=",
        Op::Pow => "**",
    }
}

struct Printer<'s> {
    source: &'s Source,
    unit: Option<&'s Unit>,
    style: Style,
    out: String,
    positions: Positions,
}

impl<'s> Printer<'s> {
    fn put(&mut self, text: &str) {
        self.out.push_str(text);
    }

    fn line(&mut self, text: &str) {
        self.put(text);
        // What must not matter.
        if self.style.chance(2) {
            self.put(" // line");
        }
        if self.style.chance(2) {
            self.put(" (* in (* nested *) one *)");
        }
        self.out.push('\n');
    }

    fn pragma(&mut self) {
        if self.style.chance(4) {
            self.line("{attribute 'displaymode' := 'hex'}");
        }
    }

    fn types(&mut self) {
        for ty in self.source.types.iter().filter(|ty| !ty.gone && !ty.name.is_empty()) {
            if let Some(def) = self.style.definition(self.source, &ty.def) {
                self.pragma();
                self.line(&format!("TYPE {} : {def}; END_TYPE", ty.name));
            }
        }
    }

    fn globals(&mut self) {
        let source = self.source;
        for (heading, retain, constant) in
            [("VAR_GLOBAL", false, false), ("VAR_GLOBAL RETAIN", true, false), ("VAR_GLOBAL CONSTANT", false, true)]
        {
            let fits = |var: &&Var| !var.gone && var.retain == retain && (var.class == Class::Constant) == constant;
            self.section(heading, source.globals.iter().filter(fits));
        }
    }

    fn section(&mut self, heading: &str, vars: impl Iterator<Item = &'s Var>) {
        let mut vars = vars.peekable();
        if vars.peek().is_none() {
            return;
        }
        self.line(heading);
        for var in vars {
            self.pragma();
            self.var(var);
        }
        self.line("END_VAR");
    }

    fn var(&mut self, var: &Var) {
        let at = match (var.at, self.source.plain(var.ty)) {
            (Some(at), Ty::K(kind)) => format!(" AT {}", address(at, kind)),
            _ => String::new(),
        };
        let init = var.init.as_ref().map(|value| format!(" := {}", self.style.initial(self.source, var.ty, value)));
        let ty = type_name(self.source, var.ty);
        let edge = match var.edge {
            None => "",
            Some(Edge::Rising) => " R_EDGE",
            Some(Edge::Falling) => " F_EDGE",
        };
        self.line(&format!("  {}{at} : {ty}{edge}{};", var.name, init.unwrap_or_default()));
    }

    fn unit(&mut self, unit: &'s Unit, startup: bool) {
        let (word, result) = match unit.kind {
            UnitKind::Function => ("FUNCTION", unit.vars.first().filter(|var| var.class == Class::Return)),
            UnitKind::Block => ("FUNCTION_BLOCK", None),
            UnitKind::Program => ("PROGRAM", None),
        };
        self.pragma();
        if startup {
            self.line("{attribute 'startup'}");
        }
        let result = result.map(|var| format!(" : {}", type_name(self.source, var.ty)));
        self.line(&format!("{word} {}{}", unit.name, result.unwrap_or_default()));
        let sections = [
            (Class::Input, false, "VAR_INPUT"),
            (Class::InOut, false, "VAR_IN_OUT"),
            (Class::Output, false, "VAR_OUTPUT"),
            (Class::Var, false, "VAR"),
            (Class::Var, true, "VAR RETAIN"),
            (Class::Temp, false, "VAR_TEMP"),
            (Class::Constant, false, "VAR CONSTANT"),
        ];
        for (class, retain, heading) in sections {
            let fits = |var: &&Var| var.class == class && var.retain == retain && !var.gone;
            self.section(heading, unit.vars.iter().filter(fits));
        }
        self.list(&unit.body, 1);
        self.line(&format!("END_{word}"));
    }

    fn config(&mut self, config: &Config) {
        self.line("CONFIGURATION plant\n  RESOURCE cpu ON PLC");
        for task in &config.tasks {
            let single = task.single.map(|at| format!("SINGLE := {}, ", self.source.globals[at].name));
            let interval = task.interval_us.map(|us| format!("INTERVAL := T#{us}us, "));
            let (single, interval) = (single.unwrap_or_default(), interval.unwrap_or_default());
            self.line(&format!("    TASK {}({single}{interval}PRIORITY := {});", task.name, task.priority));
        }
        for instance in &config.instances {
            let task = instance.task.map(|task| format!(" WITH {}", config.tasks[task].name));
            let unit = &self.source.units[instance.unit];
            self.put(&format!("    PROGRAM {}{} : {}", instance.name, task.unwrap_or_default(), unit.name));
            if !instance.args.is_empty() {
                self.put("(");
                self.args(&instance.args, &|at| unit.vars[at].name.clone());
                self.put(")");
            }
            self.line(";");
        }
        self.line("  END_RESOURCE\nEND_CONFIGURATION");
    }

    fn name(&mut self, name: &str) {
        let text = if self.style.chance(3) { name.to_uppercase() } else { name.to_string() };
        self.put(&text);
    }

    fn var_name(&mut self, at: usize) {
        let name = self.unit.map_or("?", |unit| unit.vars[at].name.as_str());
        self.name(name);
    }

    fn place(&mut self, place: &Place) {
        self.positions.note(Key::of_place(place), self.out.len());
        let mut ty = match place.base {
            Base::Global(at) => {
                self.name(&self.source.globals[at].name);
                self.source.globals[at].ty
            }
            Base::Var(at) => {
                self.var_name(at);
                self.unit.map_or(Ty::S(0), |unit| unit.vars[at].ty)
            }
            Base::Direct(at) => {
                let kind = if let Ty::K(kind) = place.ty { kind } else { Kind::Bool };
                self.put(&address(at, kind));
                place.ty
            }
        };
        for step in &place.steps {
            if let Step::Part(first, count) = step {
                let text = match count {
                    1 if self.style.chance(40) => format!(".%X{first}"),
                    1 => format!(".{first}"),
                    8 => format!(".%B{}", first / 8),
                    16 => format!(".%W{}", first / 16),
                    _ => format!(".%D{}", first / 32),
                };
                self.put(&text);
                break;
            }
            if let (Step::Index(indices), Some(_)) = (step, ty.capacity()) {
                self.put("[");
                self.joined(indices, |_, _| {});
                self.put("]");
                break;
            }
            let Ty::N(id) = ty else { panic!("a step into {ty:?}") };
            match (step, &self.source.types[id].def) {
                (Step::Field(at), def) => {
                    let name = match def {
                        Def::Struct(fields) => fields[*at].0.clone(),
                        Def::Block(unit) => self.source.units[*unit].vars[*at].name.clone(),
                        Def::Standard(standard) => standard.fields()[*at].0.to_string(),
                        other => panic!("no field of {other:?}"),
                    };
                    ty = self.source.field_type(def, *at);
                    self.put(&format!(".{name}"));
                }
                (Step::Index(indices), Def::Array(_, element)) => {
                    self.put("[");
                    self.joined(indices, |_, _| {});
                    self.put("]");
                    ty = *element;
                }
                (step, def) => panic!("{step:?} into {def:?}"),
            }
        }
    }

    fn joined(&mut self, list: &[Expr], before: impl Fn(&mut Self, usize)) {
        for (at, expr) in list.iter().enumerate() {
            if at > 0 {
                self.put(", ");
            }
            before(self, at);
            self.expr(expr, 0);
        }
    }

    /// An expression in parentheses that it would not need: they count as its beginning.
    fn enclosed(&mut self, expr: &Expr) {
        let start = self.out.len();
        self.put("(");
        self.expr(expr, 0);
        self.put(")");
        let mut inner = expr;
        loop {
            self.positions.note(Key::of_expr(inner), start);
            match &inner.kind {
                ExprKind::Widen(next) => inner = next,
                ExprKind::Get(place) => return self.positions.note(Key::of_place(place), start),
                _ => return,
            }
        }
    }

    /// An expression where at least `least` binding strength is wanted.
    fn expr(&mut self, expr: &Expr, least: u8) {
        self.positions.note(Key::of_expr(expr), self.out.len());
        let own = match &expr.kind {
            ExprKind::Widen(inner) => return self.expr(inner, least),
            ExprKind::Bin(Op::AndThen | Op::OrElse, ..) => 0,
            ExprKind::Bin(op, ..) => strength(*op),
            ExprKind::Neg(_) | ExprKind::Not(_) => UNARY,
            ExprKind::Lit(value, typed) => {
                let text = self.style.literal(self.source, expr.ty, value, *typed);
                let wrapped = text.starts_with('-') && least > UNARY - 1;
                return self.put(&if wrapped { format!("({text})") } else { text });
            }
            _ => ATOM,
        };
        if own < least {
            self.put("(");
        }
        self.open(expr);
        if own < least {
            self.put(")");
        }
    }

    fn open(&mut self, expr: &Expr) {
        match &expr.kind {
            ExprKind::Lit(..) | ExprKind::Widen(_) => {}
            ExprKind::Get(place) => self.place(place),
            ExprKind::Bin(op, left, right) => {
                // Short forms in a chain with long ones would hang on how they group; `**` next to a sign too.
                let alone = matches!(op, Op::AndThen | Op::OrElse);
                let inner = if alone { UNARY } else { strength(*op) };
                let inner = if *op == Op::Pow { ATOM } else { inner };
                self.expr(left, inner);
                let text = if *op == Op::And && self.style.chance(15) { "&" } else { sign(*op) };
                self.put(&format!(" {text} "));
                self.expr(right, (inner + 1).min(ATOM));
            }
            ExprKind::Neg(inner) => {
                self.put("-");
                self.expr(inner, ATOM);
            }
            ExprKind::Not(inner) => {
                self.put("NOT ");
                self.expr(inner, ATOM);
            }
            ExprKind::Conv(inner) | ExprKind::Trunc(inner) => {
                let word = if matches!(expr.kind, ExprKind::Trunc(_)) { "TRUNC" } else { "TO" };
                let base = |ty: Ty| match ty {
                    Ty::K(kind) => kind.name().to_string(),
                    Ty::N(_) => type_name(self.source, ty),
                    Ty::S(_) => "STRING".to_string(),
                    Ty::W(_) => "WSTRING".to_string(),
                };
                let (from, to) = (base(inner.ty), base(expr.ty));
                // What the argument is says it too, unless that is a literal without a type.
                let is_short = self.style.chance(20) && matches!(inner.kind, ExprKind::Get(_));
                self.put(&if is_short { format!("{word}_{to}(") } else { format!("{from}_{word}_{to}(") });
                self.expr(inner, 0);
                self.put(")");
            }
            ExprKind::Std(function, inputs) => {
                let row = row(*function);
                if let (Function::Not, [input]) = (function, inputs.as_slice()) {
                    // With one operand in parentheses it is the operator.
                    self.put("NOT ");
                    return self.enclosed(input);
                }
                self.put(&format!("{}(", row.name));
                let is_formal = self.style.chance(20);
                self.joined(inputs, |printer, at| {
                    let last = row.parameters.len() - 1;
                    let name = row.parameters[at.min(last)].name;
                    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
                    let number = name[stem.len()..].parse::<usize>();
                    let name = match number {
                        Ok(number) if at > last => format!("{stem}{}", number + at - last),
                        _ => name.to_string(),
                    };
                    if is_formal {
                        printer.put(&format!("{name} := "));
                    }
                });
                self.put(")");
            }
            ExprKind::Call(unit, args) => self.call_function(*unit, args),
        }
    }

    fn call_function(&mut self, unit: usize, args: &[Arg]) {
        let callee = &self.source.units[unit];
        self.put(&format!("{}(", callee.name));
        let of = |class: Class| (0..callee.vars.len()).filter(move |at| callee.vars[*at].class == class);
        let wanted: Vec<usize> = of(Class::Input).chain(of(Class::InOut)).collect();
        let given: Option<Vec<usize>> = args
            .iter()
            .map(|arg| if let Arg::In(at, _) | Arg::InOut(at, _) = arg { Some(*at) } else { None })
            .collect();
        if given.is_some_and(|given| given == wanted) && self.style.chance(40) {
            for (at, arg) in args.iter().enumerate() {
                if at > 0 {
                    self.put(", ");
                }
                match arg {
                    Arg::In(_, value) => self.expr(value, 0),
                    Arg::InOut(_, place) => self.place(place),
                    _ => {}
                }
            }
        } else {
            self.args(args, &|at| callee.vars[at].name.clone());
        }
        self.put(")");
    }

    /// A call of a standard function with outputs: by position when all before one that is given are given too.
    fn split(&mut self, function: Function, args: &[Arg]) {
        let row = row(function);
        self.put(&format!("{}(", row.name));
        let is_next = |(wanted, arg): (usize, &Arg)| matches!(arg, Arg::In(at, _) | Arg::Out(at, _) if *at == wanted);
        if args.iter().enumerate().all(is_next) && self.style.chance(40) {
            for arg in args {
                match arg {
                    Arg::In(_, value) => self.expr(value, 0),
                    Arg::Out(_, place) => {
                        self.put(", ");
                        self.place(place);
                    }
                    _ => {}
                }
            }
        } else {
            self.args(args, &|at| at.checked_sub(1).map_or("IN", |at| row.outputs[at]).to_string());
        }
        self.put(")");
    }

    fn args(&mut self, args: &[Arg], name: &dyn Fn(usize) -> String) {
        for (number, arg) in args.iter().enumerate() {
            if number > 0 {
                self.put(", ");
            }
            match arg {
                Arg::In(at, value) => {
                    self.put(&format!("{} := ", name(*at)));
                    self.expr(value, 0);
                }
                Arg::InOut(at, place) => {
                    self.put(&format!("{} := ", name(*at)));
                    self.place(place);
                }
                Arg::Out(at, place) => {
                    self.put(&format!("{} => ", name(*at)));
                    self.place(place);
                }
                Arg::En(value) => {
                    self.put("EN := ");
                    self.expr(value, 0);
                }
                Arg::Eno(place) => {
                    self.put("ENO => ");
                    self.place(place);
                }
            }
        }
    }

    fn list(&mut self, list: &[Stmt], depth: usize) {
        for stmt in list {
            self.stmt(stmt, depth);
        }
    }

    fn begin(&mut self, depth: usize, text: &str) {
        self.put(&"  ".repeat(depth));
        self.put(text);
    }

    fn stmt(&mut self, stmt: &Stmt, depth: usize) {
        self.begin(depth, "");
        self.positions.note(Key::of_stmt(stmt), self.out.len());
        match stmt {
            Stmt::Assign(place, value) => {
                self.place(place);
                self.put(" := ");
                self.expr(value, 0);
                self.line(";");
            }
            Stmt::If(branches, otherwise) => self.if_statement(branches, otherwise, depth),
            Stmt::Case(selector, branches, otherwise) => {
                self.put("CASE ");
                self.expr(selector, 0);
                self.line(" OF");
                for (labels, body) in branches {
                    self.labels(selector.ty, labels, depth);
                    self.list(body, depth + 1);
                }
                self.otherwise(otherwise, depth);
                self.begin(depth, "END_CASE;\n");
            }
            Stmt::For(..) | Stmt::While(..) | Stmt::Repeat(..) => self.loop_statement(stmt, depth),
            Stmt::Call(place, args) => {
                let Ty::N(id) = place.ty else { panic!("a call of {place:?}") };
                let source = self.source;
                self.place(place);
                self.put("(");
                self.args(args, &|at| match &source.types[id].def {
                    Def::Block(unit) => source.units[*unit].vars[at].name.clone(),
                    Def::Standard(standard) => standard.fields()[at].0.to_string(),
                    _ => String::new(),
                });
                self.line(");");
            }
            Stmt::Do(unit, args) => {
                self.call_function(*unit, args);
                self.line(";");
            }
            Stmt::Split(function, args) => {
                self.split(*function, args);
                self.line(";");
            }
            Stmt::Exit => self.line("EXIT;"),
            Stmt::Continue => self.line("CONTINUE;"),
            Stmt::Return => self.line("RETURN;"),
        }
    }

    fn labels(&mut self, ty: Ty, labels: &[(i128, i128)], depth: usize) {
        let mut texts = Vec::new();
        for (low, high) in labels {
            let from = self.style.literal(self.source, ty, &Value::Int(*low), false);
            let to = self.style.literal(self.source, ty, &Value::Int(*high), false);
            texts.push(if low == high { from } else { format!("{from}..{to}") });
        }
        self.begin(depth, &format!("{}:\n", texts.join(", ")));
    }

    fn otherwise(&mut self, otherwise: &[Stmt], depth: usize) {
        if !otherwise.is_empty() {
            self.begin(depth, "ELSE\n");
            self.list(otherwise, depth + 1);
        }
    }

    fn if_statement(&mut self, branches: &[(Expr, Vec<Stmt>)], otherwise: &[Stmt], depth: usize) {
        for (at, (condition, body)) in branches.iter().enumerate() {
            if at == 0 {
                self.put("IF ");
            } else {
                self.begin(depth, "ELSIF ");
            }
            self.expr(condition, 0);
            self.line(" THEN");
            self.list(body, depth + 1);
        }
        self.otherwise(otherwise, depth);
        self.begin(depth, "END_IF;\n");
    }

    /// A loop; the keyword's line has been begun.
    fn loop_statement(&mut self, stmt: &Stmt, depth: usize) {
        match stmt {
            Stmt::For(control, from, to, by, body) => {
                self.put("FOR ");
                self.var_name(*control);
                self.put(" := ");
                self.expr(from, 0);
                self.put(" TO ");
                self.expr(to, 0);
                if let Some(by) = by {
                    self.put(" BY ");
                    self.expr(by, 0);
                }
                self.line(" DO");
                self.list(body, depth + 1);
                self.begin(depth, "END_FOR;\n");
            }
            Stmt::While(counter, limit, condition, body) => {
                let name = self.unit.map_or("?", |unit| unit.vars[*counter].name.as_str());
                self.line(&format!("{name} := 0;"));
                // The condition is not looked at when the counter is at its end.
                self.begin(depth, &format!("WHILE {name} < {limit} AND_THEN "));
                self.enclosed(condition);
                self.line(" DO");
                self.begin(depth, &format!("  {name} := {name} + 1;\n"));
                self.list(body, depth + 1);
                self.begin(depth, "END_WHILE;\n");
            }
            Stmt::Repeat(counter, limit, condition, body) => {
                let name = self.unit.map_or("?", |unit| unit.vars[*counter].name.as_str());
                self.line(&format!("{name} := 0;"));
                self.begin(depth, "REPEAT\n");
                self.begin(depth, &format!("  {name} := {name} + 1;\n"));
                self.list(body, depth + 1);
                self.begin(depth, &format!("UNTIL {name} >= {limit} OR_ELSE "));
                self.enclosed(condition);
                self.line(" END_REPEAT;");
            }
            _ => {}
        }
    }
}
