//! Names as small numbers: comparing two names is comparing two `u32`s.

/// An interned text. Symbols of one [`Interner`] are equal exactly if their texts are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Symbol(u32);

impl Symbol {
    /// The empty text: a name that is missing from the source.
    pub const MISSING: Symbol = Symbol(0);

    /// The symbol as an index, for tables beside the interner.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Finds the symbol of a text.
#[expect(clippy::disallowed_types, reason = "looked up once a name and never iterated, so its order reaches no result")]
type Index = std::collections::HashMap<Box<str>, Symbol>;

/// The table of names. Identifiers are case-insensitive in IEC 61131-3 (6.1.2), so each text knows its folded form:
/// upper case, as the standard writes its own names.
#[derive(Debug)]
pub struct Interner {
    texts: Vec<Box<str>>,
    folded: Vec<Symbol>,
    /// Of a folded symbol, its spelling in the sources that came first.
    written: Vec<Symbol>,
    index: Index,
}

impl Default for Interner {
    fn default() -> Self {
        let mut new = Self { texts: Vec::new(), folded: Vec::new(), written: Vec::new(), index: Index::new() };
        new.add("", None);
        new
    }
}

impl Interner {
    /// The symbol of exactly this spelling.
    pub fn intern(&mut self, text: &str) -> Symbol {
        if let Some(&symbol) = self.index.get(text) {
            return symbol;
        }
        if text.bytes().all(|byte| !byte.is_ascii_lowercase()) {
            return self.add(text, None);
        }
        let upper = text.to_ascii_uppercase();
        let folded = match self.index.get(upper.as_str()) {
            Some(&symbol) => symbol,
            None => self.add(&upper, None),
        };
        self.add(text, Some(folded))
    }

    /// The symbol of the text regardless of case: what identifiers are compared by.
    pub fn intern_folded(&mut self, text: &str) -> Symbol {
        let symbol = self.intern(text);
        self.fold(symbol)
    }

    /// The folded symbol of a name, if it occurs at all. For looking up a name that comes from outside the sources.
    pub fn lookup_folded(&self, text: &str) -> Option<Symbol> {
        self.index.get(text.to_ascii_uppercase().as_str()).copied()
    }

    /// The case-folded form of a symbol.
    pub fn fold(&self, symbol: Symbol) -> Symbol {
        self.folded.get(symbol.index()).copied().unwrap_or(Symbol::MISSING)
    }

    /// The text of a symbol: as written, or in upper case if the symbol is a folded one.
    pub fn text(&self, symbol: Symbol) -> &str {
        self.texts.get(symbol.index()).map_or("", |text| text)
    }

    /// The text of a name as the sources first write it, for messages.
    pub fn text_as_written(&self, symbol: Symbol) -> &str {
        self.text(self.written.get(symbol.index()).copied().unwrap_or(symbol))
    }

    /// How many symbols there are.
    pub fn len(&self) -> usize {
        self.texts.len()
    }

    /// Whether there is no symbol but the missing one.
    pub fn is_empty(&self) -> bool {
        self.texts.len() <= 1
    }

    fn add(&mut self, text: &str, folded: Option<Symbol>) -> Symbol {
        // Sources are capped in bytes (see `source`), so the count of names fits by far.
        let symbol = Symbol(u32::try_from(self.texts.len()).unwrap_or(u32::MAX));
        self.texts.push(text.into());
        self.folded.push(folded.unwrap_or(symbol));
        self.written.push(symbol);
        if let Some(written) = folded.and_then(|folded| self.written.get_mut(folded.index()))
            && Some(*written) == folded
        {
            *written = symbol;
        }
        self.index.insert(text.into(), symbol);
        symbol
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn case_is_folded_and_spelling_kept() {
        let mut names = Interner::default();
        let first = names.intern("Motor_1");
        let second = names.intern("MOTOR_1");
        let third = names.intern("motor_1");
        assert_ne!(first, third);
        assert_eq!(names.fold(first), second);
        assert_eq!(names.fold(third), second);
        assert_eq!(names.fold(second), second);
        assert_eq!(names.text(first), "Motor_1");
        assert_eq!(names.intern_folded("mOTOR_1"), second);
        assert_eq!(names.lookup_folded("motor_1"), Some(second));
        assert_eq!(names.lookup_folded("other"), None);
        assert_eq!(names.text_as_written(second), "Motor_1");
    }

    #[test]
    fn missing_is_the_empty_name() {
        let names = Interner::default();
        assert_eq!(names.text(Symbol::MISSING), "");
        assert!(names.is_empty());
    }
}
