//! What came of tests, told to people and in the formats that build servers read: JSON, JUnit's XML, TAP.
//!
//! Nothing here depends on time: the same tests give the same bytes.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{FailedAssertion, Failure, Test, TestResult};
use crate::pipeline::EngineKind;

/// How many passed and how many did not.
#[must_use]
pub fn counts(results: &[TestResult]) -> (usize, usize) {
    let passed = results.iter().filter(|result| result.passed()).count();
    (passed, results.len() - passed)
}

/// `N passed, N failed`.
#[must_use]
pub fn summary(results: &[TestResult]) -> String {
    let (passed, failed) = counts(results);
    format!("{passed} passed, {failed} failed")
}

/// One test for people: a line, and what went wrong below it.
#[must_use]
pub fn human(result: &TestResult, engines: usize) -> String {
    let word = if result.passed() { "ok  " } else { "FAIL" };
    let mut text = format!("{word}  {}: {}", result.place.file, result.name);
    for (on, failure) in &result.failures {
        for line in explain(failure).lines() {
            // Writing to a String does not fail.
            let _ = write!(text, "\n      {line}");
        }
        if on.len() < engines {
            let _ = write!(text, "\n      (only on {})", engine_names(on).join(", "));
        }
    }
    text
}

/// Why a test did not pass, in one or more lines.
fn explain(failure: &Failure) -> String {
    match failure {
        Failure::Assertion(failed) => {
            let mut text = format!("{}: {} failed: {}", failed.place, failed.word, values(failed));
            if let Some(message) = &failed.message {
                let _ = write!(text, ": {}", one_line(message));
            }
            text
        }
        Failure::Trap(report) => report.to_string(),
        Failure::NotRun(why) => why.clone(),
    }
}

fn values(failed: &FailedAssertion) -> String {
    let each: Vec<String> = failed.values.iter().map(|(label, text, _)| format!("{label} {text}")).collect();
    each.join(", ")
}

/// A text without line ends and other control characters.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn engine_names(engines: &[EngineKind]) -> Vec<&'static str> {
    engines.iter().map(|engine| engine.name()).collect()
}

/// All results as one JSON object.
#[must_use]
pub fn json(results: &[TestResult]) -> Value {
    let (passed, failed) = counts(results);
    let tests: Vec<Value> = results
        .iter()
        .map(|result| {
            let failures: Vec<Value> = result.failures.iter().map(|(on, failure)| failure_json(on, failure)).collect();
            json!({
                "name": result.name,
                "file": result.place.file,
                "line": result.place.line,
                "column": result.place.column,
                "passed": result.passed(),
                "failures": failures,
            })
        })
        .collect();
    json!({ "passed": passed, "failed": failed, "tests": tests })
}

fn failure_json(on: &[EngineKind], failure: &Failure) -> Value {
    let engines = engine_names(on);
    match failure {
        Failure::Assertion(failed) => {
            let values: serde_json::Map<String, Value> = failed
                .values
                .iter()
                .map(|(label, text, json)| {
                    let value = serde_json::from_str(json).unwrap_or_else(|_| Value::String(text.clone()));
                    ((*label).to_owned(), value)
                })
                .collect();
            json!({
                "kind": "assertion",
                "engines": engines,
                "assertion": failed.word,
                "file": failed.place.file,
                "line": failed.place.line,
                "column": failed.place.column,
                "values": values,
                "message": failed.message,
            })
        }
        Failure::Trap(report) => {
            let report: Value = serde_json::from_str(&report.to_json()).unwrap_or(Value::Null);
            json!({ "kind": "trap", "engines": engines, "report": report })
        }
        Failure::NotRun(why) => json!({ "kind": "not run", "engines": engines, "message": why }),
    }
}

/// The tests themselves as JSON, for `--list`.
#[must_use]
pub fn list_json(tests: &[&Test]) -> Value {
    let one = |test: &&Test| json!({ "name": test.name, "file": test.place.file, "line": test.place.line, "column": test.place.column });
    Value::Array(tests.iter().map(one).collect())
}

/// All results as JUnit's XML: a suite for each file, an assertion is a failure, everything else an error.
#[must_use]
pub fn junit(results: &[TestResult]) -> String {
    let is_error =
        |result: &&TestResult| result.failures.iter().any(|(_, found)| !matches!(found, Failure::Assertion(_)));
    let figures = |some: &[&TestResult]| {
        let errors = some.iter().filter(|result| is_error(result)).count();
        let failures = some.iter().filter(|result| !result.passed()).count() - errors;
        format!("tests=\"{}\" failures=\"{failures}\" errors=\"{errors}\"", some.len())
    };
    let all: Vec<&TestResult> = results.iter().collect();
    let mut xml = format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites {}>\n", figures(&all));
    for suite in all.chunk_by(|a, b| a.place.file == b.place.file) {
        let Some(first) = suite.first() else { continue };
        let file = escape(&first.place.file);
        let _ = writeln!(xml, "  <testsuite name=\"{file}\" {}>", figures(suite));
        for result in suite {
            let name = escape(&result.name);
            let _ = write!(
                xml,
                "    <testcase name=\"{name}\" classname=\"{file}\" file=\"{file}\" line=\"{}\"",
                result.place.line
            );
            if result.passed() {
                xml.push_str("/>\n");
                continue;
            }
            xml.push_str(">\n");
            for (on, failure) in &result.failures {
                let element = if matches!(failure, Failure::Assertion(_)) { "failure" } else { "error" };
                let text = explain(failure);
                let headline = escape(text.lines().next().unwrap_or_default());
                let (engines, text) = (engine_names(on).join(", "), escape(&text));
                let _ = writeln!(xml, "      <{element} message=\"{headline}\" type=\"{engines}\">{text}</{element}>");
            }
            xml.push_str("    </testcase>\n");
        }
        xml.push_str("  </testsuite>\n");
    }
    xml.push_str("</testsuites>");
    xml
}

/// JUnit's XML of sources that did not compile: one error.
#[must_use]
pub fn junit_refused(why: &str) -> String {
    let why = escape(why);
    let figures = "tests=\"1\" failures=\"0\" errors=\"1\"";
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites {figures}>\n  <testsuite name=\"compilation\" {figures}>\n    \
         <testcase name=\"compilation\">\n      <error message=\"{why}\"/>\n    </testcase>\n  </testsuite>\n</testsuites>"
    )
}

/// A text as it may stand in XML; what XML can not hold at all becomes a question mark.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\t' => out.push(c),
            '\u{FFFE}' | '\u{FFFF}' => out.push('?'),
            _ if c.is_control() => out.push('?'),
            _ => out.push(c),
        }
    }
    out
}

/// All results in the Test Anything Protocol, version 14.
#[must_use]
pub fn tap(results: &[TestResult]) -> String {
    let mut text = format!("TAP version 14\n1..{}", results.len());
    for (number, result) in (1..).zip(results) {
        let word = if result.passed() { "ok" } else { "not ok" };
        let name = tap_name(&result.name);
        let _ = write!(text, "\n{word} {number} - {}: {name}", tap_name(&result.place.file));
        if result.passed() {
            continue;
        }
        text.push_str("\n  ---");
        for (on, failure) in &result.failures {
            let _ = write!(text, "\n  - engines: [{}]\n    message: |", engine_names(on).join(", "));
            for line in explain(failure).lines() {
                let _ = write!(text, "\n      {}", one_line(line));
            }
        }
        text.push_str("\n  ...");
    }
    text
}

/// A description may not begin a directive or a comment.
fn tap_name(name: &str) -> String {
    one_line(name).replace('\\', "\\\\").replace('#', "\\#")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_stay_inside_their_format() {
        assert_eq!(escape("a < b & \"c\"\u{1}"), "a &lt; b &amp; &quot;c&quot;?");
        assert_eq!(tap_name("all # skip\nnow"), "all \\# skip now");
    }
}
