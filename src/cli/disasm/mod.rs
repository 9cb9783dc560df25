//! `khz disasm`: what a program was compiled to, at each stage.

mod hot;
mod machine_code;

use khz_bytecode::disassembler;
use khz_bytecode::ids::FunctionId;
use khz_frontend::source::SourceMap;
use khz_jit::{JitOptions, clif_text, listing, mir_text};
use kilohertz::pipeline::Program;
use serde_json::json;

use super::args::{DisasmArgs, Format};
use super::output::{Failure, choose, load, result};
use super::{Outcome, Status};

/// Runs it.
pub fn run(args: &DisasmArgs) -> Outcome {
    let mut loaded = load(&args.sources)?;
    let sources = std::mem::take(&mut loaded.sources);
    let program = choose(loaded, args.resource.resource.as_deref())?;
    if args.hot {
        return hot::run(args, program, &sources);
    }
    let text = text(args, &program, &sources)?;
    if args.common.format == Format::Json {
        result(&json!({ "resource": program.name, "text": text }).to_string());
    } else {
        result(text.trim_end());
    }
    Ok(Status::Done)
}

fn text(args: &DisasmArgs, program: &Program, sources: &SourceMap) -> Result<String, Failure> {
    let layout = program.layout(args.resource.max_image).map_err(Failure::refused)?;
    let options = JitOptions::default();
    if args.asm {
        let units = listing::listing(&program.verified, &layout, options, None).map_err(Failure::refused)?;
        return Ok(machine_code::text(&units, sources, None));
    }
    let mut out = String::new();
    for id in (0..program.container().functions.len()).filter_map(FunctionId::from_index) {
        let listing = if args.mir {
            mir_text(&program.verified, &layout, options, id)
        } else if args.clif {
            clif_text(&program.verified, &layout, options, id).map_err(Failure::refused)?
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
