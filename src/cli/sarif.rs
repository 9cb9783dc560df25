//! Diagnostics as SARIF 2.1.0 (the OASIS standard), which code hosts and editors show at their lines.

use std::collections::BTreeMap;

use khz_frontend::diagnostics::{Diagnostic, Rule, Severity};
use khz_frontend::source::{SourceMap, Span};
use serde_json::{Value, json};

/// Where SARIF's own structure is described.
const SCHEMA: &str = "https://json.schemastore.org/sarif-2.1.0.json";

/// A whole log with one run.
pub fn log(diagnostics: &[Diagnostic], sources: &SourceMap) -> Value {
    // Only the rules that occur, in order of their codes.
    let used: BTreeMap<&str, &Rule> = diagnostics.iter().map(|found| (found.code(), found.rule)).collect();
    let index: BTreeMap<&str, usize> = used.keys().copied().zip(0..).collect();
    let rules: Vec<Value> = used.values().map(|rule| rule_json(rule)).collect();
    let results: Vec<Value> =
        diagnostics.iter().map(|found| result_json(found, index.get(found.code()).copied(), sources)).collect();
    json!({
        "$schema": SCHEMA,
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": { "name": "khz", "version": env!("CARGO_PKG_VERSION"), "rules": rules } },
            "columnKind": "unicodeCodePoints",
            "results": results,
        }],
    })
}

fn rule_json(rule: &Rule) -> Value {
    json!({
        "id": rule.code,
        "shortDescription": { "text": rule.title },
        "fullDescription": { "text": rule.explanation },
        "help": { "text": format!("khz explain {}", rule.code) },
        "defaultConfiguration": { "level": level(rule.severity) },
    })
}

fn result_json(found: &Diagnostic, rule: Option<usize>, sources: &SourceMap) -> Value {
    let help = found.help.as_deref().map(|help| format!("\nhelp: {help}")).unwrap_or_default();
    let related: Vec<Value> = found
        .labels
        .iter()
        .zip(1..)
        .map(|((span, text), id)| {
            json!({ "id": id, "physicalLocation": location(*span, sources), "message": { "text": text } })
        })
        .collect();
    json!({
        "ruleId": found.code(),
        "ruleIndex": rule,
        "level": level(found.severity),
        "message": { "text": format!("{}{help}", found.message) },
        "locations": [{ "physicalLocation": location(found.span, sources) }],
        "relatedLocations": related,
    })
}

fn level(severity: Severity) -> &'static str {
    // The same words in SARIF; what else it has, khz does not.
    severity.word()
}

fn location(span: Span, sources: &SourceMap) -> Value {
    let start = sources.line_column(span);
    let end = sources.line_column(Span::new(span.file, span.end, span.end));
    let name = sources.file(span.file).map_or("", |file| file.name());
    json!({
        "artifactLocation": { "uri": uri(name) },
        "region": {
            "startLine": start.line, "startColumn": start.column,
            "endLine": end.line, "endColumn": end.column,
        },
    })
}

/// A file's name as a URI: relative ones stay so.
fn uri(name: &str) -> String {
    let name = name.strip_prefix("./").unwrap_or(name);
    let mut out = String::from(if name.starts_with('/') { "file://" } else { "" });
    for byte in name.replace('\\', "/").bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => out.push(char::from(byte)),
            other => {
                let digits = [other >> 4, other & 15].map(|digit| char::from_digit(u32::from(digit), 16));
                out.push('%');
                out.extend(digits.into_iter().flatten().map(|digit| digit.to_ascii_uppercase()));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::uri;

    #[test]
    fn names_become_uris() {
        assert_eq!(uri("src/a b.st"), "src/a%20b.st");
        assert_eq!(uri("./Übung.st"), "%C3%9Cbung.st");
        assert_eq!(uri("/plant/a.st"), "file:///plant/a.st");
    }
}
