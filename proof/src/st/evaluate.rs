//! The meaning of the tree, straight from the page of the semantics.

use std::collections::BTreeMap;

use khz_bytecode::trap::TrapCode;

use super::functions::{Function, binary, complement, convert, negate, row, standard};
use super::memory::{Memory, Ref};
use super::moments;
use super::position::Key;
use super::text;
use super::tree::{Arg, Base, Class, Def, Edge, Expr, ExprKind, Kind, Op, Place, Source, Step, Stmt, Ty, Value};

/// Why a scan did not come to its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stop {
    /// A trap, with the values that explain it.
    Trap(TrapCode, [i64; 3]),
    /// More steps than allowed: no statement about the program.
    TooLong,
}

/// How a list of statements ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Flow {
    Next,
    Exit,
    Continue,
    Return,
}

/// One activation of a unit.
struct Context {
    unit: usize,
    me: Ref,
    in_outs: BTreeMap<usize, Ref>,
}

/// A running program. Frame 0 are the globals, then come the program instances, the others are calls of functions.
#[derive(Debug)]
pub struct Evaluator<'s> {
    source: &'s Source,
    memory: Memory,
    instances: usize,
    now: i128,
    steps: u64,
    limit: u64,
    /// The calls that are under way.
    calls: Vec<Key>,
    trapped_at: Vec<Key>,
}

/// A value as one of another type.
fn converted(from: Ty, to: Ty, value: Value, cut: bool) -> Value {
    let kind = |ty: Ty| if let Ty::K(kind) = ty { kind } else { Kind::Lint };
    match (from, to) {
        (Ty::S(_) | Ty::W(_), Ty::K(to)) => text::read(to, value.units()),
        (Ty::S(_), Ty::S(_)) | (Ty::S(_) | Ty::W(_), Ty::W(_)) => value,
        (Ty::W(_), Ty::S(_)) => Value::Str(text::narrow(value.units()).into_iter().map(u16::from).collect()),
        (from, Ty::S(capacity)) => {
            let mut text = text::write(kind(from), &value);
            text.truncate(usize::from(capacity));
            Value::Str(text::narrow(&text).into_iter().map(u16::from).collect())
        }
        (from, Ty::W(capacity)) => {
            let mut text = text::write(kind(from), &value);
            text.truncate(usize::from(capacity));
            Value::Str(text)
        }
        (from, to) => convert(kind(from), kind(to), &value, cut),
    }
}

impl<'s> Evaluator<'s> {
    /// A program before its first scan; `limit` bounds the steps of each.
    #[must_use]
    pub fn new(source: &'s Source, limit: u64) -> Self {
        let globals = source.globals.iter().map(|var| source.first(var)).collect();
        let mut frames = vec![Value::Many(globals)];
        frames.extend(source.programs().iter().map(|(_, unit, _)| source.instance(*unit)));
        let instances = frames.len() - 1;
        let memory = Memory::new(frames);
        Evaluator { source, memory, instances, now: 0, steps: 0, limit, calls: Vec::new(), trapped_at: Vec::new() }
    }

    /// Runs every program instance once in the order of declaration, at a time of the round in nanoseconds.
    ///
    /// # Errors
    /// A trap, or too many steps; what was stored before stays.
    pub fn scan(&mut self, now: i64) -> Result<(), Stop> {
        (0..self.instances).try_for_each(|instance| self.run_instance(instance, now))
    }

    /// Runs one program instance: its inputs are connected, its body runs, its outputs are stored.
    ///
    /// # Errors
    /// As [`Evaluator::scan`].
    pub fn run_instance(&mut self, instance: usize, now: i64) -> Result<(), Stop> {
        (self.now, self.steps) = (i128::from(now), 0);
        self.calls.clear();
        let Some((_, unit, args)) = self.source.programs().get(instance).copied() else { return Ok(()) };
        let me = Ref::frame(instance + 1);
        // Connections stand outside of any unit: their places are globals.
        let outside = Context { unit, me: me.clone(), in_outs: BTreeMap::new() };
        let mut in_outs = BTreeMap::new();
        self.inputs(&outside, &me, unit, args, &mut in_outs)?;
        let result = self.body(&Context { unit, me: me.clone(), in_outs });
        self.memory.frames.truncate(self.instances + 1);
        result?;
        self.outputs(&outside, &me, unit, args)
    }

    /// Runs the startup function, if there is one.
    ///
    /// # Errors
    /// As [`Evaluator::scan`].
    pub fn start(&mut self) -> Result<(), Stop> {
        let Some(unit) = self.source.config.as_ref().and_then(|config| config.startup) else { return Ok(()) };
        (self.now, self.steps) = (0, 0);
        self.memory.frames.push(self.source.instance(unit));
        let me = Ref::frame(self.memory.frames.len() - 1);
        let result = self.body(&Context { unit, me, in_outs: BTreeMap::new() });
        self.memory.frames.truncate(self.instances + 1);
        result
    }

    /// The input bytes of the process image, to be set before a scan.
    pub fn input_bytes(&mut self) -> &mut [u8] {
        &mut self.memory.image[0]
    }

    /// The output bytes and the marker bytes of the process image.
    #[must_use]
    pub fn image_bytes(&self) -> (&[u8], &[u8]) {
        (&self.memory.image[1], &self.memory.image[2])
    }

    /// A global variable's value as a BOOL.
    #[must_use]
    pub fn global_flag(&self, global: usize) -> bool {
        matches!(&self.memory.frames[0], Value::Many(parts) if parts[global] == Value::Int(1))
    }

    /// Where the last trap happened, then the calls that led there, innermost first.
    #[must_use]
    pub fn trapped_at(&self) -> &[Key] {
        &self.trapped_at
    }

    /// Every variable that lives between scans: path in a dump, type, value.
    #[must_use]
    pub fn variables(&self) -> Vec<(String, Ty, Value)> {
        let mut found = Vec::new();
        if let Value::Many(parts) = &self.memory.frames[0] {
            let shown = self.source.globals.iter().zip(parts).filter(|(var, _)| !var.gone && var.at.is_none());
            for (var, part) in shown {
                self.source.leaves(&var.name, var.ty, part, &mut found);
            }
        }
        for ((name, unit, _), frame) in self.source.programs().into_iter().zip(&self.memory.frames[1..]) {
            if let Value::Many(parts) = frame {
                self.source.unit_leaves(name, unit, parts, &mut found);
            }
        }
        found
    }

    /// The values alone, in the order of [`Evaluator::variables`].
    pub fn values<'v>(&'v self, found: &mut Vec<&'v Value>) {
        found.clear();
        if let Value::Many(parts) = &self.memory.frames[0] {
            let shown = self.source.globals.iter().zip(parts).filter(|(var, _)| !var.gone && var.at.is_none());
            shown.for_each(|(var, part)| self.source.leaf_values(var.ty, part, found));
        }
        for ((_, unit, _), frame) in self.source.programs().into_iter().zip(&self.memory.frames[1..]) {
            if let Value::Many(parts) = frame {
                self.source.unit_leaf_values(unit, parts, found);
            }
        }
    }

    /// The value of an expression that reads nothing but constants, in a unit that is not running.
    ///
    /// # Errors
    /// A trap in it.
    pub(super) fn constant(&mut self, unit: usize, expr: &Expr) -> Result<Value, Stop> {
        self.steps = 0;
        self.memory.frames.push(self.source.instance(unit));
        let me = Ref::frame(self.memory.frames.len() - 1);
        let value = self.expr(&Context { unit, me, in_outs: BTreeMap::new() }, expr);
        self.memory.frames.truncate(self.instances + 1);
        value
    }

    fn step(&mut self) -> Result<(), Stop> {
        self.steps += 1;
        if self.steps > self.limit { Err(Stop::TooLong) } else { Ok(()) }
    }

    fn trap(&mut self, at: Key, code: TrapCode, values: [i64; 3]) -> Stop {
        self.trapped_at = std::iter::once(at).chain(self.calls.iter().rev().copied()).collect();
        Stop::Trap(code, values)
    }

    /// Where an instance of a unit has what its body sees of an input with an edge; the input at the last call is next to it.
    fn edge(&self, unit: usize, number: usize) -> usize {
        let vars = &self.source.units[unit].vars;
        vars.len() + 2 * vars[..number].iter().filter(|var| var.edge.is_some()).count()
    }

    /// Runs a unit's statements with fresh VAR_TEMP.
    fn body(&mut self, context: &Context) -> Result<(), Stop> {
        let unit = &self.source.units[context.unit];
        for (at, var) in unit.vars.iter().enumerate() {
            let Some(edge) = var.edge else { continue };
            let seen = self.edge(context.unit, at);
            let now = self.memory.read(&context.me.child(at));
            let last = self.memory.read(&context.me.child(seen + 1));
            let is_edge = now != last && (now.int() != 0) == (edge == Edge::Rising);
            self.memory.write(&context.me.child(seen), Value::Int(i128::from(is_edge)));
            self.memory.write(&context.me.child(seen + 1), now);
        }
        for (at, var) in unit.vars.iter().enumerate().filter(|(_, var)| var.class == Class::Temp) {
            let first = self.source.first(var);
            *self.memory.at(&context.me.child(at)) = first;
        }
        self.list(context, &unit.body).map(|_| ())
    }

    /// The variable at the beginning of a place, and its type.
    fn base(&self, context: &Context, place: &Place) -> (Ref, Ty) {
        let kind = |ty: Ty| if let Ty::K(kind) = self.source.plain(ty) { kind } else { Kind::Lint };
        match place.base {
            Base::Direct(at) => (Ref::image(at, kind(place.ty)), place.ty),
            Base::Global(number) => {
                let var = &self.source.globals[number];
                let found = var.at.map_or_else(|| Ref::frame(0).child(number), |at| Ref::image(at, kind(var.ty)));
                (found, var.ty)
            }
            Base::Var(number) => {
                let var = &self.source.units[context.unit].vars[number];
                let seen = if var.edge.is_some() { self.edge(context.unit, number) } else { number };
                let own = || var.at.map_or_else(|| context.me.child(seen), |at| Ref::image(at, kind(var.ty)));
                (context.in_outs.get(&number).cloned().unwrap_or_else(own), var.ty)
            }
        }
    }

    /// Follows a place; indices are evaluated from left to right, then checked.
    fn place(&mut self, context: &Context, place: &Place) -> Result<Ref, Stop> {
        let (mut found, mut ty) = self.base(context, place);
        let source = self.source;
        for step in &place.steps {
            if let (Step::Part(first, count), Ty::K(kind)) = (step, source.plain(ty)) {
                found.part = Some((*first, *count, kind));
                break;
            }
            if let (Step::Index(indices), Some(capacity)) = (step, ty.capacity()) {
                let index = self.expr(context, &indices[0])?.int();
                let position = self.bounded(place, index, 1, i128::from(capacity))?;
                found.unit = Some(position);
                break;
            }
            let Ty::N(id) = ty else { panic!("a step into {ty:?}") };
            match (step, &source.types[id].def) {
                (Step::Field(at), def) => {
                    ty = source.field_type(def, *at);
                    found.path.push(*at);
                }
                (Step::Index(indices), Def::Array(dims, element)) => {
                    let values =
                        indices.iter().map(|index| self.expr(context, index)).collect::<Result<Vec<_>, _>>()?;
                    let mut position = 0;
                    for (value, (low, high)) in values.iter().map(Value::int).zip(dims) {
                        let (low, high) = (i128::from(*low), i128::from(*high));
                        position = position * (high - low + 1) as usize + self.bounded(place, value, low, high)?;
                    }
                    ty = *element;
                    found.path.push(position);
                }
                _ => panic!("a wrong step into {ty:?}"),
            }
        }
        Ok(found)
    }

    /// How far an index is behind the lower bound.
    fn bounded(&mut self, place: &Place, index: i128, low: i128, high: i128) -> Result<usize, Stop> {
        if (low..=high).contains(&index) {
            return Ok((index - low) as usize);
        }
        // Bounds are DINT, and a trap shows an index as the nearest DINT.
        let shown = index.clamp(i128::from(i32::MIN), i128::from(i32::MAX)) as i64;
        Err(self.trap(Key::of_place(place), TrapCode::ArrayIndex, [shown, low as i64, high as i64]))
    }

    /// Stores a value: strings are cut, subranges checked. `from` is where the value stands in the program.
    fn store(&mut self, place: &Ref, ty: Ty, mut value: Value, from: Key) -> Result<(), Stop> {
        if let Ty::N(id) = ty
            && let Def::Subrange(_, low, high) = &self.source.types[id].def
            && !(*low..=*high).contains(&value.int())
        {
            return Err(self.trap(from, TrapCode::Range, [value.int() as i64, *low as i64, *high as i64]));
        }
        if let (Some(capacity), Value::Str(units)) = (ty.capacity(), &mut value) {
            units.truncate(usize::from(capacity));
        }
        self.memory.write(place, value);
        Ok(())
    }

    fn expr(&mut self, context: &Context, expr: &Expr) -> Result<Value, Stop> {
        self.step()?;
        let kind = |ty: Ty| if let Ty::K(kind) = ty { kind } else { Kind::Lint };
        Ok(match &expr.kind {
            ExprKind::Lit(value, _) => value.clone(),
            ExprKind::Get(place) => {
                let found = self.place(context, place)?;
                self.memory.read(&found)
            }
            ExprKind::Bin(op, left, right) => {
                let a = self.expr(context, left)?;
                match op {
                    Op::AndThen if a.int() == 0 => return Ok(a),
                    Op::OrElse if a.int() != 0 => return Ok(a),
                    _ => {}
                }
                let b = self.expr(context, right)?;
                let wraps = if kind(expr.ty).is_duration() { expr.ty } else { left.ty };
                binary(*op, kind(wraps), &a, &b).map_err(|code| self.trap(Key::of_expr(expr), code, [0; 3]))?
            }
            ExprKind::Neg(inner) => negate(kind(inner.ty), &self.expr(context, inner)?),
            ExprKind::Not(inner) => complement(kind(inner.ty), &self.expr(context, inner)?),
            ExprKind::Widen(inner) | ExprKind::Conv(inner) | ExprKind::Trunc(inner) => {
                let value = self.expr(context, inner)?;
                converted(inner.ty, expr.ty, value, matches!(expr.kind, ExprKind::Trunc(_)))
            }
            ExprKind::Std(Function::LowerBound | Function::UpperBound, _) => Value::Int(self.bound(expr)),
            ExprKind::Std(function, inputs) => {
                let values = inputs.iter().map(|input| self.expr(context, input)).collect::<Result<Vec<_>, _>>()?;
                let found = standard(*function, kind(expr.ty), &values);
                let found = found.map_err(|code| self.trap(Key::of_expr(expr), code, [0; 3]))?;
                found.unwrap_or_else(|| panic!("{function:?} has no meaning here"))
            }
            ExprKind::Call(unit, args) => {
                if !self.is_enabled(context, args)? {
                    // It gives nothing: zero.
                    return Ok(self.source.initial(expr.ty));
                }
                self.call_function(context, *unit, args, Key::of_expr(expr))?
            }
        })
    }

    /// A bound of an array, which its declaration says: nothing is read.
    fn bound(&self, expr: &Expr) -> i128 {
        let ExprKind::Std(function, inputs) = &expr.kind else { panic!("a bound of {expr:?}") };
        let [Expr { ty: Ty::N(id), .. }, Expr { kind: ExprKind::Lit(Value::Int(number), _), .. }] = inputs.as_slice()
        else {
            panic!("a bound of {inputs:?}")
        };
        let Def::Array(dims, _) = &self.source.types[*id].def else { panic!("a bound of {id}") };
        // A number that the shrinker made has no dimension, and the compiler refuses it.
        let (low, high) = usize::try_from(number - 1).ok().and_then(|at| dims.get(at)).copied().unwrap_or_default();
        i128::from(if *function == Function::UpperBound { high } else { low })
    }

    /// Evaluates EN; where it is FALSE, ENO is too.
    fn is_enabled(&mut self, context: &Context, args: &[Arg]) -> Result<bool, Stop> {
        let mut enabled = true;
        for arg in args {
            if let Arg::En(condition) = arg {
                enabled = self.expr(context, condition)?.int() != 0;
            }
        }
        if !enabled {
            self.eno(context, args, 0)?;
        }
        Ok(enabled)
    }

    fn eno(&mut self, context: &Context, args: &[Arg], value: i128) -> Result<(), Stop> {
        for arg in args {
            if let Arg::Eno(place) = arg {
                let target = self.place(context, place)?;
                self.memory.write(&target, Value::Int(value));
            }
        }
        Ok(())
    }

    /// Stores what is given to a unit's inputs; finds what its VAR_IN_OUT stand for.
    fn inputs(
        &mut self,
        context: &Context,
        me: &Ref,
        unit: usize,
        args: &[Arg],
        in_outs: &mut BTreeMap<usize, Ref>,
    ) -> Result<(), Stop> {
        let source = self.source;
        for arg in args {
            match arg {
                Arg::In(at, given) => {
                    let value = self.expr(context, given)?;
                    self.store(&me.child(*at), source.units[unit].vars[*at].ty, value, Key::of_expr(given))?;
                }
                Arg::InOut(at, place) => {
                    let found = self.place(context, place)?;
                    in_outs.insert(*at, found);
                }
                Arg::Out(..) | Arg::En(_) | Arg::Eno(_) => {}
            }
        }
        Ok(())
    }

    fn call_function(&mut self, context: &Context, unit: usize, args: &[Arg], at: Key) -> Result<Value, Stop> {
        let source = self.source;
        // Its frame is there from the start, but what it is given is evaluated in the caller's.
        self.memory.frames.push(source.instance(unit));
        let me = Ref::frame(self.memory.frames.len() - 1);
        // An input that is given does not begin with its initial value: nothing of that stays behind a shorter text.
        for arg in args {
            if let Arg::In(at, _) = arg {
                self.memory.clear_text(&me.child(*at));
            }
        }
        let mut in_outs = BTreeMap::new();
        self.inputs(context, &me, unit, args, &mut in_outs)?;
        self.calls.push(at);
        self.body(&Context { unit, me: me.clone(), in_outs })?;
        self.calls.pop();
        self.outputs(context, &me, unit, args)?;
        self.eno(context, args, 1)?;
        let Some(Value::Many(parts)) = self.memory.frames.pop() else { panic!("no frame") };
        Ok(match parts.into_iter().next() {
            Some(Value::Str(room)) => Value::Str(text::text_in(&room).to_vec()),
            found => found.unwrap_or(Value::Int(0)),
        })
    }

    fn outputs(&mut self, context: &Context, me: &Ref, unit: usize, args: &[Arg]) -> Result<(), Stop> {
        let source = self.source;
        for arg in args {
            if let Arg::Out(at, place) = arg {
                let value = self.memory.read(&me.child(*at));
                let value = match (source.plain(source.units[unit].vars[*at].ty), source.plain(place.ty)) {
                    (Ty::K(from), Ty::K(to)) => convert(from, to, &value, false),
                    _ => value,
                };
                let target = self.place(context, place)?;
                self.store(&target, place.ty, value, Key::of_place(place))?;
            }
        }
        Ok(())
    }

    fn call_block(&mut self, context: &Context, place: &Place, args: &[Arg], at: Key) -> Result<(), Stop> {
        if !self.is_enabled(context, args)? {
            return Ok(());
        }
        let me = self.place(context, place)?;
        let source = self.source;
        let Ty::N(id) = place.ty else { panic!("a call of {place:?}") };
        match &source.types[id].def {
            Def::Block(unit) => {
                let mut in_outs = BTreeMap::new();
                self.inputs(context, &me, *unit, args, &mut in_outs)?;
                self.calls.push(at);
                self.body(&Context { unit: *unit, me: me.clone(), in_outs })?;
                self.calls.pop();
                self.outputs(context, &me, *unit, args)?;
            }
            Def::Standard(standard) => {
                for arg in args {
                    if let Arg::In(at, given) = arg {
                        let value = self.expr(context, given)?;
                        self.memory.write(&me.child(*at), value);
                    }
                }
                let now = self.now;
                if let Value::Many(parts) = self.memory.at(&me) {
                    standard.call(parts, now);
                }
                for arg in args {
                    if let Arg::Out(at, place) = arg {
                        let value = self.memory.read(&me.child(*at));
                        let target = self.place(context, place)?;
                        self.store(&target, place.ty, value, Key::of_place(place))?;
                    }
                }
            }
            other => panic!("a call of {other:?}"),
        }
        self.eno(context, args, 1)
    }

    /// The parts of a date or time of day, which is evaluated once and first; each is stored as it comes.
    fn split(&mut self, context: &Context, function: Function, args: &[Arg], at: Key) -> Result<(), Stop> {
        if !self.is_enabled(context, args)? {
            return Ok(());
        }
        let Some(kind) = moments::splits(function) else { panic!("{function:?} splits nothing") };
        let Some(Arg::In(_, given)) = args.iter().find(|arg| matches!(arg, Arg::In(..))) else {
            panic!("{function:?} of nothing")
        };
        let value = self.expr(context, given)?.int();
        for arg in args {
            if let Arg::Out(number, place) = arg {
                let part = moments::part(kind, value, row(function).outputs[number - 1]);
                let part = match self.source.plain(place.ty) {
                    Ty::K(to) => convert(Kind::Lint, to, &Value::Int(part), false),
                    other => panic!("a part into {other:?}"),
                };
                let target = self.place(context, place)?;
                self.store(&target, place.ty, part, at)?;
            }
        }
        self.eno(context, args, 1)
    }

    fn list(&mut self, context: &Context, list: &[Stmt]) -> Result<Flow, Stop> {
        for stmt in list {
            self.step()?;
            let flow = self.stmt(context, stmt)?;
            if flow != Flow::Next {
                return Ok(flow);
            }
        }
        Ok(Flow::Next)
    }

    fn assign(&mut self, context: &Context, place: &Place, value: &Expr) -> Result<(), Stop> {
        // A call that is not enabled gives nothing to assign; a conversion around it changes nothing of that.
        let mut call = value;
        while let ExprKind::Widen(inner) = &call.kind {
            call = inner;
        }
        let found = match &call.kind {
            ExprKind::Call(unit, args) if args.iter().any(|arg| matches!(arg, Arg::En(_))) => {
                if !self.is_enabled(context, args)? {
                    return Ok(());
                }
                let found = self.call_function(context, *unit, args, Key::of_expr(call))?;
                match (self.source.plain(call.ty), value.ty) {
                    (Ty::N(_), _) | (_, Ty::N(_)) => found,
                    (from, to) => converted(from, to, found, false),
                }
            }
            _ => {
                let target = self.place(context, place)?;
                let found = self.expr(context, value)?;
                return self.store(&target, place.ty, found, Key::of_expr(value));
            }
        };
        let target = self.place(context, place)?;
        self.store(&target, place.ty, found, Key::of_expr(value))
    }

    fn stmt(&mut self, context: &Context, stmt: &Stmt) -> Result<Flow, Stop> {
        match stmt {
            Stmt::Assign(place, value) => self.assign(context, place, value)?,
            Stmt::If(branches, otherwise) => {
                for (condition, body) in branches {
                    if self.expr(context, condition)?.int() != 0 {
                        return self.list(context, body);
                    }
                }
                return self.list(context, otherwise);
            }
            Stmt::Case(selector, branches, otherwise) => {
                let value = self.expr(context, selector)?.int();
                let chosen = branches
                    .iter()
                    .find(|(labels, _)| labels.iter().any(|(low, high)| (*low..=*high).contains(&value)));
                return self.list(context, chosen.map_or(otherwise, |(_, body)| body));
            }
            Stmt::For(control, from, to, by, body) => {
                return self.for_loop(context, stmt, *control, (from, to, by.as_ref()), body);
            }
            Stmt::While(counter, limit, condition, body) => {
                self.count(context, *counter, 0);
                while self.counted(context, *counter) < i128::from(*limit) && self.expr(context, condition)?.int() != 0
                {
                    let next = self.counted(context, *counter) + 1;
                    self.count(context, *counter, next);
                    match self.list(context, body)? {
                        Flow::Exit => break,
                        Flow::Return => return Ok(Flow::Return),
                        Flow::Next | Flow::Continue => {}
                    }
                }
            }
            Stmt::Repeat(counter, limit, condition, body) => {
                self.count(context, *counter, 0);
                loop {
                    let next = self.counted(context, *counter) + 1;
                    self.count(context, *counter, next);
                    match self.list(context, body)? {
                        Flow::Exit => break,
                        Flow::Return => return Ok(Flow::Return),
                        Flow::Next | Flow::Continue => {}
                    }
                    if self.counted(context, *counter) >= i128::from(*limit)
                        || self.expr(context, condition)?.int() != 0
                    {
                        break;
                    }
                }
            }
            Stmt::Call(place, args) => self.call_block(context, place, args, Key::of_stmt(stmt))?,
            Stmt::Do(unit, args) => {
                if self.is_enabled(context, args)? {
                    self.call_function(context, *unit, args, Key::of_stmt(stmt))?;
                }
            }
            Stmt::Split(function, args) => self.split(context, *function, args, Key::of_stmt(stmt))?,
            Stmt::Exit => return Ok(Flow::Exit),
            Stmt::Continue => return Ok(Flow::Continue),
            Stmt::Return => return Ok(Flow::Return),
        }
        Ok(Flow::Next)
    }

    fn count(&mut self, context: &Context, counter: usize, value: i128) {
        self.memory.write(&context.me.child(counter), Value::Int(value));
    }

    fn counted(&mut self, context: &Context, counter: usize) -> i128 {
        self.memory.read(&context.me.child(counter)).int()
    }

    fn for_loop(
        &mut self,
        context: &Context,
        stmt: &Stmt,
        control: usize,
        (from, to, by): (&Expr, &Expr, Option<&Expr>),
        body: &[Stmt],
    ) -> Result<Flow, Stop> {
        let Ty::K(kind) = self.source.units[context.unit].vars[control].ty else { panic!("a control variable") };
        let mut value = self.expr(context, from)?.int();
        let bound = self.expr(context, to)?.int();
        let step = by.map_or(Ok(1), |by| self.expr(context, by).map(|value| value.int()))?;
        if step == 0 {
            return Err(self.trap(Key::of_stmt(stmt), TrapCode::Range, [0; 3]));
        }
        self.count(context, control, value);
        while if step > 0 { value <= bound } else { value >= bound } {
            self.step()?;
            let flow = self.list(context, body)?;
            if matches!(flow, Flow::Exit) {
                break;
            }
            if flow == Flow::Return {
                return Ok(flow);
            }
            // In exact numbers, so that it ends although the bound is the last of its type.
            value += step;
            self.count(context, control, kind.wrap(value));
        }
        Ok(Flow::Next)
    }
}
