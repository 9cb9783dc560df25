//! `khz fmt` as scripts see it: files, exit statuses, encodings.

mod common;

use common::{Scratch, khz, stderr, stdout};
use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::{Output, Stdio};

const UNTIDY: &str = "program p var n:int; end_var n:=n+1; // more\nend_program";
const TIDY: &str = "PROGRAM p\nVAR\n  n : int;\nEND_VAR\n  n := n + 1; // more\nEND_PROGRAM\n";
const BROKEN: &str = "PROGRAM p\n  n := ;\nEND_PROGRAM\n";

fn fmt(words: &[&str], path: &Path) -> Output {
    khz().arg("fmt").args(words).arg(path).output().expect("khz starts")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).expect("the file is still there")
}

#[test]
fn files_are_formatted_in_place_once() {
    let scratch = Scratch::new("fmt-in-place");
    let (a, b) = (scratch.write("a.st", UNTIDY), scratch.write("b.st", TIDY));
    let output = fmt(&[], a.parent().unwrap());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stdout(&output), format!("{}\n", a.display()), "only what changed is listed");
    assert_eq!((read(&a).as_str(), read(&b).as_str()), (TIDY, TIDY));
    let again = fmt(&[], a.parent().unwrap());
    assert_eq!((again.status.code(), stdout(&again).as_str()), (Some(0), ""));
    let left: Vec<_> = std::fs::read_dir(a.parent().unwrap()).unwrap().collect();
    assert_eq!(left.len(), 2, "nothing is left behind: {left:?}");
}

#[test]
fn check_lists_and_writes_nothing() {
    let scratch = Scratch::new("fmt-check");
    let (a, b) = (scratch.write("a.st", UNTIDY), scratch.write("b.st", TIDY));
    let output = fmt(&["--check"], a.parent().unwrap());
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(stdout(&output), format!("{}\n", a.display()));
    assert_eq!(read(&a), UNTIDY);
    assert_eq!(fmt(&["--check"], &b).status.code(), Some(0));
}

#[test]
fn a_file_with_errors_is_refused_and_the_others_are_not() {
    let scratch = Scratch::new("fmt-refused");
    let (a, b) = (scratch.write("a.st", BROKEN), scratch.write("b.st", UNTIDY));
    let output = fmt(&[], a.parent().unwrap());
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("a.st:2:8"), "{}", stderr(&output));
    assert_eq!((read(&a).as_str(), read(&b).as_str()), (BROKEN, TIDY));
    let json = fmt(&["--format", "json"], a.parent().unwrap());
    let list: Value = serde_json::from_str(&stdout(&json)).unwrap();
    assert_eq!(list[0]["status"], "refused");
    assert_eq!(list[0]["diagnostics"][0]["place"]["line"], 2);
    assert_eq!(list[1]["status"], "unchanged");
    assert_eq!(json.status.code(), Some(1));
}

fn pipe(words: &[&str], text: &[u8]) -> Output {
    let mut child = khz()
        .arg("fmt")
        .args(words)
        .arg("-")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(text).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn stdin_goes_to_stdout() {
    let output = pipe(&[], UNTIDY.as_bytes());
    assert_eq!((output.status.code(), stdout(&output).as_str()), (Some(0), TIDY));
    let unchanged = pipe(&[], TIDY.as_bytes());
    assert_eq!(stdout(&unchanged), TIDY);
    let refused = pipe(&[], BROKEN.as_bytes());
    assert_eq!((refused.status.code(), stdout(&refused).as_str()), (Some(1), ""));
    assert_eq!(pipe(&["--check"], UNTIDY.as_bytes()).status.code(), Some(1));
    let kept = pipe(&["--keywords", "keep", "--indent", "4"], UNTIDY.as_bytes());
    assert!(stdout(&kept).starts_with("program p\nvar\n    n : int;\n"), "{}", stdout(&kept));
    assert_eq!(fmt(&["-"], Path::new("a.st")).status.code(), Some(2), "stdin and a file");
}

#[test]
fn a_file_keeps_its_encoding() {
    let scratch = Scratch::new("fmt-encoding");
    let latin1 = scratch.write("latin1.st", b"VAR_GLOBAL s:STRING:='gr\xFCn';END_VAR");
    let marked = scratch.write("marked.st", b"\xEF\xBB\xBFVAR_GLOBAL s:STRING:='gr\xC3\xBCn';END_VAR");
    assert_eq!(fmt(&[], latin1.parent().unwrap()).status.code(), Some(0));
    assert_eq!(std::fs::read(&latin1).unwrap(), b"VAR_GLOBAL\n  s : STRING := 'gr\xFCn';\nEND_VAR\n");
    assert_eq!(std::fs::read(&marked).unwrap(), b"\xEF\xBB\xBFVAR_GLOBAL\n  s : STRING := 'gr\xC3\xBCn';\nEND_VAR\n");
}

#[cfg(unix)]
#[test]
fn permissions_and_links_stay() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let scratch = Scratch::new("fmt-permissions");
    let file = scratch.write("plant.st", UNTIDY);
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o640)).unwrap();
    let link = scratch.path("link.st");
    symlink(&file, &link).unwrap();
    assert_eq!(fmt(&[], &link).status.code(), Some(0));
    assert_eq!(read(&file), TIDY);
    assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    std::fs::write(&file, UNTIDY).unwrap();
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o440)).unwrap();
    assert_eq!(fmt(&[], &file).status.code(), Some(4), "a file that may not be written");
    assert_eq!(read(&file), UNTIDY);
}
