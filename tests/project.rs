//! Projects on the command line: a folder with a khz.toml, or the khz.toml itself.

mod common;

use common::{Scratch, khz, stderr, stdout};
use std::path::Path;
use std::process::Output;

/// A scratch folder with these files.
fn project(name: &str, files: &[(&str, &str)]) -> Scratch {
    let scratch = Scratch::new(name);
    for (path, text) in files {
        let path = scratch.path(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    scratch
}

fn in_folder(scratch: &Scratch, words: &[&str]) -> Output {
    khz().current_dir(scratch.path("")).args(words).output().unwrap()
}

const MAIN: &str = "PROGRAM Main\nVAR n : INT; END_VAR\n  n := Twice(n + 1);\nEND_PROGRAM\n";
const TWICE: &str = "FUNCTION Twice : INT\nVAR_INPUT x : INT; END_VAR\n  Twice := 2 * x;\nEND_FUNCTION\n";

#[test]
fn a_project_builds_runs_and_checks_by_its_folder_or_file() {
    let toml = "name = 'plant'\nsources = ['src']\nlibraries = ['lib']\n[task]\nname = 'fast'\ninterval = 'T#2ms'\npriority = 3\n";
    let scratch = project("project", &[("khz.toml", toml), ("src/a/main.st", MAIN), ("lib/twice.st", TWICE)]);
    let built = in_folder(&scratch, &["build", "."]);
    assert_eq!(built.status.code(), Some(0), "{}", stderr(&built));
    assert!(scratch.path("plant.iplc").is_file(), "named after the project");
    for name in [".", "khz.toml"] {
        let checked = in_folder(&scratch, &["check", name]);
        assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
        let run = in_folder(&scratch, &["run", "--clock", "virtual", "--scans", "3", "--dump-vars", "d.json", name]);
        assert_eq!(run.status.code(), Some(0), "{}", stderr(&run));
        let dump: serde_json::Value = serde_json::from_slice(&std::fs::read(scratch.path("d.json")).unwrap()).unwrap();
        assert_eq!(dump["variables"]["Main.n"], 14);
        assert_eq!(dump["time_us"], 4000, "rounds at 0, 2 and 4 ms: the interval is the project's");
    }
    let verified = in_folder(&scratch, &["verify", "plant.iplc", "--format", "json"]);
    assert_eq!(verified.status.code(), Some(0));
    assert!(in_folder(&scratch, &["disasm", "."]).status.success());
}

#[test]
fn without_sources_everything_beside_the_project_file_is_meant_once() {
    let scratch = project(
        "project-all",
        &[("p/khz.toml", "libraries = ['lib']"), ("p/lib/twice.st", TWICE), ("p/main.st", MAIN)],
    );
    let checked = in_folder(&scratch, &["check", "p"]);
    assert_eq!((checked.status.code(), stderr(&checked).lines().last()), (Some(0), Some("0 errors, 0 warnings")));
    let built = in_folder(&scratch, &["build", "p"]);
    assert_eq!(built.status.code(), Some(0), "{}", stderr(&built));
    assert!(scratch.path("p.iplc").is_file(), "named after its folder");
}

#[test]
fn patterns_choose_files_and_libraries_bring_their_own() {
    let scratch = project(
        "project-patterns",
        &[
            ("app/khz.toml", "sources = ['**/m*.st', 'on[ce].st']\nlibraries = ['../mid']"),
            ("app/deep/er/main.st", MAIN),
            ("app/deep/other.st", "nonsense"),
            ("app/one.st", "FUNCTION One : INT\n  One := 1;\nEND_FUNCTION\n"),
            ("app/onc.st", "FUNCTION Onc : INT\n  Onc := 1;\nEND_FUNCTION\n"),
            ("mid/khz.toml", "libraries = ['../base/khz.toml']\ndialect = 'iec'"),
            ("mid/mid.st", "FUNCTION Mid : INT\n  Mid := Twice(1);\nEND_FUNCTION\n"),
            ("base/khz.toml", ""),
            ("base/twice.st", TWICE),
        ],
    );
    let checked = in_folder(&scratch, &["check", "app"]);
    assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
    // From outside, folders by a pattern, and no deeper than it says.
    for (sources, status) in [("'../app/d*'", 0), ("'../*/de?p/er/*.st'", 0), ("'*/main.st'", 1), ("'d*p/**/m*'", 0)] {
        std::fs::write(scratch.path("app/khz.toml"), format!("sources = [{sources}]\nlibraries = ['../mid']")).unwrap();
        std::fs::write(scratch.path("app/deep/other.st"), "(* nothing *)").unwrap();
        let checked = in_folder(&scratch, &["check", "app"]);
        assert_eq!(checked.status.code(), Some(status), "{sources}: {}", stderr(&checked));
    }
}

#[test]
fn what_is_wrong_with_a_project_has_a_place_in_its_file() {
    let scratch = project(
        "project-wrong",
        &[
            ("khz.toml", "sources = ['src', 'no/where.st', '*.xyz', 'a[']\nlibraries = ['lib']\n"),
            ("src/main.st", MAIN),
            ("lib/khz.toml", "libraries = ['..']\ndialec = 'iec'\n"),
            ("lib/twice.st", TWICE),
        ],
    );
    let checked = in_folder(&scratch, &["check", "."]);
    assert_eq!(checked.status.code(), Some(1));
    let all = stderr(&checked);
    for line in [
        "./khz.toml:1:19: error[F0004]: there is no file or folder ./no/where.st",
        "./khz.toml:1:34: error[F0004]: no source matches `*.xyz`",
        "./khz.toml:1:43: error[F0004]: this pattern can not be read",
        "./lib/khz.toml:1:14: error[F0005]: following libraries from here leads back to",
        "./lib/khz.toml:2:1: error[F0002]: a project has no setting `dialec`",
        "help: did you mean `dialect`?",
    ] {
        assert!(all.contains(line), "{line}\n{all}");
    }
    let json = in_folder(&scratch, &["check", ".", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&stdout(&json)).unwrap();
    assert_eq!(json.as_array().map(Vec::len), Some(5), "{json}");
}

#[test]
fn the_command_line_goes_before_the_project() {
    let narrow = "PROGRAM p\nVAR\n  a : INT;\n  b : DINT;\nEND_VAR\n  a := b;\nEND_PROGRAM\n";
    let scratch = project("project-dialect", &[("khz.toml", "dialect = 'iec'"), ("p.st", narrow)]);
    assert_eq!(in_folder(&scratch, &["check", "."]).status.code(), Some(1));
    assert_eq!(in_folder(&scratch, &["check", "--dialect", "default", "."]).status.code(), Some(0));
    let several = in_folder(&scratch, &["check", "khz.toml", "p.st"]);
    assert_eq!(several.status.code(), Some(1));
    assert!(stderr(&several).contains("a project is named by itself"));
    let unnamed = in_folder(&scratch, &["build", "p.st"]);
    assert_eq!(unnamed.status.code(), Some(2), "no project, no name: -o is needed");
}

#[test]
fn the_project_of_the_docs_is_a_project() {
    let page = std::fs::read_to_string(common::root().join("docs/projects.md")).unwrap();
    let example = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let mut sources = kilohertz::khz_frontend::source::SourceMap::new();
    let (project, found) = kilohertz::khz_frontend::project::read(&mut sources, "khz.toml", example.as_bytes());
    assert!(found.is_empty(), "{found:?}");
    assert!(project.task.is_some() && !project.libraries.is_empty() && project.sources.is_some());
    assert!(Path::new("docs/projects.md").is_relative());
}
