//! `docs/verifier.md`, generated from the rule table.

use super::rules::{Rule, RuleGroup};

/// The text of `docs/verifier.md`.
#[must_use]
pub fn rules_document() -> String {
    let mut text = String::from(
        "# Rules of the verifier\n\nGenerated from `bytecode/src/verify/rules.rs`: `KHZ_BLESS=1 cargo test -p khz-bytecode`. What is proved in which order, and\n\
         why that is enough, stands at the head of `bytecode/src/verify/mod.rs`; each rule has at least one rejected file in `bytecode/tests/verifier/`.\n\
         `khz explain V0001` prints one of them.\n",
    );
    for group in RuleGroup::ALL {
        text += &format!("\n## {}\n\n| rule | demands | because |\n|---|---|---|\n", group.title());
        for rule in Rule::ALL.iter().filter(|rule| rule.group() == *group) {
            text += &format!("| {rule} | {} | {} |\n", escape(rule.title()), escape(rule.explanation()));
        }
    }
    text
}

/// A bar would end the table cell.
fn escape(text: &str) -> String {
    text.replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_is_fresh() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/verifier.md");
        let expected = rules_document();
        if std::env::var_os("KHZ_BLESS").is_some() {
            std::fs::write(&path, &expected).unwrap();
        }
        let committed = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(committed == expected, "docs/verifier.md is stale: KHZ_BLESS=1 cargo test -p khz-bytecode");
    }
}
