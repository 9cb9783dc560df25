//! The assembler: from readable text to a [`Container`]. `docs/assembly.md` has the grammar with examples.
//!
//! Texts by people leave out what follows from the rest: layout, partitions, budgets, the only task. A text whose first line is
//! `exact` (the disassembler's) has nothing added, so that every container, a wrong one too, comes back as it was.
//!
//! Names are for the text only; a number stands wherever a name may. Names of types, arrays, functions, methods, programs,
//! tasks and constants may be used before they are declared.

mod debug;
mod declarations;
mod finish;
mod functions;
mod tokens;

pub(crate) use tokens::{quote, to_hex};

use std::collections::{BTreeMap, BTreeSet};

use crate::container::{Container, ProgramInstance, TaskExtension};
use crate::ids::TypeId;
use crate::value::{LocalType, RefType, Storage, ValueType};
use tokens::{Line, Words};

/// Why a text is no container.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{line}:{column}: {message}")]
pub struct AssemblyError {
    /// 1-based line.
    pub line: usize,
    /// 1-based column in characters.
    pub column: usize,
    /// What is wrong there.
    pub message: String,
}

/// Makes a container of assembly text. The container need not be sound: that is the verifier's business.
///
/// # Errors
/// The first place that is not in the grammar, names nothing, or does not fit.
pub fn assemble(text: &str) -> Result<Container, AssemblyError> {
    let lines = tokens::split(text)?;
    let exact = lines.first().is_some_and(|line| line.keyword() == "exact");
    let mut assembler = Assembler { exact, ..Assembler::default() };
    let body = lines.get(usize::from(exact)..).unwrap_or_default();
    let items = items(body)?;
    assembler.collect_names(&items)?;
    for item in &items {
        match item {
            Item::Line(line) => assembler.declaration(line)?,
            Item::Debug(lines) => assembler.debug(lines)?,
            Item::Function(..) => {}
        }
    }
    for item in &items {
        if let Item::Function(header, lines) = item {
            assembler.function(header, lines)?;
        }
    }
    let last = lines.last().map_or(1, |line| line.number);
    if !exact {
        assembler.finish().map_err(|message| AssemblyError { line: last, column: 1, message })?;
    }
    Ok(assembler.container)
}

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Type,
    Array,
    Function,
    Method,
    Program,
    Task,
    Constant,
    Data,
    Global,
    /// Slot of the program type with this position.
    ProgramSlot(usize),
    /// Slot of the function at work.
    Local,
    For,
    Label,
}

impl Kind {
    fn noun(self) -> &'static str {
        match self {
            Kind::Type => "type",
            Kind::Array => "array",
            Kind::Function => "function",
            Kind::Method => "method",
            Kind::Program => "program",
            Kind::Task => "task",
            Kind::Constant => "constant",
            Kind::Data => "data variable",
            Kind::Global => "global slot",
            Kind::ProgramSlot(_) => "program slot",
            Kind::Local => "local slot",
            Kind::For => "FOR loop",
            Kind::Label => "label",
        }
    }
}

/// An instance line whose partition is not known yet.
#[derive(Debug, Clone, Copy, Default)]
struct PendingInstance {
    instance: ProgramInstance,
    has_slots: bool,
    has_blocks: bool,
}

/// Everything gathered so far.
#[derive(Debug, Default)]
struct Assembler {
    exact: bool,
    container: Container,
    names: BTreeMap<(Kind, String), u32>,
    /// Extent of each type so far: size and alignment, when it is known.
    extents: Vec<Option<(u32, u32)>>,
    globals: Vec<Storage>,
    instances: Vec<PendingInstance>,
    /// Extensions that the task lines ask for.
    extensions: Vec<TaskExtension>,
    /// End of the data variables so far.
    data_end: u32,
    given: BTreeSet<&'static str>,
}

enum Item<'l> {
    Line(&'l Line),
    Function(&'l Line, &'l [Line]),
    Debug(&'l [Line]),
}

/// Groups the lines between `function` or `debug` and `end`.
fn items(lines: &[Line]) -> Result<Vec<Item<'_>>, AssemblyError> {
    let mut items = Vec::new();
    let mut rest = lines;
    while let Some((first, behind)) = rest.split_first() {
        rest = behind;
        let keyword = first.keyword();
        if keyword == "function" || keyword == "debug" {
            let end = behind.iter().position(|line| line.keyword() == "end" && line.tokens.len() == 1);
            let end = end.ok_or_else(|| first.error_at(1, format!("this `{keyword}` has no `end`")))?;
            let body = behind.get(..end).unwrap_or_default();
            rest = behind.get(end + 1..).unwrap_or_default();
            items.push(if keyword == "debug" { Item::Debug(body) } else { Item::Function(first, body) });
        } else {
            items.push(Item::Line(first));
        }
    }
    Ok(items)
}

impl Assembler {
    fn define(&mut self, kind: Kind, name: &str, value: u32, words: &Words<'_>) -> Result<(), AssemblyError> {
        if !name.starts_with(|c: char| c.is_alphabetic() || c == '_') {
            return Err(words.error(format!("a name starts with a letter, not as `{name}`")));
        }
        match self.names.insert((kind, name.to_string()), value) {
            None => Ok(()),
            Some(_) => Err(words.error(format!("the {} `{name}` stands here for the second time", kind.noun()))),
        }
    }

    /// Number of what a word names: a number itself or a name.
    fn resolve(&self, kind: Kind, word: &str) -> Result<u32, String> {
        if let Some(value) = tokens::number(word) {
            return Ok(value);
        }
        let found = self.names.get(&(kind, word.to_string())).copied();
        found.ok_or_else(|| format!("there is no {} `{word}`", kind.noun()))
    }

    /// The next word as an id of this kind.
    fn id<T: TryFrom<u32>>(&self, kind: Kind, words: &mut Words<'_>) -> Result<T, AssemblyError> {
        let word = words.word(kind.noun())?;
        let value = self.resolve(kind, word).map_err(|message| words.error(message))?;
        T::try_from(value).map_err(|_| words.error(format!("`{word}` is too large for a {}", kind.noun())))
    }

    /// First pass: names that may be used before they are declared.
    fn collect_names(&mut self, items: &[Item<'_>]) -> Result<(), AssemblyError> {
        let mut counts: BTreeMap<Kind, u32> = BTreeMap::new();
        for item in items {
            let line = match item {
                Item::Line(line) | Item::Function(line, _) => line,
                Item::Debug(_) => continue,
            };
            let kinds: &[Kind] = match line.keyword() {
                "type" => &[Kind::Type],
                // An array brings a type of its name, so that most texts need no second line.
                "array" if !self.exact => &[Kind::Array, Kind::Type],
                "array" => &[Kind::Array],
                "function" => &[Kind::Function],
                "method" => &[Kind::Method],
                "program" => &[Kind::Program],
                "task" => &[Kind::Task],
                "constant" => &[Kind::Constant],
                _ => &[],
            };
            for kind in kinds {
                let mut words = line.words();
                words.next("keyword")?;
                let name = words.word("name")?;
                let next = counts.entry(*kind).or_default();
                let mut value = *next;
                *next += 1;
                if *kind == Kind::Task {
                    // A task is named by its id, which need not be its position.
                    let id = line.tokens.windows(2).find(|pair| pair.first().is_some_and(|t| t.text == "id"));
                    value = id.and_then(|pair| tokens::number(&pair.last()?.text)).unwrap_or(value);
                }
                self.define(*kind, name, value, &words)?;
            }
        }
        Ok(())
    }

    fn storage(words: &mut Words<'_>) -> Result<Storage, AssemblyError> {
        let word = words.word("storage")?;
        Storage::from_name(word)
            .ok_or_else(|| words.error(format!("`{word}` is no storage (b1 i8 u8 i16 u16 i32 i64 f32 f64)")))
    }

    fn value_type(words: &mut Words<'_>) -> Result<ValueType, AssemblyError> {
        let word = words.word("value type")?;
        ValueType::from_name(word).ok_or_else(|| words.error(format!("`{word}` is no value type (i32 i64 f32 f64)")))
    }

    /// `i32`, or `ref:TYPE` with `.read` and `.image` behind `ref`.
    fn local_type(&self, words: &mut Words<'_>) -> Result<LocalType, AssemblyError> {
        let word = words.word("type of a local")?;
        if let Some(storage) = Storage::from_name(word) {
            return Ok(LocalType::Scalar(storage));
        }
        let (rights, target) = match word.split_once(':') {
            Some(("ref", target)) => ((true, false), target),
            Some(("ref.read", target)) => ((false, false), target),
            Some(("ref.image", target)) => ((true, true), target),
            Some(("ref.read.image", target)) => ((false, true), target),
            _ => return Err(words.error(format!("`{word}` is neither a storage nor ref:TYPE"))),
        };
        let target = self.resolve(Kind::Type, target).map_err(|message| words.error(message))?;
        let target = u16::try_from(target).map_err(|_| words.error("this type's number is too large"))?;
        Ok(LocalType::Ref(RefType { target: TypeId(target), write: rights.0, image: rights.1 }))
    }
}

#[cfg(test)]
mod tests;
