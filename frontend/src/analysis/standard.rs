//! Calls of standard functions and conversions.

use khz_bytecode::container::ElementaryType as E;
use khz_machine::library::functions::{self, FunctionRow, Parameter, ResultRule, StandardFunction as F, TypeClass};

use super::enabled::{Arguments, has_member};
use super::expr::{Checker, broken};
use super::fold;
use super::moments::is_of_moments;
use super::testing::is_test_word;
use super::tree::{BinOp, Expr, ExprKind, TextOp, UnOp};
use super::types::{
    BOOL, Const, DINT, INT, Ty, TyKind, elementary_by_name, is_character, is_integer, is_moment, is_real, widen, wrap,
};
use crate::diagnostics::{Diagnostic, semantic as names, types as rules};
use crate::source::Span;
use crate::syntax::ast::{self, Arg, ArgKind, Ident};

/// Whether an argument may be left out.
fn is_optional(parameter: &Parameter) -> bool {
    parameter.class == TypeClass::FinePart
}

impl<'a> Checker<'_, 'a> {
    /// A call of a name that is no variable and no unit of the user.
    pub(super) fn standard_call(&mut self, name: &Ident, args: &'a [Arg], span: Span, want: Ty) -> Expr {
        let text = self.an.text(name.symbol);
        let given = self.without_enable(args);
        if let Some(found) = self.known_call(text, &given, span, want) {
            return self.enable(found, &given, want, span);
        }
        let mut known: Vec<_> = self.an.pou_names.keys().copied().collect();
        known.extend(functions::TABLE.iter().filter_map(|row| self.an.ast.names.lookup_folded(row.name)));
        if let Some(pou) = self.pou {
            known.extend(self.an.scopes.get(pou.0 as usize).into_iter().flat_map(|scope| scope.keys().copied()));
        }
        if self.find_variable(name.symbol).is_some() {
            let message = format!("`{}` is a variable that can not be called", self.an.spelling(name));
            self.an.report(&names::NOT_CALLABLE, name.span, message);
        } else if is_test_word(text) {
            let message = format!("there is no function `{}`", self.an.spelling(name));
            let found = Diagnostic::new(&names::UNKNOWN_NAME, name.span, message);
            self.an.push(found.help("it means something only in a TEST, and as a statement"));
        } else {
            let message = format!("there is no function `{}`", self.an.spelling(name));
            self.an.report_unknown(&names::UNKNOWN_NAME, name, message, known.into_iter());
        }
        for arg in args {
            if let ArgKind::Positional(value) | ArgKind::Input { value: Some(value), .. } = &arg.kind {
                self.expr(value, Ty::Void);
            }
        }
        broken(span)
    }

    /// A function of the table, a typed one or a conversion. `None`: it is none of them.
    fn known_call(&mut self, text: &'a str, args: &Arguments<'a>, span: Span, want: Ty) -> Option<Expr> {
        if let Some(row) = functions::find(text) {
            return Some(self.row_call(row, None, args, span, want));
        }
        if let Some(found) = self.bcd_call(text, args, span) {
            return Some(found);
        }
        if let Some(found) = self.conversion_call(text, args, span) {
            return Some(found);
        }
        let (row, ty) = self.typed_function(text)?;
        let want = if row.result == ResultRule::Generic { ty } else { want };
        let found = self.row_call(row, Some(ty), args, span, want);
        Some(if row.result == ResultRule::Generic { self.coerce(found, ty) } else { found })
    }

    /// The arguments in the order of the parameters. `None`: it was reported.
    fn row_arguments(&mut self, row: &FunctionRow, args: &Arguments<'a>, span: Span) -> Option<Vec<&'a ast::Expr>> {
        let fixed = row.parameters.len();
        let mut list: Vec<Option<&'a ast::Expr>> = vec![None; fixed];
        for (position, arg) in args.list.iter().enumerate() {
            let (at, value) = match &arg.kind {
                ArgKind::Positional(value) => (Some(position), Some(value)),
                ArgKind::Input { name, value } => (self.row_position(row, self.an.text(name.symbol)), value.as_ref()),
                ArgKind::Output { .. } => (None, None),
            };
            match (at, value) {
                (Some(at), Some(value)) if at < fixed || row.extensible => {
                    if at >= list.len() {
                        list.resize(at + 1, None);
                    }
                    if list[at].replace(value).is_some() {
                        self.an.report(&names::PARAMETER_TWICE, arg.span, "this parameter is given twice");
                        return None;
                    }
                }
                (Some(_), Some(_)) => {
                    let message = format!("{} takes {fixed} arguments", row.name);
                    self.an.report(&names::ARGUMENT_COUNT, arg.span, message);
                    return None;
                }
                _ => {
                    let message = format!("{} has no such parameter", row.name);
                    self.an.report(&names::UNKNOWN_PARAMETER, arg.span, message);
                    return None;
                }
            }
        }
        while matches!(list.last(), Some(None)) && row.parameters.get(list.len() - 1).is_some_and(is_optional) {
            list.pop();
        }
        let given: Option<Vec<&'a ast::Expr>> = list.into_iter().collect();
        if given.is_none() {
            self.an.report(&names::ARGUMENT_COUNT, span, format!("{} takes {fixed} arguments", row.name));
        }
        given
    }

    /// Position of a formal parameter: `IN3` of an extensible function is one past `IN2`.
    fn row_position(&self, row: &FunctionRow, name: &str) -> Option<usize> {
        if let Some(at) = row.parameters.iter().position(|parameter| parameter.name == name) {
            return Some(at);
        }
        let last = row.parameters.last().filter(|_| row.extensible)?;
        let number = |text: &str| text.trim_start_matches(|c: char| !c.is_ascii_digit()).parse::<usize>().ok();
        let (base, wanted) = (number(last.name)?, number(name)?);
        let stem = last.name.trim_end_matches(|c: char| c.is_ascii_digit());
        // Nobody writes a call with more inputs than this, and a list of that length must not be made of one number.
        let fits = name.starts_with(stem) && wanted > base && wanted <= 4096;
        fits.then(|| row.parameters.len() - 1 + (wanted - base))
    }

    /// A call of a row; of a typed name, `typed` is its type.
    fn row_call(
        &mut self,
        row: &'static FunctionRow,
        typed: Option<Ty>,
        args: &Arguments<'a>,
        span: Span,
        want: Ty,
    ) -> Expr {
        let Some(given) = self.row_arguments(row, args, span) else { return broken(span) };
        let last = row.parameters.len().saturating_sub(1);
        let compares = row.result == ResultRule::Bool;
        let hint = if row.result == ResultRule::Generic { want } else { Ty::Void };
        let mut values = Vec::with_capacity(given.len());
        for (at, value) in given.iter().enumerate() {
            let class = row.parameters[at.min(last)].class;
            let hint = match class {
                TypeClass::Bool => BOOL,
                TypeClass::Count => DINT,
                TypeClass::Of(ty) => Ty::Elem(ty),
                TypeClass::Part | TypeClass::FinePart => Ty::Elem(E::Lint),
                _ if typed.is_some() => typed.unwrap_or(Ty::Void),
                _ if compares => values.first().map_or(Ty::Void, |first: &Expr| first.ty),
                _ => hint,
            };
            let found = self.expr(value, hint);
            let found = self.typed_argument(row, at, found, typed);
            if found.ty == Ty::Error || !self.check_class(row, &found, class) {
                return broken(span);
            }
            let found = match class {
                TypeClass::Bool => self.coerce(found, BOOL),
                TypeClass::Count if matches!(row.function, F::Rol | F::Ror) => self.turns(found),
                TypeClass::Count => self.count(found),
                TypeClass::Of(ty) => self.coerce(found, Ty::Elem(ty)),
                TypeClass::Part | TypeClass::FinePart => self.part_argument(found),
                _ => found,
            };
            if found.ty == Ty::Error {
                return broken(span);
            }
            values.push(found);
        }
        self.row_result(row, values, span, want)
    }

    fn count(&mut self, value: Expr) -> Expr {
        let value = self.settle(value, DINT);
        let span = value.span;
        match value.kind {
            ExprKind::Const(_) if value.ty == DINT => value,
            _ if value.ty == Ty::Error => value,
            ExprKind::Const(Const::Int(known)) => {
                let wide = self.an.types.elementary(value.ty).map_or(0, |ty| widen(ty, known));
                let index = wide.clamp(i128::from(i32::MIN), i128::from(i32::MAX));
                Expr { kind: ExprKind::Const(Const::Int(wrap(E::Dint, index))), ty: DINT, span }
            }
            _ => Expr { kind: ExprKind::ToIndex(Box::new(value)), ty: DINT, span },
        }
    }

    /// The count of a rotation: it is taken modulo a width, so that its low bits say all.
    fn turns(&mut self, value: Expr) -> Expr {
        let value = self.settle(value, DINT);
        if value.ty == Ty::Error { value } else { self.convert(value, E::Dint, false) }
    }

    fn check_class(&mut self, row: &FunctionRow, value: &Expr, class: TypeClass) -> bool {
        let elementary = self.an.types.elementary(value.ty);
        let is_enum = self.is_enum(value.ty);
        let fits = match (class, value.ty) {
            (TypeClass::AnyElementary, ty) if ty.is_text() || matches!(ty, Ty::IntLit | Ty::RealLit) => true,
            (TypeClass::AnyElementary, _) => elementary.is_some(),
            (TypeClass::AnyString, ty) => ty.is_text(),
            (TypeClass::AnyChars, ty) => ty.is_text() || elementary.is_some_and(is_character),
            (TypeClass::Bool, ty) => ty == BOOL,
            (TypeClass::Array, ty) => {
                matches!(self.an.types.kind(ty), Some(TyKind::Array { .. } | TyKind::Open { .. }))
            }
            (TypeClass::Of(_), _) => true,
            (TypeClass::Float, Ty::RealLit) => true,
            (TypeClass::Float, Ty::IntLit) => false,
            (_, Ty::IntLit) => true,
            (TypeClass::AnyMagnitude | TypeClass::AnyNum | TypeClass::AnyReal, Ty::RealLit) => true,
            _ if is_enum => false,
            // An integer becomes a float here.
            (TypeClass::AnyReal, _) => elementary.is_some_and(|ty| is_integer(ty) || is_real(ty)),
            // Dates and times of day are summed with durations, so that there is no name with one type for it.
            (TypeClass::AnyMagnitude, _) if elementary.is_some_and(is_moment) => true,
            _ => elementary.is_some_and(|ty| has_member(class, ty)),
        };
        if !fits {
            let message = format!("{} takes {} here, not {}", row.name, class.describe(), self.an.types.name(value.ty));
            self.an.report(&rules::ARGUMENT, value.span, message);
        }
        fits
    }

    fn row_result(&mut self, row: &FunctionRow, mut values: Vec<Expr>, span: Span, want: Ty) -> Expr {
        let compares = [
            (F::Gt, BinOp::Gt),
            (F::Ge, BinOp::Ge),
            (F::Eq, BinOp::Eq),
            (F::Le, BinOp::Le),
            (F::Lt, BinOp::Lt),
            (F::Ne, BinOp::Ne),
        ];
        if let Some((_, op)) = compares.iter().find(|(function, _)| *function == row.function) {
            return self.compare_chain(*op, values, span);
        }
        match row.function {
            F::Add
            | F::Mul
            | F::Sub
            | F::Div
            | F::Mod
            | F::And
            | F::Or
            | F::Xor
            | F::Expt
            | F::Min
            | F::Max
            | F::Atan2 => self.fold_left(row.function, values, span, want),
            F::Limit => {
                let high = values.pop();
                values.swap(0, 1); // MAX(IN, MN), then MIN with MX.
                let inner = self.fold_left(F::Max, values, span, want);
                let inner = self.lower_limit_first(inner);
                let Some(high) = high else { return broken(span) };
                self.fold_left(F::Min, vec![inner, high], span, want)
            }
            F::Not
            | F::Abs
            | F::Sqrt
            | F::Ln
            | F::Log
            | F::Exp
            | F::Sin
            | F::Cos
            | F::Tan
            | F::Asin
            | F::Acos
            | F::Atan => self.unary_call(row.function, values, span, want),
            F::Trunc => {
                let wanted = self.an.types.elementary(want).filter(|ty| is_integer(*ty)).unwrap_or(E::Dint);
                let Some(value) = values.pop() else { return broken(span) };
                let value = self.settle(value, Ty::Void);
                self.convert(value, wanted, true)
            }
            F::ToBigEndian | F::BigEndianTo | F::ToLittleEndian | F::LittleEndianTo | F::IsValid | F::IsValidBcd => {
                self.code_call(row.function, values, span, want)
            }
            F::Move => {
                let Some(value) = values.pop() else { return broken(span) };
                let value = self.settle(value, want);
                self.itself(value, span)
            }
            F::Shl | F::Shr | F::Rol | F::Ror => self.shift(row.function, values, span, want),
            F::LowerBound | F::UpperBound => match values.as_slice() {
                [array, dim] => self.array_bound(array, dim, row.function == F::UpperBound, span),
                _ => broken(span),
            },
            F::Sel | F::Mux => self.selection(row.function, values, span, want),
            _ if is_of_moments(row) => self.moment_call(row, values, span, want),
            _ => self.text_call(row.function, values, span),
        }
    }

    /// `GT(a, b, c)`: a > b AND b > c, where b is evaluated once.
    fn compare_chain(&mut self, op: BinOp, values: Vec<Expr>, span: Span) -> Expr {
        let last = values.len().saturating_sub(1);
        let mut values = values.into_iter().enumerate();
        let Some((_, mut left)) = values.next() else { return broken(span) };
        let mut found: Option<Expr> = None;
        for (at, value) in values {
            // Constants and variables are read again; between the two readings nothing is evaluated.
            let is_read_again = at == last || matches!(value.kind, ExprKind::Const(_) | ExprKind::Load(_));
            let (right, next) = if is_read_again {
                (value.clone(), value)
            } else {
                let (ty, span) = (value.ty, value.span);
                let kept = Expr { kind: ExprKind::Kept, ty, span };
                (Expr { kind: ExprKind::Keep(Box::new(value)), ty, span }, kept)
            };
            let one = self.binary_op(op, left, right, span, Ty::Void);
            found = Some(match found {
                None => one,
                Some(before) => self.binary_op(BinOp::And, before, one, span, BOOL),
            });
            left = next;
        }
        found.unwrap_or_else(|| broken(span))
    }

    fn fold_left(&mut self, function: F, values: Vec<Expr>, span: Span, want: Ty) -> Expr {
        let op = match function {
            F::Add => BinOp::Add,
            F::Mul => BinOp::Mul,
            F::Sub => BinOp::Sub,
            F::Div => BinOp::Div,
            F::Mod => BinOp::Mod,
            F::And => BinOp::And,
            F::Or => BinOp::Or,
            F::Xor => BinOp::Xor,
            F::Expt => BinOp::Pow,
            F::Min => BinOp::Min,
            F::Max => BinOp::Max,
            _ => BinOp::Atan2,
        };
        // A literal beside a typed operand is of that type, whatever the result goes to.
        let typed =
            values.iter().filter_map(|value| self.an.types.elementary(value.ty)).max_by_key(|ty| *ty != E::Real);
        let beside = match typed {
            Some(E::Real) => Ty::Elem(E::Real),
            Some(_) => Ty::Elem(E::Lreal),
            None => want,
        };
        let mut found: Option<Expr> = None;
        for value in values {
            let value = if op == BinOp::Atan2 { self.as_real(value, beside) } else { value };
            found = Some(match found {
                None => value,
                Some(before) => self.binary_op(op, before, value, span, want),
            });
        }
        found.unwrap_or_else(|| broken(span))
    }

    /// MAX(IN, MN) of a LIMIT, evaluated as it is written: MN first. Only of floats it matters which is the first operand.
    fn lower_limit_first(&self, mut inner: Expr) -> Expr {
        let real = self.an.types.elementary(inner.ty).is_some_and(is_real);
        if let ExprKind::Binary(op @ BinOp::Max, input, limit) = &mut inner.kind {
            std::mem::swap(input, limit);
            if real {
                *op = BinOp::Raise;
            }
        }
        inner
    }

    /// An operand of a function over ANY_REAL: an integer becomes an LREAL.
    fn as_real(&mut self, value: Expr, want: Ty) -> Expr {
        let value = match value.ty {
            Ty::IntLit | Ty::RealLit => {
                let to = if self.an.types.elementary(want) == Some(E::Real) { E::Real } else { E::Lreal };
                return self.literal(&value, to);
            }
            _ => value,
        };
        match self.an.types.elementary(value.ty) {
            Some(ty) if is_real(ty) => value,
            Some(ty) => {
                let message = format!("{} becomes LREAL here", ty.name());
                self.an.report_vendor(&rules::PRECISION, value.span, message);
                self.convert(value, E::Lreal, false)
            }
            None => value,
        }
    }

    fn unary_call(&mut self, function: F, mut values: Vec<Expr>, span: Span, want: Ty) -> Expr {
        let Some(value) = values.pop() else { return broken(span) };
        let op = match function {
            F::Not => UnOp::Not,
            F::Abs => UnOp::Abs,
            F::Sqrt => UnOp::Sqrt,
            F::Ln => UnOp::Ln,
            F::Log => UnOp::Log,
            F::Exp => UnOp::Exp,
            F::Sin => UnOp::Sin,
            F::Cos => UnOp::Cos,
            F::Tan => UnOp::Tan,
            F::Asin => UnOp::Asin,
            F::Acos => UnOp::Acos,
            _ => UnOp::Atan,
        };
        let value = match op {
            UnOp::Not | UnOp::Abs => self.settle(value, want),
            _ => self.as_real(value, want),
        };
        if value.ty == Ty::Error {
            return broken(span);
        }
        self.unary_op(op, value, span)
    }

    /// A value that a function gives as it is: it stands where the call does, and what traps in it where that stands.
    fn itself(&self, value: Expr, span: Span) -> Expr {
        let ty = value.ty;
        match value.kind {
            ExprKind::Const(_) => Expr { span, ..value },
            _ if self.an.types.storage(ty).is_none() => value,
            _ => Expr { kind: ExprKind::Convert { value: Box::new(value), truncates: false }, ty, span },
        }
    }

    /// Byte order and validity. The machine's own order is the little-endian one.
    fn code_call(&mut self, function: F, mut values: Vec<Expr>, span: Span, want: Ty) -> Expr {
        let Some(value) = values.pop() else { return broken(span) };
        let value = self.settle(value, want);
        let (op, ty) = match function {
            _ if value.ty == Ty::Error => return broken(span),
            F::ToLittleEndian | F::LittleEndianTo => return self.itself(value, span),
            F::ToBigEndian | F::BigEndianTo => (UnOp::SwapBytes, self.an.types.without_range(value.ty)),
            F::IsValid => (UnOp::IsValid, BOOL),
            _ => (UnOp::IsValidBcd, BOOL),
        };
        Expr { ty, ..self.unary_op(op, value, span) }
    }

    fn shift(&mut self, function: F, mut values: Vec<Expr>, span: Span, want: Ty) -> Expr {
        let (Some(count), Some(value)) = (values.pop(), values.pop()) else { return broken(span) };
        let value = self.settle(value, want);
        let op = match function {
            F::Shl => BinOp::Shl,
            F::Shr => BinOp::Shr,
            F::Rol => BinOp::Rol,
            _ => BinOp::Ror,
        };
        if value.ty == Ty::Error || count.ty == Ty::Error {
            return broken(span);
        }
        let ty = self.an.types.without_range(value.ty);
        if let (ExprKind::Const(x), ExprKind::Const(y), Some(elementary)) =
            (&value.kind, &count.kind, self.an.types.elementary(ty))
            && let Some(folded) = fold::shift(op, elementary, x, y)
        {
            return Expr { kind: ExprKind::Const(folded), ty, span };
        }
        Expr { kind: ExprKind::Binary(op, Box::new(value), Box::new(count)), ty, span }
    }

    /// Brings inputs to the type in which all meet.
    fn unify_all(&mut self, values: Vec<Expr>, span: Span, want: Ty) -> Option<(Vec<Expr>, Ty)> {
        let mut meet: Option<Expr> = None;
        for value in &values {
            meet = Some(match meet {
                None => value.clone(),
                Some(before) => {
                    let (x, y) = (before.ty, value.ty);
                    let Some((a, _, ty)) = self.unify(before, value.clone(), span, want) else {
                        let (x, y) = (self.an.types.name(x), self.an.types.name(y));
                        self.an.report(&rules::MISMATCH, value.span, format!("{x} and {y} have no type in common"));
                        return None;
                    };
                    Expr { ty, ..a }
                }
            });
        }
        let meet = meet?;
        let ty = self.settle(meet, want).ty;
        let ty = self.an.types.without_range(ty);
        let values = values.into_iter().map(|value| self.coerce(value, ty)).collect();
        Some((values, ty))
    }

    fn selection(&mut self, function: F, mut values: Vec<Expr>, span: Span, want: Ty) -> Expr {
        let selector = values.remove(0);
        let Some((mut values, ty)) = self.unify_all(values, span, want) else { return broken(span) };
        if selector.ty == Ty::Error || values.iter().any(|value| value.ty == Ty::Error) {
            return broken(span);
        }
        if let Some(chosen) = chosen(function, &selector, &values) {
            return Expr { kind: ExprKind::Const(chosen), ty, span };
        }
        if function == F::Mux {
            values.insert(0, selector);
            return Expr { kind: ExprKind::Mux(values), ty, span };
        }
        let (Some(b), Some(a)) = (values.pop(), values.pop()) else { return broken(span) };
        Expr { kind: ExprKind::Select(Box::new([selector, a, b])), ty, span }
    }

    fn text_call(&mut self, function: F, values: Vec<Expr>, span: Span) -> Expr {
        let Some(values) = self.texts_of_one_width(values) else { return broken(span) };
        let wide = values.first().is_some_and(|value| value.ty.is_wide_text());
        let capacity = |value: &Expr| u32::from(value.ty.capacity().unwrap_or(0));
        let sum = values.iter().map(capacity).sum::<u32>().min(khz_bytecode::limits::MAX_STRING_LENGTH);
        let sum = u16::try_from(sum.max(1)).unwrap_or(u16::MAX);
        let first = values.first().map_or(1, capacity);
        let first = Ty::text(wide, u16::try_from(first).unwrap_or(u16::MAX));
        let (op, ty) = match function {
            F::Len => (TextOp::Len, INT),
            F::Find => (TextOp::Find, INT),
            F::Left => (TextOp::Left, first),
            F::Right => (TextOp::Right, first),
            F::Mid => (TextOp::Mid, first),
            F::Delete => (TextOp::Delete, first),
            F::Insert => (TextOp::Insert, Ty::text(wide, sum)),
            F::Replace => (TextOp::Replace, Ty::text(wide, sum)),
            _ => (TextOp::Concat, Ty::text(wide, sum)),
        };
        if op != TextOp::Concat {
            return text(op, values, ty, span);
        }
        let mut found: Option<Expr> = None;
        for value in values {
            found = Some(match found {
                None => value,
                Some(before) => {
                    let length = (capacity(&before) + capacity(&value)).min(khz_bytecode::limits::MAX_STRING_LENGTH);
                    let ty = Ty::text(wide, u16::try_from(length).unwrap_or(u16::MAX));
                    text(TextOp::Concat, vec![before, value], ty, span)
                }
            });
        }
        found.unwrap_or_else(|| broken(span))
    }

    /// `INT_TO_REAL(x)`, `TO_REAL(x)`, `Color_TO_INT(x)`, `TO_Color(x)`. `None`: the name is no conversion.
    fn conversion_call(&mut self, text: &'a str, args: &Arguments<'a>, span: Span) -> Option<Expr> {
        let shape = functions::conversion(text)?;
        let to = self.conversion_type(shape.to, span)?;
        let from = match shape.from {
            Some(from) => Some(self.conversion_type(from, span)?),
            None => None,
        };
        let [Arg { kind: ArgKind::Positional(value) | ArgKind::Input { value: Some(value), .. }, .. }] = args.list[..]
        else {
            self.an.report(&names::ARGUMENT_COUNT, span, format!("{text} takes 1 argument"));
            return Some(broken(span));
        };
        let value = match from {
            Some(from) if from.is_text() => self.expr_of(value, from),
            Some(from) => self.expr_of(value, from),
            None => {
                let found = self.expr(value, Ty::Void);
                self.settle(found, Ty::Void)
            }
        };
        Some(self.conversion(value, to, shape.truncates, span))
    }

    fn conversion_type(&mut self, name: &str, span: Span) -> Option<Ty> {
        if let Some(elementary) = elementary_by_name(name) {
            return Some(Ty::Elem(elementary));
        }
        if let "STRING" | "WSTRING" = name {
            return Some(Ty::text(name == "WSTRING", super::types::DEFAULT_STRING_LENGTH));
        }
        let symbol = self.an.ast.names.lookup_folded(name)?;
        if !self.an.type_names.contains_key(&symbol) {
            return None;
        }
        let (ty, _) = self.an.named_type(symbol, span);
        self.an.types.elementary(ty).map(|_| ty)
    }

    fn conversion(&mut self, value: Expr, to: Ty, truncates: bool, span: Span) -> Expr {
        if value.ty == Ty::Error {
            return broken(span);
        }
        let value = match self.text_conversion(value, to, span) {
            Ok(found) => return self.retype(found, to),
            Err(value) => *value,
        };
        match (self.an.types.elementary(value.ty), self.an.types.elementary(to)) {
            (Some(base), Some(target)) => {
                let found = self.convert(Expr { ty: Ty::Elem(base), ..value }, target, truncates);
                let found = if base == target { self.itself(found, span) } else { Expr { span, ..found } };
                self.retype(found, to)
            }
            _ => {
                let message = format!("{} can not be converted", self.an.types.name(value.ty));
                self.an.report(&rules::MISMATCH, value.span, message);
                broken(span)
            }
        }
    }

    /// A value of the base type as one of the enumeration or subrange.
    fn retype(&mut self, value: Expr, to: Ty) -> Expr {
        if self.is_enum(to) {
            return Expr { ty: to, ..value };
        }
        self.coerce(value, to)
    }

    /// The constant of a case label or the like, as a number.
    pub(super) fn number(&self, ty: Ty, value: &Const) -> Option<i128> {
        match value {
            Const::Wide(value) => Some(*value),
            Const::Int(value) => Some(super::types::widen(self.an.types.elementary(ty)?, *value)),
            _ => None,
        }
    }
}

/// What SEL or MUX gives when all is known.
fn chosen(function: F, selector: &Expr, values: &[Expr]) -> Option<Const> {
    let ExprKind::Const(Const::Int(selector)) = &selector.kind else { return None };
    let at =
        if function == F::Mux { usize::try_from(*selector).unwrap_or(usize::MAX) } else { usize::from(*selector != 0) };
    let known: Option<Vec<&Const>> =
        values.iter().map(|value| if let ExprKind::Const(known) = &value.kind { Some(known) } else { None }).collect();
    let known = known?;
    known.get(at).or(known.last()).map(|known| (*known).clone())
}

/// An operation on strings, computed when all is known.
pub(super) fn text(op: TextOp, values: Vec<Expr>, ty: Ty, span: Span) -> Expr {
    match fold::text(op, &values, ty) {
        Some(known) => Expr { kind: ExprKind::Const(known), ty, span },
        None => Expr { kind: ExprKind::Text(op, values), ty, span },
    }
}
