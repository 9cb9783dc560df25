//! One program of the subset as C functions: `pN_first` gives the initial values, `pN_scan` runs it once, `pN_show` prints the leaves.

use std::fmt::Write;

use super::super::functions::Function;
use super::super::tree::{Base, Class, Def, Expr, ExprKind, Kind, Op, Place, Source, Step, Stmt, Ty, Unit, Value};
use super::subset::operation;
use super::{kind_of, prelude, type_of};

/// How a scan ends early; the position in [`Trap::ALL`], from 1, is its number in C.
#[allow(missing_docs, reason = "the names are those of the traps")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trap {
    DivideByZero,
    ArrayIndex,
    Range,
}

impl Trap {
    /// By number in C, from 1.
    pub const ALL: [Trap; 3] = [Trap::DivideByZero, Trap::ArrayIndex, Trap::Range];
}

/// A value that is compared after each scan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Leaf {
    /// Its path in a dump.
    pub path: String,
    /// Its type: a number, a subrange or an enumeration.
    pub ty: Ty,
}

/// A program as C.
#[derive(Debug, Clone)]
pub struct Program {
    /// Its number in its file.
    pub number: usize,
    /// Its functions.
    pub text: String,
    /// What `pN_show` prints, in order.
    pub leaves: Vec<Leaf>,
}

impl Program {
    /// Prints a program of the [`subset`](super::subset()).
    ///
    /// # Panics
    /// When the program is not of the subset.
    #[must_use]
    pub fn new(source: &Source, number: usize) -> Program {
        let unit = source.units.last().expect("a program");
        let mut writer = Writer { source, unit, number, text: String::new(), depth: 1, fresh: 0, loops: Vec::new() };
        writer.declarations();
        let mut leaves = Vec::new();
        writer.first_and_show(&mut leaves);
        writer.scan();
        Program { number, text: writer.text, leaves }
    }
}

struct Writer<'s> {
    source: &'s Source,
    unit: &'s Unit,
    number: usize,
    text: String,
    depth: usize,
    /// Number of the next operand or label.
    fresh: usize,
    /// Labels of the loops around.
    loops: Vec<usize>,
}

impl Writer<'_> {
    fn line(&mut self, text: std::fmt::Arguments<'_>) {
        let pad = "  ".repeat(self.depth);
        // A String takes everything.
        let _ = writeln!(self.text, "{pad}{text}");
    }

    fn new_number(&mut self) -> usize {
        self.fresh += 1;
        self.fresh
    }

    /// The C type of a type.
    fn ty(&self, ty: Ty) -> String {
        match ty {
            Ty::N(id) => match &self.source.types[id].def {
                Def::Subrange(base, ..) => type_of(*base).to_string(),
                Def::Enum(..) => type_of(Kind::Lint).to_string(),
                _ => format!("struct p{}_{id}", self.number),
            },
            _ => type_of(kind_of(ty)).to_string(),
        }
    }

    /// Every variable: its name in C, its path in a dump, type, initial value, and whether each scan begins with it.
    fn variables(&self) -> Vec<(String, String, Ty, Value, Class)> {
        let source = self.source;
        let globals = source.globals.iter().enumerate().filter(|(_, var)| !var.gone);
        let globals =
            globals.map(|(at, var)| (self.global(at), var.name.clone(), var.ty, source.first(var), var.class));
        let own = self.unit.vars.iter().enumerate().filter(|(_, var)| !var.gone);
        let own = own.map(|(at, var)| {
            (self.own(at), format!("{}.{}", self.unit.name, var.name), var.ty, source.first(var), var.class)
        });
        globals.chain(own).collect()
    }

    fn global(&self, at: usize) -> String {
        format!("p{}_g{at}", self.number)
    }

    fn own(&self, at: usize) -> String {
        format!("p{}_v{at}", self.number)
    }

    fn declarations(&mut self) {
        self.depth = 0;
        let (source, number) = (self.source, self.number);
        for (id, ty) in source.types.iter().enumerate() {
            if !super::subset::is_type(source, Ty::N(id)) {
                continue;
            }
            match &ty.def {
                Def::Struct(fields) => {
                    let fields = fields.iter().enumerate().map(|(at, (_, ty, _))| format!("{} f{at};", self.ty(*ty)));
                    let fields = fields.collect::<Vec<_>>().join(" ");
                    self.line(format_args!("struct p{number}_{id} {{ {fields} }};"));
                }
                Def::Array(dims, element) => {
                    let (element, count) = (self.ty(*element), Source::elements(dims));
                    self.line(format_args!("struct p{number}_{id} {{ {element} e[{count}]; }};"));
                }
                Def::Enum(..) | Def::Subrange(..) | Def::Block(_) | Def::Standard(_) => {}
            }
        }
        for (name, _, ty, ..) in self.variables() {
            self.line(format_args!("static {} {name};", self.ty(ty)));
        }
    }

    fn first_and_show(&mut self, leaves: &mut Vec<Leaf>) {
        let mut show = Vec::new();
        let number = self.number;
        self.line(format_args!("static void p{number}_first(void) {{"));
        for (name, path, ty, value, class) in self.variables() {
            self.give(&name, ty, &value);
            if class == Class::Var {
                self.leaves((&name, &path), ty, &mut show, leaves);
            }
        }
        self.line(format_args!("}}\nstatic void p{number}_show(void) {{"));
        show.into_iter().for_each(|line| self.line(format_args!("{line}")));
        self.line(format_args!("}}"));
    }

    /// Assigns a value part by part.
    fn give(&mut self, name: &str, ty: Ty, value: &Value) {
        let source = self.source;
        if let (Ty::N(id), Value::Many(parts)) = (ty, value) {
            match &source.types[id].def {
                Def::Struct(fields) => {
                    for (at, ((_, ty, _), part)) in fields.iter().zip(parts).enumerate() {
                        self.give(&format!("{name}.f{at}"), *ty, part);
                    }
                }
                Def::Array(_, element) => {
                    for (at, part) in parts.iter().enumerate() {
                        self.give(&format!("{name}.e[{at}]"), *element, part);
                    }
                }
                _ => {}
            }
            return;
        }
        let kind = kind_of(source.plain(ty));
        self.line(format_args!("{name} = {};", literal(kind, value)));
    }

    fn leaves(&self, (name, path): (&str, &str), ty: Ty, show: &mut Vec<String>, leaves: &mut Vec<Leaf>) {
        let source = self.source;
        if let Ty::N(id) = ty {
            match &source.types[id].def {
                Def::Struct(fields) => {
                    for (at, (field, ty, _)) in fields.iter().enumerate() {
                        self.leaves((&format!("{name}.f{at}"), &format!("{path}.{field}")), *ty, show, leaves);
                    }
                    return;
                }
                Def::Array(dims, element) => {
                    for at in 0..Source::elements(dims) {
                        let indices = indices(dims, at);
                        self.leaves(
                            (&format!("{name}.e[{at}]"), &format!("{path}[{indices}]")),
                            *element,
                            show,
                            leaves,
                        );
                    }
                    return;
                }
                _ => {}
            }
        }
        let kind = kind_of(source.plain(ty));
        show.push(match kind {
            Kind::Real | Kind::Lreal => format!("show_{}({name});", kind.name()),
            _ => format!("show((uint64_t)({}){name});", prelude::unsigned(kind)),
        });
        leaves.push(Leaf { path: path.to_string(), ty });
    }

    fn scan(&mut self) {
        let number = self.number;
        self.line(format_args!("static void p{number}_scan(void) {{"));
        self.depth = 1;
        for (name, _, ty, value, class) in self.variables() {
            if class == Class::Temp {
                self.give(&name, ty, &value);
            }
        }
        let unit = self.unit;
        self.list(&unit.body);
        self.depth = 0;
        self.line(format_args!("}}"));
    }

    /// A new operand of a kind.
    fn operand(&mut self, kind: Kind, value: std::fmt::Arguments<'_>) -> String {
        let name = format!("t{}", self.new_number());
        self.line(format_args!("{} {name} = {value};", type_of(kind)));
        name
    }

    /// The place as something to assign to; indices become operands, from left to right.
    fn place(&mut self, place: &Place) -> String {
        let source = self.source;
        let mut name = if let Base::Var(at) = place.base {
            self.own(at)
        } else if let Base::Global(at) = place.base {
            self.global(at)
        } else {
            panic!("{place:?} is not of the subset")
        };
        let mut ty = source.base(self.unit, place);
        for step in &place.steps {
            if let Step::Field(at) = step {
                // A String takes everything.
                let _ = write!(name, ".f{at}");
            }
            if let (Step::Index(indices), Ty::N(id)) = (step, ty)
                && let Def::Array(dims, _) = &source.types[id].def
            {
                let position = self.position(indices, dims);
                let _ = write!(name, ".e[{position}]");
            }
            ty = source.behind(ty, step);
        }
        name
    }

    fn position(&mut self, indices: &[Expr], dims: &[(i32, i32)]) -> String {
        let mut position = String::from("0");
        for (index, (low, high)) in indices.iter().zip(dims) {
            let value = self.expr(index);
            let wide = match kind_of(index.ty) {
                // One beyond LINT is beyond every bound.
                Kind::Ulint | Kind::Lword => format!("(int64_t)({value} > INT64_MAX ? INT64_MAX : {value})"),
                _ => format!("(int64_t){value}"),
            };
            let count = high - low + 1;
            let next = format!("{position} * {count} + element({wide}, {low}, {high})");
            position = self.operand(Kind::Lint, format_args!("{next}"));
        }
        position
    }

    /// An expression as an operand.
    fn expr(&mut self, expr: &Expr) -> String {
        let kind = kind_of(self.source.plain(expr.ty));
        match &expr.kind {
            ExprKind::Lit(value, _) => self.operand(kind, format_args!("{}", literal(kind, value))),
            ExprKind::Get(place) => {
                let name = self.place(place);
                let ty = self.ty(expr.ty);
                let number = self.new_number();
                self.line(format_args!("{ty} t{number} = {name};"));
                format!("t{number}")
            }
            ExprKind::Bin(op @ (Op::AndThen | Op::OrElse), left, right) => {
                let first = self.expr(left);
                let not = if *op == Op::AndThen { "" } else { "!" };
                self.line(format_args!("if ({not}{first}) {{"));
                self.depth += 1;
                let second = self.expr(right);
                self.line(format_args!("{first} = {second};"));
                self.close();
                first
            }
            ExprKind::Bin(op, left, right) => {
                let (a, b) = (self.expr(left), self.expr(right));
                let own = kind_of(self.source.plain(left.ty)).name();
                let name = operation(*op).expect("the subset has it");
                self.operand(kind, format_args!("{name}_{own}({a}, {b})"))
            }
            ExprKind::Neg(inner) => self.one("neg", inner, kind),
            ExprKind::Not(inner) => self.one("not", inner, kind),
            ExprKind::Widen(inner) | ExprKind::Conv(inner) => self.convert("to", inner, kind),
            ExprKind::Trunc(inner) => self.convert("cut", inner, kind),
            ExprKind::Std(function, inputs) => self.function(*function, inputs, kind),
            other => panic!("{other:?} is not of the subset"),
        }
    }

    fn one(&mut self, name: &str, inner: &Expr, kind: Kind) -> String {
        let value = self.expr(inner);
        self.operand(kind, format_args!("{name}_{}({value})", kind.name()))
    }

    fn convert(&mut self, word: &str, inner: &Expr, to: Kind) -> String {
        let (from, value) = (kind_of(self.source.plain(inner.ty)), self.expr(inner));
        let word = if from.is_real() && !to.is_real() && to != Kind::Bool { word } else { "to" };
        self.operand(to, format_args!("{}_{word}_{}({value})", from.name(), to.name()))
    }

    fn function(&mut self, function: Function, inputs: &[Expr], kind: Kind) -> String {
        let values: Vec<String> = inputs.iter().map(|input| self.expr(input)).collect();
        let own = kind.name();
        let fold = |name: &str| {
            let rest = values[1..].iter();
            rest.fold(values[0].clone(), |sum, value| format!("{name}_{own}({sum}, {value})"))
        };
        let result = match function {
            Function::Abs => format!("abs_{own}({})", values[0]),
            Function::Sqrt => format!("sqrt_{own}({})", values[0]),
            Function::Min => fold("min"),
            Function::Max => fold("max"),
            Function::Add => fold("add"),
            Function::Mul => fold("mul"),
            // MN, IN, MX.
            Function::Limit => format!("min_{own}(max_{own}({}, {}), {})", values[1], values[0], values[2]),
            Function::Sel => format!("{} ? {} : {}", values[0], values[2], values[1]),
            Function::Mux => {
                let (last, first) = values[1..].split_last().expect("MUX has inputs");
                let ways = first.iter().enumerate().map(|(at, value)| format!("{} == {at} ? {value} : ", values[0]));
                format!("{}{last}", ways.collect::<String>())
            }
            Function::Shl => format!("shl_{own}({}, (int64_t){})", values[0], values[1]),
            Function::Shr => format!("shr_{own}({}, (int64_t){})", values[0], values[1]),
            Function::Rol => format!("rol_{own}({}, (int64_t){})", values[0], values[1]),
            Function::Ror => format!("ror_{own}({}, (int64_t){})", values[0], values[1]),
            Function::Move => values[0].clone(),
            other => panic!("{other:?} is not of the subset"),
        };
        self.operand(kind, format_args!("{result}"))
    }

    fn close(&mut self) {
        self.depth -= 1;
        self.line(format_args!("}}"));
    }

    fn list(&mut self, list: &[Stmt]) {
        list.iter().for_each(|stmt| self.stmt(stmt));
    }

    fn stmt(&mut self, stmt: &Stmt) {
        self.line(format_args!("{{"));
        self.depth += 1;
        match stmt {
            Stmt::Assign(place, value) => self.assign(place, value),
            Stmt::If(branches, otherwise) => {
                for (condition, body) in branches {
                    let condition = self.expr(condition);
                    self.line(format_args!("if ({condition}) {{"));
                    self.depth += 1;
                    self.list(body);
                    self.depth -= 1;
                    self.line(format_args!("}} else {{"));
                    self.depth += 1;
                }
                self.list(otherwise);
                branches.iter().for_each(|_| self.close());
            }
            Stmt::Case(selector, branches, otherwise) => {
                let (kind, value) = (kind_of(self.source.plain(selector.ty)), self.expr(selector));
                for (labels, body) in branches {
                    let (low, high) = kind.limits();
                    let label = |(from, to): &(i128, i128)| {
                        let [from, to] = [from, to].map(|bound| literal(kind, &Value::Int(*bound.clamp(&low, &high))));
                        format!("({value} >= {from} && {value} <= {to})")
                    };
                    let labels = labels.iter().map(label).collect::<Vec<_>>().join(" || ");
                    self.line(format_args!("if ({labels}) {{"));
                    self.depth += 1;
                    self.list(body);
                    self.depth -= 1;
                    self.line(format_args!("}} else"));
                }
                self.line(format_args!("{{"));
                self.depth += 1;
                self.list(otherwise);
                self.close();
            }
            Stmt::For(control, from, to, by, body) => self.for_loop(*control, (from, to, by.as_ref()), body),
            Stmt::While(counter, limit, condition, body) => self.counted(*counter, *limit, condition, body, true),
            Stmt::Repeat(counter, limit, condition, body) => self.counted(*counter, *limit, condition, body, false),
            Stmt::Exit => self.leave("exit"),
            Stmt::Continue => self.leave("next"),
            Stmt::Return => self.line(format_args!("return;")),
            other => panic!("{other:?} is not of the subset"),
        }
        self.close();
    }

    fn leave(&mut self, label: &str) {
        let number = *self.loops.last().expect("a loop is around");
        self.line(format_args!("goto {label}{number};"));
    }

    fn assign(&mut self, place: &Place, value: &Expr) {
        let name = self.place(place);
        let value = self.expr(value);
        let value = match place.ty {
            Ty::N(id) => match &self.source.types[id].def {
                Def::Subrange(base, low, high) => {
                    let [low, high] = [low, high].map(|bound| literal(*base, &Value::Int(*bound)));
                    format!("check_{}({value}, {low}, {high})", base.name())
                }
                _ => value,
            },
            _ => value,
        };
        self.line(format_args!("{name} = {value};"));
    }

    fn for_loop(&mut self, control: usize, (from, to, by): (&Expr, &Expr, Option<&Expr>), body: &[Stmt]) {
        let kind = kind_of(self.unit.vars[control].ty);
        let (control, own) = (self.own(control), kind.name());
        let (value, bound) = (self.expr(from), self.expr(to));
        let step = match by {
            Some(by) => self.expr(by),
            None => self.operand(kind, format_args!("1")),
        };
        self.line(format_args!("if ({step} == 0) trap(3);"));
        self.line(format_args!("{control} = {value};"));
        self.line(format_args!("while ({step} > 0 ? {value} <= {bound} : {value} >= {bound}) {{"));
        let number = self.body(body);
        // How far the bound is, in unsigned numbers, which hold every distance.
        let up = format!("(uint64_t){bound} - (uint64_t){value} < (uint64_t){step}");
        let down = format!("(uint64_t){value} - (uint64_t){bound} < (uint64_t)0 - (uint64_t){step}");
        self.line(format_args!("int last = {step} > 0 ? {up} : {down};"));
        self.line(format_args!("{value} = add_{own}({value}, {step});"));
        self.line(format_args!("{control} = {value};"));
        self.line(format_args!("if (last) break;"));
        self.close();
        self.line(format_args!("exit{number}: ;"));
    }

    /// The statements of a loop, up to the place where CONTINUE goes; gives the number of its labels.
    fn body(&mut self, body: &[Stmt]) -> usize {
        let number = self.new_number();
        self.loops.push(number);
        self.depth += 1;
        self.list(body);
        self.loops.pop();
        self.line(format_args!("next{number}: ;"));
        number
    }

    fn counted(&mut self, counter: usize, limit: i64, condition: &Expr, body: &[Stmt], asks_first: bool) {
        let counter = self.own(counter);
        self.line(format_args!("{counter} = 0;"));
        self.line(format_args!("for (;;) {{"));
        self.depth += 1;
        if asks_first {
            self.line(format_args!("if ({counter} >= {limit}) break;"));
            let condition = self.expr(condition);
            self.line(format_args!("if (!{condition}) break;"));
        }
        self.line(format_args!("{counter} = add_DINT({counter}, 1);"));
        self.depth -= 1;
        let number = self.body(body);
        if !asks_first {
            self.line(format_args!("if ({counter} >= {limit}) break;"));
            let condition = self.expr(condition);
            self.line(format_args!("if ({condition}) break;"));
        }
        self.close();
        self.line(format_args!("exit{number}: ;"));
    }
}

/// A literal by its bits.
fn literal(kind: Kind, value: &Value) -> String {
    match value {
        Value::Real(value) => format!("real_of(0x{:X}u)", value.to_bits()),
        Value::Lreal(value) => format!("lreal_of(0x{:X}u)", value.to_bits()),
        value => {
            let bits = value.int() as u64 & (u64::MAX >> (64 - kind.bits()));
            format!("({})({})0x{bits:X}u", type_of(kind), prelude::unsigned(kind))
        }
    }
}

/// The indices of an element, as a dump writes them.
fn indices(dims: &[(i32, i32)], at: usize) -> String {
    let mut rest = at;
    let mut indices = Vec::new();
    for (low, high) in dims.iter().rev() {
        let count = (high - low + 1) as usize;
        indices.insert(0, (low + (rest % count) as i32).to_string());
        rest /= count;
    }
    indices.join(", ")
}
