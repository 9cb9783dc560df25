//! The meaning of the tree, straight from the page of the semantics.

use std::collections::BTreeMap;

use khz_bytecode::trap::TrapCode;

use super::functions::{binary, complement, convert, negate, number_in, standard};
use super::tree::{Arg, Base, Class, Def, Expr, ExprKind, Kind, Op, Place, Source, Step, Stmt, Ty, Value};

/// Why a scan did not come to its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stop {
    /// A trap, with the values that explain it.
    Trap(TrapCode, [i64; 3]),
    /// More steps than allowed: no statement about the program.
    TooLong,
}

impl From<TrapCode> for Stop {
    fn from(code: TrapCode) -> Stop {
        Stop::Trap(code, [0; 3])
    }
}

/// How a list of statements ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Flow {
    Next,
    Exit,
    Continue,
    Return,
}

/// A variable or a part of one: frame, then parts of composites.
#[derive(Debug, Clone)]
struct Ref {
    frame: usize,
    path: Vec<usize>,
}

/// One activation of a unit.
struct Context {
    unit: usize,
    me: Ref,
    in_outs: BTreeMap<usize, Ref>,
}

/// A running program. Frame 0 are the globals, frame 1 the program, the others calls of functions.
pub struct Evaluator<'s> {
    source: &'s Source,
    frames: Vec<Value>,
    now: i128,
    steps: u64,
    limit: u64,
}

const PROGRAM: usize = 1;

impl<'s> Evaluator<'s> {
    /// A program before its first scan; `limit` bounds the steps of each.
    #[must_use]
    pub fn new(source: &'s Source, limit: u64) -> Self {
        let globals = source.globals.iter().map(|var| source.first(var)).collect();
        let program = source.instance(source.units.len() - 1);
        Evaluator { source, frames: vec![Value::Many(globals), program], now: 0, steps: 0, limit }
    }

    /// Runs the program once, at a time of the round in nanoseconds.
    ///
    /// # Errors
    /// A trap, or too many steps; what was stored before stays.
    pub fn scan(&mut self, now: i64) -> Result<(), Stop> {
        (self.now, self.steps) = (i128::from(now), 0);
        let unit = self.source.units.len() - 1;
        let me = Ref { frame: PROGRAM, path: Vec::new() };
        let result = self.body(&Context { unit, me, in_outs: BTreeMap::new() });
        self.frames.truncate(PROGRAM + 1);
        result
    }

    /// Every variable that lives between scans: path in a dump, type, value.
    #[must_use]
    pub fn variables(&self) -> Vec<(String, Ty, Value)> {
        let mut found = Vec::new();
        if let Value::Many(parts) = &self.frames[0] {
            for (var, part) in self.source.globals.iter().zip(parts).filter(|(var, _)| !var.gone) {
                self.source.leaves(&var.name, var.ty, part, &mut found);
            }
        }
        let last = self.source.units.len() - 1;
        if let Value::Many(parts) = &self.frames[PROGRAM] {
            self.source.unit_leaves(&self.source.units[last].name, last, parts, &mut found);
        }
        found
    }

    fn step(&mut self) -> Result<(), Stop> {
        self.steps += 1;
        if self.steps > self.limit { Err(Stop::TooLong) } else { Ok(()) }
    }

    /// Runs a unit's statements with fresh VAR_TEMP.
    fn body(&mut self, context: &Context) -> Result<(), Stop> {
        let unit = &self.source.units[context.unit];
        for (at, var) in unit.vars.iter().enumerate().filter(|(_, var)| var.class == Class::Temp) {
            let first = self.source.first(var);
            *self.at(&child(&context.me, at)) = first;
        }
        self.list(context, &unit.body).map(|_| ())
    }

    fn at(&mut self, place: &Ref) -> &mut Value {
        place.path.iter().fold(&mut self.frames[place.frame], |value, step| match value {
            Value::Many(parts) => &mut parts[*step],
            other => panic!("{other:?} has no parts"),
        })
    }

    /// Follows a place; indices are evaluated and checked from left to right.
    fn place(&mut self, context: &Context, place: &Place) -> Result<Ref, Stop> {
        let (mut found, mut ty) = match place.base {
            Base::Global(at) => (Ref { frame: 0, path: vec![at] }, self.source.globals[at].ty),
            Base::Var(at) => {
                let ty = self.source.units[context.unit].vars[at].ty;
                (context.in_outs.get(&at).cloned().unwrap_or_else(|| child(&context.me, at)), ty)
            }
        };
        let source = self.source;
        for step in &place.steps {
            let Ty::N(id) = ty else { panic!("a step into {ty:?}") };
            match (step, &source.types[id].def) {
                (Step::Field(at), Def::Struct(fields)) => {
                    ty = fields[*at].1;
                    found.path.push(*at);
                }
                (Step::Field(at), Def::Block(unit)) => {
                    ty = source.units[*unit].vars[*at].ty;
                    found.path.push(*at);
                }
                (Step::Field(at), Def::Standard(standard)) => {
                    ty = Ty::K(standard.fields()[*at].1);
                    found.path.push(*at);
                }
                (Step::Index(indices), Def::Array(dims, element)) => {
                    let mut position = 0;
                    for (index, (low, high)) in indices.iter().zip(dims) {
                        let value = self.expr(context, index)?.int();
                        let (low, high) = (i128::from(*low), i128::from(*high));
                        if !(low..=high).contains(&value) {
                            // Bounds are DINT, and a trap shows an index as the nearest DINT.
                            let shown = value.clamp(i128::from(i32::MIN), i128::from(i32::MAX)) as i64;
                            return Err(Stop::Trap(TrapCode::ArrayIndex, [shown, low as i64, high as i64]));
                        }
                        position = position * (high - low + 1) + value - low;
                    }
                    ty = *element;
                    found.path.push(position as usize);
                }
                _ => panic!("a wrong step into {ty:?}"),
            }
        }
        Ok(found)
    }

    /// Stores a value: strings are cut, subranges checked.
    fn store(&mut self, place: &Ref, ty: Ty, mut value: Value) -> Result<(), Stop> {
        if let Ty::N(id) = ty
            && let Def::Subrange(_, low, high) = &self.source.types[id].def
            && !(*low..=*high).contains(&value.int())
        {
            return Err(Stop::Trap(TrapCode::Range, [value.int() as i64, *low as i64, *high as i64]));
        }
        if let (Ty::S(capacity), Value::Str(bytes)) = (ty, &mut value) {
            bytes.truncate(usize::from(capacity));
        }
        *self.at(place) = value;
        Ok(())
    }

    fn expr(&mut self, context: &Context, expr: &Expr) -> Result<Value, Stop> {
        self.step()?;
        let kind = |ty: Ty| if let Ty::K(kind) = ty { kind } else { Kind::Lint };
        Ok(match &expr.kind {
            ExprKind::Lit(value, _) => value.clone(),
            ExprKind::Get(place) => {
                let found = self.place(context, place)?;
                self.at(&found).clone()
            }
            ExprKind::Bin(op, left, right) => {
                let a = self.expr(context, left)?;
                match op {
                    Op::AndThen if a.int() == 0 => return Ok(a),
                    Op::OrElse if a.int() != 0 => return Ok(a),
                    _ => {}
                }
                let b = self.expr(context, right)?;
                binary(*op, kind(left.ty), &a, &b)?
            }
            ExprKind::Neg(inner) => negate(kind(inner.ty), &self.expr(context, inner)?),
            ExprKind::Not(inner) => complement(kind(inner.ty), &self.expr(context, inner)?),
            ExprKind::Widen(inner) | ExprKind::Conv(inner) | ExprKind::Trunc(inner) => {
                let value = self.expr(context, inner)?;
                match (inner.ty, expr.ty) {
                    (Ty::S(_), Ty::K(to)) => number_in(to, value.bytes()),
                    (_, Ty::S(_)) => Value::Str(value.int().to_string().into_bytes()),
                    (from, to) => convert(kind(from), kind(to), &value, matches!(expr.kind, ExprKind::Trunc(_))),
                }
            }
            ExprKind::Std(function, inputs) => {
                let values = inputs.iter().map(|input| self.expr(context, input)).collect::<Result<Vec<_>, _>>()?;
                standard(*function, kind(expr.ty), &values)
            }
            ExprKind::Call(unit, args) => self.call_function(context, *unit, args)?,
        })
    }

    fn call_function(&mut self, context: &Context, unit: usize, args: &[Arg]) -> Result<Value, Stop> {
        let source = self.source;
        let mut locals = source.instance(unit);
        let mut in_outs = BTreeMap::new();
        for arg in args {
            match arg {
                Arg::In(at, value) => {
                    let mut value = self.expr(context, value)?;
                    if let (Ty::S(capacity), Value::Str(bytes)) = (source.units[unit].vars[*at].ty, &mut value) {
                        bytes.truncate(usize::from(capacity));
                    }
                    if let Value::Many(parts) = &mut locals {
                        parts[*at] = value;
                    }
                }
                Arg::InOut(at, place) => {
                    let found = self.place(context, place)?;
                    in_outs.insert(*at, found);
                }
                Arg::Out(..) => {}
            }
        }
        self.frames.push(locals);
        let frame = self.frames.len() - 1;
        let me = Ref { frame, path: Vec::new() };
        self.body(&Context { unit, me: me.clone(), in_outs })?;
        self.outputs(context, &me, args)?;
        let Some(Value::Many(parts)) = self.frames.pop() else { panic!("no frame") };
        Ok(parts.into_iter().next().unwrap_or(Value::Int(0)))
    }

    fn outputs(&mut self, context: &Context, me: &Ref, args: &[Arg]) -> Result<(), Stop> {
        for arg in args {
            if let Arg::Out(at, place) = arg {
                let value = self.at(&child(me, *at)).clone();
                let target = self.place(context, place)?;
                self.store(&target, place.ty, value)?;
            }
        }
        Ok(())
    }

    fn call_block(&mut self, context: &Context, place: &Place, args: &[Arg]) -> Result<(), Stop> {
        let me = self.place(context, place)?;
        let source = self.source;
        let Ty::N(id) = place.ty else { panic!("a call of {place:?}") };
        let mut in_outs = BTreeMap::new();
        for arg in args {
            match arg {
                Arg::In(at, value) => {
                    let value = self.expr(context, value)?;
                    let ty = match &source.types[id].def {
                        Def::Block(unit) => source.units[*unit].vars[*at].ty,
                        _ => value_ty(&value),
                    };
                    self.store(&child(&me, *at), ty, value)?;
                }
                Arg::InOut(at, place) => {
                    let found = self.place(context, place)?;
                    in_outs.insert(*at, found);
                }
                Arg::Out(..) => {}
            }
        }
        match &source.types[id].def {
            Def::Block(unit) => self.body(&Context { unit: *unit, me: me.clone(), in_outs })?,
            Def::Standard(standard) => {
                let now = self.now;
                if let Value::Many(parts) = self.at(&me) {
                    standard.call(parts, now);
                }
            }
            other => panic!("a call of {other:?}"),
        }
        self.outputs(context, &me, args)
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

    fn stmt(&mut self, context: &Context, stmt: &Stmt) -> Result<Flow, Stop> {
        match stmt {
            Stmt::Assign(place, value) => {
                let target = self.place(context, place)?;
                let value = self.expr(context, value)?;
                self.store(&target, place.ty, value)?;
            }
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
                return self.for_loop(context, *control, (from, to, by.as_ref()), body);
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
            Stmt::Call(place, args) => self.call_block(context, place, args)?,
            Stmt::Exit => return Ok(Flow::Exit),
            Stmt::Continue => return Ok(Flow::Continue),
            Stmt::Return => return Ok(Flow::Return),
        }
        Ok(Flow::Next)
    }

    fn count(&mut self, context: &Context, counter: usize, value: i128) {
        *self.at(&child(&context.me, counter)) = Value::Int(value);
    }

    fn counted(&mut self, context: &Context, counter: usize) -> i128 {
        self.at(&child(&context.me, counter)).int()
    }

    fn for_loop(
        &mut self,
        context: &Context,
        control: usize,
        (from, to, by): (&Expr, &Expr, Option<&Expr>),
        body: &[Stmt],
    ) -> Result<Flow, Stop> {
        let Ty::K(kind) = self.source.units[context.unit].vars[control].ty else { panic!("a control variable") };
        let mut value = self.expr(context, from)?.int();
        let bound = self.expr(context, to)?.int();
        let step = by.map_or(Ok(1), |by| self.expr(context, by).map(|value| value.int()))?;
        if step == 0 {
            return Err(Stop::Trap(TrapCode::Range, [0; 3]));
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

fn child(place: &Ref, part: usize) -> Ref {
    let mut path = place.path.clone();
    path.push(part);
    Ref { frame: place.frame, path }
}

/// A type that stores a value of a standard block's input as it is.
fn value_ty(value: &Value) -> Ty {
    match value {
        Value::Int(_) => Ty::K(Kind::Lint),
        other => panic!("{other:?} is no input of a standard block"),
    }
}
