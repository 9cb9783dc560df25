//! `khz check --format sarif`: a log that has what SARIF 2.1.0 asks for, and says what the human output says.

mod common;

use common::{Scratch, khz, stdout};
use serde_json::Value;

fn checked(name: &str, text: &str) -> (Option<i32>, Value) {
    let scratch = Scratch::new(name);
    scratch.write("a b.st", text);
    let output = khz().current_dir(scratch.path("")).args(["check", "--format", "sarif", "a b.st"]).output().unwrap();
    (output.status.code(), serde_json::from_str(&stdout(&output)).unwrap())
}

/// What §3 of the standard requires of the objects that occur here.
fn validate(log: &Value) {
    assert_eq!(log["version"], "2.1.0");
    assert!(log["$schema"].as_str().unwrap().contains("sarif-2.1.0"));
    let runs = log["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 1);
    let run = &runs[0];
    let driver = &run["tool"]["driver"];
    assert!(!driver["name"].as_str().unwrap().is_empty());
    assert!(["unicodeCodePoints", "utf16CodeUnits"].contains(&run["columnKind"].as_str().unwrap()));
    let rules = driver["rules"].as_array().unwrap();
    for rule in rules {
        assert!(rule["id"].is_string() && rule["shortDescription"]["text"].is_string());
        assert!(rule["fullDescription"]["text"].is_string() && rule["help"]["text"].is_string());
    }
    for result in run["results"].as_array().unwrap() {
        assert!(["none", "note", "warning", "error"].contains(&result["level"].as_str().unwrap()));
        assert!(!result["message"]["text"].as_str().unwrap().is_empty());
        let index = usize::try_from(result["ruleIndex"].as_u64().unwrap()).unwrap();
        assert_eq!(rules[index]["id"], result["ruleId"]);
        let locations = result["locations"].as_array().unwrap();
        let related = result["relatedLocations"].as_array().unwrap();
        for location in related {
            assert!(location["id"].as_u64().is_some() && location["message"]["text"].is_string());
        }
        assert_eq!(locations.len(), 1);
        for location in locations.iter().chain(related) {
            let physical = &location["physicalLocation"];
            let uri = physical["artifactLocation"]["uri"].as_str().unwrap();
            assert!(!uri.contains(' ') && !uri.contains('\\'), "{uri}");
            let at = |name: &str| physical["region"][name].as_u64().unwrap();
            assert!(at("startLine") >= 1 && at("startColumn") >= 1);
            assert!((at("endLine"), at("endColumn")) >= (at("startLine"), at("startColumn")));
        }
    }
}

#[test]
fn errors_with_their_places_and_rules() {
    let (status, log) =
        checked("sarif", "PROGRAM p\nVAR\n  a : INT;\n  A : INT;\nEND_VAR\n  a := sped;\nEND_PROGRAM\n");
    assert_eq!(status, Some(1));
    validate(&log);
    let results = log["runs"][0]["results"].as_array().unwrap();
    let ids: Vec<&str> = results.iter().map(|one| one["ruleId"].as_str().unwrap()).collect();
    assert_eq!(ids, ["S0002", "S0001"]);
    let region = &results[1]["locations"][0]["physicalLocation"]["region"];
    assert_eq!(
        (&region["startLine"], &region["startColumn"], &region["endColumn"]),
        (&6.into(), &8.into(), &12.into())
    );
    assert_eq!(results[0]["relatedLocations"][0]["physicalLocation"]["region"]["startLine"], 3);
    assert_eq!(results[0]["locations"][0]["physicalLocation"]["artifactLocation"]["uri"], "a%20b.st");
}

#[test]
fn warnings_pass_and_a_clean_program_has_an_empty_log() {
    let (status, log) = checked("sarif-warning", "PROGRAM p\nVAR\n  a : INT;\nEND_VAR\n  a := a;\nEND_PROGRAM\n");
    validate(&log);
    assert_eq!((status, &log["runs"][0]["results"][0]["level"]), (Some(0), &"warning".into()));
    let (status, log) = checked("sarif-clean", "PROGRAM p\nEND_PROGRAM\n");
    validate(&log);
    assert_eq!((status, log["runs"][0]["results"].as_array().map(Vec::len)), (Some(0), Some(0)));
}
