//! The verifier: the only door to the engines.
//!
//! [`verify`] takes a container as a file or a front end made it and either names the first rule it breaks ([`VerifyError`]) or hands
//! it back as [`Verified`], with everything that was found out on the way ([`Facts`]). After that no engine checks again what is proved here.
//!
//! What is proved, in this order (each step relies on those before it; the rules are the rows of [`rules`]):
//!
//! 1. `types`: types refer backward, nest within a limit, have the size and the layout they claim; arrays have bounds; a
//!    function block instance has an address of its own.
//! 2. `memory`: the header stays within the limits and the image within its budget; constants have one NaN; variables of the data
//!    region are apart.
//! 3. `scope`: headers of functions: owners, locals, frames, FOR descriptors, methods of block types.
//! 4. `tasks`: identifiers, entries, partitions, SINGLE sources, system variables; then the function block instance table lists exactly the
//!    instances there are, and initial and retained values lie where they may (`memory` again).
//! 5. `flow`, for each function: whole instructions, jump targets, no unreachable code, no way past the end, reducible loops, FOR pairs.
//! 6. `typing`, for each function: places and operands exist and have the right types, the stack has one shape at each place, references
//!    are assigned before use, images and constants are respected.
//! 7. `calls`: no cycle of direct calls, call depth and frames within the header's numbers, effects with those of callees.
//! 8. `for_proof` and fuel: which FOR loops keep their control variable; what entry and each pass of a loop cost.
//!
//! So a verified container never makes an engine reach outside its memory image: every access is at a proven place, or through a reference whose whole
//! target lies inside; what stays open until run time (index, NULL, division, range, depth, time) is an explicit check that traps.
//!
//! Everything is linear in the size of the container, or n log n; recursion goes only along the nesting of types, which is limited; what
//! could grow faster is limited by a rule ([`Rule::AnalysisSize`], [`Rule::LoopDepth`], [`Rule::UnionWidth`]).

pub mod facts;
pub mod rules;

mod calls;
mod document;
mod error;
mod examples;
mod flow;
mod for_proof;
mod memory;
mod scope;
mod tasks;
mod touch;
mod types;
mod typing;

pub use document::rules_document;
pub use error::{TableEntry, VerifyError};
pub use facts::*;
pub use rules::{Rule, RuleGroup};

use crate::container::{BlockInstance, Container, TypeSection};
use crate::ids::{FunctionId, TypeId};
use crate::instruction::Instruction;
use error::Check;
use scope::Scope;
use types::TypeTable;
use typing::Draft;

/// Checks every rule.
///
/// # Errors
/// The first rule that the container breaks, with the place.
pub fn verify(container: Container) -> Result<Verified, VerifyError> {
    let facts = examine(&container)?;
    Ok(Verified::new(container, facts))
}

/// The rows of the function block instance table for one variable: what the verifier expects there and a front end has to write.
///
/// One row for a single instance, one for an array of instances or of structures that hold them (stride and count of the outermost array);
/// arrays inside such an array are listed element by element. The rows of instances inside an instance follow it.
///
/// # Errors
/// The types break a rule.
pub fn block_rows(types: &TypeSection, ty: TypeId, offset: u32) -> Result<Vec<BlockInstance>, VerifyError> {
    let table = TypeTable::new(types)?;
    let mut rows = Vec::new();
    table.block_rows(ty, offset, crate::limits::MAX_BLOCK_INSTANCES, &mut rows);
    Ok(rows)
}

fn examine(container: &Container) -> Check<Facts> {
    let types = TypeTable::new(&container.types)?;
    let image_bytes = memory::check_header(container)?;
    memory::check_constants(container)?;
    memory::check_variables(container, &types)?;
    let scopes = (container.functions.iter().enumerate())
        .map(|(index, function)| Scope::new(container, &types, function_id(index), function))
        .collect::<Check<Vec<_>>>()?;
    scope::check_methods(container, &types)?;
    let instance_programs = tasks::check_tasks(container, &types)?;
    let instance_blocks = memory::check_instances(container, &types)?;
    memory::check_init(container, &types)?;
    memory::check_retain(container)?;

    let mut entries = 0;
    let mut functions = Vec::with_capacity(scopes.len());
    let mut drafts = Vec::with_capacity(scopes.len());
    for scope in &scopes {
        let (facts, draft) = examine_code(scope, &mut entries)?;
        functions.push(facts);
        drafts.push(draft);
    }
    let frame_size = |function: &crate::container::Function| function.frame.map_or(0, |frame| types.size(frame));
    calls::close(container, &drafts, frame_size, &mut functions)?;
    prove_for_loops(&scopes, &drafts, &mut functions);
    let foreign_floats =
        drafts.iter().any(|draft| draft.foreign_floats) || types.union_with_float() || types.base_ends_in_float();
    Ok(Facts {
        functions,
        type_extents: types.into_extents(),
        instance_programs,
        instance_blocks,
        foreign_floats,
        image_bytes,
    })
}

fn function_id(index: usize) -> FunctionId {
    // `check_header` held the number of functions below 65,536.
    FunctionId(index as u16)
}

/// Steps 5 and 6, and the fuel, for one function.
fn examine_code(scope: &Scope<'_, '_>, entries: &mut usize) -> Check<(FunctionFacts, Draft)> {
    let instructions = flow::decode(scope.id, &scope.function.code)?;
    let flow = flow::Flow::new(scope.id, &instructions, scope.function.for_loops.len())?;
    let (mut blocks, mut loops) = (flow.blocks, flow.loops);
    let draft = typing::type_function(scope, &instructions, &mut blocks, entries)?;
    let mut entry_fuel: u32 = 0;
    for block in &blocks {
        let cost = |placed: &PlacedInstruction| match placed.instruction {
            Instruction::Copy { target } => placed.instruction.cost(scope.types.size(target)),
            _ => placed.instruction.cost(0),
        };
        let cost = instructions[block.start..block.end].iter().map(cost).fold(0, u32::saturating_add);
        let charged = match block.innermost_loop {
            Some(id) => &mut loops[id.index()].fuel,
            None => &mut entry_fuel,
        };
        *charged = charged.saturating_add(cost);
    }
    Ok((FunctionFacts { instructions, blocks, loops, entry_fuel, ..FunctionFacts::default() }, draft))
}

fn prove_for_loops(scopes: &[Scope<'_, '_>], drafts: &[Draft], functions: &mut [FunctionFacts]) {
    // Steps left for what is nice to know: when a hostile file uses them up, the rest counts as not proven.
    let mut steps = crate::limits::MAX_ANALYSIS_ENTRIES;
    for (index, (scope, draft)) in scopes.iter().zip(drafts).enumerate() {
        for number in 0..functions[index].loops.len() {
            let own = &functions[index];
            let Some(id) = own.loops[number].for_loop else { continue };
            let proven = for_proof::control_is_proven(scope, own, number, id, draft, functions, &mut steps);
            functions[index].loops[number].control_is_proven = proven;
        }
    }
}
