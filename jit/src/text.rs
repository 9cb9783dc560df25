//! What `khz disasm` prints of the steps to machine code: the mid-level form and CLIF of a function, each with the source lines it comes from.
//! ([`crate::listing`] has the machine code.)

use std::fmt::Write;

use cranelift_codegen::ir::SourceLoc;
use cranelift_frontend::FunctionBuilderContext;
use khz_bytecode::container::DebugSection;
use khz_bytecode::ids::FunctionId;
use khz_bytecode::verify::Verified;
use khz_machine::image::ImageLayout;
use khz_machine::trap::CodePlace;

use crate::build::{ProgramMemory, build};
use crate::code::{Key, Use, host_isa};
use crate::lower::{Settings, lower};
use crate::passes::Improver;
use crate::plan::{self, Plan};
use crate::run::{assembly, settings_for};
use crate::symbols::{self, place_of};
use crate::{JitError, JitOptions, mir};

/// The source line of a place, as `file:line`.
fn source_line(debug: Option<&DebugSection>, place: CodePlace) -> Option<String> {
    symbols::source_line(debug, place).map(|(file, line)| format!("{file}:{line}"))
}

/// A function as it is compiled: for the first program instance that reaches it.
fn key_of(plan: &Plan, function: FunctionId) -> Key {
    let mut keys = plan.functions.keys();
    keys.find(|key| key.0 == function).copied().unwrap_or((function, ProgramMemory::None))
}

/// A function in the mid-level form, after the passes.
///
/// A function that no entry reaches is shown as if it had no program's memory; such a function of a program has none to show and gives nothing.
#[must_use]
pub fn mir_text(verified: &Verified, layout: &ImageLayout, options: JitOptions, function: FunctionId) -> String {
    let scope = plan::scope(verified, layout);
    let Some((_, forms)) = forms_of(&scope, &Plan::new(&scope), options, function) else { return String::new() };
    let debug = verified.container().debug.as_ref();
    let text = |form: &mir::Function| {
        form.text(&|place| {
            let data = form.places[place.index()];
            source_line(debug, CodePlace { function: data.function, offset: data.offset })
        })
    };
    titled(forms.iter().map(text))
}

/// Listings of a function's parts and of what is left of it.
fn titled(listings: impl ExactSizeIterator<Item = String>) -> String {
    let last = listings.len().saturating_sub(1);
    let mut out = String::new();
    for (number, listing) in listings.enumerate() {
        if number < last {
            let _ = writeln!(out, "; part {number}");
        } else if last > 0 {
            let _ = writeln!(out, "; what calls the parts");
        }
        out.push_str(&listing);
    }
    out
}

/// A function as it is compiled: its parts, then what is left of it.
fn forms_of(
    scope: &crate::build::Scope<'_>,
    plan: &Plan,
    options: JitOptions,
    function: FunctionId,
) -> Option<(Key, Vec<mir::Function>)> {
    let key = key_of(plan, function);
    let owner = scope.verified.container().functions.get(function.index())?.owner;
    if matches!(owner, khz_bytecode::container::Owner::Program(_)) && key.1 == ProgramMemory::None {
        return None;
    }
    let mut form = build(scope, key.0, key.1);
    let mut forms = Improver::new(scope, options, plan.calls_virtual).run(&mut form, key.1);
    forms.push(form);
    Some((key, forms))
}

/// A function as CLIF, as it is handed to Cranelift.
///
/// # Errors
/// A host without native code.
pub fn clif_text(
    verified: &Verified,
    layout: &ImageLayout,
    options: JitOptions,
    function: FunctionId,
) -> Result<String, JitError> {
    let scope = plan::scope(verified, layout);
    let plan = Plan::new(&scope);
    let isa = host_isa(options.verify_ir, Use::Run)?;
    let settings = Settings { source_lines: true, ..settings_for(&isa, &plan, options) };
    let mut module = assembly(&scope, &plan, isa, options)?;
    let mut compilation = module.compilation();
    let Some((key, forms)) = forms_of(&scope, &plan, options, function) else { return Ok(String::new()) };
    let mut builder_context = FunctionBuilderContext::new();
    let debug = verified.container().debug.as_ref();
    let mut listings = Vec::new();
    for form in &forms {
        module.start_form();
        lower(&scope, form, key.1, settings, &mut module, &mut compilation.func, &mut builder_context);
        let line = |location: SourceLoc| source_line(debug, place_of(form, location)?);
        listings.push(with_lines(&compilation.func.display().to_string(), &line));
        compilation.clear();
    }
    Ok(titled(listings.into_iter()))
}

/// CLIF marks lines with `@` and the place in hexadecimal; each change of the source line gets a line of its own.
fn with_lines(clif: &str, line: &dyn Fn(SourceLoc) -> Option<String>) -> String {
    let mut out = String::new();
    let mut last = None;
    for text in clif.lines() {
        let mark = text.trim_start().strip_prefix('@').and_then(|rest| rest.split_whitespace().next());
        let source = mark.and_then(|mark| u32::from_str_radix(mark, 16).ok()).and_then(|at| line(SourceLoc::new(at)));
        if source.is_some() && source != last {
            let _ = writeln!(out, "; {}", source.as_deref().unwrap_or_default());
            last = source;
        }
        let _ = writeln!(out, "{text}");
    }
    out
}
