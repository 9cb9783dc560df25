//! Characters and wide strings: CHAR and WCHAR beside STRING and WSTRING (IEC 61131-3 6.4.2, tables 22, 26 and 34).
//!
//! A literal of one character in single quotes is a CHAR where one is wanted, in double quotes a WCHAR. CHAR becomes STRING and WCHAR becomes
//! WSTRING by itself; between the widths nothing does. `s[i]` is a character of a string and a variable like an element of an array: positions
//! count from 1 to the capacity, whatever the current length is.

use std::rc::Rc;

use khz_bytecode::container::ElementaryType as E;
use khz_bytecode::limits::MAX_STRING_LENGTH;
use khz_machine::semantics::strings::NO_LATIN_1;

use super::expr::{Checker, broken};
use super::place::step;
use super::standard::text;
use super::tree::{Expr, ExprKind, Place, Step, TextOp};
use super::types::{Const, DEFAULT_STRING_LENGTH, Ty, is_bits, is_character, is_integer};
use crate::diagnostics::{Diagnostic, types as rules};
use crate::source::Span;
use crate::syntax::ast;

/// The type of a character that a literal of one character may be.
fn one_character(value: &Expr) -> Option<(E, i64)> {
    match &value.kind {
        ExprKind::Const(Const::Str(text)) if text.len() == 1 => Some((E::Char, i64::from(text[0]))),
        ExprKind::Const(Const::WStr(text)) if text.len() == 1 => Some((E::Wchar, i64::from(text[0]))),
        _ => None,
    }
}

impl<'a> Checker<'_, 'a> {
    /// Length of the type of a literal: at least 1. `None`: it is too long, which was reported.
    pub(super) fn text_length(&mut self, length: usize, span: Span) -> Option<u16> {
        let found = u16::try_from(length.max(1)).ok().filter(|length| u32::from(*length) <= MAX_STRING_LENGTH);
        if found.is_none() {
            self.an.report(&rules::STRING_LENGTH, span, "the text is longer than a STRING may be");
        }
        found
    }

    /// A literal of one character where a character is wanted.
    pub(super) fn as_character(&self, literal: Expr, want: Ty) -> Expr {
        match (want, one_character(&literal)) {
            (Ty::Elem(to), Some((found, code))) if to == found => {
                Expr { kind: ExprKind::Const(Const::Int(code)), ty: want, ..literal }
            }
            _ => literal,
        }
    }

    /// `s[i]`.
    pub(super) fn character(&mut self, base: Place, indices: &'a [ast::Expr], span: Span) -> Option<Place> {
        let (text, capacity) = (base.ty, base.ty.capacity()?);
        let [index] = indices else {
            let message =
                format!("a character of {} has one index, here are {}", self.an.types.name(text), indices.len());
            self.an.report(&rules::INDEX, span, message);
            return None;
        };
        let index = self.index(index, 1, i32::from(capacity))?;
        Some(step(base, Step::Character(text, Rc::new(index)), Ty::Elem(text.character()?), span))
    }

    /// What becomes a character or, of a character, a string by itself; others are given back.
    pub(super) fn coerce_character(&mut self, expr: Expr, to: Ty) -> Result<Expr, Box<Expr>> {
        let own = self.an.types.elementary(expr.ty);
        match (to, one_character(&expr)) {
            (Ty::Elem(to), Some((found, code))) if to == found => {
                Ok(Expr { kind: ExprKind::Const(Const::Int(code)), ty: Ty::Elem(to), ..expr })
            }
            (Ty::Elem(to), _) if is_character(to) && expr.ty.character() == Some(to) => {
                let message = format!("{} is one character, not {}", to.name(), self.an.types.name(expr.ty));
                let help = format!("pick one: `s[1]`, or convert the first: TO_{}(…)", to.name());
                self.an.push(Diagnostic::new(&rules::MISMATCH, expr.span, message).help(help));
                Ok(broken(expr.span))
            }
            (_, _) if to.is_text() && own.is_some() && own == to.character() => Ok(self.text_of_character(expr)),
            (_, _)
                if to.is_text() && expr.ty.is_text()
                    || matches!((to, own), (Ty::Elem(to), Some(own)) if to != own && is_character(to) && is_character(own)) =>
            {
                self.other_width(&expr, to);
                Ok(broken(expr.span))
            }
            _ => Err(Box::new(expr)),
        }
    }

    /// Reports a narrow text where a wide one is wanted, or the other way round.
    fn other_width(&mut self, expr: &Expr, to: Ty) {
        let generic = |ty: Ty, name: String| match ty {
            Ty::Str(_) => "STRING".to_owned(),
            Ty::WStr(_) => "WSTRING".to_owned(),
            _ => name,
        };
        let (from, wanted) = (self.an.types.name(expr.ty), self.an.types.name(to));
        let (a, b) = (generic(expr.ty, from.clone()), generic(to, wanted.clone()));
        let help = match (&expr.kind, b.starts_with('W')) {
            (ExprKind::Const(Const::Str(_)), true) => "write it in double quotes: \"…\"".to_owned(),
            (ExprKind::Const(Const::WStr(_)), false) => "write it in single quotes: '…'".to_owned(),
            _ => format!("convert it: {a}_TO_{b}(…)"),
        };
        let message = format!("{wanted} is wanted here, not {from}");
        self.an.push(Diagnostic::new(&rules::MISMATCH, expr.span, message).help(help));
    }

    /// A string of one character.
    pub(super) fn text_of_character(&mut self, value: Expr) -> Expr {
        let span = value.span;
        let wide = self.an.types.elementary(value.ty) == Some(E::Wchar);
        text(TextOp::FromCharacter, vec![value], Ty::text(wide, 1), span)
    }

    /// Brings a character and what stands beside it together: a literal becomes a character too, beside a string the character becomes one.
    pub(super) fn meet_characters(&mut self, a: Expr, b: Expr) -> (Expr, Expr) {
        let character = |this: &Self, value: &Expr| this.an.types.elementary(value.ty).filter(|ty| is_character(*ty));
        match (character(self, &a), character(self, &b)) {
            (Some(own), None) if b.ty.character() == Some(own) => match one_character(&b) {
                Some((_, code)) => {
                    let b = Expr { kind: ExprKind::Const(Const::Int(code)), ty: a.ty, span: b.span };
                    (a, b)
                }
                None => (self.text_of_character(a), b),
            },
            (None, Some(_)) => {
                let (b, a) = self.meet_characters(b, a);
                (a, b)
            }
            _ => (a, b),
        }
    }

    /// Brings the strings of a call to one width: characters become strings. `None`: they differ, which was reported.
    pub(super) fn texts_of_one_width(&mut self, values: Vec<Expr>) -> Option<Vec<Expr>> {
        let values: Vec<Expr> = values
            .into_iter()
            .map(|value| match self.an.types.elementary(value.ty) {
                Some(ty) if is_character(ty) => self.text_of_character(value),
                _ => value,
            })
            .collect();
        let wide = values.first().is_some_and(|first| first.ty.is_wide_text());
        for value in &values {
            if value.ty.is_text() && value.ty.is_wide_text() != wide {
                self.other_width(value, Ty::text(wide, DEFAULT_STRING_LENGTH));
                return None;
            }
        }
        Some(values)
    }

    /// A conversion from or to a string or character. The value given back when it is neither.
    pub(super) fn text_conversion(&mut self, value: Expr, to: Ty, span: Span) -> Result<Expr, Box<Expr>> {
        let own = self.an.types.elementary(value.ty);
        let target = self.an.types.elementary(to);
        let (from_text, from_character) = (value.ty.is_text(), own.is_some_and(is_character));
        let to_character = target.filter(|ty| is_character(*ty));
        if !(from_text || from_character || to.is_text() || to_character.is_some()) {
            return Err(Box::new(value));
        }
        Ok(match to_character {
            _ if from_text && to.is_text() => self.with_width(value, to.is_wide_text(), span),
            Some(to) if from_text => {
                let first = self.first_character(value, span);
                Expr { span, ..self.convert(first, to, false) }
            }
            None if from_text => {
                let narrow = self.with_width(value, false, span);
                let ty = target.map_or(to, Ty::Elem);
                Expr { kind: ExprKind::Text(TextOp::To, vec![narrow]), ty, span }
            }
            _ if to.is_text() && from_character => {
                let unit = to.character().unwrap_or(E::Char);
                let value = self.convert(value, unit, false);
                Expr { span, ..self.text_of_character(value) }
            }
            _ if to.is_text() && own.is_some() => {
                let ty = Ty::Str(DEFAULT_STRING_LENGTH);
                let narrow = Expr { kind: ExprKind::Text(TextOp::From, vec![value]), ty, span };
                self.with_width(narrow, to.is_wide_text(), span)
            }
            _ => {
                let pair = own.zip(target);
                let fits = |ty: E| is_character(ty) || is_bits(ty) || is_integer(ty);
                match pair.filter(|(from, to)| fits(*from) && fits(*to)) {
                    Some((from, to)) => {
                        let value = Expr { ty: Ty::Elem(from), ..value };
                        Expr { span, ..self.convert(value, to, false) }
                    }
                    None => {
                        let (from, to) = (self.an.types.name(value.ty), self.an.types.name(to));
                        let message = format!("{from} can not be converted to {to}");
                        self.an.report(&rules::MISMATCH, value.span, message);
                        broken(span)
                    }
                }
            }
        })
    }

    /// A string in the width that is wanted.
    fn with_width(&mut self, value: Expr, wide: bool, span: Span) -> Expr {
        if value.ty.is_wide_text() == wide {
            return value;
        }
        let ty = Ty::text(wide, value.ty.capacity().unwrap_or(DEFAULT_STRING_LENGTH));
        text(if wide { TextOp::Widen } else { TextOp::Narrow }, vec![value], ty, span)
    }

    fn first_character(&mut self, value: Expr, span: Span) -> Expr {
        let ty = value.ty.character().map_or(Ty::Error, Ty::Elem);
        let kind = match &value.kind {
            ExprKind::Const(Const::Str(text)) => ExprKind::Const(Const::Int(text.first().map_or(0, |b| i64::from(*b)))),
            ExprKind::Const(Const::WStr(text)) => {
                ExprKind::Const(Const::Int(text.first().map_or(0, |u| i64::from(*u))))
            }
            _ => ExprKind::Text(TextOp::First, vec![value]),
        };
        Expr { kind, ty, span }
    }
}

/// The CHAR of a WCHAR.
pub(super) fn narrow(unit: u16) -> u8 {
    u8::try_from(unit).unwrap_or(NO_LATIN_1)
}
