//! The comparison of instruction counts with their baseline, and the baseline itself. Counting needs valgrind and is done by hand.

mod common;

use std::collections::BTreeMap;
use std::process::{Command, Output};

use common::{Scratch, root, stdout};

/// The counts of the baseline by name.
fn baseline() -> BTreeMap<String, u64> {
    let text = std::fs::read_to_string(root().join("benches/instructions.txt")).unwrap();
    let rows = text.lines().filter(|line| !line.starts_with('#')).map(|line| {
        let (name, count) = line.split_once(' ').unwrap();
        (name.to_owned(), count.parse().unwrap())
    });
    rows.collect()
}

fn compare(words: &[&str], counts: &BTreeMap<String, u64>) -> Output {
    let scratch = Scratch::new(&format!("instructions-{}", words.len()));
    let lines: String = counts.iter().map(|(name, count)| format!("{name} {count}\n")).collect();
    let file = scratch.write("counts.txt", lines);
    let script = root().join("benches/instructions.sh");
    Command::new("bash").arg(script).args(words).arg("--counts").arg(file).output().unwrap()
}

#[test]
fn the_baseline_has_a_count_of_every_bench() {
    let source = std::fs::read_to_string(root().join("benches/callgrind.rs")).unwrap();
    let mut expected = Vec::new();
    let mut cases = Vec::new();
    for line in source.lines() {
        if let Some(case) = line.strip_prefix("#[bench::") {
            cases.push(case.split('(').next().unwrap().to_owned());
        } else if let Some(name) = line.strip_prefix("fn ") {
            let name = name.split('(').next().unwrap();
            expected.extend(cases.drain(..).map(|case| format!("{name}.{case}")));
        }
    }
    expected.sort();
    let baseline = baseline();
    assert_eq!(baseline.keys().cloned().collect::<Vec<_>>(), expected);
    assert!(baseline.values().all(|count| *count > 100), "{baseline:?}");
}

#[test]
fn changes_are_told_in_percent_and_can_be_refused() {
    let before = baseline();
    let same = compare(&[], &before);
    assert!(same.status.success());
    assert!(stdout(&same).lines().all(|line| line.ends_with("+0.00 %")), "{}", stdout(&same));
    let (mut now, mut names) = (before.clone(), before.keys());
    let (dearer, gone) = (names.next().unwrap(), names.next().unwrap());
    now.insert(dearer.clone(), before[dearer] * 3);
    now.remove(gone);
    now.insert("scans.of_something_new".into(), 5000);
    let output = compare(&["--at-most", "150"], &now);
    let text = stdout(&output);
    let line = |name: &str| text.lines().find(|line| line.starts_with(name)).unwrap();
    assert!(line(dearer).ends_with("+200.00 %") && line(gone).ends_with("gone"), "{text}");
    assert!(line("scans.of_something_new").ends_with("new"), "{text}");
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(compare(&["--at-most", "250", "--at-most", "250"], &now).status.success());
}
