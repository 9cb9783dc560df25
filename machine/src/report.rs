//! Traps in words: where in the source, in which task and instance, with which values.
//!
//! A [`Trap`] holds numbers only, because it is made on the real-time path. The report is made afterwards, out of the debug section; a
//! stripped container's reports name functions by number and instructions by offset.

use std::fmt::{self, Display, Write};

use khz_bytecode::container::{Container, DebugSection, LineEntry};

use crate::engine::Entry;
use crate::json;
use crate::trap::{CodePlace, Trap, TrapCode};

/// A place in a source file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourcePosition {
    /// Name of the file as it was given to the compiler.
    pub file: String,
    /// 1-based.
    pub line: u32,
    /// 1-based, in characters.
    pub column: u32,
}

/// A place in code, described.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DescribedPlace {
    /// Name of the function; `function 7` when there is no debug section.
    pub function: String,
    /// Byte offset of the instruction in the function.
    pub offset: u32,
    /// Where in the source; `None` when there is no debug section.
    pub source: Option<SourcePosition>,
}

impl Display for SourcePosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

impl Display for DescribedPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.source {
            Some(source) => write!(f, "{source} in {}", self.function),
            None => write!(f, "offset {} in {}", self.offset, self.function),
        }
    }
}

/// The line entry that holds for a place: the last at or before it in the same function.
#[must_use]
pub fn line_of(debug: &DebugSection, place: CodePlace) -> Option<&LineEntry> {
    let key = (place.function, place.offset);
    let behind = debug.lines.partition_point(|line| (line.function, line.offset) <= key);
    debug.lines.get(behind.checked_sub(1)?).filter(|line| line.function == place.function)
}

/// Describes a place in code by names and lines, as far as the container has them.
#[must_use]
pub fn describe(place: CodePlace, container: &Container) -> DescribedPlace {
    let debug = container.debug.as_ref();
    let name = debug.and_then(|debug| debug.function_names.get(place.function.index())).filter(|name| !name.is_empty());
    let source = debug.and_then(|debug| {
        let line = line_of(debug, place)?;
        let file = debug.files.get(usize::from(line.file))?.name.clone();
        Some(SourcePosition { file, line: line.line, column: line.column })
    });
    DescribedPlace {
        function: name.cloned().unwrap_or_else(|| format!("function {}", place.function)),
        offset: place.offset,
        source,
    }
}

/// What is said about a trap, to people ([`Display`]) and to programs ([`TrapReport::to_json`]).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TrapReport {
    /// Which trap.
    pub trap: TrapCode,
    /// Name of the task; `task 3` (its identifier) without names; `None` in the init and startup functions.
    pub task: Option<String>,
    /// Name of the program instance; `instance 3` (its identifier) without names; `None` in the init and startup functions.
    pub instance: Option<String>,
    /// The instruction that trapped.
    pub place: DescribedPlace,
    /// The values that explain it, by name.
    pub values: Vec<(&'static str, i64)>,
    /// The calls that led there, innermost first.
    pub chain: Vec<DescribedPlace>,
}

impl TrapReport {
    /// Describes `trap`, which ended a run of `entry`.
    #[must_use]
    pub fn new(trap: &Trap, entry: Entry, container: &Container) -> TrapReport {
        let (task, instance) = match entry {
            Entry::Init | Entry::Startup => (None, None),
            Entry::Instance(position) => owner_names(container, position),
        };
        TrapReport {
            trap: trap.code,
            task,
            instance,
            place: describe(trap.place, container),
            values: trap.code.value_names().iter().copied().zip(trap.values).collect(),
            chain: trap.chain().iter().map(|place| describe(*place, container)).collect(),
        }
    }

    /// One JSON object: `trap`, `task`, `instance`, `function`, `file`, `line`, `column`, `values` (an object by name). What is not known is null; without
    /// a source position `offset` is there too.
    #[must_use]
    pub fn to_json(&self) -> String {
        let mut out = String::from("{\"trap\":");
        json::write_string(&mut out, self.trap.name().chars());
        let source = self.place.source.as_ref();
        let texts = [
            ("task", self.task.as_deref()),
            ("instance", self.instance.as_deref()),
            ("function", Some(self.place.function.as_str())),
            ("file", source.map(|source| source.file.as_str())),
        ];
        for (key, text) in texts {
            json_key(&mut out, key);
            match text {
                Some(text) => json::write_string(&mut out, text.chars()),
                None => out.push_str("null"),
            }
        }
        for (key, number) in [("line", source.map(|s| s.line)), ("column", source.map(|s| s.column))] {
            json_key(&mut out, key);
            out.push_str(&number.map_or("null".to_string(), |number| number.to_string()));
        }
        if source.is_none() {
            json_key(&mut out, "offset");
            out.push_str(&self.place.offset.to_string());
        }
        out.push_str(",\"values\":{");
        for (at, (name, value)) in self.values.iter().enumerate() {
            // Writing to a String does not fail.
            let _ = write!(out, "{}\"{name}\":{value}", if at == 0 { "" } else { "," });
        }
        out.push_str("}}");
        out
    }
}

fn json_key(out: &mut String, key: &str) {
    // Writing to a String does not fail.
    let _ = write!(out, ",\"{key}\":");
}

/// Names of the task and of the program instance at `position` of the task table.
fn owner_names(container: &Container, position: usize) -> (Option<String>, Option<String>) {
    let debug = container.debug.as_ref();
    let Some(instance) = container.tasks.instances.get(position) else { return (None, None) };
    let task = container.tasks.tasks.iter().position(|task| task.id == instance.task);
    let task_name = task.and_then(|task| container.types.task_name(task)).map(str::to_string);
    let instance_name = debug.and_then(|debug| debug.instance_names.get(position).cloned());
    (
        Some(task_name.unwrap_or_else(|| format!("task {}", instance.task))),
        Some(instance_name.unwrap_or_else(|| format!("instance {}", instance.id))),
    )
}

impl Display for TrapReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place.source {
            Some(source) => write!(f, "{source}: trap *{}*: {}", self.trap, self.trap.text())?,
            None => write!(f, "trap *{}*: {}", self.trap, self.trap.text())?,
        }
        for (at, (name, value)) in self.values.iter().enumerate() {
            write!(f, "{}{name} = {value}", if at == 0 { "\n  with " } else { ", " })?;
        }
        write!(f, "\n  at {}", self.place)?;
        if let Some(instance) = &self.instance {
            write!(f, ", program instance {instance}")?;
        }
        match &self.task {
            Some(task) => write!(f, ", task {task}")?,
            None => write!(f, ", before the first task")?,
        }
        for caller in &self.chain {
            write!(f, "\n  called from {caller}")?;
        }
        Ok(())
    }
}
