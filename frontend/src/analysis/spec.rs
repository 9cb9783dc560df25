//! Types as written to types as known.

use std::rc::Rc;

use khz_bytecode::container::ElementaryType;
use khz_bytecode::limits::{MAX_DIMENSIONS, MAX_IMAGE_BYTES, MAX_STRING_LENGTH, MAX_TYPE_DEPTH};

use super::expr::Checker;
use super::tree::PouId;
use super::types::{
    Const, DEFAULT_STRING_LENGTH, FieldDef, Ty, TyDef, TyId, TyKind, Value, elementary_by_name, is_integer, limits,
    widen, wrap,
};
use super::{Analyzer, State, TypeSource};
use crate::diagnostics::{Diagnostic, semantic as rules, types as type_rules};
use crate::source::Span;
use crate::syntax::ast::{ArrayDim, EnumValue, Expr, Ident, Range, TypeSpec, TypeSpecKind, VarDecl};
use crate::syntax::symbol::Symbol;

impl<'a> Analyzer<'a> {
    /// The type and initial value that a written type stands for. `scope` is the unit whose constants it may use.
    pub(super) fn resolve_spec(&mut self, spec: &'a TypeSpec, scope: Option<PouId>) -> (Ty, Value) {
        self.nested(spec.span, |this| this.resolve_spec_inner(spec, scope, None)).unwrap_or((Ty::Error, Value::Zero))
    }

    fn resolve_spec_inner(&mut self, spec: &'a TypeSpec, scope: Option<PouId>, name: Option<&Ident>) -> (Ty, Value) {
        let ty = match &spec.kind {
            TypeSpecKind::Named(ident) => return self.resolve_type_name(ident),
            TypeSpecKind::String { wide, length: None } => Ty::text(*wide, DEFAULT_STRING_LENGTH),
            TypeSpecKind::String { wide, length: Some(length) } => self.string_type(*wide, length, scope),
            TypeSpecKind::Subrange { base, range } => self.subrange_type(base, range, scope),
            TypeSpecKind::Enum { base, values } => self.enum_type(base.as_ref(), values, scope, name),
            TypeSpecKind::Array { dims, element } => self.array_type(dims, element, scope, spec.span),
            TypeSpecKind::Struct { union: true, fields } => self.union_type(fields, scope, name, spec.span),
            TypeSpecKind::Struct { union: false, fields } => self.struct_type(fields, scope, name, spec.span),
            TypeSpecKind::Reference { .. } => self.not_yet(spec.span, "a reference type"),
            TypeSpecKind::Error => Ty::Error,
        };
        let default = self.types.default(ty);
        (ty, default)
    }

    fn not_yet(&mut self, span: Span, what: &str) -> Ty {
        self.report(&rules::NOT_SUPPORTED, span, format!("{what} is not of the language yet"));
        Ty::Error
    }

    /// The type of a name.
    pub(super) fn resolve_type_name(&mut self, ident: &Ident) -> (Ty, Value) {
        if ident.is_missing() {
            return (Ty::Error, Value::Zero);
        }
        let text = self.text(ident.symbol);
        if let Some(elementary) = elementary_by_name(text) {
            return (Ty::Elem(elementary), Value::Zero);
        }
        if let "STRING" | "WSTRING" = text {
            return (Ty::text(text == "WSTRING", DEFAULT_STRING_LENGTH), Value::Zero);
        }
        if self.type_names.contains_key(&ident.symbol) {
            return self.named_type(ident.symbol, ident.span);
        }
        if self.pou_names.contains_key(&ident.symbol) {
            let message = format!("`{}` is a program or function, not a type of variables", self.spelling(ident));
            self.report(&rules::UNKNOWN_TYPE, ident.span, message);
        } else {
            let known: Vec<Symbol> = self.type_names.keys().copied().collect();
            let message = format!("there is no type `{}`", self.spelling(ident));
            match elementary_meant(self.text(ident.symbol)) {
                Some(meant) if !self.may_be_lost(ident.span) => {
                    let found = Diagnostic::new(&rules::UNKNOWN_TYPE, ident.span, message);
                    self.push(found.help(format!("did you mean `{meant}`?")));
                }
                _ => self.report_unknown(&rules::UNKNOWN_TYPE, ident, message, known.into_iter()),
            }
        }
        (Ty::Error, Value::Zero)
    }

    /// The type that a declared name stands for, resolving it when it is first asked for.
    pub(super) fn named_type(&mut self, symbol: Symbol, span: Span) -> (Ty, Value) {
        let Some(entry) = self.type_names.get_mut(&symbol) else { return (Ty::Error, Value::Zero) };
        let entry_span = entry.span;
        let source = match &entry.state {
            State::Done(done) => return done.clone(),
            State::Busy => {
                let message = format!("`{}` contains itself, so it would have no end", self.text(symbol));
                let declared = entry_span;
                let found = Diagnostic::new(&rules::RECURSIVE_TYPE, span, message).label(declared, "declared here");
                self.push(found.help("a part of a type is of another type"));
                return (Ty::Error, Value::Zero);
            }
            State::Waiting => {
                entry.state = State::Busy;
                entry.source
            }
        };
        let resolved = self.nested(span, |this| this.define_type(source)).unwrap_or((Ty::Error, Value::Zero));
        if let Some(entry) = self.type_names.get_mut(&symbol) {
            entry.state = State::Done(resolved.clone());
        }
        resolved
    }

    fn define_type(&mut self, source: TypeSource<'a>) -> (Ty, Value) {
        match source {
            TypeSource::Declared(decl) => {
                let (ty, default) = self.resolve_spec_inner(&decl.spec, None, Some(&decl.name));
                let Some(init) = &decl.init else { return (ty, default) };
                // The initial value may name the type's own values, so the type is known from here on.
                if let Some(entry) = self.type_names.get_mut(&decl.name.symbol) {
                    entry.state = State::Done((ty, default));
                }
                (ty, self.check_init(init, ty, None))
            }
            TypeSource::Block(pou) => {
                let info = self.resolve_pou(pou);
                let ty = info.and_then(|info| info.block).map_or(Ty::Error, Ty::User);
                (ty, self.types.default(ty))
            }
        }
    }

    fn string_type(&mut self, wide: bool, length: &'a Expr, scope: Option<PouId>) -> Ty {
        let Some(value) = self.const_integer(length, scope) else { return Ty::Error };
        match u16::try_from(value) {
            Ok(value) if value >= 1 && u32::from(value) <= MAX_STRING_LENGTH => Ty::text(wide, value),
            _ => {
                let message = format!("the length of a STRING is 1 to {MAX_STRING_LENGTH}, not {value}");
                self.report(&type_rules::STRING_LENGTH, length.span, message);
                Ty::Error
            }
        }
    }

    /// The value of an integer constant expression; reports and gives `None` when it is none.
    pub(super) fn const_integer(&mut self, expr: &'a Expr, scope: Option<PouId>) -> Option<i128> {
        let found = Checker::declarations(self, scope).constant(expr, Ty::Void)?;
        match (found.1, self.types.elementary(found.0)) {
            (Const::Wide(value), _) => Some(value),
            (Const::Int(value), Some(elementary)) if is_integer(elementary) => Some(widen(elementary, value)),
            _ => {
                if found.0 != Ty::Error {
                    let message = format!("an integer is wanted here, not {}", self.types.name(found.0));
                    self.report(&type_rules::MISMATCH, expr.span, message);
                }
                None
            }
        }
    }

    fn integer_base(&mut self, base: &Ident) -> Option<ElementaryType> {
        match self.resolve_type_name(base).0 {
            Ty::Elem(elementary) if is_integer(elementary) || super::types::is_bits(elementary) => Some(elementary),
            Ty::Error => None,
            other => {
                let message = format!("the base is an integer type, not {}", self.types.name(other));
                self.report(&type_rules::MISMATCH, base.span, message);
                None
            }
        }
    }

    fn subrange_type(&mut self, base: &Ident, range: &'a Range, scope: Option<PouId>) -> Ty {
        let base_type = self.integer_base(base);
        let bounds = self.range(range, scope);
        let (Some(base_type), Some((low, high))) = (base_type, bounds) else { return Ty::Error };
        let (least, most) = limits(base_type).unwrap_or((0, 0));
        if low < least || high > most {
            let message = format!("{low}..{high} is not inside {}, which holds {least}..{most}", base_type.name());
            self.report(&type_rules::LITERAL_RANGE, range.span, message);
            return Ty::Error;
        }
        Ty::User(self.types.subrange(base_type, wrap(base_type, low), wrap(base_type, high)))
    }

    fn range(&mut self, range: &'a Range, scope: Option<PouId>) -> Option<(i128, i128)> {
        let low = self.const_integer(&range.low, scope);
        let high = self.const_integer(&range.high, scope);
        let (low, high) = (low?, high?);
        if low > high {
            self.report(
                &type_rules::BOUNDS,
                range.span,
                format!("the lower bound {low} is above the upper bound {high}"),
            );
            return None;
        }
        Some((low, high))
    }

    fn enum_type(
        &mut self,
        base: Option<&Ident>,
        values: &'a [EnumValue],
        scope: Option<PouId>,
        name: Option<&Ident>,
    ) -> Ty {
        let elementary = match base {
            Some(base) => match self.integer_base(base) {
                Some(elementary) => elementary,
                None => return Ty::Error,
            },
            None => ElementaryType::Int,
        };
        let (least, most) = limits(elementary).unwrap_or((0, 0));
        let mut next: i128 = 0;
        let mut list: Vec<(Symbol, String, i64)> = Vec::with_capacity(values.len());
        let mut seen: std::collections::BTreeMap<Symbol, Span> = std::collections::BTreeMap::new();
        for value in values {
            if value.name.is_missing() {
                continue;
            }
            if let Some(written) = &value.value {
                next = self.const_integer(written, scope).unwrap_or(next);
            }
            if next < least || next > most {
                let message = format!("{next} does not fit {}", elementary.name());
                self.report(&type_rules::LITERAL_RANGE, value.name.span, message);
                next = 0;
            }
            if let Some(first) = seen.insert(value.name.symbol, value.name.span) {
                let message = format!("the value `{}` is there twice", self.spelling(&value.name));
                let found = Diagnostic::new(&rules::DUPLICATE_NAME, value.name.span, message);
                self.push(found.label(first, "first here").help("give one of them another name"));
                continue;
            }
            list.push((value.name.symbol, self.spelling(&value.name).to_owned(), wrap(elementary, next)));
            next += 1;
        }
        let first = list.first().map_or(0, |value| value.2);
        let symbols: Vec<Symbol> = list.iter().map(|value| value.0).collect();
        let bytes = elementary.storage().bytes();
        let id = self.types.add(TyDef {
            name: name.map_or_else(|| "an enumeration".to_owned(), |name| self.spelling(name).to_owned()),
            kind: TyKind::Enum { base: elementary, has_base: base.is_some(), values: list.into() },
            size: bytes,
            align: bytes,
            default: Value::Scalar(Const::Int(first)),
            depth: 1,
            alternatives: 1,
        });
        if name.is_none() {
            for symbol in symbols {
                self.nameless_enums.entry(symbol).or_default().push(id);
            }
        }
        Ty::User(id)
    }

    pub(super) fn array_type(
        &mut self,
        dims: &'a [ArrayDim],
        element: &'a TypeSpec,
        scope: Option<PouId>,
        span: Span,
    ) -> Ty {
        let (element_ty, element_default) = self.resolve_spec(element, scope);
        let mut bounds = Vec::with_capacity(dims.len());
        let mut sound = element_ty != Ty::Error;
        if dims.len() > MAX_DIMENSIONS {
            self.report(&type_rules::BOUNDS, span, format!("an array has at most {MAX_DIMENSIONS} dimensions"));
            sound = false;
        }
        for dim in dims {
            match dim {
                ArrayDim::Open(at) => {
                    self.open_array_not_here(*at);
                    sound = false;
                }
                ArrayDim::Range(range) => match self.range(range, scope) {
                    None => sound = false,
                    Some((low, high)) => match (i32::try_from(low), i32::try_from(high)) {
                        (Ok(low), Ok(high)) => bounds.push((low, high)),
                        _ => {
                            let message = format!("bounds {low}..{high} are outside DINT");
                            self.report(&type_rules::BOUNDS, range.span, message);
                            sound = false;
                        }
                    },
                },
            }
        }
        if !sound || self.too_deep(element_ty, span) {
            return Ty::Error;
        }
        let Some(id) = self.types.array(element_ty, &bounds, MAX_IMAGE_BYTES) else {
            let message = format!("the array is larger than a memory image may be ({MAX_IMAGE_BYTES} bytes)");
            self.report(&type_rules::BOUNDS, span, message);
            return Ty::Error;
        };
        // An alias as element may have an initial value of its own, which the interned type can not know.
        if element_default != self.types.default(element_ty) {
            let count = bounds.iter().map(|(low, high)| i64::from(*high) - i64::from(*low) + 1).product::<i64>();
            let mut def = self.types.def(id).clone();
            def.default = Value::Array(Rc::new([(u32::try_from(count).unwrap_or(u32::MAX), element_default)]));
            return Ty::User(self.types.add(def));
        }
        Ty::User(id)
    }

    pub(super) fn too_deep(&mut self, inner: Ty, span: Span) -> bool {
        let deep = self.types.depth(inner) as usize >= MAX_TYPE_DEPTH;
        if deep {
            self.report(&rules::TOO_DEEP, span, format!("types nest more than {MAX_TYPE_DEPTH} levels deep"));
        }
        deep
    }

    fn struct_type(&mut self, fields: &'a [VarDecl], scope: Option<PouId>, name: Option<&Ident>, span: Span) -> Ty {
        let Some(list) = self.field_list(fields, scope) else { return Ty::Error };
        let name = name.map_or("a structure", |name| self.spelling(name)).to_owned();
        self.record_type(name, list, None, span).map_or(Ty::Error, Ty::User)
    }

    /// The fields of a structure or union, all at offset 0. `None`: a type among them is wrong, which was reported.
    pub(super) fn field_list(&mut self, fields: &'a [VarDecl], scope: Option<PouId>) -> Option<Vec<FieldDef>> {
        let mut list: Vec<FieldDef> = Vec::new();
        let mut seen: std::collections::BTreeMap<Symbol, Span> = std::collections::BTreeMap::new();
        let mut sound = true;
        for field in fields {
            let (ty, default) = self.resolve_spec(&field.ty, scope);
            sound &= ty != Ty::Error;
            let init = match &field.init {
                Some(init) => self.check_init(init, ty, scope),
                None => default,
            };
            for ident in &field.names {
                if ident.is_missing() {
                    continue;
                }
                if let Some(first) = seen.insert(ident.symbol, ident.span) {
                    let message = format!("the field `{}` is there twice", self.spelling(ident));
                    let found = Diagnostic::new(&rules::DUPLICATE_NAME, ident.span, message);
                    self.push(found.label(first, "first here").help("give one of them another name"));
                    continue;
                }
                let (symbol, name) = (ident.symbol, self.spelling(ident).to_owned());
                list.push(FieldDef { symbol, name, ty, offset: 0, init: init.clone() });
            }
        }
        sound.then_some(list)
    }

    /// Defines a structure, or the type of a function block's instances.
    pub(super) fn record_type(
        &mut self,
        name: String,
        mut fields: Vec<FieldDef>,
        block: Option<PouId>,
        span: Span,
    ) -> Option<TyId> {
        let deepest = fields.iter().max_by_key(|field| self.types.depth(field.ty)).map_or(Ty::Error, |field| field.ty);
        if self.too_deep(deepest, span) {
            return None;
        }
        if fields.len() > usize::from(u16::MAX) {
            self.report(&rules::LIMIT, span, format!("`{name}` has {} fields; 65535 are possible", fields.len()));
            return None;
        }
        let Some((size, align)) = self.types.lay_out(&mut fields, block.is_some(), MAX_IMAGE_BYTES) else {
            let message = format!("`{name}` is larger than a memory image may be ({MAX_IMAGE_BYTES} bytes)");
            self.report(&type_rules::BOUNDS, span, message);
            return None;
        };
        let depth = self.types.depth(deepest) + 1;
        let alternatives = fields.iter().map(|field| self.types.alternatives(field.ty)).max().unwrap_or(1);
        let values: Vec<(u32, Value)> = (0u32..)
            .zip(&fields)
            .filter(|(_, field)| !field.init.is_zero())
            .map(|(at, field)| (at, field.init.clone()))
            .collect();
        let default = if values.is_empty() { Value::Zero } else { Value::Record(values.into()) };
        let fields: Rc<[FieldDef]> = fields.into();
        let kind = match block {
            Some(pou) => TyKind::Block { pou, fields },
            None => TyKind::Struct { fields },
        };
        Some(self.types.add(TyDef { name, kind, size, align, default, depth, alternatives }))
    }
}

/// The elementary type that is called so elsewhere, or that is spelt nearly so (in upper case).
fn elementary_meant(name: &str) -> Option<&'static str> {
    const ELSEWHERE: [(&str, &str); 19] = [
        ("BOOLEAN", "BOOL"),
        ("BIT", "BOOL"),
        ("FLOAT", "REAL"),
        ("FLOAT32", "REAL"),
        ("FLOAT64", "LREAL"),
        ("DOUBLE", "LREAL"),
        ("INTEGER", "INT"),
        ("SHORT", "INT"),
        ("LONG", "DINT"),
        ("UNSIGNED", "UDINT"),
        ("INT8", "SINT"),
        ("INT16", "INT"),
        ("INT32", "DINT"),
        ("INT64", "LINT"),
        ("UINT8", "USINT"),
        ("UINT16", "UINT"),
        ("UINT32", "UDINT"),
        ("UINT64", "ULINT"),
        ("STR", "STRING"),
    ];
    let known = ELSEWHERE.iter().find(|(other, _)| *other == name).map(|(_, own)| *own);
    let all = khz_bytecode::container::ElementaryType::ALL.iter().map(|ty| ty.name()).chain(["STRING"]);
    known.or_else(|| crate::diagnostics::similar::nearest(name, all.map(|own| (own, own))))
}
