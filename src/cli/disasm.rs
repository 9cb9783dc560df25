//! `khz disasm`: what a program was compiled to, at each stage.

use khz_bytecode::disassembler;
use khz_bytecode::ids::FunctionId;
use khz_jit::{JitOptions, asm_text, clif_text, mir_text};
use kilohertz::pipeline::Program;
use serde_json::json;

use super::args::{DisasmArgs, Format};
use super::output::{Failure, choose, load, result};
use super::{Outcome, Status};

/// Runs it.
pub fn run(args: &DisasmArgs) -> Outcome {
    let program = choose(load(&args.sources)?, args.resource.as_deref())?;
    let text = text(args, &program)?;
    if args.common.format == Format::Json {
        result(&json!({ "resource": program.name, "text": text }).to_string());
    } else {
        result(text.trim_end());
    }
    Ok(Status::Done)
}

fn text(args: &DisasmArgs, program: &Program) -> Result<String, Failure> {
    let layout = program.layout(khz_bytecode::limits::MAX_IMAGE_BYTES).map_err(Failure::refused)?;
    let mut out = String::new();
    for id in (0..program.container().functions.len()).filter_map(FunctionId::from_index) {
        let options = JitOptions::default();
        let listing = if args.mir {
            mir_text(&program.verified, &layout, options, id)
        } else if args.clif {
            clif_text(&program.verified, &layout, options, id).map_err(Failure::refused)?
        } else if args.asm {
            asm_text(&program.verified, &layout, options, id).map_err(Failure::refused)?
        } else {
            disassembler::disassemble_function(program.container(), id).unwrap_or_default()
        };
        let name = program.container().debug.as_ref().and_then(|debug| debug.function_names.get(id.index()));
        if let Some(name) = name.filter(|name| !name.is_empty()) {
            out += &format!("; {name}\n");
        }
        out += listing.trim_end();
        out += "\n\n";
    }
    Ok(out)
}
