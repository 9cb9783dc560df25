//! Dates and times of day: their arithmetic (IEC 61131-3 table 35), their parts (table 36), and their conversions (tables 25 and 26).
//!
//! All are 64 bits of nanoseconds, since 1970-01-01 or since midnight, and wrap in them; the L-forms differ in nothing but their type and in how they meet
//! numbers. What the calendar says is for `khz_machine` to know.

use khz_bytecode::container::ElementaryType as E;
use khz_machine::library::functions::{FunctionRow, ResultRule, StandardFunction as F};
use khz_machine::semantics::{date_day, date_month, date_of, date_start, date_time, date_weekday, date_year};

use super::expr::{Checker, broken};
use super::fold;
use super::tree::{BinOp, CalendarOp, Expr, ExprKind, Place, Stmt, StmtKind};
use super::types::{
    BOOL, Const, DINT, Ty, TyKind, is_date, is_date_and_time, is_duration, is_integer, is_moment, is_time_of_day,
    long_form,
};
use crate::diagnostics::{semantic as names, types as rules};
use crate::source::Span;
use crate::syntax::ast::{self, Arg, ArgKind, Ident};

/// Nanoseconds of the units that parts of a time of day have, and how many of each make the next one; none for hours.
const PARTS: [(&str, i64, Option<i64>); 6] = [
    ("HOUR", 3_600_000_000_000, None),
    ("MINUTE", 60_000_000_000, Some(60)),
    ("SECOND", 1_000_000_000, Some(60)),
    ("MILLISECOND", 1_000_000, Some(1000)),
    ("MICROSECOND", 1_000, Some(1000)),
    ("NANOSECOND", 1, Some(1000)),
];

/// The type of a sum or difference with a date or time of day in it (table 35). `None`: there is none.
fn result_type(op: BinOp, a: E, b: E) -> Option<E> {
    let (long_a, long_b) = (long_form(a)?, long_form(b)?);
    let is_long = a == long_a || b == long_b;
    let same = |ty: E, long: E| if is_long { long } else { ty };
    match op {
        BinOp::Add | BinOp::Sub if is_duration(b) && (is_time_of_day(a) || is_date_and_time(a)) => {
            Some(same(a, long_a))
        }
        BinOp::Sub if is_moment(a) && long_a == long_b => Some(same(E::Time, E::Ltime)),
        _ => None,
    }
}

/// A conversion between times, in nanoseconds: a date is the start of its day, a time of day what has passed of it.
pub(super) fn convert_ns(value_ns: i64, from: E, to: E) -> i64 {
    match (from, to) {
        _ if is_date(to) && !is_date(from) => date_start(value_ns),
        _ if is_time_of_day(to) && (is_date(from) || is_date_and_time(from)) => date_time(value_ns),
        _ => value_ns,
    }
}

/// Whether a function is one of table 35 or 36 that works on types of its own.
pub(super) fn is_of_moments(row: &FunctionRow) -> bool {
    matches!(row.result, ResultRule::Of(_) | ResultRule::Nothing) || row.function == F::DayOfWeek
}

fn number(value: i64, span: Span) -> Expr {
    Expr { kind: ExprKind::Const(Const::Int(value)), ty: Ty::Elem(E::Lint), span }
}

impl<'a> Checker<'_, 'a> {
    /// Sums and differences with dates and times of day. `None`: it is no such operation.
    pub(super) fn moment_op(&mut self, op: BinOp, a: &Expr, b: &Expr, span: Span) -> Option<Expr> {
        let (x, y) = (self.an.types.elementary(a.ty)?, self.an.types.elementary(b.ty)?);
        let ty = Ty::Elem(result_type(op, x, y)?);
        if let (ExprKind::Const(first), ExprKind::Const(second)) = (&a.kind, &b.kind)
            && let Ok(value) = fold::binary(op, E::Lint, first, second)
        {
            return Some(Expr { kind: ExprKind::Const(value), ty, span });
        }
        Some(Expr { kind: ExprKind::Binary(op, Box::new(a.clone()), Box::new(b.clone())), ty, span })
    }

    /// What the calendar says of values, folded when they are known.
    fn calendar(op: CalendarOp, values: Vec<Expr>, ty: Ty, span: Span) -> Expr {
        let known: Option<Vec<i64>> = values
            .iter()
            .map(|value| match value.kind {
                ExprKind::Const(Const::Int(value)) => Some(value),
                _ => None,
            })
            .collect();
        let folded = match (op, known.as_deref()) {
            (CalendarOp::Year, Some([a])) => Some(i64::from(date_year(*a))),
            (CalendarOp::Month, Some([a])) => Some(i64::from(date_month(*a))),
            (CalendarOp::Day, Some([a])) => Some(i64::from(date_day(*a))),
            (CalendarOp::Weekday, Some([a])) => Some(i64::from(date_weekday(*a))),
            (CalendarOp::Of, Some([a, b])) => Some(date_of(*a, *b)),
            _ => None,
        };
        let kind = match folded {
            Some(value) => ExprKind::Const(Const::Int(value)),
            None => ExprKind::Calendar(op, values),
        };
        Expr { kind, ty, span }
    }

    /// The nanoseconds of a time as a LINT.
    fn nanoseconds(&mut self, value: Expr) -> Expr {
        let value = self.convert(value, E::Ltime, false);
        self.convert(value, E::Lint, false)
    }

    /// A function of table 35 or 36 with a result, its arguments brought to the types of their parameters.
    pub(super) fn moment_call(&mut self, row: &FunctionRow, mut values: Vec<Expr>, span: Span, want: Ty) -> Expr {
        let ResultRule::Of(result) = row.result else { return self.weekday_or_nothing(row, values, span, want) };
        match row.function {
            F::ConcatDate | F::ConcatLdate => self.start_of_day(values, result, span),
            F::ConcatTod | F::ConcatLtod => {
                let time = self.sum_of_parts(values, span);
                let time = self.convert(time, E::Ltime, false);
                self.convert(time, result, false)
            }
            F::ConcatDt | F::ConcatLdt => {
                let time = values.split_off(3);
                let date = self.start_of_day(values, E::Ldate, span);
                let date = self.nanoseconds(date);
                let time = self.sum_of_parts(time, span);
                self.moment_of(date, time, result, span)
            }
            F::ConcatDateTod | F::ConcatDateLtod | F::ConcatLdateTod | F::ConcatLdateLtod => {
                let (Some(time), Some(date)) = (values.pop(), values.pop()) else { return broken(span) };
                let (date, time) = (self.nanoseconds(date), self.nanoseconds(time));
                self.moment_of(date, time, result, span)
            }
            _ => {
                let (Some(b), Some(a)) = (values.pop(), values.pop()) else { return broken(span) };
                let op = match row.name.get(..3) {
                    Some("ADD") => BinOp::Add,
                    Some("SUB") => BinOp::Sub,
                    Some("MUL") => BinOp::Mul,
                    _ => BinOp::Div,
                };
                self.binary_op(op, a, b, span, want)
            }
        }
    }

    fn weekday_or_nothing(&mut self, row: &FunctionRow, values: Vec<Expr>, span: Span, want: Ty) -> Expr {
        if row.result == ResultRule::Nothing {
            let message = format!("{} has no result; call it in a statement", row.name);
            self.an.report(&rules::MISMATCH, span, message);
            return broken(span);
        }
        let wanted = self.an.types.elementary(want).filter(|ty| is_integer(*ty)).unwrap_or(E::Dint);
        let found = Self::calendar(CalendarOp::Weekday, values, DINT, span);
        self.convert(found, wanted, false)
    }

    fn moment_of(&mut self, date: Expr, time: Expr, to: E, span: Span) -> Expr {
        let sum = self.binary_op(BinOp::Add, date, time, span, Ty::Void);
        let sum = self.convert(sum, E::Ltime, false);
        self.convert(sum, to, false)
    }

    /// The start of a day by its year, month and day.
    fn start_of_day(&mut self, parts: Vec<Expr>, ty: E, span: Span) -> Expr {
        let Ok([year, month, day]) = <[Expr; 3]>::try_from(parts) else { return broken(span) };
        let years = self.binary_op(BinOp::Mul, year, number(12, span), span, Ty::Void);
        let months = self.binary_op(BinOp::Sub, month, number(1, span), span, Ty::Void);
        let months = self.binary_op(BinOp::Add, years, months, span, Ty::Void);
        Self::calendar(CalendarOp::Of, vec![months, day], Ty::Elem(ty), span)
    }

    /// Nanoseconds of hours, minutes and so on, as a LINT.
    fn sum_of_parts(&mut self, parts: Vec<Expr>, span: Span) -> Expr {
        let mut sum: Option<Expr> = None;
        for (part, (_, unit_ns, _)) in parts.into_iter().zip(PARTS) {
            let part = self.binary_op(BinOp::Mul, part, number(unit_ns, span), span, Ty::Void);
            sum = Some(match sum {
                None => part,
                Some(before) => self.binary_op(BinOp::Add, before, part, span, Ty::Void),
            });
        }
        sum.unwrap_or_else(|| broken(span))
    }

    /// An integer argument as a LINT.
    pub(super) fn part_argument(&mut self, value: Expr) -> Expr {
        let value = self.settle(value, Ty::Elem(E::Lint));
        if value.ty == Ty::Error { value } else { self.convert(value, E::Lint, false) }
    }

    /// One part of a date, a time of day or both, by the name of its output.
    fn part_of(&mut self, whole: Expr, name: &str, span: Span) -> Expr {
        let op = match name {
            "YEAR" => Some(CalendarOp::Year),
            "MONTH" => Some(CalendarOp::Month),
            "DAY" => Some(CalendarOp::Day),
            _ => None,
        };
        if let Some(op) = op {
            return Self::calendar(op, vec![whole], DINT, span);
        }
        let is_moment = self.an.types.elementary(whole.ty).is_some_and(is_date_and_time);
        let time = if is_moment { self.convert(whole, E::LtimeOfDay, false) } else { whole };
        let time = self.nanoseconds(time);
        let Some((_, unit_ns, modulus)) = PARTS.iter().find(|(part, ..)| *part == name) else { return broken(span) };
        let count = self.binary_op(BinOp::Div, time, number(*unit_ns, span), span, Ty::Void);
        match modulus {
            Some(modulus) => self.binary_op(BinOp::Mod, count, number(*modulus, span), span, Ty::Void),
            None => count,
        }
    }

    /// `SPLIT_DATE(IN := d, YEAR => y)` and its like: assignments, of which all but the last wait in [`Checker::pending`].
    pub(super) fn split_call(&mut self, row: &'static FunctionRow, args: &'a [Arg], span: Span) -> Option<Stmt> {
        let mut bound = Split::default();
        let mut sound = true;
        for (position, arg) in args.iter().enumerate() {
            sound &= self.bind_split(row, position, arg, &mut bound);
        }
        let input = row.parameters.first().and_then(|parameter| match parameter.class {
            khz_machine::library::functions::TypeClass::Of(ty) => Some(ty),
            _ => None,
        })?;
        let Some(given) = bound.input else {
            if sound {
                self.an.report(&names::ARGUMENT_COUNT, span, format!("{} takes IN, and gives parts of it", row.name));
            }
            return None;
        };
        let enabled = bound.enabled.map(|enabled| self.condition(enabled));
        let value = self.expr_of(given, Ty::Elem(input));
        let mut targets: Vec<(&str, Place)> = Vec::new();
        for (name, target) in bound.outputs {
            match self.target(target) {
                Some(place) if self.takes_part(&place) => targets.push((name, place)),
                _ => sound = false,
            }
        }
        let done = match bound.done {
            Some(target) => Some(self.target(target)?),
            None => None,
        };
        if !sound || value.ty == Ty::Error {
            return None;
        }
        let mut list = self.split_assignments(value, targets, span);
        let says = |value: bool, target: &Place| Stmt {
            kind: StmtKind::Assign {
                target: target.clone(),
                value: Expr { kind: ExprKind::Const(Const::Int(i64::from(value))), ty: BOOL, span },
            },
            span,
        };
        list.extend(done.as_ref().map(|target| says(true, target)));
        if let Some(condition) = enabled {
            let otherwise = done.iter().map(|target| says(false, target)).collect();
            return Some(Stmt { kind: StmtKind::If { branches: vec![(condition, list)], otherwise }, span });
        }
        let last = list.pop();
        self.pending.extend(list);
        last
    }

    /// The assignments to the outputs; the input is evaluated once, and first.
    fn split_assignments(&mut self, value: Expr, targets: Vec<(&str, Place)>, span: Span) -> Vec<Stmt> {
        let ty = value.ty;
        let mut list = Vec::new();
        let mut waiting = Some(value);
        let count = targets.len();
        for (at, (name, target)) in targets.into_iter().enumerate() {
            let whole = waiting.take().unwrap_or(Expr { kind: ExprKind::Kept, ty, span });
            let is_constant = matches!(whole.kind, ExprKind::Const(_));
            let whole = match whole {
                whole if is_constant => {
                    waiting = Some(whole.clone());
                    whole
                }
                whole if at + 1 == count => whole,
                whole => Expr { kind: ExprKind::Keep(Box::new(whole)), ty, span },
            };
            let part = self.part_of(whole, name, span);
            let base = self.an.types.elementary(target.ty).unwrap_or(E::Lint);
            let part = self.convert(part, base, false);
            let value = self.coerce(part, target.ty);
            if value.ty != Ty::Error {
                list.push(Stmt { kind: StmtKind::Assign { target, value }, span });
            }
        }
        if count == 0 {
            list.extend(waiting.map(|value| Stmt { kind: StmtKind::Evaluate(value), span }));
        }
        list
    }

    fn takes_part(&mut self, place: &Place) -> bool {
        let fits = self.an.types.elementary(place.ty).is_some_and(is_integer)
            && !matches!(self.an.types.kind(place.ty), Some(TyKind::Enum { .. }));
        if !fits && place.ty != Ty::Error {
            let message = format!("an integer is wanted here, not {}", self.an.types.name(place.ty));
            self.an.report(&rules::MISMATCH, place.span, message);
        }
        fits
    }

    /// Finds the parameter of an argument. FALSE: it was reported.
    fn bind_split(&mut self, row: &'static FunctionRow, position: usize, arg: &'a Arg, bound: &mut Split<'a>) -> bool {
        let (name, value, is_output) = match &arg.kind {
            ArgKind::Positional(value) => match position.checked_sub(1) {
                None => ("IN", Some(value), false),
                Some(at) => match row.outputs.get(at) {
                    Some(output) => (*output, Some(value), true),
                    None => {
                        let message = format!("{} takes {} arguments", row.name, row.outputs.len() + 1);
                        self.an.report(&names::ARGUMENT_COUNT, arg.span, message);
                        return false;
                    }
                },
            },
            ArgKind::Input { name, value } => (self.an.text(name.symbol), value.as_ref(), false),
            ArgKind::Output { name, negated: false, target } => (self.an.text(name.symbol), target.as_ref(), true),
            ArgKind::Output { name, negated: true, .. } => return self.not_negated(name),
        };
        let Some(value) = value else { return true };
        let before = match (name, is_output, row.outputs.iter().find(|output| **output == name)) {
            ("IN", false, _) => bound.input.replace(value).is_some(),
            ("EN", false, _) => bound.enabled.replace(value).is_some(),
            ("ENO", true, _) => bound.done.replace(value).is_some(),
            (_, true, Some(output)) => {
                let twice = bound.outputs.iter().any(|(other, _)| other == output);
                bound.outputs.push((output, value));
                twice
            }
            _ => {
                let message = format!("{} has no such {}", row.name, if is_output { "output" } else { "input" });
                self.an.report(&names::UNKNOWN_PARAMETER, arg.span, message);
                return false;
            }
        };
        if before {
            self.an.report(&names::PARAMETER_TWICE, arg.span, "this parameter is given twice");
        }
        !before
    }

    fn not_negated(&mut self, name: &Ident) -> bool {
        self.an.report(&rules::OPERATOR, name.span, "NOT before => is for BOOL outputs");
        false
    }
}

/// Arguments of a call that splits a date or time of day.
#[derive(Default)]
struct Split<'a> {
    input: Option<&'a ast::Expr>,
    enabled: Option<&'a ast::Expr>,
    done: Option<&'a ast::Expr>,
    outputs: Vec<(&'static str, &'a ast::Expr)>,
}
