//! VAR_CONFIG (IEC 61131-3 table 62): places and initial values for variables of single instances.
//!
//! A variable `AT %I*` is a variable of its program or function block like any other, because one body serves all instances. Before the
//! body of its program instance runs, it is copied from the place that VAR_CONFIG gives it, and where that is in %Q or %M it is
//! copied back afterwards: the process image is frozen while a program runs, so nobody can tell the difference, unless the same
//! program also names that very place by another way. Two entries at one place of %Q or %M are an error.

use khz_bytecode::value::BytePlace;

use super::Analyzer;
use super::config::Planned;
use super::expr::Checker;
use super::place::step;
use super::tree::{Expr, ExprKind, Located, Place, PouInfo, Root, Step, Stmt, StmtKind, VarClass, VarId, VarInfo};
use super::types::{BOOL, Const, DINT, FieldDef, Ty, TyKind, TypeTable, Value};
use crate::diagnostics::{Diagnostic, semantic as rules, types as type_rules};
use crate::source::Span;
use crate::syntax::ast::{self, Area, ConfigVar, Configuration, Ident, PouKind, VarDecl};
use crate::syntax::symbol::Symbol;

/// Most variables without a place that are reported.
const MAX_PLACELESS: usize = 10;

/// A variable of an instance: which resource of the configuration, which instance, where in it.
struct Target {
    resource: usize,
    instance: usize,
    place: Place,
    area: Option<BytePlace>,
    constant: bool,
}

/// A variable that got a place: resource, instance, the way to it as [`key`] spells it.
pub(super) type Placed = (usize, usize, String);

/// A part of a path behind its first name.
enum Part<'a> {
    Name(&'a Ident),
    Index(&'a [ast::Expr], Span),
}

impl<'a> Analyzer<'a> {
    /// The area of a declaration `AT %I*`, `AT %Q*` or `AT %M*`, where one may stand.
    pub(super) fn incomplete_address(
        &mut self,
        decl: &VarDecl,
        kind: PouKind,
        class: VarClass,
        ty: Ty,
    ) -> Option<BytePlace> {
        let address = decl.address.as_ref().filter(|address| address.is_incomplete())?;
        let here = class == VarClass::Local && kind != PouKind::Function;
        if !here || self.types.holds_block(ty) || matches!(self.types.kind(ty), Some(TyKind::Subrange { .. })) {
            return None; // `located` says why.
        }
        Some(place_of(address.area))
    }

    /// The entries of a configuration's VAR_CONFIG, and whether they leave a variable without its place.
    pub(super) fn config_entries(&mut self, found: &'a Configuration, planned: &mut [Planned]) {
        let mut seen: std::collections::BTreeMap<Placed, Span> = std::collections::BTreeMap::new();
        let mut placed: Vec<(usize, Located, u64, Span)> = Vec::new();
        for entry in &found.config_vars {
            let Some(target) = self.config_target(entry, found, planned) else { continue };
            let whole = (target.resource, target.instance, key(&target.place));
            if let Some(first) = seen.insert(whole, entry.path.span) {
                let message = "this variable has an entry already";
                self.push(Diagnostic::new(&rules::DUPLICATE_NAME, entry.path.span, message).label(first, "first here"));
                continue;
            }
            let (resource, bits) = (target.resource, self.bits(target.place.ty));
            if let Some(located) = self.configure_variable(entry, target, planned) {
                placed.push((resource, located, bits, entry.path.span));
            }
        }
        self.refuse_overlaps(placed);
        let known: Vec<Placed> = seen.into_keys().collect();
        self.refuse_placeless(planned, &known);
    }

    fn bits(&self, ty: Ty) -> u64 {
        if ty == BOOL { 1 } else { u64::from(self.types.extent(ty).0) * 8 }
    }

    fn wrong_entry(&mut self, span: Span, message: impl Into<String>) {
        self.report(&rules::CONFIG_VAR, span, message);
    }

    /// What the path of an entry means; reports when it means nothing.
    fn config_target(&mut self, entry: &'a ConfigVar, found: &Configuration, planned: &[Planned]) -> Option<Target> {
        let Some((first, mut parts)) = flatten(&entry.path) else {
            self.wrong_entry(entry.path.span, "a path is made of names, with indices in brackets");
            return None;
        };
        let names: Vec<Option<Symbol>> = found.resources.iter().map(|one| one.name.map(|name| name.symbol)).collect();
        let mut name = first;
        let mut resource = None;
        if let (Some(at), Some(Part::Name(next))) =
            (names.iter().position(|one| *one == Some(first.symbol)), parts.first())
        {
            (resource, name) = (Some(at), next);
            parts.remove(0);
        }
        let wanted = self.text(name.symbol);
        let mut matching = Vec::new();
        for (at, one) in planned.iter().enumerate().filter(|(at, _)| resource.is_none_or(|only| only == *at)) {
            let instances = one.plan.instances.iter().enumerate();
            let instances = instances.filter(|(_, instance)| instance.name.eq_ignore_ascii_case(wanted));
            matching.extend(instances.map(|(instance, _)| (at, instance)));
        }
        let (resource, instance) = match matching.as_slice() {
            [one] => *one,
            [] => {
                let message = format!("there is no program instance `{}` in this configuration", self.spelling(name));
                self.report(&rules::UNKNOWN_NAME, name.span, message);
                return None;
            }
            _ => {
                let message =
                    format!("several resources have a program instance `{}`; name the resource", self.spelling(name));
                self.wrong_entry(name.span, message);
                return None;
            }
        };
        let pou = planned.get(resource)?.plan.instances.get(instance)?.program;
        let info = self.info(pou)?;
        let (place, area, constant) = self.config_place(&info, &parts, entry.path.span)?;
        Some(Target { resource, instance, place, area, constant })
    }

    /// The way from a program to a variable in it.
    fn config_place(
        &mut self,
        info: &PouInfo,
        parts: &[Part<'a>],
        span: Span,
    ) -> Option<(Place, Option<BytePlace>, bool)> {
        let Some((Part::Name(name), rest)) = parts.split_first() else {
            self.wrong_entry(span, "the path ends at a program instance; a variable of it is wanted");
            return None;
        };
        let (id, var) = self.stored_variable(info, name)?;
        let mut place = Place { root: Root::Var(id), path: Vec::new(), ty: var.ty, span };
        let (mut area, mut constant) = (var.area, var.constant);
        for part in rest {
            let kind = self.types.kind(place.ty).cloned();
            (area, place) = match (part, kind, place.ty) {
                (Part::Index(indices, at), Some(TyKind::Array { element, dims }), Ty::User(owner)) => {
                    let indices = self.config_index(indices, &dims, *at)?;
                    (None, step(place, Step::Index(owner, indices.into()), element, span))
                }
                (Part::Name(name), Some(TyKind::Block { pou, fields }), Ty::User(owner)) => {
                    let inner = self.info(pou)?;
                    let var = self.stored_variable(&inner, name)?.1.clone();
                    constant |= var.constant;
                    let field = var.field?;
                    (var.area, step(place, Step::Field(owner, field), fields.get(field as usize)?.ty, span))
                }
                (Part::Name(name), Some(TyKind::Struct { fields } | TyKind::Union { fields }), Ty::User(owner)) => {
                    let at = self.initialised_field(&fields, name)?;
                    (None, step(place, Step::Field(owner, u32::try_from(at).ok()?), fields.get(at)?.ty, span))
                }
                (Part::Name(name), ..) => {
                    let message = format!("{} has no fields", self.types.name(place.ty));
                    self.report(&rules::UNKNOWN_MEMBER, name.span, message);
                    return None;
                }
                (Part::Index(_, at), ..) => {
                    let message = format!("{} is no array", self.types.name(place.ty));
                    self.report(&type_rules::NOT_AN_ARRAY, *at, message);
                    return None;
                }
            };
        }
        (place.ty != Ty::Error).then_some((place, area, constant))
    }

    fn stored_variable<'i>(&mut self, info: &'i PouInfo, name: &Ident) -> Option<(VarId, &'i VarInfo)> {
        let stored = |var: &VarInfo| matches!(var.class, VarClass::Input | VarClass::Output | VarClass::Local);
        let mut vars = (0u32..).map(VarId).zip(&info.vars);
        let found = vars.find(|(_, var)| var.symbol == name.symbol && stored(var) && var.located.is_none());
        if found.is_none() {
            let message =
                format!("{} has no stored variable `{}` that VAR_CONFIG could reach", info.name, self.spelling(name));
            let known: Vec<Symbol> = info.vars.iter().filter(|var| stored(var)).map(|var| var.symbol).collect();
            self.report_unknown(&rules::UNKNOWN_MEMBER, name, message, known.into_iter());
        }
        found
    }

    fn config_index(&mut self, indices: &'a [ast::Expr], dims: &[(i32, i32)], span: Span) -> Option<Vec<Expr>> {
        if indices.len() != dims.len() {
            let message = format!("the array has {} dimensions, here are {} indices", dims.len(), indices.len());
            self.report(&type_rules::INDEX, span, message);
            return None;
        }
        let mut list = Vec::with_capacity(dims.len());
        for (index, (low, high)) in indices.iter().zip(dims) {
            let value = self.const_integer(index, None)?;
            if value < i128::from(*low) || value > i128::from(*high) {
                let message = format!("index {value} is outside {low}..{high}");
                self.report(&type_rules::INDEX, index.span, message);
                return None;
            }
            list.push(constant_index(i64::try_from(value).unwrap_or(0), index.span));
        }
        Some(list)
    }

    /// Gives a variable its place and value. The place, for the search for overlaps.
    fn configure_variable(&mut self, entry: &'a ConfigVar, target: Target, planned: &mut [Planned]) -> Option<Located> {
        let ty = self.resolve_spec(&entry.ty, None).0;
        if ty != target.place.ty {
            if ty != Ty::Error {
                let (own, other) = (self.types.name(target.place.ty), self.types.name(ty));
                let message = format!("the variable is declared as {own}, here it is {other}");
                self.report(&type_rules::MISMATCH, entry.ty.span, message);
            }
            return None;
        }
        if target.constant {
            self.wrong_entry(entry.path.span, "the variable is CONSTANT");
            return None;
        }
        let located = match (&entry.address, target.area) {
            (Some(address), _) if address.is_incomplete() => {
                self.report(&rules::BAD_ADDRESS, address.span, "here the whole address is wanted");
                return None;
            }
            (Some(address), Some(area)) => {
                if place_of(address.area) != area {
                    self.wrong_entry(address.span, "the variable is declared in another area of the process image");
                    return None;
                }
                Some(self.located_at(address, ty)?)
            }
            (Some(address), None) => {
                self.wrong_entry(address.span, "the variable is not declared `AT %I*`, `AT %Q*` or `AT %M*`");
                return None;
            }
            (None, Some(_)) => {
                self.report(&rules::PLACELESS, entry.path.span, "the entry gives the variable no address");
                return None;
            }
            (None, None) if entry.init.is_none() => {
                self.wrong_entry(entry.path.span, "the entry gives neither an address nor an initial value");
                return None;
            }
            (None, None) => None,
        };
        let value = entry.init.as_ref().map(|init| self.check_init(init, ty, None));
        self.apply_entry(target, located, value, planned);
        located
    }

    fn apply_entry(&mut self, target: Target, located: Option<Located>, value: Option<Value>, planned: &mut [Planned]) {
        let Some(plan) = planned.get_mut(target.resource).map(|planned| &mut planned.plan) else { return };
        let Some(instance) = plan.instances.get_mut(target.instance) else { return };
        let Root::Var(root) = target.place.root else { return };
        let Some(declared) = self
            .info(instance.program)
            .and_then(|info| info.vars.get(root.0 as usize).map(|var| (var.ty, var.init.clone())))
        else {
            return;
        };
        let before = instance.values.iter().find(|(id, _)| *id == root).map_or(declared.1, |(_, value)| value.clone());
        let initial = value.clone().unwrap_or_else(|| value_at(&self.types, &before, &target.place.path));
        if let Some(value) = value {
            let made = with_value(&self.types, declared.0, &before, &target.place.path, value);
            instance.values.retain(|(id, _)| *id != root);
            instance.values.push((root, made));
        }
        let Some(located) = located else { return };
        let bytes = self.types.extent(target.place.ty).0;
        let image =
            Place { root: Root::Direct(located), path: Vec::new(), ty: target.place.ty, span: target.place.span };
        // What a task of its own runs is copied around that.
        let (copy_in, copy_out) = match instance.blocks.iter_mut().find(|block| block.var == root) {
            Some(block) => (&mut block.copy_in, &mut block.copy_out),
            None => (&mut instance.copy_in, &mut instance.copy_out),
        };
        if located.place != BytePlace::Input {
            instance.image_values.push((located, target.place.ty, initial));
            copy_out.push(assign(image.clone(), target.place.clone()));
        }
        copy_in.push(assign(target.place, image));
        let environment = super::expr::Environment::new();
        let mut checker = Checker::body(self, None, &environment);
        checker.note_image(located, bytes);
        let usage = std::mem::take(&mut checker.usage);
        plan.usage.merge(usage);
    }

    /// Two entries of one resource at one place of %Q or %M: one would overwrite the other.
    fn refuse_overlaps(&mut self, placed: Vec<(usize, Located, u64, Span)>) {
        let mut ranges: Vec<(usize, BytePlace, u64, u64, Span)> = placed
            .into_iter()
            .filter(|(_, located, ..)| located.place != BytePlace::Input)
            .map(|(resource, located, bits, span)| {
                let first = u64::from(located.offset) * 8 + u64::from(located.bit.unwrap_or(0));
                (resource, located.place, first, first + bits, span)
            })
            .collect();
        ranges.sort_by_key(|(resource, place, first, ..)| (*resource, *place, *first));
        let mut before: Option<(usize, BytePlace, u64, u64, Span)> = None;
        for range in ranges {
            let overlaps = before.filter(|before| (before.0, before.1) == (range.0, range.1) && before.3 > range.2);
            if let Some(first) = overlaps {
                let (first, second) =
                    if range.4.start < first.4.start { (range.4, first.4) } else { (first.4, range.4) };
                let found = Diagnostic::new(
                    &rules::BAD_ADDRESS,
                    second,
                    "two variables get the same place of the process image",
                );
                self.push(found.label(first, "the other one"));
            }
            if before.is_none_or(|before| (before.0, before.1) != (range.0, range.1) || before.3 < range.3) {
                before = Some(range);
            }
        }
    }

    /// Reports variables `AT %I*` that have no place: of program instances, and of globals, which never have one.
    pub(super) fn refuse_placeless(&mut self, planned: &[impl std::borrow::Borrow<Planned>], known: &[Placed]) {
        let mut missing: Vec<(Span, String)> = Vec::new();
        for (resource, planned) in planned.iter().enumerate() {
            for (at, instance) in planned.borrow().plan.instances.iter().enumerate() {
                let Some(info) = self.info(instance.program) else { continue };
                for (id, var) in (0u32..).map(VarId).zip(&info.vars) {
                    let place = Place { root: Root::Var(id), path: Vec::new(), ty: var.ty, span: instance.span };
                    let name = format!("{}.{}", instance.name, var.name);
                    let is_known = |key: String| known.binary_search(&(resource, at, key)).is_ok();
                    self.collect_placeless(&place, name, var.area.is_some(), &is_known, &mut missing);
                }
            }
        }
        for global in &self.globals {
            let place = Place { root: Root::Var(VarId(0)), path: Vec::new(), ty: global.ty, span: global.span };
            self.collect_placeless(&place, global.name.clone(), false, &|_| false, &mut missing);
        }
        for (span, name) in missing {
            let message = format!("`{name}` has no address: an entry of VAR_CONFIG for this instance gives it one");
            self.report(&rules::PLACELESS, span, message);
        }
    }

    fn collect_placeless(
        &self,
        place: &Place,
        name: String,
        waits: bool,
        is_known: &dyn Fn(String) -> bool,
        missing: &mut Vec<(Span, String)>,
    ) {
        if missing.len() >= MAX_PLACELESS {
            return;
        }
        if waits {
            if !is_known(key(place)) {
                missing.push((place.span, name));
            }
            return;
        }
        if !self.types.holds_block(place.ty) || !self.waits_for_place(place.ty) {
            return;
        }
        let (Ty::User(owner), span) = (place.ty, place.span) else { return };
        match self.types.kind(place.ty).cloned() {
            Some(TyKind::Array { element, dims }) => {
                let mut index: Vec<i32> = dims.iter().map(|(low, _)| *low).collect();
                while missing.len() < MAX_PLACELESS {
                    let list: Vec<Expr> = index.iter().map(|at| constant_index(i64::from(*at), span)).collect();
                    let spelling: Vec<String> = index.iter().map(ToString::to_string).collect();
                    let part = step(place.clone(), Step::Index(owner, list.into()), element, span);
                    self.collect_placeless(&part, format!("{name}[{}]", spelling.join(", ")), false, is_known, missing);
                    if !next_index(&mut index, &dims) {
                        return;
                    }
                }
            }
            Some(TyKind::Struct { fields }) => {
                self.fields_placeless(place, owner, &fields, &name, &|_| false, is_known, missing);
            }
            Some(TyKind::Block { pou, fields }) => {
                let info = self.info(pou);
                let waits = |at: u32| {
                    info.iter().flat_map(|info| &info.vars).any(|var| var.field == Some(at) && var.area.is_some())
                };
                self.fields_placeless(place, owner, &fields, &name, &waits, is_known, missing);
            }
            _ => {}
        }
    }

    #[expect(clippy::too_many_arguments, reason = "one step of a walk that carries all of it")]
    fn fields_placeless(
        &self,
        place: &Place,
        owner: super::types::TyId,
        fields: &[FieldDef],
        name: &str,
        waits: &dyn Fn(u32) -> bool,
        is_known: &dyn Fn(String) -> bool,
        missing: &mut Vec<(Span, String)>,
    ) {
        for (at, field) in (0u32..).zip(fields) {
            let part = step(place.clone(), Step::Field(owner, at), field.ty, place.span);
            self.collect_placeless(&part, format!("{name}.{}", field.name), waits(at), is_known, missing);
        }
    }

    /// Whether a variable `AT %I*` lies anywhere in it.
    fn waits_for_place(&self, ty: Ty) -> bool {
        match self.types.kind(ty) {
            Some(TyKind::Array { element, .. }) => self.waits_for_place(*element),
            Some(TyKind::Struct { fields }) => fields.iter().any(|field| self.waits_for_place(field.ty)),
            Some(TyKind::Block { pou, .. }) => self.info(*pou).is_some_and(|info| {
                info.vars.iter().any(|var| var.area.is_some() || (var.field.is_some() && self.waits_for_place(var.ty)))
            }),
            _ => false,
        }
    }
}

fn place_of(area: Area) -> BytePlace {
    match area {
        Area::Input => BytePlace::Input,
        Area::Output => BytePlace::Output,
        Area::Memory => BytePlace::Memory,
    }
}

fn constant_index(value: i64, span: Span) -> Expr {
    Expr { kind: ExprKind::Const(Const::Int(value)), ty: DINT, span }
}

/// The next index list, the last dimension fastest; FALSE behind the last one.
fn next_index(index: &mut [i32], dims: &[(i32, i32)]) -> bool {
    for (at, (low, high)) in index.iter_mut().zip(dims).rev() {
        if *at < *high {
            *at += 1;
            return true;
        }
        *at = *low;
    }
    false
}

/// Whether two ways are one: fields and indices as text.
fn key(place: &Place) -> String {
    let mut text = match place.root {
        Root::Var(id) => id.0.to_string(),
        _ => String::new(),
    };
    for step in &place.path {
        match step {
            Step::Field(_, at) => text.push_str(&format!(".{at}")),
            Step::Index(_, indices) => {
                for index in indices.iter() {
                    if let ExprKind::Const(Const::Int(value)) = index.kind {
                        text.push_str(&format!("[{value}]"));
                    }
                }
            }
            Step::Part(..) | Step::Character(..) => {}
        }
    }
    text
}

fn assign(target: Place, from: Place) -> Stmt {
    let (ty, span) = (from.ty, from.span);
    let value = Expr { kind: ExprKind::Load(Box::new(from)), ty, span };
    Stmt { kind: StmtKind::Assign { target, value }, span }
}

/// The names and indices of a path, outermost first.
fn flatten(path: &ast::Expr) -> Option<(&Ident, Vec<Part<'_>>)> {
    let mut parts = Vec::new();
    let mut at = path;
    loop {
        match &at.kind {
            ast::ExprKind::Name(name) => {
                parts.reverse();
                return Some((name, parts));
            }
            ast::ExprKind::Member { base, member } => {
                parts.push(Part::Name(member));
                at = base;
            }
            ast::ExprKind::Index { base, indices } => {
                parts.push(Part::Index(indices, at.span));
                at = base;
            }
            _ => return None,
        }
    }
}

/// The number of an element, the last dimension fastest, and of all elements.
fn element_number(dims: &[(i32, i32)], indices: &[Expr]) -> (u32, u32) {
    let (mut number, mut count) = (0i64, 1i64);
    for (index, (low, high)) in indices.iter().zip(dims) {
        let length = i64::from(*high) - i64::from(*low) + 1;
        let value = match index.kind {
            ExprKind::Const(Const::Int(value)) => value,
            _ => i64::from(*low),
        };
        number = number * length + (value - i64::from(*low));
        count *= length;
    }
    (u32::try_from(number).unwrap_or(0), u32::try_from(count).unwrap_or(0))
}

/// The part of an initial value that a way leads to.
fn value_at(types: &TypeTable, value: &Value, path: &[Step]) -> Value {
    let Some((first, rest)) = path.split_first() else { return value.clone() };
    let inner = match (first, value) {
        (Step::Field(_, at), Value::Record(fields)) => {
            fields.iter().find(|(field, _)| field == at).map(|(_, value)| value)
        }
        (Step::Index(owner, indices), Value::Array(runs)) => match types.kind(Ty::User(*owner)) {
            Some(TyKind::Array { dims, .. }) => {
                let mut left = element_number(dims, indices).0;
                runs.iter().find_map(|(count, value)| {
                    let here = left < *count;
                    left = left.saturating_sub(*count);
                    here.then_some(value)
                })
            }
            _ => None,
        },
        _ => None,
    };
    inner.map_or(Value::Zero, |inner| value_at(types, inner, rest))
}

/// An initial value with another one where a way leads.
fn with_value(types: &TypeTable, ty: Ty, value: &Value, path: &[Step], new: Value) -> Value {
    let Some((first, rest)) = path.split_first() else { return new };
    match (first, types.kind(ty)) {
        (Step::Field(_, at), Some(TyKind::Union { fields })) => {
            let Some(field) = fields.get(*at as usize) else { return value.clone() };
            let inner = value_at(types, value, std::slice::from_ref(first));
            Value::Record([(*at, with_value(types, field.ty, &inner, rest, new))].into())
        }
        (Step::Field(_, at), Some(TyKind::Struct { fields } | TyKind::Block { fields, .. })) => {
            let Some(field) = fields.get(*at as usize) else { return value.clone() };
            let inner = value_at(types, value, std::slice::from_ref(first));
            let mut list: Vec<(u32, Value)> = match value {
                Value::Record(list) => list.iter().filter(|(field, _)| field != at).cloned().collect(),
                _ => Vec::new(),
            };
            list.push((*at, with_value(types, field.ty, &inner, rest, new)));
            list.sort_by_key(|(field, _)| *field);
            Value::Record(list.into())
        }
        (Step::Index(_, indices), Some(TyKind::Array { element, dims })) => {
            let (number, count) = element_number(dims, indices);
            let inner = value_at(types, value, std::slice::from_ref(first));
            let made = with_value(types, *element, &inner, rest, new);
            let runs: Vec<(u32, Value)> = match value {
                Value::Array(runs) => runs.to_vec(),
                _ => vec![(count, Value::Zero)],
            };
            Value::Array(replace_run(runs, number, &made).into())
        }
        _ => value.clone(),
    }
}

/// Runs with another value for one element.
fn replace_run(runs: Vec<(u32, Value)>, number: u32, made: &Value) -> Vec<(u32, Value)> {
    let mut out = Vec::with_capacity(runs.len() + 2);
    let mut at = 0u32;
    for (count, value) in runs {
        let end = at.saturating_add(count);
        if number >= at && number < end {
            let parts = [(number - at, value.clone()), (1, made.clone()), (end - number - 1, value)];
            out.extend(parts.into_iter().filter(|(count, _)| *count > 0));
        } else {
            out.push((count, value));
        }
        at = end;
    }
    out
}
