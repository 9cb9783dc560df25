//! Places: variables, fields, elements, bits, direct addresses.

use std::collections::BTreeMap;

use khz_bytecode::container::ElementaryType as E;
use khz_bytecode::value::BytePlace;

use super::expr::{Checker, broken};
use super::tree::{Expr, ExprKind, GlobalId, Located, Place, PouId, Root, Step, VarClass, VarId};
use super::types::{BOOL, Const, DINT, Ty, TyId, TyKind, is_bits, is_integer, widen};
use crate::diagnostics::{Diagnostic, semantic as names, types as rules};
use crate::source::Span;
use crate::syntax::ast::{self, AccessSize, Ident};
use crate::syntax::symbol::Symbol;

/// Names of the system variables, which are visible everywhere.
const SYSTEM: [(&str, bool); 2] = [("__SYSTEM_UP_TIME", false), ("__SYSTEM_UP_LTIME", true)];

impl<'a> Checker<'_, 'a> {
    /// The variable of a name: of the unit, else global, else of the system.
    pub(super) fn find_variable(&self, symbol: Symbol) -> Option<Root> {
        if let Some(pou) = self.pou
            && let Some(&var) = self.an.scopes.get(pou.0 as usize).and_then(|scope| scope.get(&symbol))
        {
            let info = self.info.as_ref()?.vars.get(var.0 as usize)?;
            if info.class != VarClass::External {
                return Some(Root::Var(info.edge.map_or(var, |edge| edge.seen)));
            }
        }
        if let Some(&global) = self.environment.and_then(|environment| environment.get(&symbol)) {
            return Some(Root::Global(global));
        }
        let text = self.an.text(symbol);
        SYSTEM.iter().find(|(name, _)| *name == text).map(|(_, long)| Root::System(*long))
    }

    pub(super) fn unknown_name(&mut self, name: &Ident) {
        let mut known: Vec<Symbol> = Vec::new();
        if let Some(scope) = self.pou.and_then(|pou| self.an.scopes.get(pou.0 as usize)) {
            known.extend(scope.keys());
        }
        known.extend(self.an.global_names.keys());
        known.extend(self.an.enum_owners.keys());
        let message = format!("`{}` is not declared", self.an.spelling(name));
        let list = self.an.lists.iter().find(|(_, members)| members.contains_key(&name.symbol));
        if let Some((list, _)) = list {
            let list = self.an.ast.names.text_as_written(*list);
            let help = format!("the global variable list {list} has it: `{list}.{}`", self.an.spelling(name));
            self.an.push(Diagnostic::new(&names::UNKNOWN_NAME, name.span, message).help(help));
            return;
        }
        self.an.report_unknown(&names::UNKNOWN_NAME, name, message, known.into_iter());
    }

    /// Notes that a variable is used: for the image of each resource and for the choice of slots.
    pub(super) fn note_use(&mut self, root: Root, span: Span) {
        let weight = 10u64.pow(self.loop_depth.min(6));
        match root {
            Root::Global(global) => {
                self.usage.used_globals.entry(global).or_insert(span);
                *self.usage.heat.entry((None, global.0)).or_default() += weight;
            }
            Root::Var(var) => *self.usage.heat.entry((self.pou, var.0)).or_default() += weight,
            Root::System(long) => {
                let user = Some(span.file) != self.an.standard;
                let slot = if long { &mut self.usage.up_ltime } else { &mut self.usage.up_time };
                *slot = Some(user || slot.unwrap_or(false));
            }
            Root::Direct(_) | Root::CallInstance | Root::CallOutput(_) => {}
        }
    }

    /// The value of a place.
    pub(super) fn load(&mut self, expr: &'a ast::Expr) -> Expr {
        let Some(place) = self.place(expr) else { return broken(expr.span) };
        let ty = place.ty;
        Expr { kind: ExprKind::Load(Box::new(place)), ty, span: expr.span }
    }

    /// A place that is read. `None`: it was reported.
    pub(super) fn place(&mut self, expr: &'a ast::Expr) -> Option<Place> {
        let span = expr.span;
        match &expr.kind {
            ast::ExprKind::Name(name) => self.named_place(name, span),
            ast::ExprKind::Direct(address) => {
                if self.is_constant_context() {
                    self.an.report(&names::NOT_CONSTANT, span, "an address has no value when the program is compiled");
                    return None;
                }
                let located = self.an.address(address)?;
                let ty = match address.size.unwrap_or(AccessSize::Bit) {
                    AccessSize::Bit => BOOL,
                    AccessSize::Byte => Ty::Elem(E::Byte),
                    AccessSize::Word => Ty::Elem(E::Word),
                    AccessSize::Double => Ty::Elem(E::Dword),
                    AccessSize::Long => Ty::Elem(E::Lword),
                };
                self.note_image(located, self.an.types.extent(ty).0);
                Some(Place { root: Root::Direct(located), path: Vec::new(), ty, span })
            }
            ast::ExprKind::Member { base, member } if self.list_of(base).is_some() => {
                self.listed_place(base, member, span)
            }
            ast::ExprKind::Member { base, member } => {
                let base = self.place_of_part(base)?;
                self.member(base, member, span)
            }
            ast::ExprKind::Index { base, indices } => {
                let base = self.place_of_part(base)?;
                self.element(base, indices, span)
            }
            ast::ExprKind::Part { base, size, index, part_span } => {
                let base = self.place_of_part(base)?;
                self.part(base, *size, *index, *part_span, span)
            }
            ast::ExprKind::Deref { .. } => {
                self.an.report(&names::NOT_SUPPORTED, span, "references are not of the language yet");
                None
            }
            ast::ExprKind::Error => None,
            _ => {
                let found = Diagnostic::new(&names::NOT_A_VARIABLE, span, "a variable is wanted here");
                let help = match &expr.kind {
                    ast::ExprKind::Call { .. } => {
                        "elements of arrays are written `a[1]`; the result of a call is no variable"
                    }
                    _ => "name a variable, an element or a field",
                };
                self.an.push(found.help(help));
                None
            }
        }
    }

    fn place_of_part(&mut self, base: &'a ast::Expr) -> Option<Place> {
        self.place(base)
    }

    fn named_place(&mut self, name: &Ident, span: Span) -> Option<Place> {
        if name.is_missing() {
            return None;
        }
        if self.is_constant_context() {
            let message = format!("`{}` has no value when the program is compiled", self.an.spelling(name));
            self.an.report(&names::NOT_CONSTANT, span, message);
            return None;
        }
        let Some(root) = self.find_variable(name.symbol) else {
            // A VAR_EXTERNAL without its global was reported where it is declared.
            let external = self.pou.and_then(|pou| self.an.scopes.get(pou.0 as usize));
            if external.is_none_or(|scope| !scope.contains_key(&name.symbol)) {
                self.unknown_name(name);
            }
            return None;
        };
        let found = self.root_place(root, span)?;
        (!self.external_differs(name.symbol, found.ty)).then_some(found)
    }

    /// A whole variable, which is used here.
    fn root_place(&mut self, root: Root, span: Span) -> Option<Place> {
        self.note_use(root, span);
        let ty = self.root_type(root);
        if let (Root::Global(_), Some(located)) = (root, self.root_location(root)) {
            self.note_image(located, self.an.types.extent(ty).0);
        }
        (ty != Ty::Error).then_some(Place { root, path: Vec::new(), ty, span })
    }

    /// The global variable list that a name means, where no variable has that name.
    pub(super) fn list_of(&self, base: &ast::Expr) -> Option<&BTreeMap<Symbol, GlobalId>> {
        let ast::ExprKind::Name(name) = &base.kind else { return None };
        let list = self.an.lists.get(&name.symbol)?;
        self.find_variable(name.symbol).is_none().then_some(list)
    }

    /// `LIST.x`: a variable of a global variable list.
    fn listed_place(&mut self, base: &ast::Expr, member: &Ident, span: Span) -> Option<Place> {
        let list = self.list_of(base)?;
        let found = list.get(&member.symbol).copied();
        let known: Vec<Symbol> = if found.is_none() { list.keys().copied().collect() } else { Vec::new() };
        match found {
            Some(_) if self.is_constant_context() => {
                let message = format!("`{}` has no value when the program is compiled", self.an.spelling(member));
                self.an.report(&names::NOT_CONSTANT, span, message);
                None
            }
            Some(global) => self.root_place(Root::Global(global), span),
            None => {
                let message = format!("this global variable list has no variable `{}`", self.an.spelling(member));
                self.an.report_unknown(&names::UNKNOWN_MEMBER, member, message, known.into_iter());
                None
            }
        }
    }

    /// Whether the unit's VAR_EXTERNAL is of another type than its global, which was reported there.
    fn external_differs(&self, symbol: Symbol, ty: Ty) -> bool {
        let scope = self.pou.and_then(|pou| self.an.scopes.get(pou.0 as usize));
        let var = scope.and_then(|scope| scope.get(&symbol)).and_then(|id| self.info.as_ref()?.vars.get(id.0 as usize));
        var.is_some_and(|var| var.class == VarClass::External && var.ty != ty)
    }

    /// The type of a root.
    pub(super) fn root_type(&self, root: Root) -> Ty {
        match root {
            Root::Var(VarId(var)) => {
                self.info.as_ref().and_then(|info| info.vars.get(var as usize)).map_or(Ty::Error, |var| var.ty)
            }
            Root::Global(GlobalId(global)) => {
                self.an.globals.get(global as usize).map_or(Ty::Error, |global| global.ty)
            }
            Root::System(true) => Ty::Elem(E::Ltime),
            Root::System(false) => Ty::Elem(E::Time),
            Root::Direct(_) | Root::CallInstance | Root::CallOutput(_) => Ty::Error,
        }
    }

    /// Where a root stands in the process image, if it does.
    pub(super) fn root_location(&self, root: Root) -> Option<Located> {
        match root {
            Root::Var(VarId(var)) => self.info.as_ref()?.vars.get(var as usize)?.located,
            Root::Global(GlobalId(global)) => self.an.globals.get(global as usize)?.located,
            Root::Direct(located) => Some(located),
            _ => None,
        }
    }

    /// The area of a root that VAR_CONFIG places.
    fn root_area(&self, root: Root) -> Option<BytePlace> {
        match root {
            Root::Var(VarId(var)) => self.info.as_ref()?.vars.get(var as usize)?.area,
            _ => None,
        }
    }

    pub(super) fn note_image(&mut self, located: Located, bytes: u32) {
        let at = match located.place {
            BytePlace::Input => 0,
            BytePlace::Output => 1,
            _ => 2,
        };
        let end = located.offset + bytes;
        self.usage.image_bytes[at] = self.usage.image_bytes[at].max(end);
    }

    fn member(&mut self, base: Place, member: &Ident, span: Span) -> Option<Place> {
        if member.is_missing() {
            return None;
        }
        if let Some(bit) = self.constant_bit(&base, member) {
            return self.part(base, AccessSize::Bit, bit, member.span, span);
        }
        let (Ty::User(owner), Some(fields)) = (base.ty, self.an.types.fields(base.ty).cloned()) else {
            let message = format!("{} has no fields", self.an.types.name(base.ty));
            self.an.report(&names::UNKNOWN_MEMBER, member.span, message);
            return None;
        };
        let block = match self.an.types.kind(base.ty) {
            Some(TyKind::Block { pou, .. }) => Some(*pou),
            _ => None,
        };
        let at = self.an.field_position(&fields, member.symbol);
        if self.test.is_some() {
            if let Some(found) = block.and_then(|pou| self.located_member(pou, member, span)) {
                return Some(found);
            }
        } else if let Some(pou) = block {
            let class = self.an.info(pou).and_then(|info| {
                info.vars.iter().find(|var| var.symbol == member.symbol).map(|var| (var.class, info.name.clone()))
            });
            if let Some((class, name)) = class
                && !matches!(class, VarClass::Input | VarClass::Output)
            {
                let message = format!("`{}` is private to {name}", self.an.spelling(member));
                self.an.report(&names::HIDDEN_MEMBER, member.span, message);
                return None;
            }
        }
        let Some(at) = at else {
            let message = format!("{} has no field `{}`", self.an.types.name(base.ty), self.an.spelling(member));
            let known: Vec<Symbol> = fields.iter().map(|field| field.symbol).collect();
            self.an.report_unknown(&names::UNKNOWN_MEMBER, member, message, known.into_iter());
            return None;
        };
        Some(step(base, Step::Field(owner, u32::try_from(at).unwrap_or(u32::MAX)), fields[at].ty, span))
    }

    /// A variable of a block that lies at an address, so in no instance; tests, which look inside of what they test, reach it too.
    fn located_member(&mut self, pou: PouId, member: &Ident, span: Span) -> Option<Place> {
        let info = self.an.info(pou)?;
        let var = info.vars.iter().find(|var| var.symbol == member.symbol)?;
        let located = var.located?;
        self.note_image(located, self.an.types.extent(var.ty).0);
        Some(Place { root: Root::Direct(located), path: Vec::new(), ty: var.ty, span })
    }

    fn element(&mut self, base: Place, indices: &'a [ast::Expr], span: Span) -> Option<Place> {
        if base.ty.is_text() {
            return self.character(base, indices, span);
        }
        // The bounds of an open array are known at its call.
        let kind = match self.an.types.kind(base.ty).cloned() {
            Some(TyKind::Open { element, dims }) => Some((element, vec![(i32::MIN, i32::MAX); dims].into())),
            Some(TyKind::Array { element, dims }) => Some((element, dims)),
            _ => None,
        };
        let (Ty::User(owner), Some((element, dims))) = (base.ty, kind) else {
            let message = format!("{} is no array", self.an.types.name(base.ty));
            self.an.report(&rules::NOT_AN_ARRAY, span, message);
            return None;
        };
        if indices.len() != dims.len() {
            // `a[i][j]` on an array of two dimensions is what some vendors write; one index at a time is an array of arrays.
            let message = format!("the array has {} dimensions, here are {} indices", dims.len(), indices.len());
            self.an.report(&rules::INDEX, span, message);
            return None;
        }
        let mut list = Vec::with_capacity(indices.len());
        let mut sound = true;
        for (index, (low, high)) in indices.iter().zip(dims.iter()) {
            match self.index(index, *low, *high) {
                Some(found) => list.push(found),
                None => sound = false,
            }
        }
        sound.then(|| step(base, Step::Index(owner, list.into()), element, span))
    }

    pub(super) fn index(&mut self, index: &'a ast::Expr, low: i32, high: i32) -> Option<Expr> {
        let found = self.expr(index, DINT);
        if found.ty == Ty::Error {
            return None;
        }
        let known = match (&found.kind, self.an.types.elementary(found.ty)) {
            (ExprKind::Const(Const::Wide(value)), _) => Some(*value),
            (ExprKind::Const(Const::Int(value)), Some(elementary)) => Some(widen(elementary, *value)),
            _ => None,
        };
        if let Some(value) = known.filter(|_| found.ty != BOOL) {
            if value < i128::from(low) || value > i128::from(high) {
                let message = format!("index {value} is outside {low}..{high}");
                let found = Diagnostic::new(&rules::INDEX, index.span, message);
                self.an.push(found.help(format!("the first index is {low}, the last one {high}")));
                return None;
            }
            let value = Const::Int(i64::try_from(value).unwrap_or(0));
            return Some(Expr { kind: ExprKind::Const(value), ty: DINT, span: found.span });
        }
        match self.an.types.elementary(found.ty) {
            Some(ty) if is_integer(ty) || is_bits(ty) => {
                let span = found.span;
                Some(Expr { kind: ExprKind::ToIndex(Box::new(found)), ty: DINT, span })
            }
            _ => {
                let message = format!("an index is an integer, not {}", self.an.types.name(found.ty));
                self.an.report(&rules::INDEX, index.span, message);
                None
            }
        }
    }

    /// `w.READY`: the number of a bit by a CONSTANT.
    fn constant_bit(&mut self, base: &Place, member: &Ident) -> Option<u32> {
        let has_bits = self.an.types.elementary(base.ty).is_some_and(|ty| is_bits(ty) || is_integer(ty));
        let root = self.find_variable(member.symbol).filter(|_| has_bits)?;
        let (ty, value) = self.constant_value(root)?;
        match (value, self.an.types.elementary(ty)) {
            (Const::Int(value), Some(elementary)) if is_integer(elementary) => {
                self.note_use(root, member.span);
                // No bit has a negative number: what is no number of a bit is reported with the others.
                Some(u32::try_from(value).unwrap_or(u32::MAX))
            }
            _ => None,
        }
    }

    fn part(&mut self, base: Place, size: AccessSize, index: u32, part_span: Span, span: Span) -> Option<Place> {
        let elementary = self.an.types.elementary(base.ty).filter(|ty| is_bits(*ty) || is_integer(*ty));
        let Some(elementary) = elementary.filter(|_| !self.is_enum(base.ty)) else {
            let message = format!("{} has no bits to pick", self.an.types.name(base.ty));
            self.an.report(&names::UNKNOWN_MEMBER, part_span, message);
            return None;
        };
        let width = elementary.storage().bytes() * 8;
        let first = u64::from(index) * u64::from(size.bits());
        if size.bits() >= width || first + u64::from(size.bits()) > u64::from(width) {
            let message =
                format!("{} has {width} bits; part {index} of {} bits is outside", elementary.name(), size.bits());
            self.an.report(&rules::INDEX, part_span, message);
            return None;
        }
        let ty = match size {
            AccessSize::Bit => BOOL,
            AccessSize::Byte => Ty::Elem(E::Byte),
            AccessSize::Word => Ty::Elem(E::Word),
            _ => Ty::Elem(E::Dword),
        };
        let whole = Ty::Elem(elementary);
        Some(step(base, Step::Part(whole, u32::try_from(first).unwrap_or(0), size.bits()), ty, span))
    }

    /// A place that is written.
    pub(super) fn target(&mut self, expr: &'a ast::Expr) -> Option<Place> {
        let place = self.place(expr)?;
        self.may_write(&place).then_some(place)
    }

    /// Whether a place may be written; reports when it may not.
    pub(super) fn may_write(&mut self, place: &Place) -> bool {
        let refusal = match place.root {
            Root::Var(VarId(var)) => self
                .info
                .as_ref()
                .and_then(|info| info.vars.get(var as usize))
                .and_then(|var| var.constant.then(|| (format!("`{}` is CONSTANT", var.name), Some(var.span)))),
            Root::Global(GlobalId(global)) => self.an.globals.get(global as usize).and_then(|global| {
                global.constant.then(|| (format!("`{}` is CONSTANT", global.name), Some(global.span)))
            }),
            Root::System(_) => Some(("the system variables are read-only".to_owned(), None)),
            _ => None,
        };
        let input = self.root_location(place.root).is_some_and(|located| located.place == BytePlace::Input)
            || (self.test.is_none() && self.root_area(place.root) == Some(BytePlace::Input));
        let refusal = refusal.or_else(|| input.then(|| ("%I is read-only for programs".to_owned(), None)));
        let refusal = refusal.or_else(|| {
            let refused = if self.test.is_none() { self.refuse_output(place) } else { None };
            refused.map(|message| (message, None))
        });
        let Some((message, declared)) = refusal else { return true };
        let mut found = Diagnostic::new(&names::NOT_WRITABLE, place.span, message);
        if let Some(declared) = declared {
            found =
                found.label(declared, "declared here").help("leave CONSTANT out there, or assign to another variable");
        }
        self.an.push(found);
        false
    }

    /// Outputs of a function block are for reading from outside.
    fn refuse_output(&self, place: &Place) -> Option<String> {
        for step in &place.path {
            let Step::Field(owner, at) = step else { continue };
            let TyKind::Block { pou, fields } = &self.an.types.def(*owner).kind else { continue };
            let field = fields.get(*at as usize)?;
            let info = self.an.info(*pou)?;
            let var = info.vars.iter().find(|var| var.symbol == field.symbol)?;
            if var.class == VarClass::Output {
                return Some(format!("`{}` is an output of {}; only its body writes it", field.name, info.name));
            }
        }
        None
    }

    /// Notes that a reference to a scalar variable is made, so that it needs an address.
    pub(super) fn note_address(&mut self, place: &Place) {
        match (place.root, self.pou) {
            (Root::Var(var), Some(pou)) => {
                self.usage.addressed_vars.insert((pou, var));
            }
            (Root::Global(global), _) => {
                self.usage.addressed_globals.insert(global);
            }
            _ => {}
        }
    }

    /// The record type that a step starts from.
    pub(super) fn block_of(&self, ty: Ty) -> Option<(TyId, super::tree::PouId)> {
        match (ty, self.an.types.kind(ty)) {
            (Ty::User(id), Some(TyKind::Block { pou, .. })) => Some((id, *pou)),
            _ => None,
        }
    }
}

/// A place one step further.
pub(super) fn step(mut base: Place, step: Step, ty: Ty, span: Span) -> Place {
    base.path.push(step);
    base.ty = ty;
    base.span = span;
    base
}
