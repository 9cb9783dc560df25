//! `khz disasm`: what a program was compiled to, at each stage.

use khz_bytecode::disassembler;
use khz_bytecode::ids::FunctionId;
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
    let listing = |form| khz_jit::listing(&program.verified, &layout, form).map_err(Failure::refused);
    if args.mir {
        return listing(khz_jit::Form::Mir);
    }
    if args.clif {
        return listing(khz_jit::Form::Clif);
    }
    if args.asm {
        return listing(khz_jit::Form::Asm);
    }
    let ids = (0..program.container().functions.len()).filter_map(FunctionId::from_index);
    Ok(ids.filter_map(|id| disassembler::disassemble_function(program.container(), id)).collect::<Vec<_>>().join("\n"))
}
