//! Initial values.

use std::rc::Rc;

use super::expr::Checker;
use super::tree::PouId;
use super::types::{Const, FieldDef, Ty, TyKind, Value};
use super::{Analyzer, ConstKey};
use crate::diagnostics::{semantic as rules, types as type_rules};
use crate::source::Span;
use crate::syntax::ast::{ArgKind, Expr, ExprKind, Ident, Init, InitElement, InitField, InitKind};
use crate::syntax::symbol::Symbol;

/// Most runs that one array's initial value may have after repetition is taken out.
const MAX_RUNS: usize = 1 << 20;

impl<'a> Analyzer<'a> {
    /// The value of an initialiser for a variable of type `ty`.
    pub(super) fn check_init(&mut self, init: &'a Init, ty: Ty, scope: Option<PouId>) -> Value {
        if ty == Ty::Error {
            return Value::Zero;
        }
        let kind = self.types.kind(ty).cloned();
        match (&init.kind, kind) {
            (InitKind::Array(elements), Some(TyKind::Array { element, dims })) => {
                let total = dims.iter().map(|(low, high)| i64::from(*high) - i64::from(*low) + 1).product::<i64>();
                let mut runs = Vec::new();
                let mut count = 0u64;
                self.array_elements(elements, element, scope, &mut runs, &mut count);
                let total = u64::try_from(total).unwrap_or(0);
                if count > total {
                    let message = format!("{count} values for an array of {total} elements");
                    self.report(&type_rules::INITIALISER, init.span, message);
                    return Value::Zero;
                }
                if count < total {
                    let rest = u32::try_from(total - count).unwrap_or(u32::MAX);
                    runs.push((rest, self.types.default(element)));
                }
                Value::Array(runs.into())
            }
            (InitKind::Struct(values), Some(TyKind::Struct { fields })) => {
                self.record_init(values, &fields, None, scope)
            }
            (InitKind::Struct(values), Some(TyKind::Block { fields, pou })) => {
                self.record_init(values, &fields, Some(pou), scope)
            }
            (InitKind::Struct(values), Some(TyKind::Union { fields })) => {
                self.union_init(values, &fields, ty, init.span, scope)
            }
            (
                InitKind::Expr(expr),
                Some(TyKind::Array { .. } | TyKind::Struct { .. } | TyKind::Union { .. } | TyKind::Block { .. }),
            ) => self.whole_value(expr, ty, scope),
            (InitKind::Expr(expr), _) => {
                let found = Checker::declarations(self, scope).constant(expr, ty);
                found.map_or(Value::Zero, |(_, value)| Value::Scalar(value))
            }
            (InitKind::Array(_) | InitKind::Struct(_), _) => {
                let message = format!("this is no initial value for {}", self.types.name(ty));
                self.report(&type_rules::INITIALISER, init.span, message);
                Value::Zero
            }
        }
    }

    /// A CONSTANT array or structure as the initial value of another.
    fn whole_value(&mut self, expr: &'a Expr, ty: Ty, scope: Option<PouId>) -> Value {
        if let ExprKind::Name(name) = &expr.kind {
            let found = match self.constant_of(ConstKey::Named(scope, name.symbol), expr.span) {
                None if scope.is_some() => self.constant_of(ConstKey::Named(None, name.symbol), expr.span),
                found => found,
            };
            match found {
                Some((found, value)) if found == ty || found == Ty::Error => return value,
                _ => {}
            }
        }
        let message = format!("this is no initial value for {}", self.types.name(ty));
        self.report(&type_rules::INITIALISER, expr.span, message);
        Value::Zero
    }

    fn array_elements(
        &mut self,
        elements: &'a [InitElement],
        element: Ty,
        scope: Option<PouId>,
        runs: &mut Vec<(u32, Value)>,
        count: &mut u64,
    ) {
        for entry in elements {
            let repeat = match &entry.repeat {
                None => 1,
                Some(repeat) => self.const_integer(repeat, scope).unwrap_or(1),
            };
            let Ok(repeat) = u32::try_from(repeat) else {
                self.report(&type_rules::INITIALISER, entry.span, format!("{repeat} is no number of repetitions"));
                continue;
            };
            let mut part = Vec::new();
            let mut part_count = 0u64;
            if entry.values.is_empty() {
                part.push((1, self.types.default(element)));
                part_count = 1;
            }
            for value in &entry.values {
                self.array_element(value, element, scope, &mut part, &mut part_count);
            }
            let runs_after = part.len().saturating_mul(repeat as usize).saturating_add(runs.len());
            if let [(times, value)] = part.as_slice() {
                match times.checked_mul(repeat) {
                    Some(times) => runs.push((times, value.clone())),
                    None => self.report(&type_rules::INITIALISER, entry.span, "too many values"),
                }
            } else if runs_after > MAX_RUNS {
                self.report(&rules::LIMIT, entry.span, format!("an initial value of more than {MAX_RUNS} runs"));
            } else {
                for _ in 0..repeat {
                    runs.extend(part.iter().cloned());
                }
            }
            *count = count.saturating_add(part_count.saturating_mul(u64::from(repeat)));
        }
    }

    fn array_element(
        &mut self,
        value: &'a Init,
        element: Ty,
        scope: Option<PouId>,
        runs: &mut Vec<(u32, Value)>,
        count: &mut u64,
    ) {
        let composed = matches!(self.types.kind(element), Some(TyKind::Array { .. }));
        match &value.kind {
            // A row of an array of several dimensions.
            InitKind::Array(inner) if !composed => self.array_elements(inner, element, scope, runs, count),
            InitKind::Expr(expr) => {
                if let Some((repeat, inner)) = self.named_repetition(expr, scope) {
                    let found = Checker::declarations(self, scope).constant(inner, element);
                    runs.push((repeat, found.map_or(Value::Zero, |(_, value)| Value::Scalar(value))));
                    *count += u64::from(repeat);
                } else {
                    runs.push((1, self.check_init(value, element, scope)));
                    *count += 1;
                }
            }
            _ => {
                runs.push((1, self.check_init(value, element, scope)));
                *count += 1;
            }
        }
    }

    /// `N(0)` with a named constant: N times 0.
    fn named_repetition(&mut self, expr: &'a Expr, scope: Option<PouId>) -> Option<(u32, &'a Expr)> {
        let ExprKind::Call { callee, args } = &expr.kind else { return None };
        let ExprKind::Name(name) = &callee.kind else { return None };
        let [arg] = args.as_slice() else { return None };
        let ArgKind::Positional(inner) = &arg.kind else { return None };
        let mut keys = [scope, None].into_iter().map(|scope| ConstKey::Named(scope, name.symbol));
        let known = keys.any(|key| self.constants.contains_key(&key));
        if !known {
            return None;
        }
        let repeat = self.const_integer(callee, scope)?;
        u32::try_from(repeat).ok().map(|repeat| (repeat, inner))
    }

    fn record_init(
        &mut self,
        values: &'a [InitField],
        fields: &Rc<[FieldDef]>,
        block: Option<PouId>,
        scope: Option<PouId>,
    ) -> Value {
        let mut list: Vec<Option<Value>> = vec![None; fields.len()];
        for value in values {
            let Some(at) = self.initialised_field(fields, &value.name) else { continue };
            if let Some(pou) = block {
                self.check_init_access(pou, value.name.symbol, value.name.span);
            }
            let found = self.check_init(&value.value, fields[at].ty, scope);
            if list[at].replace(found).is_some() {
                let message = format!("`{}` has two values", self.spelling(&value.name));
                self.report(&rules::DUPLICATE_NAME, value.name.span, message);
            }
        }
        let list: Vec<(u32, Value)> = (0u32..)
            .zip(list)
            .zip(fields.iter())
            .map(|((at, value), field)| (at, value.unwrap_or_else(|| field.init.clone())))
            .filter(|(_, value)| !value.is_zero())
            .collect();
        Value::Record(list.into())
    }

    /// Position of the field that an initialiser names; reports when there is none.
    pub(super) fn initialised_field(&mut self, fields: &[FieldDef], name: &Ident) -> Option<usize> {
        let found = self.field_position(fields, name.symbol);
        if found.is_none() {
            let message = format!("there is no field `{}`", self.spelling(name));
            let known: Vec<Symbol> = fields.iter().map(|field| field.symbol).collect();
            self.report_unknown(&rules::UNKNOWN_MEMBER, name, message, known.into_iter());
        }
        found
    }

    fn check_init_access(&mut self, pou: PouId, symbol: Symbol, span: Span) {
        use super::tree::VarClass;
        let Some(info) = self.info(pou) else { return };
        let hidden = info
            .vars
            .iter()
            .any(|var| var.symbol == symbol && !matches!(var.class, VarClass::Input | VarClass::Output));
        if hidden && info.name.starts_with("__") {
            self.report(&rules::HIDDEN_MEMBER, span, "this variable is not for the outside");
        }
    }

    /// Position of a field.
    pub(super) fn field_position(&self, fields: &[FieldDef], symbol: Symbol) -> Option<usize> {
        fields.iter().position(|field| field.symbol == symbol)
    }
}

/// The bytes of a scalar constant in memory.
pub(crate) fn scalar_bytes(value: &Const, bytes: u32) -> Vec<u8> {
    let mut out = match value {
        Const::Int(value) => value.to_le_bytes().to_vec(),
        Const::F32(value) => value.to_le_bytes().to_vec(),
        Const::F64(value) => value.to_le_bytes().to_vec(),
        Const::Str(text) => text.to_vec(),
        Const::WStr(text) => text.iter().flat_map(|unit| unit.to_le_bytes()).collect(),
        Const::Wide(_) | Const::Lit(..) => Vec::new(),
    };
    out.resize(bytes as usize, 0);
    out
}
