//! Pragmas: `{attribute 'name' := 'value'}` belongs to the declaration that follows it, everything else to nothing.

use super::Parser;
use crate::diagnostics::{Diagnostic, syntax as rules};
use crate::source::Span;
use crate::syntax::ast::{Attribute, Pragma};

impl Parser<'_> {
    /// Takes the pragmas that stand right before the current token: the attributes of the declaration that begins here.
    ///
    /// ```text
    /// attributes = { '{' 'attribute' string [ ':=' string ] '}' }
    /// ```
    pub(super) fn attributes(&mut self) -> Vec<Attribute> {
        let mut attributes = Vec::new();
        while let Some(&(anchor, token)) = self.pragmas.get(self.next_pragma) {
            if anchor > self.pos {
                break;
            }
            self.next_pragma += 1;
            let span = Span::new(self.file, token.start, token.end);
            match self.read_attribute(span) {
                Some(attribute) if anchor == self.pos => attributes.push(attribute),
                Some(attribute) => self.report_loose_attribute(&attribute),
                None => {}
            }
        }
        attributes
    }

    /// Attributes before something that cannot have any.
    pub(super) fn drop_attributes(&mut self, attributes: Vec<Attribute>) {
        for attribute in attributes {
            self.report_loose_attribute(&attribute);
        }
    }

    /// Takes what is left at the end of the file.
    pub(super) fn finish_pragmas(&mut self) {
        while self.next_pragma < self.pragmas.len() {
            self.pos = self.tokens.len().saturating_sub(1);
            let attributes = self.attributes();
            self.drop_attributes(attributes);
        }
    }

    fn report_loose_attribute(&mut self, attribute: &Attribute) {
        let message = format!("the attribute '{}' stands before nothing that can have it", attribute.name);
        self.push(Diagnostic::new(&rules::LOOSE_ATTRIBUTE, attribute.span, message));
        self.keep_loose(attribute.span);
    }

    fn keep_loose(&mut self, span: Span) {
        let text = pragma_text(self.slice(span)).to_owned();
        self.loose_pragmas.push(Pragma { text, span });
    }

    /// Reads the text of a pragma. One that is no attribute is kept among the loose ones.
    fn read_attribute(&mut self, span: Span) -> Option<Attribute> {
        const WORD: &str = "attribute";
        let text = pragma_text(self.slice(span)).trim();
        let is_attribute = text.get(..WORD.len()).is_some_and(|word| word.eq_ignore_ascii_case(WORD));
        let rest = text.get(WORD.len()..).unwrap_or("");
        if !is_attribute || !rest.starts_with(|next: char| next.is_whitespace() || next == '\'') {
            self.keep_loose(span);
            return None;
        }
        let parsed = parse_attribute(rest);
        if parsed.is_none() {
            let found = Diagnostic::new(&rules::BAD_ATTRIBUTE, span, "this attribute cannot be read");
            self.push(found.help("write `{attribute 'name'}` or `{attribute 'name' := 'value'}`"));
            self.keep_loose(span);
        }
        parsed.map(|(name, value)| Attribute { name, value, span })
    }
}

/// What stands between the braces.
fn pragma_text(pragma: &str) -> &str {
    pragma.strip_prefix('{').unwrap_or(pragma).strip_suffix('}').unwrap_or(pragma)
}

/// `'name'` or `'name' := 'value'`.
fn parse_attribute(text: &str) -> Option<(String, Option<String>)> {
    let (name, rest) = quoted(text)?;
    if rest.trim().is_empty() {
        return Some((name, None));
    }
    let (value, rest) = quoted(rest.trim_start().strip_prefix(":=")?)?;
    rest.trim().is_empty().then_some((name, Some(value)))
}

/// A quoted text and what follows it.
fn quoted(text: &str) -> Option<(String, &str)> {
    let (inside, rest) = text.trim_start().strip_prefix('\'')?.split_once('\'')?;
    Some((inside.trim().to_owned(), rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_read_with_and_without_value() {
        assert_eq!(parse_attribute(" 'startup' "), Some(("startup".to_owned(), None)));
        let watchdog = Some(("watchdog".to_owned(), Some("T#10ms".to_owned())));
        assert_eq!(parse_attribute("'watchdog':='T#10ms'"), watchdog);
        assert_eq!(parse_attribute("'watchdog' = 'T#10ms'"), None);
        assert_eq!(parse_attribute("startup"), None);
        assert_eq!(parse_attribute("'a' := 'b' c"), None);
    }
}
