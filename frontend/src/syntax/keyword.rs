//! The reserved words: one table.
//!
//! A word is reserved only if the grammar could not do without it. Words with a meaning in one place only (`TASK`,
//! `WITH`, `ON`, `AT`, `RETAIN`, `R_EDGE`, `SINGLE`, `STEP`, the instruction list operators, the names of types and
//! standard functions …) are ordinary identifiers that the parser compares where they can occur.

/// Declares the reserved words, sorted.
macro_rules! keywords {
    ($($name:ident = $text:literal),* $(,)?) => {
        /// A reserved word.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Keyword {
            $(#[doc = concat!("`", $text, "`.")] $name),*
        }

        impl Keyword {
            /// All reserved words, sorted by their text.
            pub const ALL: &[Keyword] = &[$(Keyword::$name),*];

            /// The word in upper case.
            pub fn text(self) -> &'static str {
                match self {
                    $(Self::$name => $text),*
                }
            }
        }
    };
}

keywords! {
    And = "AND",
    AndThen = "AND_THEN",
    Array = "ARRAY",
    By = "BY",
    Case = "CASE",
    Configuration = "CONFIGURATION",
    Constant = "CONSTANT",
    Continue = "CONTINUE",
    Do = "DO",
    Else = "ELSE",
    Elsif = "ELSIF",
    EndCase = "END_CASE",
    EndConfiguration = "END_CONFIGURATION",
    EndFor = "END_FOR",
    EndFunction = "END_FUNCTION",
    EndFunctionBlock = "END_FUNCTION_BLOCK",
    EndIf = "END_IF",
    EndProgram = "END_PROGRAM",
    EndRepeat = "END_REPEAT",
    EndResource = "END_RESOURCE",
    EndStruct = "END_STRUCT",
    EndType = "END_TYPE",
    EndUnion = "END_UNION",
    EndVar = "END_VAR",
    EndWhile = "END_WHILE",
    Exit = "EXIT",
    False = "FALSE",
    For = "FOR",
    Function = "FUNCTION",
    FunctionBlock = "FUNCTION_BLOCK",
    If = "IF",
    Mod = "MOD",
    Not = "NOT",
    Of = "OF",
    Or = "OR",
    OrElse = "OR_ELSE",
    Program = "PROGRAM",
    Repeat = "REPEAT",
    Return = "RETURN",
    Struct = "STRUCT",
    Then = "THEN",
    To = "TO",
    True = "TRUE",
    Type = "TYPE",
    Union = "UNION",
    Until = "UNTIL",
    Var = "VAR",
    VarAccess = "VAR_ACCESS",
    VarConfig = "VAR_CONFIG",
    VarExternal = "VAR_EXTERNAL",
    VarGlobal = "VAR_GLOBAL",
    VarInput = "VAR_INPUT",
    VarInOut = "VAR_IN_OUT",
    VarOutput = "VAR_OUTPUT",
    VarTemp = "VAR_TEMP",
    While = "WHILE",
    Xor = "XOR",
}

impl Keyword {
    /// The length of the longest reserved word, in bytes.
    const MAX_LEN: usize = 18;

    /// The reserved word of this text in any case.
    pub fn lookup(text: &str) -> Option<Keyword> {
        let mut buffer = [0; Self::MAX_LEN];
        let upper = buffer.get_mut(..text.len())?;
        upper.copy_from_slice(text.as_bytes());
        upper.make_ascii_uppercase();
        let upper: &[u8] = upper;
        let found = Self::ALL.binary_search_by(|word| word.text().as_bytes().cmp(upper)).ok()?;
        Self::ALL.get(found).copied()
    }

    /// Whether a statement can begin with it.
    pub fn starts_statement(self) -> bool {
        matches!(
            self,
            Self::If | Self::Case | Self::For | Self::While | Self::Repeat | Self::Exit | Self::Continue | Self::Return
        )
    }

    /// Whether it begins a declaration at the top level of a file (VAR_GLOBAL apart).
    pub fn starts_declaration(self) -> bool {
        matches!(self, Self::Type | Self::Program | Self::Function | Self::FunctionBlock | Self::Configuration)
    }

    /// Whether it begins a variable section.
    pub fn starts_section(self) -> bool {
        matches!(
            self,
            Self::Var
                | Self::VarAccess
                | Self::VarConfig
                | Self::VarExternal
                | Self::VarGlobal
                | Self::VarInput
                | Self::VarInOut
                | Self::VarOutput
                | Self::VarTemp
        )
    }

    /// Whether it ends a program organisation unit.
    pub fn ends_pou(self) -> bool {
        matches!(self, Self::EndProgram | Self::EndFunction | Self::EndFunctionBlock)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sorted_and_each_word_is_found() {
        assert!(Keyword::ALL.windows(2).all(|pair| pair[0].text() < pair[1].text()));
        assert_eq!(Keyword::ALL.iter().map(|word| word.text().len()).max(), Some(Keyword::MAX_LEN));
        for &word in Keyword::ALL {
            assert_eq!(Keyword::lookup(word.text()), Some(word));
            assert_eq!(Keyword::lookup(&word.text().to_ascii_lowercase()), Some(word));
        }
    }

    #[test]
    fn words_of_one_place_are_not_reserved() {
        for text in [
            "STEP",
            "TASK",
            "WITH",
            "ON",
            "R_EDGE",
            "SINGLE",
            "RETAIN",
            "LD",
            "INT",
            "",
            "ENDPROGRAMMEANDMORE",
            "größe",
        ] {
            assert_eq!(Keyword::lookup(text), None, "{text}");
        }
    }
}
