//! Makes a program that shows something smaller, as long as it still shows it.
//!
//! Coarse edits come first (rounds, runs of statements, whole branches and POUs), then fine ones (parameters, expressions, constants, types); all
//! repeat until none helps. Nothing here knows whether an edited program is sound: one that the compiler refuses does not show what is looked for.

use super::case::{Case, Round};
use super::sweep::{drop_field, drop_inputs_of, drop_parameter, drop_values_of, take_out, unused, uses_field};
use super::tree::{Arg, Class, Def, Expr, ExprKind, Kind, Place, Source, Step, Stmt, Ty, UnitKind, Value};
use super::visit::{bodies, bodies_mut};

/// Makes a program small without rounds of its own.
#[must_use]
pub fn shrink(source: &Source, shows: &dyn Fn(&Source) -> bool, tries: usize) -> Source {
    let case = Case { source: source.clone(), rounds: Vec::new() };
    shrink_case(&case, &|case| shows(&case.source), tries).0.source
}

/// Tries edits until none helps, at most `tries` of them; `shows` says whether a case still does what it is kept for. Gives the smallest
/// case and how many were tried.
#[must_use]
pub fn shrink_case(case: &Case, shows: &dyn Fn(&Case) -> bool, tries: usize) -> (Case, usize) {
    let mut shrinker = Shrinker { best: case.clone(), shows, left: tries };
    while shrinker.left > 0 {
        let mut helped = false;
        for stage in STAGES {
            helped |= shrinker.stage(*stage);
        }
        if !helped {
            break;
        }
    }
    (shrinker.best, tries - shrinker.left)
}

type Stage = fn(&mut Editor, &mut Case);

/// Coarse to fine.
const STAGES: &[Stage] = &[
    |editor, case| {
        if case.source.style != 0 && editor.here() {
            case.source.style = 0;
        }
        editor.rounds(&mut case.rounds);
        editor.configuration(&mut case.source);
    },
    |editor, case| editor.each_body(&mut case.source, Editor::chunks),
    |editor, case| editor.each_body(&mut case.source, Editor::list),
    |editor, case| {
        let all = unused(&case.source);
        if !all.is_empty() && editor.here() {
            all.into_iter().for_each(|declaration| take_out(&mut case.source, declaration));
        }
    },
    |editor, case| editor.declarations(&mut case.source),
    |editor, case| editor.each_body(&mut case.source, Editor::values),
    |editor, case| editor.types(case),
];

struct Shrinker<'s> {
    best: Case,
    shows: &'s dyn Fn(&Case) -> bool,
    left: usize,
}

impl Shrinker<'_> {
    /// Makes all edits of a stage, one after the other, and keeps those that help.
    fn stage(&mut self, edits: Stage) -> bool {
        let (mut helped, mut number) = (false, 0);
        while self.left > 0 {
            let mut edited = self.best.clone();
            let mut editor = Editor { number, done: false };
            edits(&mut editor, &mut edited);
            if !editor.done {
                break;
            }
            self.left -= 1;
            if (self.shows)(&edited) {
                (self.best, helped) = (edited, true);
            } else {
                number += 1;
            }
        }
        helped
    }
}

/// Walks a case and makes edit number `number`.
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

    fn rounds(&mut self, rounds: &mut Vec<Round>) {
        let last = rounds.len().saturating_sub(1);
        if last > 0 && self.here() {
            rounds.drain(..last);
            return;
        }
        for at in 0..last {
            if self.here() {
                rounds.remove(at);
                return;
            }
        }
        for round in rounds {
            if !round.inputs.is_empty() && self.here() {
                round.inputs.clear();
            }
            for at in 0..round.inputs.len() {
                if round.inputs.len() > 1 && self.here() {
                    round.inputs.remove(at);
                    return;
                }
            }
            if round.wait_ns != 0 && self.here() {
                round.wait_ns = 0;
            }
            if !round.image.is_empty() && self.here() {
                round.image.clear();
            }
            let half = round.image.len() / 2;
            if half > 0 && self.here() {
                round.image.truncate(half);
            }
            for byte in &mut round.image {
                if *byte != 0 && self.here() {
                    *byte = 0;
                }
            }
        }
    }

    /// The configuration itself, its instances and tasks, connections, and the startup function.
    fn configuration(&mut self, source: &mut Source) {
        // The program of the only instance can run alone; behind it stand only other programs.
        let only =
            source.config.as_ref().filter(|config| config.instances.len() == 1).map(|config| config.instances[0].unit);
        if let Some(program) = only.filter(|_| self.here()) {
            source.config = None;
            source.units.truncate(program + 1);
            let others = source.units[..program].iter_mut().filter(|unit| unit.kind == UnitKind::Program);
            others.for_each(|unit| unit.gone = true);
            return;
        }
        let Some(config) = &mut source.config else { return };
        if config.startup.is_some() && self.here() {
            config.startup = None;
        }
        for at in (0..config.instances.len()).rev() {
            if config.instances.len() > 1 && self.here() {
                config.instances.remove(at);
                return;
            }
        }
        for at in (0..config.tasks.len()).rev() {
            let is_used = config.instances.iter().any(|instance| instance.task == Some(at));
            if !is_used && self.here() {
                config.tasks.remove(at);
                let behind = config.instances.iter_mut().filter_map(|instance| instance.task.as_mut());
                behind.filter(|task| **task > at).for_each(|task| *task -= 1);
                return;
            }
        }
        for instance in &mut config.instances {
            self.args(&mut instance.args);
        }
    }

    /// Shows every list of statements to `edits`, outer ones first, of later units first.
    fn each_body(&mut self, source: &mut Source, edits: fn(&mut Editor, &mut Vec<Stmt>)) {
        for unit in source.units.iter_mut().rev().filter(|unit| !unit.gone) {
            self.nested(&mut unit.body, edits);
        }
    }

    fn nested(&mut self, list: &mut Vec<Stmt>, edits: fn(&mut Editor, &mut Vec<Stmt>)) {
        if self.done {
            return;
        }
        edits(self, list);
        for body in list.iter_mut().flat_map(bodies_mut) {
            if self.done {
                return;
            }
            self.nested(body, edits);
        }
    }

    /// Runs of statements: all, then halves, quarters, to pairs.
    fn chunks(&mut self, list: &mut Vec<Stmt>) {
        let mut size = list.len();
        while size >= 2 {
            for start in (0..list.len()).step_by(size).rev() {
                if self.here() {
                    list.drain(start..list.len().min(start + size));
                    return;
                }
            }
            size = size.div_ceil(2).min(size - 1);
        }
    }

    /// Single statements, what is in them in their place, and branches.
    fn list(&mut self, list: &mut Vec<Stmt>) {
        for at in (0..list.len()).rev() {
            if self.here() {
                list.remove(at);
                return;
            }
            for inner in bodies(&list[at]).into_iter().filter(|body| !body.is_empty()).cloned().collect::<Vec<_>>() {
                if self.here() {
                    list.splice(at..=at, inner);
                    return;
                }
            }
            self.branches(&mut list[at]);
            if self.done {
                return;
            }
        }
    }

    fn branches(&mut self, stmt: &mut Stmt) {
        match stmt {
            Stmt::If(branches, otherwise) => {
                self.one_less(branches);
                self.clear(otherwise);
            }
            Stmt::Case(_, branches, otherwise) => {
                self.one_less(branches);
                branches.iter_mut().for_each(|(labels, _)| self.one_less(labels));
                self.clear(otherwise);
            }
            Stmt::For(_, _, _, by, _) => {
                if by.is_some() && self.here() {
                    *by = None;
                }
            }
            Stmt::While(_, limit, ..) | Stmt::Repeat(_, limit, ..) => {
                if *limit > 1 && self.here() {
                    *limit = 1;
                }
            }
            Stmt::Assign(..)
            | Stmt::Call(..)
            | Stmt::Do(..)
            | Stmt::Split(..)
            | Stmt::Exit
            | Stmt::Continue
            | Stmt::Return => {}
        }
    }

    fn one_less<T>(&mut self, of: &mut Vec<T>) {
        for at in 0..of.len() {
            if of.len() > 1 && self.here() {
                of.remove(at);
                return;
            }
        }
    }

    fn clear(&mut self, list: &mut Vec<Stmt>) {
        if !list.is_empty() && self.here() {
            list.clear();
        }
    }

    /// Declarations that nothing uses, parameters with their arguments, initial values.
    fn declarations(&mut self, source: &mut Source) {
        for declaration in unused(source) {
            if self.here() {
                take_out(source, declaration);
                return;
            }
        }
        for unit in 0..source.units.len() {
            for at in 0..source.units[unit].vars.len() {
                let var = &source.units[unit].vars[at];
                let is_parameter = matches!(var.class, Class::Input | Class::Output | Class::InOut);
                if is_parameter && !var.gone && !source.units[unit].gone && self.here() {
                    drop_parameter(source, unit, at);
                    return;
                }
            }
        }
        let own = source.units.iter_mut().filter(|unit| !unit.gone).flat_map(|unit| &mut unit.vars);
        for var in own.chain(&mut source.globals).filter(|var| !var.gone) {
            if var.init.is_some() && var.class != Class::Constant && self.here() {
                var.init = None;
            }
            if let Some(init) = &mut var.init {
                self.value(init);
            }
        }
    }

    /// Bounds of arrays, values of enumerations, fields of structures.
    fn types(&mut self, case: &mut Case) {
        let source = &mut case.source;
        for id in 0..source.types.len() {
            if source.types[id].gone && !matches!(source.types[id].def, Def::Array(..)) {
                continue;
            }
            let mut def = source.types[id].def.clone();
            let before = self.done;
            match &mut def {
                Def::Array(dims, _) => {
                    for (low, high) in dims {
                        if low < high && self.here() {
                            *high = *low;
                        }
                        if i64::from(*low) + 1 < i64::from(*high) && self.here() {
                            *high -= 1;
                        }
                    }
                }
                Def::Enum(_, values) => self.one_less(values),
                Def::Struct(fields) => {
                    for at in 0..fields.len() {
                        if fields.len() > 1 && !uses_field(source, id, at) && self.here() {
                            drop_field(source, id, at);
                            drop_inputs_of(case, id);
                            return;
                        }
                    }
                }
                Def::Subrange(..) | Def::Block(_) | Def::Standard(_) => {}
            }
            if self.done && !before {
                // Initial values were made for what the type was.
                source.types[id].def = def;
                drop_values_of(source, id);
                drop_inputs_of(case, id);
                return;
            }
        }
    }

    /// A number nearer to 0.
    fn value(&mut self, value: &mut Value) {
        match value {
            Value::Int(number) => {
                for smaller in [0, 1, *number / 2] {
                    if smaller.abs() < number.abs() && self.here() {
                        *number = smaller;
                        return;
                    }
                }
            }
            Value::Real(number) => {
                let smaller = if *number == 1.0 { 0.0 } else { 1.0 };
                if *number != 0.0 && self.here() {
                    *number = smaller;
                }
            }
            Value::Lreal(number) => {
                let smaller = if *number == 1.0 { 0.0 } else { 1.0 };
                if *number != 0.0 && self.here() {
                    *number = smaller;
                }
            }
            Value::Str(units) => {
                if !units.is_empty() && self.here() {
                    units.clear();
                }
            }
            Value::Many(parts) => parts.iter_mut().for_each(|part| self.value(part)),
        }
    }

    /// The expressions of statements, without those of statements in them.
    fn values(&mut self, list: &mut Vec<Stmt>) {
        for stmt in list {
            match stmt {
                Stmt::Assign(place, value) => {
                    self.place(place);
                    self.expr(value);
                }
                Stmt::If(branches, _) => branches.iter_mut().for_each(|(condition, _)| self.expr(condition)),
                Stmt::Case(selector, ..) => self.expr(selector),
                Stmt::For(_, from, to, by, _) => {
                    self.expr(from);
                    self.expr(to);
                    by.iter_mut().for_each(|by| self.expr(by));
                }
                Stmt::While(_, _, condition, _) | Stmt::Repeat(_, _, condition, _) => self.expr(condition),
                Stmt::Call(place, args) => {
                    self.place(place);
                    self.args(args);
                }
                Stmt::Do(_, args) | Stmt::Split(_, args) => self.args(args),
                Stmt::Exit | Stmt::Continue | Stmt::Return => {}
            }
            if self.done {
                return;
            }
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
                Arg::In(_, value) | Arg::En(value) => self.expr(value),
                Arg::InOut(_, place) | Arg::Out(_, place) | Arg::Eno(place) => self.place(place),
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
        if let ExprKind::Lit(value, _) = &mut expr.kind {
            if matches!(expr.ty, Ty::K(_) | Ty::S(_) | Ty::W(_)) {
                self.value(value);
            }
            return;
        }
        for value in literals(expr.ty) {
            if self.here() {
                expr.kind = ExprKind::Lit(value, true);
                return;
            }
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
            ExprKind::Std(_, inputs) => {
                // Of functions that take as many as one likes; others are refused then.
                for at in 2..inputs.len() {
                    if self.here() {
                        inputs.remove(at);
                        return;
                    }
                }
                inputs.iter_mut().for_each(|input| self.expr(input));
            }
            ExprKind::Call(_, args) => self.args(args),
        }
    }
}

/// What may stand for an expression of a type.
fn literals(ty: Ty) -> Vec<Value> {
    match ty {
        Ty::K(Kind::Real) => vec![Value::Real(1.0)],
        Ty::K(Kind::Lreal) => vec![Value::Lreal(1.0)],
        Ty::K(Kind::Bool) => vec![Value::Int(0), Value::Int(1)],
        Ty::K(kind) if kind.is_moment() => vec![Value::Int(0)],
        Ty::K(kind) => vec![Value::Int(0), Value::Int(1), Value::Int(kind.wrap(-1))],
        Ty::S(_) | Ty::W(_) => vec![Value::Str(Vec::new())],
        Ty::N(_) => Vec::new(),
    }
}

/// The expressions in an expression.
fn parts(expr: &Expr) -> Vec<Expr> {
    match &expr.kind {
        ExprKind::Bin(_, left, right) => vec![(**left).clone(), (**right).clone()],
        ExprKind::Neg(inner)
        | ExprKind::Not(inner)
        | ExprKind::Widen(inner)
        | ExprKind::Conv(inner)
        | ExprKind::Trunc(inner) => vec![(**inner).clone()],
        ExprKind::Std(_, inputs) => inputs.clone(),
        ExprKind::Call(_, args) => {
            args.iter().filter_map(|arg| if let Arg::In(_, value) = arg { Some(value.clone()) } else { None }).collect()
        }
        ExprKind::Lit(..) | ExprKind::Get(_) => Vec::new(),
    }
}
