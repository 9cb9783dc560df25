//! Declarations: which names there are, and what each unit and global variable is.

use std::collections::BTreeMap;
use std::rc::Rc;

use khz_bytecode::value::BytePlace;

use super::call::is_eno;
use super::tree::{GlobalId, GlobalInfo, Located, PouId, PouInfo, VarClass, VarId, VarInfo};
use super::types::{BOOL, Const, FieldDef, Ty, TyKind, Value, elementary_by_name};
use super::{Analyzer, ConstEntry, ConstKey, GlobalDecl, ListOf, State, TypeEntry, TypeSource};
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::source::Span;
use crate::syntax::ast::{
    AccessSize, Area, Declaration, DirectAddress, Ident, Pou, PouKind, Retention, SourceUnit, TypeSpecKind, VarDecl,
    VarKind, VarSection,
};
use crate::syntax::symbol::Symbol;

/// Where %I lies in %M when tests are compiled, in bytes.
const TEST_INPUTS: u64 = 32_768;

impl<'a> Analyzer<'a> {
    /// Collects all names, then resolves all declarations.
    pub(super) fn declare(&mut self) {
        let ast = self.ast;
        for file in &ast.files {
            let list = file.global_list.map(|name| ListOf { name, qualified_only: is_qualified_only(file) });
            for declaration in &file.declarations {
                self.declare_one(declaration, list);
            }
        }
        self.declare_configurations();
        for declaration in ast.declarations() {
            if let Declaration::Type(decl) = declaration {
                self.named_type(decl.name.symbol, decl.name.span);
            }
        }
        for at in 0..self.pou_decls.len() {
            self.resolve_pou(PouId(u32::try_from(at).unwrap_or(u32::MAX)));
        }
        for at in 0..self.global_decls.len() {
            let global = self.resolve_global(self.global_decls[at]);
            self.globals.push(global);
        }
    }

    fn declare_one(&mut self, declaration: &'a Declaration, list: Option<ListOf>) {
        match declaration {
            Declaration::Type(decl) => {
                if let TypeSpecKind::Enum { values, .. } = &decl.spec.kind {
                    for value in values {
                        self.enum_owners.entry(value.name.symbol).or_default().push(decl.name.symbol);
                    }
                }
                self.declare_type(&decl.name, TypeSource::Declared(decl));
            }
            Declaration::Pou(pou) => self.declare_pou(pou),
            Declaration::Globals(section) => self.declare_globals(section, None, None, list),
            Declaration::Configuration(_) => {}
        }
    }

    fn declare_configurations(&mut self) {
        let ast = self.ast;
        let (mut configuration, mut resource) = (0u32, 0u32);
        for declaration in ast.declarations() {
            let Declaration::Configuration(found) = declaration else { continue };
            for section in &found.globals {
                self.declare_globals(section, Some(configuration), None, None);
            }
            for declared in &found.resources {
                for section in &declared.globals {
                    self.declare_globals(section, Some(configuration), Some(resource), None);
                }
                resource += 1;
            }
            configuration += 1;
        }
    }

    fn report_twice(&mut self, name: &Ident, first: Option<Span>) {
        let message = format!("`{}` is declared twice", self.spelling(name));
        let mut found = Diagnostic::new(&rules::DUPLICATE_NAME, name.span, message);
        if let Some(first) = first {
            found = found.label(first, "first here");
        }
        self.push(found.help("give one of them another name"));
    }

    fn declare_type(&mut self, name: &Ident, source: TypeSource<'a>) -> bool {
        if name.is_missing() {
            return false;
        }
        let other = self.type_names.get(&name.symbol).map(|entry| entry.span);
        let other = other.or_else(|| {
            self.pou_names.get(&name.symbol).and_then(|id| self.pou_decls.get(id.0 as usize)).map(|pou| pou.name.span)
        });
        if Some(name.span.file) == self.standard && other.is_some() {
            return false; // The user's block of that name replaces the standard one.
        }
        if other.is_some() || elementary_by_name(self.text(name.symbol)).is_some() {
            self.report_twice(name, other);
            return false;
        }
        self.type_names.insert(name.symbol, TypeEntry { source, state: State::Waiting, span: name.span });
        true
    }

    fn declare_pou(&mut self, pou: &'a Pou) {
        let id = PouId(u32::try_from(self.pou_decls.len()).unwrap_or(u32::MAX));
        let declared = if pou.kind == PouKind::FunctionBlock {
            self.declare_type(&pou.name, TypeSource::Block(id))
        } else {
            let first = self.pou_names.get(&pou.name.symbol).and_then(|id| self.pou_decls.get(id.0 as usize));
            let first = first.map(|pou| pou.name.span);
            let first = first.or_else(|| self.type_names.get(&pou.name.symbol).map(|entry| entry.span));
            if first.is_some() {
                self.report_twice(&pou.name, first);
            }
            first.is_none() && !pou.name.is_missing()
        };
        if !declared && Some(pou.span.file) == self.standard {
            return;
        }
        if declared {
            self.pou_names.insert(pou.name.symbol, id);
        }
        for section in pou.sections.iter().filter(|section| section.constant.is_some()) {
            self.declare_constants(section, Some(id));
        }
        self.pou_decls.push(pou);
        self.pous.push(None);
        self.scopes.push(BTreeMap::new());
    }

    fn declare_constants(&mut self, section: &'a VarSection, scope: Option<PouId>) {
        for decl in &section.decls {
            for name in &decl.names {
                let entry = ConstEntry { decl, state: State::Waiting };
                self.constants.entry(ConstKey::Named(scope, name.symbol)).or_insert(entry);
            }
        }
    }

    fn declare_globals(
        &mut self,
        section: &'a VarSection,
        configuration: Option<u32>,
        resource: Option<u32>,
        list: Option<ListOf>,
    ) {
        let qualified_only = list.is_some_and(|list| list.qualified_only);
        if section.constant.is_some() && !qualified_only {
            self.declare_constants(section, None);
        }
        for decl in &section.decls {
            for name in &decl.names {
                if name.is_missing() {
                    continue;
                }
                let id = GlobalId(u32::try_from(self.global_decls.len()).unwrap_or(u32::MAX));
                let decls = &self.global_decls;
                let mut clash = None;
                if !qualified_only {
                    let same = self.global_names.entry(name.symbol).or_default();
                    let other = same
                        .iter()
                        .map(|id| &decls[id.0 as usize])
                        .find(|other| (other.configuration, other.resource) == (configuration, resource));
                    clash = other.map(|other| other.name.span);
                    same.push(id);
                }
                if let Some(list) = list {
                    let other = self.lists.entry(list.name.symbol).or_default().insert(name.symbol, id);
                    clash = clash.or_else(|| other.map(|other| decls[other.0 as usize].name.span));
                    if section.constant.is_some() {
                        self.constants.insert(ConstKey::Listed(id), ConstEntry { decl, state: State::Waiting });
                    }
                }
                if clash.is_some() {
                    self.report_twice(name, clash);
                }
                self.global_decls.push(GlobalDecl { section, decl, name: *name, configuration, resource, list });
            }
        }
    }

    fn resolve_global(&mut self, found: GlobalDecl<'a>) -> GlobalInfo {
        let (ty, init) = self.declared_value(found.decl, found.name.symbol, None, found.section.constant.is_some());
        let mut name = self.spelling(&found.name).to_owned();
        if let Some(list) = found.list.filter(|list| list.qualified_only) {
            name = format!("{}.{name}", self.spelling(&list.name));
        }
        GlobalInfo {
            symbol: found.name.symbol,
            name,
            qualified_only: found.is_qualified_only(),
            span: found.name.span,
            configuration: found.configuration,
            resource: found.resource,
            ty,
            constant: found.section.constant.is_some(),
            init,
            located: self.located(found.decl, ty),
            retain: is_retained(found.section),
        }
    }

    /// Type and initial value of a declared variable; through the table of constants when it is one.
    fn declared_value(&mut self, decl: &'a VarDecl, name: Symbol, scope: Option<PouId>, constant: bool) -> (Ty, Value) {
        if constant {
            let entry = self.constants.get(&ConstKey::Named(scope, name)).map(|entry| std::ptr::eq(entry.decl, decl));
            if entry == Some(true) {
                return self.constant_of(ConstKey::Named(scope, name), decl.span).unwrap_or((Ty::Error, Value::Zero));
            }
        }
        let (ty, default) = self.resolve_spec(&decl.ty, scope);
        match &decl.init {
            Some(init) => (ty, self.check_init(init, ty, scope)),
            None => (ty, default),
        }
    }

    /// Type and value of a CONSTANT, resolved when first asked for. `None`: there is none of this name in this scope.
    pub(super) fn constant_of(&mut self, key: ConstKey, span: Span) -> Option<(Ty, Value)> {
        let entry = self.constants.get_mut(&key)?;
        let decl = entry.decl;
        let scope = match key {
            ConstKey::Named(scope, _) => scope,
            ConstKey::Listed(_) => None,
        };
        match &entry.state {
            State::Done(done) => return Some(done.clone().unwrap_or((Ty::Error, Value::Zero))),
            State::Busy => {
                let name = decl.names.first().map_or("", |name| self.spelling(name));
                let message = format!("the value of `{name}` depends on itself");
                let declared = decl.names.first().map_or(decl.span, |name| name.span);
                let found = Diagnostic::new(&rules::RECURSIVE_CONSTANT, span, message).label(declared, "declared here");
                self.push(found.help("give it a value that does not need it"));
                return Some((Ty::Error, Value::Zero));
            }
            State::Waiting => entry.state = State::Busy,
        }
        let value = self.nested(span, |this| {
            let (ty, default) = this.resolve_spec(&decl.ty, scope);
            match &decl.init {
                Some(init) => (ty, this.check_init(init, ty, scope)),
                None => (ty, default),
            }
        });
        if let Some(entry) = self.constants.get_mut(&key) {
            entry.state = State::Done(value.clone());
        }
        Some(value.unwrap_or((Ty::Error, Value::Zero)))
    }

    /// The declaration of a unit, resolved when first asked for.
    pub(super) fn resolve_pou(&mut self, id: PouId) -> Option<Rc<PouInfo>> {
        if let Some(info) = self.info(id) {
            return Some(info);
        }
        let pou = *self.pou_decls.get(id.0 as usize)?;
        if pou.kind == PouKind::FunctionBlock {
            // Only through its type name, where a block that contains itself is noticed.
            let busy = self.type_names.get(&pou.name.symbol).is_some_and(|entry| {
                matches!((&entry.source, &entry.state), (TypeSource::Block(other), State::Waiting) if *other == id)
            });
            if busy {
                self.named_type(pou.name.symbol, pou.name.span);
                return self.info(id);
            }
        }
        let info = Rc::new(self.declare_variables(id, pou));
        if let Some(slot) = self.pous.get_mut(id.0 as usize) {
            *slot = Some(info.clone());
        }
        Some(info)
    }

    fn declare_variables(&mut self, id: PouId, pou: &'a Pou) -> PouInfo {
        let mut vars: Vec<VarInfo> = Vec::new();
        let mut names: BTreeMap<Symbol, VarId> = BTreeMap::new();
        let mut result = None;
        if let Some(spec) = &pou.result {
            let (ty, init) = self.resolve_spec(spec, Some(id));
            self.refuse_block(ty, spec.span, "the result of a function");
            result = Some(VarId(0));
            names.insert(pou.name.symbol, VarId(0));
            vars.push(new_var(&pou.name, self.spelling(&pou.name), ty, VarClass::Result, init));
        }
        for section in &pou.sections {
            let class = self.var_class(section);
            for decl in &section.decls {
                self.declare_vars(id, pou, section, decl, class, &mut vars, &mut names);
            }
        }
        let block = match pou.kind {
            PouKind::FunctionBlock => self.block_type(id, pou, &mut vars),
            _ => None,
        };
        if let Some(slot) = self.scopes.get_mut(id.0 as usize) {
            *slot = names;
        }
        PouInfo { kind: pou.kind, name: self.spelling(&pou.name).to_owned(), span: pou.name.span, vars, result, block }
    }

    fn var_class(&mut self, section: &VarSection) -> VarClass {
        match section.kind {
            VarKind::Local => VarClass::Local,
            VarKind::Input => VarClass::Input,
            VarKind::Output => VarClass::Output,
            VarKind::InOut => VarClass::InOut,
            VarKind::Temp => VarClass::Temp,
            VarKind::External => VarClass::External,
            VarKind::Global => {
                self.report(&rules::NOT_SUPPORTED, section.span, "VAR_GLOBAL stands outside of programs and functions");
                VarClass::Local
            }
        }
    }

    #[expect(clippy::too_many_arguments, reason = "one declaration meets all of its surroundings here")]
    fn declare_vars(
        &mut self,
        id: PouId,
        pou: &'a Pou,
        section: &'a VarSection,
        decl: &'a VarDecl,
        class: VarClass,
        vars: &mut Vec<VarInfo>,
        names: &mut BTreeMap<Symbol, VarId>,
    ) {
        let constant = section.constant.is_some();
        for (at, name) in decl.names.iter().enumerate() {
            if name.is_missing() {
                continue;
            }
            // The later names of `a, b : T` are what the first one is.
            let first = decl.names.first().filter(|_| at > 0).and_then(|name| names.get(&name.symbol));
            let first = first.and_then(|id| vars.get(id.0 as usize)).cloned();
            let (ty, init) = match (self.open_array(&decl.ty, pou.kind, class, Some(id)), &first) {
                (Some(ty), _) => (ty, Value::Zero),
                (None, Some(first)) if !constant => (first.ty, first.init.clone()),
                _ => self.declared_value(decl, name.symbol, Some(id), constant),
            };
            if pou.kind == PouKind::Function && !matches!(class, VarClass::InOut | VarClass::External) {
                self.refuse_block(ty, decl.ty.span, "a variable of a FUNCTION");
            } else if class == VarClass::Temp {
                self.refuse_block(ty, decl.ty.span, "a VAR_TEMP");
            }
            if let Some(&first) = names.get(&name.symbol) {
                let first = vars.get(first.0 as usize).map(|var| var.span);
                self.report_twice(name, first);
                continue;
            }
            let mut var = new_var(name, self.spelling(name), ty, class, init);
            var.constant = constant;
            if pou.kind == PouKind::Function && is_eno(self.text(name.symbol), &var) {
                // Its body runs only when EN is TRUE, and may take ENO back (6.6.1.7).
                var.init = Value::Scalar(Const::Int(1));
            }
            var.area = self.incomplete_address(decl, pou.kind, class, ty);
            var.located = if var.area.is_some() {
                None
            } else if at == 0 {
                self.located(decl, ty)
            } else {
                first.and_then(|first| first.located)
            };
            if var.located.is_some() && pou.kind == PouKind::Function {
                self.report(&rules::BAD_ADDRESS, decl.span, "a FUNCTION has no variables at fixed addresses");
            }
            var.retain = is_retained(section);
            let here = VarId(u32::try_from(vars.len()).unwrap_or(u32::MAX));
            names.insert(name.symbol, here);
            let hidden = self.edge_input(decl, pou.kind, &mut var, here);
            vars.push(var);
            vars.extend(hidden.into_iter().flatten());
        }
    }

    fn refuse_block(&mut self, ty: Ty, span: Span, what: &str) {
        if self.types.holds_block(ty) {
            let message = format!("{what} keeps nothing from call to call, so it can hold no function block instance");
            self.report(&rules::BLOCK_NOT_HERE, span, message);
        }
    }

    fn block_type(&mut self, id: PouId, pou: &Pou, vars: &mut [VarInfo]) -> Option<super::types::TyId> {
        let mut fields = Vec::new();
        for var in vars.iter_mut() {
            let stored = matches!(var.class, VarClass::Input | VarClass::Output | VarClass::Local);
            if stored && var.located.is_none() {
                var.field = u32::try_from(fields.len()).ok();
                let (symbol, name, init) = (var.symbol, var.name.clone(), var.init.clone());
                fields.push(FieldDef { symbol, name, ty: var.ty, offset: 0, init });
            }
        }
        let name = self.spelling(&pou.name).to_owned();
        self.record_type(name, fields, Some(id), pou.name.span)
    }

    /// The place of a declaration's AT.
    fn located(&mut self, decl: &VarDecl, ty: Ty) -> Option<Located> {
        let address = decl.address.as_ref()?;
        if address.is_incomplete() {
            let message = "only a VAR of a program or function block leaves its address to VAR_CONFIG";
            self.report(&rules::BAD_ADDRESS, address.span, message);
            return None;
        }
        self.located_at(address, ty)
    }

    /// The place of an address for a variable of a type.
    pub(super) fn located_at(&mut self, address: &DirectAddress, ty: Ty) -> Option<Located> {
        let located = self.address(address)?;
        if ty == Ty::Error {
            return Some(located);
        }
        if self.types.holds_block(ty) {
            self.report(
                &rules::BAD_ADDRESS,
                address.span,
                "a function block instance has no place in the process image",
            );
            return None;
        }
        let bits = if ty == BOOL { 1 } else { u64::from(self.types.extent(ty).0) * 8 };
        let wanted = address.size.map_or(1, AccessSize::bits);
        let scalar = self.types.storage(ty).is_some();
        if (ty == BOOL) != located.bit.is_some() || (scalar && bits != u64::from(wanted)) {
            let message = format!("{} takes {bits} bits, the address has {wanted}", self.types.name(ty));
            self.report(&rules::BAD_ADDRESS, address.span, message);
            return None;
        }
        if matches!(self.types.kind(ty), Some(TyKind::Subrange { .. })) {
            self.report(
                &rules::BAD_ADDRESS,
                address.span,
                "the image may hold any value, so no subrange can stand there",
            );
            return None;
        }
        let end = u64::from(located.offset) + bits.div_ceil(8);
        if end > u64::from(u16::MAX) {
            self.report(&rules::BAD_ADDRESS, address.span, format!("byte {} is beyond the largest image", end - 1));
            return None;
        }
        Some(located)
    }

    /// The place that a direct address means: `%IX3.5` bit 5 of byte 3, `%IW1` bytes 2 and 3, `%ID1` bytes 4 to 7.
    pub(super) fn address(&mut self, address: &DirectAddress) -> Option<Located> {
        let in_test = self.tests.is_some();
        let place = match address.area {
            Area::Input if in_test => BytePlace::Memory,
            Area::Input => BytePlace::Input,
            Area::Output => BytePlace::Output,
            Area::Memory => BytePlace::Memory,
        };
        let size = address.size.unwrap_or(AccessSize::Bit);
        let found = match (size, address.path.as_slice()) {
            (AccessSize::Bit, [byte, bit]) if *bit < 8 => Some((u64::from(*byte), u8::try_from(*bit).ok())),
            (AccessSize::Bit, [bit]) => Some((u64::from(bit / 8), u8::try_from(bit % 8).ok())),
            (AccessSize::Bit, _) => None,
            (size, [number]) => Some((u64::from(*number) * u64::from(size.bits() / 8), None)),
            _ => None,
        };
        let Some((offset, bit)) = found else {
            let message = "an address is a byte and a bit below 8 (%IX3.5), or one number (%IW1)";
            self.report(&rules::BAD_ADDRESS, address.span, message);
            return None;
        };
        // A test writes the inputs of what it tests: they are memory then, behind the program's own.
        let offset = if in_test && address.area == Area::Input { offset + TEST_INPUTS } else { offset };
        let too_high = in_test && address.area == Area::Memory && offset + 8 > TEST_INPUTS;
        match u32::try_from(offset) {
            Ok(_) if too_high => {
                let message = format!("where there are tests, %M ends at byte {}", TEST_INPUTS - 1);
                self.report(&rules::BAD_ADDRESS, address.span, message);
                None
            }
            Ok(offset) if offset + size.bits().div_ceil(8) <= u32::from(u16::MAX) => {
                Some(Located { place, offset, bit })
            }
            _ => {
                self.report(&rules::BAD_ADDRESS, address.span, format!("byte {offset} is beyond the largest image"));
                None
            }
        }
    }
}

fn new_var(name: &Ident, spelling: &str, ty: Ty, class: VarClass, init: Value) -> VarInfo {
    VarInfo {
        symbol: name.symbol,
        name: spelling.to_owned(),
        span: name.span,
        ty,
        class,
        constant: false,
        init,
        located: None,
        retain: false,
        field: None,
        area: None,
        edge: None,
    }
}

/// Whether the variables of a global variable list are known with its name before theirs only.
fn is_qualified_only(file: &SourceUnit) -> bool {
    let mut sections = file.declarations.iter().filter_map(|declaration| match declaration {
        Declaration::Globals(section) => Some(section),
        _ => None,
    });
    sections.any(|section| section.attributes.iter().any(|entry| entry.name.eq_ignore_ascii_case("qualified_only")))
}

fn is_retained(section: &VarSection) -> bool {
    matches!(section.retention, Some((Retention::Retain | Retention::Persistent, _)))
}
