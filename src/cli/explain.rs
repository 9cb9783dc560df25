//! `khz explain`: what a code or a trap means, out of the tables.

use khz_bytecode::container::ReadCode;
use khz_bytecode::trap::TrapCode;
use khz_bytecode::verify::Rule as VerifierRule;
use khz_frontend::diagnostics;
use serde_json::{Value, json};

use super::args::{ExplainArgs, Format};
use super::output::{Failure, result};
use super::{Outcome, Status};

/// One explained thing, of any table.
struct Entry {
    code: String,
    kind: &'static str,
    title: String,
    text: String,
    wrong: &'static str,
    right: &'static str,
}

/// Runs it.
pub fn run(args: &ExplainArgs) -> Outcome {
    let all = entries();
    let Some(wanted) = &args.code else {
        for entry in &all {
            result(&format!("{:<15} {}", entry.code, entry.title));
        }
        return Ok(Status::Done);
    };
    let entry = all.iter().find(|entry| entry.code.eq_ignore_ascii_case(wanted));
    let entry = entry
        .ok_or_else(|| Failure::refused(format!("there is no code or trap `{wanted}`; `khz explain` lists all")))?;
    if args.common.format == Format::Json {
        let example = |text: &str| if text.is_empty() { Value::Null } else { Value::from(text) };
        let (wrong, right) = (example(entry.wrong), example(entry.right));
        result(&json!({ "code": entry.code, "kind": entry.kind, "title": entry.title, "text": entry.text, "wrong": wrong, "right": right }).to_string());
        return Ok(Status::Done);
    }
    result(&format!("{} ({}): {}\n\n{}", entry.code, entry.kind, entry.title, entry.text));
    for (word, example) in [("Wrong", entry.wrong), ("Right", entry.right)] {
        if !example.is_empty() {
            result(&format!("\n{word}:\n{}", indented(example)));
        }
    }
    Ok(Status::Done)
}

fn indented(text: &str) -> String {
    text.trim_end().lines().map(|line| format!("    {line}")).collect::<Vec<_>>().join("\n")
}

/// Every table: diagnostics, container errors, verifier rules, traps.
fn entries() -> Vec<Entry> {
    let plain = |code: String, kind, title: &str, text: &str| Entry {
        code,
        kind,
        title: title.into(),
        text: text.into(),
        wrong: "",
        right: "",
    };
    let rules = diagnostics::all_rules().map(|rule| Entry {
        wrong: rule.wrong,
        right: rule.right,
        ..plain(rule.code.into(), rule.severity.word(), rule.title, rule.explanation)
    });
    let reads =
        ReadCode::ALL.iter().map(|code| plain(code.code().into(), "container error", code.title(), code.explanation()));
    // What is right instead depends on the program: no example can say it.
    let verifier = VerifierRule::ALL.iter().map(|rule| Entry {
        wrong: rule.example().unwrap_or_default(),
        ..plain(rule.code(), "verifier rule", rule.title(), rule.explanation())
    });
    let traps = TrapCode::ALL.iter().map(|trap| {
        let (wrong, right) = trap.examples();
        Entry { wrong, right, ..plain(trap.name().into(), "trap", "ends a run", trap.text()) }
    });
    rules.chain(reads).chain(verifier).chain(traps).collect()
}
