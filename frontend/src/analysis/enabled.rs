//! EN and ENO of standard functions (IEC 61131-3 table 18), and their typed names (table 21).

use khz_bytecode::container::ElementaryType as E;
use khz_machine::library::functions::{self, FunctionRow, StandardFunction as F, TypeClass};

use super::expr::{Checker, broken};
use super::tree::{Enabled, Expr, ExprKind};
use super::types::{
    DEFAULT_STRING_LENGTH, Ty, elementary_by_name, is_bits, is_character, is_duration, is_integer, is_real,
};
use crate::source::Span;
use crate::syntax::ast::{self, Arg, ArgKind};

/// The arguments of a standard function, those of EN and ENO apart.
pub(super) struct Arguments<'a> {
    pub(super) list: Vec<&'a Arg>,
    en: Option<&'a ast::Expr>,
    eno: Option<&'a ast::Expr>,
}

/// Whether a class has a type as a member of its own, so that there is a typed name for it.
pub(super) fn has_member(class: TypeClass, ty: E) -> bool {
    let number = is_integer(ty) || is_real(ty);
    match class {
        TypeClass::AnyElementary => true,
        TypeClass::AnyMagnitude => number || is_duration(ty) || is_bits(ty),
        TypeClass::AnyNum => number || is_bits(ty),
        TypeClass::AnyReal | TypeClass::Float => is_real(ty),
        TypeClass::Part | TypeClass::FinePart => is_integer(ty),
        TypeClass::Of(own) => own == ty,
        TypeClass::AnyInt | TypeClass::Count | TypeClass::Shiftable => is_integer(ty) || is_bits(ty),
        TypeClass::AnyBit => ty == E::Bool || is_bits(ty) || is_integer(ty),
        TypeClass::BitString => is_bits(ty),
        TypeClass::Bytes => !is_real(ty) && !is_character(ty),
        TypeClass::Bool => ty == E::Bool,
        TypeClass::AnyString | TypeClass::AnyChars | TypeClass::Array => false,
    }
}

/// Whether a parameter takes strings.
fn takes_text(class: TypeClass) -> bool {
    matches!(class, TypeClass::AnyElementary | TypeClass::AnyString | TypeClass::AnyChars)
}

impl<'a> Checker<'_, 'a> {
    /// Takes EN and ENO out of the arguments of a standard function.
    pub(super) fn without_enable(&self, args: &'a [Arg]) -> Arguments<'a> {
        let mut found = Arguments { list: Vec::with_capacity(args.len()), en: None, eno: None };
        for arg in args {
            match &arg.kind {
                ArgKind::Input { name, value: Some(value) }
                    if self.an.text(name.symbol) == "EN" && found.en.is_none() =>
                {
                    found.en = Some(value);
                }
                ArgKind::Output { name, negated: false, target: Some(target) }
                    if self.an.text(name.symbol) == "ENO" && found.eno.is_none() =>
                {
                    found.eno = Some(target);
                }
                _ => found.list.push(arg),
            }
        }
        found
    }

    /// The value of a standard function under its EN.
    pub(super) fn enable(&mut self, value: Expr, args: &Arguments<'a>, want: Ty, span: Span) -> Expr {
        if args.en.is_none() && args.eno.is_none() {
            return value;
        }
        let en = args.en.map(|en| self.condition(en));
        let eno = args.eno.map(|eno| self.eno(eno));
        let value = self.settle(value, want);
        let sound = value.ty != Ty::Error && en.as_ref().is_none_or(|en| en.ty != Ty::Error);
        match eno {
            Some(None) => broken(span),
            _ if !sound => broken(span),
            eno => {
                let ty = value.ty;
                let kind = ExprKind::Enabled(Box::new(Enabled { en, eno: eno.flatten(), value }));
                Expr { kind, ty, span }
            }
        }
    }

    /// The row and type of `ADD_INT`. `None`: the name is no such one.
    pub(super) fn typed_function(&self, text: &str) -> Option<(&'static FunctionRow, Ty)> {
        let (row, name) = functions::typed(text)?;
        let class = row.parameters.iter().map(|parameter| parameter.class);
        if let "STRING" | "WSTRING" = name {
            let mut class = class;
            let ty = Ty::text(name == "WSTRING", DEFAULT_STRING_LENGTH);
            return class.any(takes_text).then_some((row, ty));
        }
        let ty = elementary_by_name(name)?;
        let generic = class.filter(|class| class.is_generic()).collect::<Vec<_>>();
        // EXPT says the type of its base.
        generic.first().is_some_and(|class| has_member(*class, ty)).then_some((row, Ty::Elem(ty)))
    }

    /// An argument of a typed function: of its type and no other.
    pub(super) fn typed_argument(&mut self, row: &FunctionRow, at: usize, found: Expr, typed: Option<Ty>) -> Expr {
        let class = |at: usize| row.parameters.get(at.min(row.parameters.len() - 1)).map(|parameter| parameter.class);
        let first = row.parameters.iter().map(|parameter| parameter.class).find(|class| class.is_generic());
        match typed {
            // MUL_TIME and DIV_TIME take a number there (table 35).
            Some(Ty::Elem(ty)) if is_duration(ty) && at > 0 && matches!(row.function, F::Mul | F::Div) => found,
            Some(ty @ Ty::Elem(_)) if class(at) == first => self.coerce(found, ty),
            Some(ty) if ty.is_text() && class(at).is_some_and(takes_text) => self.coerce(found, ty),
            _ => found,
        }
    }
}
