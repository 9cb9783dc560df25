//! Units with parameters of type `ARRAY[*]`: one function for each combination of arrays that stand for them.
//!
//! A call names the arrays; the first call of a combination gives it the next number, and the functions are made behind those of
//! all other units. While one is made, [`Builder::actual`] says what an open type is.

use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;

use khz_bytecode::ids::FunctionId;

use super::Builder;
use crate::analysis::tree::{Call, PouId, PouInfo, VarId};
use crate::analysis::types::{Ty, TyId, TyKind};

/// Most functions that one resource may have beside one for each unit: calls of calls multiply them.
const MAX_INSTANCES: usize = 4096;

/// Most bytes of code in them.
const MAX_INSTANCE_CODE_BYTES: usize = 1 << 24;

/// The arrays that stand for a unit's open ones, in the order of its parameters.
type Arrays = Vec<(VarId, Ty)>;

/// The functions of units with open arrays.
#[derive(Debug, Default)]
pub(super) struct Instances {
    known: BTreeMap<(PouId, Arrays), FunctionId>,
    /// Called, and not made yet.
    waiting: VecDeque<(PouId, Arrays)>,
    /// In the function that is made now: what its open types are.
    actual: BTreeMap<TyId, Ty>,
}

/// Whether a unit has a parameter whose bounds come with the argument.
pub(super) fn has_open(builder: &Builder<'_>, info: &PouInfo) -> bool {
    info.vars.iter().any(|var| matches!(builder.project.types.kind(var.ty), Some(TyKind::Open { .. })))
}

impl Builder<'_> {
    /// The array that stands for an open one; any other type is itself.
    pub(super) fn actual(&self, ty: Ty) -> Ty {
        match ty {
            Ty::User(id) => self.open.actual.get(&id).copied().unwrap_or(ty),
            _ => ty,
        }
    }

    fn arrays(&self, call: &Call) -> Arrays {
        call.arrays.iter().map(|(id, ty)| (*id, self.actual(*ty))).collect()
    }

    /// The function that a call calls.
    pub(super) fn called(&mut self, call: &Call) -> FunctionId {
        if call.arrays.is_empty() {
            return self.function_id(call.target);
        }
        let key = (call.target, self.arrays(call));
        if let Some(&id) = self.open.known.get(&key) {
            return id;
        }
        let number = self.function_ids.len() + self.open.known.len();
        let id = FunctionId(self.id16(number, "functions"));
        self.open.waiting.push_back(key.clone());
        self.open.known.insert(key, id);
        id
    }

    /// What a call calls, with the arrays in place of open ones.
    pub(super) fn called_info(&self, call: &Call) -> Option<Rc<PouInfo>> {
        let info = self.info(call.target)?;
        Some(if call.arrays.is_empty() { info } else { Rc::new(with_arrays(&info, &self.arrays(call))) })
    }

    /// Makes the functions that calls asked for, and those that these ask for.
    pub(super) fn lower_instances(&mut self) {
        let plan = self.plan;
        let mut code_bytes = 0usize;
        while let Some((pou, arrays)) = self.open.waiting.pop_front() {
            let body = plan.bodies.binary_search_by_key(&pou, |(id, _)| *id).ok().and_then(|at| plan.bodies.get(at));
            let (Some((_, body)), Some(info)) = (body, self.info(pou)) else { continue };
            let made = with_arrays(&info, &arrays);
            let types = info.vars.iter().zip(&made.vars).filter(|(open, array)| open.ty != array.ty);
            self.open.actual = types
                .filter_map(|(open, array)| match open.ty {
                    Ty::User(id) => Some((id, array.ty)),
                    _ => None,
                })
                .collect();
            let (function, marks, cost) = self.lower_unit(pou, &made, &body.statements);
            self.open.actual.clear();
            code_bytes += function.code.len();
            self.add_function(info.name.clone(), function, marks, cost);
            if self.open.known.len() > MAX_INSTANCES || code_bytes > MAX_INSTANCE_CODE_BYTES {
                self.fail("different arrays for ARRAY[*] parameters");
                return;
            }
        }
    }
}

fn with_arrays(info: &PouInfo, arrays: &Arrays) -> PouInfo {
    let mut made = info.clone();
    for (VarId(id), ty) in arrays {
        if let Some(var) = made.vars.get_mut(*id as usize) {
            var.ty = *ty;
        }
    }
    made
}
