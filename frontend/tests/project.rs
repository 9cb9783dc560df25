//! `khz.toml`: what it says, and what is said about a wrong one.

use khz_frontend::diagnostics::{files as rules, has_errors};
use khz_frontend::project::{MAX_BYTES, Project, read};
use khz_frontend::source::SourceMap;
use khz_frontend::{DefaultTask, Dialect};

fn found(text: &[u8]) -> (Project, Vec<String>) {
    let mut sources = SourceMap::new();
    let (project, diagnostics) = read(&mut sources, "khz.toml", text);
    let lines = diagnostics.iter().map(|one| {
        let help = one.help.as_deref().map(|help| format!(" ({help})")).unwrap_or_default();
        format!("{} {} {}{help}", sources.place(one.span), one.code(), one.message)
    });
    (project, lines.collect())
}

fn messages(text: &str) -> Vec<String> {
    found(text.as_bytes()).1
}

#[test]
fn everything_that_a_project_can_say() {
    let text = "name = \"bottling-2\"\nsources = [\"src\", \"gvl/*.TcGVL\"]\nlibraries = ['../lib']\ndialect = \"iec\"\n\
                [task]\nname = \"fast\"\ninterval = \"T#500us\"\npriority = 0x10\n";
    let (project, messages) = found(text.as_bytes());
    assert_eq!(messages, [""; 0]);
    assert_eq!(project.name.as_deref(), Some("bottling-2"));
    let paths: Vec<&str> = project.sources.iter().flatten().map(|path| path.text.as_str()).collect();
    assert_eq!(paths, ["src", "gvl/*.TcGVL"]);
    assert_eq!(project.libraries[0].text, "../lib");
    assert_eq!(project.dialect, Some(Dialect::Iec));
    assert_eq!(project.task, Some(DefaultTask { name: "fast".to_owned(), interval_us: 500, priority: 16 }));
}

#[test]
fn an_empty_file_is_a_project() {
    assert_eq!(found(b""), (Project::default(), Vec::new()));
    assert_eq!(found(b"\xEF\xBB\xBF# nothing\n"), (Project::default(), Vec::new()));
}

#[test]
fn unknown_settings_are_refused_with_the_one_that_was_meant() {
    assert_eq!(
        messages("source = []\n\n[task]\nPriorty = 1\ncolour = 'red'\n"),
        [
            "khz.toml:1:1 F0002 a project has no setting `source` (did you mean `sources`?)",
            "khz.toml:4:1 F0002 the task of a project has no setting `Priorty` (did you mean `priority`?)",
            "khz.toml:5:1 F0002 the task of a project has no setting `colour` (there is name, interval, priority)",
        ]
    );
}

#[test]
fn wrong_values_are_shown_where_they_stand() {
    assert_eq!(
        messages("name = 7\nsources = ['a', 3, '']\nlibraries = 'x'\ndialect = 'siemens'\n"),
        [
            "khz.toml:4:11 F0003 \"default\" or \"iec\" is wanted here",
            "khz.toml:3:13 F0003 a list of paths is wanted here",
            "khz.toml:1:8 F0003 a name of letters, digits, `_` and `-` is wanted here",
            "khz.toml:2:17 F0003 a path is wanted here",
            "khz.toml:2:20 F0003 a path is wanted here",
        ]
    );
    let interval = "F0003 a time of whole microseconds, at least 1, as in \"T#10ms\", is wanted here";
    for value in ["'10ms'", "'T#0s'", "'T#1ns'", "5", "'T#-1s'"] {
        assert_eq!(
            messages(&format!("[task]\ninterval = {value}\n")),
            [format!("khz.toml:2:12 {interval}")],
            "{value}"
        );
    }
    for value in ["65536", "-1", "1.5", "'1'"] {
        assert_eq!(messages(&format!("[task]\npriority = {value}\n")).len(), 1, "{value}");
    }
    assert_eq!(messages("task = 3\n").len(), 1);
    assert_eq!(messages("[task]\nname = '1st'\n").len(), 1);
}

#[test]
fn what_is_no_toml_is_refused_where_it_goes_wrong() {
    let all = messages("name = \"a\"\nsources = [\"src\"\n");
    assert_eq!(all.len(), 1);
    assert!(all[0].starts_with("khz.toml:2:") && all[0].contains("F0001"), "{all:?}");
    assert!(messages("name = 'a'\nname = 'b'\n")[0].contains("khz.toml:2:1 F0001"));
    assert!(found(b"name = '\xFF'").1[0].contains("not UTF-8"));
    assert!(found(&vec![b'#'; MAX_BYTES + 1]).1[0].contains("the limit is"));
}

#[test]
fn depth_and_size_are_bounded() {
    for (open, close) in [("[", "]"), ("{a=", "}")] {
        let deep = format!("name = {}1{}", open.repeat(100_000), close.repeat(100_000));
        let all = messages(&deep);
        assert_eq!(all.len(), 1, "{}", all.len());
    }
    let dotted = format!("{} = 1", vec!["a"; 100_000].join("."));
    assert_eq!(messages(&dotted).len(), 1);
    let wide = format!("sources = [{}]", "'a',".repeat(5_000));
    assert_eq!(messages(&wide), ["khz.toml:1:11 F0003 more than 4096 paths"]);
}

#[test]
fn every_rule_is_broken_by_its_wrong_example_and_kept_by_its_right_one() {
    for rule in rules::TABLE.iter().filter(|rule| rule.file == "khz.toml" && !rule.wrong.is_empty()) {
        let wrong = messages(rule.wrong);
        assert!(wrong.len() == 1 && wrong[0].contains(rule.code), "{}: {wrong:?}", rule.code);
        let mut sources = SourceMap::new();
        assert!(!has_errors(&read(&mut sources, "khz.toml", rule.right.as_bytes()).1), "{}", rule.code);
    }
}
