//! UNION types: fields that share their bytes.
//!
//! Each field reads what another wrote, byte for byte: BOOL gives whether its byte is not 0, a foreign NaN becomes the one NaN, a string
//! ends at its first 0 or at its capacity, an enumeration may hold a number that none of its values has. A subrange would be a promise
//! that no check keeps, and a function block instance must be found by its address alone, so neither stands in a union.

use std::rc::Rc;

use khz_bytecode::limits::{MAX_IMAGE_BYTES, MAX_UNION_ALTERNATIVES};

use super::Analyzer;
use super::tree::PouId;
use super::types::{FieldDef, Ty, TyDef, TyKind, TypeTable, Value};
use crate::diagnostics::{semantic as rules, types as type_rules};
use crate::source::Span;
use crate::syntax::ast::{Ident, InitField, VarDecl};

impl<'a> Analyzer<'a> {
    /// The type of `UNION … END_UNION`.
    pub(super) fn union_type(
        &mut self,
        decls: &'a [VarDecl],
        scope: Option<PouId>,
        name: Option<&Ident>,
        span: Span,
    ) -> Ty {
        let Some(list) = self.field_list(decls, scope) else { return Ty::Error };
        for decl in decls {
            let symbol = decl.names.first().map(|name| name.symbol);
            let Some(ty) = list.iter().find(|field| Some(field.symbol) == symbol).map(|field| field.ty) else {
                continue;
            };
            if let Some(reason) = self.not_in_union(ty) {
                let message = format!("{} can not stand in a union: {reason}", self.types.name(ty));
                self.report(&type_rules::UNION, decl.ty.span, message);
                return Ty::Error;
            }
        }
        let mut initialised = decls.iter().filter(|decl| decl.init.is_some());
        if let (Some(_), Some(second)) = (initialised.next(), initialised.next()) {
            self.two_values(second.span);
        }
        let name = name.map_or("a union", |name| self.spelling(name)).to_owned();
        let written = list.iter().position(|field| {
            decls.iter().any(|decl| decl.init.is_some() && decl.names.iter().any(|name| name.symbol == field.symbol))
        });
        self.define_union(name, list, written.unwrap_or(0), span)
    }

    fn not_in_union(&self, ty: Ty) -> Option<&'static str> {
        if self.types.holds_block(ty) {
            return Some("a function block instance has bytes of its own");
        }
        holds_subrange(&self.types, ty).then_some("the other fields may hold any value, also one outside of its range")
    }

    fn two_values(&mut self, span: Span) {
        let message = "the fields of a union share their bytes, so only one of them has an initial value";
        self.report(&type_rules::INITIALISER, span, message);
    }

    /// Adds the type; `valued` is the field whose initial value a variable begins with.
    fn define_union(&mut self, name: String, fields: Vec<FieldDef>, valued: usize, span: Span) -> Ty {
        let deepest = fields.iter().max_by_key(|field| self.types.depth(field.ty)).map_or(Ty::Error, |field| field.ty);
        if self.too_deep(deepest, span) {
            return Ty::Error;
        }
        let alternatives = fields.iter().map(|field| self.types.alternatives(field.ty)).fold(0, u32::saturating_add);
        if alternatives > MAX_UNION_ALTERNATIVES || fields.len() > usize::from(u16::MAX) {
            let message = format!(
                "`{name}` and the unions in it have {alternatives} fields; {MAX_UNION_ALTERNATIVES} are possible"
            );
            self.report(&rules::LIMIT, span, message);
            return Ty::Error;
        }
        let extents = fields.iter().map(|field| self.types.extent(field.ty));
        let (size, align) = extents.fold((1, 1), |(size, align), (bytes, own)| (size.max(bytes), align.max(own)));
        let size = u64::from(size).next_multiple_of(u64::from(align));
        let Some(size) = u32::try_from(size).ok().filter(|size| u64::from(*size) <= MAX_IMAGE_BYTES) else {
            let message = format!("`{name}` is larger than a memory image may be ({MAX_IMAGE_BYTES} bytes)");
            self.report(&type_rules::BOUNDS, span, message);
            return Ty::Error;
        };
        let depth = self.types.depth(deepest) + 1;
        let default = fields.get(valued).map_or(Value::Zero, |field| only(valued, field.init.clone()));
        let kind = TyKind::Union { fields: fields.into() };
        Ty::User(self.types.add(TyDef { name, kind, size, align, default, depth, alternatives: alternatives.max(1) }))
    }

    /// `(field := value)`: at most one field.
    pub(super) fn union_init(
        &mut self,
        values: &'a [InitField],
        fields: &Rc<[FieldDef]>,
        ty: Ty,
        span: Span,
        scope: Option<PouId>,
    ) -> Value {
        let mut found = None;
        for value in values {
            let Some(at) = self.initialised_field(fields, &value.name) else { continue };
            let value = self.check_init(&value.value, fields[at].ty, scope);
            if found.replace((at, value)).is_some() {
                self.two_values(span);
            }
        }
        found.map_or_else(|| self.types.default(ty), |(at, value)| only(at, value))
    }
}

/// The value of a union whose field at a position has a value.
fn only(at: usize, value: Value) -> Value {
    match u32::try_from(at) {
        Ok(at) if !value.is_zero() => Value::Record(Rc::new([(at, value)])),
        _ => Value::Zero,
    }
}

fn holds_subrange(types: &TypeTable, ty: Ty) -> bool {
    match types.kind(ty) {
        Some(TyKind::Subrange { .. }) => true,
        Some(TyKind::Array { element, .. }) => holds_subrange(types, *element),
        Some(TyKind::Struct { fields }) => fields.iter().any(|field| holds_subrange(types, field.ty)),
        // A union that is a field was checked itself.
        _ => false,
    }
}
