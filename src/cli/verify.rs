//! `khz verify`: what was proved of a container, and the memory budget.

use khz_bytecode::limits::MAX_IMAGE_BYTES;
use kilohertz::pipeline::Program;
use serde_json::json;

use super::args::{Format, VerifyArgs};
use super::output::{Failure, load, people, result};
use super::{Outcome, Status};

/// Runs it.
pub fn run(args: &VerifyArgs) -> Outcome {
    let loaded = load(&args.sources)?;
    for program in &loaded.programs {
        print(program, args.common.format)?;
    }
    Ok(Status::Done)
}

fn print(program: &Program, format: Format) -> Result<(), Failure> {
    let facts = program.verified.facts();
    let layout = program.layout(MAX_IMAGE_BYTES).map_err(Failure::refused)?;
    let loops = || facts.functions.iter().flat_map(|f| &f.loops);
    let instructions: usize = facts.functions.iter().map(|f| f.instructions.len()).sum();
    let frames = layout.frames.iter().map(std::iter::ExactSizeIterator::len).sum::<usize>();
    let proven = loops().filter(|l| l.control_is_proven).count();
    let for_loops = loops().filter(|l| l.for_loop.is_some()).count();
    let tasks = &program.container().tasks;
    if format == Format::Json {
        let value = json!({
            "resource": program.name, "functions": facts.functions.len(), "instructions": instructions, "loops": loops().count(),
            "for_loops": for_loops, "for_loops_proven": proven, "tasks": tasks.tasks.len(), "instances": tasks.instances.len(),
            "image_bytes": { "slots": layout.slots.len(), "data": layout.data.len(), "frames": frames, "memory": layout.memory.len(),
                "output": layout.output.len(), "input": layout.input.len(), "total": layout.total_bytes() },
        });
        result(&value.to_string());
        return Ok(());
    }
    people(&format!("RESOURCE {}: verified", program.name));
    people(&format!(
        "  {} functions, {instructions} instructions; every operand typed on every path, no instruction unreachable",
        facts.functions.len()
    ));
    people(&format!(
        "  {} loops, all reducible; {for_loops} of them FOR loops, {proven} with a proven control variable",
        loops().count()
    ));
    people(&format!("  {} tasks, {} program instances", tasks.tasks.len(), tasks.instances.len()));
    people(&format!(
        "  memory image {} bytes: slots {}, data {}, frames {frames}, %M {}, %Q {}, %I {}",
        layout.total_bytes(),
        layout.slots.len(),
        layout.data.len(),
        layout.memory.len(),
        layout.output.len(),
        layout.input.len()
    ));
    Ok(())
}
