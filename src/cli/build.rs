//! `khz build`: compile to containers.

use std::path::{Path, PathBuf};

use khz_bytecode::container;
use kilohertz::files::{self, Input, Sources};
use kilohertz::pipeline;
use kilohertz::project::Settings;
use serde_json::json;

use super::args::{BuildArgs, Format};
use super::output::{Failure, dialect, people, print_diagnostics, result, write_file};
use super::{Outcome, Status};

/// Runs it.
pub fn run(args: &BuildArgs) -> Outcome {
    let input = files::read(&args.sources.files)?;
    let output = output_of(args, &input)?;
    let loaded = pipeline::load(input, dialect(&args.sources))?;
    let several = loaded.programs.len() > 1;
    let mut written = Vec::new();
    for program in &loaded.programs {
        let mut container = program.container().clone();
        if args.strip {
            container::strip(&mut container);
        }
        let bytes = container::write(&container).map_err(Failure::refused)?;
        let path = if several { path_for(&output, &program.name) } else { output.clone() };
        write_file(&path, &bytes)?;
        written.push((program.name.clone(), path, bytes.len()));
    }
    if written.is_empty() {
        return Err(Failure::refused("there is no PROGRAM in these files, so there is nothing to build"));
    }
    if args.common.format == Format::Json {
        let rows: Vec<_> = written
            .iter()
            .map(|(name, path, bytes)| json!({ "resource": name, "path": path, "bytes": bytes }))
            .collect();
        result(&json!(rows).to_string());
    } else {
        print_diagnostics(&loaded.diagnostics, &loaded.sources, Format::Human);
        for (name, path, bytes) in &written {
            people(&format!("{}: RESOURCE {name}, {bytes} bytes", path.display()));
        }
    }
    Ok(Status::Done)
}

/// Where the container goes: as asked for, else in the current folder by the project's name.
fn output_of(args: &BuildArgs, input: &Input) -> Result<PathBuf, Failure> {
    if let Some(output) = &args.output {
        return Ok(output.clone());
    }
    match input {
        Input::Sources(Sources { settings: Settings { name: Some(name), .. }, .. }) => {
            Ok(PathBuf::from(format!("{name}.iplc")))
        }
        _ => Err(Failure::usage("where shall the container go? -o OUT.iplc is needed where there is no project")),
    }
}

/// `OUT.<resource>.iplc` for `OUT.iplc`.
fn path_for(output: &Path, resource: &str) -> PathBuf {
    let ending = output.extension().map_or_else(|| "iplc".to_string(), |e| e.to_string_lossy().into_owned());
    output.with_extension(format!("{resource}.{ending}"))
}
