//! Golden files: `NAME.st` as someone wrote it, `NAME.expected` as it comes out. `KHZ_BLESS=1` writes the latter.

use super::check;
use khz_frontend::format::FormatOptions;
use std::path::Path;

#[test]
fn golden_files() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/format/golden");
    #[expect(clippy::disallowed_methods, reason = "the developer's wish to write the files anew")]
    let bless = std::env::var("KHZ_BLESS").is_ok();
    let mut seen = 0;
    let mut wrong = Vec::new();
    for entry in std::fs::read_dir(&folder).expect("the golden files") {
        let path = entry.expect("a folder that can be listed").path();
        if path.extension().is_none_or(|ending| ending != "st") {
            continue;
        }
        seen += 1;
        let text = std::fs::read_to_string(&path).expect("a text");
        let name = path.display().to_string();
        let formatted = check(&name, &text, &FormatOptions::default());
        let golden = path.with_extension("expected");
        if bless {
            std::fs::write(&golden, &formatted).expect("the golden file can be written");
        }
        let expected = std::fs::read_to_string(&golden).unwrap_or_default();
        if formatted != expected {
            wrong.push(format!("{name}:\n----- expected\n{expected}\n----- formatted\n{formatted}"));
        }
    }
    assert!(seen >= 6, "{} holds too few files", folder.display());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
