//! Conversions of binary coded decimals (IEC 61131-3 table 22): `WORD_BCD_TO_UINT`, `BCD_TO_UINT`, `UINT_TO_BCD_WORD`, `TO_BCD_WORD`.

use khz_bytecode::container::ElementaryType as E;
use khz_machine::library::functions;

use super::enabled::Arguments;
use super::expr::{Checker, broken};
use super::tree::{BinOp, Expr, ExprKind, UnOp};
use super::types::{Const, Ty, elementary_by_name, is_bits, is_unsigned, limits, wrap};
use crate::diagnostics::{semantic as names, types as rules};
use crate::source::Span;
use crate::syntax::ast::{Arg, ArgKind};

/// The unsigned integer of a bit string's width.
fn number_of(bits: E) -> E {
    match bits.storage().bytes() {
        1 => E::Usint,
        2 => E::Uint,
        4 => E::Udint,
        _ => E::Ulint,
    }
}

impl<'a> Checker<'_, 'a> {
    /// `None`: the name is no such conversion.
    pub(super) fn bcd_call(&mut self, text: &str, args: &Arguments<'a>, span: Span) -> Option<Expr> {
        let shape = functions::bcd_conversion(text)?;
        let to = elementary_by_name(shape.to).filter(|to| fits(*to, shape.makes_digits))?;
        let from = match shape.from {
            Some(from) => Some(elementary_by_name(from).filter(|from| fits(*from, !shape.makes_digits))?),
            None => None,
        };
        let [Arg { kind: ArgKind::Positional(value) | ArgKind::Input { value: Some(value), .. }, .. }] = args.list[..]
        else {
            self.an.report(&names::ARGUMENT_COUNT, span, format!("{text} takes 1 argument"));
            return Some(broken(span));
        };
        // An overloaded one of a literal takes the widest type, so that no digit is lost.
        let usual = if shape.makes_digits { E::Ulint } else { E::Lword };
        let found = match from {
            Some(from) => self.expr_of(value, Ty::Elem(from)),
            None => {
                let found = self.expr(value, Ty::Void);
                self.settle(found, Ty::Elem(usual))
            }
        };
        if found.ty == Ty::Error {
            return Some(broken(span));
        }
        let elementary = self.an.types.elementary(found.ty).filter(|ty| fits(*ty, !shape.makes_digits));
        let Some(from) = elementary.filter(|_| !self.is_enum(found.ty)) else {
            let wanted =
                if shape.makes_digits { "an unsigned integer" } else { "digits in a BYTE, WORD, DWORD or LWORD" };
            let message = format!("{text} takes {wanted}, not {}", self.an.types.name(found.ty));
            self.an.report(&rules::ARGUMENT, found.span, message);
            return Some(broken(span));
        };
        let found = if shape.makes_digits {
            self.number_to_digits(found, from, to)
        } else {
            self.digits_to_number(found, from, to)
        };
        Some(Expr { span, ..found })
    }

    fn digits_to_number(&mut self, digits: Expr, from: E, to: E) -> Expr {
        let span = digits.span;
        let number = self.unary_op(UnOp::FromBcd, digits, span);
        self.convert(Expr { ty: Ty::Elem(number_of(from)), ..number }, to, false)
    }

    fn number_to_digits(&mut self, number: Expr, from: E, to: E) -> Expr {
        let span = number.span;
        let number = Expr { ty: Ty::Elem(from), ..number };
        let room = 10i128.pow(to.storage().bytes() * 2);
        let most = limits(from).map_or(0, |(_, most)| most);
        let number = if most < room {
            number
        } else {
            let room = Expr { kind: ExprKind::Const(Const::Int(wrap(from, room))), ty: Ty::Elem(from), span };
            self.binary_op(BinOp::Mod, number, room, span, Ty::Void)
        };
        let number = self.convert(number, number_of(to), false);
        let digits = self.unary_op(UnOp::ToBcd, number, span);
        Expr { ty: Ty::Elem(to), ..digits }
    }
}

/// Whether a type can hold the digits, or the number.
fn fits(ty: E, digits: bool) -> bool {
    if digits { is_bits(ty) } else { is_unsigned(ty) }
}
