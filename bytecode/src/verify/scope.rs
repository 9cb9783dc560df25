//! What a function can name: its slots and known places, and the checks of function headers that follow from them.

use super::error::{Check, VerifyError};
use super::rules::Rule;
use super::tasks::image_size;
use super::types::{TypeTable, Wanted};
use crate::container::{Container, ControlPlace, ForLoop, Function, Owner, ProgramType, Type};
use crate::ids::{FunctionId, MethodId, SlotIndex, TypeId};
use crate::limits::{MAX_REFERENCE_LOCALS, MAX_RESULTS};
use crate::value::{BytePlace, LocalType, RefType, SlotPlace, Storage, ValueType};

/// A broken rule whose place the caller adds.
pub(super) type Broken = (Rule, String);

/// One function and what its code may name.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scope<'a, 'c> {
    /// The whole.
    pub(super) container: &'c Container,
    /// Its types.
    pub(super) types: &'a TypeTable<'c>,
    /// The function.
    pub(super) id: FunctionId,
    /// The function.
    pub(super) function: &'c Function,
    /// Its program type, when it has one.
    pub(super) program: Option<&'c ProgramType>,
}

impl<'a, 'c> Scope<'a, 'c> {
    /// Checks the header of a function.
    pub(super) fn new(
        container: &'c Container,
        types: &'a TypeTable<'c>,
        id: FunctionId,
        function: &'c Function,
    ) -> Check<Self> {
        let error = |rule, message: String| Err(VerifyError::header(rule, id, message));
        let program = match function.owner {
            Owner::Program(program) => match container.types.programs.get(program.index()) {
                Some(program) => Some(program),
                None => return error(Rule::FunctionOwner, format!("program type {program} does not exist")),
            },
            Owner::Block(ty) if !matches!(types.get(ty), Some(Type::Block { .. })) => {
                return error(Rule::FunctionOwner, format!("type {ty} is no function block type"));
            }
            Owner::None | Owner::Block(_) => None,
        };
        let (count, parameters) = (function.locals.len(), usize::from(function.parameters));
        if parameters > count || count > usize::from(u16::MAX) {
            return error(Rule::FunctionLocals, format!("{parameters} parameters among {count} locals"));
        }
        if let Some(at) = function.locals.iter().position(|local| !types.local_is_valid(*local)) {
            return error(Rule::FunctionLocals, format!("local {at} refers to a type that does not exist"));
        }
        if function.results.len() > MAX_RESULTS {
            let message = format!("{} results; at most {MAX_RESULTS} are allowed", function.results.len());
            return error(Rule::FunctionLocals, message);
        }
        let references = function.locals.iter().skip(parameters).filter(|l| matches!(l, LocalType::Ref(_))).count();
        if references > MAX_REFERENCE_LOCALS {
            let message = format!("{references} locals are references; at most {MAX_REFERENCE_LOCALS} are allowed");
            return error(Rule::FunctionLocals, message);
        }
        if let Some(frame) = function.frame.filter(|frame| !matches!(types.get(*frame), Some(Type::Struct(_)))) {
            return error(Rule::FunctionFrame, format!("type {frame} is no structure"));
        }
        let scope = Scope { container, types, id, function, program };
        scope.check_for_loops()?;
        Ok(scope)
    }

    fn check_for_loops(&self) -> Check {
        let mut used = std::collections::BTreeSet::new();
        let error = |rule, message: String| Err(VerifyError::header(rule, self.id, message));
        if self.function.for_loops.len() > usize::from(u16::MAX) {
            return error(Rule::ForSlots, "too many FOR descriptors".into());
        }
        for (number, descriptor) in self.function.for_loops.iter().enumerate() {
            let storage = match descriptor.ty.value_type() {
                ValueType::I64 => Storage::I64,
                _ => Storage::I32,
            };
            for (name, slot) in [("bound", descriptor.bound), ("step", descriptor.step)] {
                let fits = self.function.locals.get(slot.index()) == Some(&LocalType::Scalar(storage));
                if !fits || !used.insert(slot) {
                    let message = format!("the {name} of FOR {number} can not be `l` slot {slot}");
                    return error(Rule::ForSlots, message);
                }
            }
            self.check_control(number, descriptor)?;
        }
        let taken = self.function.for_loops.iter().position(|descriptor| {
            matches!(descriptor.control, ControlPlace::Slot(SlotPlace::Local, slot) if used.contains(&slot))
        });
        match taken {
            Some(number) => error(Rule::ForSlots, format!("the control variable of FOR {number} is a bound or step")),
            None => Ok(()),
        }
    }

    fn check_control(&self, number: usize, descriptor: &ForLoop) -> Check {
        let storage = descriptor.ty.storage();
        let result = match descriptor.control {
            ControlPlace::Slot(place, slot) => match self.slot(place, slot) {
                Ok(LocalType::Scalar(found)) if found == storage => Ok(()),
                Ok(_) => Err(format!("{place} {slot} is no {storage}")),
                Err((_, message)) => Err(message),
            },
            ControlPlace::Bytes(place, offset) => self
                .check_bytes(place, offset, Wanted::Scalar(storage), true)
                .map(|_| ())
                .map_err(|(_, message)| message),
        };
        result.map_err(|message| {
            VerifyError::header(Rule::ForControl, self.id, format!("the control variable of FOR {number}: {message}"))
        })
    }

    /// What a slot holds.
    pub(super) fn slot(&self, place: SlotPlace, index: SlotIndex) -> Result<LocalType, Broken> {
        let missing = || (Rule::OperandIndex, format!("there is no slot {place} {index}"));
        match place {
            SlotPlace::Global => {
                let shared = usize::from(self.container.tasks.shared_globals);
                let storage = self.container.types.slots.get(index.index()).filter(|_| index.index() < shared);
                storage.map(|storage| LocalType::Scalar(*storage)).ok_or_else(missing)
            }
            SlotPlace::Program => {
                let program = self.program.ok_or_else(|| (Rule::PlaceOwner, "`p` outside a program".to_string()))?;
                program.slots.get(index.index()).map(|storage| LocalType::Scalar(*storage)).ok_or_else(missing)
            }
            SlotPlace::Local => self.function.locals.get(index.index()).copied().ok_or_else(missing),
        }
    }

    /// Checks an access to `wanted` at a known place. Returns whether it may be written.
    pub(super) fn check_bytes(
        &self,
        place: BytePlace,
        offset: u32,
        wanted: Wanted,
        write: bool,
    ) -> Result<bool, Broken> {
        if let Some(size) = image_size(self.container, place) {
            return self.check_image(place, offset, wanted, write, size);
        }
        let none = |message: &str| (Rule::PlaceOwner, message.to_string());
        let (root, inside, constant) = match place {
            BytePlace::Block => {
                let block = self.program.and_then(|program| program.block);
                (block.ok_or_else(|| none("`b` without a data block"))?, offset, false)
            }
            BytePlace::This => match self.function.owner {
                Owner::Block(ty) => (ty, offset, false),
                Owner::None | Owner::Program(_) => return Err(none("`t` outside a function block")),
            },
            BytePlace::Frame => (self.function.frame.ok_or_else(|| none("`f` without frame bytes"))?, offset, false),
            _ => {
                let variable = self.types.data_variable(offset);
                let variable =
                    variable.ok_or_else(|| (Rule::TypedAccess, format!("no variable lies at d {offset}")))?;
                (variable.ty, offset - variable.offset, variable.constant)
            }
        };
        if !self.types.meets(root, inside, wanted) {
            if self.types.gave_up() {
                return Err((Rule::AnalysisSize, "the lookups in unions are too many".into()));
            }
            return Err((Rule::TypedAccess, format!("{} does not stand at {place} {offset}", describe(wanted))));
        }
        if constant && write {
            return Err((Rule::ConstantWrite, format!("the variable at {place} {offset} is constant")));
        }
        Ok(!constant)
    }

    fn check_image(
        &self,
        place: BytePlace,
        offset: u32,
        wanted: Wanted,
        write: bool,
        size: u32,
    ) -> Result<bool, Broken> {
        let bytes = match wanted {
            Wanted::Scalar(storage) => storage.bytes(),
            Wanted::Type(ty) => self.types.size(ty),
        };
        if u64::from(offset) + u64::from(bytes) > u64::from(size) {
            return Err((Rule::ImageBounds, format!("{bytes} bytes at {place} {offset}, which has {size} bytes")));
        }
        if write && place == BytePlace::Input {
            return Err((Rule::InputWrite, format!("a write to {place} {offset}")));
        }
        Ok(place != BytePlace::Input)
    }

    /// Type of `this` in this function, if it has one.
    pub(super) fn this(function: &Function) -> Option<RefType> {
        match function.owner {
            Owner::Block(target) => Some(RefType { target, write: true, image: false }),
            Owner::None | Owner::Program(_) => None,
        }
    }
}

fn describe(wanted: Wanted) -> String {
    match wanted {
        Wanted::Scalar(storage) => format!("a scalar {storage}"),
        Wanted::Type(ty) => format!("a variable of type {ty}"),
    }
}

/// Checks the methods of function block types against functions and signatures.
pub(super) fn check_methods(container: &Container, types: &TypeTable<'_>) -> Check {
    let mut compared = std::collections::BTreeSet::new();
    for (index, ty) in container.types.types.iter().enumerate() {
        let Type::Block { methods, .. } = ty else { continue };
        let mut last: Option<MethodId> = None;
        for (method, function) in methods {
            let error = |message: String| Err(VerifyError::entry(Rule::BlockMethods, "type", index, message));
            if last.is_some_and(|last| last >= *method) {
                return error(format!("method {method} does not stand in ascending order"));
            }
            last = Some(*method);
            let Some(signature) = container.types.methods.get(method.index()) else {
                return error(format!("method {method} does not exist"));
            };
            let Some(found) = container.functions.get(function.index()) else {
                return error(format!("function {function} of method {method} does not exist"));
            };
            let own = TypeId::from_index(index).unwrap_or_default();
            if !matches!(found.owner, Owner::Block(owner) if types.derives_from(own, owner)) {
                return error(format!("function {function} of method {method} belongs to another type"));
            }
            // A pair may stand in many types; its signature is compared once.
            let is_new = compared.insert((*method, *function));
            if is_new && (found.parameter_types() != signature.parameters || found.results != signature.results) {
                return error(format!(
                    "function {function} does not have the parameters and results of method {method}"
                ));
            }
        }
    }
    Ok(())
}
