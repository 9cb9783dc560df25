//! ST programs with what they must come to: `tests/programs/*.st`. How they say it: `tests/common/programs.rs`.

mod common;
#[path = "common/programs.rs"]
mod programs;

use common::{files, root};
use programs::{check, check_all};

#[test]
fn programs_come_to_what_they_say() {
    let folder = root().join("tests/programs");
    let files = files(&folder, "st");
    assert!(files.len() >= 20);
    let wrong = check_all(&folder, &files);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_wrong_expectation_is_noticed() {
    let program = "PROGRAM main VAR x : INT; END_VAR x := 1; END_PROGRAM";
    assert_eq!(check("wrong.st", &format!("// expect: main.x = 2\n{program}")).len(), 2);
    assert_eq!(check("wrong.st", &format!("// trap: range at 2:1\n{program}")).len(), 2);
    assert_eq!(check("wrong.st", &format!("// error: S0001 at 2:1\n{program}")).len(), 1);
    assert_eq!(check("wrong.st", &format!("// warning: S0018\n{program}")).len(), 1);
    assert_eq!(check("right.st", &format!("// expect: main.x = 1\n{program}")), [""; 0]);
    let broken = "// error: S0001 at 2:14\nPROGRAM main y := 1; z := 1; END_PROGRAM";
    assert_eq!(check("two_errors.st", broken).len(), 1);
}
