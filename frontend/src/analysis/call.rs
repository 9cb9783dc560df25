//! Calls of functions and function blocks.

use std::rc::Rc;

use khz_machine::library::functions;

use super::expr::{Checker, broken};
use super::place::step;
use super::tree::{
    Call, Expr, ExprKind, Place, PouId, PouInfo, Root, Step, Stmt, StmtKind, UnOp, VarClass, VarId, VarInfo,
};
use super::types::{BOOL, Const, Ty, TyId, Value};
use crate::diagnostics::{Diagnostic, semantic as names, types as rules};
use crate::source::Span;
use crate::syntax::ast::{self, Arg, ArgKind, Ident, PouKind};
use crate::syntax::symbol::Symbol;

/// Arguments by parameter.
#[derive(Default)]
struct Bound<'a> {
    inputs: Vec<(VarId, &'a ast::Expr)>,
    outputs: Vec<(VarId, &'a ast::Expr, bool)>,
    en: Option<&'a ast::Expr>,
    eno: Option<(&'a ast::Expr, bool)>,
    /// ENO is an output that the unit declares itself, so its body says what it is.
    declares_eno: bool,
}

/// Whether a parameter is an EN that the unit declares itself.
fn is_en(text: &str, var: &VarInfo) -> bool {
    text == "EN" && var.class == VarClass::Input && var.ty == BOOL
}

/// Whether a parameter is an ENO that the unit declares itself.
pub(super) fn is_eno(text: &str, var: &VarInfo) -> bool {
    text == "ENO" && var.class == VarClass::Output && var.ty == BOOL
}

/// TRUE.
fn truth(span: Span) -> Expr {
    Expr { kind: ExprKind::Const(Const::Int(1)), ty: BOOL, span }
}

/// What a call means.
enum Callee {
    Block(Place, TyId, PouId),
    Function(PouId),
    Standard(Ident),
    Broken,
}

impl<'a> Checker<'_, 'a> {
    fn callee(&mut self, callee: &'a ast::Expr) -> Callee {
        let ast::ExprKind::Name(name) = &callee.kind else {
            let Some(place) = self.place(callee) else { return Callee::Broken };
            return match self.block_of(place.ty) {
                Some((ty, pou)) => Callee::Block(place, ty, pou),
                None => {
                    let message = format!("{} can not be called", self.an.types.name(place.ty));
                    self.an.report(&names::NOT_CALLABLE, callee.span, message);
                    Callee::Broken
                }
            };
        };
        if name.is_missing() {
            return Callee::Broken;
        }
        if let Some(root) = self.find_variable(name.symbol).filter(|_| !self.is_constant_context()) {
            if self.root_type(root) == Ty::Error {
                return Callee::Broken;
            }
            if self.block_of(self.root_type(root)).is_some() {
                let Some(place) = self.place(callee) else { return Callee::Broken };
                return self.block_of(place.ty).map_or(Callee::Broken, |(ty, pou)| Callee::Block(place, ty, pou));
            }
        }
        match self.an.pou_names.get(&name.symbol).copied() {
            None => Callee::Standard(*name),
            Some(pou) => match self.an.pou_decls.get(pou.0 as usize).map(|pou| pou.kind) {
                Some(PouKind::Function) => Callee::Function(pou),
                kind => {
                    let what = if kind == Some(PouKind::Program) { "a program" } else { "a type" };
                    let message =
                        format!("`{}` is {what}, not a function; only instances of it run", self.an.spelling(name));
                    let spelling = self.an.spelling(name);
                    let help = format!("declare an instance of it, `my{spelling} : {spelling};`, and call that");
                    self.an.push(Diagnostic::new(&names::NOT_CALLABLE, name.span, message).help(help));
                    Callee::Broken
                }
            },
        }
    }

    /// A call inside an expression.
    pub(super) fn call_expr(&mut self, expr: &'a ast::Expr, callee: &'a ast::Expr, args: &'a [Arg], want: Ty) -> Expr {
        let span = expr.span;
        match self.callee(callee) {
            Callee::Broken => {
                self.check_loose(args);
                broken(span)
            }
            Callee::Standard(name) => self.standard_call(&name, args, span, want),
            Callee::Block(..) => {
                let message = "a function block has no value; call it in a statement, then read its outputs";
                let found = Diagnostic::new(&names::NOT_CALLABLE, span, message);
                self.an.push(found.help("the call is a statement, its outputs are fields of the instance: `timer.Q`"));
                broken(span)
            }
            Callee::Function(pou) => {
                if self.is_constant_context() {
                    self.an.report(
                        &names::NOT_CONSTANT,
                        span,
                        "functions are not computed when the program is compiled",
                    );
                    return broken(span);
                }
                let Some(call) = self.function_call(pou, args, span) else { return broken(span) };
                let ty = self.result_type(pou);
                if ty == Ty::Void {
                    self.an.report(&rules::MISMATCH, span, "this function has no result");
                    return broken(span);
                }
                Expr { kind: ExprKind::Call(Box::new(call)), ty, span }
            }
        }
    }

    fn result_type(&self, pou: PouId) -> Ty {
        let info = self.an.info(pou);
        info.and_then(|info| info.result.and_then(|var| info.vars.get(var.0 as usize).map(|var| var.ty)))
            .unwrap_or(Ty::Void)
    }

    /// A call as a statement.
    pub(super) fn call_statement(&mut self, expr: &'a ast::Expr) -> Option<Stmt> {
        let span = expr.span;
        let ast::ExprKind::Call { callee, args } = &expr.kind else { return None };
        let kind = match self.callee(callee) {
            Callee::Broken => {
                self.check_loose(args);
                return None;
            }
            Callee::Standard(name) => {
                if let Some(found) = self.test_statement(&name, args, span) {
                    return found;
                }
                if let Some(row) = functions::find(self.an.text(name.symbol)).filter(|row| !row.outputs.is_empty()) {
                    let found = self.split_call(row, args, span);
                    if found.is_none() {
                        self.check_loose(args);
                    }
                    return found;
                }
                let found = self.standard_call(&name, args, span, Ty::Void);
                let found = self.settle(found, Ty::Void);
                if found.ty == Ty::Error {
                    return None;
                }
                // ENO is an effect.
                if !matches!(&found.kind, ExprKind::Enabled(enabled) if enabled.eno.is_some()) {
                    self.an.report(&names::NO_EFFECT, span, "the result of this function is not used");
                }
                StmtKind::Evaluate(found)
            }
            Callee::Function(pou) => StmtKind::Call(Box::new(self.function_call(pou, args, span)?)),
            Callee::Block(place, ty, pou) => StmtKind::Call(Box::new(self.block_call(place, ty, pou, args, span)?)),
        };
        Some(Stmt { kind, span })
    }

    /// Checks arguments of a call whose target is unknown, so that mistakes in them are found too.
    fn check_loose(&mut self, args: &'a [Arg]) {
        for arg in args {
            match &arg.kind {
                ArgKind::Positional(value) | ArgKind::Input { value: Some(value), .. } => {
                    self.expr(value, Ty::Void);
                }
                ArgKind::Output { target: Some(target), .. } => {
                    self.place(target);
                }
                _ => {}
            }
        }
    }

    fn bind(&mut self, info: &PouInfo, args: &'a [Arg]) -> Option<Bound<'a>> {
        let mut bound = Bound::default();
        let mut sound = true;
        let parameters: Vec<(VarId, &VarInfo)> = (0u32..)
            .map(VarId)
            .zip(&info.vars)
            .filter(|(_, var)| matches!(var.class, VarClass::Input | VarClass::InOut | VarClass::Output))
            .collect();
        let mut position = 0;
        let mut seen: Vec<Symbol> = Vec::new();
        for arg in args {
            let (name, value, output) = match &arg.kind {
                ArgKind::Positional(value) => {
                    let Some((id, var)) = parameters.get(position) else {
                        let message = format!("{} takes {} arguments", info.name, parameters.len());
                        self.an.report(&names::ARGUMENT_COUNT, arg.span, message);
                        return None;
                    };
                    position += 1;
                    if var.class == VarClass::Output {
                        bound.outputs.push((*id, value, false));
                    } else {
                        bound.inputs.push((*id, value));
                    }
                    seen.push(var.symbol);
                    continue;
                }
                ArgKind::Input { name, value } => (name, value.as_ref(), None),
                ArgKind::Output { name, negated, target } => (name, target.as_ref(), Some(*negated)),
            };
            if name.is_missing() {
                continue;
            }
            if seen.contains(&name.symbol) {
                let message = format!("`{}` is given twice", self.an.spelling(name));
                self.an.report(&names::PARAMETER_TWICE, name.span, message);
                sound = false;
                continue;
            }
            seen.push(name.symbol);
            sound &= self.bind_named(info, &parameters, (name, value, output), &mut bound);
        }
        sound.then_some(bound)
    }

    /// Binds an argument that names its parameter: the name, the value or target if there is one, and for an output whether it is negated.
    /// FALSE: it was reported.
    fn bind_named(
        &mut self,
        info: &PouInfo,
        parameters: &[(VarId, &VarInfo)],
        (name, value, output): (&Ident, Option<&'a ast::Expr>, Option<bool>),
        bound: &mut Bound<'a>,
    ) -> bool {
        let text = self.an.text(name.symbol);
        let found = parameters.iter().find(|(_, var)| var.symbol == name.symbol);
        match (found, output, value) {
            // A unit may declare EN itself (6.6.1.7): it is the condition of the call all the same.
            (Some((_, var)), None, Some(value)) if is_en(text, var) => bound.en = Some(value),
            (Some((id, var)), Some(negated), Some(value)) if is_eno(text, var) => {
                bound.outputs.push((*id, value, negated));
                bound.eno = Some((value, negated));
                bound.declares_eno = true;
            }
            (None, None, Some(value)) if text == "EN" => bound.en = Some(value),
            (None, Some(negated), Some(value)) if text == "ENO" => bound.eno = Some((value, negated)),
            (None, _, _) if text == "EN" || text == "ENO" => {}
            (None, ..) => {
                self.unknown_parameter(info, name, parameters);
                return false;
            }
            (Some((_, var)), Some(_), _) if var.class != VarClass::Output => {
                let message = format!("`{}` is no output", var.name);
                let found = Diagnostic::new(&names::UNKNOWN_PARAMETER, name.span, message);
                self.an.push(found.help(format!("inputs are given with `{} := …`", var.name)));
                return false;
            }
            (Some((_, var)), None, _) if var.class == VarClass::Output => {
                let message = format!("`{}` is an output", var.name);
                let found = Diagnostic::new(&names::UNKNOWN_PARAMETER, name.span, message);
                self.an.push(found.help(format!("outputs are taken with `{} => …`", var.name)));
                return false;
            }
            (Some((id, _)), Some(negated), Some(value)) => bound.outputs.push((*id, value, negated)),
            (Some((id, _)), None, Some(value)) => bound.inputs.push((*id, value)),
            (Some(_), _, None) => {}
        }
        true
    }

    fn unknown_parameter(&mut self, info: &PouInfo, name: &Ident, parameters: &[(VarId, &VarInfo)]) {
        let message = format!("{} has no parameter `{}`", info.name, self.an.spelling(name));
        let known: Vec<Symbol> = parameters.iter().map(|(_, var)| var.symbol).collect();
        self.an.report_unknown(&names::UNKNOWN_PARAMETER, name, message, known.into_iter());
    }

    fn note_callee(&mut self, pou: PouId, span: Span) {
        self.callees.entry(pou).or_insert(span);
    }

    fn function_call(&mut self, pou: PouId, args: &'a [Arg], span: Span) -> Option<Call> {
        let info = self.an.info(pou)?;
        self.note_callee(pou, span);
        let Some(bound) = self.bind(&info, args) else {
            self.check_loose(args);
            return None;
        };
        let en = bound.en.map(|en| self.condition(en));
        let mut sound = true;
        let mut inputs = Vec::new();
        let mut inouts = Vec::new();
        let mut arrays = Vec::new();
        for (id, var) in (0u32..).map(VarId).zip(&info.vars) {
            let given = bound.inputs.iter().find(|(other, _)| *other == id).map(|(_, value)| *value);
            match var.class {
                // The body runs only when EN is TRUE.
                VarClass::Input if given.is_none() && is_en(self.an.text(var.symbol), var) => {
                    inputs.push((id, truth(span)));
                }
                VarClass::Input => match self.input_value(var, given, span) {
                    Some(value) => {
                        self.note_parameter((pou, id), &value);
                        sound &= value.ty != Ty::Error;
                        arrays.extend(self.is_open(var.ty).then_some((id, value.ty)));
                        inputs.push((id, value));
                    }
                    None => sound = false,
                },
                VarClass::InOut => match self.inout(pou, id, var, given, span) {
                    Some(place) => {
                        arrays.extend(self.is_open(var.ty).then_some((id, place.ty)));
                        inouts.push((id, place));
                    }
                    None => sound = false,
                },
                VarClass::Output if self.is_open(var.ty) && !bound.outputs.iter().any(|(other, ..)| *other == id) => {
                    let message =
                        format!("the output `{}` has the bounds of its variable, so it must be connected", var.name);
                    self.an.report(&names::ARGUMENT_COUNT, span, message);
                    sound = false;
                }
                _ => {}
            }
        }
        let after = self.outputs(&bound, &info, |id, var| Place {
            root: Root::CallOutput(id),
            path: Vec::new(),
            ty: var.ty,
            span,
        });
        self.output_arrays(&info, &after, &mut arrays);
        sound &= info.vars.iter().filter(|var| self.is_open(var.ty)).count() == arrays.len();
        let eno = bound.eno.and_then(|(eno, _)| self.eno(eno));
        let eno_is_given = bound.declares_eno;
        let before = Vec::new();
        sound.then_some(Call {
            target: pou,
            instance: None,
            en,
            eno,
            eno_is_given,
            inputs,
            before,
            inouts,
            after,
            arrays: Self::in_order(arrays),
            span,
        })
    }

    fn input_value(&mut self, var: &VarInfo, given: Option<&'a ast::Expr>, span: Span) -> Option<Expr> {
        if let Some(given) = given {
            if self.is_open(var.ty) {
                let found = self.expr(given, Ty::Void);
                return (found.ty != Ty::Error && self.stands_for(var, found.ty, given.span)).then_some(found);
            }
            return Some(self.expr_of(given, var.ty));
        }
        let value = match &var.init {
            _ if self.is_open(var.ty) => None,
            Value::Scalar(value) => Some(value.clone()),
            Value::Zero => self.zero(var.ty),
            _ => None,
        };
        let Some(value) = value else {
            if var.ty != Ty::Error {
                self.an.report(&names::ARGUMENT_COUNT, span, format!("the argument `{}` is missing", var.name));
            }
            return None;
        };
        let ty = match &value {
            Const::Str(text) => Ty::Str(u16::try_from(text.len().max(1)).unwrap_or(u16::MAX)),
            Const::WStr(text) => Ty::WStr(u16::try_from(text.len().max(1)).unwrap_or(u16::MAX)),
            _ => var.ty,
        };
        Some(Expr { kind: ExprKind::Const(value), ty, span })
    }

    /// A VAR_INPUT that is passed as a reference: notes where it points.
    fn note_parameter(&mut self, parameter: (PouId, VarId), value: &Expr) {
        if self.an.types.storage(value.ty).is_some() {
            return;
        }
        if let ExprKind::Load(place) = &value.kind {
            self.note_reference(parameter, place);
        }
    }

    fn note_reference(&mut self, parameter: (PouId, VarId), place: &Place) {
        if self.root_location(place.root).is_some() {
            self.usage.image_parameters.insert(parameter);
        }
        if let (Root::Var(var), Some(pou)) = (place.root, self.pou) {
            self.usage.parameter_edges.insert((parameter, (pou, var)));
        }
    }

    /// The variable for a VAR_IN_OUT.
    pub(super) fn inout(
        &mut self,
        pou: PouId,
        id: VarId,
        var: &VarInfo,
        given: Option<&'a ast::Expr>,
        span: Span,
    ) -> Option<Place> {
        let Some(given) = given else {
            self.an.report(&names::IN_OUT, span, format!("the VAR_IN_OUT `{}` must be connected", var.name));
            return None;
        };
        let place = self.target(given)?;
        let bit = matches!(place.path.last(), Some(Step::Part(..)))
            || self.root_location(place.root).is_some_and(|located| located.bit.is_some());
        if bit {
            let message = format!("`{}` is a VAR_IN_OUT; a bit has no address", var.name);
            self.an.report(&names::IN_OUT, given.span, message);
            return None;
        }
        if self.is_open(var.ty) {
            if !self.stands_for(var, place.ty, given.span) {
                return None;
            }
        } else if place.ty != var.ty && var.ty != Ty::Error {
            let (wanted, found) = (self.an.types.name(var.ty), self.an.types.name(place.ty));
            let message =
                format!("`{}` is a VAR_IN_OUT of {wanted}; a variable of {found} can not stand in for it", var.name);
            self.an.report(&rules::MISMATCH, given.span, message);
            return None;
        }
        self.note_reference((pou, id), &place);
        if place.path.is_empty() {
            self.note_address(&place);
        }
        Some(place)
    }

    pub(super) fn eno(&mut self, eno: &'a ast::Expr) -> Option<Place> {
        let place = self.target(eno)?;
        if place.ty != BOOL {
            self.an.report(&rules::MISMATCH, eno.span, "ENO is a BOOL");
            return None;
        }
        Some(place)
    }

    fn outputs(
        &mut self,
        bound: &Bound<'a>,
        info: &PouInfo,
        source: impl Fn(VarId, &VarInfo) -> Place,
    ) -> Vec<Rc<Stmt>> {
        let mut after = Vec::new();
        for (id, target, negated) in &bound.outputs {
            let Some(var) = info.vars.get(id.0 as usize) else { continue };
            let Some(target) = self.target(target) else { continue };
            let mut from = source(*id, var);
            from.span = target.span;
            if self.is_open(var.ty) {
                if !self.stands_for(var, target.ty, target.span) {
                    continue;
                }
                from.ty = target.ty;
            }
            let (ty, span) = (from.ty, target.span);
            let mut value = Expr { kind: ExprKind::Load(Box::new(from)), ty, span };
            if *negated {
                if ty != BOOL {
                    self.an.report(&rules::OPERATOR, span, "NOT before => is for BOOL outputs");
                    continue;
                }
                value = self.unary_op(UnOp::Not, value, span);
            }
            let value = self.coerce(value, target.ty);
            if value.ty != Ty::Error {
                after.push(Rc::new(Stmt { kind: StmtKind::Assign { target, value }, span }));
            }
        }
        after
    }

    fn block_call(&mut self, instance: Place, ty: TyId, pou: PouId, args: &'a [Arg], span: Span) -> Option<Call> {
        let info = self.an.resolve_pou(pou)?;
        self.note_callee(pou, span);
        if let (Root::Var(var), true, Some(unit)) = (instance.root, instance.path.is_empty(), self.pou) {
            self.usage.called_blocks.entry((unit, var)).or_insert(span);
        }
        let Some(bound) = self.bind(&info, args) else {
            self.check_loose(args);
            return None;
        };
        let field = |var: &VarInfo, span: Span| {
            let base = Place { root: Root::CallInstance, path: Vec::new(), ty: Ty::User(ty), span };
            var.field.map(|at| step(base, Step::Field(ty, at), var.ty, span))
        };
        let en = bound.en.map(|en| self.condition(en));
        let mut before = Vec::new();
        let mut sound = true;
        for (id, given) in &bound.inputs {
            let Some(var) = info.vars.get(id.0 as usize).filter(|var| var.class == VarClass::Input) else { continue };
            let value = self.expr_of(given, var.ty);
            sound &= value.ty != Ty::Error;
            if let Some(target) = field(var, given.span) {
                before.push(Rc::new(Stmt { kind: StmtKind::Assign { target, value }, span: given.span }));
            }
        }
        // A body that runs finds its own EN and ENO TRUE.
        for (id, var) in (0u32..).map(VarId).zip(&info.vars) {
            let text = self.an.text(var.symbol);
            let given = bound.inputs.iter().any(|(other, _)| *other == id);
            if !given && (is_en(text, var) || is_eno(text, var)) {
                let assign = |target| Rc::new(Stmt { kind: StmtKind::Assign { target, value: truth(span) }, span });
                before.extend(field(var, span).map(assign));
            }
        }
        let (mut inouts, mut arrays) = (Vec::new(), Vec::new());
        for (id, var) in (0u32..).map(VarId).zip(&info.vars).filter(|(_, var)| var.class == VarClass::InOut) {
            let given = bound.inputs.iter().find(|(other, _)| *other == id).map(|(_, value)| *value);
            match self.inout(pou, id, var, given, span) {
                Some(place) => {
                    arrays.extend(self.is_open(var.ty).then_some((id, place.ty)));
                    inouts.push((id, place));
                }
                None => sound = false,
            }
        }
        let after = self.outputs(&bound, &info, |_, var| {
            let base = Place { root: Root::CallInstance, path: Vec::new(), ty: Ty::User(ty), span };
            field(var, span).unwrap_or(base)
        });
        let eno = bound.eno.and_then(|(eno, _)| self.eno(eno));
        let (instance, eno_is_given) = (Some(instance), bound.declares_eno);
        let inputs = Vec::new();
        sound.then_some(Call {
            target: pou,
            instance,
            en,
            eno,
            eno_is_given,
            inputs,
            before,
            inouts,
            after,
            arrays,
            span,
        })
    }
}
