//! Filetests of the verifier: `tests/verifier/*.khza`, assembly text (`docs/assembly.md`).
//!
//! A line with the comment `; error V0123` is where the verifier must find that rule broken; a file without one must be accepted.

use std::collections::BTreeSet;
use std::path::PathBuf;

use khz_bytecode::assembler::assemble;
use khz_bytecode::container::{Container, Function};
use khz_bytecode::instruction::{Instruction, Reader};
use khz_bytecode::verify::{Rule, VerifyError, verify};

/// Rules whose breach takes more text than a file should have; `tests/verifier_limits.rs` breaks them.
const BROKEN_ELSEWHERE: &[Rule] = &[Rule::AnalysisSize];

struct File {
    name: String,
    text: String,
    /// Line (from 0) and rule of the mark.
    expected: Option<(usize, Rule)>,
}

fn files() -> Vec<File> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/verifier");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let files = paths.iter().filter(|path| path.extension().is_some_and(|extension| extension == "khza"));
    files
        .map(|path| {
            File::new(path.file_name().unwrap().to_string_lossy().into(), std::fs::read_to_string(path).unwrap())
        })
        .collect()
}

impl File {
    fn new(name: String, text: String) -> File {
        let mut marks = text.lines().enumerate().filter_map(|(line, text)| {
            let (_, code) = text.split_once("; error ")?;
            Some((line, Rule::from_code(code.trim()).unwrap_or_else(|| panic!("{name}: no rule `{code}`"))))
        });
        let expected = marks.next();
        assert!(marks.next().is_none(), "{name} has two marks");
        File { expected, name, text }
    }

    fn run(&self) -> Result<(), String> {
        let container = assemble(&self.text).map_err(|error| format!("does not assemble: {error}"))?;
        match (self.expected, verify(container.clone())) {
            (None, Ok(_)) => Ok(()),
            (None, Err(error)) => Err(format!("should be accepted: {error}")),
            (Some((_, rule)), Ok(_)) => Err(format!("should break {rule}, but is accepted")),
            (Some((_, rule)), Err(error)) if rule != error.rule => Err(format!("should break {rule}: {error}")),
            (Some((line, _)), Err(error)) => match line_of(&self.text, &container, &error) {
                Some(found) if found != line => {
                    Err(format!("line {} is to blame, not {}: {error}", line + 1, found + 1))
                }
                _ => Ok(()),
            },
        }
    }
}

fn keyword(line: &str) -> &str {
    line.split_whitespace().next().unwrap_or("")
}

/// The line (from 0) that an error is about; none when it is about the whole.
fn line_of(text: &str, container: &Container, error: &VerifyError) -> Option<usize> {
    if let Some(entry) = error.entry {
        let exact = text.starts_with("exact");
        // Outside `exact` texts an array line makes a type, too.
        let is_of = |word: &str| word == entry.table || (entry.table == "type" && word == "array" && !exact);
        return text.lines().enumerate().filter(|(_, line)| is_of(keyword(line))).nth(entry.index).map(|(at, _)| at);
    }
    let id = error.function?;
    let mut lines = text.lines().enumerate().filter(|(_, line)| keyword(line) == "function");
    let (header, _) = lines.nth(id.index())?;
    match error.offset {
        None => Some(header),
        Some(offset) => line_of_code(text, header, &container.functions[id.index()], offset),
    }
}

fn line_of_code(text: &str, header: usize, function: &Function, offset: u32) -> Option<usize> {
    let mut at = 0;
    for (number, line) in text.lines().enumerate().skip(header + 1) {
        let line = line.split(';').next().unwrap_or("");
        let bytes = match keyword(line) {
            "" | "param" | "local" | "parameters" | "result" | "frame" | "for" => 0,
            "end" => return None,
            "bytes" => line.split_whitespace().nth(1).map_or(0, |hex| hex.len() / 2),
            word if word.ends_with(':') => 0,
            _ => {
                let mut reader = Reader::new(&function.code[at..]);
                Instruction::decode(&mut reader).map_or(0, |_| reader.position())
            }
        };
        if (at..at + bytes).contains(&(offset as usize)) {
            return Some(number);
        }
        at += bytes;
    }
    None
}

#[test]
fn every_file_is_accepted_or_rejected_as_it_says() {
    let failures: Vec<String> =
        files().iter().filter_map(|file| Some(format!("{}: {}", file.name, file.run().err()?))).collect();
    assert!(failures.is_empty(), "\n{}\n", failures.join("\n"));
}

#[test]
fn every_rule_has_a_rejected_file() {
    let broken: BTreeSet<Rule> = files().iter().filter_map(|file| Some(file.expected?.1)).collect();
    let missing: Vec<String> = Rule::ALL
        .iter()
        .filter(|rule| !broken.contains(rule) && !BROKEN_ELSEWHERE.contains(rule))
        .map(|r| r.code())
        .collect();
    assert!(missing.is_empty(), "no file breaks {missing:?}");
}

#[test]
fn every_rule_has_an_example_that_breaks_it() {
    for rule in Rule::ALL {
        let Some(text) = rule.example() else {
            assert!(BROKEN_ELSEWHERE.contains(rule), "{rule} has no example");
            continue;
        };
        let example = File::new(format!("example of {rule}"), text.to_string());
        assert_eq!(example.expected.map(|(_, marked)| marked), Some(*rule));
        assert_eq!(example.run(), Ok(()), "{rule}");
    }
}

#[test]
fn codes_are_unique_and_found_again() {
    let codes: BTreeSet<String> = Rule::ALL.iter().map(|rule| rule.code()).collect();
    assert_eq!(codes.len(), Rule::ALL.len());
    for rule in Rule::ALL {
        assert_eq!(Rule::from_code(&rule.code().to_lowercase()), Some(*rule));
        assert!(rule.title().ends_with('.') && rule.explanation().ends_with('.'), "{rule}");
    }
}
