//! From the typed tree to containers: one for each RESOURCE.
//!
//! [`memory`] decides where every variable lives; [`layout`] makes the container's types and initial values; [`unit`] makes one function of
//! each program organisation unit, with [`body`], [`expr`], [`place`], [`call`], [`text`] for its parts and [`emit`] for labels and
//! reachability; [`resource`] puts tasks, instances and names around it. Everything is in the order of declarations, so that the same source gives
//! the same bytes.
//!
//! A limit of the container that a program exceeds is noted once and becomes a diagnostic at the end.

mod body;
mod call;
mod case;
mod codes;
mod emit;
mod expr;
mod layout;
mod memory;
mod open;
mod place;
mod resource;
mod text;
mod unit;

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use khz_bytecode::container::{Constant, Container, DataVariable, Function, Hash, TypeSection};
use khz_bytecode::ids::{ArrayId, ConstantId, FunctionId, ProgramId, SlotIndex, TypeId};
use khz_bytecode::value::{SlotPlace, Storage};
use sha2::{Digest, Sha256};

use self::place::Home;
use crate::analysis::tree::{GlobalId, Place, PouId, PouInfo, Project, ResourcePlan, Root, VarId};
use crate::analysis::types::{Const, Ty, TyId, Value};
use crate::compile::SourceInput;
use crate::diagnostics::{Diagnostic, semantic as rules};
use crate::source::{FileId, SourceMap, Span};
use crate::syntax::symbol::Interner;

/// Hashes of the sources.
#[derive(Debug)]
pub(crate) struct Hashes {
    /// Over all files of the user, in order.
    pub(crate) all: Hash,
    /// Of each file of the map.
    pub(crate) files: Vec<Hash>,
}

impl Hashes {
    /// Of the user's files as they are on disk, and of the standard file's text.
    pub(crate) fn of(inputs: &[SourceInput], sources: &SourceMap) -> Self {
        let mut all = Sha256::new();
        let mut files = Vec::new();
        for input in inputs {
            all.update(&input.bytes);
            files.push(Sha256::digest(&input.bytes).into());
        }
        for (_, file) in sources.files().skip(inputs.len()) {
            files.push(Sha256::digest(file.text().as_bytes()).into());
        }
        Hashes { all: all.finalize().into(), files }
    }
}

/// What a function costs its callers.
#[derive(Debug, Clone, Default)]
struct FunctionCost {
    stack: u32,
    frame_bytes: u32,
    callees: Vec<FunctionId>,
}

/// A container in the making.
struct Builder<'p> {
    project: &'p Project,
    plan: &'p ResourcePlan,
    infos: BTreeMap<PouId, Rc<PouInfo>>,
    section: TypeSection,
    scalars: BTreeMap<Storage, TypeId>,
    types: BTreeMap<Ty, TypeId>,
    arrays: BTreeMap<TyId, ArrayId>,
    constants: Vec<Constant>,
    pool: BTreeMap<(u8, u64), ConstantId>,
    longest_string: u16,
    functions: Vec<Function>,
    function_ids: BTreeMap<PouId, FunctionId>,
    open: open::Instances,
    function_names: Vec<String>,
    marks: Vec<(FunctionId, Vec<(u32, Span)>)>,
    costs: Vec<FunctionCost>,
    programs: BTreeMap<PouId, ProgramId>,
    global_homes: BTreeMap<GlobalId, Home>,
    unit_homes: BTreeMap<PouId, Vec<Home>>,
    system: [Option<SlotIndex>; 2],
    image_parameters: BTreeSet<(PouId, VarId)>,
    data_end: u64,
    literals: BTreeMap<(Ty, Vec<u8>), u32>,
    /// Arrays that stand for the characters of strings.
    characters: BTreeMap<Ty, ArrayId>,
    constants_in_data: Vec<(Ty, Value, u32)>,
    spilled: BTreeSet<(Option<PouId>, u32)>,
    failure: Option<String>,
}

/// Makes the container of one resource.
pub(crate) fn lower(
    project: &Project,
    plan: &ResourcePlan,
    names: &Interner,
    sources: &SourceMap,
    hashes: &Hashes,
    strip: bool,
) -> Result<Container, Box<Diagnostic>> {
    let mut builder = Builder::new(project, plan);
    builder.plan_memory(names);
    builder.lower_units();
    let mut container = builder.finish(sources, hashes);
    if strip {
        container.debug = None;
    }
    match builder.failure {
        None => Ok(container),
        Some(what) => {
            let span = plan.instances.first().map_or(Span::new(FileId(0), 0, 0), |instance| instance.span);
            Err(Box::new(Diagnostic::new(
                &rules::LIMIT,
                span,
                format!("the resource `{}` has too many {what}", plan.name),
            )))
        }
    }
}

impl<'p> Builder<'p> {
    fn new(project: &'p Project, plan: &'p ResourcePlan) -> Self {
        let mut image_parameters = plan.usage.image_parameters.clone();
        // What is handed on points where it came from: followed until nothing new is found.
        let mut onward: BTreeMap<(PouId, VarId), Vec<(PouId, VarId)>> = BTreeMap::new();
        for (to, from) in &plan.usage.parameter_edges {
            onward.entry(*from).or_default().push(*to);
        }
        let mut waiting: Vec<(PouId, VarId)> = image_parameters.iter().copied().collect();
        while let Some(found) = waiting.pop() {
            for next in onward.get(&found).into_iter().flatten() {
                if image_parameters.insert(*next) {
                    waiting.push(*next);
                }
            }
        }
        let infos = (0u32..).map(PouId).zip(project.pous.iter().cloned()).collect();
        Builder {
            project,
            plan,
            infos,
            section: TypeSection::default(),
            scalars: BTreeMap::new(),
            types: BTreeMap::new(),
            arrays: BTreeMap::new(),
            constants: Vec::new(),
            pool: BTreeMap::new(),
            longest_string: 0,
            functions: Vec::new(),
            function_ids: BTreeMap::new(),
            open: open::Instances::default(),
            function_names: Vec::new(),
            marks: Vec::new(),
            costs: Vec::new(),
            programs: BTreeMap::new(),
            global_homes: BTreeMap::new(),
            unit_homes: BTreeMap::new(),
            system: [None; 2],
            image_parameters,
            data_end: u64::from(khz_bytecode::limits::NULL_GUARD_BYTES),
            literals: BTreeMap::new(),
            characters: BTreeMap::new(),
            constants_in_data: Vec::new(),
            spilled: BTreeSet::new(),
            failure: None,
        }
    }

    /// Notes that there is too much of something.
    fn fail(&mut self, what: &str) {
        self.failure.get_or_insert_with(|| what.to_owned());
    }

    /// A number of 16 bits; more than fit is noted.
    fn id16(&mut self, number: usize, what: &str) -> u16 {
        match u16::try_from(number) {
            Ok(number) if number < u16::MAX => number,
            _ => {
                self.fail(what);
                0
            }
        }
    }

    fn info(&self, pou: PouId) -> Option<Rc<PouInfo>> {
        self.infos.get(&pou).cloned()
    }

    fn function_id(&self, pou: PouId) -> FunctionId {
        self.function_ids.get(&pou).copied().unwrap_or_default()
    }

    fn system_home(&self, long: bool) -> Home {
        self.system[usize::from(long)].map_or(Home::None, |slot| Home::Slot(SlotPlace::Global, slot))
    }

    /// Whether a reference to a place may point into the process image.
    fn may_be_image(&self, unit: Option<PouId>, place: &Place) -> bool {
        match place.root {
            Root::Direct(_) => true,
            Root::Global(global) => {
                self.project.globals.get(global.0 as usize).is_some_and(|global| global.located.is_some())
            }
            Root::Var(var) => {
                let Some(unit) = unit else { return false };
                let located =
                    self.infos.get(&unit).and_then(|info| info.vars.get(var.0 as usize)).and_then(|var| var.located);
                located.is_some() || self.image_parameters.contains(&(unit, var))
            }
            _ => false,
        }
    }

    /// Room in the data region.
    fn data_room(&mut self, ty: TypeId, size: u32, align: u32, constant: bool) -> u32 {
        let offset = self.data_end.next_multiple_of(u64::from(align.max(1)));
        self.data_end = offset + u64::from(size);
        let Ok(offset) = u32::try_from(offset) else {
            self.fail("bytes of variables");
            return 0;
        };
        if self.data_end > khz_bytecode::limits::MAX_IMAGE_BYTES {
            self.fail("bytes of variables");
        }
        self.section.data.push(DataVariable { offset, ty, constant });
        offset
    }

    /// The constant variable of a string literal.
    fn literal(&mut self, text: &Const, ty: Ty) -> u32 {
        let (size, align) = self.project.types.extent(ty);
        let key = (ty, crate::analysis::scalar_bytes(text, size));
        if let Some(&offset) = self.literals.get(&key) {
            return offset;
        }
        let id = self.type_id(ty);
        let offset = self.data_room(id, size, align, true);
        self.literals.insert(key, offset);
        self.constants_in_data.push((ty, Value::Scalar(text.clone()), offset));
        offset
    }

    /// A constant variable with a value: what fresh variables are copied from.
    fn template(&mut self, ty: Ty, value: &Value) -> u32 {
        let known = self.constants_in_data.iter().find(|(other, known, _)| *other == ty && known == value);
        if let Some((_, _, offset)) = known {
            return *offset;
        }
        let (size, align) = self.project.types.extent(ty);
        let id = self.type_id(ty);
        let offset = self.data_room(id, size, align, true);
        self.constants_in_data.push((ty, value.clone(), offset));
        offset
    }
}
